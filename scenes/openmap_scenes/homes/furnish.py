"""How people furnish: one rule set per kind of room, from the large things to the small ones.

A rule asks the stock for a thing and the room for a place; either may answer None, and the home goes without. What a room
cannot do without is in ``NEEDS``: a room that lacks some of it is furnished again.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.bathroom import furnish_bathroom, furnish_laundry
from openmap_scenes.homes.furnisher import Furnisher
from openmap_scenes.homes.groups import (
    SHELF_THINGS,
    bed_with_room,
    bedside,
    desk_things,
    dining_group,
    near_middle,
    sofa_group,
)
from openmap_scenes.homes.items import Item
from openmap_scenes.homes.kitchen import dress_run, furnish_kitchen, kitchen_run
from openmap_scenes.homes.placement import RoomSpace
from openmap_scenes.homes.plan import Plan
from openmap_scenes.homes.stock import Stock, own
from openmap_scenes.homes.wishes import (
    DRESSER,
    FILLERS,
    FLOOR_FINDS,
    NEEDS,
    PLANTS,
    SEATS,
    SIDEBOARD,
    SMALL_PLANTS,
    SOFAS,
    TOYS,
)

TRIES = 4


def furnish_room(plan: Plan, room: int, stock: Stock, rng: np.random.Generator, complete: bool = False) -> RoomSpace:
    """Furnish one room by the rules of its kind; the first draw with all that it needs, or else the one that lacks least.

    Where only a ``complete`` one will do, kitchens that lack their sink or stove are left as they are.
    """
    best: tuple[tuple[int, int], RoomSpace] | None = None
    for _ in range(TRIES):
        space = RoomSpace(plan, room, rng)
        f = Furnisher(space, stock, rng, complete)
        RULES[space.kind](f)
        f.ceiling()
        lacks = missing(space, stock)
        score = (len(lacks), -len(space.items))
        if best is None or score < best[0]:
            best = score, space
        if not lacks:
            break
    assert best is not None
    return best[1]


def missing(space: RoomSpace, stock: Stock) -> list[tuple[str, ...]]:
    """What a room needs, could be had, and is not there: a row of ``NEEDS`` for each."""
    there = {item.thing.kind for item in space.items}
    return [row for row in NEEDS[space.kind] if not there & set(row) and any(stock.has(k) for k in row)]


def _living(f: Furnisher) -> None:
    space, rng = f.space, f.rng
    f.radiator()
    f.curtains()
    sofa = _sofa(f, min(space.rect.width, space.rect.depth) - 0.5)
    if sofa is not None:
        sofa_group(f, sofa)
    if "dining room" not in space.plan.kinds and space.area > 18:
        dining_group(f, most=6 if space.area > 26 else 4, wide=1.9)
    _bookcase(f)
    board = f.wall("sideboard", "chest of drawers", "cabinet", "console table", height=1.3)
    f.tops(board, (*SIDEBOARD, *SMALL_PLANTS), 4)
    f.wall("fireplace", "piano", "recliner", "bench", "grand piano", "trunk", width=1.8)
    if space.area > 24:
        _bookcase(f)
        f.wall("armchair", "bean bag", "rocking chair", "ottoman", corner=True)
    for _ in range(int(rng.integers(1, 4))):
        f.wall(*PLANTS, corner=True, width=1.1)
    f.wall("floor lamp", "speaker", "electric guitar", "guitar", "room divider", "basket", corner=True)
    f.wall("basket", "ottoman", "speaker", "magazine rack", "cat tree", corner=True, width=0.6)
    for item in f.fill(0.36, *FILLERS, *FILLERS[:3]):
        _dress(f, item)
    f.pictures(3, over=sofa)
    _wall_shelf(f)
    f.clock()


def _dress(f: Furnisher, item: Item) -> None:
    """Small things in and on what stands along a wall."""
    if item.thing.kind in ("bookcase", "shelves", "cabinet"):
        f.shelved(item, SHELF_THINGS, 5)
    if item.high[1] < 1.4 and item.thing.kind not in (*SEATS, *PLANTS):
        f.tops(item, (*SIDEBOARD, *SMALL_PLANTS), 3)


def _sofa(f: Furnisher, wide: float) -> Item | None:
    for k in range(5):
        thing = f.stock.get(*SOFAS, width=max(1.4, wide - 0.2 * k))
        sofa = f.space.against_wall(thing) if thing is not None else None
        if sofa is not None:
            return sofa
    return None


def _bookcase(f: Furnisher) -> Item | None:
    shelf = f.wall("bookcase", "shelves", "bookshelf", width=1.6)
    f.shelved(shelf, SHELF_THINGS, 7)
    if shelf is not None and shelf.high[1] < 1.5:
        f.tops(shelf, (*SIDEBOARD, *SMALL_PLANTS), 3)
    return shelf


def _wall_shelf(f: Furnisher) -> None:
    item = f.hung(f.stock.get("wall shelf", width=1.4, depth=0.4, height=0.9), 1.3)
    f.tops(item, ("book", "vase", "candle", "photo frame", "succulent", "figurine", "jar", "cactus", "potted plant"), 3)


def _dining(f: Furnisher) -> None:
    f.radiator()
    f.curtains()
    dining_group(f, most=8 if f.space.area > 14 else 6)
    for most in (4, 3):
        board = f.wall(
            "sideboard", "chest of drawers", "cupboard", "cabinet", "glass cabinet", "console table", height=2.1
        )
        if board is not None and board.high[1] < 1.4:
            f.tops(board, (*SIDEBOARD, "bowl", "teapot", "jug"), most)
    f.wall("bookcase", "piano", "fireplace", "cabinet", "grand piano", width=1.8)
    f.wall("bench", "armchair", "bar table", corner=True)
    for _ in range(2):
        f.wall(*PLANTS, corner=True, width=1.0)
    for item in f.fill(0.4, *FILLERS):
        _dress(f, item)
    f.pictures(3)
    _wall_shelf(f)
    f.clock()


def _bedroom(f: Furnisher) -> None:
    stock, rng = f.stock, f.rng
    f.radiator()
    f.curtains()
    bed = None
    for _ in range(4):
        thing = stock.get("bed", "day bed", width=2.0) or stock.get("captain's bed", "sofa bed", "bed")
        bed = bed_with_room(f, thing) if thing is not None else None
        if bed is not None:
            break
    if bed is not None:
        bedside(f, bed)
        x, z = bed.middle + bed.front * 0.5
        f.rug(float(rng.uniform(2.2, 2.9)), 1.7, float(x), float(z), bed.angle)
        f.cushions(bed, int(rng.integers(1, 3)))
        f.tops(bed, ("blanket", "folded clothes", "book", "laptop", "teddy bear", "tablet"), 1)
    _ = f.wall("wardrobe", corner=True, tries=3) or f.wall("cupboard", "clothes rack", "wardrobe", width=1.3, tries=3)
    chest = f.wall("chest of drawers", "dresser", "dressing table", height=1.5)
    f.tops(chest, (*DRESSER, *SMALL_PLANTS), 4)
    if chest is not None and chest.high[1] < 1.2:
        side, at = f.along(chest)
        f.mirror(0.7, max(1.15, float(chest.high[1]) + 0.2), side, [at])
    if f.chance(0.5):
        desk = f.wall("desk", width=1.4)
        if desk is not None:
            desk_things(f, desk, most=2)
    elif f.chance(0.5):
        f.shelved(f.wall("shelves", "bookcase", width=1.0), SHELF_THINGS, 5)
    f.wall("armchair", "chair", "bean bag", "stool", "bench", "ottoman", corner=True, width=1.0)
    f.wall(*PLANTS, corner=True, width=0.9)
    for _ in range(2):
        f.wall(*FLOOR_FINDS, corner=True, width=0.8)
    f.wall("floor lamp", "standing mirror", "clothes rack", "trunk", corner=True, width=0.9)
    for item in f.fill(0.4, ("chest of drawers", "bookcase", "shelves"), ("bench", "armchair", "ottoman"), PLANTS):
        _dress(f, item)
    f.pictures(2, over=bed)


def _children(f: Furnisher) -> None:
    space, stock = f.space, f.stock
    f.radiator()
    f.curtains()
    bed = None
    for _ in range(4):
        thing = stock.get("child bed", "bunk bed", "crib", "captain's bed", "day bed") or stock.get("bed", width=1.6)
        bed = space.against_wall(thing, corner=True) if thing is not None else None
        if bed is not None:
            break
    if bed is not None:
        bedside(f, bed, most=1)
        f.cushions(bed, 1)
        f.tops(bed, ("teddy bear", "doll", "blanket", "book"), 1)
    desk = f.wall("desk", width=1.4)
    if desk is not None:
        desk_things(f, desk, most=3)
    f.wall("wardrobe", corner=True, width=1.6) or f.wall("chest of drawers", "dresser", width=1.2)
    for _ in range(2):
        shelf = f.wall("shelves", "bookcase", "chest of drawers", width=1.3, height=1.9)
        f.shelved(shelf, (*TOYS, "book", "box", "basket"), 5)
        if shelf is not None and shelf.high[1] < 1.5:
            f.tops(shelf, (*TOYS, "globe", "table lamp"), 3)
    r = space.rect
    f.rug(1.9, 1.5, (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, 0.0)
    table = stock.get("child table")
    if table is not None and (item := near_middle(f, table, margin=0.3)) is not None:
        chair = stock.get("child chair", "stool", height=0.7, width=0.5)
        if chair is not None:
            space.around(chair, item, 2, tuck=0.1)
        f.tops(item, TOYS, 2)
    for _ in range(5):
        toy = stock.get(*TOYS, height=1.1, fresh=True)
        if toy is not None:
            space.anywhere(toy, quarter=False)
    f.wall("bean bag", "child chair", "changing table", "cradle", "toy box", "basket", "potty", corner=True, width=1.0)
    f.wall("basket", "backpack", "cardboard box", "skateboard", "toy box", corner=True, width=0.6)
    f.pictures(3, over=bed)
    _wall_shelf(f)


def _office(f: Furnisher) -> None:
    f.radiator()
    f.curtains(0.6)
    desk = None
    for wide in (1.8, 1.6, 1.3):
        desk = desk or f.wall("desk", width=wide)
    if desk is not None:
        desk_things(f, desk, most=6)
    _bookcase(f)
    _bookcase(f)
    cabinet = f.wall("filing cabinet", "safe", "chest of drawers", "sideboard", height=1.2)
    f.tops(cabinet, ("printer", "fan", "radio", "stereo", "speaker dock", "globe", "box", *SMALL_PLANTS), 3)
    f.books(cabinet)
    f.wall("armchair", "recliner", "loveseat", "chair", corner=True)
    f.wall("wastebasket", "recycling bin", corner=True)
    f.wall(
        "water cooler", "exercise bike", "electric guitar", "midi keyboard", "cardboard box", "floor lamp", corner=True
    )
    f.wall("exercise bike", "treadmill", "punching bag", "cardboard box", "suitcase", corner=True)
    r = f.space.rect
    f.rug(2.0, 1.4, (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, float(f.rng.integers(2)) * np.pi / 2)
    for _ in range(2):
        f.wall(*PLANTS, corner=True, width=0.9)
    for item in f.fill(0.42, *FILLERS):
        _dress(f, item)
    f.hung(f.stock.get("whiteboard", "notice board", "wall calendar", height=1.2, depth=0.2), 1.1)
    f.pictures(2, over=desk)
    f.clock()


def _hall(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    deep = float(np.clip(min(space.rect.width, space.rect.depth) - 0.85, 0.2, 0.5))
    table = f.wall(
        "shoe cabinet", "console table", "chest of drawers", "sideboard", depth=deep, width=1.5, height=1.3, tries=4
    )
    f.tops(
        table, ("vase", "phone", "cordless phone", "hat", "handbag", "table lamp", "bowl", "basket", *SMALL_PLANTS), 3
    )
    if table is not None and table.high[1] < 1.2:
        side, at = f.along(table)
        f.mirror(0.8, max(1.1, float(table.high[1]) + 0.25), side, [at, at + 0.2, at - 0.2])
    f.hung(stock.get("coat hooks", height=1.2, depth=0.4), 1.55)
    f.wall("coat rack", "coat stand", "clothes rack", corner=True, width=0.7, depth=max(deep, 0.45))
    if deep > 0.42:
        f.wall("wardrobe", "cupboard", depth=0.65, width=1.4)
    f.wall("bench", "chair", "trunk", depth=deep)
    for _ in range(2 if max(space.rect.width, space.rect.depth) > 4 else 0):
        f.hung(stock.get("wall lamp", height=0.5), 1.6, clear=0.3)
    for _ in range(2):
        f.wall(
            "umbrella", "umbrella stand", "sneakers", "shoes", "backpack", "suitcase", "skateboard", "fire extinguisher",
            "shoe rack", "basket", "broom", corner=True, width=0.7, depth=max(deep, 0.35),
        )  # fmt: skip
    f.wall(*PLANTS, corner=True, width=0.6)
    r = space.rect
    mat = stock.get("doormat") or own("doormat", primitives.rug(rng, 0.7, 0.45))
    for o in space.doors:
        if o.kind == "front door":
            inward = 1 if (r.z0 if o.axis == "x" else r.x0) > o.at else -1
            off, mid = o.at + inward * 0.45, (o.start + o.end) / 2
            x, z = (mid, off) if o.axis == "x" else (off, mid)
            space.put(Item(mat, np.array([x, 0.0, z]), 0.0 if o.axis == "x" else np.pi / 2, space.room), rest=True)
    long = max(r.width, r.depth)
    f.rug(
        min(2.4, 0.6 * long), min(0.9, 0.6 * min(r.width, r.depth)), (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2,
        0.0 if r.width > r.depth else np.pi / 2,
    )  # fmt: skip
    f.pictures(4)
    f.clock()
    if long > 4.5:
        f.under_ceiling_row(2 if long < 7 else 3)


def _kitchen(f: Furnisher) -> None:
    furnish_kitchen(f)
    if f.complete and missing(f.space, f.stock):
        return
    apart = "dining room" in f.space.plan.kinds
    table = None
    if f.space.area > 8.5 and (not apart or f.chance(0.4)):
        table = dining_group(f, most=4, wide=1.5)
    if table is None:
        for wide in (1.4, 1.0):
            island = f.stock.get("kitchen island", "bar table", "round table", width=wide)
            table = near_middle(f, island, margin=0.6) if island is not None else None
            if table is not None:
                stool = f.stock.get("bar stool" if table.high[1] > 0.85 else "stool", "chair", width=0.55)
                if stool is not None:
                    f.space.around(stool, table, 2, tuck=0.2)
                f.tops(table, ("bowl of fruit", "cutting board", "vase", "bread", "mug", "wine bottle", "bowl"), 3)
                break
    f.wall("trash can", "recycling bin", "wastebasket", corner=True, width=0.6)
    if "laundry room" not in f.space.plan.kinds and f.chance(0.4):
        f.wall("washing machine", "chest freezer", width=0.9, corner=True)
    shelf = f.bare_shelf("cupboard", "glass cabinet", "sideboard", width=1.2)
    f.shelved(shelf, ("jar", "bowl", "pot", "plate", "basket", "teapot", "bottle", "box", "mug", "wine bottle"), 5)
    if shelf is not None and shelf.high[1] < 1.5:
        f.tops(shelf, ("radio", "basket", "jar", "fruit bowl", *SMALL_PLANTS), 2)
    f.wall("high chair", "water cooler", "broom", "step stool", "crate", corner=True, width=0.7)
    f.wall(*PLANTS, corner=True, width=0.6)
    f.radiator()
    f.pictures(1)
    f.clock()


def _studio(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    # The bed comes first: it is the hardest to place, and with windows all around its head may only stand between them.
    bed = None
    for width in (1.7, 1.7, 1.5, 1.5, 1.2, 1.0):
        thing = stock.get("bed", "day bed", width=width, depth=2.3)
        bed = space.against_wall(thing, corner=True) if thing is not None else None
        bed = bed or (space.against_wall(thing) if thing is not None else None)
        if bed is not None:
            break
    f.radiator()
    f.curtains()
    run = kitchen_run(f, longest=3.4)
    if f.complete and missing(space, stock):
        return
    dress_run(f, run)
    if bed is not None:
        bedside(f, bed)
        f.cushions(bed, 1)
    sofa = _sofa(f, 2.0)
    f.wall("wardrobe", corner=True, width=1.6) or f.wall("wardrobe", "clothes rack", width=1.2)
    if sofa is not None:
        sofa_group(f, sofa)
    else:
        f.wall("armchair", "loveseat", corner=True)
        f.tops(f.wall("tv stand", "sideboard", "chest of drawers", width=1.5, height=0.95), ("television",), 1)
    dining_group(f, most=3, wide=1.1)
    _bookcase(f)
    if f.chance(0.5):
        desk = f.wall("desk", width=1.3)
        if desk is not None:
            desk_things(f, desk, most=3)
    f.wall("trash can", "wastebasket", corner=True, width=0.5)
    for _ in range(int(rng.integers(1, 3))):
        f.wall(*PLANTS, corner=True, width=0.8)
    f.wall(*FLOOR_FINDS, corner=True, width=0.7)
    for item in f.fill(0.34, *FILLERS):
        _dress(f, item)
    f.pictures(3, over=sofa or bed)
    f.clock()


RULES: dict[str, Callable[[Furnisher], None]] = {
    "living room": _living,
    "studio": _studio,
    "kitchen": _kitchen,
    "bedroom": _bedroom,
    "children's room": _children,
    "bathroom": furnish_bathroom,
    "hall": _hall,
    "office": _office,
    "dining room": _dining,
    "laundry room": furnish_laundry,
}
