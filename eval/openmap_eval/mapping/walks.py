"""What maps are measured on: walks whose every pixel's instance is known, rendered ones and recordings with instance pictures."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

from openmap_agents.perception.views import STRUCTURE
from openmap_eval.ap.format import cloud_of_scene, read_cloud, write_cloud
from openmap_eval.ap.protocol import LabelledCloud
from openmap_eval.mapping.sequence import SequenceFrame, SequenceSettings, record
from openmap_scenes import DataError, PinholeCamera, load_scene
from openmap_scenes.cache import cache_root
from openmap_scenes.recordings import open_recording

INSTANCES = "instance-filt"
"""Folder of a recording with an instance picture for each frame, ``<number>.png``, 0 = none."""


@dataclass(frozen=True)
class WalkSpec:
    """Which walk, and how much of it.

    Parameters
    ----------
    source : str
        A scene of the catalogue, or the folder of a recording.
    kind : {"scene", "recording"}
        A scene is walked through; a recording has its own pictures and instance pictures.
    frames, width, height, seed : int
        Of a rendered walk.
    long : bool
        Every frame from the first on, round after round, instead of frames spread over one round of the scene.
    every : int
        Only every such frame.
    first : int
        Only so many of these; 0 = all.
    step : int
        Only every such row and column of pixels.
    """

    source: str
    kind: Literal["scene", "recording"] = "scene"
    frames: int = 280
    width: int = 640
    height: int = 480
    seed: int = 0
    long: bool = False
    every: int = 1
    first: int = 0
    step: int = 1


@dataclass(frozen=True)
class Walk:
    """A walk; frames are read when they are asked for.

    Parameters
    ----------
    key : str
        Differs where any frame does.
    camera : PinholeCamera
    structure : tuple of int
        Ids of walls, floors and ceilings.
    categories : dict of int to str
        Of all ids.
    n_frames : int
    read : callable
        The n-th frame, from 0.
    make_cloud : callable
        The truth of the whole walk, however much of it is used here.
    """

    key: str
    camera: PinholeCamera
    structure: tuple[int, ...]
    categories: dict[int, str]
    n_frames: int
    read: Callable[[int], SequenceFrame]
    make_cloud: Callable[[], LabelledCloud]

    def __len__(self) -> int:
        return self.n_frames


def open_walk(spec: WalkSpec, on_frame: Callable[[int, int], None] | None = None) -> Walk:
    """The walk; a rendered one is made first if it is not kept, and ``on_frame`` told (frames written, frames in all).

    Raises
    ------
    DataError
        The scene or the recording cannot be read, or nobody says what instances its pictures show.
    """
    walk = _rendered(spec, on_frame) if spec.kind == "scene" else _recorded(Path(spec.source))
    numbers = range(0, len(walk), spec.every)[: spec.first or None]
    return walk if len(numbers) == len(walk) and spec.step == 1 else thinned(walk, numbers, spec.step)


def _rendered(spec: WalkSpec, on_frame: Callable[[int, int], None] | None) -> Walk:
    settings = SequenceSettings(
        spec.source, spec.frames, spec.seed, width=spec.width, height=spec.height, every=spec.long
    )
    sequence = record(settings, on_frame)

    def make_cloud() -> LabelledCloud:
        path = keep_folder(settings.key) / "cloud.npz"
        if not path.is_file():
            write_cloud(path, sequence.cloud)
        return read_cloud(path)

    return Walk(
        settings.key,
        sequence.camera,
        sequence.structure,
        sequence.categories,
        len(sequence),
        sequence.frame,
        make_cloud,
    )


def _recorded(folder: Path) -> Walk:
    """A recording in ScanNet's exported layout; the truth is its labelled mesh."""
    if not (folder / INSTANCES).is_dir():
        remedy = "Export the scan's filtered instance pictures beside its other folders."
        raise DataError(folder, f"no {INSTANCES}", "a recording with an instance picture for each frame", remedy)
    recording, scene = open_recording(folder), load_scene(f"scannet:{folder}")
    structure = tuple(sorted(i.id for i in scene.instances if i.category in STRUCTURE))

    def read(n: int) -> SequenceFrame:
        frame = recording.frame(n)
        path = folder / INSTANCES / f"{frame.index}.png"
        picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if picture is None or picture.ndim != 2:
            raise DataError(path, "no picture of one channel", "the instance of every pixel, 0 = none")
        height, width = frame.depth.shape
        instance = cv2.resize(picture, (width, height), interpolation=cv2.INTER_NEAREST).astype(np.int32)
        return SequenceFrame(frame.rgb, frame.depth, instance, frame.T_world_camera)

    def make_cloud() -> LabelledCloud:
        cloud = cloud_of_scene(scene)
        thing = (cloud.instance > 0) & ~np.isin(cloud.instance, structure)
        return replace(cloud, category=thing.astype(np.int32))

    listed = [(p.name, p.stat().st_size, p.stat().st_mtime_ns) for p in sorted((folder / INSTANCES).iterdir())]
    key = hashlib.sha256(repr((str(folder.resolve()), listed)).encode()).hexdigest()[:16]
    categories = {i.id: i.category for i in scene.instances}
    return Walk(key, recording.camera, structure, categories, len(recording), read, make_cloud)


def thinned(walk: Walk, numbers: Sequence[int], step: int = 1) -> Walk:
    """Some frames of a walk, and every ``step``-th row and column of them; the truth stays that of the whole walk."""
    chosen, camera = list(numbers), walk.camera

    def read(n: int) -> SequenceFrame:
        frame = walk.read(chosen[n])
        thin = np.s_[::step, ::step]
        rgb, depth = np.ascontiguousarray(frame.rgb[thin]), np.ascontiguousarray(frame.depth[thin])
        return SequenceFrame(rgb, depth, np.ascontiguousarray(frame.instance[thin]), frame.T_world_camera)

    coarse = PinholeCamera(
        -(-camera.width // step), -(-camera.height // step),
        camera.fx / step, camera.fy / step, camera.cx / step, camera.cy / step,
    )  # fmt: skip
    key = hashlib.sha256(repr((walk.key, chosen, step)).encode()).hexdigest()[:16]
    return Walk(key, coarse, walk.structure, walk.categories, len(chosen), read, walk.make_cloud)


def keep_folder(key: str) -> Path:
    """Where what was made of a walk is kept."""
    return cache_root() / "mapping-inputs-v1" / key
