"""Colour words: what a person would call the colour of a thing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.vectors import doubled_areas

WORDS = (
    "black", "white", "grey", "red", "orange", "yellow", "green", "turquoise", "blue", "purple", "pink", "brown", "beige",
)  # fmt: skip


def colour_words(rgb: npt.NDArray[np.floating]) -> npt.NDArray[np.int64]:
    """Index into ``WORDS`` of sRGB colours (N, 3) in 0..1, by hue, saturation and value."""
    rgb = np.asarray(rgb, np.float64)
    value, chroma = rgb.max(1), np.ptp(rgb, axis=1)
    saturation = chroma / np.maximum(value, 1e-9)
    r, g, b = rgb.T
    safe = np.maximum(chroma, 1e-9)
    hue = np.where(value == r, (g - b) / safe % 6, np.where(value == g, (b - r) / safe + 2, (r - g) / safe + 4)) * 60
    by_hue = np.select(
        [hue < 14, hue < 40, hue < 68, hue < 160, hue < 195, hue < 255, hue < 290, hue < 340],
        [WORDS.index(w) for w in ("red", "orange", "yellow", "green", "turquoise", "blue", "purple", "pink")],
        WORDS.index("red"),
    )
    warm = (hue < 55) | (hue > 350)
    grey = np.where(value < 0.22, 0, np.where(value > 0.80, 1, 2))
    out = np.where((saturation < 0.13) | (value < 0.16), grey, by_hue)
    out = np.where(warm & (saturation >= 0.13) & (saturation < 0.42) & (value >= 0.62), WORDS.index("beige"), out)
    brown = warm & (hue > 8) & (value < 0.72) & (value >= 0.16) & (saturation >= 0.2)
    brown |= (hue <= 8) & (value < 0.4) & (value >= 0.16) & (saturation >= 0.2) & (saturation < 0.75)
    out = np.where(brown, WORDS.index("brown"), out)
    pale_red = ((hue < 14) | (hue >= 340)) & (value > 0.7) & (saturation >= 0.13) & (saturation < 0.5) & ~warm
    return np.where(pale_red, WORDS.index("pink"), out)


def model_colour(model: Model) -> str:
    """The word that covers most of a model's surface, textures counted pixel by pixel."""
    size = doubled_areas(model.vertices.astype(np.float64), model.faces)
    area = np.bincount(model.face_material, size, minlength=len(model.materials))
    colours = []
    for material in model.materials:
        own = material.colour[None].astype(np.float64)
        if material.texture is not None:
            own = own * material.texture[::4, ::4].reshape(-1, 3) / 255.0
        colours.append(own)
    counts = np.array([len(own) for own in colours])
    votes = np.bincount(colour_words(np.concatenate(colours)), np.repeat(area / counts, counts), minlength=len(WORDS))
    return WORDS[int(votes.argmax())]
