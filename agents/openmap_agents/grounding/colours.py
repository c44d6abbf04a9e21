"""Colour words and mean colours: how well does "blue" describe an instance whose mean colour is (60, 80, 140)?"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from skimage.color import rgb2lab

# Typical colours of household things, sRGB; several to a word, because "brown" is dark oak as well as pine.
_TYPICAL: dict[str, list[tuple[int, int, int]]] = {
    "red": [(200, 30, 30), (140, 30, 35), (160, 60, 55)],
    "orange": [(240, 130, 30), (200, 110, 50)],
    "yellow": [(240, 220, 60), (200, 170, 60)],
    "green": [(50, 140, 60), (40, 80, 40), (120, 150, 80)],
    "blue": [(40, 80, 190), (35, 50, 100), (90, 130, 180), (40, 150, 160)],
    "purple": [(120, 50, 150), (90, 60, 110)],
    "pink": [(240, 150, 180), (220, 90, 140)],
    "brown": [(120, 75, 40), (80, 50, 30), (155, 110, 70)],
    "beige": [(225, 205, 170), (195, 175, 145)],
    "white": [(245, 245, 245), (215, 215, 212)],
    "grey": [(128, 128, 128), (170, 170, 170), (85, 85, 88)],
    "black": [(20, 20, 20), (45, 45, 47)],
}
COLOURS = tuple(_TYPICAL)
SPREAD = 9.0
"""Distance in CIE Lab over which a colour word fades."""
UNKNOWN = 0.4


def _lab(rgb: npt.ArrayLike) -> npt.NDArray[np.float64]:
    return np.asarray(rgb2lab(np.asarray(rgb, np.float64).reshape(-1, 1, 3) / 255)[:, 0], np.float64)


_LAB = {word: _lab(typical) for word, typical in _TYPICAL.items()}


def typical(word: str) -> npt.NDArray[np.uint8] | None:
    """The colour (3,) uint8 that a word names first; None for a word that names none."""
    found = _TYPICAL.get(word)
    return None if found is None else np.array(found[0], np.uint8)


def colour_fits(rgb: npt.NDArray[np.uint8] | None) -> dict[str, float]:
    """How well every colour word describes a mean colour (3,), 1 for the best; ``UNKNOWN`` for all where there is none."""
    if rgb is None:
        return dict.fromkeys(COLOURS, UNKNOWN)
    seen = _lab(rgb)
    distance = {word: float(np.linalg.norm(typical - seen, axis=1).min()) for word, typical in _LAB.items()}
    least = min(distance.values())
    return {word: float(np.exp((least - d) / SPREAD)) for word, d in distance.items()}


def colour_word(rgb: npt.NDArray[np.uint8] | None) -> str | None:
    """The word for a mean colour (3,)."""
    if rgb is None:
        return None
    fits = colour_fits(rgb)
    return max(COLOURS, key=fits.__getitem__)
