"""Scenes that were read once, kept on disk for the next process, keyed by the content of what they were read from.

They lie in ``$OPENMAP_CACHE``, else ``$XDG_CACHE_HOME/openmapnav``, else ``~/.cache/openmapnav``, in ``scenes-v1``; the folder
may be deleted at any time. ``OPENMAP_CACHE_GB`` limits its size (20 where it is not set, 0 = nothing is kept): what was not used
for the longest time goes first. A cache that cannot be written costs time and one line in the log, nothing else.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from openmap_scenes.errors import DataError
from openmap_scenes.scene import Scene
from openmap_scenes.store import INDEX, open_scene, remove_scene, save_scene, stored_bytes

try:
    import fcntl
except ImportError:  # not POSIX
    fcntl = None  # type: ignore[assignment]

FOLDER_VARIABLE, LIMIT_VARIABLE = "OPENMAP_CACHE", "OPENMAP_CACHE_GB"
DEFAULT_LIMIT_GB = 20.0
# Libraries that decode what readers read: another version may give other pixels.
LIBRARIES = ("openmap-nav", "numpy", "scipy", "pillow", "trimesh", "plyfile", "open3d")
# What Python and numba compile, which appears while the package is at work, and readers of recordings, which no scene comes from.
NO_SCENES = frozenset({"__pycache__", "recordings"})
# How long one process waits for another one that reads the same scene, s.
PATIENCE = 900.0
# What an interrupted process left behind goes after this time, s.
LEFTOVER_AGE = 3600.0
# A file that changed this short a time ago, s, may change again without a new time stamp, so its digest is not remembered.
SETTLED = 2.0

_log = logging.getLogger(__name__)


def cache_root() -> Path:
    """The folder of everything that is kept between runs."""
    if folder := os.environ.get(FOLDER_VARIABLE):
        return Path(folder)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "openmapnav"


def cache_limit() -> int:
    """How many bytes of scenes may be kept; DataError where the setting is not a number of 0 or more."""
    text = os.environ.get(LIMIT_VARIABLE) or str(DEFAULT_LIMIT_GB)
    try:
        return int(_not_negative(float(text)) * 1e9)
    except (ValueError, OverflowError) as error:
        raise DataError(LIMIT_VARIABLE, repr(text), "a number of gigabytes, 0 = keep nothing") from error


def cached(
    key_parts: Sequence[str], files: Sequence[Path], read: Callable[[], Scene], source: str | None = None
) -> Scene:
    """The scene that ``read`` gives, from the cache where it is there.

    The key is made of ``key_parts``, of the bytes and names of ``files`` (with the name of the folder that holds them all, since
    scenes are named after it), of the code of this package but for ``recordings`` and of the versions of the libraries that
    decode. The digest of a file is remembered by its path, size, inode and times of change, so a file that changes while all of
    these stay (on file systems that keep no time of change, or a coarse one) is taken for the old one.

    Parameters
    ----------
    key_parts : sequence of str
        What decides besides the files: the reader's name, a seed ...
    files : sequence of Path
        All that ``read`` reads.
    read : callable
        Gives the scene; its errors pass through.
    source : str or None
        ``Scene.source`` of the result; None = what ``read`` gave when the scene was kept.
    """
    limit = cache_limit()
    if not limit:
        return read()
    try:
        stamps = [_stamp(file) for file in files]
        entry = scenes_folder() / _key(key_parts, files)
    except OSError:
        return read()  # the reader says best what is wrong with its files
    scene = _open(entry, source)
    if scene is not None:
        return scene
    with _one_at_a_time(entry):
        scene = _open(entry, source)
        if scene is not None:
            return scene
        scene = read()
        with suppress(OSError):
            if [_stamp(file) for file in files] == stamps and _code_digest() == _CODE:
                return _keep(scene, entry, limit, source)
        return scene


def scenes_folder() -> Path:
    """Where scenes are kept, one folder each."""
    return cache_root() / "scenes-v1"


def evict(folder: Path, limit: int) -> None:
    """Remove scenes, those not used for the longest time first, until at most ``limit`` bytes are left; and old leftovers."""
    entries = []
    for item in sorted(folder.iterdir()):
        with suppress(OSError):
            if item.is_dir() and not item.name.startswith("."):
                size = sum(file.stat().st_size for file in item.iterdir())
                used = (item / INDEX).stat().st_mtime_ns if (item / INDEX).exists() else 0
                entries.append((used, item.name, size, item))
            elif item.stat().st_mtime < time.time() - LEFTOVER_AGE:
                shutil.rmtree(item) if item.is_dir() else item.unlink()
    total = sum(size for _, _, size, _ in entries)
    for _, _, size, item in sorted(entries):
        if total <= limit:
            break
        with suppress(OSError):
            remove_scene(item)
            total -= size


def _keep(scene: Scene, entry: Path, limit: int, source: str | None) -> Scene:
    """Write a scene that was just read, and open it from there: its arrays are then shared with the processes to come."""
    folder, size = entry.parent, stored_bytes(scene)
    try:
        if size > limit:
            raise OSError(f"{size / 1e9:.2f} GB are more than {LIMIT_VARIABLE} allows")
        folder.mkdir(parents=True, exist_ok=True)
        remove_scene(entry)
        evict(folder, limit - size)
        free = shutil.disk_usage(folder).free
        if size > free:
            raise OSError(f"{size / 1e9:.2f} GB are needed and {free / 1e9:.2f} GB are free")
        save_scene(scene, entry)
        return open_scene(entry, source)
    except (OSError, ValueError, TypeError) as error:
        _log.warning("%s is not kept for next time in %s: %s", scene.source or scene.name, folder, error)
        return scene


def _open(entry: Path, source: str | None) -> Scene | None:
    """A kept scene, now the one used last; None where there is none or it is damaged."""
    if not entry.is_dir():
        return None
    try:
        scene = open_scene(entry, source)
    except DataError as error:
        if entry.is_dir():  # else it was evicted in this moment
            _log.warning("a kept scene is damaged and read from its source again: %s", error)
        return None
    with suppress(OSError):
        os.utime(entry / INDEX)
    return scene


@contextmanager
def _one_at_a_time(entry: Path) -> Iterator[None]:
    """Let one process at a time read a scene, so that eight workers do not decode it eight times; where that fails, go on."""
    lock = entry.with_name(f".{entry.name}.lock")
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        yield
        return
    try:
        _wait_for(handle, entry)
        yield
    finally:
        # Whoever waits for the file that goes here finds the scene; at worst two processes read at once.
        with suppress(OSError):
            lock.unlink()
        os.close(handle)


def _wait_for(handle: int, entry: Path) -> None:
    end, waited = time.monotonic() + PATIENCE, False
    while fcntl is not None and time.monotonic() < end:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if not waited:
                _log.info("waiting for another process that reads the same scene (%s)", entry.name)
            waited = True
            time.sleep(0.05)
        except OSError:
            return  # a file system without locks


def _key(key_parts: Sequence[str], files: Sequence[Path]) -> str:
    absolute = sorted({Path(os.path.abspath(file)) for file in files})
    hasher = hashlib.blake2b(digest_size=16)
    hasher.update(repr((_CODE, _library_versions(), list(key_parts))).encode())
    if absolute:
        common = Path(os.path.commonpath([file.parent for file in absolute]))
        for file in absolute:
            name = (Path(common.name) / file.relative_to(common)).as_posix()
            hasher.update(repr((name, _file_digest(file))).encode())
    return hasher.hexdigest()


def _stamp(file: Path) -> tuple[int, int, int, int]:
    status = file.stat()
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino


def recall_files(kind: str, path: Path) -> list[Path] | None:
    """The files that the scene of a kind at a path is read from, as noted, if neither they nor their folders have changed since.

    It saves to import the reader and to look for them again, which costs more than to open a kept scene. None = not known.
    """
    try:
        noted, check = _files_note(kind, path).read_text(encoding="utf-8").split("\n")
        if check != _check(noted):
            return None
        watched, count = json.loads(noted)
        places = [Path(name) for name, _ in watched]
        if any(_stamp(place) != tuple(stamp) for place, (_, stamp) in zip(places, watched, strict=True)):
            return None
        return places[:count]
    except (OSError, ValueError):
        return None


def note_files(kind: str, path: Path, files: Sequence[Path]) -> None:
    """Remember from which files a scene is read, until one of them or of the folders that hold them changes."""
    with suppress(OSError):
        absolute = [Path(os.path.abspath(file)) for file in files]
        folders = {file.parent for file in absolute} | {path.absolute() if path.is_dir() else path.absolute().parent}
        watched = [(str(place), _stamp(place)) for place in [*absolute, *sorted(folders)]]
        if all(_settled(stamp) for _, stamp in watched):
            noted = json.dumps([watched, len(absolute)])
            _write_note(_files_note(kind, path), f"{noted}\n{_check(noted)}")


def _files_note(kind: str, path: Path) -> Path:
    key = hashlib.blake2b(repr((_CODE, kind, os.path.abspath(path))).encode(), digest_size=16).hexdigest()
    return cache_root() / "notes-v1" / key[:2] / key


def _file_digest(file: Path) -> str:
    """The digest of a file's bytes, from the notes where its stamp is the one noted."""
    stamp = _stamp(file)
    text = " ".join(str(number) for number in stamp)
    path = hashlib.blake2b(os.fsencode(file), digest_size=16).hexdigest()
    note = cache_root() / "notes-v1" / path[:2] / path
    with suppress(OSError, ValueError):
        noted, check, digest = note.read_text(encoding="ascii").split("\n")
        if noted == text and check == _check(text, digest):
            return digest
    with file.open("rb") as content:
        digest = hashlib.file_digest(content, lambda: hashlib.blake2b(digest_size=32)).hexdigest()
    if _settled(stamp) and _stamp(file) == stamp:
        _write_note(note, f"{text}\n{_check(text, digest)}\n{digest}")
    return digest


def _settled(stamp: tuple[int, int, int, int]) -> bool:
    return time.time() - max(stamp[1], stamp[2]) / 1e9 > SETTLED


def _write_note(note: Path, text: str) -> None:
    with suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True)
        unfinished = note.with_name(f".{note.name}.{os.getpid()}-{time.monotonic_ns()}.tmp")
        try:
            unfinished.write_text(text, encoding="utf-8")
            os.replace(unfinished, note)
        finally:
            unfinished.unlink(missing_ok=True)


def _check(*texts: str) -> str:
    return hashlib.blake2b("\n".join(texts).encode(), digest_size=8).hexdigest()


def _code_digest() -> str:
    """The digest of every file of this package that a scene can depend on: a changed reader never gives what the old one gave."""
    package, hasher = Path(__file__).parent, hashlib.blake2b(digest_size=16)
    for file in sorted(package.rglob("*")):
        if NO_SCENES.isdisjoint(file.relative_to(package).parts) and file.is_file():
            with suppress(OSError):  # an editor's file of a moment
                hasher.update(file.relative_to(package).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return hasher.hexdigest()


# Taken when this module is imported, as near as can be to when Python reads the code that then runs.
_CODE = _code_digest()


@cache
def _library_versions() -> tuple[str, ...]:
    return tuple(_version(name) for name in LIBRARIES)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _not_negative(number: float) -> float:
    if not number >= 0:
        raise ValueError("negative, or not a number")
    return number
