"""Rays against triangles, by Open3D's Embree scene: what is hit first, what is in the way."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import numpy.typing as npt


class RayCaster:
    """Casts rays against a mesh of vertices (V, 3) m and faces (F, 3)."""

    def __init__(self, vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> None:
        # Imported late, and without its type stubs, which do not take arrays.
        self._o3d: Any = importlib.import_module("open3d")
        self._scene = self._o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))

    def distance(self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """How far, in lengths of ``way`` (N, 3), the first hit lies from ``origin`` (N, 3); inf = none. (N,)."""
        return np.asarray(self._scene.cast_rays(self._rays(origin, way))["t_hit"].numpy(), np.float32)

    def first_hit(
        self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int64]]:
        """``distance`` and ``first_face`` at once."""
        hit = self._scene.cast_rays(self._rays(origin, way))
        face = hit["primitive_ids"].numpy().astype(np.int64)
        return hit["t_hit"].numpy(), np.where(face == int(self._scene.INVALID_ID), -1, face)

    def first_face(self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]) -> npt.NDArray[np.int64]:
        """The face that a ray from ``origin`` (N, 3) along ``way`` (N, 3) meets first; -1 = none. (N,)."""
        hit = self._scene.cast_rays(self._rays(origin, way))["primitive_ids"].numpy().astype(np.int64)
        return np.where(hit == int(self._scene.INVALID_ID), -1, hit)

    def blocked(
        self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating], end: float
    ) -> npt.NDArray[np.bool_]:
        """Whether anything lies between origin (N, 3) and origin + end * way; (N,)."""
        return np.asarray(self._scene.test_occlusions(self._rays(origin, way), 0.0, end).numpy(), np.bool_)

    def _rays(self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]) -> Any:
        return self._o3d.core.Tensor(np.concatenate([origin, way], 1).astype(np.float32))
