"""Names -> scenes: ``load_scene("mp3d:<scan folder>")``, ``"file:<mesh>"``, ``"homes:<split>/<n>"``."""

from __future__ import annotations

from collections.abc import Callable

from openmap_scenes.errors import DataError
from openmap_scenes.scene import Scene


def _read_mp3d(rest: str) -> Scene:
    from openmap_scenes.formats.mp3d import read_mp3d

    return read_mp3d(rest)


def _read_file(rest: str) -> Scene:
    from openmap_scenes.formats.glb import read_glb

    return read_glb(rest)


def _build_home(rest: str) -> Scene:
    from openmap_scenes.homes import build_home

    return build_home(rest)


READERS: dict[str, Callable[[str], Scene]] = {"mp3d": _read_mp3d, "file": _read_file, "homes": _build_home}


def load_scene(spec: str) -> Scene:
    """Load the scene that a spec names.

    Parameters
    ----------
    spec : str
        ``mp3d:<scan folder>``, ``file:<mesh>`` or ``homes:<split>/<n>``.

    Raises
    ------
    DataError
        The spec or what it names cannot be used.
    """
    kind, colon, rest = spec.partition(":")
    if not colon or kind not in READERS:
        raise DataError(f"scene spec {spec!r}", f"kind {kind!r}", f"one of {', '.join(f'{k}:...' for k in READERS)}")
    return READERS[kind](rest)
