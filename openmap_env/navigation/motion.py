"""How a body moves over the cells: straight on, along walls, never through them.

A displacement is walked in pieces of at most half a cell, each from a cell to one that connects with it, so nothing is jumped
over. A piece that is barred goes on along the obstacle, as far as it leads forward.
"""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True)
def locate(start, floor, origin, size, nx, nz, x, y, z, reach):  # type: ignore[no-untyped-def]
    """The cell under or over a point whose floor is nearest in height and at most ``reach`` m off; -1 for none."""
    ix, iz = int(np.floor((x - origin[0]) / size)), int(np.floor((z - origin[1]) / size))
    if ix < 0 or iz < 0 or ix >= nx or iz >= nz:
        return -1
    best, cell = reach, -1
    for i in range(start[iz * nx + ix], start[iz * nx + ix + 1]):
        off = abs(floor[i] - y)
        if off <= best:
            best, cell = off, i
    return cell


@nb.njit(cache=True)
def _enter(neighbour, ix, iz, origin, size, cell, x, z):  # type: ignore[no-untyped-def]
    """The cell that holds (x, z), which is ``cell`` or beside it, if it connects with ``cell``; else -1."""
    sx = int(np.floor((x - origin[0]) / size)) - ix[cell]
    sz = int(np.floor((z - origin[1]) / size)) - iz[cell]
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
def slide(neighbour, ix, iz, away, origin, size, cell, x, z, dx, dz):  # type: ignore[no-untyped-def]
    """Move from (x, z) in ``cell`` by (dx, dz) m; returns the new x, z and cell."""
    pieces = max(1, int(np.ceil(np.hypot(dx, dz) / (0.5 * size))))
    px, pz = dx / pieces, dz / pieces
    length = np.hypot(px, pz)
    for _ in range(pieces):
        nx_, nz_ = away[cell, 0], away[cell, 1]
        into = px * nx_ + pz * nz_
        moved = False
        for attempt in range(5):
            mx, mz = px, pz
            if attempt == 1 or attempt == 2:
                # Along the obstacle; the second time also a little off it, to get around the corner of a cell.
                if into >= 0.0:
                    continue
                push = 0.0 if attempt == 1 else 0.5 * length
                mx, mz = px - into * nx_ + push * nx_, pz - into * nz_ + push * nz_
            elif attempt == 3:
                mx, mz = (px, 0.0) if abs(px) >= abs(pz) else (0.0, pz)
            elif attempt == 4:
                mx, mz = (0.0, pz) if abs(px) >= abs(pz) else (px, 0.0)
            if attempt > 0 and mx * px + mz * pz <= 1e-6 * length * length:
                continue
            following = _enter(neighbour, ix, iz, origin, size, cell, x + mx, z + mz)
            if following >= 0:
                cell, x, z = following, x + mx, z + mz
                moved = True
                break
        if not moved:
            break
    return x, z, cell
