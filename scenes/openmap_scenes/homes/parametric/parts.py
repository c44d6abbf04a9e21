"""What many pieces of furniture share: sizes within the limits, legs and bases, fronts with handles, the finished thing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric.base import Limits, Made
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.solids import (
    assembled,
    bent,
    box,
    cylinder,
    leg,
    oval,
    prism,
    rounded_box,
    rounded_outline,
    scaled,
    sweep,
    tube,
)
from openmap_scenes.scene import Material

Range = tuple[float, float]
Size = tuple[float, float, float]


def draw_size(rng: np.random.Generator, limits: Limits, width: Range, depth: Range, height: Range) -> Size | None:
    """Width, depth, height m within the ranges and the limits; None where a limit is under a range. Draws three numbers."""
    out = []
    for (low, high), most in ((width, limits.width), (depth, limits.depth), (height, limits.height)):
        t = float(rng.random())
        if most < low:
            out.append(-1.0)
        else:
            out.append(low + t * (min(high, most) - low))
    return None if min(out) < 0 else (out[0], out[1], out[2])


def made(
    parts: Sequence[Model],
    size: Size,
    attributes: dict[str, str],
    elevation: float = 0.0,
    surface: bool = True,
    fill: bool = False,
) -> Made:
    """The parts as one thing, pressed into (width, depth, height) where they stick out of it; ``fill``: stretched to it too."""
    model = assembled(parts)
    factors = [want / have for want, have in zip(size, model.size[[0, 2, 1]].tolist(), strict=True)]
    # A hair less, so that rounding to 32 bits does not stick out.
    factors = [(f if fill else min(1.0, f)) * (1 - 1e-6) for f in factors]
    if min(factors) < 1.0 or fill:
        model = scaled(model, factors[0], factors[2], factors[1])
    return Made(model, attributes, elevation, surface)


def bar(width: float, thick: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Outline (8, 2) of a rectangular bar's section, its edges broken."""
    return rounded_outline(width / 2, thick / 2, 0.22 * min(width, thick), 1)


def beam(
    a: tuple[float, float, float], b: tuple[float, float, float], width: float, thick: float, m: Material
) -> Model:
    """A straight bar from a to b, ``thick`` along the vertical (or along z for an upright one), ``width`` across."""
    upright = abs(b[1] - a[1]) > 0.9 * float(np.linalg.norm(np.subtract(b, a)))
    return sweep([a, b], bar(width, thick), m, up=(0.0, 0.0, 1.0) if upright else (0.0, 1.0, 0.0))


def four_legs(
    x: float,
    z: float,
    height: float,
    radius: float,
    m: Material,
    splay: float = 0.0,
    taper: float = 0.6,
    square: bool = False,
) -> list[Model]:
    """Legs whose tops stand at (+-x, +-z) and whose feet stand ``splay`` m further out."""
    return [
        leg((sx * x, height, sz * z), (sx * (x + splay), 0.0, sz * (z + splay)), radius, m, taper, square=square)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]


def sled(x: float, z: float, height: float, radius: float, m: Material) -> list[Model]:
    """Two hoops of tube that stand on the floor along z, at x and -x."""
    hoops = []
    for s in (-x, x):
        way = [(s, height, z), (s, radius, z), (s, radius, -z), (s, height, -z)]
        hoops.append(tube(bent(way, 0.05, 3), radius, m, 8))
    return hoops


def frame_legs(x: float, z: float, height: float, thick: float, m: Material) -> list[Model]:
    """Two closed rectangles of square bar along z, at x and -x."""
    out: list[Model] = []
    for s in (-x, x):
        a, b = s - thick / 2, s + thick / 2
        out += [
            rounded_box((a, 0.0, z - thick), (b, height, z), m),
            rounded_box((a, 0.0, -z), (b, height, -z + thick), m),
            rounded_box((a, 0.0, -z + thick), (b, thick, z - thick), m),
        ]
    return out


def base(
    rng: np.random.Generator, style: str, w: float, d: float, h: float, wood: Material, iron: Material
) -> list[Model]:
    """What carries a cupboard or a sofa of w x d m, ``h`` m high: "tapered", "block", "sled", "plinth" or "pins"."""
    x, z = w / 2 - 0.07, d / 2 - 0.07
    if style == "plinth":
        return [box((-w / 2 + 0.02, 0.0, -d / 2 + 0.02), (w / 2 - 0.02, h, d / 2 - 0.04), wood)]
    if style == "sled":
        return [*frame_legs(x, z + 0.04, h, 0.022, iron)]
    if style == "pins":
        return four_legs(x, z, h, 0.011, iron, 0.03, 0.8)
    if style == "block":
        return four_legs(x + 0.02, z + 0.02, h, 0.03, wood, 0.0, 1.0, square=True)
    return four_legs(x - 0.02, z - 0.02, h, 0.022, wood, 0.035, 0.55)


def handle(
    style: str, x: float, y: float, z: float, m: Material, upright: bool = False, length: float = 0.13
) -> list[Model]:
    """A handle in front of a face at z, around (x, y): "bar", "knob", "cup", "strip", or "none"."""
    half = length / 2
    if style == "knob":
        stem = sweep([(x, y, z), (x, y, z + 0.016)], oval(0.006, 0.006, 6), m)
        ball = sweep(
            [(x, y, z + 0.012), (x, y, z + 0.018), (x, y, z + 0.028)],
            np.array([0.6, 1.0, 0.7])[:, None, None] * _disc(0.015),
            m,
        )
        return [stem, ball]
    if style == "cup":
        return [rounded_box((x - 0.045, y - 0.012, z), (x + 0.045, y + 0.016, z + 0.024), m, 0.01, 2)]
    if style == "strip":
        return (
            [box((x - half, y - 0.006, z), (x + half, y + 0.006, z + 0.018), m)]
            if not upright
            else [box((x - 0.006, y - half, z), (x + 0.006, y + half, z + 0.018), m)]
        )
    if style == "bar":
        a, b = ((x, y - half, z), (x, y + half, z)) if upright else ((x - half, y, z), (x + half, y, z))
        way = np.array([a, a, b, b]) + np.outer([0.0, 0.03, 0.03, 0.0], [0.0, 0.0, 1.0])
        return [tube(bent(way, 0.012, 2), 0.005, m, 6)]
    return []


def _disc(radius: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """A ring (1, 8, 2) that broadcasts against one scale a ring."""
    return oval(radius, radius, 8)[None]


def drawer_fronts(
    low: tuple[float, float],
    high: tuple[float, float],
    z: float,
    columns: int,
    rows: int,
    m: Material,
    grip: Material,
    style: str,
    gap: float = 0.004,
    thick: float = 0.018,
    framed: bool = False,
) -> list[Model]:
    """Fronts of drawers over (x, y) from low to high m, their backs at z."""
    out: list[Model] = []
    w, h = (high[0] - low[0]) / columns, (high[1] - low[1]) / rows
    for r in range(rows):
        for c in range(columns):
            x0, y0 = low[0] + c * w + gap / 2, low[1] + r * h + gap / 2
            x1, y1 = x0 + w - gap, y0 + h - gap
            out.append(front((x0, y0), (x1, y1), z, m, framed, thick, "x"))
            x, y = (x0 + x1) / 2, (y0 + y1) / 2
            wide = w > 0.75 and style in ("knob", "cup")
            y = y1 - 0.012 if style == "strip" else y
            length = min(0.16, 0.5 * w) if style != "strip" else 0.6 * w
            # A knob in the middle of a tall front would shade the middle of its board: it sits higher there.
            y = y1 - 0.07 if style != "strip" and y1 - y0 > 0.26 else y
            spots = (x - w / 4, x + w / 4) if wide else (x,)
            for s in spots:
                out += handle(style, s, y, z + thick, grip, False, length)
    return out


def front(
    low: tuple[float, float],
    high: tuple[float, float],
    z: float,
    m: Material,
    framed: bool = False,
    thick: float = 0.018,
    grain: str = "y",
) -> Model:
    """A door or drawer front with its back at z: a flat board, or a frame around a sunk panel."""
    (x0, y0), (x1, y1) = low, high
    edge = min(0.06, 0.3 * min(x1 - x0, y1 - y0))
    if not framed or edge < 0.02:
        return rounded_box((x0, y0, z), (x1, y1, z + thick), m, 0.002, grain=grain)
    return merge(
        [
            rounded_box((x0, y0, z), (x0 + edge, y1, z + thick), m, 0.002, grain="y"),
            rounded_box((x1 - edge, y0, z), (x1, y1, z + thick), m, 0.002, grain="y"),
            rounded_box((x0 + edge, y0, z), (x1 - edge, y0 + edge, z + thick), m, 0.002, grain="x"),
            rounded_box((x0 + edge, y1 - edge, z), (x1 - edge, y1, z + thick), m, 0.002, grain="x"),
            box((x0 + edge, y0 + edge, z), (x1 - edge, y1 - edge, z + thick * 0.45), m, grain),
        ]
    )


def doors(
    low: tuple[float, float],
    high: tuple[float, float],
    z: float,
    count: int,
    m: Material,
    grip: Material,
    style: str,
    framed: bool = False,
    grip_at: float = 0.5,
    gap: float = 0.004,
    thick: float = 0.018,
) -> list[Model]:
    """Doors side by side over (x, y) from low to high m, in pairs whose handles meet; ``grip_at``: handle's height, 0..1."""
    out: list[Model] = []
    w, style = (high[0] - low[0]) / count, "knob" if style == "cup" else style
    for c in range(count):
        x0, x1 = low[0] + c * w + gap / 2, low[0] + (c + 1) * w - gap / 2
        out.append(front((x0, low[1] + gap / 2), (x1, high[1] - gap / 2), z, m, framed, thick))
        right = c % 2 == 0 and not (count % 2 and c == count - 1 and count > 1)
        x = x1 - 0.035 if right else x0 + 0.035
        y = low[1] + grip_at * (high[1] - low[1])
        length = min(0.5 * (high[1] - low[1]), 0.2 if style != "strip" else 0.3)
        out += handle(
            style,
            x,
            float(np.clip(y, low[1] + length / 2 + 0.02, high[1] - length / 2 - 0.02)),
            z + thick,
            grip,
            True,
            length,
        )
    return out


def carcass(
    w: float,
    d: float,
    low: float,
    high: float,
    m: Material,
    thick: float = 0.02,
    back: Material | None = None,
    bevel: float = 0.002,
) -> list[Model]:
    """An open-fronted case of boards from y = low to high, its middle at x = z = 0; the back board is thin."""
    x, z = w / 2, d / 2
    return [
        rounded_box((-x, low, -z), (-x + thick, high, z), m, bevel, grain="y"),
        rounded_box((x - thick, low, -z), (x, high, z), m, bevel, grain="y"),
        rounded_box((-x + thick, low, -z), (x - thick, low + thick, z), m, bevel, grain="x"),
        rounded_box((-x + thick, high - thick, -z), (x - thick, high, z), m, bevel, grain="x"),
        box((-x + thick, low + thick, -z), (x - thick, high - thick, -z + 0.008), back or m, "y"),
    ]


def top_board(shape: str, w: float, d: float, low: float, high: float, m: Material, bevel: float = 0.006) -> Model:
    """A flat table top: "rectangular", "rounded", "oval", "round" or "square"."""
    if shape in ("round", "oval"):
        sides = 40 if max(w, d) > 0.7 else 28
        k = 1.0 / float(np.cos(np.pi / sides))
        return prism(oval(w / 2 * k, d / 2 * k, sides), low, high, m, bevel, step=0.2)
    if shape == "rounded":
        r = 0.22 * min(w, d)
        return prism(rounded_outline(w / 2, d / 2, r, 5, 0.25), low, high, m, bevel, step=0.25)
    return rounded_box((-w / 2, low, -d / 2), (w / 2, high, d / 2), m, bevel, step=0.22)


def pedestal(rng: np.random.Generator, height: float, reach: float, m: Material, x: float = 0.0) -> list[Model]:
    """A column on a disc or on four feet, ``reach`` m from its middle."""
    column = 0.035 + 0.03 * float(rng.random())
    parts = [cylinder(column, 0.02, height, m, 0.002, 16, (x, 0.0))]
    if rng.random() < 0.5:
        parts.append(cylinder(reach, 0.0, 0.025, m, 0.008, 28, (x, 0.0)))
    else:
        for k in range(4):
            c, s = np.cos(np.pi / 4 + k * np.pi / 2), np.sin(np.pi / 4 + k * np.pi / 2)
            path = [
                (x + c * 0.02, 0.14, s * 0.02),
                (x + c * reach * 0.6, 0.07, s * reach * 0.6),
                (x + c * reach, 0.02, s * reach),
            ]
            parts.append(sweep(path, bar(0.05, 0.04), m))
    return parts
