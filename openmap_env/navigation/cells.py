"""From solid spans to cells that a body can stand on, and how they hang together.

A cell is the top of a span, one grid column wide, on which the body has head room. Two cells of neighbouring columns connect if the
body can step between them and keeps its head room on the way. Cells nearer to an obstacle or a ledge than the body's radius are
taken away; what remains falls into islands. Storeys and stairs need no care of their own: a column may hold several cells.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.navigation.heightfield import Grid, Spans

# Neighbours in this order: +x, +z, -x, -z, then the diagonals between them.
STEP_X = np.array([1, 0, -1, 0, 1, -1, -1, 1], np.int64)
STEP_Z = np.array([0, 1, 0, -1, 1, 1, -1, -1], np.int64)

TINY = 0.05
"""Share of the largest island's cells below which an island is no floor of a home."""


@dataclass(frozen=True)
class Body:
    """An upright cylinder that walks, m.

    Parameters
    ----------
    radius, height : float
        Of the cylinder.
    step_height : float
        The highest step that it takes, up or down.
    """

    radius: float = 0.2
    height: float = 1.5
    step_height: float = 0.2

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.step_height > 0.0 and self.height > 2.0 * self.step_height):
            raise ValueError(
                f"body has radius {self.radius}, height {self.height}, step_height {self.step_height} m; "
                "expected a radius and a step height above 0 and a height of more than two steps"
            )


@dataclass(frozen=True)
class Cells:
    """N cells, ordered by column and then by height; those of column c are ``start[c]:start[c + 1]``. None may be written to.

    Parameters
    ----------
    start : (nx * nz + 1,) int32
    ix, iz : (N,) int32
        Grid column.
    floor : (N,) float64 m
        Height of what the body stands on.
    neighbour : (N, 8) int32
        Cell in direction (STEP_X, STEP_Z), -1 where the way is barred. A diagonal needs both ways around it.
    away : (N, 2) float64
        Horizontal unit vector (x, z) away from the nearest obstacle, near obstacles; else 0.
    grounded : (N,) bool
        False on roofs: nothing above, something below.
    """

    start: npt.NDArray[np.int32]
    ix: npt.NDArray[np.int32]
    iz: npt.NDArray[np.int32]
    floor: npt.NDArray[np.float64]
    neighbour: npt.NDArray[np.int32]
    away: npt.NDArray[np.float64]
    grounded: npt.NDArray[np.bool_]

    def __post_init__(self) -> None:
        # Plain and read-only, be they made or memory maps of what was made before: compiled code is the same for both then.
        for field in fields(self):
            array = np.asarray(getattr(self, field.name)).view()
            array.flags.writeable = False
            object.__setattr__(self, field.name, array)

    def ground(self, grid: Grid) -> tuple[Any, ...]:
        """What compiled code is told of the surface, in one tuple that it unpacks in this order."""
        arrays = (self.start, self.ix, self.iz, self.floor, self.neighbour, self.away)
        return (*arrays, grid.origin_x, grid.origin_z, grid.cell, grid.nx, grid.nz)


def standing_cells(spans: Spans, grid: Grid, body: Body) -> Cells:
    """The cells where a body can stand, its whole radius clear of obstacles and ledges."""
    column = np.repeat(np.arange(grid.nx * grid.nz), np.diff(spans.start))
    above = np.append(spans.low[1:], np.inf)
    above[spans.start[1:][np.diff(spans.start) > 0] - 1] = np.inf
    stands = spans.walkable & (above - spans.high >= body.height)
    lowest = np.zeros(len(column), bool)
    lowest[spans.start[:-1][np.diff(spans.start) > 0]] = True
    grounded = lowest | np.isfinite(above)

    column, floor, ceiling = column[stands], spans.high[stands], above[stands]
    ix, iz = column % grid.nx, column // grid.nx
    start = _starts(column, grid.nx * grid.nz)
    sides = _connect(start, ix, iz, floor, ceiling, grid.nx, grid.nz, body.step_height, body.height)
    # A blocked cell may be filled up to its near border: the radius is kept from there.
    keep_clear = body.radius / grid.cell + 0.5
    source = _nearest_obstacle(sides, ix, iz, int(np.ceil(keep_clear)) + 3)
    offset = np.stack([ix, iz], axis=1) - source
    distance = np.where(source[:, 0] == _FAR, np.inf, np.hypot(offset[:, 0], offset[:, 1]))
    keep = distance >= keep_clear - 1e-9

    renumber = np.where(keep, np.cumsum(keep) - 1, -1)
    sides = np.where(sides[keep] >= 0, renumber[sides[keep]], -1)
    near = np.isfinite(distance) & (distance <= keep_clear + 2.0)
    away = np.where(near[:, None], offset / np.maximum(distance, 1.0)[:, None], 0.0)[keep]
    away[~np.isfinite(away)] = 0.0
    neighbour = _with_diagonals(sides)
    return Cells(
        _starts(column[keep], grid.nx * grid.nz).astype(np.int32),
        ix[keep].astype(np.int32),
        iz[keep].astype(np.int32),
        floor[keep],
        neighbour.astype(np.int32),
        _smooth(_smooth(away, neighbour), neighbour),
        grounded[stands][keep],
    )


def label_islands(cells: Cells) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Connected components: island of each cell (N,), and for each island its cells and its grounded cells, (K,) each.

    Islands are numbered by grounded cells less the others, then by cells, most first: 0 is the floor that a home is about.
    A ceiling seen from above has more cells than the floor, but of those only the eaves are grounded. Islands that are tiny beside
    the largest come after all others: the inside of a cupboard is grounded, and must not win over a floor under the open sky.
    """
    raw = _components(cells.neighbour)
    n = int(raw.max(initial=-1)) + 1
    size, grounded = np.bincount(raw, minlength=n), np.bincount(raw[cells.grounded], minlength=n)
    tiny = size < TINY * size.max(initial=0)
    order = np.lexsort((np.arange(n), -size, size - 2 * grounded, tiny))
    rank = np.empty(n, np.int32)
    rank[order] = np.arange(n)
    return rank[raw], size[order].astype(np.int64), grounded[order].astype(np.int64)


def _starts(column: npt.NDArray[np.int64], n_columns: int) -> npt.NDArray[np.int64]:
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(np.bincount(column, minlength=n_columns))]).astype(np.int64)


_FAR = np.int64(-(1 << 40))


@nb.njit(cache=True)
def _connect(start, ix, iz, floor, ceiling, nx, nz, step_height, height):  # type: ignore[no-untyped-def]
    """The four side neighbours (N, 4) of each cell; a body higher than two steps has at most one a side."""
    sides = np.full((len(ix), 4), -1, np.int64)
    for i in range(len(ix)):
        for d in range(4):
            x, z = ix[i] + STEP_X[d], iz[i] + STEP_Z[d]
            if x < 0 or z < 0 or x >= nx or z >= nz:
                continue
            c = z * nx + x
            for j in range(start[c], start[c + 1]):
                # A hair of slack: steps are often exactly as high as they may be.
                if (
                    abs(floor[j] - floor[i]) <= step_height + 1e-6
                    and min(ceiling[i], ceiling[j]) - max(floor[i], floor[j]) >= height
                ):
                    sides[i, d] = j
    return sides


@nb.njit(cache=True)
def _nearest_obstacle(sides, ix, iz, reach):  # type: ignore[no-untyped-def]
    """Grid column (N, 2) of the nearest blocked column, handed on from cell to cell over ``reach`` rings; _FAR beyond."""
    source = np.full((len(ix), 2), _FAR, np.int64)
    for i in range(len(ix)):
        for d in range(4):
            if sides[i, d] < 0:
                source[i, 0], source[i, 1] = ix[i] + STEP_X[d], iz[i] + STEP_Z[d]
    for _ in range(reach):
        changed = False
        following = source.copy()
        for i in range(len(ix)):
            best = (ix[i] - source[i, 0]) ** 2 + (iz[i] - source[i, 1]) ** 2 if source[i, 0] != _FAR else 1 << 60
            for d in range(4):
                side = sides[i, d]
                for turn in range(2):
                    # Side d, then the diagonal between sides d and d + 1.
                    j = side if turn == 0 or side < 0 else sides[side, (d + 1) % 4]
                    if j < 0 or source[j, 0] == _FAR:
                        continue
                    square = (ix[i] - source[j, 0]) ** 2 + (iz[i] - source[j, 1]) ** 2
                    if square < best:
                        best = square
                        following[i, 0], following[i, 1] = source[j, 0], source[j, 1]
                        changed = True
        source = following
        if not changed:
            break
    return source


@nb.njit(cache=True)
def _with_diagonals(sides):  # type: ignore[no-untyped-def]
    neighbour = np.full((len(sides), 8), -1, np.int64)
    for i in range(len(sides)):
        for d in range(4):
            e = (d + 1) % 4
            a, b = sides[i, d], sides[i, e]
            neighbour[i, d] = a
            if a >= 0 and b >= 0 and sides[a, e] >= 0 and sides[a, e] == sides[b, d]:
                neighbour[i, 4 + d] = sides[a, e]
    return neighbour


@nb.njit(cache=True)
def _smooth(away, neighbour):  # type: ignore[no-untyped-def]
    """Unit vectors averaged over each cell and its neighbours: the stairs that a slanted wall makes on the grid are evened out."""
    out = np.zeros_like(away)
    for i in range(len(away)):
        x, z = away[i, 0], away[i, 1]
        for d in range(8):
            j = neighbour[i, d]
            if j >= 0:
                x += away[j, 0]
                z += away[j, 1]
        length = np.sqrt(x * x + z * z)
        if length > 1e-6:
            out[i, 0], out[i, 1] = x / length, z / length
    return out


@nb.njit(cache=True)
def _components(neighbour):  # type: ignore[no-untyped-def]
    label = np.full(len(neighbour), -1, np.int64)
    stack = np.empty(len(neighbour), np.int64)
    n = 0
    for seed in range(len(neighbour)):
        if label[seed] >= 0:
            continue
        label[seed] = n
        stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            i = stack[depth]
            for d in range(4):
                j = neighbour[i, d]
                if j >= 0 and label[j] < 0:
                    label[j] = n
                    stack[depth] = j
                    depth += 1
        n += 1
    return label
