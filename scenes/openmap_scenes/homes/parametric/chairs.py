"""Chairs at a table: slats, rungs, panel, wishbone, shell, cantilever, upholstered."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import (
    Size,
    bar,
    beam,
    draw_size,
    four_legs,
    made,
    pedestal,
    sled,
)
from openmap_scenes.homes.solids import (
    arc,
    bent,
    cushion,
    leg,
    moved,
    prism,
    rounded_box,
    rounded_outline,
    sweep,
    tube,
    turned,
)
from openmap_scenes.scene import Material

SEAT = 0.45


def chair(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A chair at a table: slats, rungs, panel, wishbone, shell, cantilever or upholstered."""
    size = draw_size(rng, limits, (0.40, 0.52), (0.44, 0.56), (0.76, 1.0))
    if size is None:
        return None
    makers = (
        _slat_chair,
        _ladder_chair,
        _panel_chair,
        _wishbone_chair,
        _shell_chair,
        _cantilever_chair,
        _parsons_chair,
    )
    parts, words = makers[int(rng.integers(len(makers)))](rng, size)
    return made(parts, size, words)


def _frame(rng: np.random.Generator, size: Size, m: Material) -> tuple[list[Model], npt.NDArray[np.float64], float]:
    """Legs and rails of a wooden chair; the back posts' line at x = 0, (K, 3), from seat to top, and their |x|."""
    w, d, h = size
    t = float(rng.uniform(0.014, 0.02))
    lean, x, z = float(rng.uniform(0.05, 0.09)), w / 2 - t - 0.01, -d / 2 + t
    post = np.array([(0, 0, z + 0.02), (0, SEAT, z + lean), (0, (SEAT + h) / 2, z + 0.6 * lean), (0, h, z)])
    parts = [sweep(bent(post + np.array([s * x, 0, 0]), 0.12, 3), bar(2 * t, 2.2 * t), m, (0, 0, 1)) for s in (-1, 1)]
    parts += [leg((s * x, SEAT - 0.02, d / 2 - t), (s * (x + 0.005), 0, d / 2 - t), t * 1.15, m, 0.75) for s in (-1, 1)]
    back, rail = z + lean, SEAT - 0.055
    parts += [beam((-x, rail, d / 2 - t), (x, rail, d / 2 - t), 0.02, 0.05, m)]
    parts += [beam((-x, rail, back), (x, rail, back), 0.02, 0.05, m)]
    parts += [beam((s * x, rail, d / 2 - t), (s * x, rail, back), 0.02, 0.05, m) for s in (-1, 1)]
    if rng.random() < 0.5:
        parts += [beam((s * x, 0.17, d / 2 - t), (s * x, 0.17, z + 0.04), 0.016, 0.024, m) for s in (-1, 1)]
        parts += [beam((-x, 0.17, 0.02), (x, 0.17, 0.02), 0.016, 0.024, m)]
    return parts, post[1:], x


def _seat(rng: np.random.Generator, size: Size, m: Material, back: float) -> tuple[list[Model], str]:
    """A seat of wood, woven or padded, and what a person says of it."""
    w, d, _ = size
    kind = finishes.choose(rng, "wood", "padded", "woven")
    low, high = (-w / 2 + 0.005, SEAT - 0.03, back - 0.01), (w / 2 - 0.005, SEAT - 0.005, d / 2 + 0.0)
    if kind == "wood":
        return [rounded_box(low, high, m, 0.008, 2)], ""
    if kind == "woven":
        return [rounded_box(low, (high[0], SEAT, high[2]), finishes.wicker(rng), 0.012, 2)], "rattan seat"
    cover, name = finishes.upholstery(rng)
    pad = cushion(
        (low[0] + 0.01, SEAT - 0.035, low[2] + 0.02), (high[0] - 0.01, SEAT + 0.025, high[2] - 0.005), cover, 0.3
    )
    return [rounded_box(low, (high[0], SEAT - 0.015, high[2]), m, 0.004), pad], name + " seat"


def _at(line: npt.NDArray[np.float64], y: float) -> float:
    """Depth of the back posts at a height."""
    return float(np.interp(y, line[:, 1], line[:, 2]))


def _words(name: str, seat: str = "", style: str = "") -> dict[str, str]:
    words = {"material": name}
    if seat:
        words["seat"] = seat
    if style:
        words["style"] = style
    return words


def _slat_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    m, name = finishes.wood_or_paint(rng)
    parts, line, x = _frame(rng, size, m)
    top, low = size[2] - 0.05, SEAT + float(rng.uniform(0.04, 0.14))
    for y, tall in ((top, 0.08), (low, 0.04)):
        z = _at(line, y)
        parts.append(sweep(arc((-x, y, z), (0, y, z - 0.02), (x, y, z), 6), bar(0.02, tall), m))
    n = int(rng.integers(3, 8))
    wide = float(rng.uniform(0.25, 0.6)) * 2 * x / (n + 1)
    for s in np.linspace(-1, 1, n + 2)[1:-1]:
        sag = -0.02 * (1 - s * s)
        a, b = (s * x, low, _at(line, low) + sag), (s * x, top, _at(line, top) + sag)
        parts.append(sweep([a, b], bar(wide, 0.012), m, (0, 0, 1)))
    seat, word = _seat(rng, size, m, line[0, 2])
    return parts + seat, _words(name, word, "slat back")


def _ladder_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    m, name = finishes.wood_or_paint(rng)
    parts, line, x = _frame(rng, size, m)
    n = int(rng.integers(2, 5))
    tall = float(rng.uniform(0.035, 0.4 / (n + 1.5)))
    for y in np.linspace(size[2] - tall / 2 - 0.01, SEAT + 0.12, n):
        z = _at(line, y)
        parts.append(sweep(arc((-x, y, z), (0, y, z - 0.03), (x, y, z), 7), bar(0.015, tall), m))
    seat, word = _seat(rng, size, m, line[0, 2])
    return parts + seat, _words(name, word, "ladder back")


def _panel_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    m, name = finishes.wood_or_paint(rng)
    parts, line, x = _frame(rng, size, m)
    low, top = SEAT + float(rng.uniform(0.08, 0.16)), size[2] - 0.01
    padded = rng.random() < 0.5
    cover, cloth = finishes.upholstery(rng)
    y = (low + top) / 2
    z = _at(line, y)
    parts.append(sweep(arc((-x, y, z), (0, y, z - 0.03), (x, y, z), 7), bar(0.018, top - low), m))
    if padded:
        pad = cushion((-x + 0.03, low + 0.02, z - 0.012), (x - 0.03, top - 0.02, z + 0.045), cover, 0.3)
        parts.append(turned(pad, "x", -0.06, (0, y, z)))
    seat, word = _seat(rng, size, m, line[0, 2])
    return parts + seat, _words(name, cloth + " seat" if padded else word, "upholstered" if padded else "")


def _wishbone_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    """A bent rail that runs round the back into arms, carried by the rear legs and a Y."""
    w, d, _ = size
    m, name = finishes.wood(rng)
    h, r = 0.75, w / 2 - 0.02
    rail = [
        (-r, h - 0.05, d * 0.22),
        (-r, h - 0.04, -d * 0.1),
        (-r * 0.6, h, -d / 2 + 0.05),
        (0, h + 0.01, -d / 2 + 0.02),
    ]
    rail += [(-x, y, z) for x, y, z in reversed(rail[:-1])]
    parts = [sweep(bent(rail, 0.12, 3), bar(0.035, 0.028), m)]
    parts += [
        tube(
            arc(
                (s * r, 0, -d / 2 + 0.05), (s * (r + 0.01), 0.4, -d / 2 + 0.06), (s * r * 0.72, h - 0.02, -d / 2 + 0.09)
            ),
            np.linspace(0.014, 0.018, 9),
            m,
        )
        for s in (-1, 1)
    ]
    parts += [
        leg((s * (r - 0.01), h - 0.05, d * 0.2), (s * (r - 0.005), 0, d / 2 - 0.025), 0.018, m, 0.75) for s in (-1, 1)
    ]
    parts.append(beam((0, SEAT - 0.03, -d / 2 + 0.1), (0, 0.6, -d / 2 + 0.07), 0.045, 0.012, m))
    parts += [beam((0, 0.58, -d / 2 + 0.073), (s * 0.1, h, -d / 2 + 0.04), 0.03, 0.012, m) for s in (-1, 1)]
    seat = prism(
        rounded_outline(w / 2 - 0.035, d / 2 - 0.055, 0.05, 3, 0.15), SEAT - 0.045, SEAT, finishes.wicker(rng), 0.012
    )
    parts.append(seat)
    parts += [beam((-r, 0.2, z), (r, 0.2, z), 0.02, 0.02, m) for z in (-d / 2 + 0.06, d / 2 - 0.06)]
    return parts, _words(name, "rattan seat", "curved back")


def _shell(rng: np.random.Generator, size: Size, m: Material, thick: float, low: float = SEAT) -> Model:
    """A seat and back in one bent piece."""
    w, d, h = size
    way = [
        (0, low - 0.01, d / 2),
        (0, low, d / 2 - 0.06),
        (0, low - 0.015, -d * 0.16),
        (0, low + 0.17, -d / 2 + 0.075),
        (0, h, -d / 2),
    ]
    path = bent(way, 0.2, 6)
    t = np.linspace(0, 1, len(path))
    half = (w / 2) * np.interp(t, [0, 0.12, 0.5, 0.75, 1], [0.82, 1.0, 0.95, 0.92, 0.66 + 0.2 * rng.random()])
    curl = np.interp(t, [0, 0.3, 0.6, 1], [0.01, 0.03, 0.045, 0.02])
    s = np.linspace(-1, 1, 9)
    upper = np.stack([s, np.abs(s) ** 2.4], 1)
    section = np.stack(
        [
            np.concatenate([upper * [a, c] + [0, thick], upper[::-1] * [a * 0.985, c]])
            for a, c in zip(half, curl, strict=True)
        ]
    )
    # Around the outline the other way, as a sweep wants it; the loft turns it outside out by itself.
    return sweep(path, section, m, (0.0, 1.0, 0.0))


def _shell_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    w, d, _ = size
    padded = rng.random() < 0.5
    cover, cloth = finishes.upholstery(rng)
    plastic = finishes.painted(finishes.shade(rng, finishes.PAINTS), "plastic")
    wood, _ = finishes.wood(rng)
    iron, _ = finishes.metal(rng, "chrome", "black metal", "brass")
    parts = [_shell(rng, size, cover if padded else plastic, 0.045 if padded else 0.014)]
    x, z, top = w * 0.27, d * 0.27, SEAT - 0.005
    style = int(rng.integers(4))
    if style == 0:
        parts += four_legs(x, z, top, 0.018, wood, 0.07, 0.6)
        parts += [beam((-x, top - 0.07, s * z), (x, top - 0.07, s * z), 0.02, 0.03, wood) for s in (-1, 1)]
    elif style == 1:
        parts += four_legs(x, z, top, 0.010, iron, 0.08, 0.9)
    elif style == 2:
        parts += sled(w * 0.36, d * 0.36, top - 0.01, 0.009, iron)
        parts += [
            beam((-w * 0.36, top - 0.03, s * d * 0.3), (w * 0.36, top - 0.03, s * d * 0.3), 0.016, 0.016, iron)
            for s in (-1, 1)
        ]
    else:
        parts += pedestal(rng, top - 0.005, min(w, d) * 0.45, iron)
    return parts, _words(cloth if padded else "plastic", "", "upholstered" if padded else "")


def _cantilever_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    """One bent tube: runners, up at the front, back under the seat, up the back."""
    w, d, h = size
    m, name = finishes.metal(rng, "chrome", "black metal", "brass")
    x, r = w / 2 - 0.016, 0.0125
    parts = []
    for s in (-x, x):
        way = [
            (s, r, -d / 2 + 0.03),
            (s, r, d / 2 - 0.01),
            (s, SEAT - 0.04, d / 2 - 0.02),
            (s, SEAT - 0.045, -d / 2 + 0.09),
            (s, h, -d / 2 + 0.015),
        ]
        parts.append(tube(bent(way, 0.07, 4), r, m))
    parts += [tube([(-x, y, z), (x, y, z)], r * 0.9, m) for y, z in ((r, -d / 2 + 0.03), (SEAT - 0.045, -d / 2 + 0.12))]
    woven = rng.random() < 0.4
    cover, cloth = (finishes.wicker(rng), "rattan") if woven else finishes.upholstery(rng)
    make = rounded_box if woven else cushion
    parts.append(
        make(
            (-x + 0.012, SEAT - 0.04, -d / 2 + 0.1),
            (x - 0.012, SEAT + 0.012, d / 2 - 0.03),
            cover,
            0.012 if woven else 0.3,
        )
    )
    back = make((-x + 0.012, SEAT + 0.16, -0.02), (x - 0.012, h - 0.01, 0.02), cover, 0.01 if woven else 0.3)
    angle = float(np.arctan2(0.075, h - SEAT))
    parts.append(turned(moved(back, 0, 0, -d / 2 + 0.018), "x", -angle, (0, h, -d / 2 + 0.018)))
    return parts, _words(name, cloth + " seat")


def _parsons_chair(rng: np.random.Generator, size: Size) -> tuple[list[Model], dict[str, str]]:
    """Upholstered all over: a thick seat and a tall, slightly leaning back."""
    w, d, h = size
    cover, cloth = finishes.upholstery(rng)
    wood, _ = finishes.wood(rng)
    parts = [*four_legs(w / 2 - 0.035, d / 2 - 0.04, SEAT - 0.1, 0.022, wood, 0.0, 0.7, square=True)]
    parts.append(
        rounded_box((-w / 2 + 0.005, SEAT - 0.12, -d / 2 + 0.05), (w / 2 - 0.005, SEAT - 0.02, d / 2), cover, 0.015, 2)
    )
    parts.append(
        cushion((-w / 2 + 0.01, SEAT - 0.05, -d / 2 + 0.09), (w / 2 - 0.01, SEAT + 0.03, d / 2 - 0.005), cover, 0.35)
    )
    back = rounded_box((-w / 2 + 0.005, SEAT - 0.12, -0.045), (w / 2 - 0.005, h, 0.045), cover, 0.03, 2, step=0.15)
    channels = int(rng.integers(0, 2)) * int(rng.integers(3, 6))
    back = turned(moved(back, 0, 0, -d / 2 + 0.1), "x", -0.1, (0, SEAT - 0.12, -d / 2 + 0.1))
    parts.append(back)
    for k in range(channels):
        a = -w / 2 + 0.02 + (w - 0.04) * k / channels
        pad = cushion((a, SEAT + 0.05, -0.02), (a + (w - 0.04) / channels, h - 0.02, 0.07), cover, 0.5)
        parts.append(turned(moved(pad, 0, 0, -d / 2 + 0.1), "x", -0.1, (0, SEAT - 0.12, -d / 2 + 0.1)))
    return parts, _words(cloth, "", "upholstered")


GENERATORS: dict[str, Generator] = {
    "chair": chair,
}
