"""The tools of the furnishing rules: a room, the stock, and the ways in which people put things."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.items import Item, Thing
from openmap_scenes.homes.placement import RoomSpace, turn_of
from openmap_scenes.homes.plan import Opening, Side
from openmap_scenes.homes.stock import Stock, own, scaled

# What is smaller than this, m2 (the product of its two longer edges), is not seen by someone who stands a metre away.
SMALLEST = 0.0065
# Curtains hang clear of the window's sill, m.
CURTAIN_OFF = 0.06


@dataclass(frozen=True)
class Furnisher:
    """A room, the stock, and the random choices: what every rule needs; whether a room that lacks something is of no use."""

    space: RoomSpace
    stock: Stock
    rng: np.random.Generator
    complete: bool = False

    def chance(self, probability: float) -> bool:
        """True that often."""
        return bool(self.rng.random() < probability)

    def wall(
        self,
        *kinds: str,
        corner: bool = False,
        width: float = 9.0,
        depth: float = 9.0,
        height: float = 9.0,
        tries: int = 2,
    ) -> Item | None:
        """One of the kinds with its back to some wall."""
        for _ in range(tries):
            thing = self.stock.get(*kinds, width=width, depth=depth, height=height)
            if thing is not None and (item := self.space.against_wall(thing, corner=corner)) is not None:
                return item
        return None

    def bare_shelf(self, *others: str, width: float) -> Item | None:
        """Shelves without books, which those made by rule have, or one of the other kinds, against a wall."""
        shelf = self.stock.get("shelves", made=False, width=width, depth=0.5) if self.chance(0.6) else None
        item = self.space.against_wall(shelf) if shelf is not None else None
        return item or self.wall(*others, width=width, depth=0.55)

    def tops(self, support: Item | None, kinds: tuple[str, ...], most: int, back: bool = False) -> list[Item]:
        """Up to ``most`` different small things on a support."""
        placed: list[Item] = []
        if support is None:
            return placed
        free = self.space.ceiling - float(support.high[1])
        order = [kinds[i] for i in self.rng.permutation(len(kinds))]
        for kind in order:
            if len(placed) >= most:
                break
            thing = self.stock.get(kind, height=min(0.75, free), fresh=True)
            if thing is None or not large_enough(thing):
                continue
            if (item := self.space.on_top(thing, support, back=back)) is not None:
                placed.append(item)
        return placed

    def shelved(self, shelf: Item | None, kinds: tuple[str, ...], most: int) -> list[Item]:
        """Up to ``most`` small things on the boards of a shelf that is open to the front."""
        placed: list[Item] = []
        if shelf is None:
            return placed
        order = [kinds[i] for i in self.rng.permutation(len(kinds))]
        for kind in order[: 2 * most]:
            if len(placed) >= most:
                break
            thing = self.stock.get(kind, height=0.34, depth=0.34, width=0.5, fresh=True)
            if thing is not None and large_enough(thing) and (item := self.space.in_shelf(thing, shelf)) is not None:
                placed.append(item)
        return placed

    def fill(self, free: float, *rows: tuple[str, ...]) -> list[Item]:
        """More along the walls, one of each row, as long as more than a share ``free`` of the floor can be walked on."""
        placed = []
        for kinds in rows:
            area = self.space.reachable(self.space.items)
            if area is None or area.mean() < free:
                break
            item = self.wall(*kinds, width=1.8)
            placed += [item] if item is not None else []
        return placed

    def beside(self, thing: Thing, anchor: Item, sign: int, gap: float = 0.06) -> Item | None:
        """A thing to the right (+1) or left (-1) of an anchor, its back in line with the anchor's, turned the same way."""
        width, _, depth = thing.model.size
        across = sign * (anchor.half_width + gap + width / 2)
        back = anchor.half_depth - depth / 2
        x, z = anchor.middle + across * anchor.right - back * anchor.front
        return self.space.put(Item(thing, np.array([x, 0.0, z]), anchor.angle, self.space.room))

    def before(self, thing: Thing, anchor: Item, distance: float, turn: float = 0.0, off: float = 0.0) -> Item | None:
        """A thing on the floor before an anchor, ``off`` m to the right, turned by ``turn`` rad against it."""
        reach = anchor.half_depth + distance + thing.model.size[2] / 2
        x, z = anchor.middle + anchor.front * reach + anchor.right * off
        return self.space.put(Item(thing, np.array([x, 0.0, z]), anchor.angle + turn, self.space.room))

    def along(self, item: Item) -> tuple[Side, float]:
        """The wall behind an item, and where on it the item's middle lies, m."""
        side = wall_behind(self.space, item)
        return side, float(item.middle[0 if side.axis == "x" else 1])

    def sides(self) -> list[Side]:
        """The walls in a random order."""
        return [self.space.sides[i] for i in self.rng.permutation(len(self.space.sides))]

    def hung(
        self, thing: Thing | None, base: float, clear: float = 0.12, sides: list[Side] | None = None
    ) -> Item | None:
        """A thing on some wall, its base ``base`` m above the floor, where there is air around it."""
        if thing is None:
            return None
        base = mounting(thing, base)
        half = float(thing.model.size[0]) / 2
        for side in self.sides() if sides is None else sides:
            a, b = side.start + half + 0.1, side.end - half - 0.1
            if b <= a:
                continue
            spots = self.rng.uniform(a, b, 6).tolist()
            if (item := self.space.hang(thing, base, side, spots, clear=clear)) is not None:
                return item
        return None

    def picture(self, width: float = 1.2, height: float = 0.9) -> Thing:
        """Something framed for a wall."""
        return self.stock.get("picture", "poster", width=width, height=height) or own(
            "picture", primitives.picture(self.rng)
        )

    def pictures(self, count: int, over: Item | None = None) -> None:
        """Pictures on the walls with their middles at eye height, one of them over an item."""
        if over is not None:
            side, at = self.along(over)
            thing = self.picture(width=max(0.5, 1.6 * over.half_width))
            base = max(1.55 - float(thing.model.size[1]) / 2, float(over.high[1]) + 0.15)
            if base + thing.model.size[1] < self.space.ceiling - 0.2:
                self.space.hang(thing, base, side, [at, at + 0.2, at - 0.2])
        for side in self.sides()[:count]:
            thing = self.picture()
            self.hung(thing, 1.55 - float(thing.model.size[1]) / 2, clear=0.2, sides=[side])

    def mirror(self, width: float, base: float, side: Side, spots: list[float]) -> Item | None:
        """A mirror on a wall."""
        thing = self.stock.get("mirror", width=width, height=self.space.ceiling - base - 0.15, depth=0.12)
        return self.space.hang(thing or own("mirror", primitives.mirror(self.rng, min(width, 0.7))), base, side, spots)

    def clock(self) -> Item | None:
        """A clock high on a wall."""
        return self.hung(self.stock.get("wall clock", "clock", "cuckoo clock", height=0.7, depth=0.3), 1.65)

    def ceiling(self, *kinds: str) -> None:
        """A lamp under the middle of the ceiling, unless one hangs there."""
        kinds = kinds or ("ceiling lamp", "ceiling fan", "pendant lamp")
        if any(i.thing.kind in kinds for i in self.space.items):
            return
        thing = self.stock.get(*kinds, width=1.2, height=0.5) if self.chance(0.8) else None
        thing = thing or own("ceiling lamp", primitives.ceiling_lamp(self.rng))
        r = self.space.rect
        self.under_ceiling(thing, np.array([(r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2]))

    def under_ceiling(self, thing: Thing, place: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Item | None:
        """A lamp under the ceiling at (x, z) m."""
        y = self.space.ceiling - float(thing.model.size[1]) - 0.001
        return self.space.put(Item(thing, np.array([place[0], y, place[1]]), 0.0, self.space.room))

    def under_ceiling_row(self, count: int) -> None:
        """Lamps of one model in a row along a long room."""
        thing = self.stock.get("ceiling lamp", width=0.6, height=0.35)
        thing = thing or own("ceiling lamp", primitives.ceiling_lamp(self.rng))
        r = self.space.rect
        for k in range(count):
            s = (k + 0.5) / count
            x = r.x0 + s * r.width if r.width > r.depth else (r.x0 + r.x1) / 2
            z = (r.z0 + r.z1) / 2 if r.width > r.depth else r.z0 + s * r.depth
            self.under_ceiling(thing, np.array([x, z]))

    def windows(self) -> list[tuple[Side, Opening]]:
        """The windows and glazed doors of the room, each with its wall."""
        return [
            (s, o) for s in self.space.sides for o in self.space.plan.on_side(s) if o.kind in ("window", "balcony door")
        ]

    def radiator(self) -> None:
        """Radiators of one make below the windows."""
        thing: Thing | None = None
        for side, o in self.windows():
            if o.kind == "window" and o.sill > 0.5:
                thing = thing or self.stock.get(
                    "radiator", depth=0.3, height=o.sill - 0.12, width=o.end - o.start + 0.3
                )
                if thing is not None and thing.model.size[1] < o.sill - 0.08:
                    self.space.against_wall(thing, [side], at=(o.start + o.end) / 2)

    def curtains(self, chance: float = 0.9) -> None:
        """Curtains of one cloth at the windows, all to the floor where it is free, or all to the sill."""
        if not self.chance(chance):
            return
        # Below the cornice.
        top = min(self.space.ceiling - 0.1, 2.45)
        seed, long = int(self.rng.integers(2**31)), self.chance(0.5)
        for side, o in ((s, o) for s, o in self.windows() if o.kind == "window"):
            to_sill, to_floor = top - o.sill + 0.05, top - 0.03
            for length in (to_floor, to_sill) if long else (to_sill,):
                width = min(o.end - o.start + 0.5, side.end - side.start - 0.1, 3.6)
                thing = self.stock.again(seed, "curtain", width=width, height=length, depth=0.2)
                if thing is not None and self._at_window(thing, side, o, top):
                    break

    def _at_window(self, thing: Thing, side: Side, o: Opening, top: float) -> bool:
        middle, half = (o.start + o.end) / 2, float(thing.model.size[0]) / 2
        at = float(np.clip(middle, side.start + half + 0.02, side.end - half - 0.02))
        thing = _bracketed(thing)
        x, z = side.point(at, float(thing.model.size[2]) / 2 + 0.002)
        place = np.array([x, top - float(thing.model.size[1]), z])
        return self.space.put(Item(thing, place, turn_of(side), self.space.room), drape=True) is not None

    def rug(self, width: float, depth: float, x: float, z: float, angle: float) -> Item | None:
        """A rug around a point, (x, z) m, no larger than the room allows."""
        r = self.space.rect
        turned = abs(np.sin(angle)) > 0.7
        wide = 2 * min(x - r.x0, r.x1 - x) - 0.1
        deep = 2 * min(z - r.z0, r.z1 - z) - 0.1
        room = (deep, wide) if turned else (wide, deep)
        width, depth = min(width, room[0]), min(depth, room[1])
        if width < 0.6 or depth < 0.4:
            return None
        thing = self.stock.get("rug", "round rug", width=width, depth=depth)
        if thing is None or thing.model.size[0] * thing.model.size[2] < 0.45 * width * depth:
            thing = own("rug", primitives.rug(self.rng, width, depth))
        return self.space.put(Item(thing, np.array([x, 0.0, z]), angle, self.space.room), rest=True)

    def cushions(self, seat: Item, most: int, level: float = 0.06) -> None:
        """Cushions on a sofa or a bed."""
        for _ in range(most):
            thing = self.stock.get("cushion", width=0.6, depth=0.6) or own(
                "cushion", primitives.cushion(self.rng), material="fabric"
            )
            self.space.on_top(thing, seat, level=level)

    def books(self, support: Item | None) -> None:
        """A pile of books on a support."""
        if support is not None:
            thing = self.stock.get("books", "pile of books", height=0.3) or own("books", primitives.books(self.rng))
            self.space.on_top(thing, support)


def mounting(thing: Thing, base: float) -> float:
    """At which height a thing is put on a wall, m: what is made by rule knows it by itself (a towel ladder stands)."""
    return thing.elevation if thing.made else base


def _bracketed(thing: Thing) -> Thing:
    """A curtain whose rod is held ``CURTAIN_OFF`` m off the wall by two brackets."""
    low, high = thing.model.vertices.min(0), thing.model.vertices.max(0)
    iron, y, back = primitives.material("bracket", (0.35, 0.34, 0.33)), float(high[1]) - 0.03, float(low[2])
    arms = [
        primitives.box(
            (x - 0.008, y - 0.008, back - CURTAIN_OFF), (x + 0.008, y + 0.008, (back + float(high[2])) / 2), iron
        )
        for x in (float(low[0]) + 0.07, float(high[0]) - 0.07)
    ]
    model = primitives.merge([thing.model, *arms])
    middle = np.array([0.0, 0.0, (model.vertices[:, 2].max() + model.vertices[:, 2].min()) / 2], np.float32)
    return replace(thing, model=replace(model, vertices=model.vertices - middle))


def large_enough(thing: Thing) -> bool:
    """Whether someone who stands near it sees enough of a thing."""
    size = np.sort(thing.model.size)
    return float(size[1] * size[2]) >= SMALLEST


def stretched(
    thing: Thing, width: float | None = None, height: float | None = None, depth: float | None = None
) -> Thing:
    """A thing brought to a width, height and depth, m, as far as a sixth more or less of each goes unnoticed."""
    size = thing.model.size
    wanted = [s if w is None else w for s, w in zip(size, (width, height, depth), strict=True)]
    x, y, z = (float(np.clip(w / s, 0.7, 1.35)) for w, s in zip(wanted, size, strict=True))
    return scaled(thing, x, y, z)


def wall_behind(space: RoomSpace, item: Item) -> Side:
    """The wall nearest to an item's back."""
    back = item.middle - item.front * 10.0
    return min(
        (s for s in space.sides if (abs(item.front[1]) > 0.7) == (s.axis == "x")),
        key=lambda s: abs(float(back[1 if s.axis == "x" else 0]) - s.at),
    )
