"""Coverage counts what was seen by when, sticking counts steps that changed nothing, and a command resumes its walks."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rich.console import Console

from openmap_eval.exploration.command import EvalExploration
from openmap_eval.exploration.report import run_eval_exploration
from openmap_eval.exploration.walk import Walked, WalkSettings, floor_area, longest_loitering, longest_still
from openmap_scenes import DataError


def test_a_run_without_moving_or_turning_is_counted_and_turning_on_the_spot_is_loitering():
    poses = (
        [(0.0, 0.0, 0.0)] * 4
        + [(0.0, 0.0, 0.26 * k) for k in range(1, 7)]
        + [(0.25 * k, 0.0, 0.0) for k in range(1, 9)]
    )
    assert longest_still(np.array(poses)) == 3
    assert longest_loitering(np.array(poses), 0) == 10
    assert longest_loitering(np.array(poses), 8) == 2


def test_coverage_grows_with_steps():
    walked = Walked(
        "x", 0, 60.0, 30, True, {"1": 0, "2": 20, "3": -1}, {"1": "bed", "2": "cup", "3": "jar"},
        {"1": 50, "2": 30, "3": 4}, 0, 0, 1.0,
    )  # fmt: skip
    assert [walked.coverage(n) for n in (0, 19, 20)] == pytest.approx([1 / 3, 1 / 3, 2 / 3])
    assert walked.missed == ["jar (4 px)"]


def test_thresholds_shrink_with_the_picture():
    assert WalkSettings(pixels=400, width=160, height=120).enough == 25


def test_the_floor_is_that_of_the_rooms(toy_scene, toy_surface):
    assert floor_area(toy_scene, toy_surface) == pytest.approx(48.0, abs=1.0)


def test_walks_are_measured_kept_and_not_walked_again(toy_specs, tmp_path, monkeypatch):
    command = EvalExploration(tmp_path, scene=(toy_specs[0],), max_steps=60, width=80, height=60)
    run_eval_exploration(command, Console(quiet=True))
    document = json.loads((tmp_path / "exploration.json").read_text())
    (walk,) = document["walks"]
    assert 0.0 < walk["in_budget"] <= 1.0
    assert walk["steps"] <= 60
    assert len(walk["seen_at"]) >= 8
    assert (tmp_path / "coverage.png").stat().st_size > 1000
    kept = (tmp_path / "walks.jsonl").read_bytes()
    monkeypatch.setattr("openmap_eval.exploration.report.simulator_of", None)
    run_eval_exploration(command, Console(quiet=True))
    assert (tmp_path / "walks.jsonl").read_bytes() == kept
    with pytest.raises(DataError, match="other settings"):
        run_eval_exploration(EvalExploration(tmp_path, scene=(toy_specs[0],), max_steps=61), Console(quiet=True))


@pytest.mark.parametrize("wrong", [{}, {"scene": ("a",), "split": "homes/val"}, {"split": "homes/val", "pixels": 0}])
def test_a_command_that_makes_no_sense_is_one_error(wrong, tmp_path):
    with pytest.raises(DataError):
        run_eval_exploration(EvalExploration(tmp_path, **wrong), Console(quiet=True))
