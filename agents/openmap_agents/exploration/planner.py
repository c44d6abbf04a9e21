"""Ways over the occupancy grid: clearance, what a step costs, shortest paths by Dijkstra, straight lines."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from openmap_agents.exploration.occupancy import FREE, OCCUPIED, UNKNOWN, Cell, OccupancyMap


@dataclass(frozen=True)
class PlannerSettings:
    """Where the body fits and what it likes; metres."""

    body_radius: float = 0.2
    """Cells nearer to an obstacle cannot be walked, unless the body already stands there."""
    comfort_radius: float = 0.45
    """Nearer to an obstacle than this, a step costs more ..."""
    closeness_cost: float = 4.0
    """... up to this much more, at the body radius."""
    unknown_radius: float = 1.0
    """Unknown floor this near to the body (under its camera's view) may be walked over ..."""
    unknown_cost: float = 6.0
    """... at this cost a metre."""


def clearance(grid: npt.NDArray[np.uint8], resolution: float) -> npt.NDArray[np.float32]:
    """Distance (H, W) float32 m from each cell's centre to that of the nearest occupied cell; inf where there is none."""
    occupied = grid == OCCUPIED
    if not occupied.any():
        return np.full(grid.shape, np.inf, np.float32)
    return np.asarray(distance_transform_edt(~occupied, sampling=resolution), np.float32)


def traversal_cost(
    occupancy: OccupancyMap, grid: npt.NDArray[np.uint8], x: float, z: float, settings: PlannerSettings
) -> npt.NDArray[np.float32]:
    """Cost a metre of walking over each cell, (H, W) float32, at least 1; inf = the body's centre cannot be there.

    Parameters
    ----------
    grid : (H, W) uint8
        ``occupancy.grid``.
    x, z : float
        Where the body stands, m: around it, cells too near to an obstacle are dear instead of closed, so that it can leave.
    """
    free_radius = clearance(grid, occupancy.resolution)
    lack = np.clip(
        (settings.comfort_radius - free_radius) / (settings.comfort_radius - settings.body_radius), 0.0, None
    )
    cost = (1.0 + settings.closeness_cost * lack * lack).astype(np.float32)
    rows, columns = np.ogrid[: grid.shape[0], : grid.shape[1]]
    away = np.hypot(
        occupancy.origin[0] + (columns + 0.5) * occupancy.resolution - x,
        occupancy.origin[1] + (rows + 0.5) * occupancy.resolution - z,
    )
    unknown = grid == UNKNOWN
    cost[unknown] += np.float32(settings.unknown_cost)
    # A cell's obstacle may lie half a cell nearer or farther than its centre: the renderer's surface decides, not our raster.
    tight = free_radius < settings.body_radius - occupancy.resolution / 2
    closed = (grid == OCCUPIED) | (tight & (away > settings.body_radius + 0.1)) | occupancy.bumped
    closed |= unknown & (away > settings.unknown_radius)
    cost[closed] = np.inf
    row, column = occupancy.cell(x, z)
    if not np.isfinite(cost[row, column]):
        cost[row, column] = 1.0 + settings.closeness_cost
    return np.asarray(cost)


def distances(
    cost: npt.NDArray[np.float32], start: Cell, resolution: float
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Cheapest way from one cell to all, over 8 neighbours; a diagonal step needs both cells beside it.

    Returns
    -------
    distance : (H, W) float32
        In metres times cost; inf = out of reach.
    parent : (H, W) int32
        Flat index of the cell before; -1 at the start and out of reach.
    """
    return _dijkstra(cost, start[0], start[1], resolution)  # type: ignore[no-any-return]


def path_to(parent: npt.NDArray[np.int32], cell: Cell) -> list[Cell]:
    """The way from the start of ``distances`` to a cell within reach, both included."""
    width = parent.shape[1]
    path = [cell]
    while (before := int(parent[path[-1]])) >= 0:
        path.append((before // width, before % width))
    return path[::-1]


def dearest_on_line(cost: npt.NDArray[np.float32], a: Cell, b: Cell) -> float:
    """The highest cost under the straight line between two cells' centres; inf where it touches one that is closed."""
    return float(_dearest_on_line(cost, a[0], a[1], b[0], b[1]))


def frontier_cells(grid: npt.NDArray[np.uint8], distance: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Cells (H, W) bool that are free and within reach and touch unknown ones: the edge of what is known."""
    unknown = np.pad(grid == UNKNOWN, 1)
    touches = np.zeros(grid.shape, bool)
    height, width = grid.shape
    for dr in (0, 1, 2):
        for dc in (0, 1, 2):
            touches |= unknown[dr : dr + height, dc : dc + width]
    return np.asarray(touches & (grid == FREE) & np.isfinite(distance))


def beyond_frontier(
    grid: npt.NDArray[np.uint8], cells: npt.NDArray[np.int64], radius: int = 3
) -> npt.NDArray[np.float32]:
    """Unit vectors (n, 2) float32 (row, column) from frontier cells (n, 2) to the middle of the unknown within ``radius`` cells.

    0 where the unknown lies around the cell on all sides alike.
    """
    unknown = np.pad(grid == UNKNOWN, radius)
    total = np.zeros((len(cells), 2), np.float32)
    for dr in range(-radius, radius + 1):
        for dc in range(-radius, radius + 1):
            there = unknown[cells[:, 0] + dr + radius, cells[:, 1] + dc + radius]
            total += np.where(there[:, None], np.array([dr, dc], np.float32), np.float32(0.0))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(length > 1e-6, total / np.maximum(length, 1e-6), np.float32(0.0)).astype(np.float32)


@numba.njit(cache=True)
def _dijkstra(cost, start_row, start_column, resolution):  # type: ignore[no-untyped-def]
    height, width = cost.shape
    distance = np.full((height, width), np.inf, np.float32)
    parent = np.full((height, width), -1, np.int32)
    distance[start_row, start_column] = 0.0
    heap = [(np.float32(0.0), start_row * width + start_column)]
    while len(heap) > 0:
        d, index = heapq.heappop(heap)
        r, c = index // width, index % width
        if d > distance[r, c]:
            continue
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                rr, cc = r + dr, c + dc
                if (dr == 0 and dc == 0) or not (0 <= rr < height and 0 <= cc < width):
                    continue
                if not np.isfinite(cost[rr, cc]) or not (np.isfinite(cost[rr, c]) and np.isfinite(cost[r, cc])):
                    continue
                length = resolution * math.sqrt(dr * dr + dc * dc)
                new = np.float32(d + length * 0.5 * (cost[r, c] + cost[rr, cc]))
                if new < distance[rr, cc]:
                    distance[rr, cc] = new
                    parent[rr, cc] = index
                    heapq.heappush(heap, (new, rr * width + cc))
    return distance, parent


@numba.njit(cache=True)
def _dearest_on_line(cost, row_a, column_a, row_b, column_b):  # type: ignore[no-untyped-def]
    steps = 2 * max(abs(row_b - row_a), abs(column_b - column_a))
    dearest = cost[row_a, column_a]
    for i in range(1, steps + 1):
        t = i / steps
        r = math.floor(row_a + t * (row_b - row_a) + 0.5)
        c = math.floor(column_a + t * (column_b - column_a) + 0.5)
        dearest = max(dearest, cost[r, c])
    return dearest
