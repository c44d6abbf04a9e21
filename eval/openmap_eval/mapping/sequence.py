"""RGB-D sequences of a walk through a scene, with the true instance of every pixel, kept on disk.

A walk goes from place to place along shortest ways and looks around at each of them; the places are spread over the main island.
When all have been visited it goes round again by others, so that a long walk comes back to where it was.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.frame import pack_cells, unpack_keys
from openmap_agents.perception.views import EYE_HEIGHT, STRUCTURE, camera_pose
from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import make_renderer
from openmap_scenes import DataError, PinholeCamera, load_scene
from openmap_scenes.cache import cache_root

if TYPE_CHECKING:
    from openmap_eval.ap.protocol import LabelledCloud

Points = npt.NDArray[np.float64]

METRES = 1e-3
"""Of a unit of the kept depth."""
STEP = 0.25
"""Between frames on the way, m."""
TURN = np.pi / 6
"""Between frames when looking around."""
_AREA_OF_A_PLACE = 5.0  # m2
_VERSION = 1
_PITCHES = (-0.35, -0.1, -0.25, 0.05)
_CLOUD_VOXEL = 0.02


@dataclass(frozen=True)
class SequenceFrame:
    """One frame.

    Parameters
    ----------
    rgb : (H, W, 3) uint8
    depth : (H, W) float32 m
        Planar, in whole millimetres; 0 = nothing.
    instance : (H, W) int32
        True ids; 0 = none.
    T_world_camera : (4, 4) float64
    """

    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    instance: npt.NDArray[np.int32]
    T_world_camera: npt.NDArray[np.float64]


class Sequence:
    """A kept sequence (``record``); frames are read when they are asked for.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        about = json.loads((folder / "about.json").read_text())
        self.scene: str = about["scene"]
        self.camera = PinholeCamera(**about["camera"])
        self.structure: tuple[int, ...] = tuple(about["structure"])
        """Ids of walls, floors and ceilings."""
        self.categories: dict[int, str] = {int(i): name for i, name in about["categories"].items()}
        self._poses = np.load(folder / "T_world_camera.npy", allow_pickle=False)

    def __len__(self) -> int:
        return len(self._poses)

    def __iter__(self) -> Iterator[SequenceFrame]:
        return (self.frame(n) for n in range(len(self)))

    def frame(self, n: int) -> SequenceFrame:
        """The n-th frame, from 0."""
        stem = str(self.folder / f"{n:05d}")
        rgb = cv2.cvtColor(_read(f"{stem}.jpg", cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
        depth = _read(f"{stem}_depth.png", cv2.IMREAD_UNCHANGED).astype(np.float32) * np.float32(METRES)
        instance = _read(f"{stem}_instance.png", cv2.IMREAD_UNCHANGED).astype(np.int32)
        return SequenceFrame(np.asarray(rgb, np.uint8), depth, instance, self._poses[n])

    @cached_property
    def cloud(self) -> LabelledCloud:
        """What the walk saw: the centres of 2 cm voxels, each with the instance that most of its pixels show.

        Its categories are 1 for things and 0 for structure and for what is no instance.
        """
        from openmap_eval.ap.protocol import LabelledCloud

        keys, ids = np.empty(0, np.int64), np.empty(0, np.int32)
        counts = np.empty(0, np.int64)
        for frame in self:
            new = _keys_of(frame, self.camera)
            use = frame.instance[new >= 0].astype(np.int64)
            pair, count = _counted(np.stack([new[new >= 0], use], 1))
            merged = np.concatenate([np.stack([keys, ids.astype(np.int64)], 1), pair])
            both, counts = _counted(merged, np.concatenate([counts, count]))
            keys, ids = both[:, 0], both[:, 1].astype(np.int32)
        order = np.lexsort((ids, -counts, keys))
        first = np.append(True, np.diff(keys[order]) > 0) if len(order) else np.zeros(0, bool)
        keys, ids = keys[order][first], ids[order][first]
        points = (unpack_keys(keys) + 0.5) * _CLOUD_VOXEL
        thing = (ids > 0) & ~np.isin(ids, self.structure)
        return LabelledCloud(points.astype(np.float32), ids, thing.astype(np.int32))


def _read(path: str, how: int) -> npt.NDArray[np.generic]:
    picture = cv2.imread(path, how)
    if picture is None:
        raise DataError(path, "no picture", "a kept frame", "Delete the folder; it is made again.")
    return np.asarray(picture)


def _keys_of(frame: SequenceFrame, camera: PinholeCamera) -> npt.NDArray[np.int64]:
    """Voxel keys (H, W); -1 without depth."""
    v, u = np.mgrid[: camera.height, : camera.width]
    d = frame.depth.astype(np.float64)
    points = np.stack([(u - camera.cx) / camera.fx * d, -(v - camera.cy) / camera.fy * d, -d], -1)
    T = frame.T_world_camera
    cells = np.floor((points @ T[:3, :3].T + T[:3, 3]) / _CLOUD_VOXEL).astype(np.int64)
    keys = pack_cells(cells.reshape(-1, 3)).reshape(d.shape)
    return np.where(d > 0, keys, -1)


def _counted(
    rows: npt.NDArray[np.int64], weights: npt.NDArray[np.int64] | None = None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Distinct rows (n, 2), ascending, and how often (or with what weight) each is there."""
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    rows = rows[order]
    weights = np.ones(len(rows), np.int64) if weights is None else weights[order]
    starts = np.flatnonzero(np.append(True, (np.diff(rows, axis=0) != 0).any(1))) if len(rows) else np.empty(0, int)
    return rows[starts], np.add.reduceat(weights, starts) if len(starts) else np.empty(0, np.int64)


def patrol(surface: NavigableSurface, rng: np.random.Generator) -> Iterator[tuple[int, Points]]:
    """An endless walk over the main island: which round it is, from 0, and the camera's pose T_world_camera (4, 4)."""
    n_places = max(2, int(surface.island_areas[0] / _AREA_OF_A_PLACE))
    here = surface.random_point(rng, island=0)
    for number in itertools.count():
        places = _spread([surface.random_point(rng, island=0) for _ in range(20 * n_places)], n_places, rng)
        while places:
            lengths = surface.distance_field(here).distances(np.array(places))
            goal = places.pop(int(np.argmin(lengths)))
            heading = float(rng.uniform(-np.pi, np.pi))
            for position, heading in _along(surface.shortest_path(here, goal)):
                yield number, _pose(position, heading, rng)
            for k in range(round(2 * np.pi / TURN)):
                yield number, _pose(goal, heading + k * TURN, rng)
            here = goal


def _pose(position: npt.ArrayLike, heading: float, rng: np.random.Generator) -> Points:
    return camera_pose(np.asarray(position) + np.array([0.0, EYE_HEIGHT, 0.0]), heading, float(rng.choice(_PITCHES)))


def _spread(points: list[Points], n: int, rng: np.random.Generator) -> list[Points]:
    """n of the points, each as far as can be from those before."""
    left = np.array(points)
    chosen = [left[int(rng.integers(len(left)))]]
    gap = np.linalg.norm(left - chosen[0], axis=1)
    while len(chosen) < n and gap.max() > 0.5:
        chosen.append(left[int(gap.argmax())])
        gap = np.minimum(gap, np.linalg.norm(left - chosen[-1], axis=1))
    return chosen


def _along(path: Points | None) -> Iterator[tuple[Points, float]]:
    """Places every ``STEP`` along a path (n, 3), with the heading of the way."""
    if path is None or len(path) < 2:
        return
    legs = np.diff(path, axis=0)
    length = np.linalg.norm(legs, axis=1)
    upto = np.concatenate([[0.0], np.cumsum(length)])
    for way in np.arange(STEP, upto[-1], STEP):
        leg = min(int(np.searchsorted(upto, way, side="right")) - 1, len(legs) - 1)
        step = legs[leg]
        yield path[leg] + step * (way - upto[leg]) / max(length[leg], 1e-9), float(np.arctan2(-step[0], -step[2]))


@dataclass(frozen=True)
class SequenceSettings:
    """What a sequence is made of.

    Parameters
    ----------
    scene : str
        A scene of the catalogue.
    frames : int
    seed : int
    width, height, hfov_deg
        Of the camera.
    every : bool
        Take every frame from the first on, instead of frames spread evenly over one round of the home.
    """

    scene: str
    frames: int = 280
    seed: int = 0
    width: int = 640
    height: int = 480
    hfov_deg: float = 79.0
    every: bool = False

    @property
    def key(self) -> str:
        """Its name in the cache."""
        text = json.dumps([_VERSION, asdict(self)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(
    settings: SequenceSettings, on_frame: Callable[[int, int], None] | None = None, folder: Path | None = None
) -> Sequence:
    """The sequence; made once, then taken from ``folder``, in the cache unless given.

    ``on_frame`` is told (frames written, frames in all).
    """
    folder = folder or cache_root() / "sequences" / settings.key
    if not (folder / "about.json").is_file():
        partial = folder.with_name(f"{folder.name}.{os.getpid()}.tmp")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        try:
            _write(settings, partial, on_frame or (lambda done, of: None))
            shutil.rmtree(folder, ignore_errors=True)
            os.replace(partial, folder)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    return Sequence(folder)


def _poses(surface: NavigableSurface, settings: SequenceSettings) -> Points:
    walk = patrol(surface, np.random.default_rng(settings.seed))
    if settings.every:
        return np.stack([pose for _, pose in itertools.islice(walk, settings.frames)])
    whole = [pose for _, pose in itertools.takewhile(lambda step: step[0] == 0, walk)]
    return np.stack([whole[k * len(whole) // settings.frames] for k in range(settings.frames)])


def _write(settings: SequenceSettings, folder: Path, on_frame: Callable[[int, int], None]) -> None:
    scene = load_scene(settings.scene)
    camera = PinholeCamera.from_hfov(settings.width, settings.height, settings.hfov_deg)
    poses = _poses(NavigableSurface.from_scene(scene), settings)
    renderer = make_renderer("opengl", scene, camera)
    try:
        for n, T_world_camera in enumerate(poses):
            frame = renderer.render(T_world_camera)
            stem = str(folder / f"{n:05d}")
            depth = np.rint(frame.depth / METRES).clip(0, 65535).astype(np.uint16)
            cv2.imwrite(f"{stem}.jpg", cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 95])
            cv2.imwrite(f"{stem}_depth.png", depth.reshape(depth.shape[:2]))
            cv2.imwrite(f"{stem}_instance.png", frame.instance.astype(np.uint16).reshape(depth.shape[:2]))
            on_frame(n + 1, len(poses))
    finally:
        renderer.close()
    np.save(folder / "T_world_camera.npy", poses)
    about = {
        "scene": settings.scene,
        "camera": asdict(camera),
        "structure": sorted(i.id for i in scene.instances if i.category in STRUCTURE),
        "categories": {str(i.id): i.category for i in scene.instances},
    }
    (folder / "about.json").write_text(json.dumps(about))
