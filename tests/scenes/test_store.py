"""Scenes on disk: what is opened equals what was saved, damage is seen, memory is shared, the cache keeps and forgets rightly."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st

import openmap_scenes.cache as cache_module
from openmap_env.navigation import NavigableSurface
from openmap_scenes import DataError, Instance, Material, Room, Scene, load_scene
from openmap_scenes.cache import cache_limit, cached, evict, scenes_folder
from openmap_scenes.store import INDEX, TEXTURES, open_scene, save_scene, stored_bytes

ARRAYS = ("vertices", "faces", "face_material", "face_instance", "uv", "vertex_colour")


@pytest.fixture(scope="module")
def rich_scene(toy_scene: Scene) -> Scene:
    """The toy scene with everything that a scene can have: shared and single textures, uv, colours, odd names."""
    rng = np.random.default_rng(3)
    wood, cloth = rng.integers(0, 256, (8, 6, 3), np.uint8), rng.integers(0, 256, (5, 7, 3), np.uint8)
    textures = [wood, None, cloth, wood, None]
    materials = [
        dataclasses.replace(m, texture=t, missing_texture="" if t is not None else "gone.png")
        for m, t in zip(toy_scene.materials, textures, strict=True)
    ]
    first = dataclasses.replace(
        toy_scene.instances[0], category='a "bed" – 床', mpcat40="bed", scannet200="bed", lvis="bed", room=None
    )
    rooms = [*toy_scene.rooms, Room(9, "attic", np.array([0.1, 3, 0]), np.array([1, 5, 1 / 3]), 1)]
    return dataclasses.replace(
        toy_scene,
        materials=materials,
        instances=[first, *toy_scene.instances[1:]],
        rooms=rooms,
        uv=rng.random((len(toy_scene.vertices), 2), np.float32),
        vertex_colour=rng.integers(0, 256, toy_scene.vertices.shape, np.uint8),
        credits=("a by b", "c"),
    )


@pytest.fixture
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("OPENMAP_CACHE_GB", raising=False)
    return tmp_path / "cache" / "scenes-v1"


class Reader:
    """Gives a scene and counts how often."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.calls = scene, 0

    def __call__(self) -> Scene:
        self.calls += 1
        return self.scene


def entries(folder: Path) -> list[Path]:
    return sorted(item for item in folder.iterdir() if not item.name.startswith("."))


def unfinished(folder: Path) -> list[Path]:
    return sorted(item for item in folder.rglob("*.tmp"))


def assert_same(one: Scene, other: Scene) -> None:
    for name in ARRAYS:
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
    for field in ("name", "source", "credits"):
        assert getattr(one, field) == getattr(other, field)
    for a, b in zip(
        [*one.instances, *one.rooms, *one.materials], [*other.instances, *other.rooms, *other.materials], strict=True
    ):
        for field in dataclasses.fields(a):
            x, y = getattr(a, field.name), getattr(b, field.name)
            if isinstance(x, np.ndarray):
                assert x.dtype == y.dtype
                np.testing.assert_array_equal(x, y)
            else:
                assert type(x) is type(y)
                assert x == y
    assert one.digest() == other.digest()


# The folder


@pytest.mark.parametrize("which", ["toy_scene", "rich_scene"])
def test_what_is_opened_equals_what_was_saved(which: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    scene: Scene = request.getfixturevalue(which)
    save_scene(scene, tmp_path / "scene")
    assert_same(scene, open_scene(tmp_path / "scene"))
    assert open_scene(tmp_path / "scene", source="file:moved").source == "file:moved"
    assert unfinished(tmp_path) == []


def test_a_texture_of_two_materials_is_kept_once(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    opened = open_scene(tmp_path / "scene")
    assert opened.materials[0].texture is opened.materials[3].texture
    assert np.load(tmp_path / "scene" / TEXTURES).size == (8 * 6 + 5 * 7) * 3
    written = sum(file.stat().st_size for file in (tmp_path / "scene").iterdir())
    assert written <= stored_bytes(rich_scene)


def test_opened_arrays_are_maps_that_nobody_can_write(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    scene = open_scene(tmp_path / "scene")
    textures = [m.texture for m in scene.materials if m.texture is not None]
    for array in [getattr(scene, name) for name in ARRAYS] + textures:
        assert type(array) is np.ndarray
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
        owner = array
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        assert isinstance(owner, np.memmap)


@given(seed=st.integers(0, 2**32 - 1), with_uv=st.booleans(), with_colour=st.booleans())
def test_any_scene_survives_the_disk(
    seed: int, with_uv: bool, with_colour: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rng = np.random.default_rng(seed)
    n, f, m = (int(x) for x in rng.integers([3, 1, 1], [40, 40, 5]))
    ids = np.unique(rng.integers(1, 2**31 - 1, 3)).tolist()
    boxes = rng.normal(size=(len(ids), 3)) * 10.0 ** rng.integers(-12, 12)
    scene = Scene(
        name=f"s{seed}",
        vertices=rng.normal(size=(n, 3)).astype(np.float32),
        faces=rng.integers(0, n, (f, 3), np.int32),
        face_material=rng.integers(0, m, f, np.int32),
        face_instance=rng.choice(np.array([0, *ids], np.int32), f),
        materials=[
            Material(f"m{k}", rng.random(3, np.float32), rng.integers(0, 256, (k + 1, 2, 3), np.uint8) if k else None)
            for k in range(m)
        ]
        * 1,
        instances=[Instance(i, "thing", b, b - 1, b + 1, None) for i, b in zip(ids, boxes, strict=True)],
        uv=rng.normal(size=(n, 2)).astype(np.float32) if with_uv else None,
        vertex_colour=rng.integers(0, 256, (n, 3), np.uint8) if with_colour else None,
    )
    folder = tmp_path_factory.mktemp("any") / "scene"
    save_scene(scene, folder)
    assert_same(scene, open_scene(folder))


def test_a_scene_replaces_a_scene_and_nothing_else(toy_scene: Scene, rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    before = open_scene(tmp_path / "scene")
    save_scene(toy_scene, tmp_path / "scene")
    assert_same(toy_scene, open_scene(tmp_path / "scene"))
    assert_same(rich_scene, before)  # whoever has the old one open keeps it
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("work of years")
    with pytest.raises(DataError, match="thesis"):
        save_scene(toy_scene, tmp_path / "thesis")
    assert (tmp_path / "thesis" / "chapter.txt").is_file()


def test_a_wrong_type_of_array_is_not_saved(toy_scene: Scene, tmp_path: Path) -> None:
    wrong = dataclasses.replace(toy_scene, faces=toy_scene.faces.astype(np.int64))
    with pytest.raises(DataError, match="faces of type int64"):
        save_scene(wrong, tmp_path / "scene")
    assert list(tmp_path.iterdir()) == []


FILES = [INDEX, TEXTURES, *(f"{name}.npy" for name in ARRAYS)]


def missing(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def longer(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\0")


def other_header(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[:100] = bytes(100)
    path.write_bytes(data)


def other_type(path: Path) -> None:
    if path.suffix == ".npy":
        np.save(path, np.load(path).astype(np.float64))
    else:
        path.write_text(path.read_text().replace('"version": 1', '"version": 2'))


def other_shape(path: Path) -> None:
    if path.suffix == ".npy":
        array = np.load(path)
        np.save(path, array.reshape(-1)[::-1][:-1])
    else:
        path.write_text(path.read_text().replace('"arrays": {', '"arrays": {"normals": [1, 3], '))


def pickled(path: Path) -> None:
    np.save(path.with_suffix(".x.npy"), np.array([{"a": 1}], object), allow_pickle=True)
    path.with_suffix(".x.npy").replace(path)


DAMAGES = [missing, cut, empty, longer, other_header, other_type, other_shape, pickled]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda d: d.__name__)
@pytest.mark.parametrize("name", FILES)
def test_damage_of_any_file_is_seen_and_mended(
    name: str, damage: Callable[[Path], None], rich_scene: Scene, cache_folder: Path
) -> None:
    reader = Reader(rich_scene)
    cached(["k"], [], reader)
    (entry,) = entries(cache_folder)
    damage(entry / name)
    with pytest.raises(DataError):
        open_scene(entry)
    assert_same(rich_scene, cached(["k"], [], reader))
    assert reader.calls == 2
    assert_same(rich_scene, cached(["k"], [], reader))
    assert reader.calls == 2
    assert entries(cache_folder) == [entry]


def test_every_flipped_bit_of_the_tables_is_seen(toy_scene: Scene, tmp_path: Path) -> None:
    save_scene(toy_scene, tmp_path / "scene")
    path = tmp_path / "scene" / INDEX
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for at in [*range(130), *rng.integers(0, len(whole), 300).tolist()]:
        data = bytearray(whole)
        data[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        with pytest.raises(DataError):
            open_scene(tmp_path / "scene")


@pytest.mark.parametrize(
    ("name", "value"), [("faces", 10**6), ("faces", -1), ("face_material", 99), ("face_instance", 9999)]
)
def test_numbers_out_of_range_are_seen(name: str, value: int, toy_scene: Scene, tmp_path: Path) -> None:
    save_scene(toy_scene, tmp_path / "scene")
    array = np.load(tmp_path / "scene" / f"{name}.npy", mmap_mode="r+")
    array.reshape(-1)[5] = value
    array.flush()
    with pytest.raises(DataError, match=str(value)):
        open_scene(tmp_path / "scene")


def with_tables(path: Path, change: Callable[[dict[str, object]], None]) -> None:
    """Change the tables of a saved scene and give them the digest that fits."""
    whole = json.loads(path.read_bytes())
    change(whole["scene"])
    payload = json.dumps(whole["scene"]).encode()
    digest = hashlib.blake2b(payload, digest_size=32).hexdigest()
    head = f'{{"format": "openmap-scene", "version": 1, "blake2b": "{digest}", "scene": '
    path.write_bytes(head.encode() + payload + b"}")


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.pop("name"),
        lambda t: t.update(arrays={}),
        lambda t: t["arrays"].update(vertices=[2**62, 3]),
        lambda t: t["arrays"].update({"../scene": [1]}),
        lambda t: t.update(textures=[[8, 6]]),
        lambda t: t.update(textures=[[-8, 6], [5, 7]]),
        lambda t: t["materials"][0].update(texture=7),
        lambda t: t["materials"][0].update(colour="red"),
        lambda t: t["instances"][0].update(shape="round"),
        lambda t: t["rooms"].append(3),
        lambda t: t.update(instances=[]),
    ],
)
def test_tables_that_do_not_fit_together_are_seen(
    change: Callable[[dict[str, object]], None], rich_scene: Scene, tmp_path: Path
) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    with_tables(tmp_path / "scene" / INDEX, change)
    with pytest.raises(DataError):
        open_scene(tmp_path / "scene")


def test_fuzz_a_damaged_folder_opens_or_is_refused(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "healthy" / "scene")
    (tmp_path / "scratch").mkdir()

    def read(folder: Path) -> str:
        return open_scene(folder).digest()

    assert hold_to_data_error(read, tmp_path / "healthy" / "scene", FILES, tmp_path / "scratch", 400) > 100


# The checks of a scene, plain and in blocks


def plain_unlisted(face_instance: np.ndarray, listed: set[int]) -> list[int]:
    return sorted(set(np.unique(face_instance).tolist()) - {0} - listed)


@given(
    faces=st.lists(
        st.one_of(st.integers(-3, 9), st.sampled_from([2**20, 2**31 - 1, -(2**31)])), min_size=1, max_size=30
    ),
    listed=st.sets(st.one_of(st.integers(-2, 9), st.sampled_from([2**20, 2**31 - 1, 2**40]))),
)
def test_unlisted_ids_are_those_that_the_plain_way_finds(faces: list[int], listed: set[int]) -> None:
    from openmap_scenes.scene import _unlisted

    array = np.array(faces, np.int32)
    assert _unlisted(array, listed) == plain_unlisted(array, listed)


def test_what_is_wrong_in_a_late_block_is_seen(toy_scene: Scene) -> None:
    n = 200_000
    big = {
        "vertices": np.zeros((n, 3), np.float32),
        "faces": np.zeros((n, 3), np.int32),
        "face_material": np.zeros(n, np.int32),
        "face_instance": np.ones(n, np.int32),
    }
    Scene("big", **big, materials=toy_scene.materials, instances=toy_scene.instances)
    for name, value, says in (("vertices", np.nan, "not finite"), ("face_instance", 77, "77")):
        wrong = big[name].copy()
        wrong[-1] = value
        with pytest.raises(DataError, match=says):
            Scene("big", **(big | {name: wrong}), materials=toy_scene.materials, instances=toy_scene.instances)


# The cache


def test_the_second_time_nothing_is_read(rich_scene: Scene, cache_folder: Path) -> None:
    reader = Reader(rich_scene)
    first, second = cached(["k", "1"], [], reader), cached(["k", "1"], [], reader)
    assert reader.calls == 1
    assert_same(rich_scene, first)
    assert_same(rich_scene, second)
    assert not first.vertices.flags.writeable
    cached(["k", "2"], [], reader)
    assert reader.calls == 2


def test_the_key_is_the_content_and_the_names(toy_scene: Scene, cache_folder: Path, tmp_path: Path) -> None:
    reader = Reader(toy_scene)

    def read_from(folder: Path, content: bytes = b"one", names: tuple[str, ...] = ("a.glb", "sub/b.ply")) -> int:
        files = [folder / name for name in names]
        for file in files:
            file.parent.mkdir(parents=True, exist_ok=True)
            if not file.is_file() or file.read_bytes() != content:
                file.write_bytes(content)
        cached(["mp3d"], files, reader, source=f"mp3d:{folder}")
        return reader.calls

    assert read_from(tmp_path / "one" / "scan") == 1
    assert read_from(tmp_path / "one" / "scan") == 1
    assert read_from(tmp_path / "copy" / "scan") == 1  # moved or copied: the same scene
    assert cached(["mp3d"], [], reader, source="x").source == "x"
    reader.calls = 1
    assert read_from(tmp_path / "one" / "other") == 2  # scenes are named after their folder
    assert read_from(tmp_path / "one" / "scan", b"two") == 3
    assert read_from(tmp_path / "one" / "scan", b"two", ("a.glb",)) == 4


def test_a_change_that_keeps_size_and_time_of_writing_is_seen(
    toy_scene: Scene, cache_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache_module, "SETTLED", -1.0)
    reader, file = Reader(toy_scene), tmp_path / "a.glb"
    file.write_bytes(b"one")
    status = file.stat()
    cached([], [file], reader)
    time.sleep(0.05)  # the clock of a file system ticks every few milliseconds
    file.write_bytes(b"two")
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert file.stat().st_mtime_ns == status.st_mtime_ns
    cached([], [file], reader)
    assert reader.calls == 2


def test_unchanged_files_are_not_hashed_again(
    toy_scene: Scene, cache_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, file = Reader(toy_scene), tmp_path / "a.glb"
    file.write_bytes(b"one")
    cached([], [file], reader)
    notes = cache_folder.parent / "notes-v1"
    assert not notes.exists()  # written a moment ago: it may change again within the same tick
    monkeypatch.setattr(cache_module, "SETTLED", -1.0)
    cached([], [file], reader)
    (note,) = (path for path in notes.rglob("*") if path.is_file())
    hashed: list[object] = []
    monkeypatch.setattr(hashlib, "file_digest", lambda *a: hashed.append(a))
    cached([], [file], reader)
    assert (reader.calls, hashed) == (1, [])
    monkeypatch.undo()
    monkeypatch.setenv("OPENMAP_CACHE", str(cache_folder.parent))
    whole = note.read_bytes()
    for damaged in (b"", whole[:-1], whole.replace(whole[-4:], b"ffff"), b"\xff" * 80, b"\n\n"):
        note.write_bytes(damaged)
        cached([], [file], reader)
    assert reader.calls == 1


def test_what_is_compiled_meanwhile_is_no_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "formats" / "__pycache__").mkdir(parents=True)
    (tmp_path / "formats" / "ply.py").write_text("pass")
    monkeypatch.setattr(cache_module, "__file__", str(tmp_path / "cache.py"))
    digest = cache_module._code_digest()
    (tmp_path / "formats" / "__pycache__" / "ply._walk-192.py311.nbi").write_bytes(b"compiled")
    assert cache_module._code_digest() == digest
    (tmp_path / "formats" / "ply.py").write_text("...")
    assert cache_module._code_digest() != digest


def test_changed_code_never_gives_what_old_code_gave(
    toy_scene: Scene, cache_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reader = Reader(toy_scene)
    cached([], [], reader)
    monkeypatch.setattr(cache_module, "_CODE", "of another version")
    cached([], [], reader)
    assert reader.calls == 2
    # This process runs other code than what lies there now, so what it reads is not kept under either name.
    assert len(entries(cache_folder)) == 1


def test_files_that_change_while_they_are_read_are_not_kept(
    toy_scene: Scene, cache_folder: Path, tmp_path: Path
) -> None:
    file = tmp_path / "a.glb"
    file.write_bytes(b"one")

    def read() -> Scene:
        file.write_bytes(b"more than one")
        return toy_scene

    assert cached([], [file], read) is toy_scene
    assert entries(cache_folder) == []


def test_a_missing_file_is_left_to_the_reader(cache_folder: Path, tmp_path: Path) -> None:
    def read() -> Scene:
        raise DataError(tmp_path, "no mesh", "a mesh")

    with pytest.raises(DataError, match="no mesh"):
        cached([], [tmp_path / "a.glb"], read)
    with pytest.raises(DataError, match="no mesh"):
        cached([], [], read)
    assert unfinished(tmp_path) == []


def test_what_was_not_used_for_longest_goes_first(
    toy_scene: Scene, cache_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    readers = {name: Reader(toy_scene) for name in "abcd"}

    def used(name: str, at: float) -> None:
        known = set(entries(cache_folder)) if cache_folder.exists() else set()
        cached([name], [], readers[name])
        for new in set(entries(cache_folder)) - known:
            paths[name] = new
        os.utime(paths[name] / INDEX, (at, at))

    paths: dict[str, Path] = {}
    now = time.time()
    used("a", now - 200)
    real = sum(file.stat().st_size for file in paths["a"].iterdir())
    # Room for three: two and a half beside the one that comes, whose size is estimated beforehand.
    monkeypatch.setenv("OPENMAP_CACHE_GB", str((2.5 * real + stored_bytes(toy_scene)) / 1e9))
    for at, name in enumerate("abcab"):
        used(name, now - 100 + at)
    used("d", now)
    assert not paths["c"].exists()
    assert {paths[name] for name in "abd"} == set(entries(cache_folder))
    assert [readers[name].calls for name in "abcd"] == [1, 1, 1, 1]
    cached(["c"], [], readers["c"])
    assert readers["c"].calls == 2
    evict(cache_folder, 0)
    assert entries(cache_folder) == []


def test_leftovers_of_killed_processes_go_when_they_are_old(toy_scene: Scene, cache_folder: Path) -> None:
    cached([], [], Reader(toy_scene))
    old, new = cache_folder / ".k.1-aa.tmp", cache_folder / ".k.2-bb.tmp"
    for folder in (old, new):
        folder.mkdir()
        (folder / "vertices.npy").write_bytes(b"half")
    os.utime(old, (0, 0))
    evict(cache_folder, 10**9)
    assert not old.exists()
    assert new.exists()
    assert len(entries(cache_folder)) == 1


def test_no_cache_means_no_cache(toy_scene: Scene, cache_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    reader = Reader(toy_scene)
    assert cached([], [], reader) is toy_scene
    assert cached([], [], reader) is toy_scene
    assert not cache_folder.parent.exists()


@pytest.mark.parametrize("text", ["much", "-1", "nan", "inf", "1e400"])
def test_a_limit_that_is_none_is_named(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE_GB", text)
    with pytest.raises(DataError, match="OPENMAP_CACHE_GB"):
        cache_limit()


def test_the_cache_lies_where_the_user_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENMAP_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert scenes_folder() == tmp_path / "openmapnav" / "scenes-v1"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert scenes_folder() == tmp_path / "home" / ".cache" / "openmapnav" / "scenes-v1"


def no_folder(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root.write_text("a file where the folder should be")


def full_disk(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", write)


def small_disk(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import shutil

    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 5, 5))  # type: ignore[attr-defined]


def too_small(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE_GB", "1e-9")


def read_only(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root.mkdir()
    root.chmod(0o555)
    if os.access(root, os.W_OK):
        pytest.skip("this user may write everywhere")


@pytest.mark.parametrize("trouble", [no_folder, full_disk, small_disk, too_small, read_only], ids=lambda t: t.__name__)
def test_a_cache_that_cannot_be_written_costs_one_line(
    trouble: Callable[[Path, pytest.MonkeyPatch], None],
    toy_scene: Scene,
    cache_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    trouble(cache_folder.parent, monkeypatch)
    reader = Reader(toy_scene)
    with caplog.at_level(logging.WARNING):
        assert_same(toy_scene, cached(["k"], [], reader))
    assert [r.name for r in caplog.records] == ["openmap_scenes.cache"]
    assert "not kept" in caplog.text
    if cache_folder.is_dir():
        assert list(cache_folder.iterdir()) == []


def test_an_interrupted_write_leaves_nothing(
    toy_scene: Scene, cache_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(_: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        cached(["k"], [], Reader(toy_scene))
    assert entries(cache_folder) == []
    assert unfinished(cache_folder) == []


def test_threads_that_want_one_scene_read_it_once(toy_scene: Scene, cache_folder: Path) -> None:
    reader, found = Reader(toy_scene), []

    def read() -> Scene:
        time.sleep(0.2)
        return reader()

    threads = [threading.Thread(target=lambda: found.append(cached(["k"], [], read))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert reader.calls == 1
    assert {scene.digest() for scene in found} == {toy_scene.digest()}


RACE = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from conftest import make_toy_scene
from openmap_scenes.store import open_scene, save_scene
scene = make_toy_scene()
for _ in range(30):
    save_scene(scene, Path(sys.argv[2]))
print(open_scene(Path(sys.argv[2])).digest() if sys.argv[3] == "last" else scene.digest())
"""


def test_processes_that_write_one_folder_at_once_leave_a_whole_scene(toy_scene: Scene, tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", RACE, str(Path(__file__).parents[1]), str(tmp_path / "race" / "scene"), "any"]
    writers = [subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    whole = 0
    while any(writer.poll() is None for writer in writers):
        try:
            assert open_scene(tmp_path / "race" / "scene").digest() == toy_scene.digest()
            whole += 1
        except DataError:
            pass  # between the two renames of a replacement
    assert [writer.wait() for writer in writers] == [0, 0]
    assert {writer.communicate()[0].strip() for writer in writers} == {toy_scene.digest()}
    assert whole > 0
    assert open_scene(tmp_path / "race" / "scene").digest() == toy_scene.digest()
    assert [item.name for item in (tmp_path / "race").iterdir()] == ["scene"]


# What uses a scene


def test_navigation_and_pictures_work_on_what_was_kept(rich_scene: Scene, tmp_path: Path) -> None:
    from openmap_env.rendering.raycast import RaycastRenderer
    from openmap_scenes import PinholeCamera

    save_scene(rich_scene, tmp_path / "scene")
    opened = open_scene(tmp_path / "scene")
    fresh, kept = NavigableSurface.from_scene(rich_scene), NavigableSurface.from_scene(opened)
    np.testing.assert_array_equal(fresh.centres, kept.centres)
    T_world_camera = np.eye(4)
    T_world_camera[:3, 3] = (0.0, 1.2, 0.0)
    camera = PinholeCamera.from_hfov(64, 48, 90.0)
    one, other = (RaycastRenderer(s, camera, threads=1).render(T_world_camera) for s in (rich_scene, opened))
    np.testing.assert_array_equal(one.rgb, other.rgb)
    np.testing.assert_array_equal(one.depth, other.depth)
    np.testing.assert_array_equal(one.instance, other.instance)


def test_a_shared_scene_from_the_cache_is_the_fresh_one(shared_scenes: Path, cache_folder: Path) -> None:
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    fresh = load_scene(spec, cache=False)
    assert load_scene(spec).digest() == fresh.digest()
    (entry,) = entries(cache_folder)
    again = load_scene(spec)
    assert again.digest() == fresh.digest()
    assert (again.name, again.source, again.credits) == (fresh.name, fresh.source, fresh.credits)
    assert not again.vertices.flags.writeable
    assert entries(cache_folder) == [entry]
