"""Leaves of houseplants."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.making import (
    chance,
    skin,
    tone,
)
from openmap_scenes.homes.revolve import (
    leaf,
)
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

GREENS: tuple[Colour, ...] = (
    (0.20, 0.40, 0.17), (0.28, 0.48, 0.20), (0.16, 0.34, 0.20), (0.38, 0.54, 0.24),
    (0.30, 0.44, 0.30), (0.22, 0.46, 0.26),
)  # fmt: skip


def blade(
    long: float, wide: float, material: Material, droop: float, n: int = 6, fold: float = 0.25, point: float = 1.0
) -> Model:
    """A leaf that grows along +x from the origin, arching up and then down by ``droop`` of its length."""
    t = np.linspace(0, 1, n)
    spine = np.stack([long * t, long * (0.25 * t - (0.25 + droop) * t * t), np.zeros(n)], 1)
    width = wide * np.sin(np.pi * np.clip(t**0.75, 0.02, 0.985)) ** point
    return leaf(spine, width, material, fold=fold)


def green(rng: np.random.Generator) -> Material:
    """Leaves of some green, now and then with pale edges."""
    return skin("leaf", patterns.foliage(rng, tone(rng, GREENS), chance(rng, 0.2)))
