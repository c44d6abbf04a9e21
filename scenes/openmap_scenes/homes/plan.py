"""Floor plans: a rectangle split into rooms, with doors that connect them all and windows in the outer walls.

Plan coordinates are the world's (x, z), m. A room's rectangle runs between the middles of its walls; the room itself is half
a wall thickness smaller on every side. Walls are named by the direction in which they lie seen from the room: -x, +x, -z, +z.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

WALL = 0.1
CEILING = 2.6
DOOR_HEIGHT = 2.05
CLEARANCE = 0.9
# Name: (area wanted in m2, shortest side allowed in m).
ROOM_KINDS = {
    "living room": (23.0, 3.4),
    "kitchen": (12.0, 2.6),
    "bedroom": (14.5, 3.0),
    "children's room": (11.5, 2.7),
    "bathroom": (7.0, 1.9),
    "hall": (7.5, 1.6),
    "office": (11.0, 2.6),
    "dining room": (13.0, 2.9),
}
PROGRAMMES = (
    ("living room", "kitchen", "bedroom", "bathroom"),
    ("living room", "kitchen", "bedroom", "children's room", "bathroom"),
    ("living room", "kitchen", "bedroom", "bathroom", "hall"),
    ("living room", "kitchen", "bedroom", "bathroom", "office"),
    ("living room", "dining room", "kitchen", "bedroom", "bathroom"),
    ("living room", "kitchen", "bedroom", "children's room", "bathroom", "hall"),
    ("living room", "kitchen", "bedroom", "bathroom", "hall", "office"),
    ("living room", "dining room", "kitchen", "bedroom", "bathroom", "hall"),
    ("living room", "dining room", "kitchen", "bedroom", "bathroom", "office"),
)


@dataclass(frozen=True)
class Rect:
    """An axis-aligned rectangle of the plan, m."""

    x0: float
    z0: float
    x1: float
    z1: float

    @property
    def width(self) -> float:
        """Extent along x, m."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """Extent along z, m."""
        return self.z1 - self.z0

    def shrunk(self, margin: float) -> Rect:
        """The rectangle without a border of ``margin`` m."""
        return Rect(self.x0 + margin, self.z0 + margin, self.x1 - margin, self.z1 - margin)

    def overlaps(self, other: Rect, tolerance: float = 0.0) -> bool:
        """Whether the two share more than a strip of ``tolerance`` m."""
        return (
            min(self.x1, other.x1) - max(self.x0, other.x0) > tolerance
            and min(self.z1, other.z1) - max(self.z0, other.z0) > tolerance
        )


@dataclass(frozen=True)
class Side:
    """One wall of a room, seen from inside: the inner face runs along ``axis`` at ``at`` on the other axis.

    Parameters
    ----------
    room : int
    axis : "x" or "z"
        The axis along which the wall runs.
    at : float
        Where its inner face lies on the other axis, m.
    inward : int
        +1 or -1: the direction on the other axis that leads into the room.
    start, end : float
        Where the face begins and ends on ``axis``, m.
    outer : bool
        Whether the open lies behind it.
    """

    room: int
    axis: str
    at: float
    inward: int
    start: float
    end: float
    outer: bool

    def point(self, along: float, off: float) -> tuple[float, float]:
        """World (x, z) at ``along`` on the wall and ``off`` m into the room."""
        other = self.at + self.inward * off
        return (along, other) if self.axis == "x" else (other, along)


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: a door (sill 0) between two rooms or to the open (rooms[1] = -1), or a window.

    Parameters
    ----------
    kind : "door", "front door" or "window"
    rooms : (int, int)
    axis : "x" or "z"
        The axis along which its wall runs.
    at : float
        Where the middle of its wall lies on the other axis, m.
    start, end, sill, top : float
        Along the axis and in height, m.
    """

    kind: str
    rooms: tuple[int, int]
    axis: str
    at: float
    start: float
    end: float
    sill: float
    top: float

    def zone(self, reach: float) -> Rect:
        """The floor in front of and behind it that must stay free, ``reach`` m deep from the wall's faces."""
        a, b = self.at - WALL / 2 - reach, self.at + WALL / 2 + reach
        return Rect(self.start, a, self.end, b) if self.axis == "x" else Rect(a, self.start, b, self.end)


@dataclass(frozen=True)
class Leaf:
    """The leaf of a door that stands open: the room it swung into and the floor that it takes, up to the door's height."""

    room: int
    footprint: Rect


@dataclass
class Plan:
    """Rooms (name, rectangle between wall middles), openings, the open doors' leaves, and the ceiling's height, m."""

    names: list[str]
    rects: list[Rect]
    openings: list[Opening] = field(default_factory=list)
    leaves: list[Leaf] = field(default_factory=list)
    ceiling: float = CEILING

    @property
    def outline(self) -> Rect:
        """The rectangle of all rooms, between wall middles."""
        return Rect(
            min(r.x0 for r in self.rects),
            min(r.z0 for r in self.rects),
            max(r.x1 for r in self.rects),
            max(r.z1 for r in self.rects),
        )

    def inner(self, room: int) -> Rect:
        """The room between the faces of its walls."""
        return self.rects[room].shrunk(WALL / 2)

    def sides(self, room: int) -> list[Side]:
        """The four walls of a room."""
        r, inner, out = self.rects[room], self.inner(room), self.outline
        return [
            Side(room, "z", inner.x0, 1, inner.z0, inner.z1, abs(r.x0 - out.x0) < 1e-6),
            Side(room, "z", inner.x1, -1, inner.z0, inner.z1, abs(r.x1 - out.x1) < 1e-6),
            Side(room, "x", inner.z0, 1, inner.x0, inner.x1, abs(r.z0 - out.z0) < 1e-6),
            Side(room, "x", inner.z1, -1, inner.x0, inner.x1, abs(r.z1 - out.z1) < 1e-6),
        ]

    def on_side(self, side: Side) -> list[Opening]:
        """The openings in one wall of a room."""
        middle = side.at - side.inward * WALL / 2
        return [o for o in self.openings if o.axis == side.axis and side.room in o.rooms and abs(o.at - middle) < 1e-6]


def make_plan(rng: np.random.Generator) -> Plan:
    """A random plan whose rooms are usable and all connected."""
    for _ in range(2000):
        names = list(PROGRAMMES[int(rng.integers(len(PROGRAMMES)))])
        areas = [ROOM_KINDS[n][0] * rng.uniform(0.9, 1.2) for n in names]
        total = min(sum(areas), 108.0)
        width = float(np.sqrt(total * rng.uniform(1.0, 1.6)))
        outline = Rect(-width / 2, -total / width / 2, width / 2, total / width / 2)
        order = rng.permutation(len(names)).tolist()
        rects: dict[int, Rect] = {}
        _cut(outline, order, areas, rects, rng)
        plan = Plan(names, [rects[i] for i in range(len(names))])
        if all(_usable(n, r) for n, r in zip(plan.names, plan.rects, strict=True)) and _add_doors(plan, rng):
            _add_front_door(plan, rng)
            _add_windows(plan, rng)
            return plan
    raise RuntimeError("no usable floor plan in 2000 attempts")


def _cut(rect: Rect, rooms: list[int], areas: list[float], out: dict[int, Rect], rng: np.random.Generator) -> None:
    """Split a rectangle among rooms, across its longer side, in proportion to the areas that they want."""
    if len(rooms) == 1:
        out[rooms[0]] = rect
        return
    k = int(rng.integers(1, len(rooms)))
    first, second = rooms[:k], rooms[k:]
    share = sum(areas[i] for i in first) / sum(areas[i] for i in rooms)
    if rect.width > rect.depth:
        x = round(rect.x0 + share * rect.width, 2)
        halves = Rect(rect.x0, rect.z0, x, rect.z1), Rect(x, rect.z0, rect.x1, rect.z1)
    else:
        z = round(rect.z0 + share * rect.depth, 2)
        halves = Rect(rect.x0, rect.z0, rect.x1, z), Rect(rect.x0, z, rect.x1, rect.z1)
    _cut(halves[0], first, areas, out, rng)
    _cut(halves[1], second, areas, out, rng)


def _usable(name: str, rect: Rect) -> bool:
    short, long = sorted((rect.width - WALL, rect.depth - WALL))
    return short >= ROOM_KINDS[name][1] and long / short < (3.6 if name == "hall" else 1.9)


def _shared(a: Rect, b: Rect) -> tuple[str, float, float, float] | None:
    """The wall between two rooms: (axis, where on the other axis, start, end), or None where they do not touch."""
    for axis, at, touch, span in (
        ("z", a.x1, abs(a.x1 - b.x0), (max(a.z0, b.z0), min(a.z1, b.z1))),
        ("z", a.x0, abs(a.x0 - b.x1), (max(a.z0, b.z0), min(a.z1, b.z1))),
        ("x", a.z1, abs(a.z1 - b.z0), (max(a.x0, b.x0), min(a.x1, b.x1))),
        ("x", a.z0, abs(a.z0 - b.z1), (max(a.x0, b.x0), min(a.x1, b.x1))),
    ):
        if touch < 1e-6 and span[1] - span[0] > 1.35:
            return axis, at, span[0], span[1]
    return None


def _door_cost(a: str, b: str) -> float:
    """How odd a door between two kinds of room is: 0 = a matter of course."""
    pair = {a, b}
    if "hall" in pair:
        return 0.0
    if pair <= {"living room", "kitchen", "dining room"}:
        return 0.2
    if "living room" in pair:
        return 0.6 if "bathroom" not in pair else 1.2
    if "bathroom" in pair:
        return 1.0 if "bedroom" in pair else 2.5
    return 1.8


def _add_doors(plan: Plan, rng: np.random.Generator) -> bool:
    """A cheapest tree of doors over all rooms, and some more where they make sense; False where rooms stay apart."""
    edges = []
    for i in range(len(plan.rects)):
        for j in range(i + 1, len(plan.rects)):
            if (wall := _shared(plan.rects[i], plan.rects[j])) is not None:
                edges.append((_door_cost(plan.names[i], plan.names[j]) + rng.uniform(0, 0.3), i, j, wall))
    group = list(range(len(plan.rects)))
    for cost, i, j, (axis, at, start, end) in sorted(edges, key=lambda e: e[0]):
        joins = group[i] != group[j]
        if joins or (cost < 0.55 and rng.random() < 0.6):
            width = round(float(rng.uniform(0.9, 1.0)), 2)
            # Near an end of the wall, so that a long stretch stays for furniture.
            offset = WALL / 2 + 0.12 + float(rng.uniform(0.0, min(0.5, end - start - WALL - 0.24 - width)))
            a = start + offset if rng.random() < 0.5 else end - offset - width
            plan.openings.append(Opening("door", (i, j), axis, at, a, a + width, 0.0, DOOR_HEIGHT))
        if joins:
            group = [group[i] if g == group[j] else g for g in group]
    return len(set(group)) == 1


def _outer_sides(plan: Plan, room: int) -> list[Side]:
    return [side for side in plan.sides(room) if side.outer]


def _add_front_door(plan: Plan, rng: np.random.Generator) -> None:
    for name in ("hall", "living room", "kitchen", "dining room"):
        for room in (i for i, n in enumerate(plan.names) if n == name):
            sides = sorted(_outer_sides(plan, room), key=lambda s: s.end - s.start)
            if sides and sides[0].end - sides[0].start > 1.3:
                side, width = sides[0], 0.95
                a = side.start + float(rng.uniform(0.15, min(0.6, side.end - side.start - width - 0.15)))
                middle = side.at - side.inward * WALL / 2
                plan.openings.append(
                    Opening("front door", (room, -1), side.axis, middle, a, a + width, 0.0, DOOR_HEIGHT)
                )
                return


def _add_windows(plan: Plan, rng: np.random.Generator) -> None:
    for room, name in enumerate(plan.names):
        for side in _outer_sides(plan, room):
            length = side.end - side.start
            bath = name == "bathroom"
            width = 0.7 if bath else min(float(rng.uniform(1.1, 1.9)), length - 0.8)
            middle = side.at - side.inward * WALL / 2
            doors = plan.on_side(side)
            if width < 0.6 or doors or rng.random() < 0.15:
                continue
            count = 2 if length > 2 * width + 2.2 and not bath else 1
            for k in range(count):
                centre = side.start + length * (k + 0.5) / count
                a, b = round(centre - width / 2, 2), round(centre + width / 2, 2)
                sill = 1.35 if bath or name == "kitchen" else 0.9
                plan.openings.append(Opening("window", (room, -1), side.axis, middle, a, b, sill, 2.15))
