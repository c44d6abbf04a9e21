"""Solids where they stand, and whether two of them run into each other."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.vectors import cross, lengths


class Body:
    """Triangles in the world frame: vertices (V, 3) m, faces (F, 3); what rays and edges need is made when first asked for."""

    def __init__(self, vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> None:
        self.vertices = np.asarray(vertices, np.float64)
        self.faces = faces
        self.low, self.high = self.vertices.min(0), self.vertices.max(0)

    @cached_property
    def caster(self) -> RayCaster:
        """Casts rays against it."""
        return RayCaster(self.vertices, self.faces)

    @cached_property
    def edges(self) -> npt.NDArray[np.int64]:
        """Both ends of every edge, indices (E, 2)."""
        pairs = np.sort(self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
        code = np.unique(pairs[:, 0] * len(self.vertices) + pairs[:, 1])
        return np.stack([code // len(self.vertices), code % len(self.vertices)], 1)

    def pierced_by(
        self, other: Body, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], tolerance: float
    ) -> bool:
        """Whether an edge of the other, in the box low to high (3,), ends more than ``tolerance`` m before and behind a face."""
        start, end = other.vertices[other.edges[:, 0]], other.vertices[other.edges[:, 1]]
        near = np.all((np.minimum(start, end) <= high) & (np.maximum(start, end) >= low), axis=1)
        start, end = start[near], end[near]
        if len(start) == 0:
            return False
        # From both ends, so that the first and the last of the faces which an edge goes through are found.
        origin, way = np.concatenate([start, end]), np.concatenate([end - start, start - end])
        t, face = self.caster.first_hit(origin, way)
        hit = np.flatnonzero((t > 0.0) & (t < 1.0))
        if len(hit) == 0:
            return False
        a, b, c = (self.vertices[self.faces[face[hit], k]] for k in range(3))
        normal = cross(b - a, c - a)
        across = np.abs((normal * way[hit]).sum(1)) / np.maximum(lengths(normal), 1e-15)
        return bool(((across * t[hit] > tolerance) & (across * (1.0 - t[hit]) > tolerance)).any())


def run_together(a: Body, b: Body, tolerance: float = 0.008) -> bool:
    """Whether an edge of one goes through a face of the other, more than ``tolerance`` m before and behind its plane."""
    if np.any(np.minimum(a.high - b.low, b.high - a.low) <= tolerance):
        return False
    low, high = np.maximum(a.low, b.low) - 1e-3, np.minimum(a.high, b.high) + 1e-3
    return a.pierced_by(b, low, high, tolerance) or b.pierced_by(a, low, high, tolerance)


def meetings(loose: Sequence[Body], fixed: Sequence[Body], tolerance: float = 0.009) -> list[tuple[int, int]]:
    """Pairs (i, j) of bodies that run into each other, j counted over the loose ones and then the fixed ones; i is loose."""
    bodies = [*loose, *fixed]
    low, high = np.stack([b.low for b in bodies]), np.stack([b.high for b in bodies])
    found = []
    for i, body in enumerate(loose):
        reach = np.minimum(body.high - low[i + 1 :], high[i + 1 :] - body.low).min(1)
        for j in (np.flatnonzero(reach > tolerance) + i + 1).tolist():
            if run_together(body, bodies[j], tolerance):
                found.append((i, j))
    return found
