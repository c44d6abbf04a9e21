"""``openmap eval mapping``: what association makes of masks and features, and what it bears."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console


@dataclass(frozen=True)
class EvalMapping:
    """Measure maps by average precision on walks whose instances are known: by masks, features and consensus, and against trouble.

    What perception says and how masks are corrupted is kept, and so is every score: the same command goes on where it was stopped.
    """

    out: Path
    """Folder for mapping.json, mapping.html, robustness.png and scores.jsonl."""
    scene: tuple[str, ...] = ()
    """Scenes of the catalogue; homes:val/0 and homes:val/1 if neither scene nor recording is given."""
    recording: tuple[Path, ...] = ()
    """Folders of exported ScanNet recordings with instance pictures and labelled meshes."""
    part: tuple[Literal["table", "robustness"], ...] = ("table", "robustness")
    """What to measure."""
    masks: tuple[Literal["perfect", "corrupted", "embedded"], ...] = ("perfect", "corrupted", "embedded")
    """Of the table."""
    peer: bool = False
    """Also MaskClustering (a minute or two a map)."""
    reference: bool = True
    """Also the plain reference, on every eighth pixel of a few frames."""
    quick: bool = False
    """Every fourth frame and every second pixel, fewer steps of trouble: for a look, not for figures."""
    frames: int = 280
    """Of a walk through a scene, spread over one round of it."""
    width: int = 640
    """Picture width, px."""
    height: int = 480
    """Picture height, px."""
    seed: int = 0
    """Draws walks, corruption, features and trouble."""
    workers: int = 1
    """Processes."""

    def run(self, console: Console) -> None:
        from openmap_eval.mapping.report import run_eval_mapping

        run_eval_mapping(self, console)
