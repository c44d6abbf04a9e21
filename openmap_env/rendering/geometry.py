"""What the rasterisers share: camera matrices, spatial batches of faces, and which of them a camera can see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera

Matrix = npt.NDArray[np.float64]


def check_pose(T_world_camera: npt.ArrayLike) -> Matrix:
    """The pose as (4, 4) float64; ValueError unless it is a finite rotation and translation."""
    T = np.asarray(T_world_camera, np.float64)
    if T.shape != (4, 4):
        raise ValueError(f"T_world_camera has shape {T.shape}, expected (4, 4)")
    if not np.isfinite(T).all():
        raise ValueError("T_world_camera holds values that are not finite, expected a camera-to-world pose in metres")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.abs(T[3] - (0, 0, 0, 1)).max() > 1e-6:
        raise ValueError(f"T_world_camera is not a rigid transform: {T.tolist()}, expected rotation and translation")
    return T


def check_range(near: float, far: float) -> None:
    """ValueError unless 0 < near < far, in metres."""
    if not 0.0 < near < far < np.inf:
        raise ValueError(f"near and far are {near} and {far} m, expected 0 < near < far")


def view_matrix(T_world_camera: Matrix) -> Matrix:
    """T_camera_world (4, 4), the inverse of a rigid pose."""
    T = np.eye(4)
    T[:3, :3] = T_world_camera[:3, :3].T
    T[:3, 3] = -T[:3, :3] @ T_world_camera[:3, 3]
    return T


def projection_matrix(camera: PinholeCamera, near: float, far: float) -> Matrix:
    """Camera frame to OpenGL clip space, (4, 4), such that row 0 of the frame buffer is the top row of the picture.

    Pixel (i, j) of a frame buffer has its centre at i + 0.5, hence ``x_ndc = 2 (u + 0.5) / W - 1`` for the image coordinate
    ``u = fx x / -z + cx`` whose pixel centres are integers. The flip of y spares a copy of every picture that is read.
    """
    w, h = camera.width, camera.height
    P = np.zeros((4, 4))
    P[0, 0], P[0, 2] = 2.0 * camera.fx / w, 1.0 - 2.0 * (camera.cx + 0.5) / w
    P[1, 1], P[1, 2] = -2.0 * camera.fy / h, 1.0 - 2.0 * (camera.cy + 0.5) / h
    P[2, 2], P[2, 3] = (near + far) / (near - far), 2.0 * near * far / (near - far)
    P[3, 2] = -1.0
    return P


@dataclass(frozen=True)
class Batches:
    """Faces in an order in which each batch is one run.

    Parameters
    ----------
    order : (F,) int64
        Faces, batch after batch.
    starts : (B + 1,) int64
        Batch b is ``order[starts[b]:starts[b + 1]]``.
    group : (B,) int64
        The group that all faces of the batch belong to.
    low, high : (B, 3) float64 m, world frame
        Axis-aligned boxes.
    """

    order: npt.NDArray[np.int64]
    starts: npt.NDArray[np.int64]
    group: npt.NDArray[np.int64]
    low: Matrix
    high: Matrix

    def __len__(self) -> int:
        return len(self.group)


def split_into_batches(
    vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer], face_group: npt.NDArray[np.integer], size: int
) -> Batches:
    """Cut the faces of each group into compact batches of at most ``size`` faces, by halving at the median.

    Parameters
    ----------
    vertices : (V, 3) m
    faces : (F, 3)
    face_group : (F,)
        What must not be mixed in one batch, such as the texture.
    size : int
    """
    corners = vertices[faces].astype(np.float64)
    centres = corners.mean(1)
    by_group = np.argsort(face_group, kind="stable")
    _, firsts = np.unique(face_group[by_group], return_index=True)
    pending = list(np.split(by_group, firsts[1:]))[::-1]
    runs: list[npt.NDArray[np.int64]] = []
    while pending:
        run = pending.pop()
        if len(run) <= size:
            runs.append(run)
            continue
        axis = int(np.argmax(np.ptp(centres[run], axis=0)))
        halves = run[np.argsort(centres[run, axis], kind="stable")]
        pending += [halves[len(run) // 2 :], halves[: len(run) // 2]]
    return Batches(
        order=np.concatenate(runs),
        starts=np.concatenate([[0], np.cumsum([len(run) for run in runs])]).astype(np.int64),
        group=np.array([face_group[run[0]] for run in runs], np.int64),
        low=np.array([corners[run].min((0, 1)) for run in runs]),
        high=np.array([corners[run].max((0, 1)) for run in runs]),
    )


def visible_boxes(low: Matrix, high: Matrix, T_clip_world: Matrix, position: Matrix) -> npt.NDArray[np.int64]:
    """Indices of the boxes that may show in the view frustum, nearest to ``position`` (3,) m first.

    A box is left out only if it lies wholly outside one of the six planes of clip space ``-w <= x, y, z <= w``
    (Gribb and Hartmann 2001: each plane is a sum or difference of rows of the matrix).
    """
    w = T_clip_world[3]
    planes = np.concatenate([w + T_clip_world[:3], w - T_clip_world[:3]])
    normals, offsets = planes[:, :3], planes[:, 3]
    # The corner of a box that lies farthest along a plane's normal decides.
    reach = np.maximum(normals, 0.0) @ high.T + np.minimum(normals, 0.0) @ low.T + offsets[:, None]
    seen = np.flatnonzero((reach >= 0.0).all(0))
    gap = np.maximum(np.maximum(low[seen] - position, position - high[seen]), 0.0)
    nearest_first: npt.NDArray[np.int64] = seen[np.argsort((gap**2).sum(1), kind="stable")]
    return nearest_first
