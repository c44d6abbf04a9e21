"""Floors painted from noise: boards, herringbone, tiles of several sizes, terrazzo, carpet. sRGB uint8, repeating seamlessly.

Each function returns a picture; how many metres it covers is given to it or stated, so that boards and tiles have true sizes.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.textures import Image, noise, to_image

Colour = npt.NDArray[np.float64]


def _grain(rng: np.random.Generator, size: int) -> npt.NDArray[np.float64]:
    """Streaks along u and a few soft flames, (size, size), mean 0."""
    fine = 0.030 * noise(rng, (size, size), (0.6, 22.0)) + 0.022 * noise(rng, (size, size), (1.6, 60.0))
    return fine + 0.012 * noise(rng, (size, size), (0.5, 4.0))


def _shaded(base: Colour, shade: npt.NDArray[np.float64], hue: npt.NDArray[np.float64] | float = 0.0) -> Image:
    """The colour times 1 + shade; ``hue`` > 0 makes it redder, < 0 greyer."""
    warm = np.asarray(hue)[..., None] * np.array([0.5, 0.0, -0.6])
    return to_image(base * (1.0 + shade[..., None] + warm))


def boards(rng: np.random.Generator, base: Colour, rows: int, contrast: float, size: int = 512) -> Image:
    """Boards along u of random lengths, each cut from a piece of grain of its own; the picture spans ``rows`` boards."""
    edges = np.round(np.linspace(0, size, rows + 1)).astype(int)
    grain = _grain(rng, size)
    shade, hue = np.zeros((size, size)), np.zeros((size, size))
    for a, b in pairwise(edges.tolist()):
        # Two or three boards to a row; their ends lie anywhere.
        count = int(rng.integers(2, 4))
        first = int(rng.integers(size))
        cuts = (first + (np.arange(count) * size) // count + rng.integers(-size // 10, size // 10, count)) % size
        cuts.sort()
        for k, cut in enumerate(cuts.tolist()):
            columns = np.arange(cut, cuts[k + 1] if k + 1 < count else cuts[0] + size) % size
            piece = np.roll(grain, (int(rng.integers(size)), int(rng.integers(size))), (0, 1))
            tone = float(rng.normal(0.0, contrast))
            shade[a:b, columns] = piece[: b - a, : len(columns)] + tone
            hue[a:b, columns] = float(rng.normal(0.0, contrast * 0.4))
            shade[a:b, cut] -= 0.22
        shade[a] -= 0.20
        shade[a + 1] -= 0.05
    return _shaded(base, shade, hue)


def veneer(rng: np.random.Generator, base: Colour, size: int = 256) -> Image:
    """Plain wood, its grain upright."""
    shade = _grain(rng, size) + 0.02 * noise(rng, (size, size), (10.0, 60.0))
    return np.ascontiguousarray(_shaded(base, 0.8 * shade).transpose(1, 0, 2))


def herringbone(rng: np.random.Generator, base: Colour, contrast: float, size: int = 512) -> Image:
    """Parquet staves five times as long as wide, at right angles; the picture spans 20 stave widths."""
    n, cells = 5, 20
    v, u = np.mgrid[0:size, 0:size] * cells / size
    i, j = u.astype(int), v.astype(int)
    d = (i - j) % (2 * n)
    flat = d < n
    # The first cell of the stave that a cell belongs to, on the torus.
    first_i, first_j = np.where(flat, (i - d) % cells, i), np.where(flat, j, (j + d - n) % cells)
    stave = (first_i * cells + first_j) * 2 + flat
    tone = rng.normal(0.0, contrast, 2 * cells * cells)
    along, across = np.where(flat, d + u - i, d - n + 1 - (v - j)), np.where(flat, v - j, u - i)
    edge = np.minimum(np.minimum(across, 1 - across), np.minimum(along, n - along))
    streaks = _grain(rng, size)
    shift = rng.integers(0, size, 2 * cells * cells)[stave]
    row = (across * size / cells + shift).astype(int) % size
    column = (along * size / cells + shift * 7).astype(int) % size
    shade = streaks[row, column] + tone[stave] - 0.2 * (edge < 0.05)
    return _shaded(base, shade, rng.normal(0.0, contrast * 0.3, 2 * cells * cells)[stave])


def tiles(
    rng: np.random.Generator,
    base: Colour,
    rows: int,
    columns: int,
    stone: float = 0.0,
    bond: bool = False,
    second: Colour | None = None,
    joint: float = 0.85,
    gap: int = 3,
    size: int = 512,
) -> Image:
    """``rows`` x ``columns`` tiles with joints.

    Parameters
    ----------
    stone : float
        How strongly clouds and veins show, 0 = plain glaze.
    bond : bool
        Every other row shifted by half a tile; ``rows`` is even then.
    second : (3,) or None
        Colour of every other tile.
    joint : float
        Colour of the joints over that of the tiles.
    gap : int
        Width of the joints, pixels.
    """
    v, u = np.mgrid[0:size, 0:size] / size
    row = (v * rows).astype(int)
    x = u * columns + (0.5 * (row % 2) if bond else 0.0)
    column = np.floor(x).astype(int) % columns
    tile = row * columns + column
    shade = rng.normal(0.0, 0.012 + 0.02 * stone, rows * columns)[tile] + 0.006 * noise(rng, (size, size), 2.0)
    if stone > 0:
        field = noise(rng, (size, size), 16.0) + 0.6 * noise(rng, (size, size), 5.0)
        turn = rng.integers(0, size, (rows * columns, 2))[tile]
        y, z = np.mgrid[0:size, 0:size]
        cloud = field[(y + turn[..., 0]) % size, (z + turn[..., 1]) % size]
        shade = shade + stone * (0.035 * cloud - 0.06 * np.exp(-((cloud - 0.3) ** 2) / 0.012))
    across = np.minimum(x % 1.0, 1 - x % 1.0) * size / columns
    along = np.minimum(v * rows % 1.0, 1 - v * rows % 1.0) * size / rows
    edge = np.minimum(across, along)
    colour = np.broadcast_to(base, (size, size, 3))
    if second is not None:
        colour = np.where(((row + column) % 2 == 1)[..., None], second, colour)
    glaze = colour * (1.0 + shade - 0.05 * (edge < gap / 2 + 2))[..., None]
    return to_image(np.where((edge < gap / 2)[..., None], base * joint * (1 + shade[..., None]), glaze))


def terrazzo(rng: np.random.Generator, base: Colour, size: int = 512) -> Image:
    """Chips of several stones in pale cement."""
    rgb = np.broadcast_to(base, (size, size, 3)) * (1 + 0.01 * noise(rng, (size, size), 3.0))[..., None]
    chips = ((0.62, 0.58, 0.53), (0.40, 0.39, 0.38), (0.93, 0.91, 0.87), (0.66, 0.52, 0.43), (0.55, 0.60, 0.58))
    for colour in chips:
        for sigma, level in ((2.2, 2.0), (4.0, 2.15)):
            chip = noise(rng, (size, size), sigma) > level
            rgb = np.where(chip[..., None], np.array(colour) * float(rng.uniform(0.9, 1.05)), rgb)
    return to_image(rgb)


def pile(rng: np.random.Generator, base: Colour, loop: bool, size: int = 512) -> Image:
    """Carpet: short pile, or loops in rows."""
    shade = 0.06 * noise(rng, (size, size), 0.8) + 0.02 * noise(rng, (size, size), 30.0)
    if loop:
        v, u = np.mgrid[0:size, 0:size]
        shade = shade + 0.05 * np.sin(2 * np.pi * v / 8) * np.sin(2 * np.pi * (u + 4 * (v // 8 % 2)) / 8)
    fleck = 0.10 * (noise(rng, (size, size), 0.7) > 1.8)
    return to_image(base * (1.0 + (shade - fleck)[..., None]))
