"""What the online map remembers of every voxel: which frames saw it, and under which mask.

A voxel's key leads through an open-addressing hash to its number; its sightings lie in a chain of blocks in one growing pool, the
newest block first. A frame visits the voxels that it sees and nothing else. A sighting names a *segment*: every frame has one
for "no mask" followed by its masks, so a segment says both frame and mask, and segments ascend with frames.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

_EMPTY = -1
# Sightings in a block; with the number of the next block it fills a cache line.
_BLOCK = 15


def grown(array: npt.NDArray[Any], size: int, fill: int = 0) -> npt.NDArray[Any]:
    """The array itself if it has room for ``size`` rows, else a copy of twice the room, filled with ``fill``."""
    if size <= len(array):
        return array
    larger = np.full((max(size, 2 * len(array)), *array.shape[1:]), fill, array.dtype)
    larger[: len(array)] = array
    return larger


@numba.njit(cache=True, inline="always")
def _slot(key, mask):  # type: ignore[no-untyped-def]
    h = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    h ^= h >> np.uint64(29)
    return np.int64(h & np.uint64(mask))


@numba.njit(cache=True)
def _find(keys, table_key, table_value, out):  # type: ignore[no-untyped-def]
    mask = len(table_key) - 1
    for i in range(len(keys)):
        slot = _slot(keys[i], mask)
        while table_key[slot] != _EMPTY and table_key[slot] != keys[i]:
            slot = (slot + 1) & mask
        out[i] = table_value[slot] if table_key[slot] == keys[i] else -1


@numba.njit(cache=True)
def _insert(keys, values, table_key, table_value):  # type: ignore[no-untyped-def]
    mask = len(table_key) - 1
    for i in range(len(keys)):
        slot = _slot(keys[i], mask)
        while table_key[slot] != _EMPTY:
            slot = (slot + 1) & mask
        table_key[slot], table_value[slot] = keys[i], values[i]


@numba.njit(cache=True)
def _count_overlaps(voxels, mask, head, views, pool, row_of_segment, segments, counts):  # type: ignore[no-untyped-def]
    """Fill old segments met (R,) and the counts (R, n + 1) of voxels that they share with the frame's masks 0..n.

    Returns how many there are, or -1 where they do not fit: an array that is exchanged for a larger one inside of the loop makes
    each access several times as slow.
    """
    rows, fits = 0, True
    for i in range(len(voxels)):
        if voxels[i] < 0:
            continue
        block, left = head[voxels[i]], views[voxels[i]]
        while left > 0:
            n_here = (left - 1) % _BLOCK + 1
            for k in range(n_here):
                segment = pool[block, k]
                row = row_of_segment[segment]
                if row < 0:
                    if rows == len(segments):
                        fits = False
                        continue
                    row = rows
                    rows += 1
                    row_of_segment[segment], segments[row] = row, segment
                counts[row, mask[i]] += 1
            left -= n_here
            block = pool[block, _BLOCK]
    for row in range(rows):
        row_of_segment[segments[row]] = -1
    return rows if fits else -1


@numba.njit(cache=True)
def _append_sightings(voxels, mask, base, n_blocks, head, views, pool):  # type: ignore[no-untyped-def]
    """Add a sighting to each voxel; return the number of blocks then in use. The pool has room for one more block each."""
    for i in range(len(voxels)):
        v = voxels[i]
        place = views[v] % _BLOCK
        if place == 0:
            pool[n_blocks, _BLOCK] = head[v]
            head[v] = n_blocks
            n_blocks += 1
        pool[head[v], place] = base + mask[i]
        views[v] += 1
    return n_blocks


@numba.njit(cache=True)
def _kept_voxels(voxels, role, ratio, head, views, pool):  # type: ignore[no-untyped-def]
    keep = np.empty(len(voxels), np.bool_)
    for i in range(len(voxels)):
        held, seen = 0, 0
        block, left = head[voxels[i]], views[voxels[i]]
        while left > 0:
            n_here = (left - 1) % _BLOCK + 1
            for k in range(n_here):
                r = role[pool[block, k]]
                held += r == 2
                seen += r > 0
            left -= n_here
            block = pool[block, _BLOCK]
        keep[i] = held > ratio * seen
    return keep


@numba.njit(cache=True)
def _elected(n_voxels, cluster, stands, min_vote, head, views, pool):  # type: ignore[no-untyped-def]
    winner = np.full(n_voxels, -1, np.int32)
    names, votes = np.empty(views[:n_voxels].max() if n_voxels else 0, np.int32), np.zeros(len(stands), np.int32)
    for v in range(n_voxels):
        n_names, total, block, left = 0, 0, head[v], views[v]
        while left > 0:
            n_here = (left - 1) % _BLOCK + 1
            for k in range(n_here):
                c = cluster[pool[block, k]]
                if c >= 0:
                    total += 1
                    if stands[c]:
                        if votes[c] == 0:
                            names[n_names] = c
                            n_names += 1
                        votes[c] += 1
            left -= n_here
            block = pool[block, _BLOCK]
        best, most = -1, 0
        for c in names[:n_names]:
            if votes[c] > most or (votes[c] == most and c < best):
                best, most = c, votes[c]
            votes[c] = 0
        if best >= 0 and most >= min_vote * total:
            winner[v] = best
    return winner


class VoxelStore:
    """The voxels met so far and their sightings."""

    def __init__(self) -> None:
        self._table_key = np.full(1 << 14, _EMPTY, np.int64)
        self._table_value = np.empty(1 << 14, np.int32)
        self._keys = np.empty(1 << 13, np.int64)
        self._head = np.full(1 << 13, -1, np.int32)
        self._views = np.zeros(1 << 13, np.int32)
        self._pool = np.empty((1 << 13, _BLOCK + 1), np.int32)
        self._n_blocks = 0
        self._row_of_segment = np.full(1 << 10, -1, np.int32)
        self.n_voxels = 0
        self.n_sightings = 0

    def find(self, keys: npt.NDArray[np.int64]) -> npt.NDArray[np.int32]:
        """Numbers of voxels by key (K,), -1 for those not met yet."""
        out = np.empty(len(keys), np.int32)
        _find(keys, self._table_key, self._table_value, out)
        return out

    def views(self, voxels: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """In how many frames each voxel (K,) was seen; 0 for number -1."""
        return np.where(voxels >= 0, self._views[voxels], 0).astype(np.int32)

    def keys(self, voxels: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
        """Keys (K,) of voxels by number."""
        return self._keys[voxels]

    def overlaps(
        self, voxels: npt.NDArray[np.int32], mask: npt.NDArray[np.int32], n_masks: int
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Segments (R,) that share voxels with a frame, ascending, and how many with each of its masks: (R, n_masks + 1)."""
        room = 1024
        while True:
            segments, counts = np.empty(room, np.int32), np.zeros((room, n_masks + 1), np.int32)
            rows = _count_overlaps(
                voxels, mask, self._head, self._views, self._pool, self._row_of_segment, segments, counts
            )
            if rows >= 0:
                segments, counts = segments[:rows], counts[:rows]
                break
            room *= 4
        order = np.argsort(segments)
        return segments[order], counts[order]

    def add(
        self,
        keys: npt.NDArray[np.int64],
        voxels: npt.NDArray[np.int32],
        mask: npt.NDArray[np.int32],
        base: int,
        n_segments: int,
    ) -> npt.NDArray[np.int32]:
        """Record a frame's sightings: segment ``base + mask``. ``voxels`` is ``find(keys)``; back it comes, all numbered."""
        new = np.flatnonzero(voxels < 0)
        voxels = voxels.copy()
        voxels[new] = np.arange(self.n_voxels, self.n_voxels + len(new), dtype=np.int32)
        end = self.n_voxels + len(new)
        self._keys, self._head, self._views = (
            grown(self._keys, end), grown(self._head, end, -1), grown(self._views, end)
        )  # fmt: skip
        self._keys[self.n_voxels : end] = keys[new]
        self._grow_table(end)
        _insert(keys[new], voxels[new], self._table_key, self._table_value)
        self.n_voxels = end

        self._pool = grown(self._pool, self._n_blocks + len(voxels))
        self._row_of_segment = grown(self._row_of_segment, n_segments, -1)
        self._n_blocks = _append_sightings(voxels, mask, base, self._n_blocks, self._head, self._views, self._pool)
        self.n_sightings += len(voxels)
        return voxels

    def _grow_table(self, n_voxels: int) -> None:
        size = len(self._table_key)
        if 2 * n_voxels <= size:
            return
        while 2 * n_voxels > size:
            size *= 2
        self._table_key, self._table_value = np.full(size, _EMPTY, np.int64), np.empty(size, np.int32)
        _insert(
            self._keys[: self.n_voxels], np.arange(self.n_voxels, dtype=np.int32), self._table_key, self._table_value
        )

    def kept(self, voxels: npt.NDArray[np.int32], role: npt.NDArray[np.int8], ratio: float) -> npt.NDArray[np.bool_]:
        """Which voxels (K,) of a node its masks hold in more than ``ratio`` of their frames that see the voxel.

        ``role`` (S,) of a segment: 2 = a mask of the node, 1 = another segment of a frame that has one, 0 = of no such frame.
        """
        keep: npt.NDArray[np.bool_] = _kept_voxels(voxels, role, ratio, self._head, self._views, self._pool)
        return keep

    def elected(
        self, cluster: npt.NDArray[np.int32], stands: npt.NDArray[np.bool_], min_vote: float
    ) -> npt.NDArray[np.int32]:
        """The cluster (V,) that each voxel's sightings name most often, of those that stand (c,); -1 = none.

        ``cluster`` (S,) of a segment, -1 = says nothing. The lowest wins a tie; a winner needs ``min_vote`` of all that say
        anything.
        """
        winner: npt.NDArray[np.int32] = _elected(
            self.n_voxels, cluster, stands, min_vote, self._head, self._views, self._pool
        )
        return winner
