"""What stands on a kitchen's counter: kettles, pots, pans, boards, blocks of knives, small machines."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import machines, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.machines import BLACK
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
)
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, soft_box, spline, tube, turn, vessel


def kettle(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An electric jug on its base, or a whistling kettle with a bail."""
    body, dark = paint(rng, METALS[:2] + VIVID + WHITES + DARK, "kettle"), BLACK
    if chance(rng, 0.55):
        r, h = between(rng, 0.068, 0.08), between(rng, 0.18, 0.22)
        parts = [lathe([(0, 0), (r * 1.1, 0), (r * 1.1, 0.016), (r, 0.02), (0, 0.02)], dark, 22)]
        parts.append(
            lathe(
                [(0, 0.022), (r, 0.022), *spline([(r, 0.03), (r * 0.95, h * 0.5), (r * 0.72, h)], 6), (0, h + 0.004)],
                body,
                24,
            )
        )
        parts.append(
            lathe(
                [(r * 0.6, h), (r * 0.55, h + 0.012), (0.012, h + 0.016), (0.012, h + 0.03), (0, h + 0.032)], dark, 18
            )
        )
        spout = [(0.0, 0, 0), (0.03, 0.035, 0), (0.045, 0.05, 0)]
        parts.append(placed(tube(spout, [0.026, 0.02, 0.016], body, 8), (r * 0.6, h - 0.055, 0)))
        grip = spline(
            [
                (-r * 0.7, h + 0.005, 0),
                (-r * 1.35, h, 0),
                (-r * 1.6, h * 0.6, 0),
                (-r * 1.3, h * 0.25, 0),
                (-r * 0.97, h * 0.2, 0),
            ],
            12,
        )
        parts.append(tube(grip, 0.0105, dark, 8))
        return finish(parts, limits, {"style": "electric", "material": "metal"})
    r, h = between(rng, 0.09, 0.11), between(rng, 0.12, 0.15)
    outline = spline([(r * 0.95, 0), (r, 0.02), (r * 0.9, h * 0.6), (r * 0.45, h)], 9)
    parts = [
        lathe(np.concatenate([[[0, 0]], outline, [[0, h + 0.004]]]), body, 24),
        lathe([(r * 0.4, h), (r * 0.36, h + 0.012), (0.01, h + 0.016), (0.014, h + 0.032), (0, h + 0.036)], dark, 16),
    ]
    parts.append(
        tube(
            spline([(r * 0.75, h * 0.45, 0), (r * 1.2, h * 0.75, 0), (r * 1.4, h * 1.05, 0)], 7),
            np.linspace(0.02, 0.012, 7),
            body,
            8,
        )
    )
    parts.append(
        tube(
            spline(
                [
                    (-r * 0.62, h * 0.8, 0),
                    (-r * 0.6, h * 1.5, 0),
                    (0, h * 1.8, 0),
                    (r * 0.6, h * 1.5, 0),
                    (r * 0.62, h * 0.8, 0),
                ],
                16,
            ),
            0.007,
            dark,
            7,
        )
    )
    return finish(parts, limits, {"style": "stovetop", "material": "metal"})


def pot(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cooking pot with two grips, mostly under its lid."""
    r, h = between(rng, 0.09, 0.14), between(rng, 0.09, 0.17)
    body, grip = (
        paint(rng, (*METALS[:2], *METALS[:2], *VIVID[:4], *DARK[:1]), "pot"),
        BLACK if chance(rng, 0.5) else paint(rng, METALS, "grip"),
    )
    wall = [(r * 0.94, 0), (r, 0.012), (r, h * 0.5), (r, h), (r + 0.004, h + 0.003)]
    if chance(rng, 0.7):
        parts = [lathe([(0, 0), *wall, (0, h + 0.004)], body, 28)]
        lid = paint(rng, GLASSES, "glass lid") if chance(rng, 0.3) else body
        dome = [(r + 0.003, h + 0.003), (r * 0.9, h + 0.016), (r * 0.5, h + 0.028), (0, h + 0.032)]
        parts += [
            lathe(dome, lid, 28),
            lathe(
                [(0.008, h + 0.028), (0.008, h + 0.04), (0.02, h + 0.048), (0.016, h + 0.056), (0, h + 0.058)], grip, 14
            ),
        ]
    else:
        parts = [vessel(wall, 0.004, body, solid("inside", (0.62, 0.62, 0.63)), 28)]
    for s in (-1, 1):
        ear = spline(
            [
                (s * (r - 0.004), h * 0.78, -0.035),
                (s * (r + 0.035), h * 0.8, -0.022),
                (s * (r + 0.035), h * 0.8, 0.022),
                (s * (r - 0.004), h * 0.78, 0.035),
            ],
            9,
        )
        parts.append(tube(ear, 0.006, grip, 7))
    return finish(parts, limits, {"material": "metal"})


def pan(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A frying pan or a saucepan with its long handle."""
    low = chance(rng, 0.6)
    r, h = (between(rng, 0.11, 0.15), 0.045) if low else (between(rng, 0.08, 0.1), 0.09)
    body, inside = paint(rng, DARK + METALS + VIVID[:2], "pan"), paint(rng, DARK + METALS[:2], "coating")
    grip = BLACK if chance(rng, 0.6) else skin("wood", patterns.wood(rng))
    parts = [vessel([(r * (0.8 if low else 0.97), 0), (r * 0.95, h * 0.5), (r, h)], 0.004, body, inside, 30)]
    bar = spline(
        [(r - 0.005, h * 0.8, 0), (r + 0.06, h * 0.95, 0), (r + 0.13, h + 0.02, 0), (r + 0.2, h + 0.03, 0)], 10
    )
    parts.append(
        placed(
            tube(bar, [0.006, 0.006, 0.007, 0.009, 0.01, 0.011, 0.011, 0.012, 0.011, 0.006], grip, 8),
            scale=(1, 1, 1.25),
        )
    )
    return finish(parts, limits, {"material": "metal"})


def cutting_board(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A board lying, of wood or plastic, with a knife or some bread on it at times; round or oblong, with a handle or not."""
    wood = chance(rng, 0.8)
    mat = skin("wood", patterns.wood(rng)) if wood else paint(rng, VIVID + WHITES, "plastic")
    w, d, t = between(rng, 0.28, 0.42), between(rng, 0.18, 0.28), between(rng, 0.012, 0.03)
    shape = pick(rng, "rectangular", "rectangular", "round", "handled")
    if shape == "round":
        parts = [lathe([(0, 0), (w * 0.42, 0), (w * 0.43, t * 0.5), (w * 0.42, t), (0, t)], mat, 32)]
    else:
        parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, t, d / 2), mat, 0.006)]
    if shape == "handled":
        parts.append(soft_box((w / 2 - 0.01, 0, -0.025), (w / 2 + 0.1, t, 0.025), mat, 0.01))
    if chance(rng, 0.45):
        steel, R = paint(rng, METALS[:1], "blade"), turn(1, between(rng, -0.6, 0.6))
        knife = [
            soft_box((-0.15, t, -0.014), (0.03, t + 0.002, 0.014), steel, 0.0009),
            soft_box((0.025, t, -0.011), (0.13, t + 0.016, 0.011), BLACK, 0.006),
        ]
        parts += [placed(p, (0, 0, 0.04), R) for p in knife]
    return finish(parts, limits, {"material": "wood" if wood else "plastic", "shape": shape})


def knife_block(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A slanting block with the handles of its knives."""
    mat = skin("wood", patterns.wood(rng)) if chance(rng, 0.7) else paint(rng, DARK + METALS, "block")
    w, h, d = between(rng, 0.1, 0.13), between(rng, 0.2, 0.24), between(rng, 0.09, 0.12)
    lean = turn(0, 0.38)
    top = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), mat, 0.004)]
    grip = BLACK if chance(rng, 0.6) else paint(rng, WOODS + METALS, "handle")
    for row in range(2):
        for k in range(3):
            x, z = w * 0.28 * (k - 1), d * (0.22 if row == 0 else -0.22)
            long = between(rng, 0.085, 0.12)
            top.append(soft_box((x - 0.008, h - 0.004, z - 0.013), (x + 0.008, h + long, z + 0.013), grip, 0.006))
    parts = [placed(p, (0, 0.0, -0.04), lean) for p in top]
    parts.append(soft_box((-w / 2, -0.035, -0.09), (w / 2, 0.03, 0.1), mat, 0.004))
    return finish(parts, limits, {"material": "wood"})


def utensil_holder(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A crock with spoons, a whisk, a turner."""
    r, h = between(rng, 0.05, 0.065), between(rng, 0.13, 0.17)
    mat = paint(rng, CERAMIC + METALS, "crock")
    parts = [vessel([(r * 0.96, 0), (r, 0.01), (r, h * 0.6), (r * 1.02, h)], 0.005, mat, mat, 22)]
    for k in range(int(rng.integers(4, 7))):
        a = 1.15 * k + between(rng, 0, 0.4)
        out = np.array([np.cos(a), 0, np.sin(a)])
        low, high = -out * r * 0.4 + [0, 0.012, 0], out * r * 1.15 + [0, h * between(rng, 1.55, 1.9), 0]
        tool = paint(rng, WOODS + METALS[:2] + DARK, "utensil")
        parts.append(tube(np.stack([low, high]), 0.005, tool, 6))
        face = turn(1, -a + np.pi / 2)
        kind = k % 3
        if kind == 0:
            parts.append(placed(ellipsoid((0, 0.02, 0), (0.024, 0.034, 0.007), tool, 12, 8), high, face))
        elif kind == 1:
            parts.append(placed(soft_box((-0.026, -0.01, -0.002), (0.026, 0.06, 0.002), tool, 0.0015), high, face))
        else:
            for turned in (0.0, np.pi / 3, 2 * np.pi / 3):
                loop = spline(
                    [
                        (0, -0.03, 0),
                        (0.024, 0.02, 0),
                        (0.018, 0.06, 0),
                        (-0.018, 0.06, 0),
                        (-0.024, 0.02, 0),
                        (0, -0.03, 0),
                    ],
                    14,
                )
                parts.append(placed(tube(loop, 0.0016, tool, 4), high, turn(1, turned)))
    return finish(parts, limits, {"material": "ceramic"})


def tray(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tray with a rim and grips: oblong or round."""
    mat = pick(rng, "wood", "metal", "plastic")
    ground = {
        "wood": lambda: skin("wood", patterns.wood(rng)),
        "metal": lambda: paint(rng, METALS, "metal"),
        "plastic": lambda: skin("tray", patterns.fabric(rng, 0.4, SOFT + VIVID)[0]),
    }[mat]()
    rim = paint(rng, WOODS, "rim") if mat == "wood" else ground
    w, d = between(rng, 0.34, 0.5), between(rng, 0.25, 0.34)
    if chance(rng, 0.35):
        r = w * 0.42
        return finish(
            [
                lathe([(0, 0), (r * 0.95, 0), (r, 0.025), (r - 0.005, 0.025), (r * 0.93, 0.006)], rim, 32),
                lathe([(r * 0.935, 0.006), (r * 0.4, 0.006), (0, 0.006)], ground, 32),
            ],
            limits,
            {"material": mat, "shape": "round"},
        )
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, 0.01, d / 2), ground, 0.003)]
    for s in (-1, 1):
        parts += [
            soft_box((-w / 2, 0.002, s * d / 2 - 0.006), (w / 2, 0.04, s * d / 2 + 0.006), rim, 0.003),
            soft_box((s * w / 2 - 0.006, 0.002, -d / 2), (s * w / 2 + 0.006, 0.04, d / 2), rim, 0.003),
        ]
        bow = spline(
            [
                (s * w / 2, 0.035, -0.06),
                (s * (w / 2 + 0.005), 0.065, -0.04),
                (s * (w / 2 + 0.005), 0.065, 0.04),
                (s * w / 2, 0.035, 0.06),
            ],
            8,
        )
        parts.append(tube(bow, 0.006, rim, 6))
    return finish(parts, limits, {"material": mat, "shape": "rectangular"})


def paper_towels(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A roll of kitchen paper upright on its stand."""
    r, h, metal, paper = (
        between(rng, 0.05, 0.065),
        0.24,
        paint(rng, METALS + WOODS, "stand"),
        paint(rng, WHITES, "paper"),
    )
    image = patterns.dots(rng, (0.95, 0.95, 0.93), (0.86, 0.88, 0.90), 14)
    roll = lathe(
        [(0.02, 0.016), (r, 0.016), (r, h), (0.02, h), (0.02, 0.016)],
        skin("paper", image) if chance(rng, 0.5) else paper,
        26,
    )
    pole = lathe(
        [
            (0, 0),
            (0.078, 0),
            (0.08, 0.006),
            (0.078, 0.012),
            (0.008, 0.014),
            (0.008, h + 0.04),
            (0.014, h + 0.05),
            (0.012, h + 0.062),
            (0, h + 0.066),
        ],
        metal,
        22,
    )
    flap = soft_box((r - 0.0015, 0.018, 0), (r, h - 0.002, 0.05), paper, 0.0006)
    return finish([roll, pole, flap], limits, {"material": "paper"})


def soap_dispenser(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bottle with a pump: round, square or bulging."""
    r, h = between(rng, 0.028, 0.038), between(rng, 0.1, 0.14)
    mat, pump = paint(rng, CERAMIC + GLASSES + VIVID, "dispenser"), paint(rng, METALS[:3] + WHITES, "pump")
    shape = pick(rng, "round", "square", "bulging")
    if shape == "square":
        parts = [soft_box((-r, 0, -r), (r, h, r), mat, 0.008, 2)]
    else:
        belly = (
            [(r, 0), (r, h * 0.6), (r * 0.9, h * 0.85), (0.015, h)]
            if shape == "round"
            else [(r * 0.8, 0), (r * 1.15, h * 0.35), (r * 0.8, h * 0.8), (0.015, h)]
        )
        parts = [lathe(np.concatenate([[[0, 0]], spline(belly, 12), [[0, h]]]), mat, 22)]
    parts += [
        lathe(
            [(0.014, h - 0.002), (0.014, h + 0.014), (0.005, h + 0.016), (0.005, h + 0.036), (0, h + 0.036)], pump, 14
        )
    ]
    parts.append(
        tube(
            spline([(0, h + 0.036, -0.008), (0, h + 0.041, 0.014), (0, h + 0.039, 0.036), (0, h + 0.028, 0.042)], 8),
            0.0055,
            pump,
            8,
        )
    )
    return finish(parts, limits, {"material": "ceramic", "shape": shape})


GENERATORS: dict[str, Generator] = {
    "kettle": kettle,
    "pot": pot,
    "pan": pan,
    "cutting board": cutting_board,
    "knife block": knife_block,
    "utensil holder": utensil_holder,
    "tray": tray,
    "paper towels": paper_towels,
    "soap dispenser": soap_dispenser,
    **machines.GENERATORS,
}
