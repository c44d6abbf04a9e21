"""The tools of the furnishing rules: a room, the stock, and the ways in which people put things."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.placement import Item, RoomSpace, Thing
from openmap_scenes.homes.plan import Side
from openmap_scenes.homes.stock import Stock, own


@dataclass(frozen=True)
class Furnisher:
    """A room, the stock, and the random choices: what every rule needs."""

    space: RoomSpace
    stock: Stock
    rng: np.random.Generator

    def wall(
        self, *kinds: str, corner: bool = False, width: float = 9.0, depth: float = 9.0, height: float = 9.0
    ) -> Item | None:
        """One of the kinds with its back to some wall."""
        for _ in range(2):
            thing = self.stock.get(*kinds, width=width, depth=depth, height=height)
            if thing is not None and (item := self.space.against_wall(thing, corner=corner)) is not None:
                return item
        return None

    def tops(self, support: Item | None, kinds: tuple[str, ...], most: int, back: bool = False) -> list[Item]:
        """Up to ``most`` different small things on a support."""
        placed: list[Item] = []
        if support is None:
            return placed
        order = [kinds[i] for i in self.rng.permutation(len(kinds))]
        for kind in order:
            if len(placed) >= most:
                break
            thing = self.stock.get(kind, height=0.75, fresh=True)
            if thing is not None and (item := self.space.on_top(thing, support, back=back)) is not None:
                placed.append(item)
        return placed

    def beside(self, thing: Thing, anchor: Item, sign: int, gap: float = 0.06) -> Item | None:
        """A thing to the right (+1) or left (-1) of an anchor, its back in line with the anchor's, turned the same way."""
        right = np.array([anchor.front[1], -anchor.front[0]])
        extent = (anchor.high - anchor.low)[[0, 2]]
        width, _, depth = thing.model.size
        middle = (anchor.low + anchor.high)[[0, 2]] / 2
        across = sign * (float(np.abs(right) @ extent) / 2 + gap + width / 2)
        back = float(np.abs(anchor.front) @ extent) / 2 - depth / 2
        x, z = middle + across * right - back * anchor.front
        return self.space.put(Item(thing, np.array([x, 0.0, z]), anchor.angle, self.space.room))

    def pictures(self, count: int, over: Item | None = None) -> None:
        """Pictures on the walls, one of them over an item."""
        sides = [self.space.sides[i] for i in self.rng.permutation(len(self.space.sides))]
        if over is not None:
            side = wall_behind(self.space, over)
            middle = (over.low + over.high) / 2
            along = float(middle[0 if side.axis == "x" else 2])
            thing = own("picture", primitives.picture(self.rng))
            base = max(1.3, float(over.high[1]) + 0.15)
            if base + thing.model.size[1] < self.space.plan.ceiling - 0.2:
                self.space.hang(thing, base, side, [along, along + 0.3, along - 0.3])
        for side in sides[:count]:
            spots = self.rng.uniform(side.start + 0.3, side.end - 0.3, 4).tolist()
            self.space.hang(
                own("picture", primitives.picture(self.rng)), float(self.rng.uniform(1.3, 1.5)), side, spots
            )

    def ceiling(self) -> None:
        """A lamp under the middle of the ceiling."""
        thing = self.stock.get("ceiling lamp", "ceiling fan", width=1.2) if self.rng.random() < 0.4 else None
        thing = thing or own("ceiling lamp", primitives.ceiling_lamp(self.rng))
        r = self.space.rect
        y = self.space.plan.ceiling - float(thing.model.size[1]) - 0.001
        middle = np.array([(r.x0 + r.x1) / 2, y, (r.z0 + r.z1) / 2])
        self.space.put(Item(thing, middle, 0.0, self.space.room))

    def radiator(self) -> None:
        """A radiator below a window."""
        for side in self.space.sides:
            for o in self.space.plan.on_side(side):
                thing = self.stock.get("radiator", depth=0.3, height=o.sill - 0.05)
                if o.kind == "window" and thing is not None:
                    at = (o.start + o.end) / 2
                    self.space.against_wall(thing, [side], at=at)
                    return

    def rug(self, width: float, depth: float, x: float, z: float, angle: float) -> Item | None:
        """A rug around a point, (x, z) m."""
        thing = (
            self.stock.get("rug", "round rug", width=width + 0.6, depth=depth + 0.8)
            if self.rng.random() < 0.3
            else None
        )
        thing = thing or own("rug", primitives.rug(self.rng, width, depth))
        return self.space.put(Item(thing, np.array([x, 0.0, z]), angle, self.space.room), rest=True)


def wall_behind(space: RoomSpace, item: Item) -> Side:
    """The wall nearest to an item's back."""
    back = (item.low + item.high)[[0, 2]] / 2 - item.front * 10.0
    return min(
        (s for s in space.sides if (abs(item.front[1]) > 0.7) == (s.axis == "x")),
        key=lambda s: abs(float(back[1 if s.axis == "x" else 0]) - s.at),
    )
