"""What an agent is: it is told how an episode begins, sees, acts, and says where the thing is that it was asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Observation = dict[str, Any]


@dataclass(frozen=True)
class Answer:
    """Where the thing is, best guess first.

    Parameters
    ----------
    positions : (k, 3) float32 m, episode frame
        Centres of the instances meant, ranked; k may be 0.
    labels : list of str
        What the agent would call each of them, for people to read.
    trace : dict
        How the answer came about; plain JSON.
    """

    positions: npt.NDArray[np.float32]
    labels: list[str] = field(default_factory=list)
    trace: dict[str, Any] = field(default_factory=dict)


class Agent(Protocol):
    """A policy over the environment's ``Discrete`` actions, with a declared answer.

    The runner calls ``reset`` once an episode, then ``act`` until it returns STOP (0) or the episode ends, and asks for ``answer``
    just before it plays STOP. What an agent has learned may outlive an episode only while ``info["episode_frame"]`` stays the
    same: that token names a scene together with an episode frame.
    """

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """An episode begins; ``observation["instruction"]`` says what is wanted."""
        ...

    def act(self, observation: Observation) -> int:
        """The next action."""
        ...

    def answer(self) -> Answer | None:
        """The ranked answer to the episode's instruction; None = it is where the agent stands."""
        ...
