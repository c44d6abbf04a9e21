"""Kitchen units: base, drawer, wall and tall cabinets, sink, island.

Everything of one kitchen matches where each generator gets a random generator of the same seed: the first thing each of
them draws is the kitchen's style. Base units are ``DEPTH`` deep and ``HEIGHT`` high, worktop included;
handles stand out before that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import doors, draw_size, drawer_fronts, made
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.solids import bent, box, cylinder, moved, rounded_box, tube
from openmap_scenes.scene import Material

DEPTH, HEIGHT = 0.6, 0.9
# How far handles stand out before the worktop.
GRIP = 0.045
PLINTH, TOP = 0.10, 0.035
FRONT = DEPTH / 2 - 0.03


@dataclass(frozen=True)
class KitchenStyle:
    """What the units of one kitchen share."""

    fronts: Material
    upper: Material
    case: Material
    worktop: Material
    iron: Material
    steel: Material
    grip: str
    framed: bool
    material: str


def kitchen_style(rng: np.random.Generator) -> KitchenStyle:
    """Draws a style; always the first and the same number of draws."""
    seed = int(rng.integers(2**63))
    own = np.random.default_rng(seed)
    wood, name = finishes.wood(own)
    paint = finishes.painted(finishes.shade(own, finishes.PAINTS))
    second = finishes.painted(finishes.shade(own, finishes.PAINTS[:3]))
    wooden = bool(own.random() < 0.35)
    fronts = wood if wooden else paint
    top = finishes.choose(own, "wood", "stone", "stone", "white")
    worktop = {
        "wood": finishes.wood(own, "oak", "beech", "walnut")[0],
        "stone": finishes.stone(own)[0],
        "white": finishes.painted((0.90, 0.89, 0.87)),
    }[top]
    return KitchenStyle(
        fronts,
        second if own.random() < 0.4 else fronts,
        finishes.painted((0.90, 0.90, 0.88)) if own.random() < 0.6 else fronts,
        worktop,
        finishes.metal(own)[0],
        finishes.metal(own, "steel")[0],
        finishes.choose(own, "bar", "bar", "knob", "cup", "strip"),
        bool(own.random() < 0.4),
        name if wooden else "wood",
    )


def base_body(s: KitchenStyle, w: float, top: float | None = None) -> list[Model]:
    """Plinth, case and worktop of a base unit, w m wide; without a worktop where the case ends at ``top`` m."""
    z = DEPTH / 2
    parts = [
        box((-w / 2, 0.0, -z), (w / 2, PLINTH, FRONT - 0.05), s.case, "x"),
        rounded_box((-w / 2, PLINTH, -z), (w / 2, HEIGHT - TOP if top is None else top, FRONT), s.case, 0.001),
    ]
    if top is None:
        parts.append(rounded_box((-w / 2, HEIGHT - TOP, -z), (w / 2, HEIGHT, z), s.worktop, 0.003, grain="x", step=0.2))
    return parts


def base_size(
    rng: np.random.Generator, limits: Limits, width: tuple[float, float]
) -> tuple[float, float, float] | None:
    """A width in steps of 5 cm, and the depth and height of every base unit."""
    if limits.depth < DEPTH + GRIP or limits.height < HEIGHT or limits.width < width[0]:
        return None
    w = width[0] + float(rng.random()) * (min(width[1], limits.width) - width[0])
    return max(width[0], int(w * 20) / 20), DEPTH + GRIP, HEIGHT


def span(w: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Corners (x, y) of a base unit's front."""
    return (-w / 2 + 0.001, PLINTH + 0.004), (w / 2 - 0.001, HEIGHT - TOP - 0.004)


def kitchen_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A base unit with doors, with or without a drawer above them."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.4, 0.8))
    if size is None:
        return None
    (x0, y0), (x1, y1) = span(size[0])
    n, cut = (2 if size[0] > 0.6 else 1), y1
    parts = base_body(s, size[0])
    if rng.random() < 0.5:
        cut = y1 - 0.15
        parts += drawer_fronts((x0, cut), (x1, y1), FRONT, 1, 1, s.fronts, s.iron, s.grip)
    parts += doors((x0, y0), (x1, cut), FRONT, n, s.fronts, s.iron, s.grip, s.framed, 0.85)
    return made(parts, size, {"material": s.material})


def kitchen_drawers(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A base unit of three or four drawers."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.4, 0.8))
    if size is None:
        return None
    (x0, y0), (x1, y1) = span(size[0])
    cut, rows = y1 - 0.15, int(rng.integers(2, 4))
    parts = base_body(s, size[0]) + drawer_fronts((x0, cut), (x1, y1), FRONT, 1, 1, s.fronts, s.iron, s.grip)
    parts += drawer_fronts((x0, y0), (x1, cut), FRONT, 1, rows, s.fronts, s.iron, s.grip, framed=s.framed)
    return made(parts, size, {"material": s.material, "style": "with drawers"})


def kitchen_sink(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A base unit with one or two basins let into its worktop, and a tap."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.6, 1.0))
    if size is None or limits.height < HEIGHT + 0.42:
        return None
    w = size[0]
    low, high = span(w)
    deep = 0.17
    parts = base_body(s, w, HEIGHT - deep - 0.01)
    parts += doors(low, high, FRONT, 2 if w > 0.6 else 1, s.fronts, s.iron, s.grip, s.framed, 0.85)
    basin = s.steel if rng.random() < 0.65 else finishes.ceramic(rng)
    x1 = min(w / 2 - 0.06, 0.42)
    x0 = -x1 if w < 0.75 or rng.random() < 0.5 else 0.02 - x1 * 0.3
    z0, z1, y, z = -0.15, 0.22, HEIGHT - TOP, DEPTH / 2
    # The worktop is a frame around the basin.
    around = ((-w / 2, -z, w / 2, z0), (-w / 2, z1, w / 2, z), (-w / 2, z0, x0, z1), (x1, z0, w / 2, z1))
    parts += [box((xa, y, za), (xb, HEIGHT, zb), s.worktop, "x") for xa, za, xb, zb in around]
    # Under it the case is hollow where the basin hangs.
    hole = ((-w / 2, -z, w / 2, z0), (-w / 2, z1, w / 2, FRONT), (-w / 2, z0, x0, z1), (x1, z0, w / 2, z1))
    parts += [box((xa, HEIGHT - deep - 0.01, za), (xb, y, zb), s.case) for xa, za, xb, zb in hole]
    bowls = [(x0, x1)] if x1 - x0 < 0.6 else [(x0, (x0 + x1) / 2), ((x0 + x1) / 2, x1)]
    rim = 0.012
    for a, b in bowls:
        lip, e = HEIGHT + 0.004, 0.02
        parts += [
            box((a + e, HEIGHT - deep, z0 + e), (b - e, HEIGHT - deep + rim, z1 - e), basin),
            box((a, HEIGHT - deep, z0), (a + e, lip, z1), basin),
            box((b - e, HEIGHT - deep, z0), (b, lip, z1), basin),
            box((a + e, HEIGHT - deep, z0), (b - e, lip, z0 + e), basin),
            box((a + e, HEIGHT - deep, z1 - e), (b - e, lip, z1), basin),
        ]
        drain = finishes.painted((0.25, 0.25, 0.26))
        parts.append(
            cylinder(0.03, HEIGHT - deep + rim, HEIGHT - deep + rim + 0.003, drain, 0.001, 14, ((a + b) / 2, 0.0))
        )
    if x0 > -w / 2 + 0.2:
        ribs = [
            box((x, HEIGHT, z0 + 0.02), (x + 0.008, HEIGHT + 0.004, z1 - 0.02), basin)
            for x in np.arange(-w / 2 + 0.06, x0 - 0.03, 0.03)
        ]
        parts += ribs
    parts.append(moved(tap(rng, s.iron if rng.random() < 0.5 else s.steel), (x0 + x1) / 2, HEIGHT, z0 - 0.05))
    return made(
        parts,
        (size[0], size[1], HEIGHT + 0.42),
        {"material": s.material, "basin": "steel" if basin is s.steel else "ceramic"},
    )


def tap(rng: np.random.Generator, m: Material, tall: float = 0.3, reach: float = 0.18) -> Model:
    """A mixer tap whose foot is at the origin and whose spout runs to +z: a swan neck or a right angle."""
    tall *= float(rng.uniform(0.85, 1.15))
    foot = [cylinder(0.024, 0.0, 0.03, m, 0.004, 14)]
    if rng.random() < 0.5:
        r, phi = min(reach, tall) / 2, np.linspace(0.0, np.pi, 10)
        neck = np.stack([0 * phi, tall - r + r * np.sin(phi), r - r * np.cos(phi)], 1)
        foot.append(tube(np.concatenate([[[0, 0.02, 0]], neck, [[0, tall - 1.4 * r, 2 * r]]]), 0.011, m))
    else:
        foot.append(
            tube(
                bent(
                    [(0, 0.02, 0), (0, tall * 0.8, 0), (0, tall * 0.8, reach), (0, tall * 0.8 - 0.03, reach)], 0.02, 3
                ),
                0.013,
                m,
            )
        )
    foot.append(tube([(0.015, 0.05, 0), (0.05, 0.06, 0), (0.085, 0.085, 0)], [0.010, 0.008, 0.006], m, 6))
    return merge(foot)


def wall_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cupboard that hangs over the worktop."""
    s = kitchen_style(rng)
    size = draw_size(rng, limits, (0.4, 0.9), (0.30, 0.36), (0.6, 0.75))
    if size is None:
        return None
    w, d, h = size
    z = d / 2 - 0.03
    parts = [rounded_box((-w / 2, 0, -d / 2), (w / 2, h, z), s.case, 0.001)]
    parts += doors((-w / 2, 0), (w / 2, h), z, 2 if w > 0.6 else 1, s.upper, s.iron, s.grip, s.framed, 0.15)
    return made(parts, size, {"material": s.material}, 1.42, surface=False)


def tall_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A kitchen's high unit: two doors over each other."""
    s = kitchen_style(rng)
    size = draw_size(rng, limits, (0.45, 0.65), (DEPTH + GRIP, DEPTH + GRIP), (1.95, 2.15))
    if size is None:
        return None
    w, _, h = size
    parts = [
        box((-w / 2, 0, -DEPTH / 2), (w / 2, PLINTH, FRONT - 0.05), s.case),
        rounded_box((-w / 2, PLINTH, -DEPTH / 2), (w / 2, h, FRONT), s.case, 0.001),
    ]
    cut = 1.25
    parts += doors((-w / 2, PLINTH + 0.004), (w / 2, cut), FRONT, 1, s.fronts, s.iron, s.grip, s.framed, 0.8)
    parts += doors((-w / 2, cut), (w / 2, h - 0.002), FRONT, 1, s.fronts, s.iron, s.grip, s.framed, 0.15)
    return made(parts, size, {"material": s.material}, surface=False)


def kitchen_island(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A free block with a wide worktop, doors and drawers in front and an overhang to sit at behind."""
    s = kitchen_style(rng)
    size = draw_size(rng, limits, (1.1, 2.0), (0.7, 1.0), (0.88, 0.94))
    if size is None:
        return None
    w, d, h = size
    over = 0.25 if d > 0.85 else 0.03
    z0, z1, x = -d / 2 + over, d / 2 - 0.05, w / 2 - 0.03
    parts = [
        box((-x + 0.03, 0, z0 + 0.03), (x - 0.03, PLINTH, z1 - 0.04), s.case),
        rounded_box((-x, PLINTH, z0), (x, h - 0.045, z1), s.fronts, 0.003),
        rounded_box((-w / 2, h - 0.045, -d / 2), (w / 2, h, d / 2), s.worktop, 0.005, grain="x", step=0.22),
    ]
    n = max(2, round(w / 0.55))
    step = 2 * x / n
    for k in range(n):
        a, b = (-x + k * step, PLINTH + 0.004), (-x + (k + 1) * step, h - 0.05)
        if k % 2 == int(rng.integers(2)):
            parts += drawer_fronts(a, b, z1, 1, 3, s.fronts, s.iron, s.grip, framed=s.framed)
        else:
            parts += doors(a, b, z1, 1, s.fronts, s.iron, s.grip, s.framed, 0.85)
    return made(parts, size, {"material": s.material, "shape": "rectangular"})


GENERATORS: dict[str, Generator] = {
    "kitchen cabinet": kitchen_cabinet,
    "kitchen drawers": kitchen_drawers,
    "kitchen sink": kitchen_sink,
    "wall cabinet": wall_cabinet,
    "tall cabinet": tall_cabinet,
    "kitchen island": kitchen_island,
}
