"""Things made here and not taken from the library: boxes, panels, framed pictures, mirrors, rugs, books."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes import textures
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.vectors import cross
from openmap_scenes.scene import Material

# Corners of the unit square of each face of a box: (normal axis, sign, u axis, u sign, v axis); v points down in uv.
_FACES = ((2, 1, 0, 1, 1), (2, -1, 0, -1, 1), (0, 1, 2, -1, 1), (0, -1, 2, 1, 1), (1, 1, 0, 1, 2), (1, -1, 0, 1, 2))


def material(name: str, colour: tuple[float, float, float], texture: npt.NDArray[np.uint8] | None = None) -> Material:
    """A material of that sRGB colour, multiplied with the texture."""
    return Material(name, np.array(colour, np.float32), texture)


def box(
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    materials: Material | dict[int, Material],
    step: float = 0.4,
) -> Model:
    """An axis-aligned box, every face once over its texture.

    Parameters
    ----------
    low, high : (float, float, float), m
    materials : Material or dict
        One for all, or by face: 0 front (+z), 1 back, 2 right (+x), 3 left, 4 top, 5 bottom; a face without one is left out.
    step : float
        Largest edge of the triangles, m.
    """
    by_face = dict.fromkeys(range(6), materials) if isinstance(materials, Material) else materials
    lo, hi = np.array(low), np.array(high)
    parts = []
    for k, face_material in by_face.items():
        axis, sign, u_axis, u_sign, v_axis = _FACES[k]
        origin = lo.copy()
        origin[axis] = hi[axis] if sign > 0 else lo[axis]
        u, v = np.zeros(3), np.zeros(3)
        u[u_axis], v[v_axis] = hi[u_axis] - lo[u_axis], hi[v_axis] - lo[v_axis]
        if u_sign < 0:
            origin, u = origin + u, -u
        if v_axis == 2:
            # Seen from above the top of the picture lies at -z.
            origin, v = origin + v, -v
        normal = np.zeros(3)
        normal[axis] = sign
        parts.append(panel(origin, u, v, normal, face_material, step))
    return merge(parts)


def panel(
    origin: npt.NDArray[np.float64],
    u: npt.NDArray[np.float64],
    v: npt.NDArray[np.float64],
    normal: npt.NDArray[np.float64],
    face_material: Material,
    step: float,
) -> Model:
    """A rectangle from ``origin`` (its lower left corner, m) along u and v, its texture once over it, split to ``step`` m."""
    nu, nv = (max(1, math.ceil(math.sqrt(float(e @ e)) / step - 1e-6)) for e in (u, v))
    s, t = _square(nu, nv)
    vertices = origin + s[:, None] * u + t[:, None] * v
    faces = grid_faces(nu, nv)
    if float(cross(u, v) @ normal) < 0:
        faces = faces[:, ::-1]
    return Model(
        vertices.astype(np.float32),
        np.broadcast_to(normal, vertices.shape).astype(np.float32),
        np.stack([s, 1.0 - t], 1).astype(np.float32),
        faces,
        np.zeros(len(faces), np.int32),
        [face_material],
    )


@lru_cache(maxsize=2048)
def _square(nu: int, nv: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """u and v, 0..1, of the vertices of a grid."""
    s, t = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1))
    return s.reshape(-1), t.reshape(-1)


def grid_faces(nu: int, nv: int) -> npt.NDArray[np.int32]:
    """Triangles of an (nv + 1) x (nu + 1) grid of vertices, row by row; counter-clockwise for v to the left of u."""
    return _grid_faces(int(nu), int(nv))


@lru_cache(maxsize=2048)
def _grid_faces(nu: int, nv: int) -> npt.NDArray[np.int32]:
    i = (np.arange(nv)[:, None] * (nu + 1) + np.arange(nu)).reshape(-1)
    a, b, c, d = i, i + 1, i + nu + 2, i + nu + 1
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    faces.flags.writeable = False
    return faces


def merge(models: list[Model]) -> Model:
    """Several models in one frame as one; equal materials (the same object) are kept once."""
    materials: list[Material] = []
    index: dict[int, int] = {}
    face_material = []
    for model in models:
        for m in model.materials:
            if id(m) not in index:
                index[id(m)] = len(materials)
                materials.append(m)
        face_material.append(np.array([index[id(m)] for m in model.materials], np.int32)[model.face_material])
    if len(models) == 1:
        return models[0]
    offsets = list(itertools.accumulate((len(m.vertices) for m in models[:-1]), initial=0))
    return Model(
        np.concatenate([m.vertices for m in models]),
        np.concatenate([m.normals for m in models]),
        np.concatenate([m.uv for m in models]),
        np.concatenate([m.faces + o for m, o in zip(models, offsets, strict=True)]).astype(np.int32),
        np.concatenate(face_material),
        materials,
    )


def picture(rng: np.random.Generator) -> Model:
    """A framed picture, 0.35-0.9 m, hanging with its back at z = -depth / 2."""
    w, h = float(rng.uniform(0.4, 0.9)), float(rng.uniform(0.35, 0.7))
    frame = material(
        "frame", tuple(rng.choice([(0.12, 0.10, 0.09), (0.55, 0.38, 0.22), (0.92, 0.91, 0.88), (0.7, 0.58, 0.3)]))
    )
    canvas = material("canvas", (1.0, 1.0, 1.0), textures.painting(rng))
    return _framed(w, h, 0.03, 0.035, frame, canvas)


def mirror(rng: np.random.Generator, width: float) -> Model:
    """A mirror as scans show it: a pale, slightly uneven surface in a thin frame."""
    frame = material("frame", tuple(rng.choice([(0.75, 0.76, 0.78), (0.15, 0.14, 0.14), (0.6, 0.45, 0.3)])))
    v, u = np.mgrid[0:64, 0:64] / 64.0
    glow = np.clip(0.72 + 0.15 * (u - v) + 0.08 * np.sin(6 * (u + v)), 0, 1)[..., None] * np.array([0.93, 0.98, 1.0])
    glass = material("mirror", (1.0, 1.0, 1.0), np.round(glow * 255).astype(np.uint8))
    return _framed(width, float(rng.uniform(0.6, 0.85)), 0.025, 0.02, frame, glass)


def _framed(w: float, h: float, depth: float, border: float, frame: Material, inside: Material) -> Model:
    z = depth / 2
    bars = [
        box((-w / 2, 0.0, -z), (w / 2, border, z), frame),
        box((-w / 2, h - border, -z), (w / 2, h, z), frame),
        box((-w / 2, border, -z), (-w / 2 + border, h - border, z), frame),
        box((w / 2 - border, border, -z), (w / 2, h - border, z), frame),
    ]
    sheet = box((-w / 2 + border, border, -z), (w / 2 - border, h - border, z - 0.01), {0: inside})
    return merge([*bars, sheet])


def rug(rng: np.random.Generator, width: float, depth: float) -> Model:
    """A rug 6 mm thick."""
    top = material("rug", (1.0, 1.0, 1.0), textures.rug(rng))
    edge = material("rug edge", (0.4, 0.36, 0.32))
    sides = {0: edge, 1: edge, 2: edge, 3: edge, 4: top}
    return box((-width / 2, 0.0, -depth / 2), (width / 2, 0.006, depth / 2), sides, step=0.2)


def books(rng: np.random.Generator) -> Model:
    """A pile of two to five books."""
    parts, y = [], 0.0
    for _ in range(int(rng.integers(2, 6))):
        w, d, t = float(rng.uniform(0.14, 0.2)), float(rng.uniform(0.2, 0.27)), float(rng.uniform(0.015, 0.04))
        cover = material("cover", tuple(textures.pick(rng, textures.ACCENTS)))
        pages = material("pages", (0.93, 0.90, 0.83))
        parts.append(
            box((-w / 2, y, -d / 2), (w / 2, y + t, d / 2), {0: pages, 1: pages, 2: pages, 3: cover, 4: cover})
        )
        y += t
    return merge(parts)


def cushion(rng: np.random.Generator) -> Model:
    """A square cushion lying flat, 0.4 m, bulging in the middle."""
    n, half, height = 8, 0.2, 0.13
    s = np.linspace(-1, 1, n + 1)
    u, v = (g.reshape(-1) for g in np.meshgrid(s, s))
    bulge = height / 2 * ((1 - u**4) * (1 - v**4)) ** 0.5
    cloth = material("cloth", tuple(textures.pick(rng, textures.ACCENTS)))
    parts = []
    for sign in (1.0, -1.0):
        vertices = np.stack([half * u, height / 2 + sign * bulge, -half * v], 1)
        normals = np.stack([u**3, sign * np.ones_like(u), -(v**3)], 1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        faces = grid_faces(n, n) if sign > 0 else grid_faces(n, n)[:, ::-1]
        uv = np.zeros((len(u), 2), np.float32)
        parts.append(
            Model(
                vertices.astype(np.float32),
                normals.astype(np.float32),
                uv,
                faces,
                np.zeros(len(faces), np.int32),
                [cloth],
            )
        )
    return merge(parts)


def ceiling_lamp(rng: np.random.Generator) -> Model:
    """A round white shade, 0.35-0.5 m across, whose flat top touches the ceiling."""
    radius, height, n = float(rng.uniform(0.17, 0.25)), 0.09, 24
    phi = np.linspace(0, 2 * np.pi, n + 1)
    rings = [(1.0, height), (0.95, 0.03), (0.7, 0.005), (0.0, 0.0)]
    vertices = np.concatenate(
        [np.stack([r * radius * np.cos(phi), np.full(n + 1, y), r * radius * np.sin(phi)], 1) for r, y in rings]
    )
    normals = vertices - np.array([0.0, height + 0.1, 0.0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shade = material("shade", (1.0, 0.98, 0.93))
    faces = grid_faces(n, len(rings) - 1)
    uv = np.zeros((len(vertices), 2), np.float32)
    return Model(
        vertices.astype(np.float32), normals.astype(np.float32), uv, faces, np.zeros(len(faces), np.int32), [shade]
    )
