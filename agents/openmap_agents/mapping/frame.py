"""One frame on its way into the map: checked, back-projected, and cut into the voxel sets P_k of its masks.

A voxel belongs to one mask of a frame at most: to that which most of the voxel's pixels carry (the lowest label on a tie, no mask
being label 0). Reference and online mapper share the checks and the back-projection of pixels, where rounding decides, and
nothing after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

# Indoor surfaces love round coordinates: with the grid at 0, a floor at y = 0 would flicker between two layers of voxels.
GRID_OFFSET = 0.37
_HALF = 1 << 20
_BITS = 21


@dataclass(frozen=True)
class FrameVoxels:
    """What a frame sees, n masks, V voxels.

    Parameters
    ----------
    keys : (V,) int64
        Voxels, ascending (see ``voxel_centres``).
    mask : (V,) int32
        1..n, index of the mask that owns the voxel; 0 = none.
    labels : (n,) int32
        What the masks were called in the label picture.
    pixels : (n,) int32
        Pixels of the masks, whether they have depth or not.
    sizes : (n,) int32
        Voxels of the masks, |P_k|.
    """

    keys: npt.NDArray[np.int64]
    mask: npt.NDArray[np.int32]
    labels: npt.NDArray[np.int32]
    pixels: npt.NDArray[np.int32]
    sizes: npt.NDArray[np.int32]


def check_frame(
    camera: PinholeCamera,
    depth: npt.ArrayLike,
    masks: npt.ArrayLike,
    features: npt.ArrayLike | None,
    T_world_camera: npt.ArrayLike,
    rgb: npt.ArrayLike | None = None,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.float32] | None, npt.NDArray[np.float64]]:
    """The arguments of a frame as arrays, or ValueError that says which of them cannot be used and why.

    Depth that is not finite or not positive counts as no reading. Features come back as unit vectors; one that is zero or not
    finite comes back as zeros, which says "no feature".
    """
    shape = (camera.height, camera.width)
    depth_, masks_ = np.asarray(depth), np.asarray(masks)
    if depth_.shape == (*shape, 1):
        depth_ = depth_[..., 0]
    for name, array, kind, expected in (("depth", depth_, "fiu", "numbers"), ("masks", masks_, "iub", "integers")):
        if array.shape != shape or array.dtype.kind not in kind:
            raise ValueError(f"{name} is {array.dtype} of shape {array.shape}, expected {expected} of shape {shape}")
    if depth_.dtype.kind != "f":
        raise ValueError(
            f"depth is {depth_.dtype}, expected metres as floats; millimetres in integers become depth / 1000.0"
        )
    T = np.asarray(T_world_camera, np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        what = f"of shape {T.shape}" if T.shape != (4, 4) else "not finite"
        raise ValueError(
            f"T_world_camera is {what}, expected a finite 4 x 4 matrix; skip frames whose tracking was lost"
        )
    if not np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-3) or not np.allclose(T[3], (0, 0, 0, 1)):
        raise ValueError("T_world_camera is not a rigid transform, expected a rotation, a translation and 0 0 0 1")
    if np.abs(T[:3, 3]).max() > 10_000:
        raise ValueError(f"T_world_camera lies at {T[:3, 3]} m, expected within 10 km of the origin")
    if masks_.size and int(masks_.min()) < 0:
        raise ValueError(f"masks hold {masks_.min()}, expected labels of 0 (none) and above")
    features_ = None if features is None else _check_features(np.asarray(features), int(masks_.max()))
    if rgb is not None and np.shape(rgb) != (*shape, 3):
        raise ValueError(f"rgb is of shape {np.shape(rgb)}, expected {(*shape, 3)}")
    return np.ascontiguousarray(depth_, np.float32), np.ascontiguousarray(masks_, np.int32), features_, T


def _check_features(features: npt.NDArray[np.generic], max_label: int) -> npt.NDArray[np.float32]:
    if features.ndim != 2 or features.dtype.kind not in "fiu":
        raise ValueError(f"features are {features.dtype} of shape {features.shape}, expected numbers of shape (n, D)")
    if max_label > len(features):
        raise ValueError(
            f"masks go up to label {max_label}, but there are features for 1..{len(features)} only; expected one row for each label"
        )
    unit = features.astype(np.float64)
    unit[~np.isfinite(unit).all(1)] = 0
    norm = np.linalg.norm(unit, axis=1, keepdims=True)
    return np.asarray(np.divide(unit, norm, out=np.zeros_like(unit), where=norm > 1e-12), np.float32)


@numba.njit(cache=True)
def _points_of_pixels(depth, fx, fy, cx, cy, T, max_depth):  # type: ignore[no-untyped-def]
    """World points (H, W, 3) float64 m; NaN without a reading."""
    points = np.full((*depth.shape, 3), np.nan)
    for v in range(depth.shape[0]):
        y = -(v - cy) / fy
        for u in range(depth.shape[1]):
            d = np.float64(depth[v, u])
            if d > 0.0 and d <= max_depth:
                x = (u - cx) / fx
                for axis in range(3):
                    points[v, u, axis] = d * (T[axis, 0] * x + T[axis, 1] * y - T[axis, 2]) + T[axis, 3]
    return points


@numba.njit(cache=True)
def _steps_between(points, masks, v, u, voxel, max_gap):  # type: ignore[no-untyped-def]
    """Into how many steps the patch from pixel (v, u) to (v + 1, u + 1) must be cut to leave no voxel out; 1 = not at all."""
    if v + 1 == points.shape[0] or u + 1 == points.shape[1]:
        return 1
    label = masks[v, u]
    if masks[v, u + 1] != label or masks[v + 1, u] != label or masks[v + 1, u + 1] != label:
        return 1
    longest = 0.0
    for a, b, c, d in ((v, u, v, u + 1), (v, u, v + 1, u), (v + 1, u + 1, v, u + 1), (v + 1, u + 1, v + 1, u)):
        square = 0.0
        for axis in range(3):
            square += (points[a, b, axis] - points[c, d, axis]) ** 2
        if not square <= max_gap * max_gap:
            return 1
        longest = max(longest, square)
    return max(1, int(np.ceil(np.sqrt(longest) / voxel)))


@numba.njit(cache=True)
def _voxels_of_points(points, masks, voxel, max_gap, cells, labels):  # type: ignore[no-untyped-def]
    """Fill ``cells`` (K, 3) and ``labels`` (K,); return how many there are, also where they do not fit."""
    count, room = 0, len(labels)
    for v in range(points.shape[0]):
        for u in range(points.shape[1]):
            if np.isnan(points[v, u, 0]):
                continue
            steps = _steps_between(points, masks, v, u, voxel, max_gap)
            for i in range(steps):
                for j in range(steps):
                    if count < room:
                        s, t = i / steps, j / steps
                        for axis in range(3):
                            p = points[v, u, axis]
                            if steps > 1:
                                p = (1 - s) * ((1 - t) * p + t * points[v, u + 1, axis]) + s * (
                                    (1 - t) * points[v + 1, u, axis] + t * points[v + 1, u + 1, axis]
                                )
                            cells[count, axis] = np.int64(np.floor(p / voxel + GRID_OFFSET))
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
    """Voxel cells (K, 3) int64 and labels (K,) int32 of the pixels that have depth, row by row.

    Where four neighbours of one label lie further apart than a voxel, but no edge is longer than ``max_gap``, the patch between
    them is sampled too: else a far or slanted surface would be a sieve, and no two frames would see the same of it.
    """
    points = _points_of_pixels(
        depth, camera.fx, camera.fy, camera.cx, camera.cy, T_world_camera, settings.max_depth
    )  # fmt: skip
    count = 2 * depth.size
    while True:
        cells, labels = np.empty((count, 3), np.int64), np.empty(count, np.int32)
        needed = _voxels_of_points(points, masks, settings.voxel_size, settings.max_gap, cells, labels)
        if needed <= count:
            return cells[:needed], labels[:needed]
        count = needed


def pack_cells(cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Cells (K, 3) -> keys (K,) int64, in the same lexicographic order."""
    c = cells + _HALF
    return np.asarray((c[:, 0] << 2 * _BITS) | (c[:, 1] << _BITS) | c[:, 2], np.int64)


def unpack_keys(keys: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Keys (K,) -> cells (K, 3) int64; undoes ``pack_cells``."""
    low = (1 << _BITS) - 1
    return np.stack([keys >> 2 * _BITS, (keys >> _BITS) & low, keys & low], axis=1) - _HALF


def voxel_centres(keys: npt.NDArray[np.int64], voxel_size: float) -> npt.NDArray[np.float32]:
    """Centres (K, 3) float32 m of voxels."""
    return np.asarray((unpack_keys(keys) + 0.5 - GRID_OFFSET) * voxel_size, np.float32)


def large_enough(masks: npt.NDArray[np.int32], settings: MappingSettings) -> npt.NDArray[np.int64]:
    """Pixels of each label 0..max, with those of label 0 and of masks below ``min_mask_pixels`` set to 0."""
    pixels = np.bincount(masks.ravel())
    pixels[0] = 0
    pixels[pixels < settings.min_mask_pixels] = 0
    return np.asarray(pixels, np.int64)


@numba.njit(cache=True)
def _codes(cells, label, n):  # type: ignore[no-untyped-def]
    """(code (K,), lowest cell (3,), extent (3,)): code = place in the box of the cells * n + label."""
    low, high = cells[0].copy(), cells[0].copy()
    for i in range(len(cells)):
        for axis in range(3):
            low[axis], high[axis] = min(low[axis], cells[i, axis]), max(high[axis], cells[i, axis])
    span = high - low + 1
    codes = np.empty(len(cells), np.int64)
    for i in range(len(cells)):
        x, y, z = cells[i, 0] - low[0], cells[i, 1] - low[1], cells[i, 2] - low[2]
        codes[i] = ((x * span[1] + y) * span[2] + z) * n + label[i]
    return codes, low, span


@numba.njit(cache=True)
def _majority(codes, n, voxel_code, voxel_label):  # type: ignore[no-untyped-def]
    """Reduce sorted codes (voxel * n + label) to a label a voxel, the lowest of the most frequent; return how many voxels."""
    count, i = 0, 0
    while i < len(codes):
        voxel = codes[i] // n
        best, best_count = 0, 0
        while i < len(codes) and codes[i] // n == voxel:
            start = i
            while i < len(codes) and codes[i] == codes[start]:
                i += 1
            if i - start > best_count:
                best, best_count = codes[start] - voxel * n, i - start
        voxel_code[count], voxel_label[count] = voxel, best
        count += 1
    return count


def frame_voxels(
    depth: npt.NDArray[np.float32],
    masks: npt.NDArray[np.int32],
    camera: PinholeCamera,
    T_world_camera: npt.NDArray[np.float64],
    settings: MappingSettings,
) -> FrameVoxels:
    """The voxels of a frame and who owns them (``reference.frame_sets`` says the same plainly)."""
    pixels = large_enough(masks, settings)
    new_label = np.zeros(len(pixels), np.int32)
    used = np.flatnonzero(pixels)
    new_label[used] = np.arange(1, len(used) + 1)
    cells, labels = pixel_voxels(depth, masks, camera, T_world_camera, settings)
    if len(cells) == 0:
        empty = np.empty(0, np.int32)
        return FrameVoxels(np.empty(0, np.int64), empty, empty, empty, empty)
    # Codes relative to the frame's own box leave room for the label in 64 bits and sort in the order of the global keys.
    n = len(used) + 1
    codes, low, span = _codes(cells, new_label[labels], n)
    codes.sort()
    voxel, mask = np.empty(len(codes), np.int64), np.empty(len(codes), np.int32)
    count = _majority(codes, n, voxel, mask)
    voxel, mask = voxel[:count], mask[:count]
    cells = np.stack([voxel // (span[1] * span[2]), voxel // span[2] % span[1], voxel % span[2]], axis=1) + low
    keys = pack_cells(cells)

    sizes = np.bincount(mask, minlength=n)
    sizes[0] = 0
    kept = np.flatnonzero(sizes >= settings.min_mask_voxels)
    kept = kept[kept > 0]
    index = np.zeros(n, np.int32)
    index[kept] = np.arange(1, len(kept) + 1)
    mask = index[mask]
    if settings.visibility == "labelled":
        keys, mask = keys[mask > 0], mask[mask > 0]
    source = used[kept - 1]
    return FrameVoxels(
        keys, mask, source.astype(np.int32), pixels[source].astype(np.int32), sizes[kept].astype(np.int32)
    )
