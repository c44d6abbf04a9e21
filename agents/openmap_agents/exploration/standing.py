"""Where to stand to have reached a thing: beside it, where it is in plain sight, and not behind the wall that it leans on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_agents.exploration.occupancy import OCCUPIED, Cell, OccupancyMap
from openmap_agents.exploration.views import sees
from openmap_agents.exploration.walker import Ways


def standing_place(
    occupancy: OccupancyMap,
    ways: Ways,
    points: npt.NDArray[np.floating],
    *,
    arm: float = 0.1,
    reach: float = 0.7,
    tall: float = 1.1,
) -> tuple[Cell, bool] | None:
    """The reachable cell from which to say "here it is", and whether the thing is seen from there; None = nothing is in reach.

    Parameters
    ----------
    points : (n, 3) float m
        Of the thing, in the frame of the map.
    arm : float
        Places this much farther from the thing than the nearest one count as beside it, m.
    reach : float
        Where the thing is not seen from beside it, places up to this much farther are tried too, m.
    tall : float
        What reaches higher than this above the floor hides what is behind it, m.
    """
    reachable = np.argwhere(np.isfinite(ways.distance))
    if not len(reachable) or not len(points):
        return None
    places = (reachable[:, ::-1] + 0.5) * occupancy.resolution + occupancy.origin
    gap, nearest = cKDTree(points[:, [0, 2]]).query(places)
    opaque = (ways.grid == OCCUPIED) & (occupancy.top > tall)
    own = occupancy.cells(points)
    opaque[own[:, 0], own[:, 1]] = False  # A thing does not hide itself.
    goals = np.floor((points[nearest][:, [2, 0]] - occupancy.origin[::-1]) / occupancy.resolution).astype(np.int64)
    inside = np.all((goals >= 0) & (goals < opaque.shape), axis=1)
    cost = ways.distance[reachable[:, 0], reachable[:, 1]]
    for slack in (arm, 0.5 * (arm + reach), reach):
        near = np.flatnonzero((gap <= gap.min() + slack) & inside)
        for k in near[np.argsort(cost[near], kind="stable")]:
            here = (int(reachable[k, 0]), int(reachable[k, 1]))
            if sees(here, (int(goals[k, 0]), int(goals[k, 1])), opaque):
                return here, True
    beside = np.flatnonzero(gap <= gap.min() + arm)
    row, column = reachable[beside[np.argmin(cost[beside])]].tolist()
    return (row, column), False
