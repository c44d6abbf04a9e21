"""How people furnish: one rule set per kind of room, from the large things to the small ones.

A rule asks the stock for a thing and the room for a place; either may answer None, and the home goes without.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.kitchen import furnish_kitchen
from openmap_scenes.homes.placement import Item, RoomSpace, Thing
from openmap_scenes.homes.plan import CEILING, Side
from openmap_scenes.homes.stock import Stock, own

SOFAS = ("sofa", "corner sofa", "loveseat", "futon")
PLANTS = ("potted plant", "ficus", "yucca", "peace lily", "spider plant")
SMALL_PLANTS = ("potted plant", "bonsai", "cactus", "orchid", "succulent", "flowers", "tulips", "lilies", "bamboo plant")
COFFEE_TABLE = (
    "book", "remote control", "newspaper", "bowl of fruit", "mug", "vase", "candle", "chessboard", "game controller",
    "tablet", "cup", "ashtray", "teapot", "coffee cup", "bowl of apples", "sunglasses", "camera", "keys",
)  # fmt: skip
SIDEBOARD = (
    "vase", "radio", "candle", "photo frame", "speaker dock", "stereo", "aquarium", "cat statue", "deer figurine", "bowl",
    "cordless phone", "camera", "fan", "jar", "helmet", "toy car",
)  # fmt: skip
DESK = (
    "pen holder", "phone", "mug", "letter tray", "printer", "headphones", "calendar", "tablet", "book", "camera",
    "coffee cup", "cactus", "rubik's cube", "eyeglasses", "fan",
)  # fmt: skip
DRESSER = ("vase", "hat", "handbag", "photo frame", "folded clothes", "candle", "cap", "brush", "sunglasses", "briefcase")
TOYS = (
    "teddy bear", "toy car", "toy train", "toy plane", "toy", "doll", "soccer ball", "basketball", "puzzle", "xylophone",
    "rubik's cube", "rocking horse", "dollhouse", "tricycle", "skateboard",
)  # fmt: skip


@dataclass(frozen=True)
class Furnisher:
    """A room, the stock, and the random choices: what every rule needs."""

    space: RoomSpace
    stock: Stock
    rng: np.random.Generator

    def wall(self, *kinds: str, corner: bool = False, **limits: float) -> Item | None:
        """One of the kinds with its back to some wall."""
        for _ in range(2):
            thing = self.stock.get(*kinds, **limits)
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
            if base + thing.model.size[1] < CEILING - 0.2:
                self.space.hang(thing, base, side, [along, along + 0.3, along - 0.3])
        for side in sides[:count]:
            spots = self.rng.uniform(side.start + 0.3, side.end - 0.3, 4).tolist()
            self.space.hang(own("picture", primitives.picture(self.rng)), float(self.rng.uniform(1.3, 1.5)), side, spots)

    def ceiling(self) -> None:
        """A lamp under the middle of the ceiling."""
        thing = self.stock.get("ceiling lamp", "ceiling fan", width=1.2) if self.rng.random() < 0.4 else None
        thing = thing or own("ceiling lamp", primitives.ceiling_lamp(self.rng))
        r = self.space.rect
        y = CEILING - float(thing.model.size[1]) - 0.001
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
        thing = self.stock.get("rug", "round rug", width=width + 0.6, depth=depth + 0.8) if self.rng.random() < 0.3 else None
        thing = thing or own("rug", primitives.rug(self.rng, width, depth))
        return self.space.put(Item(thing, np.array([x, 0.0, z]), angle, self.space.room), rest=True)


def wall_behind(space: RoomSpace, item: Item) -> Side:
    """The wall nearest to an item's back."""
    back = (item.low + item.high)[[0, 2]] / 2 - item.front * 10.0
    return min(
        (s for s in space.sides if (abs(item.front[1]) > 0.7) == (s.axis == "x")),
        key=lambda s: abs(float(back[1 if s.axis == "x" else 0]) - s.at),
    )


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
        sofa = thing and space.against_wall(thing)
        if sofa is not None:
            break
    if sofa is not None:
        _sofa_group(f, sofa)
    if rng.random() < 0.7:
        f.wall("bookcase", "shelves", "cupboard", "cabinet")
    board = f.wall("sideboard", "chest of drawers", "dresser", "shelves", "aquarium")
    f.tops(board, (*SIDEBOARD, *SMALL_PLANTS), 3)
    if space.rect.width * space.rect.depth > 22 or "dining room" not in space.plan.names:
        _dining_group(f, most=4)
    f.wall("fireplace", "piano", "trunk", "recliner", "bench")
    f.wall("armchair", "bean bag", corner=True)
    for _ in range(2):
        f.wall(*PLANTS, corner=True, width=1.1)
    f.wall("floor lamp", "speaker", "electric guitar", "room divider", corner=True)
    f.radiator()
    f.pictures(2, over=sofa)


def _sofa_group(f: Furnisher, sofa: Item) -> None:
    """Rug, coffee table, television across, armchairs at the sides."""
    space, stock, rng = f.space, f.stock, f.rng
    middle = (sofa.low + sofa.high)[[0, 2]] / 2
    opposite = next(s for s in space.sides if s.axis == wall_behind(space, sofa).axis and s is not wall_behind(space, sofa))
    at = float(middle[0 if opposite.axis == "x" else 1])
    stand = None
    for kinds in (("tv stand", "tv cabinet", "entertainment center"), ("sideboard", "chest of drawers", "dresser", "shelves", "trunk")):
        thing = stock.get(*kinds, height=2.1 if "tv stand" in kinds else 1.05)
        if thing is not None and (stand := space.against_wall(thing, [opposite], at=at)) is not None:
            break
    screen = stock.get("television", height=0.8)
    if stand is not None and screen is not None and stand.thing.kind != "entertainment center":
        space.on_top(screen, stand, spread=0.0, tries=30)
    elif (flat := stock.get("wall television")) is not None:
        space.hang(flat, 1.0, opposite, [at, at - 0.4, at + 0.4, at - 0.8, at + 0.8])
    f.tops(stand, ("dvd player", "game console", "game controller", "speaker dock", "amplifier", "vase", "projector"), 2)
    reach = float(np.abs(sofa.front) @ (sofa.high - sofa.low)[[0, 2]]) / 2
    x, z = middle + sofa.front * (reach + 0.75)
    f.rug(2.1, 1.4, x, z, sofa.angle)
    thing = stock.get("coffee table") or stock.get("trunk", "bench")
    table = thing and space.facing(thing, sofa, float(rng.uniform(0.36, 0.45)))
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


def _dining_group(f: Furnisher, most: int) -> Item | None:
    """A table, chairs of one kind around it, something on it, perhaps a lamp above."""
    space, stock, rng = f.space, f.stock, f.rng
    chair = stock.get("chair", width=0.62, depth=0.7) or stock.get("folding chair", "stool")
    table = None
    for attempt in range(6):
        thing = stock.get("dining table", "round table", height=0.95, width=9.0 if attempt < 3 else 1.3)
        thing = thing or stock.get("folding table")
        before = len(space.items)
        table = thing and _near_middle(f, thing)
        # A table at which hardly anyone can sit is no use.
        if table is not None and chair is not None and len(space.around(chair, table, most)) >= 2:
            break
        del space.items[before:]
        table = None
    if table is None:
        return None
    f.tops(table, ("vase", "bowl of fruit", "flowers", "tulips", "lilies", "candle", "bowl of apples", "birthday cake"), 1)
    setting = stock.get("place setting", "plate")
    for _ in range(int(rng.integers(0, 3))):
        if setting is not None:
            space.on_top(setting, table)
    f.tops(table, ("wine bottle", "glass", "teapot", "bowl of salad", "roast chicken", "cup", "jar", "beer glass"), 2)
    lamp = stock.get("pendant lamp")
    if lamp is not None and rng.random() < 0.8:
        middle = (table.low + table.high) / 2
        space.put(Item(lamp, np.array([middle[0], CEILING - lamp.model.size[1] - 0.001, middle[2]]), 0.0, space.room))
    return table


def _near_middle(f: Furnisher, thing: Thing) -> Item | None:
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


def _dining(f: Furnisher) -> None:
    board = f.wall("sideboard", "chest of drawers", "dresser", "cupboard", height=1.3)
    _dining_group(f, most=6)
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
        bed = thing and _bed_with_room(f, thing)
        if bed is not None:
            break
    if bed is not None:
        _bedside(f, bed)
        middle = (bed.low + bed.high)[[0, 2]] / 2 + bed.front * 0.55
        f.rug(float(rng.uniform(2.0, 2.6)), 1.6, *middle.tolist(), bed.angle)
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


def _bed_with_room(f: Furnisher, thing: Thing) -> Item | None:
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


def _bedside(f: Furnisher, bed: Item) -> None:
    stand = f.stock.get("nightstand") or f.stock.get("stool", "piano bench", height=0.6)
    lamp = f.stock.get("table lamp", height=0.75)
    for sign in (1, -1):
        item = stand and f.beside(stand, bed, sign)
        if item is not None:
            if lamp is not None:
                f.space.on_top(lamp, item, back=True)
            f.tops(item, ("alarm clock", "book", "mug", "glass", "tablet", "eyeglasses", "cordless phone"), 1)


def _children(f: Furnisher) -> None:
    space, stock, rng = f.space, f.stock, f.rng
    thing = stock.get("child bed", "bunk bed", "crib", "captain's bed", "day bed") or stock.get("bed", width=1.6)
    bed = thing and space.against_wall(thing, corner=True)
    if bed is not None:
        _bedside(f, bed)
        f.tops(bed, ("teddy bear", "doll"), 1)
    desk = f.wall("desk", width=1.5)
    if desk is not None:
        _desk_things(f, desk)
    shelf = f.wall("shelves", "bookcase", "cupboard", "chest of drawers", "dresser", width=1.5)
    f.tops(shelf, TOYS, 3)
    f.wall("wardrobe", corner=True)
    table = stock.get("child table")
    if table is not None and (item := _near_middle(f, table)) is not None:
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


def _desk_things(f: Furnisher, desk: Item) -> None:
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


def _office(f: Furnisher) -> None:
    desk = f.wall("desk")
    if desk is not None:
        _desk_things(f, desk)
    f.wall("bookcase", "shelves")
    f.wall("bookcase", "cabinet", "shelves", "sideboard", "cupboard")
    cabinet = f.wall("filing cabinet", "safe", "chest of drawers", "shelves", height=1.2)
    f.tops(cabinet, ("printer", "books", "fan", "radio", "stereo", "speaker dock"), 2)
    if cabinet is not None:
        f.space.on_top(own("books", primitives.books(f.rng)), cabinet)
    f.wall("armchair", "recliner", "loveseat", "chair", corner=True)
    f.wall("wastebasket", "recycling bin", corner=True)
    f.wall("whiteboard", "water cooler", "exercise bike", "electric guitar", "midi keyboard", "cardboard box", corner=True)
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
    if f.space.rect.width * f.space.rect.depth > 9 and "dining room" not in f.space.plan.names:
        _dining_group(f, most=4)
    else:
        island = f.stock.get("kitchen island", "bar table", "round table")
        item = island and _near_middle(f, island)
        stool = f.stock.get("bar stool", "stool")
        if item is not None and stool is not None:
            f.space.around(stool, item, 2)
    f.wall("trash can", "recycling bin", "high chair", "wastebasket", corner=True)
    f.wall("washing machine", "chest freezer", "shelves", "cupboard", "water cooler")
    f.wall("broom", "stool", "step stool", "potted plant", corner=True, width=0.6)
    f.pictures(1)


RULES: dict[str, Callable[[Furnisher], None]] = {
    "living room": _living,
    "kitchen": _kitchen,
    "bedroom": _bedroom,
    "children's room": _children,
    "bathroom": _bathroom,
    "hall": _hall,
    "office": _office,
    "dining room": _dining,
}
