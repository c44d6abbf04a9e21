"""What moves, turns, stretches and repeats parts of furniture, and puts them together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.outlines import Triple
from openmap_scenes.homes.primitives import merge

_AXES = {"x": 0, "y": 1, "z": 2}


def moved(model: Model, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Model:
    """Shifted by m."""
    return replace(model, vertices=model.vertices + np.array([x, y, z], np.float32))


def turned(model: Model, axis: str, angle: float, about: Triple = (0.0, 0.0, 0.0)) -> Model:
    """Turned by ``angle`` rad, right-handed, about an axis "x", "y" or "z" through a point, m."""
    k = _AXES[axis]
    a, b = (k + 1) % 3, (k + 2) % 3
    rotation = np.eye(3)
    rotation[a, a] = rotation[b, b] = np.cos(angle)
    rotation[b, a], rotation[a, b] = np.sin(angle), -np.sin(angle)
    centre = np.array(about)
    vertices = (model.vertices - centre) @ rotation.T + centre
    return replace(model, vertices=vertices.astype(np.float32), normals=(model.normals @ rotation.T).astype(np.float32))


def scaled(model: Model, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Model:
    """Stretched along the axes by positive factors, about the origin."""
    s = np.array([x, y, z])
    normals = model.normals / s
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return replace(model, vertices=(model.vertices * s).astype(np.float32), normals=normals.astype(np.float32))


def mirrored(model: Model, axis: str = "x") -> Model:
    """Its mirror image in the plane through the origin across an axis."""
    s = np.ones(3, np.float32)
    s[_AXES[axis]] = -1.0
    faces = np.ascontiguousarray(model.faces[:, ::-1])
    return replace(model, vertices=model.vertices * s, normals=model.normals * s, faces=faces)


def both(model: Model, axis: str = "x") -> Model:
    """A part and its mirror image."""
    return merge([model, mirrored(model, axis)])


def repeated(model: Model, offsets: npt.ArrayLike) -> Model:
    """A part at each of the offsets (K, 3) m: slats, drawers, legs."""
    return merge([moved(model, *o) for o in np.asarray(offsets, np.float64).tolist()])


def assembled(parts: Sequence[Model]) -> Model:
    """Parts as one model, stood on y = 0, centred in x and z."""
    model = merge(list(parts))
    low, high = model.vertices.min(0), model.vertices.max(0)
    shift = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], np.float32)
    return replace(model, vertices=model.vertices - shift)
