"""What a walk has seen of the floor, from depth and camera poses alone: unknown, free or occupied, on a grid in the episode frame.

A point between ``low`` and ``high`` above the floor occupies its cell. One at most ``low`` above or below the floor frees its
cell, and so does a ray where it runs within ``low`` of the floor: higher up it passes over tables, and says nothing of the floor.
Once occupied, a cell stays so until it was free in ``FORGET`` frames more than it was occupied in. Rows run along +z, columns
along +x: ahead of the start is up.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
FORGET = 4
_MOST = 8
"""Frames that count, at most, for a cell's being occupied."""
_BLOCK = 5.0
"""The grid grows by so many metres at least."""


class Occupancy:
    """Integrates depth pictures into a grid that grows where it must.

    Parameters
    ----------
    camera : PinholeCamera
    resolution : float
        Side of a cell, m.
    low, high : float
        What lies between these heights above the floor bars the way, m.
    max_depth : float
        What is farther than this is left alone, m.
    pixels : int
        Pictures are thinned to at most about this many pixels.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        resolution: float = 0.1,
        low: float = 0.2,
        high: float = 1.5,
        max_depth: float = 8.0,
        pixels: int = 10_000,
    ) -> None:
        if not (resolution > 0.0 and high > low > 0.0 and max_depth > 0.0 and pixels > 0):
            raise ValueError(
                f"resolution is {resolution}, low {low}, high {high}, max_depth {max_depth} m, pixels {pixels}; "
                "expected a resolution, a depth and pixels above 0, and 0 < low < high"
            )
        self.camera, self.resolution = camera, resolution
        self.low, self.high, self.max_depth = low, high, max_depth
        self._stride = max(1, math.ceil(math.sqrt(camera.width * camera.height / pixels)))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        side = math.ceil(2.0 * _BLOCK / self.resolution)
        self._weight = np.zeros((side, side), np.int16)
        self._seen = np.zeros((side, side), np.bool_)
        self._first = np.array([-side // 2, -side // 2], np.int64)

    @property
    def grid(self) -> npt.NDArray[np.uint8]:
        """UNKNOWN, FREE or OCCUPIED, (H, W) uint8; cell (i, j) covers z from ``origin[1] + i * resolution`` on, x likewise."""
        return np.where(self._weight > 0, OCCUPIED, np.where(self._seen, FREE, UNKNOWN)).astype(np.uint8)

    @property
    def origin(self) -> tuple[float, float]:
        """x, z of the corner of cell (0, 0), m."""
        return float(self._first[1] * self.resolution), float(self._first[0] * self.resolution)

    def integrate(
        self, depth: npt.NDArray[np.floating], T_episode_camera: npt.NDArray[np.floating], floor: float
    ) -> None:
        """Add a depth picture (H, W) m, 0 = nothing seen; ``floor`` is the height y of the floor under the camera, m."""
        T = np.asarray(T_episode_camera, np.float64)
        self._make_room(T[0, 3], T[2, 3])
        mark = np.zeros(self._weight.shape, np.uint8)
        c = self.camera
        mark_cells(
            np.asarray(depth), self._stride, c.fx, c.fy, c.cx, c.cy, T, floor, self._first, self.resolution,
            self.low, self.high, self.max_depth, mark,
        )  # fmt: skip
        self._seen |= mark > 0
        occupied, free = mark == OCCUPIED, mark == FREE
        self._weight[occupied] = np.clip(self._weight[occupied] + FORGET, FORGET, _MOST)
        self._weight[free] -= self._weight[free] > 0

    def crop(self, T_episode_camera: npt.NDArray[np.floating], size: int, resolution: float) -> npt.NDArray[np.uint8]:
        """The surroundings of the camera, (size, size) uint8: it is in the middle and looks up; ``resolution`` m a pixel."""
        T = np.asarray(T_episode_camera, np.float64)
        # Looking straight up or down the forward axis has no heading, but the camera's x axis always has.
        right = T[[0, 2], 0] / max(float(np.hypot(T[0, 0], T[2, 0])), 1e-9)
        ahead = np.array([right[1], -right[0]])
        steps = (np.arange(size) - (size - 1) / 2) * resolution
        place = T[[0, 2], 3] + steps[None, :, None] * right - steps[:, None, None] * ahead
        column, row = (
            np.floor(place / self.resolution).astype(np.int64).transpose(2, 0, 1) - self._first[::-1, None, None]
        )
        inside = (row >= 0) & (row < self._seen.shape[0]) & (column >= 0) & (column < self._seen.shape[1])
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        state = np.where(self._weight[row, column] > 0, OCCUPIED, np.where(self._seen[row, column], FREE, UNKNOWN))
        return np.where(inside, state, UNKNOWN).astype(np.uint8)

    def _make_room(self, x: float, z: float) -> None:
        """Grow the grid, where it must, so that what the camera can see from (x, z) has a place in it."""
        cell = np.floor(np.array([z, x]) / self.resolution).astype(np.int64)
        # Depth is planar: what is seen at the edge of the picture is farther away than its depth.
        slant = math.hypot(1.0, max(self.camera.cx, self.camera.width - self.camera.cx) / self.camera.fx)
        slant = math.hypot(slant, max(self.camera.cy, self.camera.height - self.camera.cy) / self.camera.fy)
        reach = math.ceil(self.max_depth * slant / self.resolution) + 1
        block = math.ceil(_BLOCK / self.resolution)
        below = self._first - (cell - reach)
        above = cell + reach + 1 - (self._first + self._weight.shape)
        pad = [
            tuple(n + block if n > 0 else 0 for n in pair) for pair in zip(below.tolist(), above.tolist(), strict=True)
        ]
        if any(map(any, pad)):
            self._weight, self._seen = np.pad(self._weight, pad), np.pad(self._seen, pad)
            self._first = self._first - np.array([pad[0][0], pad[1][0]])


@nb.njit(cache=True)
def mark_cells(  # type: ignore[no-untyped-def]
    depth, stride, fx, fy, cx, cy, T, floor, first, resolution, low, high, max_depth, mark
):  # fmt: skip
    """Mark each cell (H, W) FREE or OCCUPIED that a picture says something of; OCCUPIED wins.

    The free part of a ray is walked in steps of half a cell, from where it comes near the floor up to the cell it ends in.
    """
    for v in range(stride // 2, depth.shape[0], stride):
        for u in range(stride // 2, depth.shape[1], stride):
            d = depth[v, u]
            if not 0.0 < d <= max_depth:
                continue
            a, b = (u - cx) / fx * d, -(v - cy) / fy * d
            dx = T[0, 0] * a + T[0, 1] * b - T[0, 2] * d
            dy = T[1, 0] * a + T[1, 1] * b - T[1, 2] * d
            dz = T[2, 0] * a + T[2, 1] * b - T[2, 2] * d
            row = math.floor((T[2, 3] + dz) / resolution) - first[0]
            column = math.floor((T[0, 3] + dx) / resolution) - first[1]
            start, end = T[1, 3] - floor, T[1, 3] + dy - floor
            if low < end <= high:
                mark[row, column] = OCCUPIED
            if abs(end) > low:
                continue
            if mark[row, column] == UNKNOWN:
                mark[row, column] = FREE
            t = (start - low) / (start - end) if start > low else 0.0
            step = 0.5 * resolution / max(math.sqrt(dx * dx + dz * dz), 0.5 * resolution)
            while t < 1.0:
                r = math.floor((T[2, 3] + t * dz) / resolution) - first[0]
                c = math.floor((T[0, 3] + t * dx) / resolution) - first[1]
                if (r != row or c != column) and mark[r, c] == UNKNOWN:
                    mark[r, c] = FREE
                t += step
