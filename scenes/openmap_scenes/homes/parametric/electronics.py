"""Remote controls, telephones, consoles, loudspeakers, radios, printers."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns, scenery
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    DEVICE,
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
from openmap_scenes.homes.parametric.slabs import lying, slab
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import Array, ellipsoid, lathe, placed, soft_box, spline, tube, turn
from openmap_scenes.scene import Material

CASES = WOODS[:2]


def remote_control(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A remote control with rows of buttons."""
    w, h, t = between(rng, 0.038, 0.052), between(rng, 0.14, 0.21), 0.018
    body = paint(rng, DARK + DEVICE, "plastic")
    parts = [soft_box((-w / 2, 0, -h / 2), (w / 2, t, h / 2), body, 0.006, 2)]
    pale = paint(rng, ((0.80, 0.80, 0.80), (0.45, 0.46, 0.48)), "button")
    for row in range(6):
        for column in (-1, 0, 1):
            mat = solid("red button", (0.75, 0.12, 0.12)) if row == 0 and column < 0 else pale
            parts.append(
                placed(
                    ellipsoid((0, 0, 0), (0.0055, 0.003, 0.0045), mat, 8, 4),
                    (column * w * 0.28, t, (row / 6 - 0.42) * h),
                )
            )
    parts.append(
        placed(lathe([(0.008, -0.002), (0.013, 0.002), (0.008, 0.003), (0, 0.003)], pale, 14), (0, t - 0.001, h * 0.32))
    )
    return finish(parts, limits, {"material": "plastic"})


def phone(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A mobile phone lying, or a desk telephone with its handset."""
    if chance(rng, 0.5):
        lid = slab(
            0.073, 0.15, 0.009, paint(rng, DEVICE + VIVID, "shell"), skin("screen", scenery.screen(rng)), 0.0035, 0.004
        )
        return finish(lying(lid, 0.15, 0.009), limits, {"style": "mobile"})
    body = paint(rng, DARK + WHITES + VIVID[:2] + SOFT[:2], "plastic")
    parts = [placed(soft_box((-0.1, 0, -0.1), (0.1, 0.045, 0.1), body, 0.015, 2), (0, 0.002, 0), turn(0, 0.12))]
    for row in range(4):
        for column in range(3):
            parts.append(
                soft_box(
                    (column * 0.024 - 0.005, 0.04, row * 0.022 - 0.035),
                    (column * 0.024 + 0.012, 0.052 - row * 0.003, row * 0.022 - 0.02),
                    solid("key", (0.85, 0.85, 0.83)),
                    0.003,
                )
            )
    bar = spline([(-0.065, 0.062, 0.085), (-0.065, 0.082, 0.04), (-0.065, 0.085, -0.03), (-0.065, 0.07, -0.08)], 9)
    parts += [
        tube(bar, 0.014, body, 10),
        ellipsoid((-0.065, 0.06, 0.085), (0.028, 0.02, 0.026), body, 14, 8),
        ellipsoid((-0.065, 0.065, -0.085), (0.028, 0.02, 0.026), body, 14, 8),
    ]
    return finish(parts, limits, {"style": "desk"})


def game_console(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A console lying or standing with a controller before it."""
    body, accent = paint(rng, DARK + WHITES, "plastic"), paint(rng, VIVID + DARK, "accent")
    w, h, d = between(rng, 0.26, 0.32), between(rng, 0.045, 0.07), between(rng, 0.2, 0.27)
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), body, 0.012, 2),
        box((-w / 2 + 0.02, h * 0.45, 0), (w / 2 - 0.02, h * 0.55, d / 2 + 0.0015), accent),
    ]
    pad = [ellipsoid((0, 0.022, 0), (0.05, 0.018, 0.03), body, 18, 8, 0.7, 0.7)]
    for side in (-1, 1):
        pad += [
            placed(
                ellipsoid((0, 0, 0), (0.018, 0.016, 0.045), body, 12, 8),
                (side * 0.055, 0.018, 0.022),
                turn(1, side * 0.35),
            ),
            ellipsoid((side * 0.025, 0.042, 0.014), (0.009, 0.005, 0.009), accent, 10, 5),
            ellipsoid((side * 0.052, 0.036, -0.008), (0.006, 0.004, 0.006), accent, 8, 4),
        ]
    aside, R = between(rng, -0.06, 0.06), turn(1, between(rng, -0.4, 0.4))
    parts += [placed(p, (aside, 0, d / 2 + 0.08), R) for p in pad]
    return finish(parts, limits, {"material": "plastic"})


def _cone(at: Array, r: float, rim: Material) -> list[Model]:
    """A loudspeaker's cone that looks along +z."""
    dark = solid("cone", (0.12, 0.12, 0.13))
    parts = [
        lathe([(r * 1.12, -0.004), (r * 1.12, 0.004), (r, 0.005), (r * 0.9, 0.002)], rim, 22),
        lathe([(r * 0.92, 0.002), (r * 0.8, 0.004), (r * 0.35, 0.0012), (r * 0.25, 0.004), (0, 0.007)], dark, 22),
    ]
    return [placed(p, at, turn(0, np.pi / 2)) for p in parts]


def speaker(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A shelf speaker, a tower, or a round wireless one."""
    style = pick(rng, "shelf", "tower", "round")
    wood = skin("wood", patterns.wood(rng)) if chance(rng, 0.5) else paint(rng, DARK + WHITES, "case")
    if style == "round":
        r, h = between(rng, 0.045, 0.075), between(rng, 0.1, 0.2)
        mesh = skin("mesh", patterns.dots(rng, tone(rng, SOFT + DARK), (0.2, 0.2, 0.22), 24))
        profile = [(0, 0), (r * 0.9, 0), (r, 0.01), (r, h - 0.012), (r * 0.9, h)]
        return finish(
            [
                lathe(profile, mesh, 24),
                lathe([(r * 0.9, h), (r * 0.7, h + 0.004), (0, h + 0.003)], paint(rng, DARK, "top"), 24),
            ],
            limits,
            {"shape": "round"},
        )
    w, h, d = (
        (0.18, between(rng, 0.27, 0.36), 0.22)
        if style == "shelf" or limits.height < 0.8
        else (0.21, between(rng, 0.85, 1.1), 0.28)
    )
    rim = paint(rng, METALS + DARK, "rim")
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), wood, 0.004),
        *_cone(np.array([0, h - 0.2 if h > 0.5 else h * 0.36, d / 2]), w * 0.38, rim),
        *_cone(np.array([0, h - 0.07, d / 2]), 0.025, rim),
    ]
    if h > 0.5:
        parts += _cone(np.array([0, h - 0.38, d / 2]), w * 0.38, rim)
    return finish(parts, limits, {"style": style})


def radio(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A radio with a grille, a dial and knobs; a handle and an aerial."""
    w, h, d = between(rng, 0.22, 0.32), between(rng, 0.13, 0.18), between(rng, 0.07, 0.1)
    case = skin("wood", patterns.wood(rng)) if chance(rng, 0.35) else paint(rng, VIVID + SOFT + CASES, "case")
    metal, z = paint(rng, METALS, "metal"), d / 2
    grille = skin(
        "grille", patterns.stripes(rng, [(0.75, 0.70, 0.60), (0.35, 0.32, 0.28)], 12, bool(chance(rng, 0.5)), 64)
    )
    parts = [soft_box((-w / 2, 0, -z), (w / 2, h, z), case, 0.018, 2)]
    parts += [
        soft_box((-w * 0.43, h * 0.15, z - 0.004), (w * 0.1, h * 0.85, z + 0.002), grille, 0.001),
        soft_box(
            (w * 0.15, h * 0.55, z - 0.004), (w * 0.43, h * 0.82, z + 0.002), solid("dial", (0.92, 0.88, 0.74)), 0.001
        ),
    ]
    for x in (0.21, 0.36):
        parts.append(
            placed(
                lathe([(0.019, 0), (0.017, 0.012), (0, 0.012)], metal, 16),
                (w * x, h * 0.3, z - 0.001),
                turn(0, np.pi / 2),
            )
        )
    if chance(rng, 0.5):
        parts.append(
            tube(
                spline(
                    [
                        (-w * 0.4, h - 0.01, 0),
                        (-w * 0.36, h + 0.035, 0),
                        (w * 0.36, h + 0.035, 0),
                        (w * 0.4, h - 0.01, 0),
                    ],
                    12,
                ),
                0.005,
                metal,
                6,
            )
        )
    parts.append(tube([(w * 0.42, h - 0.01, -z * 0.6), (w * 0.6, h + 0.13, -z * 0.6)], 0.002, metal, 5))
    return finish(parts, limits, {"style": "portable"})


def printer(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A printer with paper in its tray, a lid and a small panel."""
    w, h, d = between(rng, 0.38, 0.46), between(rng, 0.14, 0.24), between(rng, 0.3, 0.38)
    body, dark = paint(rng, DEVICE + WHITES, "plastic"), solid("slot", (0.15, 0.15, 0.16))
    sheets = solid("paper", (0.96, 0.96, 0.95))
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h * 0.75, d / 2), body, 0.015, 2),
        soft_box((-w * 0.49, h * 0.77, -d * 0.49), (w * 0.49, h, d * 0.42), body, 0.012, 2),
    ]
    parts += [
        soft_box((-w * 0.33, h * 0.2, d / 2 - 0.01), (w * 0.33, h * 0.48, d / 2 + 0.0015), dark, 0.001),
        soft_box((-w * 0.3, h * 0.2, d / 2), (w * 0.3, h * 0.24, d / 2 + 0.13), body, 0.003),
        soft_box((-0.105, h * 0.25, d / 2), (0.105, h * 0.27, d / 2 + 0.11), sheets, 0.001),
    ]
    tray = [
        soft_box((-0.13, 0, -0.006), (0.13, 0.16, 0), body, 0.003),
        soft_box((-0.105, 0, 0.001), (0.105, 0.21, 0.008), sheets, 0.001),
    ]
    if chance(rng, 0.6):
        parts += [placed(p, (0, h * 0.7, -d * 0.46), turn(0, -0.3)) for p in tray]
    parts.append(
        soft_box(
            (w * 0.2, h * 0.55, d / 2 - 0.006),
            (w * 0.42, h * 0.7, d / 2 + 0.0015),
            solid("panel", (0.25, 0.40, 0.55)),
            0.001,
        )
    )
    return finish(parts, limits, {"material": "plastic"})


GENERATORS: dict[str, Generator] = {
    "remote control": remote_control,
    "phone": phone,
    "game console": game_console,
    "speaker": speaker,
    "radio": radio,
    "printer": printer,
}
