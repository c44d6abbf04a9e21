"""Walls painted from noise: rolled paint and papers with restrained patterns. sRGB uint8, repeating seamlessly."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.textures import Image, noise, to_image

Colour = npt.NDArray[np.float64]


def paint(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Paint put on with a roller: fine orange peel, faint broad strokes up and down."""
    peel = 0.007 * noise(rng, (size, size), 1.1) + 0.004 * noise(rng, (size, size), 2.6)
    strokes = 0.005 * noise(rng, (size, size), (70.0, 14.0)) + 0.005 * noise(rng, (size, size), 45.0)
    return to_image(base * (1.0 + (peel + strokes)[..., None]))


def rough_plaster(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Woodchip or scraped plaster under paint, lit a little from above."""
    height = noise(rng, (size, size), 1.4) + 1.2 * np.clip(noise(rng, (size, size), 2.4) - 1.2, 0, None)
    relief = height - np.roll(height, 1, 0)
    return to_image(base * (1.0 + (0.018 * relief + 0.005 * noise(rng, (size, size), 50.0))[..., None]))


def stripes(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Paper with upright stripes, tone on tone, a fine line between them."""
    u, n = np.arange(size) / size, int(rng.integers(8, 17))
    phase = (u * n) % 1.0
    tone = np.where(phase < 0.5, 0.0, -0.035) - 0.05 * (np.abs(phase - 0.5) < 0.03)
    return to_image(base * (1.0 + tone[None, :, None] + 0.006 * noise(rng, (size, size), 0.9)[..., None]))


def linen(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Woven paper: threads both ways."""
    threads = 0.014 * noise(rng, (size, size), (9.0, 0.6)) + 0.014 * noise(rng, (size, size), (0.6, 9.0))
    return to_image(base * (1.0 + threads[..., None]))


def sprigs(rng: np.random.Generator, base: Colour, ink: Colour, size: int = 512) -> Image:
    """Paper with a small leafy motif on a staggered lattice."""
    n = 2 * int(rng.integers(3, 5))
    v, u = np.mgrid[0:size, 0:size] * n / size
    x, y = (u + 0.5 * (np.floor(v) % 2)) % 1.0 - 0.5, v % 1.0 - 0.5
    angle, petals = np.arctan2(y, x), int(rng.integers(2, 4))
    radius = np.hypot(x, y) / (0.12 + 0.13 * np.abs(np.cos(petals * angle)))
    stem = (np.abs(x + 0.06 * np.sin(6 * y)) < 0.012) & (np.abs(y) < 0.34)
    amount = 0.5 * (radius < 1.0) + 0.35 * ((radius >= 1.0) & stem)
    rgb = base + (ink - base) * amount[..., None]
    return to_image(rgb * (1.0 + 0.008 * noise(rng, (size, size), 1.0)[..., None]))


def damask(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Paper with a mirrored ornament, tone on tone."""
    n = 128
    field = noise(rng, (n, n), (7.0, 5.0))
    half = np.concatenate([field, field[:, ::-1]], 1)[:, : 2 * n]
    tile = np.concatenate([half, np.roll(half, n // 2, 1)], 0)
    ornament = np.tile(tile, (size // tile.shape[0], size // tile.shape[1]))
    soft = 1.0 / (1.0 + np.exp(-np.clip((ornament - 0.3) * 12, -30, 30)))
    return to_image(base * (1.0 - 0.045 * soft[..., None] + 0.006 * noise(rng, (size, size), 0.9)[..., None]))


def lattice(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Paper with fine lozenges or arcs."""
    n = 2 * int(rng.integers(3, 6))
    v, u = np.mgrid[0:size, 0:size] * n / size
    if rng.random() < 0.5:
        line = np.minimum(np.abs((u + v) % 1 - 0.5), np.abs((u - v) % 1 - 0.5)) < 0.025
    else:
        radius = np.hypot((u + 0.5 * (np.floor(v) % 2)) % 1 - 0.5, v % 1 - 1.0)
        line = (np.abs(radius - 0.5) < 0.03) | (np.abs(radius - 0.3) < 0.03)
    tone = float(rng.choice([-0.07, 0.06]))
    return to_image(base * (1.0 + tone * line[..., None] + 0.006 * noise(rng, (size, size), 0.9)[..., None]))
