"""What is done to triangles before they become furniture: thinning, splitting, turning outside out, normals."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.obj import Surface
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.vectors import area_vectors


def face_normals(surface: Surface) -> npt.NDArray[np.float64]:
    """Area vectors (F, 3): the unit normal times twice the area."""
    return area_vectors(surface.vertices, surface.faces)


def tidy(surface: Surface) -> Surface:
    """Merge vertices at the same place and drop faces without area."""
    _, first, inverse = np.unique(np.round(surface.vertices, 5), axis=0, return_index=True, return_inverse=True)
    merged = Surface(surface.vertices[first], inverse.reshape(-1)[surface.faces], surface.uv, surface.material)
    return merged.keep(np.linalg.norm(face_normals(merged), axis=1) > 1e-9)


def thin(surface: Surface, target: int) -> Surface:
    """Decimate to at most ``target`` triangles by vertex clustering: materials, seams and loose parts survive, no cracks open.

    Vertices of one grid cell become their mean, those that face the other way apart so that a sheet keeps its two sides; every
    corner keeps its own texture coordinates. The finest grid that meets the target is found by bisection.
    """
    if len(surface.faces) <= target:
        return surface
    fine, coarse = 0.0, float(np.ptp(surface.vertices, axis=0).max()) / 12.0
    while len((best := _cluster(surface, coarse)).faces) > target:
        coarse *= 1.3
    for _ in range(12):
        middle = (fine + coarse) / 2.0
        thinned = _cluster(surface, middle)
        if len(thinned.faces) <= target:
            coarse, best = middle, thinned
        else:
            fine = middle
    return best


def _cluster(surface: Surface, cell: float) -> Surface:
    low = surface.vertices.min(0)
    cells = np.floor((surface.vertices - low) / cell + 0.5).astype(np.int64)
    normal = _vertex_sums(surface, face_normals(surface))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    key = np.ravel_multi_index(tuple(cells.T), tuple((cells.max(0) + 1).tolist()))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    behind = (normal * normal[first][inverse.reshape(-1)]).sum(1) < -0.3
    _, inverse = np.unique(2 * inverse.reshape(-1) + behind, return_inverse=True)
    inverse = inverse.reshape(-1)
    count = np.bincount(inverse)
    mean = np.stack([np.bincount(inverse, surface.vertices[:, k]) / count for k in range(3)], 1)
    faces = inverse[surface.faces]
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    order = np.sort(faces, axis=1)
    _, first = np.unique((order[:, 0] * len(count) + order[:, 1]) * len(count) + order[:, 2], return_index=True)
    once = np.zeros(len(faces), bool)
    once[first] = True
    return Surface(mean, faces, surface.uv, surface.material).keep(proper & once)


def split(surface: Surface, longest: float) -> Surface:
    """Halve triangles at their longest edge until no edge exceeds ``longest`` m, so that light can vary over them."""
    vertices, faces, uv, material = surface.vertices, surface.faces, surface.uv, surface.material
    for _ in range(40):
        corners = vertices[faces]
        edges = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
        long = np.flatnonzero(edges.max(1) > longest)
        if len(long) == 0:
            break
        k = edges[long].argmax(1)
        order = (k[:, None] + np.arange(3)) % 3
        f, t = np.take_along_axis(faces[long], order, 1), np.take_along_axis(uv[long], order[..., None], 1)
        pairs, index = np.unique(np.sort(f[:, :2], axis=1), axis=0, return_inverse=True)
        middle = len(vertices) + index.reshape(-1)
        vertices = np.concatenate([vertices, vertices[pairs].mean(1)])
        t_middle = t[:, :2].mean(1)
        first = np.stack([f[:, 0], middle, f[:, 2]], 1), np.stack([t[:, 0], t_middle, t[:, 2]], 1)
        second = np.stack([middle, f[:, 1], f[:, 2]], 1), np.stack([t_middle, t[:, 1], t[:, 2]], 1)
        faces, uv = faces.copy(), uv.copy()
        faces[long], uv[long] = first
        faces, uv = np.concatenate([faces, second[0]]), np.concatenate([uv, second[1]])
        material = np.concatenate([material, material[long]])
    return Surface(vertices, faces, uv, material)


def turn_outward(surface: Surface, rays: int = 24) -> Surface:
    """Flip faces whose back sees more of the open than their front: library models wind their faces either way."""
    caster = RayCaster(surface.vertices, surface.faces)
    normals = face_normals(surface)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    centres = surface.vertices[surface.faces].mean(1)
    open_front, open_back = np.zeros(len(normals)), np.zeros(len(normals))
    for direction in sphere(rays):
        side = np.sign(normals @ direction)
        origin = centres + 1e-4 * side[:, None] * normals
        free = ~caster.blocked(origin, np.broadcast_to(direction, origin.shape), np.inf)
        open_front += free & (side > 0)
        open_back += free & (side < 0)
    flip = open_back > open_front
    faces, uv = surface.faces.copy(), surface.uv.copy()
    faces[flip], uv[flip] = faces[flip][:, ::-1], uv[flip][:, ::-1]
    return Surface(surface.vertices, faces, uv, surface.material)


def corner_normals(surface: Surface, crease: float = 0.75) -> npt.NDArray[np.float64]:
    """Unit normals per corner (F, 3, 3): smooth over bends, flat where face and mean differ by more than acos(crease)."""
    area = face_normals(surface)
    flat = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-12)
    total = _vertex_sums(surface, area)
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    smooth = total[surface.faces]
    keep = (smooth * flat[:, None]).sum(-1, keepdims=True) > crease
    return np.where(keep, smooth, flat[:, None])


def _vertex_sums(surface: Surface, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """For each vertex the sum (V, 3) of what the faces around it have, values (F, 3)."""
    where, n = surface.faces.T.reshape(-1), len(surface.vertices)
    return np.stack([np.bincount(where, np.tile(values[:, k], 3), minlength=n) for k in range(3)], 1)


def sphere(n: int) -> npt.NDArray[np.float64]:
    """``n`` unit vectors (n, 3) spread evenly over the sphere (Fibonacci's spiral)."""
    k = np.arange(n) + 0.5
    y, phi = 1.0 - 2.0 * k / n, np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - y * y)
    return np.stack([r * np.cos(phi), y, r * np.sin(phi)], 1)
