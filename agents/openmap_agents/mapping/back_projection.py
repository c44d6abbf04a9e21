"""Pixels to voxels: where each pixel lies in the world, which voxels a frame sees, and which mask owns each of them.

``pixel_voxels`` lists a voxel and a label for every pixel, which is all that the plain reference needs. ``owned_voxels`` counts the
labels of each voxel on the way, in a hash that tries the voxels of the pixels before and above first. Both go through
the same compiled lines for points and patches, where rounding decides.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

# Indoor surfaces love round coordinates: with the grid at 0, a floor at y = 0 would flicker between two layers of voxels.
GRID_OFFSET = 0.37
HALF = 1 << 20
BITS = 21
_EMPTY = -1


@numba.njit(cache=True, error_model="numpy")
def _fill_row(depth, v, fx, fy, cx, cy, T, max_depth, points):  # type: ignore[no-untyped-def]
    """World points of row v of the pixels into ``points[v % 2]`` (W, 3) float64 m; NaN without a reading."""
    y, row = -(v - cy) / fy, v % 2
    for u in range(depth.shape[1]):
        d = np.float64(depth[v, u])
        if d > 0.0 and d <= max_depth:
            x = (u - cx) / fx
            for axis in range(3):
                points[row, u, axis] = d * (T[axis, 0] * x + T[axis, 1] * y - T[axis, 2]) + T[axis, 3]
        else:
            points[row, u, 0] = points[row, u, 1] = points[row, u, 2] = np.nan


@numba.njit(cache=True)
def _fill_edges(points, row, across):  # type: ignore[no-untyped-def]
    """Squared distances (W - 1,) of neighbours in a row of points, into ``across[row]``."""
    for u in range(points.shape[1] - 1):
        x = points[row, u, 0] - points[row, u + 1, 0]
        y = points[row, u, 1] - points[row, u + 1, 1]
        z = points[row, u, 2] - points[row, u + 1, 2]
        across[row, u] = x * x + y * y + z * z


@numba.njit(cache=True, error_model="numpy")
def _fill_steps(points, masks, v, voxel, max_gap, across, down, steps):  # type: ignore[no-untyped-def]
    """Into how many steps (W,) the patches from row v of the pixels to the next must be cut to leave no voxel out; 1 = not at all.

    ``across`` (2, W - 1) and ``down`` (W,) are work space; rows of points and of ``across`` change places from row to row.
    """
    upper, lower, width = v % 2, 1 - v % 2, points.shape[1]
    if v == 0:
        _fill_edges(points, upper, across)
    steps[:] = 1
    if v + 1 == masks.shape[0]:
        return
    _fill_edges(points, lower, across)
    for u in range(width):
        x, y = points[0, u, 0] - points[1, u, 0], points[0, u, 1] - points[1, u, 1]
        z = points[0, u, 2] - points[1, u, 2]
        down[u] = x * x + y * y + z * z
    most, least = max_gap * max_gap, 0.99 * voxel * voxel
    for u in range(width - 1):
        a, b, c, d = across[upper, u], across[lower, u], down[u], down[u + 1]
        # Where one of them is NaN nothing is true of it.
        if (a > least or b > least or c > least or d > least) and a <= most and b <= most and c <= most and d <= most:
            label = masks[v, u]
            if masks[v, u + 1] == label and masks[v + 1, u] == label and masks[v + 1, u + 1] == label:
                steps[u] = max(1, int(np.ceil(np.sqrt(max(a, b, c, d)) / voxel)))


@numba.njit(cache=True, error_model="numpy", inline="always")
def _key(points, row, u, s, t, voxel):  # type: ignore[no-untyped-def]
    """Voxel key of the point at (s, t), 0..1, of the way across the patch from pixel u of a row on.

    Adding HALF first makes coordinates positive, so that cutting them off is rounding them down.
    """
    key, scale, other = np.int64(0), 1.0 / voxel, 1 - row
    for axis in range(3):
        p = points[row, u, axis]
        if s + t > 0.0:
            p = (1 - s) * ((1 - t) * p + t * points[row, u + 1, axis]) + s * (
                (1 - t) * points[other, u, axis] + t * points[other, u + 1, axis]
            )
        key = (key << BITS) | np.int64(p * scale + (GRID_OFFSET + HALF))
    return key


@numba.njit(cache=True, error_model="numpy")
def _keys_of_pixels(depth, masks, fx, fy, cx, cy, T, max_depth, voxel, max_gap, keys, labels):  # type: ignore[no-untyped-def]
    """Fill ``keys`` (K,) and ``labels`` (K,); return how many there are, also where they do not fit."""
    count, room = 0, len(labels)
    width = depth.shape[1]
    points, across, down, cuts = (
        np.empty((2, width, 3)),
        np.empty((2, width)),
        np.empty(width),
        np.empty(width, np.int32),
    )
    _fill_row(depth, 0, fx, fy, cx, cy, T, max_depth, points)
    for v in range(depth.shape[0]):
        if v + 1 < depth.shape[0]:
            _fill_row(depth, v + 1, fx, fy, cx, cy, T, max_depth, points)
        _fill_steps(points, masks, v, voxel, max_gap, across, down, cuts)
        for u in range(width):
            if np.isnan(points[v % 2, u, 0]):
                continue
            steps, part = cuts[u], 1.0 / cuts[u]
            for i in range(steps):
                for j in range(steps):
                    if count < room:
                        keys[count] = _key(points, v % 2, u, i * part, j * part, voxel)
                        labels[count] = masks[v, u]
                    count += 1
    return count


def pixel_voxels(
    depth: npt.NDArray[np.float32],
    masks: npt.NDArray[np.int32],
    camera: PinholeCamera,
    T_world_camera: npt.NDArray[np.float64],
    settings: MappingSettings,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Voxel keys (K,) int64 and labels (K,) int32 of the pixels that have depth, row by row.

    Where four neighbours of one label lie further apart than a voxel, but no edge is longer than ``max_gap``, the patch between
    them is sampled too: else a far or slanted surface would be a sieve, and no two frames would see the same of it.
    """
    count = 2 * depth.size
    while True:
        keys, labels = np.empty(count, np.int64), np.empty(count, np.int32)
        needed = _keys_of_pixels(
            depth, masks, camera.fx, camera.fy, camera.cx, camera.cy, T_world_camera, settings.max_depth,
            settings.voxel_size, settings.max_gap, keys, labels,
        )  # fmt: skip
        if needed <= count:
            return keys[:needed], labels[:needed]
        count = needed


@numba.njit(cache=True, inline="always")
def _slot(key, mask):  # type: ignore[no-untyped-def]
    h = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    h ^= h >> np.uint64(29)
    return np.int64(h & np.uint64(mask))


@numba.njit(cache=True, error_model="numpy")
def _owned_voxels(depth, owner, masks, fx, fy, cx, cy, T, max_depth, voxel, max_gap, keys, owners):  # type: ignore[no-untyped-def]
    """Fill keys and owners (R,) of voxels; return how many there are, or -1 where they do not fit.

    R is a power of two. The owner is the lowest of the most frequent numbers of ``owner`` (H, W) among a voxel's samples.
    """
    room = len(keys)
    size = 4 * room
    table = np.full(size, _EMPTY, np.int32)
    # Each voxel has a chain of (number, samples), the newest link first.
    first = np.empty(room, np.int32)
    label, count, following = np.empty(2 * room, np.int32), np.empty(2 * room, np.int32), np.empty(2 * room, np.int32)
    # The voxel of the pixel before, of the one above, and the link that was counted last: mostly it is one of them again.
    n, n_links, last, last_key, last_link = 0, 0, 0, np.int64(_EMPTY), _EMPTY
    above = np.full(depth.shape[1], _EMPTY, np.int32)
    width = depth.shape[1]
    points, across, down, cuts = (
        np.empty((2, width, 3)),
        np.empty((2, width)),
        np.empty(width),
        np.empty(width, np.int32),
    )
    _fill_row(depth, 0, fx, fy, cx, cy, T, max_depth, points)
    for v in range(depth.shape[0]):
        if v + 1 < depth.shape[0]:
            _fill_row(depth, v + 1, fx, fy, cx, cy, T, max_depth, points)
        _fill_steps(points, masks, v, voxel, max_gap, across, down, cuts)
        for u in range(width):
            if np.isnan(points[v % 2, u, 0]):
                continue
            own, steps, part = owner[v, u], cuts[u], 1.0 / cuts[u]
            for i in range(steps):
                for j in range(steps):
                    key = _key(points, v % 2, u, i * part, j * part, voxel)
                    if key == last_key and label[last_link] == own:
                        count[last_link] += 1
                        continue
                    if key != last_key:
                        last = above[u]
                        if last == _EMPTY or keys[last] != key:
                            slot = _slot(key, size - 1)
                            while table[slot] != _EMPTY and keys[table[slot]] != key:
                                slot = (slot + 1) & (size - 1)
                            if table[slot] == _EMPTY:
                                if n == room:
                                    return -1
                                table[slot], keys[n], first[n] = n, key, _EMPTY
                                n += 1
                            last = table[slot]
                        last_key = key
                    link = first[last]
                    while link != _EMPTY and label[link] != own:
                        link = following[link]
                    if link == _EMPTY:
                        if n_links == len(label):
                            return -1
                        link = n_links
                        n_links += 1
                        label[link], count[link], following[link] = own, 0, first[last]
                        first[last] = link
                    count[link] += 1
                    last_link = link
            above[u] = last
    for k in range(n):
        best, most, link = 0, 0, first[k]
        while link != _EMPTY:
            if count[link] > most or (count[link] == most and label[link] < best):
                best, most = label[link], count[link]
            link = following[link]
        owners[k] = best
    return n


def owned_voxels(
    depth: npt.NDArray[np.float32],
    owner: npt.NDArray[np.int32],
    masks: npt.NDArray[np.int32],
    camera: PinholeCamera,
    T_world_camera: npt.NDArray[np.float64],
    settings: MappingSettings,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Keys (V,) of the voxels of a frame in the order in which they are met, and which number of ``owner`` (H, W) owns each.

    Patches are filled within labels of ``masks``.
    """
    room = 1 << 16
    while True:
        keys, owners = np.empty(room, np.int64), np.empty(room, np.int32)
        n = _owned_voxels(
            depth, owner, masks, camera.fx, camera.fy, camera.cx, camera.cy, T_world_camera, settings.max_depth,
            settings.voxel_size, settings.max_gap, keys, owners,
        )  # fmt: skip
        if n >= 0:
            return keys[:n].copy(), owners[:n].copy()
        room *= 2
