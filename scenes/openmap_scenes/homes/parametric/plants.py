"""Plants in pots by their habit of growth, and flowers."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import bouquets, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.bouquets import PETALS
from openmap_scenes.homes.parametric.leaves import GREENS, blade, green
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    SOFT,
    VIVID,
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
from openmap_scenes.homes.revolve import (
    Array,
    copies,
    ellipsoid,
    grid,
    lathe,
    leaf,
    placed,
    soft_box,
    spline,
    tube,
    turn,
)

SOIL = solid("soil", (0.20, 0.14, 0.10))
BARK = solid("bark", (0.38, 0.29, 0.20))


def pot(rng: np.random.Generator, radius: float, height: float) -> tuple[list[Model], str]:
    """A pot with soil, its rim at ``height`` and ``radius``: clay, glazed, square, basket, bowl."""
    r, h, style = radius, height, pick(rng, "terracotta", "ceramic", "ceramic", "square", "wicker", "saucer")
    glaze = paint(rng, (*CERAMIC, *SOFT, *VIVID), "pot")
    stuff = "ceramic"
    if style == "square":
        parts = [
            soft_box((-r, 0, -r), (r, h, r), glaze, 0.012, 2),
            soft_box((-r * 0.88, h - 0.01, -r * 0.88), (r * 0.88, h + 0.004, r * 0.88), SOIL, 0.004),
        ]
        return parts, stuff
    if style == "terracotta":
        clay = paint(rng, ((0.72, 0.42, 0.28), (0.66, 0.38, 0.26)), "terracotta")
        outline = np.array([(r * 0.66, 0), (r * 0.88, h * 0.78), (r, h * 0.78), (r, h)])
        wall, stuff = clay, "terracotta"
    elif style == "wicker":
        wall, stuff = skin("wicker", patterns.wicker(rng, tone(rng, WOODS), 9, 26)), "wicker"
        outline = spline([(r * 0.85, 0), (r, h * 0.4), (r, h * 0.8), (r * 0.96, h)], 7)
    else:
        wall = (
            glaze
            if chance(rng, 0.6)
            else skin("pot", patterns.band(tone(rng, CERAMIC), tone(rng, CERAMIC + VIVID), 0.4, 0.75))
        )
        shape = [(0.7, 0), (0.86, 0.5), (1, 1)] if chance(rng, 0.6) else [(0.55, 0), (1.0, 0.4), (1.04, 0.7), (0.95, 1)]
        outline = spline([(a * r, b * h) for a, b in shape], 8)
    rim, inner = float(outline[-1, 0]), 0.06 * r
    parts = [lathe(np.concatenate([[[0, 0]], outline, [[rim - inner, h], [rim - inner, h * 0.9]]]), wall, 22)]
    parts.append(lathe([(rim - inner + 0.001, h * 0.9), (0, h * 0.93)], SOIL, 16))
    return parts, stuff


def _turns(rng: np.random.Generator, count: int, low: float, high: float) -> tuple[Array, Array]:
    """Rotations (count, 3, 3): around y by the golden angle, then tilted off it between two angles; and the azimuths."""
    azimuth = 2.39996 * np.arange(count) + rng.normal(0, 0.2, count) + rng.uniform(0, 6.3)
    tilt = rng.uniform(low, high, count)
    return np.stack([turn(1, a) @ turn(2, -t) for a, t in zip(azimuth, tilt, strict=True)]), azimuth


def rosette(rng: np.random.Generator, r: float) -> list[Model]:
    """Long arching leaves from one point: dracaena, spider plant, bromeliad."""
    mat, n = green(rng), int(rng.integers(22, 40))
    R, _ = _turns(rng, n, 0.1, 1.1)
    one = blade(r * 1.5, r * between(rng, 0.1, 0.24), mat, between(rng, 0.15, 0.5), 7)
    return [copies(one, np.zeros((n, 3)), R, rng.uniform(0.7, 1.1, n))]


def bushy(rng: np.random.Generator, r: float) -> list[Model]:
    """Many leaves on stalks to a dome: pothos, peace lily, monstera when large."""
    mat, n = green(rng), int(rng.integers(34, 50))
    R, azimuth = _turns(rng, n, -0.5, 0.5)
    level = np.linspace(0.05, 1, n)
    out, up = r * 0.75 * np.sqrt(1 - level**2 * 0.85), r * 1.5 * level
    at = np.stack([out * np.cos(azimuth), up, -out * np.sin(azimuth)], 1)
    one = blade(r * between(rng, 0.5, 0.7), r * between(rng, 0.3, 0.45), mat, 0.25, 5)
    parts = [copies(one, at, R, rng.uniform(0.7, 1.15, n))]
    stalk = solid("stalk", (0.33, 0.46, 0.22))
    parts += [tube(np.stack([[0, -0.02, 0], at[k] * [0.4, 0.6, 0.4], at[k]]), 0.0035, stalk, 4) for k in range(0, n, 3)]
    return parts


def tree(rng: np.random.Generator, r: float) -> list[Model]:
    """A little tree: a stem, some branches, a crown of small leaves: ficus, lemon tree."""
    h = r * between(rng, 2.2, 3.2)
    bend = rng.normal(0, 0.12 * r, (2, 2))
    trunk = spline([(0, -0.02, 0), (bend[0, 0], h * 0.35, bend[0, 1]), (bend[1, 0], h * 0.7, bend[1, 1]), (0, h, 0)], 9)
    parts = [tube(trunk, np.linspace(0.05 * r, 0.025 * r, 9) + 0.004, BARK, 7)]
    ends = []
    for k in range(7):
        a, base = 0.9 * 2.4 * k, trunk[4 + k // 2]
        tip = np.array([r * 0.62 * np.cos(a), h * (0.72 + 0.09 * k), r * 0.62 * np.sin(a)])
        ends.append(tip)
        parts.append(
            tube(
                np.stack([base, (base + tip) / 2 + [0, 0.03 * r, 0], tip]),
                [0.016 * r + 0.002, 0.011 * r + 0.002, 0.004],
                BARK,
                5,
            )
        )
    n = 120
    centre = np.array([0, h * 1.05, 0])
    d = rng.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    at = centre + d * r * np.array([0.85, 0.72, 0.85]) * rng.uniform(0.35, 1.0, (n, 1))
    R, _ = _turns(rng, n, -0.6, 0.5)
    one = blade(r * 0.46, r * between(rng, 0.18, 0.26), green(rng), 0.35, 3)
    return [*parts, copies(one, at, R, rng.uniform(0.75, 1.2, n))]


def palm(rng: np.random.Generator, r: float) -> list[Model]:
    """Fronds of narrow leaflets on arching stalks."""
    mat, n = green(rng), int(rng.integers(7, 10))
    stalk = solid("stalk", (0.42, 0.52, 0.24))
    long, pairs = r * 2.0, 9
    t = np.linspace(0, 1, 9)
    spine = np.stack([long * 0.8 * t, long * (1.0 * t - 0.75 * t * t), np.zeros(9)], 1)
    parts = [tube(spine, np.linspace(0.006, 0.002, 9), stalk, 4)]
    s = np.linspace(0.25, 1.0, pairs)
    at = np.stack([np.interp(s, t, spine[:, k]) for k in range(3)], 1)
    for side in (-1, 1):
        R = np.stack([turn(1, side * (1.05 - 0.7 * x)) @ turn(2, -0.35) for x in s])
        one = blade(r * 0.62, r * 0.085, mat, 0.1, 3)
        parts.append(copies(one, at, R, 1.0 - 0.5 * np.abs(s - 0.45)))
    frond = merge(parts)
    R, _ = _turns(rng, n, -0.65, 0.15)
    tall = r * between(rng, 0.4, 1.6)
    trunk = spline([(0, -0.02, 0), (0.06 * r, tall * 0.5, 0), (0, tall + 0.02, 0)], 7)
    bark = tube(trunk, np.linspace(0.13 * r, 0.08 * r, 7), BARK, 8)
    return [bark, copies(frond, np.tile([0.0, tall, 0.0], (n, 1)), R, rng.uniform(0.75, 1.05, n))]


def snake(rng: np.random.Generator, r: float) -> list[Model]:
    """Upright stiff swords with pale edges."""
    mat = skin("leaf", patterns.foliage(rng, tone(rng, GREENS[2:]), True))
    n, parts = int(rng.integers(8, 14)), []
    for k in range(n):
        a, out, h = 2.4 * k, r * 0.55 * np.sqrt(k / n), r * between(rng, 1.6, 3.0)
        lean, t = between(rng, 0.0, 0.2), np.linspace(0, 1, 7)
        x = out + lean * h * t * t
        spine = np.stack([x * np.cos(a), h * t - 0.01, x * np.sin(a)], 1)
        face = np.array([np.cos(a + 1), 0.05, np.sin(a + 1)])
        parts.append(leaf(spine, r * 0.34 * np.clip(1.02 - t**3, 0.02, 1) * (0.7 + 0.5 * t), mat, tuple(face), 0.35))
    return parts


def cactus_shape(rng: np.random.Generator, r: float) -> list[Model]:
    """A ribbed column with arms, a ribbed ball, or flat pads; spines as pale specks."""
    mat = skin("cactus", patterns.speckle(rng, tone(rng, GREENS), (0.85, 0.84, 0.66), 0.05))
    style = int(rng.integers(3))
    phi = np.linspace(0, 2 * np.pi, 41)
    phi[-1] = 0.0
    rib = 1 + 0.09 * np.cos(10 * phi)

    def ribbed(wide: float, tall: float) -> Model:
        t = np.linspace(0, 1, 10)
        rad = (
            wide * np.clip(1 - (2 * t - 1) ** 6, 0, 1) ** 0.5
            if style == 0
            else wide * np.sin(np.pi * np.clip(t, 0, 1)) ** 0.7
        )
        rad[[0, -1]] = 0.0
        rr = rad[:, None] * rib
        return grid(np.stack([rr * np.cos(phi), np.repeat((tall * t)[:, None], 41, 1), -rr * np.sin(phi)], 2), mat)

    if style == 2:
        parts = [ellipsoid((0, r * 0.55, 0), (r * 0.42, r * 0.62, r * 0.12), mat, 16, 10)]
        for k in range(int(rng.integers(2, 5))):
            a = between(rng, -0.9, 0.9)
            pad = ellipsoid((0, r * 0.35, 0), (r * 0.3, r * 0.4, r * 0.1), mat, 14, 8)
            parts.append(
                placed(
                    pad,
                    (0.35 * r * np.sin(a), r * (0.95 + 0.1 * np.cos(a)), 0.02 * k),
                    turn(2, -a) @ turn(1, float(rng.normal(0, 0.5))),
                )
            )
        return parts
    if style == 1:
        parts = [placed(ribbed(r * 0.8, r * 1.3), (0, -0.1 * r, 0))]
        parts.append(
            placed(
                lathe(
                    [(0.0, 0), (r * 0.16, 0.01), (r * 0.2, r * 0.16), (0, r * 0.08)], paint(rng, PETALS, "blossom"), 10
                ),
                (0, r * 1.13, 0),
            )
        )
        return parts
    tall = r * between(rng, 2.0, 3.2)
    parts = [placed(ribbed(r * 0.38, tall), (0, -0.05 * r, 0))]
    for side in (-1, 1)[: int(rng.integers(0, 3))]:
        y = tall * between(rng, 0.3, 0.5)
        elbow = spline(
            [
                (0, y, 0),
                (side * r * 0.55, y + 0.05 * r, 0),
                (side * r * 0.75, y + 0.35 * r, 0),
                (side * r * 0.75, y + 0.9 * r, 0),
            ],
            10,
        )
        parts.append(tube(elbow, r * 0.2 * np.sqrt(np.clip(1 - np.linspace(0, 1, 10) ** 6, 0.03, 1)), mat, 10))
    return parts


def trailing(rng: np.random.Generator, r: float) -> list[Model]:
    """Vines with heart-shaped leaves that hang over the rim."""
    mat, stalk = green(rng), solid("stalk", (0.33, 0.46, 0.22))
    parts, at, turned = [], [], []
    for k in range(10):
        a, drop = 0.63 * k + float(rng.normal(0, 0.15)), r * between(rng, 0.5, 1.4)
        out = np.array([np.cos(a), 0, np.sin(a)])
        path = spline(
            [
                out * 0.2 * r,
                out * 0.8 * r + [0, 0.3 * r, 0],
                out * 1.2 * r + [0, 0.05 * r, 0],
                out * 1.3 * r - [0, drop, 0],
            ],
            8,
        )
        path[:, 1] = np.maximum(path[:, 1], -r * 1.2)
        parts.append(tube(path, 0.0025, stalk, 4))
        for j in range(1, 8):
            at.append(path[j])
            turned.append(turn(1, -a + (1.1 if j % 2 else -1.1)) @ turn(2, -0.1))
    one = blade(r * 0.42, r * 0.3, mat, 0.3, 5, point=0.7)
    return [*parts, copies(one, np.array(at), np.array(turned), rng.uniform(0.7, 1.1, len(at)))]


HABITS = {
    "rosette": rosette, "bushy": bushy, "tree": tree, "palm": palm, "snake plant": snake, "cactus": cactus_shape,
    "trailing": trailing,
}  # fmt: skip


def _potted(rng: np.random.Generator, limits: Limits, habit: str, r: float) -> Made | None:
    h = r * between(rng, 1.1, 1.8)
    parts, stuff = pot(rng, r, h)
    spread = r * (between(rng, 1.3, 2.0) if habit in ("rosette", "bushy", "tree", "palm") else 1.0)
    parts += [placed(p, (0, h * 0.9, 0)) for p in HABITS[habit](rng, spread)]
    return finish(parts, limits, {"style": habit, "material": stuff}, smallest=0.25)


def potted_plant(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A plant of some habit in a pot, for a sill (15 cm) up to the floor (1.3 m)."""
    habit = pick(rng, "rosette", "bushy", "bushy", "tree", "palm", "snake plant", "trailing")
    r = between(rng, 0.06, 0.1) if limits.height < 0.8 or chance(rng, 0.35) else between(rng, 0.12, 0.17)
    return _potted(rng, limits, habit, r)


def ficus(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small tree in a pot."""
    return _potted(rng, limits, "tree", between(rng, 0.13, 0.17))


def palm_tree(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A palm in a pot."""
    return _potted(rng, limits, "palm", between(rng, 0.13, 0.17))


def snake_plant(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A snake plant in a pot."""
    return _potted(rng, limits, "snake plant", between(rng, 0.08, 0.14))


def cactus(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cactus in a pot, mostly small."""
    return _potted(rng, limits, "cactus", between(rng, 0.045, 0.08) if chance(rng, 0.8) else 0.14)


def succulent(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A rosette of thick leaves in a small pot."""
    r = between(rng, 0.04, 0.07)
    h = r * between(rng, 0.9, 1.4)
    parts, stuff = pot(rng, r, h)
    a, b = tone(rng, (*GREENS, (0.52, 0.62, 0.56), (0.5, 0.46, 0.56))), tone(rng, PETALS[3:5] + GREENS)
    mat = skin("succulent", patterns.fade(a, a) if chance(rng, 0.5) else patterns.fade(b, a))
    n = 34
    k = np.arange(n)
    tilt = 0.15 + 1.15 * (1 - k / n) ** 0.8
    R = np.stack([turn(1, 2.39996 * i) @ turn(2, np.pi / 2 - t) for i, t in zip(k, tilt, strict=True)])
    one = placed(ellipsoid((0.5, 0, 0), (0.5, 0.11, 0.2), mat, 8, 6), scale=r * 1.25)
    parts.append(copies(one, np.tile([0.0, h * 0.95, 0.0], (n, 1)), R, 1.0 - 0.55 * k / n))
    return finish(parts, limits, {"material": stuff})


GENERATORS: dict[str, Generator] = {
    "potted plant": potted_plant,
    "ficus": ficus,
    "palm": palm_tree,
    "snake plant": snake_plant,
    "cactus": cactus,
    "succulent": succulent,
    **bouquets.GENERATORS,
}
