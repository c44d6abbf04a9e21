"""Forty instructions as people say them, in one home that does not change, and how many of them are understood."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openmap_agents.baselines.true_map import true_map
from openmap_agents.grounding import Grounder, Grounding
from openmap_agents.mapping import InstanceMap
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import Scene, load_scene
from openmap_scenes.homes.library import FOLDER_VARIABLE, furniture_folder

HOME = "homes:val/0"
PEOPLE: list[dict[str, Any]] = [
    json.loads(line)
    for line in (Path(__file__).parents[1] / "data" / "people.jsonl").read_text(encoding="utf-8").splitlines()
]
REACH = 1.0
"""m between centres within which a declared place counts, as in SR."""
PASSES = 26
"""Instructions that must be answered by a place within reach of what is meant, or by none where it is absent."""
EXACT = 22
"""Instructions whose very thing must be first; fewer, since within reach of what is meant stand other things too."""

needs_library = pytest.mark.skipif(
    not list(furniture_folder().glob("*.sh3f")),
    reason=f"no furniture at {furniture_folder()}; install sweethome3d-furniture or set {FOLDER_VARIABLE}",
)


@pytest.fixture(scope="module")
def home() -> Scene:
    return load_scene(HOME)


def test_every_line_is_whole_and_said_once() -> None:
    assert len(PEOPLE) == 40
    assert len({p["id"] for p in PEOPLE}) == len({p["instruction"].casefold() for p in PEOPLE}) == 40
    for person in PEOPLE:
        assert set(person) == {"id", "instruction", "targets", "traits", "why"}
        assert all((person["instruction"].strip(), person["traits"], person["why"])), person["id"]
        assert len(set(person["targets"])) == len(person["targets"])
        assert bool(person["targets"]) != ("absent" in person["traits"]), person["id"]
    assert sum("absent" in p["traits"] for p in PEOPLE) == 4


@needs_library
def test_what_is_meant_stands_in_the_home(home: Scene) -> None:
    ids = {instance.id for instance in home.instances}
    for person in PEOPLE:
        assert set(person["targets"]) <= ids, person["id"]


@needs_library
def test_most_of_what_people_say_is_understood(home: Scene) -> None:
    encoder = TextEncoder()
    known, grounder = true_map(home, encoder), Grounder(encoder=encoder)
    answers = [(person, grounder.ground(person["instruction"], known)) for person in PEOPLE]
    missed = [p["instruction"] for p, answer in answers if not _within_reach(p["targets"], answer, known)]
    inexact = [p["instruction"] for p, answer in answers if not _exact(p["targets"], answer)]
    assert len(PEOPLE) - len(missed) >= PASSES, "\n".join(missed)
    assert len(PEOPLE) - len(inexact) >= EXACT, "\n".join(inexact)


def _within_reach(targets: list[int], answer: Grounding, known: InstanceMap) -> bool:
    """Whether the first of the ranking lies within reach of a target; whether nothing was chosen where there is none."""
    if not targets:
        return answer.choice is None
    first = known.get(answer.ranking[0]).centre
    return min(float(np.linalg.norm(first - known.get(t).centre)) for t in targets) <= REACH


def _exact(targets: list[int], answer: Grounding) -> bool:
    return answer.ranking[0] in targets if targets else answer.choice is None
