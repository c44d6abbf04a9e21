"""What a learned policy sees: one picture of colour and depth, where it is, and the instruction as numbers."""

from __future__ import annotations

import math
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

Observation = dict[str, Any]
FARTHEST = 10.0
"""Depth that fills its channel, m."""
_REACH = 1000.0


def view_space(width: int, height: int, words: int) -> spaces.Dict:
    """The space of ``view``'s result, for pictures of that size and an instruction of that many numbers."""
    return spaces.Dict(
        {
            "rgbd": spaces.Box(0, 255, (height, width, 4), np.uint8),
            "gps": spaces.Box(-_REACH, _REACH, (2,), np.float32),
            "heading": spaces.Box(-1.0, 1.0, (2,), np.float32),
            "instruction": spaces.Box(-1.0, 1.0, (words,), np.float32),
        }
    )


def view(observation: Observation, words: npt.NDArray[np.float32], width: int, height: int) -> Observation:
    """The environment's observation as a policy sees it.

    Returns
    -------
    dict
        ``rgbd`` (height, width, 4) uint8: colour, and depth of which 10 m is 255 and nothing 0; ``gps`` (2,) as it is; ``heading``
        (2,): cosine and sine of the compass; ``instruction``: the words.
    """
    rgb, depth = observation["rgb"], observation["depth"][..., 0]
    if rgb.shape[:2] != (height, width):
        rgb = cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA)
        depth = cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST)
    far = np.round(np.clip(depth / FARTHEST, 0.0, 1.0) * 255.0).astype(np.uint8)
    turned = float(observation["compass"][0])
    return {
        "rgbd": np.concatenate([rgb, far[..., None]], axis=2),
        "gps": observation["gps"],
        "heading": np.array([math.cos(turned), math.sin(turned)], np.float32),
        "instruction": words,
    }


class LearnersView(gym.ObservationWrapper[Observation, int, Observation], RecordConstructorArgs):
    """Gives ``view`` of each observation; goes around ``EmbedInstruction``."""

    def __init__(self, env: gym.Env[Observation, int]) -> None:
        RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        inner = env.observation_space
        needed = ("rgb", "depth", "gps", "compass", "instruction_embedding")
        if not isinstance(inner, spaces.Dict) or not set(needed) <= set(inner.spaces):
            raise ValueError(f"observation space is {inner}, expected a Dict with {', '.join(needed)}")
        rgb, words = inner["rgb"].shape or (), inner["instruction_embedding"].shape or ()
        self._height, self._width = rgb[:2]
        self.observation_space = view_space(self._width, self._height, words[0])

    def observation(self, observation: Observation) -> Observation:
        """What the policy sees."""
        return view(observation, observation["instruction_embedding"], self._width, self._height)
