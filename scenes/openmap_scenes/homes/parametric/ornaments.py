"""Clocks, figurines, globes and baskets."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.frames import frame_material
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    DARK,
    METALS,
    SOFT,
    VIVID,
    WOODS,
    between,
    chance,
    finish,
    paint,
    pick,
    skin,
    tone,
)
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, soft_box, spline, tube, turn, vessel


def _dial(rng: np.random.Generator, r: float) -> Model:
    """A clock's face, a disc in the xy plane that looks along +z."""
    pale = chance(rng, 0.7)
    face = skin(
        "clock face",
        patterns.clock_face(
            rng,
            (0.95, 0.94, 0.90) if pale else tone(rng, DARK + SOFT),
            (0.10, 0.10, 0.11) if pale else (0.95, 0.94, 0.90),
        ),
    )
    disc = lathe([(r, -0.008), (r, 0), *((x, 0.0) for x in np.linspace(r, 0, 3)[1:])], face, 32)
    uv = (0.5 + disc.vertices[:, [0, 2]] / (2 * r)).astype(np.float32)
    return placed(
        Model(disc.vertices, disc.normals, uv, disc.faces, disc.face_material, disc.materials),
        rotation=turn(0, np.pi / 2),
    )


def clock(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A wall clock, round or square."""
    r, (frame, stuff) = between(rng, 0.12, 0.2), frame_material(rng)
    if chance(rng, 0.4):
        frame = paint(rng, VIVID + DARK, "frame")
    shape = pick(rng, "round", "round", "square")
    parts = [placed(_dial(rng, r), (0, 0, 0.022))]
    if shape == "round":
        rim = lathe(
            [(0, 0), (r + 0.012, 0), (r + 0.016, 0.006), (r + 0.014, 0.03), (r + 0.004, 0.034), (r - 0.002, 0.026)],
            frame,
            32,
        )
        parts.append(placed(rim, rotation=turn(0, np.pi / 2)))
    else:
        s = r + 0.02
        parts.append(soft_box((-s, -s, 0), (s, s, 0.02), frame, 0.006))
    return finish(parts, limits, {"shape": shape, "material": stuff}, elevation=1.7, smallest=0.6)


def alarm_clock(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An alarm clock with bells, a box with a dial, or one with lit figures."""
    style, body = pick(rng, "bells", "box", "digital"), paint(rng, VIVID + DARK + METALS, "case")
    r, metal = between(rng, 0.04, 0.055), paint(rng, METALS, "metal")
    if style == "digital":
        w, h = 0.15, 0.065
        glass = np.full((32, 80, 3), 16, np.uint8)
        for k, x in enumerate((8, 24, 46, 62)):
            glass[6:26, x : x + 3] = glass[6:26, x + 8 : x + 11] = (235, 60, 40)
            if k % 2:
                glass[6:9, x : x + 11] = glass[23:26, x : x + 11] = (235, 60, 40)
        glass[11:14, 39:41] = glass[19:22, 39:41] = (235, 60, 40)
        return finish(
            [
                soft_box((-w / 2, 0, -0.04), (w / 2, h, 0.035), body, 0.012, 2),
                soft_box((-w * 0.44, h * 0.14, 0.02), (w * 0.44, h * 0.86, 0.037), skin("digits", glass), 0.001),
            ],
            limits,
            {"style": style},
        )
    if style == "box":
        s = r * 1.25
        return finish(
            [soft_box((-s, -s, -0.04), (s, s, 0), body, 0.014, 2), placed(_dial(rng, r), (0, 0, 0.002))],
            limits,
            {"style": style, "shape": "square"},
        )
    case = lathe(
        [(0, -0.05), (r * 0.9, -0.05), (r + 0.004, -0.04), (r + 0.006, 0), (r + 0.002, 0.004), (r - 0.002, 0.0)],
        body,
        26,
    )
    parts = [placed(case, rotation=turn(0, np.pi / 2)), placed(_dial(rng, r), (0, 0, 0.0015))]
    dome = lathe([(0, 0), (0.021, 0), (0.02, 0.008), (0.012, 0.017), (0, 0.02)], metal, 14)
    for side in (-1, 1):
        parts.append(placed(dome, (side * r * 0.62, r * 0.86, -0.022), turn(2, -side * 0.6)))
        parts.append(tube([(side * r * 0.55, -r * 0.7, -0.022), (side * r * 0.9, -r * 1.25, -0.022)], 0.005, metal, 6))
    parts.append(
        tube(
            spline([(-r * 0.5, r + 0.016, -0.022), (0, r + 0.034, -0.022), (r * 0.5, r + 0.016, -0.022)], 7),
            0.003,
            metal,
            5,
        )
    )
    return finish(parts, limits, {"style": style, "shape": "round"})


def figurine(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small sculpture: a bird, a cat, an elephant, a standing figure or a knot of rings."""
    mat = paint(rng, METALS + CERAMIC + WOODS + DARK, "figurine")
    style = pick(rng, "bird", "cat", "elephant", "person", "abstract")
    e = ellipsoid
    if style == "bird":
        parts = [
            placed(e((0, 0, 0), (0.032, 0.034, 0.055), mat), (0, 0.075, 0), turn(0, -0.3)),
            e((0, 0.12, 0.038), (0.022, 0.022, 0.024), mat),
            placed(tube([(0, 0, 0), (0, 0, 0.026)], [0.007, 0.001], mat, 6), (0, 0.12, 0.055)),
        ]
        parts += [
            placed(e((0, 0, 0), (0.014, 0.005, 0.045), mat), (0, 0.075, -0.065), turn(0, 0.35)),
            *(tube([(x, 0.005, 0), (x, 0.055, 0)], 0.0035, mat, 5) for x in (-0.012, 0.012)),
        ]
    elif style == "cat":
        parts = [
            e((0, 0.05, 0), (0.034, 0.055, 0.045), mat),
            e((0, 0.12, 0.02), (0.027, 0.025, 0.025), mat),
            tube(spline([(0.0, 0.014, -0.04), (0.05, 0.014, -0.03), (0.055, 0.016, 0.03)], 8), 0.009, mat, 7),
        ]
        for x in (-0.016, 0.016):
            parts += [
                placed(lathe([(0, 0), (0.011, 0), (0, 0.026)], mat, 8), (x, 0.135, 0.018)),
                e((x, 0.03, 0.036), (0.011, 0.03, 0.013), mat, 8, 6),
            ]
    elif style == "elephant":
        parts = [
            e((0, 0.085, 0), (0.042, 0.042, 0.06), mat),
            e((0, 0.11, 0.06), (0.03, 0.032, 0.028), mat),
            tube(
                spline([(0, 0.1, 0.085), (0, 0.06, 0.1), (0, 0.03, 0.1), (0, 0.03, 0.118)], 9),
                np.linspace(0.013, 0.006, 9),
                mat,
                8,
            ),
        ]
        parts += [tube([(x, 0, z), (x, 0.07, z)], 0.016, mat, 10) for x in (-0.024, 0.024) for z in (-0.034, 0.034)]
        parts += [e((x, 0.115, 0.05), (0.022, 0.03, 0.006), mat, 10, 6) for x in (-0.04, 0.04)]
    elif style == "person":
        robe = spline([(0.045, 0), (0.034, 0.06), (0.024, 0.12), (0.034, 0.165), (0.012, 0.19)], 12)
        parts = [
            lathe(np.concatenate([[[0, 0]], robe, [[0, 0.19]]]), mat, 16),
            e((0, 0.212, 0), (0.019, 0.024, 0.02), mat),
        ]
        parts += [
            tube(spline([(s * 0.032, 0.16, 0), (s * 0.05, 0.12, 0.012), (s * 0.012, 0.1, 0.036)], 8), 0.009, mat, 7)
            for s in (-1, 1)
        ]
    else:
        phi = np.linspace(0, 2 * np.pi, 41)[:-1]
        knot = (
            np.stack(
                [(2 + np.cos(3 * phi)) * np.cos(2 * phi), (2 + np.cos(3 * phi)) * np.sin(2 * phi), np.sin(3 * phi)], 1
            )
            * 0.027
        )
        parts = [placed(tube(knot, 0.012, mat, 8, closed=True), (0, 0.105, 0))]
    if style in ("bird", "person", "abstract"):
        parts.append(soft_box((-0.04, 0, -0.035), (0.04, 0.02, 0.035), paint(rng, WOODS + DARK, "plinth"), 0.003))
    size = between(rng, 0.8, 1.5)
    return finish([placed(p, scale=size) for p in parts], limits, {"shape": style}, smallest=0.6)


def globe(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A globe on a foot, tilted in its arc."""
    r, metal = between(rng, 0.1, 0.16), paint(rng, METALS, "arc")
    old = chance(rng, 0.35)
    sea, land = ((0.82, 0.72, 0.52), (0.55, 0.42, 0.26)) if old else ((0.22, 0.45, 0.70), (0.50, 0.62, 0.32))
    y = r + 0.11
    ball = ellipsoid((0, 0, 0), (r, r, r), skin("map", patterns.globe_map(rng, sea, land)), 28, 16)
    tilt = turn(2, -0.41)
    a = np.linspace(-np.pi / 2 - 0.1, np.pi / 2 + 0.1, 16)
    arc = np.stack([-(r + 0.014) * np.cos(a), (r + 0.014) * np.sin(a), 0 * a], 1)
    foot = [(0, 0), (r * 0.7, 0), (r * 0.7, 0.012), (r * 0.3, 0.028), (0.012, 0.04), (0.012, 0.1), (0, 0.1)]
    parts = [placed(ball, (0, y, 0), tilt), placed(tube(arc, 0.006, metal, 6), (0, y, 0), tilt)]
    parts += [
        lathe(foot, paint(rng, WOODS + METALS, "foot"), 22),
        placed(tube([(0, -r - 0.014, 0), (0, r + 0.02, 0)], 0.004, metal, 6), (0, y, 0), tilt),
    ]
    return finish(parts, limits, {"material": "plastic"})


def basket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A woven basket, round or oblong, low or tall; with a handle, a lid of cloth, or balls of wool in it."""
    weave = skin("wicker", patterns.wicker(rng, tone(rng, (*WOODS, *SOFT[:3])), 10, 26))
    r, h = between(rng, 0.13, 0.22), between(rng, 0.14, 0.34)
    outline = spline([(r * 0.8, 0), (r * 0.97, h * 0.4), (r, h)], 7)
    body = vessel(outline, 0.012, weave, weave, 24)
    phi = np.linspace(0, 2 * np.pi, 25)[:-1]
    rim = tube(
        np.stack([(r - 0.005) * np.cos(phi), np.full(24, h), (r - 0.005) * np.sin(phi)], 1),
        0.011,
        weave,
        6,
        closed=True,
    )
    oblong = chance(rng, 0.4)
    parts = [placed(p, scale=(1.35 if oblong else 1.0, 1.0, 0.9 if oblong else 1.0)) for p in (body, rim)]
    extra = pick(rng, "handle", "wool", "cloth", "handles")
    if extra == "handle":
        wide = r * (1.35 if oblong else 1.0)
        parts.append(
            tube(
                spline(
                    [
                        (-wide + 0.01, h * 0.8, 0),
                        (-wide * 0.8, h * 1.5, 0),
                        (0, h * 1.8, 0),
                        (wide * 0.8, h * 1.5, 0),
                        (wide - 0.01, h * 0.8, 0),
                    ],
                    16,
                ),
                0.01,
                weave,
                7,
            )
        )
    elif extra == "handles":
        wide = r * (1.35 if oblong else 1.0)
        for s in (-1, 1):
            parts.append(
                tube(
                    spline(
                        [
                            (s * wide, h * 0.8, -0.05),
                            (s * (wide + 0.03), h * 0.95, -0.03),
                            (s * (wide + 0.03), h * 0.95, 0.03),
                            (s * wide, h * 0.8, 0.05),
                        ],
                        10,
                    ),
                    0.008,
                    weave,
                    6,
                )
            )
    elif extra == "wool":
        for k in range(5):
            a, q = 1.3 * k, 0.5 * r * (k > 0)
            wool = skin(
                "wool",
                patterns.stripes(
                    rng, [c := tone(rng, VIVID + SOFT), (0.8 * c[0], 0.8 * c[1], 0.8 * c[2])], 9, False, 64
                ),
            )
            parts.append(
                placed(
                    ellipsoid((0, 0, 0), (r * 0.36, r * 0.34, r * 0.36), wool, 14, 8),
                    (q * np.cos(a), h - 0.02, q * np.sin(a)),
                    turn(0, a),
                )
            )
    else:
        parts.append(
            ellipsoid(
                (0, h - 0.02, 0), (r * 0.85, 0.05, r * 0.75), skin("cloth", patterns.fabric(rng, 0.5)[0]), 18, 8, 0.8
            )
        )
    return finish(parts, limits, {"material": "wicker", "shape": "oval" if oblong else "round"})


GENERATORS: dict[str, Generator] = {
    "clock": clock,
    "alarm clock": alarm_clock,
    "figurine": figurine,
    "globe": globe,
    "basket": basket,
}
