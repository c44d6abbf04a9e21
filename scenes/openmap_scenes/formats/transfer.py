"""Ids from the faces of a labelled mesh to the faces of another mesh of the same surfaces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_scenes.errors import DataError

# Faces of the two meshes are the same ones where their centroids are this close, m.
SAME_FACE = 1e-3
# No home lies farther from its origin, m; beyond it float32 keeps no centimetres and squared distances may overflow.
FARTHEST = 1e6


def transfer_face_ids(
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    face_id: npt.NDArray[np.int32],
    to_vertices: npt.NDArray[np.float32],
    to_faces: npt.NDArray[np.int32],
    source: str | Path = "the labelled mesh",
    to_source: str | Path = "the textured mesh",
) -> npt.NDArray[np.int32]:
    """The id of each face of one mesh at the faces of another one of the same surface, both in one frame.

    Where both have the same triangles, the face with the same centroid gives the id, and among faces that lie on one
    another (a picture's back on the wall) the one whose corners fit best. Elsewhere the closest surface gives it.

    Parameters
    ----------
    vertices, faces, face_id : (V, 3) float32 m, (F, 3) int32, (F,) int32
        The labelled mesh.
    to_vertices, to_faces : (W, 3) float32 m, (G, 3) int32
        The mesh that wants ids.
    source, to_source : str or Path
        What an error names.

    Returns
    -------
    (G,) int32
        All 0 where the labelled mesh has no faces.

    Raises
    ------
    DataError
        Coordinates that are not finite or absurdly far out, faces outside the vertices, ids that do not fit the faces.
    """
    _check(vertices, faces, source)
    _check(to_vertices, to_faces, to_source)
    if len(face_id) != len(faces):
        raise DataError(source, f"{len(face_id)} face ids", f"one for each of the {len(faces)} faces")
    result = np.zeros(len(to_faces), np.int32)
    if not len(faces) or not len(to_faces):
        return result
    same = _same_faces(vertices, faces, face_id, to_vertices, to_faces)
    result[same >= 0] = face_id[same[same >= 0]]
    rest = np.flatnonzero(same < 0)
    if len(rest):
        result[rest] = face_id[_nearest_faces(vertices, faces, to_vertices[to_faces[rest]])]
    return result


def _same_faces(
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    face_id: npt.NDArray[np.int32],
    to_vertices: npt.NDArray[np.float32],
    to_faces: npt.NDArray[np.int32],
) -> npt.NDArray[np.int64]:
    """Which face has the same three corners to the bit, in any order, (G,); -1 where none has, or faces of several ids have.

    Corners are compared by a sum of 64-bit hashes; that two of a few million differ and agree has odds of one in a million.
    """
    keys, to_keys = _keys(vertices, faces), _keys(to_vertices, to_faces)
    order = np.argsort(keys, kind="stable")
    unique, starts = np.unique(keys[order], return_index=True)
    ids = face_id[order]
    is_clear = np.minimum.reduceat(ids, starts) == np.maximum.reduceat(ids, starts)
    at = np.minimum(np.searchsorted(unique, to_keys), len(unique) - 1)
    found = (unique[at] == to_keys) & is_clear[at]
    return np.asarray(np.where(found, order[starts[at]], -1), np.int64)


def _keys(vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32]) -> npt.NDArray[np.uint64]:
    """A number (F,) that faces of equal corners share (Weyl and SplitMix64 constants; all sums wrap)."""
    # Adding zero makes minus zero plus zero.
    bits = np.ascontiguousarray(vertices + np.float32(0), np.float32).view(np.uint32).astype(np.uint64)
    key = np.zeros(len(bits), np.uint64)
    for axis in range(3):
        key = (key ^ bits[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
        key = (key ^ (key >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
        key ^= key >> np.uint64(32)
    return np.asarray(key[faces].sum(axis=1), np.uint64)


def _nearest_faces(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32], to_corners: npt.NDArray[np.float32]
) -> npt.NDArray[np.int64]:
    """Index of the face whose centroid and shape fit corners (N, 3, 3) within ``SAME_FACE``, else of the closest face."""
    corners = vertices[faces]
    k = min(4, len(faces))
    distance, nearest = cKDTree(corners.mean(1)).query(to_corners.mean(1), k=k, distance_upper_bound=SAME_FACE)
    distance, nearest = distance.reshape(-1, k), nearest.reshape(-1, k)
    mismatch = np.full(nearest.shape, np.inf)
    hit = np.isfinite(distance)
    row, column = np.nonzero(hit)
    # Both meshes list a triangle's corners in any rotation, so compare the sorted distances to the common centroid.
    spread, to_spread = _spread(corners), _spread(to_corners)
    mismatch[row, column] = np.abs(spread[nearest[row, column]] - to_spread[row]).max(1) + distance[row, column]
    best = np.asarray(nearest[np.arange(len(nearest)), np.argmin(mismatch, axis=1)], np.int64)
    far = ~hit.any(1)
    if far.any():
        best[far] = _closest_faces(vertices, faces, to_corners[far].mean(1))
    return best


def _check(vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32], source: str | Path) -> None:
    """Refuse what would crash or hang the tree or the ray tracer, which are C code and check nothing."""
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise DataError(source, f"arrays of shape {vertices.shape} and {faces.shape}", "(V, 3) vertices, (F, 3) faces")
    check_coordinates(vertices, source)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise DataError(source, f"vertex indices from {faces.min()} to {faces.max()}", f"0..{len(vertices) - 1}")


def check_coordinates(vertices: npt.NDArray[np.floating], source: str | Path) -> None:
    """DataError where a coordinate is not finite or lies more than ``FARTHEST`` m from the origin."""
    if not len(vertices):
        return
    # NaN fails every comparison, so one pass finds all of it.
    if not (vertices.min() >= -FARTHEST and vertices.max() <= FARTHEST):
        bad = vertices[~(np.abs(vertices) <= FARTHEST).all(axis=1)]
        raise DataError(
            source,
            f"{len(bad)} vertices out of all bounds (first: {bad[0].tolist()})",
            f"finite coordinates in metres within {FARTHEST:.0f} m",
        )


def _spread(corners: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Ascending distances (F, 3) m of the corners (F, 3, 3) to their centroid."""
    return np.sort(np.linalg.norm(corners - corners.mean(1, keepdims=True), axis=2), axis=1)


def _closest_faces(
    vertices: npt.NDArray[np.float32], faces: npt.NDArray[np.int32], points: npt.NDArray[np.float32]
) -> npt.NDArray[np.int64]:
    """Index of the face closest to each point (N, 3) m."""
    import open3d as o3d

    surface = o3d.t.geometry.RaycastingScene()
    vertices, points = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(points, np.float32)
    surface.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(faces.astype(np.uint32)))
    closest = surface.compute_closest_points(o3d.core.Tensor.from_numpy(points))
    return np.asarray(closest["primitive_ids"].numpy(), np.int64)
