"""Where one washes all over: bathtub, shower stall; towel rack."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.bathroom import Ring, bowl
from openmap_scenes.homes.parametric.parts import beam, draw_size, made
from openmap_scenes.homes.solids import (
    arc,
    bent,
    box,
    cylinder,
    lathe,
    moved,
    rounded_box,
    rumpled,
    tube,
)
from openmap_scenes.scene import Material


def bathtub(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bathtub along x: panelled in, a free oval, or on claw feet."""
    size = draw_size(rng, limits, (1.45, 1.8), (0.68, 0.82), (0.54, 0.66))
    if size is None:
        return None
    w, d, h = size
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome", "brass", "black metal")[0]
    style = finishes.choose(rng, "panel", "panel", "oval", "claw")
    a, b, sides = w / 2, d / 2, 44
    if style == "panel":
        rim = h
        rings: list[Ring] = [
            (0.03, a - 0.02, b - 0.02, 0),
            (rim - 0.035, a - 0.02, b - 0.02, 0),
            (rim - 0.034, a, b, 0),
            (rim, a, b, 0),
        ]
        rings += [
            (rim, a - 0.07, b - 0.07, 0),
            (rim - 0.08, a - 0.10, b - 0.09, 0),
            (0.2, a - 0.2, b - 0.14, 0),
            (0.14, a - 0.28, b - 0.2, 0),
        ]
        parts = [bowl(rings, white, 16.0, (1, 2, 3, 4), sides)]
        if rng.random() < 0.4:
            wood = finishes.wood(rng)[0]
            parts.append(
                rounded_box((-a + 0.01, 0.0, b - 0.03), (a - 0.01, rim - 0.04, b - 0.004), wood, 0.002, grain="x")
            )
        else:
            parts.append(box((-a + 0.04, 0, -b + 0.04), (a - 0.04, 0.05, b - 0.04), white))
    else:
        low = 0.0 if style == "oval" else 0.12
        flare = float(rng.uniform(0.72, 0.9))
        outer = white if rng.random() < 0.6 else finishes.painted(finishes.shade(rng, finishes.PAINTS), "enamel")
        rim = h
        wall: list[Ring] = [
            (low, a * flare, b * flare, 0),
            (low + 0.05, a * (flare + 0.03), b * (flare + 0.03), 0),
            (rim - 0.05, a * 0.97, b * 0.97, 0),
        ]
        wall += [(rim - 0.02, a, b, 0), (rim, a * 0.99, b * 0.985, 0), (rim - 0.005, a * 0.94, b * 0.9, 0)]
        inner: list[Ring] = [
            (rim - 0.004, a * 0.95, b * 0.91, 0),
            (rim - 0.006, a * 0.93, b * 0.88, 0),
            (rim - 0.25, a * 0.82, b * 0.76, 0),
            (low + 0.09, a * 0.66, b * 0.56, 0),
        ]
        parts = [bowl(wall + inner[1:], white, 2.5, (), sides)]
        if outer is not white:
            # The coloured skin runs down again between itself and the white one, so that nothing closes the tub.
            lip: list[Ring] = [(rim - 0.03, a * 0.975, b * 0.97, 0), (rim - 0.032, a * 0.968, b * 0.962, 0)]
            parts = [bowl([*wall[:3], *lip, (low + 0.03, a * 0.62, b * 0.52, 0)], outer, 2.5, (3, 4), sides)]
            shell = [(low + 0.06, a * 0.6, b * 0.5, 0), (rim - 0.045, a * 0.96, b * 0.955, 0), *wall[3:], *inner[1:]]
            parts.append(bowl(shell, white, 2.5, (), sides))
        if style == "claw":
            for sx in (-1, 1):
                for sz in (-1, 1):
                    x, z = sx * a * 0.62, sz * b * 0.58
                    parts.append(
                        tube(
                            arc(
                                (x, 0.2, z),
                                (x + sx * 0.05, 0.11, z + sz * 0.05),
                                (x + sx * 0.02, 0.012, z + sz * 0.03),
                                7,
                            ),
                            np.linspace(0.035, 0.018, 7),
                            iron,
                        )
                    )
                    parts.append(
                        moved(
                            lathe([(0.0, 0.0), (0.03, 0.006), (0.032, 0.02), (0.0, 0.045)], iron, (), 12),
                            x + sx * 0.02,
                            0,
                            z + sz * 0.03,
                        )
                    )
    side = float(rng.choice([-1.0, 1.0]))
    parts.append(
        cylinder(0.02, h - 0.002, h + 0.1, iron, 0.002, 12, (side * (a - 0.035), 0.0))
        if style == "panel"
        else cylinder(0.018, 0.0, h + 0.12, iron, 0.002, 12, (0.0, -b + 0.02))
    )
    start = (side * (a - 0.035), h + 0.09, 0.0) if style == "panel" else (0.0, h + 0.11, -b + 0.02)
    end = (side * (a - 0.17), h + 0.07, 0.0) if style == "panel" else (0.0, h + 0.08, -b + 0.2)
    parts.append(tube([start, end], 0.014, iron))
    words = {"material": "ceramic", "shape": "oval" if style != "panel" else "rectangular"}
    return made(parts, (w, d, min(limits.height, h + 0.13)), words, surface=False)


def _tiles(rng: np.random.Generator) -> Material:
    """Wall tiles with pale joints, 0.15 m or bricks."""
    base_colour = np.array(
        finishes.shade(
            rng, ((0.88, 0.89, 0.88), (0.66, 0.76, 0.78), (0.55, 0.66, 0.60), (0.80, 0.76, 0.70), (0.42, 0.46, 0.5))
        )
    )
    v, u = np.mgrid[0:64, 0:128]
    tall = 32 if rng.random() < 0.5 else 16
    shift = (v // tall % 2) * 16 if tall == 16 else 0 * v
    joint = (v % tall < 1) | ((u + shift) % 32 < 1)
    tone = rng.normal(0, 0.02, (64 // tall, 5))[v // tall, (u + shift) // 32]
    rgb = np.where(joint[..., None], 0.93 * np.array([0.9, 0.9, 0.88]), base_colour * (1 + tone[..., None]))
    return Material("tiles", np.ones(3, np.float32), np.asarray(np.round(np.clip(rgb, 0, 1) * 255), np.uint8))


def shower_stall(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A shower: tray, tiled or plain back walls, frame, open in front or with a pane to the hip, head and riser."""
    size = draw_size(rng, limits, (0.8, 1.1), (0.8, 0.95), (1.95, 2.15))
    if size is None:
        return None
    w, d, h = size
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome", "chrome", "black metal", "brass")[0]
    wall = _tiles(rng) if rng.random() < 0.7 else white
    pane, x, z, rim = finishes.glass(rng), w / 2, d / 2, float(rng.uniform(0.08, 0.15))
    parts = [rounded_box((-x, 0, -z), (x, rim - 0.03, z), white, 0.01, 2, step=0.2)]
    parts += [
        rounded_box((s * (x - 0.025) - 0.025, rim - 0.035, -z), (s * (x - 0.025) + 0.025, rim, z), white, 0.008)
        for s in (-1, 1)
    ]
    parts += [
        rounded_box(
            (-x + 0.05, rim - 0.035, s * (z - 0.025) - 0.025), (x - 0.05, rim, s * (z - 0.025) + 0.025), white, 0.008
        )
        for s in (-1, 1)
    ]
    parts.append(cylinder(0.045, rim - 0.031, rim - 0.024, iron, 0.002, 18))
    parts.append(rounded_box((-x, rim, -z), (x, h, -z + 0.025), wall, 0.002, step=0.2))
    s = float(rng.choice([-1.0, 1.0]))
    parts.append(rounded_box((s * x - s * 0.025, rim, -z + 0.025), (s * x, h, z), wall, 0.002, step=0.2))
    e = 0.018
    posts = [(-s * (x - e), z - e)] + ([(s * (x - e - 0.025), z - e)] if rng.random() < 0.5 else [])
    parts += [rounded_box((px - e, rim, pz - e), (px + e, h, pz + e), iron, 0.002) for px, pz in posts]
    parts.append(
        rounded_box((-x + 0.001, h - 2 * e, z - 2 * e), (x - 0.026 if s > 0 else x - 0.001, h, z), iron, 0.002)
    )
    ox = -s * (x - e)
    parts.append(rounded_box((ox - e, h - 2 * e, -z + 0.025), (ox + e, h, z - 2 * e), iron, 0.002))
    hip = rim + float(rng.uniform(0.7, 1.0))
    parts.append(rounded_box((ox - 0.005, rim, -z + 0.03), (ox + 0.005, hip, z - 2 * e), pane, 0.001))
    parts.append(rounded_box((ox - 0.009, hip, -z + 0.03), (ox + 0.009, hip + 0.018, z - 2 * e), iron, 0.002))
    if rng.random() < 0.5:
        lo, hi = (ox + e, 0.05) if ox < 0 else (-0.05, ox - e)
        parts.append(rounded_box((lo, rim, z - 0.03), (hi, hip, z - 0.02), pane, 0.001))
        parts.append(rounded_box((lo, hip, z - 0.035), (hi, hip + 0.018, z - 0.016), iron, 0.002))
    back = -z + 0.025
    parts.append(
        tube(bent([(0, 1.0, back + 0.05), (0, h - 0.12, back + 0.05), (0, h - 0.1, back + 0.32)], 0.08, 4), 0.011, iron)
    )
    parts.append(moved(cylinder(0.1, 0.0, 0.012, iron, 0.004, 24), 0, h - 0.125, back + 0.32))
    parts.append(rounded_box((-0.12, 0.98, back), (0.12, 1.03, back + 0.06), iron, 0.012, 2))
    return made(
        parts, size, {"material": "tiles" if wall is not white else "plastic", "style": "with glass"}, surface=False
    )


def _towel(rng: np.random.Generator, x0: float, x1: float, y: float, z: float, drop: float) -> Model:
    """A towel folded over a bar at (y, z)."""
    cloth = finishes.cloth(
        rng, finishes.shade(rng, (*finishes.LINENS, *finishes.CLOTHS)), finishes.choose(rng, "tweed", "stripes")
    )
    return rumpled(
        rounded_box((x0, y - drop, z - 0.024), (x1, y + 0.02, z + 0.024), cloth, 0.018, 2, step=0.1), rng, 0.008, 0.25
    )


def towel_rack(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Bars with towels: a free stand, a leaning ladder, or two bars on a wall."""
    size = draw_size(rng, limits, (0.45, 0.7), (0.22, 0.32), (0.8, 1.6))
    if size is None:
        return None
    w, d, h = size
    iron, word = finishes.metal(rng, "chrome", "black metal", "brass")
    wood, name = finishes.wood(rng)
    style = finishes.choose(rng, "wall", "stand") if h < 1.15 else "ladder"
    m, called = (wood, name) if style == "ladder" and rng.random() < 0.6 else (iron, word)
    x, parts = w / 2 - 0.012, []
    bars: list[tuple[float, float]] = []
    if style == "wall":
        tall, deep = 0.5, min(d, 0.12)
        bars = [(tall - 0.03, deep / 2 - 0.02), (tall - 0.22, deep / 2 - 0.02)]
        for y, z in bars:
            parts.append(tube([(-x, y, z), (x, y, z)], 0.009, m))
            for s in (-1, 1):
                parts += [
                    tube([(s * (x - 0.02), y, z), (s * (x - 0.02), y, -deep / 2)], 0.008, m, 8),
                    rounded_box(
                        (s * (x - 0.02) - 0.02, y - 0.02, -deep / 2),
                        (s * (x - 0.02) + 0.02, y + 0.02, -deep / 2 + 0.01),
                        m,
                    ),
                ]
    elif style == "stand":
        for s in (-1, 1):
            parts.append(
                tube(
                    bent(
                        [
                            (s * x, 0.01, d / 2 - 0.02),
                            (s * x, h - 0.01, d * 0.12),
                            (s * x, h - 0.01, -d * 0.12),
                            (s * x, 0.01, -d / 2 + 0.02),
                        ],
                        0.04,
                        3,
                    ),
                    0.011,
                    m,
                )
            )
        bars = [(h - 0.02, 0.0), (h * 0.7, d * 0.24), (h * 0.45, -d * 0.32)]
        parts += [tube([(-x, y, z), (x, y, z)], 0.009, m) for y, z in bars]
    else:
        parts += [beam((s * x, 0.0, d / 2 - 0.03), (s * x, h, -d / 2 + 0.02), 0.024, 0.035, m) for s in (-1, 1)]
        ys = np.linspace(0.3, h - 0.1, 5).tolist()
        bars = [(y, d / 2 - 0.03 - (d - 0.05) * y / h) for y in reversed(ys)]
        parts += [tube([(-x, y, z), (x, y, z)], 0.011, m) for y, z in bars]
    chosen = [0] + [k for k in range(1, min(3, len(bars))) if rng.random() < 0.7]
    for k in chosen:
        wide = float(rng.uniform(0.45, 0.8)) * 2 * (x - 0.03)
        a = float(rng.uniform(-x + 0.03, x - 0.03 - wide))
        room = bars[k][0] - (0.02 if style != "wall" else 0.0)
        drop = min(float(rng.uniform(0.3, 0.5)), room, 0.17 if style == "wall" and k == 0 and 1 in chosen else 9.0)
        parts.append(_towel(rng, a, a + wide, *bars[k], drop))
    if style == "wall":
        return made(parts, (w, d, 0.6), {"material": called, "style": "with towels"}, 0.95, surface=False)
    return made(parts, size, {"material": called, "style": "with towels"}, surface=False)


GENERATORS: dict[str, Generator] = {
    "bathtub": bathtub,
    "shower stall": shower_stall,
    "towel rack": towel_rack,
}
