"""The glazes of crockery."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    SOFT,
    VIVID,
    WHITES,
    between,
    skin,
    solid,
    tone,
)
from openmap_scenes.scene import Material


def glaze(rng: np.random.Generator) -> tuple[Material, Material, str]:
    """Outside and inside of a piece of crockery, and what its pattern is called."""
    a, b = tone(rng, CERAMIC + VIVID), tone(rng, WHITES)
    style = int(rng.integers(6))
    inside = solid("glaze inside", b if style != 1 else a)
    if style <= 1:
        return solid("glaze", a if style else b), inside, "plain"
    if style == 2:
        low = between(rng, 0.3, 0.6)
        return skin("glaze", patterns.band(b, a, low, low + between(rng, 0.08, 0.25))), inside, "striped"
    if style == 3:
        return skin("glaze", patterns.band(a, tone(rng, SOFT), 0.5, 1.0)), inside, "two-tone"
    if style == 4:
        return skin("glaze", patterns.speckle(rng, a, (0.3, 0.25, 0.2))), inside, "speckled"
    return skin("glaze", patterns.dots(rng, b, a, 5)), inside, "dotted"
