"""What people wear and carry: backpacks, handbags, suitcases, shoes, umbrellas, hats."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    METALS,
    SOFT,
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
from openmap_scenes.homes.revolve import ellipsoid, grid, lathe, placed, soft_box, spline, tube, turn
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

LEATHERS: tuple[Colour, ...] = ((0.42, 0.24, 0.14), (0.14, 0.11, 0.10), (0.62, 0.40, 0.24), (0.48, 0.14, 0.14), (0.80, 0.70, 0.56))


def backpack(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A backpack standing: main bag, front pocket, straps behind, a loop on top."""
    cloth = skin("canvas", patterns.fabric(rng, 0.8, SOFT + VIVID)[0])
    trim, strap = paint(rng, LEATHERS + DARK + VIVID, "trim"), paint(rng, DARK + LEATHERS, "strap")
    w, h, d = between(rng, 0.28, 0.33), between(rng, 0.4, 0.47), between(rng, 0.14, 0.18)
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), cloth, 0.06, 3, puff=0.015), soft_box((-w * 0.38, 0.03, d / 2 - 0.02), (w * 0.38, h * 0.5, d / 2 + 0.055), trim if chance(rng, 0.5) else cloth, 0.03, 2, puff=0.008)]
    parts.append(tube(spline([(-0.04, h - 0.008, -d * 0.3), (-0.03, h + 0.035, -d * 0.3), (0.03, h + 0.035, -d * 0.3), (0.04, h - 0.008, -d * 0.3)], 9), 0.006, strap, 6))
    if chance(rng, 0.5):
        parts.append(placed(soft_box((-w * 0.44, -0.01, -0.01), (w * 0.44, 0.022, d * 0.95), trim, 0.01, 2), (0, h - 0.008, -d * 0.4), turn(0, 0.12)))
        parts += [soft_box((x - 0.012, h * 0.45, d / 2 + 0.01), (x + 0.012, h * 0.98, d / 2 + 0.028), strap, 0.004) for x in (-w * 0.22, w * 0.22)]
    else:
        arc = [(w * 0.46 * np.sin(a), h * 0.66 + h * 0.27 * np.cos(a), d / 2 + 0.004) for a in np.linspace(-1.5, 1.5, 14)]
        parts.append(tube(arc, 0.005, strap, 6))
        parts.append(tube([(-w * 0.33, h * 0.4, d / 2 + 0.058), (w * 0.33, h * 0.4, d / 2 + 0.058)], 0.004, strap, 6))
    for s in (-1, 1):
        belt = spline([(s * w * 0.2, h * 0.9, -d / 2), (s * w * 0.24, h * 0.78, -d / 2 - 0.045), (s * w * 0.3, h * 0.4, -d / 2 - 0.04), (s * w * 0.36, 0.06, -d / 2)], 12)
        parts.append(tube(belt, 0.016, strap, 6))
        parts.append(soft_box((s * w / 2 - 0.02 if s > 0 else -w / 2 - 0.03, 0.03, -d * 0.3), (s * w / 2 + 0.03 if s > 0 else -w / 2 + 0.02, h * 0.34, d * 0.3), trim, 0.02, 1))
    return finish(parts, limits, {"material": "canvas"})


def handbag(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A handbag: a tote with two loops, or a flap bag with a clasp."""
    leather, metal = paint(rng, LEATHERS + VIVID + SOFT, "leather"), paint(rng, METALS[:1] + METALS[3:4], "clasp")
    w, h, d = between(rng, 0.26, 0.36), between(rng, 0.19, 0.27), between(rng, 0.09, 0.13)
    rows = []
    for t in np.linspace(0, 1, 7):
        a = np.linspace(0, 2 * np.pi, 25)
        wide, deep = w / 2 * (1 - 0.14 * t), d / 2 * (1 - 0.75 * t**2)
        x, z = (np.sign(f(a)) * np.abs(f(a)) ** 0.55 for f in (np.cos, np.sin))
        row = np.stack([wide * x, np.full(25, h * t), -deep * z], 1)
        row[-1] = row[0]
        rows.append(row)
    bag = np.stack([rows[0] * [0, 1, 0], *rows, rows[-1] * [1, 1, 0]])
    style = pick(rng, "tote", "flap")
    parts = [grid(bag[:2], leather), grid(bag[1:-1], leather), grid(bag[-2:], leather)]
    if style == "tote":
        for s in (-1, 1):
            parts.append(tube(spline([(-w * 0.22, h * 0.82, s * d * 0.2), (-w * 0.2, h * 1.35, s * 0.012), (0, h * 1.62, s * 0.02), (w * 0.2, h * 1.35, s * 0.012), (w * 0.22, h * 0.82, s * d * 0.2)], 16), 0.006, leather, 6))
            parts += [ellipsoid((x, h * 0.8, s * d * 0.29), (0.012, 0.016, 0.008), metal, 10, 6) for x in (-w * 0.22, w * 0.22)]
    else:
        flap = soft_box((-w * 0.43, h * 0.4, d * 0.02), (w * 0.43, h * 1.03, d * 0.5 + 0.012), paint(rng, LEATHERS + SOFT, "flap") if chance(rng, 0.4) else leather, 0.03, 2)
        parts += [flap, ellipsoid((0, h * 0.47, d * 0.5 + 0.012), (0.018, 0.014, 0.006), metal, 12, 6)]
        parts.append(tube(spline([(-w * 0.43, h * 0.9, 0), (-w * 0.3, h * 1.5, 0), (0, h * 1.75, 0), (w * 0.3, h * 1.5, 0), (w * 0.43, h * 0.9, 0)], 16), 0.006, metal if chance(rng, 0.3) else leather, 6))
    return finish(parts, limits, {"material": "leather", "style": style})


def suitcase(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A trolley case standing with its pull-out bar, or an old case with belts, standing on its side."""
    shell = paint(rng, VIVID + DARK + SOFT, "shell")
    w, h, d = between(rng, 0.36, 0.48), between(rng, 0.52, 0.68), between(rng, 0.22, 0.28)
    dark = solid("black plastic", (0.1, 0.1, 0.11))
    if chance(rng, 0.65):
        ribs = skin("ribs", patterns.stripes(rng, [a := tuple(shell.colour.tolist()), a, (0.82 * a[0], 0.82 * a[1], 0.82 * a[2])], 7, True, 96)) if chance(rng, 0.6) else shell  # type: ignore[list-item]
        parts = [soft_box((-w / 2, 0.05, -d / 2), (w / 2, 0.05 + h, d / 2), {**dict.fromkeys(range(2, 6), shell), 0: ribs, 1: ribs}, 0.045, 3), soft_box((-w / 2 - 0.002, 0.05 - 0.002, -0.006), (w / 2 + 0.002, 0.052 + h, 0.006), dark, 0.004)]
        parts += [placed(lathe([(0, -0.012), (0.024, -0.012), (0.026, 0), (0.024, 0.012), (0, 0.012)], dark, 14), (x, 0.026, z), turn(2, np.pi / 2)) for x in (-w * 0.38, w * 0.38) for z in (-d * 0.32, d * 0.32)]
        parts += [soft_box((x - 0.02, 0.028, z - 0.02), (x + 0.02, 0.065, z + 0.02), dark, 0.006) for x in (-w * 0.38, w * 0.38) for z in (-d * 0.32, d * 0.32)]
        bar, out = paint(rng, METALS, "bar"), between(rng, 0.03, 0.4)
        parts += [tube([(x, h, -d * 0.32), (x, h + 0.05 + out, -d * 0.32)], 0.008, bar, 8) for x in (-w * 0.2, w * 0.2)]
        parts.append(soft_box((-w * 0.24, h + 0.04 + out, -d * 0.32 - 0.014), (w * 0.24, h + 0.07 + out, -d * 0.32 + 0.014), dark, 0.01))
        parts.append(tube(spline([(-0.07, h + 0.045, 0.03), (-0.06, h + 0.075, 0.03), (0.06, h + 0.075, 0.03), (0.07, h + 0.045, 0.03)], 9), 0.008, dark, 7))
        return finish(parts, limits, {"style": "trolley", "material": "plastic"}, smallest=0.65)
    leather, metal = skin("leather", patterns.fur(rng, tone(rng, LEATHERS), 64, 0.05)), paint(rng, METALS[3:] + METALS[:1], "metal")
    wide, high = between(rng, 0.5, 0.65), between(rng, 0.36, 0.44)
    d *= 0.75
    parts = [soft_box((-wide / 2, 0, -d / 2), (wide / 2, high, d / 2), leather, 0.02, 2)]
    belt = paint(rng, LEATHERS, "belt")
    parts += [soft_box((x - 0.018, -0.003, -d / 2 - 0.003), (x + 0.018, high + 0.003, d / 2 + 0.003), belt, 0.015) for x in (-wide * 0.3, wide * 0.3)]
    parts.append(tube(spline([(-0.07, high - 0.002, 0), (-0.06, high + 0.035, 0), (0.06, high + 0.035, 0), (0.07, high - 0.002, 0)], 10), 0.009, belt, 7))
    parts += [soft_box((x - 0.02, high - 0.05, d / 2 - 0.002), (x + 0.02, high - 0.015, d / 2 + 0.006), metal, 0.003) for x in (-wide * 0.16, wide * 0.16)]
    parts += [ellipsoid((x, y, z), (0.022, 0.022, 0.022), metal, 10, 6, 0.6, 0.6) for x in (-wide / 2 + 0.015, wide / 2 - 0.015) for y in (0.021, high - 0.015) for z in (-d / 2 + 0.015, d / 2 - 0.015)]
    return finish(parts, limits, {"style": "old", "material": "leather"}, smallest=0.65)


def _shoe(style: str, upper: Material, sole: Material, lace: Material, lining: Material) -> list[Model]:
    """A left shoe, toe towards +z, 28 cm long, around x = 0."""
    t = np.linspace(0, 1, 13)
    z = -0.14 + 0.28 * t
    half = 0.036 + 0.012 * np.sin(np.pi * np.clip((t - 0.25) / 0.75, 0, 1)) - 0.028 * np.clip((t - 0.9) / 0.1, 0, 1) ** 2
    half[0] *= 0.55
    high = {"sneaker": 0.085, "boot": 0.2, "loafer": 0.07}[style]
    top = 0.055 + (high - 0.055) * np.clip(1 - np.clip((t - 0.32) / 0.2, 0, 1), 0, 1) - 0.02 * np.clip((t - 0.55) / 0.45, 0, 1) ** 1.5
    phi = np.linspace(0, np.pi, 11)
    x = half[:, None] * np.sign(np.cos(phi)) * np.abs(np.cos(phi)) ** 0.65
    y = 0.012 + (top - 0.012)[:, None] * np.sin(phi) ** 0.6
    shell = np.stack([x, y, np.repeat(z[:, None], 11, 1)], 2)
    shell = np.concatenate([shell[:1] * [0, 1, 1], shell, shell[-1:] * [0, 1, 1]])
    shell[0, :, 1] = shell[-1, :, 1] = 0.02
    outline = np.stack([half + 0.004, z], 1)
    loop = np.concatenate([outline, outline[::-1] * [-1, 1], outline[:1]])
    level = [0.0, 0.006, 0.022, 0.026]
    scale = [0.97, 1.0, 1.0, 0.94]
    rows = [np.stack([loop[:, 0] * s, np.full(len(loop), h), loop[:, 1] * s], 1) for s, h in zip(scale, level, strict=True)]
    rows = [rows[0] * [0.0, 1, 1], *rows, rows[-1] * [0.0, 1, 1]]
    parts = [grid(shell, upper), grid(np.stack(rows)[:, ::-1] if _inward(rows) else np.stack(rows), sole)]
    parts.append(placed(ellipsoid((0, 0, 0), (0.03, 0.006, 0.048), lining, 14, 5), (0, high - 0.001, -0.075)))
    if style != "loafer":
        for k in range(4):
            zz, yy = -0.005 + 0.024 * k, 0.078 - 0.007 * k if style == "sneaker" else 0.088 - 0.01 * k
            parts.append(tube([(-0.022, yy - 0.008, zz), (0, yy, zz), (0.022, yy - 0.008, zz)], 0.003, lace, 5))
    return parts


def _inward(rows: list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]) -> bool:
    """Whether loops stacked upwards run clockwise as seen from above, so that their surface would face inwards."""
    x, z = rows[2][:-1, 0], rows[2][:-1, 2]
    return bool(np.sum(x * np.roll(z, -1) - np.roll(x, -1) * z) > 0)


def shoes(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A pair of sneakers, boots or loafers side by side, a little askew."""
    style = pick(rng, "sneaker", "sneaker", "boot", "loafer")
    upper = paint(rng, VIVID + WHITES + DARK + SOFT if style == "sneaker" else LEATHERS, "upper")
    sole, lace = paint(rng, WHITES + DARK[:1], "sole") if style == "sneaker" else solid("sole", (0.14, 0.10, 0.08)), paint(rng, WHITES + DARK, "lace")
    left = _shoe(style, upper, sole, lace, solid("lining", (0.16, 0.14, 0.13)))
    size, parts = between(rng, 0.75, 1.05), []
    for s in (-1, 1):
        R, ahead = turn(1, s * between(rng, 0.0, 0.15)), between(rng, -0.02, 0.02)
        parts += [placed(p, (s * 0.062 * size, 0, ahead), R, size) for p in left]
    return finish(parts, limits, {"style": style + "s", "material": "fabric" if style == "sneaker" else "leather"})


def umbrella(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A closed umbrella standing in a stand, or two of them."""
    cloth = skin("cloth", patterns.stripes(rng, [a := tone(rng, VIVID + DARK), (0.75 * a[0], 0.75 * a[1], 0.75 * a[2])], 8, True, 64))
    wood, metal = paint(rng, WOODS + DARK, "handle"), paint(rng, METALS, "metal")
    furl = spline([(0.006, 0.06), (0.02, 0.2), (0.034, 0.5), (0.026, 0.62), (0.01, 0.66)], 14)
    one = [lathe(np.concatenate([[[0, 0.05]], furl, [[0, 0.665]]]), cloth, 14), tube([(0, 0, 0), (0, 0.06, 0)], [0.002, 0.005], metal, 6), tube([(0, 0.6, 0), (0, 0.76, 0)], 0.005, metal, 6)]
    one.append(tube(spline([(0, 0.75, 0), (0, 0.86, 0), (0.025, 0.9, 0), (0.06, 0.88, 0), (0.065, 0.83, 0)], 14), 0.0105, wood, 8))
    stand = chance(rng, 0.7)
    if not stand:
        return finish(one, limits, {"state": "closed"})
    r, h = between(rng, 0.1, 0.13), between(rng, 0.42, 0.52)
    mat = paint(rng, METALS + SOFT + DARK, "stand")
    shell = [(0, 0), (r, 0), (r, h * 0.5), (r, h), (r - 0.005, h), (r - 0.005, h * 0.4), (r - 0.005, 0.01), (0, 0.01)]
    parts = [lathe(shell, mat, 24)]
    for k in range(int(rng.integers(1, 3))):
        lean = turn(1, 2.6 * k + between(rng, 0, 6)) @ turn(2, -0.13)
        parts += [placed(p, (0, 0.015, 0), lean) for p in one]
    return finish(parts, limits, {"state": "closed", "style": "in a stand"})


def hat(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A straw hat, a felt hat, a cap or a knitted hat, lying."""
    style = pick(rng, "straw", "felt", "cap", "knitted")
    if style == "knitted":
        wool = skin("wool", patterns.stripes(rng, [tone(rng, VIVID + SOFT), tone(rng, WHITES + SOFT)], 4, False, 96))
        parts = [lathe([(0, 0), (0.098, 0), (0.104, 0.02), (0.098, 0.045), (0.1, 0.05), (0.095, 0.12), (0.06, 0.17), (0, 0.185)], wool, 24)]
        parts.append(ellipsoid((0, 0.2, 0), (0.032, 0.03, 0.032), paint(rng, VIVID + WHITES, "bobble"), 12, 8))
        return finish(parts, limits, {"material": "wool", "style": style})
    if style == "cap":
        cloth = paint(rng, VIVID + DARK + SOFT, "cap")
        crown = [(0.094 * np.cos(a), 0.004 + 0.115 * np.sin(a)) for a in np.linspace(0, np.pi / 2, 9)]
        brim = paint(rng, VIVID + DARK, "brim") if chance(rng, 0.4) else cloth
        peak = placed(ellipsoid((0, 0, 0), (0.085, 0.006, 0.085), brim, 22, 4), (0, 0.012, 0.085), turn(0, 0.1))
        return finish([lathe([(0, 0.004), *crown], cloth, 24), peak, ellipsoid((0, 0.12, 0), (0.008, 0.005, 0.008), brim, 8, 5)], limits, {"material": "fabric", "style": style})
    r = between(rng, 0.15, 0.19) if style == "straw" else between(rng, 0.13, 0.15)
    mat = skin("straw", patterns.wicker(rng, tone(rng, ((0.86, 0.74, 0.50), (0.78, 0.64, 0.42))), 18, 40)) if style == "straw" else paint(rng, LEATHERS + DARK + SOFT, "felt")
    outline = [(0, 0.008), (r * 0.6, 0.006), (r * 0.98, 0.0), (r, 0.004), (r * 0.97, 0.006), (0.095, 0.014), (0.088, 0.07), (0.078, 0.11), (0.05, 0.118), (0, 0.108)]
    ribbon = lathe([(0.096, 0.014), (0.0945, 0.022), (0.0925, 0.042)], paint(rng, VIVID + DARK, "ribbon"), 28)
    return finish([placed(p, scale=(1, 1, 1.12)) for p in (lathe(outline, mat, 28), ribbon)], limits, {"material": style, "style": style})


GENERATORS: dict[str, Generator] = {
    "backpack": backpack,
    "handbag": handbag,
    "suitcase": suitcase,
    "shoes": shoes,
    "umbrella": umbrella,
    "hat": hat,
}
