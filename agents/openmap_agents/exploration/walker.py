"""The body on its map: where it is, how it follows a way with discrete actions, and how it notices that it cannot.

The walker reads poses only. A step forward that does not move the body marks the place it aimed at, so that the next way
leads around it; when that happens again and again the walker turns away at random and tries from elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from openmap_agents.exploration.occupancy import Cell, OccupancyMap
from openmap_agents.exploration.planner import PlannerSettings, dearest_on_line, distances, path_to, traversal_cost
from openmap_env.actions import Action


@dataclass(frozen=True)
class WalkerSettings:
    """What the body's actions do, as the environment is set up."""

    forward: float = 0.25
    """MOVE_FORWARD, m."""
    turn_deg: float = 15.0
    """TURN_LEFT and TURN_RIGHT, degrees."""
    tilt_deg: float = 15.0
    """LOOK_UP and LOOK_DOWN, degrees."""
    lookahead: float = 1.0
    """How far along its way the body aims, m."""
    patience: int = 4
    """After so many steps forward in a row without moving, turn away."""
    planner: PlannerSettings = field(default_factory=PlannerSettings)


@dataclass(frozen=True)
class Ways:
    """The map as one plan sees it: state, cost and distance of every cell, from where the body stood then."""

    version: int
    start: Cell
    grid: npt.NDArray[np.uint8]
    cost: npt.NDArray[np.float32]
    distance: npt.NDArray[np.float32]
    parent: npt.NDArray[np.int32]


class Walker:
    """Follows ways over an occupancy map; see the module.

    Attributes
    ----------
    x, z, heading, pitch : float
        Of the last pose, m and rad; pitch is positive looking up.
    blocked : int
        Steps forward in a row that did not move the body.
    """

    def __init__(
        self, occupancy: OccupancyMap, settings: WalkerSettings | None = None, rng: np.random.Generator | None = None
    ) -> None:
        self.occupancy = occupancy
        self.settings = settings or WalkerSettings()
        self.rng = rng if rng is not None else np.random.default_rng(0)
        self.x = self.z = self.heading = self.pitch = 0.0
        self.camera_height: float | None = None
        self.floor = 0.0
        self.blocked = 0
        self._last: Action | None = None
        self._escape: list[Action] = []

    @property
    def cell(self) -> Cell:
        """The cell under the body."""
        return self.occupancy.cell(self.x, self.z)

    def observe(self, T_episode_camera: npt.NDArray[np.floating], collided: bool | None = None) -> None:
        """Take in the pose (4, 4) after the last action; ``collided`` where the body reports it, None = tell from the pose.

        The first pose tells the height of the camera: the episode frame's origin lies on the floor.
        """
        T = np.asarray(T_episode_camera, np.float64)
        if self.camera_height is None:
            self.camera_height = float(T[1, 3])
        moved = math.hypot(T[0, 3] - self.x, T[2, 3] - self.z)
        forward = -T[:3, 2]
        self.x, self.z, self.floor = float(T[0, 3]), float(T[2, 3]), float(T[1, 3]) - self.camera_height
        flat = math.hypot(forward[0], forward[2])
        if flat > 1e-3:
            self.heading = math.atan2(-forward[0], -forward[2])
        self.pitch = math.atan2(forward[1], flat)
        if self._last == Action.MOVE_FORWARD:
            stopped = moved < 0.5 * self.settings.forward
            if stopped or (collided and moved < 0.8 * self.settings.forward):
                ahead = 0.6 * self.settings.forward
                self.occupancy.bump(self.x - ahead * math.sin(self.heading), self.z - ahead * math.cos(self.heading))
            self.blocked = self.blocked + 1 if stopped else 0
        self._last = None
        self.occupancy.stand(self.x, self.z)

    def lift(self) -> None:
        """The body is about to be put somewhere else: its next pose is no consequence of its last action."""
        self._last = None
        self._escape = []
        self.blocked = 0

    def did(self, action: Action) -> Action:
        """Remember the action that is about to be played; every action of the body passes through here."""
        self._last = action
        return action

    def ways(self) -> Ways:
        """Distances from here to everywhere on the map as it is now."""
        grid = self.occupancy.grid
        cost = traversal_cost(self.occupancy, grid, self.x, self.z, self.settings.planner)
        start = self.cell
        distance, parent = distances(cost, start, self.occupancy.resolution)
        return Ways(self.occupancy.version, start, grid, cost, distance, parent)

    def follow(self, ways: Ways, goal: Cell) -> Action | None:
        """The next action towards a cell; None where the body stands on it, or where no way leads there."""
        if self._escape:
            return self.did(self._escape.pop(0))
        if self.blocked >= self.settings.patience:
            return self._turn_away()
        if not np.isfinite(ways.distance[goal]):
            return None
        aim = self._aim(ways, path_to(ways.parent, goal))
        if aim is None:
            return None
        if level := self.level():
            return level
        x, z = self.occupancy.place(aim)
        return self.turn_towards(math.atan2(self.x - x, self.z - z)) or self.did(Action.MOVE_FORWARD)

    def turn_towards(self, heading: float) -> Action | None:
        """The turn that brings the body nearer to a heading, or None where it looks there as well as its turns allow."""
        off = math.remainder(heading - self.heading, 2.0 * math.pi)
        if abs(off) <= 0.5 * math.radians(self.settings.turn_deg) + 1e-4:
            return None
        return self.did(Action.TURN_LEFT if off > 0 else Action.TURN_RIGHT)

    def level(self, pitch: float = 0.0) -> Action | None:
        """The look that brings the camera nearer to a pitch (rad), or None where it has it."""
        off = pitch - self.pitch
        if abs(off) <= 0.5 * math.radians(self.settings.tilt_deg) + 1e-4:
            return None
        return self.did(Action.LOOK_UP if off > 0 else Action.LOOK_DOWN)

    def _aim(self, ways: Ways, path: list[Cell]) -> Cell | None:
        """The farthest cell of the way, within the lookahead, that a straight line reaches; None at the way's end."""
        here, reach = self.cell, self.settings.lookahead / self.occupancy.resolution
        gaps = [math.hypot(r - here[0], c - here[1]) for r, c in path]
        first = int(np.argmin(gaps))
        aim, dearest = None, 1.5
        for cell, gap in zip(path[first:], gaps[first:], strict=True):
            dearest = max(dearest, float(ways.cost[cell]))
            # A short cut may come no nearer to the walls than the way itself does.
            if gap > reach or (aim and dearest_on_line(ways.cost, here, cell) > dearest + 0.5):
                break
            if gap * self.occupancy.resolution >= 0.5 * self.settings.forward:
                aim = cell
        return aim

    def _turn_away(self) -> Action:
        """Nothing moves here: turn by 60 to 180 degrees and take a step."""
        turns = int(self.rng.integers(round(60.0 / self.settings.turn_deg), round(180.0 / self.settings.turn_deg) + 1))
        turn = Action.TURN_LEFT if self.rng.random() < 0.5 else Action.TURN_RIGHT
        self._escape = [turn] * (turns - 1) + [Action.MOVE_FORWARD]
        self.blocked = 0
        return self.did(turn)
