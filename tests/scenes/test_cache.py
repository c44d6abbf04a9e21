"""Scenes that were read once: kept by content, shared by processes, given up in good order."""

from __future__ import annotations

import hashlib
import logging
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from kept_scenes import Reader, assert_same, entries, unfinished

import openmap_scenes.cache as cache_module
from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.cache import cache_limit, cached, evict, scenes_folder
from openmap_scenes.store import INDEX, stored_bytes


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
    make = Path.mkdir

    # Permissions would not stop root, so the refusal is made here.
    def refuse(self: Path, *arguments: object, **settings: object) -> None:
        if root in self.parents:
            raise PermissionError(13, "Permission denied", str(self))
        make(self, *arguments, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr(Path, "mkdir", refuse)


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


def test_the_key_holds_the_code_that_scenes_come_from_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cache_module, "__file__", str(tmp_path / "cache.py"))
    for name, changes in (("formats/new.py", True), ("recordings/new.py", False), ("homes/new.tsv", True)):
        before = cache_module._code_digest()
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("x = 1\n")
        assert (cache_module._code_digest() != before) == changes, name
