"""From a camera's picture to the maps that the networks read: sizes, strides, what depth says at each cell, means under masks.

The colour picture is brought to at most about 640 pixels' width (``front_picture``), and every map of stride s has
ceil(h / 32) * 32 / s rows and as many columns of it, so that maps of all strides lie on each other. Labels are taken on the working
picture of ``surface``, whose pixels each lie in one cell of every stride.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.surface import Surface

STRIDES = (4, 8, 16, 32)
ALIGN = STRIDES[-1]
FRONT_WIDTH = 640
N_GEOMETRY = 6
N_BELONGING, N_CLASSES = 12, 4
"""Channels of the neck's map of stride 4: a place in a space where one thing's pixels lie together; the logits of thing, wall,
floor and ceiling."""


def front_scale(width: int) -> int:
    """How many pixels of the camera's picture, across, make one of the networks'."""
    return max(1, round(width / FRONT_WIDTH))


def front_picture(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The picture (H, W, 3) as the networks see it, (H // k, W // k, 3): means of k x k pixels."""
    k = front_scale(rgb.shape[1])
    if k == 1:
        return rgb
    size = (rgb.shape[1] // k, rgb.shape[0] // k)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


def map_shape(height: int, width: int, stride: int) -> tuple[int, int]:
    """Rows and columns of a map of a picture of (height, width) pixels."""
    k = front_scale(width)
    return tuple(-(-(n // k) // ALIGN) * ALIGN // stride for n in (height, width))  # type: ignore[return-value]


def cells_of(step: int, stride: int, height: int, width: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Row and column of the cell of ``stride`` in which each row and column of the working picture, every ``step`` pixels, lies."""
    k, limits = front_scale(width), map_shape(height, width, stride)
    rows, columns = (
        np.minimum(np.arange(step // 2, n, step) // (k * stride), limit - 1)
        for n, limit in zip((height, width), limits, strict=True)
    )
    return rows, columns


def geometry_map(
    surface: Surface, T_world_camera: npt.NDArray[np.floating], height: int, width: int
) -> npt.NDArray[np.float32]:
    """What depth says at stride 4, (N_GEOMETRY, h, w) float32: normal (right, up, back), height above the floor, log depth, seen.

    The normal's axes are level and turned with the camera, so that neither tilt nor heading of the camera matters. Zeros where
    there is no depth.
    """
    rows, columns = cells_of(surface.step, 4, height, width)
    shape = map_shape(height, width, 4)
    # The first working pixel of each cell stands for it; cells past the picture's edge repeat the last.
    v = np.minimum(np.searchsorted(rows, np.arange(shape[0])), len(rows) - 1)
    u = np.minimum(np.searchsorted(columns, np.arange(shape[1])), len(columns) - 1)
    depth, normals = surface.depth[v[:, None], u], surface.normals[v[:, None], u]
    up = surface.points[v[:, None], u, 1] - surface.floor
    right = np.asarray(T_world_camera, np.float64)[[0, 2], 0]
    right = (right / max(float(np.linalg.norm(right)), 1e-9)).astype(np.float32)
    seen = (depth > 0).astype(np.float32)
    return np.stack(
        [
            normals[..., 0] * right[0] + normals[..., 2] * right[1],
            normals[..., 1],
            normals[..., 2] * right[0] - normals[..., 0] * right[1],
            up * seen,
            np.log(np.maximum(depth, 0.1)) * seen,
            seen,
        ]
    ).astype(np.float32)


def cover(labels: npt.NDArray[np.integer], n: int, step: int, height: int, width: int) -> list[npt.NDArray[np.float32]]:
    """How much of each cell each label 1..n of the working picture covers: [(n, h_s * w_s) float32 px] at strides 4 to 32."""
    h, w = map_shape(height, width, 4)
    rows, columns = cells_of(step, 4, height, width)
    v, u = np.nonzero(labels)
    flat = (labels[v, u].astype(np.int64) - 1) * (h * w) + rows[v] * w + columns[u]
    counts = np.bincount(flat, minlength=n * h * w).reshape(n, h, w).astype(np.float32)
    levels = [counts]
    while len(levels) < len(STRIDES):
        levels.append(levels[-1].reshape(n, levels[-1].shape[1] // 2, 2, -1, 2).sum((2, 4)))
    return [level.reshape(n, -1) for level in levels]


def means(cells: npt.NDArray[np.float32], features: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Mean (n, C) of a map (C, h, w) under each row of ``cells`` (n, h * w); zeros for an empty one."""
    area = np.maximum(cells.sum(1, keepdims=True), 1.0)
    return np.asarray((cells @ features.reshape(len(features), -1).T) / area, np.float32)
