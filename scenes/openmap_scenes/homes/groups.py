"""Things that belong together: sofa and television, table and chairs, bed and nightstands, desk and computer."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.furnisher import Furnisher, large_enough, wall_behind
from openmap_scenes.homes.items import Item, Thing
from openmap_scenes.homes.plan import Side

COFFEE_TABLE = (
    "book", "newspaper", "magazine", "bowl of fruit", "mug", "vase", "candle", "chessboard", "game controller", "tablet", "cup",
    "teapot", "coffee cup", "bowl of apples", "camera", "potted plant", "tray", "remote control", "laptop", "bowl", "flowers",
)  # fmt: skip
TV_BOARD = (
    "dvd player", "game console", "speaker dock", "amplifier", "vase", "projector", "router", "photo frame", "speaker",
    "potted plant", "candle", "figurine",
)  # fmt: skip
DESK = (
    "pen holder", "phone", "mug", "letter tray", "printer", "headphones", "calendar", "tablet", "book", "camera", "coffee cup",
    "cactus", "rubik's cube", "fan", "photo frame", "globe", "succulent", "router", "notebook", "glass", "table clock",
)  # fmt: skip
BEDSIDE = (
    "alarm clock", "book", "mug", "glass", "tablet", "cordless phone", "photo frame", "vase", "candle", "bottle", "succulent",
)  # fmt: skip
TABLE_MIDDLE = (
    "vase", "bowl of fruit", "flowers", "tulips", "lilies", "candle", "bowl of apples", "birthday cake", "bowl", "teapot",
)  # fmt: skip
ON_TABLE = (
    "wine bottle", "glass", "teapot", "bowl of salad", "roast chicken", "cup", "jar", "beer glass", "bread", "bottle", "mug",
    "sushi tray", "newspaper", "laptop", "jug", "butter",
)  # fmt: skip
SHELF_THINGS = (
    "book", "vase", "photo frame", "candle", "figurine", "cat statue", "deer figurine", "succulent", "potted plant", "radio",
    "jar", "camera", "box", "bowl", "globe", "speaker dock", "toy car", "helmet", "basket", "table clock", "teapot", "cactus",
)  # fmt: skip


def sofa_group(f: Furnisher, sofa: Item) -> None:
    """Television across, rug, coffee table, armchairs at the sides, a lamp, cushions."""
    space, stock, rng = f.space, f.stock, f.rng
    television(f, sofa)
    x, z = sofa.middle + sofa.front * (sofa.half_depth + 0.8)
    f.rug(float(rng.uniform(2.0, 2.8)), float(rng.uniform(1.4, 1.8)), float(x), float(z), sofa.angle)
    table = None
    for width in (1.3, 0.9):
        thing = stock.get("coffee table", width=width, depth=0.8) or stock.get("trunk", "ottoman", width=width)
        table = f.before(thing, sofa, float(rng.uniform(0.36, 0.42))) if thing is not None else None
        if table is not None:
            break
    f.tops(table, COFFEE_TABLE, 4)
    if table is not None and f.chance(0.5):
        f.books(table)
    if table is not None:
        armchairs(f, table, sofa)
    small = stock.get("side table", "nightstand", "stool", height=0.65, width=0.6)
    if small is not None:
        side = f.beside(small, sofa, 1) or f.beside(small, sofa, -1)
        f.tops(side, ("table lamp",), 1) or f.tops(side, ("vase", "flowers", "potted plant"), 1)
        f.tops(side, ("book", "mug", "glass", "remote control", "phone"), 1)
    lamp = stock.get("floor lamp", width=0.7)
    if lamp is not None:
        _ = f.beside(lamp, sofa, -1) or f.beside(lamp, sofa, 1) or space.against_wall(lamp, corner=True)
    f.cushions(sofa, int(rng.integers(2, 4)))
    if f.chance(0.35):
        f.tops(sofa, ("blanket", "teddy bear"), 1)


def armchairs(f: Furnisher, table: Item, sofa: Item) -> None:
    """One or two armchairs of one model at the ends of the coffee table, turned to it."""
    chair = f.stock.get("armchair", "recliner", width=1.0, depth=1.0)
    for sign in (1, -1) if f.chance(0.6) else (-1, 1)[: int(f.rng.integers(1, 3))]:
        if chair is None:
            return
        for gap in (0.35, 0.55):
            off = table.half_width + gap + chair.model.size[2] / 2
            place = table.middle + sign * sofa.right * off
            look = -sign * sofa.right
            angle = float(np.arctan2(look[0], look[1])) + float(f.rng.normal(0, 0.1))
            if f.space.put(Item(chair, np.array([place[0], 0.0, place[1]]), angle, f.space.room)) is not None:
                break


def television(f: Furnisher, sofa: Item) -> Item | None:
    """A television across from the sofa, on a low cabinet or on the wall; where that cannot be, on another wall."""
    behind = wall_behind(f.space, sofa)
    across = next(s for s in f.space.sides if s.axis == behind.axis and s is not behind)
    others = [s for s in f.sides() if s is not behind and s is not across]
    at = float(sofa.middle[0 if across.axis == "x" else 1])
    for side in (across, *others):
        middle = at if side is across else (side.start + side.end) / 2
        if (screen := _screen_at(f, side, middle)) is not None:
            return screen
    return None


def _screen_at(f: Furnisher, side: Side, at: float) -> Item | None:
    space, stock = f.space, f.stock
    spots = [at + d for d in (0.0, -0.4, 0.4, -0.8, 0.8, -1.2, 1.2)]
    for kinds, tall in (
        (("tv stand", "tv cabinet", "entertainment center"), 2.1),
        (("sideboard", "chest of drawers"), 0.95),
    ):
        thing = stock.get(*kinds, height=tall, width=max(0.5, side.end - side.start - 0.1))
        if thing is None:
            continue
        stand = next((i for s in spots if (i := space.against_wall(thing, [side], at=s)) is not None), None)
        if stand is None:
            continue
        wide = max(0.4, 2 * stand.half_width - 0.04)
        for _ in range(3):
            screen = stock.get("television", height=min(1.0, space.ceiling - stand.high[1] - 0.2), width=wide)
            if screen is not None and (item := space.on_top(screen, stand, spread=0.0, tries=24)) is not None:
                f.tops(stand, TV_BOARD, 3)
                return item
        if stand.high[1] < 0.9 and (item := _flat_screen(f, side, float(stand.high[1]) + 0.12, spots)) is not None:
            f.tops(stand, TV_BOARD, 4)
            return item
        if stand.thing.kind == "entertainment center":
            return stand
        space.remove([stand])
    return _flat_screen(f, side, 1.0, spots)


def _flat_screen(f: Furnisher, side: Side, base: float, spots: list[float]) -> Item | None:
    flat = f.stock.get("wall television", height=1.0) or f.stock.get("television", made=True, depth=0.15)
    return f.space.hang(flat, base, side, spots) if flat is not None else None


def dining_group(f: Furnisher, most: int, wide: float = 9.0) -> Item | None:
    """A table, chairs of one model tucked under it, something on it, perhaps a lamp above."""
    space, stock, rng = f.space, f.stock, f.rng
    chair = stock.get("chair", width=0.62, depth=0.7) or stock.get("folding chair", "stool")
    table = None
    for attempt in range(7):
        width = wide if attempt < 3 else 1.3 if attempt < 5 else 0.95
        thing = stock.get("dining table", "round table", height=0.95, width=width, depth=1.3)
        thing = thing or stock.get("folding table", width=width)
        before = list(space.items)
        table = near_middle(f, thing) if thing is not None else None
        # A table at which hardly anyone can sit is no use.
        if table is not None and chair is not None and len(space.around(chair, table, most, tuck=0.22)) >= 2:
            break
        space.items = before
        table = None
    if table is None:
        return None
    f.tops(table, TABLE_MIDDLE, 1)
    setting = stock.get("place setting", "plate")
    for _ in range(int(rng.integers(0, 4))):
        if setting is not None:
            space.on_top(setting, table)
    f.tops(table, ON_TABLE, 3)
    lamp = stock.get("pendant lamp", height=1.1, width=1.0) if f.chance(0.85) else None
    if lamp is not None and lamp.model.size[1] < space.ceiling - 1.55:
        f.under_ceiling(lamp, table.middle)
    return table


def near_middle(f: Furnisher, thing: Thing, margin: float = 0.55) -> Item | None:
    """A thing with free floor of ``margin`` m around it, as near to the middle of the room as may be."""
    r, rng = f.space.rect, f.rng
    for k in range(18):
        s = 0.08 + 0.4 * k / 18
        x = (r.x0 + r.x1) / 2 + float(rng.uniform(-s, s)) * r.width
        z = (r.z0 + r.z1) / 2 + float(rng.uniform(-s, s)) * r.depth
        item = Item(thing, np.array([x, 0.0, z]), float(rng.integers(2)) * np.pi / 2, f.space.room)
        # Room for chairs, or the table is of no use.
        fp = item.footprint
        if min(fp.x0 - r.x0, r.x1 - fp.x1, fp.z0 - r.z0, r.z1 - fp.z1) < margin:
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


def bedside(f: Furnisher, bed: Item, most: int = 2) -> None:
    """Nightstands and lamps of one model on both sides of a bed."""
    stand = f.stock.get("nightstand", height=0.85, width=0.7) or f.stock.get("stool", "side table", height=0.6)
    lamp = f.stock.get("table lamp", height=0.65, width=0.4)
    for sign in (1, -1)[:most]:
        item = f.beside(stand, bed, sign, gap=0.04) if stand is not None else None
        if item is not None:
            if lamp is not None:
                f.space.on_top(lamp, item, back=True)
            f.tops(item, BEDSIDE, 2)


def desk_things(f: Furnisher, desk: Item, most: int = 5) -> None:
    """Chair before it, computer on it, lamp and small things."""
    space, stock = f.space, f.stock
    chair = stock.get("office chair", width=0.8, depth=0.8) or stock.get("chair", width=0.65)
    for reach in (-0.25, -0.12, 0.03):
        if chair is None:
            break
        x, z = desk.middle + desk.front * (desk.half_depth + reach + chair.model.size[2] / 2)
        item = Item(chair, np.array([x, 0.0, z]), desk.angle + np.pi, space.room)
        if space.put(item, under=desk) is not None:
            break
    for kinds in (("computer", "laptop", "monitor"), ("laptop",)):
        thing = stock.get(*kinds, height=0.75)
        if thing is not None and large_enough(thing) and space.on_top(thing, desk, spread=0.05, tries=24) is not None:
            if thing.kind == "monitor":
                f.tops(desk, ("keyboard",), 1)
            break
    f.tops(desk, ("desk lamp",), 1, back=True) or f.tops(desk, ("table lamp",), 1, back=True)
    f.tops(desk, DESK, most)
