"""The file of a map: comes back as it was, or is refused with one clear error."""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzzing import damaged
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.mapping.identity import BORN, GONE, JOINED
from openmap_agents.mapping.map_file import _digest, _sealed
from openmap_scenes import DataError

Columns = dict[str, np.ndarray]


def thing(instance_id: int, centre: tuple[float, float, float], **rest: Any) -> MapInstance:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    return MapInstance(instance_id, corners * 0.1 + np.array(centre, np.float32), **{"feature": None, **rest})


@pytest.fixture
def small_map() -> InstanceMap:
    views = np.array([[3, 1, 90], [0, 2, 40]], np.int32)
    rows = [*([0, i, 0, BORN] for i in range(1, 10)), [4, 1, 2, JOINED], [5, 3, 0, GONE]]
    return InstanceMap(
        [
            thing(2, (0, 1, 0), feature=np.array([0.6, 0.8], np.float32), label="jug", views=views, n_observations=2),
            thing(5, (0.5, 0, 0), confidence=0.25, colour=np.array([1, 2, 3], np.uint8)),
            thing(6, (1, 1, 0), is_structure=True, label="größer"),
            thing(9, (5, 0, 5)),
        ],
        voxel_size=0.05,
        history=np.array(rows, np.int32),
    )


def assert_equal(a: InstanceMap, b: InstanceMap) -> None:
    assert (a.voxel_size, a.segmenter, a.encoder) == (b.voxel_size, b.segmenter, b.encoder)
    assert a.history.dtype == b.history.dtype
    np.testing.assert_array_equal(a.history, b.history)
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


def test_the_same_map_gives_the_same_bytes(small_map: InstanceMap, tmp_path: Path, monkeypatch) -> None:
    small_map.save(tmp_path / "a.npz")
    monkeypatch.setattr("time.time", lambda: 2e9)
    InstanceMap.load(tmp_path / "a.npz").save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz") as data:  # any reader of numpy's files opens it
        assert data["id"].tolist() == [2, 5, 6, 9]


def test_the_file_is_on_the_disk_before_it_has_its_name(small_map: InstanceMap, tmp_path: Path, monkeypatch) -> None:
    happened = []
    fsync, rename = os.fsync, Path.replace

    def noted_fsync(handle: int) -> None:
        happened.append("folder" if os.path.isdir(f"/proc/self/fd/{handle}") else "file")
        fsync(handle)

    def noted_rename(self: Path, target: Path) -> Path:
        happened.append("rename")
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", noted_fsync)
    monkeypatch.setattr(Path, "replace", noted_rename)
    small_map.save(tmp_path / "a.npz")
    assert happened in (["file", "rename", "folder"], ["file", "rename", "file"])


def test_a_crash_while_writing_leaves_the_old_file(small_map: InstanceMap, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "a.npz"
    small_map.save(path)

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(DataError, match="No space left"):
        InstanceMap().save(path)
    assert_equal(InstanceMap.load(path), small_map)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [({"confidence": 1.5}, "confidences"), ({"points": np.zeros((0, 3), np.float32)}, "points"),
     ({"n_observations": -1}, "negative"), ({"id": 99}, "ids out of order")],
)  # fmt: skip
def test_a_map_that_could_not_be_read_is_not_written(
    change: dict[str, Any], message: str, small_map: InstanceMap, tmp_path: Path
) -> None:
    wrong = replace(small_map, instances=[replace(small_map.instances[0], **change), *small_map.instances[1:]])
    with pytest.raises(ValueError, match=message):
        wrong.save(tmp_path / "a.npz")
    assert not list(tmp_path.iterdir())


def unpacked(path: Path) -> tuple[dict[str, Any], Columns]:
    with np.load(path) as data:
        columns = {name: data[name] for name in data.files}
    return json.loads(columns.pop("header").tobytes()), columns


def rewrite(path: Path, change: Callable[[dict[str, Any], Columns], None], honest: bool = False) -> None:
    """Write a file anew with changes, and the sum of its bytes; ``honest`` = with the arrays' sums and shapes as well."""
    header, columns = unpacked(path)
    change(header, columns)
    if honest:
        for name, array in columns.items():
            header["arrays"][name].update(shape=list(array.shape), sha256=_digest(array))
    path.write_bytes(_sealed({"header": np.frombuffer(json.dumps(header).encode(), np.uint8), **columns}))


def test_a_file_of_the_first_version_is_read(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    header, columns = unpacked(path)
    header["version"] = 1
    del columns["history"], header["arrays"]["history"]
    with path.open("wb") as file:
        np.savez_compressed(file, **columns, header=np.frombuffer(json.dumps(header).encode(), np.uint8))
    assert_equal(InstanceMap.load(path), replace(small_map, history=np.empty((0, 4), np.int32)))
    # One of the second version owes its sum.
    header["version"] = 2
    with path.open("wb") as file:
        np.savez_compressed(file, **columns, header=np.frombuffer(json.dumps(header).encode(), np.uint8))
    with pytest.raises(DataError, match="no checksum at its end"):
        InstanceMap.load(path)


def put(name: str, key: str, value: Any) -> Callable[[dict[str, Any], Columns], None]:
    def change(header: dict[str, Any], columns: Columns) -> None:
        (header["arrays"][name] if name else header)[key] = value

    return change


def swap(name: str, make: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict[str, Any], Columns], None]:
    def change(header: dict[str, Any], columns: Columns) -> None:
        columns[name] = make(columns[name])

    return change


def _missing(header: dict[str, Any], columns: Columns) -> None:
    del columns["views"]


def _more(header: dict[str, Any], columns: Columns) -> None:
    columns["../../etc/cron.d/x"] = np.zeros(3)


LIES = {
    "newer": (put("", "version", 99), "map version 99, expected version 1 to 2"),
    "no number": (put("", "version", "2"), "map version '2'"),
    "true": (put("", "version", True), "map version True"),
    "kind": (put("", "format", "holiday photos"), "another kind"),
    "altered": (swap("points", lambda a: a + 1), "points that does not match its checksum"),
    "missing": (_missing, "no member 'views.npy'"),
    "path trick": (_more, r"a member '../../etc/cron.d/x.npy'"),
    "huge": (put("points", "shape", [2**60, 3]), "points as float32"),
    "negative": (put("points", "shape", [-1, 3]), "points declared as"),
    "fraction": (put("points", "shape", [32.0, 3]), "points declared as"),
    "flat": (put("points", "shape", [96]), "points declared as"),
    "dtype": (put("points", "dtype", "float64"), "points declared as float64"),
    "objects": (swap("points", lambda a: np.array([{"a": 1}, 2], dtype=object)), "found"),
    "other dtype": (swap("points", lambda a: a.astype(np.float64)), "points as float64"),
    "labels": (put("", "labels", [1, 2, 3, 4]), "labels"),
    "labels no list": (put("", "labels", "abcd"), "columns of different lengths"),
    "encoder": (put("", "encoder", ["embedded"]), "encoder of the wrong type"),
    "list": (put("", "arrays", []), "damaged"),
    "voxel nan": (put("", "voxel_size", float("nan")), "voxel size of nan"),
    "voxel text": (put("", "voxel_size", "0.05"), "voxel size of '0.05'"),
    "voxel minus": (put("", "voxel_size", -1), "voxel size of -1"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_file_that_lies_about_itself_is_refused(lie: str, small_map: InstanceMap, tmp_path: Path) -> None:
    change, message = LIES[lie]
    path = tmp_path / "map.npz"
    small_map.save(path)
    if lie == "objects":
        header, columns = unpacked(path)
        change(header, columns)
        with path.open("wb") as file:
            np.savez(file, **columns, header=np.frombuffer(json.dumps({**header, "version": 1}).encode(), np.uint8))
    else:
        rewrite(path, change)
    with pytest.raises(DataError, match=message) as caught:
        InstanceMap.load(path)
    assert str(path) in str(caught.value)


def at(index: Any, value: Any) -> Callable[[np.ndarray], np.ndarray]:
    def make(array: np.ndarray) -> np.ndarray:
        array = array.copy()
        array[index] = value
        return array

    return make


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (swap("point_count", at(0, -8)), "point_count that does not add up"),
        (swap("point_count", at(slice(2), [2**62, -(2**62) + 16])), "point_count that does not add up"),
        (swap("point_count", lambda a: np.array([2**63 - 1, 2**63 - 1, 17, 17])), "point_count that does not add up"),
        (swap("point_count", at(slice(2), [0, 16])), "an instance without any"),
        (swap("view_count", at(0, 3)), "view_count that does not add up"),
        (swap("points", at((0, 0), np.nan)), "points that are not finite"),
        (swap("feature", at((0, 0), np.inf)), "features that are not finite"),
        (swap("confidence", at(0, np.nan)), "confidences out of range"),
        (swap("n_observations", at(0, -1)), "negative counts"),
        (swap("views", at((0, 2), -1)), "negative counts"),
        (swap("id", at(0, 0)), "ids out of order"),
        (swap("id", at(0, 5)), "ids out of order"),
        (swap("id", lambda a: a[:3]), "columns of different lengths"),
        (swap("has_feature", lambda a: np.array([1, 2, 0, 0], np.uint8).view(np.bool_)), "truth values"),
        (swap("history", at((9, 2), 1)), "impossible history"),
        (swap("history", lambda a: np.vstack([a, [6, 2, 1, JOINED]]).astype(np.int32)), "impossible history"),
    ],
)
def test_values_that_no_map_has_are_refused_whatever_the_sums_say(
    change: Callable[[dict[str, Any], Columns], None], message: str, small_map: InstanceMap, tmp_path: Path
) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    rewrite(path, change, honest=True)
    with pytest.raises(DataError, match=message):
        InstanceMap.load(path)


def test_a_bomb_is_not_unpacked(small_map: InstanceMap, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "map.npz"
    rows = 1 << 23
    small_map.save(path)
    rewrite(path, swap("points", lambda a: np.zeros((rows, 3), np.float32)), honest=True)
    assert path.stat().st_size < 1 << 20
    with pytest.raises(DataError, match="bytes that unpack to 10"):
        InstanceMap.load(path)
    # One that hides its size is not read further than what it states.
    monkeypatch.setattr("openmap_agents.mapping.map_file._SMALL", 1 << 40)
    data = path.read_bytes()
    size = rows * 12 + 128
    assert data.count(size.to_bytes(4, "little")) == 2
    path.write_bytes(reseal(data.replace(size.to_bytes(4, "little"), (500).to_bytes(4, "little"))))
    with pytest.raises(DataError, match=r"points as float32|CRC"):
        InstanceMap.load(path)


def reseal(data: bytes) -> bytes:
    """The bytes with the sum that they ought to end in."""
    body = data[:-71]
    return body + b"sha256:" + hashlib.sha256(body).hexdigest().encode()


def test_members_of_the_same_name_are_refused(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    with zipfile.ZipFile(path) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    twice = io.BytesIO()
    with zipfile.ZipFile(twice, "w") as archive:
        for name, data in [*members, ("ie.npy", members[1][1])]:
            archive.writestr(name, data)
        archive.comment = bytes(71)
    # The library that writes them warns of equal names, so the name is changed afterwards.
    path.write_bytes(reseal(twice.getvalue().replace(b"ie.npy", b"id.npy")))
    with pytest.raises(DataError, match="members of the same name"):
        InstanceMap.load(path)


def test_files_that_are_no_map_are_refused(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    with pytest.raises(DataError, match="no such file"):
        InstanceMap.load(path)
    for content in (b"", b"not a zip at all", b"PK\x03\x04", b"sha256:" + b"0" * 64, b"sha256:" * 20):
        path.write_bytes(content)
        with pytest.raises(DataError):
            InstanceMap.load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(DataError, match="without a header"):
        InstanceMap.load(path)
    with pytest.raises(DataError):
        InstanceMap.load(tmp_path)


def test_a_file_with_any_byte_changed_or_cut_off_is_refused(small_map: InstanceMap, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    small_map.save(path)
    whole = path.read_bytes()
    for end in range(0, len(whole), 13):
        path.write_bytes(whole[:end])
        with pytest.raises(DataError):
            InstanceMap.load(path)
    # Every byte: the members and their headers, the directory, the zip's end and the sum itself.
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ (1 << place % 8)]) + whole[place + 1 :])
        with pytest.raises(DataError):
            InstanceMap.load(path)
    for more in (b"\0", whole):
        path.write_bytes(whole + more)
        with pytest.raises(DataError):
            InstanceMap.load(path)


def test_fuzz_whatever_is_done_to_a_file_the_error_is_the_same(small_map: InstanceMap, tmp_path: Path) -> None:
    """Damage that comes with a matching sum gets as far as the zip, the headers and the arrays, and no further."""
    path = tmp_path / "map.npz"
    small_map.save(path)
    whole, rng = path.read_bytes(), np.random.default_rng(0)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
        directory = archive.start_dir
    refused = 0
    for case in range(1500):
        if case % 3 == 0:  # the zip
            data = damaged(whole[:-71], rng) + bytes(71)
        elif case % 3 == 1:  # its directory and end
            data = whole[:directory] + damaged(whole[directory:-71], rng) + bytes(71)
        else:  # what is packed in it, packed properly
            names = list(members)
            worse = names[int(rng.integers(len(names)))] if case % 2 else "header.npy"
            file = io.BytesIO()
            with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
                for name, content in members.items():
                    archive.writestr(name, damaged(content, rng) if name == worse else content)
                archive.comment = bytes(71)
            data = file.getvalue()
        path.write_bytes(reseal(data))
        try:
            read = InstanceMap.load(path)
        except DataError:
            refused += 1
        except BaseException as error:
            raise AssertionError(f"case {case} raised {type(error).__name__}: {error}") from error
        else:
            assert [i.id for i in read] == [2, 5, 6, 9]
    assert refused > 1100


@st.composite
def maps(draw: st.DrawFn) -> InstanceMap:
    dim = draw(st.sampled_from([1, 3]))
    whole = st.integers(0, 2**31 - 1)
    floats = st.floats(-1e6, 1e6, width=32)
    instances = []
    for instance_id in sorted(draw(st.sets(st.integers(1, 2**31 - 1), max_size=4))):
        instances.append(
            MapInstance(
                instance_id,
                draw(arrays.arrays(np.float32, (draw(st.integers(1, 4)), 3), elements=floats)),
                draw(st.none() | arrays.arrays(np.float32, dim, elements=floats)),
                draw(whole),
                draw(st.floats(0, 1)),
                draw(arrays.arrays(np.int32, (draw(st.integers(0, 3)), 3), elements=whole)),
                draw(st.booleans()),
                draw(st.none() | arrays.arrays(np.uint8, 3)),
                draw(st.text(max_size=8)),
            )
        )
    return InstanceMap(instances, draw(st.floats(0, 1)), draw(st.text(max_size=5)), draw(st.text(max_size=5)))


@given(maps())
@settings(max_examples=60, deadline=None)
def test_any_map_comes_back_as_it_was(tmp_path_factory: pytest.TempPathFactory, a_map: InstanceMap) -> None:
    path = tmp_path_factory.getbasetemp() / "any.npz"
    a_map.save(path)
    assert_equal(InstanceMap.load(path), a_map)
