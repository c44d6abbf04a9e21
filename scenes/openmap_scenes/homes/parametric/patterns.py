"""Textures of small things: cloth, wicker, wood, fruit, pictures, covers, screens. sRGB uint8 (h, w, 3), row 0 on top."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PIL import Image as PilImage
from PIL import ImageDraw

from openmap_scenes.homes.parametric.making import DARK, SOFT, VIVID, WHITES, WOODS, tone
from openmap_scenes.homes.textures import Colour, Image, noise

Array = npt.NDArray[np.float64]


def to_image(rgb: Array) -> Image:
    """Values (h, w, 3) in 0..1 as sRGB bytes."""
    return np.asarray(np.round(np.clip(rgb, 0.0, 1.0) * 255.0), np.uint8)


def unit(size: int) -> tuple[Array, Array]:
    """Coordinates u to the right and v down of pixel centres, 0..1, (size, size) each."""
    s = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(s, s)
    return u, v


def cloth(rng: np.random.Generator, colour: Colour, size: int = 64, rough: float = 0.05) -> Image:
    """Plain cloth: threads and a little noise."""
    u, v = unit(size)
    threads = 0.02 * np.sin(2 * np.pi * u * size / 4) + 0.02 * np.sin(2 * np.pi * v * size / 4)
    return to_image(np.array(colour) * (1 + threads + rough * noise(rng, (size, size), 0.7))[..., None])


def fur(rng: np.random.Generator, colour: Colour, size: int = 128, depth: float = 0.12) -> Image:
    """Long pile or fur."""
    shade = depth * noise(rng, (size, size), (1.6, 0.7)) + 0.4 * depth * noise(rng, (size, size), 5.0)
    return to_image(np.array(colour) * (1 + shade)[..., None])


def stripes(
    rng: np.random.Generator, colours: list[Colour], count: int = 5, along_u: bool = True, size: int = 128
) -> Image:
    """Bands of different widths in the colours, repeated ``count`` times; ``along_u``: the colour changes with u."""
    cuts = np.cumsum(rng.uniform(0.5, 1.5, len(colours)))
    u, v = unit(size)
    band = np.searchsorted(cuts / cuts[-1], ((u if along_u else v) * count) % 1.0)
    rgb = np.array(colours)[np.minimum(band, len(colours) - 1)]
    return to_image(rgb * (1 + 0.05 * noise(rng, (size, size), 0.7))[..., None])


def checks(rng: np.random.Generator, a: Colour, b: Colour, count: int = 6, size: int = 128) -> Image:
    """Gingham or plaid: bands of a second colour both ways, darker where they cross."""
    u, v = unit(size)
    share = 0.5 * ((u * count) % 1 < 0.5) + 0.5 * ((v * count) % 1 < 0.5)
    rgb = np.array(a) * (1 - share[..., None]) + np.array(b) * share[..., None]
    return to_image(rgb * (1 + 0.04 * noise(rng, (size, size), 0.7))[..., None])


def dots(rng: np.random.Generator, ground: Colour, dot: Colour, count: int = 6, size: int = 128) -> Image:
    """Spots in staggered rows."""
    u, v = unit(size)
    row = np.floor(v * count)
    inside = np.hypot((u * count + 0.5 * (row % 2)) % 1 - 0.5, (v * count) % 1 - 0.5) < 0.26
    rgb = np.where(inside[..., None], np.array(dot), np.array(ground))
    return to_image(rgb * (1 + 0.04 * noise(rng, (size, size), 0.7))[..., None])


def floral(rng: np.random.Generator, ground: Colour, colours: list[Colour], count: int = 16, size: int = 128) -> Image:
    """Scattered blossoms with leaves."""
    image = PilImage.new("RGB", (size, size), _rgb(ground))
    draw = ImageDraw.Draw(image)
    for _ in range(count):
        x, y, r = *rng.uniform(0, size, 2), float(rng.uniform(0.03, 0.06) * size)
        for k in range(3):
            a = float(rng.uniform(0, 6.3)) + k
            _blob(draw, x + 2 * r * np.cos(a), y + 2 * r * np.sin(a), 0.8 * r, (0.35, 0.48, 0.30))
        petal = colours[int(rng.integers(len(colours)))]
        for a in np.arange(5) * 2 * np.pi / 5:
            _blob(draw, x + r * np.cos(a), y + r * np.sin(a), 0.75 * r, petal)
        _blob(draw, x, y, 0.5 * r, (0.92, 0.80, 0.36))
    return np.asarray(image)


def _rgb(colour: Colour) -> tuple[int, int, int]:
    r, g, b = (round(255 * float(np.clip(c, 0, 1))) for c in colour)
    return r, g, b


def _blob(draw: ImageDraw.ImageDraw, x: float, y: float, r: float, colour: Colour) -> None:
    draw.ellipse((x - r, y - r, x + r, y + r), fill=_rgb(colour))


def fabric(
    rng: np.random.Generator, plain: float = 0.4, palette: tuple[Colour, ...] = SOFT
) -> tuple[Image, str, Colour]:
    """Some cloth: its texture, what people call its pattern, and its main colour."""
    a, b, c = tone(rng, palette), tone(rng, SOFT), tone(rng, WHITES)
    if rng.random() < plain:
        return cloth(rng, a), "plain", a
    style = int(rng.integers(5))
    if style == 0:
        return stripes(rng, [a, c, b, c], int(rng.integers(2, 5)), bool(rng.random() < 0.6)), "striped", a
    if style == 1:
        return checks(rng, c, a, int(rng.integers(4, 9))), "checked", a
    if style == 2:
        return dots(rng, a, c, int(rng.integers(5, 10))), "dotted", a
    if style == 3:
        return floral(rng, c if rng.random() < 0.5 else a, [b, tone(rng, VIVID)]), "floral", a
    return zigzag(rng, [a, c, b]), "patterned", a


def zigzag(rng: np.random.Generator, colours: list[Colour], size: int = 128) -> Image:
    """Chevrons."""
    u, v = unit(size)
    n, m = int(rng.integers(3, 6)), int(rng.integers(2, 4))
    wave = np.abs((u * n) % 1 - 0.5) * 0.35
    band = (((v + wave) * m * len(colours)) % len(colours)).astype(int)
    return to_image(np.array(colours)[band] * (1 + 0.05 * noise(rng, (size, size), 0.7))[..., None])


def wicker(rng: np.random.Generator, colour: Colour, rows: int = 10, columns: int = 14, size: int = 128) -> Image:
    """Woven rods: over one, under one."""
    u, v = unit(size)
    row = np.floor(v * rows)
    swell = np.sin(np.pi * ((v * rows) % 1)) ** 0.6
    over = 0.5 + 0.5 * np.cos(np.pi * (u * columns + row))
    shade = 0.45 + 0.65 * swell * (0.45 + 0.55 * over)
    return to_image(np.array(colour) * (shade + 0.04 * noise(rng, (size, size), 1.0))[..., None])


def wood(rng: np.random.Generator, colour: Colour | None = None, size: int = 96) -> Image:
    """Grain along u."""
    base = np.array(colour or tone(rng, WOODS))
    grain = 0.05 * noise(rng, (size, size), (0.7, 14)) + 0.05 * noise(rng, (size, size), (3, 30))
    return to_image(base * (1 + grain)[..., None])


def speckle(rng: np.random.Generator, colour: Colour, other: Colour, share: float = 0.08, size: int = 64) -> Image:
    """Stoneware, cork, terrazzo: spots of another colour."""
    spots = noise(rng, (size, size), 0.9) > np.quantile(noise(rng, (size, size), 0.9), 1 - share)
    return to_image(np.where(spots[..., None], np.array(other), np.array(colour)))


def fade(top: Colour, bottom: Colour, size: int = 32) -> Image:
    """One colour above into another below."""
    t = np.linspace(0, 1, size)[:, None, None]
    return to_image((1 - t) * np.array(top) + t * np.array(bottom) * np.ones((size, 8, 1)))


def band(ground: Colour, stripe: Colour, low: float, high: float, size: int = 64) -> Image:
    """A ground with one stripe across, from ``low`` to ``high`` of its height, measured from below."""
    v = 1 - (np.arange(size) + 0.5) / size
    inside = ((v > low) & (v < high))[:, None, None]
    return to_image(np.where(inside, np.array(stripe), np.array(ground)) * np.ones((size, 8, 1)))


def foliage(rng: np.random.Generator, colour: Colour, variegated: bool = False, size: int = 64) -> Image:
    """A leaf: midrib along v, veins to both sides, its edge paler where ``variegated``."""
    u, v = unit(size)
    across = np.abs(u - 0.5) * 2
    veins = np.abs(((v + 0.35 * across) * 7) % 1 - 0.5) < 0.07
    shade = 1 - 0.10 * veins + 0.06 * noise(rng, (size, size), 2.0)
    rgb = np.array(colour) * np.where(across < 0.07, 1.22, shade)[..., None]
    if variegated:
        pale = np.clip((across + 0.15 * noise(rng, (size, size), 3.0) - 0.55) * 6, 0, 1)[..., None]
        rgb = rgb * (1 - pale) + np.array([0.85, 0.86, 0.62]) * pale
    return to_image(rgb)


def keys(
    rng: np.random.Generator, board: Colour, key: Colour, rows: int = 5, columns: int = 15, size: int = 160
) -> Image:
    """Keys of a keyboard, a space bar in the lowest row."""
    h = max(48, round(size * rows / columns))
    image = PilImage.new("RGB", (size, h), _rgb(board))
    draw = ImageDraw.Draw(image)
    w, dy = size / columns, h / rows
    for row in range(rows):
        x = 0.0
        while x < columns - 0.05:
            wide = 1.0 if 0 < x < columns - 2 else float(rng.choice([1.0, 1.5, 2.0]))
            wide = 5.5 if row == rows - 1 and 3 < x < 4.5 else min(wide, columns - x)
            draw.rounded_rectangle((x * w + 1, row * dy + 1, (x + wide) * w - 2, (row + 1) * dy - 2), 1, _rgb(key))
            x += wide
    return np.asarray(image)


def clock_face(rng: np.random.Generator, face: Colour, ink: Colour, size: int = 128) -> Image:
    """A dial, u to 3 o'clock and v to 6 o'clock, with marks and hands."""
    image = PilImage.new("RGB", (2 * size, 2 * size), _rgb(face))
    draw = ImageDraw.Draw(image)
    many = 60 if rng.random() < 0.5 else 12
    for k in range(many):
        big = k % (many // 12) == 0
        _spoke(draw, size, 2 * np.pi * k / many, 0.78 if big else 0.86, 0.92, 8 if big else 3, ink)
    minutes = int(rng.integers(720))
    _spoke(draw, size, 2 * np.pi * minutes / 720, -0.08, 0.5, 12, ink)
    _spoke(draw, size, 2 * np.pi * (minutes % 60) / 60, -0.1, 0.75, 8, ink)
    if rng.random() < 0.5:
        _spoke(draw, size, float(rng.uniform(0, 6.3)), -0.15, 0.8, 3, (0.75, 0.15, 0.12))
    _blob(draw, size, size, 0.05 * size, ink)
    return np.asarray(image.resize((size, size), PilImage.Resampling.BOX))


def _spoke(draw: ImageDraw.ImageDraw, c: int, angle: float, r0: float, r1: float, width: int, ink: Colour) -> None:
    x, y = np.sin(angle), -np.cos(angle)
    draw.line((c + r0 * c * x, c + r0 * c * y, c + r1 * c * x, c + r1 * c * y), fill=_rgb(ink), width=width)


def cover(rng: np.random.Generator, size: int = 96) -> Image:
    """The front of a book or magazine: a ground, a picture or bands, a title in bars."""
    ground, other = tone(rng, VIVID + SOFT + DARK), tone(rng, SOFT + WHITES)
    ink = (0.96, 0.95, 0.92) if sum(ground) < 1.6 else (0.12, 0.12, 0.14)
    w, h = round(size * 0.7), size
    image = PilImage.new("RGB", (w, h), _rgb(ground))
    draw = ImageDraw.Draw(image)
    style = int(rng.integers(4))
    if style == 0:
        draw.rectangle((0, h * 0.45, w, h), fill=_rgb(other))
        _blob(draw, w / 2, h * 0.62, w * 0.22, tone(rng, VIVID))
    elif style == 1:
        for k in range(5):
            draw.rectangle(
                (w * 0.12, h * (0.45 + 0.09 * k), w * float(rng.uniform(0.4, 0.88)), h * (0.49 + 0.09 * k)), _rgb(other)
            )
    elif style == 2:
        draw.polygon([(0, h), (w, h * 0.5), (w, h)], fill=_rgb(other))
        draw.polygon([(0, h * 0.7), (w * 0.6, h), (0, h)], fill=_rgb(tone(rng, VIVID)))
    else:
        draw.rectangle((w * 0.08, h * 0.06, w * 0.92, h * 0.94), outline=_rgb(other), width=2)
    for k in range(int(rng.integers(1, 4))):
        long = float(rng.uniform(0.3, 0.7))
        draw.rectangle(
            (w * (0.5 - long / 2), h * (0.12 + 0.1 * k), w * (0.5 + long / 2), h * (0.18 + 0.1 * k)), fill=_rgb(ink)
        )
    return np.asarray(image)


def globe_map(rng: np.random.Generator, sea: Colour, land: Colour, size: int = 128) -> Image:
    """Continents over seas, ice at the poles; u along the equator."""
    height = noise(rng, (size, 2 * size), 9.0) + 0.4 * noise(rng, (size, 2 * size), 3.0)
    rgb = np.where(
        (height > 0.5)[..., None],
        np.array(land) * (1 + 0.1 * noise(rng, (size, 2 * size), 2.0))[..., None],
        np.array(sea),
    )
    pole = np.abs(np.linspace(-1, 1, size))[:, None] > 0.9 + 0.02 * height
    return to_image(np.where(pole[..., None], 0.95, rgb))
