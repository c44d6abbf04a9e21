"""One frame on its way into the map: checked, back-projected, and cut into the voxel sets P_k of its masks.

A voxel belongs to one mask of a frame at most: to that which most of the voxel's pixels carry (the lowest label on a tie, no mask
being label 0). Reference and online mapper share the checks and the back-projection of pixels, where rounding decides, and
nothing after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.back_projection import BITS, GRID_OFFSET, HALF, owned_voxels
from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

MOST_LABEL = (1 << 20) - 1
"""Highest label of a mask: tables are as long as labels are high."""
FARTHEST = 5000.0
"""How far from the origin a camera may stand, m: voxels of the smallest size have numbers up to there."""


@dataclass(frozen=True)
class FrameVoxels:
    """What a frame sees, n masks, V voxels.

    Parameters
    ----------
    keys : (V,) int64
        Voxels (see ``voxel_centres``), in the order in which the picture shows them, row by row.
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
    rotation = T[:3, :3]
    orthogonal = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3)
    if not orthogonal or np.linalg.det(rotation) < 0 or not np.allclose(T[3], (0, 0, 0, 1)):
        raise ValueError("T_world_camera is not a rigid transform, expected a rotation, a translation and 0 0 0 1")
    if np.abs(T[:3, 3]).max() > FARTHEST:
        raise ValueError(f"T_world_camera lies at {T[:3, 3]} m, expected within {FARTHEST / 1000:g} km of the origin")
    if int(masks_.min()) < 0 or int(masks_.max()) > MOST_LABEL:
        wrong = masks_.min() if int(masks_.min()) < 0 else masks_.max()
        raise ValueError(f"masks hold {wrong}, expected labels of 0 (none) to {MOST_LABEL}")
    features_ = None if features is None else _check_features(np.asarray(features), int(masks_.max()))
    if rgb is not None and (np.shape(rgb) != (*shape, 3) or np.asarray(rgb).dtype != np.uint8):
        found = f"{np.asarray(rgb).dtype} of shape {np.shape(rgb)}"
        raise ValueError(f"rgb is {found}, expected uint8 of shape {(*shape, 3)}")
    with np.errstate(over="ignore"):  # it becomes infinite, which is no reading
        depth_ = np.ascontiguousarray(depth_, np.float32)
    return depth_, np.ascontiguousarray(masks_, np.int32), features_, T


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


def pack_cells(cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Cells (K, 3) -> keys (K,) int64, in the same lexicographic order."""
    c = cells + HALF
    return np.asarray((c[:, 0] << 2 * BITS) | (c[:, 1] << BITS) | c[:, 2], np.int64)


def unpack_keys(keys: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Keys (K,) -> cells (K, 3) int64; undoes ``pack_cells``."""
    low = (1 << BITS) - 1
    return np.stack([keys >> 2 * BITS, (keys >> BITS) & low, keys & low], axis=1) - HALF


def voxel_centres(keys: npt.NDArray[np.int64], voxel_size: float) -> npt.NDArray[np.float32]:
    """Centres (K, 3) float32 m of voxels."""
    return np.asarray((unpack_keys(keys) + 0.5 - GRID_OFFSET) * voxel_size, np.float32)


def large_enough(masks: npt.NDArray[np.int32], settings: MappingSettings) -> npt.NDArray[np.int64]:
    """Pixels of each label 0..max, with those of label 0 and of masks below ``min_mask_pixels`` set to 0."""
    pixels = np.bincount(masks.ravel())
    pixels[0] = 0
    pixels[pixels < settings.min_mask_pixels] = 0
    return np.asarray(pixels, np.int64)


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
    keys, mask = owned_voxels(depth, new_label[masks], masks, camera, T_world_camera, settings)
    n = len(used) + 1
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
