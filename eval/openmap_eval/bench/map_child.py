"""Mapping alone, in a process of its own: ``python -m openmap_eval.bench.map_child`` reads one JSON line of what to do.

``{"what": "mapper" | "reference" | "peer", "sequence", "masks", "features", "cloud": paths, "frames": [numbers], "step", "warm",
"camera", "settings", "ask_every"}``; prints one JSON line of figures. Nothing is imported that the map does not need, so that the
memory is the map's.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from openmap_eval.bench.memory import peak_mib

Frame = tuple[Any, Any, Any, Any]


def main() -> None:
    task = json.loads(sys.stdin.readline())
    cv2.setNumThreads(task["threads"])
    print(json.dumps(MEASURES[task["what"]](task, Frames(task))), flush=True)


class Frames:
    """Kept frames, read one by one; the time of reading is taken, to be left out.

    Attributes
    ----------
    reading : float
        CPU seconds so far.
    """

    def __init__(self, task: dict[str, Any]) -> None:
        from openmap_scenes import PinholeCamera

        self._task, self.reading = task, 0.0
        self.camera = PinholeCamera(**task["camera"])
        self._poses = np.load(Path(task["sequence"]) / "T_world_camera.npy", allow_pickle=False)

    def __iter__(self) -> Iterator[Frame]:
        return (self.read(n) for n in self._task["frames"])

    def read(self, n: int) -> Frame:
        """``(depth m, masks, features or None, T_world_camera)``."""
        start, step = time.process_time(), self._task["step"]
        depth = cv2.imread(f"{self._task['sequence']}/{n:05d}_depth.png", cv2.IMREAD_UNCHANGED)
        labels = cv2.imread(f"{self._task['masks']}/{n:05d}.png", cv2.IMREAD_UNCHANGED)
        if depth is None or labels is None:
            raise FileNotFoundError(f"frame {n} of {self._task['sequence']}")
        near = np.ascontiguousarray(depth[::step, ::step]).astype(np.float32) * np.float32(1e-3)
        frame = near, np.ascontiguousarray(labels[::step, ::step]).astype(np.int32), self._feature(n), self._poses[n]
        self.reading += time.process_time() - start
        return frame

    @cached_property
    def _features(self) -> tuple[Any, Any] | None:
        if self._task["features"] is None:
            return None
        with np.load(self._task["features"], allow_pickle=False) as file:
            return file["starts"], file["features"]

    def _feature(self, n: int) -> Any:
        if self._features is None:
            return None
        starts, features = self._features
        return features[starts[n] : starts[n + 1]]


def resident_mib() -> float:
    """What this process holds now."""
    import psutil

    return float(psutil.Process().memory_info().rss / 2**20)


def measure_mapper(task: dict[str, Any], frames: Frames) -> dict[str, Any]:
    """Milliseconds of every frame (wall, CPU, whether it was used), of asking on the way and of the end; memory in MiB."""
    from openmap_agents.mapping import MappingSettings, OpenMapper

    settings = MappingSettings(**task["settings"])
    warm = OpenMapper(frames.camera, settings)
    for n in task["frames"][: task["warm"]]:
        warm.integrate(*frames.read(n))
    warm.finalize()
    del warm
    before = resident_mib()
    mapper = OpenMapper(frames.camera, settings)
    rows, asked = [], []
    for number, frame in enumerate(frames, 1):
        wall, cpu = time.perf_counter(), time.process_time()
        used = mapper.integrate(*frame)
        rows.append(((time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3, bool(used)))
        if task["ask_every"] and number % task["ask_every"] == 0 and number < len(task["frames"]):
            wall, cpu = time.perf_counter(), time.process_time()
            found = len(mapper.instance_map)
            took = (time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3
            asked.append({"after": number, "wall": took[0], "cpu": took[1], "instances": found, "mib": resident_mib()})
    wall, cpu = time.perf_counter(), time.process_time()
    found = len(mapper.finalize())
    end = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    wall_ms, cpu_ms, used_ = (list(column) for column in zip(*rows, strict=True))
    return {
        "wall_ms": wall_ms, "cpu_ms": cpu_ms, "used": used_, "asked": asked, "finalize_seconds": end,
        "cpu_seconds": sum(cpu_ms) / 1e3 + sum(a["cpu"] for a in asked) / 1e3 + end["cpu"],
        "instances": found, "voxels": mapper.n_voxels, "before_mib": before, "peak_mib": peak_mib(),
    }  # fmt: skip


def measure_reference(task: dict[str, Any], frames: Frames) -> dict[str, Any]:
    """CPU seconds and memory of the plain reference."""
    from openmap_agents.mapping import MappingSettings
    from openmap_agents.mapping.reference import reference_map
    from openmap_agents.mapping.reference_soft import reference_soft_map

    settings = MappingSettings(**task["settings"])
    make = reference_soft_map if settings.consensus == "soft" else reference_map
    make(frames.camera, [frames.read(n) for n in task["frames"][: task["warm"]]], settings)
    before, start, read = resident_mib(), time.process_time(), frames.reading
    found = make(frames.camera, frames, settings)
    return _whole(len(found), before, time.process_time() - start - (frames.reading - read))


def measure_peer(task: dict[str, Any], frames: Frames) -> dict[str, Any]:
    """CPU seconds and memory of MaskClustering on a finished cloud."""
    from openmap_agents.baselines.maskclustering import MaskClusteringSettings, mask_clustering

    settings, cloud = MaskClusteringSettings(**task["settings"]), np.load(task["cloud"], allow_pickle=False)
    mask_clustering(frames.camera, [frames.read(n) for n in task["frames"][: task["warm"]]], cloud, settings)
    before, start, read = resident_mib(), time.process_time(), frames.reading
    found = mask_clustering(frames.camera, frames, cloud, settings)
    return _whole(len(found), before, time.process_time() - start - (frames.reading - read))


def _whole(instances: int, before: float, seconds: float) -> dict[str, Any]:
    return {"cpu_seconds": seconds, "instances": instances, "before_mib": before, "peak_mib": peak_mib()}


MEASURES = {"mapper": measure_mapper, "reference": measure_reference, "peer": measure_peer}

if __name__ == "__main__":
    main()
