"""Which instances are the house itself: floors, ceilings and walls, told by shape alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.instance_map import MapInstance

_FLAT = 0.08  # rms distance from the plane, m
_TILT = np.cos(np.radians(15.0))


def mark_structure(instances: list[MapInstance]) -> list[MapInstance]:
    """The same instances with ``is_structure`` set.

    Floor or ceiling: flat, level, at least 1.5 m2, within 0.25 m of the lowest or highest of all points; a floor within the box of
    a larger one is a rug. Wall: flat, upright, and 1.3 m wide and 70 % of the height between floor and ceiling (at least 1.8 m), or
    4 m wide; or several walls in one: as high, and 2 m both ways. Shape cannot tell a curtain as large as a wall.
    """
    if not instances:
        return []
    heights = np.concatenate([i.points[:, 1] for i in instances])
    low, high = (float(q) for q in np.quantile(heights, (0.005, 0.995)))
    kinds = [_kind(i, low, high) for i in instances]
    return [
        replace(i, is_structure=kind is not None and not _lies_on_another(i, kind, instances, kinds))
        for i, kind in zip(instances, kinds, strict=True)
    ]


Kind = Literal["floor", "ceiling", "wall"] | None


def _kind(instance: MapInstance, low: float, high: float) -> Kind:
    points = instance.points
    if len(points) < 16:
        return None
    centred = points.astype(np.float64) - points.mean(axis=0)
    variance, axes = np.linalg.eigh(centred.T @ centred / len(points))
    normal_up, flat = abs(float(axes[1, 0])), float(np.sqrt(max(variance[0], 0.0))) < _FLAT
    width, height, length = (float(e) for e in instance.aabb_max - instance.aabb_min)
    if flat and normal_up > _TILT:
        level = float(np.median(points[:, 1]))
        if width * length < 1.5:
            return None
        if level < low + 0.25:
            return "floor"
        return "ceiling" if level > high - 0.25 and high - low > 1.8 else None
    across, room_high = float(np.hypot(width, length)), height >= max(1.8, 0.7 * (high - low))
    if flat and normal_up < np.sqrt(1 - _TILT**2) and (across >= 4.0 or (room_high and across >= 1.3)):
        return "wall"
    return "wall" if room_high and min(width, length) >= 2.0 else None


def _lies_on_another(instance: MapInstance, kind: Kind, instances: list[MapInstance], kinds: list[Kind]) -> bool:
    if kind != "floor":
        return False
    low, high = _footprint(instance)
    for other, other_kind in zip(instances, kinds, strict=True):
        if other is not instance and other_kind == "floor":
            other_low, other_high = _footprint(other)
            larger = float(np.prod(other_high - other_low)) > 1.2 * float(np.prod(high - low))
            if larger and (other_low <= low + 0.1).all() and (other_high >= high - 0.1).all():
                return True
    return False


def _footprint(instance: MapInstance) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    return instance.aabb_min[[0, 2]], instance.aabb_max[[0, 2]]
