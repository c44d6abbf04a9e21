"""What furniture is made of: wood, paint, metal, cloth, leather, stone, wicker; one texture repeat covers ``solids.TILE`` m."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

WOODS: dict[str, Colour] = {
    "oak": (0.72, 0.58, 0.42), "pine": (0.86, 0.73, 0.53), "beech": (0.80, 0.65, 0.49), "walnut": (0.42, 0.28, 0.19),
    "cherry": (0.58, 0.33, 0.20), "teak": (0.62, 0.42, 0.25), "birch": (0.88, 0.78, 0.62), "mahogany": (0.42, 0.20, 0.13),
}  # fmt: skip
METALS: dict[str, Colour] = {
    "steel": (0.66, 0.67, 0.69), "chrome": (0.80, 0.82, 0.85), "brass": (0.78, 0.62, 0.32), "black metal": (0.13, 0.13, 0.14),
}  # fmt: skip
PAINTS: tuple[Colour, ...] = (
    (0.95, 0.95, 0.93), (0.92, 0.90, 0.85), (0.62, 0.66, 0.68), (0.26, 0.28, 0.30), (0.45, 0.56, 0.52), (0.25, 0.35, 0.48),
    (0.72, 0.78, 0.74), (0.83, 0.76, 0.66), (0.30, 0.42, 0.34), (0.76, 0.45, 0.36), (0.88, 0.74, 0.40), (0.14, 0.14, 0.15),
)  # fmt: skip
CLOTHS: tuple[Colour, ...] = (
    (0.62, 0.60, 0.56), (0.38, 0.40, 0.43), (0.80, 0.75, 0.66), (0.20, 0.28, 0.42), (0.30, 0.42, 0.34), (0.70, 0.38, 0.26),
    (0.55, 0.24, 0.26), (0.78, 0.62, 0.28), (0.25, 0.24, 0.25), (0.48, 0.60, 0.66), (0.72, 0.55, 0.54), (0.52, 0.42, 0.34),
    (0.35, 0.48, 0.50), (0.88, 0.86, 0.82), (0.45, 0.33, 0.45),
)  # fmt: skip
HIDES: tuple[Colour, ...] = (
    (0.42, 0.25, 0.15), (0.16, 0.13, 0.12), (0.58, 0.36, 0.20), (0.86, 0.82, 0.75), (0.32, 0.14, 0.12), (0.30, 0.32, 0.30),
)  # fmt: skip
LINENS: tuple[Colour, ...] = (
    (0.94, 0.93, 0.90), (0.86, 0.83, 0.77), (0.70, 0.76, 0.82), (0.60, 0.66, 0.58), (0.80, 0.68, 0.64), (0.36, 0.42, 0.52),
    (0.55, 0.55, 0.57), (0.84, 0.72, 0.46), (0.48, 0.28, 0.32),
)  # fmt: skip
_WIDE, _TALL = 256, 128
Field = npt.NDArray[np.float64]


def choose(rng: np.random.Generator, *options: str) -> str:
    """One of the words."""
    return options[int(rng.integers(len(options)))]


def shade(rng: np.random.Generator, colours: tuple[Colour, ...]) -> Colour:
    """One of the colours, a little off."""
    base = np.array(colours[int(rng.integers(len(colours)))])
    c = np.clip(base * rng.uniform(0.93, 1.07) + rng.normal(0, 0.006, 3), 0.03, 0.98)
    return float(c[0]), float(c[1]), float(c[2])


def wood(rng: np.random.Generator, *species: str) -> tuple[Material, str]:
    """A wood of one of the species (default: any) and its name; the grain runs along u."""
    name = choose(rng, *(species or tuple(WOODS)))
    base = np.array(WOODS[name]) * rng.uniform(0.90, 1.08)
    streaks = gaussian_filter1d(_white(rng), 22, axis=1, mode="wrap")
    streaks = gaussian_filter1d(streaks, 0.6, axis=0, mode="wrap")
    bands = gaussian_filter1d(rng.standard_normal(_TALL), 4.0, mode="wrap")
    drift = 6 * np.sin(2 * np.pi * np.arange(_WIDE) / _WIDE + rng.uniform(0, 6)) * rng.uniform(0.4, 1.4)
    rows = (np.arange(_TALL)[:, None] + drift[None]).astype(int) % _TALL
    value = 0.05 * _unit(streaks) + 0.05 * _unit(bands)[rows]
    strength = 1.35 if name in ("pine", "oak", "walnut", "teak") else 0.75
    return Material(name, np.ones(3, np.float32), _paint(base, strength * value)), name


def wood_or_paint(rng: np.random.Generator, share: float = 0.35) -> tuple[Material, str]:
    """Wood, or with a chance of ``share`` painted wood, and what a person calls it."""
    material, name = wood(rng)
    return (painted(shade(rng, PAINTS)), "wood") if rng.random() < share else (material, name)


def painted(colour: Colour, name: str = "paint") -> Material:
    """One plain colour."""
    return Material(name, np.array(colour, np.float32))


def metal(rng: np.random.Generator, *kinds: str) -> tuple[Material, str]:
    """One of steel, chrome, brass, black metal (default: any), and what a person calls it."""
    name = choose(rng, *(kinds or tuple(METALS)))
    tone = np.array(METALS[name]) * rng.uniform(0.92, 1.08)
    value = gaussian_filter1d(rng.standard_normal((32, 64)), 12, axis=1, mode="wrap")
    word = "metal" if name == "black metal" else name
    return Material(name, np.ones(3, np.float32), _paint(tone, 0.018 * _unit(value))), word


def cloth(rng: np.random.Generator, colour: Colour | None = None, weave: str = "") -> Material:
    """Woven cloth: plain, coarse, striped, checked, or with velvet's soft spots."""
    base = np.array(colour if colour is not None else shade(rng, CLOTHS))
    weave = weave or choose(rng, "plain", "plain", "coarse", "velvet", "tweed")
    v, u = np.mgrid[0 : _TALL // 2, 0 : _WIDE // 2]
    white = rng.standard_normal(u.shape)
    if weave == "plain":
        value = 0.03 * ((u + v) % 2 * 2.0 - 1.0) + 0.025 * white
    elif weave == "coarse":
        value = 0.07 * ((u // 2 + v // 2) % 2 * 2.0 - 1.0) + 0.03 * white
    elif weave == "velvet":
        value = 0.035 * _unit(gaussian_filter(white, 7.0, mode="wrap")) + 0.012 * white
    elif weave == "tweed":
        value = 0.10 * white
    elif weave == "stripes":
        value = np.where((u // 8) % 2 == 0, 0.09, -0.09) + 0.02 * white
    else:
        value = 0.09 * ((u // 16) % 2) + 0.09 * ((v // 16) % 2) - 0.09 + 0.02 * white
    return Material(f"{weave} cloth", np.ones(3, np.float32), _paint(base, value))


def upholstery(rng: np.random.Generator) -> tuple[Material, str]:
    """What a seat is covered with, and its name: fabric, velvet or leather."""
    kind = choose(rng, "fabric", "fabric", "fabric", "velvet", "leather")
    if kind == "leather":
        return leather(rng), kind
    return cloth(rng, weave="velvet" if kind == "velvet" else choose(rng, "plain", "coarse", "tweed")), kind


def leather(rng: np.random.Generator) -> Material:
    """Leather: fine grain over soft wear."""
    white = rng.standard_normal((_TALL // 2, _WIDE // 2))
    value = 0.035 * _unit(gaussian_filter(white, 0.9, mode="wrap")) + 0.022 * _unit(
        gaussian_filter(white, 9, mode="wrap")
    )
    return Material("leather", np.ones(3, np.float32), _paint(np.array(shade(rng, HIDES)), value))


def linen(rng: np.random.Generator, colour: Colour | None = None) -> Material:
    """Bed linen: plain, striped or checked, with soft creases."""
    base = np.array(colour if colour is not None else shade(rng, LINENS))
    creases = _unit(gaussian_filter(rng.standard_normal((_TALL, _TALL)), (3.0, 9.0), mode="wrap"))
    value = 0.03 * creases + 0.012 * rng.standard_normal(creases.shape)
    pattern, k = choose(rng, "none", "none", "stripes", "checks", "dots"), np.arange(_TALL)
    if pattern == "stripes":
        value = value + np.where(k // 16 % 2 == 0, 0.06, -0.05)[None]
    elif pattern == "checks":
        value = value - 0.12 * ((k // 16 % 2)[None] + (k // 32 % 2)[:, None]) / 2
    elif pattern == "dots":
        u, v = np.meshgrid((k % 16) - 7.5, (k % 32) - 15.5)
        value = value - 0.22 * (np.hypot(u, v / 2) < 3.0)
    return Material("linen", np.ones(3, np.float32), _paint(base, value))


def stone(rng: np.random.Generator, kind: str = "") -> tuple[Material, str]:
    """A worktop or table top: marble, granite, or plain laminate, and its name."""
    kind = kind or choose(rng, "marble", "granite", "granite")
    white = rng.standard_normal((_TALL, _WIDE))
    if kind == "marble":
        base = np.array([(0.93, 0.92, 0.90), (0.20, 0.21, 0.22), (0.82, 0.76, 0.68)][int(rng.integers(3))])
        veins = np.abs(_unit(gaussian_filter(white, 9, mode="wrap")))
        cloud = _unit(gaussian_filter(white[::-1], 16, mode="wrap"))
        value = -np.where(base.mean() > 0.5, 0.22, -0.5) * np.exp(-((veins / 0.10) ** 2)) + 0.025 * cloud
    else:
        base = np.array(
            [(0.30, 0.30, 0.31), (0.62, 0.60, 0.57), (0.16, 0.16, 0.17), (0.80, 0.79, 0.76)][int(rng.integers(4))]
        )
        value = 0.10 * _unit(gaussian_filter(white, 0.8, mode="wrap"))
    return Material(kind, np.ones(3, np.float32), _paint(base, value)), kind


def wicker(rng: np.random.Generator) -> Material:
    """Plaited rattan: over and under, dark in the gaps."""
    base = np.array(shade(rng, ((0.72, 0.55, 0.35), (0.58, 0.42, 0.27), (0.45, 0.40, 0.36), (0.82, 0.70, 0.50))))
    v, u = np.mgrid[0:_TALL, 0:_WIDE]
    row = v // 8
    over = np.abs(np.sin(np.pi * (u / 16 + 0.5 * (row % 2))))
    value = 0.35 * (over - 0.65) - 0.32 * (v % 8 < 2) + 0.05 * rng.standard_normal(u.shape)
    return Material("rattan", np.ones(3, np.float32), _paint(base, value))


def glass(rng: np.random.Generator) -> Material:
    """Glass as an unlit, opaque picture shows it: pale, with a slanted gleam."""
    v, u = np.mgrid[0:64, 0:64] / 64.0
    gleam = 0.06 * np.sin(2 * np.pi * (u + v)) + 0.03 * np.sin(4 * np.pi * (u + v) + 1)
    tint = np.array([(0.76, 0.84, 0.85), (0.70, 0.78, 0.80), (0.80, 0.84, 0.82)][int(rng.integers(3))])
    return Material("glass", np.ones(3, np.float32), _paint(tint, gleam))


def mirror_glass() -> Material:
    """A mirror: brighter than glass, its gleam wider."""
    v, u = np.mgrid[0:64, 0:64] / 64.0
    gleam = 0.08 * np.sin(2 * np.pi * (u + v)) + 0.05 * np.sin(2 * np.pi * (2 * u - v))
    return Material("mirror", np.ones(3, np.float32), _paint(np.array([0.80, 0.85, 0.87]), gleam))


def ceramic(rng: np.random.Generator) -> Material:
    """White glaze."""
    return painted(shade(rng, ((0.96, 0.96, 0.95), (0.96, 0.96, 0.95), (0.93, 0.91, 0.86))), "ceramic")


def _white(rng: np.random.Generator) -> Field:
    return rng.standard_normal((_TALL, _WIDE))


def _unit(field: Field) -> Field:
    return np.asarray((field - field.mean()) / max(float(field.std()), 1e-9))


def _paint(base: npt.NDArray[np.floating], value: Field) -> npt.NDArray[np.uint8]:
    """A colour (3,) made lighter and darker by the values (h, w)."""
    return np.asarray(np.round(np.clip(base * (1.0 + value[..., None]), 0.0, 1.0) * 255.0), np.uint8)
