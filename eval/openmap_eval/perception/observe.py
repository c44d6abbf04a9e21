"""What a segmenter and an encoder say of random views of a scene, kept for all that is computed of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception import Encoder, Masks, Segmenter
from openmap_agents.perception.colour import region_colour
from openmap_agents.perception.overlap import true_masks
from openmap_agents.perception.views import STRUCTURE, View
from openmap_env.episodes.vocabulary import vocabulary
from openmap_eval.perception.masks import ViewMasks, compare
from openmap_scenes import Instance, PinholeCamera, Scene

MIN_IOU = 0.3
"""A predicted mask speaks for a thing from this IoU on."""

Sensor = Callable[
    [npt.NDArray[np.uint8], npt.NDArray[np.float32], np.random.Generator],
    tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]],
]
"""(rgb, depth, rng) -> what the camera gives of them."""


@dataclass
class Clock:
    """Wall and CPU milliseconds of each call, by stage."""

    wall: dict[str, list[float]] = field(default_factory=dict)
    cpu: dict[str, list[float]] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        self.wall.setdefault(stage, []).append((time.perf_counter() - wall) * 1e3)
        self.cpu.setdefault(stage, []).append((time.process_time() - cpu) * 1e3)


@dataclass(frozen=True)
class Regions:
    """What was said of n regions, each a view of a thing.

    Parameters
    ----------
    things : (n,) int64
        Index into ``Observed.things``.
    views : (n,) int64
        Index into ``Observed.views``.
    features : (n, D) float32
        Unit; zeros where no mask showed the thing.
    colours : list of (str or None)
    there : (n,) bool
        Whether a mask showed the thing.
    """

    things: npt.NDArray[np.int64]
    views: npt.NDArray[np.int64]
    features: npt.NDArray[np.float32]
    colours: list[str | None]
    there: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Shown:
    """A view for people: its picture (H, W, 3) uint8, its masks and their features (n, D), and how they lie on things."""

    rgb: npt.NDArray[np.uint8]
    masks: Masks
    features: npt.NDArray[np.float32]
    overlap: ViewMasks


@dataclass(frozen=True)
class Observed:
    """Everything that was said of a scene.

    Parameters
    ----------
    scene : str
        Its spec.
    things : list of Instance
        Those seen in any view, ascending by id.
    views : list of ViewMasks
    true : Regions or None
        With true masks; None from an encoder that does not read them.
    predicted : Regions
        With the best predicted mask of each; row for row the same things and views.
    pictures : list of bytes
        Each view's picture, JPEG.
    boxes : (n, 4) int64
        Where each region lies in its picture: left, top, right, bottom (exclusive), px.
    shown : list of Shown
    """

    scene: str
    things: list[Instance]
    views: list[ViewMasks]
    true: Regions | None
    predicted: Regions
    pictures: list[bytes]
    boxes: npt.NDArray[np.int64]
    shown: list[Shown]


@dataclass(frozen=True)
class Roles:
    """Which instances of a scene count: ``things`` by id, and the ids of walls, floors and ceilings."""

    things: dict[int, Instance]
    background: frozenset[int]

    @classmethod
    def of(cls, scene: Scene) -> Roles:
        """Instances without a name that people would ask for ("unlabelled", "moulding") are neither."""
        background = frozenset(i.id for i in scene.instances if i.category in STRUCTURE)
        named = (i for i in scene.instances if i.category and i.id not in background)
        return cls({i.id: i for i in named if not vocabulary().is_structure(i.category)}, background)


class _Said:
    """Features (D = dim) and colours of regions as they come in."""

    def __init__(self, dim: int) -> None:
        self._none = np.zeros(dim, np.float32)
        self._features: list[npt.NDArray[np.float32]] = []
        self._colours: list[str | None] = []
        self._there: list[bool] = []

    def add(self, features: npt.NDArray[np.float32], colours: Sequence[str], chosen: Iterable[int | None]) -> None:
        """Of each thing of a view the mask that was chosen for it; None where none was."""
        for k in chosen:
            self._features.append(self._none if k is None else features[k])
            self._colours.append(None if k is None else colours[k])
            self._there.append(k is not None)

    def regions(self, things: npt.NDArray[np.int64], views: npt.NDArray[np.int64]) -> Regions:
        """All that came in, of these things and views."""
        features = np.stack([*self._features, self._none])[:-1]
        return Regions(things, views, features, self._colours, np.array(self._there, bool))


class Observer:
    """Shows views to a segmenter and an encoder, one after another.

    Parameters
    ----------
    roles : Roles
    camera : PinholeCamera
    segmenter, encoder
    sensor, rng
        What the camera makes of a rendered picture, and its chance.
    clock : Clock
        Takes the times of "segment" and "encode"; the encoder's with the predicted masks.
    any_masks : bool
        Whether the encoder reads any masks, the true ones too, or only the segmenter's.
    """

    def __init__(
        self,
        roles: Roles,
        camera: PinholeCamera,
        segmenter: Segmenter,
        encoder: Encoder,
        sensor: Sensor,
        rng: np.random.Generator,
        clock: Clock,
        any_masks: bool = True,
    ) -> None:
        self._roles, self._camera, self._segmenter, self._encoder = roles, camera, segmenter, encoder
        self._sensor, self._rng, self._clock, self._any_masks = sensor, rng, clock, any_masks
        self.views: list[ViewMasks] = []
        self.pictures: list[bytes] = []
        self.shown: list[Shown] = []
        self._rows: list[tuple[int, int]] = []
        self._boxes: list[tuple[int, int, int, int]] = []
        self._true, self._predicted = _Said(encoder.dim), _Said(encoder.dim)

    def see(self, view: View, show: bool) -> None:
        """Take in one view; ``show`` keeps it for people."""
        ids, pose, camera = view.frame.instance, view.T_world_camera, self._camera
        rgb, depth = self._sensor(view.frame.rgb, view.frame.depth, self._rng)
        with self._clock("segment"):
            masks = self._segmenter.segment(rgb, depth, pose, camera)
        with self._clock("encode"):
            features = self._encoder.encode_regions(rgb, depth, masks, pose, camera)
        overlap = compare(masks, ids, self._roles.things.keys(), self._roles.background)
        truth, kept = true_masks(ids, sorted(self._roles.things))
        if self._any_masks:
            told = self._encoder.encode_regions(rgb, depth, truth, pose, camera)
            self._true.add(told, region_colour(rgb, truth), range(len(kept)))
        self._predicted.add(features, region_colour(rgb, masks), _best(overlap))
        self._rows.extend((i, len(self.views)) for i in kept)
        self._boxes.extend(_box(truth.labels == k + 1) for k in range(len(kept)))
        self.views.append(overlap)
        self.pictures.append(_jpeg(rgb))
        if show:
            self.shown.append(Shown(rgb, masks, features, overlap))

    def observed(self, scene: str) -> Observed:
        """All of it."""
        ids = sorted({i for i, _ in self._rows})
        things = np.array([ids.index(i) for i, _ in self._rows], np.int64)
        views = np.array([v for _, v in self._rows], np.int64)
        true = self._true.regions(things, views) if self._any_masks else None
        predicted = self._predicted.regions(things, views)
        boxes = np.array(self._boxes, np.int64).reshape(-1, 4)
        instances = [self._roles.things[i] for i in ids]
        return Observed(scene, instances, self.views, true, predicted, self.pictures, boxes, self.shown)


def observe(views: Iterable[View], observer: Observer, scene: str, show: AbstractSet[int]) -> Observed:
    """Show all views to the observer; those numbered in ``show`` are kept for people."""
    for number, view in enumerate(views):
        observer.see(view, number in show)
    return observer.observed(scene)


def _best(overlap: ViewMasks) -> list[int | None]:
    """The mask that shows each thing best, if its IoU is at least ``MIN_IOU``."""
    return [int(row.argmax()) if row.max(initial=0.0) >= MIN_IOU else None for row in overlap.iou]


def _box(mask: npt.NDArray[np.bool_]) -> tuple[int, int, int, int]:
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _jpeg(rgb: npt.NDArray[np.uint8]) -> bytes:
    return bytes(cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])[1])
