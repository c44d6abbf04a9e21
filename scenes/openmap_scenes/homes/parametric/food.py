"""Fruit and bread: single fruits, bowls of them, loaves."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
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
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.revolve import ellipsoid, lathe, leaf, placed, soft_box, spline, tube, turn, vessel
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

STEM = solid("stem", (0.32, 0.22, 0.12))
APPLES: tuple[Colour, ...] = ((0.72, 0.10, 0.10), (0.78, 0.22, 0.14), (0.55, 0.68, 0.20), (0.86, 0.74, 0.26))
ORANGES: tuple[Colour, ...] = ((0.94, 0.55, 0.10), (0.92, 0.48, 0.08), (0.95, 0.62, 0.16))
LEMONS: tuple[Colour, ...] = ((0.95, 0.85, 0.20), (0.62, 0.74, 0.20))
BANANAS: tuple[Colour, ...] = ((0.93, 0.80, 0.22), (0.88, 0.80, 0.30), (0.78, 0.78, 0.26))
GRAPES: tuple[Colour, ...] = ((0.36, 0.14, 0.32), (0.62, 0.72, 0.36))


def one_apple(rng: np.random.Generator, cover: Material | None = None) -> Model:
    """An apple 7-8.5 cm across, its base at y = 0: dimpled above and below, with a stem."""
    r = between(rng, 0.034, 0.042)
    cover = cover or apple_skin(rng)
    phi = np.linspace(-np.pi / 2, np.pi / 2, 13)
    rad = r * np.cos(phi) ** 0.75 * (1 + 0.06 * np.sin(phi))
    y = r * (1.0 * np.sin(phi) - 0.28 * np.exp(-((rad / (0.42 * r)) ** 2)) * np.sign(phi)) * 0.94
    rad[[0, -1]] = 0.0
    low = float(y.min())
    body = lathe(np.stack([rad, y - low], 1), cover, 14)
    top = float(y[-1]) - low
    return _with(body, tube([(0, top - 0.004, 0), (0.002, top + 0.01, 0), (0.006, top + 0.017, 0)], 0.0013, STEM, 5))


def apple_skin(rng: np.random.Generator) -> Material:
    """Red, yellow or green, a second tone towards one end."""
    family = APPLES[:2] if chance(rng, 0.6) else APPLES[2:]
    return skin("apple", patterns.fade(tone(rng, family), tone(rng, family)))


def one_round(rng: np.random.Generator, cover: Material, r: float, tip: float = 0.0) -> Model:
    """An orange or, with a tip at both ends, a lemon; its base at y = 0."""
    body = ellipsoid((0, 0, 0), (r, r * (1 + tip), r), cover, 16, 10, 1.0 if tip == 0 else 1.25)
    body = placed(body, rotation=turn(2, np.pi / 2) if tip else None)
    return placed(body, (0, -float(body.vertices[:, 1].min()), 0))


def one_banana(rng: np.random.Generator, cover: Material) -> Model:
    """A banana on its side, 17-20 cm long, bent."""
    long = between(rng, 0.075, 0.09)
    a = np.linspace(-1.0, 1.0, 13)
    path = np.stack([long * np.sin(a), np.full(13, 0.018), long * 1.15 * (1 - np.cos(a))], 1)
    radius = 0.018 * np.clip(1 - np.abs(a) ** 5, 0.2, 1)
    radius[0], radius[-1] = 0.004, 0.006
    tips = solid("banana tip", (0.25, 0.20, 0.10))
    stalk = path[-1] + (path[-1] - path[-2]) * 0.9
    return _with(tube(path, radius, cover, 6), tube(np.stack([path[-1], stalk]), [0.006, 0.005], tips, 6))


def _with(*parts: Model) -> Model:
    return merge(list(parts))


def apple(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An apple, sometimes with a leaf."""
    parts = [one_apple(rng)]
    if chance(rng, 0.4):
        top = float(parts[0].vertices[:, 1].max())
        spine = spline([(0, top - 0.004, 0), (0.015, top + 0.004, 0.006), (0.034, top - 0.002, 0.012)], 5)
        parts.append(leaf(spine, [0.001, 0.012, 0.015, 0.011, 0.001], solid("leaf", (0.30, 0.46, 0.18))))
    return finish(parts, limits)


def orange(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An orange with its navel."""
    r = between(rng, 0.034, 0.043)
    parts = [one_round(rng, skin("orange", patterns.cloth(rng, tone(rng, ORANGES), 48, 0.03)), r)]
    parts.append(ellipsoid((0, 2 * r - 0.001, 0), (0.004, 0.002, 0.004), solid("navel", (0.40, 0.45, 0.16)), 8, 4))
    return finish(parts, limits)


def banana(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A banana or a hand of three to five."""
    cover = paint(rng, BANANAS, "banana")
    n = 1 if chance(rng, 0.4) else int(rng.integers(3, 6))
    return finish(hand(rng, cover, n), limits)


def hand(rng: np.random.Generator, cover: Material, n: int) -> list[Model]:
    """``n`` bananas side by side that meet at their stalks."""
    parts = []
    for k in range(n):
        angle = 0.28 * (k - (n - 1) / 2)
        end = np.array([0.075, 0.018, 0.05])
        R = turn(1, angle)
        parts.append(placed(one_banana(rng, cover), end - R @ end + [0, 0.006 * abs(k - (n - 1) / 2), 0.0], R))
    return parts


def bowl_of_fruit(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A bowl of ceramic, wood or wire with apples, oranges, lemons, bananas, grapes."""
    stuff = pick(rng, "ceramic", "wood", "wicker")
    shell = {
        "ceramic": lambda: paint(rng, CERAMIC, "bowl"),
        "wood": lambda: skin("bowl", patterns.wood(rng)),
        "wicker": lambda: skin("bowl", patterns.wicker(rng, tone(rng, WOODS), 6, 28)),
    }[stuff]()
    R, h = between(rng, 0.13, 0.16), between(rng, 0.06, 0.085)
    outline = spline([(R * 0.45, 0), (R * 0.75, h * 0.3), (R * 0.95, h * 0.75), (R, h)], 9)
    parts = [vessel(outline, 0.006, shell, shell, 26)]
    kinds = ["apple", "orange", "lemon"] if chance(rng, 0.75) else [pick(rng, "apple", "orange", "lemon")]
    covers = {"orange": paint(rng, ORANGES, "orange"), "lemon": paint(rng, LEMONS, "lemon")}
    spots = [(0.0, 0.012, 0.0)] if chance(rng, 0.5) else []
    ring = 5 if R < 0.145 else 6
    start = between(rng, 0, 6.3)
    spots += [
        ((R - 0.055) * np.cos(a), 0.03, (R - 0.055) * np.sin(a)) for a in start + np.arange(ring) * 2 * np.pi / ring
    ]
    topping = pick(rng, "fruit", "banana", "grapes")
    if topping == "fruit":
        spots += [(0.038 * np.cos(a), 0.082, 0.038 * np.sin(a)) for a in start + np.arange(3) * 2.1]
    for k, spot in enumerate(spots):
        kind = kinds[(k + int(rng.integers(2))) % len(kinds)]
        if kind == "apple":
            fruit = placed(one_apple(rng), rotation=turn(0, float(rng.normal(0, 0.25))))
        else:
            fruit = one_round(
                rng,
                covers[kind],
                between(rng, 0.035, 0.04) if kind == "orange" else 0.029,
                0.0 if kind == "orange" else 0.3,
            )
        parts.append(placed(fruit, spot, turn(1, between(rng, 0, 6.3))))
    if topping == "banana":
        parts += [placed(b, (0, 0.085, -0.03)) for b in hand(rng, paint(rng, BANANAS, "banana"), 3)]
    elif topping == "grapes":
        colour = paint(rng, GRAPES, "grape")
        for _ in range(16):
            x, z = rng.normal(0, 0.026, 2)
            y = 0.085 + 0.028 * np.exp(-(x * x + z * z) / 0.001)
            parts.append(ellipsoid((x, y, z), (0.011, 0.012, 0.011), colour, 8, 5))
    return finish(parts, limits, {"material": stuff})


def bread(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A loaf, a baguette, a round loaf, or rolls on a board."""
    style = pick(rng, "loaf", "baguette", "round", "sliced")
    crust = tone(rng, ((0.70, 0.46, 0.22), (0.58, 0.36, 0.17), (0.78, 0.56, 0.30)))
    cover = skin("crust", patterns.to_image(patterns.fur(rng, crust, 64, 0.10) / 255.0))
    pale = solid("crumb", (0.90, 0.80, 0.60))
    if style == "baguette":
        long = between(rng, 0.24, 0.3)
        t = np.linspace(-1, 1, 15)
        radius = 0.034 * np.sqrt(np.clip(1 - t**4, 0.04, 1))
        parts = [
            placed(
                tube(np.stack([t * long, np.zeros(15), np.zeros(15)], 1), radius, cover, 12),
                (0, 0.03, 0),
                scale=(1, 0.85, 1),
            )
        ]
        for x in np.linspace(-0.7, 0.7, 5) * long:
            cut = ellipsoid((0, 0, 0), (0.024, 0.004, 0.006), pale, 8, 4)
            parts.append(placed(cut, (x, 0.0575, 0), turn(1, 0.7)))
    elif style == "round":
        r = between(rng, 0.09, 0.12)
        parts = [ellipsoid((0, r * 0.42, 0), (r, r * 0.5, r), cover, 24, 10, 0.8)]
        parts += [
            placed(ellipsoid((0, 0, 0), (r * 0.5, 0.006, 0.006), pale, 8, 4), (0, r * 0.9, 0), turn(1, a))
            for a in (0.3, 0.3 + np.pi / 2)
        ]
    else:
        n = 1 if style == "loaf" else 6
        w = between(rng, 0.22, 0.28)
        parts = []
        for k in range(n):
            lean = 0.0 if k == 0 else 0.018 * k
            a = -w / 2 if k == 0 else w * 0.12 + lean
            b = (w / 2 if n == 1 else w * 0.1) if k == 0 else a + 0.012
            parts += _loaf(a, b, cover, pale if n > 1 else cover)
    return finish(parts, limits, {"shape": style})


def _loaf(a: float, b: float, cover: Material, cut: Material) -> list[Model]:
    """A piece of a tin loaf from x = a to b, its right end cut."""
    faces = {0: cover, 1: cover, 3: cover, 4: cover, 5: cover, 2: cut}
    top = ellipsoid(((a + b) / 2, 0.075, 0), ((b - a) / 2, 0.035, 0.06), cover, 14, 8, 0.6, 0.5)
    return [soft_box((a, 0, -0.05), (b, 0.085, 0.05), faces, 0.012), top]


GENERATORS: dict[str, Generator] = {
    "bowl of fruit": bowl_of_fruit,
    "bread": bread,
    "apple": apple,
    "banana": banana,
    "orange": orange,
}
