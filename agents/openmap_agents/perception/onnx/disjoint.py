"""Overlapping mask proposals -> disjoint masks of one picture.

Segmenters of the SAM and YOLO families propose masks that overlap: the same thing several times, things inside things, parts
inside wholes. :func:`suppress` takes out repetitions by their boxes, :func:`disjoint` gives every pixel to one mask at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks

Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.floating]


@dataclass(frozen=True)
class DisjointSettings:
    """Which pixels a proposal gets, and when it is given up."""

    nested: float = 0.9
    """A proposal is inside another where at least this share of its pixels is."""
    smaller: float = 0.7
    """...and where it has at most this share of the other's pixels; above, they are two tries at one thing."""
    min_area: float = 400 / (640 * 480)
    """Share of the picture that a mask must be left with."""
    min_left: float = 0.2
    """Share of its own pixels that a mask must be left with: less is a rim, not the thing that was proposed."""

    def __post_init__(self) -> None:
        for name in ("nested", "smaller", "min_area", "min_left"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name)}, expected a share of 0 to 1")


def disjoint(masks: Bools, scores: Floats, settings: DisjointSettings | None = None) -> Masks:
    """Disjoint masks of proposals that may overlap.

    The rule: where proposals overlap, the one inside the other has the pixel (a cushion is not lost in the sofa, which keeps the
    rest); where neither is inside the other, the better score has it, at equal scores the one that comes first. A proposal to
    which that leaves too little is given up, and its pixels go to the next in line.

    Parameters
    ----------
    masks : (n, H, W) bool
    scores : (n,) float
        Clipped to 0..1.
    settings : DisjointSettings, optional

    Returns
    -------
    Masks
        Numbered by falling score.
    """
    settings = settings or DisjointSettings()
    n, (height, width) = len(masks), masks.shape[1:]
    if len(scores) != n:
        raise ValueError(f"there are {len(scores)} scores, expected one for each of {n} masks")
    if n == 0:
        return Masks(np.zeros((height, width), np.int32), np.zeros(0, np.float32))
    scores = np.clip(np.nan_to_num(scores), 0, 1).astype(np.float32)
    areas = masks.reshape(n, -1).sum(1)
    # At least one pixel: no label is empty.
    needed = np.maximum(np.maximum(settings.min_area * height * width, settings.min_left * areas), 1)
    owner, taken = np.full((height, width), n, np.int32), np.zeros((height, width), bool)
    chosen = []
    for i in _order(_nested(masks, areas, settings), scores):
        free = masks[i] & ~taken
        if free.sum() >= needed[i]:
            owner[free] = i
            taken |= masks[i]
            chosen.append(i)
    ranked = sorted(chosen, key=lambda i: (-scores[i], i))
    number = np.zeros(n + 1, np.int32)
    number[ranked] = np.arange(1, len(ranked) + 1)
    return Masks(number[owner], scores[ranked])


def _nested(masks: Bools, areas: npt.NDArray[np.int64], settings: DisjointSettings) -> Bools:
    """(n, n): whether mask i is inside mask j."""
    bits = pack(masks)
    both = np.array([np.bitwise_count(bits & row).sum(1, dtype=np.int64) for row in bits])
    inside = both >= settings.nested * areas[:, None]
    much_smaller = (areas[:, None] <= settings.smaller * areas[None, :]) & (areas[:, None] < areas[None, :])
    return np.asarray(inside & much_smaller & (both > 0))


def _order(nested: Bools, scores: Floats) -> list[int]:
    """Who is served before whom: what is inside before what it is inside of, and else the better score.

    Found from the end: the worst of those that nobody left holds is served last. There always is one, for what is inside is
    smaller, so that nobody is inside itself by way of others.
    """
    holders = nested.sum(1)
    todo, backwards = list(range(len(scores))), []
    while todo:
        last = min((i for i in todo if holders[i] == 0), key=lambda i: (scores[i], -i))
        backwards.append(last)
        todo.remove(last)
        holders = holders - nested[:, last]
    return backwards[::-1]


def pack(masks: Bools) -> npt.NDArray[np.uint64]:
    """Masks (n, H, W) as bits (n, ceil(H W / 64)), a 64th of the words to compare."""
    n = len(masks)
    flat = np.packbits(masks.reshape(n, int(np.prod(masks.shape[1:]))), axis=1)
    return np.pad(flat, ((0, 0), (0, -flat.shape[1] % 8))).view(np.uint64)


def unpack(bits: npt.NDArray[np.uint64], height: int, width: int) -> Bools:
    """What :func:`pack` packed, (n, H, W) bool."""
    flat = np.unpackbits(np.ascontiguousarray(bits).view(np.uint8), axis=1, count=height * width)
    return flat.reshape(-1, height, width).astype(bool)


def boxes_of(masks: Bools) -> npt.NDArray[np.float32]:
    """Boxes (n, 4) of masks (n, H, W): x0, y0, x1, y1 in pixels, the last ones included; zeros for an empty mask."""
    boxes = np.zeros((len(masks), 4), np.float32)
    for box, mask in zip(boxes, masks, strict=True):
        columns, rows = np.flatnonzero(mask.any(0)), np.flatnonzero(mask.any(1))
        if len(columns):
            box[:] = columns[0], rows[0], columns[-1], rows[-1]
    return boxes


def suppress(boxes: Floats, scores: Floats, max_iou: float) -> npt.NDArray[np.int64]:
    """Which boxes stay, by falling score, when one that overlaps a better one by more than ``max_iou`` goes.

    Parameters
    ----------
    boxes : (n, 4) float
        x0, y0, x1, y1.
    scores : (n,) float
        At equal scores the first is better.
    max_iou : float
        0..1.
    """
    area = np.maximum(boxes[:, 2] - boxes[:, 0], 0) * np.maximum(boxes[:, 3] - boxes[:, 1], 0)
    left = np.argsort(-scores, kind="stable")
    kept = []
    while len(left):
        best, left = left[0], left[1:]
        kept.append(best)
        corner = np.minimum(boxes[best, 2:], boxes[left, 2:]) - np.maximum(boxes[best, :2], boxes[left, :2])
        both = np.prod(np.maximum(corner, 0), axis=1)
        left = left[both <= max_iou * (area[best] + area[left] - both)]
    return np.array(kept, np.int64)
