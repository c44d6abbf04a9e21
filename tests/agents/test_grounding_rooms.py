"""Walls part a map into rooms; where they part nothing, no room is claimed."""

import numpy as np

from openmap_agents.grounding.rooms import rooms_of
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance


def block(number: int, low: tuple[float, float, float], high: tuple[float, float, float]) -> MapInstance:
    axes = [np.linspace(a, b, max(2, int((b - a) / 0.05) + 1)) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)
    return MapInstance(number, points, None)


def house(doorway: float) -> tuple[InstanceMap, np.ndarray]:
    """Two rooms of 4 m x 4 m side by side, a doorway in the wall between them, a thing in each and one on a wall."""
    edge = 2 - doorway / 2
    walls = [
        block(1, (0, 0, 0), (8, 2.6, 0.05)),
        block(2, (0, 0, 4), (8, 2.6, 4.05)),
        block(3, (0, 0, 0), (0.05, 2.6, 4)),
        block(4, (8, 0, 0), (8.05, 2.6, 4)),
        block(5, (4, 0, 0), (4.05, 2.6, edge)),
        block(6, (4, 0, 4 - edge), (4.05, 2.6, 4)),
    ]
    things = [
        block(7, (1.5, 0, 1.5), (2.5, 0.5, 2.5)),
        block(8, (5.5, 0, 1.5), (6.5, 0.5, 2.5)),
        block(9, (1.5, 1, 0), (2.5, 1.8, 0.02)),
    ]
    return InstanceMap([*walls, *things]), np.arange(9) < 6


def test_a_doorway_parts_and_a_picture_hangs_in_its_room() -> None:
    rooms = rooms_of(*house(doorway=0.9))
    assert rooms[6] > 0
    assert rooms[7] > 0
    assert rooms[6] != rooms[7]
    assert rooms[8] == rooms[6]


def test_an_open_side_parts_nothing() -> None:
    assert not rooms_of(*house(doorway=2.6)).any()


def test_nothing_known() -> None:
    instance_map, _ = house(doorway=0.9)
    assert not rooms_of(instance_map, np.zeros(9, bool)).any()
    assert not len(rooms_of(InstanceMap([]), np.zeros(0, bool)))


def test_a_point_gone_astray_costs_no_memory() -> None:
    instance_map, walls = house(doorway=0.9)
    astray = block(10, (90_000, 1, 90_000), (90_000.1, 1.1, 90_000.1))
    assert not rooms_of(InstanceMap([*instance_map.instances, astray]), np.append(walls, True)).any()
