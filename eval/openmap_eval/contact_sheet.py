"""A scene on one sheet: views from inside, and its plan with names."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import make_renderer
from openmap_env.simulator import Simulator
from openmap_eval.pictures import Picture, draw_names
from openmap_scenes import PinholeCamera, Scene

VIEWS, COLUMNS = 6, 3
TRIED = 300
VIEW = (480, 360)
CUT = 1.9
"""The plan shows what lies below this height above the lowest point, m."""
ALTITUDE = 60.0
"""The plan's camera hangs so high, m, that its picture is as good as a parallel projection."""
STRUCTURE = ("wall", "floor", "ceiling", "window", "door", "unlabelled")


def contact_sheet(scene: Scene, seed: int = 0) -> Picture:
    """Six views from places where a body can stand, chosen for how much they show, and the plan under them."""
    simulator = Simulator(scene, PinholeCamera.from_hfov(*VIEW, 90.0))
    try:
        poses = telling_poses(scene, simulator.surface, VIEWS, np.random.default_rng(seed))
        views = []
        for position, heading in poses:
            simulator.reset(position, heading, math.radians(-8.0))
            frame = simulator.observe()
            view, name = frame.rgb.copy(), _room_in_view(scene, frame.instance)
            if name:
                draw_names(view, [(8 + 4 * len(name), VIEW[1] - 12, name)])
            views.append(view)
    finally:
        simulator.close()
    rows = [np.hstack(views[i : i + COLUMNS]) for i in range(0, VIEWS, COLUMNS)]
    return np.vstack([*rows, plan_picture(scene, COLUMNS * VIEW[0])])


def _room_in_view(scene: Scene, instance: npt.NDArray[np.int32]) -> str:
    """The name of the room whose things fill most of a picture of instance ids (H, W), or ""."""
    room_of = {i.id: i.room for i in scene.instances if i.room is not None}
    pixels: Counter[int] = Counter()
    for i, n in zip(*np.unique(instance, return_counts=True), strict=True):
        if int(i) in room_of:
            pixels[room_of[int(i)]] += int(n)
    names = {room.id: room.name for room in scene.rooms}
    return names.get(pixels.most_common(1)[0][0], "") if pixels else ""


@dataclass(frozen=True)
class _Candidate:
    """A pose, the room that it shows ("": none), what each thing in its view is worth (0..1), and how open the view is (0..1)."""

    position: npt.NDArray[np.float64]
    heading: float
    room: str
    worth: dict[int, float]
    openness: float


def _gain(candidate: _Candidate, known: dict[int, float], rooms: dict[str, int]) -> float:
    """What a view adds to those chosen already."""
    new = sum(max(0.0, w - known.get(i, 0.0)) for i, w in candidate.worth.items() if i)
    return float(candidate.openness * (0.5 + new) * 0.4 ** rooms.get(candidate.room, 0))


def telling_poses(
    scene: Scene, surface: NavigableSurface, count: int, rng: np.random.Generator
) -> list[tuple[npt.NDArray[np.float64], float]]:
    """Places (3,) m and headings (radians) that show many things from a good distance, in as many rooms as there are.

    Random poses are rendered small; a thing counts once over all chosen views, and a room that was shown counts for less.
    """
    camera = PinholeCamera.from_hfov(120, 90, 90.0)
    look = Simulator(scene, camera, surface=surface)
    seen: list[_Candidate] = []
    try:
        for _ in range(TRIED):
            position, heading = surface.random_point(rng), float(rng.uniform(-math.pi, math.pi))
            look.reset(position, heading, math.radians(-8.0))
            frame = look.observe()
            ids, pixels = np.unique(frame.instance, return_counts=True)
            # A thing is worth the more the larger it is, up to 2 % of the picture.
            worth = {
                int(i): min(1.0, n / (0.02 * camera.width * camera.height)) for i, n in zip(ids, pixels, strict=True)
            }
            depth = frame.depth[frame.depth > 0]
            open_view = min(1.0, float(np.median(depth)) / 2.0) if len(depth) else 0.0
            seen.append(_Candidate(position, heading, _room_in_view(scene, frame.instance), worth, open_view))
    finally:
        look.close()
    chosen: list[tuple[npt.NDArray[np.float64], float]] = []
    known: dict[int, float] = {}
    rooms: dict[str, int] = {}
    for _ in range(count):
        gains = [_gain(candidate, known, rooms) for candidate in seen]
        best = seen[int(np.argmax(gains))]
        chosen.append((best.position, best.heading))
        rooms[best.room] = rooms.get(best.room, 0) + 1
        for i, w in best.worth.items():
            known[i] = max(known.get(i, 0.0), w)
    return chosen


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
