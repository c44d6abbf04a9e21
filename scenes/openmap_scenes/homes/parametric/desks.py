"""Tables with drawers of their own: desk, night stand, dressing table."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import (
    base,
    carcass,
    draw_size,
    drawer_fronts,
    four_legs,
    made,
)
from openmap_scenes.homes.solids import box, moved, oval, prism, rounded_box, turned

HANDLES = ("bar", "knob", "knob", "cup", "strip", "none")


def desk(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A desk: plain on legs, with a drawer box, with pedestals either side, or a secretary's low shelf on top."""
    size = draw_size(rng, limits, (0.95, 1.7), (0.52, 0.8), (0.72, 0.76))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng)
    style = finishes.choose(rng, "metal", "pedestal", "pedestal", "two", "drawer")
    grip, framed = finishes.choose(rng, *HANDLES), bool(rng.random() < 0.3)
    inside = finishes.painted(finishes.shade(rng, finishes.PAINTS)) if rng.random() < 0.4 else wood
    under, x, z = h - 0.028, w / 2 - 0.03, d / 2 - 0.03
    parts = [rounded_box((-w / 2, under, -d / 2), (w / 2, h, d / 2), wood, 0.005, step=0.22)]
    sides: tuple[int, ...] = ()
    if style in ("pedestal", "two") and w > 1.0:
        sides = (-1, 1) if style == "two" and w > 1.35 else (int(rng.choice([-1, 1])),)
    for s in sides:
        pw = min(0.42, 0.32 * w)
        cx = s * (w / 2 - pw / 2 - 0.01)
        case = carcass(pw, d - 0.04, 0.05, under, inside) + drawer_fronts(
            (-pw / 2, 0.05),
            (pw / 2, under),
            d / 2 - 0.02,
            1,
            int(rng.integers(3, 5)),
            inside,
            iron,
            grip,
            framed=framed,
        )
        parts += [moved(m, cx, 0, 0) for m in case]
        parts.append(box((cx - pw / 2 + 0.03, 0, -z), (cx + pw / 2 - 0.03, 0.05, z - 0.03), inside))
    free = [s for s in (-1, 1) if s not in sides]
    m = iron if style == "metal" or rng.random() < 0.3 else wood
    for s in free:
        if m is iron:
            parts += [
                rounded_box((s * x - 0.02, 0.0, e * z - 0.02), (s * x + 0.02, under, e * z + 0.02), m) for e in (-1, 1)
            ]
            parts.append(rounded_box((s * x - 0.02, under - 0.04, -z + 0.02), (s * x + 0.02, under, z - 0.02), m))
        elif rng.random() < 0.5:
            parts.append(rounded_box((s * x - 0.015, 0.0, -z - 0.01), (s * x + 0.015, under, z + 0.01), m, grain="y"))
        else:
            parts += [
                p
                for e in (-1, 1)
                for p in (
                    rounded_box(
                        (s * x - 0.025, 0.0, e * z - 0.025), (s * x + 0.025, under, e * z + 0.025), m, grain="y"
                    ),
                )
            ]
    parts.append(
        rounded_box(
            (-x, under - (0.3 if sides else 0.08), -z + 0.02),
            (x, under, -z + 0.036),
            wood if m is not iron else m,
            grain="x",
        )
    )
    if style == "drawer":
        n = 2 if w > 1.2 else 1
        parts.append(box((-x + 0.03, under - 0.11, -z + 0.05), (x - 0.03, under, z - 0.01), wood))
        parts += drawer_fronts((-x + 0.03, under - 0.11), (x - 0.03, under - 0.003), z - 0.01, n, 1, inside, iron, grip)
    return made(
        parts,
        size,
        {"material": name, "shape": "rectangular"} | ({"style": "with drawers"} if sides or style == "drawer" else {}),
    )


def nightstand(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bedside table: drawers on a base, a drawer over an open shelf, or a round one."""
    size = draw_size(rng, limits, (0.38, 0.56), (0.34, 0.46), (0.45, 0.64))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng)
    grip, style = finishes.choose(rng, *HANDLES), finishes.choose(rng, "drawers", "drawers", "open", "tall")
    inside = finishes.painted(finishes.shade(rng, finishes.PAINTS)) if rng.random() < 0.3 else wood
    foot = finishes.choose(rng, "tapered", "block", "pins", "plinth", "sled")
    low = {"plinth": 0.05, "tapered": 0.16, "block": 0.10}.get(foot, 0.13) + (0.08 if style == "tall" else 0.0)
    parts = base(rng, foot, w, d, low, wood, iron)
    deep = d - 0.02
    parts += [moved(m, 0, 0, -0.01) for m in carcass(w, deep, low, h - 0.02, wood)]
    parts.append(rounded_box((-w / 2, h - 0.022, -d / 2), (w / 2, h, d / 2), wood, 0.004, grain="x"))
    rows = 1 if style in ("open", "tall") else (3 if h - low > 0.45 else 2)
    bottom = low + 0.02 if style != "open" else low + 0.5 * (h - low)
    z = d / 2 - 0.025
    parts += drawer_fronts(
        (-w / 2 + 0.02, bottom),
        (w / 2 - 0.02, h - 0.042),
        z - 0.012,
        1,
        rows,
        inside,
        iron,
        grip,
        framed=bool(rng.random() < 0.3),
    )
    if style == "open":
        parts.append(
            rounded_box((-w / 2 + 0.02, bottom - 0.018, -d / 2 + 0.01), (w / 2 - 0.02, bottom, z), wood, grain="x")
        )
        y = low + 0.02
        for _ in range(int(rng.integers(0, 4))):
            t = float(rng.uniform(0.015, 0.035))
            cover = finishes.painted(finishes.shade(rng, finishes.CLOTHS), "cover")
            parts.append(
                moved(turned(box((-0.09, 0, -0.12), (0.09, t, 0.12), cover), "y", float(rng.normal(0, 0.15))), 0, y, 0)
            )
            y += t
    return made(parts, size, {"material": name, "style": "with drawers"})


def dressing_table(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A table with drawers and a mirror that stands on it: round, arched or rectangular."""
    size = draw_size(rng, limits, (0.8, 1.2), (0.40, 0.5), (1.25, 1.5))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng, "brass", "chrome")
    top, x, z = 0.76, w / 2 - 0.035, d / 2 - 0.035
    parts = four_legs(x, z, top - 0.022, 0.022, wood, 0.0, 0.5, square=bool(rng.random() < 0.5))
    parts.append(rounded_box((-w / 2, top - 0.022, -d / 2), (w / 2, top, d / 2), wood, 0.005))
    parts.append(rounded_box((-x, top - 0.16, -z), (x, top - 0.022, z - 0.005), wood))
    parts += drawer_fronts(
        (-x + 0.02, top - 0.155), (x - 0.02, top - 0.03), z - 0.005, int(rng.integers(2, 4)), 1, wood, iron, "knob"
    )
    glass, tall = finishes.mirror_glass(), h - top
    shape = finishes.choose(rng, "round", "arched", "rectangular")
    half = min(tall / 2 - 0.01, 0.3) if shape == "round" else min(0.32 * w, 0.34)
    back = -d / 2 + 0.035
    if shape == "rectangular":
        flat = [
            rounded_box((-half, 0.01, -0.012), (half, tall, 0.0), wood),
            box((-half + 0.03, 0.04, -0.001), (half - 0.03, tall - 0.03, 0.006), glass),
        ]
    else:
        outline = oval(half, tall / 2 - 0.005, 32, 2.0 if shape == "round" else 3.2)
        flat = []
        for scale, a, b, m in ((1.0, 0.0, 0.014, wood), (0.9, 0.01, 0.02, glass)):
            disc = turned(prism(outline * scale, a, b, m, 0.002, 0.2), "x", np.pi / 2)
            flat.append(moved(disc, 0, tall / 2 + 0.005, -0.012))
        flat.append(box((-0.09, 0.0, -0.02), (0.09, 0.04, 0.002), wood))
    parts += [moved(m, 0, top, back) for m in flat]
    for s in (-1, 1):
        if rng.random() < 0.5:
            case = s * (w / 2 - 0.13)
            parts.append(rounded_box((case - 0.12, top, -d / 2 + 0.02), (case + 0.12, top + 0.11, -d / 2 + 0.2), wood))
            parts += drawer_fronts(
                (case - 0.11, top + 0.01), (case + 0.11, top + 0.1), -d / 2 + 0.2, 1, 1, wood, iron, "knob", thick=0.01
            )
    return made(parts, size, {"material": name, "style": "with mirror"})


GENERATORS: dict[str, Generator] = {
    "desk": desk,
    "nightstand": nightstand,
    "dressing table": dressing_table,
}
