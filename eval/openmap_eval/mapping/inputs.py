"""Masks and features for a walk: the truth, the truth made bad, or what a segmenter and an encoder say; kept on disk.

What is made here is slow next to a map, and the same for every map that is made of it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

import openmap_agents
from openmap_agents.perception.corruption import TYPICAL, Corruption, corrupt
from openmap_eval.mapping.walks import Walk, keep_folder
from openmap_scenes import DataError

Features = Literal["none", "good", "poor", "own"]
FEATURES: tuple[Features, ...] = ("none", "good", "poor", "own")
DIM = 64
"""Of features that are drawn."""
# Squares of the parts that everything has in common, that a category has, that a mask has alone. Within a category the cosine is
# the sum of the first two, .8 either way; between categories it is the first.
PARTS: dict[Features, tuple[float, float, float]] = {"good": (0.0, 0.8, 0.2), "poor": (0.7, 0.1, 0.2)}


@dataclass(frozen=True)
class MaskSpec:
    """Which masks.

    Parameters
    ----------
    kind : {"true", "embedded"}
        True ones, or a segmenter's that is told nothing, with its encoder's features.
    strength : float
        How much the true ones are corrupted: 0 = not at all, 1 = as a good segmenter does (``corruption.TYPICAL``).
    seed : int
        Of the corruption.
    """

    kind: Literal["true", "embedded"] = "true"
    strength: float = 0.0
    seed: int = 0

    @property
    def name(self) -> str:
        """For people."""
        if self.kind == "embedded":
            return "embedded"
        return {0.0: "perfect", 1.0: "corrupted"}.get(self.strength, f"corrupted x {self.strength:g}")


def scaled(strength: float) -> Corruption:
    """``TYPICAL`` with its lengths and probabilities times ``strength``; probabilities end at 1."""
    numbers: dict[str, Any] = {}
    for field in dataclasses.fields(Corruption):
        value = getattr(TYPICAL, field.name)
        if isinstance(value, float) and not field.name.endswith("area"):
            numbers[field.name] = value * strength
            if field.name not in ("warp", "grow"):
                numbers[field.name] = min(1.0, numbers[field.name])
    return dataclasses.replace(TYPICAL, **numbers)


class KeptMasks:
    """Masks of a walk on disk (``masks_of``)."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def labels(self, n: int) -> npt.NDArray[np.int32]:
        """Masks (H, W) of the n-th frame, 0 = none, 1.. without gaps."""
        picture = cv2.imread(str(self.folder / f"{n:05d}.png"), cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise DataError(self.folder, f"no masks of frame {n}", "a picture", "Delete the folder; it is made again.")
        return np.asarray(picture, np.int32)

    @cached_property
    def _said(self) -> dict[str, npt.NDArray[np.generic]]:
        with np.load(self.folder / "said.npz", allow_pickle=False) as file:
            return {name: file[name] for name in file.files}

    @property
    def has_own_features(self) -> bool:
        """Whether an encoder saw these masks."""
        return bool(self._said["features"].size)

    def own_features(self, n: int) -> npt.NDArray[np.float32]:
        """The encoder's (k, D) for the masks of the n-th frame."""
        starts = self._said["starts"]
        return np.asarray(self._said["features"][int(starts[n]) : int(starts[n + 1])], np.float32)

    def shares(self, n: int) -> tuple[npt.NDArray[np.int64], int]:
        """Rows (mask, true instance or 0, pixels) of the n-th frame, and how many masks it has."""
        rows, starts = self._said["rows"], self._said["starts"]
        return np.asarray(rows[rows[:, 0] == n, 1:], np.int64), int(starts[n + 1] - starts[n])


def masks_of(walk: Walk, spec: MaskSpec, on_frame: Callable[[int, int], None] | None = None) -> KeptMasks:
    """The masks; made once, then taken from the cache. ``on_frame`` is told (frames done, frames in all)."""
    told: list[Any] = [spec.kind, spec.strength, spec.seed]
    if spec.kind == "embedded":
        told = [spec.kind, source_digest(Path(openmap_agents.__file__).parent / "perception")]
    folder = keep_folder(walk.key) / hashlib.sha256(repr(told).encode()).hexdigest()[:16]
    if not (folder / "said.npz").is_file():
        partial = folder.with_name(f"{folder.name}.{os.getpid()}.tmp")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        try:
            _write(walk, spec, partial, on_frame or (lambda done, of: None))
            shutil.rmtree(folder, ignore_errors=True)
            os.replace(partial, folder)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    return KeptMasks(folder)


def source_digest(*places: Path) -> str:
    """Of Python sources and weights: of files, and of all in folders."""
    digest = hashlib.sha256()
    for place in places:
        files = [place] if place.is_file() else sorted(p for e in ("*.py", "*.npz") for p in place.rglob(e))
        for path in files:
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _write(walk: Walk, spec: MaskSpec, folder: Path, on_frame: Callable[[int, int], None]) -> None:
    rows, features, counts = [np.empty((0, 4), np.int64)], [], [0]
    see = _embedded(walk) if spec.kind == "embedded" else _corrupted(walk, spec)
    for n in range(len(walk)):
        labels, feature, true = see(n)
        cv2.imwrite(str(folder / f"{n:05d}.png"), labels.astype(np.uint16), [cv2.IMWRITE_PNG_COMPRESSION, 1])
        counts.append(int(labels.max(initial=0)) if feature is None else len(feature))
        if feature is not None:
            features.append(feature)
        inside = labels > 0
        code, pixels = np.unique((labels[inside].astype(np.int64) << 32) | true[inside], return_counts=True)
        rows.append(np.stack([np.full(len(code), n), code >> 32, code & 0xFFFFFFFF, pixels], 1))
        on_frame(n + 1, len(walk))
    said = np.concatenate(features) if features else np.empty((0, 0), np.float32)
    np.savez(folder / "said.npz", rows=np.concatenate(rows), starts=np.cumsum(counts), features=said)


Seen = tuple[npt.NDArray[np.int32], npt.NDArray[np.float32] | None, npt.NDArray[np.int32]]


def _corrupted(walk: Walk, spec: MaskSpec) -> Callable[[int], Seen]:
    how = scaled(spec.strength) if spec.strength > 0 else Corruption()

    def see(n: int) -> Seen:
        frame = walk.read(n)
        rng = np.random.default_rng([spec.seed, n])
        labels = corrupt(frame.instance, frame.depth, rng, how, walk.structure, frame.rgb)
        return labels, None, frame.instance

    return see


def _embedded(walk: Walk) -> Callable[[int], Seen]:
    from openmap_agents.perception import make_perception

    segmenter, encoder = make_perception("embedded", "embedded")

    def see(n: int) -> Seen:
        frame = walk.read(n)
        seen = frame.rgb, frame.depth
        masks = segmenter.segment(*seen, frame.T_world_camera, walk.camera)
        features = encoder.encode_regions(*seen, masks, frame.T_world_camera, walk.camera)
        return masks.labels, features, frame.instance

    return see


@dataclass(frozen=True)
class DrawnFeatures:
    """Features as an encoder of a certain quality would give them: of the categories that a mask shows, by pixels.

    Every category has a random direction; so has every mask, and all have one in common. ``PARTS`` says how much of each.

    Parameters
    ----------
    kind : {"good", "poor"}
    categories : dict of int to str
        Of all ids.
    seed : int
    """

    kind: Features
    categories: dict[int, str]
    seed: int = 0

    @cached_property
    def _directions(self) -> tuple[npt.NDArray[np.float64], dict[int, int]]:
        """Unit vectors (1 + C + 1, DIM): of all, of each category, of what is no instance; and the row of each id."""
        names = sorted(set(self.categories.values()))
        rng = np.random.default_rng([self.seed, 7])
        vectors = rng.standard_normal((len(names) + 2, DIM))
        number = {name: 1 + k for k, name in enumerate(names)}
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True), {
            i: number[name] for i, name in self.categories.items()
        }

    def __call__(self, rows: npt.NDArray[np.int64], n_masks: int, frame: int) -> npt.NDArray[np.float32]:
        """Unit vectors (n_masks, DIM) of a frame's masks, from rows (mask, id, pixels)."""
        vectors, row_of = self._directions
        mixed = np.zeros((n_masks, DIM))
        directions = vectors[[row_of.get(i, len(vectors) - 1) for i in rows[:, 1].tolist()]]
        np.add.at(mixed, rows[:, 0] - 1, directions * rows[:, 2:].astype(np.float64))
        own = np.random.default_rng([self.seed, 8, frame]).standard_normal((n_masks, DIM))
        common, category, alone = np.sqrt(PARTS[self.kind])
        out = common * vectors[0] + category * _unit(mixed) + alone * _unit(own)
        return _unit(out).astype(np.float32)


def _unit(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


MapperFrame = tuple[
    npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float32] | None, npt.NDArray[np.float64]
]


class Inputs:
    """A walk as a mapper gets it, in memory: about 1.2 MB a frame of 640 x 480.

    Parameters
    ----------
    walk : Walk
    masks : KeptMasks
    """

    def __init__(self, walk: Walk, masks: KeptMasks) -> None:
        self.walk, self.masks = walk, masks
        self._depth, self._labels, self._poses = [], [], []
        for n in range(len(walk)):
            frame = walk.read(n)
            self._depth.append(np.rint(frame.depth * 1000).astype(np.uint16))
            self._labels.append(masks.labels(n).astype(np.uint16))
            self._poses.append(frame.T_world_camera)

    def __len__(self) -> int:
        return len(self._depth)

    def frames(self, features: Features, seed: int = 0) -> Iterator[MapperFrame]:
        """``(depth m, masks, features or None, T_world_camera)`` one by one."""
        drawn = DrawnFeatures(features, self.walk.categories, seed) if features in PARTS else None
        if features == "own" and not self.masks.has_own_features:
            raise ValueError("masks without an encoder have no features of their own, expected none, good or poor")
        for n, depth in enumerate(self._depth):
            own = self.masks.own_features(n) if features == "own" else None
            feature = drawn(*self.masks.shares(n), n) if drawn else own
            yield depth.astype(np.float32) / np.float32(1000), self._labels[n].astype(np.int32), feature, self._poses[n]
