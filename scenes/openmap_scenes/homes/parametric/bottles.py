"""Jars and bottles."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.glazes import glaze
from openmap_scenes.homes.parametric.making import (
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
from openmap_scenes.homes.revolve import ellipsoid, lathe, soft_box, spline
from openmap_scenes.scene import Material


def jar(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A jar of glass with something in it, or of stoneware; lid of metal, cork or wood."""
    r, h = between(rng, 0.035, 0.06), between(rng, 0.09, 0.19)
    full = chance(rng, 0.7)
    stuff = "glass" if full else "ceramic"
    if full:
        inside = tone(
            rng,
            (
                (0.75, 0.55, 0.25),
                (0.62, 0.12, 0.12),
                (0.35, 0.20, 0.10),
                (0.88, 0.80, 0.62),
                (0.40, 0.48, 0.22),
                (0.86, 0.48, 0.14),
            ),
        )
        level = between(rng, 0.55, 0.85)
        body = skin("jar", patterns.band(tone(rng, GLASSES), inside, 0.08, level))
    else:
        body = glaze(rng)[0]
    profile = [
        (0, 0),
        *spline([(r * 0.93, 0), (r, 0.01), (r, h * 0.5), (r, h * 0.86), (r * 0.82, h * 0.95), (r * 0.82, h)], 12),
    ]
    stopper = pick(rng, "metal", "cork", "wood")
    top = {"metal": METALS + VIVID[:2], "cork": ((0.72, 0.56, 0.38),), "wood": WOODS}[stopper]
    lid = lathe(
        [(r * 0.84, h - 0.004), (r * 0.87, h), (r * 0.87, h + 0.018), (r * 0.83, h + 0.022), (0, h + 0.022)],
        paint(rng, top, "lid"),
        20,
    )
    return finish([lathe(profile, body, 22), lid], limits, {"material": stuff})


def _bottle(r: float, h: float, neck: float, shoulder: float, material: Material) -> Model:
    profile = [
        (r * 0.95, 0),
        (r, 0.006),
        (r, h * shoulder * 0.5),
        (r, h * shoulder),
        (r * 0.85, h * (shoulder + 0.07)),
        (neck * 1.15, h * (shoulder + 0.18)),
        (neck, h * 0.9),
        (neck, h),
    ]
    body = np.concatenate([[profile[0]], spline(profile[1:], 18)])
    return lathe(np.concatenate([[[0, 0]], body, [[0, h]]]), material, 18)


def wine_bottle(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bottle of wine with label and capsule: Bordeaux, Burgundy or Rhine shape."""
    r, h, shoulder = between(rng, 0.036, 0.041), between(rng, 0.29, 0.34), float(rng.choice([0.6, 0.45, 0.35]))
    dark = solid(
        "bottle glass",
        tone(rng, ((0.10, 0.18, 0.10), (0.16, 0.10, 0.06), (0.30, 0.36, 0.18), (0.08, 0.10, 0.10), (0.72, 0.70, 0.48))),
    )
    parts = [_bottle(r, h, 0.013, shoulder, dark)]
    label = skin("label", patterns.cover(rng, 64)) if chance(rng, 0.5) else solid("label", (0.93, 0.90, 0.82))
    y = h * shoulder * 0.22
    tall = h * shoulder * 0.55
    parts.append(
        lathe([(r + 0.0002, y), (r + 0.0006, y), (r + 0.0006, y + tall), (r + 0.0002, y + tall)], label, 18, 2.0)
    )
    capsule = paint(rng, ((0.45, 0.08, 0.12), (0.12, 0.12, 0.13), (0.72, 0.60, 0.30), (0.80, 0.80, 0.80)), "capsule")
    parts.append(lathe([(0.0136, h * 0.84), (0.0142, h * 0.85), (0.0142, h + 0.002), (0, h + 0.002)], capsule, 14))
    return finish(parts, limits, {"material": "glass"})


def bottle(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bottle of water, soda, oil, shampoo or cleaner, with label and cap."""
    style = pick(rng, "plastic", "glass", "shampoo", "soda")
    if style == "shampoo":
        w, d, h = between(rng, 0.03, 0.04), between(rng, 0.018, 0.025), between(rng, 0.15, 0.21)
        body, cap = paint(rng, VIVID + WHITES + SOFT, "bottle"), paint(rng, WHITES + SOFT, "cap")
        parts = [
            ellipsoid((0, h / 2, 0), (w, h / 2, d), body, 20, 12, 0.3, 0.7),
            lathe([(0.016, h - 0.008), (0.016, h + 0.022), (0, h + 0.022)], cap, 16),
        ]
        parts.append(
            soft_box(
                (-w * 0.62, h * 0.25, d * 0.88),
                (w * 0.62, h * 0.7, d * 1.03),
                skin("label", patterns.cover(rng, 64)),
                0.001,
            )
        )
        return finish(parts, limits, {"material": "plastic"})
    r, h = between(rng, 0.03, 0.042), between(rng, 0.2, 0.31)
    colour = {
        "plastic": ((0.74, 0.86, 0.94), (0.80, 0.90, 0.86)),
        "glass": ((0.82, 0.74, 0.30), (0.24, 0.42, 0.26), (0.80, 0.87, 0.88)),
        "soda": ((0.22, 0.10, 0.06), (0.88, 0.52, 0.14), (0.40, 0.66, 0.24)),
    }[style]
    parts = [_bottle(r, h, 0.012, between(rng, 0.5, 0.65), paint(rng, colour, "bottle"))]
    parts.append(
        lathe([(0.0145, h - 0.012), (0.0145, h + 0.006), (0, h + 0.006)], paint(rng, VIVID + WHITES, "cap"), 14)
    )
    a = tone(rng, VIVID)
    label = skin("label", patterns.band(a, tone(rng, WHITES), 0.35, 0.65))
    parts.append(
        lathe([(r + 0.0002, h * 0.2), (r + 0.0008, h * 0.2), (r + 0.0008, h * 0.42), (r + 0.0002, h * 0.42)], label, 18)
    )
    return finish(parts, limits, {"material": "glass" if style == "glass" else "plastic"})


GENERATORS: dict[str, Generator] = {
    "jar": jar,
    "wine bottle": wine_bottle,
    "bottle": bottle,
}
