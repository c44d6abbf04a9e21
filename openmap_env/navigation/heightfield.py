"""From triangles to solid spans: what stands over each cell of a horizontal grid.

A column of the grid holds the vertical extents of everything that touches it. Triangles are clipped to the cells (a conservative
rasterisation: a wall of no thickness fills every cell that it touches), and what overlaps in a column is one solid span. The top
of a span is walkable where a face with a slope of at most ``MAX_SLOPE_DEG`` lies at it, or at most one step below it (a door
sill, a cable). This is the voxelisation of Recast (M. Mononen, 2009) with real heights in place of voxels. Which way a face
looks is not used: scans have walls of one side and faces turned inside out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
import numpy.typing as npt

MAX_SLOPE_DEG = 45.0
MAX_COLUMNS = 60_000_000


@dataclass(frozen=True)
class Grid:
    """A horizontal grid: column (ix, iz) covers x in origin_x + [ix, ix + 1) * cell, and z alike; its index is iz * nx + ix."""

    origin_x: float
    origin_z: float
    cell: float
    nx: int
    nz: int

    @classmethod
    def over(cls, vertices: npt.NDArray[np.floating], cell: float) -> Grid:
        """The grid over all vertices (V, 3) m, with a margin.

        Cell *centres* lie at multiples of the cell size: a wall at a round coordinate then lies in the middle of a cell, and
        rounding in the vertices does not decide which side of a border it is on.
        """
        low, high = vertices[:, (0, 2)].min(0).astype(np.float64), vertices[:, (0, 2)].max(0).astype(np.float64)
        first = np.floor(low / cell) - 1.5
        n = np.ceil(high / cell - first).astype(np.int64) + 2
        if int(n[0]) * int(n[1]) > MAX_COLUMNS:
            extent = " x ".join(f"{e:.0f} m" for e in high - low)
            raise ValueError(
                f"the mesh covers {extent}, {n[0]} x {n[1]} cells of {cell} m; expected at most {MAX_COLUMNS} cells. "
                "Check that the mesh is in metres and has no stray vertices, or use a larger cell"
            )
        return cls(float(first[0] * cell), float(first[1] * cell), cell, int(n[0]), int(n[1]))


@dataclass(frozen=True)
class Spans:
    """Solid spans of all columns: those of column c are ``start[c]:start[c + 1]``, from low to high, disjoint.

    ``low``, ``high`` (S,) float64 m are their extents, ``walkable`` (S,) bool says whether one can stand on top (head room aside).
    """

    start: npt.NDArray[np.int64]
    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    walkable: npt.NDArray[np.bool_]


def solid_spans(
    vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer], grid: Grid, step_height: float
) -> Spans:
    """Solid spans of a mesh of vertices (V, 3) m and triangles (F, 3) over a grid; ``step_height`` in m."""
    v, f = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    upright = math.cos(math.radians(MAX_SLOPE_DEG + 1e-3))
    column, low, high, is_flat = _rasterise(v, f, upright, grid.origin_x, grid.origin_z, grid.cell, grid.nx, grid.nz)
    return Spans(*_merge(column, low, high, is_flat, grid.nx * grid.nz, step_height))


@nb.njit(cache=True)
def _clip(  # type: ignore[no-untyped-def]
    source, n, axis, bound, sign, target
):
    """Cut a convex polygon (its first n rows) to sign * (coordinate - bound) >= 0; returns the number of rows of target."""
    m = 0
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        a, b = sign * (source[i, axis] - bound), sign * (source[j, axis] - bound)
        if a >= 0.0:
            target[m] = source[i]
            m += 1
        if (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0):
            t = a / (a - b)
            for k in range(3):
                target[m, k] = source[i, k] + t * (source[j, k] - source[i, k])
            target[m, axis] = bound
            m += 1
    return m


@nb.njit(cache=True)
def _index(coordinate, origin, cell, n):  # type: ignore[no-untyped-def]
    return min(max(math.floor((coordinate - origin) / cell), 0), n - 1)


@nb.njit(cache=True)
def _is_flat(triangle, upright):  # type: ignore[no-untyped-def]
    """Whether the vertical part of a triangle's normal is at least ``upright`` of it; no triangle without an area is flat."""
    ax, ay, az = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
    bx, by, bz = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    return length > 0.0 and abs(ny) >= upright * length


@nb.njit(cache=True)
def _rasterise(vertices, faces, upright, ox, oz, cell, nx, nz):  # type: ignore[no-untyped-def]
    """Column, lowest and highest point of each triangle within each column that it touches, and whether it is flat."""
    capacity = 4 * len(faces) + 1024
    column, low, high = np.empty(capacity, np.int64), np.empty(capacity), np.empty(capacity)
    is_flat = np.empty(capacity, np.bool_)
    count = 0
    triangle, spare = np.empty((9, 3)), np.empty((9, 3))
    row, part = np.empty((9, 3)), np.empty((9, 3))
    for f in range(len(faces)):
        for k in range(3):
            triangle[k] = vertices[faces[f, k]]
        flat = _is_flat(triangle, upright)
        z_first = _index(min(triangle[0, 2], triangle[1, 2], triangle[2, 2]), oz, cell, nz)
        z_last = _index(max(triangle[0, 2], triangle[1, 2], triangle[2, 2]), oz, cell, nz)
        for iz in range(z_first, z_last + 1):
            if z_first == z_last:
                n = 3
                row[:3] = triangle[:3]
            else:
                n = _clip(triangle, 3, 2, oz + iz * cell, 1.0, spare)
                n = _clip(spare, n, 2, oz + (iz + 1) * cell, -1.0, row)
            if n == 0:
                continue
            x_first = _index(row[:n, 0].min(), ox, cell, nx)
            x_last = _index(row[:n, 0].max(), ox, cell, nx)
            for ix in range(x_first, x_last + 1):
                if x_first == x_last:
                    m = n
                    part[:n] = row[:n]
                else:
                    m = _clip(row, n, 0, ox + ix * cell, 1.0, spare)
                    m = _clip(spare, m, 0, ox + (ix + 1) * cell, -1.0, part)
                if m == 0:
                    continue
                if count == capacity:
                    capacity *= 2
                    column = np.concatenate((column, np.empty(capacity - count, np.int64)))
                    low = np.concatenate((low, np.empty(capacity - count)))
                    high = np.concatenate((high, np.empty(capacity - count)))
                    is_flat = np.concatenate((is_flat, np.empty(capacity - count, np.bool_)))
                column[count] = iz * nx + ix
                low[count], high[count] = part[:m, 1].min(), part[:m, 1].max()
                is_flat[count] = flat
                count += 1
    return column[:count], low[:count], high[:count], is_flat[:count]


@nb.njit(cache=True)
def _merge(column, low, high, is_flat, n_columns, step_height):  # type: ignore[no-untyped-def]
    """Sort the pieces by column and height and unite those that touch; see ``Spans`` for what comes back."""
    first = np.zeros(n_columns + 1, np.int64)
    for i in range(len(column)):
        first[column[i] + 1] += 1
    for c in range(n_columns):
        first[c + 1] += first[c]
    order, cursor = np.empty(len(column), np.int64), first[:-1].copy()
    for i in range(len(column)):
        order[cursor[column[i]]] = i
        cursor[column[i]] += 1
    start = np.zeros(n_columns + 1, np.int64)
    out_low, out_high = np.empty(len(column)), np.empty(len(column))
    out_walkable = np.empty(len(column), np.bool_)
    count = 0
    for c in range(n_columns):
        pieces = order[first[c] : first[c + 1]]
        if len(pieces) > 1:
            pieces = pieces[np.argsort(low[pieces], kind="mergesort")]
        i = 0
        was_flat, was_high = False, -np.inf
        while i < len(pieces):
            bottom, top = low[pieces[i]], high[pieces[i]]
            flat_top = top if is_flat[pieces[i]] else -np.inf
            i += 1
            while i < len(pieces) and low[pieces[i]] <= top:
                top = max(top, high[pieces[i]])
                if is_flat[pieces[i]]:
                    flat_top = max(flat_top, high[pieces[i]])
                i += 1
            flat = top - flat_top <= step_height
            out_low[count], out_high[count] = bottom, top
            # Something low that lies on or just above a floor can be stepped on, whatever its shape.
            out_walkable[count] = flat or (was_flat and top - was_high <= step_height)
            was_flat, was_high = flat, top
            count += 1
        start[c + 1] = count
    return start, out_low[:count], out_high[:count], out_walkable[:count]
