"""What a map can be asked, and its file."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_scenes import DataError


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


def assert_equal(a: InstanceMap, b: InstanceMap) -> None:
    assert (a.voxel_size, a.segmenter, a.encoder) == (b.voxel_size, b.segmenter, b.encoder)
    for one, other in zip(a, b, strict=True):
        for name in MapInstance.__dataclass_fields__:
            x, y = getattr(one, name), getattr(other, name)
            if isinstance(x, np.ndarray):
                assert x.dtype == y.dtype
                np.testing.assert_array_equal(x, y)
            else:
                assert type(x) is type(y)
                assert x == y


def test_a_map_comes_back_from_its_file_as_it_was(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "deep" / "walk.map"
    small_map.save(path)
    assert_equal(InstanceMap.load(path), small_map)
    told = replace(small_map, segmenter="sam:/a", encoder="oracle:drop=.1")
    told.save(path)
    assert_equal(InstanceMap.load(path), told)
    InstanceMap().save(path)
    assert len(InstanceMap.load(path)) == 0
    assert [p.name for p in path.parent.iterdir()] == ["walk.map"], "a temporary file was left"


def test_a_failed_save_leaves_the_old_file(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    broken = InstanceMap([replace(small_map.instances[0], feature=np.ones(2)), thing(8, (0, 0, 0), feature=np.ones(3))])
    with pytest.raises(ValueError, match="features of 2 and 3 dimensions"):
        broken.save(path)
    assert_equal(InstanceMap.load(path), small_map)
    assert len(list(tmp_path.iterdir())) == 1


def rewrite(path: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], None]) -> None:
    with np.load(path) as data:
        columns = {name: data[name] for name in data.files}
    header = json.loads(columns.pop("header").tobytes())
    change(header, columns)
    with path.open("wb") as file:
        np.savez(file, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **columns)


def _newer(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["version"] = 99


def _other(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["format"] = "holiday photos"


def _altered(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    columns["points"] = columns["points"] + 1


def _missing(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    del columns["views"]


def _huge(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["arrays"]["points"]["shape"] = [2**60, 3]


def _labels(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["labels"] = [1, 2, 3, 4]


def _encoder(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["encoder"] = ["embedded"]


def _list(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    header["arrays"] = []


def _objects(header: dict[str, Any], columns: dict[str, np.ndarray]) -> None:
    columns["points"] = np.array([{"a": 1}, print], dtype=object)


@pytest.mark.parametrize(
    ("change", "message"),
    [(_newer, "map version 99, expected version 1"), (_other, "another kind"), (_altered, "checksum"), (_missing, "damaged"),
     (_huge, "points declared as"), (_labels, "labels"), (_encoder, "encoder of the wrong type"),
     (_list, "damaged"), (_objects, "found")],
)  # fmt: skip
def test_a_file_that_cannot_be_trusted_is_refused(
    change: Callable[[dict[str, Any], dict[str, np.ndarray]], None],
    message: str,
    small_map: InstanceMap,
    tmp_path: Path,
) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    rewrite(path, change)
    with pytest.raises(DataError, match=message) as caught:
        InstanceMap.load(path)
    assert str(path) in str(caught.value)


def test_files_that_are_no_map_are_refused(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    with pytest.raises(DataError, match="no such file"):
        InstanceMap.load(path)
    for content in (b"", b"not a zip at all", b"PK\x03\x04"):
        path.write_bytes(content)
        with pytest.raises(DataError):
            InstanceMap.load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(DataError, match="without a header"):
        InstanceMap.load(path)
    with pytest.raises(DataError):
        InstanceMap.load(tmp_path)


def test_a_file_cut_or_flipped_anywhere_is_refused_or_unharmed(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    whole = path.read_bytes()
    for end in range(0, len(whole), 97):
        path.write_bytes(whole[:end])
        with pytest.raises(DataError):
            InstanceMap.load(path)
    for place in range(0, len(whole), 41):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        try:
            read = InstanceMap.load(path)
        except DataError:
            continue
        assert_equal(read, small_map)
