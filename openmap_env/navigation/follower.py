"""The next action on the shortest way to a goal, for agents that are allowed to know the way."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from openmap_env.actions import Action
from openmap_env.navigation.surface import DistanceField, NavigableSurface


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
        self._turns = sorted(range(1 - half_circle, half_circle + 1), key=lambda n: (abs(n), -n))

    def next_action(self, position: npt.ArrayLike, heading: float) -> Action:
        """What to do at a position (3,) m with a heading in radians (0 looks along -Z, positive turns left).

        STOP at the goal, and also where no heading leads nearer to it.
        """
        p = np.asarray(position, np.float64)
        here = self.field.distance(p)
        if here <= self.goal_radius or not math.isfinite(here):
            return Action.STOP
        best, best_turns = math.inf, 0
        for turns in self._turns:
            angle = heading + turns * self._turn
            step = self.forward_step * np.array([-math.sin(angle), 0.0, -math.cos(angle)])
            once = self.surface.try_step(p, step)
            nearest = self.field.distance(once)
            if nearest > self.goal_radius:
                nearest = 0.5 * (nearest + self.field.distance(self.surface.try_step(once, step)))
            value = nearest + 0.01 * self.forward_step * abs(turns)
            if value < best - 1e-9 and nearest < here - 1e-6:
                best, best_turns = value, turns
        if math.isinf(best):
            return Action.STOP
        if best_turns == 0:
            return Action.MOVE_FORWARD
        return Action.TURN_LEFT if best_turns > 0 else Action.TURN_RIGHT
