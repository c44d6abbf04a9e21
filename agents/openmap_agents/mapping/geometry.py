"""Which instances are the house itself: floors, ceilings and walls, told by shape alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.instance_map import MapInstance

_FLAT = 0.08  # rms distance from the plane, m
_TILT = np.cos(np.radians(15.0))


def mark_structure(instances: list[MapInstance]) -> list[MapInstance]:
    """The same instances with ``is_structure`` set.

    Floor or ceiling: flat, level, at least 1.5 m2, within 0.25 m of the lowest or highest of what such planes reach. Wall: flat and
    upright, or several metres across both ways, and at least 80 % of the height between floor and ceiling (and 1.8 m).
    """
    if not instances:
        return []
    heights = np.concatenate([i.points[:, 1] for i in instances])
    low, high = np.quantile(heights, (0.005, 0.995))
    return [replace(i, is_structure=_is_structure(i.points, float(low), float(high))) for i in instances]


def _is_structure(points: npt.NDArray[np.float32], low: float, high: float) -> bool:
    if len(points) < 16:
        return False
    centred = points.astype(np.float64) - points.mean(axis=0)
    variance, axes = np.linalg.eigh(centred.T @ centred / len(points))
    normal_up, flat = abs(float(axes[1, 0])), float(np.sqrt(max(variance[0], 0.0))) < _FLAT
    extent = points.max(axis=0) - points.min(axis=0)
    if flat and normal_up > _TILT:
        height = float(np.median(points[:, 1]))
        at_end = height < low + 0.25 or (height > high - 0.25 and high - low > 1.8)
        return at_end and float(extent[0] * extent[2]) >= 1.5
    room_high = float(extent[1]) >= max(1.8, 0.8 * (high - low))
    upright = flat and normal_up < np.sqrt(1 - _TILT**2) and float(np.hypot(extent[0], extent[2])) >= 1.0
    return room_high and (upright or float(min(extent[0], extent[2])) >= 2.0)
