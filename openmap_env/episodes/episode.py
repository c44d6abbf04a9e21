"""An episode: a home, a place to start, what a person says, and everything that satisfies it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["object_goal", "demand", "language_guided"]
KINDS: tuple[Kind, ...] = ("object_goal", "demand", "language_guided")


@dataclass(frozen=True)
class Target:
    """One thing that satisfies the instruction; world frame, m. ``instance_id`` 0 = a place that is no instance."""

    instance_id: int
    centre: tuple[float, float, float]
    aabb_min: tuple[float, float, float]
    aabb_max: tuple[float, float, float]


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
        Everything that satisfies the instruction; at least one.
    info : dict
        What the source says beside that (reference path, category); plain JSON.
    """

    episode_id: str
    scene: str
    instruction: str
    kind: Kind
    start_position: tuple[float, float, float]
    start_heading: float
    targets: tuple[Target, ...]
    info: dict[str, Any] = field(default_factory=dict)
