"""The house itself: floors, walls, ceilings, door frames and windows of a plan, as named pieces of mesh in the world frame."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes import textures
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.plan import CEILING, WALL, Opening, Plan, Rect, Side
from openmap_scenes.homes.primitives import box, material, merge
from openmap_scenes.scene import Material

STEP = 0.25
BASEBOARD = 0.08
WET = ("bathroom", "kitchen")


@dataclass(frozen=True)
class Piece:
    """Part of the building: a mesh in the world frame, what it is and in which room."""

    kind: str
    room: int
    mesh: Model
    attributes: dict[str, str]


@dataclass(frozen=True)
class _Finish:
    """What the surfaces of one room are made of; texture repeats in metres."""

    floor: Material
    floor_scale: float
    floor_word: str
    wall: Material
    tile: Material
    tile_height: float
    baseboard: Material
    ceiling: Material


def build_shell(plan: Plan, rng: np.random.Generator) -> list[Piece]:
    """Everything of a plan but the furniture."""
    wood = material("wood floor", (1, 1, 1), textures.wood_planks(rng))
    trim = material("trim", (0.94, 0.93, 0.91) if rng.random() < 0.7 else (0.50, 0.36, 0.24))
    pieces = []
    for room, name in enumerate(plan.names):
        finish = _finish(name, wood, trim, rng)
        inner = plan.inner(room)
        pieces.append(Piece("floor", room, _floor(plan, room, finish), {"material": finish.floor_word}))
        pieces.append(Piece("ceiling", room, _horizontal(inner, CEILING, -1.0, finish.ceiling, 2.0, STEP * 2), {}))
        for side in plan.sides(room):
            pieces.append(Piece("wall", room, _wall(plan, side, finish), {}))
    for opening in plan.openings:
        build = _window if opening.kind == "window" else _door
        pieces += build(plan, opening, trim, rng)
    return pieces


def _finish(name: str, wood: Material, trim: Material, rng: np.random.Generator) -> _Finish:
    white = material("white paint", (0.96, 0.96, 0.95))
    choice = rng.random()
    if name in WET or (name == "hall" and choice < 0.4):
        floor, scale, word = material("floor tiles", (1, 1, 1), textures.tiles(rng)), 1.6, "tile"
    elif name in ("bedroom", "office") and choice < 0.4:
        floor, scale, word = material("carpet", (1, 1, 1), textures.carpet(rng)), 1.5, "carpet"
    else:
        floor, scale, word = wood, 1.3, "wood"
    paint = textures.wallpaper(rng) if choice > 0.75 and name not in WET else textures.plaster(rng)
    height = {"bathroom": 2.0, "kitchen": 0.0}.get(name, 0.0)
    tile = material("wall tiles", (1, 1, 1), textures.tiles(rng, count=6))
    return _Finish(floor, scale, word, material("wall", (1, 1, 1), paint), tile, height, trim, white)


def _grid(
    u: npt.NDArray[np.float64], v: npt.NDArray[np.float64], keep: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Points (N, 2) of a grid over u and v, two triangles for every kept cell (len(v)-1, len(u)-1), and each one's row."""
    points = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    row, column = np.nonzero(keep)
    i = row * len(u) + column
    a, b, c, d = i, i + 1, i + len(u) + 1, i + len(u)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    used, inverse = np.unique(faces, return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.int32), np.concatenate([row, row])


def _breaks(start: float, end: float, step: float, marks: list[float]) -> npt.NDArray[np.float64]:
    """Grid lines from start to end about ``step`` apart, with all marks among them."""
    fixed = sorted({start, end, *(m for m in marks if start < m < end)})
    lines = [start]
    for a, b in pairwise(fixed):
        lines += np.linspace(a, b, max(1, round((b - a) / step)) + 1)[1:].tolist()
    return np.array(lines)


def _mesh(
    points: npt.NDArray[np.float64],
    faces: npt.NDArray[np.int32],
    uv: npt.NDArray[np.float64],
    normal: tuple[float, float, float],
    face_material: npt.NDArray[np.integer],
    materials: list[Material],
) -> Model:
    """A flat mesh whose faces are turned to ``normal``."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    wrong = np.cross(b - a, c - a) @ np.array(normal) < 0
    faces = np.where(wrong[:, None], faces[:, ::-1], faces).astype(np.int32)
    normals = np.broadcast_to(np.array(normal, np.float32), points.shape).copy()
    return Model(
        points.astype(np.float32), normals, uv.astype(np.float32), faces, face_material.astype(np.int32), materials
    )


def _horizontal(rect: Rect, y: float, up: float, surface: Material, scale: float, step: float) -> Model:
    u, v = _breaks(rect.x0, rect.x1, step, []), _breaks(rect.z0, rect.z1, step, [])
    points, faces, _ = _grid(u, v, np.ones((len(v) - 1, len(u) - 1), bool))
    world = np.stack([points[:, 0], np.full(len(points), y), points[:, 1]], 1)
    return _mesh(world, faces, points / scale, (0.0, up, 0.0), np.zeros(len(faces), np.int64), [surface])


def _floor(plan: Plan, room: int, finish: _Finish) -> Model:
    """The room's floor and the thresholds of the doors that it is the first room of."""
    parts = [_horizontal(plan.inner(room), 0.0, 1.0, finish.floor, finish.floor_scale, 0.125)]
    for o in plan.openings:
        if o.kind != "window" and o.rooms[0] == room:
            parts.append(_horizontal(o.zone(0.0), 0.0, 1.0, finish.floor, finish.floor_scale, 0.125))
    return merge(parts)


def _wall(plan: Plan, side: Side, finish: _Finish) -> Model:
    """One wall of a room, its openings cut out; where it is an outer wall, with its outer face."""
    holes = plan.on_side(side)
    marks_v = [BASEBOARD, finish.tile_height, *(o.sill for o in holes), *(o.top for o in holes)]
    u = _breaks(side.start, side.end, STEP, [e for o in holes for e in (o.start, o.end)])
    v = _breaks(0.0, CEILING, STEP, marks_v)
    um, vm = (u[1:] + u[:-1]) / 2, (v[1:] + v[:-1]) / 2
    keep = np.ones((len(vm), len(um)), bool)
    for o in holes:
        keep &= ~(((vm > o.sill) & (vm < o.top))[:, None] & ((um > o.start) & (um < o.end))[None, :])
    points, faces, row = _grid(u, v, keep)
    height = vm[row]
    face_material = np.where(height < finish.tile_height, 1, np.where(height < BASEBOARD, 2, 0))
    uv = np.stack([points[:, 0], CEILING - points[:, 1]], 1) / 1.8
    normal = (0.0, 0.0, float(side.inward)) if side.axis == "x" else (float(side.inward), 0.0, 0.0)
    materials = [finish.wall, finish.tile, finish.baseboard]
    inner = _mesh(_upright(side, points, 0.0), faces, uv, normal, face_material, materials)
    if not side.outer:
        return inner
    back = _upright(side, points, -WALL)
    outward = (-normal[0], 0.0, -normal[2])
    plain = [material("facade", (0.85, 0.82, 0.76))]
    return merge([inner, _mesh(back, faces, uv * 0.0, outward, np.zeros(len(faces), np.int64), plain)])


def _upright(side: Side, points: npt.NDArray[np.float64], off: float) -> npt.NDArray[np.float64]:
    """World places (N, 3) of wall coordinates (along, height), ``off`` m into the room from the inner face."""
    other = np.full(len(points), side.at + side.inward * off)
    along, height = points.T
    return np.stack([along, height, other] if side.axis == "x" else [other, height, along], 1)


def _bar(
    o: Opening, along: tuple[float, float], height: tuple[float, float], off: tuple[float, float], m: Material
) -> Model:
    """A box in an opening's wall: along it, in height, and across it from its middle, m."""
    a, b = o.at + off[0], o.at + off[1]
    if o.axis == "x":
        return box((along[0], height[0], a), (along[1], height[1], b), m)
    return box((a, height[0], along[0]), (b, height[1], along[1]), m)


def _casing(o: Opening, width: float, m: Material, sill: bool) -> list[Model]:
    """A lining of the hole and flat trim around it, standing 1.5 cm out of the wall on both sides."""
    t, out = 0.015, WALL / 2 + 0.015
    low = o.sill - (width if sill else 0.0)
    parts = [
        _bar(o, (o.start, o.start + t), (o.sill, o.top), (-out, out), m),
        _bar(o, (o.end - t, o.end), (o.sill, o.top), (-out, out), m),
        _bar(o, (o.start, o.end), (o.top - t, o.top), (-out, out), m),
    ]
    if sill:
        parts.append(_bar(o, (o.start, o.end), (o.sill, o.sill + t), (-out, out), m))
    for a, b in ((-out, -WALL / 2), (WALL / 2, out)):
        parts.append(_bar(o, (o.start - width, o.start), (low, o.top + width), (a, b), m))
        parts.append(_bar(o, (o.end, o.end + width), (low, o.top + width), (a, b), m))
        parts.append(_bar(o, (o.start, o.end), (o.top, o.top + width), (a, b), m))
        if sill:
            parts.append(_bar(o, (o.start, o.end), (low, o.sill), (a, b), m))
    return parts


def _door(plan: Plan, o: Opening, trim: Material, rng: np.random.Generator) -> list[Piece]:
    frame = Piece("door frame", o.rooms[0], merge(_casing(o, 0.06, trim, sill=False)), {})
    if o.kind == "door":
        return [frame]
    paint = material("door", tuple(textures.pick(rng, (*textures.WOODS, (0.30, 0.36, 0.42), (0.42, 0.16, 0.14)))))
    dark = material("door panel", tuple(np.asarray(paint.colour) * 0.85))
    metal = material("handle", (0.72, 0.70, 0.65))
    parts = [_bar(o, (o.start + 0.015, o.end - 0.015), (0.0, o.top - 0.015), (-0.02, 0.02), paint)]
    width = o.end - o.start
    for low, high in ((0.2, 0.9), (1.1, 1.85)):
        for k in range(2):
            a = o.start + width * (0.14 + 0.4 * k)
            parts.append(_bar(o, (a, a + width * 0.32), (low, high), (-0.026, 0.026), dark))
    parts.append(_bar(o, (o.end - 0.14, o.end - 0.05), (0.98, 1.01), (-0.06, 0.06), metal))
    return [frame, Piece("front door", o.rooms[0], merge(parts), {})]


def _window(plan: Plan, o: Opening, trim: Material, rng: np.random.Generator) -> list[Piece]:
    white = material("window frame", (0.95, 0.95, 0.94))
    view = material("window pane", (1.0, 1.0, 1.0), textures.outdoors(rng))
    parts = _casing(o, 0.05, white, sill=True)
    bars = [o.start + 0.015, o.end - 0.06]
    if o.end - o.start > 0.9:
        bars.append((o.start + o.end) / 2 - 0.02)
    parts += [_bar(o, (a, a + 0.045), (o.sill, o.top), (-0.02, 0.02), white) for a in bars]
    parts += [_bar(o, (o.start, o.end), (y, y + 0.045), (-0.02, 0.02), white) for y in (o.sill + 0.015, o.top - 0.06)]
    low, high = (o.start + 0.02, o.sill + 0.02, -0.005), (o.end - 0.02, o.top - 0.02, 0.005)
    if o.axis == "x":
        pane = box((low[0], low[1], o.at + low[2]), (high[0], high[1], o.at + high[2]), {0: view, 1: view})
    else:
        pane = box((o.at + low[2], low[1], low[0]), (o.at + high[2], high[1], high[0]), {2: view, 3: view})
    return [Piece("window", o.rooms[0], merge([*parts, pane]), {})]
