"""Lamps: on ceilings, tables, desks, floors and walls; candles. Shades are pale because what shines is drawn bright."""

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
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, sheet, soft_box, spline, tube, turn
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

GLOW: tuple[Colour, ...] = ((1.0, 0.97, 0.90), (0.98, 0.93, 0.80), (0.97, 0.96, 0.94))
SHADES: tuple[Colour, ...] = (
    *GLOW,
    *GLOW,
    (0.90, 0.82, 0.68),
    (0.70, 0.30, 0.24),
    (0.36, 0.48, 0.60),
    (0.30, 0.32, 0.34),
)


def shade(low: float, high: float, r_low: float, r_high: float, cloth: Material, bulb: Material) -> list[Model]:
    """A cloth shade open above and below, with a bulb inside."""
    t = 0.004
    profile = [(r_low, low), (r_high, high), (r_high - t, high), (r_low - t, low), (r_low, low)]
    middle = (low + high) / 2
    size = min(0.035, 0.4 * min(r_low, r_high))
    return [lathe(profile, cloth, 26), ellipsoid((0, middle, 0), (size, size * 1.3, size), bulb, 10, 6)]


def shade_cloth(rng: np.random.Generator) -> Material:
    """Linen, pleated or striped cloth."""
    colour, style = tone(rng, SHADES, 0.015), int(rng.integers(4))
    if style == 0:
        return skin(
            "shade", patterns.stripes(rng, [colour, (0.8 * colour[0], 0.8 * colour[1], 0.8 * colour[2])], 16, True, 96)
        )
    return skin("shade", patterns.cloth(rng, colour, 64, 0.03)) if style == 1 else solid("shade", colour)


def bowl_lamp(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """A shallow glass bowl against the ceiling."""
    r, h = between(rng, 0.15, 0.24), between(rng, 0.07, 0.11)
    arc = [(r * np.sin(a), h * (1 - np.cos(a))) for a in np.linspace(0, np.pi / 2, 7)]
    parts = [
        lathe([*arc, (0.0, h)], glass, 28),
        lathe([(r * 1.01, h - 0.004), (r * 1.02, h + 0.015), (0, h + 0.015)], metal, 28),
    ]
    if chance(rng, 0.6):
        parts.append(ellipsoid((0, -0.006, 0), (0.012, 0.014, 0.012), metal, 10, 6))
    return parts


def drum_lamp(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """A cloth drum with a flat cover below, a little off the ceiling."""
    r, h = between(rng, 0.18, 0.28), between(rng, 0.12, 0.2)
    cloth = shade_cloth(rng)
    return [
        lathe([(0, 0.01), (r - 0.006, 0.01)], glass, 28),
        lathe([(r - 0.006, 0.0), (r, 0.0), (r, h), (r - 0.006, h), (0, h)], cloth, 28),
        lathe([(0.05, h), (0.05, h + 0.05), (0, h + 0.05)], metal, 14),
    ]


def spot_bar(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """A bar with three or four spots turned this way and that."""
    n = int(rng.integers(3, 5))
    half = 0.13 * n
    parts = [soft_box((-half, 0.12, -0.03), (half, 0.145, 0.03), metal, 0.008)]
    spot = [(0.0, 0.0), (0.03, 0.0), (0.034, 0.004), (0.034, 0.07), (0.02, 0.085), (0, 0.085)]
    for k in range(n):
        R = turn(1, float(rng.uniform(0, 6.3))) @ turn(0, between(rng, 0.2, 0.8))
        at = np.array([half * (2 * (k + 0.5) / n - 1), 0.095, 0.0])
        head = [lathe(spot[2:], metal, 14), lathe(spot[:3], glass, 14)]
        parts += [placed(p, at + R @ [0, -0.06, 0], R) for p in head]
        parts.append(tube([at + [0, -0.01, 0], at + [0, 0.03, 0]], 0.006, metal, 6))
    return parts


def chandelier(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """Curved arms with cups of glass or candles around a stem."""
    n, reach = int(rng.integers(4, 7)), between(rng, 0.2, 0.32)
    stem = [(0, 0), (0.018, 0.01), (0.028, 0.04), (0.012, 0.09), (0.03, 0.13), (0.01, 0.18), (0.008, 0.36), (0.06, 0.38), (0.06, 0.4), (0, 0.4)]  # fmt: skip
    parts = [lathe(stem, metal, 12)]
    cups = chance(rng, 0.5)
    for k in range(n):
        R = turn(1, 2 * np.pi * k / n)
        arm = spline([(0.02, 0.1, 0), (0.4 * reach, 0.03, 0), (0.85 * reach, 0.04, 0), (reach, 0.11, 0)], 8)
        parts.append(tube(arm @ R.T, 0.007, metal, 6))
        at = R @ [reach, 0.11, 0]
        if cups:
            cup = lathe(
                [(0, 0), (0.03, 0.005), (0.05, 0.04), (0.055, 0.09), (0.051, 0.09), (0.044, 0.04), (0, 0.012)],
                glass,
                14,
            )
        else:
            cup = lathe([(0.012, -0.002), (0.012, 0.08), (0.016, 0.1), (0.008, 0.13), (0, 0.145)], glass, 10)
            parts.append(placed(lathe([(0, -0.004), (0.03, 0), (0.03, 0.004), (0, 0.004)], metal, 12), at))
        parts.append(placed(cup, at))
    return parts


def panel_lamp(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """A flat square or long box of milky plastic in a frame."""
    w = between(rng, 0.3, 0.6)
    d = w if chance(rng, 0.6) else w * 0.4
    h = between(rng, 0.05, 0.08)
    return [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), glass, 0.02, 2),
        soft_box((-w / 2 - 0.008, h * 0.5, -d / 2 - 0.008), (w / 2 + 0.008, h + 0.004, d / 2 + 0.008), metal, 0.006),
    ]


def ceiling_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A lamp whose flat top touches the ceiling: bowl, drum, spots, chandelier or panel."""
    makers = {"bowl": bowl_lamp, "drum": drum_lamp, "spots": spot_bar, "chandelier": chandelier, "square": panel_lamp}
    style = pick(rng, *makers)
    glass, metal = solid("lamp glass", tone(rng, GLOW, 0.01)), paint(rng, METALS + WHITES, "lamp metal")
    return finish(makers[style](rng, glass, metal), limits, {"style": style}, elevation=2.3)


def _pendant_heads(rng: np.random.Generator, style: str, glow: Material, metal: Material) -> tuple[list[Model], float]:
    """What hangs from the cord, its base at y = 0, and the height at which the cord enters."""
    r, h = between(rng, 0.13, 0.24), between(rng, 0.14, 0.24)
    colour = paint(rng, SOFT + VIVID + METALS + DARK, "shade")
    if style == "dome":
        arc = [(r * np.cos(a), h * np.sin(a)) for a in np.linspace(0, 1.45, 7)]
        inner = [(x * 0.97, y - 0.004) for x, y in arc[::-1]]
        return [lathe([*arc, (0, h)], colour, 26), lathe([*inner, arc[0]], glow, 26), ellipsoid((0, h * 0.4, 0), (0.035, 0.045, 0.035), glow, 10, 6)], h  # fmt: skip
    if style == "globe":
        return [ellipsoid((0, r * 0.8, 0), (r * 0.8, r * 0.8, r * 0.8), glow, 22, 14)], r * 1.58
    if style == "drum":
        return [
            *shade(0, h, r, r, shade_cloth(rng), glow),
            tube([(-r + 0.002, h - 0.01, 0), (r - 0.002, h - 0.01, 0)], 0.003, metal, 5),
        ], h - 0.01
    if style == "cone":
        profile = [(r, 0), (0.035, h), (0, h + 0.01)]
        return [lathe(profile, colour, 24), lathe([(0.03, h - 0.01), (r * 0.985, 0.003), (r, 0)], glow, 24), ellipsoid((0, 0.07, 0), (0.032, 0.04, 0.032), glow, 10, 6)], h  # fmt: skip
    if style == "lantern":
        rods = skin("woven shade", patterns.wicker(rng, tone(rng, WOODS), 8, 24))
        body = [(r * 0.35 + r * 0.65 * np.sin(np.pi * t), h * 1.4 * t) for t in np.linspace(0.04, 0.96, 10)]
        return [lathe([*body, *((x - 0.006, y) for x, y in body[::-1]), body[0]], rods, 24), ellipsoid((0, h * 0.7, 0), (0.04, 0.05, 0.04), glow, 10, 6), tube([(-r * 0.4, h * 1.32, 0), (r * 0.4, h * 1.32, 0)], 0.003, metal, 5)], h * 1.32  # fmt: skip
    bulb = [(0, 0), (0.025, 0.004), (0.045, 0.03), (0.048, 0.06), (0.03, 0.1), (0.018, 0.12)]
    return [
        lathe(bulb, glow, 16),
        lathe([(0.018, 0.115), (0.024, 0.12), (0.024, 0.17), (0.008, 0.18), (0, 0.18)], metal, 14),
    ], 0.18


def pendant_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A lamp on a cord; its canopy touches the ceiling and the whole drop is ``limits.height``, at most 1.6 m."""
    style = pick(rng, "dome", "globe", "drum", "cone", "lantern", "bulb")
    glow, metal = solid("lamp glass", tone(rng, GLOW, 0.01)), paint(rng, METALS, "lamp metal")
    parts, top = _pendant_heads(rng, style, glow, metal)
    drop = min(limits.height, 1.6) if limits.height < 5 else between(rng, 0.6, 1.1)
    if drop < top + 0.1:
        return None
    cord = np.stack([np.zeros(8), np.linspace(top - 0.01, drop - 0.02, 8), np.zeros(8)], 1)
    parts.append(tube(cord, 0.004, paint(rng, DARK + WHITES, "cord"), 6))
    parts.append(
        lathe([(0, drop - 0.03), (0.03, drop - 0.028), (0.05, drop - 0.012), (0.052, drop), (0, drop)], metal, 16)
    )
    return finish(parts, limits, {"shape": style}, elevation=1.4)


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
                tube([(x, 0.02, 0), elbow + [x, 0, 0]], 0.005, steel, 6),
                tube([elbow + [x, 0, 0], tip + [x, 0, 0]], 0.005, steel, 6),
            ]
        for joint in (elbow, tip, np.array([0, 0.03, 0])):
            parts.append(tube([joint + [-0.022, 0, 0], joint + [0.022, 0, 0]], 0.014, colour, 10))
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
        parts = [tube(path, 0.012, metal), placed(lathe([(0, 0), (0.17, 0), (0.17, 0.03), (0.16, 0.04), (0, 0.04)], paint(rng, WHITES + DARK, "marble"), 24), (-reach / 2, 0, 0))]  # fmt: skip
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
        parts += [lathe([(0.012, h - 0.02), (0.05, h), (r, h + 0.11), (r - 0.006, h + 0.11), (0.05, h + 0.012), (0, h + 0.01)], glow if chance(rng, 0.5) else metal, 24)]  # fmt: skip
    elif style == "reading":
        arm = spline([(0, h - 0.01, 0), (0, h + 0.1, 0.02), (0, h + 0.12, 0.14), (0, h + 0.05, 0.2)], 10)
        bell = [lathe([(0.075, -0.13), (0.06, -0.05), (0.025, 0), (0, 0.005)], metal, 20), lathe([(0, -0.02), (0.023, -0.02), (0.058, -0.055), (0.073, -0.13), (0.075, -0.13)], glow, 20)]  # fmt: skip
        parts += [tube(arm, 0.01, metal), *(placed(p, arm[-1] + [0, 0.01, 0], turn(0, -0.5)) for p in bell)]
    else:
        r, high = between(rng, 0.17, 0.24), between(rng, 0.2, 0.3)
        parts += shade(h - 0.03, h - 0.03 + high, r, r * between(rng, 0.65, 1.0), shade_cloth(rng), glow)
        parts.append(tube([(0, h - 0.02, 0), (0, h + high / 2, 0)], 0.008, metal, 6))
        parts.append(tube([(-r * 0.95, h, 0), (r * 0.95, h, 0)], 0.003, metal, 4))
    return finish(parts, limits, {"style": style, "material": "wood" if style == "tripod" else "metal"})


def wall_lamp(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A lamp on a wall: plate, arm and a shade, a half bowl, or a box that shines up and down."""
    style = pick(rng, "shade", "globe", "half bowl", "box")
    metal, glow = paint(rng, METALS + DARK + WHITES, "metal"), solid("lamp glass", tone(rng, GLOW, 0.01))
    if style == "half bowl":
        r, h = between(rng, 0.12, 0.16), between(rng, 0.1, 0.15)
        phi = np.linspace(-np.pi / 2, np.pi / 2, 15)
        t = np.linspace(0.02, 1, 8)
        rad = r * np.sin(t * np.pi / 2) ** 0.8
        points = np.stack(
            [rad[:, None] * np.sin(phi), np.repeat((h * t)[:, None], 15, 1), rad[:, None] * np.cos(phi) * 0.8], 2
        )
        return finish(
            [
                sheet(points, 0.005, glow),
                soft_box((-r * 0.6, h * 0.3, -0.01), (r * 0.6, h * 0.95, 0.004), metal, 0.003),
            ],
            limits,
            {"shape": style},
            elevation=1.6,
        )
    if style == "box":
        w, h = between(rng, 0.05, 0.07), between(rng, 0.1, 0.2)
        parts = [soft_box((-w, 0, 0.02), (w, h, 0.02 + 2 * w), {k: (glow if k > 3 else metal) for k in range(6)}, 0.004), soft_box((-w, h * 0.2, 0), (w, h * 0.8, 0.025), metal, 0.003)]  # fmt: skip
        return finish(parts, limits, {"shape": style}, elevation=1.6)
    parts = [
        placed(
            lathe([(0, 0), (0.05, 0), (0.05, 0.012), (0.03, 0.02), (0, 0.02)], metal, 18),
            (0, 0.02, 0),
            turn(0, np.pi / 2),
        )
    ]
    parts.append(tube(spline([(0, 0.02, 0.01), (0, -0.01, 0.06), (0, 0.0, 0.11), (0, 0.07, 0.12)], 10), 0.007, metal))
    if style == "globe":
        parts.append(ellipsoid((0, 0.13, 0.12), (0.07, 0.07, 0.07), glow, 18, 10))
    else:
        parts += [placed(p, (0, 0, 0.12)) for p in shade(0.06, 0.2, 0.085, 0.055, shade_cloth(rng), glow)]
    return finish(parts, limits, {"shape": style}, elevation=1.55)


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
                [(0, 0), (r, 0), (r, h), (r - 0.003, h), (r - 0.003, h * 0.7), (0, h * 0.7)],
                paint(rng, GLASSES + CERAMIC, "jar"),
                20,
            ),
            *one(r * 0.9, 0.012, 0, h * 0.7 - 0.006, 0),
        ]
    return finish(parts, limits, {"material": "wax"})


GENERATORS: dict[str, Generator] = {
    "ceiling lamp": ceiling_lamp,
    "pendant lamp": pendant_lamp,
    "table lamp": table_lamp,
    "desk lamp": desk_lamp,
    "floor lamp": floor_lamp,
    "wall lamp": wall_lamp,
    "candle": candle,
}
