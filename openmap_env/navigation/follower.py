"""The next action on the shortest way to a goal, for agents that are allowed to know the way."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.actions import Action
from openmap_env.navigation.field import SNAP_DISTANCE, DistanceField, look_up
from openmap_env.navigation.motion import step
from openmap_env.navigation.surface import NavigableSurface

_NOWHERE = 1 << 30


class ShortestPathFollower:
    """Turns and walks so that the distance to the goal falls fastest.

    Every heading that turning can reach is tried: the body walks forward in thought, twice, and the heading that brings it nearest
    to the goal wins, less a little for each turn. It has no memory, so an agent may act otherwise in between.

    Parameters
    ----------
    surface : NavigableSurface
    goals : (3,) or (G, 3) m, world frame, or a DistanceField
        The nearest counts.
    goal_radius : float
        STOP within this many m of way.
    forward_step, turn_deg : float
        The environment's step, m, and turn, degrees.
    """

    def __init__(
        self,
        surface: NavigableSurface,
        goals: npt.ArrayLike | DistanceField,
        *,
        goal_radius: float = 0.25,
        forward_step: float = 0.25,
        turn_deg: float = 15.0,
    ) -> None:
        self.surface, self.goal_radius, self.forward_step = surface, goal_radius, forward_step
        self.field = goals if isinstance(goals, DistanceField) else surface.distance_field(goals)
        self._turn = math.radians(turn_deg)
        half_circle = math.ceil(math.pi / self._turn - 1e-9)
        # Straight on first, then ever larger turns, left before right: the first of equals wins.
        order = sorted(range(1 - half_circle, half_circle + 1), key=lambda n: (abs(n), -n))
        self._turns = np.array(order, np.int64)

    def next_action(self, position: npt.ArrayLike, heading: float) -> Action:
        """What to do at a position (3,) m with a heading in radians (0 looks along -Z, positive turns left).

        STOP at the goal, and also where no heading leads nearer to it.
        """
        s, way = self.surface, self.field.way
        x, y, z = np.asarray(position, np.float64).tolist()
        turns = _best_turns(
            s.ground, way, s.island, s.body.step_height, s.reach, x, y, z,
            heading, self._turns, self._turn, self.forward_step, self.goal_radius,
        )  # fmt: skip
        if turns == _NOWHERE:
            return Action.STOP
        if turns == 0:
            return Action.MOVE_FORWARD
        return Action.TURN_LEFT if turns > 0 else Action.TURN_RIGHT


@nb.njit(cache=True)
def _best_turns(  # type: ignore[no-untyped-def]
    ground, way, island, slack, reach, x, y, z, heading, turns, turn, forward, goal_radius
):
    """The number of turns, left positive, to the heading that leads nearest to the goal; _NOWHERE at the goal or if none does."""
    here = look_up(ground, way, island, slack, reach, SNAP_DISTANCE, x, y, z)[0]
    if here <= goal_radius or not np.isfinite(here):
        return _NOWHERE
    best, best_turns = np.inf, _NOWHERE
    for n in turns:
        angle = heading + n * turn
        # Where a step ends may hang on the last bit of its direction. Rounded, a heading is judged alike before and after a turn.
        dx, dz = -forward * round(np.sin(angle), 7), -forward * round(np.cos(angle), 7)
        ax, ay, az, cell = step(ground, reach, x, y, z, dx, dz)
        if cell < 0:
            return _NOWHERE
        nearest = look_up(ground, way, island, slack, reach, SNAP_DISTANCE, ax, ay, az)[0]
        if nearest > goal_radius:
            ax, ay, az, _ = step(ground, reach, ax, ay, az, dx, dz)
            nearest = 0.5 * (nearest + look_up(ground, way, island, slack, reach, SNAP_DISTANCE, ax, ay, az)[0])
        value = nearest + 0.01 * forward * abs(n)
        if value < best - 1e-9 and nearest < here - 1e-6:
            best, best_turns = value, n
    return best_turns
