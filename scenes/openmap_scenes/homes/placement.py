"""Putting things into a room so that nothing overlaps, doors stay free and a body can still walk everywhere it must.

A thing is held against the others by its axis-aligned box. Whatever would break a rule is not put down: every method returns
None then, and the furnishing rules go on without it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import label

from openmap_scenes.homes.bodies import run_together
from openmap_scenes.homes.items import Item, Thing, open_to_front, shelf_boards
from openmap_scenes.homes.plan import CLEARANCE, DOOR_HEIGHT, Opening, Plan, Rect, Side

CELL = 0.05
BODY_RADIUS = 0.2
BODY_HEIGHT = 1.5
# A body of 0.2 m with some air, so that a mesh's own navigable surface agrees.
KEEP_FREE = 0.26
GAP = 0.01
# Below this height, m, walls have a skirting.
LOW = 0.15
SKIRTING = 0.0085


def turn_of(side: Side) -> float:
    """The angle at which a thing's front looks into the room from a wall."""
    return {("x", 1): 0.0, ("x", -1): np.pi, ("z", 1): np.pi / 2, ("z", -1): -np.pi / 2}[(side.axis, side.inward)]


class RoomSpace:
    """One room with what stands in it so far."""

    def __init__(self, plan: Plan, room: int, rng: np.random.Generator) -> None:
        self.plan, self.room, self.rng = plan, room, rng
        self.name, self.kind, self.ceiling = plan.names[room], plan.kinds[room], plan.ceiling
        self.rect, self.sides = plan.inner(room), plan.sides(room)
        self.items: list[Item] = []
        self.doors = [o for o in plan.openings if room in o.rooms and o.kind != "window"]
        self.zones = [o.zone(CLEARANCE) for o in self.doors]
        self.leaves = [leaf.footprint for leaf in plan.leaves if leaf.room == room]
        self._x = np.arange(self.rect.x0 + CELL / 2, self.rect.x1, CELL)
        self._z = np.arange(self.rect.z0 + CELL / 2, self.rect.z1, CELL)

    @property
    def area(self) -> float:
        """Of the floor, m2."""
        return self.rect.width * self.rect.depth

    def remove(self, items: list[Item]) -> None:
        """Take things away again."""
        self.items = [i for i in self.items if not any(i is o for o in items)]

    def put(
        self,
        item: Item,
        support: Item | None = None,
        rest: bool = False,
        under: Item | None = None,
        drape: bool = False,
    ) -> Item | None:
        """Put an item down if every rule allows it.

        Parameters
        ----------
        support : Item or None
            What it stands on, which its box may overlap.
        rest : bool
            It lies flat on the floor and others may stand on it (a rug).
        under : Item or None
            What it may be pushed under as far as the solids themselves leave room (a chair under a table).
        drape : bool
            It hangs at a window and may cover its edges.
        """
        low, high = item.low, item.high
        if rest:
            if not self._inside(item) or any(
                self._flat(o) and item.footprint.overlaps(o.footprint) for o in self.items
            ):
                return None
            self.items.append(item)
            return item
        margin = SKIRTING if low[1] < LOW and not drape else 0.0
        if not self._inside(item, margin) or high[1] > self.ceiling + 1e-6:
            return None
        for other in self.items:
            if self._flat(other):
                continue
            if other is support:
                if np.minimum(high, other.high)[1] - low[1] > 0.01 and run_together(item.body, other.body):
                    return None
                continue
            if np.all(np.minimum(high, other.high) - np.maximum(low, other.low) > 0.003) and (
                other is not under or run_together(item.body, other.body)
            ):
                return None
        if low[1] < DOOR_HEIGHT and any(item.footprint.overlaps(leaf) for leaf in self.leaves):
            return None
        if low[1] < BODY_HEIGHT and support is None:
            if any(item.footprint.overlaps(zone) for zone in self.zones):
                return None
            if (not drape and self._stands_before_window(item)) or not self._walkable([*self.items, item]):
                return None
        item.support = support
        self.items.append(item)
        return item

    def against_wall(
        self,
        thing: Thing,
        sides: list[Side] | None = None,
        corner: bool = False,
        at: float | None = None,
        tries: int = 32,
    ) -> Item | None:
        """Put a thing with its back to a wall: at ``at`` on it, in a corner, or anywhere."""
        width, _, depth = thing.model.size
        order = list(self.sides) if sides is None else list(sides)
        if sides is None:
            order = [order[i] for i in self.rng.permutation(len(order))]
        for side in order:
            a, b = side.start + GAP + width / 2, side.end - GAP - width / 2
            if b < a:
                continue
            if at is not None:
                spots = [float(np.clip(at, a, b))]
            elif corner:
                spots = [a, b] if self.rng.random() < 0.5 else [b, a]
            else:
                spots = [a, b, *self.rng.uniform(a, b, tries // 4).tolist()]
                spots = [spots[i] for i in self.rng.permutation(len(spots))]
            for along in spots:
                x, z = side.point(along, depth / 2 + GAP)
                item = Item(thing, np.array([x, thing.elevation, z]), turn_of(side), self.room)
                if self.put(item) is not None:
                    return item
        return None

    def hang(
        self, thing: Thing, height: float, side: Side, along: list[float], clear: float = 0.0, off: float = 0.002
    ) -> Item | None:
        """Hang a thing on a wall, its base ``height`` m above the floor, at the first of the places that is free.

        Parameters
        ----------
        clear : float
            Free width, m, that is left on both sides between it and its neighbours on the wall.
        off : float
            Between the wall and its back, m.
        """
        width, tall, depth = thing.model.size
        for centre in along:
            low, high = centre - width / 2, centre + width / 2
            if low < side.start + 0.05 or high > side.end - 0.05:
                continue
            if any(
                o.start - 0.12 < high and low < o.end + 0.12 and o.sill - 0.1 < height + tall and height < o.top + 0.1
                for o in self.plan.on_side(side)
            ):
                continue
            # What hangs down to the skirting keeps clear of it.
            x, z = side.point(centre, depth / 2 + (off if height > LOW else max(off, GAP)))
            item = Item(thing, np.array([x, height, z]), turn_of(side), self.room)
            if clear > 0.0 and self._crowded(item, side, clear):
                continue
            if self.put(item) is not None:
                return item
        return None

    def _crowded(self, item: Item, side: Side, clear: float) -> bool:
        axis = 0 if side.axis == "x" else 2
        low, high = item.low.copy(), item.high.copy()
        low[axis] -= clear
        high[axis] += clear
        return any(np.all(np.minimum(high, o.high) - np.maximum(low, o.low) > 0.0) for o in self.items)

    def in_shelf(self, thing: Thing, shelf: Item, tries: int = 6) -> Item | None:
        """Stand a thing on a board of a shelf that is open to the front, or None where none is free."""
        boards = shelf_boards(shelf)
        for k in self.rng.permutation(len(boards)).tolist()[:tries]:
            height, room, along, off = boards[k]
            if thing.model.size[1] > room - 0.02:
                continue
            x, z = shelf.middle + shelf.right * along + shelf.front * off
            item = Item(thing, np.array([x, height, z]), shelf.angle, self.room)
            if np.any((item.low < shelf.low - 1e-3)[[0, 2]]) or np.any((item.high > shelf.high + 1e-3)[[0, 2]]):
                continue
            stands = shelf.height_below(item.footprint, height + room / 2, 0.008)
            if stands is None or abs(stands - height) > 0.01 or run_together(item.body, shelf.body, 0.004):
                continue
            if not open_to_front(item, shelf):
                continue
            if self.put(item, support=shelf) is not None:
                return item
        return None

    def on_top(
        self,
        thing: Thing,
        support: Item,
        back: bool = False,
        tries: int = 16,
        spread: float = 0.3,
        level: float = 0.008,
    ) -> Item | None:
        """Stand a thing on another, level, its front the same way give or take ``spread`` rad; ``back``: far from its front."""
        for _ in range(tries):
            turn = support.angle + (float(self.rng.normal(0, spread)) if spread else 0.0)
            item = Item(thing, np.array([0.0, 0.0, 0.0]), turn, self.room)
            half = (item.high - item.low) / 2
            room = (support.high - support.low) / 2 - half
            if room[0] < 0 or room[2] < 0:
                return None
            middle = (support.low + support.high) / 2
            offset = self.rng.uniform(-1, 1, 2) * (room[[0, 2]] - 0.01).clip(0)
            if back:
                wish = -support.front * room[[0, 2]] * 0.9
                offset = np.where(np.abs(support.front) > 0.5, wish * self.rng.uniform(0.5, 1.0), offset)
            centre = middle[[0, 2]] + offset
            rect = Rect(centre[0] - half[0], centre[1] - half[2], centre[0] + half[0], centre[1] + half[2])
            height = support.height_under(rect, level)
            if height is None or height < 0.2:
                continue
            shift = (item.low + item.high)[[0, 2]] / 2
            item = Item(thing, np.array([centre[0] - shift[0], height, centre[1] - shift[1]]), turn, self.room)
            if self.put(item, support=support) is not None:
                return item
        return None

    def around(self, thing: Thing, table: Item, most: int, tuck: float = 0.0) -> list[Item]:
        """Chairs around a table, their fronts to it, pushed under it by up to ``tuck`` m: along its long sides first."""
        width, _, depth = thing.model.size
        extent = (table.high - table.low)[[0, 2]]
        seats = []
        long = int(extent[1] > extent[0])
        for axis in (long, 1 - long):
            room = float(extent[axis])
            # At the short sides, and at a round or square table, one.
            n = max(1, min(3, int(room / (width + 0.12)))) if axis == long and extent.max() - extent.min() > 0.1 else 1
            seats += [(axis, sign, (k + 0.5) / n * room - room / 2) for k in range(n) for sign in (1, -1)]
        placed: list[Item] = []
        middle = (table.low + table.high)[[0, 2]] / 2
        for axis, sign, along in seats:
            if len(placed) == most:
                break
            other = 1 - axis
            centre = middle.copy()
            centre[axis] += along
            centre[other] += sign * (extent[other] / 2 + 0.02 + depth / 2)
            look = np.zeros(2)
            look[other] = -sign
            angle = float(np.arctan2(look[0], look[1]) + self.rng.normal(0, 0.04))
            item = Item(thing, np.array([centre[0], 0.0, centre[1]]), angle, self.room)
            excess = (item.high - item.low)[[0, 2]][other] - depth
            reach = excess / 2 - tuck
            for back in (0.0, 0.12, 0.24, 0.36):
                position = item.position.copy()
                position[[0, 2][other]] += sign * (reach + back)
                tucked = self.put(Item(thing, position, angle, self.room), under=table)
                if tucked is not None:
                    placed.append(tucked)
                    break
                if reach + back > excess / 2:
                    break
        return placed

    def anywhere(self, thing: Thing, tries: int = 12, quarter: bool = True) -> Item | None:
        """Stand a thing somewhere on the floor."""
        for _ in range(tries):
            angle = float(self.rng.integers(4)) * np.pi / 2 if quarter else float(self.rng.uniform(0, 2 * np.pi))
            x, z = self.rng.uniform(self.rect.x0, self.rect.x1), self.rng.uniform(self.rect.z0, self.rect.z1)
            item = self.put(Item(thing, np.array([x, thing.elevation, z]), angle, self.room))
            if item is not None:
                return item
        return None

    def reachable(self, items: list[Item]) -> npt.NDArray[np.bool_] | None:
        """Cells (nz, nx) where a body can stand that came in by a door; None where some doors are cut off."""
        free = np.zeros((len(self._z), len(self._x)), bool)
        m = round(KEEP_FREE / CELL)
        free[m:-m, m:-m] = True
        for opening in self.doors:
            free[self._cells(opening.zone(0.5), opening.axis)] = True
        for item in items:
            if item.low[1] < BODY_HEIGHT and item.high[1] > 0.03:
                free[self._block(item.footprint, KEEP_FREE)] = False
        for leaf in self.leaves:
            free[self._block(leaf, KEEP_FREE)] = False
        areas, _ = label(free)
        marks = set()
        for opening in self.doors:
            x, z = self._entry(opening)
            marks.add(int(areas[z, x]))
        if len(marks) != 1 or 0 in marks:
            return None
        return np.asarray(areas == marks.pop())

    def _walkable(self, items: list[Item]) -> bool:
        area = self.reachable(items)
        if area is None or area.mean() < 0.12:
            return False
        # Everything on the floor must be within an arm's length of a place to stand.
        return all(
            bool(area[self._block(i.footprint, 0.65)].any()) for i in items if i.low[1] < 0.3 and not self._flat(i)
        )

    def _entry(self, opening: Opening) -> tuple[int, int]:
        """The cell half a metre inside a door."""
        middle = (opening.start + opening.end) / 2
        inward = 1 if (self.rect.z0 if opening.axis == "x" else self.rect.x0) > opening.at else -1
        off = opening.at + inward * 0.5
        x, z = (middle, off) if opening.axis == "x" else (off, middle)
        return int((x - self.rect.x0) / CELL), int((z - self.rect.z0) / CELL)

    def _cells(self, rect: Rect, axis: str) -> tuple[slice, slice]:
        """Cells of a door's way in, a body's radius off its jambs."""
        grown = (
            Rect(rect.x0 + KEEP_FREE, rect.z0, rect.x1 - KEEP_FREE, rect.z1)
            if axis == "x"
            else Rect(rect.x0, rect.z0 + KEEP_FREE, rect.x1, rect.z1 - KEEP_FREE)
        )
        return self._block(grown, 0.0)

    def _block(self, rect: Rect, margin: float) -> tuple[slice, slice]:
        """The cells (rows, columns) whose centres lie in a rectangle grown by ``margin`` m."""
        x = np.searchsorted(self._x, [rect.x0 - margin, rect.x1 + margin])
        z = np.searchsorted(self._z, [rect.z0 - margin, rect.z1 + margin])
        return slice(int(z[0]), int(z[1])), slice(int(x[0]), int(x[1]))

    def _inside(self, item: Item, margin: float = 0.0) -> bool:
        r, f = self.rect.shrunk(margin), item.footprint
        return f.x0 >= r.x0 - 1e-6 and f.z0 >= r.z0 - 1e-6 and f.x1 <= r.x1 + 1e-6 and f.z1 <= r.z1 + 1e-6

    def _stands_before_window(self, item: Item) -> bool:
        for side in self.sides:
            near = abs((item.low if side.inward > 0 else item.high)[2 if side.axis == "x" else 0] - side.at) < 0.5
            low, high = (item.low[0], item.high[0]) if side.axis == "x" else (item.low[2], item.high[2])
            for o in self.plan.on_side(side) if near else []:
                # Sill and casing reach a little further than the opening.
                if o.kind == "window" and item.high[1] > o.sill - 0.01 and low < o.end + 0.08 and high > o.start - 0.08:
                    return True
        return False

    @staticmethod
    def _flat(item: Item) -> bool:
        return bool(item.high[1] < 0.03)
