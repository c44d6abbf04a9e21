"""Some environments of a batch, stepped one after the other, in this process or in one of their own.

What they see is written into arrays that the whole batch shares, a block for each key of the observation. ``serve`` is the main
function of a worker process: it does what comes through a pipe until the pipe's other end is closed.
"""

from __future__ import annotations

import mmap
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

Arrays = dict[str, npt.NDArray[Any]]
WHOLE = "observation"
"""Name of the one leaf of an observation that is no Dict."""
_ARRAYS = (spaces.Box, spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary)
_ALIGNMENT = 64


def leaves(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """The parts of an observation by name: those of a Dict, or the whole of anything else."""
    return dict(space.spaces) if isinstance(space, spaces.Dict) else {WHOLE: space}


class Layout:
    """Where the batch of each leaf that is an array lies in one stretch of memory; other leaves, texts say, have no place there.

    Parameters
    ----------
    space : Space
        Of one environment's observation.
    n : int
        Environments in the batch.
    """

    def __init__(self, space: spaces.Space[Any], n: int) -> None:
        self._blocks: dict[str, tuple[int, tuple[int, ...], np.dtype[Any]]] = {}
        self.size = 0
        for name, leaf in leaves(space).items():
            if isinstance(leaf, _ARRAYS) and leaf.shape is not None and leaf.dtype is not None:
                shape = (n, *leaf.shape)
                self._blocks[name] = (self.size, shape, leaf.dtype)
                self.size += -(-int(np.prod(shape)) * leaf.dtype.itemsize // _ALIGNMENT) * _ALIGNMENT

    @property
    def names(self) -> set[str]:
        """The leaves that have a block."""
        return set(self._blocks)

    def arrays(self, memory: mmap.mmap | bytearray) -> Arrays:
        """The blocks (n, ...) by name, as views of the memory."""
        return {
            name: np.frombuffer(memory, dtype, int(np.prod(shape)), offset).reshape(shape)
            for name, (offset, shape, dtype) in self._blocks.items()
        }


@dataclass
class Outcome:
    """What one environment answers to a reset or a step, but for what was written into the blocks.

    Parameters
    ----------
    rest : dict
        The leaves of the observation that have no block.
    infos : list of dict
        In the order in which Gymnasium puts them together.
    """

    rest: dict[str, Any]
    infos: list[dict[str, Any]]
    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False


@dataclass
class Share:
    """Environments ``first`` to ``first + len(envs) - 1`` of a batch.

    Parameters
    ----------
    envs : list of Env
    first : int
    blocks : dict
        The blocks of the whole batch.
    autoreset_mode : AutoresetMode
    """

    envs: list[gym.Env[Any, Any]]
    first: int
    blocks: Arrays
    autoreset_mode: AutoresetMode
    _over: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._over = [False] * len(self.envs)

    def reset(self, seeds: Sequence[int | None], options: Any, chosen: Sequence[bool]) -> list[Outcome | None]:
        """Reset the chosen environments; None for the others."""
        outcomes: list[Outcome | None] = []
        for i, (env, seed, wanted) in enumerate(zip(self.envs, seeds, chosen, strict=True)):
            if wanted:
                observation, info = env.reset(seed=seed, options=options)
                self._over[i] = False
                outcomes.append(Outcome(self._write(i, observation), [info]))
            else:
                outcomes.append(None)
        return outcomes

    def step(self, actions: Sequence[Any]) -> list[Outcome]:
        """One action for each environment; what is over begins anew as the mode says."""
        return [self._step(i, env, action) for i, (env, action) in enumerate(zip(self.envs, actions, strict=True))]

    def call(self, name: str, chosen: Sequence[int], args: Sequence[Any], kwargs: dict[str, Any]) -> list[Any]:
        """Attribute ``name`` of the chosen environments, called if it can be; ``args`` has a tuple for each of them."""
        results = []
        for index, own in zip(chosen, args, strict=True):
            found = self.envs[index - self.first].get_wrapper_attr(name)
            results.append(found(*own, **kwargs) if callable(found) else found)
        return results

    def set_attr(self, name: str, values: Sequence[Any]) -> None:
        """Set an attribute of each environment."""
        for env, value in zip(self.envs, values, strict=True):
            env.set_wrapper_attr(name, value)

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()

    def _step(self, i: int, env: gym.Env[Any, Any], action: Any) -> Outcome:
        if self._over[i]:
            if self.autoreset_mode == AutoresetMode.DISABLED:
                raise RuntimeError(
                    f"episode of environment {self.first + i} is over; reset it with options['reset_mask']"
                )
            observation, info = env.reset()
            self._over[i] = False
            return Outcome(self._write(i, observation), [info])
        observation, reward, terminated, truncated, info = env.step(action)
        infos = [info]
        if (terminated or truncated) and self.autoreset_mode == AutoresetMode.SAME_STEP:
            final = {"final_obs": observation, "final_info": info}
            observation, info = env.reset()
            infos = [final, info]
        else:
            self._over[i] = terminated or truncated
        return Outcome(self._write(i, observation), infos, float(reward), bool(terminated), bool(truncated))

    def _write(self, i: int, observation: Any) -> dict[str, Any]:
        parts = observation if isinstance(observation, dict) else {WHOLE: observation}
        for name, block in self.blocks.items():
            np.copyto(block[self.first + i, ...], parts[name])
        return {name: value for name, value in parts.items() if name not in self.blocks}


@dataclass(frozen=True)
class Assignment:
    """What a worker process is told first.

    Parameters
    ----------
    make : callable
        Makes one environment.
    first, count : int
        Its share of the batch.
    n : int
        Size of the batch.
    memory : int
        File descriptor of the blocks' memory.
    autoreset_mode : AutoresetMode
    """

    make: Callable[[], gym.Env[Any, Any]]
    first: int
    count: int
    n: int
    memory: int
    autoreset_mode: AutoresetMode

    def begin(self) -> tuple[Share, tuple[spaces.Space[Any], spaces.Space[Any]]]:
        """The environments, and the spaces of one's observation and action."""
        envs = [self.make() for _ in range(self.count)]
        layout = Layout(envs[0].observation_space, self.n)
        blocks = layout.arrays(mmap.mmap(self.memory, layout.size)) if layout.size else {}
        os.close(self.memory)
        return Share(envs, self.first, blocks, self.autoreset_mode), (envs[0].observation_space, envs[0].action_space)


def serve(descriptor: int) -> None:
    """Serve one share of a batch over the pipe with that file descriptor, until its other end is closed.

    The first message is an ``Assignment``, the others are (name of a method of ``Share``, arguments). Every message has one
    answer: (True, result), or (False, (error, its traceback)).
    """
    # An interrupt from the keyboard goes to all processes of a terminal; the one that made this one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pipe = Connection(descriptor)
    share: Share | None = None
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            message = pipe.recv_bytes()
            try:
                content = pickle.loads(message)
                if share is None:
                    share, result = content.begin()
                else:
                    result = getattr(share, content[0])(*content[1])
                answer = pickle.dumps((True, result), pickle.HIGHEST_PROTOCOL)
            except Exception as error:
                answer = pickle.dumps((False, (_portable(error), traceback.format_exc())))
            pipe.send_bytes(answer)
    if share is not None:
        share.close()


def _portable(error: Exception) -> Exception:
    """The error if it can be sent to another process and back, else one that says the same."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
