"""Meshes of flat sheets: grids with holes, walls from plan to world, strips between two lines along a wall."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.primitives import grid_faces
from openmap_scenes.homes.rooms import Side
from openmap_scenes.homes.vectors import area_vectors
from openmap_scenes.scene import Material

Array = npt.NDArray[np.float64]


def breaks(start: float, end: float, step: float, marks: list[float]) -> Array:
    """Grid lines from start to end about ``step`` apart, with all marks between them among them."""
    fixed = sorted({start, end, *(m for m in marks if start < m < end)})
    lines = [start]
    for a, b in pairwise(fixed):
        lines += np.linspace(a, b, max(1, round((b - a) / step)) + 1)[1:].tolist()
    return np.array(lines)


def grid(u: Array, v: Array, keep: npt.NDArray[np.bool_]) -> tuple[Array, npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Points (N, 2) of a grid over u and v, two triangles for every kept cell (len(v)-1, len(u)-1), and each one's row."""
    points = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    row, column = np.nonzero(keep)
    i = row * len(u) + column
    a, b, c, d = i, i + 1, i + len(u) + 1, i + len(u)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.int32), np.concatenate([row, row])


def flat_mesh(
    points: Array,
    faces: npt.NDArray[np.int32],
    uv: Array,
    normal: tuple[float, float, float],
    face_material: npt.NDArray[np.integer],
    materials: list[Material],
) -> Model:
    """A flat mesh whose faces are turned to ``normal``."""
    wrong = area_vectors(points, faces) @ np.array(normal) < 0
    faces = np.where(wrong[:, None], faces[:, ::-1], faces).astype(np.int32)
    normals = np.broadcast_to(np.array(normal, np.float32), points.shape).copy()
    return Model(
        points.astype(np.float32), normals, uv.astype(np.float32), faces, face_material.astype(np.int32), materials
    )


def upright(side: Side, points: Array, off: float) -> Array:
    """World places (N, 3) of wall coordinates (along, height), ``off`` m into the room from the inner face."""
    return wall_places(side, np.insert(points, 2, off, axis=1))


def wall_places(side: Side, points: Array) -> Array:
    """World places (N, 3) of (along, height, off into the room from the inner face), m."""
    along, height, off = points.T
    other = side.at + side.inward * off
    return np.stack([along, height, other] if side.axis == "x" else [other, height, along], 1)


def strip(
    side: Side,
    lower: list[tuple[float, float, float]],
    upper: list[tuple[float, float, float]],
    surface: Material,
    step: float,
) -> Model:
    """A plain band between two lines given by their ends (along, height, off), m; it looks into the room and upwards, or
    downwards where the upper line lies further into the room."""
    (l0, l1), (u0, u1) = np.array(lower), np.array(upper)
    n = max(1, round(float(np.linalg.norm(l1 - l0)) / step))
    t = np.linspace(0, 1, n + 1)[:, None]
    local = np.concatenate([l0 + t * (l1 - l0), u0 + t * (u1 - u0)])
    points = wall_places(side, local)
    rise, out = float(u0[1] - l0[1]), float(u0[2] - l0[2])
    normal = np.array([rise, -out]) / np.hypot(rise, out)
    world = (0.0, float(normal[1]), float(normal[0]) * side.inward)
    world = world if side.axis == "x" else (world[2], world[1], 0.0)
    faces = grid_faces(n, 1)
    zero = np.zeros(len(faces), np.int64)
    return flat_mesh(points, faces, np.zeros((len(points), 2)), world, zero, [surface])
