"""What closes the building: the outer faces around all rooms, with corners, and the tops of the walls.

The outside is the edge of the union of all room rectangles grown by the outer walls; it is found on the grid of all their
edges, so that any arrangement of rooms is closed.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.plan import OUTER, Plan, Rect
from openmap_scenes.homes.sheets import breaks, flat_mesh, grid
from openmap_scenes.scene import Material

_STEP = 0.5
Parts = list[list[list[Model]]]


def outer_parts(plan: Plan, facade: Material, top: Material) -> Parts:
    """Outer faces and tops of the walls, by room and by the index of its side that they belong to."""
    parts: Parts = [[[] for _ in range(4)] for _ in plan.rects]
    inner = [plan.inner(room) for room in range(len(plan.rects))]
    grown = [r.shrunk(-OUTER) for r in plan.rects]
    x = np.unique([c for r in (*grown, *inner, *plan.rects) for c in (r.x0, r.x1)])
    z = np.unique([c for r in (*grown, *inner, *plan.rects) for c in (r.z0, r.z1)])
    cx, cz = (x[1:] + x[:-1]) / 2, (z[1:] + z[:-1]) / 2
    owner = np.full((len(cz), len(cx)), -1)
    for rects in (grown, plan.rects):
        for room in reversed(range(len(rects))):
            owner[_covered(rects[room], cx, cz)] = room
    hollow = np.zeros(owner.shape, bool)
    for r in inner:
        hollow |= _covered(r, cx, cz)
    for row, column in np.argwhere((owner >= 0) & ~hollow).tolist():
        room = int(owner[row, column])
        r = inner[room]
        beyond = (r.x0 - cx[column], cx[column] - r.x1, r.z0 - cz[row], cz[row] - r.z1)
        tile = Rect(x[column], z[row], x[column + 1], z[row + 1])
        parts[room][int(np.argmax(beyond))].append(_cap(tile, plan.ceiling, top))
    for room, index, axis, at, start, end in _edges(owner, x, z):
        parts[room][index].append(_face(plan, (index, axis, at, start, end), facade))
    return parts


def _covered(r: Rect, cx: npt.NDArray[np.float64], cz: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    return np.asarray(((cz > r.z0) & (cz < r.z1))[:, None] & ((cx > r.x0) & (cx < r.x1))[None, :])


def _edges(
    owner: npt.NDArray[np.int_], x: npt.NDArray[np.float64], z: npt.NDArray[np.float64]
) -> list[tuple[int, int, str, float, float, float]]:
    """Stretches of the outside: (room, index of its side, axis along which it runs, at, start, end)."""
    found = []
    padded = np.pad(owner, 1, constant_values=-1)
    for index, (axis, shift) in enumerate((("z", (0, -1)), ("z", (0, 1)), ("x", (-1, 0)), ("x", (1, 0)))):
        beyond = np.roll(padded, (-shift[0], -shift[1]), (0, 1))[1:-1, 1:-1]
        edge = (owner >= 0) & (beyond < 0)
        lines, across = (z, x) if axis == "z" else (x, z)
        cells, rooms = (edge, owner) if axis == "z" else (edge.T, owner.T)
        for line in range(cells.shape[1]):
            at = float(across[line + (1 if sum(shift) > 0 else 0)])
            k = 0
            while k < cells.shape[0]:
                if not cells[k, line]:
                    k += 1
                    continue
                first = k
                while k < cells.shape[0] and cells[k, line] and rooms[k, line] == rooms[first, line]:
                    k += 1
                found.append((int(rooms[first, line]), index, axis, at, float(lines[first]), float(lines[k])))
    return found


def _face(plan: Plan, stretch: tuple[int, str, float, float, float], facade: Material) -> Model:
    index, axis, at, start, end = stretch
    outward = 1.0 if index in (1, 3) else -1.0
    holes = [o for o in plan.openings if o.rooms[1] < 0 and o.axis == axis and abs(o.at + outward * OUTER - at) < 1e-6]
    u = breaks(start, end, _STEP, [e for o in holes for e in (o.start, o.end)])
    v = breaks(0.0, plan.ceiling, _STEP, [e for o in holes for e in (o.sill, o.top)])
    um, vm = (u[1:] + u[:-1]) / 2, (v[1:] + v[:-1]) / 2
    keep = np.ones((len(vm), len(um)), bool)
    for o in holes:
        keep &= ~(((vm > o.sill) & (vm < o.top))[:, None] & ((um > o.start) & (um < o.end))[None, :])
    points, faces, _ = grid(u, v, keep)
    other = np.full(len(points), at)
    along, height = points.T
    world = np.stack([along, height, other] if axis == "x" else [other, height, along], 1)
    normal = (0.0, 0.0, outward) if axis == "x" else (outward, 0.0, 0.0)
    return flat_mesh(world, faces, np.zeros((len(points), 2)), normal, np.zeros(len(faces), np.int64), [facade])


def _cap(r: Rect, y: float, top: Material) -> Model:
    points = np.array([[r.x0, y, r.z0], [r.x1, y, r.z0], [r.x1, y, r.z1], [r.x0, y, r.z1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return flat_mesh(points, faces, np.zeros((4, 2)), (0.0, 1.0, 0.0), np.zeros(2, np.int64), [top])
