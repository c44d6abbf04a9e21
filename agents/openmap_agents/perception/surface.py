"""What depth says at each pixel, gravity-aligned: where the surface lies, which way it faces, how high it is above the floor.

Perception works on a picture of about 320 pixels' width, whatever the camera's: ``working_picture`` makes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numba
import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera

WORKING_WIDTH = 320
_JUMP = 0.03  # relative step in depth from one pixel to the next that may end a surface
_BEND = 0.01  # it does not where the surface goes on as flat as it came: inverse depth is linear on a plane
_REACH = 3  # pixels to each side that a normal is taken over
_NEAREST = 1e-4  # m; nothing is that near, and squares of smaller numbers vanish
_FARTHEST = 1e4  # m; sensors have been seen to say "nothing" by a very large number
_LOW_SHARE = 0.005


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


@numba.njit(cache=True, error_model="numpy")
def _goes_on(last: float, here: float, there: float, beyond: float) -> bool:
    """Whether a surface goes on from ``here`` to ``there``: inverse depths of four pixels in a row, negative = nothing seen."""
    if there <= 0.0:
        return False
    if abs(here - there) <= _JUMP * there:
        return True
    as_before = last > 0.0 and abs(there - 2.0 * here + last) <= _BEND * here
    return as_before or (beyond > 0.0 and abs(here - 2.0 * there + beyond) <= _BEND * here)


@numba.njit(cache=True, error_model="numpy")
def _arms(depth: np.ndarray, reach: int) -> np.ndarray:
    """Steps (h, w, 4) uint8, 0..reach, one may go left, right, up and down without leaving the picture or the surface."""
    h, w = depth.shape
    inverse = np.full((h + 4, w + 4), -1.0)  # a border of two pixels where nothing was seen
    for v in range(h):
        for u in range(w):
            if depth[v, u] > 0.0:
                inverse[v + 2, u + 2] = 1.0 / depth[v, u]
    arms = np.zeros((h, w, 4), np.uint8)
    for v in range(h):
        row = inverse[v + 2]
        run = 0
        for u in range(w):
            on = row[u + 2] > 0.0 and _goes_on(row[u + 3], row[u + 2], row[u + 1], row[u])
            run = min(run + 1, reach) if on else 0
            arms[v, u, 0] = run
        run = 0
        for u in range(w - 1, -1, -1):
            on = row[u + 2] > 0.0 and _goes_on(row[u + 1], row[u + 2], row[u + 3], row[u + 4])
            run = min(run + 1, reach) if on else 0
            arms[v, u, 1] = run
        for u in range(2, w + 2):
            if row[u] > 0.0 and _goes_on(inverse[v + 3, u], row[u], inverse[v + 1, u], inverse[v, u]):
                arms[v, u - 2, 2] = min(arms[v - 1, u - 2, 2] + 1, reach)
    for v in range(h - 1, -1, -1):
        row = inverse[v + 2]
        for u in range(2, w + 2):
            if row[u] > 0.0 and _goes_on(inverse[v + 1, u], row[u], inverse[v + 3, u], inverse[v + 4, u]):
                arms[v, u - 2, 3] = min(arms[v + 1, u - 2, 3] + 1, reach)
    return arms


@numba.njit(cache=True, error_model="numpy")
def _normals(points: np.ndarray, depth: np.ndarray, reach: int) -> np.ndarray:
    """Unit normals (h, w, 3) towards the origin: cross product of the longest differences that stay on the surface."""
    h, w = depth.shape
    arms = _arms(depth, reach)
    normals = np.zeros((h, w, 3), np.float32)
    for v in range(h):
        for u in range(w):
            if depth[v, u] <= 0.0:
                continue
            left, right, up, down = arms[v, u, 0], arms[v, u, 1], arms[v, u, 2], arms[v, u, 3]
            # Equal arms where both sides allow it: a lopsided difference leans at creases.
            if left > 0 and right > 0:
                left = right = min(left, right)
            if up > 0 and down > 0:
                up = down = min(up, down)
            a0 = points[v, u + right, 0] - points[v, u - left, 0]
            a1 = points[v, u + right, 1] - points[v, u - left, 1]
            a2 = points[v, u + right, 2] - points[v, u - left, 2]
            b0 = points[v + down, u, 0] - points[v - up, u, 0]
            b1 = points[v + down, u, 1] - points[v - up, u, 1]
            b2 = points[v + down, u, 2] - points[v - up, u, 2]
            n0, n1, n2 = b1 * a2 - b2 * a1, b2 * a0 - b0 * a2, b0 * a1 - b1 * a0
            length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
            p0, p1, p2 = points[v, u, 0], points[v, u, 1], points[v, u, 2]
            if length < 1e-12:  # no arm along one of the lines, or both along one
                n0, n1, n2 = -p0, -p1, -p2
                length = np.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
            elif n0 * p0 + n1 * p1 + n2 * p2 > 0.0:
                length = -length
            normals[v, u, 0], normals[v, u, 1], normals[v, u, 2] = n0 / length, n1 / length, n2 / length
    return normals


@numba.njit(cache=True)
def _clean_and_unproject(depth: np.ndarray, rays: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Points (h, w, 3) of depth along rays; readings that are none become 0 in place. All float32."""
    h, w = depth.shape
    points = np.empty((h, w, 3), np.float32)
    for v in range(h):
        for u in range(w):
            d = depth[v, u]
            if not (_NEAREST < d < _FARTHEST):
                d = np.float32(0.0)
                depth[v, u] = d
            x, y, z = d * rays[v, u, 0], d * rays[v, u, 1], d * rays[v, u, 2]
            for c in range(3):
                points[v, u, c] = rotation[c, 0] * x + rotation[c, 1] * y + rotation[c, 2] * z
    return points


@lru_cache(maxsize=4)
def _rays(camera: PinholeCamera, step: int) -> npt.NDArray[np.float32]:
    """The camera's rays (h, w, 3) through the pixels of the working picture."""
    return np.ascontiguousarray(camera.rays()[step // 2 :: step, step // 2 :: step])


def _low(heights: npt.NDArray[np.float32]) -> float:
    """The height (m) that half a percent of ``heights`` (n,) lie below, interpolated linearly; 0 of none."""
    if len(heights) == 0:
        return 0.0
    place = (len(heights) - 1) * _LOW_SHARE
    k = int(place)
    low = np.partition(heights, sorted({k, min(k + 1, len(heights) - 1)}))[k : k + 2]
    return float(low[0] + (low[-1] - low[0]) * (place - k))


def check_picture(rgb: npt.NDArray[np.uint8], depth: npt.NDArray[np.floating], camera: PinholeCamera) -> None:
    """ValueError where a picture does not fit its camera."""
    expected = (camera.height, camera.width)
    if rgb.shape != (*expected, 3) or rgb.dtype != np.uint8:
        raise ValueError(f"rgb is {rgb.shape} {rgb.dtype}, expected {(*expected, 3)} uint8 as the camera says")
    if depth.shape != expected:
        raise ValueError(f"depth is {depth.shape}, expected {expected} as the camera says (drop a trailing axis)")
    if not np.issubdtype(depth.dtype, np.floating):
        raise ValueError(f"depth is {depth.dtype}, expected metres as floats (divide millimetres by 1000)")


def working_step(width: int) -> int:
    """Every how many pixels of a picture that wide one is taken for the working picture."""
    return max(1, round(width / WORKING_WIDTH))


def working_lab(rgb: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.float32], int]:
    """CIE L*a*b* (h, w, 3) float32 of the working picture of rgb (H, W, 3) uint8, and its step."""
    step = working_step(rgb.shape[1])
    offset = step // 2
    small = cv2.blur(rgb, (step, step))[offset::step, offset::step] if step > 1 else rgb
    lab = cv2.cvtColor(np.divide(small, np.float32(255.0), order="C"), cv2.COLOR_RGB2LAB)
    return np.asarray(lab, np.float32), step


def working_picture(
    rgb: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.floating],
    T_world_camera: npt.NDArray[np.floating],
    camera: PinholeCamera,
) -> Surface:
    """The gravity-aligned working picture of rgb (H, W, 3) uint8 and planar depth (H, W) m. Only the pose's rotation is used.

    Depth that is not finite, 0.1 mm and less or 10 km and more counts as nothing seen.

    Raises
    ------
    ValueError
        The picture does not fit the camera, or the pose's rotation is none, as of a frame that a tracker lost.
    """
    check_picture(rgb, depth, camera)
    step = working_step(camera.width)
    offset = step // 2
    kept = np.array(depth[offset::step, offset::step], np.float32)
    rotation = np.asarray(T_world_camera, np.float64)[:3, :3].astype(np.float32)
    if not np.isfinite(rotation).all() or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-2):
        raise ValueError(f"T_world_camera has the rotation {rotation.tolist()}, expected an orthonormal one")
    points = _clean_and_unproject(kept, _rays(camera, step), np.ascontiguousarray(rotation))
    lab, _ = working_lab(rgb)
    floor = _low(points[..., 1][kept > 0])
    return Surface(step, kept, points, _normals(points, kept, _REACH), lab, floor)


def to_full_size(labels: npt.NDArray[np.int32], step: int, height: int, width: int) -> npt.NDArray[np.int32]:
    """Labels (h, w) of the working picture, repeated to the camera's picture (height, width) int32."""
    rows = np.minimum(np.arange(height) // step, labels.shape[0] - 1)
    columns = np.minimum(np.arange(width) // step, labels.shape[1] - 1)
    return np.ascontiguousarray(labels[rows[:, None], columns[None, :]])
