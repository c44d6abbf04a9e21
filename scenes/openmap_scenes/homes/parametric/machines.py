"""Small machines of a kitchen: toasters, coffee makers, blenders."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    DARK,
    DEVICE,
    GLASSES,
    METALS,
    VIVID,
    WHITES,
    between,
    chance,
    finish,
    paint,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.revolve import lathe, placed, soft_box, spline, tube, turn, vessel

BLACK = solid("black plastic", (0.10, 0.10, 0.11))


def toaster(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A toaster with two or four slots, now and then with toast."""
    w, h, d = between(rng, 0.26, 0.34), between(rng, 0.17, 0.2), between(rng, 0.16, 0.2)
    body, dark = paint(rng, METALS[:2] + VIVID + DARK + WHITES, "toaster"), BLACK
    parts = [
        soft_box((-w / 2, 0.012, -d / 2), (w / 2, h, d / 2), body, 0.035, 3),
        soft_box((-w * 0.48, 0, -d * 0.46), (w * 0.48, 0.02, d * 0.46), dark, 0.006),
    ]
    toast = solid("toast", (0.72, 0.48, 0.24)) if chance(rng, 0.35) else None
    for z in (-d * 0.2, d * 0.2):
        parts.append(soft_box((-w * 0.36, h - 0.006, z - 0.014), (w * 0.36, h + 0.0012, z + 0.014), dark, 0.001))
        if toast is not None:
            parts.append(soft_box((-w * 0.26, h - 0.03, z - 0.007), (w * 0.26, h + 0.045, z + 0.007), toast, 0.006))
    parts += [
        soft_box((w / 2 - 0.004, h * 0.62, -0.025), (w / 2 + 0.022, h * 0.7, 0.025), dark, 0.005),
        placed(
            lathe([(0.016, -0.002), (0.014, 0.012), (0, 0.012)], dark, 14),
            (w / 2 - 0.001, h * 0.3, 0),
            turn(2, -np.pi / 2),
        ),
    ]
    return finish(parts, limits, {"material": "metal"})


def coffee_maker(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A filter machine with its glass jug, or an espresso machine with a cup."""
    body, metal = paint(rng, DARK + DEVICE + VIVID[:1], "plastic"), paint(rng, METALS[:2], "metal")
    w, d, h = between(rng, 0.17, 0.22), between(rng, 0.2, 0.26), between(rng, 0.3, 0.36)
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, 0.035, d / 2), body, 0.01, 2),
        soft_box((-w / 2, 0.02, -d / 2), (w / 2, h, -d * 0.12), body, 0.015, 2),
        soft_box((-w / 2, h * 0.7, -d / 2), (w / 2, h, d * 0.38), body, 0.02, 2),
    ]
    z = d * 0.16
    if chance(rng, 0.6):
        r, tall = w * 0.38, h * 0.44
        belly = spline([(r * 0.85, 0), (r, tall * 0.4), (r * 0.7, tall * 0.9), (r * 0.72, tall)], 9)
        coffee = skin("jug", patterns.band((0.78, 0.83, 0.84), (0.16, 0.08, 0.04), 0.0, between(rng, 0.3, 0.7)))
        jug = [
            lathe(np.concatenate([[[0, 0]], belly, [[0, tall]]]), coffee, 20),
            lathe([(r * 0.74, tall), (r * 0.7, tall + 0.014), (0, tall + 0.016)], body, 20),
        ]
        jug.append(
            tube(
                spline(
                    [(0, tall, r * 0.6), (0, tall, r + 0.03), (0, tall * 0.5, r + 0.04), (0, tall * 0.3, r + 0.01)], 9
                ),
                0.008,
                body,
                7,
            )
        )
        R = turn(1, between(rng, -0.5, 0.5))
        parts += [placed(p, (0, 0.036, z), R) for p in jug]
        return finish(parts, limits, {"style": "filter"})
    parts += [lathe([(0, h * 0.58), (0.03, h * 0.58), (0.032, h * 0.7), (0, h * 0.7)], metal, 18)]
    parts = [
        *parts[:3],
        placed(parts[3], (0, 0, z)),
        tube([(0, h * 0.62, z + 0.02), (0, h * 0.61, z + 0.13)], 0.011, BLACK, 8),
        soft_box((-w * 0.4, 0.03, -d * 0.1), (w * 0.4, 0.042, d * 0.46), metal, 0.003),
    ]
    cup = paint(rng, CERAMIC, "cup")
    parts.append(placed(vessel([(0.022, 0), (0.031, 0.03), (0.033, 0.055)], 0.003, cup, cup, 18), (0, 0.043, z)))
    parts.append(
        tube(
            spline([(w * 0.36, h * 0.7, z), (w * 0.42, h * 0.5, z + 0.02), (w * 0.42, h * 0.3, z + 0.03)], 6),
            0.005,
            metal,
            6,
        )
    )
    return finish(parts, limits, {"style": "espresso"})


def blender(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A blender: a motor with a knob below a tall glass jug."""
    body, r = paint(rng, DARK + VIVID[:2] + METALS[:2] + WHITES, "motor"), between(rng, 0.07, 0.085)
    base = lathe([(0, 0), (r * 1.15, 0), (r * 1.15, 0.02), (r * 0.95, 0.09), (r * 0.75, 0.12), (0, 0.12)], body, 22)
    h = between(rng, 0.2, 0.25)
    drink = tone(rng, ((0.85, 0.30, 0.40), (0.60, 0.75, 0.30), (0.95, 0.85, 0.60)))
    glass = (
        skin("jug", patterns.band(tone(rng, GLASSES), drink, 0.05, between(rng, 0.4, 0.7)))
        if chance(rng, 0.5)
        else paint(rng, GLASSES, "glass")
    )
    jug = lathe([(0, 0.12), (r * 0.7, 0.12), (r * 0.95, 0.12 + h), (0, 0.121 + h)], glass, 22)
    lid = lathe(
        [(r * 0.97, 0.118 + h), (r * 0.97, 0.135 + h), (r * 0.5, 0.137 + h), (r * 0.45, 0.155 + h), (0, 0.155 + h)],
        BLACK,
        20,
    )
    grip = tube(
        spline([(-r * 0.92, 0.1 + h, 0), (-r * 1.5, 0.1 + h, 0), (-r * 1.45, 0.15, 0), (-r * 0.75, 0.15, 0)], 12),
        0.009,
        BLACK,
        7,
    )
    knob = placed(
        lathe([(0.02, -0.008), (0.018, 0.014), (0, 0.014)], paint(rng, METALS, "knob"), 14),
        (0, 0.05, r * 1.08),
        turn(0, np.pi / 2),
    )
    return finish([base, jug, lid, grip, knob], limits, {"material": "glass"})


GENERATORS: dict[str, Generator] = {
    "toaster": toaster,
    "coffee maker": coffee_maker,
    "blender": blender,
}
