"""The way to fixed goals from everywhere: one search, then every distance is a look-up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.navigation.geodesic import NO_ANCHOR, distance_at, distances
from openmap_env.navigation.motion import locate, nearest

if TYPE_CHECKING:
    from openmap_env.navigation.surface import NavigableSurface

Point = npt.NDArray[np.float64]
SNAP_DISTANCE = 0.5
"""Places at most this far, m, from the surface are taken for the nearest place on it."""


class DistanceField:
    """The way to the nearest of fixed goals from everywhere; a look-up costs no search.

    Parameters
    ----------
    surface : NavigableSurface
    goals : (G, 3) float64 m
        On the surface.
    until : int
        Search no further than to this cell; -1 = everywhere.

    Raises
    ------
    ValueError
        A goal is not on the surface, or there is none.
    """

    def __init__(self, surface: NavigableSurface, goals: Point, until: int = -1) -> None:
        goals = np.array(goals, np.float64).reshape(-1, 3)
        cells = np.array([surface.locate(g) for g in goals], np.int64)
        if len(goals) == 0 or (cells < 0).any():
            off = goals[cells < 0][:1].tolist()
            raise ValueError(f"goals are {off or 'none'}, expected places on the navigable surface; snap them first")
        self.surface, self.goals = surface, goals
        found = distances(surface.ground, surface.centres, surface.body.step_height, goals, cells, until)
        self._distance, self._anchor = found
        self.way = (surface.centres, *found, goals, cells)
        """What compiled code is told of the field; see ``geodesic.distance_at``."""

    def distance(self, position: npt.ArrayLike) -> float:
        """Metres from a position (3,) m (snapped if it is off the surface) to the nearest goal; inf where there is no way."""
        s = self.surface
        x, y, z = xyz(position)
        d, _, _, _, _, _ = look_up(s.ground, self.way, s.island, s.body.step_height, s.reach, SNAP_DISTANCE, x, y, z)
        return float(d)

    def distances(self, positions: npt.ArrayLike) -> Point:
        """``distance`` of each of (n, 3) positions, (n,) float64 m."""
        p = np.ascontiguousarray(positions, np.float64)
        if p.ndim != 2 or p.shape[1] != 3 or not np.isfinite(p).all():
            raise ValueError(f"positions have shape {p.shape}, expected finite numbers of shape (n, 3)")
        s = self.surface
        found = _look_up_all(s.ground, self.way, s.island, s.body.step_height, s.reach, SNAP_DISTANCE, p)
        return np.asarray(found, np.float64)

    def path(self, position: npt.ArrayLike) -> Point:
        """Corners (n, 3) m from a position (3,) m to the nearest goal, both ends included.

        Raises
        ------
        ValueError
            There is no way.
        """
        s = self.surface
        p = xyz(position)
        _, anchor, cell, *place = look_up(s.ground, self.way, s.island, s.body.step_height, s.reach, SNAP_DISTANCE, *p)
        if cell < 0 or anchor == NO_ANCHOR:
            raise ValueError(f"no goal can be reached from {list(p)}")
        corners = [np.array(place)]
        while anchor >= 0:
            corners.append(s.centres[anchor])
            anchor = int(self._anchor[anchor])
        return np.array([*corners, self.goals[-1 - anchor]])


def xyz(position: npt.ArrayLike) -> tuple[float, float, float]:
    """A position (3,) as three finite floats.

    Raises
    ------
    ValueError
        It is none.
    """
    p = np.asarray(position, np.float64)
    if p.shape == (3,):
        x, y, z = p.tolist()
        # A sum is finite where its terms are, whatever home they are in.
        if -np.inf < x + y + z < np.inf:
            return x, y, z
    raise ValueError(f"position is {position!r}, expected three finite numbers")


@nb.njit(cache=True)
def look_up(ground, way, island, slack, reach, limit, x, y, z):  # type: ignore[no-untyped-def]
    """Distance, next corner, cell, and the place x, y, z there at which a body that is said to be at (x, y, z) stands."""
    cell = locate(ground, x, y, z, reach)
    if cell < 0:
        x, z, cell = nearest(ground, island, -1, x, y, z, reach, limit)
        if cell < 0:
            return np.inf, NO_ANCHOR, cell, x, y, z
    y = ground[3][cell]
    distance, anchor = distance_at(ground, way, slack, np.array((x, y, z)), cell)
    return distance, anchor, cell, x, y, z


@nb.njit(cache=True)
def _look_up_all(ground, way, island, slack, reach, limit, positions):  # type: ignore[no-untyped-def]
    out = np.empty(len(positions))
    for i in range(len(positions)):
        p = positions[i]
        out[i] = look_up(ground, way, island, slack, reach, limit, p[0], p[1], p[2])[0]
    return out
