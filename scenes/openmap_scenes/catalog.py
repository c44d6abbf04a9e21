"""Names -> scenes: ``load_scene("mp3d:<scan folder>")``, ``"file:<mesh>"``, ``"homes:<split>/<n>"`` ..."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from openmap_scenes.cache import cache_limit, cached, note_files, recall_files
from openmap_scenes.discovery import check_exists, guess_spec, list_scenes
from openmap_scenes.errors import DataError
from openmap_scenes.scene import Scene

__all__ = ["READERS", "expand_specs", "guess_spec", "list_scenes", "load_scene"]

# Kind -> module in ``formats``, which has ``read_<kind>(path) -> Scene`` and ``files_<kind>(path) -> list of all that it reads``.
FORMATS = {
    "mp3d": "mp3d",
    "hm3d": "hm3d",
    "gibson": "gibson",
    "replica": "replica",
    "scannet": "scannet",
    "file": "glb",
}
HOME_SPLITS = ("train", "val", "test")
MOST_HOMES = 100_000
_RANGES = re.compile(r"\d+(-\d+)?(,\d+(-\d+)?)*", re.ASCII)


def _read(kind: str, rest: str) -> Scene:
    scene: Scene = _function("read", kind)(Path(rest))
    return scene


def _function(verb: str, kind: str) -> Callable[[Path], Any]:
    # Readers are imported when they are needed: their libraries take longer to load than a kept scene.
    function: Callable[[Path], Any] = getattr(
        import_module(f"openmap_scenes.formats.{FORMATS[kind]}"), f"{verb}_{kind}"
    )
    return function


def _build_home(rest: str) -> Scene:
    from openmap_scenes.homes import build_home

    return build_home(rest)


READERS: dict[str, Callable[[str], Scene]] = {kind: partial(_read, kind) for kind in FORMATS} | {"homes": _build_home}


def load_scene(spec: str, cache: bool = True) -> Scene:
    """Load the scene that a spec names.

    Parameters
    ----------
    spec : str
        ``mp3d:<scan folder>``, ``hm3d:<scan folder>``, ``gibson:<glb>``, ``replica:<scan folder>``, ``scannet:<scan folder>``,
        ``file:<mesh>`` or ``homes:<split>/<n>``; or the path of a scan or mesh, whose kind its files tell.
    cache : bool
        Keep the scene for next time, and take what was kept (see ``openmap_scenes.cache``); its arrays are read-only then.

    Raises
    ------
    DataError
        The spec or what it names cannot be used.
    """
    kind, rest = _split(spec)
    if kind == "homes":
        split, numbers = _home(rest)
        if len(numbers) != 1:
            raise DataError(f"scene spec {spec!r}", f"{len(numbers)} homes", "one", "Name a single one.")
    elif kind in FORMATS:
        check_exists(Path(rest), "a mesh" if kind in ("file", "gibson") else f"the folder of a scan ({kind})")
    read = partial(READERS[kind], rest)
    if not cache or not cache_limit() or kind not in {*FORMATS, "homes"}:
        return read()
    if kind == "homes":
        return cached(["homes", split, str(numbers[0]), *_furniture()], [], read)
    return _load_from_files(kind, Path(rest), read)


def _load_from_files(kind: str, path: Path, read: Callable[[], Scene]) -> Scene:
    source = f"{kind}:{path}"
    files = recall_files(kind, path)
    if files is not None:
        return cached([kind], files, read, source)
    files = _function("files", kind)(path)
    scene = cached([kind], files, read, source)
    # Where something is missing it may turn up in a folder that nobody watches, so the reader looks for it each time.
    if not any(m.missing_texture for m in scene.materials) and (scene.instances or kind == "file"):
        note_files(kind, path, files)
    return scene


def expand_specs(spec: str) -> list[str]:
    """All specs that one stands for.

    ``homes:val/0-9`` and ``homes:val/0,3,5-7`` are several homes; the path of a scan or mesh is that scene, the path of a folder
    of datasets is every scene below it; every other spec is itself.

    Raises
    ------
    DataError
        The spec cannot be used, or nothing lies there.
    """
    if _is_path(spec):
        path = Path(spec)
        specs = [guess_spec(path)] if path.is_file() else list_scenes(path)
        return specs or [guess_spec(path)]
    kind, rest = _split(spec)
    if kind != "homes":
        return [spec]
    split, numbers = _home(rest)
    return [f"homes:{split}/{number}" for number in numbers]


def _is_path(spec: str) -> bool:
    return bool(spec) and spec.partition(":")[0] not in READERS and Path(spec).exists()


def _split(spec: str) -> tuple[str, str]:
    """Kind and rest of a spec."""
    if _is_path(spec):
        spec = guess_spec(spec)
    kind, _, rest = spec.partition(":")
    where = f"scene spec {spec!r}"
    if kind in READERS and rest.strip():
        # A shell expands ~ only at the start of a word.
        return kind, str(Path(rest).expanduser()) if rest.startswith("~") else rest
    expected = f"one of {', '.join(f'{k}:...' for k in READERS)}, or the path of a scan or mesh"
    if kind in READERS:
        example = "homes:val/0" if kind == "homes" else f"{kind}:{'<mesh>' if kind == 'file' else '<scan folder>'}"
        raise DataError(where, "nothing after the colon" if ":" in spec else "no colon", f"{example}")
    if ":" not in spec and ("/" in spec or "\\" in spec):
        check_exists(Path(spec), expected)
    near = get_close_matches(kind.lower(), list(READERS), 1, 0.5)
    guess = f"{near[0]}:{rest or ('val/0' if near[0] == 'homes' else '...')}" if near else ""
    raise DataError(where, f"kind {kind!r}", expected, f"Did you mean {guess}?" if guess else "")


def _home(rest: str) -> tuple[str, list[int]]:
    """Split and numbers of a home's spec, ``val/3``, ``val/0-9`` or ``val/0,3,5-7``."""
    split, _, text = rest.partition("/")
    where, expected = f"scene spec 'homes:{rest}'", f"homes:<split>/<n> with a split of {', '.join(HOME_SPLITS)}"
    if split not in HOME_SPLITS:
        near = get_close_matches(split.lower(), HOME_SPLITS, 1, 0.5)
        remedy = f"Did you mean homes:{near[0]}/{text or '0'}?" if near else ""
        raise DataError(where, f"split {split!r}", expected, remedy)
    if not _RANGES.fullmatch(text):
        remedy = f"For example homes:{split}/0, or homes:{split}/0-9 where several may be named."
        raise DataError(where, f"{text!r} for a number" if text else "no number", expected, remedy)
    numbers: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        low, high = int(first), int(last or first)
        if low > high or len(numbers) + high - low >= MOST_HOMES:
            found = f"the range {part}"
            raise DataError(where, found, f"the smaller number first, and at most {MOST_HOMES} homes")
        numbers += range(low, high + 1)
    return split, numbers


def _furniture() -> list[str]:
    """What the furniture library holds, as far as file names, sizes and time stamps tell; one line for no library."""
    try:
        archives = [(path.name, path.stat()) for path in sorted(furniture_folder().glob("*.sh3f"))]
    except OSError:
        archives = []
    return [f"{name} {status.st_size} {status.st_mtime_ns}" for name, status in archives] or ["no library"]


def furniture_folder() -> Path:
    """As ``homes.library.furniture_folder``, without importing what builds homes."""
    return Path(os.environ.get("OPENMAP_FURNITURE", "/usr/share/sweethome3d/furniture"))
