"""Observation wrappers: what learning libraries want instead of a text and of metres."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

Observation = dict[str, Any]
_LARGEST = float(np.finfo(np.float32).max)


class EmbedInstruction(gym.ObservationWrapper[Observation, int, Observation]):
    """Replaces ``instruction`` by a vector of fixed size, as stable-baselines3's ``MultiInputPolicy`` takes it.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``instruction``.
    embed : callable
        Text -> (D,) numbers, always the same D; asked once per new instruction.
    key : str
        Name of the vector in the observation.

    Raises
    ------
    ValueError
        The environment has no instruction, or ``embed`` gives no finite vector of one size.
    """

    def __init__(
        self, env: gym.Env[Observation, int], embed: Callable[[str], npt.ArrayLike], key: str = "instruction_embedding"
    ) -> None:
        super().__init__(env)
        inner = env.observation_space
        if not isinstance(inner, spaces.Dict) or "instruction" not in inner.spaces:
            raise ValueError(f"observation space is {type(inner).__name__}, expected a Dict with 'instruction'")
        self._embed, self._key = embed, key
        self._last: tuple[str, npt.NDArray[np.float32]] | None = None
        self._size: int | None = None
        self._size = len(self._vector("find the chair"))
        kept = {name: space for name, space in inner.spaces.items() if name != "instruction"}
        self.observation_space = spaces.Dict({**kept, key: spaces.Box(-_LARGEST, _LARGEST, (self._size,), np.float32)})

    def observation(self, observation: Observation) -> Observation:
        """The observation with the vector in place of the text."""
        kept = {name: value for name, value in observation.items() if name != "instruction"}
        return {**kept, self._key: self._vector(observation["instruction"]).copy()}

    def _vector(self, text: str) -> npt.NDArray[np.float32]:
        if self._last is None or self._last[0] != text:
            vector = np.asarray(self._embed(text), np.float32)
            expected = (self._size,) if self._size is not None else vector.shape
            if vector.ndim != 1 or len(vector) == 0 or vector.shape != expected or not np.isfinite(vector).all():
                size = "D" if self._size is None else self._size
                raise ValueError(
                    f"embed({text[:60]!r}) has shape {vector.shape}, expected finite numbers of shape ({size},)"
                )
            self._last = (text, vector)
        return self._last[1]


class NormalizeDepth(gym.ObservationWrapper[Observation, int, Observation]):
    """Turns ``depth`` from metres into 0..1, as habitat-lab does: clipped to [min_depth, max_depth], scaled; 0 stays 0.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``depth``.
    min_depth, max_depth : float
        Metres.
    """

    def __init__(self, env: gym.Env[Observation, int], min_depth: float = 0.0, max_depth: float = 10.0) -> None:
        super().__init__(env)
        inner = env.observation_space
        if not isinstance(inner, spaces.Dict) or "depth" not in inner.spaces:
            raise ValueError(f"observation space is {type(inner).__name__}, expected a Dict with 'depth'")
        if not 0.0 <= min_depth < max_depth < np.inf:
            raise ValueError(
                f"min_depth is {min_depth} and max_depth {max_depth} m, expected 0 <= min_depth < max_depth"
            )
        self._min, self._max = min_depth, max_depth
        shape = inner["depth"].shape or ()
        self.observation_space = spaces.Dict({**inner.spaces, "depth": spaces.Box(0.0, 1.0, shape, np.float32)})

    def observation(self, observation: Observation) -> Observation:
        """The observation with scaled depth."""
        depth = observation["depth"]
        scaled = (np.clip(depth, self._min, self._max) - self._min) / np.float32(self._max - self._min)
        scaled = np.where(depth > 0.0, scaled, 0.0).astype(np.float32)
        return {**observation, "depth": scaled}
