"""Beds made up with mattress, duvet and pillows: bed, child bed, bunk bed, crib."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import beam, draw_size, made
from openmap_scenes.homes.solids import (
    bent,
    box,
    cushion,
    leg,
    moved,
    rounded_box,
    rumpled,
    tube,
    turned,
)
from openmap_scenes.scene import Material


def _bedding(
    rng: np.random.Generator,
    x: float,
    z0: float,
    z1: float,
    y: float,
    thick: float,
    sleepers: int,
    drop: float = 0.12,
    fine: float = 0.13,
) -> list[Model]:
    """Mattress from the head z0 to the foot z1, |x| <= x, standing at y; duvet, pillows, perhaps a throw at its foot."""
    sheet = finishes.linen(rng, finishes.shade(rng, finishes.LINENS[:2]))
    cover = finishes.linen(rng)
    slip = cover if rng.random() < 0.4 else finishes.linen(rng)
    top = y + thick
    parts = [rounded_box((-x, y, z0), (x, top, z1), sheet, 0.04, 2, step=0.3)]
    pillow, deep = (0.62 if sleepers > 1 else min(0.7, 1.5 * x)), 0.40
    layers = 2 if rng.random() < 0.35 and sleepers > 1 else 1
    for k in range(sleepers):
        px = 0.0 if sleepers == 1 else (k - 0.5) * min(pillow + 0.08, 2 * x - pillow - 0.04)
        for layer in range(layers):
            shape = cushion(
                (-pillow / 2, 0, -deep / 2), (pillow / 2, 0.15, deep / 2), slip if layer == 0 else sheet, 0.6, 0.12
            )
            shape = rumpled(shape, rng, 0.012, 0.2)
            tip = turned(shape, "x", 0.28 + 0.35 * layer, (0, 0, deep / 2))
            tip = turned(tip, "y", float(rng.normal(0, 0.06)))
            parts.append(
                moved(
                    tip,
                    px,
                    top - 0.02 - float(min(0.0, tip.vertices[:, 1].min())),
                    z0 + deep / 2 + 0.02 + 0.12 * layer,
                )
            )
    head = z0 + 0.42 + 0.1 * (layers - 1) if rng.random() < 0.75 else z0 + 0.7
    # The duvet hangs over the sides; folded back at the head it shows its other side.
    duvet = rounded_box((-x - 0.035, top - drop, head), (x + 0.035, top + 0.07, z1 + 0.03), cover, 0.05, 1, step=fine)
    parts.append(rumpled(duvet, rng, min(0.045, 0.3 * drop), 0.35))
    if rng.random() < 0.6:
        fold = rounded_box(
            (-x - 0.04, top - drop * 0.7, head - 0.01), (x + 0.04, top + 0.095, head + 0.26), sheet, 0.04, 1, step=fine
        )
        parts.append(rumpled(fold, rng, min(0.025, 0.25 * drop), 0.3))
    if rng.random() < 0.5:
        throw = finishes.cloth(rng, weave=finishes.choose(rng, "coarse", "checks", "stripes"))
        a = z1 - float(rng.uniform(0.45, 0.7))
        spread = rounded_box(
            (-x - 0.05, top - drop - 0.04, a), (x + 0.05, top + 0.085, a + 0.38), throw, 0.03, 1, step=fine
        )
        parts.append(rumpled(spread, rng, min(0.02, 0.25 * drop), 0.3))
    return parts


def _headboard(
    rng: np.random.Generator, style: str, x: float, z: float, low: float, h: float, m: Material, cover: Material
) -> list[Model]:
    """What stands at the head, its back at z, from |x| to -|x|, from low to h m."""
    if style == "panel":
        parts = [rounded_box((-x, low, z), (x, h, z + 0.035), m, 0.008, grain="x", step=0.25)]
        n = int(rng.integers(0, 4))
        ys = np.linspace(0.5, h - 0.05, n + 1)
        return parts + [
            rounded_box((-x + 0.05, a + 0.015, z + 0.03), (x - 0.05, b - 0.015, z + 0.045), m, 0.004, grain="x")
            for a, b in zip(ys[:-1].tolist(), ys[1:].tolist(), strict=True)
        ]
    if style == "channels":
        n = max(3, round(2 * x / float(rng.uniform(0.14, 0.3))))
        w = 2 * x / n
        parts = [rounded_box((-x + 0.01, low, z), (x - 0.01, h - 0.02, z + 0.05), cover, 0.01, 2)]
        pads = [
            cushion((-x + k * w, 0.32, z + 0.02), (-x + (k + 1) * w, h, z + 0.1), cover, 0.4, 0.2, 1) for k in range(n)
        ]
        return parts + pads
    if style == "tufted":
        nx, ny = max(3, round(2 * x / 0.26)), max(2, round((h - 0.4) / 0.24))
        w, t = 2 * x / nx, (h - 0.35) / ny
        parts = [rounded_box((-x + 0.01, low, z), (x - 0.01, h - 0.02, z + 0.05), cover, 0.01, 2)]
        return parts + [
            cushion(
                (-x + i * w, 0.35 + k * t, z + 0.02),
                (-x + (i + 1) * w, 0.35 + (k + 1) * t, z + 0.09),
                cover,
                0.5,
                0.2,
                1,
            )
            for i in range(nx)
            for k in range(ny)
        ]
    if style == "metal":
        hoop = [
            (-x + 0.02, 0, z + 0.02),
            (-x + 0.02, h - 0.02, z + 0.02),
            (x - 0.02, h - 0.02, z + 0.02),
            (x - 0.02, 0, z + 0.02),
        ]
        parts = [
            tube(bent(hoop, 0.12, 5), 0.018, m),
            beam((-x + 0.02, 0.5, z + 0.02), (x - 0.02, 0.5, z + 0.02), 0.02, 0.02, m),
        ]
        xs = np.linspace(-x, x, max(5, round(2 * x / 0.15)))[1:-1]
        return parts + [tube([(a, 0.5, z + 0.02), (a, h - 0.025, z + 0.02)], 0.007, m, 6) for a in xs.tolist()]
    # Slats between two posts.
    parts = [
        rounded_box((s * (x - 0.03) - 0.03, 0, z), (s * (x - 0.03) + 0.03, h, z + 0.05), m, grain="y") for s in (-1, 1)
    ]
    parts += [
        rounded_box((-x + 0.06, y - 0.04, z + 0.01), (x - 0.06, y + 0.04, z + 0.04), m, grain="x")
        for y in (h - 0.06, 0.45)
    ]
    xs = np.linspace(-x + 0.06, x - 0.06, max(4, round(2 * x / float(rng.uniform(0.1, 0.2)))))[1:-1]
    return parts + [
        rounded_box((a - 0.02, 0.49, z + 0.017), (a + 0.02, h - 0.1, z + 0.033), m, grain="y") for a in xs.tolist()
    ]


def bed(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A single or a double bed: head boards of panels, slats, tubes or cushions; on legs or a box."""
    wide = limits.width >= 1.45 and rng.random() < 0.75
    size = draw_size(rng, limits, (1.45, 1.85) if wide else (0.95, 1.1), (2.05, 2.2), (0.85, 1.2))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng, "black metal", "brass", "steel")
    cover, cloth = finishes.upholstery(rng)
    style = finishes.choose(rng, "panel", "slats", "channels", "tufted", "metal")
    material = {"channels": cloth, "tufted": cloth, "metal": "metal"}.get(style, name)
    frame = {"channels": cover, "tufted": cover, "metal": iron}.get(style, m)
    x, z0, z1 = w / 2 - 0.06, -d / 2 + 0.09, d / 2 - 0.05
    foot, deck = float(rng.uniform(0.1, 0.2)), 0.30
    boxspring = style in ("channels", "tufted") and rng.random() < 0.6
    if boxspring:
        foot = 0.06
    parts = _headboard(rng, style, w / 2, -d / 2, 0.0, h, frame, cover)
    legs = [(s * (x - 0.03), e) for s in (-1, 1) for e in (z0 + 0.15, z1 - 0.06)]
    parts += [leg((a, foot, e), (a, 0, e), 0.028, m if style != "metal" else iron, 0.7) for a, e in legs]
    parts += [
        rounded_box(
            (s * x - 0.02, foot, z0 - 0.05),
            (s * x + 0.02, deck + 0.03, z1),
            frame,
            0.008 if not boxspring else 0.015,
            2,
        )
        for s in (-1, 1)
    ]
    parts.append(rounded_box((-x - 0.02, foot, z1), (x + 0.02, deck + 0.03, z1 + 0.03), frame, 0.008))
    parts.append(box((-x + 0.02, foot + 0.02, z0 - 0.04), (x - 0.02, deck, z1), frame))
    if style in ("slats", "metal") and rng.random() < 0.5:
        end = _headboard(rng, style, w / 2, d / 2 - 0.05, 0.0, 0.62, frame, cover)
        parts += end
    parts += _bedding(rng, x - 0.025, z0 - 0.03, z1 - 0.01, deck, 0.24, 2 if w > 1.3 else 1)
    return made(parts, size, {"material": material, "shape": "double" if w > 1.3 else "single"}, surface=True)


def child_bed(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small bed with guard rails: plain, with drawers, or under a little house's beams."""
    size = draw_size(rng, limits, (0.78, 0.95), (1.5, 1.8), (0.65, 1.55))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    x, z, deck = w / 2 - 0.02, d / 2 - 0.02, 0.24
    house = h > 1.25
    top = 0.62 if house else h
    parts = [
        rounded_box(
            (s * x - 0.02, 0, e * z - 0.02),
            (s * x + 0.02, (h - 0.25) if house else (top if e < 0 else 0.5), e * z + 0.02),
            m,
            grain="y",
        )
        for s in (-1, 1)
        for e in (-1, 1)
    ]
    parts += [
        rounded_box((s * x - 0.012, 0.1, -z + 0.02), (s * x + 0.012, deck + 0.06, z - 0.02), m, grain="z")
        for s in (-1, 1)
    ]
    for e, y1 in ((-1, top - 0.02), (1, 0.48)):
        parts.append(rounded_box((-x + 0.02, 0.1, e * z - 0.012), (x - 0.02, y1, e * z + 0.012), m, 0.006, grain="x"))
    parts.append(box((-x, deck - 0.02, -z), (x, deck, z), m))
    for s in (-1, 1):
        end = z - 0.02 if s < 0 else -z + 0.55 * d
        parts.append(rounded_box((s * x - 0.012, 0.47, -z + 0.02), (s * x + 0.012, 0.53, end), m, 0.006, grain="z"))
        posts = np.arange(-z + 0.2, end - 0.05, 0.3)
        parts += [
            rounded_box((s * x - 0.01, deck + 0.05, a), (s * x + 0.01, 0.48, a + 0.04), m) for a in posts.tolist()
        ]
        if s > 0:
            parts.append(rounded_box((s * x - 0.011, deck, end - 0.04), (s * x + 0.011, 0.5, end), m))
    if house:
        for e in (-1, 1):
            parts += [beam((s * x, h - 0.27, e * z), (0, h - 0.02, e * z), 0.04, 0.04, m) for s in (-1, 1)]
        parts.append(beam((0, h - 0.04, -z), (0, h - 0.04, z), 0.04, 0.04, m))
        parts += [beam((s * x, h - 0.27, -z), (s * x, h - 0.27, z), 0.035, 0.035, m) for s in (-1, 1)]
    parts += _bedding(rng, x - 0.06, -z + 0.03, z - 0.06, deck, 0.12, 1, 0.07)
    return made(parts, size, {"material": name} | ({"style": "house-shaped"} if house else {}))


def _ladder(x: float, z: float, h: float, m: Material) -> list[Model]:
    """A ladder along z at x, its stiles 0.32 m apart."""
    parts = [
        rounded_box((x - 0.02, 0, z + s * 0.16 - 0.02), (x + 0.02, h, z + s * 0.16 + 0.02), m, grain="y")
        for s in (-1, 1)
    ]
    return parts + [
        rounded_box((x - 0.014, y, z - 0.14), (x + 0.014, y + 0.03, z + 0.14), m)
        for y in np.arange(0.25, h - 0.1, 0.26).tolist()
    ]


def bunk_bed(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Two beds over each other with a ladder and rails, of wood or of steel."""
    size = draw_size(rng, limits, (0.95, 1.1), (1.9, 2.1), (1.5, 1.75))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    if rng.random() < 0.3:
        m, name = finishes.metal(rng, "black metal", "steel")
    x, z, upper = w / 2 - 0.055, d / 2 - 0.03, h - 0.42
    parts = [
        rounded_box((s * x - 0.03, 0, e * z - 0.03), (s * x + 0.03, h, e * z + 0.03), m, grain="y")
        for s in (-1, 1)
        for e in (-1, 1)
    ]
    for deck in (0.26, upper):
        parts += [
            rounded_box(
                (s * x - 0.015, deck - 0.1, -z + 0.03), (s * x + 0.015, deck + 0.05, z - 0.03), m, 0.004, grain="z"
            )
            for s in (-1, 1)
        ]
        parts += [
            rounded_box(
                (-x + 0.03, deck - 0.1, e * z - 0.015), (x - 0.03, deck + 0.05, e * z + 0.015), m, 0.004, grain="x"
            )
            for e in (-1, 1)
        ]
        parts.append(box((-x + 0.015, deck - 0.02, -z + 0.015), (x - 0.015, deck, z - 0.015), m))
        rails = (deck + 0.19, deck + 0.34)
        parts += [
            rounded_box((-x + 0.03, y - 0.04, e * z - 0.012), (x - 0.03, y + 0.04, e * z + 0.012), m, 0.004, grain="x")
            for e in (-1, 1)
            for y in rails
        ]
        parts += _bedding(rng, x - 0.03, -z + 0.03, z - 0.03, deck, 0.13, 1, 0.04, 0.17)
    for s in (-1, 1):
        end = z - 0.03 if s < 0 else z - 0.55
        parts += [
            rounded_box((s * x - 0.012, y - 0.04, -z + 0.03), (s * x + 0.012, y + 0.04, end), m, 0.004, grain="z")
            for y in (upper + 0.22, upper + 0.36)
        ]
    parts.append(rounded_box((x - 0.012, upper, z - 0.59), (x + 0.012, upper + 0.4, z - 0.55), m))
    parts += _ladder(x + 0.035, z - 0.3, upper + 0.35, m)
    return made(parts, size, {"material": name}, surface=False)


def crib(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cot: four posts, slats all around, a small mattress."""
    size = draw_size(rng, limits, (0.65, 0.8), (1.2, 1.45), (0.82, 1.0))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    x, z, deck = w / 2 - 0.025, d / 2 - 0.025, float(rng.uniform(0.28, 0.42))
    parts = [leg((s * x, 0.16, e * z), (s * x, 0, e * z), 0.025, m, 0.6) for s in (-1, 1) for e in (-1, 1)]
    parts += [
        rounded_box((s * x - 0.025, 0.15, e * z - 0.025), (s * x + 0.025, h, e * z + 0.025), m, 0.006, grain="y")
        for s in (-1, 1)
        for e in (-1, 1)
    ]
    solid = rng.random() < 0.4
    for y in (0.2, h - 0.05):
        parts += [
            rounded_box(
                (s * x - 0.015, y - 0.03, -z + 0.025), (s * x + 0.015, y + 0.03, z - 0.025), m, 0.006, grain="z"
            )
            for s in (-1, 1)
        ]
        parts += [
            rounded_box(
                (-x + 0.025, y - 0.03, e * z - 0.015), (x - 0.025, y + 0.03, e * z + 0.015), m, 0.006, grain="x"
            )
            for e in (-1, 1)
        ]
    n = max(9, round(d / 0.085))
    zs = np.linspace(-z + 0.02, z - 0.02, n + 2)[1:-1].tolist()
    parts += [
        box((s * x - 0.008, 0.23, a - 0.011), (s * x + 0.008, h - 0.08, a + 0.011), m, "y") for s in (-1, 1) for a in zs
    ]
    if solid:
        parts += [
            rounded_box((-x + 0.025, 0.23, e * z - 0.01), (x - 0.025, h - 0.08, e * z + 0.01), m, 0.003, grain="x")
            for e in (-1, 1)
        ]
    else:
        xs = np.linspace(-x + 0.02, x - 0.02, max(5, round(w / 0.085)) + 2)[1:-1].tolist()
        parts += [
            box((a - 0.011, 0.23, e * z - 0.008), (a + 0.011, h - 0.08, e * z + 0.008), m, "y")
            for e in (-1, 1)
            for a in xs
        ]
    parts.append(box((-x + 0.01, deck - 0.02, -z + 0.01), (x - 0.01, deck, z - 0.01), m))
    parts += _bedding(rng, x - 0.035, -z + 0.03, z - 0.04, deck, 0.09, 1, 0.05)
    return made(parts, size, {"material": name}, surface=False)


GENERATORS: dict[str, Generator] = {"bed": bed, "child bed": child_bed, "bunk bed": bunk_bed, "crib": crib}
