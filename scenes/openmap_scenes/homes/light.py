"""Light for a home, baked into vertex colours: sky through the windows, a lamp per room, and how open the place is.

For a vertex with normal n the light is a sum of three terms, all found by casting rays against the home itself:
the share of the hemisphere that is open within reach (ambient occlusion), the windows as bright areas, and the ceiling lamps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.surface import sphere

REACH = 1.2
AMBIENT, SKY, LAMP = 0.62, 1.5, 0.85
DAY = np.array([0.97, 1.0, 1.03])
WARM = np.array([1.03, 0.99, 0.91])


@dataclass(frozen=True)
class Light:
    """A patch that shines: ``points`` (K, 3) m on it, ``normal`` (3,) or None for all around, ``power``, ``tint`` (3,)."""

    points: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64] | None
    power: float
    tint: npt.NDArray[np.float64]


def bake(
    vertices: npt.NDArray[np.float32],
    normals: npt.NDArray[np.float32],
    faces: npt.NDArray[np.int32],
    lights: list[Light],
    rays: int = 20,
) -> npt.NDArray[np.uint8]:
    """Vertex colours (V, 3) uint8 sRGB for vertices and normals (V, 3) in the world frame."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices, faces.astype(np.uint32))

    def distance(origin: npt.NDArray[np.float32], direction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        batch = o3d.core.Tensor(np.concatenate([origin, direction], 1).astype(np.float32))
        return np.asarray(scene.cast_rays(batch)["t_hit"].numpy())

    places, inverse = np.unique(
        np.concatenate([np.round(vertices, 3), np.round(normals, 2)], 1), axis=0, return_inverse=True
    )
    points, normal = places[:, :3].astype(np.float32), places[:, 3:].astype(np.float32)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-6)
    origin = points + np.float32(0.02) * normal
    openness = np.zeros(len(points), np.float32)
    for direction in _hemisphere(normal, rays):
        openness += np.minimum(distance(origin, direction), REACH) / REACH
    openness /= rays
    # Light from above is stronger than light from the floor.
    total = AMBIENT * (openness * (0.86 + 0.14 * normal[:, 1]))[:, None] * np.ones(3)
    for light in lights:
        total += _direct(origin, normal, light, distance)[:, None] * light.tint
    shade = np.clip(1.0 - np.exp(-2.1 * total), 0.0, 1.0) ** 0.8
    return np.asarray(np.round(255.0 * np.clip(shade * 1.06, 0.10, 1.0)), np.uint8)[inverse.reshape(-1)]


def _hemisphere(normal: npt.NDArray[np.float32], rays: int) -> list[npt.NDArray[np.float32]]:
    """``rays`` unit directions (V, 3) around each normal, spread by the cosine: a normal plus a point of the unit sphere."""
    out = []
    for offset in sphere(rays):
        direction = normal + np.float32(0.98) * offset.astype(np.float32)
        out.append(direction / np.linalg.norm(direction, axis=1, keepdims=True))
    return out


def _direct(
    origin: npt.NDArray[np.float32],
    normal: npt.NDArray[np.float32],
    light: Light,
    distance: object,
) -> npt.NDArray[np.float64]:
    """What a light sends to each place, (V,): power * cosines / (1 + r^2), shadows by rays."""
    total = np.zeros(len(origin))
    for point in light.points.astype(np.float32):
        to = point - origin
        r = np.linalg.norm(to, axis=1)
        unit = to / np.maximum(r, 1e-6)[:, None]
        strength = np.maximum((normal * unit).sum(1), 0.0)
        if light.normal is not None:
            strength = strength * np.maximum(-(unit @ light.normal.astype(np.float32)), 0.0)
        strength = strength / (0.6 + r * r)
        lit = np.flatnonzero(strength * light.power > 0.004)
        if len(lit):
            clear = distance(origin[lit], unit[lit]) > r[lit] - 0.06  # type: ignore[operator]
            total[lit] += strength[lit] * clear
    return total * light.power / len(light.points)
