"""The clusters of the soft consensus over the life of a walk: afresh at its end, and on the way only where something has changed.

On the way, a cluster of the last update stays one node unless new frames have observed one of its masks; all others fall into their
masks again and join anew, with each other and with the clusters that stayed. So an update costs what the camera has seen since the
last one. What stays could have joined otherwise had it been taken apart too; ``afresh`` takes everything apart, and is exact.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.agglomeration import SoftNodes, agglomerate, nodes_of_masks
from openmap_agents.mapping.consensus import Rows, rows_by
from openmap_agents.mapping.segments import Columns, Segments
from openmap_agents.mapping.semantics import SoftWeight
from openmap_agents.mapping.settings import MappingSettings

IntArray = npt.NDArray[np.int32]


@numba.njit(cache=True)
def _summed_rows(group_start, members, start, segment, count, n_segments):  # type: ignore[no-untyped-def]
    """Rows of groups of nodes: the sums of their rows, segments ascending."""
    n = len(group_start) - 1
    out_start, out, sums = np.zeros(n + 1, np.int64), np.empty(len(segment), np.int32), np.empty(len(segment), np.int64)
    total, touched, filled = np.zeros(n_segments, np.int64), np.empty(n_segments, np.int32), 0
    for g in range(n):
        n_touched = 0
        for i in members[group_start[g] : group_start[g + 1]]:
            for e in range(start[i], start[i + 1]):
                if total[segment[e]] == 0:
                    touched[n_touched] = segment[e]
                    n_touched += 1
                total[segment[e]] += count[e]
        for m in np.sort(touched[:n_touched]):
            out[filled], sums[filled] = m, total[m]
            total[m] = 0
            filled += 1
        out_start[g + 1] = filled
    return out_start, out[:filled].copy(), sums[:filled].copy()


def summed(nodes: SoftNodes, group: IntArray, n_groups: int, n_segments: int) -> SoftNodes:
    """One node for each group of nodes (``group`` (n,))."""
    everyone = np.arange(len(nodes), dtype=np.int32)
    groups = rows_by(group, n_groups, everyone, np.ones(len(nodes), np.bool_))
    start, segment, count = _summed_rows(
        groups.start, groups.values, nodes.counts.start, nodes.counts.values, nodes.count, n_segments
    )
    features, n_features = np.zeros((n_groups, nodes.features.shape[1])), np.zeros(n_groups, np.int64)
    np.add.at(features, group, nodes.features)
    np.add.at(n_features, group, nodes.n_features)
    return SoftNodes(Rows(start, segment), count, features, n_features)


class SoftClusters:
    """Which masks are together, and what of it new frames have touched since."""

    def __init__(self) -> None:
        self._cluster_of = np.empty(0, np.int32)  # of every segment at the last update, -1 = none
        self._n_overlaps = 0

    def update(
        self, segments: Segments, overlaps: Columns, weight: SoftWeight, settings: MappingSettings, afresh: bool
    ) -> tuple[Rows, npt.NDArray[np.int64]]:
        """The masks of each cluster, ascending, clusters by their lowest mask; and how many frames observe each.

        ``overlaps`` are (mask, segment, voxels), those of later frames later.
        """
        masks = np.flatnonzero(segments.size > 0).astype(np.int32)
        nodes = nodes_of_masks(masks, overlaps.columns, segments.features)
        if afresh or len(self._cluster_of) == 0:
            group = np.arange(len(masks), dtype=np.int32)
        else:
            group = self._groups(masks, overlaps)
            nodes = summed(nodes, group, int(group.max(initial=-1)) + 1, segments.n)
        joined = agglomerate(nodes, segments.frame, segments.n_frames, weight, settings.min_share, settings.doubt)
        n = int(joined.max(initial=-1)) + 1
        cluster = joined[group]
        self._cluster_of = np.full(segments.n, -1, np.int32)
        self._cluster_of[masks] = cluster
        self._n_overlaps = overlaps.n
        observing = _observing_frames(joined, nodes.counts, segments.frame, n)
        return rows_by(cluster, n, masks, np.ones(len(masks), np.bool_)), observing

    def _groups(self, masks: IntArray, overlaps: Columns) -> IntArray:
        """The group (n,) of each mask: its last cluster where nothing has touched that, else itself; by lowest mask."""
        known = len(self._cluster_of)
        observed = overlaps.columns[0][self._n_overlaps :]
        touched = np.unique(self._cluster_of[observed[observed < known]])
        old = np.where(masks < known, self._cluster_of[np.minimum(masks, known - 1)], -1)
        stays = (old >= 0) & ~np.isin(old, touched)
        own_name = int(self._cluster_of.max(initial=-1)) + 1 + np.arange(len(masks))
        _, first, inverse = np.unique(np.where(stays, old, own_name), return_index=True, return_inverse=True)
        rank = np.empty(len(first), np.int32)
        rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
        return rank[inverse]


def _observing_frames(cluster: IntArray, counts: Rows, segment_frame: IntArray, n: int) -> npt.NDArray[np.int64]:
    """How many frames observe a mask of each of n clusters."""
    of_entry = np.repeat(cluster, np.diff(counts.start)).astype(np.int64)
    span = int(segment_frame.max(initial=0)) + 1
    pairs = np.unique(of_entry * span + segment_frame[counts.values])
    return np.bincount(pairs // span, minlength=n)
