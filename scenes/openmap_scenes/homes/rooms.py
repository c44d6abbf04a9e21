"""What a floor plan is made of: rectangles, walls, openings, the leaves of doors, and the plan that holds them.

Plan coordinates are the world's (x, z), m. A room's rectangle runs between the middles of its walls; the room itself is half
a wall thickness smaller on every side. Outer walls are thicker, and all of what they have more lies outside, so that every
inner face lies half a wall off the rectangle. Walls are named by the axis along which they run and by what lies inwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field

WALL = 0.1
# From the middle line of an outer wall, on which room rectangles end, to its outer face, m.
OUTER = 0.2
CEILING = 2.6
DOOR_HEIGHT = 2.05
CLEARANCE = 0.9
_TOUCH = 1e-6


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

    @property
    def area(self) -> float:
        """In m2."""
        return self.width * self.depth

    def shrunk(self, margin: float) -> Rect:
        """The rectangle without a border of ``margin`` m."""
        return Rect(self.x0 + margin, self.z0 + margin, self.x1 - margin, self.z1 - margin)

    def overlaps(self, other: Rect, tolerance: float = 0.0) -> bool:
        """Whether the two share more than a strip of ``tolerance`` m."""
        return (
            min(self.x1, other.x1) - max(self.x0, other.x0) > tolerance
            and min(self.z1, other.z1) - max(self.z0, other.z0) > tolerance
        )

    def contains(self, other: Rect, tolerance: float = 0.0) -> bool:
        """Whether the other lies in it, give or take ``tolerance`` m."""
        return (
            other.x0 >= self.x0 - tolerance
            and other.z0 >= self.z0 - tolerance
            and other.x1 <= self.x1 + tolerance
            and other.z1 <= self.z1 + tolerance
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
        Whether the open lies behind some of it; ``Plan.open_spans`` says behind which stretches.
    """

    room: int
    axis: str
    at: float
    inward: int
    start: float
    end: float
    outer: bool

    @property
    def middle(self) -> float:
        """Where the middle of the wall lies on the other axis, m: the ``at`` of its openings."""
        return self.at - self.inward * WALL / 2

    def point(self, along: float, off: float) -> tuple[float, float]:
        """World (x, z) at ``along`` on the wall and ``off`` m into the room."""
        other = self.at + self.inward * off
        return (along, other) if self.axis == "x" else (other, along)


@dataclass(frozen=True)
class Opening:
    """A hole in a wall: a door (sill 0) between two rooms or to the open (rooms[1] = -1), or a window.

    Parameters
    ----------
    kind : "door", "front door", "balcony door" or "window"
        A "door" leads from room to room, whether or not a leaf hangs in it. The front door and the balcony door, which is
        of glass, lead to the open and are shut.
    rooms : (int, int)
    axis : "x" or "z"
        The axis along which its wall runs.
    at : float
        Where the middle of its wall lies on the other axis, m.
    start, end, sill, top : float
        Along the axis and in height, m.
    wide : bool
        A broad passage between two day rooms, which never has a leaf.
    """

    kind: str
    rooms: tuple[int, int]
    axis: str
    at: float
    start: float
    end: float
    sill: float
    top: float
    wide: bool = False

    @property
    def width(self) -> float:
        """Extent along the wall, m."""
        return self.end - self.start

    @property
    def glazed(self) -> bool:
        """Whether daylight comes in through it."""
        return self.kind in ("window", "balcony door")

    def zone(self, reach: float) -> Rect:
        """The floor in front of and behind it that must stay free, ``reach`` m deep from the wall's faces."""
        a, b = self.at - WALL / 2 - reach, self.at + WALL / 2 + reach
        return Rect(self.start, a, self.end, b) if self.axis == "x" else Rect(a, self.start, b, self.end)


@dataclass(frozen=True)
class Leaf:
    """The leaf of a door that stands open.

    Parameters
    ----------
    room : int
        The room it swung into.
    footprint : Rect
        The floor that it and its handles take, up to the door's height.
    opening : int
        Index into ``Plan.openings`` of its door.
    at_start : bool
        Whether its hinges are at the opening's start, otherwise at its end.
    angle : float
        How far it stands open, rad; 0 = shut.
    """

    room: int
    footprint: Rect
    opening: int = -1
    at_start: bool = True
    angle: float = 0.0


@dataclass
class Plan:
    """Rooms, openings, the leaves of doors that stand open, and the ceiling's height, m.

    Parameters
    ----------
    names : list of str
        What each room is called; no two have one name.
    rects : list of Rect
        Between the middles of the walls.
    kinds : list of str
        What each room is: "bedroom" for one that is called "guest bedroom". The names where none are given.
    """

    names: list[str]
    rects: list[Rect]
    openings: list[Opening] = field(default_factory=list)
    leaves: list[Leaf] = field(default_factory=list)
    ceiling: float = CEILING
    kinds: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.kinds = self.kinds or list(self.names)

    @property
    def outline(self) -> Rect:
        """The rectangle around all rooms, between wall middles; parts of it may lie in the open."""
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
        inner = self.inner(room)
        sides = []
        for axis, at, inward, start, end in (
            ("z", inner.x0, 1, inner.z0, inner.z1),
            ("z", inner.x1, -1, inner.z0, inner.z1),
            ("x", inner.z0, 1, inner.x0, inner.x1),
            ("x", inner.z1, -1, inner.x0, inner.x1),
        ):
            side = Side(room, axis, at, inward, start, end, False)
            outer = bool(self.open_spans(side))
            sides.append(Side(room, axis, at, inward, start, end, outer))
        return sides

    def open_spans(self, side: Side) -> list[tuple[float, float]]:
        """The stretches (start, end), m, of a wall behind which no room lies, without the ends of the walls behind it."""
        taken = []
        for room, r in enumerate(self.rects):
            if room == side.room:
                continue
            low, high, a, b = (r.z0, r.z1, r.x0, r.x1) if side.axis == "x" else (r.x0, r.x1, r.z0, r.z1)
            # Rooms that touch the wall from behind, and those beside it that reach past it.
            behind = low < side.middle - _TOUCH if side.inward > 0 else high > side.middle + _TOUCH
            reaches = high > side.middle - _TOUCH if side.inward > 0 else low < side.middle + _TOUCH
            if behind and reaches:
                taken.append((a - OUTER, b + OUTER))
        spans, cursor = [], side.start
        for a, b in [*sorted(taken), (side.end, side.end)]:
            if a - cursor > 0.05:
                spans.append((cursor, min(a, side.end)))
            cursor = max(cursor, b)
        return spans

    def on_side(self, side: Side) -> list[Opening]:
        """The openings in one wall of a room."""
        return [
            o
            for o in self.openings
            if o.axis == side.axis and side.room in o.rooms and abs(o.at - side.middle) < _TOUCH
        ]

    def contact(self, i: int, j: int) -> tuple[str, float, float, float] | None:
        """The wall between two rooms: (axis, where its middle lies, start and end of what both see of it), or None."""
        a, b = self.rects[i], self.rects[j]
        for axis, at, touches, low, high in (
            ("z", a.x1, abs(a.x1 - b.x0), max(a.z0, b.z0), min(a.z1, b.z1)),
            ("z", a.x0, abs(a.x0 - b.x1), max(a.z0, b.z0), min(a.z1, b.z1)),
            ("x", a.z1, abs(a.z1 - b.z0), max(a.x0, b.x0), min(a.x1, b.x1)),
            ("x", a.z0, abs(a.z0 - b.z1), max(a.x0, b.x0), min(a.x1, b.x1)),
        ):
            if touches < _TOUCH and high - low > WALL:
                return axis, at, low + WALL / 2, high - WALL / 2
        return None
