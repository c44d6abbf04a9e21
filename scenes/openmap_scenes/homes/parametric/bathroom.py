"""Bathroom ceramics and cupboards: toilet, bidet, washbasin, vanity, bathroom cabinet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.kitchen import tap
from openmap_scenes.homes.parametric.parts import base, doors, draw_size, drawer_fronts, made
from openmap_scenes.homes.solids import (
    box,
    cylinder,
    leg,
    loft,
    moved,
    oval,
    prism,
    rounded_box,
    tube,
)
from openmap_scenes.scene import Material

# y, half width, half depth, shift along z of one ring of a bowl, m.
Ring = tuple[float, float, float, float]


def bowl(rings: Sequence[Ring], m: Material, power: float = 2.4, sharp: Sequence[int] = (), sides: int = 32) -> Model:
    """A skin over superellipses, from the foot outside up over the rim and down inside."""
    out = []
    for y, a, b, z in rings:
        o = _even(oval(a, b, 16 * sides, power), sides)
        out.append(np.stack([o[:, 0], np.full(sides, y), o[:, 1] + z], 1))
    return loft(np.array(out), m, sharp, 0.2)


def _even(outline: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.float64]:
    """``count`` points (count, 2) at equal distances along a closed outline (N, 2): long sides get their share."""
    closed = np.concatenate([outline, outline[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(count) / count * length[-1]
    return np.stack([np.interp(at, length, closed[:, k]) for k in range(2)], 1)


def toilet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A toilet: with a cistern on it, its foot skirted or waisted, or hung from a boxed-in wall."""
    size = draw_size(rng, limits, (0.36, 0.42), (0.62, 0.72), (0.76, 0.9))
    if size is None:
        return None
    w, d, h = size
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome")[0]
    style = finishes.choose(rng, "cistern", "skirted", "hung")
    seat, a = 0.40, w / 2
    tank = 0.18 if style != "hung" else 0.14
    back, front = -d / 2 + tank - 0.02, d / 2
    b, zc = (front - back) / 2, (front + back) / 2
    foot = {"cistern": (0.62, 0.66), "skirted": (0.86, 0.94), "hung": (0.7, 0.6)}[style]
    low = 0.0 if style != "hung" else 0.12
    rings: list[Ring] = [
        (low, a * foot[0], b * foot[1], zc - 0.05),
        (low + 0.06, a * foot[0] * 0.95, b * foot[1] * 0.97, zc - 0.05),
        (seat - 0.16, a * (foot[0] + 0.1), b * (foot[1] + 0.12 * (1 - foot[1])), zc - 0.03),
        (seat - 0.05, a * 0.97, b * 0.97, zc),
        (seat, a * 0.98, b * 0.99, zc),
        (seat, a * 0.72, b * 0.72, zc + 0.01),
        (seat - 0.08, a * 0.6, b * 0.6, zc + 0.02),
        (seat - 0.2, a * 0.28, b * 0.3, zc),
    ]
    parts = [bowl(rings, white, sharp=(4, 5))]
    tint = white if rng.random() < 0.75 else finishes.wood(rng)[0]
    lid = prism(oval(a, b * 0.98, 32, 2.3), seat + 0.002, seat + 0.022, tint, 0.006)
    parts.append(moved(lid, 0, 0, zc))
    if rng.random() < 0.5:
        # The lid is closed: a second, slightly smaller plate.
        parts.append(moved(prism(oval(a * 0.97, b * 0.95, 32, 2.3), seat + 0.023, seat + 0.04, tint, 0.01), 0, 0, zc))
    else:
        hole = finishes.painted((0.60, 0.64, 0.66), "water")
        parts.append(
            moved(prism(oval(a * 0.62, b * 0.62, 28, 2.2), seat + 0.0215, seat + 0.0225, hole, 0.0005), 0, 0, zc + 0.03)
        )
        up = rounded_box(
            (-a * 0.96, seat + 0.01, back + 0.015), (a * 0.96, seat + 2 * b * 0.85, back + 0.04), tint, 0.012, 2
        )
        parts.append(up)
    if style == "hung":
        wall = finishes.painted((0.86, 0.86, 0.85), "panel")
        parts.append(rounded_box((-a - 0.0, 0, -d / 2), (a + 0.0, h, -d / 2 + tank), wall, 0.003))
        parts.append(
            rounded_box((-0.1, h - 0.2, -d / 2 + tank - 0.002), (0.1, h - 0.06, -d / 2 + tank + 0.01), iron, 0.003)
        )
        parts += [
            rounded_box(
                (s * 0.05 - 0.035, h - 0.17, -d / 2 + tank + 0.008),
                (s * 0.05 + 0.035, h - 0.09, -d / 2 + tank + 0.014),
                iron,
                0.002,
            )
            for s in (-1, 1)
        ]
    else:
        parts.append(rounded_box((-a, seat - 0.02, -d / 2), (a, h - 0.035, -d / 2 + tank), white, 0.025, 2))
        parts.append(rounded_box((-a, h - 0.036, -d / 2), (a, h - 0.006, -d / 2 + tank + 0.004), white, 0.01, 2))
        parts.append(cylinder(0.022, h - 0.008, h, iron, 0.002, 16, (0.0, -d / 2 + tank / 2)))
        parts.append(rounded_box((-a * 0.6, 0.1, -d / 2 + 0.03), (a * 0.6, seat, back + 0.06), white, 0.02, 2))
    return made(parts, size, {"material": "ceramic"}, surface=False)


def bidet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A low oval basin with a tap at its back."""
    size = draw_size(rng, limits, (0.34, 0.40), (0.50, 0.60), (0.50, 0.56))
    if size is None:
        return None
    w, d, _ = size
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome", "brass", "black metal")[0]
    a, b, rim, slim = w / 2, d / 2, 0.40, float(rng.uniform(0.6, 0.9))
    rings: list[Ring] = [
        (0.0, a * slim, b * slim, -0.03), (0.15, a * slim, b * slim, -0.03), (rim - 0.06, a * 0.96, b * 0.97, 0),
        (rim, a, b, 0), (rim, a * 0.8, b * 0.7, 0.04), (rim - 0.06, a * 0.7, b * 0.6, 0.04), (rim - 0.13, a * 0.3, b * 0.25, 0.04),
    ]  # fmt: skip
    parts = [bowl(rings, white, sharp=(3, 4)), moved(tap(rng, iron, 0.12, 0.12), 0, rim - 0.005, -b + 0.06)]
    return made(parts, size, {"material": "ceramic"}, surface=False)


def _basin(rng: np.random.Generator, a: float, b: float, rim: float, deep: float, m: Material) -> Model:
    """A basin whose rim lies at a height; its back a little wider for the tap."""
    power = float(rng.choice([2.2, 3.0, 6.0]))
    rings: list[Ring] = [
        (rim - deep, a * 0.35, b * 0.4, -0.02), (rim - deep * 0.6, a * 0.75, b * 0.78, -0.01), (rim - 0.03, a * 0.98, b * 0.98, 0),
        (rim, a, b, 0), (rim, a * 0.86, b * 0.72, 0.04), (rim - deep * 0.45, a * 0.74, b * 0.6, 0.04),
        (rim - deep * 0.72, a * 0.4, b * 0.32, 0.03),
    ]  # fmt: skip
    return bowl(rings, m, power, (3, 4))


def washbasin(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A washbasin on a pedestal, on the wall with a bottle trap, or on two legs."""
    size = draw_size(rng, limits, (0.45, 0.65), (0.38, 0.5), (0.98, 1.12))
    if size is None:
        return None
    w, d, _ = size
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome", "brass", "black metal")[0]
    rim, style = 0.84, finishes.choose(rng, "pedestal", "half", "legs")
    parts = [_basin(rng, w / 2, d / 2, rim, 0.17, white)]
    parts.append(moved(tap(rng, iron, 0.14, 0.13), 0, rim - 0.005, -d / 2 + 0.06))
    if style == "pedestal":
        rings: list[Ring] = [
            (0, 0.12, 0.11, -0.05),
            (0.05, 0.10, 0.09, -0.05),
            (0.4, 0.075, 0.075, -0.05),
            (rim - 0.12, 0.11, 0.11, -0.03),
        ]
        parts.append(bowl(rings, white))
    else:
        if style == "half":
            half: list[Ring] = [
                (0.42, 0.05, 0.05, -d / 2 + 0.1),
                (0.55, 0.09, 0.10, -d / 2 + 0.11),
                (rim - 0.12, 0.12, 0.13, -d / 2 + 0.14),
            ]
            parts.append(bowl(half, white))
        else:
            parts += [
                leg((s * w * 0.4, rim - 0.06, d * 0.33), (s * w * 0.4, 0, d * 0.33), 0.014, iron, 1.0) for s in (-1, 1)
            ]
            parts.append(tube([(-w * 0.4, 0.6, d * 0.33), (w * 0.4, 0.6, d * 0.33)], 0.008, iron, 8))
        parts += [cylinder(0.016, 0.5, rim - 0.12, iron, 0.001, 10), cylinder(0.03, 0.45, 0.58, iron, 0.004, 14)]
        parts.append(tube([(0, 0.5, 0), (0, 0.5, -d / 2 + 0.01)], 0.014, iron))
        # It reaches the floor, as everything that stands in a room does: the pipe to the wall goes down.
        parts.append(tube([(0, 0.5, -d / 2 + 0.02), (0, 0.0, -d / 2 + 0.02)], 0.012, iron, 8))
    return made(parts, size, {"material": "ceramic"}, surface=False)


def vanity(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cupboard with one or two basins let into it or standing on it."""
    size = draw_size(rng, limits, (0.55, 1.4), (0.42, 0.54), (1.05, 1.2))
    if size is None:
        return None
    w, d, _ = size
    case, name = finishes.wood(rng)
    if rng.random() < 0.5:
        case, name = finishes.painted(finishes.shade(rng, finishes.PAINTS)), "wood"
    white, iron = finishes.ceramic(rng), finishes.metal(rng, "chrome", "brass", "black metal")[0]
    top = finishes.stone(rng, "marble")[0] if rng.random() < 0.4 else (white if rng.random() < 0.5 else case)
    foot, low = finishes.choose(rng, "plinth", "tapered", "block"), 0.15
    y, z = 0.80, d / 2 - 0.03
    parts = base(rng, foot, w - 0.02, d - 0.03, low, case, iron)
    parts.append(rounded_box((-w / 2 + 0.005, low, -d / 2), (w / 2 - 0.005, y, z), case, 0.002, grain="x"))
    parts.append(rounded_box((-w / 2, y, -d / 2), (w / 2, y + 0.025, d / 2), top, 0.004, grain="x", step=0.2))
    a, b, grip = (-w / 2 + 0.01, low + 0.004), (w / 2 - 0.01, y - 0.006), finishes.choose(rng, "bar", "knob", "strip")
    columns = max(1, round(w / 0.6))
    style = finishes.choose(rng, "doors", "drawers")
    if style == "drawers":
        parts += drawer_fronts(a, b, z, columns, 2, case, iron, grip, framed=bool(rng.random() < 0.3))
    else:
        parts += doors(a, b, z, max(2, columns), case, iron, grip, bool(rng.random() < 0.4), 0.75)
    count = 2 if w > 1.15 else 1
    vessel = rng.random() < 0.6
    for k in range(count):
        x = 0.0 if count == 1 else (k - 0.5) * w * 0.5
        r, rise = min(0.21, w * 0.38), 0.13 if vessel else 0.025
        vessel_bowl = _basin(
            rng, r * (1.0 if vessel else 1.15), min(0.17, d * 0.36), rise, 0.128 if vessel else 0.024, white
        )
        parts.append(moved(vessel_bowl, x, y + 0.025, 0.02))
        parts.append(moved(tap(rng, iron, 0.24 if vessel else 0.15, 0.14), x, y + 0.024, -d / 2 + 0.05))
    return made(
        parts, size, {"material": name, "style": "with drawers" if style == "drawers" else "with doors"}, surface=True
    )


def bathroom_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cupboard with mirrored doors on the wall, or a narrow tall one on the floor."""
    wood, name = finishes.wood(rng)
    m, called = (wood, name) if rng.random() < 0.5 else (finishes.painted(finishes.shade(rng, finishes.PAINTS)), "wood")
    iron = finishes.metal(rng, "chrome", "brass", "black metal")[0]
    if rng.random() < 0.6 or limits.height < 1.4:
        size = draw_size(rng, limits, (0.45, 0.9), (0.13, 0.2), (0.55, 0.75))
        if size is None:
            return None
        w, d, h = size
        z = d / 2 - 0.022
        parts, n = (
            [rounded_box((-w / 2, 0, -d / 2), (w / 2, h, z), m, 0.002)],
            (1 if w < 0.55 else (2 if w < 0.75 else 3)),
        )
        step = w / n
        for k in range(n):
            x0 = -w / 2 + k * step
            parts.append(rounded_box((x0 + 0.002, 0.002, z), (x0 + step - 0.002, h - 0.002, z + 0.016), m, 0.002))
            parts.append(
                box((x0 + 0.022, 0.022, z + 0.014), (x0 + step - 0.022, h - 0.022, z + 0.018), finishes.mirror_glass())
            )
        return made(parts, size, {"material": called, "style": "with mirror"}, 1.25, surface=False)
    size = draw_size(rng, limits, (0.3, 0.45), (0.28, 0.36), (1.4, 1.85))
    if size is None:
        return None
    w, d, h = size
    foot = finishes.choose(rng, "plinth", "tapered", "block")
    low, z = 0.1, d / 2 - 0.03
    parts = base(rng, foot, w - 0.01, d - 0.02, low, m, iron)
    parts.append(rounded_box((-w / 2, low, -d / 2), (w / 2, h, z), m, 0.002, grain="y"))
    grip, framed, cut = finishes.choose(rng, "bar", "knob"), bool(rng.random() < 0.4), low + 0.45 * (h - low)
    a, b = -w / 2 + 0.003, w / 2 - 0.003
    parts += doors((a, low), (b, cut), z, 1, m, iron, grip, framed, 0.8)
    parts += drawer_fronts((a, cut), (b, cut + 0.16), z, 1, 1, m, iron, grip)
    parts += doors((a, cut + 0.16), (b, h - 0.003), z, 1, m, iron, grip, framed, 0.2)
    return made(parts, size, {"material": called}, surface=False)


GENERATORS: dict[str, Generator] = {
    "toilet": toilet,
    "bidet": bidet,
    "washbasin": washbasin,
    "vanity": vanity,
    "bathroom cabinet": bathroom_cabinet,
}
