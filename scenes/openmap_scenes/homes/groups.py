"""Things that belong together: sofa and coffee table, table and chairs, bed and nightstands, desk and computer."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.furnisher import Furnisher, wall_behind
from openmap_scenes.homes.placement import Item, Thing
from openmap_scenes.homes.stock import own

COFFEE_TABLE = (
    "book", "remote control", "newspaper", "bowl of fruit", "mug", "vase", "candle", "chessboard", "game controller",
    "tablet", "cup", "ashtray", "teapot", "coffee cup", "bowl of apples", "sunglasses", "camera", "keys",
)  # fmt: skip

DESK = (
    "pen holder", "phone", "mug", "letter tray", "printer", "headphones", "calendar", "tablet", "book", "camera",
    "coffee cup", "cactus", "rubik's cube", "eyeglasses", "fan",
)  # fmt: skip


def sofa_group(f: Furnisher, sofa: Item) -> None:
    """Rug, coffee table, television across, armchairs at the sides."""
    space, stock, rng = f.space, f.stock, f.rng
    middle = (sofa.low + sofa.high)[[0, 2]] / 2
    opposite = next(
        s for s in space.sides if s.axis == wall_behind(space, sofa).axis and s is not wall_behind(space, sofa)
    )
    at = float(middle[0 if opposite.axis == "x" else 1])
    stand = None
    for kinds in (
        ("tv stand", "tv cabinet", "entertainment center"),
        ("sideboard", "chest of drawers", "dresser", "shelves", "trunk"),
    ):
        thing = stock.get(*kinds, height=2.1 if "tv stand" in kinds else 1.05)
        if thing is not None and (stand := space.against_wall(thing, [opposite], at=at)) is not None:
            break
    screen = stock.get("television", height=0.8)
    if stand is not None and screen is not None and stand.thing.kind != "entertainment center":
        space.on_top(screen, stand, spread=0.0, tries=30)
    elif (flat := stock.get("wall television")) is not None:
        space.hang(flat, 1.0, opposite, [at, at - 0.4, at + 0.4, at - 0.8, at + 0.8])
    f.tops(
        stand, ("dvd player", "game console", "game controller", "speaker dock", "amplifier", "vase", "projector"), 2
    )
    reach = float(np.abs(sofa.front) @ (sofa.high - sofa.low)[[0, 2]]) / 2
    x, z = middle + sofa.front * (reach + 0.75)
    f.rug(2.1, 1.4, x, z, sofa.angle)
    thing = stock.get("coffee table") or stock.get("trunk", "bench")
    table = space.facing(thing, sofa, float(rng.uniform(0.36, 0.45))) if thing is not None else None
    if table is not None:
        f.tops(table, COFFEE_TABLE, 3)
        if rng.random() < 0.5:
            space.on_top(own("books", primitives.books(rng)), table)
        right = np.array([sofa.front[1], -sofa.front[0]])
        chair = stock.get("armchair")
        for sign in (1, -1) if rng.random() < 0.6 else (-1,):
            if chair is None:
                break
            extent = float(np.abs(right) @ (table.high - table.low)[[0, 2]]) / 2
            centre = (table.low + table.high)[[0, 2]] / 2 + sign * right * (extent + 0.4 + chair.model.size[2] / 2)
            look = -sign * right
            angle = float(np.arctan2(look[0], look[1])) + float(rng.normal(0, 0.12))
            space.put(Item(chair, np.array([centre[0], 0.0, centre[1]]), angle, space.room))
    side_table = stock.get("nightstand", "stool", height=0.6)
    if side_table is not None:
        side = f.beside(side_table, sofa, 1) or f.beside(side_table, sofa, -1)
        f.tops(side, ("table lamp",), 1)
    lamp = stock.get("floor lamp")
    if lamp is not None:
        _ = f.beside(lamp, sofa, -1) or f.beside(lamp, sofa, 1)
    for _ in range(int(rng.integers(1, 3))):
        space.on_top(own("cushion", primitives.cushion(rng), material="fabric"), sofa, level=0.05)


def dining_group(f: Furnisher, most: int) -> Item | None:
    """A table, chairs of one kind around it, something on it, perhaps a lamp above."""
    space, stock, rng = f.space, f.stock, f.rng
    chair = stock.get("chair", width=0.62, depth=0.7) or stock.get("folding chair", "stool")
    table = None
    for attempt in range(6):
        thing = stock.get("dining table", "round table", height=0.95, width=9.0 if attempt < 3 else 1.3)
        thing = thing or stock.get("folding table")
        before = len(space.items)
        table = near_middle(f, thing) if thing is not None else None
        # A table at which hardly anyone can sit is no use.
        if table is not None and chair is not None and len(space.around(chair, table, most)) >= 2:
            break
        del space.items[before:]
        table = None
    if table is None:
        return None
    f.tops(
        table, ("vase", "bowl of fruit", "flowers", "tulips", "lilies", "candle", "bowl of apples", "birthday cake"), 1
    )
    setting = stock.get("place setting", "plate")
    for _ in range(int(rng.integers(0, 3))):
        if setting is not None:
            space.on_top(setting, table)
    f.tops(table, ("wine bottle", "glass", "teapot", "bowl of salad", "roast chicken", "cup", "jar", "beer glass"), 2)
    lamp = stock.get("pendant lamp")
    if lamp is not None and rng.random() < 0.8:
        middle = (table.low + table.high) / 2
        y = space.plan.ceiling - float(lamp.model.size[1]) - 0.001
        space.put(Item(lamp, np.array([middle[0], y, middle[2]]), 0.0, space.room))
    return table


def near_middle(f: Furnisher, thing: Thing) -> Item | None:
    r, rng = f.space.rect, f.rng
    for k in range(14):
        s = 0.1 + 0.35 * k / 14
        x = (r.x0 + r.x1) / 2 + float(rng.uniform(-s, s)) * r.width
        z = (r.z0 + r.z1) / 2 + float(rng.uniform(-s, s)) * r.depth
        item = Item(thing, np.array([x, 0.0, z]), float(rng.integers(2)) * np.pi / 2, f.space.room)
        # Room for chairs, or the table is of no use.
        fp = item.footprint
        if min(fp.x0 - r.x0, r.x1 - fp.x1, fp.z0 - r.z0, r.z1 - fp.z1) < 0.55:
            continue
        if f.space.put(item) is not None:
            return item
    return None


def bed_with_room(f: Furnisher, thing: Thing) -> Item | None:
    """A bed with its head to a wall, where a nightstand would fit beside it."""
    width = float(thing.model.size[0])
    sides = sorted(f.space.sides, key=lambda s: (s.outer, f.rng.random()))
    for side in sides:
        centre = (side.start + side.end) / 2
        spots = [centre, side.start + 0.65 + width / 2, side.end - 0.65 - width / 2]
        for at in spots:
            if (item := f.space.against_wall(thing, [side], at=at)) is not None:
                return item
    return f.space.against_wall(thing)


def bedside(f: Furnisher, bed: Item) -> None:
    stand = f.stock.get("nightstand") or f.stock.get("stool", "piano bench", height=0.6)
    lamp = f.stock.get("table lamp", height=0.75)
    for sign in (1, -1):
        item = f.beside(stand, bed, sign) if stand is not None else None
        if item is not None:
            if lamp is not None:
                f.space.on_top(lamp, item, back=True)
            f.tops(item, ("alarm clock", "book", "mug", "glass", "tablet", "eyeglasses", "cordless phone"), 1)


def desk_things(f: Furnisher, desk: Item) -> None:
    """Chair before it, computer on it, lamp and small things."""
    space, stock = f.space, f.stock
    chair = stock.get("office chair") or stock.get("chair", width=0.65)
    if chair is not None:
        extent = float(np.abs(desk.front) @ (desk.high - desk.low)[[0, 2]]) / 2
        x, z = (desk.low + desk.high)[[0, 2]] / 2 + desk.front * (extent + 0.03 + chair.model.size[2] / 2)
        space.put(Item(chair, np.array([x, 0.0, z]), desk.angle + np.pi, space.room))
    computer = stock.get("computer", "laptop")
    if computer is not None:
        space.on_top(computer, desk, back=False, spread=0.05)
    f.tops(desk, ("desk lamp",), 1, back=True) or f.tops(desk, ("table lamp",), 1, back=True)
    f.tops(desk, DESK, 4)
