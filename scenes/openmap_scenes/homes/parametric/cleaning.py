"""Bins, baskets for washing, and things to clean and iron with."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import patterns
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
from openmap_scenes.homes.revolve import (
    ellipsoid,
    grid,
    lathe,
    placed,
    soft_box,
    spline,
    tube,
    turn,
    vessel,
)

BLACK = solid("black plastic", (0.10, 0.10, 0.11))


def wastebasket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small open bin, some crumpled paper in it."""
    stuff = pick(rng, "plastic", "metal", "wicker")
    mat = {
        "plastic": lambda: paint(rng, VIVID + DARK + SOFT, "bin"),
        "metal": lambda: skin("mesh", patterns.checks(rng, tone(rng, METALS), (0.25, 0.25, 0.26), 32)),
        "wicker": lambda: skin("wicker", patterns.wicker(rng, tone(rng, WOODS), 12, 26)),
    }[stuff]()
    r, h = between(rng, 0.11, 0.15), between(rng, 0.25, 0.33)
    parts = [vessel([(r * 0.78, 0), (r * 0.9, h * 0.55), (r, h - 0.01), (r + 0.006, h)], 0.006, mat, mat, 24)]
    if chance(rng, 0.6):
        for k in range(5):
            ball = ellipsoid((0, 0, 0), (0.04, 0.035, 0.038), solid("paper", (0.94, 0.93, 0.90)), 7, 4)
            parts.append(
                placed(ball, (0.06 * np.cos(1.3 * k), h * 0.72 + 0.02 * (k % 2), 0.06 * np.sin(1.3 * k)), turn(0, k))
            )
    if stuff != "plastic" and chance(rng, 0.2):
        parts = [placed(p, scale=(1.2, 1, 0.8)) for p in parts]
    return finish(parts, limits, {"material": stuff})


def trash_can(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A kitchen bin: round with a pedal and a domed lid, or square with a swing lid."""
    body, dark = paint(rng, METALS[:3] + WHITES + VIVID[:1], "bin"), BLACK
    if chance(rng, 0.55):
        r, h = between(rng, 0.13, 0.17), between(rng, 0.4, 0.62)
        parts = [
            lathe([(0, 0), (r, 0), (r, 0.03)], dark, 26),
            lathe([(r - 0.003, 0.03), (r - 0.003, h * 0.5), (r - 0.003, h)], body, 26),
            lathe(
                [(r, h), (r, h + 0.025), (r * 0.8, h + 0.06), (r * 0.4, h + 0.075), (0, h + 0.078)],
                dark if chance(rng, 0.5) else body,
                26,
            ),
        ]
        parts.append(soft_box((-0.05, 0.008, r * 0.8), (0.05, 0.025, r + 0.05), dark, 0.005))
        return finish(parts, limits, {"shape": "round", "style": "pedal"})
    w, d, h = between(rng, 0.26, 0.32), between(rng, 0.2, 0.26), between(rng, 0.45, 0.62)
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h * 0.82, d / 2), body, 0.025, 2),
        soft_box((-w / 2 - 0.006, h * 0.8, -d / 2 - 0.006), (w / 2 + 0.006, h * 0.88, d / 2 + 0.006), dark, 0.01),
    ]
    parts.append(
        placed(
            soft_box((-w * 0.42, -0.09, -0.09), (w * 0.42, 0.09, 0.09), dark, 0.03, 2),
            (0, h * 0.85, 0),
            turn(0, np.pi / 4),
            (1, 0.9, 0.9),
        )
    )
    return finish(parts, limits, {"shape": "rectangular", "style": "swing"})


def laundry_basket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tall basket for washing, closed or with clothes over its rim; or a low one of plastic."""
    stuff = pick(rng, "wicker", "fabric", "plastic")
    r, h = between(rng, 0.19, 0.24), between(rng, 0.45, 0.6)
    if stuff == "plastic":
        h = between(rng, 0.24, 0.3)
    mat = {
        "wicker": lambda: skin("wicker", patterns.wicker(rng, tone(rng, WOODS + SOFT[:1]), 16, 30)),
        "fabric": lambda: skin("cloth", patterns.fabric(rng, 0.5)[0]),
        "plastic": lambda: skin("holes", patterns.dots(rng, tone(rng, SOFT + VIVID), (0.2, 0.2, 0.22), 9)),
    }[stuff]()
    stretch = (1.25, 1, 0.9) if stuff == "plastic" or chance(rng, 0.3) else (1, 1, 1)
    parts = [vessel([(r * 0.85, 0), (r * 0.95, h * 0.5), (r, h)], 0.01, mat, mat, 26)]
    if stuff != "plastic" and chance(rng, 0.4):
        parts.append(
            lathe(
                [
                    (r + 0.008, h - 0.02),
                    (r + 0.01, h + 0.01),
                    (r * 0.7, h + 0.03),
                    (0.02, h + 0.036),
                    (0.02, h + 0.05),
                    (0, h + 0.052),
                ],
                mat,
                26,
            )
        )
    else:
        for k in range(5):
            cloth = skin("clothes", patterns.fabric(rng, 0.6, SOFT + VIVID)[0])
            heap = ellipsoid((0, 0, 0), (r * 0.52, 0.07, r * 0.36), cloth, 12, 7, 1.0, 0.8)
            parts.append(
                placed(
                    heap,
                    (0.4 * r * np.cos(1.4 * k), h - 0.03 + 0.03 * (k % 2), 0.4 * r * np.sin(1.4 * k)),
                    turn(1, 1.1 * k) @ turn(2, 0.25),
                )
            )
    return finish([placed(p, scale=stretch) for p in parts], limits, {"material": stuff})


def broom(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A broom, upright: flat with bristles, or a bundle of straw."""
    stick, h = paint(rng, WOODS + VIVID + METALS, "stick"), between(rng, 1.2, 1.4)
    path = np.stack([np.zeros(6), np.linspace(0.18, h, 6), np.zeros(6)], 1)
    bristle = skin(
        "bristles",
        patterns.stripes(
            rng,
            [
                a := tone(rng, ((0.80, 0.66, 0.36), (0.20, 0.20, 0.22), (0.72, 0.20, 0.18), (0.22, 0.42, 0.62))),
                (0.7 * a[0], 0.7 * a[1], 0.7 * a[2]),
            ],
            20,
            True,
            96,
        ),
    )
    if chance(rng, 0.5):
        parts = [
            soft_box((-0.15, 0.09, -0.028), (0.15, 0.135, 0.028), paint(rng, WOODS + VIVID, "head"), 0.008),
            soft_box((-0.16, 0, -0.035), (0.16, 0.1, 0.035), bristle, 0.01),
            lathe([(0.02, 0.13), (0.016, 0.2), (0, 0.2)], stick, 12),
        ]
    else:
        swell = spline([(0.14, 0), (0.12, 0.12), (0.06, 0.26), (0.022, 0.34)], 8)
        parts = [
            placed(lathe(np.concatenate([[[0, 0]], swell, [[0, 0.34]]]), bristle, 20), scale=(1, 1, 0.4)),
            placed(
                lathe([(0.075, 0.2), (0.079, 0.21), (0.066, 0.24)], paint(rng, VIVID, "cord"), 18), scale=(1.25, 1, 0.6)
            ),
        ]
    return finish([*parts, tube(path, 0.012, stick, 8)], limits, {"material": "wood"})


def vacuum_cleaner(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A canister with its hose and wand, or an upright stick."""
    body, dark, grey = paint(rng, VIVID + DARK, "body"), BLACK, solid("tube", (0.66, 0.67, 0.69))
    if chance(rng, 0.5):
        lean = turn(0, -0.12)
        wand = [
            tube([(0, 0.06, 0), (0, 0.4, 0), (0, 0.75, 0)], 0.017, grey, 10),
            tube([(0, 0.72, 0), (0, 1.0, 0)], [0.05, 0.045], body, 16),
            tube([(0, 0.68, 0.055), (0, 0.9, 0.055)], 0.035, paint(rng, WHITES + METALS, "cup"), 14),
        ]
        wand.append(
            tube(spline([(0, 0.98, -0.02), (0, 1.1, -0.06), (0, 1.13, -0.15), (0, 1.02, -0.13)], 9), 0.016, dark, 8)
        )
        return finish(
            [
                *(placed(p, (0, 0.0, 0), lean) for p in wand),
                soft_box((-0.13, 0, -0.02), (0.13, 0.055, 0.1), dark, 0.02, 2),
            ],
            limits,
            {"style": "stick"},
        )
    parts = [
        ellipsoid((0, 0.15, 0), (0.14, 0.12, 0.2), body, 20, 12, 0.7, 0.8),
        ellipsoid((0, 0.2, 0.05), (0.1, 0.09, 0.12), paint(rng, METALS + DARK, "lid"), 18, 10),
    ]
    wheel = lathe([(0, -0.02), (0.09, -0.02), (0.095, 0), (0.09, 0.02), (0, 0.02)], dark, 20)
    parts += [placed(wheel, (s * 0.14, 0.095, -0.08), turn(2, np.pi / 2)) for s in (-1, 1)]
    hose = spline([(0, 0.2, 0.17), (0.05, 0.3, 0.34), (0.28, 0.45, 0.34), (0.36, 0.75, 0.1), (0.34, 0.82, 0.02)], 26)
    radius = 0.02 + 0.0025 * (np.arange(26) % 2)
    parts += [
        tube(hose, radius, dark, 8),
        tube([(0.34, 0.86, 0.0), (0.33, 0.45, 0.16), (0.32, 0.05, 0.32)], 0.016, grey, 10),
        soft_box((0.18, 0, 0.29), (0.46, 0.05, 0.39), dark, 0.015, 2),
    ]
    return finish(parts, limits, {"style": "canister"})


def ironing_board(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A board with a pointed end on crossed legs; now and then with the iron."""
    cover, metal = skin("cover", patterns.fabric(rng, 0.25, SOFT + VIVID)[0]), paint(rng, METALS[:2] + WHITES, "legs")
    h, half = between(rng, 0.82, 0.9), between(rng, 0.58, 0.66)
    t = np.linspace(0, 1, 12)
    width = 0.18 * np.clip(1 - np.clip((t - 0.6) / 0.4, 0, 1) ** 2.2, 0.12, 1)
    x = -half + 2 * half * t
    rows = []
    for edge, y in ((0.9, -0.028), (1.0, -0.02), (1.0, -0.006), (0.92, 0.0), (0.0, 0.002)):
        loop = np.concatenate(
            [
                np.stack([x, np.full(12, y), width * edge], 1),
                np.stack([x[::-1], np.full(12, y), -width[::-1] * edge], 1),
                [[x[0], y, width[0] * edge]],
            ]
        )
        rows.append(loop)
    bottom = [rows[0] * [1, 1, 0], rows[0]]
    parts = [placed(grid(np.stack([*bottom, *rows[1:]]), cover), (0, h, 0))]
    for s in (-1, 1):
        parts.append(
            tube(
                [(-s * half * 0.75, 0.015, 0.14 * s), (0, h / 2, 0.05 * s), (s * half * 0.6, h - 0.03, 0.05 * s)],
                0.011,
                metal,
                8,
            )
        )
        parts.append(tube([(-s * half * 0.75, 0.012, -0.17), (-s * half * 0.75, 0.012, 0.17)], 0.012, metal, 8))
    if chance(rng, 0.5):
        sole, shell = paint(rng, METALS[:1], "sole"), paint(rng, VIVID + WHITES, "iron")
        iron = [
            soft_box((-0.12, 0, -0.055), (0.1, 0.012, 0.055), sole, 0.005),
            ellipsoid((-0.01, 0.035, 0), (0.12, 0.035, 0.052), shell, 16, 8, 0.7),
            tube(spline([(0.06, 0.05, 0), (0.05, 0.1, 0), (-0.06, 0.105, 0), (-0.1, 0.05, 0)], 10), 0.012, shell, 8),
        ]
        parts += [placed(p, (-half * 0.55, h + 0.003, 0)) for p in iron]
    return finish(parts, limits, {"material": "metal"})


GENERATORS: dict[str, Generator] = {
    "wastebasket": wastebasket,
    "trash can": trash_can,
    "laundry basket": laundry_basket,
    "broom": broom,
    "vacuum cleaner": vacuum_cleaner,
    "ironing board": ironing_board,
}
