"""What every generator of small things needs: colours, materials, and the last touch that makes a thing fit its limits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric.base import Limits, Made
from openmap_scenes.homes.primitives import merge
from openmap_scenes.homes.textures import Colour
from openmap_scenes.scene import Material

STEP = 0.3
"""Longest edge, m: the light is measured at vertices."""

CERAMIC: tuple[Colour, ...] = (
    (0.94, 0.93, 0.90), (0.90, 0.87, 0.80), (0.30, 0.42, 0.56), (0.24, 0.26, 0.28), (0.62, 0.70, 0.62), (0.80, 0.52, 0.40),
    (0.86, 0.76, 0.50), (0.55, 0.24, 0.22), (0.35, 0.58, 0.60), (0.74, 0.78, 0.84),
)  # fmt: skip
VIVID: tuple[Colour, ...] = (
    (0.78, 0.16, 0.14), (0.14, 0.34, 0.66), (0.92, 0.72, 0.14), (0.20, 0.52, 0.28), (0.90, 0.46, 0.14), (0.50, 0.26, 0.56),
    (0.20, 0.62, 0.66), (0.90, 0.45, 0.58),
)  # fmt: skip
SOFT: tuple[Colour, ...] = (
    (0.88, 0.84, 0.76), (0.60, 0.66, 0.72), (0.72, 0.64, 0.56), (0.56, 0.62, 0.54), (0.80, 0.66, 0.62), (0.92, 0.90, 0.87),
    (0.40, 0.46, 0.56), (0.70, 0.50, 0.36), (0.76, 0.62, 0.30), (0.34, 0.34, 0.36), (0.62, 0.28, 0.26), (0.26, 0.40, 0.38),
)  # fmt: skip
METALS: tuple[Colour, ...] = (
    (0.76, 0.77, 0.78),
    (0.58, 0.59, 0.61),
    (0.20, 0.20, 0.21),
    (0.74, 0.60, 0.34),
    (0.70, 0.46, 0.34),
)
DARK: tuple[Colour, ...] = ((0.10, 0.10, 0.11), (0.16, 0.16, 0.18), (0.22, 0.22, 0.24), (0.14, 0.15, 0.18))
DEVICE: tuple[Colour, ...] = ((0.13, 0.13, 0.14), (0.80, 0.81, 0.82), (0.55, 0.56, 0.58), (0.92, 0.92, 0.91))
WHITES: tuple[Colour, ...] = ((0.95, 0.94, 0.92), (0.93, 0.92, 0.88), (0.90, 0.90, 0.90))
WOODS: tuple[Colour, ...] = (
    (0.72, 0.53, 0.34), (0.58, 0.39, 0.23), (0.42, 0.27, 0.17), (0.80, 0.66, 0.48), (0.50, 0.36, 0.25), (0.86, 0.74, 0.58),
)  # fmt: skip
LEATHERS: tuple[Colour, ...] = (
    (0.42, 0.24, 0.14),
    (0.14, 0.11, 0.10),
    (0.62, 0.40, 0.24),
    (0.48, 0.14, 0.14),
    (0.80, 0.70, 0.56),
)
GLASSES: tuple[Colour, ...] = ((0.80, 0.87, 0.88), (0.74, 0.84, 0.80), (0.85, 0.88, 0.92))


def tone(rng: np.random.Generator, palette: tuple[Colour, ...], spread: float = 0.025) -> Colour:
    """One of the colours, a little off."""
    r, g, b = np.clip(np.array(palette[int(rng.integers(len(palette)))]) + rng.normal(0, spread, 3), 0.03, 0.97)
    return float(r), float(g), float(b)


def paint(rng: np.random.Generator, palette: tuple[Colour, ...], name: str) -> Material:
    """A plain material in one of the colours."""
    return solid(name, tone(rng, palette))


def solid(name: str, colour: Colour) -> Material:
    """A plain material of a colour."""
    return Material(name, np.array(colour, np.float32))


def dimmed(colour: Colour, factor: float) -> Colour:
    """A colour made darker, or lighter where the factor exceeds 1."""
    r, g, b = (min(1.0, c * factor) for c in colour)
    return r, g, b


def skin(name: str, texture: npt.NDArray[np.uint8]) -> Material:
    """A material that shows a texture as it is."""
    return Material(name, np.ones(3, np.float32), texture)


def chance(rng: np.random.Generator, probability: float) -> bool:
    """True that often."""
    return bool(rng.random() < probability)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two."""
    return float(rng.uniform(low, high))


def pick(rng: np.random.Generator, *options: str) -> str:
    """One of the words."""
    return options[int(rng.integers(len(options)))]


def finish(
    parts: list[Model],
    limits: Limits,
    words: dict[str, str] | None = None,
    *,
    elevation: float = 0.0,
    surface: bool = False,
    smallest: float = 0.75,
) -> Made | None:
    """The parts as one thing, the middle of its base at the origin, shrunk evenly where it does not fit.

    None where it had to shrink below ``smallest`` of the size that it was drawn with.
    """
    model = merge(parts)
    vertices = model.vertices.astype(np.float64)
    low, high = vertices.min(0), vertices.max(0)
    room = np.array([limits.width, limits.height, limits.depth]) - 2e-6
    scale = min(1.0, float((room / np.maximum(high - low, 1e-9)).min()))
    if scale < smallest:
        return None
    middle = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    vertices = (vertices - middle) * scale
    model = Model(
        vertices.astype(np.float32), model.normals, model.uv, model.faces, model.face_material, model.materials
    )
    return Made(split_edges(model, STEP), dict(words or {}), elevation, surface)


def split_edges(model: Model, longest: float) -> Model:
    """Halve triangles at their longest edge until none exceeds ``longest`` m; normals and texture follow."""
    rows = np.concatenate([model.vertices, model.normals, model.uv], 1).astype(np.float64)
    faces, material = model.faces, model.face_material
    for _ in range(40):
        corners = rows[faces][..., :3]
        edges = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
        long = np.flatnonzero(edges.max(1) > longest)
        if len(long) == 0:
            break
        order = (edges[long].argmax(1)[:, None] + np.arange(3)) % 3
        f = np.take_along_axis(faces[long], order, 1)
        pairs, index = np.unique(np.sort(f[:, :2], axis=1), axis=0, return_inverse=True)
        middle = (len(rows) + index.reshape(-1)).astype(np.int32)
        added = rows[pairs].mean(1)
        added[:, 3:6] /= np.maximum(np.linalg.norm(added[:, 3:6], axis=1, keepdims=True), 1e-9)
        rows = np.concatenate([rows, added])
        faces = faces.copy()
        faces[long] = np.stack([f[:, 0], middle, f[:, 2]], 1)
        faces = np.concatenate([faces, np.stack([middle, f[:, 1], f[:, 2]], 1)])
        material = np.concatenate([material, material[long]])
    if len(rows) == len(model.vertices):
        return model
    out = rows.astype(np.float32)
    return Model(out[:, :3], out[:, 3:6], out[:, 6:], faces.astype(np.int32), material, model.materials)
