"""What the online map remembers of every voxel: which frames saw it, and under which mask.

A voxel's key leads through an open-addressing hash to its number; its sightings are a linked list in one growing pool. A frame
visits the voxels that it sees and nothing else. A sighting names a *segment*: every frame has one for "no mask" followed by its masks, so
a segment says both frame and mask, and segments ascend with frames.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

_EMPTY = -1


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
def _count_overlaps(voxels, mask, n, head, pool_segment, pool_next, row_of_segment):  # type: ignore[no-untyped-def]
    """Rows of old segments met and their (segments, n + 1) counts of common voxels with the frame's masks 0..n."""
    rows, capacity = 0, 256
    segments, counts = np.empty(capacity, np.int32), np.zeros((capacity, n + 1), np.int32)
    for i in range(len(voxels)):
        if voxels[i] < 0:
            continue
        entry = head[voxels[i]]
        while entry >= 0:
            segment = pool_segment[entry]
            row = row_of_segment[segment]
            if row < 0:
                if rows == capacity:
                    capacity *= 2
                    more_segments, more_counts = np.empty(capacity, np.int32), np.zeros((capacity, n + 1), np.int32)
                    more_segments[:rows], more_counts[:rows] = segments, counts
                    segments, counts = more_segments, more_counts
                row = rows
                rows += 1
                row_of_segment[segment], segments[row] = row, segment
            counts[row, mask[i]] += 1
            entry = pool_next[entry]
    for row in range(rows):
        row_of_segment[segments[row]] = -1
    return segments[:rows], counts[:rows]


@numba.njit(cache=True)
def _append_sightings(voxels, mask, base, start, head, views, pool_segment, pool_next):  # type: ignore[no-untyped-def]
    for i in range(len(voxels)):
        entry, v = start + i, voxels[i]
        pool_segment[entry], pool_next[entry] = base + mask[i], head[v]
        head[v] = entry
        views[v] += 1


@numba.njit(cache=True)
def _kept_voxels(voxels, members, ratio, head, pool_segment, pool_next, segment_frame, is_member, is_frame):  # type: ignore[no-untyped-def]
    """Which of a node's voxels its masks hold in more than ``ratio`` of their frames that see it (bool); scratch is left clean."""
    keep = np.empty(len(voxels), np.bool_)
    for m in members:
        is_member[m] = True
        is_frame[segment_frame[m]] = True
    for i in range(len(voxels)):
        held, seen = 0, 0
        entry = head[voxels[i]]
        while entry >= 0:
            segment = pool_segment[entry]
            if is_frame[segment_frame[segment]]:
                seen += 1
                if is_member[segment]:
                    held += 1
            entry = pool_next[entry]
        keep[i] = held > ratio * seen
    for m in members:
        is_member[m] = False
        is_frame[segment_frame[m]] = False
    return keep


class VoxelStore:
    """The voxels met so far and their sightings."""

    def __init__(self) -> None:
        self._table_key = np.full(1 << 14, _EMPTY, np.int64)
        self._table_value = np.empty(1 << 14, np.int32)
        self._keys = np.empty(1 << 13, np.int64)
        self._head = np.full(1 << 13, -1, np.int32)
        self._views = np.zeros(1 << 13, np.int32)
        self._pool_segment = np.empty(1 << 15, np.int32)
        self._pool_next = np.empty(1 << 15, np.int32)
        self._row_of_segment = np.full(1 << 10, -1, np.int32)
        self._is_member = np.zeros(1 << 10, np.bool_)
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
        segments, counts = _count_overlaps(
            voxels, mask, n_masks, self._head, self._pool_segment, self._pool_next, self._row_of_segment
        )
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

        total = self.n_sightings + len(voxels)
        self._pool_segment, self._pool_next = grown(self._pool_segment, total), grown(self._pool_next, total)
        self._row_of_segment = grown(self._row_of_segment, n_segments, -1)
        self._is_member = grown(self._is_member, n_segments)
        _append_sightings(
            voxels, mask, base, self.n_sightings, self._head, self._views, self._pool_segment, self._pool_next
        )
        self.n_sightings = total
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

    def kept(
        self,
        voxels: npt.NDArray[np.int32],
        members: npt.NDArray[np.int32],
        ratio: float,
        segment_frame: npt.NDArray[np.int32],
    ) -> npt.NDArray[np.bool_]:
        """Which of a node's voxels (K,) its member segments hold in more than ``ratio`` of their frames that see the voxel."""
        is_frame = np.zeros(int(segment_frame[members].max()) + 1 if len(members) else 1, np.bool_)
        is_frame = grown(is_frame, int(segment_frame.max()) + 1)
        keep: npt.NDArray[np.bool_] = _kept_voxels(
            voxels,
            members,
            ratio,
            self._head,
            self._pool_segment,
            self._pool_next,
            segment_frame,
            self._is_member,
            is_frame,
        )
        return keep
