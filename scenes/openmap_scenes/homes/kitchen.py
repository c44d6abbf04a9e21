"""The kitchen run: cabinets, sink, dishwasher and stove side by side under one worktop, cabinets and a hood above."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.furnisher import Furnisher, large_enough, stretched
from openmap_scenes.homes.items import Item, Thing
from openmap_scenes.homes.placement import GAP, RoomSpace, turn_of
from openmap_scenes.homes.plan import Side
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.wishes import FRIDGE, HOT, NEEDS, SINKS

# A counter's height and depth, m; units of different makers are brought to them so that the worktop runs on.
HEIGHT, DEPTH = 0.9, 0.62
BASES = ("kitchen cabinet", "kitchen drawers")
COUNTER = (
    "microwave", "toaster", "kettle", "coffee maker", "coffee machine", "blender", "knife block", "cutting board", "bread",
    "bread box", "pot", "bowl", "bowl of fruit", "stand mixer", "paper towels", "spice rack", "utensil holder", "teapot",
    "kitchen scale", "milk carton", "wine bottle", "oil bottles", "mug", "glass", "toaster oven", "sandwich maker", "jar",
    "juicer", "moka pot", "beer bottle", "plate", "coffee press", "deep fryer", "sugar bowl", "butter", "sushi tray", "cup",
    "radio", "tray", "bottle", "pan", "rice cooker", "dish rack", "cereal box", "potted plant", "jug", "basket", "banana",
)  # fmt: skip


def furnish_kitchen(f: Furnisher, longest: float = 9.0) -> list[Item]:
    """A kitchen's run and what hangs over it and lies on it; returns the base units."""
    placed = kitchen_run(f, longest)
    if not (f.complete and _lacking(f, placed)):
        dress_run(f, placed)
    return placed


def kitchen_run(f: Furnisher, longest: float = 9.0) -> list[Item]:
    """Put the base units down along the wall with the longest free stretch, up to ``longest`` m, and on along others."""
    space, rng = f.space, f.rng
    placed: list[Item] = []
    units = _units(f)
    stretches = _stretches(space)
    for n, (length, i, a, b) in enumerate(stretches[:3]):
        side, left = space.sides[i], min(length - 2 * GAP, longest)
        if n > 0 and not units and not (placed and len(placed) < 6):
            break
        row = _chosen(f, units, left, fill=n == 0)
        flip = bool(rng.random() < 0.5)
        a, b = (b - GAP - left, b - GAP) if flip else (a + GAP, a + GAP + left)
        placed += _row(space, side, a, b, row, flip)
    if not any(p.thing.kind == "refrigerator" for p in placed):
        fridge = f.stock.get("refrigerator", width=0.9) or f.stock.get("refrigerator")
        item = space.against_wall(fridge, tries=80) if fridge is not None else None
        placed += [item] if item is not None else []
    for unit in units:
        item = space.against_wall(unit, tries=120)
        placed += [item] if item is not None else []
    for kinds in _lacking(f, placed):
        placed = _made_room(f, kinds, placed)
    return placed


def dress_run(f: Furnisher, placed: list[Item]) -> None:
    """Cabinets and a hood above the units, things on their worktops."""
    _above(f, placed)
    _on_counter(f, [p for p in placed if p.thing.kind in BASES or p.thing.kind == "dishwasher"])
    sink = next((p for p in placed if p.thing.kind == "kitchen sink"), None)
    f.tops(sink, ("soap dispenser", "dish rack", "glass", "utensil holder"), 1)
    stove = next((p for p in placed if p.thing.kind == "stove"), None)
    f.tops(stove, ("pot", "pan", "kettle", "moka pot"), 2)


def _lacking(f: Furnisher, placed: list[Item]) -> list[tuple[str, ...]]:
    """What the run must have, could have, and has not."""
    there = {p.thing.kind for p in placed}
    rows = [row for row in (SINKS, HOT, FRIDGE) if row in NEEDS[f.space.kind]]
    return [row for row in rows if not there & set(row) and any(f.stock.has(k) for k in row)]


def _made_room(f: Furnisher, kinds: tuple[str, ...], placed: list[Item]) -> list[Item]:
    """The units with one of the kinds as wide as some wall allows, or else in the place of what fills the run."""
    for width in (1.0, 0.8, 0.62):
        thing = f.stock.get(*kinds, width=width, depth=0.8, height=2.1)
        item = f.space.against_wall(thing, tries=80) if thing is not None else None
        if item is not None:
            return [*placed, item]
    for unit in [p for p in placed if p.thing.kind in (*BASES, "dishwasher", "tall cabinet")]:
        thing = f.stock.get(*kinds, width=2 * unit.half_width + 0.002, depth=0.8, height=2.1)
        if thing is not None:
            side, along = f.along(unit)
            before = list(f.space.items)
            f.space.remove([unit])
            if (item := f.space.against_wall(thing, [side], at=along)) is not None:
                return [*(p for p in placed if p is not unit), item]
            f.space.items = before
    return placed


def _on_counter(f: Furnisher, counters: list[Item]) -> None:
    order = [COUNTER[i] for i in f.rng.permutation(len(COUNTER))]
    wanted = 3 * len(counters) + 2
    for kind in order:
        if wanted <= 0 or not counters:
            break
        thing = f.stock.get(kind, height=0.5, depth=0.55, fresh=True)
        if thing is None or not large_enough(thing):
            continue
        for k in f.rng.permutation(len(counters)).tolist():
            if f.space.on_top(thing, counters[k], tries=6) is not None:
                wanted -= 1
                break


def _stretches(space: RoomSpace) -> list[tuple[float, int, float, float]]:
    """Free stretches of wall (length, side, start, end), the longest first."""
    return sorted(((b - a, i, a, b) for i, side in enumerate(space.sides) for a, b in _free(space, side)), reverse=True)


def _unit(f: Furnisher, *kinds: str) -> Thing | None:
    """A unit of the home's one kitchen style, its worktop brought to the counter's height, its front to the counter's."""
    match = any(f.stock.makes(k) for k in kinds) and f.stock.kitchen_made
    thing = None
    for same in (match, False):
        thing = thing or f.stock.get(
            *kinds, height=1.5, width=1.25, depth=0.75, match=same, made=True if same else None
        )
    if thing is None or thing.made:
        return thing
    grown = HEIGHT / _worktop(thing)
    return stretched(thing, height=float(thing.model.size[1]) * grown, depth=DEPTH)


def _worktop(thing: Thing) -> float:
    """How high the worktop of a unit lies, m: its middle height near the front, beside bowl, taps and hobs."""
    low, high = thing.model.vertices.min(0), thing.model.vertices.max(0)
    x = np.linspace(0.06, 0.94, 8) * (high[0] - low[0]) + low[0]
    start = np.stack([x, np.full(8, high[1] + 0.1), np.full(8, high[2] - 0.2 * (high[2] - low[2]))], 1)
    caster = RayCaster(thing.model.vertices, thing.model.faces)
    hit = high[1] + 0.1 - caster.distance(start, np.broadcast_to([0.0, -1.0, 0.0], start.shape))
    return float(np.clip(np.median(hit[np.isfinite(hit)]) if np.isfinite(hit).any() else high[1], 0.6, 1.2))


def _units(f: Furnisher) -> list[Thing]:
    """What every kitchen needs, the most needed first."""
    wanted = [
        _unit(f, "kitchen sink") or f.stock.get("washbasin", height=1.0),
        _unit(f, "stove") or f.stock.get(*HOT),
    ]
    return [unit for unit in wanted if unit is not None]


def _chosen(f: Furnisher, units: list[Thing], left: float, fill: bool) -> list[Thing]:
    """Which units stand in a stretch of ``left`` m, in order; what is needed is taken out of ``units``."""
    needed = []
    for unit in list(units):
        if unit.model.size[0] <= left:
            needed.append(unit)
            units.remove(unit)
            left -= float(unit.model.size[0])
    tall = []
    if fill:
        fridge = f.stock.get("refrigerator", width=min(left, 0.95), height=2.1)
        if fridge is not None:
            tall.append(fridge)
            left -= float(fridge.model.size[0])
        washer = _unit(f, "dishwasher") if left > 1.2 else None
        if washer is not None and washer.model.size[0] < left:
            needed.insert(1, washer)
            left -= float(washer.model.size[0])
        extra = f.stock.get("tall cabinet", "double oven", height=2.3) if left > 1.9 and f.chance(0.4) else None
        if extra is not None and extra.model.size[0] < left - 0.8:
            tall.append(extra)
            left -= float(extra.model.size[0])
    return [*tall, *_mixed(needed, _fillers(f, left))]


def _fillers(f: Furnisher, left: float) -> list[Thing]:
    """Cabinets and drawers that fill ``left`` m to the end."""
    cabinet, drawers = _unit(f, "kitchen cabinet"), _unit(f, "kitchen drawers")
    kinds = [c for c in (cabinet, drawers) if c is not None]
    if not kinds or left < 0.3:
        return []
    out: list[Thing] = []
    while left > 0.3 and len(out) < 8:
        unit = kinds[len(out) % len(kinds)]
        width = float(unit.model.size[0])
        if width > left * 1.3:
            unit = min(kinds, key=lambda u: float(u.model.size[0]))
            width = float(unit.model.size[0])
            if width * 0.72 > left:
                break
        rest = left - width
        if rest < 0.3:
            width = min(left, width * 1.34)
        unit = stretched(unit, width=width)
        out.append(unit)
        left -= float(unit.model.size[0])
    return out


def _mixed(needed: list[Thing], fillers: list[Thing]) -> list[Thing]:
    """Needed units with cabinets between them, so that sink and stove have a worktop on both sides."""
    row, rest = [], list(fillers)
    share = len(fillers) / (len(needed) + 1)
    for k, unit in enumerate(needed):
        while rest and len(fillers) - len(rest) < round(share * (k + 1)):
            row.append(rest.pop(0))
        row.append(unit)
    return [*row, *rest]


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
    low, high = sorted((side.at, side.at + side.inward * (DEPTH + 0.04)))
    for zone in (*space.zones, *space.leaves):
        span = ((zone.x0, zone.x1), (zone.z0, zone.z1))
        near = span[1 - axis]
        if near[0] < high and near[1] > low:
            blocked.append((span[axis][0] - 0.03, span[axis][1] + 0.03))
    blocked += [(o.start, o.end) for o in space.plan.on_side(side) if o.sill < HEIGHT + 0.08]
    for item in space.items:
        near = (float(item.low[2 - 2 * axis]), float(item.high[2 - 2 * axis]))
        if item.low[1] < 1.0 and near[0] < high and near[1] > low:
            blocked.append((float(item.low[2 * axis]), float(item.high[2 * axis])))
    free, cursor = [], side.start
    for a, b in [*sorted(blocked), (side.end, side.end)]:
        if a - cursor > 0.6:
            free.append((cursor, a))
        cursor = max(cursor, b)
    return free


def _above(f: Furnisher, placed: list[Item]) -> None:
    """A hood over the stove, wall cabinets of one make over the counter, as wide as what they hang over."""
    space, stock = f.space, f.stock
    match = stock.kitchen_made and stock.makes("wall cabinet")
    cabinet = stock.get(
        "wall cabinet", "glass cabinet", width=1.0, height=0.95, match=match, made=True if match else None
    )
    hood = stock.get("range hood", width=1.1, height=1.0)
    for base in placed:
        side, along = f.along(base)
        wide = 2 * base.half_width
        if base.thing.kind == "stove" and base.high[1] < 1.3:
            if hood is not None:
                fitted = stretched(hood, width=min(wide, 0.9))
                space.hang(fitted, min(1.65, space.ceiling - 0.05 - float(fitted.model.size[1])), side, [along])
        elif base.high[1] < 1.3 and cabinet is not None and base.thing.kind != "washbasin":
            n = max(1, round(wide / float(cabinet.model.size[0])))
            fitted = stretched(cabinet, width=wide / n - 0.004)
            for k in range(n):
                at = along + (k + 0.5 - n / 2) * (float(fitted.model.size[0]) + 0.002)
                space.hang(fitted, min(1.45, space.ceiling - 0.08 - float(fitted.model.size[1])), side, [at])
