"""What is known of a region of a picture: sums over its pixels and along its boundaries, and the features that follow from them.

A joined region's description is the sum of its parts', so that nothing looks at pixels again after the first time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.maps import N_BELONGING, N_CLASSES
from openmap_agents.perception.surface import Surface

# Sums over a region's pixels: count, p (3), p p^T (6), n (3), L a b (3), squared L a b (3), pixels on the picture's border,
# then what the neck says: its place among things e (N_BELONGING), the classes' logits (N_CLASSES), and |e|^2
N_MEASURED = 20
_PLACE, _CLASS = N_MEASURED, N_MEASURED + N_BELONGING
SQUARE = _CLASS + N_CLASSES
N_SUMS = SQUARE + 1
# Extremes of a region: low and high corner of its box in gravity-aligned space (6), in the picture (4)
N_EXTREMES = 10
# Sums over a boundary: pixel pairs, step off the plane, pairs across a gap in depth, of them pairs with the region of the lower
# number nearer, bend of the surface, signed convexity, colour edge, |e_p - e_q|^2
N_BOUNDARY = 8
N_MEASURED_BETWEEN = 7
N_REGION = 23 + N_CLASSES
FARTHEST = 20.0  # beyond this |e_p - e_q|^2 says no more
# What is worked out once of every region: mean (3), deviations along its principal axes (3), its plane's normal (3), its mean
# normal (3), mean e, mean logits, scatter of e
MEAN, SPREAD, AXIS, NORMAL, PLACE_OF_E = 0, 3, 6, 9, 12
LOGITS = PLACE_OF_E + N_BELONGING
SCATTER = LOGITS + N_CLASSES
N_DERIVED = SCATTER + 1
_GAP = 0.04  # relative step off the plane that counts as a gap


@dataclass
class Regions:
    """Descriptions of n regions; see the constants above for the columns.

    Parameters
    ----------
    sums : (n, N_SUMS) float64
    extremes : (n, N_EXTREMES) float64
    boundary : (n, n, N_BOUNDARY) float32, symmetric but for its column 3
    """

    sums: npt.NDArray[np.float64]
    extremes: npt.NDArray[np.float64]
    boundary: npt.NDArray[np.float32]


@numba.njit(cache=True)
def _describe(
    patches: np.ndarray, n: int, depth: np.ndarray, points: np.ndarray, normals: np.ndarray, lab: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    h, w = depth.shape
    sums = np.zeros((n, N_SUMS))
    extremes = np.empty((n, N_EXTREMES))
    extremes[:, 0:3], extremes[:, 3:6] = np.inf, -np.inf
    extremes[:, 6:8], extremes[:, 8:10] = np.inf, -np.inf
    boundary = np.zeros((n, n, N_BOUNDARY), np.float32)
    for v in range(h):
        for u in range(w):
            i = patches[v, u]
            if i < 0:
                continue
            p, q, c = points[v, u], normals[v, u], lab[v, u]
            s = sums[i]
            s[0] += 1
            for k in range(3):
                s[1 + k] += p[k]
                s[10 + k] += q[k]
                s[13 + k] += c[k]
                s[16 + k] += c[k] * c[k]
                extremes[i, k] = min(extremes[i, k], p[k])
                extremes[i, 3 + k] = max(extremes[i, 3 + k], p[k])
            s[4] += p[0] * p[0]
            s[5] += p[1] * p[1]
            s[6] += p[2] * p[2]
            s[7] += p[0] * p[1]
            s[8] += p[0] * p[2]
            s[9] += p[1] * p[2]
            s[19] += v == 0 or u == 0 or v == h - 1 or u == w - 1
            extremes[i, 6], extremes[i, 7] = min(extremes[i, 6], v), min(extremes[i, 7], u)
            extremes[i, 8], extremes[i, 9] = max(extremes[i, 8], v), max(extremes[i, 9], u)
            for side in range(2):
                y, x = v + side, u + 1 - side
                if y >= h or x >= w:
                    continue
                j = patches[y, x]
                if j < 0 or j == i:
                    continue
                off_a, off_b, cosine, bend, colour, length = 0.0, 0.0, 0.0, 0.0, 0.0, 1e-12
                for k in range(3):
                    d = points[y, x, k] - p[k]
                    off_a += q[k] * d
                    off_b += normals[y, x, k] * d
                    cosine += q[k] * normals[y, x, k]
                    bend += (normals[y, x, k] - q[k]) * d
                    length += d * d
                    colour += (lab[y, x, k] - c[k]) ** 2
                near = min(depth[v, u], depth[y, x])
                step = max(abs(off_a), abs(off_b)) / near
                gap = step > _GAP
                convex = 0.0 if gap else bend / np.sqrt(length)
                for a, b, nearer in ((i, j, depth[v, u] < depth[y, x]), (j, i, depth[v, u] > depth[y, x])):
                    e = boundary[a, b]
                    e[0] += 1
                    e[1] += min(step, 0.2)
                    e[2] += gap
                    e[3] += gap and nearer
                    e[4] += 1.0 - cosine
                    e[5] += convex
                    e[6] += min(np.sqrt(colour), 50.0)
    return sums, extremes, boundary


def describe(patches: npt.NDArray[np.int32], surface: Surface) -> Regions:
    """Descriptions of the patches 0..n-1 of a working picture (h, w); -1 = part of none. What the neck says is yet zero."""
    n = int(patches.max(initial=-1)) + 1
    return Regions(*_describe(patches, n, surface.depth, surface.points, surface.normals, surface.lab))


@numba.njit(cache=True)
def _add_belonging(
    patches: np.ndarray,
    rows: np.ndarray,
    columns: np.ndarray,
    cells: np.ndarray,
    sums: np.ndarray,
    boundary: np.ndarray,
) -> None:
    h, w = patches.shape
    channels = cells.shape[2]
    for v in range(h):
        for u in range(w):
            i = patches[v, u]
            if i < 0:
                continue
            c = cells[rows[v], columns[u]]
            square = 0.0
            for k in range(channels):
                sums[i, _PLACE + k] += c[k]
                if k < N_BELONGING:
                    square += c[k] * c[k]
            sums[i, SQUARE] += square
            for side in range(2):
                y, x = v + side, u + 1 - side
                if y >= h or x >= w:
                    continue
                j = patches[y, x]
                if j < 0 or j == i:
                    continue
                d = cells[rows[y], columns[x]]
                apart = 0.0
                for k in range(N_BELONGING):
                    apart += (c[k] - d[k]) ** 2
                apart = min(apart, FARTHEST)
                boundary[i, j, 7] += apart
                boundary[j, i, 7] += apart


def add_belonging(
    regions: Regions,
    patches: npt.NDArray[np.int32],
    belonging: npt.NDArray[np.float32],
    rows: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int64],
) -> None:
    """Add to the patches' descriptions what the neck says, (N_BELONGING + N_CLASSES, h4, w4); the rest is ``cells_of`` stride 4."""
    cells = np.ascontiguousarray(belonging.transpose(1, 2, 0))
    _add_belonging(patches, rows, columns, cells, regions.sums, regions.boundary)


@numba.njit(cache=True)
def spread_of(c: np.ndarray) -> np.ndarray:
    """Roots of the eigenvalues (3,), ascending, of a covariance given as xx, yy, zz, xy, xz, yz (Smith, CACM 4(4), 1961)."""
    mean = (c[0] + c[1] + c[2]) / 3.0
    off = c[3] ** 2 + c[4] ** 2 + c[5] ** 2
    p = np.sqrt(((c[0] - mean) ** 2 + (c[1] - mean) ** 2 + (c[2] - mean) ** 2 + 2.0 * off) / 6.0)
    out = np.empty(3)
    if p < 1e-15:
        out[:] = np.sqrt(max(mean, 0.0))
        return out
    x, y, z = (c[0] - mean) / p, (c[1] - mean) / p, (c[2] - mean) / p
    f, g, h = c[3] / p, c[4] / p, c[5] / p
    determinant = x * (y * z - h * h) - f * (f * z - h * g) + g * (f * h - y * g)
    angle = np.arccos(min(max(determinant / 2.0, -1.0), 1.0)) / 3.0
    high = mean + 2.0 * p * np.cos(angle)
    low = mean + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0)
    out[0], out[1], out[2] = low, 3.0 * mean - high - low, high
    for k in range(3):
        out[k] = np.sqrt(max(out[k], 0.0))
    return out


@numba.njit(cache=True)
def covariance(s: np.ndarray) -> np.ndarray:
    """xx, yy, zz, xy, xz, yz of summed points."""
    x, y, z = s[1] / s[0], s[2] / s[0], s[3] / s[0]
    c: np.ndarray = s[4:10] / s[0]
    c[0] -= x * x
    c[1] -= y * y
    c[2] -= z * z
    c[3] -= x * y
    c[4] -= x * z
    c[5] -= y * z
    return c


@numba.njit(cache=True)
def _plane(s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (3,), standard deviations along the principal axes (3,) ascending, normal (3,) of the plane through summed points.

    The normal is the longest cross product of two rows of C - low I; that of the pixels' mean where the points do not span a plane.
    """
    c = covariance(s)
    spread = spread_of(c)
    low = spread[0] ** 2
    rows = np.array([[c[0] - low, c[3], c[4]], [c[3], c[1] - low, c[5]], [c[4], c[5], c[2] - low]])
    axis, longest = s[10:13].copy(), 0.0
    for i in range(3):
        a, b = rows[i], rows[(i + 1) % 3]
        x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        length = x * x + y * y + z * z
        if length > longest:
            longest = length
            axis[0], axis[1], axis[2] = x, y, z
    if longest <= 1e-24 * c[:3].sum() ** 4:
        axis = s[10:13].copy()
    return s[1:4] / s[0], spread, axis / (np.sqrt((axis * axis).sum()) + 1e-30)


@numba.njit(cache=True)
def derive(s: np.ndarray, out: np.ndarray) -> None:
    mean, spread, axis = _plane(s)
    length = np.sqrt((s[10:13] ** 2).sum()) + 1e-9
    square = 0.0
    for k in range(3):
        out[MEAN + k], out[SPREAD + k], out[AXIS + k] = mean[k], spread[k], axis[k]
        out[NORMAL + k] = s[10 + k] / length
    for k in range(N_BELONGING + N_CLASSES):
        out[PLACE_OF_E + k] = s[_PLACE + k] / s[0]
        if k < N_BELONGING:
            square += out[PLACE_OF_E + k] ** 2
    out[SCATTER] = np.sqrt(max(s[SQUARE] / s[0] - square, 0.0))


@numba.njit(cache=True)
def _region_row(s: np.ndarray, x: np.ndarray, floor: float, pixels: float, out: np.ndarray) -> None:
    d = np.empty(N_DERIVED)
    derive(s, d)
    m = d[MEAN : MEAN + 3]
    n = s[0]
    length = np.sqrt((s[10:13] ** 2).sum()) + 1e-9
    out[0] = np.log(n) - 6.0
    for k in range(3):
        out[1 + k] = np.log(d[SPREAD + k] + 0.01)
    out[4] = length / n
    out[5] = s[11] / n
    out[6] = abs(d[AXIS + 1])
    out[7] = x[1] - floor
    out[8] = x[4] - floor
    out[9] = m[1] - floor
    out[10] = x[4] - x[1]
    out[11] = np.log(max(x[3] - x[0], x[5] - x[2]) + 0.01)
    out[12] = np.log(np.sqrt((m * m).sum()) + 0.1)
    out[13:16] = s[13:16] / n / 50.0
    variance = 0.0
    for k in range(3):
        variance += max(s[16 + k] / n - (s[13 + k] / n) ** 2, 0.0)
    out[16] = np.sqrt(variance) / 20.0
    out[17] = s[19] / np.sqrt(n)
    out[18] = n / ((x[8] - x[6] + 1) * (x[9] - x[7] + 1))
    out[19] = n / pixels * 5.0
    out[20] = (x[9] - x[7] + 1) / np.sqrt(pixels)
    out[21] = (x[8] - x[6] + 1) / np.sqrt(pixels)
    out[22] = d[SCATTER]
    for k in range(N_CLASSES):
        out[23 + k] = d[LOGITS + k] / 4.0


@numba.njit(cache=True)
def _region_rows(sums: np.ndarray, extremes: np.ndarray, floor: float, pixels: float) -> np.ndarray:
    rows = np.empty((len(sums), N_REGION))
    for i in range(len(sums)):
        _region_row(sums[i], extremes[i], floor, pixels, rows[i])
    return rows


def region_features(
    sums: npt.NDArray[np.float64], extremes: npt.NDArray[np.float64], floor: float, pixels: int
) -> npt.NDArray[np.float64]:
    """What a network may know of each region by itself, (n, N_REGION); ``pixels`` of the whole picture."""
    return np.asarray(_region_rows(sums, extremes, floor, float(pixels)))
