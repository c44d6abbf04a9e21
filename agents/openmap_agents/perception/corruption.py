"""Good masks made bad, as segmenters make them: edges that wander, things that join, go missing or fall to pieces.

One picture at a time, in this order; each step has its own stream of random numbers, and each draws for every mask whatever its
probability is, so that turning up one setting leaves what the others do alone, and masks once dropped stay dropped:

1. warp: the labels are read through a smooth displacement field (a random B-spline, longest vector ``warp`` px);
2. merge: a mask joins a mask that it touches;
3. drop: a mask goes missing;
4. split: a large mask is cut, half of the time by position (the Voronoi cells of some of its pixels), else by depth and colour
   (k-means);
5. spurious: an ellipse that is nothing is a mask, over others;
6. grow: each mask's signed distance is shifted by its own amount, and a pixel goes to the mask that it then lies in deepest.

Disjoint by construction, because labels go in and labels come out. Pixels without depth are in no mask.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Labels = npt.NDArray[np.int32]
_VGA = 640 * 480
_WAVE = 40  # px of a 640 x 480 picture between the knots of the warp
_ROUNDS = 5  # of k-means
_BLUR = 2.0  # px; without it k-means finds the grain of wood instead of its planks


@dataclass(frozen=True)
class Corruption:
    """How bad, and at what. All zero, the default, changes nothing.

    Areas are pixels of a 640 x 480 picture, other sizes in proportion; ``warp`` and ``grow`` are pixels of the picture at hand.
    "Structure" is what the caller says is wall, floor or ceiling.
    """

    warp: float = 0.0
    """Length of the longest displacement of an edge, px."""
    merge: float = 0.0
    """Probability that a mask joins one that it touches."""
    merge_structure: float = 0.0
    drop: float = 0.0
    """Probability that a mask goes missing."""
    drop_structure: float = 0.0
    split: float = 0.0
    """Probability that a mask of at least ``split_area`` is cut into as many pieces as ``split_pieces`` (least, most) says."""
    split_area: float = 2500.0
    split_pieces: tuple[int, int] = (2, 3)
    split_structure: float = 0.0
    split_structure_area: float = 15000.0
    split_structure_pieces: tuple[int, int] = (1, 4)
    spurious: float = 0.0
    """Probability that a picture has a mask of nothing."""
    spurious_axes: tuple[float, float] = (0.03, 0.12)
    """Half axes of that ellipse, least and most, as shares of the picture's height."""
    grow: float = 0.0
    """Each mask is eroded or dilated by up to so many px."""

    def __post_init__(self) -> None:
        for name in ("merge", "drop", "split", "merge_structure", "drop_structure", "split_structure", "spurious"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected a probability, 0 to 1")
        for name in ("warp", "grow", "split_area", "split_structure_area"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected a number of pixels, at least 0")
        for name in ("split_pieces", "split_structure_pieces"):
            least, most = getattr(self, name)
            if not 1 <= least <= most:
                raise ValueError(f"{name} is {getattr(self, name)!r}, expected (least, most), from 1 upwards")
        if not 0.0 < self.spurious_axes[0] <= self.spurious_axes[1]:
            raise ValueError(f"spurious_axes is {self.spurious_axes!r}, expected (least, most), above 0")


TYPICAL = Corruption(
    warp=2.0, merge=0.12, merge_structure=0.03, drop=0.10, drop_structure=0.05,
    split=0.25, split_structure=1.0, spurious=0.15, grow=4.0,
)  # fmt: skip
"""About what a good class-agnostic segmenter does to a furnished room; mapping is held against it."""


def corrupt(
    labels: Labels,
    depth: npt.NDArray[np.floating],
    rng: np.random.Generator,
    settings: Corruption = TYPICAL,
    structure: npt.ArrayLike = (),
    rgb: npt.NDArray[np.uint8] | None = None,
) -> Labels:
    """Corrupted masks of one picture.

    Parameters
    ----------
    labels : (H, W) int32
        0 = no mask; any numbers above, with or without gaps.
    depth : (H, W) float32 m
        What is not above 0 is in no mask of the result.
    rng : np.random.Generator
        For this picture; the same one gives the same bytes.
    settings : Corruption
    structure : ids
        Which of the labels are walls, floors and ceilings.
    rgb : (H, W, 3) uint8, optional
        Large masks are then cut by depth and colour instead of by depth alone.

    Returns
    -------
    (H, W) int32
        0 = no mask, 1..n without gaps. With nothing but zeros in the settings, and depth everywhere, these are the labels that
        came in, numbered in their order.

    Raises
    ------
    ValueError
        Shapes that do not fit each other.
    """
    if labels.ndim != 2 or depth.shape != labels.shape or (rgb is not None and rgb.shape != (*labels.shape, 3)):
        shapes = f"labels {labels.shape}, depth {depth.shape}" + (f", rgb {rgb.shape}" if rgb is not None else "")
        raise ValueError(f"{shapes} do not fit, expected (H, W), (H, W) and (H, W, 3)")
    warp, merge, drop, split, spurious, grow = (np.random.default_rng(s) for s in rng.integers(2**63, size=6))
    before, present = _numbered(labels)
    fixed = np.append(False, np.isin(present, np.asarray(structure)))
    out = before
    if settings.warp > 0:
        out = _warped(out, settings.warp, warp)
    out, fixed = _merged(out, fixed, _chances(settings.merge, settings.merge_structure, fixed), merge)
    gone = drop.random(len(fixed)) < _chances(settings.drop, settings.drop_structure, fixed)
    out = np.where(gone[out], 0, out).astype(np.int32)
    out = _split(out, fixed, depth, rgb, settings, split)
    out = _with_blob(out, settings, spurious)
    if settings.grow > 0:
        out = _grown(out, grow.uniform(-settings.grow, settings.grow, int(out.max(initial=0)) + 1))
    return _numbered(np.where(depth > 0, out, 0))[0]


def _numbered(labels: npt.NDArray[np.integer]) -> tuple[Labels, npt.NDArray[np.int64]]:
    """The labels as 0..n without gaps, and which of the old ones became 1..n."""
    present, inverse = np.unique(labels, return_inverse=True)
    first = int(np.searchsorted(present, 0, side="right"))  # 1 where there is a 0
    if first > 1 or (first == 1 and present[0] != 0):
        raise ValueError(f"labels has {present[0]}, expected 0 or more")
    return (inverse.reshape(labels.shape) + 1 - first).astype(np.int32), present[first:].astype(np.int64)


def _chances(objects: float, structure: float, fixed: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    return np.where(fixed, structure, objects)


def _warped(labels: Labels, length: float, rng: np.random.Generator) -> Labels:
    """The labels read at places up to ``length`` px away, neighbouring pixels in much the same direction."""
    height, width = labels.shape
    wave = _WAVE * np.sqrt(labels.size / _VGA)
    across, down = (_spline_basis(size, max(wave, 1.0)) for size in (width, height))
    field = np.stack([down @ rng.standard_normal((down.shape[1], across.shape[1])) @ across.T for _ in range(2)])
    field *= length / max(float(np.sqrt((field**2).sum(0)).max()), 1e-12)
    rows, columns = (np.rint(field + np.mgrid[:height, :width])).astype(np.int64)
    return np.asarray(labels[rows.clip(0, height - 1), columns.clip(0, width - 1)])


def _spline_basis(size: int, spacing: float) -> npt.NDArray[np.float64]:
    """Values (size, k) of k cubic B-splines with knots ``spacing`` px apart at the pixels 0..size-1."""
    count = int(np.ceil(size / spacing)) + 3
    knots = spacing * np.arange(-3, count + 1)
    return np.asarray(BSpline.design_matrix(np.arange(size, dtype=np.float64), knots, 3).toarray())


def _touching(labels: Labels) -> npt.NDArray[np.int64]:
    """Pairs (m, 2), a < b, of masks that have neighbouring pixels."""
    beside = [(labels[:, 1:], labels[:, :-1]), (labels[1:], labels[:-1])]
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], 1)[(a != b).ravel()] for a, b in beside])
    pairs = np.sort(pairs[(pairs > 0).all(1)], axis=1).astype(np.int64)
    return np.unique(pairs, axis=0)


def _merged(
    labels: Labels, fixed: npt.NDArray[np.bool_], chances: npt.NDArray[np.float64], rng: np.random.Generator
) -> tuple[Labels, npt.NDArray[np.bool_]]:
    """Masks joined to a random one that they touch; who is joined to structure is structure. Numbers stay those of before."""
    joins, which = rng.random(len(fixed)) < chances, rng.random(len(fixed))
    if not joins[1:].any():
        return labels, fixed
    pairs = _touching(labels)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    edges = []
    for mask in np.flatnonzero(joins):
        others = np.sort(both[both[:, 0] == mask, 1])
        if len(others):
            edges.append((mask, others[int(which[mask] * len(others))]))
    if not edges:
        return labels, fixed
    a, b = np.array(edges).T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(fixed), len(fixed)))
    _, group = connected_components(graph, directed=False)
    lowest = np.full(group.max() + 1, len(fixed))
    np.minimum.at(lowest, group, np.arange(len(fixed)))
    number = lowest[group]
    joined = np.zeros(len(fixed), bool)
    np.logical_or.at(joined, number, fixed)
    return number[labels].astype(np.int32), joined


def _split(
    labels: Labels,
    fixed: npt.NDArray[np.bool_],
    depth: npt.NDArray[np.floating],
    rgb: npt.NDArray[np.uint8] | None,
    settings: Corruption,
    rng: np.random.Generator,
) -> Labels:
    """Large masks cut; the first piece keeps the number, the others get numbers of their own."""
    cut = rng.random(len(fixed)) < _chances(settings.split, settings.split_structure, fixed)
    seeds = rng.integers(2**63, size=len(fixed))
    smallest = _chances(settings.split_area, settings.split_structure_area, fixed) * labels.size / _VGA
    large = np.bincount(labels.ravel(), minlength=len(fixed)) >= np.maximum(smallest, 2)
    out, looks, new = labels.copy(), None, len(fixed)
    for mask in np.flatnonzero(cut & large):
        if mask == 0:
            continue
        own = np.random.default_rng(seeds[mask])
        least, most = settings.split_structure_pieces if fixed[mask] else settings.split_pieces
        pieces, by_place = int(own.integers(least, most + 1)), bool(own.random() < 0.5)
        rows, columns = np.nonzero((labels == mask) & (depth > 0))
        if len(rows) == 0:
            continue
        if by_place:
            values = np.stack([rows, columns], 1).astype(np.float64)
        else:
            looks = _looks(depth, rgb) if looks is None else looks
            values = looks[rows, columns]
        part = _clusters(values, pieces, own, 0 if by_place else _ROUNDS)
        out[rows, columns] = np.where(part == 0, mask, new + part - 1)
        new += pieces - 1
    return out


def _looks(depth: npt.NDArray[np.floating], rgb: npt.NDArray[np.uint8] | None) -> npt.NDArray[np.float64]:
    """What a careless segmenter goes by: depth and, with less weight, blurred colour, (H, W, 1 or 4)."""
    near = np.where(depth > 0, depth, 0.0)[..., None].astype(np.float64)
    if rgb is None:
        return near
    colour = cv2.GaussianBlur(rgb.astype(np.float32), (0, 0), _BLUR) / np.float32(255.0)
    return np.concatenate([near, colour.astype(np.float64)], axis=2)


def _clusters(values: npt.NDArray[np.float64], k: int, rng: np.random.Generator, rounds: int) -> npt.NDArray[np.int64]:
    """Cluster 0..k-1 (n,) of values (n, d): nearest of k of them, drawn at random, then so many rounds of k-means."""
    centres = values[rng.choice(len(values), size=min(k, len(values)), replace=False)]
    for number in range(rounds + 1):
        distance = ((values[:, None] - centres[None]) ** 2).sum(2)
        nearest = np.argmin(distance, axis=1)
        if number < rounds:
            counts = np.bincount(nearest, minlength=len(centres))
            sums = np.stack([np.bincount(nearest, column, len(centres)) for column in values.T], 1)
            centres = np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], centres)
    return np.asarray(nearest)


def _with_blob(labels: Labels, settings: Corruption, rng: np.random.Generator) -> Labels:
    """Perhaps an ellipse somewhere, over everything."""
    height, width = labels.shape
    chance, row, column, angle = rng.random(4)
    axes = rng.uniform(*settings.spurious_axes, 2) * height
    if chance >= settings.spurious:
        return labels
    y, x = np.mgrid[:height, :width].astype(np.float64)
    y, x = y - row * height, x - column * width
    c, s = np.cos(np.pi * angle), np.sin(np.pi * angle)
    inside = ((c * x + s * y) / axes[0]) ** 2 + ((c * y - s * x) / axes[1]) ** 2 <= 1.0
    return np.where(inside, labels.max(initial=0) + 1, labels).astype(np.int32)


def _grown(labels: Labels, by: npt.NDArray[np.float64]) -> Labels:
    """Masks dilated by so many px each, (n + 1,), eroded where negative; a pixel that two claim goes where it lies deeper.

    The signed distance of a mask's outermost pixels is -1/2 px, of those just outside 1/2 px. The border of the picture is no edge.
    """
    height, width = labels.shape
    margin = int(np.ceil(np.abs(by).max(initial=0.0))) + 1
    out, depth = np.zeros_like(labels), np.zeros(labels.shape, np.float32)
    for mask, box in _boxes(labels, margin, height, width):
        own = (labels[box] == mask).astype(np.uint8)
        inside = cv2.distanceTransform(np.pad(own, 1, "edge"), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        outside = cv2.distanceTransform(1 - own, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        signed = np.where(own > 0, 0.5 - inside, outside - 0.5) - np.float32(by[mask])
        better = signed < depth[box]
        out[box][better], depth[box][better] = mask, signed[better]
    return out


def _boxes(labels: Labels, margin: int, height: int, width: int) -> list[tuple[int, tuple[slice, slice]]]:
    """Each mask with the box around it, ``margin`` px wider on every side, ascending."""
    rows, columns = np.nonzero(labels)
    numbers = labels[rows, columns]
    n = int(labels.max(initial=0)) + 1
    low, high = np.full((n, 2), max(height, width)), np.full((n, 2), -1)
    for axis, places in enumerate((rows, columns)):
        np.minimum.at(low[:, axis], numbers, places)
        np.maximum.at(high[:, axis], numbers, places)
    low, high = np.maximum(low - margin, 0), high + margin + 1
    found = np.flatnonzero(high[:, 0] > margin)
    return [(int(m), (slice(low[m, 0], high[m, 0]), slice(low[m, 1], high[m, 1]))) for m in found]
