"""Vectors of fixed lists of texts, kept between runs in the user's cache folder.

A file is named after what it holds: the texts and the encoder. One that cannot be read, or does not hold what its name says,
counts as absent and is written anew; a folder that cannot be written costs time and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]


def folder() -> Path:
    """Where the vectors are kept: ``$XDG_CACHE_HOME/openmapnav/text``, by default under ``~/.cache``."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "openmapnav" / "text"


def key(texts: list[str], encoder: bytes) -> str:
    """Hex digest of the texts and of bytes that tell the encoder from others."""
    digest = hashlib.sha256(json.dumps(texts).encode())
    digest.update(encoder)
    return digest.hexdigest()[:32]


def load(name: str, count: int) -> FloatArray | None:
    """The vectors (count, D) float32 of the file of that name; None if there is none that is whole."""
    try:
        found = np.load(folder() / f"{name}.npy", allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    if not isinstance(found, np.ndarray) or found.dtype != np.float32 or found.ndim != 2 or len(found) != count:
        return None
    lengths = np.linalg.norm(found, axis=1)
    return found if np.isfinite(lengths).all() and bool((lengths < 1.01).all()) else None


def store(name: str, vectors: FloatArray) -> None:
    """Write vectors (n, D) under that name, whole or not at all."""
    with suppress(OSError):
        folder().mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder()) as aside:
            np.save(Path(aside) / "new.npy", vectors, allow_pickle=False)
            os.replace(Path(aside) / "new.npy", folder() / f"{name}.npy")
