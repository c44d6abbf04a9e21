"""What an agent is told: the observation space, which texts it can hold, and the frame in which poses are given."""

from __future__ import annotations

import hashlib
import math
import string
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
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


class EpisodeFrame:
    """Where an episode began: the frame of all that its agent sees and answers.

    Parameters
    ----------
    T_world_episode : (4, 4) float64
        The body's pose at the start: origin on the floor, -z forward, y up.
    heading : float
        Radians, of the same pose.
    """

    def __init__(self, T_world_episode: npt.NDArray[np.float64], heading: float) -> None:
        self.T_world_episode, self.heading = T_world_episode, heading
        R, t = T_world_episode[:3, :3], T_world_episode[:3, 3]
        self._T_episode_world = np.eye(4)
        self._T_episode_world[:3, :3], self._T_episode_world[:3, 3] = R.T, -R.T @ t

    def token(self, scene: str) -> str:
        """An opaque name of this frame in a scene."""
        pose = [*self.T_world_episode[:3, 3].tolist(), self.heading]
        return hashlib.sha256(f"{scene} {pose!r}".encode()).hexdigest()[:16]

    def to_world(self, places: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """World positions (k, 3) m of places (k, 3) m in this frame."""
        return np.asarray(places @ self.T_world_episode[:3, :3].T + self.T_world_episode[:3, 3], np.float64)

    def pose(self, T_world_camera: npt.NDArray[np.float64], heading: float) -> dict[str, npt.NDArray[np.float32]]:
        """``T_episode_camera``, ``gps`` and ``compass`` of a camera (4, 4) right above a body with a heading in radians."""
        T_episode_camera = self._T_episode_world @ T_world_camera
        return {
            "T_episode_camera": T_episode_camera.astype(np.float32),
            "gps": np.array([-T_episode_camera[2, 3], T_episode_camera[0, 3]], np.float32),
            "compass": np.array([math.remainder(heading - self.heading, math.tau)], np.float32),
        }


def check_instruction(instruction: Any, name: str = "instruction") -> None:
    """Raise ValueError, naming what is wrong, if a text cannot be an instruction."""
    if not isinstance(instruction, str) or not 1 <= len(instruction) <= MAX_INSTRUCTION or instruction.isspace():
        found = repr(instruction[:80] if isinstance(instruction, str) else instruction)
        raise ValueError(f"{name} is {found}, expected a text of 1 to {MAX_INSTRUCTION} characters")
    strange = sorted(set(instruction) - set(CHARACTERS))
    if strange:
        raise ValueError(
            f"{name} {instruction[:80]!r} has the characters {strange[:5]}, expected Latin, Greek or Cyrillic "
            "letters, digits and punctuation on one line; replace them"
        )


def check_places(positions: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Declared places as (k, 3) float64 m, k may be 0; ValueError, naming what is wrong, if they are not."""
    try:
        with np.errstate(over="ignore"):
            places = np.asarray(positions, np.float32).astype(np.float64)
    except (TypeError, ValueError):
        places = np.full(1, np.nan)
    if places.size == 0:
        places = places.reshape(0, 3)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        found = " ".join(repr(positions).split())
        raise ValueError(
            f"declared places are {found[:120]}, expected finite numbers of shape (k, 3), m in the episode frame"
        )
    return places
