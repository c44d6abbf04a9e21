"""A small recording of cards before a wall, with what stands where, for whatever maps recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.stored_frames import write_frame
from openmap_scenes import PinholeCamera
from openmap_scenes.recordings import Frame, RecordingWriter

CAMERA = PinholeCamera(96, 72, 60.0, 60.0, 47.5, 35.5)
NAMES = ["wall", "floor", "sofa", "refrigerator", "table", "television"]
COLOURS = np.array([(225, 220, 210), (150, 110, 80), (40, 60, 190), (240, 240, 245), (120, 80, 40), (15, 15, 20)])
# Upright cards: x from, x to, y from, y to, z.
CARDS = [
    (-2.6, -0.8, 0.0, 0.9, -3.4),
    (0.2, 0.9, 0.0, 1.8, -3.5),
    (1.5, 2.7, 0.0, 0.8, -3.2),
    (-0.4, 0.05, 1.1, 1.5, -3.9),
]


def frame(index: int, x: float, camera: PinholeCamera = CAMERA) -> tuple[Frame, npt.NDArray[np.int32]]:
    """What a camera sees 1.2 m above the floor at (x, 0), looking along -z; and ids 1.. into ``NAMES``."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    right, up = (u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy
    depth = np.full(u.shape, 4.0)
    ids = np.ones(u.shape, np.int32)
    to_floor = np.where(up < 0, -1.2 / np.minimum(up, -1e-9), np.inf)
    ids[to_floor < depth] = 2
    depth = np.minimum(depth, to_floor)
    for n, (x0, x1, y0, y1, z) in enumerate(CARDS, start=3):
        at_x, at_y = x - right * z, 1.2 - up * z
        hit = (at_x >= x0) & (at_x <= x1) & (at_y >= y0) & (at_y <= y1) & (-z < depth)
        depth[hit], ids[hit] = -z, n
    shade = (0.75 + 0.25 * np.cos(7.0 * (x + right * depth)))[..., None]
    rgb = np.rint(COLOURS[ids - 1] * shade).astype(np.uint8)
    T_world_camera = np.eye(4)
    T_world_camera[:3, 3] = x, 1.2, 0.0
    return Frame(index, rgb, depth.astype(np.float32), T_world_camera), ids


def write_walk(folder: Path, n: int = 12, blind: tuple[int, ...] = (), lost: tuple[int, ...] = ()) -> Path:
    """A recording of n frames along x; those in ``blind`` have no depth, those in ``lost`` no pose."""
    with RecordingWriter(folder, CAMERA, exact=True) as writer:
        for i, x in enumerate(np.linspace(-1.0, 1.0, n)):
            seen, _ = frame(i, float(x))
            depth = np.zeros_like(seen.depth) if i in blind else seen.depth
            writer.append(seen.rgb, depth, None if i in lost else seen.T_world_camera)
    return folder


def write_truth(folder: Path, n: int = 12) -> Path:
    """The true masks and names of such a recording's frames, found by picture."""
    for i, x in enumerate(np.linspace(-1.0, 1.0, n)):
        seen, ids = frame(i, float(x))
        write_frame(folder, seen.rgb, ids, names=NAMES)
    return folder
