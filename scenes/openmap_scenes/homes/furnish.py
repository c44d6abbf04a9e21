"""How people furnish: one rule set per kind of room, from the large things to the small ones.

A rule asks the stock for a thing and the room for a place; either may answer None, and the home goes without.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.furnisher import Furnisher, wall_behind
from openmap_scenes.homes.groups import bed_with_room, bedside, desk_things, dining_group, near_middle, sofa_group
from openmap_scenes.homes.kitchen import furnish_kitchen
from openmap_scenes.homes.placement import Item, RoomSpace
from openmap_scenes.homes.stock import Stock, own

SOFAS = ("sofa", "corner sofa", "loveseat", "futon")

PLANTS = ("potted plant", "ficus", "yucca", "peace lily", "spider plant")

SMALL_PLANTS = (
    "potted plant",
    "bonsai",
    "cactus",
    "orchid",
    "succulent",
    "flowers",
    "tulips",
    "lilies",
    "bamboo plant",
)

SIDEBOARD = (
    "vase", "radio", "candle", "photo frame", "speaker dock", "stereo", "aquarium", "cat statue", "deer figurine", "bowl",
    "cordless phone", "camera", "fan", "jar", "helmet", "toy car",
)  # fmt: skip

DRESSER = (
    "vase",
    "hat",
    "handbag",
    "photo frame",
    "folded clothes",
    "candle",
    "cap",
    "brush",
    "sunglasses",
    "briefcase",
)

TOYS = (
    "teddy bear", "toy car", "toy train", "toy plane", "toy", "doll", "soccer ball", "basketball", "puzzle", "xylophone",
    "rubik's cube", "rocking horse", "dollhouse", "tricycle", "skateboard",
)  # fmt: skip


def furnish_room(space: RoomSpace, stock: Stock) -> list[Item]:
    """Furnish one room by the rules of its kind and return what stands in it."""
    f = Furnisher(space, stock, space.rng)
    RULES[space.name](f)
    f.ceiling()
    return space.items


def _living(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    sofa = None
    for _ in range(4):
        thing = stock.get(*SOFAS, width=min(space.rect.width, space.rect.depth) - 0.6)
        sofa = space.against_wall(thing) if thing is not None else None
        if sofa is not None:
            break
    if sofa is not None:
        sofa_group(f, sofa)
    if rng.random() < 0.7:
        f.wall("bookcase", "shelves", "cupboard", "cabinet")
    board = f.wall("sideboard", "chest of drawers", "dresser", "shelves", "aquarium")
    f.tops(board, (*SIDEBOARD, *SMALL_PLANTS), 3)
    if space.rect.width * space.rect.depth > 22 or "dining room" not in space.plan.kinds:
        dining_group(f, most=4)
    f.wall("fireplace", "piano", "trunk", "recliner", "bench")
    f.wall("armchair", "bean bag", corner=True)
    for _ in range(2):
        f.wall(*PLANTS, corner=True, width=1.1)
    f.wall("floor lamp", "speaker", "electric guitar", "room divider", corner=True)
    f.radiator()
    f.pictures(2, over=sofa)


def _dining(f: Furnisher) -> None:
    board = f.wall("sideboard", "chest of drawers", "dresser", "cupboard", height=1.3)
    dining_group(f, most=6)
    f.tops(board, (*SIDEBOARD, "bowl", "teapot"), 3)
    f.wall("bookcase", "piano", "fireplace", "cabinet", "grand piano")
    f.wall("bench", "armchair", "chair", corner=True)
    for _ in range(2):
        f.wall(*PLANTS, corner=True, width=1.0)
    f.radiator()
    f.pictures(3, over=board)


def _bedroom(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    bed = None
    for _ in range(4):
        thing = stock.get("bed") or stock.get("day bed", "captain's bed", "sofa bed")
        bed = bed_with_room(f, thing) if thing is not None else None
        if bed is not None:
            break
    if bed is not None:
        bedside(f, bed)
        middle = (bed.low + bed.high)[[0, 2]] / 2 + bed.front * 0.55
        f.rug(float(rng.uniform(2.0, 2.6)), 1.6, float(middle[0]), float(middle[1]), bed.angle)
        space.on_top(own("cushion", primitives.cushion(rng), material="fabric"), bed, level=0.06)
    f.wall("wardrobe", corner=True) or f.wall("cupboard", "clothes rack", "wardrobe")
    chest = f.wall("dresser", "chest of drawers", "dressing table", "shelves", "trunk", height=1.5)
    f.tops(chest, DRESSER, 3)
    if rng.random() < 0.7:
        f.wall("armchair", "chair", "bean bag", "stool", corner=True)
    if rng.random() < 0.5:
        desk = f.wall("desk", width=1.5)
        f.tops(desk, ("laptop", "desk lamp", "book", "table lamp"), 2)
    f.wall(*PLANTS, corner=True, width=0.9)
    f.wall("suitcase", "laundry basket", "slippers", "sneakers", "shoes", "safe", "backpack", "fan", corner=True)
    f.radiator()
    f.pictures(2, over=bed)


def _children(f: Furnisher) -> None:
    space, stock = f.space, f.stock
    thing = stock.get("child bed", "bunk bed", "crib", "captain's bed", "day bed") or stock.get("bed", width=1.6)
    bed = space.against_wall(thing, corner=True) if thing is not None else None
    if bed is not None:
        bedside(f, bed)
        f.tops(bed, ("teddy bear", "doll"), 1)
    desk = f.wall("desk", width=1.5)
    if desk is not None:
        desk_things(f, desk)
    shelf = f.wall("shelves", "bookcase", "cupboard", "chest of drawers", "dresser", width=1.5)
    f.tops(shelf, TOYS, 3)
    f.wall("wardrobe", corner=True)
    table = stock.get("child table")
    if table is not None and (item := near_middle(f, table)) is not None:
        chair = stock.get("child chair")
        if chair is not None:
            space.around(chair, item, 2)
        f.tops(item, TOYS, 2)
    r = space.rect
    f.rug(1.8, 1.3, (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, 0.0)
    for _ in range(4):
        toy = stock.get(*TOYS, height=0.9, fresh=True)
        if toy is not None:
            space.anywhere(toy, quarter=False)
    f.wall("child chair", "bean bag", "stool", "changing table", "cradle", corner=True)
    f.radiator()
    f.pictures(2, over=bed)


def _office(f: Furnisher) -> None:
    desk = f.wall("desk")
    if desk is not None:
        desk_things(f, desk)
    f.wall("bookcase", "shelves")
    f.wall("bookcase", "cabinet", "shelves", "sideboard", "cupboard")
    cabinet = f.wall("filing cabinet", "safe", "chest of drawers", "shelves", height=1.2)
    f.tops(cabinet, ("printer", "books", "fan", "radio", "stereo", "speaker dock"), 2)
    if cabinet is not None:
        f.space.on_top(own("books", primitives.books(f.rng)), cabinet)
    f.wall("armchair", "recliner", "loveseat", "chair", corner=True)
    f.wall("wastebasket", "recycling bin", corner=True)
    f.wall(
        "whiteboard", "water cooler", "exercise bike", "electric guitar", "midi keyboard", "cardboard box", corner=True
    )
    r = f.space.rect
    f.rug(1.8, 1.2, (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, float(f.rng.integers(2)) * np.pi / 2)
    f.wall(*PLANTS, corner=True, width=0.9)
    f.radiator()
    f.pictures(2, over=desk)


def _bathroom(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    tub = f.wall("bathtub", "corner bathtub", "shower stall", corner=True)
    if tub is None or (tub.thing.kind != "shower stall" and rng.random() < 0.4):
        f.wall("shower stall", corner=True)
    basin = f.wall("washbasin", "vanity", "double vanity") or f.wall("washbasin")
    if basin is not None:
        side = wall_behind(space, basin)
        along = float(((basin.low + basin.high) / 2)[0 if side.axis == "x" else 2])
        if basin.high[1] < 1.25:
            mirror = own("mirror", primitives.mirror(rng, float(rng.uniform(0.45, 0.7))))
            space.hang(mirror, max(1.2, float(basin.high[1]) + 0.08), side, [along])
        f.tops(basin, ("soap dispenser", "bottle", "brush", "cup"), 2)
    toilet = f.wall("toilet")
    if toilet is not None:
        paper = stock.get("toilet paper")
        if paper is not None:
            side = wall_behind(space, toilet)
            along = float(((toilet.low + toilet.high) / 2)[0 if side.axis == "x" else 2])
            space.hang(paper, 0.6, side, [along + 0.42, along - 0.42])
    f.wall("bidet")
    machine = f.wall("washing machine", "dryer")
    f.tops(machine, ("folded clothes", "towel", "bottle", "soap dispenser"), 2)
    f.wall("laundry basket", "stool", "wastebasket", corner=True)
    f.wall("shelves", width=0.7)
    for kind in ("towel rack", "hanging towel", "towel radiator"):
        thing = stock.get(kind)
        if thing is not None:
            for side in (space.sides[i] for i in rng.permutation(4)):
                base = 1.0 if kind != "towel radiator" else 0.4
                if space.hang(thing, base, side, rng.uniform(side.start, side.end, 4).tolist()):
                    break
    mat = stock.get("bath mat") or own("bath mat", primitives.rug(rng, 0.75, 0.5))
    anchor = tub or basin
    if anchor is not None:
        extent = float(np.abs(anchor.front) @ (anchor.high - anchor.low)[[0, 2]]) / 2
        x, z = (anchor.low + anchor.high)[[0, 2]] / 2 + anchor.front * (extent + 0.35)
        space.put(Item(mat, np.array([x, 0.0, z]), anchor.angle, space.room), rest=True)
    f.wall("potted plant", corner=True, width=0.6)


def _hall(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    table = f.wall("chest of drawers", "sideboard", "dresser", "shelves", "cupboard", depth=0.55, width=1.7, height=1.6)
    f.tops(table, ("keys", "vase", "phone", "cordless phone", "hat", "handbag", "umbrella", *SMALL_PLANTS), 3)
    f.wall("wardrobe", "clothes rack", "cupboard", depth=0.7)
    f.wall("bench", "stool", "chair", "trunk", depth=0.6)
    f.wall("umbrella", "sneakers", "shoes", "backpack", "suitcase", "skateboard", "fire extinguisher", corner=True)
    f.wall(*PLANTS, corner=True, width=0.7)
    hooks = stock.get("coat hooks")
    for side in space.sides:
        if hooks is not None and space.hang(hooks, 1.6, side, rng.uniform(side.start, side.end, 3).tolist()):
            break
    r = space.rect
    along = r.width > r.depth
    mat = stock.get("doormat") or own("doormat", primitives.rug(rng, 0.7, 0.45))
    for o in space.doors:
        if o.kind == "front door":
            inward = 1 if (r.z0 if o.axis == "x" else r.x0) > o.at else -1
            off, mid = o.at + inward * 0.45, (o.start + o.end) / 2
            x, z = (mid, off) if o.axis == "x" else (off, mid)
            space.put(Item(mat, np.array([x, 0.0, z]), 0.0 if o.axis == "x" else np.pi / 2, space.room), rest=True)
    f.rug(1.6, 0.8, (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, 0.0 if along else np.pi / 2)
    f.pictures(3)


def _kitchen(f: Furnisher) -> None:
    furnish_kitchen(f.space, f.stock)
    if f.space.rect.width * f.space.rect.depth > 9 and "dining room" not in f.space.plan.kinds:
        dining_group(f, most=4)
    else:
        island = f.stock.get("kitchen island", "bar table", "round table")
        item = near_middle(f, island) if island is not None else None
        stool = f.stock.get("bar stool", "stool")
        if item is not None and stool is not None:
            f.space.around(stool, item, 2)
    f.wall("trash can", "recycling bin", "high chair", "wastebasket", corner=True)
    f.wall("washing machine", "chest freezer", "shelves", "cupboard", "water cooler")
    f.wall("broom", "stool", "step stool", "potted plant", corner=True, width=0.6)
    f.pictures(1)


def _studio(f: Furnisher) -> None:
    furnish_kitchen(f.space, f.stock)
    _bedroom(f)
    _living(f)


def _laundry(f: Furnisher) -> None:
    machine = f.wall("washing machine", "dryer")
    f.tops(machine, ("folded clothes", "towel", "bottle", "soap dispenser"), 2)
    f.wall("dryer", "shelves", "cupboard")
    f.wall("shelves", "cupboard", width=1.0)
    f.wall("laundry basket", "broom", "stool", corner=True)


RULES: dict[str, Callable[[Furnisher], None]] = {
    "living room": _living,
    "kitchen": _kitchen,
    "bedroom": _bedroom,
    "children's room": _children,
    "bathroom": _bathroom,
    "hall": _hall,
    "office": _office,
    "dining room": _dining,
    "studio": _studio,
    "laundry room": _laundry,
}
