"""Machines of kitchen and laundry: stove, oven, refrigerator, range hood, dishwasher, microwave, washing machine, dryer."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.kitchen import (
    DEPTH,
    FRONT,
    HEIGHT,
    PLINTH,
    TOP,
    base_body,
    base_size,
    kitchen_style,
)
from openmap_scenes.homes.parametric.parts import draw_size, drawer_fronts, handle, made
from openmap_scenes.homes.solids import bent, box, cylinder, lathe, loft, moved, rounded_box, tube, turned
from openmap_scenes.scene import Material

BLACK = (0.10, 0.10, 0.11)


def _body(rng: np.random.Generator) -> tuple[Material, str]:
    """Steel, white or black enamel, now and then a colour."""
    kind = finishes.choose(rng, "steel", "steel", "white", "white", "black", "colour")
    if kind == "steel":
        return finishes.metal(rng, "steel")[0], "steel"
    if kind == "colour":
        colours = ((0.62, 0.78, 0.76), (0.72, 0.20, 0.18), (0.90, 0.85, 0.70), (0.45, 0.58, 0.68))
        return finishes.painted(finishes.shade(rng, colours), "enamel"), "metal"
    return finishes.painted((0.94, 0.94, 0.93) if kind == "white" else (0.16, 0.16, 0.17), "enamel"), "metal"


def _oven_door(w: float, y0: float, y1: float, z: float, body: Material, iron: Material) -> list[Model]:
    """A door with a dark window and a bar across its top."""
    dark, x = finishes.painted((0.09, 0.09, 0.10), "window"), w / 2 - 0.006
    parts = [rounded_box((-x, y0, z), (x, y1, z + 0.025), body, 0.004)]
    parts.append(rounded_box((-x + 0.06, y0 + 0.06, z + 0.02), (x - 0.06, y1 - 0.11, z + 0.0275), dark, 0.002))
    way = [
        (-x + 0.05, y1 - 0.05, z + 0.02),
        (-x + 0.05, y1 - 0.05, z + 0.06),
        (x - 0.05, y1 - 0.05, z + 0.06),
        (x - 0.05, y1 - 0.05, z + 0.02),
    ]
    return [*parts, tube(bent(way, 0.012, 2), 0.008, iron)]


def _knobs(
    xs: np.ndarray[tuple[int, ...], np.dtype[np.float64]], y: float, z: float, m: Material, r: float = 0.018
) -> list[Model]:
    knob = turned(cylinder(r, 0.0, 0.022, m, 0.004, 14), "x", np.pi / 2)
    return [moved(knob, float(x), y, z) for x in xs]


def _hob(rng: np.random.Generator, w: float, y: float, body: Material) -> list[Model]:
    """Four cooking zones on y: rings on black glass, or gas burners under grates."""
    black = finishes.painted(BLACK, "hob")
    spots = [
        (sx * w * 0.23, sz * 0.13 + 0.01, r)
        for sx, sz, r in ((-1, -1, 0.075), (1, -1, 0.1), (-1, 1, 0.1), (1, 1, 0.075))
    ]
    if rng.random() < 0.55:
        parts = [rounded_box((-w / 2 + 0.012, y, -0.27), (w / 2 - 0.012, y + 0.006, 0.27), black, 0.002)]
        grey = finishes.painted((0.34, 0.33, 0.34), "ring")
        for x, z, r in spots:
            parts.append(cylinder(r, y + 0.004, y + 0.007, grey, 0.0005, 24, (x, z)))
            parts.append(cylinder(r - 0.006, y + 0.004, y + 0.0078, black, 0.0005, 24, (x, z)))
        return parts
    parts = []
    for x, z, r in spots:
        parts += [
            moved(cylinder(r * 0.55, 0.0, 0.012, body, 0.003, 18), x, y, z),
            moved(cylinder(r * 0.36, 0.012, 0.022, black, 0.003, 16), x, y, z),
        ]
        for s in (-1, 1):
            parts.append(
                box((x - 0.11, y + 0.024, z + s * 0.035 - 0.005), (x + 0.11, y + 0.034, z + s * 0.035 + 0.005), black)
            )
            parts.append(
                box((x + s * 0.035 - 0.005, y + 0.0245, z - 0.11), (x + s * 0.035 + 0.005, y + 0.0335, z + 0.11), black)
            )
        parts += [
            box((x + a - 0.006, y, z + b - 0.006), (x + a + 0.006, y + 0.026, z + b + 0.006), black)
            for a in (-0.1, 0.1)
            for b in (-0.035, 0.035)
        ]
    return parts


def stove(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cooker: a hob with knobs below its edge over an oven, a drawer at the floor."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.55, 0.75))
    if size is None or limits.height < HEIGHT + 0.03:
        return None
    w = size[0]
    body, material = _body(rng)
    iron, knobs = s.steel, finishes.painted(BLACK) if rng.random() < 0.6 else s.steel
    foot, top = 0.05, HEIGHT - 0.012
    parts = [box((-w / 2 + 0.02, 0, -DEPTH / 2 + 0.02), (w / 2 - 0.02, foot, FRONT - 0.05), finishes.painted(BLACK))]
    parts.append(rounded_box((-w / 2, foot, -DEPTH / 2), (w / 2, top, FRONT), body, 0.003))
    parts.append(rounded_box((-w / 2, top - 0.11, FRONT), (w / 2, top, FRONT + 0.02), body, 0.004))
    parts += _knobs(np.linspace(-w * 0.36, w * 0.36, int(rng.integers(5, 7))), top - 0.055, FRONT + 0.02, knobs)
    parts += _oven_door(w, 0.25, top - 0.12, FRONT, body, iron)
    parts.append(rounded_box((-w / 2 + 0.006, 0.07, FRONT), (w / 2 - 0.006, 0.24, FRONT + 0.022), body, 0.004))
    parts += _hob(rng, w, top, body)
    if rng.random() < 0.35 and limits.height > HEIGHT + 0.13:
        parts.append(rounded_box((-w / 2, top, -DEPTH / 2), (w / 2, top + 0.12, -DEPTH / 2 + 0.04), body, 0.006))
    return made(parts, (w, size[1], min(limits.height, HEIGHT + 0.13)), {"material": material})


def oven(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A built-in oven in a base unit of the kitchen, with a clock and knobs."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.6, 0.6))
    if size is None:
        return None
    w = size[0]
    face = s.steel if rng.random() < 0.6 else finishes.painted(BLACK, "glass")
    y0, y1 = PLINTH + 0.13, HEIGHT - TOP - 0.005
    parts = base_body(s, w)
    parts += drawer_fronts((-w / 2, PLINTH + 0.004), (w / 2, y0 - 0.004), FRONT, 1, 1, s.fronts, s.iron, "none")
    parts.append(rounded_box((-w / 2 + 0.004, y1 - 0.11, FRONT), (w / 2 - 0.004, y1, FRONT + 0.02), face, 0.003))
    parts.append(
        box(
            (-0.07, y1 - 0.08, FRONT + 0.018),
            (0.07, y1 - 0.03, FRONT + 0.0215),
            finishes.painted((0.05, 0.12, 0.13), "clock"),
        )
    )
    parts += _knobs(np.array([-0.2, 0.2]), y1 - 0.055, FRONT + 0.02, s.steel, 0.022)
    parts += _oven_door(w, y0, y1 - 0.115, FRONT, face, s.steel)
    return made(parts, size, {"material": "steel" if face is s.steel else "glass"})


def refrigerator(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A refrigerator: freezer below or above, two doors side by side, or a rounded one."""
    size = draw_size(rng, limits, (0.55, 0.92), (0.6, 0.72), (1.4, 1.95))
    if size is None:
        return None
    w, d, h = size
    body, material = _body(rng)
    iron, _ = finishes.metal(rng, "chrome", "steel", "black metal")
    style = finishes.choose(rng, "below", "above", "retro") if w < 0.75 else finishes.choose(rng, "side", "french")
    z, e = d / 2 - 0.06, 0.004
    side = body if rng.random() < 0.5 else finishes.painted((0.55, 0.56, 0.57), "side")
    parts = [
        box((-w / 2 + 0.02, 0, -d / 2 + 0.02), (w / 2 - 0.02, 0.04, z - 0.02), finishes.painted(BLACK)),
        rounded_box(
            (-w / 2, 0.04, -d / 2),
            (w / 2, h, z - 0.004),
            side,
            0.04 if style == "retro" else 0.004,
            2 if style == "retro" else 1,
        ),
    ]
    cut = {"below": 0.36, "above": 0.70, "retro": 0.72, "side": 0.0, "french": 0.38}[style] * h
    panels: list[tuple[float, float, float, float, float]] = []
    hinge = float(rng.choice([-1.0, 1.0]))
    if style in ("side", "french"):
        panels += [(-w / 2, -e / 2, max(cut, 0.05), h, 1.0), (e / 2, w / 2, max(cut, 0.05), h, -1.0)]
        panels += [(-w / 2, w / 2, 0.05, cut - e, 0.0)] if cut else []
    else:
        panels += [(-w / 2, w / 2, 0.05, cut - e, hinge), (-w / 2, w / 2, cut, h, hinge)]
    for x0, x1, y0, y1, grip in panels:
        soft = (0.025, 3) if style == "retro" else (0.008, 2)
        parts.append(rounded_box((x0, y0, z), (x1, y1, z + 0.045), body, *soft, grain="y"))
        if grip == 0.0:
            parts += handle("bar", 0.0, y1 - 0.06, z + 0.045, iron, False, 0.5 * w)
            continue
        x = x1 - 0.045 if grip > 0 else x0 + 0.045
        length = min(0.5, 0.55 * (y1 - y0))
        y = y0 + length / 2 + 0.05 if y0 > 0.3 * h else y1 - length / 2 - 0.05
        parts += handle("bar", x, y, z + 0.045, iron, True, length)
    if style == "side" and rng.random() < 0.6:
        parts.append(
            rounded_box(
                (-w * 0.36, h * 0.55, z + 0.04),
                (-w * 0.14, h * 0.72, z + 0.048),
                finishes.painted((0.14, 0.14, 0.16)),
                0.004,
            )
        )
    return made(parts, size, {"material": material}, surface=False)


def range_hood(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A hood over the stove: a pyramid or a slab under a chimney, or a slanted pane."""
    size = draw_size(rng, limits, (0.55, 0.9), (0.42, 0.5), (0.45, 0.75))
    if size is None:
        return None
    w, d, h = size
    body, material = _body(rng)
    style, z = finishes.choose(rng, "pyramid", "slab", "slant"), -d / 2
    parts = [rounded_box((-w / 2, 0, z), (w / 2, 0.05, d / 2), body, 0.004)]
    parts.append(rounded_box((-0.14, 0.04, z), (0.14, h, z + 0.25), body, 0.003))
    if style == "pyramid":
        y = min(0.28, 0.55 * h)
        rings = []
        for half, front, level in ((w / 2 - 0.005, d / 2 - 0.005, 0.05), (0.15, z + 0.26, y)):
            c = [(half, front), (-half, front), (-half, z + 0.001), (half, z + 0.001)]
            dense = [
                np.add(np.multiply(c[i], 1 - t), np.multiply(c[(i + 1) % 4], t))
                for i in range(4)
                for t in np.linspace(0, 1, 5)[:-1]
            ]
            rings.append([(p[0], level, p[1]) for p in dense])
        parts.append(loft(rings, body, step=0.15))
    elif style == "slant":
        glass = finishes.painted((0.12, 0.13, 0.14), "glass")
        pane = rounded_box((-w / 2, -0.012, 0.0), (w / 2, 0.012, d * 0.85), glass, 0.004)
        parts.append(moved(turned(pane, "x", 0.45), 0, 0.05 + 0.4 * d, z + 0.1))
    dark = finishes.painted((0.3, 0.3, 0.31), "filter")
    parts.append(box((-w / 2 + 0.06, -0.006, z + 0.08), (w / 2 - 0.06, 0.002, d / 2 - 0.08), dark))
    parts += _knobs(np.linspace(-0.08, 0.08, 4), 0.025, d / 2, finishes.painted(BLACK), 0.009)
    return made(parts, size, {"material": material}, 1.55, surface=False)


def dishwasher(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A dishwasher under the kitchen's worktop: a plain door with a strip of keys above."""
    s = kitchen_style(rng)
    size = base_size(rng, limits, (0.6, 0.6))
    if size is None:
        return None
    w = size[0]
    body, material = _body(rng)
    parts, y1, x = base_body(s, w), HEIGHT - TOP - 0.004, w / 2 - 0.003
    parts.append(rounded_box((-x, PLINTH + 0.004, FRONT), (x, y1 - 0.125, FRONT + 0.022), body, 0.004, grain="y"))
    parts.append(
        rounded_box(
            (-x, y1 - 0.12, FRONT),
            (x, y1, FRONT + 0.022),
            body if rng.random() < 0.5 else finishes.painted(BLACK),
            0.004,
        )
    )
    grey = finishes.painted((0.55, 0.57, 0.58))
    parts += _knobs(np.linspace(0.08, 0.24, 5), y1 - 0.06, FRONT + 0.012, grey, 0.008)
    parts.append(
        box(
            (-0.24, y1 - 0.085, FRONT + 0.02), (-0.14, y1 - 0.035, FRONT + 0.0235), finishes.painted((0.05, 0.14, 0.16))
        )
    )
    parts += handle("bar", 0.0, y1 - 0.17, FRONT + 0.022, s.steel, False, 0.42)
    return made(parts, size, {"material": material})


def microwave(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A microwave: a dark window on the left, keys or knobs on the right."""
    size = draw_size(rng, limits, (0.44, 0.54), (0.32, 0.42), (0.25, 0.32))
    if size is None:
        return None
    w, d, h = size
    body, material = _body(rng)
    iron, _ = finishes.metal(rng, "chrome", "steel")
    dark, z, cut, foot = finishes.painted(BLACK, "window"), d / 2 - 0.045, w / 2 - 0.12, 0.012
    parts = [rounded_box((-w / 2, foot, -d / 2), (w / 2, h, z), body, 0.008)]
    parts += [
        cylinder(0.014, 0.0, foot + 0.004, dark, 0.002, 10, (sx * (w / 2 - 0.04), sz * (d / 2 - 0.07)))
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    parts.append(rounded_box((-w / 2, foot, z), (cut - 0.002, h, z + 0.022), body, 0.004))
    parts.append(rounded_box((-w / 2 + 0.035, foot + 0.04, z + 0.018), (cut - 0.05, h - 0.04, z + 0.024), dark, 0.002))
    parts.append(rounded_box((cut, foot, z), (w / 2, h, z + 0.022), body if rng.random() < 0.5 else dark, 0.004))
    parts += handle("bar", cut - 0.025, (foot + h) / 2, z + 0.022, iron, True, 0.65 * h)
    x, grey = (cut + w / 2) / 2, finishes.painted((0.62, 0.63, 0.64))
    if rng.random() < 0.5:
        parts.append(
            box((x - 0.04, h - 0.06, z + 0.02), (x + 0.04, h - 0.03, z + 0.0235), finishes.painted((0.10, 0.45, 0.42)))
        )
        parts += [
            box(
                (x + i * 0.027 - 0.009, h - 0.095 - r * 0.028, z + 0.02),
                (x + i * 0.027 + 0.009, h - 0.077 - r * 0.028, z + 0.0245),
                grey,
            )
            for i in (-1, 0, 1)
            for r in range(4)
        ]
    else:
        parts += _knobs(np.array([x]), h * 0.68, z + 0.022, grey, 0.026) + _knobs(
            np.array([x]), h * 0.34, z + 0.022, grey, 0.026
        )
    return made(parts, size, {"material": material})


def _drum(rng: np.random.Generator, limits: Limits, dryer_: bool) -> Made | None:
    size = draw_size(rng, limits, (0.58, 0.62), (0.52, 0.64), (0.83, 0.88))
    if size is None:
        return None
    w, d, h = size
    body = finishes.painted(
        finishes.shade(rng, ((0.95, 0.95, 0.95), (0.95, 0.95, 0.95), (0.66, 0.67, 0.69), (0.28, 0.29, 0.31))), "enamel"
    )
    ring = finishes.metal(rng, "chrome")[0] if rng.random() < 0.6 else finishes.painted((0.35, 0.36, 0.38))
    dark, z, r = (
        finishes.painted((0.13, 0.14, 0.16), "window"),
        d / 2 - 0.045,
        float(rng.uniform(0.17, 0.2)) + 0.015 * dryer_,
    )
    parts = [rounded_box((-w / 2, 0.012, -d / 2), (w / 2, h, z), body, 0.008, step=0.2)]
    parts += [
        cylinder(0.02, 0.0, 0.02, dark, 0.002, 10, (sx * (w / 2 - 0.06), sz * (d / 2 - 0.08)))
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    parts.append(rounded_box((-w / 2 + 0.002, h - 0.125, z), (w / 2 - 0.002, h - 0.006, z + 0.012), body, 0.004))
    line = [(r + 0.02, 0.0), (r + 0.02, 0.022), (r, 0.034), (r - 0.03, 0.034), (r - 0.04, 0.016)]
    parts.append(
        moved(
            turned(lathe([*line, (r - 0.04, 0.003), (0.0, 0.003)], ring, {0, 1, 3, 4, 5}, 32), "x", np.pi / 2),
            0,
            h * 0.43,
            z - 0.001,
        )
    )
    bulge = [
        (r - 0.035, 0.0),
        (r - 0.036, 0.018),
        ((r - 0.04) * 0.75, 0.012 if not dryer_ else 0.024),
        (0.0, 0.006 if not dryer_ else 0.028),
    ]
    parts.append(
        moved(
            turned(lathe(bulge, dark if not dryer_ or rng.random() < 0.6 else body, {0, 1}, 28), "x", np.pi / 2),
            0,
            h * 0.43,
            z,
        )
    )
    parts.append(
        rounded_box((r - 0.012, h * 0.43 - 0.04, z + 0.02), (r + 0.016, h * 0.43 + 0.04, z + 0.04), ring, 0.006)
    )
    side = float(rng.choice([-1.0, 1.0]))
    parts += _knobs(np.array([side * (0.03 if dryer_ else 0.0)]), h - 0.065, z + 0.012, ring, 0.032)
    parts.append(
        box(
            (side * 0.1 - 0.045, h - 0.085, z + 0.011),
            (side * 0.1 + 0.045, h - 0.045, z + 0.0145),
            finishes.painted((0.06, 0.10, 0.14)),
        )
    )
    parts += _knobs(
        side * np.array([0.18, 0.21, 0.24]), h - 0.065, z + 0.004, finishes.painted((0.5, 0.52, 0.54)), 0.009
    )
    if not dryer_:
        parts.append(
            rounded_box(
                (min(-side * 0.27, -side * 0.1), h - 0.11, z + 0.01),
                (max(-side * 0.27, -side * 0.1), h - 0.02, z + 0.018),
                body,
                0.003,
            )
        )
    else:
        parts += [
            box((-w / 2 + 0.05, y, z - 0.001), (-w / 2 + 0.2, y + 0.006, z + 0.004), dark)
            for y in np.arange(0.05, 0.12, 0.016).tolist()
        ]
    return made(parts, size, {"material": "metal"})


def washing_machine(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A front loader: a round window, a soap drawer, a knob."""
    return _drum(rng, limits, False)


def dryer(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tumble dryer: a larger door that bulges, slots at the foot."""
    return _drum(rng, limits, True)


GENERATORS: dict[str, Generator] = {
    "stove": stove,
    "oven": oven,
    "refrigerator": refrigerator,
    "range hood": range_hood,
    "dishwasher": dishwasher,
    "microwave": microwave,
    "washing machine": washing_machine,
    "dryer": dryer,
}
