"""What depth says at each pixel, gravity-aligned: where the surface lies, which way it faces, how high it is above the floor.

Perception works on a picture of about 320 pixels' width, whatever the camera's: ``working_picture`` makes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera

WORKING_WIDTH = 320
_JUMP = 0.03  # relative step in depth from one pixel to the next that may end a surface
_BEND = 0.01  # it does not where the surface goes on as flat as it came: inverse depth is linear on a plane


@dataclass(frozen=True)
class Surface:
    """The working picture, h x w pixels, taken every ``step`` pixels of the camera's.

    Parameters
    ----------
    step : int
    depth : (h, w) float32 m, planar; 0 = nothing
    points : (h, w, 3) float32 m
        Relative to the camera's place, axes of the world (Y up).
    normals : (h, w, 3) float32
        Unit, towards the camera, world axes; zero where there is no depth.
    lab : (h, w, 3) float32
        CIE L*a*b*.
    floor : float
        Height m of the lowest thing seen, relative to the camera (a low percentile); 0 in a picture without depth.
    """

    step: int
    depth: npt.NDArray[np.float32]
    points: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    lab: npt.NDArray[np.float32]
    floor: float


@numba.njit(cache=True)
def _reading(depth: np.ndarray, v: int, u: int) -> float:
    """Inverse depth, or -1 outside the picture and where nothing was seen."""
    if v < 0 or u < 0 or v >= depth.shape[0] or u >= depth.shape[1] or depth[v, u] <= 0.0:
        return -1.0
    return float(1.0 / depth[v, u])


@numba.njit(cache=True)
def _side(depth: np.ndarray, v: int, u: int, dv: int, du: int, reach: int) -> int:
    """Steps (0..reach) one may go from (v, u) along (dv, du) without leaving the picture or the surface."""
    last, here = _reading(depth, v - dv, u - du), _reading(depth, v, u)
    for i in range(1, reach + 1):
        there = _reading(depth, v + i * dv, u + i * du)
        if there <= 0.0:
            return i - 1
        if abs(here - there) > _JUMP * there:
            beyond = _reading(depth, v + (i + 1) * dv, u + (i + 1) * du)
            as_before = last > 0.0 and abs(there - 2.0 * here + last) <= _BEND * here
            as_after = beyond > 0.0 and abs(here - 2.0 * there + beyond) <= _BEND * here
            if not (as_before or as_after):
                return i - 1
        last, here = here, there
    return reach


@numba.njit(cache=True)
def _normals(points: np.ndarray, depth: np.ndarray, reach: int) -> np.ndarray:
    """Unit normals (h, w, 3) towards the origin: cross product of the longest differences that stay on the surface."""
    h, w = depth.shape
    normals = np.zeros((h, w, 3), np.float32)
    for v in range(h):
        for u in range(w):
            if depth[v, u] <= 0.0:
                continue
            left, right = _side(depth, v, u, 0, -1, reach), _side(depth, v, u, 0, 1, reach)
            up, down = _side(depth, v, u, -1, 0, reach), _side(depth, v, u, 1, 0, reach)
            # Equal arms where both sides allow it: a lopsided difference leans at creases.
            if left > 0 and right > 0:
                left = right = min(left, right)
            if up > 0 and down > 0:
                up = down = min(up, down)
            p = points[v, u]
            if left + right == 0 or up + down == 0:
                normals[v, u] = -p / np.sqrt((p * p).sum())
                continue
            a = points[v, u + right] - points[v, u - left]
            b = points[v + down, u] - points[v - up, u]
            n0, n1, n2 = b[1] * a[2] - b[2] * a[1], b[2] * a[0] - b[0] * a[2], b[0] * a[1] - b[1] * a[0]
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            if length < 1e-12:
                normals[v, u] = -p / np.sqrt((p * p).sum())
                continue
            if n0 * p[0] + n1 * p[1] + n2 * p[2] > 0.0:
                length = -length
            normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = n0 / length, n1 / length, n2 / length
    return normals


def check_picture(rgb: npt.NDArray[np.uint8], depth: npt.NDArray[np.floating], camera: PinholeCamera) -> None:
    """ValueError where a picture does not fit its camera."""
    expected = (camera.height, camera.width)
    if rgb.shape != (*expected, 3) or rgb.dtype != np.uint8:
        raise ValueError(f"rgb is {rgb.shape} {rgb.dtype}, expected {(*expected, 3)} uint8 as the camera says")
    if depth.shape != expected:
        raise ValueError(f"depth is {depth.shape}, expected {expected} as the camera says (drop a trailing axis)")


def working_picture(
    rgb: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.floating],
    T_world_camera: npt.NDArray[np.floating],
    camera: PinholeCamera,
) -> Surface:
    """The gravity-aligned working picture of rgb (H, W, 3) uint8 and planar depth (H, W) m. Only the pose's rotation is used.

    Depth that is not finite counts as nothing seen.
    """
    check_picture(rgb, depth, camera)
    step = max(1, round(camera.width / WORKING_WIDTH))
    offset = step // 2
    kept = np.asarray(depth, np.float32)[offset::step, offset::step]
    kept = np.where(np.isfinite(kept) & (kept > 0), kept, 0).astype(np.float32)
    h, w = kept.shape
    rays = camera.rays()[offset::step, offset::step]
    rotation = np.asarray(T_world_camera, np.float64)[:3, :3].astype(np.float32)
    points = np.ascontiguousarray((kept[..., None] * rays) @ rotation.T, np.float32)
    small = cv2.blur(rgb, (step, step))[offset::step, offset::step] if step > 1 else rgb
    lab = cv2.cvtColor(np.ascontiguousarray(small[:h, :w]).astype(np.float32) / 255.0, cv2.COLOR_RGB2LAB)
    seen = kept > 0
    floor = float(np.percentile(points[..., 1][seen], 0.5)) if seen.any() else 0.0
    return Surface(step, kept, points, _normals(points, kept, 3), np.asarray(lab, np.float32), floor)


def to_full_size(labels: npt.NDArray[np.int32], step: int, height: int, width: int) -> npt.NDArray[np.int32]:
    """Labels (h, w) of the working picture, repeated to the camera's picture (height, width) int32."""
    rows = np.minimum(np.arange(height) // step, labels.shape[0] - 1)
    columns = np.minimum(np.arange(width) // step, labels.shape[1] - 1)
    return np.ascontiguousarray(labels[rows[:, None], columns[None, :]])
