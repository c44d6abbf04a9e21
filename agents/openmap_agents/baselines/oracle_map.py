"""The agent that starts with the map of a perfect eye: what it loses, grounding loses, and in ``navigation`` the walk."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from openmap_agents.agent import Answer, Observation
from openmap_agents.baselines.true_map import true_map
from openmap_agents.grounding import Grounder, Grounding
from openmap_agents.grounding.text_space import TextEncoder
from openmap_agents.mapping import InstanceMap
from openmap_env.actions import Action
from openmap_env.env import OpenMapNavEnv
from openmap_env.episodes import Target
from openmap_env.goals import way_to
from openmap_env.navigation import ShortestPathFollower
from openmap_scenes import Scene


class OracleMapAgent:
    """Grounds the instruction in the scene's true instances; in ``navigation`` it takes the shortest way to its choice.

    Parameters
    ----------
    env : OpenMapNavEnv
        The environment itself, wrappers taken off: the agent looks at what no agent that is to be scored may see.
    grounder : Grounder
    encoder : TextEncoder
        The grounder's.
    walks : bool
        Whether it goes to what it chose before it stops.
    """

    def __init__(self, env: OpenMapNavEnv, grounder: Grounder, encoder: TextEncoder, walks: bool) -> None:
        self._env, self.grounder, self.encoder, self._walks = env, grounder, encoder, walks
        self._scene: Scene | None = None
        self._map = InstanceMap()
        self._instruction = ""
        self._grounding: Grounding | None = None
        self._follower: ShortestPathFollower | None = None
        self._sets_out = False

    @property
    def instance_map(self) -> InstanceMap:
        """The scene's instances, with their own ids, in the world frame."""
        return self._map

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """An episode begins; the map is made once for each scene."""
        scene = self._env.simulator.scene
        if scene is not self._scene:
            self._scene, self._map = scene, true_map(scene, self.encoder)
        self._instruction = str(observation["instruction"])
        self._grounding = self._follower = None
        self._sets_out = self._walks

    def act(self, observation: Observation) -> int:
        """The next action on the way to the chosen instance; STOP at its end, or where there is no way."""
        if self._sets_out:
            self._sets_out, self._follower = False, self._way()
        if self._follower is None:
            return int(Action.STOP)
        simulator = self._env.simulator
        return int(self._follower.next_action(simulator.position, simulator.heading))

    def answer(self) -> Answer:
        """The true centres of all instances, ranked for the episode's instruction."""
        grounding = self._ground()
        ranked = [self._map.get(i) for i in grounding.ranking]
        T_episode_world = np.linalg.inv(self._env.T_world_episode)
        centres = np.array([i.centre for i in ranked], np.float64).reshape(-1, 3)
        positions = centres @ T_episode_world[:3, :3].T + T_episode_world[:3, 3]
        trace = {**grounding.trace, "ranking": grounding.ranking[:16], "instances": len(self._map)}
        return Answer(positions.astype(np.float32), [i.label for i in ranked], trace)

    def _ground(self) -> Grounding:
        if self._grounding is None:
            self._grounding = self.grounder.ground(self._instruction, self._map)
        return self._grounding

    def _way(self) -> ShortestPathFollower | None:
        """To the choice, or to what fits best where nothing was chosen; None where nothing can be reached."""
        grounding = self._ground()
        chosen = grounding.choice if grounding.choice is not None else next(iter(grounding.ranking), None)
        if chosen is None:
            return None
        instance, simulator = self._map.get(chosen), self._env.simulator
        centre, low, high = (
            (float(v[0]), float(v[1]), float(v[2])) for v in (instance.centre, instance.aabb_min, instance.aabb_max)
        )
        surface = simulator.surface
        target = Target(chosen, centre, low, high)
        way = way_to(surface, simulator.scene, [target], surface.island_of(simulator.position))
        if way is None:
            return None
        turn_deg = math.degrees(simulator.turn)
        return ShortestPathFollower(surface, way, forward_step=simulator.forward_step, turn_deg=turn_deg)
