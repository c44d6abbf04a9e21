"""Rooms of a map, by geometry: what walls part.

The walls' points, seen from above, divide the floor; a doorway is narrower than a room, so the cells that are farther from any wall
than half a doorway fall into one piece for each room, and the others go to the piece whose slope they lie on (watershed of the
distance to the walls). Nothing is named here: which room is a kitchen is told by what stands in it (``scoring.py``).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from skimage.segmentation import watershed

from openmap_agents.mapping.instance_map import InstanceMap

CELL = 0.1
"""Edge of a cell, m."""
HALF_DOORWAY = 0.55
"""Floor farther from the walls than this is no doorway, m."""
WALL_FROM, WALL_TO = 0.3, 2.4
"""Heights above the floor between which points speak of walls, m ..."""
WALL_RISE = 1.0
"""... if those of one cell span this much, m."""
MOST_CELLS = 4_000_000
"""A plan of more cells (200 m x 200 m) is that of no home, but of points gone astray: then nothing is claimed."""
LEAST_ROOM = 1.0
"""m^2 of core floor."""
MARGIN = 1.0
"""Ground around the house, so that outdoors is one piece, m."""
ABOUT = 0.3
"""How far around a thing one looks for the room that it is in, m."""


def rooms_of(instance_map: InstanceMap, walls: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Which room (M,) every instance stands in or hangs in, from 1; 0 = none found.

    Parameters
    ----------
    instance_map : InstanceMap
        M instances, Y up.
    walls : (M,) bool
        Which of them are built structure.
    """
    rooms = np.zeros(len(instance_map), np.int64)
    built = [i.points for i, is_wall in zip(instance_map.instances, walls, strict=True) if is_wall]
    if not built:
        return rooms
    points = np.concatenate(built).astype(np.float64)
    points = points[np.isfinite(points).all(1)]
    if not len(points):
        return rooms
    height = points[:, 1] - np.percentile(points[:, 1], 2)
    upright = points[(height > WALL_FROM) & (height < WALL_TO)]
    if not len(upright):
        return rooms
    origin = points[:, [0, 2]].min(0) - MARGIN
    x, z = ((points[:, [0, 2]].max(0) + MARGIN - origin) / CELL).astype(np.int64) + 1
    if x * z > MOST_CELLS:
        return rooms
    pieces = _pieces(_wall_cells(upright, origin, (int(x), int(z))))
    outdoors = pieces[0, 0]
    for n, instance in enumerate(instance_map.instances):
        # A picture or a window has its centre inside of a wall: its room is what lies around it.
        low = ((instance.aabb_min[[0, 2]] - origin - ABOUT) / CELL).astype(int).clip(0)
        high = ((instance.aabb_max[[0, 2]] - origin + ABOUT) / CELL).astype(int).clip(0)
        votes = np.bincount(pieces[low[0] : high[0] + 1, low[1] : high[1] + 1].ravel(), minlength=1)
        votes[[0, min(outdoors, len(votes) - 1)]] = 0
        rooms[n] = votes.argmax() if votes.any() else 0
    # Where walls part nothing, they tell nothing.
    return rooms if len(np.unique(rooms[rooms > 0])) > 1 else np.zeros_like(rooms)


def _wall_cells(
    upright: npt.NDArray[np.float64], origin: npt.NDArray[np.float64], shape: tuple[int, int]
) -> npt.NDArray[np.bool_]:
    """Cells whose points span ``WALL_RISE``."""
    cells = ((upright[:, [0, 2]] - origin) / CELL).astype(int)
    low, high = np.full(shape, np.inf), np.full(shape, -np.inf)
    np.minimum.at(low, (cells[:, 0], cells[:, 1]), upright[:, 1])
    np.maximum.at(high, (cells[:, 0], cells[:, 1]), upright[:, 1])
    return np.asarray(high - low > WALL_RISE)


def _pieces(walls: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Rooms of a plan of walls; outdoors is one too."""
    away = ndimage.distance_transform_edt(~walls) * CELL
    cores, count = ndimage.label(away > HALF_DOORWAY)
    sizes = ndimage.sum_labels(np.ones_like(cores), cores, np.arange(count + 1)) * CELL**2
    cores[(sizes < LEAST_ROOM)[cores]] = 0
    if not cores.any():
        return np.zeros(walls.shape, np.int64)
    return np.asarray(watershed(-away, cores), np.int64)
