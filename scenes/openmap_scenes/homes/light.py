"""Light for a home, baked into vertex colours: sky through the windows, a lamp per room, and how open the place is.

For a vertex with normal n the light is a sum of three terms, all found by casting rays against the home itself:
the share of the hemisphere that is open within reach (ambient occlusion), the windows as bright areas, and the ceiling lamps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.surface import sphere
from openmap_scenes.homes.vectors import lengths

REACHES = (0.3, 0.7, 1.4)
AMBIENT, SKY, LAMP = 0.62, 1.5, 0.85
DAY = np.array([0.97, 1.0, 1.03])
WARM = np.array([1.03, 0.99, 0.91])
GLOW = 0.16


@dataclass(frozen=True)
class Light:
    """A patch that shines: ``points`` (K, 3) m on it, ``normal`` (3,) or None for all around, ``power``, ``tint`` (3,).

    ``reach`` m is how far it is felt; what lies within ``past`` m of it, its own shade, casts no shadow.
    """

    points: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64] | None
    power: float
    tint: npt.NDArray[np.float64]
    reach: float = 6.0
    past: float = 0.0


@dataclass(frozen=True)
class Sun:
    """Parallel light that comes in at windows.

    Parameters
    ----------
    towards : (3,) float64
        Unit vector to the sun.
    holes : list of (axis along the wall 0 or 2, place on the other axis m, low, high)
        Glass: (along, height) m of two corners.
    power : float
    tint : (3,) float64
    """

    towards: npt.NDArray[np.float64]
    holes: list[tuple[int, float, tuple[float, float], tuple[float, float]]]
    power: float
    tint: npt.NDArray[np.float64]


def bake(
    points: npt.NDArray[np.float32],
    normals: npt.NDArray[np.float32],
    vertices: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    lights: list[Light],
    may_hide: npt.NDArray[np.bool_],
    sun: Sun | None = None,
    rays: int = 18,
) -> npt.NDArray[np.uint8]:
    """Colours (V, 3) uint8 sRGB at points (V, 3) m with normals (V, 3); vertices (W, 3) and faces (F, 3) cast the shadows.

    Where ``may_hide`` (V,) bool holds and no ray gets out the place is inside something: it becomes grey instead of black,
    because all that is ever seen of it is a pixel through a seam.
    """
    caster = RayCaster(vertices, faces)
    first, inverse = _distinct(points, normals)
    normal = normals[first] / np.maximum(np.linalg.norm(normals[first], axis=1, keepdims=True), np.float32(1e-6))
    origin = points[first] + np.float32(0.02) * normal
    openness = np.zeros(len(origin), np.float32)
    for k, direction in enumerate(_hemisphere(normal, rays)):
        openness += ~caster.blocked(origin, direction, REACHES[k % len(REACHES)])
    openness /= rays
    # Light from above is stronger than light from the floor.
    total = AMBIENT * (openness * (0.86 + 0.14 * normal[:, 1]))[:, None] * np.ones(3)
    for light in lights:
        total += _direct(origin, normal, light, caster)[:, None] * light.tint
    if sun is not None:
        total += _sunlight(origin, normal, sun, caster)[:, None] * sun.tint
    total[(openness == 0.0) & may_hide[first]] = 0.4
    shade = np.clip(1.0 - np.exp(-1.8 * total), 0.0, 1.0) ** 0.8
    return np.asarray(np.round(255.0 * np.clip(shade * 1.06, 0.22, 1.0)), np.uint8)[inverse]


def _distinct(
    points: npt.NDArray[np.float32], normals: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """One index for each different (point, normal), to 5 mm and 1/12, and for every row which of them it is."""
    cells = np.concatenate([np.round(points / 0.005), np.round(normals * 12)], 1).astype(np.int64)
    cells -= cells.min(0)
    key = np.ravel_multi_index(tuple(cells.T), tuple((cells.max(0) + 1).tolist()))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse.reshape(-1)


def _hemisphere(normal: npt.NDArray[np.float32], rays: int) -> list[npt.NDArray[np.float32]]:
    """``rays`` unit directions (V, 3) around each normal, spread by the cosine: a normal plus a point of the unit sphere."""
    out = []
    for offset in sphere(rays):
        direction = normal + np.float32(0.98) * offset.astype(np.float32)
        out.append(direction / lengths(direction)[:, None])
    return out


def _direct(
    origin: npt.NDArray[np.float32],
    normal: npt.NDArray[np.float32],
    light: Light,
    caster: RayCaster,
) -> npt.NDArray[np.float64]:
    """What a light sends to each place, (V,): power * cosines / (1 + r^2), shadows by rays."""
    total, columns = np.zeros(len(origin)), np.ascontiguousarray(origin.T)
    for point in light.points.astype(np.float32):
        inside = np.abs(columns[0] - point[0]) < light.reach
        for k in (1, 2):
            inside &= np.abs(columns[k] - point[k]) < light.reach
        near = np.flatnonzero(inside)
        to = point - origin[near]
        r = lengths(to)
        unit = to / np.maximum(r, 1e-6)[:, None]
        strength = np.maximum(np.einsum("ij,ij->i", normal[near], unit), 0.0)
        if light.normal is not None:
            strength = strength * np.maximum(-(unit @ light.normal.astype(np.float32)), 0.0)
        strength = strength / ((0.6 if light.past == 0.0 else 0.06) + r * r)
        lit = np.flatnonzero((strength * light.power > 0.006) & (r < light.reach) & (r > light.past))
        if len(lit):
            # A ray as long as the way to the light; its last stretch is left out, where the lamp itself is.
            way = to[lit] * (1.0 - light.past / r[lit])[:, None]
            total[near[lit]] += strength[lit] * ~caster.blocked(origin[near[lit]], way, 0.97)
    return total * light.power / len(light.points)


def _sunlight(
    origin: npt.NDArray[np.float32], normal: npt.NDArray[np.float32], sun: Sun, caster: RayCaster
) -> npt.NDArray[np.float64]:
    """What the sun sends through the windows to each place, (V,)."""
    total = np.zeros(len(origin))
    cosine = normal @ sun.towards.astype(np.float32)
    for axis, at, low, high in sun.holes:
        other = 2 - axis
        if abs(sun.towards[other]) < 0.15:
            continue
        t = (at - origin[:, other]) / sun.towards[other]
        along, height = origin[:, axis] + t * sun.towards[axis], origin[:, 1] + t * sun.towards[1]
        inside = (along > low[0]) & (along < high[0]) & (height > low[1]) & (height < high[1])
        lit = np.flatnonzero((t > 0.1) & (t < 9.0) & (cosine > 0.02) & inside)
        if len(lit):
            way = (t[lit, None] * sun.towards).astype(np.float32)
            # The glass and its bars, 15 cm deep in the wall, let it through.
            end = 1.0 - 0.16 / (t[lit] * abs(sun.towards[other]))
            free = ~caster.blocked(origin[lit], way * np.maximum(end, 0.0)[:, None].astype(np.float32), 1.0)
            total[lit] = np.maximum(total[lit], cosine[lit] * free)
    return total * sun.power
