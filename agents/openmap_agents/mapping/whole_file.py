"""Files that are there as a whole or not at all, whatever happens while they are written."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from openmap_scenes import DataError


def write_whole_file(path: str | Path, data: bytes) -> None:
    """Write a file so that after a crash or a power cut the path holds the old or the new one, and no piece of one.

    The folder is made where there is none.

    Raises
    ------
    DataError
        The disk is full, or the path cannot be written to.
    """
    path = Path(path)
    unfinished = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with unfinished.open("wb") as file:
            file.write(data)
            file.flush()
            # On the disk before the name points to it.
            os.fsync(file.fileno())
        unfinished.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        found = f"no way to write it ({error.strerror or error})"
        raise DataError(path, found, f"room for {len(data)} bytes in a folder that can be written to") from error
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Bring the new name itself to the disk, where the system can do that for a folder."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
