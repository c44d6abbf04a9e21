"""Second step of the segmenter: patches become things by joining, pair by pair, the two that most likely belong together.

Every region and every pair of touching regions is described by sums, so that a joined region's description is the sum of its
parts' and nothing looks at pixels again. A small network reads a pair's features and says how likely both lie on one thing
(hierarchical agglomeration with a learned policy, as in Nunez-Iglesias et al., PLoS ONE 2013).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.surface import Surface

# Sums over a region's pixels: count, p (3), p p^T (6), n (3), L a b (3), squared L a b (3), pixels on the picture's border
N_SUMS = 20
# Extremes of a region: low and high corner of its box in gravity-aligned space (6), in the picture (4)
N_EXTREMES = 10
# Sums over a boundary: pixel pairs, step off the plane, pairs across a gap in depth, of them pairs with the region of the lower
# number nearer, bend of the surface, signed convexity, colour edge
N_BOUNDARY = 7
N_PAIR = 30
N_REGION = 22
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
    """Descriptions of the patches 0..n-1 of a working picture (h, w); -1 = part of none."""
    n = int(patches.max(initial=-1)) + 1
    return Regions(*_describe(patches, n, surface.depth, surface.points, surface.normals, surface.lab))


@numba.njit(cache=True)
def _spread(c: np.ndarray) -> np.ndarray:
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
def _covariance(s: np.ndarray) -> np.ndarray:
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
    c = _covariance(s)
    spread = _spread(c)
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
def _region_row(s: np.ndarray, x: np.ndarray, floor: float, pixels: float, out: np.ndarray) -> None:
    m, spread, axis = _plane(s)
    n = s[0]
    length = np.sqrt((s[10:13] ** 2).sum()) + 1e-9
    out[0] = np.log(n) - 6.0
    out[1:4] = np.log(spread + 0.01)
    out[4] = length / n
    out[5] = s[11] / n
    out[6] = abs(axis[1])
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


@numba.njit(cache=True)
def _pair_row(
    sa: np.ndarray, xa: np.ndarray, sb: np.ndarray, xb: np.ndarray, e: np.ndarray, floor: float, out: np.ndarray
) -> None:
    """Features of a pair; a is the smaller region, e the boundary as seen from a."""
    ma, spread_a, axis_a = _plane(sa)
    mb, spread_b, axis_b = _plane(sb)
    spread = _spread(_covariance(sa + sb))
    na, nb, k = sa[0], sb[0], e[0]
    normal_a = sa[10:13] / (np.sqrt((sa[10:13] ** 2).sum()) + 1e-9)
    normal_b = sb[10:13] / (np.sqrt((sb[10:13] ** 2).sum()) + 1e-9)
    between = mb - ma
    out[0], out[1] = np.log(na) - 5.0, np.log(nb) - 7.0
    out[2], out[3] = k / np.sqrt(na), k / np.sqrt(nb)
    out[4], out[5] = e[1] / k * 20.0, e[2] / k
    out[6] = e[3] / k
    out[7], out[8], out[9] = e[4] / k * 2.0, e[5] / k * 2.0, e[6] / k / 10.0
    out[10] = abs(sa[13] / na - sb[13] / nb) / 20.0
    out[11] = np.sqrt((sa[14] / na - sb[14] / nb) ** 2 + (sa[15] / na - sb[15] / nb) ** 2) / 15.0
    out[12] = (normal_a * normal_b).sum()
    out[13], out[14] = np.log(spread_a[0] + 0.003) + 4.0, np.log(spread_b[0] + 0.003) + 4.0
    out[15] = np.log(spread[0] + 0.003) + 4.0
    out[16] = min(abs((between * axis_b).sum()), 1.0) * 3.0
    out[17] = min(abs((between * axis_a).sum()), 1.0) * 3.0
    out[18], out[19] = normal_a[1], normal_b[1]
    out[20], out[21] = xa[1] - floor, xa[4] - floor
    out[22], out[23] = xb[1] - floor, xb[4] - floor
    out[24] = min(np.sqrt((between * between).sum()), 5.0)
    out[25] = np.log(spread[2] + 0.02) + 1.0
    out[26] = np.log(spread_a[2] + 0.02) + 1.0
    out[27] = np.log(spread_b[2] + 0.02) + 1.0
    out[28] = xa[1] - xb[4]
    out[29] = xa[4] - xb[4]


@numba.njit(cache=True)
def _probability(x: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray, o: int) -> float:
    """Output o of the network: sigmoid(w2 relu(w1 x + b1) + b2)."""
    z = b2[o]
    for j in range(len(b1)):
        a = b1[j]
        for i in range(len(x)):
            a += w1[j, i] * x[i]
        if a > 0.0:
            z += w2[o, j] * a
    return float(1.0 / (1.0 + np.exp(-z)))


@numba.njit(cache=True)
def _rate(
    a: int, b: int, sums: np.ndarray, extremes: np.ndarray, boundary: np.ndarray, floor: float,
    row: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray,
) -> float:  # fmt: skip
    if sums[a, 0] > sums[b, 0] or (sums[a, 0] == sums[b, 0] and a > b):
        a, b = b, a
    _pair_row(sums[a], extremes[a], sums[b], extremes[b], boundary[a, b], floor, row)
    return float(_probability(row, w1, b1, w2, b2, 0))


@numba.njit(cache=True)
def _absorb(a: int, b: int, sums: np.ndarray, extremes: np.ndarray, boundary: np.ndarray) -> None:
    """Region b becomes part of region a."""
    sums[a] += sums[b]
    for low, high in ((0, 3), (1, 4), (2, 5), (6, 8), (7, 9)):
        extremes[a, low] = min(extremes[a, low], extremes[b, low])
        extremes[a, high] = max(extremes[a, high], extremes[b, high])
    for c in range(len(sums)):
        if c != a and boundary[b, c, 0] > 0:
            boundary[a, c] += boundary[b, c]
            boundary[c, a] += boundary[c, b]
        boundary[b, c] = 0
        boundary[c, b] = 0


@numba.njit(cache=True)
def _agglomerate(
    sums: np.ndarray,
    extremes: np.ndarray,
    boundary: np.ndarray,
    floor: float,
    stop: float,
    w1: np.ndarray,
    b1: np.ndarray,
    w2: np.ndarray,
    b2: np.ndarray,
    seen: np.ndarray,
    rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """Children (k, 2) of the joined nodes n, n + 1, ... and their probabilities, sums and extremes.

    Changes its arguments: the pairs that it rates and their features go to ``seen`` (L, 2) and ``rows`` (L, N_PAIR), as far as
    there is room; the last result says how many.
    """
    n = len(sums)
    logged = 0
    row = np.empty(N_PAIR)
    rate = np.full((n, n), -1.0)
    best = np.zeros(n, np.int64)
    for a in range(n):
        for b in range(a + 1, n):
            if boundary[a, b, 0] > 0:
                rate[a, b] = rate[b, a] = _rate(a, b, sums, extremes, boundary, floor, row, w1, b1, w2, b2)
                if logged < len(rows):
                    seen[logged, 0], seen[logged, 1], rows[logged] = a, b, row
                    logged += 1
    for a in range(n):
        best[a] = np.argmax(rate[a])
    node = np.arange(n)
    children, values = np.empty((n, 2), np.int32), np.empty(n)
    node_sums, node_extremes = np.empty((n, N_SUMS)), np.empty((n, N_EXTREMES))
    count = 0
    while count < n - 1:
        a, value = -1, stop
        for i in range(n):
            if rate[i, best[i]] > value:
                a, value = i, rate[i, best[i]]
        if a < 0:
            break
        a, b = min(a, best[a]), max(a, best[a])
        children[count, 0], children[count, 1], values[count] = node[a], node[b], value
        node[a] = n + count
        _absorb(a, b, sums, extremes, boundary)
        node_sums[count], node_extremes[count] = sums[a], extremes[a]
        count += 1
        rate[b, :] = -1.0
        rate[:, b] = -1.0
        rate[a, :] = -1.0
        for c in range(n):
            rate[c, a] = -1.0
            if boundary[a, c, 0] > 0:
                rate[a, c] = rate[c, a] = _rate(a, c, sums, extremes, boundary, floor, row, w1, b1, w2, b2)
                if logged < len(rows):
                    seen[logged, 0], seen[logged, 1], rows[logged] = node[a], node[c], row
                    logged += 1
        best[a] = np.argmax(rate[a])
        for c in range(n):
            if best[c] == a or best[c] == b:
                best[c] = np.argmax(rate[c])
            elif rate[c, a] > rate[c, best[c]]:
                best[c] = a
    return children[:count], values[:count], node_sums[:count], node_extremes[:count], logged


@dataclass(frozen=True)
class Network:
    """sigmoid(w2 relu(w1 x + b1) + b2) with w1 (hidden, inputs), w2 (outputs, hidden), all float64."""

    w1: npt.NDArray[np.float64]
    b1: npt.NDArray[np.float64]
    w2: npt.NDArray[np.float64]
    b2: npt.NDArray[np.float64]

    def arrays(self) -> tuple[npt.NDArray[np.float64], ...]:
        """The four arrays, in order."""
        return self.w1, self.b1, self.w2, self.b2

    def __call__(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Probabilities (n, outputs) of inputs (n, inputs)."""
        z = np.maximum(np.asarray(x, np.float64) @ self.w1.T + self.b1, 0.0) @ self.w2.T + self.b2
        return np.asarray(1.0 / (1.0 + np.exp(-z)))


@dataclass(frozen=True)
class Tree:
    """How n regions were joined, one pair at a time: nodes 0..n-1 are the regions, node n + i is the i-th join.

    Parameters
    ----------
    children : (k, 2) int32
        The two nodes that make node n + i.
    probabilities : (k,) float64
        That they belonged together, when they were joined.
    sums : (n + k, N_SUMS), extremes : (n + k, N_EXTREMES)
        As in ``Regions``, of every node.
    """

    children: npt.NDArray[np.int32]
    probabilities: npt.NDArray[np.float64]
    sums: npt.NDArray[np.float64]
    extremes: npt.NDArray[np.float64]

    @property
    def n_leaves(self) -> int:
        return len(self.sums) - len(self.children)


_NO_LOG = (np.empty((0, 2), np.int32), np.empty((0, N_PAIR)))


def agglomerate(
    regions: Regions,
    floor: float,
    network: Network,
    stop: float,
    log: tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]] = _NO_LOG,
) -> tuple[Tree, int]:
    """Join touching regions, the most probable pair first, until no pair is more probable than ``stop``.

    For training, ``log`` takes the nodes (L, 2) and the features (L, N_PAIR) of the pairs looked at; how many is the second result.
    """
    sums, extremes = regions.sums.copy(), regions.extremes.copy()
    children, probabilities, joined_sums, joined_extremes, logged = _agglomerate(
        sums, extremes, regions.boundary.copy(), floor, stop, *network.arrays(), *log
    )
    tree = Tree(
        children,
        probabilities,
        np.concatenate([regions.sums, joined_sums]),
        np.concatenate([regions.extremes, joined_extremes]),
    )
    return tree, logged


def best_cut(tree: Tree, worth: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """The node (n,) that each region goes to, in the cut through the tree whose nodes are together worth most."""
    n = tree.n_leaves
    total, whole = worth.copy(), np.ones(len(worth), bool)
    for i, (a, b) in enumerate(tree.children, start=n):
        apart = total[a] + total[b]
        whole[i] = worth[i] >= apart
        total[i] = max(worth[i], apart)
    owner = np.arange(len(worth))
    for i in range(len(worth) - 1, n - 1, -1):
        if owner[i] != i or whole[i]:
            owner[tree.children[i - n]] = owner[i]
    return owner[:n]


@numba.njit(cache=True)
def _region_rows(sums: np.ndarray, extremes: np.ndarray, floor: float, pixels: float) -> np.ndarray:
    rows = np.empty((len(sums), N_REGION))
    for i in range(len(sums)):
        _region_row(sums[i], extremes[i], floor, pixels, rows[i])
    return rows


def region_features(regions: Regions | Tree, floor: float, pixels: int) -> npt.NDArray[np.float64]:
    """What a network may know of each region, or of each node of a tree, by itself, (n, N_REGION); the picture's pixels."""
    return np.asarray(_region_rows(regions.sums, regions.extremes, floor, float(pixels)))
