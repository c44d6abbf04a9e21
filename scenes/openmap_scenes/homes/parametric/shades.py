"""What lamps have in common: shades of cloth, their colours, and what glows."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.making import (
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.revolve import ellipsoid, lathe
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

GLOW: tuple[Colour, ...] = ((1.0, 0.97, 0.90), (0.98, 0.93, 0.80), (0.97, 0.96, 0.94))


SHADES: tuple[Colour, ...] = (
    *GLOW,
    *GLOW,
    (0.90, 0.82, 0.68),
    (0.70, 0.30, 0.24),
    (0.36, 0.48, 0.60),
    (0.30, 0.32, 0.34),
)


def shade(low: float, high: float, r_low: float, r_high: float, cloth: Material, bulb: Material) -> list[Model]:
    """A cloth shade open above and below, with a bulb inside."""
    t = 0.004
    profile = [(r_low, low), (r_high, high), (r_high - t, high), (r_low - t, low), (r_low, low)]
    middle = (low + high) / 2
    size = min(0.035, 0.4 * min(r_low, r_high))
    return [lathe(profile, cloth, 26), ellipsoid((0, middle, 0), (size, size * 1.3, size), bulb, 10, 6)]


def shade_cloth(rng: np.random.Generator) -> Material:
    """Linen, pleated or striped cloth."""
    colour, style = tone(rng, SHADES, 0.015), int(rng.integers(4))
    if style == 0:
        return skin(
            "shade", patterns.stripes(rng, [colour, (0.8 * colour[0], 0.8 * colour[1], 0.8 * colour[2])], 16, True, 96)
        )
    return skin("shade", patterns.cloth(rng, colour, 64, 0.03)) if style == 1 else solid("shade", colour)
