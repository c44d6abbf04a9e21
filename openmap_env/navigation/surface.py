"""The navigable surface of a home: where a body can stand, how far it is from here to there, and what happens when it walks.

Made from plain triangles alone; what a face belongs to is never asked. All positions are world frame, m, on the floor that
the body stands on. Islands are numbered from the one that matters most: 0 is the largest floor (see ``cells.label_islands``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_env.navigation.cells import Body, Cells, label_islands, standing_cells
from openmap_env.navigation.geodesic import NO_ANCHOR, cell_centres, distance_to, sees
from openmap_env.navigation.heightfield import Grid, solid_spans
from openmap_env.navigation.motion import locate, slide
from openmap_scenes import Scene

Point = npt.NDArray[np.float64]
CELL = 0.05
SNAP_DISTANCE = 0.5


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

    def __init__(self, cells: Cells, grid: Grid, body: Body) -> None:
        self.cells, self.grid, self.body = cells, grid, body
        self.centres = cell_centres(cells, grid)
        self.island, sizes, grounded = label_islands(cells)
        self.island_areas: Point = np.asarray(sizes * grid.cell**2, np.float64)
        """Area (K,) m2 of each island."""
        self.grounded_areas: Point = np.asarray(grounded * grid.cell**2, np.float64)
        """Area (K,) m2 of each island that is no roof: with something above it or nothing below."""
        self._origin = np.array([grid.origin_x, grid.origin_z])
        self._trees: dict[int | None, tuple[cKDTree, npt.NDArray[np.int64]]] = {}

    @classmethod
    def from_scene(
        cls,
        scene: Scene | tuple[npt.ArrayLike, npt.ArrayLike],
        body: Body | None = None,
        cell: float = CELL,
    ) -> NavigableSurface:
        """The surface of a scene, or of (vertices (V, 3) m, faces (F, 3)), for a body, on a grid of ``cell`` m.

        Raises
        ------
        ValueError
            The arrays are no mesh, the mesh is too large for the grid, or there is nowhere to stand.
        """
        body = body or Body()
        vertices, faces = (scene.vertices, scene.faces) if isinstance(scene, Scene) else scene
        v, f = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
        if v.ndim != 2 or v.shape[1] != 3 or f.ndim != 2 or f.shape[1] != 3 or len(f) == 0:
            raise ValueError(f"mesh has vertices {v.shape} and faces {f.shape}, expected (V, 3) and (F, 3), F > 0")
        if f.min() < 0 or f.max() >= len(v) or not np.isfinite(v).all():
            raise ValueError("mesh has faces without a vertex, or vertices that are not finite")
        grid = Grid.over(v, cell)
        surface = cls(standing_cells(solid_spans(v, f, grid, body.step_height), grid, body), grid, body)
        if len(surface.centres) == 0:
            raise ValueError(
                f"a body of radius {body.radius} m and height {body.height} m can stand nowhere on this mesh of extent "
                f"{np.ptp(v, axis=0).round(2).tolist()} m; expected a floor. Check that the mesh is Y up and in metres"
            )
        return surface

    def locate(self, position: npt.ArrayLike) -> int:
        """The cell that a position (3,) m is on, -1 for none: over or under it by at most a step (and a little)."""
        x, y, z = np.asarray(position, np.float64)
        c, g = self.cells, self.grid
        return int(locate(c.start, c.floor, self._origin, g.cell, g.nx, g.nz, x, y, z, self.body.step_height + 0.05))

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
        p = np.asarray(position, np.float64)
        if p.shape != (3,) or not np.isfinite(p).all():
            raise ValueError(f"position is {position!r}, expected three finite numbers")
        cell = self.locate(p)
        if (
            cell >= 0
            and island in (None, int(self.island[cell]))
            and abs(self.cells.floor[cell] - p[1]) <= max_distance
        ):
            return np.array([p[0], self.cells.floor[cell], p[2]])
        tree, members = self._tree(island)
        # Centres lie up to half a diagonal from the nearest point of their cell.
        near = np.array(sorted(tree.query_ball_point(p, max_distance + self.grid.cell)), np.int64)
        if len(near) == 0:
            return None
        centres, inside = self.centres[members[near]], 0.499 * self.grid.cell
        candidates = centres.copy()
        candidates[:, (0, 2)] += np.clip(p[[0, 2]] - centres[:, (0, 2)], -inside, inside)
        off = np.linalg.norm(candidates - p, axis=1)
        best = int(np.argmin(off))
        return np.asarray(candidates[best]) if off[best] <= max_distance else None

    def random_point(self, rng: np.random.Generator, island: int | None = None) -> Point:
        """A place (3,) m drawn evenly from an island, by default the main one (0)."""
        members = np.flatnonzero(self.island == (island or 0))
        if len(members) == 0:
            raise ValueError(f"there is no island {island}, expected one of 0..{len(self.island_areas) - 1}")
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
        p, d = np.asarray(position, np.float64), np.asarray(displacement, np.float64)
        cell = self.locate(p)
        if cell < 0:
            raise ValueError(f"position {p.tolist()} is not on the navigable surface; snap it first")
        if not np.isfinite(d).all():
            raise ValueError(f"displacement is {displacement!r}, expected finite numbers")
        c = self.cells
        x, z, cell = slide(
            c.neighbour, c.ix, c.iz, c.away, self._origin, self.grid.cell, cell, p[0], p[2], float(d[0]), float(d[2])
        )
        return np.array([x, c.floor[cell], z])

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

    def _tree(self, island: int | None) -> tuple[cKDTree, npt.NDArray[np.int64]]:
        if island not in self._trees:
            members = np.arange(len(self.island)) if island is None else np.flatnonzero(self.island == island)
            if len(members) == 0:
                raise ValueError(f"there is no island {island}, expected one of 0..{len(self.island_areas) - 1}")
            self._trees[island] = (cKDTree(self.centres[members]), members)
        return self._trees[island]


class DistanceField:
    """The way to the nearest of fixed goals from everywhere; a look-up costs no search.

    Parameters
    ----------
    surface : NavigableSurface
    goals : (G, 3) float64 m
        On the surface.
    until : int
        Search no further than to this cell; -1 = everywhere.
    """

    def __init__(self, surface: NavigableSurface, goals: Point, until: int = -1) -> None:
        self.surface, self.goals = surface, goals
        self._goal_cells = np.array([surface.locate(g) for g in goals], np.int64)
        self._distance, self._anchor = distance_to(
            surface.cells,
            surface.centres,
            surface.grid,
            surface.body.step_height,
            goals,
            self._goal_cells,
            until,
        )

    def distance(self, position: npt.ArrayLike) -> float:
        """Metres from a position (3,) m (snapped if it is off the surface) to the nearest goal; inf where there is no way."""
        p = np.asarray(position, np.float64)
        cell, p = self._stand(p)
        if cell < 0 or self._anchor[cell] == NO_ANCHOR:
            return float("inf")
        anchor = self._first_anchor(p, cell)
        return float(np.linalg.norm(p - self._place(anchor)) + (self._distance[anchor] if anchor >= 0 else 0.0))

    def path(self, position: npt.ArrayLike) -> Point:
        """Corners (n, 3) m from a position (3,) m to the nearest goal, both ends included.

        Raises
        ------
        ValueError
            There is no way.
        """
        p = np.asarray(position, np.float64)
        cell, p = self._stand(p)
        if cell < 0 or self._anchor[cell] == NO_ANCHOR:
            raise ValueError(f"no goal can be reached from {p.tolist()}")
        corners = [p]
        anchor = self._first_anchor(p, cell)
        while anchor >= 0:
            corners.append(self.surface.centres[anchor])
            anchor = int(self._anchor[anchor])
        return np.array([*corners, self._place(anchor)])

    def _stand(self, p: Point) -> tuple[int, Point]:
        cell = self.surface.locate(p)
        if cell >= 0:
            return cell, np.array([p[0], self.surface.cells.floor[cell], p[2]])
        snapped = self.surface.snap(p)
        return (-1, p) if snapped is None else (self.surface.locate(snapped), snapped)

    def _place(self, anchor: int) -> Point:
        return np.asarray(self.surface.centres[anchor] if anchor >= 0 else self.goals[-1 - anchor])

    def _first_anchor(self, p: Point, cell: int) -> int:
        """The cell's own anchor, or, where p does not see what the middle of its cell sees, the middle of the cell."""
        s, anchor = self.surface, int(self._anchor[cell])
        anchor_cell = anchor if anchor >= 0 else int(self._goal_cells[-1 - anchor])
        if anchor_cell == cell or sees(s.cells, s.grid, s.body.step_height, p, cell, self._place(anchor), anchor_cell):
            return anchor
        return cell
