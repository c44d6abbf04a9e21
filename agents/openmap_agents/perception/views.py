"""Pictures with known ids to train and measure perception on: random standpoints and headings in a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import Frame, make_renderer
from openmap_scenes import PinholeCamera, Scene

EYE_HEIGHT = 1.25
STRUCTURE = frozenset({"wall", "floor", "ceiling"})
_PITCHES = (-0.35, -0.17, 0.0, 0.0, 0.12)


@dataclass(frozen=True)
class View:
    """A frame and where it was taken; ``T_world_camera`` (4, 4) float64."""

    frame: Frame
    T_world_camera: npt.NDArray[np.float64]


def camera_pose(position: npt.ArrayLike, heading: float, pitch: float) -> npt.NDArray[np.float64]:
    """T_world_camera (4, 4) at a place (3,) m; heading turns left about +Y, pitch looks up; radians."""
    c, s, cp, sp = np.cos(heading), np.sin(heading), np.cos(pitch), np.sin(pitch)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array(
        [[1, 0, 0], [0, cp, -sp], [0, sp, cp]]
    )
    T_world_camera[:3, 3] = position
    return T_world_camera


def random_views(
    scene: Scene, camera: PinholeCamera, n: int, rng: np.random.Generator, min_instances: int = 3
) -> Iterator[View]:
    """n views from random navigable places of the scene's largest island; views of fewer instances are drawn again."""
    surface = NavigableSurface.from_scene(scene)
    renderer = make_renderer("opengl", scene, camera)
    try:
        made = 0
        for _ in range(20 * n):
            if made == n:
                break
            position = surface.random_point(rng, island=0) + np.array([0.0, EYE_HEIGHT, 0.0])
            pose = camera_pose(position, float(rng.uniform(-np.pi, np.pi)), float(rng.choice(_PITCHES)))
            frame = renderer.render(pose)
            if len(np.unique(frame.instance)) >= min_instances and np.median(frame.depth) > 0.6:
                made += 1
                yield View(frame, pose)
    finally:
        renderer.close()
