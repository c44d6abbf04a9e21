"""The benchmark of the environment: it measures what it says, and the same walks each time."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import make_toy_scene
from rich.console import Console

from openmap_eval.bench.env import ROWS, Env
from openmap_eval.bench.env_child import FORWARD_HEAVY, WARM_UP, walks
from openmap_scenes.formats.export import export_scene


def test_every_row_is_measured_and_written_beside_the_machine(tmp_path):
    export_scene(make_toy_scene(), tmp_path / "toy.glb")
    scene, out = f"file:{tmp_path / 'toy.glb'}", tmp_path / "env.json"
    console = Console(record=True, width=200)
    Env(
        scene=scene, sizes=("24x16",), steps=15, repeats=1, leak=True, leak_scenes=(scene, scene), leak_frames=20,
        leak_switches=3, out=out,
    ).run(console)  # fmt: skip
    result = json.loads(out.read_text())
    assert result["machine"]["cores"] >= 1
    rows = result["sizes"]["24x16"]
    assert list(rows) == list(ROWS)
    assert all(figures["steps_per_second"] > 0.0 for figures in rows.values())
    assert rows["one"]["times_one"] == 1.0
    assert 0.0 < rows["one"]["not_rendering"] < 1.0
    assert rows["two, ours"]["worker_pss_mib"] > 0.0
    assert result["leak"]["24x16"]["frames"] == 20
    assert result["leak"]["24x16"]["switches"] == 4
    text = console.export_text()
    assert all(row in text for row in ROWS)


def test_walks_follow_from_the_seed_and_mostly_go_forward():
    settings = {"seed": 3, "walks": 2, "steps": 2000}
    first, second = walks(settings)
    assert len(first) == WARM_UP + 2000
    np.testing.assert_array_equal(walks(settings)[1], second)
    assert (first != second).any()
    assert (walks({**settings, "seed": 4})[0] != first).any()
    assert np.mean(first == 1) == pytest.approx(FORWARD_HEAVY[1], abs=0.05)
    assert 0 not in first


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(ValueError, match="'640', expected width x height"):
        Env(sizes=("640",)).run(Console())
    with pytest.raises(ValueError, match="0 steps; expected 1 or more"):
        Env(steps=0).run(Console())
