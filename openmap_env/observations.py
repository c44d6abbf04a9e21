"""The observation space of the environment, and which texts it can hold."""

from __future__ import annotations

import math
import string
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from openmap_env.text_space import InstructionSpace
from openmap_scenes import PinholeCamera

Sensor = Literal["rgb", "depth", "semantic"]
SENSORS: tuple[Sensor, ...] = ("rgb", "depth", "semantic")

FARTHEST = 1000.0
"""Bound of depths and positions in the observation space, m."""
MAX_INSTRUCTION = 2000
CHARACTERS = (
    string.printable[:95]
    + "".join(chr(c) for c in range(0xA0, 0x180))
    + "".join(chr(c) for c in range(0x370, 0x530) if chr(c).isprintable())
    + "‐‑‒–—‘’‚“”„…•′″€"
)
"""What instructions are written with: ASCII, Latin with accents, Greek, Cyrillic, typographic punctuation."""


def observation_space(camera: PinholeCamera, sensors: Sequence[Sensor]) -> spaces.Dict:
    """The flat Dict space of an environment with that camera and those pictures."""
    size = (camera.height, camera.width)
    pictures: dict[str, spaces.Space[Any]] = {
        "rgb": spaces.Box(0, 255, (*size, 3), np.uint8),
        "depth": spaces.Box(0.0, FARTHEST, (*size, 1), np.float32),
        "semantic": spaces.Box(0, np.iinfo(np.int32).max, (*size, 1), np.int32),
    }
    return spaces.Dict(
        {
            **{name: pictures[name] for name in sensors},
            "T_episode_camera": spaces.Box(-FARTHEST, FARTHEST, (4, 4), np.float32),
            "gps": spaces.Box(-FARTHEST, FARTHEST, (2,), np.float32),
            "compass": spaces.Box(-math.pi, math.pi, (1,), np.float32),
            "instruction": InstructionSpace(MAX_INSTRUCTION, charset=CHARACTERS),
        }
    )


def check_instruction(instruction: Any) -> None:
    """Raise ValueError, naming what is wrong, if a text cannot be an instruction."""
    if not isinstance(instruction, str) or not 1 <= len(instruction) <= MAX_INSTRUCTION:
        raise ValueError(
            f"instruction is {str(instruction)[:80]!r}, expected a text of 1 to {MAX_INSTRUCTION} characters"
        )
    strange = sorted(set(instruction) - set(CHARACTERS))
    if strange:
        raise ValueError(
            f"instruction {instruction[:80]!r} has the characters {strange[:5]}, expected Latin, Greek or Cyrillic "
            "letters, digits and punctuation on one line; replace them"
        )
