"""Rooms for a format that only numbers them: their extent, storey and, where their contents tell it, what they are called."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from openmap_scenes.scene import Instance, Room
from openmap_scenes.taxonomy import labels_of

# Floors farther apart than that are two storeys, m; sunken living rooms and landings are not.
STOREY = 1.8
# What stands in, hangs on or makes a wall may lie outside the floor's outline.
_ON_WALLS = {
    *("wall", "window", "door", "picture", "mirror", "curtain", "blinds", "fireplace", "board_panel", "ceiling"),
    *("column", "railing", "stairs", "beam"),
}
# ScanNet200 names of things that only one kind of room has.
_TELLING = {
    "bedroom": ("bed",),
    "bathroom": ("toilet", "bathtub", "shower", "shower head", "bathroom vanity", "shower curtain"),
    "kitchen": ("stove", "oven", "dishwasher", "range hood", "kitchen cabinet", "kitchen counter"),
}
# What a room is where none of the above is in it, first hit first.
_OTHERWISE = (("couch", "living room"), ("dining table", "dining room"), ("washing machine", "laundry room"))


def make_rooms(instances: Sequence[Instance]) -> list[Room]:
    """One room for each region that an instance is in, ascending by number.

    The box stands on the floor's outline (that of the ceiling where no floor is annotated), grown to hold the centres of what
    stands in the room, and reaches from the lowest to the highest point of its floor, walls and ceiling.
    """
    members: dict[int, list[Instance]] = defaultdict(list)
    for instance in instances:
        if instance.room is not None:
            members[instance.room].append(instance)
    boxes = {number: _box(group) for number, group in sorted(members.items())}
    levels = _levels({number: float(low[1]) for number, (low, _) in boxes.items()})
    return [Room(n, _name(n, members[n]), low, high, levels[n]) for n, (low, high) in boxes.items()]


def _box(group: list[Instance]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    by_class: dict[str | None, list[Instance]] = defaultdict(list)
    for instance in group:
        # Rugs are of the floor's class, but no outline of it.
        is_cover = instance.mpcat40 == "floor" and instance.scannet200 != "floor"
        by_class["cover" if is_cover else instance.mpcat40].append(instance)
    ground = by_class["floor"] or by_class["ceiling"] or by_class["wall"] or group
    standing = [i.centre for i in group if i.mpcat40 not in _ON_WALLS]
    across = np.array([*(i.aabb_min for i in ground), *(i.aabb_max for i in ground), *standing])
    shell = by_class["floor"] + by_class["wall"] + by_class["ceiling"] or group
    tall = np.array([[i.aabb_min[1], i.aabb_max[1]] for i in shell])
    low, high = across.min(0), across.max(0)
    low[1], high[1] = tall[:, 0].min(), tall[:, 1].max()
    return low, high


def _levels(floor_height: dict[int, float]) -> dict[int, int]:
    """Storey of each room by the height of its floor, 0 = lowest; a gap of ``STOREY`` between floors starts a new one."""
    levels: dict[int, int] = {}
    level, below = 0, None
    for number, height in sorted(floor_height.items(), key=lambda item: (item[1], item[0])):
        if below is not None and height - below > STOREY:
            level += 1
        levels[number], below = level, height
    return levels


def _name(number: int, group: list[Instance]) -> str:
    """What a room is called where one kind of room alone has such things; else "region <number>"."""
    things = {labels_of(instance.category).scannet200 for instance in group}
    told = [name for name, signs in _TELLING.items() if not things.isdisjoint(signs)]
    if len(told) == 1 and (told == ["bedroom"] or "couch" not in things):
        return told[0]
    if not told:
        for sign, name in _OTHERWISE:
            if sign in things:
                return name
    return f"region {number}"
