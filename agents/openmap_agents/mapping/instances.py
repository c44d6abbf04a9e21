"""From merged nodes to instances: noisy voxels removed, pieces split, duplicates dropped (the last steps of ``reference.py``)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage, sparse

from openmap_agents.mapping.consensus import Rows
from openmap_agents.mapping.frame import unpack_keys, voxel_centres
from openmap_agents.mapping.reference import cell_factor
from openmap_agents.mapping.segments import Segments
from openmap_agents.mapping.settings import MappingSettings
from openmap_agents.mapping.voxel_store import VoxelStore


@dataclass(frozen=True)
class Piece:
    """A connected piece of a node: its masks (segments, ascending), voxel numbers, their centres (N, 3) m, unit feature or None."""

    members: npt.NDArray[np.int32]
    voxels: npt.NDArray[np.int32]
    points: npt.NDArray[np.float32]
    feature: npt.NDArray[np.float32] | None


def pieces_of(
    members: npt.NDArray[np.int32], segments: Segments, store: VoxelStore, settings: MappingSettings
) -> list[Piece]:
    """The pieces of a node (``reference.split``). They depend on the members alone, so they may be kept while those stay."""
    if len(members) < settings.min_masks:
        return []
    voxels = np.unique(np.concatenate([segments.voxels(m) for m in members]))
    has_member = np.zeros(segments.n_frames, np.int8)
    has_member[segments.frame[members]] = 1
    role = has_member[segments.frame]
    role[members] = 2
    voxels = voxels[store.kept(voxels, role, settings.detection_ratio)]
    return _connected_pieces(members, voxels, segments, store, settings)


def elected_pieces(
    clusters: Rows, segments: Segments, store: VoxelStore, settings: MappingSettings
) -> tuple[list[Piece], list[int]]:
    """The pieces of clusters of masks (``reference_soft.elect`` and what follows it), and which cluster each is of.

    ``clusters`` lists the masks of each, ascending.
    """
    n = len(clusters)
    size = np.diff(clusters.start)
    cluster_of = np.full(segments.n, -1, np.int32)
    cluster_of[clusters.values] = np.repeat(np.arange(n, dtype=np.int32), size)
    winner = store.elected(cluster_of, size >= settings.min_masks, settings.min_vote)
    order = np.argsort(winner, kind="stable")
    start = np.searchsorted(winner[order], np.arange(n + 1))
    pieces, origin = [], []
    for c in np.flatnonzero(size >= settings.min_masks).tolist():
        voxels = order[start[c] : start[c + 1]].astype(np.int32)
        found = _connected_pieces(clusters.row(c), voxels, segments, store, settings)
        pieces += found
        origin += [c] * len(found)
    return pieces, origin


def _connected_pieces(
    members: npt.NDArray[np.int32],
    voxels: npt.NDArray[np.int32],
    segments: Segments,
    store: VoxelStore,
    settings: MappingSettings,
) -> list[Piece]:
    """The connected pieces of voxels; a mask goes to the piece with most of it, and pieces of too few masks go."""
    if len(voxels) < settings.min_voxels:
        return []
    keys = store.keys(voxels)
    order = np.argsort(keys)
    keys, voxels = keys[order], voxels[order]
    label, n_pieces = _connected(keys, settings)
    piece_of = np.full(int(voxels.max()) + 1, -1, np.int32)
    piece_of[voxels] = label
    owner = np.full(len(members), -1, np.int32)
    for i, m in enumerate(members):
        own = segments.voxels(m)
        own = own[own < len(piece_of)]
        overlap = np.bincount(piece_of[own] + 1, minlength=n_pieces + 1)[1:]
        if overlap.max(initial=0) > 0:
            owner[i] = int(np.argmax(overlap))
    pieces = []
    for p in range(n_pieces):
        inside, own_masks = label == p, members[owner == p]
        if inside.sum() >= settings.min_voxels and len(own_masks) >= settings.min_masks:
            points = voxel_centres(keys[inside], settings.voxel_size)
            pieces.append(Piece(own_masks, voxels[inside], points, _mean_feature(own_masks, segments, settings)))
    return pieces


def _connected(keys: npt.NDArray[np.int64], settings: MappingSettings) -> tuple[npt.NDArray[np.int32], int]:
    """Piece 0..n-1 of each voxel key (ascending), pieces by their lowest key; and n."""
    cells = unpack_keys(keys) // cell_factor(settings)
    cells -= cells.min(0)
    grid = np.zeros(cells.max(0) + 1, np.bool_)
    grid[tuple(cells.T)] = True
    labels, _ = ndimage.label(grid, np.ones((3, 3, 3)))
    found, first, inverse = np.unique(labels[tuple(cells.T)], return_index=True, return_inverse=True)
    rank = np.empty(len(found), np.int32)
    rank[np.argsort(first)] = np.arange(len(found), dtype=np.int32)
    return rank[inverse], len(found)


def _mean_feature(
    members: npt.NDArray[np.int32], segments: Segments, settings: MappingSettings
) -> npt.NDArray[np.float32] | None:
    best = members[np.lexsort((members, -segments.size[members].astype(np.int64)))]
    features = segments.features[best]
    features = features[features.any(axis=1)][: settings.top_k].astype(np.float64)
    if len(features) == 0:
        return None
    mean = features.mean(axis=0)
    norm = float(np.linalg.norm(mean))
    return None if norm < 1e-9 else np.asarray(mean / norm, np.float32)


def drop_overlapping(pieces: list[Piece], n_voxels: int, settings: MappingSettings) -> list[int]:
    """Indices of the pieces that stay, largest first (``reference.drop_overlapping``)."""
    if not pieces:
        return []
    sizes = np.array([len(p.voxels) for p in pieces])
    order = np.lexsort((np.array([p.members[0] for p in pieces]), -sizes))
    start = np.concatenate([[0], np.cumsum(sizes)])
    voxels = np.concatenate([p.voxels for p in pieces])
    belongs = sparse.csr_matrix((np.ones(len(voxels), np.int32), voxels, start), shape=(len(pieces), n_voxels))
    common = (belongs @ belongs.T).tocsr()
    kept = np.zeros(len(pieces), np.bool_)
    for i in order:
        row = slice(common.indptr[i], common.indptr[i + 1])
        others = kept[common.indices[row]]
        kept[i] = not (common.data[row][others] > settings.tau_overlap * sizes[i]).any()
    return [int(i) for i in order if kept[i]]
