"""``openmap ap``: average precision of maps and of other methods' instances, as the ScanNet200 benchmark counts it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console


@dataclass(frozen=True)
class Ap:
    """Score instances against the truth as the ScanNet200 benchmark does: AP, AP50, AP25, by head, common and tail."""

    predictions: tyro.conf.Positional[Path]
    """A map in the truth's frame, a folder of maps <scan>.npz, or a folder in the benchmark's format: <scan>.txt with lines
    "predicted_masks/<scan>_000.txt <label> <confidence>"."""
    truth: str
    """The benchmark's <scan>.txt (label * 1000 + instance, a line a point), an .npz of points, instance and category, a folder
    of either, or a scene of the catalogue."""
    points: str | None = None
    """For a map and truth without points: a .ply or .npz, a scene of the catalogue, or a folder of points by scan."""
    class_agnostic: bool = False
    """Take all categories as one."""
    per_class: bool = False
    """Also print every class that there is."""
    ranked: bool = True
    """With the confidences of a map; else 1 for all, as MaskClustering and OpenMap were published."""
    reach: float | None = None
    """How far from a point its voxel may be, m; about 1.4 voxels unless given."""
    min_points: int = 100
    """Of an instance and of a proposal; smaller ones are left out."""
    out: Path | None = None
    """JSON file for all figures."""
    write_format: Path | None = None
    """Folder to write the predictions to in the benchmark's format."""

    def run(self, console: Console) -> None:
        from openmap_eval.ap.run import run_ap

        run_ap(self, console)
