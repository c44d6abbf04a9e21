"""Instructions as people give them, on hand-built homes: is the thing chosen that they mean?

The sentences of ``grounding_needs.json`` were written before the table of uses, though by the same hand; settings were chosen on
every other one (the first, third, ...). Those that are not answered at once are listed here by name, so that a change in
either direction shows.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openmap_agents.grounding import Grounder
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_agents.perception.text import TextEncoder

DATA = Path(__file__).parents[1] / "data"
HOME: dict[str, Any] = json.loads((DATA / "grounding_home.json").read_text())
NEEDS: dict[str, Any] = json.loads((DATA / "grounding_needs.json").read_text())
STRUCTURE = ("wall", "wall", "floor", "ceiling")
CORNERS = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), -1).reshape(-1, 3)
NOT_UNDERSTOOD = ("what can I use to see myself in my new dress",)
NOT_AT_ONCE = (
    "It's pouring outside and I have to walk the dog.",
    "I can't find anything to put on for the party.",
    "Do you know a good spot for these tulips?",
    "I have half an hour before the meeting and feel like a little snooze.",
    "Where should this banana peel go?",
    "I would like to browse for cheap flights.",
    "Bring the leftovers from the office lunch back to temperature, please.",
    "Let's do something together with the children, it's a rainy Sunday.",
    "I'm parched.",
    "The soup tastes of nothing.",
)
RGB = {
    "white": (230, 230, 225),
    "grey": (140, 140, 140),
    "black": (30, 30, 30),
    "brown": (115, 80, 50),
    "red": (180, 40, 40),
    "blue": (50, 70, 160),
    "yellow": (225, 200, 70),
    "green": (60, 120, 60),
}


@pytest.fixture(scope="module")
def encoder() -> TextEncoder:
    return TextEncoder()


@pytest.fixture(scope="module")
def home(encoder: TextEncoder) -> InstanceMap:
    """The home as a mapper would hold it: corner points, the feature of the name, a mean colour."""
    return InstanceMap(
        [
            MapInstance(
                id=thing["id"],
                points=(np.array(thing["centre"]) + CORNERS * thing["size"]).astype(np.float32),
                feature=encoder.encode_text([thing["name"]])[0],
                colour=np.array(RGB[thing["colour"]], np.uint8),
            )
            for thing in HOME["things"]
        ]
    )


@pytest.fixture(scope="module")
def grounder(encoder: TextEncoder) -> Grounder:
    return Grounder(encoder=encoder)


@pytest.mark.parametrize("case", HOME["instructions"], ids=lambda case: case["text"][:60])
def test_the_choice_is_what_a_person_means(case: dict[str, Any], grounder: Grounder, home: InstanceMap) -> None:
    grounding = grounder.ground(case["text"], home)
    understood = grounding.choice in case["targets"]
    assert understood == (case["text"] not in NOT_UNDERSTOOD), json.dumps(grounding.trace, indent=1)[:3000]
    assert sorted(grounding.ranking) == sorted(thing["id"] for thing in HOME["things"])


@pytest.fixture(scope="module")
def furnished(encoder: TextEncoder) -> InstanceMap:
    """The larger home of the needs: things a step apart, room by room."""
    placed = [
        (name, (6.0 * (room % 4) + 0.9 * (k % 5), 0.6, 6.0 * (room // 4) + 0.9 * (k // 5)), 0.5)
        for room, things in enumerate(NEEDS["rooms"].values())
        for k, name in enumerate(n for n, count in things.items() for _ in range(count))
    ] + [(name, (9.0, 1.2, 9.0), 8.0) for name in STRUCTURE]
    return InstanceMap(
        [
            MapInstance(
                id=number,
                points=(np.array(centre) + CORNERS * size).astype(np.float32),
                feature=encoder.encode_text([name])[0],
                label=name,
            )
            for number, (name, centre, size) in enumerate(placed, start=1)
        ]
    )


def rank_of_the_first_that_serves(case: dict[str, Any], grounder: Grounder, home: InstanceMap) -> int:
    ranking = grounder.ground(case["text"], home).ranking
    return next(rank for rank, i in enumerate(ranking) if home.get(i).label in case["kinds"])


def test_needs_that_the_table_was_not_written_for(grounder: Grounder, furnished: InstanceMap) -> None:
    ranks = {case["text"]: rank_of_the_first_that_serves(case, grounder, furnished) for case in NEEDS["needs"]}
    assert {text for text, rank in ranks.items() if rank > 0} == set(NOT_AT_ONCE)
    assert not {text for text, rank in ranks.items() if rank >= 8}


def test_several_kinds_are_offered_for_a_need_and_one_for_a_name(grounder: Grounder, furnished: InstanceMap) -> None:
    def labels(instruction: str) -> list[str]:
        return [furnished.get(i).label for i in grounder.ground(instruction, furnished).ranking[:5]]

    assert labels("find a chair") == ["chair"] * 5
    assert len(set(labels("my legs are tired and I would like to sit down"))) >= 3


def test_other_names_of_a_thing_are_the_thing(grounder: Grounder, furnished: InstanceMap) -> None:
    for name, other in {"couch": "sofa", "weights": "dumbbells", "tv": "television", "bookcase": "bookshelf"}.items():
        choice = grounder.ground(f"find the {other}", furnished).choice
        assert choice is not None
        assert furnished.get(choice).label == name


def test_a_need_is_met_in_the_room_that_it_names(grounder: Grounder, home: InstanceMap) -> None:
    dining_chairs = {9, 10, 11, 12}
    assert set(grounder.ground("I want to sit down in the dining room", home).ranking[:3]) <= dining_chairs
    assert grounder.ground("It is too dark in the bedroom", home).choice == 29


@pytest.mark.parametrize("name", ["zeppelin", "submarine", "volcano", "cathedral", "windmill", "rollercoaster"])
def test_nothing_is_chosen_for_what_no_home_holds(name: str, grounder: Grounder, furnished: InstanceMap) -> None:
    assert grounder.ground(f"find the {name}", furnished).choice is None


def test_features_that_are_half_noise_still_lead_to_a_choice(
    encoder: TextEncoder, grounder: Grounder, furnished: InstanceMap
) -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(len(furnished), encoder.dim)) / np.sqrt(encoder.dim)
    blurred = InstanceMap(
        [
            replace(i, feature=(i.feature + 1.5 * n).astype(np.float32))
            for i, n in zip(furnished, noise, strict=True)
            if i.feature is not None
        ]
    )
    names = sorted({i.label for i in furnished} - set(STRUCTURE))
    chosen = [grounder.ground(f"find the {name}", blurred).choice for name in names]
    right = [c is not None and blurred.get(c).label == name for c, name in zip(chosen, names, strict=True)]
    assert sum(c is None for c in chosen) <= 0.05 * len(names)
    assert sum(right) >= 0.9 * len(names)
