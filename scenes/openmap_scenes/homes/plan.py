"""Floor plans by seed: rooms of a home with doors that connect them all, windows, and the leaves of doors that stand open."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.doors import add_balcony_doors, add_doors, add_front_door, add_leaves, add_windows
from openmap_scenes.homes.layout import ROOM_KINDS, SECOND_NAMES, draw_layout
from openmap_scenes.homes.rooms import CEILING, CLEARANCE, DOOR_HEIGHT, OUTER, WALL, Leaf, Opening, Plan, Rect, Side

__all__ = [
    "CEILING", "CLEARANCE", "DOOR_HEIGHT", "OUTER", "ROOM_KINDS", "WALL", "Leaf", "Opening", "Plan", "Rect", "Side",
    "make_plan",
]  # fmt: skip


def make_plan(rng: np.random.Generator) -> Plan:
    """A random plan of 2 to 8 rooms, usable and all connected."""
    for _ in range(4000):
        layout = draw_layout(rng)
        if layout is None:
            continue
        kinds, rects = layout
        plan = Plan(list(kinds), rects, kinds=kinds, ceiling=round(float(rng.uniform(2.4, 2.9)), 2))
        if not (add_doors(plan, rng) and add_front_door(plan, rng)):
            continue
        if _odd(plan) and rng.random() < 0.8:
            continue
        plan.names = _names(plan)
        add_balcony_doors(plan, rng)
        add_windows(plan, rng)
        add_leaves(plan, rng)
        return plan
    raise RuntimeError("no usable floor plan in 4000 attempts")


def _odd(plan: Plan) -> bool:
    """Whether a bathroom opens from a day room though there is a hall, or a private room from the dining room or kitchen."""
    for o in plan.openings:
        pair = {plan.kinds[r] for r in o.rooms if r >= 0}
        if "bathroom" in pair and "hall" in plan.kinds and pair & {"living room", "studio"}:
            return True
        if pair & {"dining room", "kitchen"} and pair & {"bedroom", "bathroom", "office", "children's room"}:
            return True
    return False


def _names(plan: Plan) -> list[str]:
    """What people would call the rooms: the second of a kind is the smaller one, or the one that a bedroom leads to."""
    names = list(plan.kinds)
    for kind, second in SECOND_NAMES.items():
        rooms = sorted((i for i, k in enumerate(plan.kinds) if k == kind), key=lambda i: -plan.rects[i].area)
        if len(rooms) < 2:
            continue
        suite = [r for r in rooms if kind == "bathroom" and _opens_to_bedroom(plan, r)]
        other = suite[0] if suite else rooms[1]
        names[other] = "en suite bathroom" if suite else second
    return names


def _opens_to_bedroom(plan: Plan, room: int) -> bool:
    return any(
        o.kind == "door" and room in o.rooms and plan.kinds[sum(o.rooms) - room] == "bedroom" for o in plan.openings
    )
