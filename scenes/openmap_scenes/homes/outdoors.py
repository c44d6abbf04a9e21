"""What the windows of a home show: one sky for all of them, and hills, houses, trees and hedges that differ. sRGB uint8."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.textures import Image, noise, to_image

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Weather:
    """The hour and the sky: colours (3,) at the zenith and at the horizon, how much cloud, what light falls on things."""

    zenith: Array
    horizon: Array
    cloud: float
    light: Array
    lamps: bool = False


def _weather(zenith: tuple[float, ...], horizon: tuple[float, ...], cloud: float, light: tuple[float, ...]) -> Weather:
    return Weather(np.array(zenith), np.array(horizon), cloud, np.array(light))


WEATHER = (
    _weather((0.55, 0.73, 0.93), (0.90, 0.95, 0.98), 0.5, (1.0, 1.0, 0.98)),
    _weather((0.66, 0.79, 0.93), (0.95, 0.96, 0.95), 0.8, (1.0, 0.99, 0.95)),
    _weather((0.82, 0.85, 0.88), (0.93, 0.94, 0.94), 1.0, (0.88, 0.90, 0.92)),
    _weather((0.60, 0.70, 0.86), (0.99, 0.87, 0.70), 0.6, (1.0, 0.86, 0.70)),
)
EVENING = Weather(np.array([0.30, 0.38, 0.56]), np.array([0.93, 0.68, 0.52]), 0.5, np.array([0.45, 0.44, 0.52]), True)


def draw_weather(rng: np.random.Generator) -> Weather:
    """Mostly day, sometimes dusk."""
    return EVENING if rng.random() < 0.08 else WEATHER[int(rng.integers(len(WEATHER)))]


def outdoors(rng: np.random.Generator, weather: Weather, horizon: float, aspect: float, size: int = 256) -> Image:
    """A view, (size, size, 3), stretched over a pane.

    Parameters
    ----------
    horizon : float
        Height of the eye within the pane, 0 = its top, 1 = its foot.
    aspect : float
        Width of the pane over its height, so that houses are upright and trees round.
    """
    v, u = np.mgrid[0:size, 0:size] / size
    # Coordinates in pane heights: x to the right, y up from the horizon.
    x, y = u * aspect, horizon - v
    rise = np.clip(y / 0.9, 0, 1)[..., None]
    rgb = weather.horizon + (weather.zenith - weather.horizon) * rise
    cloud = np.clip(noise(rng, (size, size), (5.0, 16.0)) * 0.7 + weather.cloud - 0.5, 0, 1)[..., None] * 0.6
    rgb = rgb + (np.clip(weather.horizon * 1.04, 0, 1) - rgb) * cloud
    haze = weather.horizon
    hills = 0.04 + 0.03 * _ridge(rng, x, 0.5)
    rgb = np.where((y < hills)[..., None], 0.55 * haze + 0.45 * weather.light * np.array([0.45, 0.53, 0.52]), rgb)
    if rng.random() < 0.7:
        rgb = _houses(rng, rgb, x, y, weather, aspect)
    rgb = _trees(rng, rgb, x, y, weather, aspect)
    ground = np.array([0.50, 0.60, 0.36]) * (1 + 0.05 * noise(rng, (size, size), (1.0, 3.0)))[..., None]
    lawn = y < -0.10 - 0.01 * _ridge(rng, x, 0.2)
    rgb = np.where(lawn[..., None], weather.light * ground, rgb)
    if rng.random() < 0.5:
        hedge = (y < -0.03 + 0.006 * noise(rng, (size, size), 2.0)) & (y > -0.13)
        leaf = np.array([0.28, 0.40, 0.24]) * (1 + 0.16 * noise(rng, (size, size), 1.2))[..., None]
        rgb = np.where(hedge[..., None], weather.light * leaf, rgb)
    # Seen from a room what lies outside is bright and pale.
    pale = 0.12 if weather.lamps else 0.28
    return to_image(rgb * (1 - pale) + pale * np.array([0.97, 0.98, 1.0]))


def _ridge(rng: np.random.Generator, x: Array, scale: float) -> Array:
    """A smooth line over x, about -1..1."""
    waves = [(scale / k, rng.uniform(0, 2 * np.pi), 1.0 / k) for k in (1, 2, 3)]
    return np.asarray(sum(a * np.sin(x / s + phase) for s, phase, a in waves))


def _houses(rng: np.random.Generator, rgb: Array, x: Array, y: Array, weather: Weather, aspect: float) -> Array:
    """A row of houses across the street, gabled or flat, with windows that are lit at dusk."""
    left = float(rng.uniform(-0.3, 0.1))
    while left < aspect:
        width, wall = float(rng.uniform(0.22, 0.42)), float(rng.uniform(0.08, 0.2))
        paint = np.array(rng.choice([(0.85, 0.80, 0.70), (0.74, 0.50, 0.42), (0.88, 0.88, 0.86), (0.72, 0.72, 0.66)]))
        roof = np.array(rng.choice([(0.52, 0.30, 0.25), (0.34, 0.33, 0.35), (0.46, 0.36, 0.30)]))
        inside = (x > left) & (x < left + width)
        gable = float(rng.uniform(0.05, 0.11))
        height = wall + gable * (1 - np.abs((x - left) / width * 2 - 1))
        light = weather.light * float(rng.uniform(0.85, 1.0))
        rgb = np.where((inside & (y > -0.12) & (y < height))[..., None], roof * light, rgb)
        rgb = np.where((inside & (y > -0.12) & (y < wall))[..., None], paint * light, rgb)
        columns = int(rng.integers(2, 5))
        s, t = (x - left) / width * columns, (y + 0.12) / 0.105
        pane = inside & (np.abs(s % 1 - 0.5) < 0.2) & (np.abs(t % 1 - 0.55) < 0.26) & (y < wall - 0.02) & (y > -0.12)
        lit = weather.lamps & (rng.random((16, 16)) < 0.4)[t.astype(int) % 16, s.astype(int) % 16]
        glass = np.where(lit[..., None], np.array([1.0, 0.84, 0.52]), np.array([0.38, 0.44, 0.50]) * light)
        rgb = np.where(pane[..., None], glass, rgb)
        left += width + float(rng.choice([0.0, rng.uniform(0.05, 0.3)]))
    return rgb


def _trees(rng: np.random.Generator, rgb: Array, x: Array, y: Array, weather: Weather, aspect: float) -> Array:
    """Some round crowns and some firs."""
    rough = noise(rng, x.shape, 2.2)
    leaf = noise(rng, x.shape, 1.3)
    for _ in range(int(rng.integers(1, 3 + int(3 * aspect)))):
        at, low, r = (
            float(rng.uniform(-0.1, aspect + 0.1)),
            float(rng.uniform(0.0, 0.12)),
            float(rng.uniform(0.06, 0.16)),
        )
        green = np.array(rng.choice([(0.33, 0.47, 0.26), (0.42, 0.53, 0.28), (0.27, 0.40, 0.30), (0.50, 0.52, 0.26)]))
        if rng.random() < 0.3:
            crown = (np.abs(x - at) < (low + 3 * r - y) * 0.28 + 0.008 * rough) & (y > -0.08)
        else:
            crown = np.hypot(x - at, (y - low - r) * 0.85) < r * (1 + 0.10 * rough)
        trunk = (np.abs(x - at) < 0.012) & (y < low + r) & (y > -0.14)
        shade = 1 + 0.13 * leaf + 0.5 * (y - low - r)
        rgb = np.where(trunk[..., None], weather.light * np.array([0.36, 0.29, 0.23]), rgb)
        rgb = np.where(crown[..., None], weather.light * green * shade[..., None], rgb)
    return rgb
