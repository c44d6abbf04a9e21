"""What a map can be asked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.mapping.identity import BORN, GONE, JOINED, SPLIT


def thing(instance_id: int, centre: tuple[float, float, float], size: float = 0.2, **rest: Any) -> MapInstance:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    return MapInstance(
        instance_id, corners * np.float32(size / 2) + np.array(centre, np.float32), **{"feature": None, **rest}
    )


@pytest.fixture
def small_map() -> InstanceMap:
    views = np.array([[3, 1, 90], [0, 2, 40]], np.int32)
    return InstanceMap(
        [
            thing(2, (0, 1, 0), feature=np.array([0.6, 0.8], np.float32), label="jug", views=views, n_observations=2),
            thing(5, (0.5, 0, 0), confidence=0.25, colour=np.array([1, 2, 3], np.uint8)),
            thing(6, (1, 1, 0), is_structure=True, label="größer"),
            thing(9, (5, 0, 5)),
        ],
        voxel_size=0.05,
    )


def test_neighbours_are_the_nearest_within_the_radius(small_map: InstanceMap) -> None:
    assert [i.id for i in small_map.neighbours(2)] == [6, 5]
    assert [i.id for i in small_map.neighbours(2, k=1)] == [6]
    assert [i.id for i in small_map.neighbours(2, radius=1.05)] == [6]
    assert small_map.neighbours(9) == []
    with pytest.raises(KeyError, match="no instance 7"):
        small_map.neighbours(7)


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_neighbours_equal_a_plain_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a_map = InstanceMap([thing(n + 1, tuple(rng.integers(0, 5, 3))) for n in range(12)])
    radius, k = float(rng.uniform(0, 4)), int(rng.integers(1, 6))
    own = a_map.get(3)
    distance = [(float(np.linalg.norm(i.centre - own.centre)), i.id) for i in a_map if i.id != 3]
    expected = [i for _, i in sorted(d for d in distance if d[0] <= radius)][:k]
    assert [i.id for i in a_map.neighbours(3, radius, k)] == expected


def test_top_down_shows_what_is_on_top_at_its_place(small_map: InstanceMap) -> None:
    raster = small_map.top_down(resolution=0.1)

    def at(x: float, z: float) -> int:
        column, row = ((np.array([x, z]) - raster.origin) // raster.resolution).astype(int)
        return int(raster.ids[row, column])

    assert at(5.1, 5.1) == 9
    assert at(0.9, -0.1) == 6
    assert set(np.unique(raster.ids)) == {0, 2, 5, 6, 9}
    assert set(np.unique(small_map.top_down(below=0.5).ids)) == {0, 5, 9}
    assert 6 not in small_map.top_down(structure=False).ids
    stacked = InstanceMap([thing(1, (0, 2, 0)), thing(2, (0, 0, 0))])
    assert set(np.unique(stacked.top_down(0.1).ids)) == {0, 1}
    assert InstanceMap().top_down().ids.shape == (0, 0)


def test_labels_are_set_on_a_copy(small_map: InstanceMap) -> None:
    named = small_map.with_labels({5: "cup"})
    assert [i.label for i in named] == ["jug", "cup", "größer", ""]
    assert small_map.get(5).label == ""


def test_the_best_views_are_the_largest_of_each_picture() -> None:
    views = np.array([[3, 1, 90], [0, 2, 40], [3, 7, 30], [1, 1, 20], [5, 1, 9]], np.int32)
    instance = thing(1, (0, 0, 0), views=views)
    assert instance.best_views(3).tolist() == [[3, 1, 90], [0, 2, 40], [1, 1, 20]]
    assert len(instance.best_views(9)) == 4
    assert thing(1, (0, 0, 0)).best_views().shape == (0, 3)


def test_the_nearest_is_that_of_the_nearest_point(small_map: InstanceMap) -> None:
    large = replace(small_map.get(9), points=np.array([[0, 0, 0.4], [9, 9, 9]], np.float32))
    a_map = replace(small_map, instances=[*small_map.instances[:3], large])
    # Its centre is far off, one of its points is near.
    assert a_map.nearest((0, 0, 0.3)) is large
    assert a_map.nearest((0, 0, 0.3), within=0.05) is None
    assert a_map.ids_at([(0, 0, 0.3), (0, 1, 0), (0.61, 0.1, 0.1), (-9, 0, 0)], within=1).tolist() == [9, 2, 5, 0]
    assert InstanceMap().nearest((0, 0, 0)) is None
    assert a_map.ids_at(np.empty((0, 3))).shape == (0,)


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_nearest_equals_a_plain_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a_map = InstanceMap([thing(3 * n + 1, tuple(rng.normal(size=3))) for n in range(6)])
    for place in rng.normal(size=(5, 3)):
        distance = [float(np.linalg.norm(i.points.astype(np.float64) - place, axis=1).min()) for i in a_map]
        found = a_map.nearest(place)
        assert found is not None
        assert distance[a_map.instances.index(found)] == pytest.approx(min(distance))


def test_similarities_are_cosines(small_map: InstanceMap) -> None:
    got = small_map.similarities([4.0, 3.0])
    assert got[0] == pytest.approx(0.96)
    assert np.isnan(got[1:]).all()
    assert InstanceMap([thing(1, (0, 0, 0))]).similarities([1, 2, 3]).shape == (1,)
    for wrong in ([1.0, 0.0, 0.0], [0.0, 0.0], [np.nan, 1.0]):
        with pytest.raises(ValueError, match="2 dimensions and a length above 0"):
            small_map.similarities(wrong)


def test_ids_of_earlier_states_are_resolved(small_map: InstanceMap) -> None:
    given_ids = [[0, i, 0, BORN] for i in (1, 2, 3, 5, 6)]
    rows = [*given_ids, [4, 9, 5, SPLIT], [5, 1, 2, JOINED], [6, 3, 0, GONE], [7, 10, 0, BORN]]
    told = replace(small_map, history=np.array(rows, np.int32))
    assert [told.resolve(i) for i in (1, 2, 3, 5, 9)] == [2, 2, None, 5, 9]
    assert told.holders(5) == [5, 9]
    assert told.resolve(10) is None, "what somebody took out of the list is not in the map"
    with pytest.raises(KeyError, match="never had an instance 4"):
        told.resolve(4)
    assert told.with_labels({2: "pot"}).resolve(1) == 2
    # A map without a history knows what it holds.
    assert (small_map.resolve(5), small_map.holders(5)) == (5, [5])
    with pytest.raises(KeyError, match="no instance 1"):
        small_map.resolve(1)
