"""Products and lengths of many small vectors, without what NumPy's general forms spend on shapes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def cross(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> Floats:
    """The cross products of vectors (..., 3) of shapes that broadcast: the same bits as ``numpy.cross``."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    first = a1 * b2 - a2 * b1
    out = np.empty((*first.shape, 3), first.dtype)
    out[..., 0] = first
    out[..., 1] = a2 * b0 - a0 * b2
    out[..., 2] = a0 * b1 - a1 * b0
    return out


def lengths(a: npt.NDArray[np.floating]) -> Floats:
    """The Euclidean lengths (...,) of vectors (..., 3)."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def gradient(a: Floats) -> Floats:
    """Central differences along the first axis, one-sided at its ends: ``numpy.gradient(a, axis=0)``."""
    out = np.empty_like(a)
    out[1:-1] = (a[2:] - a[:-2]) / 2.0
    out[0], out[-1] = a[1] - a[0], a[-1] - a[-2]
    return out


def doubled_areas(vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> Floats:
    """Twice the area, m2, of each triangle, (F,)."""
    return lengths(area_vectors(vertices, faces))


def area_vectors(vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> Floats:
    """The normal of each triangle times twice its area, (F, 3)."""
    a = vertices[faces[:, 0]]
    return cross(vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a)
