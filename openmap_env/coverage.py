"""How much of a floor a walk came near."""

from __future__ import annotations

from collections.abc import Sequence

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.navigation.surface import NavigableSurface


def covered_share(surface: NavigableSurface, path: Sequence[npt.NDArray[np.float64]], radius: float) -> float:
    """Share of the island that holds the first place of a path, (3,) m each, that came within ``radius`` m in plain sight."""
    cells = [surface.locate(place) for place in path]
    island = int(surface.island[cells[0]]) if cells[0] >= 0 else -1
    stood = np.array(sorted({cell for cell in cells if cell >= 0 and surface.island[cell] == island}), np.int64)
    if len(stood) == 0:
        return 0.0
    covered = covered_cells(surface.cells.neighbour, stood, round(radius / surface.grid.cell))
    return float(np.count_nonzero(covered) / np.count_nonzero(surface.island == island))


# Which of a cell's eight neighbours lies in direction (1 + sign of x, 1 + sign of z); see ``navigation.cells.STEP_X``.
_SIDE = np.array([[6, 2, 5], [3, -1, 1], [7, 0, 4]], np.int64)


@nb.njit(cache=True)
def covered_cells(neighbour, stood, reach):  # type: ignore[no-untyped-def]
    """Which of N cells (N,) bool are in plain sight of one of the cells ``stood``, at most ``reach`` cells away.

    From each, straight lines go to the border of the square of side 2 reach + 1 around it, cell by cell (Bresenham 1965),
    until the way is barred, ``neighbour`` (N, 8) being -1, or they are too long.
    """
    covered = np.zeros(len(neighbour), np.bool_)
    for k in range(len(stood)):
        covered[stood[k]] = True
        for edge in range(8 * reach):
            side, along = edge // (2 * reach), edge % (2 * reach) - reach
            x, z = along, reach
            for _ in range(side):
                x, z = z, -x
            cell, at_x, at_z = stood[k], 0, 0
            for i in range(1, reach + 1):
                to_x, to_z = _rounded(x * i, reach), _rounded(z * i, reach)
                if to_x * to_x + to_z * to_z > reach * reach:
                    break
                cell = neighbour[cell, _SIDE[1 + to_x - at_x, 1 + to_z - at_z]]
                if cell < 0:
                    break
                covered[cell] = True
                at_x, at_z = to_x, to_z
    return covered


@nb.njit(cache=True)
def _rounded(a, b):  # type: ignore[no-untyped-def]
    """a / b, b > 0, to the nearest integer, halves away from 0."""
    return (2 * abs(a) + b) // (2 * b) * (1 if a >= 0 else -1)
