"""Cut flowers."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.leaves import blade, green
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    GLASSES,
    WHITES,
    between,
    finish,
    paint,
    pick,
    solid,
)
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.revolve import (
    copies,
    ellipsoid,
    lathe,
    placed,
    spline,
    tube,
    turn,
    vessel,
)
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

PETALS: tuple[Colour, ...] = (
    (0.86, 0.18, 0.22), (0.95, 0.80, 0.24), (0.94, 0.92, 0.90), (0.90, 0.52, 0.66), (0.62, 0.38, 0.72),
    (0.94, 0.52, 0.20), (0.46, 0.50, 0.86),
)  # fmt: skip


def blossom(rng: np.random.Generator, style: str, mat: Material, size: float) -> Model:
    """A flower that looks along +y from the origin."""
    heart = solid("heart", (0.88, 0.72, 0.22) if style == "daisy" else (0.45, 0.30, 0.14))
    if style == "tulip":
        return lathe(
            [
                (0, 0),
                (size * 0.38, size * 0.1),
                (size * 0.5, size * 0.5),
                (size * 0.36, size * 1.05),
                (size * 0.3, size * 1.0),
                (size * 0.4, size * 0.5),
                (0, size * 0.2),
            ],
            mat,
            10,
        )
    if style == "rose":
        spiral = [ellipsoid((0, 0, 0), (size * s, size * s * 0.75, size * s), mat, 10, 6, 0.8) for s in (0.5, 0.36)]
        return merge([placed(spiral[0], (0, size * 0.3, 0)), placed(spiral[1], (0.04 * size, size * 0.5, 0))])
    n, wide = (12, 0.22) if style == "daisy" else (6, 0.45)
    petal = blade(size * 0.8, size * wide, mat, 0.25, 3)
    R = np.stack([turn(1, 2 * np.pi * k / n) for k in range(n)])
    middle = ellipsoid((0, size * 0.03, 0), (size * 0.2, size * 0.12, size * 0.2), heart, 8, 5)
    return merge([copies(petal, np.zeros((n, 3)), R), middle])


def bouquet(rng: np.random.Generator, height: float, spread: float) -> list[Model]:
    """Stems from the origin with flowers at ``height`` and leaves between."""
    style, stalk = pick(rng, "tulip", "rose", "daisy", "lily"), solid("stalk", (0.30, 0.48, 0.22))
    n = int(rng.integers(5, 10))
    mats = [paint(rng, PETALS, "petal") for _ in range(int(rng.integers(1, 4)))]
    leaf_mat, size, parts = green(rng), between(rng, 0.045, 0.065), []
    for k in range(n):
        a, out = 2.4 * k, spread * np.sqrt((k + 0.3) / n)
        tip = np.array([out * np.cos(a), height * between(rng, 0.85, 1.1), out * np.sin(a)])
        parts.append(tube(spline([np.zeros(3), tip * [0.35, 0.55, 0.35], tip], 5), 0.0025, stalk, 5))
        tilt = turn(1, -a) @ turn(2, -0.7 * out / max(spread, 1e-6))
        parts.append(placed(blossom(rng, style, mats[k % len(mats)], size), tip, tilt))
        foliage = blade(height * 0.4, 0.03, leaf_mat, 0.2, 5)
        parts.append(placed(foliage, tip * [0.3, 0.5, 0.3], turn(1, -a + 1.0) @ turn(2, 0.6)))
    return parts


def flowers(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Cut flowers in a vase."""
    r, h = between(rng, 0.035, 0.06), between(rng, 0.13, 0.22)
    mat = paint(rng, GLASSES + CERAMIC + WHITES, "vase")
    shape = (
        [(0.8, 0), (1, 0.3), (0.8, 0.7), (0.95, 1)],
        [(0.7, 0), (0.75, 0.5), (1, 1)],
        [(0.6, 0), (1.1, 0.35), (0.5, 0.8), (0.7, 1)],
    )[int(rng.integers(3))]
    parts = [vessel(spline([(a * r, b * h) for a, b in shape], 10), 0.004, mat, mat, 20)]
    parts += [placed(p, (0, h * 0.55, 0)) for p in bouquet(rng, between(rng, 0.18, 0.26), between(rng, 0.08, 0.13))]
    return finish(parts, limits, {"material": "ceramic"}, smallest=0.6)


GENERATORS: dict[str, Generator] = {
    "flowers": flowers,
}
