"""An episode: a home, a place to start, what a person says, and everything that satisfies it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from openmap_scenes import Instance

Point = tuple[float, float, float]
Kind = Literal["object_goal", "demand", "language_guided"]
KINDS: tuple[Kind, ...] = ("object_goal", "demand", "language_guided")


@dataclass(frozen=True)
class Target:
    """One thing that satisfies the instruction; world frame, m. ``instance_id`` 0 = a place that is no instance."""

    instance_id: int
    centre: Point
    aabb_min: Point
    aabb_max: Point


@dataclass(frozen=True)
class Episode:
    """One question to an agent.

    Parameters
    ----------
    episode_id : str
    scene : str
        Catalogue spec.
    instruction : str
    kind : Kind
    start_position : (3,) m, world frame, on the floor
    start_heading : float
        Radians about +Y; 0 looks along -Z, positive turns left.
    targets : tuple of Target
        Everything that satisfies the instruction; at least one, except where a file names a category alone and the scene has
        yet to say what is of it (``readers.complete``).
    info : dict
        What the source says beside that (reference path, category); plain JSON.
    """

    episode_id: str
    scene: str
    instruction: str
    kind: Kind
    start_position: Point
    start_heading: float
    targets: tuple[Target, ...]
    info: dict[str, Any] = field(default_factory=dict)


def target_of(instance: Instance) -> Target:
    """An instance as a target."""

    def triple(v: npt.NDArray[np.float64]) -> Point:
        return float(v[0]), float(v[1]), float(v[2])

    return Target(instance.id, triple(instance.centre), triple(instance.aabb_min), triple(instance.aabb_max))


def place(position: Point) -> Target:
    """A position as a target that is no instance."""
    return Target(0, position, position, position)


def same_box(target: Target, instance: Instance, tolerance: float = 0.01) -> bool:
    """Whether a target's centre and box are those of an instance, each coordinate within ``tolerance`` m."""
    pairs = (
        (target.centre, instance.centre),
        (target.aabb_min, instance.aabb_min),
        (target.aabb_max, instance.aabb_max),
    )
    return all(abs(a - float(b)) <= tolerance for ours, theirs in pairs for a, b in zip(ours, theirs, strict=True))
