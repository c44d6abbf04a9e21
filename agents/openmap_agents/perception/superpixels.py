"""First cut of the segmenter: many small patches that do not cross an edge of shape or colour.

Felzenszwalb and Huttenlocher, Efficient Graph-Based Image Segmentation (IJCV 2004), on the 4-neighbour graph of the working
picture. scikit-image's function takes channels; here an edge's weight says how far one pixel lies off the other's tangent
plane, how the surface bends and how the colour changes, and the whole cut takes a fraction of the time.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.surface import Surface

_SCALE = 0.6  # k of the paper: larger gives larger patches
_MIN_PIXELS = 20
_LEVELS = 4095  # weights are compared as integers of this resolution


@numba.njit(cache=True)
def _weight(points: np.ndarray, normals: np.ndarray, lab: np.ndarray, depth: np.ndarray, a: int, b: int) -> float:
    """Dissimilarity 0..3 of two neighbouring pixels, given by their flat index."""
    if (depth[a] > 0.0) != (depth[b] > 0.0):
        return 3.0
    colour = 0.0
    for c in range(3):
        colour += (lab[a, c] - lab[b, c]) ** 2
    colour = min(np.sqrt(colour) / 25.0, 1.0)
    if depth[a] <= 0.0:
        return float(colour)
    off_a, off_b, cosine = 0.0, 0.0, 0.0
    for c in range(3):
        d = points[b, c] - points[a, c]
        off_a += normals[a, c] * d
        off_b += normals[b, c] * d
        cosine += normals[a, c] * normals[b, c]
    off = max(abs(off_a), abs(off_b)) / (0.01 + 0.01 * min(depth[a], depth[b]))
    return float(min(off, 1.0) + min((1.0 - cosine) / 0.3, 1.0) + colour)


@numba.njit(cache=True)
def _root(parent: np.ndarray, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(cache=True)
def _edges(
    points: np.ndarray, normals: np.ndarray, lab: np.ndarray, depth: np.ndarray, w: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pixel pairs (m, 2) int32 and their weights (m,) uint16 of a picture w pixels wide."""
    n = len(depth)
    pairs = np.empty((2 * n, 2), np.int32)
    weights = np.empty(2 * n, np.uint16)
    m = 0
    for i in range(n):
        for neighbour in (i + 1 if (i + 1) % w != 0 else n, i + w):
            if neighbour < n:
                pairs[m, 0], pairs[m, 1] = i, neighbour
                weights[m] = np.uint16(_weight(points, normals, lab, depth, i, neighbour) / 3.0 * _LEVELS)
                m += 1
    return pairs[:m], weights[:m]


@numba.njit(cache=True)
def _merge(
    pairs: np.ndarray, weights: np.ndarray, order: np.ndarray, n: int, scale: float, min_pixels: int
) -> np.ndarray:
    """Patch number 0.. of each of n pixels; edges are taken in ``order``, lightest first."""
    parent = np.arange(n)
    size = np.ones(n, np.int64)
    limit = np.full(n, scale)
    for e in order:
        weight = weights[e] / _LEVELS * 3.0
        a, b = _root(parent, pairs[e, 0]), _root(parent, pairs[e, 1])
        if a != b and weight <= limit[a] and weight <= limit[b]:
            a, b = min(a, b), max(a, b)
            parent[b] = a
            size[a] += size[b]
            limit[a] = weight + scale / size[a]
    for e in order:
        a, b = _root(parent, pairs[e, 0]), _root(parent, pairs[e, 1])
        if a != b and weights[e] < _LEVELS and min(size[a], size[b]) < min_pixels:
            a, b = min(a, b), max(a, b)
            parent[b] = a
            size[a] += size[b]
    number = np.full(n, -1, np.int32)
    patches = np.empty(n, np.int32)
    k = 0
    for i in range(n):
        r = _root(parent, i)
        if number[r] < 0:
            number[r] = k
            k += 1
        patches[i] = number[r]
    return patches


def superpixels(surface: Surface, scale: float = _SCALE, min_pixels: int = _MIN_PIXELS) -> npt.NDArray[np.int32]:
    """Patch numbers (h, w) int32 from 0, without gaps, in reading order. A patch has depth everywhere or nowhere."""
    h, w = surface.depth.shape
    flat = (surface.points.reshape(-1, 3), surface.normals.reshape(-1, 3), surface.lab.reshape(-1, 3))
    pairs, weights = _edges(*flat, surface.depth.ravel(), w)
    order = np.argsort(weights, kind="stable")
    return np.asarray(_merge(pairs, weights, order, h * w, scale, min_pixels).reshape(h, w))
