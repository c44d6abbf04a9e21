"""One renderer in a process of its own: ``python -m openmap_eval.bench.render_child CONTENDER FOLDER...``.

FOLDER is where ``save_scene`` wrote the home; the leak test gives two. Reads one JSON request a line and answers each with one
JSON line: ``open`` (width, height, places: a .npy file), ``time`` (poses: a .npy file), ``show`` (poses, to: an .npz file),
``grow`` (frames or switches), ``close``. An answer with ``error`` is the last one. What libraries print goes to the error stream.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from openmap_eval.bench.render_contenders import CONTENDERS, HFOV_DEG
from openmap_scenes import PinholeCamera, Scene
from openmap_scenes.store import open_scene

Request = dict[str, Any]
_WARM_UP = 10


class Eye(Protocol):
    """What is measured: it shows rgb (H, W, 3) uint8 and depth (H, W) float32 m, and ids (H, W) int32 if it can."""

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> tuple[npt.NDArray[Any] | None, ...]:
        """(rgb, depth, ids), None for what it cannot show."""
        ...

    def close(self) -> None:
        """Give everything back."""
        ...


class _OwnEye:
    """One of this package's renderers."""

    def __init__(self, scene: Scene, camera: PinholeCamera, backend: str, settings: dict[str, Any]) -> None:
        from openmap_env.rendering import make_renderer

        self._renderer: Any = make_renderer(backend, scene, camera, **settings)
        self._places: npt.NDArray[np.float64] | None = None
        self.close = self._renderer.close

    def learn(self, places: npt.NDArray[np.float64]) -> None:
        """Find out ahead what shows from places (n, 3) m."""
        self._places = places
        self._renderer.learn(places)

    def forget(self) -> None:
        """Forget what showed so far: every round is the first of its walk. What was found out ahead stays."""
        if hasattr(self._renderer, "forget"):
            self._renderer.forget()
            if self._places is not None:
                self._renderer.learn(self._places)

    def show(self, T_world_camera: npt.NDArray[np.float64]) -> tuple[npt.NDArray[Any] | None, ...]:
        frame = self._renderer.render(T_world_camera)
        return frame.rgb, frame.depth, frame.instance


def open_eye(name: str, scene: Scene, camera: PinholeCamera) -> Eye:
    """The contender of that name, ready for its first frame."""
    contender = CONTENDERS[name]
    if contender.peer:
        from openmap_eval.bench import render_peers

        eye: Eye = render_peers.PEERS[contender.backend](scene, camera)
        return eye
    return _OwnEye(scene, camera, contender.backend, contender.settings)


class _Child:
    def __init__(self, name: str, folders: list[Path]) -> None:
        import psutil

        self._name, self._process = name, psutil.Process()
        self._scenes = [open_scene(folder) for folder in folders]
        self._eye: Eye | None = None
        self._camera = PinholeCamera.from_hfov(8, 8, HFOV_DEG)

    def answer(self, request: Request) -> dict[str, Any]:
        work: dict[str, Callable[[Request], dict[str, Any]]] = {
            "open": self._open, "time": self._time, "show": self._show, "grow": self._grow, "close": self._close,
        }  # fmt: skip
        return work[request["do"]](request)

    def _open(self, request: Request) -> dict[str, Any]:
        """Seconds until the first frame was shown, libraries loaded included."""
        self._camera = PinholeCamera.from_hfov(request["width"], request["height"], HFOV_DEG)
        began = time.perf_counter()
        self._eye = open_eye(self._name, self._scenes[0], self._camera)
        self._eye.show(np.load(request["poses"])[0])
        seconds, began = time.perf_counter() - began, time.perf_counter()
        if isinstance(self._eye, _OwnEye) and CONTENDERS[self._name].learns:
            self._eye.learn(np.load(request["places"]))
        return {"seconds": seconds, "learn_seconds": time.perf_counter() - began}

    def _time(self, request: Request) -> dict[str, Any]:
        """Wall and CPU seconds for all poses, one after the other; resident memory after them, MiB."""
        assert self._eye is not None
        poses = np.load(request["poses"])
        for T in poses[:_WARM_UP]:
            self._eye.show(T)
        if isinstance(self._eye, _OwnEye):
            self._eye.forget()
        wall, cpu = time.perf_counter(), time.process_time()
        for T in poses:
            self._eye.show(T)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        return {"wall_s": wall, "cpu_s": cpu, "frames": len(poses), "rss_mib": self._rss()}

    def _show(self, request: Request) -> dict[str, Any]:
        """Write what is seen from the poses, as arrays of all frames."""
        assert self._eye is not None
        frames = [self._eye.show(T) for T in np.load(request["poses"])]
        named = zip(("rgb", "depth", "ids"), zip(*frames, strict=True), strict=True)
        found: dict[str, Any] = {name: np.stack(arrays) for name, arrays in named if arrays[0] is not None}
        np.savez(request["to"], **found)
        return {"shows": list(found)}

    def _grow(self, request: Request) -> dict[str, Any]:
        """Growth of resident memory, MiB, over so many frames, or over so many changes of the scene, after a warm-up."""
        poses = np.load(request["poses"])
        frames, switches = request.get("frames", 0), request.get("switches", 0)
        if frames:
            assert self._eye is not None
            for k in range(200):
                self._eye.show(poses[k % len(poses)])
            before = self._settled()
            for k in range(frames):
                self._eye.show(poses[k % len(poses)])
            return {"mib": self._settled() - before}
        self._close(request)
        before = 0.0
        for k in range(-10, switches):  # the allocator takes some rounds until it holds all that it will ever need
            if k == 0:
                before = self._settled()
            eye = open_eye(self._name, self._scenes[k % len(self._scenes)], self._camera)
            for T in poses[:20]:
                eye.show(T)
            eye.close()
        return {"mib": self._settled() - before}

    def _close(self, request: Request) -> dict[str, Any]:
        if self._eye is not None:
            self._eye.close()
            self._eye = None
        return {}

    def _settled(self) -> float:
        gc.collect()
        return self._rss()

    def _rss(self) -> float:
        return float(self._process.memory_info().rss) / 2**20


def main(arguments: list[str]) -> None:
    """Answer requests until there are no more."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    child: _Child | None = None
    for line in sys.stdin:
        try:
            child = child or _Child(arguments[0], [Path(folder) for folder in arguments[1:]])
            answer = child.answer(json.loads(line))
        except Exception as error:  # whatever a peer's library raises is its answer
            answer = {"error": f"{type(error).__name__}: {error}".replace("\n", " ")}
        print(json.dumps(answer), file=answers, flush=True)
        if "error" in answer:
            break
    # Some libraries crash while the process ends, after all their answers were given.
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
