"""What perception said of a recording's frames, kept on disk while a map is built, so that a run that was killed goes on.

A folder with

- ``run.json``: what the run is of (recording, camera, specs, settings); another run is refused;
- ``<n>.npz``: masks and features of the n-th frame (``stored_frames`` has the format), complete or not there;
- ``frames.jsonl``: one line for each of those, written after it: its number, and digests of its picture and of all that
  perception was given. A line that a kill cut short is dropped, and its frame is seen again;
- ``lock``: held by the process that is at work here, and let go of by the kernel when that ends in any way.

``write_index`` makes it a folder for ``precomputed:``.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.perception import Masks
from openmap_agents.perception.stored_frames import (
    INDEX,
    StoredFrame,
    picture_digest,
    read_frame,
    replacing,
    write_frame,
    write_index,
)
from openmap_scenes import DataError
from openmap_scenes.recordings import Frame

try:
    import fcntl
except ImportError:  # Windows, where two processes are not kept apart
    fcntl = None  # type: ignore[assignment]

FORMAT, VERSION = "openmap-kept-frames", 1
_RUN, _JOURNAL, _LOCK = "run.json", "frames.jsonl", "lock"
_OURS = re.compile(rf"[0-9]+\.npz|{re.escape(_RUN)}|{re.escape(_JOURNAL)}|{re.escape(INDEX)}|\..*\.tmp")
_LARGEST_TEXT = 16 << 20
_REMEDY = "Give the command of that run to go on with it, or add --fresh (fresh=True) to drop what it kept."


@dataclass(frozen=True)
class _Entry:
    seen: str
    picture: str


class KeptFrames:
    """The folder of one run; a context manager that holds its lock, and leaves nothing behind where no frame is kept.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    fresh : bool
        Drop what an earlier run kept in it.
    about : mapping of JSON values, optional
        What else the run is of, beside what ``begin`` is told.

    Raises
    ------
    DataError
        Another process is at work in it, or it cannot be used.
    """

    def __init__(self, folder: str | Path, *, fresh: bool = False, about: Mapping[str, Any] | None = None) -> None:
        self.folder, self._about = Path(folder), dict(about or {})
        self._entries: dict[int, _Entry] = {}
        if self.folder.exists() and not self.folder.is_dir():
            raise DataError(self.folder, "a file", "a folder for what is kept while a map is built")
        self._handle: int | None = _locked(self.folder)
        try:
            if fresh:
                self._clear()
            self._read_journal()
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        """How many frames are kept."""
        return len(self._entries)

    def __enter__(self) -> KeptFrames:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._handle is not None and not self._entries:
            self.remove()
        self.close()

    def close(self) -> None:
        """Let go of the lock; what is kept stays."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None

    def remove(self) -> None:
        """Remove the folder, but for files that are none of ours, and let go of the lock."""
        self._clear()
        with suppress(OSError):
            (self.folder / _LOCK).unlink()
        with suppress(OSError):
            self.folder.rmdir()
        self.close()

    def begin(self, run: Mapping[str, Any]) -> None:
        """Say what the run is of, a JSON object of objects; what is kept must be of the same.

        Raises
        ------
        DataError
            It is of another; the error says what differs.
        """
        path = self.folder / _RUN
        wanted = json.loads(json.dumps({"format": FORMAT, "version": VERSION, **self._about, **run}))
        if not path.exists():
            self._clear()  # frames of nobody knows what
            with replacing(path) as file:
                file.write((json.dumps(wanted, indent=1) + "\n").encode())
            return
        there, here = _flat(_read_json(path)), _flat(wanted)
        differing = [name for name in sorted({*there, *here}) if there.get(name) != here.get(name)]
        if differing:
            found, expected = (
                ", ".join(f"{name} {_shown(side, name)}" for name in differing[:6]) for side in (there, here)
            )
            raise DataError(self.folder, f"frames kept by a run with {found}", expected, _REMEDY)

    def read(self, n: int, frame: Frame) -> StoredFrame | None:
        """What is kept of the n-th frame; None if nothing usable is.

        Raises
        ------
        DataError
            It is of another picture, depth or pose: the recording has changed since.
        """
        entry = self._entries.get(n)
        if entry is None:
            return None
        if entry.seen != _digests(frame).seen:
            found = f"what was kept of frame {n} (number {frame.index} of the source) as it was then"
            raise DataError(self.folder, found, "the recording to be as it was when the run began", _REMEDY)
        try:
            return read_frame(self._path(n), (frame.depth.shape[0], frame.depth.shape[1]))
        except DataError:
            return None  # damaged on disk; it is seen again

    def write(self, n: int, frame: Frame, masks: Masks, features: npt.NDArray[np.float32]) -> None:
        """Keep what perception said of the n-th frame: features as they are, to the bit."""
        labels = masks.labels.astype(np.min_scalar_type(len(masks)))  # small numbers are packed in half the time
        write_frame(self.folder, f"{n:06d}", labels, scores=masks.scores, features=features)
        entry = _digests(frame)
        line = json.dumps({"frame": n, "seen": entry.seen, "picture": entry.picture}) + "\n"
        with (self.folder / _JOURNAL).open("ab") as file:
            file.write(line.encode())
        self._entries[n] = entry

    def write_index(self) -> None:
        """Say which picture each file belongs to, so that ``precomputed:<folder>`` finds them."""
        if self._entries:
            write_index(self.folder, {self._path(n).name: entry.picture for n, entry in sorted(self._entries.items())})

    def _path(self, n: int) -> Path:
        return self.folder / f"{n:06d}.npz"

    def _clear(self) -> None:
        self._entries.clear()
        # What vouches for the frames goes first.
        for path in sorted(self.folder.iterdir(), key=lambda p: (p.suffix == ".npz", p.name)):
            if _OURS.fullmatch(path.name):
                path.unlink(missing_ok=True)

    def _read_journal(self) -> None:
        path = self.folder / _JOURNAL
        if not path.exists():
            return
        data = path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            with path.open("r+b") as file:
                file.truncate(len(whole))
        for number, line in enumerate(whole.splitlines(), start=1):
            try:
                entry = json.loads(line)
                self._entries[int(entry["frame"])] = _Entry(str(entry["seen"]), str(entry["picture"]))
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                found = f"line {number}, which is no entry ({type(error).__name__})"
                raise DataError(
                    path, found, '{"frame": n, "seen": digest, "picture": digest} in every line', _REMEDY
                ) from None


def _locked(folder: Path) -> int:
    """The lock of a folder, held; DataError where another process holds it."""
    path = folder / _LOCK
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            try:
                handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            except FileNotFoundError:
                if path.is_symlink():
                    raise  # it leads nowhere, now and later
                continue  # the folder was removed between the two
        except OSError as error:
            raise DataError(folder, f"no way to write to it ({error.strerror})", "a folder to keep frames in") from None
        if not _got(handle):
            os.close(handle)
            found = "another process that is building this map"
            raise DataError(folder, found, "one at a time", "Wait for it, or write to another file.")
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)  # that was the lock of a run that has just ended, and removed it


def _got(handle: int) -> bool:
    """Whether the lock was free; it is where the file system knows none."""
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True
    return True


def _digests(frame: Frame) -> _Entry:
    picture = picture_digest(frame.rgb)
    seen = hashlib.sha256(picture.encode())
    for array in (frame.depth, frame.T_world_camera):
        seen.update(np.ascontiguousarray(array).tobytes())
    return _Entry(seen.hexdigest()[:24], picture)


def _flat(value: Any, name: str = "") -> dict[str, Any]:
    """The leaves of a JSON object by their dotted names."""
    if not isinstance(value, dict):
        return {name: value}
    leaves: dict[str, Any] = {}
    for key, inner in value.items():
        leaves.update(_flat(inner, f"{name}.{key}" if name else key))
    return leaves


def _shown(leaves: Mapping[str, Any], name: str) -> str:
    return repr(leaves[name]) if name in leaves else "(nothing)"


def _read_json(path: Path) -> Any:
    try:
        if path.stat().st_size > _LARGEST_TEXT:
            raise ValueError("over 16 MiB")
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict):
            raise ValueError("not an object")
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(path, f"no JSON object ({error})", "what the run is of", _REMEDY) from None
    return document
