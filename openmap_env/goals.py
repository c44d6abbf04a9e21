"""Where to stand to have reached a target: the navigable places that touch it, or touch what it stands on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from openmap_env.navigation.surface import DistanceField, NavigableSurface
from openmap_scenes import Room, Scene

if TYPE_CHECKING:
    # The episodes' package makes episodes with this module: it must be importable before them.
    from openmap_env.episodes.episode import Target

ARM = 0.1
"""Places this much farther from a target than the nearest one, m, still count as touching it."""
REACH = 2.0
"""A target farther than this from every place to stand, m on the floor plan, cannot be reached."""
STOREY = 3.2
"""Nothing on one storey is higher above its floor than this, m."""


def target_room(scene: Scene, target: Target) -> Room | None:
    """The room a target is in: its instance's, else the smallest that holds its centre, else None."""
    instance = next((i for i in scene.instances if i.id == target.instance_id), None)
    room = None if instance is None else next((r for r in scene.rooms if r.id == instance.room), None)
    return room or scene.room_of(target.centre)


def places_at(surface: NavigableSurface, scene: Scene, target: Target, island: int) -> npt.NDArray[np.float64]:
    """Places (n, 3) m, world frame, on an island of the surface at which a body touches a target; n may be 0.

    Of all cells below the target's middle, on its storey and, where its room is known, in that room (a wall's far side may
    be nearer than its own), those whose distance to the target's box on the floor plan is smallest, and up to ``ARM`` more.
    """
    centre, low, high = (np.asarray(v, np.float64) for v in (target.centre, target.aabb_min, target.aabb_max))
    places = surface.centres
    height = centre[1] - places[:, 1]
    usable = (surface.island == island) & (height >= -surface.body.step_height) & (height <= STOREY)
    room = target_room(scene, target)
    if room is not None:
        inside = np.all((places >= room.aabb_min - 0.1) & (places <= room.aabb_max + 0.1), axis=1)
        usable = usable & inside if np.any(usable & inside) else usable
    places = places[usable]
    if len(places) == 0:
        return np.empty((0, 3))
    outside = np.maximum(np.maximum(low - places, places - high), 0.0)
    gap = np.hypot(outside[:, 0], outside[:, 2])
    touching = gap <= gap.min() + ARM if gap.min() <= REACH else np.zeros(len(gap), bool)
    return np.asarray(places[touching], np.float64)


def way_to(surface: NavigableSurface, scene: Scene, targets: Sequence[Target], island: int) -> DistanceField | None:
    """The way from everywhere on an island to the nearest target, or None if none can be reached."""
    places = [places_at(surface, scene, target, island) for target in targets]
    goals = np.concatenate(places) if places else np.empty((0, 3))
    return DistanceField(surface, goals) if len(goals) else None
