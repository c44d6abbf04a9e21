"""Second step of the segmenter: patches become things by joining, pair by pair, the two that most likely belong together.

A small network reads a pair's features and says how likely both lie on one thing (hierarchical agglomeration with a learned
policy, as in Nunez-Iglesias et al., PLoS ONE 2013). What comes out is a tree, of which ``best_cut`` takes the best part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.maps import N_BELONGING, N_CLASSES
from openmap_agents.perception.regions import (
    AXIS,
    LOGITS,
    MEAN,
    N_DERIVED,
    N_EXTREMES,
    N_SUMS,
    NORMAL,
    PLACE_OF_E,
    SCATTER,
    SPREAD,
    SQUARE,
    Regions,
    covariance,
    derive,
    spread_of,
)

N_PAIR = 35 + 2 * N_CLASSES


@numba.njit(cache=True)
def _pair_row(
    sa: np.ndarray, xa: np.ndarray, da: np.ndarray, sb: np.ndarray, xb: np.ndarray, db: np.ndarray,
    e: np.ndarray, floor: float, out: np.ndarray,
) -> None:  # fmt: skip
    """Features of a pair; a is the smaller region, e the boundary as seen from a, d what ``derive`` says."""
    both = sa + sb
    spread = spread_of(covariance(both))
    na, nb, k = sa[0], sb[0], e[0]
    facing, off_a, off_b, far = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        between = db[MEAN + i] - da[MEAN + i]
        facing += da[NORMAL + i] * db[NORMAL + i]
        off_a += between * da[AXIS + i]
        off_b += between * db[AXIS + i]
        far += between * between
    out[0], out[1] = np.log(na) - 5.0, np.log(nb) - 7.0
    out[2], out[3] = k / np.sqrt(na), k / np.sqrt(nb)
    out[4], out[5] = e[1] / k * 20.0, e[2] / k
    out[6] = e[3] / k
    out[7], out[8], out[9] = e[4] / k * 2.0, e[5] / k * 2.0, e[6] / k / 10.0
    out[10] = abs(sa[13] / na - sb[13] / nb) / 20.0
    out[11] = np.sqrt((sa[14] / na - sb[14] / nb) ** 2 + (sa[15] / na - sb[15] / nb) ** 2) / 15.0
    out[12] = facing
    out[13], out[14] = np.log(da[SPREAD] + 0.003) + 4.0, np.log(db[SPREAD] + 0.003) + 4.0
    out[15] = np.log(spread[0] + 0.003) + 4.0
    out[16] = min(abs(off_b), 1.0) * 3.0
    out[17] = min(abs(off_a), 1.0) * 3.0
    out[18], out[19] = da[NORMAL + 1], db[NORMAL + 1]
    out[20], out[21] = xa[1] - floor, xa[4] - floor
    out[22], out[23] = xb[1] - floor, xb[4] - floor
    out[24] = min(np.sqrt(far), 5.0)
    out[25] = np.log(spread[2] + 0.02) + 1.0
    out[26] = np.log(da[SPREAD + 2] + 0.02) + 1.0
    out[27] = np.log(db[SPREAD + 2] + 0.02) + 1.0
    out[28] = xa[1] - xb[4]
    out[29] = xa[4] - xb[4]
    apart, square = 0.0, 0.0
    for i in range(N_BELONGING):
        apart += (da[PLACE_OF_E + i] - db[PLACE_OF_E + i]) ** 2
        square += ((na * da[PLACE_OF_E + i] + nb * db[PLACE_OF_E + i]) / (na + nb)) ** 2
    out[30], out[31] = np.sqrt(apart), np.sqrt(e[7] / k)
    out[32], out[33] = da[SCATTER], db[SCATTER]
    out[34] = np.sqrt(max(both[SQUARE] / both[0] - square, 0.0))
    for i in range(N_CLASSES):
        out[35 + i] = da[LOGITS + i] / 4.0
        out[35 + N_CLASSES + i] = db[LOGITS + i] / 4.0


@numba.njit(cache=True)
def _probability(
    x: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray, hidden: np.ndarray
) -> float:
    """First output of the network: sigmoid(w2 relu(x w1 + b1) + b2); w1 is (inputs, hidden) here, so that the inner loop is one of
    independent sums, which the compiler may do several at a time."""
    hidden[:] = b1
    for i in range(len(x)):
        for j in range(len(hidden)):
            hidden[j] += w1[i, j] * x[i]
    z = b2[0]
    for j in range(len(hidden)):
        if hidden[j] > 0.0:
            z += w2[0, j] * hidden[j]
    return float(1.0 / (1.0 + np.exp(-z)))


@numba.njit(cache=True)
def _rate(
    a: int, b: int, sums: np.ndarray, extremes: np.ndarray, derived: np.ndarray, boundary: np.ndarray, floor: float,
    row: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray, hidden: np.ndarray,
) -> float:  # fmt: skip
    if sums[a, 0] > sums[b, 0] or (sums[a, 0] == sums[b, 0] and a > b):
        a, b = b, a
    _pair_row(sums[a], extremes[a], derived[a], sums[b], extremes[b], derived[b], boundary[a, b], floor, row)
    return float(_probability(row, w1, b1, w2, b2, hidden))


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
    row, hidden, derived = np.empty(N_PAIR), np.empty(len(b1)), np.empty((n, N_DERIVED))
    for a in range(n):
        derive(sums[a], derived[a])
    rate = np.full((n, n), -1.0)
    best = np.zeros(n, np.int64)
    for a in range(n):
        for b in range(a + 1, n):
            if boundary[a, b, 0] > 0:
                rate[a, b] = rate[b, a] = _rate(
                    a, b, sums, extremes, derived, boundary, floor, row, w1, b1, w2, b2, hidden
                )
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
        derive(sums[a], derived[a])
        node_sums[count], node_extremes[count] = sums[a], extremes[a]
        count += 1
        rate[b, :] = -1.0
        rate[:, b] = -1.0
        rate[a, :] = -1.0
        for c in range(n):
            rate[c, a] = -1.0
            if boundary[a, c, 0] > 0:
                rate[a, c] = rate[c, a] = _rate(
                    a, c, sums, extremes, derived, boundary, floor, row, w1, b1, w2, b2, hidden
                )
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

    The boundaries are used up: they are large, and nobody needs them again. For training, ``log`` takes the nodes (L, 2) and the
    features (L, N_PAIR) of the pairs looked at; how many is the second result.
    """
    sums, extremes = regions.sums.copy(), regions.extremes.copy()
    children, probabilities, joined_sums, joined_extremes, logged = _agglomerate(
        sums,
        extremes,
        regions.boundary,
        floor,
        stop,
        np.ascontiguousarray(network.w1.T),
        *network.arrays()[1:],
        *log,
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
