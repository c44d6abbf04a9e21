"""Frames of pictures, mirrors and clocks."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns
from openmap_scenes.homes.parametric.making import (
    pick,
    skin,
    solid,
)
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import soft_box
from openmap_scenes.scene import Material


def frame_material(rng: np.random.Generator) -> tuple[Material, str]:
    """Wood, black, white, gold or silver."""
    stuff = pick(rng, "wood", "black", "white", "gold", "silver")
    if stuff == "wood":
        return skin("frame", patterns.wood(rng)), "wood"
    colour = {
        "black": (0.10, 0.09, 0.09),
        "white": (0.93, 0.92, 0.90),
        "gold": (0.72, 0.58, 0.28),
        "silver": (0.72, 0.73, 0.75),
    }
    return solid("frame", colour[stuff]), "metal" if stuff in ("gold", "silver") else "wood"


def framed(
    w: float,
    h: float,
    border: float,
    depth: float,
    frame: Material,
    layers: list[tuple[float, Material]],
    bevel: float = 0.004,
) -> list[Model]:
    """A frame that stands on y = 0 with flat layers in it, each inset by so much: a mat, then the picture."""
    z = depth / 2
    bars = [
        soft_box((-w / 2, 0, -z), (w / 2, border, z), frame, bevel),
        soft_box((-w / 2, h - border, -z), (w / 2, h, z), frame, bevel),
        soft_box((-w / 2, border - 0.002, -z), (-w / 2 + border, h - border + 0.002, z), frame, bevel),
        soft_box((w / 2 - border, border - 0.002, -z), (w / 2, h - border + 0.002, z), frame, bevel),
    ]
    for k, (inset, sheet) in enumerate(layers):
        i = border - 0.001 + inset
        front = -z + 0.35 * depth + 0.0015 * k
        bars.append(box((-w / 2 + i, i, -z + 0.001), (w / 2 - i, h - i, front), sheet, step=0.25))
    return bars
