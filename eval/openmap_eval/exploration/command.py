"""``openmap eval exploration``: what share of a home's things a walk shows, after how many steps, and where it sticks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console


@dataclass(frozen=True)
class EvalExploration:
    """Measure the agent's walk alone: no perception, depth and poses only; true ids are read to measure, never to walk.

    Walks are kept in the folder as they are made: the same command goes on where it was stopped.
    """

    out: Path
    """Folder for exploration.json, coverage.png and walks.jsonl."""
    scene: tuple[str, ...] = ()
    """Scenes of the catalogue: mp3d:<scan folder>, file:<mesh> or homes:<split>/<n>."""
    split: Literal["homes/train", "homes/val", "homes/test"] | None = None
    """Instead of --scene: a split of the built-in homes."""
    first: int = 0
    """The first home of the split."""
    homes: int = 10
    """How many homes of the split."""
    episodes: int = 1
    """Walks a scene: from the starts of the benchmark's episodes, or from places drawn by seed where it has none."""
    pixels: int = 400
    """A thing was seen once so many pixels of it were in one picture of 640 x 480; as much less in a smaller one."""
    width: int = 160
    """Picture width, px. The walk reads a raster of about 160 x 120 of whatever it is given."""
    height: int = 120
    """Picture height, px."""
    max_steps: int = 1500
    """Budget of actions for one walk."""
    steps: float = 500.0
    """Coverage is judged after this many steps ..."""
    per_area: float = 60.0
    """... for each so many square metres of floor."""
    renderer: str = "raycast"
    """opengl, pyrender, raycast or auto."""
    seed: int = 0
    """Draws what the walk draws, and starts where the benchmark has none."""

    def run(self, console: Console) -> None:
        from openmap_eval.exploration.report import run_eval_exploration

        run_eval_exploration(self, console)
