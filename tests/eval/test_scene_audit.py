"""What a scene is held to: solids apart, rooms open, things to be seen."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest

from openmap_env.navigation import NavigableSurface
from openmap_eval.scene_audit import ENOUGH_PIXELS, best_views, clashes, look_at, things, unreachable_rooms
from openmap_scenes import Instance, Material, Room, Scene

Box = tuple[str, tuple[float, float, float], tuple[float, float, float]]
FLOOR: Box = ("floor", (-3.0, 0.0, -3.0), (3.0, 0.0, 3.0))
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def scene_of(*boxes: Box, rooms: list[Room] | None = None) -> Scene:
    """Boxes as one scene, each one an instance, in the order given; ids from 1."""
    vertices, faces, ids, instances = [], [], [], []
    for k, (category, low, high) in enumerate(boxes):
        a, b = np.array(low), np.array(high)
        vertices.append(a + _CORNERS * (b - a))
        quads = np.array(_QUADS) + 8 * k
        faces.append(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
        ids.append(np.full(12, k + 1))
        instances.append(Instance(k + 1, category, (a + b) / 2, a, b))
    return Scene(
        name="boxes",
        vertices=np.concatenate(vertices).astype(np.float32),
        faces=np.concatenate(faces).astype(np.int32),
        face_material=np.zeros(12 * len(boxes), np.int32),
        face_instance=np.concatenate(ids).astype(np.int32),
        materials=[Material("grey", np.full(3, 0.5, np.float32))],
        instances=instances,
        rooms=rooms or [],
    )


@pytest.mark.parametrize(
    ("second", "clash"),
    [
        (((1.0, 0.0, 0.0), (2.0, 1.0, 1.0)), False),
        (((0.995, 0.0, 0.0), (2.0, 1.0, 1.0)), False),
        (((0.95, 0.2, 0.2), (2.0, 0.8, 0.8)), True),
        (((0.95, 0.0, 0.0), (2.0, 1.0, 1.0)), True),
        (((0.3, 0.3, 0.3), (0.6, 0.6, 0.6)), True),
        (((0.2, 1.0, 0.2), (0.8, 1.5, 0.8)), False),
        (((0.2, 0.9, 0.2), (0.8, 1.5, 0.8)), True),
    ],
    ids=[
        "beside",
        "half a centimetre in",
        "five centimetres in",
        "five in, edges aligned",
        "inside",
        "on top",
        "sunk in",
    ],
)
def test_solids_clash_only_where_one_reaches_into_the_other_by_more_than_a_centimetre(
    second: tuple[tuple[float, float, float], tuple[float, float, float]], clash: bool
) -> None:
    scene = scene_of(("chest", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), ("box", *second))
    assert bool(clashes(scene)) == clash


def test_what_goes_through_a_wall_clashes_and_what_stands_before_it_does_not() -> None:
    wall: Box = ("wall", (0.0, 0.0, -2.0), (0.0, 2.5, 2.0))
    through = scene_of(wall, ("shelf", (-0.05, 1.0, 0.0), (0.3, 1.1, 1.0)))
    assert [c.second.category for c in clashes(through)] == ["shelf"]
    assert not clashes(scene_of(wall, ("shelf", (-0.004, 1.0, 0.0), (0.3, 1.1, 1.0))))


def test_parts_of_the_building_may_meet() -> None:
    assert not clashes(scene_of(("wall", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), ("door", (0.5, 0.5, 0.5), (2.0, 2.0, 2.0))))


def test_a_room_behind_a_closed_wall_is_told() -> None:
    def room(number: int, x0: float, x1: float) -> Room:
        return Room(number, f"room {number}", np.array([x0, 0.0, -3.0]), np.array([x1, 2.5, 3.0]))

    rooms = [room(1, -3.0, 1.0), room(2, 1.1, 3.0)]
    closed = scene_of(FLOOR, ("wall", (1.0, 0.0, -3.0), (1.1, 2.5, 3.0)), rooms=rooms)
    ajar = scene_of(FLOOR, ("wall", (1.0, 0.0, -3.0), (1.1, 2.5, 2.0)), rooms=rooms)
    assert [r.id for r in unreachable_rooms(closed, NavigableSurface.from_scene(closed))] == [2]
    assert unreachable_rooms(ajar, NavigableSurface.from_scene(ajar)) == []


def test_a_thing_on_the_floor_is_seen_and_one_in_a_closed_chest_is_not() -> None:
    walls = [("wall", (a, 0.0, -3.0), (a + 0.02, 2.5, 3.0)) for a in (-3.0, 2.98)]
    sides = [("chest", low, high) for low, high in _closed_chest()]
    scene = scene_of(
        FLOOR,
        *walls,
        ("cup", (1.0, 0.0, 1.0), (1.12, 0.14, 1.12)),
        *sides,
        ("ring", (-1.1, 0.2, -1.1), (-0.9, 0.4, -0.9)),
    )
    surface = NavigableSurface.from_scene(scene)
    pixels = best_views(scene, surface, renderer="raycast")
    named = {i.category: pixels[i.id] for i in things(scene)}
    assert named["cup"] >= ENOUGH_PIXELS
    assert named["ring"] == 0


def _closed_chest() -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    slabs = []
    for axis in range(3):
        for a, b in pairwise((-1.3, -1.25, -0.75, -0.7)):
            if b - a < 0.1:
                low, high = [-1.3, 0.0, -1.3], [-0.7, 0.6, -0.7]
                low[axis], high[axis] = (a, b) if axis != 1 else (a + 1.3, b + 1.3)
                slabs.append((tuple(low), tuple(high)))
    return slabs


def test_the_camera_looks_at_what_it_is_turned_to() -> None:
    def looks(target: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.asarray(-look_at(np.zeros(3), target)[:3, 2])

    np.testing.assert_allclose(looks(np.array([1.0, 0.5, 2.0])), np.array([1.0, 0.5, 2.0]) / np.sqrt(5.25), atol=1e-12)
    np.testing.assert_allclose(looks(np.array([0.0, -5.0, -0.1]))[1], -np.sin(np.pi / 3), atol=1e-12)
