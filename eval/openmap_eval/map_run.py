"""What ``openmap map`` does: settings from words, progress, the file, a picture, tables."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import nullcontext
from dataclasses import fields, replace
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from openmap_agents.building import FrameReport, build_map
from openmap_agents.kept_frames import KeptFrames
from openmap_agents.mapping import InstanceMap, MappingSettings
from openmap_agents.perception import is_oracle, make_perception, read_encoder_spec, read_segmenter_spec, resolve
from openmap_eval.map_command import Map
from openmap_eval.pictures import recording_picture, things, write_png
from openmap_scenes import DataError
from openmap_scenes.recordings import open_recording, subsampled

_MOST_ROWS = 12


def run_map(command: Map, console: Console) -> None:
    """``openmap map``: build, write, draw, print."""
    if command.out.suffix != ".npz" or command.out.is_dir():
        raise DataError(command.out, "no name for a map", "a file <name>.npz")
    settings = read_settings(command.settings, command.max_depth)
    specs = resolve(command.perception, command.segmenter, command.encoder)
    if any(map(is_oracle, specs)):
        raise DataError("--perception", "oracle", "a spec that sees", "A recording has nobody who could tell the ids.")
    recording = open_recording(command.recording, command.kind, command.lenient)
    recording = subsampled(recording, command.every, command.first, command.last)
    chosen = {"first": command.first, "last": command.last, "every": command.every}
    kept_at = command.out.with_name(command.out.name + ".partial")
    # What is found by its place in a stream must be asked for every frame of it, and is on disk anyway.
    in_order = "order" in (read_segmenter_spec(specs[0]).frames, read_encoder_spec(specs[1]).frames)
    with nullcontext() if in_order else KeptFrames(kept_at, fresh=command.fresh, about={"frames": chosen}) as keep:
        if keep:
            console.print(f"{len(keep)} of {len(recording)} frames are kept in {kept_at}; going on", soft_wrap=True)
        with MapProgress(console) as progress:
            built = build_map(
                recording, *make_perception(*specs), settings, made_by=specs, keep=keep, on_frame=progress
            )
        built.save(command.out)
        written = [command.out]
        if command.picture:
            written.append(command.out.with_suffix(".png"))
            write_png(written[-1], recording_picture(built, progress.trajectory))
        if keep is not None and command.keep_frames:
            keep.write_index()
            written.append(kept_at)
        elif keep is not None:
            keep.remove()
    print_map(console, built)
    console.print(progress.summary(len(recording.skipped)))
    console.print(f"written: {', '.join(map(str, written))}", soft_wrap=True, highlight=False)


def read_settings(pairs: tuple[str, ...], max_depth: float | None = None) -> MappingSettings:
    """Mapping settings from words "key=value"; a value is read as the default is.

    Raises
    ------
    DataError
        Not such a word, or no such setting. ValueError: a value that the setting cannot have.
    """
    default = MappingSettings()
    known = {field.name: getattr(default, field.name) for field in fields(default)}
    chosen: dict[str, Any] = {} if max_depth is None else {"max_depth": max_depth}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or key not in known:
            raise DataError("--settings", repr(pair), f"<key>=<value> with a key of {', '.join(known)}")
        chosen[key] = _value(key, text, known[key])
    return replace(default, **chosen)


def _value(key: str, text: str, default: object) -> object:
    words = {"true": True, "false": False}
    try:
        if isinstance(default, bool):
            return words[text.lower()]
        if isinstance(default, int | float):
            return type(default)(text)
    except (ValueError, KeyError):
        what = "true or false" if isinstance(default, bool) else f"a number such as {default}"
        raise DataError("--settings", f"{key}={text}", f"{key}={what}") from None
    return text


class MapProgress:
    """Watches ``build_map``: a bar with frames, milliseconds a frame and instances; a context manager.

    Attributes
    ----------
    trajectory : (n, 3) float64 m
        Where the camera stood.
    """

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            TextColumn("frames"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[cost]}"),
            TextColumn("{task.fields[found]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._progress.add_task("frames", total=None, cost="", found="")
        self._places: list[npt.NDArray[np.float64]] = []
        self._seen = self._kept = self._without_depth = 0
        self._seeing = self._mapping = 0.0
        self._start = time.perf_counter()

    def __enter__(self) -> MapProgress:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def __call__(self, frame: FrameReport) -> None:
        """Take note of a frame."""
        self._places.append(frame.T_world_camera[:3, 3].copy())
        self._without_depth += not frame.has_depth
        self._kept += frame.kept
        self._mapping += frame.seconds_mapping
        if frame.has_depth and not frame.kept:
            self._seen += 1
            self._seeing += frame.seconds_seeing
        found = "" if frame.instances is None else f"{frame.instances} instances"
        self._progress.update(self._task, completed=frame.done, total=frame.total, cost=self._cost(), found=found)

    @property
    def trajectory(self) -> npt.NDArray[np.float64]:
        return np.array(self._places, np.float64).reshape(-1, 3)

    def _cost(self) -> str:
        parts = []
        if self._seen:
            parts.append(f"{1000 * self._seeing / self._seen:.0f} ms seeing")
        if self._seen + self._kept:
            parts.append(f"{1000 * self._mapping / (self._seen + self._kept):.0f} ms mapping")
        return " + ".join(parts)

    def summary(self, without_pose: int) -> str:
        """One line on what became of the frames."""
        counts = {
            "seen": self._seen,
            "kept from before": self._kept,
            "without depth left out": self._without_depth,
            "without a pose left out": without_pose,
        }
        said = ", ".join(f"{n} {what}" for what, n in counts.items() if n or what == "seen")
        return f"frames: {said}; {self._cost()} a frame; {time.perf_counter() - self._start:.0f} s in all"


def print_map(console: Console, instance_map: InstanceMap) -> None:
    """How many instances there are of each label, and the biggest things."""
    shown = things(instance_map)
    if not shown:
        console.print(
            "no thing was found: fewer than two frames agree on anything; check the unit of depth, the poses and their axes"
        )
        return
    structure = len(instance_map) - len(shown)
    counts = sorted(Counter(i.label for i in shown).items(), key=lambda item: (-item[1], item[0]))
    console.print(f"{len(shown)} things, and {structure} instances of walls, floors and ceilings")
    table = Table()
    table.add_column("label")
    table.add_column("instances", justify="right")
    for label, count in counts[:_MOST_ROWS]:
        table.add_row(label, str(count))
    if len(counts) > _MOST_ROWS:
        table.add_row(f"{len(counts) - _MOST_ROWS} more labels", str(sum(n for _, n in counts[_MOST_ROWS:])))
    console.print(table)
    console.print("the biggest things:")
    biggest = Table()
    for name in ("instance", "label", "seen in", "size, m", "centre, m"):
        biggest.add_column(name, justify="left" if name == "label" else "right")
    for instance in sorted(shown, key=lambda i: (-len(i.points), i.id))[:_MOST_ROWS]:
        size = instance.aabb_max - instance.aabb_min + instance_map.voxel_size
        place = " ".join(f"{x:.2f}" for x in instance.centre)
        extent = " x ".join(f"{x:.2f}" for x in size)
        biggest.add_row(str(instance.id), instance.label, f"{instance.n_observations} frames", extent, place)
    console.print(biggest)
