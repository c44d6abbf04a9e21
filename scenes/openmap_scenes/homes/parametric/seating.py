"""Seats besides chairs and sofas: office chairs, stools, bar stools, benches, ottomans."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import (
    bar,
    beam,
    draw_size,
    four_legs,
    frame_legs,
    made,
)
from openmap_scenes.homes.solids import (
    arc,
    bent,
    box,
    cushion,
    cylinder,
    leg,
    moved,
    oval,
    prism,
    rounded_box,
    sweep,
    tube,
    turned,
)


def office_chair(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A swivel chair on five castors: mesh back, executive leather, or a small task chair."""
    size = draw_size(rng, limits, (0.56, 0.66), (0.56, 0.66), (0.85, 1.2))
    if size is None:
        return None
    w, d, h = size
    style = finishes.choose(rng, "mesh", "executive", "task")
    iron, _ = finishes.metal(rng, "chrome", "black metal", "black metal")
    black = finishes.painted((0.12, 0.12, 0.13), "plastic")
    if style == "executive":
        cover, cloth = finishes.leather(rng), "leather"
    else:
        cover, cloth = finishes.cloth(rng, weave="coarse" if style == "mesh" else "plain"), "fabric"
    seat, reach = 0.47, min(w, d) / 2 - 0.03
    parts = [
        cylinder(0.028, 0.08, 0.25, black, sides=12),
        cylinder(0.016, 0.24, seat - 0.06, iron, sides=10),
        cylinder(0.045, 0.05, 0.11, iron, sides=14),
    ]
    for k in range(5):
        c, s = np.sin(2 * np.pi * (k + 0.5) / 5), np.cos(2 * np.pi * (k + 0.5) / 5)
        parts.append(
            sweep(
                [(0, 0.10, 0), (c * reach * 0.5, 0.085, s * reach * 0.5), (c * reach, 0.06, s * reach)],
                bar(0.04, 0.025),
                iron,
            )
        )
        wheel = turned(cylinder(0.025, -0.02, 0.02, black, sides=12), "z", np.pi / 2)
        parts.append(moved(turned(wheel, "y", float(rng.uniform(0, np.pi))), c * reach, 0.026, s * reach))
    sw, sd = w * 0.41, d * 0.4
    parts.append(box((-0.09, seat - 0.08, -0.12), (0.09, seat - 0.035, 0.1), black))
    thick = 0.10 if style == "executive" else 0.07
    parts.append(cushion((-sw, seat - 0.05, -sd), (sw, seat - 0.05 + thick, sd), cover, 0.35))
    zb, low = -sd - 0.02, seat + (0.02 if style == "executive" else 0.10)
    parts.append(
        tube(
            bent([(0, seat - 0.06, -0.1), (0, seat - 0.06, zb - 0.02), (0, low + 0.12, zb - 0.035)], 0.05, 3),
            0.018,
            black,
        )
    )
    bw = sw * (1.0 if style != "task" else 0.8)
    tall = h if style != "task" else min(h, seat + 0.42)
    if style == "mesh":
        curve = arc((0, low, zb), (0, (low + tall) / 2, zb + 0.03), (0, tall, zb - 0.05), 6)
        parts.append(sweep(curve, _sheet(bw, 0.05, 0.012), cover, (0, 0, 1)))
    else:
        pad = cushion((-bw, low, -0.05), (bw, tall, 0.05), cover, 0.35)
        parts.append(turned(moved(pad, 0, 0, zb), "x", -0.08, (0, low, zb)))
        if style == "executive" and tall > 1.0:
            pillow = cushion((-bw * 0.7, tall - 0.22, 0.0), (bw * 0.7, tall - 0.04, 0.09), cover, 0.4)
            parts.append(turned(moved(pillow, 0, 0, zb), "x", -0.08, (0, low, zb)))
    if style != "task" or rng.random() < 0.4:
        for s in (-1, 1):
            x = s * (sw + 0.02)
            parts.append(
                tube(
                    bent(
                        [(s * sw * 0.6, seat - 0.045, -0.03), (x, seat - 0.04, -0.03), (x, seat + 0.19, -0.03)], 0.04, 3
                    ),
                    0.014,
                    iron,
                )
            )
            parts.append(rounded_box((x - 0.03, seat + 0.18, -0.14), (x + 0.03, seat + 0.215, 0.13), black, 0.012, 2))
    return made(parts, size, {"material": cloth, "style": "swivel"}, surface=False)


def _sheet(half: float, curl: float, thick: float) -> npt.NDArray[np.float64]:
    """Section (18, 2) of a bent sheet whose sides come forward."""
    s = np.linspace(-1, 1, 9)
    upper = np.stack([s * half, curl * s**2 + thick], 1)
    return np.concatenate([upper, (upper - [0, thick])[::-1]])


def stool(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A low stool: round on three or four legs, square, or padded."""
    size = draw_size(rng, limits, (0.30, 0.42), (0.30, 0.42), (0.40, 0.50))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    style = finishes.choose(rng, "three legs", "four legs", "square", "padded", "metal")
    cover, cloth = finishes.upholstery(rng)
    iron, word = finishes.metal(rng)
    r = min(w, d) / 2
    parts: list[Model] = []
    if style == "three legs":
        for k in range(3):
            c, s = np.sin(2 * np.pi * k / 3), np.cos(2 * np.pi * k / 3)
            parts.append(leg((c * r * 0.5, h - 0.03, s * r * 0.5), (c * r * 0.9, 0, s * r * 0.9), 0.018, wood, 0.7))
        parts.append(cylinder(r, h - 0.035, h, wood, 0.008, 28))
        return made(parts, (2 * r, 2 * r, h), {"material": name, "shape": "round"})
    if style == "square":
        parts += four_legs(w / 2 - 0.025, d / 2 - 0.025, h - 0.02, 0.02, wood, 0.0, 0.9, square=True)
        parts += [
            beam((-w / 2 + 0.03, h * 0.35, z), (w / 2 - 0.03, h * 0.35, z), 0.018, 0.03, wood)
            for z in (-d / 2 + 0.025, d / 2 - 0.025)
        ]
        parts.append(rounded_box((-w / 2, h - 0.03, -d / 2), (w / 2, h, d / 2), wood, 0.006))
        return made(parts, size, {"material": name, "shape": "square"})
    m = iron if style == "metal" else wood
    parts += four_legs(r * 0.52, r * 0.52, h - 0.03, 0.011 if style == "metal" else 0.017, m, r * 0.12, 0.75)
    ring = np.concatenate([oval(r * 0.82, r * 0.82, 20), oval(r * 0.82, r * 0.82, 20)[:1]])
    if style == "metal":
        parts.append(tube(np.insert(ring, 1, h * 0.35, axis=1), 0.006, m, 6))
    if style == "padded":
        parts.append(cylinder(r * 0.95, h - 0.07, h - 0.045, wood, 0.004, 28))
        pad = prism(oval(r, r, 28), h - 0.045, h, cover, 0.018)
        return made([*parts, pad], (2 * r, 2 * r, h), {"material": cloth, "shape": "round", "style": "upholstered"})
    parts.append(cylinder(r, h - 0.03, h, wood if rng.random() < 0.7 else m, 0.008, 28))
    return made(parts, (2 * r, 2 * r, h), {"material": word if style == "metal" else name, "shape": "round"})


def bar_stool(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tall stool with a foot rest: four legs, a chrome column, a low back."""
    size = draw_size(rng, limits, (0.36, 0.46), (0.36, 0.46), (0.66, 1.0))
    if size is None:
        return None
    w, d, h = size
    seat = min(h, float(rng.uniform(0.64, 0.76)))
    wood, name = finishes.wood(rng)
    iron, word = finishes.metal(rng)
    cover, cloth = finishes.upholstery(rng)
    style = finishes.choose(rng, "wood", "metal", "column")
    parts: list[Model] = []
    x, z = w / 2 - 0.03, d / 2 - 0.03
    if style == "column":
        r = min(w, d) / 2
        parts += [cylinder(r, 0, 0.022, iron, 0.01, 30), cylinder(0.028, 0.02, seat - 0.03, iron, 0.002, 14)]
        loop = np.stack([0.13 * np.cos(a := np.linspace(0, 2 * np.pi, 17)), np.full(17, 0.28), 0.13 * np.sin(a)], 1)
        parts += [tube(loop, 0.009, iron, 6), beam((0, 0.28, 0), (0, 0.28, 0.13), 0.016, 0.016, iron)]
        parts.append(prism(oval(r * 0.92, r * 0.92, 28), seat - 0.07, seat, cover, 0.02))
        words = {"material": cloth, "style": "swivel"}
    else:
        m = wood if style == "wood" else iron
        t = 0.018 if style == "wood" else 0.011
        parts += four_legs(x - 0.05, z - 0.05, seat - 0.03, t, m, 0.05, 0.8, square=style == "wood")
        k = 0.05 * (1 - 0.25 / seat)
        f = 0.24
        parts += [
            beam((-x + 0.05 - k, f, s * (z - 0.05 + k)), (x - 0.05 + k, f, s * (z - 0.05 + k)), 0.018, 0.018, m)
            for s in (-1, 1)
        ]
        parts += [
            beam(
                (s * (x - 0.05 + k), f + 0.06, -z + 0.05 - k),
                (s * (x - 0.05 + k), f + 0.06, z - 0.05 + k),
                0.018,
                0.018,
                m,
            )
            for s in (-1, 1)
        ]
        padded = rng.random() < 0.5
        top = (
            cushion((-x, seat - 0.06, -z), (x, seat + 0.01, z), cover, 0.3)
            if padded
            else rounded_box((-x, seat - 0.035, -z), (x, seat, z), wood, 0.01, 2)
        )
        parts.append(top)
        words = {"material": name if style == "wood" else word}
    if h > seat + 0.15:
        m = wood if style == "wood" else iron
        parts += [
            beam((s * x * 0.75, seat - 0.02, -z + 0.02), (s * x * 0.8, h - 0.02, -z - 0.005), 0.02, 0.02, m)
            for s in (-1, 1)
        ]
        parts.append(
            sweep(
                arc((-x * 0.85, h - 0.06, -z + 0.01), (0, h - 0.06, -z - 0.03), (x * 0.85, h - 0.06, -z + 0.01), 7),
                bar(0.02, 0.11),
                wood if style == "wood" else cover,
            )
        )
    return made(parts, (w, d, h if h > seat + 0.15 else seat), words)


def bench(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bench: plank, slats, padded, or with a shelf for shoes."""
    size = draw_size(rng, limits, (0.8, 1.5), (0.32, 0.44), (0.42, 0.48))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng, "black metal", "brass")
    cover, cloth = finishes.upholstery(rng)
    style = finishes.choose(rng, "plank", "slats", "padded", "shelf")
    parts: list[Model] = []
    low = h - 0.045
    if rng.random() < 0.5 or style == "shelf":
        parts += four_legs(w / 2 - 0.05, d / 2 - 0.04, low, 0.025, wood, 0.0, 0.8, square=True)
        parts += [
            beam((-w / 2 + 0.05, low - 0.03, z), (w / 2 - 0.05, low - 0.03, z), 0.02, 0.06, wood)
            for z in (-d / 2 + 0.04, d / 2 - 0.04)
        ]
    else:
        parts += frame_legs(w / 2 - 0.14, d / 2 - 0.01, low, 0.035, iron)
    if style == "slats":
        n = int(rng.integers(4, 8))
        step = d / n
        parts += [
            rounded_box((-w / 2, low, -d / 2 + k * step + 0.006), (w / 2, h, -d / 2 + (k + 1) * step - 0.006), wood)
            for k in range(n)
        ]
    elif style == "padded":
        parts += [
            rounded_box((-w / 2, low - 0.005, -d / 2), (w / 2, low + 0.012, d / 2), wood),
            cushion((-w / 2, low + 0.01, -d / 2), (w / 2, h + 0.03, d / 2), cover, 0.25),
        ]
    else:
        parts.append(rounded_box((-w / 2, low, -d / 2), (w / 2, h, d / 2), wood, 0.006))
    if style == "shelf":
        n = 6
        parts += [
            rounded_box(
                (-w / 2 + 0.05, 0.14, -d / 2 + 0.05 + k * (d - 0.1) / n),
                (w / 2 - 0.05, 0.16, -d / 2 + 0.05 + (k + 0.6) * (d - 0.1) / n),
                wood,
            )
            for k in range(n)
        ]
    padded = style == "padded"
    return made(parts, size, {"material": cloth if padded else name} | ({"style": "upholstered"} if padded else {}))


def ottoman(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A footstool of cloth or leather: cube, drum, or tufted on short legs."""
    size = draw_size(rng, limits, (0.42, 0.75), (0.40, 0.58), (0.34, 0.45))
    if size is None:
        return None
    w, d, h = size
    cover, cloth = finishes.upholstery(rng)
    wood, _ = finishes.wood(rng)
    style = finishes.choose(rng, "cube", "drum", "legs")
    words = {"material": cloth, "style": "upholstered"}
    if style == "drum":
        r = min(w, d) / 2
        parts = [
            cylinder(r * 0.94, 0.0, 0.02, wood, 0.004, 30),
            prism(oval(r, r, 30), 0.02, h - 0.06, cover, 0.02),
            prism(oval(r, r, 30), h - 0.06, h, cover, 0.022),
        ]
        return made(parts, (2 * r, 2 * r, h), words | {"shape": "round"})
    if style == "cube":
        w = d
        parts = [
            rounded_box((-w / 2, 0.0, -d / 2), (w / 2, h - 0.09, d / 2), cover, 0.02, 2),
            cushion((-w / 2, h - 0.1, -d / 2), (w / 2, h, d / 2), cover, 0.2),
        ]
        return made(parts, (w, d, h), words | {"shape": "square"})
    parts = [*four_legs(w / 2 - 0.06, d / 2 - 0.06, 0.13, 0.022, wood, 0.03, 0.55)]
    parts.append(rounded_box((-w / 2, 0.12, -d / 2), (w / 2, h - 0.1, d / 2), cover, 0.015, 2))
    nx, nz = (3, 2) if w > 0.6 else (2, 2)
    for i in range(nx):
        for k in range(nz):
            a, b = -w / 2 + w * i / nx, -d / 2 + d * k / nz
            parts.append(cushion((a, h - 0.12, b), (a + w / nx, h, b + d / nz), cover, 0.35))
    return made(parts, size, words | {"shape": "rectangular"})


GENERATORS: dict[str, Generator] = {
    "office chair": office_chair,
    "stool": stool,
    "bar stool": bar_stool,
    "bench": bench,
    "ottoman": ottoman,
}
