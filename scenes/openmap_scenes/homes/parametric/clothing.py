"""Shoes, hats and umbrellas."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    LEATHERS,
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
from openmap_scenes.homes.revolve import Array, ellipsoid, grid, lathe, placed, spline, tube, turn
from openmap_scenes.scene import Material


def _shoe(style: str, upper: Material, sole: Material, lace: Material, lining: Material) -> list[Model]:
    """A left shoe, toe towards +z, 28 cm long, around x = 0."""
    t = np.linspace(0, 1, 13)
    z = -0.14 + 0.28 * t
    half = (
        0.036 + 0.012 * np.sin(np.pi * np.clip((t - 0.25) / 0.75, 0, 1)) - 0.018 * np.clip((t - 0.9) / 0.1, 0, 1) ** 2
    )
    half[0] *= 0.55
    high = {"sneaker": 0.085, "boot": 0.2, "loafer": 0.07}[style]
    top = (
        0.055
        + (high - 0.055) * np.clip(1 - np.clip((t - 0.32) / 0.2, 0, 1), 0, 1)
        - 0.02 * np.clip((t - 0.55) / 0.45, 0, 1) ** 1.5
    )
    phi = np.linspace(0, np.pi, 11)
    x = half[:, None] * np.sign(np.cos(phi)) * np.abs(np.cos(phi)) ** 0.65
    y = 0.012 + (top - 0.012)[:, None] * np.sin(phi) ** 0.6
    shell = np.stack([x, y, np.repeat(z[:, None], 11, 1)], 2)
    shell = np.concatenate([shell[:1] * [0, 1, 1], shell, shell[-1:] * [0, 1, 1]])
    shell[0, :, 1] = shell[-1, :, 1] = 0.02
    outline = np.stack([half + 0.004, z], 1)
    loop = np.concatenate([outline, outline[::-1] * [-1, 1], outline[:1]])
    level = [0.0, 0.006, 0.022, 0.026]
    scale = [0.97, 1.0, 1.0, 0.94]
    rows = [
        np.stack([loop[:, 0] * s, np.full(len(loop), h), loop[:, 1] * s], 1) for s, h in zip(scale, level, strict=True)
    ]
    rows = [rows[0] * [0.0, 1, 1], *rows, rows[-1] * [0.0, 1, 1]]
    parts = [grid(shell, upper), grid(np.stack(rows)[:, ::-1] if _inward(rows) else np.stack(rows), sole)]
    parts.append(placed(ellipsoid((0, 0, 0), (0.03, 0.006, 0.048), lining, 14, 5), (0, high - 0.001, -0.075)))
    if style != "loafer":
        for k in range(4):
            zz, yy = -0.005 + 0.024 * k, 0.078 - 0.007 * k if style == "sneaker" else 0.088 - 0.01 * k
            parts.append(tube([(-0.022, yy - 0.008, zz), (0, yy, zz), (0.022, yy - 0.008, zz)], 0.003, lace, 5))
    return parts


def _inward(rows: list[Array]) -> bool:
    """Whether loops stacked upwards run clockwise as seen from above, so that their surface would face inwards."""
    x, z = rows[2][:-1, 0], rows[2][:-1, 2]
    return bool(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z) > 0)


def shoes(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A pair of sneakers, boots or loafers side by side, a little askew."""
    style = pick(rng, "sneaker", "sneaker", "boot", "loafer")
    upper = paint(rng, VIVID + WHITES + DARK + SOFT if style == "sneaker" else LEATHERS, "upper")
    sole, lace = (
        paint(rng, WHITES + DARK[:1], "sole") if style == "sneaker" else solid("sole", (0.14, 0.10, 0.08)),
        paint(rng, WHITES + DARK, "lace"),
    )
    left = _shoe(style, upper, sole, lace, solid("lining", (0.16, 0.14, 0.13)))
    size, parts = between(rng, 0.75, 1.05), []
    for s in (-1, 1):
        R, ahead = turn(1, s * between(rng, 0.0, 0.15)), between(rng, -0.02, 0.02)
        parts += [placed(p, (s * 0.062 * size, 0, ahead), R, size) for p in left]
    return finish(parts, limits, {"style": style + "s", "material": "fabric" if style == "sneaker" else "leather"})


def umbrella(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A closed umbrella standing in a stand, or two of them."""
    cloth = skin(
        "cloth",
        patterns.stripes(rng, [a := tone(rng, VIVID + DARK), (0.75 * a[0], 0.75 * a[1], 0.75 * a[2])], 8, True, 64),
    )
    wood, metal = paint(rng, WOODS + DARK, "handle"), paint(rng, METALS, "metal")
    furl = spline([(0.006, 0.06), (0.02, 0.2), (0.034, 0.5), (0.026, 0.62), (0.01, 0.66)], 14)
    one = [
        lathe(np.concatenate([[[0, 0.05]], furl, [[0, 0.665]]]), cloth, 14),
        tube([(0, 0, 0), (0, 0.06, 0)], [0.002, 0.005], metal, 6),
        tube([(0, 0.6, 0), (0, 0.76, 0)], 0.005, metal, 6),
    ]
    one.append(
        tube(
            spline([(0, 0.75, 0), (0, 0.86, 0), (0.025, 0.9, 0), (0.06, 0.88, 0), (0.065, 0.83, 0)], 14),
            0.0105,
            wood,
            8,
        )
    )
    stand = chance(rng, 0.7)
    if not stand:
        return finish(one, limits, {"state": "closed"})
    r, h = between(rng, 0.1, 0.13), between(rng, 0.42, 0.52)
    mat = paint(rng, METALS + SOFT + DARK, "stand")
    shell = [(0, 0), (r, 0), (r, h * 0.5), (r, h), (r - 0.005, h), (r - 0.005, h * 0.4), (r - 0.005, 0.01), (0, 0.01)]
    parts = [lathe(shell, mat, 24)]
    for k in range(int(rng.integers(1, 3))):
        lean = turn(1, 2.6 * k + between(rng, 0, 6)) @ turn(2, -0.13)
        parts += [placed(p, (0, 0.015, 0), lean) for p in one]
    return finish(parts, limits, {"state": "closed", "style": "in a stand"})


def hat(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A straw hat, a felt hat, a cap or a knitted hat, lying."""
    style = pick(rng, "straw", "felt", "cap", "knitted")
    if style == "knitted":
        wool = skin("wool", patterns.stripes(rng, [tone(rng, VIVID + SOFT), tone(rng, WHITES + SOFT)], 4, False, 96))
        parts = [
            lathe(
                [
                    (0, 0),
                    (0.098, 0),
                    (0.104, 0.02),
                    (0.098, 0.045),
                    (0.1, 0.05),
                    (0.095, 0.12),
                    (0.06, 0.17),
                    (0, 0.185),
                ],
                wool,
                24,
            )
        ]
        parts.append(ellipsoid((0, 0.2, 0), (0.032, 0.03, 0.032), paint(rng, VIVID + WHITES, "bobble"), 12, 8))
        return finish(parts, limits, {"material": "wool", "style": style})
    if style == "cap":
        cloth = paint(rng, VIVID + DARK + SOFT, "cap")
        crown = [(0.094 * np.cos(a), 0.004 + 0.115 * np.sin(a)) for a in np.linspace(0, np.pi / 2, 9)]
        brim = paint(rng, VIVID + DARK, "brim") if chance(rng, 0.4) else cloth
        peak = placed(ellipsoid((0, 0, 0), (0.085, 0.006, 0.085), brim, 22, 4), (0, 0.012, 0.085), turn(0, 0.1))
        return finish(
            [lathe([(0, 0.004), *crown], cloth, 24), peak, ellipsoid((0, 0.12, 0), (0.008, 0.005, 0.008), brim, 8, 5)],
            limits,
            {"material": "fabric", "style": style},
        )
    r = between(rng, 0.15, 0.19) if style == "straw" else between(rng, 0.13, 0.15)
    mat = (
        skin("straw", patterns.wicker(rng, tone(rng, ((0.86, 0.74, 0.50), (0.78, 0.64, 0.42))), 18, 40))
        if style == "straw"
        else paint(rng, LEATHERS + DARK + SOFT, "felt")
    )
    outline = [
        (0, 0.008),
        (r * 0.6, 0.006),
        (r * 0.98, 0.0),
        (r, 0.004),
        (r * 0.97, 0.006),
        (0.095, 0.014),
        (0.088, 0.07),
        (0.078, 0.11),
        (0.05, 0.118),
        (0, 0.108),
    ]
    ribbon = lathe([(0.096, 0.014), (0.0945, 0.022), (0.0925, 0.042)], paint(rng, VIVID + DARK, "ribbon"), 28)
    return finish(
        [placed(p, scale=(1, 1, 1.12)) for p in (lathe(outline, mat, 28), ribbon)],
        limits,
        {"material": style, "style": style},
    )


GENERATORS: dict[str, Generator] = {
    "shoes": shoes,
    "umbrella": umbrella,
    "hat": hat,
}
