"""Books, magazines and how they lie or stand."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    between,
    chance,
    finish,
    skin,
    solid,
)
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import placed, sheet, soft_box, turn
from openmap_scenes.scene import Material

PAPER = solid("pages", (0.93, 0.90, 0.83))


def _book(w: float, h: float, t: float, front: Material, cloth: Material) -> list[Model]:
    """A book lying with its spine along -x: boards above and below, pages between."""
    b = 0.0025
    boards = [
        box((-w / 2, y, -h / 2), (w / 2, y + b, h / 2), {**dict.fromkeys((0, 1, 2, 3, 5), cloth), 4: top})
        for y, top in ((0, cloth), (t - b, front))
    ]
    spine = box((-w / 2 - 0.001, 0, -h / 2), (-w / 2 + 0.002, t, h / 2), cloth)
    pages = box(
        (-w / 2 + 0.001, b, -h / 2 + 0.003), (w / 2 - 0.004, t - b, h / 2 - 0.003), dict.fromkeys(range(6), PAPER)
    )
    return [*boards, spine, pages]


def _cover(rng: np.random.Generator) -> tuple[Material, Material]:
    image = patterns.cover(rng)
    return skin("cover", image), solid("cloth", tuple((image[2, 2] / 255.0).tolist()))


def book(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A book lying closed, or open with its pages bending to both sides."""
    w, h, t = between(rng, 0.12, 0.19), between(rng, 0.18, 0.27), between(rng, 0.015, 0.045)
    front, cloth = _cover(rng)
    if chance(rng, 0.25):
        s = np.linspace(-1, 1, 17)
        swell = 0.012 + 0.016 * np.abs(s) ** 0.5 * (1 - np.abs(s)) * 2
        lines = np.full((64, 64, 3), 236, np.uint8)
        lines[8:56:4, 6:28] = lines[8:56:4, 36:58] = 150
        points = np.stack(
            [
                np.broadcast_to(s * w, (3, 17)),
                np.broadcast_to(swell, (3, 17)),
                np.repeat(np.linspace(h / 2, -h / 2, 3)[:, None], 17, 1),
            ],
            2,
        )
        low = points.copy()
        low[..., 1] = 0.004
        parts = [
            sheet(points, 0.003, skin("pages", lines)),
            soft_box((-w - 0.004, 0, -h / 2 - 0.003), (w + 0.004, 0.004, h / 2 + 0.003), cloth, 0.001),
            sheet((points + low) / 2, 0.006, PAPER),
        ]
        return finish(parts, limits, {"material": "paper", "state": "open"})
    return finish(_book(w, h, t, front, cloth), limits, {"material": "paper"})


def books(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A pile of books lying, a row standing, or a row that leans."""
    parts: list[Model] = []
    if chance(rng, 0.5):
        y = 0.0
        for _ in range(int(rng.integers(2, 7))):
            w, h, t = between(rng, 0.13, 0.19), between(rng, 0.19, 0.26), between(rng, 0.015, 0.045)
            R = turn(1, float(rng.normal(0, 0.14)))
            at = between(rng, -0.01, 0.01), y, between(rng, -0.01, 0.01)
            parts += [placed(p, at, R) for p in _book(w, h, t, *_cover(rng))]
            y += t + 0.0005
        return finish(parts, limits, {"material": "paper", "style": "pile"})
    x, n = 0.0, int(rng.integers(4, 10))
    for k in range(n):
        w, h, t = between(rng, 0.13, 0.18), between(rng, 0.18, 0.26), between(rng, 0.014, 0.045)
        upright = [
            placed(p, (0, h / 2, w / 2), turn(1, np.pi / 2) @ turn(0, np.pi / 2)) for p in _book(w, h, t, *_cover(rng))
        ]
        lean = 0.25 if k == n - 1 and chance(rng, 0.5) else 0.0
        along = np.concatenate([(p.vertices @ turn(2, lean).T)[:, 0] for p in upright])
        parts += [placed(p, (x - float(along.min()), 0, -w / 2), turn(2, lean)) for p in upright]
        x += float(np.ptp(along)) + 0.0008
    return finish(parts, limits, {"material": "paper", "style": "row"})


def magazine(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A magazine, or a few of them fanned."""
    n, parts = int(rng.integers(1, 5)), []
    for k in range(n):
        w, h, t = 0.21, 0.28, between(rng, 0.003, 0.007)
        page = {**dict.fromkeys((0, 1, 2, 3, 5), PAPER), 4: skin("cover", patterns.cover(rng))}
        flat = soft_box((-w / 2, 0, -h / 2), (w / 2, t, h / 2), page, 0.001, step=0.1)
        parts.append(
            placed(flat, (0.015 * k, 0.0075 * k, 0.01 * k), turn(1, float(rng.normal(0, 0.2)) if n > 1 else 0.0))
        )
    return finish(parts, limits, {"material": "paper"})


GENERATORS: dict[str, Generator] = {
    "book": book,
    "books": books,
    "magazine": magazine,
}
