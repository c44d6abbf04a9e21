"""Building blocks of furniture: boxes with broken edges, swept bars, lofts, prisms, cushions, and what moves and turns them.

Every block is a closed surface with outward normals; x right, y up, front along +z, m. Vertices lie at most ``STEP`` m apart
along flat faces, so that baked light can vary over them. Texture coordinates are metres over ``TILE``: a wood's grain runs
along u and keeps its scale on every board. Their materials are made by ``parametric.finishes``.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.moves import assembled as assembled
from openmap_scenes.homes.moves import both as both
from openmap_scenes.homes.moves import mirrored as mirrored
from openmap_scenes.homes.moves import moved as moved
from openmap_scenes.homes.moves import repeated as repeated
from openmap_scenes.homes.moves import scaled as scaled
from openmap_scenes.homes.moves import turned as turned
from openmap_scenes.homes.outlines import Floats, Triple
from openmap_scenes.homes.outlines import arc as arc
from openmap_scenes.homes.outlines import bent as bent
from openmap_scenes.homes.outlines import oval as oval
from openmap_scenes.homes.outlines import rounded_outline as rounded_outline
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.vectors import area_vectors, cross, doubled_areas, gradient, lengths
from openmap_scenes.scene import Material

STEP = 0.3
# What one repeat of a texture covers along u and v, m.
TILE = np.array([0.6, 0.3])

_AXES = {"x": 0, "y": 1, "z": 2}
_FAR = 1e9


def rounded_box(
    low: Triple,
    high: Triple,
    material: Material,
    bevel: float = 0.003,
    segments: int = 1,
    grain: str = "",
    step: float = STEP,
) -> Model:
    """A box whose edges are broken.

    Parameters
    ----------
    low, high : (float, float, float), m
    bevel : float
        How far from the edges the flat faces end, m; no more than half the thinnest side. 0 = sharp.
    segments : int
        0: sharp; 1: chamfered (44 triangles where nothing is split); 2 and more: rounded, that many to 45 degrees.
    grain : "x", "y", "z" or ""
        Where the texture's u runs; "" = along the longest side.
    """
    lo, hi = np.minimum(low, high).astype(np.float64), np.maximum(low, high).astype(np.float64)
    size = hi - lo
    bevel = min(bevel, 0.49 * float(size.min()))
    segments = segments if bevel > 1e-5 else 0
    bevel = bevel if segments else 0.0
    axis = _AXES[grain] if grain else int(size.argmax())
    split = np.maximum(1, np.ceil((size - 2 * bevel) / step - 1e-6)).astype(int)
    t, n, faces, at = _box_template(int(split[0]), int(split[1]), int(split[2]), segments, axis)
    offset = t * (size / 2 - bevel) + n * bevel
    vertices = (lo + hi) / 2 + offset
    uv = np.take_along_axis(offset, at, axis=1) / TILE + _shift(lo + hi)
    return _model(vertices, n, uv, faces, material)


@lru_cache(maxsize=1024)
def _box_template(
    nx: int, ny: int, nz: int, segments: int, grain: int
) -> tuple[Floats, Floats, npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """A box as vertex = t * (half size - bevel) + normal * bevel: t, normal (V, 3), faces (F, 3), axes of u and v (V, 2)."""
    t_all, n_all, f_all, at_all, start = [], [], [], [], 0
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        # A chamfer belongs to one of the faces that it joins: y has all of its own, z those to x.
        wide = [segments > 1 or (segments == 1 and (axis == 1 or (axis == 2 and k == 0))) for k in (a, b)]
        lines = [_lines((nx, ny, nz)[k], segments if w else 0) for k, w in zip((a, b), wide, strict=True)]
        (ta, sa), (tb, sb) = lines
        na, nb = len(ta), len(tb)
        index = np.arange(na * nb).reshape(na, nb)
        quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], -1).reshape(-1, 4)
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        if segments == 1 and all(wide):
            outer = [index[0, 0], index[-1, 0], index[-1, -1], index[0, -1]]
            corner = np.isin(quads, outer).any(1)
            keep = quads[~corner]
            cut = [[v for v in q if v not in outer] for q in quads[corner]]
            triangles = np.concatenate([keep[:, [0, 1, 2]], keep[:, [0, 2, 3]], np.array(cut)])
        for sign in (1.0, -1.0):
            t, n = np.empty((na * nb, 3)), np.empty((na * nb, 3))
            t[:, a], t[:, b], t[:, axis] = np.repeat(ta, nb), np.tile(tb, na), sign
            n[:, a], n[:, b], n[:, axis] = np.repeat(sa, nb), np.tile(sb, na), sign
            n /= np.linalg.norm(n, axis=1, keepdims=True)
            n[np.abs(n) < 1e-6] = 0.0
            faces = triangles if sign > 0 else triangles[:, ::-1]
            u = (grain + 1) % 3 if axis == grain else grain
            t_all.append(t)
            n_all.append(n)
            f_all.append(faces + start)
            at_all.append(np.tile([u, 3 - axis - u], (na * nb, 1)))
            start += na * nb
    faces = np.concatenate(f_all)
    used, packed = np.unique(faces, return_inverse=True)
    return (
        np.concatenate(t_all)[used],
        np.concatenate(n_all)[used],
        packed.reshape(-1, 3).astype(np.int32),
        np.concatenate(at_all)[used],
    )


def _lines(n: int, segments: int) -> tuple[Floats, Floats]:
    """Grid lines of a face along one axis: where (-1..1), and the tangent of the angle that the normal leans there."""
    flat = np.linspace(-1.0, 1.0, n + 1)
    lean = np.tan(np.linspace(0.0, np.pi / 4, segments + 1)[1:]) if segments != 1 else np.array([_FAR])
    lean = lean[:segments]
    where = np.concatenate([-np.ones(len(lean)), flat, np.ones(len(lean))])
    return where, np.concatenate([-lean[::-1], np.zeros(n + 1), lean])


def box(low: Triple, high: Triple, material: Material, grain: str = "", step: float = STEP) -> Model:
    """A box with sharp edges, for what is small, hidden or many."""
    return rounded_box(low, high, material, 0.0, 0, grain, step)


def cushion(
    low: Triple, high: Triple, material: Material, puff: float = 0.35, step: float = 0.17, segments: int = 2
) -> Model:
    """A stuffed box inside the given corners: rounded, and bulging along its thinnest side by ``puff`` of that thickness."""
    lo, hi = np.array(low, np.float64), np.array(high, np.float64)
    thin = int((hi - lo).argmin())
    thick = float(hi[thin] - lo[thin])
    rise = np.zeros(3)
    rise[thin] = puff * thick / 2
    a, b = lo + rise, hi - rise
    model = rounded_box(_triple(a), _triple(b), material, 0.42 * float(b[thin] - a[thin]), segments, step=step)
    away = (model.vertices - (lo + hi) / 2) / ((hi - lo) / 2)
    others = [k for k in range(3) if k != thin]
    dome = np.prod(1.0 - np.clip(np.abs(away[:, others]), 0, 1) ** 2.5, axis=1)
    vertices = model.vertices.astype(np.float64)
    vertices[:, thin] += np.sign(away[:, thin]) * rise[thin] * dome * (np.abs(away[:, thin]) > 0.05)
    return smoothed(replace(model, vertices=vertices.astype(np.float32)))


def rumpled(model: Model, rng: np.random.Generator, amount: float, wave: float = 0.3) -> Model:
    """Moved along the normals by up to ``amount`` m inwards, in folds about ``wave`` m long; seams stay closed."""
    k = rng.normal(0.0, 2 * np.pi / wave / 1.7, (5, 3))
    phase = rng.uniform(0, 2 * np.pi, 5)
    p = model.vertices.astype(np.float64)
    height = np.sin(p @ k.T + phase).mean(1) * 0.5 - 0.5
    # The same way for all vertices at one place, whatever side they belong to.
    return smoothed(replace(model, vertices=(p + amount * height[:, None] * _shared_normals(model)).astype(np.float32)))


def smoothed(model: Model, crease: float = 0.3) -> Model:
    """With normals found from the faces around each place, kept apart where they differ by more than acos(crease)."""
    shared = _shared_normals(model)
    own = _accumulated(model, np.arange(len(model.vertices)), len(model.vertices))
    soft = (shared * own).sum(1, keepdims=True) > crease
    return replace(model, normals=np.where(soft, shared, own).astype(np.float32))


def _shared_normals(model: Model) -> Floats:
    """Unit normals (V, 3) over all faces that touch the place of a vertex."""
    key = np.round(model.vertices.astype(np.float64) * 1e4).astype(np.int64)
    key -= key.min(0)
    code = (key[:, 0] * (key[:, 1].max() + 1) + key[:, 1]) * (key[:, 2].max() + 1) + key[:, 2]
    _, place = np.unique(code, return_inverse=True)
    place = place.reshape(-1)
    return _accumulated(model, place, int(place.max()) + 1)[place]


def _accumulated(model: Model, place: npt.NDArray[np.int64], count: int) -> Floats:
    """Unit normals (count, 3): the sum of the area vectors of the faces at each place."""
    area = area_vectors(model.vertices.astype(np.float64), model.faces)
    where = place[model.faces].T.reshape(-1)
    total: Floats = np.stack([np.bincount(where, np.tile(area[:, k], 3), minlength=count) for k in range(3)], 1)
    return np.asarray(total / np.maximum(lengths(total), 1e-12)[:, None])


def loft(
    rings: npt.ArrayLike, material: Material, sharp: Iterable[int] = (), step: float = STEP, flat: bool = True
) -> Model:
    """The skin over closed rings of points, from one end to the other.

    Parameters
    ----------
    rings : (R, N, 3) m
        N points around, R rings; the first and the last close the ends, as points or as flat discs.
    sharp : ints
        Rings at which the surface has an edge.
    flat : bool
        Level parts are textured from above and not around.
    """
    p = np.asarray(rings, np.float64)
    edges = set(sharp)
    if np.ptp(p[0], axis=0).max() > 1e-6:
        p, edges = np.concatenate([_centre(p[0]), p]), {0, *(s + 1 for s in edges)} - {0} | {1}
    if np.ptp(p[-1], axis=0).max() > 1e-6:
        p, edges = np.concatenate([p, _centre(p[-1])]), edges | {len(p) - 1}
    cuts = [0, *sorted(edges - {0, len(p) - 1}), len(p) - 1]
    parts = [_band(_refined(p[a : b + 1], step), material, flat) for a, b in itertools.pairwise(cuts)]
    return _facing_out(merge(parts))


def _centre(ring: Floats) -> Floats:
    return np.broadcast_to(ring.mean(0), ring.shape)[None].copy()


def _refined(p: Floats, step: float) -> Floats:
    """More rings where two are further apart than ``step`` m."""
    out = [p[:1]]
    for a, b in itertools.pairwise(p):
        n = max(1, int(np.ceil(lengths(b - a).max() / step - 1e-6)))
        t = (np.arange(1, n + 1) / n)[:, None, None]
        out.append(a + t * (b - a))
    return np.concatenate(out)


def _band(p: Floats, material: Material, flat: bool) -> Model:
    """A smooth strip of rings (R, N, 3), its seam doubled for the texture."""
    rings, n = p.shape[:2]
    q = np.concatenate([p, p[:, :1]], 1)
    around = np.concatenate([p[:, 1:], p[:, :1]], 1) - np.concatenate([p[:, -1:], p[:, :-1]], 1)
    along = gradient(p)
    normal = cross(along, around)
    # At a tip there is no way around: its neighbours' way does.
    for end, inner in ((0, 1), (-1, -2)):
        if lengths(around[end]).max() < 1e-9:
            normal[end] = cross(p[inner] - p[end], around[inner]) * (1 if end == 0 else -1)
            normal[end] = normal[end].mean(0)
    normal = normal / np.maximum(lengths(normal), 1e-15)[..., None]
    normal = np.concatenate([normal, normal[:, :1]], 1)
    if flat and np.abs(normal[..., 1]).mean() > 0.85:
        uv = q[..., [0, 2]] / TILE
    else:
        u = np.concatenate([[0.0], np.cumsum(lengths(p[1:] - p[:-1]).mean(1))])
        girth = lengths(q[:, 1:] - q[:, :-1]).max(0)
        v = np.concatenate([[0.0], np.cumsum(girth)])
        uv = np.stack(np.broadcast_arrays(u[:, None], v[None]), -1) / TILE
    faces = _band_faces(rings, n)
    flatq = q.reshape(-1, 3)
    faces = faces[doubled_areas(flatq, faces) > 1e-12]
    return _model(flatq, normal.reshape(-1, 3), uv.reshape(-1, 2) + _shift(p[0, 0]), faces, material)


@lru_cache(maxsize=512)
def _band_faces(rings: int, n: int) -> npt.NDArray[np.int64]:
    """Triangles of a strip of rings of n + 1 vertices."""
    i = np.arange((rings - 1) * (n + 1)).reshape(rings - 1, n + 1)[:, :-1].reshape(-1)
    return np.concatenate([np.stack([i, i + n + 1, i + 1], 1), np.stack([i + 1, i + n + 1, i + n + 2], 1)])


def _facing_out(model: Model) -> Model:
    """Faces turned so that they hold a positive volume, normals turned to their faces."""
    if signed_volume(model) < 0:
        model = replace(model, faces=np.ascontiguousarray(model.faces[:, ::-1]))
    own = _accumulated(model, np.arange(len(model.vertices)), len(model.vertices))
    against = (own * model.normals).sum(1) < 0
    return replace(model, normals=np.where(against[:, None], -model.normals, model.normals))


def signed_volume(model: Model) -> float:
    """Volume that the faces hold, m3; negative where they look inwards."""
    a, b, c = (model.vertices[model.faces[:, k]].astype(np.float64) for k in range(3))
    return float((a * cross(b, c)).sum() / 6.0)


def sweep(
    path: npt.ArrayLike, section: npt.ArrayLike, material: Material, up: Triple = (0.0, 1.0, 0.0), step: float = STEP
) -> Model:
    """A bar along a path.

    Parameters
    ----------
    path : (P, 3) m
    section : (N, 2) or (P, N, 2) m
        Outline across the path, (sideways, along ``up``), one for all or one for each point.
    up : (float, float, float)
        What the section's second axis looks along at the start; it is carried on without twist.
    """
    p, s = np.asarray(path, np.float64), np.asarray(section, np.float64)
    s = np.broadcast_to(s, (len(p), *s.shape[-2:]))
    way = gradient(p)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12)
    v = np.array(up, np.float64)
    rings = []
    for k in range(len(p)):
        v = v - way[k] * (v @ way[k])
        if np.linalg.norm(v) < 1e-6:
            v = np.roll(way[k], 1) - way[k] * float(np.roll(way[k], 1) @ way[k])
        v = v / np.linalg.norm(v)
        rings.append(p[k] + s[k][:, :1] * cross(v, way[k]) + s[k][:, 1:] * v)
    return loft(np.array(rings), material, {0, len(p) - 1} - {0}, step, flat=False)


def tube(path: npt.ArrayLike, radius: npt.ArrayLike, material: Material, sides: int = 8, step: float = STEP) -> Model:
    """A round bar along a path (P, 3) m, of one radius or one for each point, m."""
    phi = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    r = np.broadcast_to(np.asarray(radius, np.float64), (len(np.asarray(path)),))
    section = r[:, None, None] * np.stack([np.cos(phi), np.sin(phi)], 1)
    return sweep(path, section, material, step=step)


def leg(
    top: Triple,
    foot: Triple,
    radius: float,
    material: Material,
    taper: float = 0.6,
    sides: int = 10,
    square: bool = False,
) -> Model:
    """A straight leg from its foot to its top, ``taper`` times as thick at the foot; cut level at both ends."""
    a, b = np.array(foot, np.float64), np.array(top, np.float64)
    outline = rounded_outline(radius, radius, radius * 0.35, 2) if square else oval(radius, radius, sides)
    rings = [
        np.insert(outline * s, 1, 0.0, axis=1) + p for s, p in ((taper, a), ((taper + 1) / 2, (a + b) / 2), (1.0, b))
    ]
    return loft(rings, material, flat=False)


def cylinder(
    radius: float,
    low: float,
    high: float,
    material: Material,
    bevel: float = 0.003,
    sides: int = 24,
    at: tuple[float, float] = (0.0, 0.0),
) -> Model:
    """An upright cylinder from y = low to high around ``at`` (x, z), m."""
    return prism(oval(radius, radius, sides) + np.array(at), low, high, material, bevel)


def lathe(
    profile: Sequence[tuple[float, float]], material: Material, sharp: Iterable[int] = (), sides: int = 24
) -> Model:
    """A turned thing: (radius, y) m from one end to the other, about the y axis; a radius of 0 closes an end in a point."""
    circle = oval(1.0, 1.0, sides)
    rings = [np.insert(circle * r, 1, y, axis=1) for r, y in profile]
    return loft(np.array(rings), material, sharp)


def prism(
    outline: npt.ArrayLike, low: float, high: float, material: Material, bevel: float = 0.003, step: float = STEP
) -> Model:
    """An outline (N, 2) of (x, z) m that all of its middle sees, raised from y = low to high, its edges broken."""
    o = np.asarray(outline, np.float64)
    middle = o.mean(0)
    reach = float(np.linalg.norm(o - middle, axis=1).min())
    bevel = min(bevel, 0.3 * reach, 0.45 * (high - low))
    small = middle + (o - middle) * (1.0 - bevel / reach)
    rings = [(small, low), (o, low + bevel), (o, high - bevel), (small, high)]
    return loft(np.array([np.insert(r, 1, y, axis=1) for r, y in rings]), material, step=step)


def _shift(place: Floats) -> Floats:
    """A texture offset that differs from part to part, the same in every process."""
    return np.round(np.array([place @ [1.37, 3.1, 2.3], place @ [2.9, 1.7, 4.1]]) % 1.0, 3)


def _triple(p: Floats) -> Triple:
    return float(p[0]), float(p[1]), float(p[2])


def _model(vertices: Floats, normals: Floats, uv: Floats, faces: npt.NDArray[np.integer], material: Material) -> Model:
    if material.texture is None:
        uv = np.zeros((len(vertices), 2))
    return Model(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        uv.astype(np.float32),
        faces.astype(np.int32),
        np.zeros(len(faces), np.int32),
        [material],
    )
