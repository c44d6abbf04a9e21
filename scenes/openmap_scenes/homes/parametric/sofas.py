"""Upholstered seats with arms: armchair, loveseat, sofa, corner sofa."""

from __future__ import annotations

import itertools

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import Size, bar, base, beam, draw_size, four_legs, made
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.solids import (
    bent,
    box,
    cushion,
    leg,
    mirrored,
    moved,
    oval,
    rounded_box,
    sweep,
    tube,
    turned,
)
from openmap_scenes.scene import Material

ARMS = ("box", "slim", "rolled", "pad")
BASES = ("tapered", "tapered", "block", "pins", "plinth")


def _couch(rng: np.random.Generator, size: Size, seats: int, cover: Material, open_side: str = "") -> list[Model]:
    """Base, arms, back and cushions of a seat for ``seats``; ``open_side``: "left" or "right" has no arm."""
    w, d, h = size
    wood, _ = finishes.wood(rng)
    iron, _ = finishes.metal(rng, "black metal", "brass", "chrome")
    arm, foot = finishes.choose(rng, *ARMS), float(rng.uniform(0.09, 0.16))
    style, loose = finishes.choose(rng, *BASES), bool(rng.random() < 0.65)
    a = (
        (0.75 if seats == 1 else 1.0)
        * {"box": 0.17, "slim": 0.09, "rolled": 0.17, "pad": 0.14}[arm]
        * float(rng.uniform(0.9, 1.15))
    )
    foot = 0.06 if style == "plinth" else foot
    rise, back = min(float(rng.uniform(0.54, 0.64)), h - 0.08), float(rng.uniform(0.15, 0.19))
    deck, seat = 0.28, float(rng.uniform(0.42, 0.45))
    x0, x1 = -w / 2 + (0 if open_side == "left" else a), w / 2 - (0 if open_side == "right" else a)
    z0, z1 = -d / 2, d / 2
    parts = base(rng, style, w, d, foot, wood, iron)
    parts.append(rounded_box((x0, foot, z0 + back * 0.5), (x1, deck, z1 - 0.015), cover, 0.015, 2))
    for s, side in ((-1, "left"), (1, "right")):
        if side != open_side:
            parts += _arm(arm, s, w / 2, a, foot, rise, z0, z1, cover)
    top = h if not loose else h - 0.09
    hull = rounded_box((x0, foot, z0), (x1, top, z0 + back), cover, 0.045, 2, step=0.26)
    parts.append(hull)
    n, front = seats, z1 - 0.002
    step = (x1 - x0) / n
    for k in range(n):
        parts.append(
            cushion(
                (x0 + k * step, deck - 0.005, z0 + back - 0.02),
                (x0 + (k + 1) * step, seat + 0.02, front),
                cover,
                0.22,
                0.2,
            )
        )
        lean = cushion(
            (x0 + k * step + 0.005, seat - 0.02, -0.075), (x0 + (k + 1) * step - 0.005, h, 0.075), cover, 0.45
        )
        if loose:
            parts.append(turned(moved(lean, z=z0 + back + 0.075), "x", -0.16, (0, seat, z0 + back + 0.05)))
        else:
            parts.append(
                cushion(
                    (x0 + k * step, seat, z0 + back - 0.05),
                    (x0 + (k + 1) * step, h - 0.02, z0 + back + 0.07),
                    cover,
                    0.4,
                )
            )
    return parts + _pillows(rng, x0, x1, seat, z0 + back + 0.13, seats)


def _arm(
    kind: str, s: int, half: float, a: float, foot: float, rise: float, z0: float, z1: float, m: Material
) -> list[Model]:
    lo, hi = (-half, -half + a) if s < 0 else (half - a, half)
    if kind == "rolled":
        r = a * 0.5
        x = (lo + hi) / 2 + s * a * 0.0
        roll = sweep([(x, rise - r, z0 + 0.02), (x, rise - r, z1)], oval(r, r, 16), m, step=0.2)
        inner = lo + 0.025 if s < 0 else lo + 0.02
        return [rounded_box((inner, foot, z0 + 0.02), (inner + a - 0.045, rise - r, z1 - 0.01), m, 0.015, 2), roll]
    if kind == "pad":
        return [
            rounded_box((lo + 0.015, foot, z0 + 0.01), (hi - 0.01, rise - 0.09, z1 - 0.01), m, 0.012, 2),
            cushion((lo, rise - 0.11, z0 + 0.01), (hi, rise, z1), m, 0.25),
        ]
    return [rounded_box((lo, foot, z0), (hi, rise, z1), m, 0.035 if kind == "box" else 0.02, 2, step=0.26)]


def _pillows(rng: np.random.Generator, x0: float, x1: float, seat: float, z: float, seats: int) -> list[Model]:
    """A few throw pillows that lean on the back, at the ends."""
    out = []
    for s in (-1, 1):
        if rng.random() < (0.25 if seats == 1 else 0.5):
            edge = float(rng.uniform(0.36, 0.46))
            cover = finishes.cloth(
                rng, finishes.shade(rng, finishes.CLOTHS), finishes.choose(rng, "plain", "stripes", "checks", "velvet")
            )
            x = (x0 + edge * 0.6) if s < 0 else (x1 - edge * 0.6)
            x = (x0 + x1) / 2 if seats == 1 else x
            pillow = cushion((-edge / 2, 0, -0.07), (edge / 2, edge, 0.07), cover, 0.7)
            pillow = turned(turned(pillow, "z", float(rng.normal(0, 0.08))), "x", -0.35)
            out.append(moved(turned(pillow, "y", -s * 0.25), x, seat + 0.012, z + 0.06))
            if seats == 1:
                break
    return out


def _sofa(rng: np.random.Generator, size: Size | None, seats: int) -> Made | None:
    if size is None:
        return None
    style = finishes.choose(rng, "soft", "soft", "soft", "framed", "tufted")
    if style == "framed":
        parts, material = _framed(rng, size, seats)
    elif style == "tufted":
        cover, material = finishes.upholstery(rng)
        parts = _tufted(rng, size, cover)
    else:
        cover, material = finishes.upholstery(rng)
        parts = _couch(rng, size, seats, cover)
    return made(parts, size, {"material": material}, surface=True)


def _framed(rng: np.random.Generator, size: Size, seats: int) -> tuple[list[Model], str]:
    """A frame of wood, rattan or tube with loose cushions."""
    w, d, h = size
    wood, name = finishes.wood(rng)
    iron, word = finishes.metal(rng, "black metal", "chrome")
    kind = finishes.choose(rng, "wood", "wood", "metal", "rattan")
    m = {"wood": wood, "metal": iron, "rattan": finishes.wicker(rng)}[kind]
    cover, _ = finishes.upholstery(rng)
    x, z, seat, rise = w / 2 - 0.03, d / 2 - 0.04, 0.42, 0.58
    parts: list[Model] = []
    for s in (-x, x):
        if kind == "rattan":
            parts.append(rounded_box((s - 0.03, 0.05, -z - 0.04), (s + 0.03, rise, z + 0.04), m, 0.02, 2))
            parts += [
                leg((s * 0.97, 0.06, k * z * 0.95), (s * 0.97, 0, k * z * 0.95), 0.02, wood, 0.8) for k in (-1, 1)
            ]
        elif kind == "metal":
            hoop = [(s, 0.012, -z), (s, rise, -z), (s, rise, z), (s, 0.012, z), (s, 0.012, -z)]
            parts.append(tube(bent(hoop, 0.06, 3), 0.014, m))
        else:
            parts += [
                leg((s, rise - 0.02, z), (s, 0, z + 0.02), 0.022, m, 0.7),
                leg((s, rise + 0.02, -z + 0.05), (s, 0, -z), 0.022, m, 0.7),
            ]
            arm = [(s, rise, -z + 0.02), (s, rise + 0.01, 0.0), (s, rise - 0.01, z + 0.04)]
            parts.append(sweep(arm, bar(0.06, 0.025), m))
    parts += [beam((-x, 0.26, s * z * 0.9), (x, 0.26, s * z * 0.9), 0.03, 0.07, m) for s in (-1, 1)]
    parts.append(box((-x, 0.255, -z * 0.9), (x, 0.275, z * 0.9), m, "x"))
    back = -z + 0.1
    if kind == "rattan":
        parts.append(
            turned(rounded_box((-x, 0.25, -z - 0.02), (x, h - 0.04, -z + 0.03), m, 0.02, 2), "x", -0.08, (0, 0.25, -z))
        )
    else:
        n = max(4, int(w / 0.09)) if kind == "wood" else 0
        top = (h - 0.05, -z - 0.01)
        parts.append(beam((-x, top[0], top[1]), (x, top[0], top[1]), 0.025, 0.06, m))
        parts += [beam((s, 0.27, back - 0.02), (s, top[0], top[1]), 0.025, 0.018, m) for s in np.linspace(-x, x, n + 2)]
        parts += [beam((s, 0.27, back - 0.02), (s, top[0], top[1]), 0.03, 0.03, m) for s in (-x, x)]
    step = 2 * (x - 0.03) / seats
    for k in range(seats):
        a = -x + 0.03 + k * step
        parts.append(cushion((a, 0.275, back), (a + step, seat + 0.01, z + 0.03), cover, 0.22, 0.2))
        pad = cushion((a, seat - 0.01, -0.06), (a + step, h, 0.07), cover, 0.35)
        parts.append(turned(moved(pad, z=back + 0.05), "x", -0.18, (0, seat, back + 0.05)))
    return parts, {"wood": name, "metal": word, "rattan": "rattan"}[kind]


def _tufted(rng: np.random.Generator, size: Size, cover: Material) -> list[Model]:
    """A chesterfield or a channelled shell: arms and back in one curve of equal height."""
    w, d, h = size
    wood, _ = finishes.wood(rng, "walnut", "mahogany", "oak", "beech")
    rise, t = min(h, float(rng.uniform(0.68, 0.76))), 0.15
    x, z = w / 2 - t / 2, d / 2
    parts = four_legs(w / 2 - 0.09, d / 2 - 0.09, 0.12, 0.025, wood, 0.02, 0.6)
    parts.append(rounded_box((-w / 2 + 0.03, 0.10, -z + 0.03), (w / 2 - 0.03, 0.29, z - 0.02), cover, 0.02, 2))
    corner = min(0.28, 0.4 * d)
    way = bent([(x, 0.0, z - 0.02), (x, 0.0, -z + t / 2), (-x, 0.0, -z + t / 2), (-x, 0.0, z - 0.02)], corner, 6)
    cut = [way[:1]]
    for p, q in itertools.pairwise(way):
        n = max(1, int(np.linalg.norm(q - p) / 0.12))
        cut.append(p + (np.arange(1, n + 1) / n)[:, None] * (q - p))
    path = np.concatenate(cut)
    wall = np.array(
        [
            (-0.4, 0.1),
            (0.4, 0.1),
            (0.45, 0.42),
            (0.5, 0.75),
            (0.55, 0.9),
            (0.35, 1.0),
            (-0.35, 1.0),
            (-0.55, 0.9),
            (-0.5, 0.75),
            (-0.45, 0.42),
        ]
    )
    parts.append(sweep(path, wall * [t, rise], cover))
    if rng.random() < 0.6:
        # Channels along the inside, one cushion each.
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        spots = np.arange(0.12, length[-1] - 0.08, 0.14)
        for s in spots:
            p = np.array([np.interp(s, length, path[:, k]) for k in range(3)])
            q = np.array([np.interp(s + 0.01, length, path[:, k]) for k in range(3)])
            angle = float(np.arctan2(-(q - p)[2], (q - p)[0]))
            pad = cushion((-0.072, 0.40, -0.12), (0.072, rise - 0.01, -0.03), cover, 0.6, 0.2, 1)
            parts.append(moved(turned(pad, "y", angle), p[0], 0.0, p[2]))
    seats = max(1, round((w - 2 * t) / 0.68))
    step = (w - 2 * t) / seats
    for k in range(seats):
        a = -w / 2 + t + k * step
        parts.append(cushion((a, 0.28, -z + t * 0.8), (a + step, 0.45, z), cover, 0.22, 0.2))
    return parts


def sofa(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A sofa for two and a half to four."""
    size = draw_size(rng, limits, (1.75, 2.4), (0.82, 0.98), (0.74, 0.92))
    return _sofa(rng, size, 0 if size is None else (2 if size[0] < 1.9 else 3))


def loveseat(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A sofa for two."""
    return _sofa(rng, draw_size(rng, limits, (1.25, 1.65), (0.78, 0.95), (0.74, 0.9)), 2)


def armchair(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An armchair: club, framed, tub, or wing chair."""
    size = draw_size(rng, limits, (0.66, 0.92), (0.70, 0.9), (0.72, 1.0))
    if size is None:
        return None
    if rng.random() < 0.22 and size[2] > 0.85:
        cover, material = finishes.upholstery(rng)
        return made(_wing(rng, size, cover), size, {"material": material, "style": "wingback"}, surface=False)
    return _sofa(rng, size, 1)


def _wing(rng: np.random.Generator, size: Size, cover: Material) -> list[Model]:
    w, d, h = size
    wood, _ = finishes.wood(rng, "walnut", "mahogany", "oak")
    z = d / 2
    parts = four_legs(w / 2 - 0.08, d / 2 - 0.08, 0.2, 0.025, wood, 0.03, 0.5)
    parts.append(rounded_box((-w / 2 + 0.06, 0.18, -z + 0.08), (w / 2 - 0.06, 0.32, z - 0.03), cover, 0.02, 2))
    back = cushion((-w / 2 + 0.1, 0.3, -0.08), (w / 2 - 0.1, h, 0.08), cover, 0.3)
    parts.append(turned(moved(back, z=-z + 0.15), "x", -0.1, (0, 0.3, -z + 0.15)))
    for s in (-1, 1):
        lo, hi = (-w / 2 + 0.01, -w / 2 + 0.1) if s < 0 else (w / 2 - 0.1, w / 2 - 0.01)
        parts.append(rounded_box((lo, 0.18, -z + 0.08), (hi, 0.56, z - 0.04), cover, 0.03, 2))
        roll = [((lo + hi) / 2, 0.57, -z + 0.1), ((lo + hi) / 2, 0.57, z - 0.02)]
        parts.append(sweep(roll, oval(0.05, 0.05, 12), cover, step=0.2))
        wing = cushion((lo + 0.01, 0.5, -z + 0.02), (hi - 0.01, h - 0.03, -z + 0.34), cover, 0.3)
        parts.append(turned(wing, "y", -s * 0.12, (lo, 0.5, -z + 0.05)))
    parts.append(cushion((-w / 2 + 0.1, 0.31, -z + 0.18), (w / 2 - 0.1, 0.47, z), cover, 0.25))
    return parts


def corner_sofa(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A sofa with a chaise longue at one end, or with a second row of seats."""
    size = draw_size(rng, limits, (2.1, 2.9), (1.45, 2.0), (0.74, 0.88))
    if size is None:
        return None
    w, d, h = size
    cover, material = finishes.upholstery(rng)
    depth, wide = 0.9, float(rng.uniform(0.82, 0.95))
    right, chaise = bool(rng.random() < 0.5), bool(rng.random() < 0.6)
    seed = int(rng.integers(2**31))
    # Both parts draw from equal generators, so that their arms, legs and cushions match.
    main = _couch(np.random.default_rng(seed), (w - wide, depth, h), 2, cover, "right")
    x, z = (w - wide) / 2, d / 2 - depth / 2
    parts = [moved(m, -wide / 2, 0, -z) for m in main]
    foot, deck, seat, x = 0.11, 0.28, 0.45, w / 2 - wide
    wood, _ = finishes.wood(rng)
    parts += [
        leg((s, foot, e), (s, 0, e), 0.022, wood, 0.7)
        for s in (x + 0.08, w / 2 - 0.08)
        for e in (-d / 2 + 0.08, d / 2 - 0.08)
    ]
    parts.append(rounded_box((x, foot, -d / 2), (w / 2, deck, d / 2 - 0.01), cover, 0.015, 2))
    parts.append(
        rounded_box((x, deck - 0.01, -d / 2 + 0.001), (w / 2, h - 0.09, -d / 2 + 0.17), cover, 0.045, 2, step=0.26)
    )
    z0 = -d / 2 + 0.17
    side = 0.0 if chaise else 0.17
    parts.append(cushion((x, deck - 0.005, z0 - 0.02), (w / 2 - side, seat, d / 2), cover, 0.12, 0.22))
    lean = cushion((x + 0.005, seat - 0.02, -0.075), (w / 2 - 0.005, h, 0.075), cover, 0.45, 0.24)
    parts.append(turned(moved(lean, z=z0 + 0.075), "x", -0.16, (0, seat, z0 + 0.05)))
    if not chaise:
        parts.append(
            rounded_box(
                (w / 2 - side, deck - 0.01, z0), (w / 2 - 0.001, h - 0.09, d / 2 - 0.02), cover, 0.045, 2, step=0.2
            )
        )
        n, room = 2, d - 0.17 - 0.15
        for k in range(n):
            pad = cushion(
                (-0.075, seat - 0.02, z0 + 0.15 + k * room / n), (0.075, h, z0 + 0.14 + (k + 1) * room / n), cover, 0.45
            )
            parts.append(turned(moved(pad, x=w / 2 - side - 0.075), "z", -0.14, (w / 2 - side - 0.05, seat, 0)))
    if not right:
        parts = [mirrored(merge(parts))]
    return made(parts, size, {"material": material, "shape": "l-shaped"})


GENERATORS: dict[str, Generator] = {
    "armchair": armchair,
    "loveseat": loveseat,
    "sofa": sofa,
    "corner sofa": corner_sofa,
}
