"""What the body knows of the floor: free, occupied or unknown, on a grid that grows, from depth and poses alone.

The grid lies in the plane of the floor, in the frame of the poses (the episode frame): rows run along +z, columns along +x.
A point between ``min_height`` and ``max_height`` above the floor makes its cell occupied. A cell is free where the floor was
seen, or where a ray ran below ``low_height`` on its way to what it hit: a ray that passes higher says nothing about the floor
under it. Nothing is read from the scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera

UNKNOWN, FREE, OCCUPIED = 0, 1, 2

_PASS, _HIT = 1, 2
_LIMIT = 60_000

Cell = tuple[int, int]


@dataclass(frozen=True)
class OccupancySettings:
    """How depth becomes occupancy; metres above the floor unless said."""

    resolution: float = 0.05
    """Side of a cell, m."""
    min_depth: float = 0.1
    """Nearer depth is not trusted."""
    max_depth: float = 8.0
    """Farther depth is not trusted."""
    min_height: float = 0.1
    """Lower is floor."""
    max_height: float = 1.5
    """Higher passes over the body's head."""
    max_surface_height: float = 2.2
    """Surfaces above the body's head, up to here, still count as seen."""
    low_height: float = 0.3
    """Where a ray runs lower than this, the floor below it is free."""
    drop: float = 0.3
    """Deeper below the floor than this is a hole, not to be walked into."""
    body_radius: float = 0.2
    """Where the body stood is free in this radius, m."""
    hit_weight: int = 10
    """A cell is occupied while it was hit at least once for this many frames that saw its floor."""
    max_pixels: int = 20_000
    """Depth pictures are thinned to about this many pixels."""


class OccupancyMap:
    """A growing 2-D grid; see the module.

    Attributes
    ----------
    hits, passes : (H, W) uint16
        In how many frames something stood in the cell; in how many its floor was seen.
    top : (H, W) float32 m
        Height above the floor of the highest hit, 0 = none.
    seen_from : (H, W) float32 m
        The smallest distance in the plane from which a surface in the cell was seen, inf = never.
    stood : (H, W) bool
        The body was here.
    bumped : (H, W) bool
        The body's centre could not go here.
    looked : (H, W) uint8
        How often the cell was looked at on purpose; the explorer counts here.
    origin : (2,) float64 m
        (x, z) of the outer corner of cell (0, 0).
    version : int
        Grows with every change.
    """

    def __init__(self, settings: OccupancySettings | None = None) -> None:
        self.settings = settings or OccupancySettings()
        side = round(20.0 / self.settings.resolution)
        self.origin = np.full(2, -side / 2 * self.settings.resolution)
        self.hits = np.zeros((side, side), np.uint16)
        self.passes = np.zeros((side, side), np.uint16)
        self.top = np.zeros((side, side), np.float32)
        self.seen_from = np.full((side, side), np.inf, np.float32)
        self.stood = np.zeros((side, side), bool)
        self.bumped = np.zeros((side, side), bool)
        self.looked = np.zeros((side, side), np.uint8)
        self.version = 0

    @property
    def resolution(self) -> float:
        """Side of a cell, m."""
        return self.settings.resolution

    @property
    def grid(self) -> npt.NDArray[np.uint8]:
        """State of every cell, (H, W) uint8: UNKNOWN, FREE or OCCUPIED."""
        grid = np.zeros(self.hits.shape, np.uint8)
        grid[self.passes > 0] = FREE
        occupied = (self.hits > 0) & (self.hits.astype(np.int64) * self.settings.hit_weight >= self.passes)
        grid[occupied] = OCCUPIED
        grid[self.stood] = FREE
        return grid

    def cell(self, x: float, z: float) -> Cell:
        """The cell (row, column) that holds a place; it may lie outside the grid."""
        return (
            math.floor((z - self.origin[1]) / self.resolution),
            math.floor((x - self.origin[0]) / self.resolution),
        )

    def place(self, cell: Cell) -> tuple[float, float]:
        """(x, z) m of a cell's centre."""
        return (
            float(self.origin[0] + (cell[1] + 0.5) * self.resolution),
            float(self.origin[1] + (cell[0] + 0.5) * self.resolution),
        )

    def cells(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.int64]:
        """Cells (N, 2) of points (N, 3) m, without those that lie outside the grid."""
        cells = np.floor((points[:, [2, 0]] - self.origin[::-1]) / self.resolution).astype(np.int64)
        return np.asarray(cells[np.all((cells >= 0) & (cells < self.hits.shape), axis=1)])

    def integrate(
        self,
        depth: npt.NDArray[np.floating],
        T_episode_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
        floor: float,
    ) -> None:
        """Add one depth picture (H, W) m; ``floor`` is the height y of the floor under the body, m."""
        s = self.settings
        depth = np.asarray(depth, np.float32)
        if depth.shape != (camera.height, camera.width):
            raise ValueError(
                f"depth has shape {depth.shape}, expected that of the camera, {camera.height, camera.width}"
            )
        stride = max(1, math.ceil(math.sqrt(depth.size / s.max_pixels)))
        T = np.asarray(T_episode_camera, np.float64)
        self._make_room(T[0, 3], T[2, 3], s.max_depth * 2.0)
        mark = np.zeros(self.hits.shape, np.uint8)
        _mark_cells(
            depth, stride, camera.fx, camera.fy, camera.cx, camera.cy, T, floor, self.origin[0], self.origin[1],
            s.resolution, s.min_depth, s.max_depth, s.min_height, s.max_height, s.max_surface_height, s.low_height,
            -s.drop, mark, self.top, self.seen_from,
        )  # fmt: skip
        hit = (mark & _HIT) > 0
        self.hits[hit & (self.hits < _LIMIT)] += 1
        self.passes[(mark == _PASS) & (self.passes < _LIMIT)] += 1
        self.version += 1

    def stand(self, x: float, z: float) -> None:
        """The body stands here: the floor under it is free, whatever was thought before."""
        self._make_room(x, z, 1.0)
        disc = self._disc(x, z, self.settings.body_radius)
        self.stood[disc] = True
        self.bumped[self.cell(x, z)] = False
        self.version += 1

    def bump(self, x: float, z: float, radius: float = 0.08) -> None:
        """The body's centre could not go here."""
        self.bumped[self._disc(x, z, radius)] = True
        self.version += 1

    def _disc(self, x: float, z: float, radius: float) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Rows and columns of the cells whose centres lie within a radius, and of the cell itself."""
        row, column = self.cell(x, z)
        reach = math.ceil(radius / self.resolution)
        rows, columns = np.mgrid[row - reach : row + reach + 1, column - reach : column + reach + 1]
        centre_x = self.origin[0] + (columns + 0.5) * self.resolution
        centre_z = self.origin[1] + (rows + 0.5) * self.resolution
        inside = np.hypot(centre_x - x, centre_z - z) <= radius
        inside |= (rows == row) & (columns == column)
        inside &= (rows >= 0) & (rows < self.hits.shape[0]) & (columns >= 0) & (columns < self.hits.shape[1])
        return rows[inside], columns[inside]

    def _make_room(self, x: float, z: float, margin: float) -> None:
        """Grow the grid, where it must, so that it reaches ``margin`` m beyond a place on all sides."""
        row, column = self.cell(x, z)
        need = math.ceil(margin / self.resolution)
        block = round(5.0 / self.resolution)
        height, width = self.hits.shape
        pad = [
            (block if row - need < 0 else 0, block if row + need >= height else 0),
            (block if column - need < 0 else 0, block if column + need >= width else 0),
        ]
        if not any(map(any, pad)):
            return
        for name in ("hits", "passes", "top", "stood", "bumped", "looked"):
            setattr(self, name, np.pad(getattr(self, name), pad))
        self.seen_from = np.pad(self.seen_from, pad, constant_values=np.inf)
        self.origin = self.origin - np.array([pad[1][0], pad[0][0]]) * self.resolution
        self._make_room(x, z, margin)


@numba.njit(cache=True)
def _mark_cells(  # type: ignore[no-untyped-def]
    depth, stride, fx, fy, cx, cy, T, floor, origin_x, origin_z, resolution, min_depth, max_depth,
    min_height, max_height, max_surface_height, low_height, bottom, mark, top, seen_from,
):  # fmt: skip
    """Mark what each pixel says of the cells (``_PASS``, ``_HIT``), and keep the highest hit and the nearest view."""
    camera_height = T[1, 3] - floor
    for v in range(stride // 2, depth.shape[0], stride):
        for u in range(stride // 2, depth.shape[1], stride):
            d = depth[v, u]
            if not (d >= min_depth and d <= max_depth):
                continue
            a, b = (u - cx) / fx * d, -(v - cy) / fy * d
            dx = T[0, 0] * a + T[0, 1] * b - T[0, 2] * d
            dy = T[1, 0] * a + T[1, 1] * b - T[1, 2] * d
            dz = T[2, 0] * a + T[2, 1] * b - T[2, 2] * d
            row = math.floor((T[2, 3] + dz - origin_z) / resolution)
            column = math.floor((T[0, 3] + dx - origin_x) / resolution)
            if not (0 <= row < mark.shape[0] and 0 <= column < mark.shape[1]):
                continue
            height = camera_height + dy
            flat = math.sqrt(dx * dx + dz * dz)
            if bottom < height <= min_height:
                mark[row, column] |= _PASS
            elif height <= bottom or height < max_height:
                mark[row, column] |= _HIT
                top[row, column] = max(top[row, column], height)
            if min_height < height < max_surface_height:
                seen_from[row, column] = min(seen_from[row, column], flat)
            if bottom < height < low_height and camera_height > low_height:
                t = (camera_height - low_height) / (camera_height - height)
                step = resolution / max(flat, resolution)
                while t < 1.0:
                    r = math.floor((T[2, 3] + t * dz - origin_z) / resolution)
                    c = math.floor((T[0, 3] + t * dx - origin_x) / resolution)
                    if r != row or c != column:
                        mark[r, c] |= _PASS
                    t += step
