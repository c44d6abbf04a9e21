"""Soft view consensus on sparse rows: the rounds of ``reference_soft.py``, which says plainly what is computed here.

A round finds for every node the partner of the highest score; two nodes that are each other's best become one. Only nodes that
share a mask can have a score, so a node meets its partners in the columns of the masks that hold parts of it. New nodes do so and
tell the others; a node looks again only when all the partners that it has kept in mind are gone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.consensus import Rows, rows_by
from openmap_agents.mapping.semantics import COSINE_STEPS, SoftWeight

SHARES = 64
"""Units of a share."""
FEATURE_STEPS = 2048
"""Units of a mask's feature; sums of a million of them are exact in float64."""
LISTED = 8
"""How many of its best partners a node keeps in mind."""
MEAN_STEPS = 8 * FEATURE_STEPS
"""Units of the mean feature of a node, which fits 16 bits."""


@dataclass
class SoftNodes:
    """n nodes: ``counts[i]`` by segment, how many voxels of the node's masks lie under it in frames that observe them.

    Parameters
    ----------
    counts, count : Rows, (nnz,) int64
        Segments, ascending, and their counts.
    features : (n, D) float64
        Sums of the members' features in units of 1 / ``FEATURE_STEPS``.
    n_features : (n,) int64
        How many members have one.
    """

    counts: Rows
    count: npt.NDArray[np.int64]
    features: npt.NDArray[np.float64]
    n_features: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.counts)


def nodes_of_masks(
    masks: npt.NDArray[np.int32],
    overlaps: tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]],
    features: npt.NDArray[np.float32],
) -> SoftNodes:
    """A node for each of the segments ``masks`` (n,), ascending.

    ``overlaps`` are columns (mask, segment, voxels) of what segments hold of masks, each mask's by segment; ``features`` (S, D)
    are those of all segments, zeros = none.
    """
    node_of = np.full(len(features), -1, np.int32)
    node_of[masks] = np.arange(len(masks), dtype=np.int32)
    owner, use = node_of[overlaps[0]], node_of[overlaps[0]] >= 0
    counts = rows_by(owner, len(masks), overlaps[1], use)
    count = rows_by(owner, len(masks), overlaps[2], use).values.astype(np.int64)
    own = features[masks]
    return SoftNodes(
        counts, count, np.rint(own.astype(np.float64) * FEATURE_STEPS), np.asarray(own.any(axis=1), np.int64)
    )


@numba.njit(cache=True)
def _popcount(x):  # type: ignore[no-untyped-def]
    x = x - ((x >> np.uint64(1)) & np.uint64(0x5555555555555555))
    x = (x & np.uint64(0x3333333333333333)) + ((x >> np.uint64(2)) & np.uint64(0x3333333333333333))
    x = (x + (x >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((x * np.uint64(0x0101010101010101)) >> np.uint64(56))


@numba.njit(cache=True)
def _shares(start, segment, count, segment_frame, n_frames, least):  # type: ignore[no-untyped-def]
    """Rows of shares, and the frames that observe each node as bits (n, W)."""
    n = len(start) - 1
    seen = np.zeros((n, (n_frames + 63) // 64), np.uint64)
    total = np.zeros(n_frames, np.int64)
    out_start, out, share = (
        np.zeros(n + 1, np.int64),
        np.empty(len(segment), np.int32),
        np.empty(len(segment), np.int32),
    )
    filled = 0
    for i in range(n):
        for e in range(start[i], start[i + 1]):
            total[segment_frame[segment[e]]] += count[e]
        for e in range(start[i], start[i + 1]):
            t = segment_frame[segment[e]]
            part = (2 * SHARES * count[e] + total[t]) // (2 * total[t])
            if part >= least:
                out[filled], share[filled] = segment[e], part
                filled += 1
            seen[i, t // 64] |= np.uint64(1) << np.uint64(t % 64)
        for e in range(start[i], start[i + 1]):
            total[segment_frame[segment[e]]] = 0
        out_start[i + 1] = filled
    return out_start, out[:filled].copy(), share[:filled].copy(), seen


@numba.njit(cache=True)
def _columns(start, segment, share, n_segments):  # type: ignore[no-untyped-def]
    """The same entries by segment: start, node, share."""
    at = np.zeros(n_segments + 1, np.int64)
    for e in range(len(segment)):
        at[segment[e] + 1] += 1
    for c in range(n_segments):
        at[c + 1] += at[c]
    fill, node, value = at[:-1].copy(), np.empty(len(segment), np.int32), np.empty(len(segment), np.int32)
    for i in range(len(start) - 1):
        for e in range(start[i], start[i + 1]):
            k = fill[segment[e]]
            node[k], value[k] = i, share[e]
            fill[segment[e]] += 1
    return at, node, value


@dataclass
class Partners:
    """The best partners of n nodes, up to ``LISTED`` each, so that a node that loses its best one need not look for another.

    Parameters
    ----------
    node, score : (n, LISTED) int32, float64
        In no order; the first ``count[i]`` of a row are filled.
    count : (n,) int32
    unlisted : (n,) float64
        No partner that is left out has a higher score; 0 = none is left out.
    """

    node: npt.NDArray[np.int32]
    score: npt.NDArray[np.float64]
    count: npt.NDArray[np.int32]
    unlisted: npt.NDArray[np.float64]

    @classmethod
    def none(cls, n: int) -> Partners:
        """Empty lists."""
        return cls(np.empty((n, LISTED), np.int32), np.empty((n, LISTED)), np.zeros(n, np.int32), np.zeros(n))


@numba.njit(cache=True)
def _list(node, score, count, unlisted, i, j, r):  # type: ignore[no-untyped-def]
    """Enter partner j of score r in the list of node i, in the place of the worst one if the list is full."""
    if count[i] < node.shape[1]:
        node[i, count[i]], score[i, count[i]] = j, r
        count[i] += 1
        return
    worst = 0
    for k in range(1, node.shape[1]):
        if score[i, k] < score[i, worst] or (score[i, k] == score[i, worst] and node[i, k] > node[i, worst]):
            worst = k
    if r > score[i, worst] or (r == score[i, worst] and j < node[i, worst]):
        unlisted[i] = max(unlisted[i], score[i, worst])
        node[i, worst], score[i, worst] = j, r
    else:
        unlisted[i] = max(unlisted[i], r)


@numba.njit(cache=True, error_model="numpy")
def _meet(  # type: ignore[no-untyped-def]
    xs, xm, xv, cs, ci, cv, seen, features, known, table, ignores_structure, most, doubt, tau, looks, offers,
    node, score, count, unlisted,
):  # fmt: skip
    """Fill the lists of nodes that look; with ``offers`` they enter themselves in the lists of all that they meet as well."""
    n, words, dim = len(xs) - 1, seen.shape[1], features.shape[1]
    unit = np.float64(SHARES * SHARES)
    common, touched = np.zeros(n, np.int32), np.empty(n, np.int32)
    for i in range(n):
        if looks[i]:
            count[i], unlisted[i] = 0, 0.0
    for i in range(n):
        if not looks[i]:
            continue
        n_touched = 0
        for e in range(xs[i], xs[i + 1]):
            m, x = xm[e], xv[e]
            for k in range(cs[m], cs[m + 1]):
                j = ci[k]
                if common[j] == 0:
                    touched[n_touched] = j
                    n_touched += 1
                common[j] += x * cv[k]
        for q in range(n_touched):
            j = touched[q]
            supporters = common[j]
            common[j] = 0
            # Of two nodes that both look and offer, the one with the lower number does it for both.
            if j == i or (offers and looks[j] and j < i):
                continue
            observers = np.int64(0)
            for w in range(words):
                observers += _popcount(seen[i, w] & seen[j, w])
            r = 1.0 if ignores_structure else supporters / (unit * (observers + doubt))
            if r * most < tau:
                continue
            if dim > 0 and known[i] and known[j]:
                dot = np.int32(0)
                for d in range(dim):
                    dot += np.int32(features[i, d]) * np.int32(features[j, d])
                place = np.int64(np.rint((dot / np.float64(MEAN_STEPS * MEAN_STEPS) + 1.0) * COSINE_STEPS))
                r *= table[min(max(place, 0), len(table) - 2)]
            else:
                r *= table[len(table) - 1]
            if r < tau:
                continue
            _list(node, score, count, unlisted, i, j, r)
            if offers:
                _list(node, score, count, unlisted, j, i, r)


@numba.njit(cache=True)
def _best(looked, node, score, count, unlisted):  # type: ignore[no-untyped-def]
    """The best listed partner (n,) of each node, -1 = none; -2 = perhaps an unlisted one, of nodes that have not ``looked`` now."""
    best = np.full(len(count), -1, np.int32)
    for i in range(len(count)):
        top = -1.0
        for k in range(count[i]):
            if score[i, k] > top or (score[i, k] == top and node[i, k] < best[i]):
                best[i], top = node[i, k], score[i, k]
        if not looked[i] and unlisted[i] > 0.0 and top <= unlisted[i]:
            best[i] = -2
    return best


@numba.njit(cache=True)
def _pair_up(best):  # type: ignore[no-untyped-def]
    """The group of each node when mutual best partners join, groups by their lowest node, and how many there are."""
    n = len(best)
    group, count = np.empty(n, np.int32), 0
    for i in range(n):
        j = best[i]
        if 0 <= j < i and best[j] == i:
            group[i] = group[j]
        else:
            group[i] = count
            count += 1
    return group, count


@numba.njit(cache=True)
def _joined_rows(group, n_groups, start, segment, count):  # type: ignore[no-untyped-def]
    """Rows of groups of one or two nodes: sums of their rows, segments ascending."""
    first, second = np.full(n_groups, -1, np.int64), np.full(n_groups, -1, np.int64)
    for i in range(len(group)):
        if first[group[i]] < 0:
            first[group[i]] = i
        else:
            second[group[i]] = i
    out_start = np.zeros(n_groups + 1, np.int64)
    out, sums = np.empty(len(segment), np.int32), np.empty(len(segment), np.int64)
    filled = 0
    for g in range(n_groups):
        a, a_end = start[first[g]], start[first[g] + 1]
        b, b_end = a_end, a_end
        if second[g] >= 0:
            b, b_end = start[second[g]], start[second[g] + 1]
        while a < a_end or b < b_end:
            take_a = a < a_end and (b == b_end or segment[a] <= segment[b])
            take_b = b < b_end and (a == a_end or segment[b] <= segment[a])
            out[filled] = segment[a] if take_a else segment[b]
            sums[filled] = 0
            if take_a:
                sums[filled] += count[a]
                a += 1
            if take_b:
                sums[filled] += count[b]
                b += 1
            filled += 1
        out_start[g + 1] = filled
    return out_start, out[:filled].copy(), sums[:filled].copy()


def _joined(nodes: SoftNodes, group: npt.NDArray[np.int32], n: int) -> SoftNodes:
    start, segment, count = _joined_rows(group, n, nodes.counts.start, nodes.counts.values, nodes.count)
    features, n_features = np.zeros((n, nodes.features.shape[1])), np.zeros(n, np.int64)
    np.add.at(features, group, nodes.features)
    np.add.at(n_features, group, nodes.n_features)
    return SoftNodes(Rows(start, segment), count, features, n_features)


def _mean_features(nodes: SoftNodes) -> npt.NDArray[np.int16]:
    """Mean features (n, D) in units of 1 / ``MEAN_STEPS``."""
    scale = (MEAN_STEPS // FEATURE_STEPS) / np.maximum(nodes.n_features, 1)
    return np.asarray(np.rint(nodes.features * scale[:, None]), np.int16)


def agglomerate(
    nodes: SoftNodes,
    segment_frame: npt.NDArray[np.int32],
    n_frames: int,
    weight: SoftWeight,
    min_share: float,
    doubt: float,
) -> npt.NDArray[np.int32]:
    """The cluster 0..c-1 of each node (n,), clusters in the order of their lowest nodes."""
    cluster = np.arange(len(nodes), dtype=np.int32)
    partners, new = Partners.none(len(nodes)), np.ones(len(nodes), np.bool_)
    least = max(1, round(min_share * SHARES))
    while True:
        shares: Any = _shares(nodes.counts.start, nodes.counts.values, nodes.count, segment_frame, n_frames, least)
        told = (
            *shares[:3], *_columns(*shares[:3], len(segment_frame)), shares[3], _mean_features(nodes),
            nodes.n_features > 0, weight.table, weight.ignores_structure, float(weight.table.max()), doubt, weight.threshold,
        )  # fmt: skip
        lists = (partners.node, partners.score, partners.count, partners.unlisted)
        _meet(*told, new, True, *lists)
        best = _best(new, *lists)
        if (lost := best == -2).any():
            _meet(*told, lost, False, *lists)
            best = _best(new | lost, *lists)
        group, n = _pair_up(best)
        if n == len(nodes):
            return cluster
        nodes, cluster = _joined(nodes, group, n), group[cluster]
        partners, new = _carried_over(partners, group, n)


def _carried_over(partners: Partners, group: npt.NDArray[np.int32], n: int) -> tuple[Partners, npt.NDArray[np.bool_]]:
    """The lists after nodes have joined, without those that are no more; and which of the n nodes are new."""
    new = np.bincount(group, minlength=n) > 1
    lowest = np.searchsorted(np.maximum.accumulate(group), np.arange(n))
    node, score, count = partners.node[lowest], partners.score[lowest], partners.count[lowest]
    now = group[np.where(np.arange(LISTED) < count[:, None], node, 0)]
    stays = (np.arange(LISTED) < count[:, None]) & ~new[now]
    order = np.argsort(~stays, axis=1, kind="stable")
    return (
        Partners(
            np.take_along_axis(now, order, 1),
            np.take_along_axis(score, order, 1),
            stays.sum(axis=1).astype(np.int32),
            partners.unlisted[lowest],
        ),
        new,
    )
