"""Pictures: landscapes, seas, abstracts, plant prints, portraits, and what screens show. sRGB uint8 (h, w, 3)."""

from __future__ import annotations

import numpy as np
from PIL import Image as PilImage
from PIL import ImageDraw

from openmap_scenes.homes.parametric.making import DARK, SOFT, VIVID, WHITES, tone
from openmap_scenes.homes.parametric.patterns import _blob, _rgb, to_image, unit
from openmap_scenes.homes.textures import Image, noise


def landscape(rng: np.random.Generator, size: int = 128) -> Image:
    """Mountains behind mountains under a sky of morning, noon or evening."""
    _, v = unit(size)
    top, low = (
        ((0.35, 0.55, 0.82), (0.86, 0.90, 0.93)) if rng.random() < 0.5 else ((0.35, 0.38, 0.60), (0.96, 0.72, 0.50))
    )
    rgb = (1 - v[..., None]) * np.array(top) + v[..., None] * np.array(low)
    near = np.array(tone(rng, ((0.16, 0.26, 0.18), (0.30, 0.34, 0.16), (0.24, 0.20, 0.26), (0.36, 0.26, 0.18))))
    layers = int(rng.integers(3, 6))
    for k in range(layers):
        t = (k + 1) / layers
        ridge = 0.35 + 0.5 * k / layers + (0.12 - 0.07 * t) * noise(rng, (1, size), (0.0, 4.0 + 10 * t))
        hill = (np.array(low) * (1 - t) * 0.85 + near * t) * (1 + 0.08 * noise(rng, (size, size), 1.5))[..., None]
        rgb = np.where((v > ridge)[..., None], hill, rgb)
    return to_image(rgb)


def seaside(rng: np.random.Generator, size: int = 128) -> Image:
    """Sky, sea and sand, the sun somewhere."""
    u, v = unit(size)
    horizon, shore = float(rng.uniform(0.35, 0.55)), float(rng.uniform(0.72, 0.85))
    warm = rng.random() < 0.5
    sky, glow = (
        (np.array([0.55, 0.72, 0.90]), np.array([0.95, 0.93, 0.86]))
        if not warm
        else (np.array([0.45, 0.40, 0.62]), np.array([0.98, 0.66, 0.36]))
    )
    rgb = sky + (glow - sky) * np.clip(v / horizon, 0, 1)[..., None] ** 1.5
    rgb[np.hypot(u - rng.uniform(0.25, 0.75), v - horizon * 0.7) < 0.07] = (0.99, 0.95, 0.80)
    water = np.array([0.16, 0.42, 0.54]) * (1 + 0.22 * noise(rng, (size, size), (0.8, 7)))[..., None]
    rgb = np.where((v > horizon)[..., None], water, rgb)
    sand = np.array([0.86, 0.77, 0.60]) * (1 + 0.05 * noise(rng, (size, size), 1.0))[..., None]
    return to_image(np.where((v > shore + 0.03 * noise(rng, (1, size), (0, 12)))[..., None], sand, rgb))


def abstract(rng: np.random.Generator, size: int = 128) -> Image:
    """Shapes or blots or fields of colour."""
    ground, style = tone(rng, WHITES + SOFT), int(rng.integers(3))
    palette = [tone(rng, VIVID + SOFT + DARK) for _ in range(4)]
    if style == 0:
        _u, _v = unit(size)
        rgb = np.ones((size, size, 3)) * np.array(ground)
        for k in range(5):
            blot = noise(rng, (size, size), float(rng.uniform(6, 18)))
            rgb = np.where((blot > 0.9)[..., None], np.array(palette[k % 4]), rgb)
        return to_image(rgb * (1 + 0.04 * noise(rng, (size, size), 1.0))[..., None])
    image = PilImage.new("RGB", (size, size), _rgb(ground))
    draw = ImageDraw.Draw(image)
    for k in range(7 if style == 1 else 4):
        x, y, r = *rng.uniform(0.1, 0.9, 2) * size, float(rng.uniform(0.1, 0.3)) * size
        if style == 1 and k % 2:
            _blob(draw, x, y, r, palette[k % 4])
        elif style == 1:
            draw.pieslice(
                (x - r, y - r, x + r, y + r),
                int(rng.integers(4)) * 90,
                int(rng.integers(4)) * 90 + 180,
                _rgb(palette[k % 4]),
            )
        else:
            y0 = size * (0.06 + 0.23 * k)
            draw.rectangle((size * 0.08, y0, size * 0.92, y0 + size * 0.19), _rgb(palette[k]))
    return np.asarray(image)


def botanical(rng: np.random.Generator, size: int = 128) -> Image:
    """A sprig on paper."""
    image = PilImage.new("RGB", (size, size), _rgb(tone(rng, WHITES)))
    draw = ImageDraw.Draw(image)
    green = tone(rng, ((0.24, 0.38, 0.26), (0.40, 0.46, 0.28), (0.25, 0.35, 0.40), (0.55, 0.35, 0.25)))
    bend, wide = float(rng.uniform(-0.2, 0.2)), float(rng.uniform(0.05, 0.1))
    pairs = int(rng.integers(4, 8))
    for k in range(pairs * 2 + 1):
        t = (k // 2) / pairs
        x, y = size * (0.5 + bend * t * t), size * (0.9 - 0.75 * t)
        side = (-1) ** k if k < pairs * 2 else 0
        long = size * 0.3 * (1 - 0.6 * t)
        tip = (x + side * long * 0.85, y - long * (0.55 if side else 1.0))
        dx, dy = tip[0] - x, tip[1] - y
        nx, ny = -dy * wide * 2, dx * wide * 2
        draw.polygon(
            [(x, y), (x + dx * 0.4 + nx, y + dy * 0.4 + ny), tip, (x + dx * 0.4 - nx, y + dy * 0.4 - ny)], _rgb(green)
        )
        draw.line((size * 0.5, size * 0.93, x, y), _rgb(green), 2)
    return np.asarray(image)


def portrait(rng: np.random.Generator, size: int = 96) -> Image:
    """Head and shoulders before a plain ground, one or two people."""
    image = PilImage.new("RGB", (size, size), _rgb(tone(rng, SOFT)))
    draw = ImageDraw.Draw(image)
    for x in (0.5,) if rng.random() < 0.5 else (0.33, 0.68):
        skin = tone(rng, ((0.90, 0.72, 0.60), (0.72, 0.52, 0.38), (0.45, 0.30, 0.22)))
        hair = tone(rng, ((0.14, 0.10, 0.08), (0.45, 0.30, 0.16), (0.75, 0.60, 0.36), (0.62, 0.60, 0.58)))
        y, r = float(rng.uniform(0.36, 0.45)), 0.14
        draw.ellipse([size * c for c in (x - r * 1.25, y - r * 1.5, x + r * 1.25, y + r * 1.5)], _rgb(hair))
        draw.ellipse([size * c for c in (x - 0.26, y + 0.22, x + 0.26, y + 1.0)], _rgb(tone(rng, VIVID + SOFT)))
        draw.rectangle([size * c for c in (x - 0.05, y + 0.1, x + 0.05, y + 0.26)], _rgb(skin))
        draw.ellipse([size * c for c in (x - r, y - r * 1.05, x + r, y + r * 1.35)], _rgb(skin))
    return np.asarray(image)


def any_picture(rng: np.random.Generator) -> tuple[Image, str]:
    """Some picture for a wall and what people call it."""
    makers = (
        (landscape, "landscape"),
        (seaside, "seascape"),
        (abstract, "abstract"),
        (botanical, "botanical print"),
        (portrait, "portrait"),
    )
    maker, name = makers[int(rng.choice(5, p=[0.25, 0.2, 0.25, 0.2, 0.1]))]
    return maker(rng), name


def screen(rng: np.random.Generator, desktop: bool = True) -> Image:
    """What a screen shows: mostly nothing (nearly black, paler towards a corner), else a desktop with windows or a film."""
    if rng.random() < (0.35 if desktop else 0.7):
        u, v = unit(64)
        return to_image((0.07 + 0.06 * np.clip(u - v, 0, 1))[..., None] * np.array([1.0, 1.05, 1.15]))
    if not desktop:
        return landscape(rng) if rng.random() < 0.6 else seaside(rng)
    image = PilImage.fromarray(landscape(rng) if rng.random() < 0.5 else abstract(rng)).resize((160, 96))
    draw = ImageDraw.Draw(image)
    for _ in range(int(rng.integers(1, 3))):
        x, y = int(rng.integers(8, 50)), int(rng.integers(6, 26))
        w, h = int(rng.integers(70, 100)), int(rng.integers(40, 60))
        draw.rectangle((x, y, x + w, y + h), (245, 246, 248))
        draw.rectangle((x, y, x + w, y + 6), _rgb(tone(rng, SOFT)))
        for k in range(h // 8 - 1):
            draw.rectangle(
                (x + 5, y + 11 + 8 * k, x + 5 + int(rng.integers(20, w - 10)), y + 13 + 8 * k), (90, 94, 104)
            )
    draw.rectangle((0, 90, 160, 96), (40, 44, 54))
    return np.asarray(image)
