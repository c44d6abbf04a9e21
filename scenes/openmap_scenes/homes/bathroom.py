"""Rooms with water: the bathroom and the laundry room."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes import primitives
from openmap_scenes.homes.furnisher import Furnisher, mounting
from openmap_scenes.homes.items import Item
from openmap_scenes.homes.stock import own

BASIN = ("soap dispenser", "bottle", "cup", "towel", "toothbrush holder", "candle", "succulent", "glass", "brush")
LINEN = ("folded clothes", "towel", "bottle", "box", "basket", "detergent", "soap dispenser", "blanket")


def furnish_bathroom(f: Furnisher) -> None:
    """Toilet, basin with a mirror above, tub or shower, towels, mat, and what lies about."""
    space = f.space
    tub = None
    kinds = ("bathtub", "corner bathtub") if f.chance(0.6) and space.area > 4.5 else ("shower stall", "shower")
    for tried in (kinds, ("shower stall", "shower", "bathtub", "corner bathtub")):
        tub = tub or f.wall(*tried, corner=True, height=2.3, tries=3)
    basin = f.wall("washbasin", "vanity", "double vanity", tries=4) or f.wall("washbasin", width=0.6, tries=3)
    toilet = f.wall("toilet", tries=4)
    if tub is not None and "bathtub" in tub.thing.kind and space.area > 7 and f.chance(0.4):
        f.wall("shower stall", "shower", corner=True, height=2.3)
    if basin is not None:
        side, along = f.along(basin)
        if basin.high[1] < 1.3:
            base = max(1.15, float(basin.high[1]) + 0.06)
            f.mirror(float(np.clip(2 * basin.half_width, 0.45, 1.1)), base, side, [along])
            f.hung(f.stock.get("wall lamp", height=0.4), 2.0, sides=[side])
        f.tops(basin, BASIN, 3)
    if toilet is not None:
        side, along = f.along(toilet)
        paper = f.stock.get("toilet paper")
        if paper is not None:
            space.hang(paper, mounting(paper, 0.65), side, [along + 0.42, along - 0.42])
        for brush in ("toilet brush",):
            thing = f.stock.get(brush)
            if thing is not None:
                _ = f.beside(thing, toilet, 1, gap=0.1) or f.beside(thing, toilet, -1, gap=0.1)
    _mat(f, tub or basin)
    _towels(f)
    if space.area > 6:
        f.wall("bidet")
    if "laundry room" not in space.plan.kinds:
        f.tops(f.wall("washing machine", corner=True, height=1.1), LINEN, 2)
    shelf = f.bare_shelf("bathroom cabinet", width=0.8)
    f.shelved(shelf, LINEN, 4)
    if shelf is not None and shelf.high[1] < 1.5:
        f.tops(shelf, LINEN, 2)
    f.wall("laundry basket", corner=True, width=0.7)
    f.wall("wastebasket", "stool", "trash can", corner=True, width=0.45)
    f.wall("potted plant", "snake plant", corner=True, width=0.5)
    f.radiator()
    if f.chance(0.4):
        f.pictures(1)


def _towels(f: Furnisher) -> None:
    hung = 0
    for kind, base in (("towel radiator", 0.4), ("towel rack", 1.1), ("hanging towel", 0.9), ("hanging towel", 0.9)):
        thing = f.stock.get(kind, height=1.6, depth=0.35)
        if thing is not None and hung < 3 and f.hung(thing, base, clear=0.05) is not None:
            hung += 1


def _mat(f: Furnisher, anchor: Item | None) -> None:
    if anchor is None:
        return
    mat = f.stock.get("bath mat", width=1.0, depth=0.7) or own("bath mat", primitives.rug(f.rng, 0.75, 0.5))
    reach = anchor.half_depth + 0.08 + float(mat.model.size[2]) / 2
    x, z = anchor.middle + anchor.front * reach
    f.space.put(Item(mat, np.array([x, 0.0, z]), anchor.angle, f.space.room), rest=True)


def furnish_laundry(f: Furnisher) -> None:
    """Washing machine and dryer side by side, a sink, shelves, ironing board, baskets, a rack with clothes."""
    stock = f.stock
    machine = f.wall("washing machine", corner=True, tries=4)
    dryer = stock.get("dryer", "washing machine")
    second = None
    if machine is not None and dryer is not None:
        second = f.beside(dryer, machine, 1, gap=0.02) or f.beside(dryer, machine, -1, gap=0.02)
    for support in (machine, second):
        f.tops(support, LINEN, 2)
    if machine is not None:
        side, along = f.along(machine)
        board = stock.get("wall shelf", "wall cabinet", width=1.2, depth=0.4)
        if board is not None:
            item = f.space.hang(board, 1.5, side, [along, along + 0.2, along - 0.2])
            f.tops(item, LINEN, 2)
    f.wall("washbasin", "utility sink", "kitchen sink", width=0.8)
    shelf = f.bare_shelf("cupboard", "cabinet", width=1.0)
    f.shelved(shelf, LINEN, 4)
    if shelf is not None and shelf.high[1] < 1.6:
        f.tops(shelf, LINEN, 2)
    f.wall("ironing board", "drying rack", "clothes rack", depth=0.7)
    for _ in range(2):
        f.tops(f.wall("laundry basket", "basket", corner=True, width=0.7), ("folded clothes", "towel"), 1)
    f.wall("broom", "vacuum cleaner", "bucket", "step stool", corner=True)
    f.wall("cardboard box", "trash can", "recycling bin", "crate", corner=True, width=0.6)
    f.radiator()
    f.clock()
