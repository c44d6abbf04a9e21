"""Things to eat and drink from: cups, mugs, glasses, plates, bowls, place settings, teapots, jars, bottles."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import bottles, kitchenware, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.glazes import glaze
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    GLASSES,
    METALS,
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
from openmap_scenes.homes.revolve import Array, ellipsoid, lathe, placed, soft_box, spline, tube, turn, vessel
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

DRINKS: tuple[Colour, ...] = ((0.22, 0.12, 0.06), (0.60, 0.42, 0.26), (0.55, 0.28, 0.10), (0.93, 0.90, 0.84))


def handle(
    at_top: tuple[float, float], at_bottom: tuple[float, float], out: float, material: Material, thick: float = 0.0055
) -> Model:
    """A handle from (radius, y) to (radius, y), ``out`` m beyond."""
    (r1, y1), (r0, y0) = at_top, at_bottom
    bow = [
        (r1 - 0.004, y1, 0),
        (r1 + out * 0.8, y1 + 0.004, 0),
        (max(r0, r1) + out, (2 * y1 + y0) / 3, 0),
        (r0 + out * 0.75, y0 + 0.1 * (y1 - y0), 0),
        (r0 - 0.004, y0, 0),
    ]
    return tube(spline(bow, 12), thick, material, 6)


def saucer(radius: float, material: Material) -> Model:
    """A plate with a raised rim, its middle at y = 0.006."""
    r = radius
    return lathe(
        [(0, 0), (r * 0.55, 0), (r * 0.62, 0.004), (r, 0.02), (r - 0.002, 0.023), (r * 0.6, 0.008), (0, 0.006)],
        material,
        26,
    )


def cup(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tea or coffee cup, mostly on a saucer, with something in it or not."""
    outside, inside, pattern = glaze(rng)
    r, h = between(rng, 0.034, 0.048), between(rng, 0.05, 0.07)
    shape = (
        [(0.5, 0), (0.75, 0.2), (0.95, 0.6), (1.0, 1.0)],
        [(0.55, 0), (0.9, 0.15), (0.97, 0.5), (1.0, 1.0)],
        [(0.45, 0), (0.6, 0.08), (0.85, 0.5), (1.08, 1.0)],
    )[int(rng.integers(3))]
    outline = spline([(a * r, b * h) for a, b in shape], 9)
    parts = [
        vessel(outline, 0.003, outside, inside, 22),
        handle((r * 0.97, h * 0.82), (r * 0.85, h * 0.3), 0.018, outside, 0.004),
    ]
    if chance(rng, 0.6):
        parts.append(_filled(r * 0.9, h * 0.8, paint(rng, DRINKS, "drink")))
    if chance(rng, 0.7):
        parts = [placed(p, (0, 0.0065, 0)) for p in parts] + [saucer(r * 1.75, inside if chance(rng, 0.5) else outside)]
    return finish(parts, limits, {"material": "ceramic", "pattern": pattern})


def _filled(radius: float, y: float, drink: Material) -> Model:
    return lathe([(radius * 0.97, y - 0.003), (radius, y), (0, y)], drink, 20)


def mug(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A straight, barrelled or tapering mug."""
    outside, inside, pattern = glaze(rng)
    r, h = between(rng, 0.037, 0.046), between(rng, 0.08, 0.105)
    style = pick(rng, "straight", "barrel", "tapering", "enamel")
    shape = {
        "straight": [(0.94, 0), (1, 0.04), (1, 0.5), (1, 1)],
        "barrel": [(0.8, 0), (1.02, 0.3), (1.05, 0.55), (0.95, 1)],
        "tapering": [(0.7, 0), (0.8, 0.3), (0.93, 0.7), (1.02, 1)],
        "enamel": [(0.97, 0), (1, 0.05), (1, 0.97), (1.06, 1)],
    }[style]
    outline = spline([(a * r, b * h) for a, b in shape], 10)
    parts = [vessel(outline, 0.0035, outside, inside, 24)]
    grip = outside if outside.texture is None else inside
    parts.append(handle((r * 0.99, h * 0.8), (r * 0.95, h * 0.22), between(rng, 0.022, 0.032), grip, 0.0055))
    if chance(rng, 0.6):
        parts.append(_filled(r * 0.95, h * 0.84, paint(rng, DRINKS, "drink")))
    return finish(parts, limits, {"material": "metal" if style == "enamel" else "ceramic", "pattern": pattern})


def glass(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tumbler, highball, wine glass, champagne flute or tankard; a third of it filled."""
    style = pick(rng, "tumbler", "highball", "wine glass", "flute", "tankard")
    clear = paint(rng, GLASSES, "glass")
    drink = paint(
        rng,
        ((0.88, 0.92, 0.94), (0.95, 0.62, 0.16), (0.45, 0.06, 0.12), (0.93, 0.86, 0.52), (0.90, 0.60, 0.12)),
        "drink",
    )
    parts: list[Model]
    if style in ("wine glass", "flute"):
        wide, tall = (between(rng, 0.036, 0.045), 0.1) if style == "wine glass" else (0.026, 0.15)
        stem = between(rng, 0.07, 0.09)
        foot = lathe(
            [
                (0, 0),
                (0.034, 0),
                (0.034, 0.002),
                (0.008, 0.008),
                (0.0035, 0.02),
                (0.0035, stem - 0.01),
                (0.008, stem),
                (0, stem),
            ],
            clear,
            20,
        )
        belly = spline(
            [
                (0.008, stem - 0.002),
                (wide * 0.85, stem + tall * 0.25),
                (wide, stem + tall * 0.5),
                (wide * 0.8, stem + tall),
            ],
            11,
        )
        fill = int(rng.integers(0, 7))
        low, rest = belly[: fill + 1], belly[fill:]
        parts = (
            [foot, vessel(rest, 0.0015, clear, clear, 20)]
            if fill == 0
            else [
                foot,
                lathe(np.concatenate([[[0, stem - 0.002]], low, [[0, low[-1, 1]]]]), drink, 20),
                _cylinder_wall(rest, clear),
            ]
        )
        return finish(parts, limits, {"material": "glass", "shape": style})
    r, h = {
        "tumbler": (between(rng, 0.034, 0.042), between(rng, 0.08, 0.1)),
        "highball": (0.032, between(rng, 0.13, 0.16)),
        "tankard": (0.042, 0.14),
    }[style]
    full = between(rng, 0.0, 0.85) if chance(rng, 0.6) else 0.0
    outline = np.array([(r * (0.86 + 0.14 * t), h * t) for t in np.linspace(0, 1, 6)])
    parts = [_cylinder_wall(outline, clear, 0.004)]
    if full > 0.2:
        top = np.array([(r * (0.86 + 0.14 * t) + 0.0004, h * t) for t in np.linspace(0.05, full, 4)])
        parts.append(lathe(np.concatenate([[[0, h * 0.05]], top, [[0, h * full]]]), drink, 20))
    if style == "tankard":
        parts.append(handle((r, h * 0.85), (r * 0.95, h * 0.2), 0.035, clear, 0.007))
    return finish(parts, limits, {"material": "glass", "shape": style})


def _cylinder_wall(outline: Array, material: Material, wall: float = 0.0015) -> Model:
    """The wall along an outline, closed below by a floor."""
    return vessel(outline, wall, material, material, 20)


def plate(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A plate, or a pile of them; plain, rimmed or patterned, round or square."""
    r, n = between(rng, 0.09, 0.14), 1 if chance(rng, 0.65) else int(rng.integers(2, 7))
    base, rim = solid("plate", tone(rng, CERAMIC)), paint(rng, CERAMIC + VIVID, "rim")
    if chance(rng, 0.5):
        rim = base
    square, parts = chance(rng, 0.2), []
    for k in range(n):
        y, s = 0.009 * k, r
        inner = lathe([(s * 0.7, 0.007), (s * 0.62, 0.005), (0, 0.005)], base, 28)
        outer = lathe(
            [
                (0, 0),
                (s * 0.6, 0),
                (s * 0.66, 0.003),
                (s * 0.97, 0.016),
                (s, 0.018),
                (s * 0.985, 0.0205),
                (s * 0.7, 0.007),
            ],
            rim,
            28,
        )
        piece = [placed(p, (0, y, 0)) for p in (outer, inner)]
        if square:
            piece = [
                soft_box((-s * 0.9, y, -s * 0.9), (s * 0.9, y + 0.009, s * 0.9), rim, 0.004),
                soft_box((-s * 0.78, y + 0.002, -s * 0.78), (s * 0.78, y + 0.0105, s * 0.78), base, 0.004),
            ]
        parts += piece
    return finish(parts, limits, {"material": "ceramic", "shape": "square" if square else "round"})


def bowl(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bowl of ceramic, wood or glass, small or for salad."""
    stuff = pick(rng, "ceramic", "ceramic", "wood", "glass", "metal")
    outside, inside, pattern = glaze(rng)
    if stuff != "ceramic":
        pattern = "plain"
        outside = inside = {
            "wood": lambda: skin("wood", patterns.wood(rng)),
            "glass": lambda: paint(rng, GLASSES + VIVID[1:3], "glass"),
            "metal": lambda: paint(rng, METALS, "metal"),
        }[stuff]()
    r = between(rng, 0.065, 0.15)
    h = r * between(rng, 0.45, 0.75)
    shape = (
        [(0.45, 0), (0.75, 0.25), (0.95, 0.65), (1, 1)],
        [(0.4, 0), (0.6, 0.1), (0.85, 0.5), (1.02, 1)],
        [(0.4, 0), (0.42, 0.12), (0.8, 0.4), (1, 1)],
    )[int(rng.integers(3))]
    return finish(
        [vessel(spline([(a * r, b * h) for a, b in shape], 10), 0.005, outside, inside, 28)],
        limits,
        {"material": stuff, "pattern": pattern},
    )


def _fork(steel: Material) -> list[Model]:
    neck = soft_box((-0.004, 0, -0.02), (0.004, 0.003, 0.1), steel, 0.001)
    prongs = [
        soft_box((x - 0.0018, 0.0005, -0.09), (x + 0.0018, 0.003, -0.045), steel, 0.0008)
        for x in (-0.0085, -0.0028, 0.0028, 0.0085)
    ]
    return [neck, soft_box((-0.011, 0.0003, -0.05), (0.011, 0.003, -0.018), steel, 0.001), *prongs]


def place_setting(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Plate, knife, fork and spoon, a glass; on a mat or with a napkin."""
    base, rim = solid("plate", tone(rng, WHITES + CERAMIC)), paint(rng, CERAMIC + VIVID, "rim")
    steel = solid("cutlery", tone(rng, METALS[:2] + METALS[3:4]))
    parts, y = [], 0.0
    if chance(rng, 0.6):
        mat = skin("place mat", patterns.fabric(rng, 0.5)[0])
        parts.append(soft_box((-0.215, 0, -0.15), (0.215, 0.003, 0.15), mat, 0.001))
        y = 0.003
    r = between(rng, 0.115, 0.13)
    dish = [
        lathe([(0, 0), (r * 0.6, 0), (r * 0.66, 0.003), (r, 0.018), (r * 0.985, 0.0205), (r * 0.7, 0.007)], rim, 28),
        lathe([(r * 0.7, 0.007), (r * 0.62, 0.005), (0, 0.005)], base, 28),
    ]
    parts += [placed(p, (0, y, 0.01)) for p in dish]
    if chance(rng, 0.4):
        napkin = skin("napkin", patterns.fabric(rng, 0.6)[0])
        parts.append(soft_box((-0.045, y + 0.006, -0.06), (0.045, y + 0.016, 0.08), napkin, 0.004))
    parts += [placed(p, (-0.155, y, 0.02)) for p in _fork(steel)]
    parts += [
        soft_box((0.149, y, 0.0), (0.161, y + 0.005, 0.11), steel, 0.002),
        soft_box((0.148, y, -0.1), (0.164, y + 0.002, 0.005), steel, 0.0008),
    ]
    parts += [
        soft_box((0.181, y, -0.04), (0.188, y + 0.003, 0.11), steel, 0.001),
        ellipsoid((0.1845, y + 0.003, -0.065), (0.016, 0.003, 0.025), steel, 12, 6),
    ]
    clear, h = paint(rng, GLASSES, "glass"), between(rng, 0.09, 0.13)
    outline = np.array([(0.029 + 0.006 * t, h * t) for t in np.linspace(0, 1, 4)])
    parts.append(placed(_cylinder_wall(outline, clear, 0.003), (0.16, y, -0.14)))
    return finish(parts, limits, {"material": "ceramic"})


def teapot(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A round, tall or flat pot with spout, handle and lid."""
    outside, _, pattern = glaze(rng)
    r, h = between(rng, 0.065, 0.085), between(rng, 0.09, 0.14)
    body = spline([(r * 0.6, 0), (r * 0.95, h * 0.25), (r, h * 0.5), (r * 0.8, h * 0.85), (r * 0.45, h)], 12)
    plain = outside if outside.texture is None else solid("glaze", tone(rng, CERAMIC))
    lid = spline(
        [
            (r * 0.47, h),
            (r * 0.38, h + 0.012),
            (r * 0.12, h + 0.02),
            (r * 0.08, h + 0.026),
            (r * 0.14, h + 0.036),
            (0.004, h + 0.046),
        ],
        12,
    )
    parts = [
        lathe(np.concatenate([[[0, 0]], body]), outside, 24),
        lathe(np.concatenate([[[r * 0.44, h - 0.002]], lid, [[0, h + 0.046]]]), plain, 18),
    ]
    spout = spline(
        [(r * 0.85, h * 0.3, 0), (r * 1.3, h * 0.45, 0), (r * 1.45, h * 0.75, 0), (r * 1.75, h * 0.97, 0)], 9
    )
    parts.append(tube(spout, np.linspace(0.017, 0.008, 9), plain, 10))
    if chance(rng, 0.25):
        bail = spline(
            [
                (-r * 0.7, h * 0.9, 0),
                (-r * 0.75, h * 1.5, 0),
                (0, h * 1.8, 0),
                (r * 0.75, h * 1.5, 0),
                (r * 0.7, h * 0.9, 0),
            ],
            16,
        )
        parts.append(tube(bail, 0.005, paint(rng, WOODS, "bail"), 6))
    else:
        parts.append(
            placed(handle((r * 0.88, h * 0.8), (r * 0.9, h * 0.25), 0.045, plain, 0.006), rotation=turn(1, np.pi))
        )
    return finish(parts, limits, {"material": "ceramic", "pattern": pattern})


GENERATORS: dict[str, Generator] = {
    "cup": cup,
    "mug": mug,
    "glass": glass,
    "plate": plate,
    "bowl": bowl,
    "place setting": place_setting,
    "teapot": teapot,
    **kitchenware.GENERATORS,
    **bottles.GENERATORS,
}
