"""Round, bent and soft shapes: surfaces of revolution, tubes, ellipsoids, pillows' boxes, cloth and leaves.

All give ``Model``s with smooth outward normals and texture coordinates, in the frame of their arguments: m, y up.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.primitives import grid_faces, merge
from openmap_scenes.homes.vectors import cross, doubled_areas, gradient, lengths
from openmap_scenes.scene import Material

Array = npt.NDArray[np.float64]
CREASE = 0.8
"""Cosine of the bend at which a profile becomes an edge."""


def grid(points: Array, material: Material, uv: Array | None = None) -> Model:
    """A surface through a grid of points (nv + 1, nu + 1, 3), its normal along d/du x d/dv, smooth across closed sides.

    ``uv`` (nv + 1, nu + 1, 2) is 0..1 along u and 1..0 along v where None. Triangles without area (at poles) are left out.
    """
    nv, nu = points.shape[0] - 1, points.shape[1] - 1
    normal = cross(_slope(points, 1), _slope(points, 0))
    length = lengths(normal)
    poles = length < 1e-6 * max(float(length.max()), 1e-12)
    for row, inner in ((0, 1), (-1, -2)):
        if poles[row].all():
            normal[row] = normal[inner, :-1].mean(0)
    # Single corners where the surface has no width look where their row looks.
    lone = lengths(normal) < 1e-12
    if lone.any():
        normal[lone] = np.broadcast_to(normal.sum(1, keepdims=True), normal.shape)[lone]
    normal /= np.maximum(lengths(normal), 1e-15)[..., None]
    if uv is None:
        uv = np.empty((nv + 1, nu + 1, 2))
        uv[..., 0], uv[..., 1] = np.linspace(0, 1, nu + 1), np.linspace(1, 0, nv + 1)[:, None]
    faces, flat = grid_faces(nu, nv), points.reshape(-1, 3)
    faces = faces[doubled_areas(flat, faces) > 1e-13]
    return _model(points, normal, uv, faces, material)


def _model(points: Array, normals: Array, uv: Array, faces: npt.NDArray[np.int32], material: Material) -> Model:
    return Model(
        points.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        uv.reshape(-1, 2).astype(np.float32),
        faces,
        np.zeros(len(faces), np.int32),
        [material],
    )


def _slope(points: Array, axis: int) -> Array:
    """Differences along a side of the grid, across the seam where it is closed."""
    p = points.swapaxes(0, axis)
    if len(p) > 2 and float(np.abs(p[0] - p[-1]).max()) < 1e-9:
        d = np.empty_like(p)
        d[1:-2], d[-2], d[0] = p[2:-1] - p[:-3], p[0] - p[-3], p[1] - p[-2]
        d[-1] = d[0]
    else:
        d = gradient(p)
    return d.swapaxes(0, axis)


def lathe(
    profile: Sequence[tuple[float, float]] | Array, material: Material, sides: int = 20, repeat: float = 1.0
) -> Model:
    """The surface that a profile [(radius, y), ...] sweeps about the y axis; creases where it bends sharply.

    The outside is to the right of the profile: upwards on the outer wall, downwards inside a cup. Texture: u around
    (``repeat`` times), v along the profile from its end (0) to its start (1).
    """
    p = np.asarray(profile, np.float64)
    p = p[np.concatenate([[True], np.linalg.norm(np.diff(p, axis=0), axis=1) > 1e-7])]
    d = np.diff(p, axis=0)
    step = np.linalg.norm(d, axis=1)
    direction = d / step[:, None]
    along = 1.0 - np.concatenate([[0.0], np.cumsum(step)]) / step.sum()
    cuts = [0, *(np.flatnonzero((direction[1:] * direction[:-1]).sum(1) < CREASE) + 1).tolist(), len(p) - 1]
    phi = np.linspace(0, 2 * np.pi, sides + 1)
    phi[-1] = 0.0
    u = np.linspace(0, repeat, sides + 1)
    parts = []
    for first, last in itertools.pairwise(cuts):
        q, own = p[first : last + 1], direction[first:last]
        tangent = np.concatenate([own[:1], own[1:] + own[:-1], own[-1:]])
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        parts.append(_ring_band(q, tangent, along[first : last + 1], phi, u, material))
    return merge(parts)


def _ring_band(q: Array, tangent: Array, along: Array, phi: Array, u: Array, material: Material) -> Model:
    cos, sin = np.cos(phi), -np.sin(phi)
    points = np.stack([q[:, :1] * cos, np.broadcast_to(q[:, 1:], (len(q), len(phi))), q[:, :1] * sin], 2)
    nr, ny = tangent[:, 1:], -tangent[:, :1]
    normals = np.stack([nr * cos, np.broadcast_to(ny, points.shape[:2]), nr * sin], 2)
    uv = np.stack(np.broadcast_arrays(u[None], along[:, None]), 2)
    faces = grid_faces(len(phi) - 1, len(q) - 1)
    flat = points.reshape(-1, 3)
    faces = faces[doubled_areas(flat, faces) > 1e-13]
    return _model(points, normals, uv, faces, material)


def vessel(
    outline: Sequence[tuple[float, float]] | Array, wall: float, outside: Material, inside: Material, sides: int = 20
) -> Model:
    """An open vessel: the outline [(radius, y), ...] of its outer wall from the foot's edge to the rim, ``wall`` m thick."""
    outer = np.asarray(outline, np.float64)
    floor = float(outer[0, 1]) + wall
    inner = outer[::-1] - [wall, 0.0]
    inner = inner[(inner[:, 0] > wall * 0.5) & (inner[:, 1] > floor)]
    # The inner wall follows the outer one down to the floor, however few points the outline has.
    above = int(np.argmax(outer[:, 1] > floor))
    (r0, y0), (r1, y1) = outer[max(above - 1, 0)], outer[above]
    r = max(float(r0 + (r1 - r0) * (floor - y0) / max(y1 - y0, 1e-9)) - wall, wall * 0.5)
    return merge(
        [
            lathe(np.concatenate([[[0.0, outer[0, 1]]], outer]), outside, sides),
            lathe(np.concatenate([outer[-1:], inner, [[r, floor], [0.0, floor]]]), inside, sides),
        ]
    )


def spline(points: npt.ArrayLike, count: int) -> Array:
    """``count`` points on the smooth curve (Catmull-Rom) through points (K, D), its ends included."""
    p = np.asarray(points, np.float64)
    padded = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.linspace(0, len(p) - 1, count)
    k = np.minimum(t.astype(int), len(p) - 2)
    s = (t - k)[:, None]
    a, b, c, d = (padded[k + i] for i in range(4))
    return np.asarray(0.5 * (2 * b + (c - a) * s + (2 * a - 5 * b + 4 * c - d) * s**2 + (3 * b - a - 3 * c + d) * s**3))


def tube(
    path: npt.ArrayLike,
    radius: npt.ArrayLike,
    material: Material,
    sides: int = 8,
    closed: bool = False,
    length: float = 1.0,
) -> Model:
    """A round bar along a path (K, 3) with flat ends, or a ring where ``closed``; texture v runs ``length`` times along it."""
    p = np.asarray(path, np.float64)
    r = np.broadcast_to(np.asarray(radius, np.float64), (len(p),))
    if closed:
        p, r = np.concatenate([p, p[:1]]), np.concatenate([r, r[:1]])
    normal, binormal = _frames(p, closed)
    phi = np.linspace(0, 2 * np.pi, sides + 1)
    phi[-1] = 0.0
    ring = np.cos(phi)[None, :, None] * normal[:, None] + np.sin(phi)[None, :, None] * binormal[:, None]
    points = p[:, None] + r[:, None, None] * ring
    s, t = np.meshgrid(np.linspace(0, 1, sides + 1), np.linspace(length, 0, len(p)))
    parts = [grid(points, material, np.stack([s, t], 2))]
    if not closed:
        for k, outer in ((0, False), (-1, True)):
            if r[k] > 1e-5:
                rows = np.stack([points[k], np.broadcast_to(p[k], points[k].shape)])
                parts.append(grid(rows if outer else rows[::-1], material))
    return merge(parts)


def _frames(p: Array, closed: bool) -> tuple[Array, Array]:
    """Two unit vectors (K, 3) each across a path, turning as little as they can (parallel transport)."""
    tangent = _slope(p[:, None], 0)[:, 0]
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    start = np.eye(3)[int(np.abs(tangent[0]).argmin())]
    normal = np.empty_like(p)
    current = start
    for k in range(len(p)):
        current = current - (current @ tangent[k]) * tangent[k]
        current = current / max(float(np.linalg.norm(current)), 1e-12)
        normal[k] = current
    if closed:
        normal[-1] = normal[0]
    return normal, cross(tangent, normal)


def ellipsoid(
    centre: Sequence[float],
    radii: Sequence[float],
    material: Material,
    sides: int = 14,
    rings: int = 8,
    round_up: float = 1.0,
    round_across: float = 1.0,
) -> Model:
    """An ellipsoid; exponents below 1 make it boxy (superellipsoid), seen from the side (``round_up``) or from above."""
    phi, theta = np.linspace(0, 2 * np.pi, sides + 1), np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    phi[-1] = 0.0
    across, up = _power(np.cos(theta), round_up), _power(np.sin(theta), round_up)
    across[[0, -1]] = 0.0
    x = across[:, None] * _power(np.cos(phi), round_across)
    z = -across[:, None] * _power(np.sin(phi), round_across)
    y = np.broadcast_to(up[:, None], x.shape)
    return grid(np.stack([x, y, z], 2) * np.asarray(radii, np.float64) + np.asarray(centre, np.float64), material)


def _power(value: Array, exponent: float) -> Array:
    return np.asarray(np.sign(value) * np.abs(value) ** exponent)


def soft_box(
    low: Sequence[float],
    high: Sequence[float],
    materials: Material | dict[int, Material],
    radius: float = 0.01,
    bevels: int = 1,
    step: float = 0.3,
    puff: float = 0.0,
) -> Model:
    """A box with rounded edges, ``bevels`` facets each; ``puff`` m is how far its faces bulge in the middle.

    Materials as in ``primitives.box``: one, or by face 0 front (+z), 1 back, 2 right, 3 left, 4 top, 5 bottom. Each face has
    its texture once over it.
    """
    lo, hi = np.asarray(low, np.float64), np.asarray(high, np.float64)
    half = (hi - lo) / 2
    r = min(radius, float(half.min()) * 0.98)
    by_face = dict.fromkeys(range(6), materials) if isinstance(materials, Material) else materials
    lines = [_cuts(h, r, bevels, step) for h in half]
    parts = []
    for k, (axis, sign, u_axis, u_sign, v_axis, v_sign) in enumerate(_SIDES):
        if k not in by_face:
            continue
        u, v = np.meshgrid(u_sign * lines[u_axis], v_sign * lines[v_axis])
        p = np.empty((*u.shape, 3))
        p[..., axis], p[..., u_axis], p[..., v_axis] = sign * half[axis], u, v
        core = np.clip(p, -half + r, half - r)
        out = p - core
        normal = out / lengths(out)[..., None]
        points = core + r * normal + (lo + hi) / 2
        uv = np.stack([0.5 + u_sign * u / (2 * half[u_axis]), 0.5 - v_sign * v / (2 * half[v_axis])], 2)
        if puff > 0.0:
            swell = (1 - (u / half[u_axis]) ** 2) * (1 - (v / half[v_axis]) ** 2)
            parts.append(grid(points + puff * swell[..., None] * normal, by_face[k], uv))
        else:
            faces = grid_faces(u.shape[1] - 1, u.shape[0] - 1)
            parts.append(_model(points, normal, uv, faces, by_face[k]))
    return merge(parts)


# (normal axis, sign, u axis, u sign, v axis, v sign) with u x v = normal; seen from outside the texture stands upright.
_SIDES = (
    (2, 1, 0, 1, 1, 1), (2, -1, 0, -1, 1, 1), (0, 1, 2, -1, 1, 1), (0, -1, 2, 1, 1, 1), (1, 1, 0, 1, 2, -1), (1, -1, 0, 1, 2, 1),
)  # fmt: skip


def _cuts(half: float, r: float, bevels: int, step: float) -> Array:
    edge = half - r + r * np.tan(np.linspace(0, np.pi / 4, bevels + 1))
    n = max(1, int(np.ceil(2 * (half - r) / step)))
    return np.unique(np.round(np.concatenate([-edge, np.linspace(-half + r, half - r, n + 1), edge]), 9))


def sheet(
    points: Array, thickness: float, front: Material, back: Material | None = None, uv: Array | None = None
) -> Model:
    """Cloth or paper along a grid of points (nv + 1, nu + 1, 3), ``thickness`` m thick with the grid in its middle."""
    top = grid(points, front, uv)
    n = top.normals.reshape(points.shape).astype(np.float64) * (thickness / 2)
    above, below = points + n, points - n
    parts = [grid(above, front, uv), grid(below[:, ::-1], back or front, None if uv is None else uv[:, ::-1])]
    closed_u = np.allclose(points[:, 0], points[:, -1], atol=1e-9)
    borders = [(above[0], below[0]), (above[-1, ::-1], below[-1, ::-1])]
    if not closed_u:
        borders += [(above[:, -1], below[:, -1]), (above[::-1, 0], below[::-1, 0])]
    parts += [grid(np.stack([b, a]), front) for a, b in borders]
    return merge(parts)


def leaf(
    spine: Array,
    width: Sequence[float] | Array,
    material: Material,
    up: Sequence[float] = (0.0, 1.0, 0.0),
    fold: float = 0.2,
) -> Model:
    """A blade along a spine (K, 3), ``width`` (K,) m wide, its halves raised by ``fold`` times their width; both sides.

    Its two sides share their edge and part in the middle by a millimetre, so that the surface is closed.
    """
    w = np.asarray(width, np.float64)[:, None] / 2
    tangent = gradient(spine)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    side = cross(tangent, np.asarray(up, np.float64))
    short = np.linalg.norm(side, axis=1) < 0.05
    side[short] = cross(tangent[short], np.array([0.3, 0.1, 0.95]))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    over = cross(side, tangent)
    left, right = spine - w * side + fold * w * over, spine + w * side + fold * w * over
    # Rows go across the blade: u from left to right, v along the spine.
    thick = np.minimum(0.0006, 0.1 * w) * over
    front = np.stack([left, spine + thick, right], 1)
    rear = np.stack([right, spine - thick, left], 1)
    return merge([grid(front, material), grid(rear, material)])


def turn(axis: int, angle: float) -> Array:
    """Rotation (3, 3) about x (0), y (1) or z (2) by an angle in radians, counter-clockwise seen from the axis' tip."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = c
    R[i, j], R[j, i] = -s, s
    return R


def placed(
    model: Model,
    offset: Sequence[float] | Array = (0.0, 0.0, 0.0),
    rotation: Array | None = None,
    scale: float | Sequence[float] = 1.0,
) -> Model:
    """A model scaled along its axes, then rotated (3, 3), then moved by an offset (3,) m."""
    s = np.broadcast_to(np.asarray(scale, np.float64), (3,))
    R = np.eye(3) if rotation is None else rotation
    vertices = (model.vertices * s) @ R.T + np.asarray(offset, np.float64)
    normals = (model.normals / s) @ R.T
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Model(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        model.uv,
        model.faces,
        model.face_material,
        model.materials,
    )


def copies(model: Model, offsets: Array, rotations: Array, scales: Array | float = 1.0) -> Model:
    """A model at many places: offsets (M, 3) m, rotations (M, 3, 3), scales (M,)."""
    m, v = len(offsets), len(model.vertices)
    s = np.broadcast_to(np.asarray(scales, np.float64), (m,))[:, None, None]
    vertices = np.einsum("mij,vj->mvi", rotations, model.vertices.astype(np.float64)) * s + offsets[:, None]
    normals = np.einsum("mij,vj->mvi", rotations, model.normals.astype(np.float64))
    faces = model.faces[None] + (np.arange(m) * v)[:, None, None]
    return Model(
        vertices.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        np.tile(model.uv, (m, 1)),
        faces.reshape(-1, 3).astype(np.int32),
        np.tile(model.face_material, m),
        model.materials,
    )
