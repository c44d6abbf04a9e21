"""Where the rendering benchmark looks from: along a walk, as agents do, and from places that have nothing to do with each other."""

from __future__ import annotations

from typing import cast

import numpy as np
import numpy.typing as npt

from openmap_env.actions import Action
from openmap_env.navigation import NavigableSurface, ShortestPathFollower
from openmap_env.rendering import Renderer
from openmap_env.simulator import Simulator
from openmap_scenes import PinholeCamera, Scene

CAMERA_HEIGHT = 1.25
_STEPS_TO_A_GOAL = 80
_LOOK_AROUND = 0.1

Poses = npt.NDArray[np.float64]


class _Blind:
    """Stands in for a renderer where only the body's way matters."""

    def close(self) -> None:
        """Nothing is open."""


def walk(scene: Scene, surface: NavigableSurface, n: int, rng: np.random.Generator) -> Poses:
    """Camera poses T_world_camera (n, 4, 4) after each of n actions on the way to random places: 0.25 m, 15 degrees."""
    blind = cast(Renderer, _Blind())
    body = Simulator(
        scene, PinholeCamera.from_hfov(8, 8, 90.0), renderer=blind, camera_height=CAMERA_HEIGHT, surface=surface
    )
    body.reset(surface.random_point(rng, 0), float(rng.uniform(-np.pi, np.pi)))
    poses: list[Poses] = []
    while len(poses) < n:
        guide = ShortestPathFollower(surface, surface.random_point(rng, 0))
        for _ in range(_STEPS_TO_A_GOAL):
            action = guide.next_action(body.position, body.heading)
            if action == Action.STOP:
                break
            if rng.random() < _LOOK_AROUND:
                action = Action.TURN_LEFT
            body.step(action)
            poses.append(body.T_world_camera)
    return np.stack(poses[:n])


def scattered(surface: NavigableSurface, n: int, rng: np.random.Generator) -> Poses:
    """Poses (n, 4, 4) at random places of the largest island, looking anywhere, up to 15 degrees up or down."""
    poses = np.tile(np.eye(4), (n, 1, 1))
    for T in poses:
        T[:3, 3] = surface.random_point(rng, 0) + np.array([0.0, CAMERA_HEIGHT, 0.0])
        heading, pitch = rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi / 12, np.pi / 12)
        c, s, cp, sp = np.cos(heading), np.sin(heading), np.cos(pitch), np.sin(pitch)
        T[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    return poses
