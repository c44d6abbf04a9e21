"""What a rug shows: borders and medallions, stripes, lozenges, shag, plain with an edge. sRGB uint8 (h, w, 3)."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric.making import SOFT, VIVID, WHITES, tone
from openmap_scenes.homes.parametric.patterns import Array, fur, stripes, to_image, unit, zigzag
from openmap_scenes.homes.textures import Colour, Image, noise

WARM: tuple[Colour, ...] = (
    (0.52, 0.14, 0.13),
    (0.16, 0.22, 0.38),
    (0.60, 0.36, 0.18),
    (0.22, 0.30, 0.26),
    (0.45, 0.20, 0.26),
)


def oriental(rng: np.random.Generator, aspect: float, size: int = 192) -> Image:
    """Borders around a field with a medallion, mirrored both ways as woven rugs are; ``aspect`` = width / depth."""
    field, ground, ink, gold = tone(rng, WARM), tone(rng, WARM), tone(rng, WARM + SOFT), (0.80, 0.70, 0.50)
    u, v = unit(size)
    x, y = np.minimum(u, 1 - u) * aspect, np.minimum(v, 1 - v)
    edge = np.minimum(x, y) / min(1.0, aspect)
    along = np.where(x < y, v, u * aspect)
    small = max(6, round(14 * max(1.0, 1 / aspect)))
    lattice = np.abs((x * small) % 1 - 0.5) + np.abs((y * small) % 1 - 0.5)
    half = size // 2
    blots = noise(rng, (half, half), 2.2)
    mirrored = np.block([[blots, blots[:, ::-1]], [blots[::-1], blots[::-1, ::-1]]])
    rgb = np.ones((size, size, 3)) * np.array(field)
    rgb = np.where((np.abs(mirrored) < 0.18)[..., None], np.array(gold), rgb)
    rgb = np.where((mirrored > 1.1)[..., None], np.array(ink), rgb)
    away = np.abs(u - 0.5) * 2 * max(1.0, aspect) ** 0.5 + np.abs(v - 0.5) * 2 * max(1.0, 1 / aspect) ** 0.5
    for reach, colour in ((0.62, gold), (0.58, ground), (0.36, gold), (0.33, ink), (0.14, gold)):
        wavy = away < reach + 0.03 * np.cos(12 * np.arctan2(v - 0.5, (u - 0.5) * aspect))
        rgb = np.where((wavy & (np.abs(mirrored) > 0.12))[..., None], np.array(colour), rgb)
    border = np.where((lattice < 0.28)[..., None], np.array(gold), np.array(ground))
    rgb = np.where((edge < 0.17)[..., None], border, rgb)
    for a, b, colour in ((0.0, 0.02, ink), (0.02, 0.04, gold), (0.145, 0.155, gold), (0.155, 0.172, ink)):
        rgb = np.where(((edge >= a) & (edge < b))[..., None], np.array(colour), rgb)
    dashes = (edge > 0.04) & (edge < 0.055) & ((along * 30) % 1 < 0.5)
    return _worn(rng, np.where(dashes[..., None], np.array(ink), rgb))


def geometric(rng: np.random.Generator, aspect: float, size: int = 160) -> Image:
    """Lozenges, squares, rings, a trellis."""
    a, b, c = tone(rng, SOFT + WHITES), tone(rng, SOFT), tone(rng, SOFT + VIVID)
    u, v = unit(size)
    n = int(rng.integers(3, 6))
    p, q = (u * max(1, round(n * aspect))) % 1 - 0.5, (v * n) % 1 - 0.5
    style = int(rng.integers(4))
    r = (
        np.abs(p) + np.abs(q),
        np.maximum(np.abs(p), np.abs(q)) * 1.2,
        np.hypot(p, q) * 1.1,
        np.abs(np.abs(p) - np.abs(q)) * 2,
    )[style]
    rgb = np.where((r < 0.17)[..., None], np.array(c), np.where((r < 0.38)[..., None], np.array(b), np.array(a)))
    return _worn(rng, rgb)


def bordered(rng: np.random.Generator, aspect: float, size: int = 128) -> Image:
    """Plain with one or two bands around."""
    a, b = tone(rng, SOFT), tone(rng, SOFT + WARM)
    u, v = unit(size)
    edge = np.minimum(np.minimum(u, 1 - u) * aspect, np.minimum(v, 1 - v))
    wide = float(rng.uniform(0.03, 0.09))
    inside = (edge < wide) | ((edge > 1.4 * wide) & (edge < 1.7 * wide) & bool(rng.random() < 0.5))
    return _worn(rng, np.where(inside[..., None], np.array(b), np.array(a)))


def rings(rng: np.random.Generator, size: int = 160) -> Image:
    """Circles around the middle, petals or plain pile: for a round rug."""
    u, v = unit(size)
    r, phi = np.hypot(u - 0.5, v - 0.5) * 2, np.arctan2(v - 0.5, u - 0.5)
    colours = np.array([tone(rng, SOFT + WARM), tone(rng, SOFT + WHITES), tone(rng, SOFT)])
    style, n = int(rng.integers(3)), int(rng.integers(3, 7))
    if style == 0:
        index = np.floor(r * n).astype(int) % 3
    elif style == 1:
        index = np.where(r < 0.25 + 0.55 * np.abs(np.cos(phi * n)), 0, 1) + np.where(r > 0.92, 1, 0)
    else:
        index = np.where(r > 0.88, 1, 0)
    return _worn(rng, colours[index])


def any_rug(rng: np.random.Generator, aspect: float) -> tuple[Image, str]:
    """Some rectangular rug and what people call it."""
    style = int(rng.choice(6, p=[0.3, 0.18, 0.18, 0.12, 0.12, 0.1]))
    if style == 0:
        return oriental(rng, aspect), "oriental"
    if style == 1:
        return geometric(rng, aspect), "geometric"
    if style == 2:
        colours = [tone(rng, SOFT + WARM) for _ in range(4)]
        return stripes(rng, colours, int(rng.integers(2, 5)), bool(aspect > 1), 160), "striped"
    if style == 3:
        return fur(rng, tone(rng, SOFT), 160), "shaggy"
    if style == 4:
        return bordered(rng, aspect), "bordered"
    return zigzag(rng, [tone(rng, SOFT + WARM) for _ in range(3)], 160), "zigzag"


def _worn(rng: np.random.Generator, rgb: Array) -> Image:
    h, w = rgb.shape[:2]
    return to_image(rgb * (1 + 0.07 * noise(rng, (h, w), 0.7) + 0.03 * noise(rng, (h, w), 12.0))[..., None])
