"""``openmap bench env``: steps a second of one environment and of two side by side, and what of a step is not rendering."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console
from rich.table import Table

from openmap_eval.bench.machine import describe_machine, write_json

WALKS = 8
"""Two environments make them in four turns, eight at once: a step of a batch waits for the slowest, which evens out in eight."""
ROWS: dict[str, tuple[str, dict[str, str]]] = {
    "one": ("one", {}),
    "one, LP_NUM_THREADS=0": ("one", {"LP_NUM_THREADS": "0"}),
    "two, Gymnasium's async": ("gymnasium_async", {"LP_NUM_THREADS": "0"}),
    "two, ours": ("vector", {}),
    "eight, ours, two workers": ("crowd", {}),
}
"""What is measured: a way of ``env_child``, and environment variables; ``LP_NUM_THREADS`` is not set otherwise."""


@dataclass(frozen=True)
class Env:
    """How fast environments step with all sensors on: one, and several in two processes; same walks, in turn, in one run.

    Random walks of fixed seeds, mostly forward. Steps a second count the steps of all environments together. CPU is that of all
    processes. With --leak: how memory grows over many frames and over many changes of scene.
    """

    scene: str = "homes:val/0"
    """The scene of the walks."""
    sizes: tuple[str, ...] = ("256x256", "640x480")
    """Width x height of the camera, px."""
    steps: int = 100
    """Of each of the eight walks."""
    repeats: int = 3
    """Rounds; in each, every row is measured once, and the median counts."""
    renderer: str = "opengl"
    """A backend."""
    leak: bool = False
    """Measure the growth of memory too."""
    leak_scenes: tuple[str, ...] = ("homes:train/0", "homes:train/1", "homes:train/2")
    """Which scenes are gone through for it."""
    leak_frames: int = 5000
    """Frames in one scene."""
    leak_switches: int = 30
    """Changes of scene, at least."""
    seed: int = 0
    """Of the walks."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        result = measure(self)
        for size, rows in result["sizes"].items():
            console.print(_table(result, size, rows))
        for size, figures in result.get("leak", {}).items():
            console.print(
                f"{size}: RSS grew by {figures['rss_growth_over_frames_mib']:.1f} MiB over {figures['frames']} frames and by "
                f"{figures['rss_growth_over_switches_mib']:.1f} MiB over {figures['switches']} changes of scene",
                highlight=False,
            )
        if self.out is not None:
            write_json(self.out, result)
            console.print(f"written: {self.out}", soft_wrap=True)


def measure(settings: Env) -> dict[str, Any]:
    """All figures, as they are written: the settings, the machine, and for each size the rows."""
    if settings.repeats < 1 or settings.steps < 1:
        raise ValueError(f"{settings.repeats} repeats of {settings.steps} steps; expected 1 or more of both")
    sizes = {size: _size(size) for size in settings.sizes}
    result: dict[str, Any] = {
        "benchmark": "env",
        "settings": {name: value for name, value in asdict(settings).items() if name != "out"},
        "machine": describe_machine(),
        "sizes": {},
    }
    for size, shape in sizes.items():
        rounds = [{row: _once(settings, *shape, *ROWS[row]) for row in ROWS} for _ in range(settings.repeats)]
        result["sizes"][size] = {row: _figures(row, rounds, WALKS * settings.steps) for row in ROWS}
    if settings.leak:
        result["leak"] = {size: _once(settings, *shape, "leak", {}) for size, shape in sizes.items()}
    return result


def _figures(row: str, rounds: list[dict[str, dict[str, float]]], steps: int) -> dict[str, float]:
    """Medians over the rounds of a row; ratios are taken within a round."""
    runs = [found[row] for found in rounds]
    figures = {
        "steps_per_second": steps / median(run["wall"] for run in runs),
        "cpu_ms_per_step": median(1e3 * run["cpu"] / steps for run in runs),
        "times_one": median(found["one"]["wall"] / found[row]["wall"] for found in rounds),
        "times_one_lp_0": median(found["one, LP_NUM_THREADS=0"]["wall"] / found[row]["wall"] for found in rounds),
    }
    for name in ("not_rendering", "worker_pss_mib"):
        if name in runs[0]:
            figures[name] = median(run[name] for run in runs)
    return {name: round(value, 3) for name, value in figures.items()}


def _once(settings: Env, width: int, height: int, way: str, variables: dict[str, str]) -> dict[str, float]:
    leak = way == "leak"
    told = {
        "way": way,
        "scenes": list(settings.leak_scenes) if leak else [settings.scene],
        "width": width,
        "height": height,
        "renderer": settings.renderer,
        "steps": settings.leak_frames if leak else settings.steps,
        "walks": WALKS,
        "switches": settings.leak_switches,
        "seed": settings.seed,
    }
    environment = {name: value for name, value in os.environ.items() if name != "LP_NUM_THREADS"} | variables
    command = [sys.executable, "-m", "openmap_eval.bench.env_child", json.dumps(told)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=environment, check=False)
    if done.returncode or not done.stdout.strip():
        raise RuntimeError(f"a measured process ended with status {done.returncode}; its message is above")
    figures: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return figures


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise ValueError(f"size is {text!r}, expected width x height in px, such as 640x480")
    return int(width), int(height)


def _table(result: dict[str, Any], size: str, rows: dict[str, dict[str, float]]) -> Table:
    s = result["settings"]
    table = Table(
        title=f"{size}, rgb + depth + ids, {s['scene']}, {s['renderer']}", title_justify="left", pad_edge=False
    )
    table.add_column("environments", no_wrap=True)
    for column in ("steps/s", "times one", "times one, LP 0", "CPU ms a step", "not rendering", "worker's PSS MiB"):
        table.add_column(column, justify="right")
    for row, f in rows.items():
        table.add_row(
            row,
            f"{f['steps_per_second']:.1f}",
            f"{f['times_one']:.2f}",
            f"{f['times_one_lp_0']:.2f}",
            f"{f['cpu_ms_per_step']:.2f}",
            f"{f['not_rendering']:.1%}" if "not_rendering" in f else "",
            f"{f['worker_pss_mib']:.0f}" if "worker_pss_mib" in f else "",
        )
    return table
