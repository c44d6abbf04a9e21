"""How a body stands on and moves over the cells: to the nearest of them, straight on, along walls, never through them.

A displacement is walked in pieces of at most half a cell, each from a cell to one that connects with it, so nothing is jumped
over. Where a piece is barred, the rest leads along the obstacle, to the nearest point that connected cells lead to.

``ground`` is what ``Cells.ground`` gives.
"""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True)
def locate(ground, x, y, z, reach):  # type: ignore[no-untyped-def]
    """The cell under or over a point whose floor is nearest in height and at most ``reach`` m off; -1 for none."""
    start, _, _, floor, _, _, origin_x, origin_z, size, nx, nz = ground
    # A comparison of floats first: what is far off, or no number, has no integer column.
    u, v = (x - origin_x) / size, (z - origin_z) / size
    if not (0.0 <= u < nx and 0.0 <= v < nz):
        return -1
    column = int(v) * nx + int(u)
    best, cell = reach, -1
    for i in range(start[column], start[column + 1]):
        off = abs(floor[i] - y)
        if off <= best:
            best, cell = off, i
    return cell


@nb.njit(cache=True)
def nearest(ground, island, wanted, x, y, z, reach, limit):  # type: ignore[no-untyped-def]
    """The nearest place to stand, at most ``limit`` m off, as its x, z and cell; cell -1 for none.

    A point over or under a cell by at most ``reach`` keeps its x and z. ``wanted`` is the island that counts, -1 = any.
    """
    start, _, _, floor, _, _, origin_x, origin_z, size, nx, nz = ground
    cell = locate(ground, x, y, z, reach)
    if cell >= 0 and (wanted < 0 or island[cell] == wanted) and abs(floor[cell] - y) <= limit:
        return x, z, cell
    first_x = int(min(max((x - limit - origin_x) / size, 0.0), nx))
    last_x = int(min(max((x + limit - origin_x) / size, -1.0), nx - 1.0))
    first_z = int(min(max((z - limit - origin_z) / size, 0.0), nz))
    last_z = int(min(max((z + limit - origin_z) / size, -1.0), nz - 1.0))
    best, best_x, best_z, best_cell = limit, x, z, -1
    for iz in range(first_z, last_z + 1):
        middle = origin_z + (iz + 0.5) * size
        pz = min(max(z, middle - 0.499 * size), middle + 0.499 * size)
        for ix in range(first_x, last_x + 1):
            column = iz * nx + ix
            if start[column] == start[column + 1]:
                continue
            middle = origin_x + (ix + 0.5) * size
            px = min(max(x, middle - 0.499 * size), middle + 0.499 * size)
            flat = (px - x) ** 2 + (pz - z) ** 2
            for i in range(start[column], start[column + 1]):
                if wanted >= 0 and island[i] != wanted:
                    continue
                off = np.sqrt(flat + (floor[i] - y) ** 2)
                if off < best or (off == best and best_cell < 0):
                    best, best_x, best_z, best_cell = off, px, pz, i
    return best_x, best_z, best_cell


@nb.njit(cache=True)
def _enter(ground, cell, x, z):  # type: ignore[no-untyped-def]
    """The cell that holds (x, z), which is ``cell`` or beside it, if it connects with ``cell``; else -1."""
    _, ix, iz, _, neighbour, _, origin_x, origin_z, size, _, _ = ground
    sx = int(np.floor((x - origin_x) / size)) - ix[cell]
    sz = int(np.floor((z - origin_z) / size)) - iz[cell]
    if sx == 0 and sz == 0:
        return cell
    if sz == 0:
        return neighbour[cell, 0 if sx > 0 else 2]
    if sx == 0:
        return neighbour[cell, 1 if sz > 0 else 3]
    if sx > 0:
        return neighbour[cell, 4 if sz > 0 else 7]
    return neighbour[cell, 5 if sz > 0 else 6]


@nb.njit(cache=True)
def _nearest_reachable(ground, cell, x, z, tx, tz, limit):  # type: ignore[no-untyped-def]
    """The point nearest to a target (tx, tz), at most ``limit`` m from (x, z), that is reached without leaving the circle
    around start and target, widened by a cell; returns its x, z and cell.
    """
    _, ix, iz, _, neighbour, _, origin_x, origin_z, size, _, _ = ground
    middle_x, middle_z = 0.5 * (x + tx), 0.5 * (z + tz)
    radius = 0.5 * np.hypot(tx - x, tz - z) + size
    best = np.hypot(tx - x, tz - z)
    best_x, best_z, best_cell = x, z, cell
    across = 2 * int(np.ceil(radius / size)) + 3
    queue = np.empty(across * across, np.int64)
    way = np.zeros(across * across)
    queue[0] = cell
    count, head = 1, 0
    while head < count:
        i = queue[head]
        head += 1
        # The edges of a cell are its neighbours' as well: stay a hair inside.
        low_x, low_z = origin_x + (ix[i] + 1e-6) * size, origin_z + (iz[i] + 1e-6) * size
        high_x, high_z = low_x + size * (1.0 - 2e-6), low_z + size * (1.0 - 2e-6)
        px, pz = min(max(tx, low_x), high_x), min(max(tz, low_z), high_z)
        off = np.hypot(tx - px, tz - pz)
        straight = np.hypot(px - x, pz - z)
        # No way around the end of a wall to what lies behind it: the way over the cells is about as long as the straight one.
        if off < best and straight <= limit and way[head - 1] <= straight + 1.5 * size:
            best, best_x, best_z, best_cell = off, px, pz, i
        for d in range(8):
            j = neighbour[i, d]
            if j < 0 or count == len(queue):
                continue
            cx, cz = origin_x + (ix[j] + 0.5) * size, origin_z + (iz[j] + 0.5) * size
            beside_x, beside_z = max(abs(cx - middle_x) - 0.5 * size, 0.0), max(abs(cz - middle_z) - 0.5 * size, 0.0)
            if np.hypot(beside_x, beside_z) > radius:
                continue
            known = False
            for k in range(count):
                known = known or queue[k] == j
            if not known:
                queue[count], way[count] = j, way[head - 1] + (size if d < 4 else 1.4142 * size)
                count += 1
    return best_x, best_z, best_cell


@nb.njit(cache=True)
def slide(ground, cell, x, z, dx, dz):  # type: ignore[no-untyped-def]
    """Move from (x, z) in ``cell`` by (dx, dz) m; returns the new x, z and cell."""
    away, size, nx, nz = ground[5], ground[8], ground[9], ground[10]
    length = np.hypot(dx, dz)
    if length == 0.0:
        return x, z, cell
    ux, uz = dx / length, dz / length
    # Nobody walks further straight on than the grid is wide.
    left = min(length, size * np.hypot(nx, nz))
    while left > 1e-9:
        piece = min(left, 0.5 * size)
        following = _enter(ground, cell, x + piece * ux, z + piece * uz)
        if following >= 0:
            cell, x, z = following, x + piece * ux, z + piece * uz
            left -= piece
            continue
        # Barred. Aim along the obstacle and go as near to that as the cells allow: a slanted wall is a stair on the grid, and
        # this finds the way over its steps. If that leads nowhere, aim straight on.
        stretch = min(left, 6.0 * size)
        into = min(ux * away[cell, 0] + uz * away[cell, 1], 0.0)
        moved = 0.0
        for attempt in range(2):
            share = into if attempt == 0 else 0.0
            reach = stretch if attempt == 0 else min(stretch, size)
            tx, tz = x + reach * (ux - share * away[cell, 0]), z + reach * (uz - share * away[cell, 1])
            end_x, end_z, end_cell = _nearest_reachable(ground, cell, x, z, tx, tz, reach)
            moved = np.hypot(end_x - x, end_z - z)
            if moved > 0.02 * stretch:
                break
        x, z, cell = end_x, end_z, end_cell
        if moved <= 0.02 * stretch:
            break
        left -= stretch
    return x, z, cell


@nb.njit(cache=True)
def step(ground, reach, x, y, z, dx, dz):  # type: ignore[no-untyped-def]
    """Where a body at (x, y, z) ends that wants to move by (dx, dz) m: x, y, z and cell; cell -1 if it stands nowhere now."""
    cell = locate(ground, x, y, z, reach)
    if cell < 0:
        return x, y, z, cell
    x, z, cell = slide(ground, cell, x, z, dx, dz)
    return x, ground[3][cell], z, cell
