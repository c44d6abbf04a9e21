"""Views of a scene to learn from: many cameras, at many heights, aimed at large and small things, with a sensor's errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.training.augment import SensorNoise
from openmap_agents.perception.views import camera_pose
from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import Frame, make_renderer
from openmap_scenes import PinholeCamera, Scene

_SIZES = ((640, 480), (640, 480), (640, 480), (640, 360), (512, 512), (320, 240))
_HEIGHTS = (0.5, 1.7)
_USUAL_HEIGHT = 1.25
_AIMED_SHARE = 0.5
_REACH = (0.7, 4.0)
_CLOSEST_MEDIAN = 0.5
_FEWEST_THINGS = 3
_TRIES = 20


@dataclass(frozen=True)
class Sight:
    """A view as a camera gives it.

    Parameters
    ----------
    frame : Frame
        Picture and depth with the sensor's errors, true ids.
    T_world_camera : (4, 4) float64
        As the robot believes it: gravity is off by up to two degrees now and then.
    """

    frame: Frame
    T_world_camera: npt.NDArray[np.float64]


def draw_camera(rng: np.random.Generator) -> PinholeCamera:
    """A camera as robots carry them: 640 pixels across for the most part, 60 to 100 degrees."""
    width, height = _SIZES[int(rng.integers(len(_SIZES)))]
    return PinholeCamera.from_hfov(width, height, float(rng.uniform(60.0, 100.0)))


def _aim(scene: Scene, eye: npt.NDArray[np.float64], rng: np.random.Generator) -> tuple[float, float] | None:
    """Heading and pitch towards some thing within reach; things of all sizes are as likely."""
    centres = np.array([i.centre for i in scene.instances])
    distance = np.linalg.norm(centres - eye, axis=1)
    near = np.flatnonzero((distance > _REACH[0]) & (distance < _REACH[1]))
    if len(near) == 0:
        return None
    d = centres[rng.choice(near)] - eye
    heading = np.arctan2(-d[0], -d[2]) + rng.uniform(-0.35, 0.35)
    pitch = np.arctan2(d[1], np.hypot(d[0], d[2])) + rng.uniform(-0.2, 0.2)
    return float(heading), float(np.clip(pitch, -0.9, 0.5))


def _pose(scene: Scene, surface: NavigableSurface, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    height = _USUAL_HEIGHT if rng.random() < 0.5 else float(rng.uniform(*_HEIGHTS))
    eye = surface.random_point(rng, island=0) + np.array([0.0, height, 0.0])
    aimed = _aim(scene, eye, rng) if rng.random() < _AIMED_SHARE else None
    heading, pitch = aimed or (float(rng.uniform(-np.pi, np.pi)), float(rng.choice((-0.35, -0.17, 0.0, 0.0, 0.12))))
    return camera_pose(eye, heading, pitch)


def _believed(T_world_camera: npt.NDArray[np.float64], rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """The pose with gravity off by a little, in one view of four."""
    if rng.random() > 0.25:
        return T_world_camera
    a, b = np.deg2rad(rng.uniform(-2.0, 2.0, 2))
    tilt = np.eye(4)
    tilt[:3, :3] = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]) @ np.array(
        [[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]]
    )
    out: npt.NDArray[np.float64] = T_world_camera @ tilt
    return out


def draw_sights(
    scene: Scene, camera: PinholeCamera, n: int, rng: np.random.Generator, noise: SensorNoise | None = None
) -> Iterator[Sight]:
    """n views of a scene; those with fewer than three things, or with the nose to a wall, are drawn again."""
    noise = noise or SensorNoise()
    surface = NavigableSurface.from_scene(scene)
    renderer = make_renderer("auto", scene, camera)
    try:
        made = 0
        for _ in range(_TRIES * n):
            if made == n:
                return
            T_world_camera = _pose(scene, surface, rng)
            frame = renderer.render(T_world_camera)
            if len(np.unique(frame.instance)) < _FEWEST_THINGS or np.median(frame.depth) < _CLOSEST_MEDIAN:
                continue
            made += 1
            rgb, depth = noise(frame.rgb, frame.depth, rng)
            yield Sight(Frame(rgb, depth, frame.instance), _believed(T_world_camera, rng))
    finally:
        renderer.close()
