"""One way of loading one file, in a process of its own: ``python -m openmap_eval.bench.loading_child WAY FILE``.

Prints one JSON line when everything is loaded, then holds it until its input ends; for every line that it reads it prints its
memory again, so that processes can be measured beside one another.
"""

from __future__ import annotations

import json
import mmap
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_eval.bench.memory import peak_mib


def trimesh_alone(path: str) -> object:
    """What a renderer needs, by the mesh library alone: geometry as arrays, each texture decoded."""
    import trimesh

    loaded = trimesh.load(path, process=False)
    held: list[npt.NDArray[Any]] = []
    for mesh in loaded.geometry.values():
        held += [np.asarray(mesh.vertices), np.asarray(mesh.faces), np.asarray(mesh.visual.uv)]
        held.append(np.asarray(mesh.visual.material.baseColorTexture.convert("RGB")))
    touch(held)
    return loaded, held


def uncached(path: str) -> object:
    """The reader, with nothing kept for next time."""
    return _ours(path, cache=False, all_pages=True)


def first(path: str) -> object:
    """The reader, then written to an empty cache and opened from there."""
    return _ours(path, cache=True, all_pages=True)


def kept(path: str) -> object:
    """Opened from the cache, where it is already; every page is looked at."""
    return _ours(path, cache=True, all_pages=True)


def opened(path: str) -> object:
    """Opened from the cache, without looking at what was opened."""
    return _ours(path, cache=True, all_pages=False)


def _ours(path: str, cache: bool, all_pages: bool) -> object:
    from openmap_scenes import load_scene

    scene = load_scene(f"file:{path}", cache=cache)
    if all_pages:
        arrays = [scene.vertices, scene.faces, scene.face_material, scene.face_instance, scene.uv, scene.vertex_colour]
        touch([a for a in [*arrays, *(m.texture for m in scene.materials)] if a is not None])
    return scene


WAYS: dict[str, Callable[[str], object]] = {f.__name__: f for f in (trimesh_alone, uncached, first, opened, kept)}


def touch(arrays: list[npt.NDArray[Any]]) -> None:
    """Read from every page of memory of every array."""
    for array in arrays:
        np.ascontiguousarray(array).reshape(-1).view(np.uint8)[:: mmap.PAGESIZE].max(initial=0)


def memory() -> dict[str, float]:
    """Resident, unique and proportional memory of this process, MiB; the last is NaN where the system does not tell it."""
    import psutil

    full = psutil.Process().memory_full_info()
    pss = getattr(full, "pss", float("nan"))
    return {"rss_mib": full.rss / 2**20, "uss_mib": full.uss / 2**20, "pss_mib": pss / 2**20}


def main() -> None:
    way, path = sys.argv[1:]
    # Libraries are loaded before the clock starts; "process_seconds" has them.
    if way == "trimesh_alone":
        import trimesh  # noqa: F401
    elif way in ("uncached", "first"):
        import openmap_scenes.formats.glb
    else:
        import openmap_scenes  # noqa: F401
    before = peak_mib()
    wall, cpu = time.perf_counter(), time.process_time()
    held = WAYS[way](path)
    figures: dict[str, float] = {
        "seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
        "libraries_mib": before,
        "peak_mib": peak_mib(),
    }
    print(json.dumps(figures | memory()), flush=True)
    for _ in sys.stdin:
        print(json.dumps(memory()), flush=True)
    del held


if __name__ == "__main__":
    main()
