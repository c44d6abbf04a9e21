"""What colour a thing is, in one of thirteen words, so that "the blue armchair" can be told from the red one."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.surface import working_lab
from openmap_agents.perception.weights import FOLDER, load_weights

# sRGB of good examples of each word; several where a word covers much of the space. Lightness counts for less than hue, since
# the shaded side of a thing is darker than its colour; for the greys lightness is all there is.
_EXAMPLES: dict[str, list[tuple[int, int, int]]] = {
    "black": [(0, 0, 0), (35, 35, 37)],
    "grey": [(85, 85, 88), (128, 128, 128), (170, 170, 172)],
    "white": [(255, 255, 255), (228, 228, 226)],
    "red": [(200, 25, 30), (150, 20, 25), (235, 60, 55)],
    "orange": [(245, 130, 30), (225, 110, 20)],
    "yellow": [(250, 220, 50), (235, 205, 90)],
    "green": [(40, 150, 60), (30, 95, 45), (130, 190, 90), (90, 110, 60)],
    "turquoise": [(50, 190, 185), (20, 130, 135)],
    "blue": [(40, 80, 200), (25, 40, 110), (100, 150, 220), (70, 105, 150)],
    "purple": [(120, 50, 150), (80, 40, 100), (165, 120, 200)],
    "pink": [(245, 150, 180), (230, 90, 150), (240, 195, 205)],
    "brown": [(110, 65, 30), (75, 45, 25), (150, 95, 55), (175, 120, 75)],
    "beige": [(225, 200, 165), (205, 180, 145), (235, 220, 195)],
}
COLOURS = tuple(_EXAMPLES)
_CHROMA_WEIGHT = 1.6
_MOST_FEATURE_PIXELS = 400


def _lab(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """CIE L*a*b* (n, 3) of sRGB (n, 3)."""
    return np.asarray(cv2.cvtColor((rgb.astype(np.float32) / 255.0)[None], cv2.COLOR_RGB2LAB)[0], np.float32)


def _space(lab: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """L*a*b* with chroma stretched, so that distance follows the word rather than the shading."""
    return lab * np.array([1.0, _CHROMA_WEIGHT, _CHROMA_WEIGHT], np.float32)


_WORD = np.array([i for i, c in enumerate(COLOURS) for _ in _EXAMPLES[c]])
_PLACE = _space(_lab(np.array([rgb for c in COLOURS for rgb in _EXAMPLES[c]], np.uint8)))


def colour_votes(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Share of pixels (n, 3) uint8 that each of the 13 words would be used for; sums to 1, zeros without pixels."""
    if len(rgb) == 0:
        return np.zeros(len(COLOURS))
    place = _space(_lab(rgb))
    distance = ((place[:, None] - _PLACE[None]) ** 2).sum(2)
    words = _WORD[distance.argmin(1)]
    return np.bincount(words, minlength=len(COLOURS)) / len(words)


N_COLOUR = 32
_QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9)


def colour_features(lab: npt.NDArray[np.float32], labels: npt.NDArray[np.int32], n: int) -> npt.NDArray[np.float32]:
    """What the working picture says of the colour of each label 1..n, (n, N_COLOUR) float32.

    Quantiles of L*, a*, b* (15), the share of pixels that each word would be used for (13), and of the whole picture the mean
    a*, b* and the median and 90th percentile of L*: by them a dim or tinted room is told from a dark or tinted thing.
    """
    out = np.zeros((n, N_COLOUR), np.float32)
    every = lab.reshape(-1, 3)
    light = np.quantile(every[:, 0], [0.5, 0.9]) / 50.0
    out[:, 28:] = [*(every[:, 1:].mean(0) / 20.0), *light]
    order = np.argsort(labels, axis=None, kind="stable")
    starts = np.searchsorted(labels.ravel()[order], np.arange(1, n + 2))
    for k, (first, last) in enumerate(pairwise(starts.tolist())):
        pixels = every[order[first : last : max(1, (last - first) // _MOST_FEATURE_PIXELS)]]
        if len(pixels):
            out[k, :15] = (np.quantile(pixels, _QUANTILES, axis=0) / 50.0).ravel()
            distance = ((_space(pixels)[:, None] - _PLACE[None]) ** 2).sum(2)
            out[k, 15:28] = np.bincount(_WORD[distance.argmin(1)], minlength=len(COLOURS)) / len(pixels)
    return out


class ColourNamer:
    """w2 relu(w1 (x - mean) / std + b1) + b2: a score for each of ``COLOURS``.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(self, path: Path = FOLDER / "colour.npz") -> None:
        n = len(COLOURS)
        ends = ((N_COLOUR,), (N_COLOUR,), (None, N_COLOUR), (None,), (n, None), (n,))
        parts = ("mean", "std", "w1", "b1", "w2", "b2")
        arrays = load_weights(path, dict(zip(parts, ends, strict=True)))
        self._mean, self._std, self._w1, self._b1, self._w2, self._b2 = (arrays[part] for part in parts)

    def __call__(self, features: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Scores (n, 13) of ``colour_features`` (n, N_COLOUR)."""
        hidden = np.maximum(((features - self._mean) / self._std) @ self._w1.T + self._b1, 0.0)
        return np.asarray(hidden @ self._w2.T + self._b2, np.float32)


@cache
def _namer() -> ColourNamer:
    return ColourNamer()


def region_colour(rgb: npt.NDArray[np.uint8], masks: Masks) -> list[str]:
    """A colour word for each mask 1..n of a picture rgb (H, W, 3) uint8, as people would name it, told from ``colour_features``.

    A mask too thin for the working picture gets the word of most of its pixels.
    """
    lab, step = working_lab(rgb)
    offset = step // 2
    labels = np.ascontiguousarray(masks.labels[offset::step, offset::step])
    features = colour_features(lab, labels, len(masks))
    words = [COLOURS[k] for k in _namer()(features).argmax(1).tolist()] if len(masks) else []
    missing = np.flatnonzero(np.bincount(labels.ravel(), minlength=len(masks) + 1)[1:] == 0)
    for k in missing.tolist():
        words[k] = COLOURS[int(colour_votes(rgb[masks.labels == k + 1]).argmax())]
    return words
