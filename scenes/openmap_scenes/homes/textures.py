"""Noise, colours, and flat things painted from them: rugs and pictures. sRGB uint8."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, zoom

Image = npt.NDArray[np.uint8]
Colour = tuple[float, float, float]

WOODS: tuple[Colour, ...] = (
    (0.72, 0.53, 0.34), (0.58, 0.39, 0.23), (0.44, 0.28, 0.17), (0.80, 0.66, 0.48), (0.62, 0.55, 0.47),
)  # fmt: skip
WALLS: tuple[Colour, ...] = (
    (0.93, 0.91, 0.87), (0.88, 0.86, 0.80), (0.84, 0.87, 0.85), (0.82, 0.85, 0.90), (0.92, 0.86, 0.75),
    (0.85, 0.80, 0.74), (0.78, 0.84, 0.76), (0.90, 0.82, 0.80), (0.95, 0.95, 0.94), (0.74, 0.80, 0.84),
)  # fmt: skip
ACCENTS: tuple[Colour, ...] = (
    (0.70, 0.18, 0.16), (0.16, 0.32, 0.58), (0.85, 0.62, 0.18), (0.22, 0.45, 0.30), (0.48, 0.25, 0.45),
    (0.90, 0.86, 0.78), (0.18, 0.18, 0.20), (0.30, 0.60, 0.65), (0.86, 0.45, 0.25),
)  # fmt: skip


def to_image(values: npt.NDArray[np.floating]) -> Image:
    """Colours (h, w, 3) in 0..1 as a picture."""
    return np.asarray(np.round(np.clip(values, 0.0, 1.0) * 255.0), np.uint8)


def noise(
    rng: np.random.Generator, shape: tuple[int, int], sigma: float | tuple[float, float]
) -> npt.NDArray[np.float64]:
    """Smooth noise (h, w) that wraps around, mean 0, standard deviation 1; ``sigma`` in pixels, (down, across) or both."""
    sigmas = (sigma, sigma) if isinstance(sigma, (int, float)) else sigma
    # What is smooth over many pixels is made of few and drawn large.
    factors = [_coarser(n, s) for n, s in zip(shape, sigmas, strict=True)]
    small = rng.standard_normal([n // f for n, f in zip(shape, factors, strict=True)])
    field = gaussian_filter(small, [s / f for s, f in zip(sigmas, factors, strict=True)], mode="wrap")
    if max(factors) > 1:
        field = zoom(field, factors, order=1, mode="grid-wrap", grid_mode=True)
    return np.asarray((field - field.mean()) / max(float(field.std()), 1e-9))


def _coarser(n: int, sigma: float) -> int:
    """The power of two by which n pixels may be fewer for noise that is ``sigma`` pixels wide."""
    factor = 1
    while sigma / (2 * factor) >= 2.5 and n % (2 * factor) == 0:
        factor *= 2
    return factor


def pick(rng: np.random.Generator, colours: tuple[Colour, ...]) -> npt.NDArray[np.float64]:
    """One of the colours (3,), a little off."""
    return np.clip(np.array(colours[int(rng.integers(len(colours)))]) + rng.normal(0, 0.02, 3), 0.02, 0.98)


def rug(rng: np.random.Generator, size: int = 192) -> Image:
    """A border or stripes or lozenges in two or three colours."""
    a, b, c = pick(rng, ACCENTS), pick(rng, ACCENTS), pick(rng, ACCENTS)
    v, u = np.mgrid[0:size, 0:size] / size
    edge = np.minimum(np.minimum(u, 1 - u), np.minimum(v, 1 - v))
    style, n = int(rng.integers(3)), int(rng.integers(4, 9))
    if style == 0:
        inside = (np.abs((u * n) % 1 - 0.5) + np.abs((v * n) % 1 - 0.5)) < 0.3
    elif style == 1:
        inside = (v * n * 2) % 2 < 1
    else:
        inside = (np.hypot(u - 0.5, v - 0.5) * n * 2) % 2 < 1
    rgb = np.where(inside[..., None], b, a)
    rgb = np.where(((edge > 0.03) & (edge < 0.07))[..., None], c, np.where((edge <= 0.03)[..., None], b, rgb))
    return to_image(rgb * (1.0 + 0.06 * noise(rng, (size, size), 0.8)[..., None]))


def painting(rng: np.random.Generator, size: int = 160) -> Image:
    """A landscape, blocks or strokes."""
    v, u = np.mgrid[0:size, 0:size] / size
    style = int(rng.integers(3))
    if style == 0:
        rgb = (1 - v[..., None]) * np.array([0.45, 0.62, 0.82]) + v[..., None] * np.array([0.93, 0.85, 0.72])
        for k in range(4):
            ridge = 0.45 + 0.12 * k + 0.05 * noise(rng, (1, size), (0, 12.0))
            rgb = np.where(
                (v > ridge)[..., None], pick(rng, ((0.25, 0.42, 0.30), (0.42, 0.48, 0.28), (0.3, 0.34, 0.42))), rgb
            )
    elif style == 1:
        rgb = np.full((size, size, 3), pick(rng, WALLS))
        for _ in range(9):
            x, y, w, h = rng.uniform(0, 0.8), rng.uniform(0, 0.8), rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5)
            rgb = np.where(((u > x) & (u < x + w) & (v > y) & (v < y + h))[..., None], pick(rng, ACCENTS), rgb)
    else:
        rgb = np.full((size, size, 3), pick(rng, WALLS))
        for _ in range(5):
            blot = noise(rng, (size, size), float(rng.uniform(10, 26)))
            rgb = np.where((blot > 1.0)[..., None], pick(rng, ACCENTS), rgb)
    return to_image(rgb * (1.0 + 0.03 * noise(rng, (size, size), 1.0)[..., None]))
