"""How big a region is, how high it hangs and how flat it is: what gravity-aligned depth says of a thing without its looks."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.surface import Surface

N_SHAPE = 16
_FEWEST = 4  # pixels with depth that a row is made of
_ENDS = 0.02  # a mask reaches from this quantile of its pixels to that of 1 minus it
_UP, _SIDEWAYS = 0.9, 0.2  # vertical part of a normal, at least and at most
# Columns of ``_moments``: pixels with depth, all pixels, pixels on the picture's border, mean point (3), mean normal (3), shares of
# pixels facing up and sideways, covariance of the points (9).
_SEEN, _ALL, _BORDER, _POINT, _NORMAL, _FACING, _COVARIANCE, _N_MOMENTS = 0, 1, 2, 3, 6, 9, 11, 20


@numba.njit(cache=True)
def _by_label(labels: np.ndarray, depth: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flat pixels with depth in the order of their labels, where those of 1..n begin and end (n + 1,), and moments begun."""
    h, w = labels.shape
    moments = np.zeros((n, _N_MOMENTS))
    for v in range(h):
        for u in range(w):
            k = labels[v, u] - 1
            if 0 <= k < n:
                moments[k, _SEEN] += depth[v, u] > 0.0
                moments[k, _ALL] += 1
                moments[k, _BORDER] += v == 0 or u == 0 or v == h - 1 or u == w - 1
    first = np.zeros(n + 1, np.int64)
    for k in range(n):
        first[k + 1] = first[k] + np.int64(moments[k, _SEEN])
    pixels, free = np.empty(first[-1], np.int64), first.copy()
    for v in range(h):
        for u in range(w):
            k = labels[v, u] - 1
            if 0 <= k < n and depth[v, u] > 0.0:
                pixels[free[k]] = v * w + u
                free[k] += 1
    return pixels, first, moments


@numba.njit(cache=True, error_model="numpy")
def _fill_moments(
    pixels: np.ndarray, first: np.ndarray, points: np.ndarray, normals: np.ndarray, moments: np.ndarray
) -> None:
    """Complete the moments (n, _N_MOMENTS) of masks of flat pixels with depth; points and normals (h * w, 3)."""
    for k in range(len(moments)):
        m, n = moments[k], first[k + 1] - first[k]
        if n < _FEWEST:
            continue
        for i in pixels[first[k] : first[k + 1]]:
            for c in range(3):
                m[_POINT + c] += points[i, c]
                m[_NORMAL + c] += normals[i, c]
            m[_FACING] += normals[i, 1] > _UP
            m[_FACING + 1] += abs(normals[i, 1]) < _SIDEWAYS
        m[_POINT:_COVARIANCE] /= n
        for i in pixels[first[k] : first[k + 1]]:
            for a in range(3):
                for b in range(3):
                    m[_COVARIANCE + 3 * a + b] += (points[i, a] - m[_POINT + a]) * (points[i, b] - m[_POINT + b])
        m[_COVARIANCE:] /= n - 1


@numba.njit(cache=True, error_model="numpy")
def _quantile(values: np.ndarray, share: float) -> float:
    """The quantile of values (n,), interpolated linearly; leaves them in another order. Hoare's selection."""
    place = share * (len(values) - 1)
    k = int(place)
    low, high = 0, len(values) - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    here, after = values[k], values[min(k + 1, len(values) - 1)]
    for i in range(k + 2, len(values)):
        after = min(after, values[i])
    return float(here + (after - here) * (place - k))


@numba.njit(cache=True, error_model="numpy")
def _extents(
    pixels: np.ndarray, first: np.ndarray, points: np.ndarray, depth: np.ndarray, axes: np.ndarray
) -> np.ndarray:
    """Low and high end, extents along the level axes (n, 2, 2, columns) and median depth of each mask, (n, 5) float64."""
    out = np.zeros((len(first) - 1, 5))
    room = np.empty(len(pixels))
    for k in range(len(out)):
        own = pixels[first[k] : first[k + 1]]
        values = room[: len(own)]
        if len(own) < _FEWEST:
            continue
        for j in range(len(own)):
            values[j] = points[own[j], 1]
        out[k, 0], out[k, 1] = _quantile(values, _ENDS), _quantile(values, 1.0 - _ENDS)
        for axis in range(2):
            for j in range(len(own)):
                values[j] = points[own[j], 0] * axes[k, 0, axis] + points[own[j], 2] * axes[k, 1, axis]
            out[k, 2 + axis] = -_quantile(values, _ENDS)
            out[k, 2 + axis] += _quantile(values, 1.0 - _ENDS)
        for j in range(len(own)):
            values[j] = depth[own[j]]
        out[k, 4] = _quantile(values, 0.5)
    return out


def shape_features(surface: Surface, labels: npt.NDArray[np.int32], n: int) -> npt.NDArray[np.float32]:
    """What the working picture says of each label 1..n of it (h, w), (n, N_SHAPE) float32; one without depth gets zeros.

    Raises
    ------
    ValueError
        The labels are of a picture of another size.
    """
    if labels.shape != surface.depth.shape:
        raise ValueError(f"labels are {labels.shape}, expected {surface.depth.shape} as the working picture")
    labels = np.ascontiguousarray(labels, np.int32)
    points, normals, depth = surface.points.reshape(-1, 3), surface.normals.reshape(-1, 3), surface.depth.ravel()
    pixels, first, m = _by_label(labels, surface.depth, n)
    _fill_moments(pixels, first, points, normals, m)
    covariance = m[:, _COVARIANCE:].reshape(n, 3, 3)
    _, axes = np.linalg.eigh(covariance[:, ::2, ::2])
    low, high, short, long, distance = _extents(pixels, first, points, depth, axes).T
    low, high = low - surface.floor, high - surface.floor
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 0.0))
    rows = np.column_stack(
        [
            low,
            high,
            (low + high) / 2,
            np.log(high - low + 0.02),
            np.log(long + 0.02),
            np.log(short + 0.02),
            np.log((long + 0.02) / (high - low + 0.02)),
            np.log(spread[:, 0] + 0.005),
            spread[:, 0] / (spread[:, 2] + 0.01),
            m[:, _FACING],
            m[:, _FACING + 1],
            m[:, _NORMAL + 1],
            np.linalg.norm(m[:, _NORMAL : _NORMAL + 3], axis=1),
            np.log(np.linalg.norm(m[:, _POINT : _POINT + 3], axis=1) + 0.1),
            np.log(m[:, _SEEN] * distance**2 / labels.size + 1e-4),
            m[:, _BORDER] / np.sqrt(np.maximum(m[:, _ALL], 1)),
        ]
    )
    rows[m[:, _SEEN] < _FEWEST] = 0.0
    return rows.astype(np.float32)
