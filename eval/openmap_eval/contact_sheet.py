"""A scene on one sheet: views from inside, and its plan with names."""

from __future__ import annotations

import math

import cv2
import numpy as np

from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import make_renderer
from openmap_env.simulator import Simulator
from openmap_eval.pictures import Picture, draw_names
from openmap_scenes import PinholeCamera, Scene

VIEWS, COLUMNS = 6, 3
VIEW = (480, 360)
CUT = 1.9
"""The plan shows what lies below this height above the lowest point, m."""
ALTITUDE = 60.0
"""The plan's camera hangs so high, m, that its picture is as good as a parallel projection."""
STRUCTURE = ("wall", "floor", "ceiling", "window", "door", "unlabelled")


def contact_sheet(scene: Scene, seed: int = 0) -> Picture:
    """Six views from random places where a body can stand, and the plan under them."""
    rng = np.random.default_rng(seed)
    surface = NavigableSurface.from_scene(scene)
    simulator = Simulator(scene, PinholeCamera.from_hfov(*VIEW, 90.0), surface=surface)
    views = []
    for _ in range(VIEWS):
        simulator.reset(surface.random_point(rng), float(rng.uniform(-math.pi, math.pi)))
        views.append(simulator.observe().rgb)
    simulator.close()
    rows = [np.hstack(views[i : i + COLUMNS]) for i in range(0, VIEWS, COLUMNS)]
    return np.vstack([*rows, plan_picture(scene, COLUMNS * VIEW[0])])


def plan_picture(scene: Scene, width: int) -> Picture:
    """The scene from above without its ceiling, (h, width, 3), x to the right and z down, with the names of things."""
    low, high = scene.aabb
    extent, middle = high - low, (low + high) / 2
    pixels_a_metre = width / (extent[0] + 0.5)
    height = int(pixels_a_metre * (extent[2] + 0.5)) // 2 * 2
    focal = pixels_a_metre * (ALTITUDE - CUT)
    camera = PinholeCamera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    T_world_camera[:3, 3] = (middle[0], low[1] + ALTITUDE, middle[2])
    renderer = make_renderer("opengl", scene, camera, near=ALTITUDE - CUT, far=ALTITUDE + 5.0)
    picture = renderer.render(T_world_camera).rgb
    renderer.close()
    named = sorted(
        (i for i in scene.instances if i.category not in STRUCTURE and i.aabb_min[1] < low[1] + CUT),
        key=lambda i: -float(np.prod(i.aabb_max - i.aabb_min)),
    )
    pixels, _ = camera.project(np.array([i.centre for i in named]).reshape(-1, 3), T_world_camera)
    draw_names(picture, [(int(u), int(v), i.category) for (u, v), i in zip(pixels, named, strict=True)])
    return np.asarray(cv2.copyMakeBorder(picture, 6, 0, 0, 0, cv2.BORDER_CONSTANT), np.uint8)
