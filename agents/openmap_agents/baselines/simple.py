"""Agents that know nothing: what any other has to beat."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from openmap_agents.agent import Answer, Observation
from openmap_env.actions import Action

MOVES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class RandomAgent:
    """Walks and turns at random and stops after ``mean_steps`` actions on average; its answer is where it stands."""

    def __init__(self, rng: np.random.Generator, mean_steps: int = 100) -> None:
        if mean_steps < 1:
            raise ValueError(f"mean_steps is {mean_steps}, expected at least 1")
        self._seed, self._stop = int(rng.integers(2**32)), 1.0 / mean_steps
        self._rng = np.random.default_rng(self._seed)

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """What is drawn depends on the episode alone, so that an evaluation that was resumed draws the same."""
        self._rng = np.random.default_rng([self._seed, zlib.crc32(str(info["episode_id"]).encode())])

    def act(self, observation: Observation) -> int:
        """STOP now and then, otherwise any move."""
        if self._rng.random() < self._stop:
            return int(Action.STOP)
        return int(MOVES[int(self._rng.integers(len(MOVES)))])

    def answer(self) -> Answer | None:
        """Where it stands."""
        return None


class StandStillAgent:
    """Stops at once; its answer is where it starts."""

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """Nothing is kept, nothing is dropped."""

    def act(self, observation: Observation) -> int:
        """STOP."""
        return int(Action.STOP)

    def answer(self) -> Answer | None:
        """Where it stands."""
        return None
