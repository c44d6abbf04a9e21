"""What a generator of furniture takes and gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from openmap_scenes.homes.models import Model


@dataclass(frozen=True)
class Limits:
    """The largest size that fits, m: along x (width), z (depth) and y (height)."""

    width: float = 9.0
    depth: float = 9.0
    height: float = 9.0


@dataclass(frozen=True)
class Made:
    """A thing that a generator made.

    Parameters
    ----------
    model : Model
        x right, y up, front along +z, m, origin in the middle of the base; closed surfaces with outward normals, no edge
        longer than ``models.LONGEST_EDGE``, no face inside another part where it would flicker.
    attributes : dict
        Words that a person would say of it: ``{"material": "oak", "shape": "round"}``; the colour is found from the model.
    elevation : float
        Height of its base above the floor where people put it, m.
    surface : bool
        Whether people put things on it.
    """

    model: Model
    attributes: dict[str, str] = field(default_factory=dict)
    elevation: float = 0.0
    surface: bool = True


# Draws proportions, style, material and texture from the generator; None where the limits leave no sensible size.
Generator = Callable[[np.random.Generator, Limits], Made | None]
