"""Many environments at once: ``gym.make_vec("OpenMapNav-v0", num_envs=8)``, stepped by a few worker processes."""

from __future__ import annotations

import json
import mmap
import os
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from multiprocessing.connection import Connection, Pipe
from typing import Any, NoReturn

import cloudpickle  # type: ignore[import-untyped]
import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array, iterate

from openmap_env import ENV_ID
from openmap_env.settings import integer, refuse
from openmap_env.vector_worker import WHOLE, Assignment, Layout, Outcome, Share, leaves

Wrap = Callable[[gym.Env[Any, Any]], gym.Env[Any, Any]]
Batch = Any
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that are 1 in a worker: its share of the machine is one core."""
_MOST = 100_000
"""Environments of one batch."""
CLOSING = 5.0
"""Seconds that a worker has to end by itself."""
_CHILD = """import json, sys
sys.path[:] = json.loads(sys.argv[1])
from openmap_env.vector_worker import serve
serve(int(sys.argv[2]))"""


class OpenMapNavVectorEnv(VectorEnv[Batch, Any, npt.NDArray[Any]]):
    """A batch of ``OpenMapNav-v0``, equal step by step to Gymnasium's ``SyncVectorEnv`` of the same environments and seeds.

    Each worker process steps its share of the environments one after the other and writes what they see straight into memory that
    it shares with this process. Workers are new processes, not forks, since graphics contexts and threads do not survive a fork;
    they do not run the main module again, so a script needs no ``if __name__ == "__main__"``. Scenes in the cache are
    memory-mapped: workers share them. What was registered in this process alone (a reader of scenes, say) is unknown to workers;
    an entry of ``env_wrappers`` can do it there.

    Parameters
    ----------
    num_envs : int
    workers : int or None
        Processes; None = one for each core, at most ``num_envs``; 0 = none: all environments are stepped in this process.
    env_wrappers : sequence of callable
        Each environment is wrapped in these, first one innermost. (``gym.make_vec`` allows ``wrappers`` in its own two modes only.)
    autoreset_mode : AutoresetMode or str
        When an episode that is over gives way to the next: ``NextStep``, ``SameStep`` or ``Disabled``, as Gymnasium defines them.
    copy : bool
        Whether observations are copies; otherwise they show what the environments see until the next step overwrites it.
    **settings
        Of ``gym.make("OpenMapNav-v0", ...)``, the same for all environments; with a list of scenes each draws by its own seed.

    Raises
    ------
    ValueError
        A setting cannot be used.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        workers: int | None = None,
        env_wrappers: Sequence[Wrap] = (),
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        copy: bool = True,
        **settings: Any,
    ) -> None:
        num_envs = self.num_envs = integer("num_envs", num_envs, 1, _MOST)
        self.workers = min(num_envs, _cores() if workers is None else integer("workers", workers, 0, _MOST))
        self.autoreset_mode, self.copy = _mode(autoreset_mode), copy
        if not isinstance(env_wrappers, Sequence) or not all(map(callable, env_wrappers)):
            refuse("env_wrappers", env_wrappers, "a list of callables, each of which wraps an environment")
        self._owner = os.getpid()
        self._pipes: list[Connection] = []
        self._processes: list[subprocess.Popen[bytes]] = []
        self._here: Share | None = None
        make = partial(_make, settings, tuple(env_wrappers))
        probe = make()
        self.metadata = {**probe.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = probe.render_mode
        self.single_observation_space, self.single_action_space = probe.observation_space, probe.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        probe.close()
        layout = Layout(self.single_observation_space, num_envs)
        self._rest: dict[str, list[Any]] = {
            name: [None] * num_envs for name in leaves(self.single_observation_space) if name not in layout.names
        }
        if self.workers == 0:
            self._blocks = layout.arrays(bytearray(layout.size))
            self._here = Share([make() for _ in range(num_envs)], 0, self._blocks, self.autoreset_mode)
            self._slices = [slice(0, num_envs)]
            return
        borders = np.linspace(0, num_envs, self.workers + 1).astype(int).tolist()
        self._slices = [slice(a, b) for a, b in pairwise(borders)]
        try:
            self._blocks = self._start(make, layout)
        except BaseException:
            self.close(terminate=True)
            raise

    # Gymnasium's interface

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Batch, dict[str, Any]]:
        """Begin an episode in every environment, or in those of ``options["reset_mask"]`` (num_envs,) bool.

        Environment i gets ``seed + i``, or its own of a list; the other options go to every environment as they are.
        """
        seeds = self._seeds(seed)
        if not isinstance(options, Mapping | None):
            refuse("options", options, "None or a dict")
        rest = dict(options or {})
        chosen = self._mask(rest.pop("reset_mask", None))
        messages = [(seeds[s], rest if options is not None else None, chosen[s]) for s in self._slices]
        outcomes = [outcome for share in self._ask("reset", messages) for outcome in share]
        infos: dict[str, Any] = {}
        for i, outcome in enumerate(outcomes):
            if outcome is not None:
                infos = self._take(i, outcome, infos)
        return self._observation(), infos

    def step(self, actions: Any) -> tuple[Batch, Floats, Bools, Bools, dict[str, Any]]:
        """Play one action in every environment."""
        try:
            each = self._each("actions", list(iterate(self.action_space, actions)))
        except TypeError:
            refuse("actions", actions, f"a list with one for each of {self.num_envs} environments")
        # All are looked at before one is played, so that a wrong one leaves the batch as it is.
        for i, action in enumerate(each):
            if not self.single_action_space.contains(action):
                refuse(f"actions[{i}]", action, f"one of {self.single_action_space}")
        outcomes: list[Outcome] = [
            outcome for share in self._ask("step", [(each[s],) for s in self._slices]) for outcome in share
        ]
        infos: dict[str, Any] = {}
        for i, outcome in enumerate(outcomes):
            infos = self._take(i, outcome, infos)
        return (
            self._observation(),
            np.array([o.reward for o in outcomes], np.float64),
            np.array([o.terminated for o in outcomes], np.bool_),
            np.array([o.truncated for o in outcomes], np.bool_),
            infos,
        )

    def render(self) -> tuple[Any, ...] | None:
        """The picture of every environment."""
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of every environment, or get what is not callable; see ``call_on``."""
        return self.call_on(range(self.num_envs), name, *args, **kwargs)

    def call_on(self, indices: Sequence[int], name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of the environments with these numbers; their results in that order."""
        if not isinstance(indices, Sequence | np.ndarray):
            refuse("indices", indices, "a list of numbers of environments")
        chosen = [integer(f"indices[{k}]", i, 0, self.num_envs - 1) for k, i in enumerate(indices)]
        return self._call(chosen, name, [args] * len(chosen), kwargs)

    def declare(self, positions: Sequence[npt.ArrayLike | None]) -> None:
        """Declare places (k, 3) m in the episode frame, one array for each environment; None declares nothing there.

        An environment whose episode is over cannot be told anything: give it None.
        """
        told = {i: (p,) for i, p in enumerate(self._each("declarations", positions)) if p is not None}
        self._call(list(told), "declare", list(told.values()), {})

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every environment."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of every environment: a list or tuple has a value for each, anything else is for all."""
        each = self._each(f"values of {name}", values) if isinstance(values, list | tuple) else [values] * self.num_envs
        self._ask("set_attr", [(name, each[s]) for s in self._slices])

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of every environment."""
        return self.get_attr("np_random_seed")

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generator of every environment; copies, if there are workers."""
        return self.get_attr("np_random")

    def close_extras(self, timeout: float = CLOSING, terminate: bool = False) -> None:
        """End the workers: they have ``timeout`` seconds for it, or none with ``terminate``; then they are killed."""
        if self._here is not None:
            self._here.close()
        for pipe in self._pipes:
            pipe.close()
        deadline = time.monotonic() + (0.0 if terminate else timeout)
        for process in self._processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(deadline - time.monotonic(), 0.0))
            if process.returncode is None:
                process.kill()
                process.wait()

    def __getstate__(self) -> NoReturn:
        # A copy would hold the same pipes, and close them.
        raise TypeError(
            f"a {type(self).__name__} cannot be copied or pickled, since it has processes of its own; make another with the same "
            "arguments"
        )

    def __del__(self) -> None:
        # A fork of this process has no workers of its own to end.
        if not self.closed and getattr(self, "_owner", None) == os.getpid() and hasattr(self, "_here"):
            self.close()

    # Workers

    def _start(self, make: Callable[[], gym.Env[Any, Any]], layout: Layout) -> dict[str, npt.NDArray[Any]]:
        """Start the workers, wait until all are ready, and give the blocks that they write into."""
        with _nameless_file() as memory:
            os.ftruncate(memory.fileno(), max(layout.size, 1))
            for share in self._slices:
                ours, theirs = Pipe()
                with theirs:
                    self._pipes.append(ours)
                    self._processes.append(_child(theirs.fileno(), memory.fileno()))
                count = share.stop - share.start
                told = Assignment(make, share.start, count, self.num_envs, memory.fileno(), self.autoreset_mode)
                with suppress(BrokenPipeError):
                    ours.send_bytes(cloudpickle.dumps(told))
            blocks = layout.arrays(mmap.mmap(memory.fileno(), layout.size)) if layout.size else {}
        for worker, found in enumerate(self._answers()):
            if found != (self.single_observation_space, self.single_action_space):
                raise RuntimeError(f"environments of worker {worker} have spaces {found}, expected those of the others")
        return blocks

    def _ask(self, command: str, messages: Sequence[tuple[Any, ...]]) -> list[Any]:
        """One message for each worker, all sent before the first answer is awaited; their answers."""
        if self.closed:
            raise ClosedEnvironmentError(f"{command} after close() of this {type(self).__name__}; make a new one")
        if self._here is not None:
            return [getattr(self._here, command)(*messages[0])]
        dumps = pickle.dumps if command == "step" else cloudpickle.dumps
        contents = [dumps((command, message)) for message in messages]
        try:
            for pipe, content in zip(self._pipes, contents, strict=True):
                # If a worker is gone, waiting for its answer says so.
                with suppress(BrokenPipeError):
                    pipe.send_bytes(content)
        except BaseException:
            self.close(terminate=True)
            raise
        return self._answers()

    def _answers(self) -> list[Any]:
        """The answer of each worker, all awaited before an error of one is raised, so that none is left in a pipe.

        Raises
        ------
        Exception
            The error that an environment raised, with the traceback in its worker as a note.
        RuntimeError
            A worker ended.
        """
        answers: list[tuple[bool, Any]] = []
        try:
            answers.extend(pipe.recv() for pipe in self._pipes)
        except (EOFError, ConnectionResetError):
            raise RuntimeError(self._lost(len(answers))) from None
        except BaseException:
            # Answers that nobody took would be taken for those to the next command.
            self.close(terminate=True)
            raise
        for worker, (succeeded, content) in enumerate(answers):
            if not succeeded:
                error, text = content
                error.add_note(f"in worker {worker} of the vector environment:\n{text}")
                raise error
        return [content for _, content in answers]

    def _lost(self, worker: int) -> str:
        """End the others and say what became of a worker that hung up."""
        process, share = self._processes[worker], self._slices[worker]
        with suppress(subprocess.TimeoutExpired):
            process.wait(CLOSING)
        self.close(terminate=True)
        status = process.returncode
        how = f"was killed by signal {-status}" if status < 0 else f"ended with status {status}"
        return (
            f"worker {worker} (environments {share.start} to {share.stop - 1}) {how}; found no answer, expected one. "
            "If its message is not above, look for a lack of memory. Make a new vector environment"
        )

    # What goes in and out

    def _call(self, chosen: list[int], name: str, args: list[Any], kwargs: dict[str, Any]) -> tuple[Any, ...]:
        where = [[k for k, i in enumerate(chosen) if s.start <= i < s.stop] for s in self._slices]
        messages = [(name, [chosen[k] for k in ks], [args[k] for k in ks], kwargs) for ks in where]
        results: list[Any] = [None] * len(chosen)
        for ks, found in zip(where, self._ask("call", messages), strict=True):
            for k, result in zip(ks, found, strict=True):
                results[k] = result
        return tuple(results)

    def _take(self, i: int, outcome: Outcome, infos: dict[str, Any]) -> dict[str, Any]:
        for name, value in outcome.rest.items():
            self._rest[name][i] = value
        for info in outcome.infos:
            infos = self._add_info(infos, info, i)
        return infos

    def _observation(self) -> Batch:
        spaces = leaves(self.single_observation_space)
        parts = {
            name: (self._blocks[name].copy() if self.copy else self._blocks[name])
            if name in self._blocks
            else concatenate(space, tuple(self._rest[name]), create_empty_array(space, self.num_envs))  # type: ignore[arg-type]
            for name, space in spaces.items()
        }
        return parts if isinstance(self.single_observation_space, gym.spaces.Dict) else parts[WHOLE]

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, Sequence | np.ndarray):
            each = self._each("seeds", seed)
            return [None if own is None else integer(f"seed[{i}]", own, 0) for i, own in enumerate(each)]
        first = integer("seed", seed, 0)
        return [first + i for i in range(self.num_envs)]

    def _each(self, name: str, values: Any) -> list[Any]:
        """A value for each environment; ValueError where there are more or fewer, or no list at all."""
        if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray):
            refuse(name, values, f"a list with one for each of {self.num_envs} environments")
        if len(values) != self.num_envs:
            raise ValueError(f"got {len(values)} {name}, expected one for each of {self.num_envs} environments")
        return list(values)

    def _mask(self, mask: Any) -> list[bool]:
        if mask is None:
            return [True] * self.num_envs
        if (
            not isinstance(mask, np.ndarray)
            or mask.dtype != np.bool_
            or mask.shape != (self.num_envs,)
            or not mask.any()
        ):
            raise ValueError(f"options['reset_mask'] is {mask!r}, expected ({self.num_envs},) bool, one at least True")
        return [bool(m) for m in mask]


def _mode(mode: Any) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        refuse("autoreset_mode", mode, f"one of {', '.join(mode.value for mode in AutoresetMode)}")


def _make(settings: dict[str, Any], wrappers: Sequence[Wrap]) -> gym.Env[Any, Any]:
    env: gym.Env[Any, Any] = gym.make(ENV_ID, **settings)
    for wrap in wrappers:
        env = wrap(env)
    return env


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _nameless_file() -> Any:
    """A file in memory that goes when nobody holds it, however its holders end, and that no limit of /dev/shm counts."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("openmap-observations"), "r+b")
    return tempfile.TemporaryFile()


def _child(pipe: int, memory: int) -> subprocess.Popen[bytes]:
    """A worker process that has these two file descriptors."""
    variables = {**os.environ, "LP_NUM_THREADS": "0", **dict.fromkeys(THREADS, "1")}
    command = [sys.executable, "-c", _CHILD, json.dumps(sys.path), str(pipe)]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=(pipe, memory), env=variables)
