"""Runs an agent over episodes: the loop that every figure comes from.

``retrieval``: all instructions of a scene share one start. The agent first walks until it stops by itself or its budget is
spent, then answers every instruction from the map it has. ``navigation``: every episode by itself, from its own start.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

import gymnasium as gym
import numpy as np

from openmap_agents import make_agent
from openmap_agents.agent import Agent, Answer, Observation
from openmap_agents.perception import resolve
from openmap_env.env import OpenMapNavEnv
from openmap_env.episodes import Episode
from openmap_env.episodes.benchmark import NAME, frozen_home
from openmap_env.episodes.source import BENCHMARK, evenly
from openmap_eval.attribution import Attribution
from openmap_eval.records import EpisodeRecord, RecordFile, write_json
from openmap_eval.summary import summarise
from openmap_scenes import DataError

STOP = 0
ANSWERS_KEPT = 16


@dataclass(frozen=True)
class EvalSettings:
    """What an evaluation's figures depend on, beside its scenes and episodes; written beside them (``described``).

    ``perception`` is the spec of both segmenter and encoder, which override it (``openmap_agents.perception``).
    """

    agent: str = "openmap"
    perception: str = "embedded"
    segmenter: str | None = None
    encoder: str | None = None
    llm: str = "builtin"
    protocol: Literal["retrieval", "navigation"] = "retrieval"
    stop_confidence: float = 0.0
    seed: int = 0
    renderer: str = "auto"
    width: int = 640
    height: int = 480
    max_steps: int = 2000


def described(settings: EvalSettings) -> dict[str, Any]:
    """Settings as they are written: which segmenter and which encoder, however that was said.

    Raises
    ------
    ValueError
        One of their specs is none; DataError for a path where nothing is.
    """
    segmenter, encoder = resolve(settings.perception, settings.segmenter, settings.encoder)
    perception = segmenter if segmenter == encoder else f"{segmenter} + {encoder}"
    return {**asdict(settings), "perception": perception, "segmenter": segmenter, "encoder": encoder}


@dataclass(frozen=True)
class SceneTask:
    """A scene and what is asked in it: a number of episodes, a file or folder to read, or the episodes themselves.

    A number takes that many of the benchmark's frozen episodes, evenly over their kinds; of a scene that is no home of the
    benchmark, that many are generated.
    """

    scene: str
    episodes: int | Path | Sequence[Episode]


StepObserver = Callable[[OpenMapNavEnv, Agent, Observation], None]
"""Called after every decision of a walk with the observation that it was made from, for videos and pictures."""

SceneObserver = Callable[[OpenMapNavEnv, Agent, str], None]
"""Called when a scene's episodes are done and its environment is still open."""

Progress = Callable[[str, int, int], None]
"""Called with what is going on, how far it is and how far it may go."""


def evaluate(
    tasks: Sequence[SceneTask],
    settings: EvalSettings,
    out: Path,
    *,
    on_step: StepObserver | None = None,
    on_scene_end: SceneObserver | None = None,
    on_progress: Progress | None = None,
    attribution: bool = True,
) -> dict[str, Any]:
    """Run all episodes that ``out/episodes.jsonl`` does not have yet, and write ``out/summary.json``.

    With ``attribution`` the record of an episode that failed says which stage lost the target (``attribution.py``).
    Returns the summary (see ``summarise``) with the settings.

    Raises
    ------
    DataError
        ``out`` holds an evaluation with other settings, or a file that the settings name cannot be used.
    ValueError
        A setting cannot be used; specs are looked at before anything is loaded.
    """
    if not 0.0 <= settings.stop_confidence <= 1.0:
        raise ValueError(f"stop_confidence is {settings.stop_confidence}, expected 0 to 1")
    asked = described(settings)
    out.mkdir(parents=True, exist_ok=True)
    records = RecordFile(out / "episodes.jsonl")
    _claim(out, asked, tasks, fresh=not records.records)
    for task in tasks:
        env = make_env(task, settings)
        try:
            agent, episodes = _enter(env, task, settings)
            open_episodes = [e for e in episodes if (task.scene, e.episode_id) not in records.done]
            if not open_episodes:
                continue
            witness = Attribution() if attribution else None
            for record in run_scene(env, agent, open_episodes, episodes[0], settings, on_step, on_progress, witness):
                records.append(record)
            if on_scene_end:
                on_scene_end(_bare(env), agent, task.scene)
        finally:
            env.close()
    summary = {"settings": asked, **summarise(records.records, settings.seed)}
    write_json(out / "summary.json", summary)
    return summary


def _claim(out: Path, settings: dict[str, Any], tasks: Sequence[SceneTask], fresh: bool) -> None:
    """Write what is run into a new folder; refuse a folder whose records come from something else."""
    path = out / "settings.json"
    asked = {**settings, "tasks": [[task.scene, _described(task)] for task in tasks]}
    if fresh or not path.exists():
        write_json(path, asked)
        return
    found = json.loads(path.read_text())
    different = {key: found.get(key) for key, value in asked.items() if found.get(key) != value}
    if different:
        raise DataError(path, f"an evaluation with {different}", "the settings of this run", "Give another --out.")


def _described(task: SceneTask) -> int | str:
    """The episodes as they are asked for: how many (of which), or a digest of which."""
    episodes = task.episodes
    if isinstance(episodes, int):
        home = frozen_home(task.scene)
        return episodes if home is None else f"{episodes} of {NAME} {home.digest()}"
    if isinstance(episodes, Path):
        files = sorted(p for p in episodes.rglob("*") if p.is_file()) if episodes.is_dir() else [episodes]
        return hashlib.sha256(b"".join(p.read_bytes() for p in files if p.is_file())).hexdigest()[:16]
    return hashlib.sha256(repr(list(episodes)).encode()).hexdigest()[:16]


def make_env(task: SceneTask, settings: EvalSettings) -> gym.Env[Any, Any]:
    """The environment of a scene, as an evaluation uses it."""
    how_many = task.episodes if isinstance(task.episodes, int) else None
    return gym.make(
        "OpenMapNav-v0",
        scene=task.scene,
        episodes=BENCHMARK if how_many is not None else task.episodes,
        episodes_per_scene=how_many or 1,
        episode_seed=settings.seed,
        width=settings.width,
        height=settings.height,
        renderer=settings.renderer,
        protocol=settings.protocol,
        max_steps=settings.max_steps,
        disable_env_checker=True,
    )


def _bare(env: gym.Env[Any, Any]) -> OpenMapNavEnv:
    return cast(OpenMapNavEnv, env.unwrapped)


def _enter(env: gym.Env[Any, Any], task: SceneTask, settings: EvalSettings) -> tuple[Agent, list[Episode]]:
    """Load the scene; the agent for it and all of the task's episodes."""
    env.reset(seed=settings.seed)
    agent_settings = None
    if settings.stop_confidence > 0:
        from openmap_agents.openmap_agent import OpenMapAgentSettings
        from openmap_agents.stopping import StopSettings

        agent_settings = OpenMapAgentSettings(stop=StopSettings(confidence=settings.stop_confidence))
    agent = make_agent(
        settings.agent,
        env,
        perception=settings.perception,
        segmenter=settings.segmenter,
        encoder=settings.encoder,
        llm=settings.llm,
        protocol=settings.protocol,
        seed=settings.seed,
        settings=agent_settings,
    )
    episodes = _bare(env).episodes
    return agent, evenly(episodes, task.episodes) if isinstance(task.episodes, int) else episodes


def run_scene(
    env: gym.Env[Any, Any],
    agent: Agent,
    episodes: Sequence[Episode],
    first: Episode,
    settings: EvalSettings,
    on_step: StepObserver | None = None,
    on_progress: Progress | None = None,
    witness: Attribution | None = None,
) -> Iterator[EpisodeRecord]:
    """Yield the record of each episode of a scene, which the environment has entered.

    ``first`` gives the start that all episodes share in the retrieval protocol, also when an evaluation is resumed.
    """
    shared_start = (first.start_position, first.start_heading) if settings.protocol == "retrieval" else None
    walking: list[StepObserver] = [o for o in (witness, on_step) if o is not None]
    # Where the walk is over there is nothing left to film; what an agent still sees by then counts as seen.
    asking = walking if shared_start is None else walking[: witness is not None]
    if shared_start is not None:
        _play(env, agent, first, shared_start, settings, walking, on_progress, asks=False)
    for number, episode in enumerate(episodes, start=1):
        started = time.perf_counter()
        info, answer = _play(env, agent, episode, shared_start, settings, asking)
        seconds = time.perf_counter() - started
        if on_progress:
            on_progress("answering", number, len(episodes))
        bare = _bare(env)
        record = _record(bare, episode, info["metrics"], answer, seconds)
        lost = witness.lost_at(bare, agent, info["metrics"], answer) if witness else None
        yield replace(record, lost_at=lost[0], evidence=lost[1]) if lost else record


def _play(
    env: gym.Env[Any, Any],
    agent: Agent,
    episode: Episode,
    start: tuple[tuple[float, float, float], float] | None,
    settings: EvalSettings,
    observers: Sequence[StepObserver],
    on_progress: Progress | None = None,
    asks: bool = True,
) -> tuple[dict[str, Any], Answer | None]:
    """One episode from reset to its end; the last info and the agent's answer, unless nothing is asked yet."""
    options: dict[str, Any] = {"episode": episode}
    if start is not None:
        options["start"] = start
    observation, info = env.reset(seed=settings.seed, options=options)
    agent.reset(observation, info)
    over, steps, answer = False, 0, None
    while not over:
        action = agent.act(observation)
        for observer in observers:
            observer(_bare(env), agent, observation)
        if action == STOP and asks:
            answer = agent.answer()
            if answer is not None:
                _bare(env).declare(answer.positions)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
        steps += 1
        if on_progress:
            on_progress("exploring", steps, settings.max_steps)
    return info, answer


def _record(
    env: OpenMapNavEnv, episode: Episode, metrics: dict[str, float], answer: Answer | None, seconds: float
) -> EpisodeRecord:
    T_episode_world = np.linalg.inv(env.T_world_episode)
    kept = (
        []
        if answer is None
        else list(zip(answer.positions[:ANSWERS_KEPT].tolist(), answer.labels[:ANSWERS_KEPT], strict=False))
    )
    names = {i.id: i.category for i in env.simulator.scene.instances}
    return EpisodeRecord(
        episode_id=episode.episode_id,
        scene=episode.scene,
        instruction=episode.instruction,
        kind=episode.kind,
        metrics={name: float(value) if math.isfinite(value) else None for name, value in metrics.items()},
        seconds=round(seconds, 3),
        answer=[{"position": [round(x, 3) for x in position], "label": label} for position, label in kept],
        targets=[
            {
                "centre": [
                    round(float(x), 3) for x in T_episode_world[:3, :3] @ np.asarray(t.centre) + T_episode_world[:3, 3]
                ],
                "category": names.get(t.instance_id, "place"),
            }
            for t in env.episode.targets
        ],
        trace={} if answer is None else answer.trace,
    )
