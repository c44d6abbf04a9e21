"""Where to look next: exploration of an unknown home by next best view, from depth and poses alone.

After a look around at the start, the explorer always knows two kinds of targets: frontier cells (free floor that touches
unknown) and surfaces that were only seen from afar, on which small things would be missed. Of all places within reach it
goes to the one whose best single look is worth most for the steps that it costs, turns there, looks, and chooses again; it
looks along the way too, so a goal that has nothing left to show is dropped before it is reached. Targets that stay although
they were looked at from near are given up. Before it ends it walks up to every stretch of frontier that it never came near, however
little the looks from afar promised: a door seen from the side shows nothing. It is done when no look is worth its while, or when
its steps are spent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt, label

from openmap_agents.exploration.occupancy import OCCUPIED, Cell, OccupancyMap, OccupancySettings
from openmap_agents.exploration.planner import beyond_frontier, frontier_cells
from openmap_agents.exploration.views import best_headings, gains_by_bearing, in_view
from openmap_agents.exploration.walker import Walker, WalkerSettings, Ways
from openmap_env.actions import Action
from openmap_scenes import PinholeCamera


@dataclass(frozen=True)
class ExplorerSettings:
    """What is worth a look, and for how long."""

    max_steps: int = 1500
    """Actions after which exploration ends."""
    frontier_reach: float = 3.0
    """A frontier cell counts for places up to this far away, m."""
    surface_reach: float = 2.5
    """Surfaces seen only from farther away than this deserve a nearer look, m; 0 = none do."""
    table_reach: float = 0.0
    """The same for surfaces whose highest point lies between ``table_low`` and ``table_high``: small things lie on them.
    0 = as others."""
    table_weight: float = 0.2
    """What a cell of these is worth once it was seen from within ``surface_reach``."""
    table_low: float = 0.35
    """Above the floor, m."""
    table_high: float = 1.15
    """Above the floor, m."""
    surface_weight: float = 0.45
    """What a surface cell is worth; a frontier cell is worth 1."""
    least_frontier: float = 6.0
    """A look must show this many frontier cells (0.3 m with cells of 5 cm: less than the walkable part of a door) ..."""
    least_gain: float = 16.0
    """... or be worth this much, surfaces and all."""
    walk_up: float = 0.35
    """Before the end, a connected frontier of at least this length, m, is walked up to; 0 = none is ..."""
    near: float = 0.75
    """... unless the body has been this near to it, m."""
    overhead: float = 10.0
    """Steps added to the cost of every look, so that near crumbs do not come before a room."""
    patience: int = 4
    """Looks from near, after which a target that is still there is given up."""
    tall: float = 1.1
    """What reaches higher than this above the floor cannot be seen over, m."""
    look_down_deg: float = 30.0
    """Pitch of the looks at the floor near the body, degrees."""
    lattice: float = 0.25
    """Spacing of the places that are considered, m."""
    replan_every: int = 3
    """Actions between two choices while a goal holds."""
    occupancy: OccupancySettings = field(default_factory=OccupancySettings)
    walker: WalkerSettings = field(default_factory=WalkerSettings)


Interest = Callable[[npt.NDArray[np.float64], npt.NDArray[np.bool_]], npt.NDArray[np.float32]]
"""From places (n, 2) x, z m and whether each is a frontier to factors (n,) on what a look at them is worth."""


@dataclass(frozen=True)
class Targets:
    """Cells that deserve a look: (m, 2) int64 cells, (m,) weights, (m,) reach m, (m,) whether a frontier; and (m, 2) the direction
    in which the unknown lies, unit vectors in cells, 0 for surfaces."""

    cells: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float32]
    reach: npt.NDArray[np.float32]
    frontier: npt.NDArray[np.bool_]
    beyond: npt.NDArray[np.float32]


@dataclass(frozen=True)
class Goal:
    """Where to look from, (x, z) m, and in which direction, rad."""

    x: float
    z: float
    heading: float
    gain: float


class Explorer:
    """Explores by ``update`` with every observation and ``next_action`` for what to do; see the module.

    Parameters
    ----------
    settings : ExplorerSettings or None
    rng : np.random.Generator or None
        Breaks out of places where nothing moves; None = seed 0.

    Attributes
    ----------
    occupancy : OccupancyMap
    walker : Walker
    goal : Goal or None
        What it goes for now.
    done : bool
    look_around : int
        How many actions the look around at the start takes.
    interest : Interest or None
        What one is looking for may make some places worth more than others; None = all alike.
    """

    def __init__(self, settings: ExplorerSettings | None = None, rng: np.random.Generator | None = None) -> None:
        self.settings = settings or ExplorerSettings()
        self.occupancy = OccupancyMap(self.settings.occupancy)
        self.walker = Walker(self.occupancy, self.settings.walker, rng)
        self.goal: Goal | None = None
        self.interest: Interest | None = None
        self.done = False
        self.steps = 0
        self._camera: PinholeCamera | None = None
        self._places: list[tuple[float, float, float]] = []
        self._queue = self._look_around()
        self.look_around = len(self._queue)
        self._ways: Ways | None = None
        self._age = 0
        self._still = False
        self._walked_up: list[tuple[float, float]] = []

    @property
    def trajectory(self) -> npt.NDArray[np.float64]:
        """Where the body stood after each action, (n, 3) m, on the floor."""
        return np.array(self._places, np.float64).reshape(-1, 3)

    def update(
        self,
        depth: npt.NDArray[np.floating],
        T_episode_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
        collided: bool | None = None,
    ) -> None:
        """Take in what the last action led to: planar depth (H, W) m, 0 = nothing seen, and the pose (4, 4) it was seen from."""
        before = (self.walker.x, self.walker.z)
        self.walker.observe(T_episode_camera, collided)
        self._still = before == (self.walker.x, self.walker.z)
        self._camera = camera
        self._places.append((self.walker.x, self.walker.floor, self.walker.z))
        self.occupancy.integrate(depth, T_episode_camera, camera, self.walker.floor)

    def next_action(self) -> Action | None:
        """What to do next; None = there is nothing left worth a look, or the steps are spent."""
        if self._camera is None:
            raise ValueError("next_action was asked for before any observation; call update first")
        if self.done or self.steps >= self.settings.max_steps:
            self.done = True
            return None
        action = self._choose()
        self.done = action is None
        self.steps += 1
        self._age += 1
        return action

    def targets(self, ways: Ways) -> Targets:
        """What deserves a look now."""
        s, o = self.settings, self.occupancy
        frontier = np.argwhere(frontier_cells(ways.grid, ways.distance))
        near_enough = self._near_enough(ways)
        surface = np.argwhere(np.isfinite(o.seen_from) & (o.seen_from > near_enough) & (near_enough > 0))
        cells = np.concatenate([frontier, surface])
        is_frontier = np.arange(len(cells)) < len(frontier)
        keep = o.looked[cells[:, 0], cells[:, 1]] < s.patience
        cells, is_frontier = cells[keep], is_frontier[keep]
        near = o.seen_from[cells[:, 0], cells[:, 1]] <= s.surface_reach
        weights = np.where(is_frontier, 1.0, np.where(near, s.table_weight, s.surface_weight)).astype(np.float32)
        if self.interest is not None and len(cells):
            weights *= self.interest(np.array([o.place((int(i), int(j))) for i, j in cells]), is_frontier)
        reach = np.where(is_frontier, s.frontier_reach, 0.95 * near_enough[cells[:, 0], cells[:, 1]]).astype(np.float32)
        beyond = np.zeros((len(cells), 2), np.float32)
        beyond[is_frontier] = beyond_frontier(ways.grid, cells[is_frontier])
        return Targets(cells, weights, reach, is_frontier, beyond)

    def _near_enough(self, ways: Ways) -> npt.NDArray[np.float32]:
        """From how near each cell's surfaces are to be seen, (H, W) m; 0 = they need not be."""
        s, top = self.settings, self.occupancy.top
        reach = np.full(top.shape, s.surface_reach, np.float32)
        if s.table_reach > 0:
            reach[(top > s.table_low) & (top < s.table_high) & (ways.grid == OCCUPIED)] = s.table_reach
        return reach

    def _choose(self) -> Action | None:
        """One decision: go on with the goal, or look, or take a new goal."""
        if self._queue:
            return self.walker.did(self._queue.pop(0))
        while True:
            ways = self._plan()
            if self.goal is None:
                return None
            goal_cell = self.occupancy.cell(self.goal.x, self.goal.z)
            if action := self.walker.follow(ways, goal_cell):
                return action
            if action := self.walker.turn_towards(self.goal.heading) or self._look_down(ways):
                return action
            if self._age == 0:
                # It stands there and looks there, and what was just planned still wants that look: it will not help.
                self._give_up(ways)
            self._ways = None

    def _plan(self) -> Ways:
        """The ways and the goal, chosen anew when they are old or do not fit the map any more."""
        ways, w = self._ways, self.walker
        fits = ways is not None and ways.grid.shape == self.occupancy.hits.shape
        if ways and fits and self.goal and w.blocked == 0 and self._age < self.settings.replan_every:
            return ways
        ways = self._ways = w.ways()
        self._age = 0
        targets = self.targets(ways)
        if self._still:
            self._count_looks(ways, targets)
        self.goal = self._best_goal(ways, targets) or self._unvisited(ways)
        return ways

    def _unvisited(self, ways: Ways) -> Goal | None:
        """The nearest stretch of frontier that the body never came near, to be walked up to; None = there is none."""
        s, o = self.settings, self.occupancy
        if s.walk_up <= 0:
            return None
        frontier = frontier_cells(ways.grid, ways.distance)
        been = o.stood.copy()
        for x, z in self._walked_up:
            been[o.cell(x, z)] = True
        pieces, n = label(frontier, np.ones((3, 3)))
        away = distance_transform_edt(~been, sampling=o.resolution)
        best: tuple[float, Cell] | None = None
        for number in range(1, n + 1):
            cells = np.argwhere(pieces == number)
            if len(cells) * o.resolution < s.walk_up or away[cells[:, 0], cells[:, 1]].min() < s.near:
                continue
            middle = cells[np.argmin(np.hypot(*(cells - cells.mean(axis=0)).T))]
            cell = (int(middle[0]), int(middle[1]))
            if best is None or ways.distance[cell] < best[0]:
                best = float(ways.distance[cell]), cell
        if best is None:
            return None
        (row, column), (x, z) = beyond_frontier(ways.grid, np.array([best[1]]))[0].tolist(), o.place(best[1])
        return Goal(x, z, math.atan2(-column, -row), 0.0)

    def _best_goal(self, ways: Ways, targets: Targets) -> Goal | None:
        """The place and heading whose look is worth most a step; None where none is worth it."""
        s, o, w = self.settings, self.occupancy, self.walker
        if not len(targets.cells):
            return None
        places = self._candidates(ways)
        # A chequer of the targets is enough to choose by, at twice the weight.
        half = targets.cells.sum(axis=1) % 2 == 0
        cells, weights, reach = targets.cells[half], 2 * targets.weights[half], targets.reach[half]
        frontier, beyond, opaque = targets.frontier[half], targets.beyond[half], self._opaque(ways)
        gains = [
            gains_by_bearing(places, cells[part], weights[part], reach[part], opaque, o.resolution, beyond[part])
            for part in (frontier, ~frontier)
        ]
        gain, heading = best_headings(gains[0] + gains[1])
        worth = (gain >= s.least_gain) | (best_headings(gains[0])[0] >= s.least_frontier)
        turn, forward = math.radians(s.walker.turn_deg), s.walker.forward
        way = np.arctan2(w.cell[1] - places[:, 1], w.cell[0] - places[:, 0])
        away = ways.distance[places[:, 0], places[:, 1]]
        here = np.all(places == np.array(w.cell), axis=1)
        first = np.where(here, 0.0, np.abs(_wrap(way - w.heading)))
        last = np.abs(_wrap(heading - np.where(here, w.heading, way)))
        steps = away / forward + (first + last) / turn + s.overhead
        if self.goal is not None:
            near_goal = np.hypot(*(places - np.array(o.cell(self.goal.x, self.goal.z))).T) * o.resolution < 0.5
            steps = np.where(near_goal, steps * 0.8, steps)
        rate = np.where(worth, gain / steps, 0.0)
        best = int(np.argmax(rate))
        if rate[best] <= 0.0:
            return None
        x, z = o.place((int(places[best, 0]), int(places[best, 1])))
        return Goal(x, z, float(heading[best]), float(gain[best]))

    def _candidates(self, ways: Ways) -> npt.NDArray[np.int64]:
        """Cells (n, 2) to look from: where the body stands, and a lattice of what is within reach."""
        step = max(1, round(self.settings.lattice / self.occupancy.resolution))
        lattice = np.argwhere(np.isfinite(ways.distance[::step, ::step])) * step
        return np.concatenate([np.array([self.walker.cell]), lattice]).astype(np.int64)

    def _opaque(self, ways: Ways) -> npt.NDArray[np.bool_]:
        return np.asarray((ways.grid == OCCUPIED) & (self.occupancy.top > self.settings.tall))

    def _blind_distance(self, pitch: float) -> float:
        """From how far on the camera sees the floor, m."""
        assert self._camera is not None
        assert self.walker.camera_height is not None
        lowest = math.atan2(self._camera.height / 2, self._camera.fy) - pitch
        return self.walker.camera_height / math.tan(lowest) if lowest < math.pi / 2 else 0.0

    def _seen_now(self, ways: Ways, targets: Targets, pitch: float) -> npt.NDArray[np.bool_]:
        """Which targets the camera has in view at that pitch, as far as the map can tell."""
        assert self._camera is not None
        half = 0.9 * math.atan2(self._camera.width / 2, self._camera.fx)
        w, opaque, resolution = self.walker, self._opaque(ways), self.occupancy.resolution
        in_frame = in_view(
            w.cell, w.heading, targets.cells, targets.reach, 0.0, half, opaque, resolution, targets.beyond
        )
        cells = targets.cells - np.array(w.cell)
        near = np.hypot(cells[:, 0], cells[:, 1]) * resolution < self._blind_distance(pitch)
        return np.asarray(in_frame & ~(near & targets.frontier))

    def _count_looks(self, ways: Ways, targets: Targets) -> None:
        seen = targets.cells[self._seen_now(ways, targets, self.walker.pitch)]
        self.occupancy.looked[seen[:, 0], seen[:, 1]] += 1

    def _look_down(self, ways: Ways) -> Action | None:
        """A look at the floor near the body, where that shows more of the frontier than the level camera does."""
        down = -math.radians(self.settings.look_down_deg)
        targets = self.targets(ways)
        more = self._seen_now(ways, targets, down) & ~self._seen_now(ways, targets, self.walker.pitch)
        return self.walker.level(down) if targets.weights[more].sum() >= 2.0 else None

    def _give_up(self, ways: Ways) -> None:
        """The targets in view of the goal are not shown by looking from here: ask for them no more."""
        if self.goal is not None:
            self._walked_up.append((self.goal.x, self.goal.z))
        targets = self.targets(ways)
        seen = targets.cells[self._seen_now(ways, targets, -math.pi / 2 + 0.1)]
        self.occupancy.looked[seen[:, 0], seen[:, 1]] = self.settings.patience
        if not len(seen) and self.goal is not None:
            cells = targets.cells
            away = np.hypot(*(cells - np.array(self.occupancy.cell(self.goal.x, self.goal.z))).T)
            near = cells[away * self.occupancy.resolution < self.settings.frontier_reach]
            self.occupancy.looked[near[:, 0], near[:, 1]] = self.settings.patience

    def _look_around(self) -> list[Action]:
        """A full turn, level and looking down by turns of 90 degrees: with 90 degrees of view both cover the circle."""
        quarter = [Action.TURN_LEFT] * round(90.0 / self.settings.walker.turn_deg)
        tilts = round(self.settings.look_down_deg / self.settings.walker.tilt_deg)
        down, up = [Action.LOOK_DOWN] * tilts, [Action.LOOK_UP] * tilts
        return (quarter + down + quarter + up) * 2


def _wrap(angle: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """Angles in -pi..pi."""
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)), np.float64)
