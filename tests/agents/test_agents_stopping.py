"""Exploration ends early where the answer is settled, and the body stands where it sees what it was sent for."""

from __future__ import annotations

import numpy as np
import pytest

from openmap_agents.exploration import OccupancyMap, Walker, standing_place
from openmap_agents.grounding import Grounding
from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.stopping import EarlyStop, StopSettings


def a_map(frames):
    views = np.array([[frame, 1, 900] for frame in range(frames)], np.int32)
    return InstanceMap([MapInstance(1, np.ones((4, 3), np.float32), None, views=views)])


def answer(confidence, **description):
    return Grounding([1], 1, confidence, {"description": description})


PLAIN = {"target": {"phrase": "bed"}}


def test_it_stops_once_the_same_answer_came_twice_and_never_when_off():
    early = EarlyStop(StopSettings(confidence=0.7, every=10))
    assert not early.due(9)
    assert early.due(10)
    assert not early.settled(answer(0.9, **PLAIN), a_map(5), 10)
    assert not early.due(19)
    assert early.settled(answer(0.9, **PLAIN), a_map(5), 20)
    assert early.asked == 2
    assert not EarlyStop(StopSettings()).due(1000)


@pytest.mark.parametrize(
    ("confidence", "frames", "description"),
    [
        (0.6, 5, PLAIN),
        (0.9, 2, PLAIN),
        (0.99, 5, {"target": {"phrase": "bed", "superlative": "largest"}}),
        (0.99, 5, {"target": {"phrase": "bed", "ordinal": 2}}),
        (0.8, 5, {"needs": ["I am tired"]}),
        (0.8, 5, {"target": {"phrase": "bed", "relations": [{"name": "near"}]}}),
        (0.8, 5, {"target": {"phrase": "bed"}, "route": [{"motion": "leave", "room": "hallway"}]}),
        (0.99, 5, {"target": {"phrase": "bed", "relations": [{"name": "near", "negated": True}]}}),
        (0.99, 5, {"target": {"phrase": "bed", "relations": [{"name": "closest"}]}}),
        (0.99, 5, {"needs": ["I am tired"], "avoid": [{"phrase": "sofa"}]}),
    ],
)
def test_it_goes_on_while_something_better_may_come(confidence, frames, description):
    early = EarlyStop(StopSettings(confidence=0.7))
    assert not any(early.settled(answer(confidence, **description), a_map(frames), 10 * k) for k in range(1, 6))


def test_a_relation_needs_more_confidence_than_a_name():
    early = EarlyStop(StopSettings(confidence=0.7))
    assert early.needed({"target": {"phrase": "bed"}}) == pytest.approx(0.7)
    assert early.needed({"target": {"phrase": "bed", "relations": [{"name": "near"}]}}) == pytest.approx(0.85)


def test_the_body_stands_on_the_side_of_the_wall_from_which_the_thing_is_seen():
    occupancy = OccupancyMap()
    occupancy.passes[150:250, 150:250] = 5
    wall = np.s_[200:202, 150:230]  # along x at z = 0, open at its right end
    occupancy.hits[wall], occupancy.top[wall] = 5, 2.4
    cabinet = np.s_[202:210, 150:230]  # low, along the wall's far side: this side of the wall is nearer
    occupancy.hits[cabinet], occupancy.top[cabinet] = 5, 0.8
    walker = Walker(occupancy)
    walker.x, walker.z = -1.0, -1.0
    points = np.array([[-1.0, 1.0, 0.15], [-0.8, 1.2, 0.15]])  # hangs on the far side of it
    found = standing_place(occupancy, walker.ways(), points)
    assert found is not None
    (row, _), seen = found
    assert seen
    assert row > 210
