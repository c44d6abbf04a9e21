"""Geometry of places: how far, on, under, between, how large. Everything works on axis-aligned boxes in a frame with Y
up.

Scores are 0..1 and fall off smoothly, because maps of real homes have ragged boxes; none of them needs to know where
the speaker stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.grounding.description import RelationName, Superlative
from openmap_agents.mapping.instance_map import InstanceMap

FloatArray = npt.NDArray[np.float64]
UP = 1
FLAT = [0, 2]


@dataclass(frozen=True)
class Boxes:
    """The boxes of a map's instances: low, high, centre (N, 3) m."""

    low: FloatArray
    high: FloatArray

    @property
    def centre(self) -> FloatArray:
        return (self.low + self.high) / 2

    @property
    def size(self) -> FloatArray:
        return self.high - self.low

    def __len__(self) -> int:
        return len(self.low)


def boxes_of(instance_map: InstanceMap) -> Boxes:
    """Boxes of all instances, in the map's order."""
    low = np.array([i.aabb_min for i in instance_map.instances], np.float64).reshape(-1, 3)
    high = np.array([i.aabb_max for i in instance_map.instances], np.float64).reshape(-1, 3)
    return Boxes(low, high)


def gaps(boxes: Boxes, j: int) -> FloatArray:
    """Distance (N,) m between every box and box j, 0 where they touch or overlap."""
    apart = np.maximum(np.maximum(boxes.low - boxes.high[j], boxes.low[j] - boxes.high), 0)
    return np.asarray(np.linalg.norm(apart, axis=1))


def _footprint_share(boxes: Boxes, j: int, margin: float = 0.05) -> FloatArray:
    """Which share (N,) of every box's footprint lies over that of box j."""
    low = np.maximum(boxes.low[:, FLAT], boxes.low[j, FLAT] - margin)
    high = np.minimum(boxes.high[:, FLAT], boxes.high[j, FLAT] + margin)
    own = np.maximum(boxes.size[:, FLAT], 1e-3).prod(1)
    return np.asarray(np.clip(np.maximum(high - low, 0).prod(1) / own, 0, 1))


def near(boxes: Boxes, j: int, reach: float = 1.0) -> FloatArray:
    """exp(-gap / reach)."""
    return np.asarray(np.exp(-gaps(boxes, j) / reach))


def on(boxes: Boxes, j: int) -> FloatArray:
    """Stands on j, lies in its seat, or hangs on it when it is a wall."""
    share = _footprint_share(boxes, j)
    rise = boxes.low[:, UP] - boxes.high[j, UP]
    # A pillow's underside is below the top of a bed with a headboard: anywhere in the upper part of j is "on", above it is not.
    sunk = np.clip(-rise / max(boxes.size[j, UP], 0.05), 0, 1)
    stands = (
        share * np.where(rise > 0, np.exp(-rise / 0.15), 1 - 0.7 * sunk) * (boxes.centre[:, UP] > boxes.centre[j, UP])
    )
    size = boxes.size[j]
    if size[UP] > 1.5 and min(size[FLAT]) < 0.4:
        return np.asarray(np.maximum(stands, np.exp(-gaps(boxes, j) / 0.15)))
    return np.asarray(stands)


def above(boxes: Boxes, j: int) -> FloatArray:
    """Higher than j and over it or, as a picture over a sofa, close beside its upright."""
    rise = boxes.low[:, UP] - boxes.high[j, UP]
    flat = _flat_gaps(boxes, j)
    return np.asarray(np.exp(-flat / 0.25) * np.where(rise > -0.1, np.exp(-np.maximum(rise, 0) / 1.5), 0.0))


def under(boxes: Boxes, j: int) -> FloatArray:
    """Lower than j and beneath it, or within its legs."""
    lower = boxes.centre[:, UP] < boxes.centre[j, UP] + 0.02
    fits = boxes.high[:, UP] <= boxes.high[j, UP] + 0.05
    return np.asarray(np.exp(-_flat_gaps(boxes, j) / 0.25) * (lower & fits) * (0.3 + 0.7 * _footprint_share(boxes, j)))


def inside(boxes: Boxes, j: int) -> FloatArray:
    """Share of the box's volume inside j."""
    low, high = np.maximum(boxes.low, boxes.low[j] - 0.05), np.minimum(boxes.high, boxes.high[j] + 0.05)
    own = np.maximum(boxes.size, 1e-3).prod(1)
    return np.asarray(np.clip(np.maximum(high - low, 0).prod(1) / own, 0, 1))


def between(boxes: Boxes, j: int, k: int) -> FloatArray:
    """Close to the line from j to k, seen from above, and not beyond its ends; people say it of landmarks in one room."""
    a, b, points = boxes.centre[j, FLAT], boxes.centre[k, FLAT], boxes.centre[:, FLAT]
    line = b - a
    length = max(float(np.linalg.norm(line)), 1e-6)
    along = (points - a) @ line / length**2
    off = np.linalg.norm(points - (a + np.clip(along, 0, 1)[:, None] * line), axis=1)
    middle = 1 - np.clip(np.abs(along - 0.5) - 0.4, 0, 0.5) * 2
    return np.asarray(np.exp(-off / max(0.5 * length, 0.5) - length / 6) * np.clip(middle, 0, 1))


def _flat_gaps(boxes: Boxes, j: int) -> FloatArray:
    apart = np.maximum(np.maximum(boxes.low - boxes.high[j], boxes.low[j] - boxes.high), 0)
    return np.asarray(np.linalg.norm(apart[:, FLAT], axis=1))


def relation_scores(name: RelationName, boxes: Boxes, j: int) -> FloatArray:
    """How well every instance stands in a two-place relation to instance j, (N,) 0..1; j itself gets 0."""
    if name == "on":
        scores = on(boxes, j)
    elif name == "under":
        scores = under(boxes, j)
    elif name == "above":
        scores = above(boxes, j)
    elif name == "in":
        scores = np.maximum(inside(boxes, j), 0.3 * near(boxes, j))
    elif name == "away":
        scores = 1 - near(boxes, j, 3.0)
    else:
        scores = near(boxes, j, 2.0 if name == "facing" else 1.0)
    scores = np.array(scores, np.float64)
    scores[j] = 0
    return scores


def extent(name: Superlative, boxes: Boxes) -> FloatArray:
    """What a superlative compares, (N,), more is more so."""
    size, sign = boxes.size, -1.0 if name in ("smallest", "shortest", "lowest") else 1.0
    if name in ("largest", "smallest"):
        return np.asarray(sign * np.maximum(size, 0.01).prod(1))
    if name in ("tallest", "shortest"):
        return sign * size[:, UP]
    if name == "longest":
        return np.asarray(size[:, FLAT].max(1))
    return sign * boxes.centre[:, UP]
