"""Tables: dining, round, coffee, side and console tables."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import (
    Size,
    bar,
    base,
    beam,
    carcass,
    draw_size,
    drawer_fronts,
    four_legs,
    frame_legs,
    made,
    pedestal,
    sled,
    top_board,
)
from openmap_scenes.homes.solids import cylinder, lathe, oval, prism, rounded_box, sweep, tube
from openmap_scenes.scene import Material

HANDLES = ("bar", "knob", "knob", "cup", "strip", "none")


def _board(rng: np.random.Generator) -> tuple[Material, str]:
    """What a table top is made of."""
    kind = finishes.choose(rng, "wood", "wood", "wood", "wood", "white", "glass", "stone")
    if kind == "glass":
        return finishes.glass(rng), "glass"
    if kind == "stone":
        return finishes.stone(rng, "marble")
    if kind == "white":
        return finishes.painted(finishes.shade(rng, finishes.PAINTS)), "wood"
    return finishes.wood(rng)


def _apron(x: float, z: float, top: float, tall: float, m: Material) -> list[Model]:
    """Rails under a table top that join its legs."""
    rails = [rounded_box((-x, top - tall, s * z - 0.01), (x, top, s * z + 0.01), m, grain="x") for s in (-1, 1)]
    return rails + [rounded_box((s * x - 0.01, top - tall, -z), (s * x + 0.01, top, z), m, grain="z") for s in (-1, 1)]


def _carried(rng: np.random.Generator, size: Size, shape: str, thick: float) -> tuple[list[Model], str]:
    """A table: a top of the given shape on legs, frames, trestles or a column; and its material."""
    w, d, h = size
    top, name = _board(rng)
    wood, _ = finishes.wood(rng)
    iron, _ = finishes.metal(rng)
    same = top if name in finishes.WOODS or name == "wood" else wood
    under = h - thick
    parts = [top_board(shape, w, d, under, h, top, min(0.012, thick * 0.3))]
    shrink = 0.68 if shape in ("round", "oval") else 1.0
    x, z = w / 2 * shrink - 0.05, d / 2 * shrink - 0.05
    if shape == "round":
        style = finishes.choose(rng, "pedestal", "splayed", "splayed", "straight", "turned", "hairpin")
    elif w < 0.55:
        style = finishes.choose(rng, "splayed", "straight", "hairpin", "sled")
    else:
        style = finishes.choose(rng, "straight", "straight", "splayed", "frame", "trestle", "cross", "hairpin", "panel")
    if style == "pedestal":
        parts += pedestal(rng, under, 0.3 * min(w, d) + 0.03, iron if rng.random() < 0.5 else same)
    elif style == "turned":
        r = 0.06
        profile = [
            (0.24 * w, 0.0),
            (0.24 * w, 0.02),
            (0.06, 0.06),
            (0.05, 0.14),
            (r, 0.3 * h),
            (0.04, 0.5 * h),
            (0.055, 0.7 * h),
            (0.04, under - 0.03),
            (0.1, under),
        ]
        parts.append(lathe(profile, same, {1}, 20))
    elif style == "straight":
        t = float(rng.uniform(0.02, 0.04)) if h > 0.6 else 0.022
        parts += four_legs(
            x + 0.05 - t - 0.01, z + 0.05 - t - 0.01, under, t, same, 0.0, float(rng.uniform(0.6, 1.0)), square=True
        )
        if h > 0.55 and w > 0.5:
            parts += _apron(x + 0.04 - t, z + 0.04 - t, under, 0.08, same)
    elif style == "splayed":
        parts += four_legs(x - 0.05, z - 0.05, under, 0.026 if h > 0.6 else 0.018, same, 0.05, 0.5)
        if w > 0.5:
            parts += _apron(x - 0.05, z - 0.05, under, 0.05, same)
    elif style == "frame":
        parts += frame_legs(x - 0.02, z + 0.02, under, 0.05 if h > 0.6 else 0.03, iron if rng.random() < 0.7 else same)
    elif style == "sled":
        parts += sled(x, z, under - 0.001, 0.011, iron)
        parts += [
            beam((-x, under - 0.012, s * z * 0.9), (x, under - 0.012, s * z * 0.9), 0.018, 0.018, iron) for s in (-1, 1)
        ]
    elif style == "trestle":
        for s in (-1, 1):
            a = s * (x - 0.12)
            parts += [beam((a, under, 0.04 * k), (a, 0.0, z * k), 0.05, 0.04, same) for k in (-1, 1)]
            parts.append(beam((a, under - 0.025, -z * 0.8), (a, under - 0.025, z * 0.8), 0.05, 0.05, same))
        parts.append(beam((-x + 0.12, 0.3 * h, 0), (x - 0.12, 0.3 * h, 0), 0.03, 0.05, same))
    elif style == "cross":
        for s in (-1, 1):
            a = s * (x - 0.08)
            parts += [
                beam((a + 0.001 * k, under, -z * k), (a - 0.001 * k, 0.0, z * k), 0.05, 0.04, iron) for k in (-1, 1)
            ]
        parts.append(beam((-x + 0.08, under / 2, 0), (x - 0.08, under / 2, 0), 0.03, 0.03, iron))
    elif style == "hairpin":
        for sx in (-1, 1):
            for sz in (-1, 1):
                a, b = sx * (x - 0.04), sz * (z - 0.04)
                foot = (a + sx * 0.03, 0.006, b + sz * 0.03)
                parts += [
                    tube([(a - sx * 0.06, under, b), foot], 0.006, iron, 6),
                    tube([(a, under, b - sz * 0.06), foot], 0.006, iron, 6),
                ]
    else:
        parts += [rounded_box((s * x - 0.02, 0.0, -z), (s * x + 0.02, under, z), same, grain="y") for s in (-1, 1)]
        parts.append(rounded_box((-x, under * 0.35, -0.012), (x, under * 0.7, 0.012), same, grain="x"))
    if h < 0.6 and w > 0.7 and shape != "round" and style == "straight":
        parts.append(rounded_box((-x, 0.12, -z), (x, 0.14, z), same, grain="x"))
    return parts, name if name != "wood" else "wood"


def _table(
    rng: np.random.Generator, size: Size | None, shapes: tuple[str, ...], thick: tuple[float, float]
) -> Made | None:
    if size is None:
        return None
    shape = finishes.choose(rng, *shapes)
    if shape in ("round", "square"):
        edge = min(size[0], size[1])
        size = (edge, edge, size[2])
    parts, name = _carried(rng, size, "rectangular" if shape == "square" else shape, float(rng.uniform(*thick)))
    word = {"rounded": "rectangular"}.get(shape, shape)
    return made(parts, size, {"material": name, "shape": word})


def dining_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A table to eat at, for four to eight."""
    size = draw_size(rng, limits, (1.1, 2.1), (0.75, 1.0), (0.72, 0.77))
    return _table(rng, size, ("rectangular", "rectangular", "rectangular", "rounded", "oval"), (0.022, 0.045))


def round_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A round table to eat at."""
    edge = min(limits.width, limits.depth)
    size = draw_size(rng, Limits(edge, edge, limits.height), (0.75, 1.3), (0.75, 1.3), (0.72, 0.77))
    return _table(rng, size, ("round",), (0.022, 0.04))


def coffee_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A low table before a sofa: on legs, a drum, two nested ones, or a box with a drawer."""
    size = draw_size(rng, limits, (0.7, 1.3), (0.45, 0.75), (0.34, 0.46))
    if size is None:
        return None
    style = finishes.choose(rng, "legs", "legs", "legs", "drum", "box")
    if style == "legs":
        return _table(rng, size, ("rectangular", "rectangular", "rounded", "oval", "round", "square"), (0.018, 0.04))
    w, d, h = size
    wood, name = finishes.wood(rng)
    if style == "drum":
        r = min(w, d) / 2
        parts = [
            prism(oval(r * 0.9, r * 0.9, 30), 0.0, h - 0.03, wood, 0.008),
            cylinder(r, h - 0.03, h, wood, 0.008, 36),
        ]
        return made(parts, (2 * r, 2 * r, h), {"material": name, "shape": "round"})
    iron, _ = finishes.metal(rng)
    parts = base(rng, "tapered", w, d, 0.12, wood, iron)
    parts += carcass(w, d - 0.002, 0.12, h, wood, 0.025)
    parts += [rounded_box((-0.01, 0.145, -d / 2 + 0.01), (0.01, h - 0.025, d / 2 - 0.02), wood)]
    parts += drawer_fronts((-w / 2 + 0.025, 0.145), (-0.01, h - 0.025), d / 2 - 0.025, 1, 1, wood, iron, "knob")
    return made(parts, size, {"material": name, "shape": "rectangular", "style": "with drawers"})


def side_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small table beside a seat: on legs, on a column, or a C that slides over it."""
    size = draw_size(rng, limits, (0.36, 0.55), (0.34, 0.5), (0.45, 0.62))
    if size is None:
        return None
    style = finishes.choose(rng, "legs", "legs", "column", "tray", "shelf")
    w, d, h = size
    r = min(w, d) / 2
    top, name = _board(rng)
    iron, metal = finishes.metal(rng)
    if style == "legs":
        return _table(rng, size, ("round", "square", "rounded"), (0.015, 0.03))
    if style == "column":
        parts = [*pedestal(rng, h - 0.02, r * 0.7, iron), top_board("round", 2 * r, 2 * r, h - 0.022, h, top)]
        return made(parts, (2 * r, 2 * r, h), {"material": name, "shape": "round"})
    if style == "tray":
        parts = [
            *four_legs(r * 0.62, r * 0.62, h - 0.05, 0.009, iron, r * 0.05, 0.9),
            cylinder(r * 0.97, h - 0.055, h - 0.04, iron, 0.002, 32),
        ]
        ring = np.insert(np.concatenate([(o := oval(r - 0.006, r - 0.006, 32)), o[:1]]), 1, h - 0.025, axis=1)
        parts.append(sweep(ring, bar(0.008, 0.045), iron))
        return made(parts, (2 * r, 2 * r, h), {"material": metal, "shape": "round"})
    parts = four_legs(w / 2 - 0.025, d / 2 - 0.025, h - 0.02, 0.018, top, 0.0, 0.9, square=True)
    parts += [
        rounded_box((-w / 2, h - 0.022, -d / 2), (w / 2, h, d / 2), top),
        rounded_box((-w / 2 + 0.03, 0.15, -d / 2 + 0.03), (w / 2 - 0.03, 0.165, d / 2 - 0.03), top),
    ]
    return made(parts, size, {"material": name, "shape": "rectangular"})


def console_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A narrow table against a wall: with drawers, with a shelf, or a half round."""
    size = draw_size(rng, limits, (0.8, 1.4), (0.28, 0.42), (0.74, 0.9))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    iron, metal = finishes.metal(rng)
    style = finishes.choose(rng, "drawers", "shelf", "metal")
    top, tname = _board(rng) if style == "metal" else (wood, name)
    parts = [rounded_box((-w / 2, h - 0.028, -d / 2), (w / 2, h, d / 2), top, 0.005)]
    x, z = w / 2 - 0.03, d / 2 - 0.03
    if style == "metal":
        parts += frame_legs(x - 0.02, z + 0.028, h - 0.028, 0.025, iron)
        parts.append(rounded_box((-x, 0.12, -z), (x, 0.135, z), top))
        return made(parts, size, {"material": tname if tname != "wood" else metal, "shape": "rectangular"})
    parts += four_legs(x, z, h - 0.028, 0.022, wood, 0.0, 0.65, square=True)
    parts += _apron(x, z, h - 0.028, 0.13 if style == "drawers" else 0.07, wood)
    if style == "drawers":
        n = int(rng.integers(2, 4))
        parts += drawer_fronts(
            (-x + 0.02, h - 0.15),
            (x - 0.02, h - 0.035),
            z + 0.005,
            n,
            1,
            wood,
            iron,
            finishes.choose(rng, *HANDLES[:4]),
        )
    if rng.random() < 0.6 or style == "shelf":
        parts.append(rounded_box((-x, 0.16, -z), (x, 0.18, z), wood, grain="x"))
    return made(
        parts,
        size,
        {"material": name, "shape": "rectangular"} | ({"style": "with drawers"} if style == "drawers" else {}),
    )


GENERATORS: dict[str, Generator] = {
    "dining table": dining_table,
    "round table": round_table,
    "coffee table": coffee_table,
    "side table": side_table,
    "console table": console_table,
}
