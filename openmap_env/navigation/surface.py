"""The navigable surface of a home: where a body can stand, how far it is from here to there, and what happens when it walks.

Made from plain triangles alone; what a face belongs to is never asked. All positions are world frame, m, on the floor that
the body stands on. Islands are numbered from the one that matters most: 0 is the largest floor (see ``cells.label_islands``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.kept import Arrays, kept
from openmap_env.navigation import cells as cells_module
from openmap_env.navigation import gaps, heightfield
from openmap_env.navigation.cells import Body, Cells, label_islands, standing_cells
from openmap_env.navigation.field import SNAP_DISTANCE, DistanceField, xyz
from openmap_env.navigation.gaps import close_gaps
from openmap_env.navigation.geodesic import cell_centres
from openmap_env.navigation.heightfield import Grid, solid_spans
from openmap_env.navigation.motion import locate, nearest, step
from openmap_scenes import Scene

__all__ = ["CELL", "SNAP_DISTANCE", "DistanceField", "NavigableSurface", "TopDownMap"]

Point = npt.NDArray[np.float64]
Islands = tuple[npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]
CELL = 0.05
KEPT_FROM = 5_000
"""Meshes with fewer faces than this have their surface sooner than it is found and opened."""


@dataclass(frozen=True)
class TopDownMap:
    """A picture of an island from above.

    Parameters
    ----------
    navigable : (H, W) bool
        Row i, column j covers x from ``origin[0] + j * resolution`` and z from ``origin[1] + i * resolution`` on; -Z is up.
    origin : (2,) m
        World x, z of the corner of pixel (0, 0).
    resolution : float
        Metres a pixel.
    """

    navigable: npt.NDArray[np.bool_]
    origin: tuple[float, float]
    resolution: float

    def pixel(self, position: npt.ArrayLike) -> Point:
        """(row, column) (..., 2), pixel centres at integers, of world positions (..., 3) m."""
        p = np.asarray(position, np.float64)
        return np.asarray((p[..., [2, 0]] - np.array(self.origin)[[1, 0]]) / self.resolution - 0.5, np.float64)


class NavigableSurface:
    """Cells on which a body can stand; make one with ``from_scene``."""

    def __init__(self, cells: Cells, grid: Grid, body: Body, islands: Islands | None = None) -> None:
        self.cells, self.grid, self.body = cells, grid, body
        self.island, sizes, grounded = islands or label_islands(cells)
        self.island_areas: Point = np.asarray(sizes * grid.cell**2, np.float64)
        """Area (K,) m2 of each island."""
        self.grounded_areas: Point = np.asarray(grounded * grid.cell**2, np.float64)
        """Area (K,) m2 of each island that is no roof: with something above it or nothing below."""
        self.ground = cells.ground(grid)
        """What compiled code is told of the surface; see ``Cells.ground``."""
        self.reach = body.step_height + 0.05
        """A position is on a cell if it is over or under it by at most this, m."""

    @cached_property
    def centres(self) -> Point:
        """The middle (N, 3) m of each cell, on the floor."""
        return cell_centres(self.cells, self.grid)

    @classmethod
    def from_scene(
        cls,
        scene: Scene | tuple[npt.ArrayLike, npt.ArrayLike],
        body: Body | None = None,
        cell: float = CELL,
        *,
        keep: bool = True,
    ) -> NavigableSurface:
        """The surface of a scene, or of (vertices (V, 3) m, faces (F, 3)), for a body, on a grid of ``cell`` m.

        With ``keep`` it is kept on disk for other processes (see ``openmap_env.kept``), and opened where it was kept before.

        Raises
        ------
        ValueError
            The arrays are no mesh, the mesh is too large for the grid, or there is nowhere to stand.
        """
        body = body or Body()
        vertices, faces = map(np.asarray, (scene.vertices, scene.faces) if isinstance(scene, Scene) else scene)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise ValueError(
                f"mesh has vertices {vertices.shape} and faces {faces.shape}, expected (V, 3) and (F, 3), F > 0"
            )
        if not 0.0 < cell < np.inf:
            raise ValueError(f"cell is {cell} m, expected more than 0")
        if keep and len(faces) >= KEPT_FROM:
            made = kept(
                "navigable",
                (vertices, faces, repr(body), repr(float(cell))),
                (heightfield, gaps, cells_module),
                lambda: _make(vertices, faces, body, cell),
            )
        else:
            made = _make(vertices, faces, body, cell)
        origin_x, origin_z, size, nx, nz = made["grid"].tolist()
        islands = (np.asarray(made["island"]), made["sizes"], made["grounded_sizes"])
        cells = Cells(*(made[name] for name in Cells.__dataclass_fields__))
        return cls(cells, Grid(origin_x, origin_z, size, int(nx), int(nz)), body, islands)

    def locate(self, position: npt.ArrayLike) -> int:
        """The cell that a position (3,) m is on, -1 for none: over or under it by at most a step (and a little)."""
        x, y, z = np.asarray(position, np.float64).tolist()
        return int(locate(self.ground, x, y, z, self.reach))

    def is_navigable(self, position: npt.ArrayLike) -> bool:
        """Whether a body can stand at a position (3,) m."""
        return self.locate(position) >= 0

    def island_of(self, position: npt.ArrayLike) -> int:
        """The island that a position (3,) m is on, -1 for none."""
        cell = self.locate(position)
        return int(self.island[cell]) if cell >= 0 else -1

    def snap(
        self, position: npt.ArrayLike, max_distance: float = SNAP_DISTANCE, island: int | None = None
    ) -> Point | None:
        """The nearest place to stand (3,) m, on the given island if any, or None beyond ``max_distance`` m.

        A position over or under a cell keeps its x and z.
        """
        x, y, z = xyz(position)
        wanted = -1 if island is None else self._known(island)
        x, z, cell = nearest(self.ground, self.island, wanted, x, y, z, self.reach, float(max_distance))
        return np.array([x, self.cells.floor[cell], z]) if cell >= 0 else None

    def random_point(self, rng: np.random.Generator, island: int | None = None) -> Point:
        """A place (3,) m drawn evenly from an island, by default the main one (0)."""
        members = np.flatnonzero(self.island == self._known(island or 0))
        point = self.centres[members[rng.integers(len(members))]].copy()
        point[[0, 2]] += rng.uniform(-0.499, 0.499, 2) * self.grid.cell
        return np.asarray(point)

    def distance_field(
        self, goals: npt.ArrayLike, max_snap: float = SNAP_DISTANCE, island: int | None = None
    ) -> DistanceField:
        """Distances to the nearest of the goals (3,) or (G, 3) m; goals are snapped, those that cannot be are left out.

        Raises
        ------
        ValueError
            No goal is within ``max_snap`` m of the surface.
        """
        snapped = [self.snap(g, max_snap, island) for g in np.atleast_2d(np.asarray(goals, np.float64))]
        found = [g for g in snapped if g is not None]
        if not found:
            raise ValueError(
                f"none of {len(snapped)} goals is within {max_snap} m of the surface; snap them first, or allow more"
            )
        return DistanceField(self, np.array(found))

    def geodesic_distance(self, a: npt.ArrayLike, b: npt.ArrayLike) -> float:
        """Length m of the shortest way from a (3,) m to b, (3,) or the nearest of (G, 3) m; inf where there is none.

        Both ends are snapped first, and are out of reach where that fails. For many distances to one goal keep a
        ``distance_field``.
        """
        path = self._search(a, b)
        return path[0] if path else float("inf")

    def shortest_path(self, a: npt.ArrayLike, b: npt.ArrayLike) -> Point | None:
        """Corners (n, 3) m of the shortest way from a (3,) m to b, (3,) or the nearest of (G, 3) m; None where there is none."""
        path = self._search(a, b)
        return path[1] if path else None

    def _search(self, a: npt.ArrayLike, b: npt.ArrayLike) -> tuple[float, Point] | None:
        start = self.snap(a)
        goals = [g for g in map(self.snap, np.atleast_2d(np.asarray(b, np.float64))) if g is not None]
        if start is None or not goals:
            return None
        cell = self.locate(start)
        goals = [g for g in goals if self.island[self.locate(g)] == self.island[cell]]
        if not goals:
            return None
        field = DistanceField(self, np.array(goals), until=cell)
        return field.distance(start), field.path(start)

    def try_step(self, position: npt.ArrayLike, displacement: npt.ArrayLike) -> Point:
        """Where a body at a position (3,) m on the surface ends that wants to move by (3,) m; only x and z of it count.

        It slides along what bars its way, climbs steps, stays on the surface and goes through nothing.

        Raises
        ------
        ValueError
            The position is not on the surface.
        """
        x, y, z = np.asarray(position, np.float64).tolist()
        dx, dy, dz = np.asarray(displacement, np.float64).tolist()
        if not math.isfinite(dx + dy + dz):
            raise ValueError(f"displacement is {displacement!r}, expected finite numbers")
        x, y, z, cell = step(self.ground, self.reach, x, y, z, dx, dz)
        if cell < 0:
            raise ValueError(f"position {[x, y, z]} is not on the navigable surface; snap it first")
        return np.array([x, y, z])

    def points_near_box(
        self, aabb_min: npt.ArrayLike, aabb_max: npt.ArrayLike, distance: float, island: int | None = 0
    ) -> Point:
        """Places (n, 3) m of an island (None: of all) within a horizontal ``distance`` m of a box whose height span they share.

        A place counts if the body's height there overlaps the box, so that a lamp on the ceiling has places below it only
        where it hangs low, and nothing upstairs is near what stands downstairs.
        """
        low, high = np.asarray(aabb_min, np.float64), np.asarray(aabb_max, np.float64)
        outside = np.maximum(np.maximum(low - self.centres, self.centres - high), 0.0)
        near = np.hypot(outside[:, 0], outside[:, 2]) <= distance
        near &= (self.centres[:, 1] <= high[1]) & (self.centres[:, 1] + self.body.height >= low[1])
        if island is not None:
            near &= self.island == island
        return self.centres[near]

    def top_down_map(self, island: int | None = 0) -> TopDownMap:
        """The cells of an island (None: of all) from above."""
        navigable = np.zeros((self.grid.nz, self.grid.nx), bool)
        members = slice(None) if island is None else np.flatnonzero(self.island == island)
        navigable[self.cells.iz[members], self.cells.ix[members]] = True
        return TopDownMap(navigable, (self.grid.origin_x, self.grid.origin_z), self.grid.cell)

    def _known(self, island: int) -> int:
        if not 0 <= island < len(self.island_areas):
            raise ValueError(f"there is no island {island}, expected one of 0..{len(self.island_areas) - 1}")
        return int(island)


def _make(vertices: npt.NDArray[Any], faces: npt.NDArray[Any], body: Body, cell: float) -> Arrays:
    """The grid, the fields of ``Cells`` and what ``label_islands`` gives, as arrays by name."""
    v, f = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if f.min() < 0 or f.max() >= len(v) or not np.isfinite(v).all():
        raise ValueError("mesh has faces without a vertex, or vertices that are not finite")
    grid = Grid.over(v, cell)
    spans = close_gaps(solid_spans(v, f, grid, body.step_height), grid, body)
    cells = standing_cells(spans, grid, body)
    if len(cells.floor) == 0:
        raise ValueError(
            f"a body of radius {body.radius} m and height {body.height} m can stand nowhere on this mesh of extent "
            f"{np.ptp(v, axis=0).round(2).tolist()} m; expected a floor. Check that the mesh is Y up and in metres"
        )
    island, sizes, grounded = label_islands(cells)
    frame = np.array([grid.origin_x, grid.origin_z, grid.cell, grid.nx, grid.nz])
    return {**vars(cells), "grid": frame, "island": island, "sizes": sizes, "grounded_sizes": grounded}
