"""Perception alone, in a process of its own: ``python -m openmap_eval.bench.perception_child`` reads one JSON line of what to do.

``{"frames": [paths], "segmenter", "encoder", "threads", "warm", "labels", "hfov_deg"}``; prints one JSON line of figures.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np


def main() -> None:
    task = json.loads(sys.stdin.readline())
    cv2.setNumThreads(task["threads"])  # the only library here that takes no variable for it
    print(json.dumps(measure(task)), flush=True)


def measure(task: dict[str, Any]) -> dict[str, Any]:
    """Load perception, show it the frames, then ask it for words; memory in MiB, times in ms."""
    import psutil

    from openmap_eval.bench.memory import peak_mib
    from openmap_eval.bench.perception_stages import StageClock, install

    memory = {"python": psutil.Process().memory_info().rss / 2**20}
    started = time.perf_counter()
    from openmap_agents.perception import colour as colours
    from openmap_agents.perception import make_perception

    segmenter, encoder = make_perception(task["segmenter"], task["encoder"])
    loading = time.perf_counter() - started
    memory["loaded"] = psutil.Process().memory_info().rss / 2**20
    clock = StageClock()
    stages = install(clock)
    rows: list[dict[str, Any]] = []
    for number, path in enumerate(task["frames"]):
        rgb, depth, pose, camera = read_frame(path, task["hfov_deg"])
        clock.start()
        wall, cpu = time.perf_counter(), time.process_time()
        masks = segmenter.segment(rgb, depth, pose, camera)
        between, cpu_between = time.perf_counter(), time.process_time()
        encoder.encode_regions(rgb, depth, masks, pose, camera)
        end, cpu_end = time.perf_counter(), time.process_time()
        whole = {
            "segment": ((between - wall) * 1e3, (cpu_between - cpu) * 1e3),
            "encode": ((end - between) * 1e3, (cpu_end - cpu_between) * 1e3),
            "frame": ((end - wall) * 1e3, (cpu_end - cpu) * 1e3),
        }
        inside = dict(clock.milliseconds)
        rest = tuple(a - sum(t[k] for t in inside.values()) for k, a in enumerate(whole["frame"]))
        colours.region_colour(rgb, masks)
        if number >= task["warm"]:
            rows.append({"masks": len(masks), "stages": {**clock.milliseconds, "rest": rest}, "whole": whole})
    memory["after the frames"] = psutil.Process().memory_info().rss / 2**20
    memory["at most"] = peak_mib()
    text = texts(encoder.encode_text, task["labels"])
    if task["encoder"] == "embedded":
        text |= bank(task["labels"])
    memory["after the words"] = psutil.Process().memory_info().rss / 2**20
    order = [stage for stage in (*stages, "rest") if any(stage in row["stages"] for row in rows)]
    return {
        "loading_seconds": loading,
        "masks": float(np.mean([row["masks"] for row in rows])),
        "whole": {name: spread([row["whole"][name] for row in rows]) for name in ("frame", "segment", "encode")},
        "stages": {name: spread([row["stages"].get(name, (0.0, 0.0)) for row in rows]) for name in order},
        "text": text,
        "memory_mib": memory,
    }


def read_frame(path: str, hfov_deg: float) -> tuple[Any, Any, Any, Any]:
    """(rgb, depth, T_world_camera, camera) of a file that ``perception.write_frames`` wrote."""
    from openmap_scenes import PinholeCamera

    with np.load(path, allow_pickle=False) as file:
        rgb, depth, pose = file["rgb"], file["depth"], file["T_world_camera"]
    return rgb, depth, pose, PinholeCamera.from_hfov(rgb.shape[1], rgb.shape[0], hfov_deg)


def texts(encode: Callable[[list[str]], Any], labels: list[str]) -> dict[str, Any]:
    """Milliseconds of all labels together, for the first time and again."""
    return {f"{len(labels)} labels, first": took(encode, labels), f"{len(labels)} labels, again": took(encode, labels)}


def bank(labels: list[str]) -> dict[str, Any]:
    """The same as a bank of words that outlives the process, with nothing in memory either time."""
    from openmap_agents.perception.text import TextEncoder

    first, again = TextEncoder(), TextEncoder()
    return {
        "as a bank, first": took(first.encode_many, labels),
        "as a bank, by another process": took(again.encode_many, labels),
    }


def took(encode: Callable[[list[str]], Any], labels: list[str]) -> dict[str, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    encode(labels)
    return {"wall": (time.perf_counter() - wall) * 1e3, "cpu": (time.process_time() - cpu) * 1e3}


def spread(values: list[tuple[float, float]]) -> dict[str, dict[str, float]]:
    """Median and 90th percentile of (wall, CPU) ms."""
    columns = zip(("wall", "cpu"), np.array(values, np.float64).T, strict=True)
    return {name: {"median": float(np.median(c)), "p90": float(np.percentile(c, 90))} for name, c in columns}


if __name__ == "__main__":
    main()
