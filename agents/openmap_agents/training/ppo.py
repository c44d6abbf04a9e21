"""Trains a policy by PPO (Schulman et al. 2017), with stable-baselines3's implementation, on the environment's own sparse reward.

    python -m openmap_agents.training.ppo --scene homes:train/0 homes:train/1 --out runs/ppo

Writes ``policy.safetensors`` (weights, optimiser state, settings; after every rollout that ``save_every`` asks for, and at the end)
and ``progress.jsonl``, a line for each rollout. The same command goes on where a run was stopped: with the weights, the optimiser
and the count of steps, in new episodes. ``openmap eval --agent ppo:runs/ppo/policy.safetensors`` scores what was learned.

The reward is success at STOP, less 0.001 a step, nothing on the way: expect far more than a million steps before it finds anything.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from openmap_agents.training.policy import Saved, read, stable_baselines, write
from openmap_env.settings import integer, number, refuse
from openmap_scenes import DataError

EMBEDDING = "hashed"


@dataclass(frozen=True)
class Args:
    """What to train, and how."""

    out: Path = Path("runs/ppo")
    """Folder for what it writes; a second call with it goes on."""
    scene: tuple[str, ...] = ("homes:train/0",)
    """Scenes of the catalogue, drawn anew for each episode."""
    steps: int = 1_000_000
    """Of all environments together."""
    envs: int = 8
    """Environments side by side."""
    workers: int | None = None
    """Processes that step them; none given = one for each core."""
    width: int = 64
    """Of what the policy sees, px, at least 36."""
    height: int = 64
    """Of what the policy sees, px, at least 36."""
    protocol: str = "navigation"
    """navigation or retrieval; decides what success is."""
    max_steps: int = 200
    """Budget of an episode."""
    renderer: str = "opengl"
    """opengl, pyrender or raycast."""
    rollout: int = 128
    """Steps of each environment between two updates."""
    minibatch: int = 256
    """Steps in one gradient."""
    epochs: int = 4
    """How often each step is used."""
    learning_rate: float = 2.5e-4
    gamma: float = 0.99
    """Discount."""
    gae_lambda: float = 0.95
    """Of the advantage estimate."""
    clip: float = 0.2
    """Range of the probability ratio."""
    entropy: float = 0.01
    """Weight of the entropy bonus."""
    torch_threads: int = 1
    """Of the updates."""
    save_every: int = 20_000
    """Steps between two checkpoints."""
    seed: int = 0


# These may differ when a training goes on.
_FREE = ("out", "steps", "workers", "save_every", "torch_threads")


# What the learner takes: least whole numbers, and what other numbers are at most, all of them above 0.
_AT_LEAST = {
    "steps": 1, "envs": 1, "width": 36, "height": 36, "rollout": 2, "minibatch": 2, "epochs": 1, "torch_threads": 1,
    "save_every": 1, "seed": 0,
}  # fmt: skip
_AT_MOST = {"learning_rate": 1.0, "gamma": 1.0, "gae_lambda": 1.0, "clip": 1e6}


def train(args: Args) -> Path:
    """Train, or go on training; the path of the policy.

    Raises
    ------
    ValueError
        The folder holds a training of other settings, or an argument cannot be used.
    openmap_scenes.DataError
        A scene or the checkpoint cannot be used.
    RuntimeError
        stable-baselines3 is not installed.
    """
    _check(args)
    ppo = stable_baselines().PPO
    import torch
    from stable_baselines3.common.vec_env import VecMonitor

    from openmap_agents.training.batch import StableBatch

    torch.set_num_threads(args.torch_threads)
    path = args.out / "policy.safetensors"
    before = _go_on(path, args) if path.exists() else None
    done = before.steps if before else 0
    if done >= args.steps:
        return path
    batch = VecMonitor(StableBatch(_environments(args)), info_keywords=())
    try:
        model = ppo(
            "MultiInputPolicy", batch, learning_rate=args.learning_rate, n_steps=args.rollout, batch_size=args.minibatch,
            n_epochs=args.epochs, gamma=args.gamma, gae_lambda=args.gae_lambda, clip_range=args.clip, ent_coef=args.entropy,
            seed=_seed(args, done), device="cpu",
        )  # fmt: skip
        if before is not None:
            _put_back(model, before)
        model.num_timesteps = done
        recorder = _recorder(args, path)
        model.learn(args.steps - done, callback=recorder, reset_num_timesteps=False)
        _save(model, args, path)
    finally:
        batch.close()
    return path


def _check(args: Args) -> None:
    """ValueError, naming the argument, where the learner could not use it; the environments check their own."""
    for name, low in _AT_LEAST.items():
        integer(name, getattr(args, name), low)
    if args.rollout * args.envs % args.minibatch == 1:
        refuse(
            "minibatch",
            args.minibatch,
            f"a number that leaves no rest of 1 in {args.rollout * args.envs} steps of a rollout",
        )
    for name, most in _AT_MOST.items():
        number(name, getattr(args, name), 0.0, most, "")
    if args.entropy != 0.0:
        number("entropy", args.entropy, 0.0, 1e6, "")


def _environments(args: Args) -> Any:
    from openmap_agents.training.view import LearnersView
    from openmap_env.vector import OpenMapNavVectorEnv
    from openmap_env.wrappers import EmbedInstruction

    return OpenMapNavVectorEnv(
        args.envs,
        workers=args.workers,
        env_wrappers=(EmbedInstruction, LearnersView),
        autoreset_mode="SameStep",
        scene=list(args.scene),
        width=args.width,
        height=args.height,
        protocol=args.protocol,
        max_steps=args.max_steps,
        renderer=args.renderer,
    )


def _recorder(args: Args, path: Path) -> Any:
    """A callback that writes a line of progress after each rollout, and now and then a checkpoint."""
    from stable_baselines3.common.callbacks import BaseCallback

    class Recorder(BaseCallback):  # type: ignore[misc]
        def _on_training_start(self) -> None:
            self.started, self.first = time.monotonic(), self.model.num_timesteps
            self.saved = self.first
            self.ended: list[dict[str, float]] = []
            self.lines = (args.out / "progress.jsonl").open("a", encoding="utf-8")

        def _on_step(self) -> bool:
            for info in self.locals["infos"]:
                if "metrics" in info:
                    self.ended.append({**info["metrics"], "return": float(info["episode"]["r"])})
            return True

        def _on_rollout_end(self) -> None:
            steps = self.model.num_timesteps
            means = {
                f"mean_{name}": _mean(self.ended, name)
                for name in ("return", "steps", "nav_success", "sr_1", "coverage")
            }
            speed = (steps - self.first) / (time.monotonic() - self.started)
            line = {"steps": steps, "episodes": len(self.ended), **means, "steps_per_second": round(speed, 1)}
            print(json.dumps(line), file=self.lines, flush=True)
            print(json.dumps(line), file=sys.stderr, flush=True)
            self.ended = []
            if steps - self.saved >= args.save_every:
                self.saved = steps
                _save(self.model, args, path)

        def _on_training_end(self) -> None:
            self.lines.close()

    args.out.mkdir(parents=True, exist_ok=True)
    return Recorder()


def _mean(episodes: list[dict[str, float]], name: str) -> float | None:
    found = [episode[name] for episode in episodes if name in episode]
    return round(float(np.mean(found)), 4) if found else None


def _save(model: Any, args: Args, path: Path) -> None:
    state = model.policy.optimizer.state_dict()["state"]
    optimiser = {f"{number}.{name}": tensor for number, parts in state.items() for name, tensor in parts.items()}
    write(
        path,
        Saved(
            args.width,
            args.height,
            EMBEDDING,
            int(model.num_timesteps),
            _plain(args),
            model.policy.state_dict(),
            optimiser,
        ),
    )


def _go_on(path: Path, args: Args) -> Saved:
    before = read(path)
    differing = [n for n, v in _plain(args).items() if n not in _FREE and before.settings.get(n) != v]
    if differing:
        was = ", ".join(f"{name} = {before.settings.get(name)!r}" for name in differing)
        raise ValueError(f"{path} was trained with {was}; give the same settings, or another --out")
    return before


def _put_back(model: Any, before: Saved) -> None:
    try:
        model.policy.load_state_dict(before.weights)
        state: dict[int, dict[str, Any]] = {}
        for name, tensor in before.optimiser.items():
            number, _, part = name.partition(".")
            state.setdefault(int(number), {})[part] = tensor
        groups = model.policy.optimizer.state_dict()["param_groups"]
        model.policy.optimizer.load_state_dict({"state": state, "param_groups": groups})
    except (RuntimeError, ValueError, KeyError) as error:
        raise DataError(
            "checkpoint", str(error)[:300], "weights of such a policy", "Train anew in another folder."
        ) from error


def _seed(args: Args, done: int) -> int:
    """Another one for each part of a training, so that it does not see the same episodes again."""
    return int(np.random.default_rng([args.seed, done]).integers(2**31))


def _plain(args: Args) -> dict[str, Any]:
    plain: dict[str, Any] = json.loads(json.dumps({**asdict(args), "out": ""}))
    return plain


def main() -> None:
    """The command."""
    try:
        print(train(tyro.cli(Args, description=__doc__)))
    except (ValueError, RuntimeError, OSError) as error:
        raise SystemExit(str(error)) from error
    except KeyboardInterrupt:
        raise SystemExit("stopped; the same command goes on from the last checkpoint") from None


if __name__ == "__main__":
    main()
