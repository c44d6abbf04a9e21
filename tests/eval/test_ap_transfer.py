"""From maps to proposals: the nearest voxel's instance, as asking every voxel would find it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.perception.scannet200 import NUMBER_OF
from openmap_eval.ap.protocol import LabelledCloud, average_precision
from openmap_eval.ap.transfer import owner_of_points, proposals_of_map

VOXEL = 0.05


def instance_of(number: int, cells: object, **more: object) -> MapInstance:
    points = ((np.array(cells, np.float64).reshape(-1, 3) + 0.5) * VOXEL).astype(np.float32)
    return MapInstance(number, points, None, **more)  # type: ignore[arg-type]


CELLS = st.lists(st.tuples(*[st.integers(0, 4)] * 3), min_size=1, max_size=12)


@given(st.lists(CELLS, max_size=4), st.integers(0, 2**32 - 1))
def test_owners_are_those_of_the_nearest_voxel(cells: list[list[tuple[int, int, int]]], seed: int) -> None:
    # Ids fall along the list: the order of instances is not that of ids.
    instance_map = InstanceMap([instance_of(9 - n, c) for n, c in enumerate(cells)], VOXEL)
    points = np.random.default_rng(seed).uniform(-0.1, 0.35, (60, 3))
    reach = (np.sqrt(3) + 1) / 2 * VOXEL
    for point, found in zip(points, owner_of_points(instance_map, points), strict=True):
        gaps = {i.id: float(np.linalg.norm(i.points.astype(np.float64) - point, axis=1).min()) for i in instance_map}
        least = min(gaps.values(), default=np.inf)
        # The lowest of the ids that have the nearest voxel.
        assert found == (min(i for i, gap in gaps.items() if gap == least) if least <= reach else 0)


def test_every_point_of_a_voxel_belongs_to_its_instance() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64) * VOXEL
    instance_map = InstanceMap([instance_of(3, [(0, 0, 0)])], VOXEL)
    assert owner_of_points(instance_map, corners).tolist() == [3] * 8
    assert owner_of_points(instance_map, corners + 0.5).tolist() == [0] * 8
    assert owner_of_points(instance_map, corners + 0.5, reach=1.0).tolist() == [3] * 8


def test_maps_become_proposals_with_categories_and_confidences() -> None:
    chair = instance_of(2, [(n, 0, 0) for n in range(4)], label="office chair", confidence=0.5)
    other = instance_of(5, [(n, 2, 0) for n in range(4)], confidence=0.25)
    far = instance_of(7, [(99, 99, 99)])
    instance_map = InstanceMap([chair, other, far], VOXEL)
    points = np.concatenate([other.points, chair.points])
    found = proposals_of_map(instance_map, points)
    assert [(p.indices.tolist(), p.confidence, p.category) for p in found] == [
        ([4, 5, 6, 7], 0.5, NUMBER_OF["office chair"]),
        ([0, 1, 2, 3], 0.25, 0),
    ]
    assert [p.confidence for p in proposals_of_map(instance_map, points, ranked=False)] == [1.0, 1.0]
    truth = LabelledCloud(points, np.repeat([1, 2], 4).astype(np.int32), np.ones(8, np.int32))
    assert average_precision([(found, truth)], class_agnostic=True, min_points=1).ap == 1.0


def test_empty_maps_and_clouds_have_no_proposals() -> None:
    assert proposals_of_map(InstanceMap([], VOXEL), np.zeros((3, 3))) == []
    assert proposals_of_map(InstanceMap([instance_of(1, [(0, 0, 0)])], VOXEL), np.zeros((0, 3))) == []
    with pytest.raises(ValueError, match="voxel size"):
        owner_of_points(InstanceMap([instance_of(1, [(0, 0, 0)])]), np.zeros((1, 3)))
