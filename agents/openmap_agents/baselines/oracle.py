"""The upper bound: an agent that is told where the targets are and knows the way."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from openmap_agents.agent import Answer, Observation
from openmap_env.actions import Action
from openmap_env.env import OpenMapNavEnv
from openmap_env.goals import way_to
from openmap_env.navigation import ShortestPathFollower


class OracleAgent:
    """Follows the shortest way to the nearest target and declares the centres of all of them.

    Parameters
    ----------
    env : OpenMapNavEnv
        The environment itself, wrappers taken off: the agent looks at what no agent that is to be scored may see.
    """

    def __init__(self, env: OpenMapNavEnv) -> None:
        self._env = env
        self._follower: ShortestPathFollower | None = None

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Look the way up; a target that cannot be reached is only declared."""
        simulator, episode = self._env.simulator, self._env.episode
        surface = simulator.surface
        way = way_to(surface, simulator.scene, episode.targets, surface.island_of(simulator.position))
        self._follower = None
        if way is not None:
            turn_deg = math.degrees(simulator.turn)
            self._follower = ShortestPathFollower(surface, way, forward_step=simulator.forward_step, turn_deg=turn_deg)

    def act(self, observation: Observation) -> int:
        """The next action on the way, STOP at its end."""
        if self._follower is None:
            return int(Action.STOP)
        simulator = self._env.simulator
        return int(self._follower.next_action(simulator.position, simulator.heading))

    def answer(self) -> Answer:
        """The centres of the targets, in the order of the episode."""
        targets = self._env.episode.targets
        T_episode_world = np.linalg.inv(self._env.T_world_episode)
        centres = np.array([t.centre for t in targets], np.float64).reshape(-1, 3)
        positions = centres @ T_episode_world[:3, :3].T + T_episode_world[:3, 3]
        names = {i.id: i.category for i in self._env.simulator.scene.instances}
        return Answer(positions.astype(np.float32), [names.get(t.instance_id, "place") for t in targets])
