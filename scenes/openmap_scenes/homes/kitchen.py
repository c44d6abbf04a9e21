"""The kitchen run: refrigerator, cabinets, sink and stove side by side along a wall, cabinets and a hood above."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.placement import GAP, Item, RoomSpace, Thing, turn_of
from openmap_scenes.homes.plan import Side
from openmap_scenes.homes.stock import Stock

DEPTH = 0.66
COUNTER = (
    "microwave", "toaster", "kettle", "coffee maker", "coffee machine", "blender", "knife block", "cutting board", "bread",
    "bread box", "pot", "bowl", "bowl of fruit", "stand mixer", "paper towels", "spice rack", "utensil holder", "teapot",
    "kitchen scale", "milk carton", "wine bottle", "oil bottles", "mug", "glass", "toaster oven", "sandwich maker", "jar",
    "juicer", "moka pot", "beer bottle", "plate", "coffee press", "deep fryer", "sugar bowl", "butter", "yogurt bottle",
    "sushi tray", "creamer", "cocktail glass", "radio", "tray",
)  # fmt: skip


def furnish_kitchen(space: RoomSpace, stock: Stock) -> list[Item]:
    """Put the run down along the wall with the longest free stretch, and things on its counter; returns the base units."""
    rng = space.rng
    placed: list[Item] = []
    fridge = stock.get("refrigerator")
    if fridge is not None:
        item = _at_an_end(space, fridge) or space.against_wall(fridge, tries=80)
        placed += [item] if item is not None else []
    units = _units(stock)
    for length, i, a, b in _stretches(space)[:3]:
        chosen, left = [], length - 2 * GAP
        for unit in list(units):
            if unit.model.size[0] <= left:
                chosen.append(unit)
                units.remove(unit)
                left -= float(unit.model.size[0])
        placed += _row(space, space.sides[i], a + GAP, b - GAP, _ordered(chosen), bool(rng.random() < 0.5))
        if not units:
            break
    for unit in units:
        if unit.kind in ("stove", "kitchen sink"):
            item = space.against_wall(unit, tries=120)
            placed += [item] if item is not None else []
    _above(space, stock, placed)
    counters = [p for p in placed if p.thing.kind in ("kitchen cabinet", "kitchen drawers")]
    order = [COUNTER[i] for i in rng.permutation(len(COUNTER))]
    for kind in order[:20]:
        thing = stock.get(kind, height=0.55, fresh=True)
        if thing is None or not counters:
            continue
        for k in rng.permutation(len(counters)).tolist():
            if space.on_top(thing, counters[k], tries=5) is not None:
                break
    return placed


def _stretches(space: RoomSpace) -> list[tuple[float, int, float, float]]:
    """Free stretches of wall (length, side, start, end), the longest first."""
    return sorted(((b - a, i, a, b) for i, side in enumerate(space.sides) for a, b in _free(space, side)), reverse=True)


def _at_an_end(space: RoomSpace, thing: Thing) -> Item | None:
    """A thing at an end of a free stretch of wall that leaves the rest of it to the counter."""
    half = float(thing.model.size[0]) / 2 + GAP
    for _, i, a, b in _stretches(space):
        ends = (a + half, b - half) if space.rng.random() < 0.5 else (b - half, a + half)
        for at in ends:
            if (item := space.against_wall(thing, [space.sides[i]], at=at)) is not None:
                return item
    return None


def _units(stock: Stock) -> list[Thing]:
    """What a run is made of, the most needed first; cabinets of one model so that they match."""
    cabinet, drawers = stock.get("kitchen cabinet"), stock.get("kitchen drawers")
    wanted = [
        stock.get("kitchen sink") or stock.get("washbasin", height=1.0),
        stock.get("stove") or stock.get("tall cabinet", "double oven", "oven"),
        cabinet,
        drawers or cabinet,
        cabinet,
        stock.get("tall cabinet", "double oven", fresh=True),
        cabinet,
    ]
    return [unit for unit in wanted if unit is not None]


def _ordered(units: list[Thing]) -> list[Thing]:
    """Tall ones at the end, the sink and the stove apart with a cabinet between."""
    tall = [u for u in units if u.model.size[1] > 1.3]
    low = [u for u in units if u.kind in ("kitchen cabinet", "kitchen drawers")]
    wet = [u for u in units if u not in tall and u not in low]
    row = list(tall)
    while low or wet:
        if low:
            row.append(low.pop(0))
        if wet:
            row.append(wet.pop(0))
    return row


def _row(space: RoomSpace, side: Side, a: float, b: float, units: list[Thing], flip: bool) -> list[Item]:
    """Units side by side from one end of a stretch of wall; one that does not fit is left out."""
    placed, cursor = [], 0.0
    for unit in units:
        width, _, depth = unit.model.size
        along = b - cursor - width / 2 if flip else a + cursor + width / 2
        x, z = side.point(float(along), float(depth) / 2 + GAP)
        item = space.put(Item(unit, np.array([x, 0.0, z]), turn_of(side), space.room))
        if item is not None:
            placed.append(item)
            cursor += float(width)
    return placed


def _free(space: RoomSpace, side: Side) -> list[tuple[float, float]]:
    """Stretches of a wall before which a counter may stand: no door in it or beside it, no low window."""
    axis = 0 if side.axis == "x" else 1
    blocked = []
    for zone in space.zones:
        span = ((zone.x0, zone.x1), (zone.z0, zone.z1))
        near = span[1 - axis]
        low, high = sorted((side.at, side.at + side.inward * DEPTH))
        if near[0] < high and near[1] > low:
            blocked.append(span[axis])
    blocked += [(o.start, o.end) for o in space.plan.on_side(side) if o.kind == "window" and o.sill < 1.1]
    for item in space.items:
        near = (item.low[2 - 2 * axis], item.high[2 - 2 * axis])
        low, high = sorted((side.at, side.at + side.inward * DEPTH))
        if item.low[1] < 1.0 and near[0] < high and near[1] > low:
            blocked.append((float(item.low[2 * axis]), float(item.high[2 * axis])))
    free, cursor = [], side.start
    for a, b in [*sorted(blocked), (side.end, side.end)]:
        if a - cursor > 0.6:
            free.append((cursor, a))
        cursor = max(cursor, b)
    return free


def _above(space: RoomSpace, stock: Stock, placed: list[Item]) -> None:
    """A hood over the stove, wall cabinets over the counter."""
    cabinet = stock.get("wall cabinet", "glass cabinet", width=0.7)
    for base in placed:
        side = min(space.sides, key=lambda s: turn_of(s) != base.angle)
        along = float(((base.low + base.high) / 2)[0 if side.axis == "x" else 2])
        if base.thing.kind == "stove":
            hood = stock.get("range hood", width=1.1)
            if hood is not None:
                space.hang(hood, 1.62, side, [along])
        elif base.high[1] < 1.3 and cabinet is not None:
            width = float(cabinet.model.size[0])
            room = float((base.high - base.low)[0 if side.axis == "x" else 2])
            n = int(room / width + 0.05)
            for k in range(n):
                space.hang(cabinet, 1.45, side, [along + (k + 0.5 - n / 2) * (width + 0.001)])
