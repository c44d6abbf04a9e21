"""Instructions as people give them, on a hand-built home: does the interpreter mean the thing that they mean?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openmap_agents.grounding import Grounder
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_agents.perception.text import TextEncoder

HOME: dict[str, Any] = json.loads((Path(__file__).parents[1] / "data" / "grounding_home.json").read_text())
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
    corners = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), -1).reshape(-1, 3)
    return InstanceMap(
        [
            MapInstance(
                id=thing["id"],
                points=(np.array(thing["centre"]) + corners * thing["size"]).astype(np.float32),
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
    assert grounding.choice in case["targets"], json.dumps(grounding.trace, indent=1)[:3000]
    assert sorted(grounding.ranking) == sorted(thing["id"] for thing in HOME["things"])
