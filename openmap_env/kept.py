"""Arrays that follow from a scene and cost seconds to make (its navigable surface, its draw order), kept on disk between processes.

They lie in ``derived-v1`` in the same cache folder as the scenes. The key is made of the content of what they are made from and of
the code that makes them, so what is found is never stale. What cannot be kept, or is damaged, is made again.
"""

from __future__ import annotations

import hashlib
import logging
import os
import secrets
import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes.cache import cache_limit, cache_root

Arrays = dict[str, npt.NDArray[Any]]

SHARE = 0.25
"""Of the bytes that may be kept of scenes, as many again may be kept of what follows from them."""
_LEFTOVER_AGE = 3600.0
_log = logging.getLogger(__name__)


def kept(
    kind: str,
    parts: Iterable[npt.NDArray[Any] | str | None],
    makers: Iterable[ModuleType],
    make: Callable[[], Mapping[str, npt.NDArray[Any]]],
) -> Arrays:
    """The named arrays that ``make`` gives, from the cache where they are there; then read-only memory maps.

    Parameters
    ----------
    kind : str
        What they are, a word for a file's name.
    parts : iterable of array, str or None
        Everything that decides what they are: their bytes, shapes and types are the key.
    makers : iterable of module
        The modules whose code makes them; another version of their source is another key.
    make : callable
        Its errors pass through, and nothing is kept then.
    """
    limit = int(SHARE * cache_limit())
    if not limit:
        return dict(make())
    entry = derived_folder() / f"{kind}-{_key(parts, makers)}"
    found = _open(entry)
    if found is not None:
        return found
    made = dict(make())
    try:
        _keep(entry, made, limit)
    except OSError as error:
        _log.warning("%s is not kept for next time in %s: %s", kind, entry.parent, error)
        return made
    return _open(entry) or made


def kept_before(
    kind: str, parts: Iterable[npt.NDArray[Any] | str | None], makers: Iterable[ModuleType]
) -> Arrays | None:
    """What ``kept`` would find with these arguments, or None where it would have to make it."""
    return _open(derived_folder() / f"{kind}-{_key(parts, makers)}")


def derived_folder() -> Path:
    """Where the arrays are kept, one folder a set of them."""
    return cache_root() / "derived-v1"


def _key(parts: Iterable[npt.NDArray[Any] | str | None], makers: Iterable[ModuleType]) -> str:
    hasher = hashlib.blake2b(np.__version__.encode(), digest_size=16)
    for maker in makers:
        hasher.update(Path(str(maker.__file__)).read_bytes())
    for part in parts:
        if isinstance(part, np.ndarray):
            hasher.update(f"{part.dtype.str} {part.shape}".encode())
            hasher.update(np.ascontiguousarray(part).data)
        else:
            hasher.update(repr(part).encode())
    return hasher.hexdigest()


def _open(entry: Path) -> Arrays | None:
    """The arrays of an entry, now the one used last; None where there is none or it is damaged."""
    try:
        arrays = {
            file.stem: np.load(file, mmap_mode="r" if file.stat().st_size > 4096 else None, allow_pickle=False)
            for file in sorted(entry.iterdir())
        }
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError) as error:
        _log.warning("%s is damaged and made again: %s", entry, error)
        shutil.rmtree(entry, ignore_errors=True)
        return None
    with suppress(OSError):
        os.utime(entry)
    return arrays or None


def _keep(entry: Path, arrays: Arrays, limit: int) -> None:
    """Write an entry, whole or not at all."""
    size = sum(array.nbytes + 128 for array in arrays.values())
    if size > limit:
        raise OSError(f"{size / 1e9:.2f} GB are more than OPENMAP_CACHE_GB allows")
    entry.parent.mkdir(parents=True, exist_ok=True)
    _evict(entry.parent, limit - size)
    unfinished = entry.with_name(f".{entry.name}.{os.getpid()}-{secrets.token_hex(4)}")
    unfinished.mkdir()
    try:
        for name, array in arrays.items():
            np.save(unfinished / f"{name}.npy", array, allow_pickle=False)
        # Another process may have kept the same meanwhile; then its entry stays.
        with suppress(OSError):
            os.rename(unfinished, entry)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _evict(folder: Path, limit: int) -> None:
    """Remove entries, those not used for the longest time first, until at most ``limit`` bytes are left; and old leftovers."""
    entries = []
    for item in folder.iterdir():
        with suppress(OSError):
            status = item.stat()
            if not item.name.startswith("."):
                entries.append((status.st_mtime_ns, item, sum(file.stat().st_size for file in item.iterdir())))
            elif status.st_mtime < time.time() - _LEFTOVER_AGE:
                shutil.rmtree(item, ignore_errors=True)
    total = sum(size for _, _, size in entries)
    for _, item, size in sorted(entries):
        if total <= limit:
            return
        shutil.rmtree(item, ignore_errors=True)
        total -= size
