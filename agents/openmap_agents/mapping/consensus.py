"""View consensus on sparse rows: the merge rounds of ``reference.py``, on what the online mapper counted.

A node is a row of observers (frames, ascending) and a row of containers (segments, ascending, so by frame too). Only nodes that
share a container can have a supporter, so a round looks at the members of each container's list and at no other pair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.semantics import COSINE_STEPS, SemanticWeight
from openmap_agents.mapping.settings import MappingSettings

IntArray = npt.NDArray[np.int32]


@dataclass
class Rows:
    """Sparse rows: row i is ``values[start[i]:start[i + 1]]``, ascending."""

    start: npt.NDArray[np.int64]
    values: IntArray

    def __len__(self) -> int:
        return len(self.start) - 1

    def row(self, i: int) -> IntArray:
        return self.values[self.start[i] : self.start[i + 1]]


@dataclass
class Nodes:
    """Nodes i: ``representative`` (segment), members, observers (frames) and containers (segments)."""

    representative: IntArray
    members: Rows
    observers: Rows
    containers: Rows

    def __len__(self) -> int:
        return len(self.representative)


@numba.njit(cache=True)
def _rows_by(owner, n_rows, value, use):  # type: ignore[no-untyped-def]
    start = np.zeros(n_rows + 1, np.int64)
    for i in range(len(owner)):
        if use[i]:
            start[owner[i] + 1] += 1
    for i in range(n_rows):
        start[i + 1] += start[i]
    fill, values = start[:-1].copy(), np.empty(start[-1], np.int32)
    for i in range(len(owner)):
        if use[i]:
            values[fill[owner[i]]] = value[i]
            fill[owner[i]] += 1
    return start, values


def rows_by(owner: IntArray, n_rows: int, value: IntArray, use: npt.NDArray[np.bool_]) -> Rows:
    """Rows of ``value`` by ``owner``, in the order given, where ``use``."""
    return Rows(*_rows_by(owner, n_rows, value, use))


@numba.njit(cache=True)
def _invert(start, values, n, use):  # type: ignore[no-untyped-def]
    """Which rows hold each of the values 0..n - 1, of entries in ``use``."""
    owner = np.empty(len(values), np.int32)
    for i in range(len(start) - 1):
        owner[start[i] : start[i + 1]] = i
    return _rows_by(values, n, owner, use)


def initial_nodes(
    mask: IntArray,
    frame: IntArray,
    container: IntArray,
    segment_size: IntArray,
    n_frames: int,
    settings: MappingSettings,
) -> Nodes:
    """Nodes of the masks that are not under-segmented, from observations (mask, frame, container or -1), by frame within a mask.

    ``segment_size`` (S,) holds |P_k| of segments that are masks, 0 of others. See ``reference.drop_undersegmented``.
    """
    n = len(segment_size)
    observed, split = np.bincount(mask, minlength=n), np.bincount(mask[container < 0], minlength=n)
    dropped = split > settings.tau_undersegmented * observed
    is_node = (segment_size > 0) & ~dropped
    # A witness that was itself under-segmented is taken back, as observer and as container.
    witness = is_node[mask] & ~((container >= 0) & dropped[container])
    observer = witness & (container >= 0) if settings.observers == "contained" else witness
    segments = np.flatnonzero(is_node).astype(np.int32)
    node_of = np.full(n, -1, np.int32)
    node_of[segments] = np.arange(len(segments), dtype=np.int32)
    owner = node_of[mask]
    identity = Rows(np.arange(len(segments) + 1, dtype=np.int64), segments.copy())
    return Nodes(
        segments,
        identity,
        rows_by(owner, len(segments), frame, observer),
        rows_by(owner, len(segments), container, witness & (container >= 0)),
    )


@numba.njit(cache=True)
def _histogram(start, values, by_start, by_values, longest):  # type: ignore[no-untyped-def]
    n = len(start) - 1
    histogram, count, touched = np.zeros(longest + 1, np.int64), np.zeros(n, np.int32), np.empty(n, np.int32)
    for i in range(n):
        n_touched = 0
        for f in values[start[i] : start[i + 1]]:
            for j in by_values[by_start[f] : by_start[f + 1]]:
                if j >= i:
                    if count[j] == 0:
                        touched[n_touched] = j
                        n_touched += 1
                    count[j] += 1
        for j in touched[:n_touched]:
            histogram[count[j]] += 1 if j == i else 2
            count[j] = 0
    return histogram


def observer_schedule(nodes: Nodes, n_frames: int, settings: MappingSettings) -> list[int]:
    """N_o of each round (``reference.observer_schedule``)."""
    rows = nodes.observers
    longest = int(np.diff(rows.start).max(initial=0))
    by_frame = _invert(rows.start, rows.values, n_frames, np.ones(len(rows.values), np.bool_))
    histogram = _histogram(rows.start, rows.values, *by_frame, longest)
    upto = np.cumsum(histogram)
    schedule = []
    for percent in range(settings.observer_start, -1, -settings.observer_step):
        index = (int(upto[-1]) - 1) * percent // 100
        n_o = int(np.searchsorted(upto, index, side="right")) if upto[-1] else 1
        if n_o <= 1 and percent < 50:
            break
        schedule.append(max(n_o, 1))
    return [*schedule, 1]


@numba.njit(cache=True)
def _semantic(a, b, features, kind, slope, offset, gap):  # type: ignore[no-untyped-def]
    """``SemanticWeight`` of ``rounded_cosine`` of two rows."""
    if kind == 0:
        return 1.0
    dot, norm_a, norm_b = 0.0, 0.0, 0.0
    for d in range(features.shape[1]):
        x, y = np.float64(features[a, d]), np.float64(features[b, d])
        dot += x * y
        norm_a += x * x
        norm_b += y * y
    known = norm_a > 0.0 and norm_b > 0.0
    cosine = np.rint(dot * COSINE_STEPS) / COSINE_STEPS
    if kind == 1:
        return max(0.0, cosine) if known else 1.0
    if kind == 3:
        return max(0.0, cosine) if known else 0.0
    exponent = slope * cosine + offset if known else 0.0
    p = 1.0 / (1.0 + math.exp(-min(max(exponent, -30.0), 30.0)))
    return p / (p + (1.0 - p) * gap)


@numba.njit(cache=True)
def _root(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(cache=True)
def _components(  # type: ignore[no-untyped-def]
    n_o, o_start, o_values, c_start, c_values, by_start, by_values, segment_frame, n_frames, representative, features,
    kind, threshold, slope, offset, gap,
):  # fmt: skip
    """Lowest node of the component of each node."""
    n = len(representative)
    parent = np.arange(n, dtype=np.int32)
    supporters, last_frame = np.zeros(n, np.int32), np.full(n, -1, np.int32)
    touched, stamp = np.empty(n, np.int32), np.full(n_frames, -1, np.int32)
    for i in range(n):
        if o_start[i + 1] - o_start[i] <= n_o:
            continue
        n_touched = 0
        for c in c_values[c_start[i] : c_start[i + 1]]:
            frame = segment_frame[c]
            for j in by_values[by_start[c] : by_start[c + 1]]:
                if j > i and last_frame[j] != frame:
                    if supporters[j] == 0:
                        touched[n_touched] = j
                        n_touched += 1
                    supporters[j] += 1
                    last_frame[j] = frame
        for f in o_values[o_start[i] : o_start[i + 1]]:
            stamp[f] = i
        for j in touched[:n_touched]:
            s = supporters[j]
            supporters[j], last_frame[j] = 0, -1
            a, b = _root(parent, i), _root(parent, j)
            if a == b:
                continue
            common = 0
            for f in o_values[o_start[j] : o_start[j + 1]]:
                if stamp[f] == i:
                    common += 1
            r_struc = 1.0 if kind == 3 else s / common
            if common <= n_o or r_struc < threshold:
                continue
            r_seman = _semantic(representative[i], representative[j], features, kind, slope, offset, gap)
            if r_struc * r_seman >= threshold:
                parent[max(a, b)] = min(a, b)
    for i in range(n):
        parent[i] = _root(parent, i)
    return parent


@numba.njit(cache=True)
def _union_rows(group_start, group_values, start, values):  # type: ignore[no-untyped-def]
    """Rows of the sorted union of each group's rows."""
    n = len(group_start) - 1
    out_start, out = np.zeros(n + 1, np.int64), np.empty(len(values), np.int32)
    filled = 0
    for g in range(n):
        first = filled
        for i in group_values[group_start[g] : group_start[g + 1]]:
            out[filled : filled + start[i + 1] - start[i]] = values[start[i] : start[i + 1]]
            filled += start[i + 1] - start[i]
        if group_start[g + 1] - group_start[g] > 1:
            merged = np.sort(out[first:filled])
            filled = first
            for k in range(len(merged)):
                if k == 0 or merged[k] != merged[k - 1]:
                    out[filled] = merged[k]
                    filled += 1
        out_start[g + 1] = filled
    return out_start, out[:filled].copy()


def merge_round(
    nodes: Nodes,
    n_o: int,
    segment_frame: IntArray,
    segment_size: IntArray,
    n_frames: int,
    features: npt.NDArray[np.float32],
    weight: SemanticWeight,
) -> Nodes:
    """One round (``reference.merge_round``); returns ``nodes`` itself if nothing merged. ``features`` (S, D), zeros = none."""
    # Only nodes with enough observers of their own can have enough in common.
    able = np.repeat(np.diff(nodes.observers.start) > n_o, np.diff(nodes.containers.start))
    by_container = _invert(nodes.containers.start, nodes.containers.values, len(segment_frame), able)
    parent = _components(
        n_o, nodes.observers.start, nodes.observers.values, nodes.containers.start, nodes.containers.values,
        *by_container, segment_frame, n_frames, nodes.representative, features,
        weight.kind, weight.threshold, weight.slope, weight.offset, weight.gap,
    )  # fmt: skip
    roots, group = np.unique(parent, return_inverse=True)
    if len(roots) == len(nodes):
        return nodes
    everyone = np.arange(len(nodes), dtype=np.int32)
    groups = rows_by(group.astype(np.int32), len(roots), everyone, np.ones(len(nodes), np.bool_))
    order = np.lexsort((nodes.representative, -segment_size[nodes.representative].astype(np.int64), group))
    first = np.searchsorted(group[order], np.arange(len(roots)))
    return Nodes(
        nodes.representative[order][first],
        *(
            Rows(*_union_rows(groups.start, groups.values, rows.start, rows.values))
            for rows in (nodes.members, nodes.observers, nodes.containers)
        ),
    )


def cluster(
    nodes: Nodes,
    segment_frame: IntArray,
    segment_size: IntArray,
    n_frames: int,
    features: npt.NDArray[np.float32],
    weight: SemanticWeight,
    settings: MappingSettings,
) -> Nodes:
    """All rounds. A round with the N_o of one that merged nothing would merge nothing again, and is skipped."""
    settled = -1
    for n_o in observer_schedule(nodes, n_frames, settings):
        if n_o == settled:
            continue
        merged = merge_round(nodes, n_o, segment_frame, segment_size, n_frames, features, weight)
        settled = n_o if merged is nodes else -1
        nodes = merged
    return nodes
