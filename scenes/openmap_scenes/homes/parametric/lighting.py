"""Lamps: on ceilings, tables, desks, floors and walls; candles. Shades are pale because what shines is drawn bright."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns, standing_lamps
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
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
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, sheet, soft_box, spline, tube, turn
from openmap_scenes.scene import Material


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
        parts.append(tube(np.stack([at + np.array([0, -0.01, 0]), at + np.array([0, 0.03, 0])]), 0.006, metal, 6))
    return parts


def chandelier(rng: np.random.Generator, glass: Material, metal: Material) -> list[Model]:
    """Curved arms with cups of glass or candles around a stem."""
    n, reach = int(rng.integers(4, 7)), between(rng, 0.2, 0.32)
    stem = [
        (0, 0),
        (0.018, 0.01),
        (0.028, 0.04),
        (0.012, 0.09),
        (0.03, 0.13),
        (0.01, 0.18),
        (0.008, 0.36),
        (0.06, 0.38),
        (0.06, 0.4),
        (0, 0.4),
    ]
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
        return [
            lathe([*arc, (0, h)], colour, 26),
            lathe([*inner, arc[0]], glow, 26),
            ellipsoid((0, h * 0.4, 0), (0.035, 0.045, 0.035), glow, 10, 6),
        ], h
    if style == "globe":
        return [ellipsoid((0, r * 0.8, 0), (r * 0.8, r * 0.8, r * 0.8), glow, 22, 14)], r * 1.58
    if style == "drum":
        return [
            *shade(0, h, r, r, shade_cloth(rng), glow),
            tube([(-r + 0.002, h - 0.01, 0), (r - 0.002, h - 0.01, 0)], 0.003, metal, 5),
        ], h - 0.01
    if style == "cone":
        profile = [(r, 0), (0.035, h), (0, h + 0.01)]
        return [
            lathe(profile, colour, 24),
            lathe([(0.03, h - 0.01), (r * 0.985, 0.003), (r, 0)], glow, 24),
            ellipsoid((0, 0.07, 0), (0.032, 0.04, 0.032), glow, 10, 6),
        ], h
    if style == "lantern":
        rods = skin("woven shade", patterns.wicker(rng, tone(rng, WOODS), 8, 24))
        body = [(r * 0.35 + r * 0.65 * np.sin(np.pi * t), h * 1.4 * t) for t in np.linspace(0.04, 0.96, 10)]
        return [
            lathe([*body, *((x - 0.006, y) for x, y in body[::-1]), body[0]], rods, 24),
            ellipsoid((0, h * 0.7, 0), (0.04, 0.05, 0.04), glow, 10, 6),
            tube([(-r * 0.4, h * 1.32, 0), (r * 0.4, h * 1.32, 0)], 0.003, metal, 5),
        ], h * 1.32
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
        parts = [
            soft_box(
                (-w, 0, 0.02), (w, h, 0.02 + 2 * w), {k: (metal if k in (1, 2, 3) else glow) for k in range(6)}, 0.004
            ),
            soft_box((-w - 0.006, h * 0.4, 0), (w + 0.006, h * 0.6, 0.026 + 2 * w), metal, 0.003),
        ]
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


GENERATORS: dict[str, Generator] = {
    "ceiling lamp": ceiling_lamp,
    "pendant lamp": pendant_lamp,
    "wall lamp": wall_lamp,
    **standing_lamps.GENERATORS,
}
