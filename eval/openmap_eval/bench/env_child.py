"""One way of stepping environments, in a process of its own: ``python -m openmap_eval.bench.env_child SETTINGS``, JSON in and out.

Settings: ``way`` (a name in ``WAYS``), ``scenes``, ``width``, ``height``, ``renderer``, ``steps`` (of each walk), ``walks``,
``switches``, ``seed``. Every way but ``leak`` makes the same walks: one environment makes them one after the other, batches
make them side by side.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import psutil

from openmap_env import ENV_ID

FORWARD_HEAVY = {1: 0.6, 2: 0.15, 3: 0.15, 4: 0.05, 5: 0.05}
"""How often each action is played; never STOP."""
WARM_UP = 10
Settings = dict[str, Any]


class Clock:
    """Seconds that a function of an object takes, all its calls together."""

    def __init__(self, owner: object, name: str) -> None:
        self.spent = 0.0
        function = getattr(owner, name)

        def timed(*args: Any, **kwargs: Any) -> Any:
            started = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self.spent += time.perf_counter() - started

        setattr(owner, name, timed)


def one(settings: Settings) -> dict[str, float]:
    """One environment, one walk after another; besides, what share of ``step`` is not spent in the renderer."""
    env = gym.make(ENV_ID, **_of_env(settings))
    wall = cpu = drawing = 0.0
    clock: Clock | None = None
    for walk, actions in enumerate(walks(settings)):
        env.reset(seed=settings["seed"] + walk)
        clock = clock or Clock(env.get_wrapper_attr("simulator").renderer, "render")
        for action in actions[:WARM_UP].tolist():
            env.step(action)
        started, cpu_started, drawn = time.perf_counter(), _cpu_seconds(), clock.spent
        for action in actions[WARM_UP:].tolist():
            env.step(action)
        wall += time.perf_counter() - started
        cpu += _cpu_seconds() - cpu_started
        drawing += clock.spent - drawn
    env.close()
    return {"wall": wall, "cpu": cpu, "not_rendering": 1.0 - drawing / wall}


def gymnasium_async(settings: Settings) -> dict[str, float]:
    """Gymnasium's ``AsyncVectorEnv`` with its defaults, two environments."""
    return _batch(gym.make_vec(ENV_ID, 2, vectorization_mode="async", **_of_env(settings)), settings)


def vector(settings: Settings) -> dict[str, float]:
    """Our vector environment, two environments in two workers."""
    return _batch(gym.make_vec(ENV_ID, 2, workers=2, **_of_env(settings)), settings)


def crowd(settings: Settings) -> dict[str, float]:
    """Our vector environment, one for each walk, all in two workers."""
    return _batch(gym.make_vec(ENV_ID, settings["walks"], workers=2, **_of_env(settings)), settings)


def leak(settings: Settings) -> dict[str, float]:
    """Resident memory before and after many frames in one scene, and before and after many changes of scene, MiB.

    First every scene is entered twice: what is made once for a process (compiled code, contexts, caches) is no leak. The last
    entry is the same scene as the one before the first change, and as much was drawn in it.
    """
    env = gym.make(ENV_ID, **_of_env(settings))
    scenes, rng = settings["scenes"], np.random.default_rng(settings["seed"])

    def walk(scene: str, steps: int) -> float:
        env.reset(seed=settings["seed"], options={"scene": scene})
        for action in _draw(rng, steps).tolist():
            env.step(action)
        return float(psutil.Process().memory_info().rss) / 2**20

    for scene in [*scenes, *scenes, scenes[0]]:
        walk(scene, 2 * WARM_UP)
    before_frames = walk(scenes[0], settings["steps"] // 10)
    after_frames = walk(scenes[0], settings["steps"])
    rounds = -(-settings["switches"] // len(scenes))
    for scene in (scenes * (rounds + 1))[1 : rounds * len(scenes) + 1]:
        after_switches = walk(scene, 2 * WARM_UP)
    env.close()
    return {
        "frames": settings["steps"],
        "rss_growth_over_frames_mib": after_frames - before_frames,
        "switches": rounds * len(scenes),
        "rss_growth_over_switches_mib": after_switches - after_frames,
        "rss_mib": after_switches,
    }


WAYS: dict[str, Callable[[Settings], dict[str, float]]] = {
    f.__name__: f for f in (one, gymnasium_async, vector, crowd, leak)
}


def walks(settings: Settings) -> list[npt.NDArray[np.int64]]:
    """The actions of each walk, warm-up first."""
    rngs = [np.random.default_rng([settings["seed"], walk]) for walk in range(settings["walks"])]
    return [_draw(rng, WARM_UP + settings["steps"]) for rng in rngs]


def _draw(rng: np.random.Generator, n: int) -> npt.NDArray[np.int64]:
    return rng.choice(list(FORWARD_HEAVY), n, p=list(FORWARD_HEAVY.values()))


def _batch(envs: gym.vector.VectorEnv[Any, Any, Any], settings: Settings) -> dict[str, float]:
    actions = np.stack(walks(settings), axis=1)
    wall = cpu = 0.0
    for first in range(0, settings["walks"], envs.num_envs):
        envs.reset(seed=settings["seed"] + first)
        turn = actions[:, first : first + envs.num_envs]
        for each in turn[:WARM_UP]:
            envs.step(each)
        started, cpu_started = time.perf_counter(), _cpu_seconds()
        for each in turn[WARM_UP:]:
            envs.step(each)
        wall += time.perf_counter() - started
        cpu += _cpu_seconds() - cpu_started
    figures = {"wall": wall, "cpu": cpu}
    children = [child.memory_full_info() for child in psutil.Process().children()]
    figures["worker_pss_mib"] = max(getattr(memory, "pss", float("nan")) for memory in children) / 2**20
    envs.close()
    return figures


def _of_env(settings: Settings) -> Settings:
    return {
        **{name: settings[name] for name in ("width", "height", "renderer")},
        "scene": settings["scenes"],
        "sensors": ("rgb", "depth", "semantic"),
        "max_steps": 10**9,
    }


def _cpu_seconds() -> float:
    """User and system time of this process and its workers so far."""
    workers = [process.cpu_times() for process in psutil.Process().children(recursive=True)]
    return time.process_time() + sum(float(times.user + times.system) for times in workers)


def main() -> None:
    settings: Settings = json.loads(sys.argv[1])
    print(json.dumps(WAYS[settings["way"]](settings)), flush=True)


if __name__ == "__main__":
    main()
