"""Shortest distance over the cells, free of the grid's directions.

Dijkstra's algorithm over the eight neighbours, in which a cell takes its predecessor's anchor for its own where the straight
line to it stays on the surface (Lazy Theta*: Nash, Koenig, Tovey, AAAI 2010). A cell's anchor is the next corner on its way to
the goal, so distances are those of taut strings and each chain of anchors is a shortest path. A straight line also has to follow
the ground: where the floor under it leaves it by more than a step (the foot of a stair), the string gets a corner.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.navigation.cells import Cells
from openmap_env.navigation.heightfield import Grid

NO_ANCHOR = np.int64(-(1 << 60))
LOOK_BEYOND = 3


def cell_centres(cells: Cells, grid: Grid) -> npt.NDArray[np.float64]:
    """World positions (N, 3) m of the middle of each cell, on the floor."""
    return np.stack(
        [
            grid.origin_x + (cells.ix + 0.5) * grid.cell,
            cells.floor,
            grid.origin_z + (cells.iz + 0.5) * grid.cell,
        ],
        axis=1,
    )


@nb.njit(cache=True)
def distance_at(ground, way, slack, point, cell):  # type: ignore[no-untyped-def]
    """Distance m from a point (3,) on the floor of a cell to the nearest goal, and the next corner on the way there.

    ``way`` is (centres, distance, anchor, goals, goal_cells) with what ``distances`` gives. The next corner is the cell's own
    anchor, or, where the point does not see what the middle of its cell sees, the middle of the cell.
    """
    centres, distance, anchor, goals, goal_cells = way
    a = anchor[cell]
    if a == NO_ANCHOR:
        return np.inf, a
    place = _place(a, centres, goals)
    a_cell = a if a >= 0 else goal_cells[-1 - a]
    if a_cell != cell and not sees(ground, slack, point, cell, place, a_cell):
        return _length(point, centres[cell]) + distance[cell], cell
    return _length(point, place) + (distance[a] if a >= 0 else 0.0), a


@nb.njit(cache=True)
def sees(ground, slack, a, cell_a, b, cell_b):  # type: ignore[no-untyped-def]
    """Whether the straight line from a (3,) m in one cell to b (3,) m in another stays on the surface.

    It is walked from cell to cell; ``slack`` is how far the floor may be from it.
    """
    _, ix, iz, floor, neighbour, _, origin_x, origin_z, size, _, _ = ground
    dx, dz = (b[0] - a[0]) / size, (b[2] - a[2]) / size
    steps_x, steps_z = ix[cell_b] - ix[cell_a], iz[cell_b] - iz[cell_a]
    sign_x, sign_z = (1 if steps_x > 0 else -1), (1 if steps_z > 0 else -1)
    left_x, left_z = abs(steps_x), abs(steps_z)
    ax, az = (a[0] - origin_x) / size - ix[cell_a], (a[2] - origin_z) / size - iz[cell_a]
    # Share of the line at which the next border in x and in z is crossed.
    t_x = ((1.0 - ax) if sign_x > 0 else ax) / abs(dx) if left_x > 0 else np.inf
    t_z = ((1.0 - az) if sign_z > 0 else az) / abs(dz) if left_z > 0 else np.inf
    cell, t = cell_a, 0.0
    while left_x > 0 or left_z > 0:
        t_before = t
        if left_x > 0 and left_z > 0 and abs(t_x - t_z) < 1e-9:
            d = (4 if sign_z > 0 else 7) if sign_x > 0 else (5 if sign_z > 0 else 6)
        elif left_z == 0 or (left_x > 0 and t_x < t_z):
            d = 0 if sign_x > 0 else 2
        else:
            d = 1 if sign_z > 0 else 3
        if d != 1 and d != 3:
            t = t_x
            t_x += 1.0 / abs(dx)
            left_x -= 1
        if d != 0 and d != 2:
            t = t_z
            t_z += 1.0 / abs(dz)
            left_z -= 1
        middle = 0.5 * (t_before + t)
        if abs(floor[cell] - (a[1] + middle * (b[1] - a[1]))) > slack:
            return False
        cell = neighbour[cell, d]
        if cell < 0:
            return False
    return cell == cell_b


@nb.njit(cache=True)
def _place(anchor, centres, goals):  # type: ignore[no-untyped-def]
    return centres[anchor] if anchor >= 0 else goals[-1 - anchor]


@nb.njit(cache=True)
def _length(a, b):  # type: ignore[no-untyped-def]
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@nb.njit(cache=True)
def _rise(heap, slot, key, i):  # type: ignore[no-untyped-def]
    """Move entry i of a binary heap of cells towards its root; ``slot`` tells where a cell lies in the heap."""
    cell = heap[i]
    while i > 0:
        parent = (i - 1) // 2
        if key[heap[parent]] <= key[cell]:
            break
        heap[i] = heap[parent]
        slot[heap[i]] = i
        i = parent
    heap[i] = cell
    slot[cell] = i


@nb.njit(cache=True)
def _sink(heap, slot, key, n, i):  # type: ignore[no-untyped-def]
    """Move entry i of a heap of n cells away from its root."""
    cell = heap[i]
    while True:
        child = 2 * i + 1
        if child >= n:
            break
        if child + 1 < n and key[heap[child + 1]] < key[heap[child]]:
            child += 1
        if key[cell] <= key[heap[child]]:
            break
        heap[i] = heap[child]
        slot[heap[i]] = i
        i = child
    heap[i] = cell
    slot[cell] = i


@nb.njit(cache=True)
def _settle_anchor(i, ground, centres, slack, goals, goal_cells, distance, anchor, settled):  # type: ignore[no-untyped-def]
    """The best of what the settled neighbours offer cell i: the anchor of one, or one beyond, if seen, else the neighbour."""
    neighbour = ground[4]
    best, best_anchor, turns_here = np.inf, NO_ANCHOR, False
    for d in range(8):
        j = neighbour[i, d]
        if j < 0 or not settled[j]:
            continue
        a = anchor[j]
        place = _place(a, centres, goals)
        through = _length(centres[i], place) + (distance[a] if a >= 0 else 0.0)
        if through < best:
            a_cell = a if a >= 0 else goal_cells[-1 - a]
            if sees(ground, slack, centres[i], i, place, a_cell):
                best, best_anchor, turns_here = through, a, False
        step = distance[j] + _length(centres[i], centres[j])
        if step < best:
            best, best_anchor, turns_here = step, j, True
    if not turns_here:
        return best, best_anchor
    # Pull the string taut: skip corners over which the cell sees a later one. In passages one cell wide it may see that one,
    # but not the one before it.
    a, look = best_anchor, LOOK_BEYOND
    while a >= 0 and look > 0:
        a = anchor[a]
        place = _place(a, centres, goals)
        a_cell = a if a >= 0 else goal_cells[-1 - a]
        look -= 1
        if sees(ground, slack, centres[i], i, place, a_cell):
            best, best_anchor = _length(centres[i], place) + (distance[a] if a >= 0 else 0.0), a
            look = LOOK_BEYOND
    return best, best_anchor


@nb.njit(cache=True)
def distances(ground, centres, slack, goals, goal_cells, until):  # type: ignore[no-untyped-def]
    """Distance (N,) m from each cell's centre to the nearest goal, inf where there is no way, and its anchor (N,).

    ``goals`` (G, 3) m lie in ``goal_cells`` (G,). Anchor a >= 0 is the centre of cell a, -1 - g is goal g. With ``until`` >= 0
    the search ends once that cell is reached; cells further off are then unfinished (inf).
    """
    n, neighbour = len(centres), ground[4]
    distance, anchor = np.full(n, np.inf), np.full(n, NO_ANCHOR, np.int64)
    settled, checked = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    heap, slot = np.empty(n, np.int64), np.full(n, -1, np.int64)
    count = 0
    for g in range(len(goals)):
        i = goal_cells[g]
        here = _length(goals[g], centres[i])
        if here < distance[i]:
            distance[i], anchor[i], checked[i] = here, -1 - g, True
            if slot[i] < 0:
                heap[count], slot[i] = i, count
                count += 1
            _rise(heap, slot, distance, slot[i])
    while count > 0:
        i = heap[0]
        if not checked[i]:
            # The anchor was taken over on trust; look now, and queue again with what is true.
            distance[i], anchor[i] = _settle_anchor(
                i, ground, centres, slack, goals, goal_cells, distance, anchor, settled
            )
            checked[i] = True
            _sink(heap, slot, distance, count, 0)
            _rise(heap, slot, distance, slot[i])
            continue
        count -= 1
        slot[i] = -2
        if count > 0:
            heap[0] = heap[count]
            slot[heap[0]] = 0
            _sink(heap, slot, distance, count, 0)
        settled[i] = True
        if i == until:
            break
        a = anchor[i]
        place = _place(a, centres, goals)
        base = distance[a] if a >= 0 else 0.0
        for d in range(8):
            j = neighbour[i, d]
            if j < 0 or settled[j]:
                continue
            through = base + _length(centres[j], place)
            if through < distance[j] - 1e-12:
                distance[j], anchor[j], checked[j] = through, a, False
                if slot[j] < 0:
                    heap[count], slot[j] = j, count
                    count += 1
                _rise(heap, slot, distance, slot[j])
    for i in range(n):
        if not settled[i]:
            distance[i], anchor[i] = np.inf, NO_ANCHOR
    return distance, anchor
