"""``openmap bench render``: all renderers, and what other people use, on one home, the same poses, in turn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from openmap_eval.bench.machine import describe_machine, write_json


@dataclass(frozen=True)
class Render:
    """Frames a second, CPU time a frame, set-up, memory and agreement of every renderer on a synthetic home of twelve rooms.

    Each renderer has a process of its own, and they take turns on the same poses, round after round, so that what else the
    machine does falls on all of them alike. RGB, depth and instance ids, 90 degrees across.
    """

    faces: tuple[int, ...] = (300_000, 1_000_000)
    """Triangles of the homes."""
    sizes: tuple[str, ...] = ("256x256", "640x480")
    """Pictures, WIDTHxHEIGHT."""
    frames: int = 120
    """Poses of each kind: along a walk, and scattered over the rooms."""
    rounds: int = 5
    """Turns of each renderer; the median counts."""
    backends: tuple[str, ...] = ()
    """Only these, such as "opengl prepared egl"; empty = all that this machine has."""
    textures: int = 40
    """Of the home, 512 to 1024 px."""
    seed: int = 0
    """Of the home and of the poses."""
    lp_threads: int | None = None
    """Threads of Mesa's software rasteriser (LP_NUM_THREADS); None = its default, which suits a single environment."""
    quick: bool = False
    """50,000 faces, one size, few frames, two rounds: whether everything runs, not how fast."""
    leak: bool = False
    """Measure growth of resident memory instead: over 5,000 frames, and over 30 changes of the scene."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        from openmap_eval.bench import render_leak, render_measure, render_table

        chosen = replace(self, faces=(50_000,), sizes=self.sizes[:1], frames=24, rounds=2) if self.quick else self
        check(chosen)
        measured = render_leak.measure(chosen, console) if self.leak else render_measure.measure(chosen, console)
        result = {"benchmark": "render leak" if self.leak else "render", "machine": describe_machine(), **measured}
        render_table.show(result, console)
        if self.out is not None:
            write_json(self.out, result)
            console.print(f"written: {self.out}", soft_wrap=True)


def picture_size(text: str) -> tuple[int, int]:
    """(width, height) px of WIDTHxHEIGHT; ValueError for anything else."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and 1 <= int(width) <= 8192 and 1 <= int(height) <= 8192):
        raise ValueError(f"size is {text!r}, expected WIDTHxHEIGHT in pixels, such as 640x480")
    return int(width), int(height)


def check(settings: Render) -> None:
    """ValueError for settings that cannot be measured with."""
    from openmap_eval.bench.render_contenders import CONTENDERS

    for size in settings.sizes:
        picture_size(size)
    for name, number in (("frames", settings.frames), ("rounds", settings.rounds)):
        if number < 1:
            raise ValueError(f"{number} {name}; expected 1 or more")
    if settings.lp_threads is not None and settings.lp_threads < 0:
        raise ValueError(f"{settings.lp_threads} rasteriser threads; expected 0 or more")
    if not (settings.faces and settings.sizes):
        raise ValueError("no faces or no sizes; expected one of each or more")
    unknown = [name for name in settings.backends if name not in CONTENDERS]
    if unknown:
        raise ValueError(f"backends {unknown}; expected some of: {', '.join(CONTENDERS)}")


def as_settings(settings: Render) -> dict[str, Any]:
    """The settings that decide a result, as they are written."""
    names = ("faces", "sizes", "frames", "rounds", "textures", "seed", "lp_threads")
    return {name: getattr(settings, name) for name in names}
