"""Figures of grounding alone: by hand on small cases, and through the command on a small home."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from openmap_env.episodes import Episode
from openmap_env.episodes.episode import target_of
from openmap_eval.grounding.command import EvalGrounding
from openmap_eval.grounding.measure import Outcome, auroc, threshold_curve
from openmap_eval.grounding.questions import Asked, absent_from, is_absent
from openmap_scenes import DataError, Scene


def outcome(absent: bool, rank: int | None, confidence: float) -> Outcome:
    return Outcome("home", "object_goal", "?", absent, rank, confidence, confidence > 0.1, "", "", None)


def test_auroc_by_hand() -> None:
    # Pairs (there, not there): .9 > .4, .9 > .9 half, .5 > .4, .5 < .9.
    assert auroc([0.9, 0.5], [0.4, 0.9]) == pytest.approx((1 + 0.5 + 1 + 0) / 4)
    assert np.isnan(auroc([], [0.5]))


def test_threshold_by_hand() -> None:
    outcomes = [outcome(False, 1, 0.9), outcome(False, 1, 0.3), outcome(False, 2, 0.8), outcome(True, None, 0.4)]
    low, high = threshold_curve(outcomes, np.array([0.0, 0.5]))
    assert low == {"confidence": 0.0, "sr": pytest.approx(2 / 3), "false_answers": 1.0}
    assert high == {"confidence": 0.5, "sr": pytest.approx(1 / 3), "false_answers": 0.0}


def question(scene: Scene, number: int) -> Episode:
    thing = scene.instances[number]
    return Episode(
        str(number), "home", f"Find the {thing.category}.", "object_goal", (0, 0, 0), 0.0, (target_of(thing),)
    )


def emptied(scene: Scene, category: str) -> Scene:
    """The scene with things of a category called "vase"."""
    renamed = [replace(i, category="vase") if i.category == category else i for i in scene.instances]
    return replace(scene, instances=renamed)


def test_what_is_absent_is_absent_and_what_is_here_is_not(toy_scene: Scene) -> None:
    number = next(
        n for n, i in enumerate(toy_scene.instances) if i.category not in ("wall", "floor", "ceiling", "vase")
    )
    category = toy_scene.instances[number].category
    episode, other = question(toy_scene, number), emptied(toy_scene, category)
    assert not is_absent(episode, toy_scene, toy_scene)
    assert is_absent(episode, toy_scene, other)


def test_absent_questions_do_not_depend_on_the_order_of_scenes(toy_scene: Scene) -> None:
    number = next(
        n for n, i in enumerate(toy_scene.instances) if i.category not in ("wall", "floor", "ceiling", "vase")
    )
    here = Asked("a", emptied(toy_scene, toy_scene.instances[number].category), [])
    others = [Asked(name, toy_scene, [question(toy_scene, number)]) for name in ("b", "c", "d")]
    drawn = absent_from(here, others, 2, 0)
    assert len(drawn) == 2
    assert drawn == absent_from(here, others[::-1], 2, 0)
    assert absent_from(others[0], others[1:], 2, 0) == []


def test_the_command(toy_specs: list[str], tmp_path: Path) -> None:
    command = EvalGrounding(tmp_path / "out", scene=(toy_specs[0],), episodes=3)
    command.run(Console(quiet=True))
    written = json.loads((tmp_path / "out" / "grounding.json").read_text())
    assert set(written["success"]) == {"both rounds", "no select", "no parse", "neither"}
    assert written["success"]["both rounds"]["all"]["sr_16"]["value"] > 0
    assert (tmp_path / "out" / "threshold.png").read_bytes().startswith(b"\x89PNG")
    assert {q["absent"] for q in written["questions"]} == {False}


def test_bad_command_lines(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="neither"):
        EvalGrounding(tmp_path).run(Console(quiet=True))
    with pytest.raises(DataError, match="at least 1"):
        EvalGrounding(tmp_path, scene=("x",), episodes=0).run(Console(quiet=True))
