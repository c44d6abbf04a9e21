"""``openmap map``: the map of a recording, in a file that ``openmap query`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console


@dataclass(frozen=True)
class Map:
    """Build the map of a posed RGB-D recording; a run that was stopped goes on where it was."""

    recording: tyro.conf.Positional[Path]
    """ScanNet's .sens file or exported folder, a folder in the layout of TUM RGB-D, Replica or Record3D, or one with a
    recording.json."""
    out: Path
    """File for the map, <name>.npz. What the run needs to go on lies in <name>.npz.partial until the map is written."""
    kind: str | None = None
    """Which of these it is, where a folder looks like several: openmap, tum, replica, record3d, scannet or sens."""
    lenient: bool = False
    """Of a recording that was cut short take the frames that are whole."""
    perception: str = "embedded"
    """Segmenter and encoder: embedded (from pixels) or precomputed:<folder>."""
    segmenter: str | None = None
    """Instead of --perception's: any of those, sam:<folder or encoder.onnx>, or yolo:<model.onnx>."""
    encoder: str | None = None
    """Instead of --perception's: any of those, clip-onnx:<folder>, or openclip:<architecture>/<tag>."""
    first: int = 0
    """First frame, counted from 0 among those that have a pose."""
    last: int | None = None
    """Last frame, itself included; by default the last one there is."""
    every: int = 1
    """Only each so manieth frame."""
    max_depth: float | None = None
    """Readings beyond it are ignored, m: where the sensor cannot be trusted. By default the mapping settings' own."""
    settings: Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")] = ()
    """Mapping settings, such as voxel_size=0.03 semantics=structural; openmap_agents.mapping.MappingSettings lists them."""
    picture: bool = True
    """Also draw the map from above, to <name>.png."""
    fresh: bool = False
    """Drop what a run that was stopped has kept."""
    keep_frames: bool = False
    """Leave the masks and features of all frames in <name>.npz.partial, for --perception precomputed:<name>.npz.partial."""

    def run(self, console: Console) -> None:
        from openmap_eval.map_run import run_map

        run_map(self, console)
