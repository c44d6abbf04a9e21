"""Lamps that stand: on tables, desks and floors; candles."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    DARK,
    GLASSES,
    METALS,
    SOFT,
    VIVID,
    WHITES,
    WOODS,
    between,
    chance,
    finish,
    paint,
    pick,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.parametric.shades import GLOW, shade, shade_cloth
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, soft_box, spline, tube, turn
from openmap_scenes.scene import Material


def _foot(rng: np.random.Generator, height: float) -> tuple[list[Model], str]:
    """The body of a table lamp, its top at ``height``."""
    style, h = pick(rng, "ceramic", "glass", "wood", "metal", "tripod"), height
    r = between(rng, 0.06, 0.095)
    if style == "ceramic" or style == "glass":
        mat = paint(rng, CERAMIC + VIVID[:4] if style == "ceramic" else GLASSES, style)
        shape = (
            [(0.6, 0), (0.65, 0.02), (1.0, 0.35), (0.85, 0.6), (0.25, 0.85), (0.2, 1.0)],
            [(0.5, 0), (0.9, 0.12), (1.0, 0.3), (0.9, 0.5), (0.35, 0.72), (0.2, 1.0)],
            [(0.75, 0), (0.75, 0.05), (0.35, 0.2), (0.8, 0.55), (0.3, 0.9), (0.2, 1.0)],
        )[int(rng.integers(3))]
        profile = spline([(a * r, b * h) for a, b in shape], 16)
        return [lathe(np.concatenate([[[0, 0]], profile, [[0, h]]]), mat, 20)], style
    if style == "wood":
        mat = skin("wood", patterns.wood(rng))
        if chance(rng, 0.5):
            s = r * 0.7
            return [
                soft_box((-s, 0, -s), (s, h * 0.9, s), mat, 0.012),
                tube([(0, h * 0.88, 0), (0, h, 0)], 0.008, paint(rng, METALS, "metal")),
            ], style
        turned = [
            (r, 0),
            (r, 0.02),
            (0.03, 0.04),
            (0.022, 0.3 * h),
            (0.036, 0.36 * h),
            (0.036, 0.44 * h),
            (0.02, 0.5 * h),
            (0.014, h),
            (0, h),
        ]
        return [lathe([(0, 0), *turned], mat, 16)], style
    mat = paint(rng, METALS + DARK, "metal")
    if style == "metal":
        return [
            lathe([(0, 0), (r, 0), (r, 0.01), (r - 0.006, 0.016), (0.012, 0.022), (0.009, h), (0, h)], mat, 20)
        ], style
    legs = [
        tube([(r * 1.2 * np.sin(a), 0, r * 1.2 * np.cos(a)), (0, h * 0.95, 0)], 0.01, paint(rng, WOODS, "wood"), 8)
        for a in (0.0, 2.1, 4.2)
    ]
    return [*legs, tube([(0, h * 0.88, 0), (0, h, 0)], 0.014, mat)], "wood"


def table_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A foot of ceramic, glass, wood or metal under a cone, drum or globe."""
    h = between(rng, 0.2, 0.34)
    parts, stuff = _foot(rng, h)
    glow = solid("bulb", tone(rng, GLOW, 0.01))
    if chance(rng, 0.18):
        r = between(rng, 0.08, 0.12)
        parts.append(ellipsoid((0, h + r * 0.9, 0), (r, r, r), glow, 20, 12))
        return finish(parts, limits, {"shape": "globe", "material": stuff})
    r, high = between(rng, 0.11, 0.18), between(rng, 0.15, 0.23)
    taper, low = (1.0 if chance(rng, 0.3) else between(rng, 0.5, 0.85)), h - 0.02
    parts += shade(low, low + high, r, r * taper, shade_cloth(rng), glow)
    metal = solid("metal", (0.6, 0.6, 0.6))
    parts.append(tube([(0, h - 0.01, 0), (0, low + high / 2, 0)], 0.006, metal, 6))
    for a in (0.3, 0.3 + np.pi / 2):
        mid = low + high * 0.3
        reach = r + (r * taper - r) * 0.3 - 0.004
        parts.append(
            tube(
                [(reach * np.cos(a), mid, reach * np.sin(a)), (-reach * np.cos(a), mid, -reach * np.sin(a))],
                0.002,
                metal,
                4,
            )
        )
    return finish(parts, limits, {"material": stuff})


def desk_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A jointed arm with a bell, a goose neck, or a flat bar of light."""
    style = pick(rng, "jointed", "jointed", "gooseneck", "bar")
    colour = paint(rng, DARK + METALS + VIVID + WHITES, "painted metal")
    steel, glow = paint(rng, METALS[:2], "steel"), solid("bulb", tone(rng, GLOW, 0.01))
    r = between(rng, 0.075, 0.1)
    parts = [lathe([(0, 0), (r, 0), (r, 0.015), (r - 0.01, 0.024), (0, 0.026)], colour, 24)]
    if style == "jointed":
        elbow, tip = (
            np.array([0, between(rng, 0.22, 0.3), -0.1]),
            np.array([0, between(rng, 0.38, 0.46), between(rng, 0.06, 0.14)]),
        )
        for x in (-0.012, 0.012):
            parts += [
                tube([(x, 0.02, 0), elbow + np.array([x, 0, 0])], 0.005, steel, 6),
                tube([elbow + np.array([x, 0, 0]), tip + np.array([x, 0, 0])], 0.005, steel, 6),
            ]
        for joint in (elbow, tip, np.array([0, 0.03, 0])):
            parts.append(tube([joint + np.array([-0.022, 0, 0]), joint + np.array([0.022, 0, 0])], 0.014, colour, 10))
    elif style == "gooseneck":
        neck = spline([(0, 0.02, -0.02), (0, 0.2, -0.06), (0, 0.38, -0.02), (0, 0.42, 0.08), (0, 0.38, 0.13)], 16)
        parts.append(tube(neck, 0.008, steel, 8))
        tip = np.array([0, 0.37, 0.13])
    else:
        parts.append(tube([(0, 0.02, -0.03), (0, 0.38, -0.03)], 0.009, colour))
        head = [
            soft_box((-0.018, 0.375, -0.05), (0.018, 0.395, 0.3), colour, 0.007),
            soft_box((-0.013, 0.371, 0.02), (0.013, 0.38, 0.28), glow, 0.002),
        ]
        return finish([*parts, *head], limits, {"shape": style})
    R = turn(0, -between(rng, 0.2, 0.7))
    bell = [(0.062, -0.1), (0.055, -0.06), (0.035, -0.02), (0.02, 0.0), (0.018, 0.03), (0, 0.03)]
    inner = [(0.02, -0.03), (0.033, -0.03), (0.053, -0.065), (0.06, -0.1)]
    heads = [
        lathe(bell, colour, 20),
        lathe([(0, -0.03), *inner, bell[0]], glow, 20),
        ellipsoid((0, -0.065, 0), (0.024, 0.03, 0.024), glow, 10, 6),
    ]
    return finish([*parts, *(placed(p, tip, R) for p in heads)], limits, {"shape": style, "material": "metal"})


def _stand_straight(rng: np.random.Generator, h: float, metal: Material) -> list[Model]:
    r = between(rng, 0.12, 0.16)
    return [
        lathe(
            [
                (0, 0),
                (r, 0),
                (r, 0.015),
                (r * 0.9, 0.024),
                (0.014, 0.03),
                *((0.011, y) for y in np.linspace(0.05, h, 7)),
                (0, h),
            ],
            metal,
            20,
        )
    ]


def floor_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A standing lamp: shade on a pole, on a tripod, an arc over a sofa, an uplighter, a reading lamp, a paper column."""
    style = pick(rng, "pole", "tripod", "arc", "uplighter", "reading", "column")
    metal, glow = paint(rng, METALS + DARK, "metal"), solid("bulb", tone(rng, GLOW, 0.01))
    h = between(rng, 1.25, 1.5)
    if style == "column":
        w = between(rng, 0.11, 0.16)
        paper, frame = (
            skin("paper", patterns.stripes(rng, [(0.97, 0.93, 0.84), (0.88, 0.82, 0.70)], 12, False, 96)),
            paint(rng, WOODS, "wood"),
        )
        parts = [soft_box((-w, 0.06, -w), (w, h, w), paper, 0.004)]
        parts += [
            soft_box((x * w - 0.012, 0, z * w - 0.012), (x * w + 0.012, h + 0.02, z * w + 0.012), frame, 0.003)
            for x in (-1, 1)
            for z in (-1, 1)
        ]
        return finish(parts, limits, {"style": style, "material": "paper"})
    if style == "tripod":
        wood = paint(rng, WOODS, "wood")
        spread = between(rng, 0.22, 0.3)
        feet = [np.array([spread * np.sin(a), 0, spread * np.cos(a)]) for a in (0.5, 2.6, 4.7)]
        parts = [tube(np.linspace(f, [0, h - 0.02, 0], 6), 0.016, wood, 8) for f in feet]
        parts.append(tube([(0, h - 0.1, 0), (0, h + 0.1, 0)], 0.02, metal))
    elif style == "arc":
        reach = between(rng, 0.7, 1.0)
        path = spline(
            [
                (-reach / 2, 0.03, 0),
                (-reach / 2 - 0.04, 1.0, 0),
                (-reach * 0.2, 1.75, 0),
                (reach * 0.3, 1.75, 0),
                (reach / 2, 1.5, 0),
            ],
            22,
        )
        parts = [
            tube(path, 0.012, metal),
            placed(
                lathe(
                    [(0, 0), (0.17, 0), (0.17, 0.03), (0.16, 0.04), (0, 0.04)], paint(rng, WHITES + DARK, "marble"), 24
                ),
                (-reach / 2, 0, 0),
            ),
        ]
        colour, r = paint(rng, METALS + DARK + WHITES, "shade"), between(rng, 0.15, 0.2)
        dome = [(r * np.cos(a), r * np.sin(a) * 0.8) for a in np.linspace(0, np.pi / 2, 7)]
        bell = [
            lathe(dome, colour, 24),
            lathe([(x * 0.97, y * 0.96) for x, y in dome[::-1]] + [dome[0]], glow, 24),
            ellipsoid((0, 0.05, 0), (0.04, 0.05, 0.04), glow, 10, 6),
        ]
        return finish(
            [*parts, *(placed(p, (reach / 2, 1.36, 0)) for p in bell)], limits, {"style": style, "material": "metal"}
        )
    else:
        parts = _stand_straight(rng, h, metal)
    if style == "uplighter":
        r = between(rng, 0.14, 0.2)
        parts += [
            lathe(
                [(0.012, h - 0.02), (0.05, h), (r, h + 0.11), (r - 0.006, h + 0.11), (0.05, h + 0.012), (0, h + 0.01)],
                glow if chance(rng, 0.5) else metal,
                24,
            )
        ]
    elif style == "reading":
        arm = spline([(0, h - 0.01, 0), (0, h + 0.1, 0.02), (0, h + 0.12, 0.14), (0, h + 0.05, 0.2)], 10)
        bell = [
            lathe([(0.075, -0.13), (0.06, -0.05), (0.025, 0), (0, 0.005)], metal, 20),
            lathe([(0, -0.02), (0.023, -0.02), (0.058, -0.055), (0.073, -0.13), (0.075, -0.13)], glow, 20),
        ]
        parts += [tube(arm, 0.01, metal), *(placed(p, arm[-1] + [0, 0.01, 0], turn(0, -0.5)) for p in bell)]
    else:
        r, high = between(rng, 0.17, 0.24), between(rng, 0.2, 0.3)
        parts += shade(h - 0.03, h - 0.03 + high, r, r * between(rng, 0.65, 1.0), shade_cloth(rng), glow)
        parts.append(tube([(0, h - 0.02, 0), (0, h + high / 2, 0)], 0.008, metal, 6))
        parts.append(tube([(-r * 0.95, h, 0), (r * 0.95, h, 0)], 0.003, metal, 4))
    return finish(parts, limits, {"style": style, "material": "wood" if style == "tripod" else "metal"})


def candle(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A thick candle, three of them on a plate, a taper in a holder, or a candle in a glass."""
    style = pick(rng, "pillar", "group", "candlestick", "jar")
    wax, flame = paint(rng, (*WHITES, *WHITES, *VIVID[:1], *SOFT[:3]), "wax"), solid("flame", (1.0, 0.86, 0.45))

    def one(r: float, h: float, x: float, y: float, z: float) -> list[Model]:
        body = lathe(
            [(0, 0), (r * 0.97, 0), (r, 0.004), (r, h - 0.004), (r * 0.94, h), (r * 0.6, h - 0.003), (0, h - 0.005)],
            wax,
            18,
        )
        parts = [
            placed(body, (x, y, z)),
            tube([(x, y + h - 0.006, z), (x, y + h + 0.008, z)], 0.0012, solid("wick", (0.12, 0.1, 0.08)), 5),
        ]
        if lit:
            parts.append(
                placed(lathe([(0, 0), (0.005, 0.008), (0.0035, 0.018), (0, 0.03)], flame, 8), (x, y + h + 0.003, z))
            )
        return parts

    lit, parts = chance(rng, 0.6), []
    if style == "pillar":
        parts = one(between(rng, 0.03, 0.045), between(rng, 0.08, 0.18), 0, 0, 0)
    elif style == "group":
        r = 0.095
        parts = [
            lathe(
                [(0, 0), (r * 0.9, 0), (r, 0.012), (r - 0.005, 0.012), (r * 0.85, 0.006), (0, 0.006)],
                paint(rng, METALS + CERAMIC, "plate"),
                24,
            )
        ]
        for k, h in enumerate((0.15, 0.1, 0.07)):
            parts += one(0.03, h * between(rng, 0.9, 1.1), 0.045 * np.cos(2.1 * k), 0.006, 0.045 * np.sin(2.1 * k))
    elif style == "candlestick":
        h = between(rng, 0.08, 0.22)
        stick = [
            (0, 0),
            (0.045, 0),
            (0.045, 0.006),
            (0.015, 0.02),
            (0.01, h * 0.4),
            (0.018, h * 0.5),
            (0.009, h * 0.6),
            (0.009, h * 0.85),
            (0.02, h * 0.95),
            (0.02, h),
            (0, h),
        ]
        parts = [
            lathe(stick, paint(rng, METALS + WOODS, "candlestick"), 16),
            *one(0.011, between(rng, 0.12, 0.2), 0, h, 0),
        ]
    else:
        r, h = 0.038, between(rng, 0.07, 0.1)
        parts = [
            lathe(
                [(0, 0), (r, 0), (r, h), (r - 0.003, h), (r - 0.003, h * 0.88), (0, h * 0.88)],
                paint(rng, GLASSES + CERAMIC, "jar"),
                20,
            ),
            *one(r * 0.9, 0.012, 0, h * 0.88 - 0.006, 0),
        ]
    return finish(parts, limits, {"material": "wax"})


GENERATORS: dict[str, Generator] = {
    "table lamp": table_lamp,
    "desk lamp": desk_lamp,
    "floor lamp": floor_lamp,
    "candle": candle,
}
