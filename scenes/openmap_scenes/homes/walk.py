"""Where a body can walk in a furnished plan."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation, label

from openmap_scenes.homes.items import Item
from openmap_scenes.homes.placement import BODY_HEIGHT, BODY_RADIUS, CELL
from openmap_scenes.homes.plan import Plan


def standing_places(plan: Plan, items: list[Item]) -> npt.NDArray[np.float64] | None:
    """Where a body of 0.2 m can stand that walks through all rooms: (N, 2) x, z m of a 5 cm grid; None where a room is cut off."""
    out = plan.outline
    shape = int(np.ceil(out.depth / CELL)), int(np.ceil(out.width / CELL))
    solid = np.ones(shape, bool)

    def cells(x0: float, z0: float, x1: float, z1: float) -> tuple[slice, slice]:
        x = np.clip(np.round((np.array([x0, x1]) - out.x0) / CELL), 0, shape[1]).astype(int)
        z = np.clip(np.round((np.array([z0, z1]) - out.z0) / CELL), 0, shape[0]).astype(int)
        return slice(z[0], z[1]), slice(x[0], x[1])

    inner = [plan.inner(room) for room in range(len(plan.names))]
    for r in inner:
        solid[cells(r.x0, r.z0, r.x1, r.z1)] = False
    for o in plan.openings:
        if o.kind == "door":
            z = o.zone(CELL)
            solid[cells(z.x0, z.z0, z.x1, z.z1)] = False
    blocks = [leaf.footprint for leaf in plan.leaves]
    blocks += [item.footprint for item in items if item.low[1] < BODY_HEIGHT and item.high[1] > 0.03]
    for f in blocks:
        solid[cells(f.x0, f.z0, f.x1, f.z1)] = True
    n = round(BODY_RADIUS / CELL)
    disc = np.hypot(*np.mgrid[-n : n + 1, -n : n + 1]) <= n + 1e-6
    areas, _ = label(~binary_dilation(solid, disc, border_value=1))
    found = [set(np.unique(areas[cells(r.x0, r.z0, r.x1, r.z1)]).tolist()) - {0} for r in inner]
    common = set.intersection(*found)
    if not common:
        return None
    rows, columns = np.nonzero(np.isin(areas, sorted(common)))
    return np.stack([out.x0 + (columns + 0.5) * CELL, out.z0 + (rows + 0.5) * CELL], 1)
