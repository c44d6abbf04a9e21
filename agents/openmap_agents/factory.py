"""Agents by name, put together for an environment. Their modules are imported when asked for, because torch takes seconds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import gymnasium as gym
import numpy as np

from openmap_agents.agent import Agent
from openmap_agents.perception import is_oracle, make_perception, resolve

if TYPE_CHECKING:
    from openmap_agents.baselines.oracle_map import OracleMapAgent
    from openmap_agents.openmap_agent import OpenMapAgent, OpenMapAgentSettings
    from openmap_env.env import OpenMapNavEnv

AGENTS = ("openmap", "random", "stand_still", "oracle", "oracle_map")
LEARNED = "ppo:"
"""Before the path of a policy that ``openmap_agents.training`` wrote."""


def make_agent(
    name: str,
    env: gym.Env[Any, Any],
    *,
    perception: str = "embedded",
    segmenter: str | None = None,
    encoder: str | None = None,
    llm: str = "builtin",
    protocol: Literal["retrieval", "navigation"] = "retrieval",
    seed: int = 0,
    settings: OpenMapAgentSettings | None = None,
) -> Agent:
    """An agent for an environment that has been reset once, so that its scene, body and camera are known.

    Parameters
    ----------
    name : {"openmap", "random", "stand_still", "oracle", "oracle_map"} or "ppo:<policy.safetensors>"
        oracle knows the targets; oracle_map knows all instances and what they are called, and grounds as openmap does.
    env : gym.Env
        An ``OpenMapNavEnv``, wrapped or not. The openmap agent takes the camera, the sizes of the actions and the step limit
        from it, and looks at nothing else of it unless the segmenter or the encoder is an oracle.
    perception, segmenter, encoder : str
        For openmap: ``openmap_agents.perception`` has the specs. The first is for both, the others override it. With an
        oracle the agent is for the scene at hand alone, and its figures are for analysis.
    llm : str
        For openmap and oracle_map: a spec for ``openmap_agents.grounding.make_llm``.
    protocol : {"retrieval", "navigation"}
        For openmap and oracle_map.
    seed : int
    settings : OpenMapAgentSettings or None
        For openmap; the environment's camera, action sizes and step limit, and ``protocol``, are put into them.

    Raises
    ------
    ValueError
        An argument is none of the above, or a file that one names cannot be used.
    """
    if name not in AGENTS and not name.startswith(LEARNED):
        raise ValueError(f"agent is {name!r}, expected one of {', '.join(AGENTS)}, or {LEARNED}<policy.safetensors>")
    if protocol not in ("retrieval", "navigation"):
        raise ValueError(f"protocol is {protocol!r}, expected retrieval or navigation")
    seeing = resolve(perception, segmenter, encoder)
    if name.startswith(LEARNED):
        from openmap_agents.training import load

        return load(name.removeprefix(LEARNED), seed)
    rng = np.random.default_rng(seed)
    if name == "openmap":
        return _openmap(_bare(env), seeing, llm, protocol, rng, settings)
    from openmap_agents.baselines import OracleAgent, RandomAgent, StandStillAgent

    if name == "oracle":
        return OracleAgent(_bare(env))
    if name == "oracle_map":
        return _oracle_map(_bare(env), llm, protocol)
    return RandomAgent(rng) if name == "random" else StandStillAgent()


def _bare(env: gym.Env[Any, Any]) -> OpenMapNavEnv:
    from openmap_env.env import OpenMapNavEnv

    bare = env.unwrapped
    if not isinstance(bare, OpenMapNavEnv):
        raise ValueError(f"env is a {type(bare).__name__}, expected an OpenMapNavEnv")
    return bare


def _oracle_map(env: OpenMapNavEnv, llm: str, protocol: Literal["retrieval", "navigation"]) -> OracleMapAgent:
    from openmap_agents.baselines.oracle_map import OracleMapAgent
    from openmap_agents.grounding import Grounder
    from openmap_agents.perception.text import TextEncoder

    encoder = TextEncoder()
    return OracleMapAgent(env, Grounder(llm, encoder=encoder), encoder, walks=protocol == "navigation")


def _openmap(
    env: OpenMapNavEnv,
    seeing: tuple[str, str],
    llm: str,
    protocol: Literal["retrieval", "navigation"],
    rng: np.random.Generator,
    settings: OpenMapAgentSettings | None,
) -> OpenMapAgent:
    from openmap_agents.grounding import Grounder
    from openmap_agents.openmap_agent import OpenMapAgent, OpenMapAgentSettings, with_budget

    simulator = env.simulator
    told: dict[str, Any] = {}
    if any(map(is_oracle, seeing)):
        # The simulator keeps the frame of its pose, so these are the ids of the very picture that the agent is given.
        told = {"semantic": lambda: env.simulator.observe().instance}
        told["categories"] = {i.id: i.category for i in simulator.scene.instances}
    segmenter, encoder = make_perception(*seeing, **told)
    settings = settings or OpenMapAgentSettings()
    walker = replace(
        settings.explorer.walker,
        forward=simulator.forward_step,
        turn_deg=math.degrees(simulator.turn),
        tilt_deg=math.degrees(simulator.look),
    )
    planner = replace(walker.planner, body_radius=simulator.body.radius)
    explorer = replace(settings.explorer, walker=replace(walker, planner=planner))
    settings = with_budget(replace(settings, protocol=protocol, explorer=explorer), env.max_steps)
    return OpenMapAgent(env.camera, segmenter, encoder, Grounder(llm, encoder=encoder), settings, rng, seeing)
