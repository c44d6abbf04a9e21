"""``openmap eval perception``: what masks and names are worth by themselves, on any scene whose things are known."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console


@dataclass(frozen=True)
class EvalPerception:
    """Measure a segmenter and an encoder on random views: masks, names, retrieval by category and by use, colour, time."""

    out: Path
    """Folder for perception.json and perception.html."""
    scene: tuple[str, ...] = ()
    """Scenes of the catalogue: mp3d:<scan folder>, file:<mesh>, homes:<split>/<n>; one or more."""
    split: Literal["homes/train", "homes/val", "homes/test"] | None = None
    """Instead of --scene: a split of the built-in homes."""
    homes: int = 3
    """How many homes of the split."""
    views: int = 60
    """Views of each scene."""
    seed: int = 0
    """Draws views, what the sensor adds, and resamples."""
    perception: str = "embedded"
    """Spec of both; --segmenter and --encoder override it."""
    segmenter: str | None = None
    """As for ``openmap eval``."""
    encoder: str | None = None
    """As for ``openmap eval``."""
    sensor: Literal["ideal", "real"] = "ideal"
    """Pictures as rendered, or as a real camera gives them: depth with errors and holes, exposure, white balance, blur."""
    width: int = 640
    """Picture width, px."""
    height: int = 480
    """Picture height, px."""
    hfov_deg: float = 90.0
    """Horizontal field of view."""
    names: Path | None = None
    """JSON list of the names that the weights were trained on; by default the one beside the embedded weights in use."""
    train_homes: int = 0
    """Instead of such a list: the categories of so many training homes, which are built for it."""

    def run(self, console: Console) -> None:
        from openmap_eval.perception.run import run_eval_perception

        run_eval_perception(self, console)
