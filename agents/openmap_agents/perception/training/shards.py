"""What is seen of one home, on disk: maps of the frozen backbone, depth's maps, who is where. One file a home, so work resumes.

Looking is the slow part of training (rendering, the backbone), and nothing of it changes while the networks learn.
"""

from __future__ import annotations

import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import N_FEATURES, Backbone
from openmap_agents.perception.colour import N_COLOUR, colour_features
from openmap_agents.perception.maps import cover, front_picture, geometry_map, means
from openmap_agents.perception.overlap import MIN_PIXELS
from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.regions import (
    N_BOUNDARY,
    N_MEASURED,
    N_MEASURED_BETWEEN,
    N_SUMS,
    Regions,
    describe,
)
from openmap_agents.perception.segmenter import patches_of
from openmap_agents.perception.shape import N_SHAPE, shape_features
from openmap_agents.perception.surface import Surface, working_picture
from openmap_agents.perception.training.frames import Sight
from openmap_scenes import DataError, PinholeCamera

_LOST, _GAINED = 0.2, 0.12  # shares of a thing's patches that a rough mask lacks, and of its neighbours' that it takes
_MOST_LOCAL = 255
KEPT_MAPS = 3  # strides 4, 8, 16; of stride 32 the means under masks are enough


@dataclass
class Patches:
    """What the segmenter's training needs of a view: patches (h, w) int16, their description, and the pixels of each thing."""

    patches: npt.NDArray[np.int16]
    regions: Regions
    floor: float


@dataclass
class Lesson:
    """A view as the networks learn from it.

    Parameters
    ----------
    maps : [(C, h, w) int8] of strides 4, 8, 16, and their scales [(C,) float16]
    geometry : (N_GEOMETRY, h, w) float16
    local : (h, w) uint8
        Number of the thing at each working pixel, 0 = none; ``present[k - 1]`` is the instance id of number k.
    rough : (h, w) uint8
        The same as a segmenter might have it: whole patches, some lost, some taken from neighbours.
    regions : (n,) uint8, kind_of_mask : (n,) uint8
        The number of the thing of each row below, and whether its true (0) or rough (1) mask was used.
    pixels : (n,) float32
        Of a picture of 640 x 480.
    pooled : (n, N_FEATURES), shape : (n, N_SHAPE), colour : (n, N_COLOUR), float16
    patches : Patches or None
    """

    maps: list[npt.NDArray[np.int8]]
    scales: list[npt.NDArray[np.float16]]
    geometry: npt.NDArray[np.float16]
    local: npt.NDArray[np.uint8]
    rough: npt.NDArray[np.uint8]
    present: npt.NDArray[np.int32]
    regions: npt.NDArray[np.uint8]
    kind_of_mask: npt.NDArray[np.uint8]
    pixels: npt.NDArray[np.float32]
    pooled: npt.NDArray[np.float16]
    shape: npt.NDArray[np.float16]
    colour: npt.NDArray[np.float16]
    patches: Patches | None

    @property
    def grid(self) -> tuple[int, int, int]:
        """Step of the working picture, height and width of the camera's as far as it fills it, px."""
        h, w = self.local.shape
        step = round(self.maps[1].shape[2] * 8 / w)
        return step, h * step, w * step


def rough_masks(
    local: npt.NDArray[np.int32], patches: npt.NDArray[np.int32], rng: np.random.Generator
) -> npt.NDArray[np.int32]:
    """Things (h, w) as whole patches: each goes to the thing with most of it, some to none or to a neighbouring pixel's thing."""
    n, m = int(patches.max()) + 1, int(local.max()) + 1
    seen = patches >= 0
    counts = np.bincount(patches[seen] * m + local[seen], minlength=n * m).reshape(n, m)
    owner = counts.argmax(1)
    draw = rng.random(n)
    owner[draw < _LOST * 0.5] = 0
    # A neighbour's number is found one patch to the right of some pixel of the patch.
    right = np.full(n, -1)
    edge = seen[:, :-1] & seen[:, 1:] & (patches[:, :-1] != patches[:, 1:])
    right[patches[:, :-1][edge]] = patches[:, 1:][edge]
    swapped = np.flatnonzero((draw > 1 - _GAINED) & (right >= 0))
    owner[swapped] = owner[right[swapped]]
    return np.where(seen, owner[patches], 0).astype(np.int32)


def _kept(labels: npt.NDArray[np.int32], m: int) -> npt.NDArray[np.int64]:
    """Numbers 1..m with enough pixels."""
    area = np.bincount(labels.ravel(), minlength=m + 1)
    kept = np.flatnonzero(area >= MIN_PIXELS * labels.size / (640 * 480))
    return kept[kept > 0]


def _quantised(maps: list[npt.NDArray[np.float32]]) -> tuple[list[npt.NDArray[np.int8]], list[npt.NDArray[np.float16]]]:
    scales = [(np.abs(x).max((1, 2)) / 127.0 + 1e-6).astype(np.float16) for x in maps]
    return [
        np.round(x / s.astype(np.float32)[:, None, None]).clip(-127, 127).astype(np.int8)
        for x, s in zip(maps, scales, strict=True)
    ], scales


def look(
    sight: Sight, camera: PinholeCamera, backbone: Backbone, rng: np.random.Generator, with_patches: bool
) -> Lesson | None:
    """All that is learned from one view; None where no depth was seen."""
    rgb, ids = sight.frame.rgb, sight.frame.instance
    surface: Surface = working_picture(rgb, sight.frame.depth, sight.T_world_camera, camera)
    patches = patches_of(surface)
    if patches.max() < 1:
        return None
    offset = surface.step // 2
    present, found = np.unique(ids[offset :: surface.step, offset :: surface.step], return_inverse=True)
    numbers = found.reshape(surface.depth.shape) + (0 if present[0] == 0 else 1)
    present = present[present > 0][:_MOST_LOCAL]
    local = np.where(numbers <= _MOST_LOCAL, numbers, 0).astype(np.int32)
    rough = rough_masks(local, patches, rng)
    both: tuple[npt.NDArray[np.int32], ...] = (local, rough)
    maps = backbone.dense(front_picture(rgb))
    rows: dict[str, list[Any]] = {"regions": [], "kind": [], "pixels": [], "pooled": [], "shape": [], "colour": []}
    for kind, labels in enumerate(both):
        kept = _kept(labels, len(present))
        number = np.zeros(len(present) + 1, np.int32)
        number[kept] = np.arange(1, len(kept) + 1)
        masks = Masks(number[labels], np.ones(len(kept), np.float32))
        cells = cover(masks.labels, len(kept), surface.step, camera.height, camera.width)
        rows["regions"].append(kept)
        rows["kind"].append(np.full(len(kept), kind))
        rows["pixels"].append(cells[0].sum(1) * (640 * 480 / labels.size))
        rows["pooled"].append(np.hstack([means(c, m) for c, m in zip(cells, maps, strict=True)]))
        rows["shape"].append(shape_features(surface, masks.labels, len(kept)))
        rows["colour"].append(colour_features(surface.lab, masks.labels, len(kept)))
    stacked = {k: np.concatenate(v) for k, v in rows.items()}
    small, scales = _quantised(maps[:KEPT_MAPS])
    return Lesson(
        small,
        scales,
        geometry_map(surface, sight.T_world_camera, camera.height, camera.width).astype(np.float16),
        local.astype(np.uint8),
        rough.astype(np.uint8),
        present.astype(np.int32),
        stacked["regions"].astype(np.uint8),
        stacked["kind"].astype(np.uint8),
        stacked["pixels"].astype(np.float32),
        stacked["pooled"].reshape(-1, N_FEATURES).astype(np.float16),
        stacked["shape"].reshape(-1, N_SHAPE).astype(np.float16),
        stacked["colour"].reshape(-1, N_COLOUR).astype(np.float16),
        Patches(patches.astype(np.int16), describe(patches, surface), surface.floor) if with_patches else None,
    )


_FIELDS = ("geometry", "local", "rough", "present", "regions", "kind_of_mask", "pixels", "pooled", "shape", "colour")


def save_shard(path: Path, lessons: list[Lesson], names: dict[int, str], colours: dict[int, str]) -> None:
    """Write the lessons of one home, with its things' names and colours by id; whole or not at all."""
    arrays: dict[str, Any] = {"n": np.array(len(lessons))}
    for key, words in (("names", names), ("colours", colours)):
        arrays[f"{key}.ids"] = np.array(sorted(words), np.int32)
        arrays[f"{key}.words"] = np.array([words[i] for i in sorted(words)] or [""])
    for k, lesson in enumerate(lessons):
        arrays |= {f"{k}.{f}": getattr(lesson, f) for f in _FIELDS}
        for s in range(KEPT_MAPS):
            arrays[f"{k}.map{s}"], arrays[f"{k}.scale{s}"] = lesson.maps[s], lesson.scales[s]
        if lesson.patches:
            r = lesson.patches.regions
            pairs = np.argwhere(r.boundary[:, :, 0] > 0)
            arrays |= {
                f"{k}.patches": lesson.patches.patches,
                f"{k}.sums": r.sums[:, :N_MEASURED],
                f"{k}.extremes": r.extremes,
                f"{k}.floor": np.array(lesson.patches.floor),
                f"{k}.pairs": pairs.astype(np.int16),
                f"{k}.between": r.boundary[pairs[:, 0], pairs[:, 1], :N_MEASURED_BETWEEN],
            }
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part.npz")
    np.savez(unfinished, **arrays)
    os.replace(unfinished, path)


class Shard:
    """The lessons of one home, read as they are asked for.

    Raises
    ------
    DataError
        The file is damaged.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = np.load(path, allow_pickle=False)
            self.n = int(self._file["n"])
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
            raise DataError(path, f"no lessons ({error})", "a file that training wrote", "Delete it.") from error
        self.names, self.colours = self._words("names"), self._words("colours")

    def _words(self, key: str) -> dict[int, str]:
        return dict(zip(self._file[f"{key}.ids"].tolist(), self._file[f"{key}.words"].tolist(), strict=False))

    def has_patches(self, k: int) -> bool:
        """Whether lesson k is for the segmenter as well."""
        return f"{k}.patches" in self._file.files

    def rows(self, k: int) -> dict[str, npt.NDArray[Any]]:
        """What is kept of the regions of lesson k."""
        return {f: self._file[f"{k}.{f}"] for f in _FIELDS[3:]}

    def lesson(self, k: int) -> Lesson:
        """Lesson k."""
        f = self._file
        patches = None
        if self.has_patches(k):
            measured, pairs = f[f"{k}.sums"], f[f"{k}.pairs"]
            sums = np.zeros((len(measured), N_SUMS))
            sums[:, :N_MEASURED] = measured
            boundary = np.zeros((len(sums), len(sums), N_BOUNDARY), np.float32)
            boundary[pairs[:, 0], pairs[:, 1], :N_MEASURED_BETWEEN] = f[f"{k}.between"]
            patches = Patches(f[f"{k}.patches"], Regions(sums, f[f"{k}.extremes"], boundary), float(f[f"{k}.floor"]))
        kept: dict[str, Any] = {name: f[f"{k}.{name}"] for name in _FIELDS}
        maps, scales = ([f[f"{k}.{part}{s}"] for s in range(KEPT_MAPS)] for part in ("map", "scale"))
        return Lesson(maps, scales, patches=patches, **kept)


def dequantised(lesson: Lesson) -> list[npt.NDArray[np.float32]]:
    """The maps (C, h, w) float32 of strides 4, 8, 16."""
    return [
        m.astype(np.float32) * s.astype(np.float32)[:, None, None]
        for m, s in zip(lesson.maps, lesson.scales, strict=True)
    ]
