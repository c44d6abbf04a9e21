"""Doors of a plan: which rooms they join, where they lie in their walls, and which way their leaves stand open.

As architects draw it: the hall and the day rooms (living, dining, kitchen, studio) join each other and everything else hangs
on them; a bedroom, a bathroom, an office, a children's room or a laundry has one door and leads nowhere, but for a bathroom
that belongs to a bedroom.
"""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.rooms import DOOR_HEIGHT, WALL, Leaf, Opening, Plan, Rect, Side

DAY = ("living room", "kitchen", "dining room", "studio")
PUBLIC = (*DAY, "hall")
# What lies between a door's edge and the corner of the room: the casing and a hand's breadth, m.
JAMB = 0.14
LINING, THICK, KNOB = 0.015, 0.04, 0.055
HINGE_OFF = 0.018


def add_doors(plan: Plan, rng: np.random.Generator) -> bool:
    """A cheapest tree of doors over all rooms and some more where they make sense; False where rooms stay apart."""
    edges = []
    for i in range(len(plan.rects)):
        for j in range(i + 1, len(plan.rects)):
            cost = _cost(plan, i, j)
            if cost is not None and plan.contact(i, j) is not None:
                edges.append((cost + float(rng.uniform(0, 0.25)), i, j))
    group, ends = list(range(len(plan.rects))), [0] * len(plan.rects)
    broad, suites = rng.random() < 0.6, 0
    for cost, i, j in sorted(edges):
        # One bathroom may be a bedroom's own; the other is everybody's.
        if _suite(plan, i, j) and suites:
            continue
        if any(ends[k] and plan.kinds[k] not in PUBLIC and not _suite(plan, i, j) for k in (i, j)):
            continue
        joins = group[i] != group[j]
        if not joins and not (cost < 0.6 and _public(plan, i, j) and rng.random() < 0.6):
            continue
        door = _door(plan, i, j, broad, rng)
        if door is None:
            continue
        plan.openings.append(door)
        suites += _suite(plan, i, j)
        if joins:
            group = [group[i] if g == group[j] else g for g in group]
        ends[i], ends[j] = ends[i] + 1, ends[j] + 1
    return len(set(group)) == 1


def _public(plan: Plan, i: int, j: int) -> bool:
    return plan.kinds[i] in PUBLIC and plan.kinds[j] in PUBLIC


def _suite(plan: Plan, i: int, j: int) -> bool:
    """Whether the two are a bedroom and a bathroom that is not the only one."""
    return {plan.kinds[i], plan.kinds[j]} == {"bedroom", "bathroom"} and plan.kinds.count("bathroom") > 1


def _cost(plan: Plan, i: int, j: int) -> float | None:
    """How odd a door between two rooms is: 0 = a matter of course, None = never."""
    pair = {plan.kinds[i], plan.kinds[j]}
    if "hall" in pair:
        return 0.3 if _suite_bath(plan, i, j) else 0.1
    if pair <= set(DAY):
        return 0.2
    if pair == {"kitchen", "laundry room"}:
        return 0.3
    if _suite(plan, i, j):
        return 0.3
    if not pair & set(PUBLIC) or pair == {"kitchen", "bathroom"}:
        return None
    return 0.6 if pair & {"living room", "studio"} else 1.2


def _suite_bath(plan: Plan, i: int, j: int) -> bool:
    """Whether one of the two is a second bathroom that lies beside a bedroom."""
    return any(
        plan.kinds[k] == "bathroom"
        and any(_suite(plan, k, b) and plan.contact(k, b) is not None for b in range(len(plan.kinds)))
        for k in (i, j)
    )


def _door(plan: Plan, i: int, j: int, broad: bool, rng: np.random.Generator) -> Opening | None:
    """A hole in the wall between two rooms, clear of the other openings in it."""
    contact = plan.contact(i, j)
    if contact is None:
        return None
    axis, at, start, end = contact
    low, high = start + JAMB, end - JAMB
    day = plan.kinds[i] in DAY and plan.kinds[j] in DAY
    if broad and day and high - low > 1.6 and rng.random() < 0.75:
        width = round(min(float(rng.uniform(1.4, 2.2)), high - low), 2)
        a = (low + high - width) / 2
        if _clear(plan, axis, at, a, a + width):
            return Opening("door", (i, j), axis, at, a, a + width, 0.0, DOOR_HEIGHT + 0.1, wide=True)
    width = round(float(rng.uniform(0.88, 1.0)), 2)
    if high - low < width:
        return None
    # Near an end of the wall, so that a long stretch stays for furniture.
    slack = high - low - width
    spots = [low + min(slack, float(rng.uniform(0.0, 0.2))), high - width - min(slack, float(rng.uniform(0.0, 0.2)))]
    if rng.random() < 0.5:
        spots.reverse()
    for a in [*spots, *(low + slack * float(t) for t in rng.uniform(0, 1, 4))]:
        if _clear(plan, axis, at, a, a + width):
            return Opening("door", (i, j), axis, at, a, a + width, 0.0, DOOR_HEIGHT)
    return None


def _clear(plan: Plan, axis: str, at: float, start: float, end: float) -> bool:
    """Whether no opening of the same wall line lies within 0.3 m."""
    return not any(
        o.axis == axis and abs(o.at - at) < 1e-6 and o.start < end + 0.3 and start < o.end + 0.3 for o in plan.openings
    )


def add_front_door(plan: Plan, rng: np.random.Generator) -> bool:
    """The way in: into the hall where there is one, in a short stretch of wall rather than in a long one."""
    for kind in ("hall", "living room", "studio", "dining room", "kitchen"):
        spans = [
            (b - a, side, a, b)
            for room, k in enumerate(plan.kinds)
            if k == kind
            for side in plan.sides(room)
            for a, b in plan.open_spans(side)
            if b - a > 0.95 + 2 * JAMB
        ]
        for _, side, a, b in sorted(spans, key=lambda s: s[0]):
            at = a + JAMB + float(rng.uniform(0.0, min(0.5, b - a - 0.95 - 2 * JAMB)))
            door = Opening("front door", (side.room, -1), side.axis, side.middle, at, at + 0.95, 0.0, DOOR_HEIGHT)
            if _clear(plan, side.axis, side.middle, at, at + 0.95):
                plan.openings.append(door)
                return True
    return False


def add_balcony_doors(plan: Plan, rng: np.random.Generator) -> None:
    """A glazed door to the open in some living rooms and studios, seldom in a bedroom."""
    for room, kind in enumerate(plan.kinds):
        share = {"living room": 0.55, "studio": 0.45, "bedroom": 0.1, "dining room": 0.15}.get(kind, 0.0)
        spans = [(b - a, s, a, b) for s in plan.sides(room) for a, b in plan.open_spans(s) if not plan.on_side(s)]
        if rng.random() >= share or not spans:
            continue
        length, side, a, _ = max(spans, key=lambda s: s[0])
        width = round(float(rng.uniform(1.5, 1.9)) if length > 3.2 and rng.random() < 0.6 else 0.95, 2)
        if length < width + 0.8 or (length < 3.2 and len(spans) < 2):
            continue
        at = round(a + (length - width) * float(rng.choice([0.22, 0.5, 0.78])), 2)
        plan.openings.append(
            Opening("balcony door", (room, -1), side.axis, side.middle, at, at + width, 0.0, DOOR_HEIGHT + 0.1)
        )


def add_leaves(plan: Plan, rng: np.random.Generator) -> None:
    """Leaves in most doors to private rooms and in some others, standing open where nothing is in their way."""
    habit = float(rng.uniform(0.35, 0.8))
    for index, door in enumerate(plan.openings):
        if door.kind != "door" or door.wide:
            continue
        private = [r for r in door.rooms if plan.kinds[r] not in PUBLIC]
        if rng.random() > (0.9 if private else habit):
            continue
        # Into the room that fewer pass through; a bathroom's rather than its bedroom's.
        rooms = sorted(door.rooms, key=lambda r: (plan.kinds[r] in PUBLIC, plan.kinds[r] == "hall", -r))
        for leaf in _swings(plan, index, rooms[: 1 if plan.kinds[rooms[1]] == "hall" else 2], rng):
            if _leaf_fits(plan, leaf):
                plan.leaves.append(leaf)
                break


def _swings(plan: Plan, index: int, rooms: list[int], rng: np.random.Generator) -> list[Leaf]:
    """Ways in which a door's leaf may stand, the likeliest first: against the near wall, else straight or folded back."""
    door = plan.openings[index]
    leaves = []
    for room in rooms:
        inner = plan.inner(room)
        low, high = (inner.x0, inner.x1) if door.axis == "x" else (inner.z0, inner.z1)
        near_start = door.start - low < high - door.end
        straight, folded = np.deg2rad(rng.uniform(88, 100)), np.deg2rad(rng.uniform(168, 174))
        ways = [(near_start, straight), (not near_start, folded), (not near_start, straight), (near_start, folded)]
        for at_start, angle in ways:
            leaves.append(Leaf(room, leaf_footprint(plan, door, room, at_start, angle), index, at_start, float(angle)))
    return leaves


def hinge_frame(plan: Plan, door: Opening, room: int, at_start: bool) -> tuple[float, float, float, float, float]:
    """How a leaf hangs: (along, off) of its hinge in plan m, which way the opening lies along the wall and which way the
    room lies off it (+1 or -1 each), and the leaf's width, m."""
    inner = plan.inner(room)
    into = 1.0 if (inner.z0 if door.axis == "x" else inner.x0) > door.at else -1.0
    along = door.start + LINING + 0.003 if at_start else door.end - LINING - 0.003
    return along, door.at + into * (WALL / 2 + HINGE_OFF), 1.0 if at_start else -1.0, into, door.width - 0.036


def leaf_footprint(plan: Plan, door: Opening, room: int, at_start: bool, angle: float) -> Rect:
    """The box on the floor of a leaf and its handles, opened by ``angle`` rad about its hinge."""
    along, off, forth, into, width = hinge_frame(plan, door, room, at_start)
    s = np.array([0.0, width, width, 0.0, width - 0.13, width - 0.13, width - 0.03, width - 0.03])
    t = np.array([0.0, 0.0, THICK, THICK, -KNOB, THICK + KNOB, -KNOB, THICK + KNOB])
    a = along + forth * (s * np.cos(angle) + t * np.sin(angle))
    b = off + into * (s * np.sin(angle) - t * np.cos(angle))
    low, high = (float(a.min()), float(b.min())), (float(a.max()), float(b.max()))
    return Rect(*low, *high) if door.axis == "x" else Rect(low[1], low[0], high[1], high[0])


def _leaf_fits(plan: Plan, leaf: Leaf) -> bool:
    """Whether a leaf stays in its room, 1 cm off the walls, and stands before no opening and no other leaf."""
    own = plan.openings[leaf.opening]
    if not plan.inner(leaf.room).shrunk(0.01).contains(leaf.footprint):
        return False
    for o in plan.openings:
        if o is not own and leaf.room in o.rooms:
            reach = 0.25 if o.kind == "window" else 0.75
            if leaf.footprint.overlaps(o.zone(reach)):
                return False
    grown = leaf.footprint.shrunk(-0.06)
    return not any(o.room == leaf.room and o.footprint.overlaps(grown) for o in plan.leaves)


def add_windows(plan: Plan, rng: np.random.Generator) -> None:
    """Windows in the outer walls: in the longest stretch of every room, and in others where the room is for living in."""
    top = round(min(float(rng.uniform(2.1, 2.25)), plan.ceiling - 0.22), 2)
    sill = float(rng.choice([0.85, 0.9, 0.95]))
    broad = float(rng.uniform(1.1, 1.7))
    for room, kind in enumerate(plan.kinds):
        spans = [(b - a, side, a, b) for side in plan.sides(room) for a, b in plan.open_spans(side)]
        lit = any(o.glazed and room in o.rooms for o in plan.openings)
        for n, (_, side, a, b) in enumerate(sorted(spans, key=lambda s: -s[0])):
            more = {"living room": 0.75, "studio": 0.75, "dining room": 0.6, "bedroom": 0.4, "kitchen": 0.35}
            share = 0.6 if kind == "hall" else 1.0 if n == 0 and not lit else more.get(kind, 0.3)
            if rng.random() > share or (kind in ("bathroom", "laundry room", "hall") and n > 0):
                continue
            _windows(plan, kind, side, (a, b), (sill, top, broad), rng)


def _windows(
    plan: Plan,
    kind: str,
    side: Side,
    span: tuple[float, float],
    form: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    """One or two windows in what the doors leave of an open stretch of wall; ``form``: sill, top and usual width, m."""
    sill, top, width = form
    if kind in ("bathroom", "laundry room"):
        sill, width = 1.35, float(rng.uniform(0.6, 0.8))
    elif kind == "kitchen":
        sill = 1.15
    elif kind in ("living room", "studio") and rng.random() < 0.35:
        sill, width = 0.5, width * 1.3
    low, high = span[0] + 0.15, span[1] - 0.15
    for o in plan.on_side(side):
        if o.start - low > high - o.end:
            high = min(high, o.start - 0.3)
        else:
            low = max(low, o.end + 0.3)
    room = high - low
    width = min(width, room - 0.1)
    if width < 0.5:
        return
    count = 2 if room > 2 * width + 1.6 and kind not in ("bathroom", "laundry room", "hall") else 1
    for k in range(count):
        middle = low + room * (k + 0.5) / count
        a, b = round(middle - width / 2, 2), round(middle + width / 2, 2)
        if _clear(plan, side.axis, side.middle, a + 0.1, b - 0.1):
            plan.openings.append(Opening("window", (side.room, -1), side.axis, side.middle, a, b, sill, top))
