"""Our vector environment in the shape that stable-baselines3 takes, so that pictures come through shared memory there too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from openmap_env.vector import OpenMapNavVectorEnv


class StableBatch(VecEnv):  # type: ignore[misc]
    """A stable-baselines3 ``VecEnv`` over an ``OpenMapNavVectorEnv`` that resets within the step, which it then owns.

    ``infos[i]`` is empty but at the end of an episode, when it has ``terminal_observation``, ``TimeLimit.truncated`` and
    ``metrics``.
    """

    def __init__(self, envs: OpenMapNavVectorEnv) -> None:
        if envs.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode is {envs.autoreset_mode.value}, expected SameStep")
        self.envs = envs
        self._actions: Any = None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Any:
        seeds = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observation, _ = self.envs.reset(seed=seeds)
        self._reset_seeds()
        return observation

    def step_async(self, actions: npt.NDArray[np.integer]) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Any, npt.NDArray[np.float32], npt.NDArray[np.bool_], list[dict[str, Any]]]:
        observation, rewards, terminated, truncated, batch = self.envs.step(self._actions)
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(over).tolist():
            metrics = batch["final_info"]["metrics"]
            infos[i] = {
                "terminal_observation": batch["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
                "metrics": {name: float(metrics[name][i]) for name in metrics if not name.startswith("_")},
            }
        return observation, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return list(self.envs.call_on(self._chosen(indices), attr_name))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        chosen = set(self._chosen(indices))
        old = self.get_attr(attr_name) if len(chosen) < self.num_envs else [None] * self.num_envs
        self.envs.set_attr(attr_name, [value if i in chosen else kept for i, kept in enumerate(old)])

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        return list(self.envs.call_on(self._chosen(indices), method_name, *method_args, **method_kwargs))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._chosen(indices)]

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
