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
def _voxels_of_pixels(depth, masks, fx, fy, cx, cy, T, voxel, max_depth, cells, labels):  # type: ignore[no-untyped-def]
    """Fill ``cells`` (K, 3) int64 and ``labels`` (K,) with the voxel and label of every pixel that has depth; return K."""
    count = 0
    for v in range(depth.shape[0]):
        y = -(v - cy) / fy
        for u in range(depth.shape[1]):
            d = np.float64(depth[v, u])
            if not (d > 0.0 and d <= max_depth):
                continue
            x = (u - cx) / fx
            for axis in range(3):
                p = d * (T[axis, 0] * x + T[axis, 1] * y - T[axis, 2]) + T[axis, 3]
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
    """Voxel cells (K, 3) int64 and labels (K,) int32 of the pixels that have depth, row by row."""
    cells, labels = np.empty((depth.size, 3), np.int64), np.empty(depth.size, np.int32)
    count = _voxels_of_pixels(
        depth, masks, camera.fx, camera.fy, camera.cx, camera.cy, T_world_camera,
        settings.voxel_size, settings.max_depth, cells, labels,
    )  # fmt: skip
    return cells[:count], labels[:count]


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
    low = cells.min(0)
    span = cells.max(0) - low + 1
    n = len(used) + 1
    local = cells - low
    codes = ((local[:, 0] * span[1] + local[:, 1]) * span[2] + local[:, 2]) * n + new_label[labels]
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
