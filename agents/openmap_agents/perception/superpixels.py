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


@numba.njit(cache=True, error_model="numpy")
def _weight(
    points: np.ndarray, normals: np.ndarray, lab: np.ndarray, depth: np.ndarray, v: int, u: int, y: int, x: int
) -> np.int32:
    """Dissimilarity 0.._LEVELS of two neighbouring pixels (v, u) and (y, x); the largest where only one has depth."""
    colour, off_a, off_b, cosine = 0.0, 0.0, 0.0, 0.0
    for c in range(3):
        difference = lab[v, u, c] - lab[y, x, c]
        colour += difference * difference
        d = points[y, x, c] - points[v, u, c]
        off_a += normals[v, u, c] * d
        off_b += normals[y, x, c] * d
        cosine += normals[v, u, c] * normals[y, x, c]
    off = max(abs(off_a), abs(off_b)) / (0.01 + 0.01 * min(depth[v, u], depth[y, x]))
    shape = min(off, 1.0) + min((1.0 - cosine) / 0.3, 1.0)
    # Selected rather than branched on, so that the compiler can take several pixels at a time.
    weight = (shape if depth[v, u] > 0.0 else 0.0) + min(np.sqrt(colour) / 25.0, 1.0)
    weight = weight if (depth[v, u] > 0.0) == (depth[y, x] > 0.0) else 3.0
    return np.int32(weight / 3.0 * _LEVELS)


@numba.njit(cache=True, error_model="numpy")
def _edges(
    points: np.ndarray, normals: np.ndarray, lab: np.ndarray, depth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Edges (m,) int32, lightest first, and where those of each weight begin (_LEVELS + 2,).

    Edge 2 i goes from pixel i to the right, 2 i + 1 down; edges of one weight are in the order of their numbers.
    """
    h, w = depth.shape
    across, below = np.empty((h, w), np.int32), np.empty((h, w), np.int32)
    for v in range(h):
        for u in range(w - 1):
            across[v, u] = _weight(points, normals, lab, depth, v, u, v, u + 1)
    for v in range(h - 1):
        for u in range(w):
            below[v, u] = _weight(points, normals, lab, depth, v, u, v + 1, u)
    first = np.zeros(_LEVELS + 2, np.int64)
    for v in range(h):
        for u in range(w):
            if u + 1 < w:
                first[across[v, u] + 1] += 1
            if v + 1 < h:
                first[below[v, u] + 1] += 1
    first = np.cumsum(first)
    free = first.copy()
    edges = np.empty(first[-1], np.int32)
    for v in range(h):
        for u in range(w):
            i = v * w + u
            if u + 1 < w:
                edges[free[across[v, u]]] = 2 * i
                free[across[v, u]] += 1
            if v + 1 < h:
                edges[free[below[v, u]]] = 2 * i + 1
                free[below[v, u]] += 1
    return edges, first


@numba.njit(cache=True, error_model="numpy")
def _root(parent: np.ndarray, i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(cache=True, error_model="numpy")
def _merge(edges: np.ndarray, first: np.ndarray, n: int, w: int, scale: float, min_pixels: int) -> np.ndarray:
    """The first pixel of the patch of each of n pixels, of a picture w wide; edges as of ``_edges``."""
    parent = np.arange(n).astype(np.int32)
    size = np.ones(n, np.int32)
    limit = np.full(n, scale)
    left, n_left = np.empty(len(edges), np.int32), 0  # edges between two patches, of those that may yet join them
    for level in range(_LEVELS + 1):
        weight = level / _LEVELS * 3.0
        for k in range(first[level], first[level + 1]):
            e = edges[k]
            i = e >> 1
            a, b = _root(parent, i), _root(parent, i + w if e & 1 else i + 1)
            if a == b:
                continue
            if weight <= limit[a] and weight <= limit[b]:
                a, b = min(a, b), max(a, b)
                parent[b] = a
                size[a] += size[b]
                limit[a] = weight + scale / size[a]
            elif level < _LEVELS:
                left[n_left] = e
                n_left += 1
    for k in range(n_left):
        e = left[k]
        i = e >> 1
        a, b = _root(parent, i), _root(parent, i + w if e & 1 else i + 1)
        if a != b and min(size[a], size[b]) < min_pixels:
            a, b = min(a, b), max(a, b)
            parent[b] = a
            size[a] += size[b]
    return parent


@numba.njit(cache=True)
def _number(parent: np.ndarray, depth: np.ndarray, seen_only: bool) -> np.ndarray:
    """Patch number 0.. (h, w) int32 in reading order; -1 where there is no depth, if ``seen_only``."""
    h, w = depth.shape
    number = np.full(h * w, -1, np.int32)
    patches = np.full((h, w), -1, np.int32)
    k = 0
    for v in range(h):
        for u in range(w):
            if seen_only and depth[v, u] <= 0.0:
                continue
            r = _root(parent, v * w + u)
            if number[r] < 0:
                number[r] = k
                k += 1
            patches[v, u] = number[r]
    return patches


def superpixels(
    surface: Surface, scale: float = _SCALE, min_pixels: int = _MIN_PIXELS, seen_only: bool = False
) -> npt.NDArray[np.int32]:
    """Patch numbers (h, w) int32 from 0, without gaps, in reading order. A patch has depth everywhere or nowhere.

    ``scale`` is below 3, the largest dissimilarity. With ``seen_only`` the patches without depth are -1 and have no numbers.
    """
    h, w = surface.depth.shape
    edges, first = _edges(surface.points, surface.normals, surface.lab, surface.depth)
    return np.asarray(_number(_merge(edges, first, h * w, w, scale, min_pixels), surface.depth, seen_only))
