"""What is fixed to a home: radiators, fireplaces, toilet paper on its holder, coat hooks."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
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
from openmap_scenes.homes.revolve import Array, ellipsoid, lathe, placed, sheet, soft_box, spline, tube, turn
from openmap_scenes.homes.textures import Image
from openmap_scenes.scene import Material


def radiator(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A radiator with its back at the wall: cast-iron ribs, a grooved panel, or upright tubes; as wide as fits below a window."""
    w, h = min(between(rng, 0.6, 1.4), limits.width), min(between(rng, 0.5, 0.75), limits.height)
    if w < 0.4 or h < 0.3 or limits.depth < 0.09:
        return None
    style, mat = (
        pick(rng, "ribbed", "panel", "tubes"),
        paint(rng, (*WHITES, *WHITES, *METALS[:1], *DARK[:1]), "radiator"),
    )
    w = min(w, 1.0) if style == "ribbed" else w
    parts: list[Model] = []
    if style == "panel":
        grooves = skin("grooves", (mat.colour * 255 * _groove(int(w / 0.04))).astype(np.uint8))
        parts.append(
            soft_box((-w / 2, 0.08, -0.035), (w / 2, h, 0.035), {**dict.fromkeys(range(1, 6), mat), 0: grooves}, 0.008)
        )
    else:
        n = max(4, int(w / (0.062 if style == "ribbed" else 0.085)))
        for k in range(n):
            x = w * ((k + 0.5) / n - 0.5)
            if style == "ribbed":
                parts.append(soft_box((x - 0.024, 0.06, -0.05), (x + 0.024, h, 0.05), mat, 0.022, 1, step=0.4))
            else:
                parts.append(tube([(x, 0.08, 0), (x, h, 0)], 0.022, mat, 8))
        for y in (0.13, h - 0.06):
            parts.append(tube([(-w / 2 + 0.02, y, 0), (w / 2 - 0.02, y, 0)], 0.018, mat, 8))
    metal = solid("pipe", (0.75, 0.75, 0.74))
    for s in (-1, 1):
        parts.append(tube([(s * (w / 2 - 0.06), 0, 0), (s * (w / 2 - 0.06), 0.12, 0)], 0.01, metal, 8))
    knob = lathe([(0.02, -0.004), (0.022, 0.03), (0.018, 0.06), (0, 0.062)], solid("valve", (0.94, 0.94, 0.92)), 12)
    parts.append(placed(knob, (w / 2 - 0.065, 0.12, 0.0), turn(0, np.pi / 2)))
    return finish(parts, limits, {"material": "metal", "style": style}, smallest=0.7)


def _groove(count: int) -> Array:
    s = (np.arange(128) + 0.5) / 128
    shade = 0.93 + 0.07 * np.cos(2 * np.pi * s * count)
    return np.broadcast_to(shade[None, :, None], (8, 128, 3))


def fireplace(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A surround of brick, stone or painted wood with a mantel around a dark hearth with logs, burning or not."""
    w, h, d = between(rng, 1.1, 1.5), between(rng, 0.95, 1.15), between(rng, 0.3, 0.4)
    stuff = pick(rng, "brick", "stone", "wood")
    front = {
        "brick": lambda: skin("brick", _bricks(rng)),
        "stone": lambda: skin("stone", patterns.to_image(patterns.fur(rng, (0.72, 0.70, 0.66), 96, 0.08) / 255)),
        "wood": lambda: paint(rng, WHITES + WOODS, "painted wood"),
    }[stuff]()
    a, top, soot = w * 0.3, h * 0.68, solid("soot", (0.09, 0.08, 0.08))
    parts = [
        soft_box((-w / 2, 0, -d / 2), (-a, h, d / 2), front, 0.006),
        soft_box((a, 0, -d / 2), (w / 2, h, d / 2), front, 0.006),
        soft_box((-a - 0.001, top, -d / 2), (a + 0.001, h, d / 2 - 0.002), front, 0.006),
        soft_box((-a - 0.001, 0.0, -d / 2), (a + 0.001, top + 0.005, -d / 2 + 0.04), soot, 0.004),
        soft_box(
            (-w / 2 - 0.05, 0, d / 2 - 0.01),
            (w / 2 + 0.05, 0.04, d / 2 + 0.22),
            paint(rng, DARK + METALS[:2], "hearth"),
            0.006,
        ),
        soft_box(
            (-w / 2 - 0.06, h - 0.002, -d / 2),
            (w / 2 + 0.06, h + 0.055, d / 2 + 0.06),
            skin("mantel", patterns.wood(rng)) if stuff != "stone" else front,
            0.008,
        ),
        soft_box((-a, 0, -d / 2 + 0.03), (a, 0.03, d / 2 - 0.01), soot, 0.004),
    ]
    log, cut = skin("bark", patterns.fur(rng, (0.34, 0.25, 0.18), 64, 0.2)), solid("log end", (0.76, 0.60, 0.40))
    for k, (x, y, z, angle) in enumerate(((0, 0.08, 0.04, 0.1), (0.02, 0.08, -0.06, -0.1), (0, 0.17, -0.01, 0.3))):
        body = [
            tube([(-0.2, 0, 0), (0.2, 0, 0)], 0.048, log, 10),
            *(tube([(s * 0.2, 0, 0), (s * 0.202, 0, 0)], 0.047, cut, 10) for s in (-1, 1)),
        ]
        parts += [placed(p, (x, y, z), turn(1, angle + 0.02 * k)) for p in body]
    if chance(rng, 0.5):
        for k in range(6):
            flame = lathe(
                [(0, 0), (0.035, 0.03), (0.03, 0.09), (0, 0.2)],
                solid("flame", ((0.98, 0.72, 0.20), (0.95, 0.48, 0.12))[k % 2]),
                8,
            )
            parts.append(
                placed(flame, (0.07 * (k - 2.5), 0.13, 0.03 * (-1) ** k), scale=(1, between(rng, 0.6, 1.3), 0.7))
            )
    return finish(parts, limits, {"material": stuff}, surface=True)


def _bricks(rng: np.random.Generator, size: int = 128) -> Image:
    u, v = patterns.unit(size)
    rows, columns = 10, 4
    row = np.floor(v * rows)
    x = (u * columns + 0.5 * (row % 2)) % columns
    joint = ((v * rows) % 1 < 0.12) | (x % 1 < 0.05)
    shade = rng.normal(0, 0.07, (rows, columns))[row.astype(int), x.astype(int)]
    rgb = np.array(tone(rng, ((0.62, 0.30, 0.22), (0.70, 0.42, 0.32), (0.80, 0.76, 0.70)))) * (1 + shade)[..., None]
    return patterns.to_image(np.where(joint[..., None], 0.72, rgb))


def paper_roll(r: float, w: float, paper: Material) -> Model:
    """A roll along x with its hole."""
    core = 0.02
    profile = [(core, -w / 2), (r, -w / 2), (r, 0), (r, w / 2), (core, w / 2), (core, -w / 2)]
    return placed(lathe(profile, paper, 22), rotation=turn(2, -np.pi / 2))


def toilet_paper(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A roll on a holder at the wall, its end hanging; with a lid, on a hook, or on a standing rod."""
    style, metal, paper = pick(rng, "hook", "lid", "stand"), paint(rng, METALS, "metal"), paint(rng, WHITES, "paper")
    r, w = between(rng, 0.048, 0.06), 0.1
    if style == "stand":
        base = lathe(
            [(0, 0), (0.08, 0), (0.08, 0.012), (0.01, 0.018), (0.009, 0.3), (0.009, 0.6), (0, 0.605)], metal, 20
        )
        parts = [
            base,
            tube(spline([(0, 0.595, 0), (0.06, 0.6, 0), (0.14, 0.6, 0)], 6), 0.007, metal),
            placed(paper_roll(r, w, paper), (0.08, 0.6, 0)),
        ]
        parts.append(soft_box((0.03, 0.47, r - 0.003), (0.13, 0.6, r), paper, 0.001))
        return finish(parts, limits, {"style": style, "material": "paper"})
    y, z = 0.0, r + 0.02
    parts = [
        placed(paper_roll(r, w, paper), (0, y, z)),
        soft_box((-w / 2, y - 0.11, z + r - 0.002), (w / 2, y, z + r + 0.0005), paper, 0.0008),
    ]
    parts.append(tube([(-w / 2 - 0.02, y, z), (w / 2 + 0.015, y, z)], 0.006, metal, 8))
    parts.append(
        tube(
            spline([(-w / 2 - 0.018, y, 0.004), (-w / 2 - 0.02, y, z * 0.6), (-w / 2 - 0.018, y, z)], 6),
            0.006,
            metal,
            8,
        )
    )
    parts.append(
        placed(
            lathe([(0, 0), (0.024, 0), (0.024, 0.006), (0, 0.008)], metal, 16),
            (-w / 2 - 0.018, y, 0),
            turn(0, np.pi / 2),
        )
    )
    if style == "lid":
        a = np.linspace(0.35, np.pi - 0.1, 8)
        lid = np.stack(
            [
                np.broadcast_to(np.array([-w / 2 - 0.01, w / 2 + 0.01])[None], (8, 2)),
                (y + (r + 0.008) * np.sin(a))[:, None].repeat(2, 1),
                (z + (r + 0.008) * np.cos(a))[:, None].repeat(2, 1),
            ],
            2,
        )
        parts.append(sheet(lid, 0.002, metal))
    return finish(parts, limits, {"style": style, "material": "paper"}, elevation=0.6)


def _coat(rng: np.random.Generator, cover: Material) -> list[Model]:
    """A coat hanging from the origin: shoulders drawn together at the loop, folds below, two sleeves."""
    long, wide = between(rng, 0.75, 1.0), between(rng, 0.13, 0.17)
    t, phi = np.linspace(0, 1, 9), np.linspace(0, 2 * np.pi, 25)
    phi[-1] = 0.0
    rx = wide * np.array([0.2, 0.62, 0.85, 0.92, 0.95, 1.0, 1.08, 1.14, 1.16])
    rz = 0.085 * np.array([0.3, 0.75, 1.0, 1.0, 0.95, 0.95, 1.0, 1.05, 1.05])
    wave = 1 + 0.10 * t[:, None] * np.sin(6 * phi + between(rng, 0, 6))
    points = np.stack(
        [
            rx[:, None] * np.cos(phi) * wave,
            np.repeat((-long * t)[:, None], 25, 1),
            -rz[:, None] * np.sin(phi) * wave + 0.095,
        ],
        2,
    )
    parts = [sheet(points[::-1], 0.006, cover)]
    for s in (-1, 1):
        arm = spline([(s * wide * 0.5, -0.06, 0.1), (s * wide * 1.05, -0.22, 0.11), (s * wide * 1.12, -0.6, 0.12)], 9)
        parts.append(tube(arm, np.linspace(0.05, 0.042, 9), cover, 9))
    return parts


def coat_hooks(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A board with hooks, coats and a bag or a scarf on some of them."""
    n = int(rng.integers(3, 6))
    w = n * between(rng, 0.14, 0.18)
    board, metal = (
        skin("wood", patterns.wood(rng)) if chance(rng, 0.7) else paint(rng, WHITES + DARK, "board"),
        paint(rng, METALS, "hook"),
    )
    parts = [soft_box((-w / 2, -0.06, 0), (w / 2, 0.06, 0.02), board, 0.005)]
    used = rng.permutation(n)[: int(rng.integers(1, 3))]
    for k in range(n):
        x = w * ((k + 0.5) / n - 0.5)
        hook = spline([(x, 0.02, 0.018), (x, -0.025, 0.03), (x, -0.03, 0.06), (x, 0.01, 0.07)], 8)
        parts += [tube(hook, 0.006, metal, 6), ellipsoid((x, 0.014, 0.07), (0.01, 0.01, 0.01), metal, 8, 5)]
        if k in used:
            cloth = skin("coat", patterns.cloth(rng, tone(rng, SOFT + VIVID + DARK), 64, 0.07))
            parts += [placed(p, (x, -0.01, 0.0)) for p in _coat(rng, cloth)]
    return finish(parts, limits, {"material": "wood"}, elevation=0.75)


GENERATORS: dict[str, Generator] = {
    "radiator": radiator,
    "fireplace": fireplace,
    "toilet paper": toilet_paper,
    "coat hooks": coat_hooks,
}
