"""What people wear and carry: backpacks, handbags, suitcases, shoes, umbrellas, hats."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import clothing, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    LEATHERS,
    METALS,
    SOFT,
    VIVID,
    between,
    chance,
    finish,
    paint,
    pick,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.revolve import ellipsoid, grid, lathe, placed, soft_box, spline, tube, turn


def backpack(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A backpack standing: main bag, front pocket, straps behind, a loop on top."""
    cloth = skin("canvas", patterns.fabric(rng, 0.8, SOFT + VIVID)[0])
    trim, strap = paint(rng, LEATHERS + DARK + VIVID, "trim"), paint(rng, DARK + LEATHERS, "strap")
    w, h, d = between(rng, 0.28, 0.33), between(rng, 0.4, 0.47), between(rng, 0.14, 0.18)
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), cloth, 0.06, 3, puff=0.015),
        soft_box(
            (-w * 0.38, 0.03, d / 2 - 0.02),
            (w * 0.38, h * 0.5, d / 2 + 0.055),
            trim if chance(rng, 0.5) else cloth,
            0.03,
            2,
            puff=0.008,
        ),
    ]
    parts.append(
        tube(
            spline(
                [
                    (-0.04, h - 0.008, -d * 0.3),
                    (-0.03, h + 0.035, -d * 0.3),
                    (0.03, h + 0.035, -d * 0.3),
                    (0.04, h - 0.008, -d * 0.3),
                ],
                9,
            ),
            0.006,
            strap,
            6,
        )
    )
    if chance(rng, 0.5):
        parts.append(
            placed(
                soft_box((-w * 0.44, -0.01, -0.01), (w * 0.44, 0.022, d * 0.95), trim, 0.01, 2),
                (0, h - 0.008, -d * 0.4),
                turn(0, 0.12),
            )
        )
        parts += [
            soft_box((x - 0.012, h * 0.45, d / 2 + 0.01), (x + 0.012, h * 0.98, d / 2 + 0.028), strap, 0.004)
            for x in (-w * 0.22, w * 0.22)
        ]
    else:
        arc = [
            (w * 0.46 * np.sin(a), h * 0.66 + h * 0.27 * np.cos(a), d / 2 + 0.004) for a in np.linspace(-1.5, 1.5, 14)
        ]
        parts.append(tube(arc, 0.005, strap, 6))
        parts.append(tube([(-w * 0.33, h * 0.4, d / 2 + 0.058), (w * 0.33, h * 0.4, d / 2 + 0.058)], 0.004, strap, 6))
    for s in (-1, 1):
        belt = spline(
            [
                (s * w * 0.2, h * 0.9, -d / 2),
                (s * w * 0.24, h * 0.78, -d / 2 - 0.045),
                (s * w * 0.3, h * 0.4, -d / 2 - 0.04),
                (s * w * 0.36, 0.06, -d / 2),
            ],
            12,
        )
        parts.append(tube(belt, 0.016, strap, 6))
        parts.append(
            soft_box(
                (s * w / 2 - 0.02 if s > 0 else -w / 2 - 0.03, 0.03, -d * 0.3),
                (s * w / 2 + 0.03 if s > 0 else -w / 2 + 0.02, h * 0.34, d * 0.3),
                trim,
                0.02,
                1,
            )
        )
    return finish(parts, limits, {"material": "canvas"})


def handbag(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A handbag: a tote with two loops, or a flap bag with a clasp."""
    leather, metal = paint(rng, LEATHERS + VIVID + SOFT, "leather"), paint(rng, METALS[:1] + METALS[3:4], "clasp")
    w, h, d = between(rng, 0.26, 0.36), between(rng, 0.19, 0.27), between(rng, 0.09, 0.13)
    rows = []
    for t in np.linspace(0, 1, 7):
        a = np.linspace(0, 2 * np.pi, 25)
        wide, deep = w / 2 * (1 - 0.14 * t), d / 2 * (1 - 0.75 * t**2)
        x, z = (np.sign(f(a)) * np.abs(f(a)) ** 0.55 for f in (np.cos, np.sin))
        row = np.stack([wide * x, np.full(25, h * t), -deep * z], 1)
        row[-1] = row[0]
        rows.append(row)
    bag = np.stack([rows[0] * [0, 1, 0], *rows, rows[-1] * [1, 1, 0]])
    style = pick(rng, "tote", "flap")
    parts = [grid(bag[:2], leather), grid(bag[1:-1], leather), grid(bag[-2:], leather)]
    if style == "tote":
        for s in (-1, 1):
            parts.append(
                tube(
                    spline(
                        [
                            (-w * 0.22, h * 0.82, s * d * 0.2),
                            (-w * 0.2, h * 1.35, s * 0.012),
                            (0, h * 1.62, s * 0.02),
                            (w * 0.2, h * 1.35, s * 0.012),
                            (w * 0.22, h * 0.82, s * d * 0.2),
                        ],
                        16,
                    ),
                    0.006,
                    leather,
                    6,
                )
            )
            parts += [
                ellipsoid((x, h * 0.8, s * d * 0.29), (0.012, 0.016, 0.008), metal, 10, 6)
                for x in (-w * 0.22, w * 0.22)
            ]
    else:
        flap = soft_box(
            (-w * 0.43, h * 0.4, d * 0.02),
            (w * 0.43, h * 1.03, d * 0.5 + 0.012),
            paint(rng, LEATHERS + SOFT, "flap") if chance(rng, 0.4) else leather,
            0.03,
            2,
        )
        parts += [flap, ellipsoid((0, h * 0.47, d * 0.5 + 0.012), (0.018, 0.014, 0.006), metal, 12, 6)]
        parts.append(
            tube(
                spline(
                    [
                        (-w * 0.43, h * 0.9, 0),
                        (-w * 0.3, h * 1.5, 0),
                        (0, h * 1.75, 0),
                        (w * 0.3, h * 1.5, 0),
                        (w * 0.43, h * 0.9, 0),
                    ],
                    16,
                ),
                0.006,
                metal if chance(rng, 0.3) else leather,
                6,
            )
        )
    return finish(parts, limits, {"material": "leather", "style": style})


def suitcase(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A trolley case standing with its pull-out bar, or an old case with belts, standing on its side."""
    shell = paint(rng, VIVID + DARK + SOFT, "shell")
    w, h, d = between(rng, 0.36, 0.48), between(rng, 0.52, 0.68), between(rng, 0.22, 0.28)
    dark = solid("black plastic", (0.1, 0.1, 0.11))
    if chance(rng, 0.65):
        ribs = (
            skin(
                "ribs",
                patterns.stripes(
                    rng, [a := tuple(shell.colour.tolist()), a, (0.82 * a[0], 0.82 * a[1], 0.82 * a[2])], 7, True, 96
                ),
            )
            if chance(rng, 0.6)
            else shell
        )
        parts = [
            soft_box(
                (-w / 2, 0.05, -d / 2),
                (w / 2, 0.05 + h, d / 2),
                {**dict.fromkeys(range(2, 6), shell), 0: ribs, 1: ribs},
                0.045,
                3,
            ),
            soft_box((-w / 2 - 0.002, 0.05 - 0.002, -0.006), (w / 2 + 0.002, 0.052 + h, 0.006), dark, 0.004),
        ]
        parts += [
            placed(
                lathe([(0, -0.012), (0.024, -0.012), (0.026, 0), (0.024, 0.012), (0, 0.012)], dark, 14),
                (x, 0.026, z),
                turn(2, np.pi / 2),
            )
            for x in (-w * 0.38, w * 0.38)
            for z in (-d * 0.32, d * 0.32)
        ]
        parts += [
            soft_box((x - 0.02, 0.028, z - 0.02), (x + 0.02, 0.065, z + 0.02), dark, 0.006)
            for x in (-w * 0.38, w * 0.38)
            for z in (-d * 0.32, d * 0.32)
        ]
        bar, out = paint(rng, METALS, "bar"), between(rng, 0.03, 0.4)
        parts += [tube([(x, h, -d * 0.32), (x, h + 0.05 + out, -d * 0.32)], 0.008, bar, 8) for x in (-w * 0.2, w * 0.2)]
        parts.append(
            soft_box(
                (-w * 0.24, h + 0.04 + out, -d * 0.32 - 0.014),
                (w * 0.24, h + 0.07 + out, -d * 0.32 + 0.014),
                dark,
                0.01,
            )
        )
        parts.append(
            tube(
                spline(
                    [
                        (-0.07, h + 0.045, 0.03),
                        (-0.06, h + 0.075, 0.03),
                        (0.06, h + 0.075, 0.03),
                        (0.07, h + 0.045, 0.03),
                    ],
                    9,
                ),
                0.008,
                dark,
                7,
            )
        )
        return finish(parts, limits, {"style": "trolley", "material": "plastic"}, smallest=0.65)
    leather, metal = (
        skin("leather", patterns.fur(rng, tone(rng, LEATHERS), 64, 0.05)),
        paint(rng, METALS[3:] + METALS[:1], "metal"),
    )
    wide, high = between(rng, 0.5, 0.65), between(rng, 0.36, 0.44)
    d *= 0.75
    parts = [soft_box((-wide / 2, 0, -d / 2), (wide / 2, high, d / 2), leather, 0.02, 2)]
    belt = paint(rng, LEATHERS, "belt")
    parts += [
        soft_box((x - 0.018, -0.003, -d / 2 - 0.003), (x + 0.018, high + 0.003, d / 2 + 0.003), belt, 0.015)
        for x in (-wide * 0.3, wide * 0.3)
    ]
    parts.append(
        tube(
            spline(
                [(-0.07, high - 0.002, 0), (-0.06, high + 0.035, 0), (0.06, high + 0.035, 0), (0.07, high - 0.002, 0)],
                10,
            ),
            0.009,
            belt,
            7,
        )
    )
    parts += [
        soft_box((x - 0.02, high - 0.05, d / 2 - 0.002), (x + 0.02, high - 0.015, d / 2 + 0.006), metal, 0.003)
        for x in (-wide * 0.16, wide * 0.16)
    ]
    parts += [
        ellipsoid((x, y, z), (0.022, 0.022, 0.022), metal, 10, 6, 0.6, 0.6)
        for x in (-wide / 2 + 0.015, wide / 2 - 0.015)
        for y in (0.021, high - 0.015)
        for z in (-d / 2 + 0.015, d / 2 - 0.015)
    ]
    return finish(parts, limits, {"style": "old", "material": "leather"}, smallest=0.65)


GENERATORS: dict[str, Generator] = {
    "backpack": backpack,
    "handbag": handbag,
    "suitcase": suitcase,
    **clothing.GENERATORS,
}
