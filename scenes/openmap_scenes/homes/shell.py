"""The house itself: floors, walls, ceilings, doors and windows of a plan, as named pieces of mesh in the world frame."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.envelope import outer_parts
from openmap_scenes.homes.joinery import VIEW, build_joinery
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.palette import Cover, HomeFinish, RoomFinish, draw_finish
from openmap_scenes.homes.plan import OUTER, WALL, Plan, Rect, Side
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.sheets import breaks, flat_mesh, grid, strip, upright
from openmap_scenes.scene import Material

STEP = 0.25
FLOOR_STEP = 0.125
# Furniture stands a centimetre off the wall.
SKIRTING_DEPTH = 0.007
CASING = 0.07


@dataclass(frozen=True)
class Piece:
    """Part of the building: a mesh in the world frame, what it is and in which room."""

    kind: str
    room: int
    mesh: Model
    attributes: dict[str, str]

    @property
    def shines(self) -> npt.NDArray[np.bool_]:
        """(V,) which vertices show the open and so are bright by themselves."""
        views = np.array([m.name == VIEW for m in self.mesh.materials])
        out = np.zeros(len(self.mesh.vertices), bool)
        out[self.mesh.faces[views[self.mesh.face_material]].reshape(-1)] = True
        return out


def build_shell(plan: Plan, rng: np.random.Generator, counters: Mapping[int, Set[int]] | None = None) -> list[Piece]:
    """Everything of a plan but the furniture.

    Parameters
    ----------
    plan : Plan
    rng : np.random.Generator
        Chooses colours, coverings, and the make of doors and windows.
    counters : dict or None
        By kitchen, the indices into ``plan.sides`` of the walls behind its counters, which may be tiled; where nothing is
        said, the wall with the longest stretch without a door.
    """
    finish = draw_finish(plan, rng, counters or {})
    outside = outer_parts(plan, finish.facade, finish.plaster)
    pieces = []
    for room, surfaces in enumerate(finish.rooms):
        pieces.append(Piece("floor", room, _floor(plan, room, surfaces), {"material": surfaces.floor.word}))
        ceiling = _horizontal(plan.inner(room), plan.ceiling, -1.0, finish.ceiling, STEP * 2)
        pieces.append(Piece("ceiling", room, ceiling, {}))
        for k, side in enumerate(plan.sides(room)):
            parts = [_wall(plan, side, k, surfaces), *_trim(plan, side, k, surfaces, finish), *outside[room][k]]
            pieces.append(Piece("wall", room, merge(parts), {}))
    return pieces + [Piece(*parts) for parts in build_joinery(plan, finish, rng)]


def _horizontal(rect: Rect, y: float, up: float, cover: Cover, step: float) -> Model:
    u, v = breaks(rect.x0, rect.x1, step, []), breaks(rect.z0, rect.z1, step, [])
    points, faces, _ = grid(u, v, np.ones((len(v) - 1, len(u) - 1), bool))
    world = np.stack([points[:, 0], np.full(len(points), y), points[:, 1]], 1)
    return flat_mesh(world, faces, cover.uv(points), (0.0, up, 0.0), np.zeros(len(faces), np.int64), [cover.material])


def _floor(plan: Plan, room: int, surfaces: RoomFinish) -> Model:
    """The room's floor, up to the middle of the wall in doorways and to the outer face in doors to the open."""
    inner = plan.inner(room)
    parts = [_horizontal(inner, 0.0, 1.0, surfaces.floor, FLOOR_STEP)]
    for o in plan.openings:
        if o.kind != "window" and room in o.rooms:
            into = 1 if (inner.z0 if o.axis == "x" else inner.x0) > o.at else -1
            a, b = sorted((o.at + into * WALL / 2, o.at - into * (0.0 if o.rooms[1] >= 0 else OUTER)))
            sill = Rect(o.start, a, o.end, b) if o.axis == "x" else Rect(a, o.start, b, o.end)
            parts.append(_horizontal(sill, 0.0, 1.0, surfaces.floor, FLOOR_STEP))
    return merge(parts)


def _wall(plan: Plan, side: Side, index: int, surfaces: RoomFinish) -> Model:
    """The inner face of a wall of a room, its openings cut out, painted and tiled."""
    holes = plan.on_side(side)
    low, high = surfaces.tiled[index]
    marks = [low, high, *(o.sill for o in holes), *(o.top for o in holes)]
    u = breaks(side.start, side.end, STEP, [e for o in holes for e in (o.start, o.end)])
    v = breaks(0.0, plan.ceiling, STEP, marks)
    um, vm = (u[1:] + u[:-1]) / 2, (v[1:] + v[:-1]) / 2
    keep = np.ones((len(vm), len(um)), bool)
    for o in holes:
        keep &= ~(((vm > o.sill) & (vm < o.top))[:, None] & ((um > o.start) & (um < o.end))[None, :])
    normal = (0.0, 0.0, float(side.inward)) if side.axis == "x" else (float(side.inward), 0.0, 0.0)
    paint = surfaces.accent if surfaces.accent is not None and index == surfaces.accent_side else surfaces.wall
    tiled = np.broadcast_to(((vm > low) & (vm < high))[:, None], keep.shape)
    parts = []
    for cover, cells, top in ((paint, keep & ~tiled, plan.ceiling), (surfaces.tile, keep & tiled, high)):
        if cells.any():
            points, faces, _ = grid(u, v, cells)
            # Pictures hang from the upper edge; seen from inside u grows to the right.
            sign = -side.inward if side.axis == "z" else side.inward
            uv = cover.uv(np.stack([sign * points[:, 0], top - points[:, 1]], 1))
            zero = np.zeros(len(faces), np.int64)
            parts.append(flat_mesh(upright(side, points, 0.0), faces, uv, normal, zero, [cover.material]))
    return merge(parts)


def _trim(plan: Plan, side: Side, index: int, surfaces: RoomFinish, finish: HomeFinish) -> list[Model]:
    """Skirting, where the wall is not tiled, and cornice, where the home has one."""
    parts = []
    low, high = surfaces.tiled[index]
    if not (low == 0.0 and high > 0.0):
        doors = sorted((o for o in plan.on_side(side) if o.sill < 0.1), key=lambda o: o.start)
        ends = [side.start, *(e for o in doors for e in (o.start - CASING, o.end + CASING)), side.end]
        for a, b in zip(ends[::2], ends[1::2], strict=True):
            if b - a > 0.02:
                parts += _skirting(side, a, b, finish.skirting, finish.trim)
    if finish.cornice and high < plan.ceiling - 0.01:
        c = finish.cornice
        lower = [(side.start, plan.ceiling - c, 0.0), (side.end, plan.ceiling - c, 0.0)]
        upper = [(side.start + c, plan.ceiling, c), (side.end - c, plan.ceiling, c)]
        parts.append(strip(side, lower, upper, finish.plaster, STEP))
    return parts


def _skirting(side: Side, a: float, b: float, height: float, trim: Material) -> list[Model]:
    d = SKIRTING_DEPTH
    front = strip(side, [(a, 0.0, d), (b, 0.0, d)], [(a, height - d, d), (b, height - d, d)], trim, STEP)
    top = strip(side, [(a, height - d, d), (b, height - d, d)], [(a, height, 0.0), (b, height, 0.0)], trim, STEP)
    return [front, top]
