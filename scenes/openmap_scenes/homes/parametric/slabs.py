"""Flat things with a picture on their front."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import placed, soft_box, turn
from openmap_scenes.scene import Material


def slab(
    w: float, h: float, d: float, body: Material, front: Material, rim: float, radius: float = 0.006
) -> list[Model]:
    """A flat thing that stands on y = 0 with a picture on its front (+z): a screen, a tablet."""
    shell = soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), body, radius)
    glass = box((-w / 2 + rim, rim, 0), (w / 2 - rim, h - rim, d / 2 + 0.0012), {0: front}, step=0.3)
    frame = _edge(w - 2 * rim, h - 2 * rim, d / 2, front)
    return [shell, placed(glass), *[placed(f, (0, rim, 0)) for f in frame]]


def _edge(w: float, h: float, z: float, material: Material) -> list[Model]:
    """The thin sides of a glass that lies 1.2 mm proud of its frame, so that the surface is closed."""
    return [box((-w / 2, 0, z - 0.001), (w / 2, h, z + 0.0011), dict.fromkeys((1, 2, 3, 4, 5), material), step=0.3)]


def lying(models: list[Model], h: float, d: float) -> list[Model]:
    """A slab laid on its back: front up, its top to -z."""
    return [placed(p, (0, d / 2, h / 2), turn(0, -np.pi / 2)) for p in models]
