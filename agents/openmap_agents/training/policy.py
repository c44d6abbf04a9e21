"""Learned policies as files, and as agents. A file is safetensors: weights, optimiser state, and settings as JSON; no pickle."""

from __future__ import annotations

import json
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from openmap_agents.agent import Answer, Observation
from openmap_agents.training.view import view, view_space
from openmap_env.actions import Action
from openmap_env.embedding import EMBEDDINGS
from openmap_scenes import DataError

if TYPE_CHECKING:
    import torch

_FORMAT = "openmap-policy-1"
_KINDS = {"width": int, "height": int, "embedding": str, "steps": int, "settings": dict}
_MOST_PIXELS = 4096 * 4096


@dataclass(frozen=True)
class Saved:
    """What a file holds.

    Parameters
    ----------
    width, height : int
        Of the pictures that the policy sees, px.
    embedding : str
        Name of the instruction's embedding.
    steps : int
        How many it was trained.
    settings : dict
        Of its training; plain JSON.
    weights : dict
        Of the policy, by stable-baselines3's names.
    optimiser : dict
        ``"<number of the parameter>.<name>"`` to tensor.
    """

    width: int
    height: int
    embedding: str
    steps: int
    settings: dict[str, Any]
    weights: dict[str, torch.Tensor]
    optimiser: dict[str, torch.Tensor]


def stable_baselines() -> Any:
    """The module ``stable_baselines3``; RuntimeError, saying how to get it, where there is none."""
    try:
        import stable_baselines3
    except ImportError as error:
        raise RuntimeError(
            "learned policies need stable-baselines3, which is not installed: pip install 'openmap-nav[train]'"
        ) from error
    return stable_baselines3


def write(path: Path, saved: Saved) -> None:
    """Write a file, whole or not at all."""
    from safetensors.torch import save_file

    about = {"format": _FORMAT, **{name: getattr(saved, name) for name in _KINDS}}
    tensors = {f"weights.{name}": tensor for name, tensor in saved.weights.items()}
    tensors |= {f"optimiser.{name}": tensor for name, tensor in saved.optimiser.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        # Parts that a policy has under two names are written twice: the format does not know shared memory.
        save_file(
            {n: t.detach().clone().contiguous() for n, t in tensors.items()}, unfinished, {"about": json.dumps(about)}
        )
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def read(path: str | Path) -> Saved:
    """Read a file.

    Raises
    ------
    openmap_scenes.DataError
        It is not there, or no policy of ours.
    """
    from safetensors import SafetensorError, safe_open

    expected, remedy = f"a policy in the format {_FORMAT}", "Give policy.safetensors of a training's folder."
    try:
        with safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {}).get("about", "null"))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - no mapping
    except OSError as error:
        raise DataError(path, f"no file that can be read ({error})", expected, remedy) from error
    except (SafetensorError, ValueError) as error:
        raise DataError(path, f"no safetensors file ({error})", expected, remedy) from error
    if not isinstance(about, dict) or about.get("format") != _FORMAT:
        raise DataError(path, "another kind of file", expected, remedy)
    for name, kind in _KINDS.items():
        if not isinstance(about.get(name), kind) or isinstance(about[name], bool):
            raise DataError(path, f"{name} = {about.get(name)!r}", f"{name} to be {kind.__name__}", remedy)
    if min(about["width"], about["height"]) < 1 or about["width"] * about["height"] > _MOST_PIXELS:
        raise DataError(path, f"pictures of {about['width']} x {about['height']} px", "a picture's size", remedy)
    if about["embedding"] not in EMBEDDINGS:
        raise DataError(path, f"embedding {about['embedding']!r}", f"one of {', '.join(EMBEDDINGS)}", remedy)
    parts: dict[str, Any] = {
        kind: {n.removeprefix(f"{kind}."): t for n, t in tensors.items() if n.startswith(f"{kind}.")}
        for kind in ("weights", "optimiser")
    }
    return Saved(**{name: about[name] for name in _KINDS}, **parts)


def rebuild(saved: Saved, source: str | Path) -> Any:
    """The stable-baselines3 policy that was saved.

    Raises
    ------
    openmap_scenes.DataError
        The weights are not those of such a policy.
    """
    stable_baselines()
    from gymnasium import spaces
    from stable_baselines3.common.policies import MultiInputActorCriticPolicy
    from stable_baselines3.common.vec_env import VecTransposeImage

    space = view_space(saved.width, saved.height, len(np.asarray(EMBEDDINGS[saved.embedding](""))))
    channels_first = {
        name: VecTransposeImage.transpose_space(part, name) if name == "rgbd" else part
        for name, part in space.spaces.items()
    }
    policy = MultiInputActorCriticPolicy(spaces.Dict(channels_first), spaces.Discrete(len(Action)), lambda _: 0.0)
    try:
        policy.load_state_dict(saved.weights)
    except RuntimeError as error:
        what = " ".join(str(error).split())[:300]
        raise DataError(source, what, f"the weights of a policy for {saved.width} x {saved.height} px") from error
    policy.set_training_mode(False)
    return policy


class PolicyAgent:
    """Plays a learned policy: draws its actions from what the policy gives, by episode and seed. Its answer is where it stands."""

    def __init__(self, policy: Any, saved: Saved, seed: int = 0) -> None:
        self._policy, self._saved, self._seed = policy, saved, seed
        self._words = np.zeros(0, np.float32)
        self._rng = np.random.default_rng(seed)

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """What is drawn depends on the episode alone, so that an evaluation that was resumed draws the same."""
        self._words = np.asarray(EMBEDDINGS[self._saved.embedding](observation["instruction"]), np.float32)
        self._rng = np.random.default_rng([self._seed, zlib.crc32(str(info["episode_id"]).encode())])

    def act(self, observation: Observation) -> int:
        """An action drawn from the policy's distribution."""
        import torch

        seen = view(observation, self._words, self._saved.width, self._saved.height)
        tensors, _ = self._policy.obs_to_tensor(seen)
        with torch.no_grad():
            chances = self._policy.get_distribution(tensors).distribution.probs[0].double().numpy()
        return int(self._rng.choice(len(chances), p=chances / chances.sum()))

    def answer(self) -> Answer | None:
        """Where it stands."""
        return None


def load(path: str | Path, seed: int = 0) -> PolicyAgent:
    """The agent of a file that a training wrote.

    Raises
    ------
    openmap_scenes.DataError
        The file cannot be used.
    RuntimeError
        stable-baselines3 is not installed.
    """
    saved = read(path)
    return PolicyAgent(rebuild(saved, path), saved, seed)
