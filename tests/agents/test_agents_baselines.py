"""The agents that bound the others run through the environment, and the factory names what it cannot make."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import openmap_env  # noqa: F401 - registers the environment
from openmap_agents import make_agent
from openmap_agents.baselines import RandomAgent
from openmap_env.actions import Action
from openmap_env.episodes import Episode, Target


@pytest.fixture
def env(two_rooms, two_rooms_spec):
    instance = next(i for i in two_rooms.instances if i.category == "refrigerator")
    target = Target(instance.id, tuple(instance.centre), tuple(instance.aabb_min), tuple(instance.aabb_max))
    start = (-1.5, 0.0, -1.0)
    episode = Episode("e0", two_rooms_spec, "Go to the refrigerator.", "object_goal", start, 1.0, (target,))
    env = gym.make(
        "OpenMapNav-v0", scene=two_rooms_spec, episodes=[episode], width=40, height=30, renderer="raycast",
        max_steps=150,
    )  # fmt: skip
    env.reset(seed=0)
    yield env
    env.close()


def play(env, agent):
    observation, info = env.reset(options={"episode": 0})
    agent.reset(observation, info)
    actions, over = [], False
    while not over:
        actions.append(agent.act(observation))
        answer = agent.answer() if actions[-1] == Action.STOP else None
        if answer is not None:
            env.unwrapped.declare(answer.positions)
        observation, _, terminated, truncated, info = env.step(actions[-1])
        over = terminated or truncated
    return actions, info["metrics"]


def test_the_oracle_succeeds_by_every_measure(env):
    actions, metrics = play(env, make_agent("oracle", env))
    assert metrics["sr_1"] == 1.0
    assert metrics["nav_success"] == 1.0
    assert metrics["spl"] > 0.9
    assert actions[-1] == Action.STOP


def test_the_oracle_map_is_grounded_in_and_its_answer_is_in_the_episode_frame(env):
    agent = make_agent("oracle_map", env)
    actions, metrics = play(env, agent)
    assert actions == [Action.STOP]
    assert metrics["sr_1"] == 1.0
    assert metrics["nav_success"] == 0.0
    answer = agent.answer()
    assert answer.labels[0] == "refrigerator"
    T_world_episode = env.unwrapped.T_world_episode
    centre = T_world_episode[:3, :3] @ answer.positions[0] + T_world_episode[:3, 3]
    np.testing.assert_allclose(centre, env.unwrapped.episode.targets[0].centre, atol=1e-3)
    assert sorted(answer.trace["ranking"]) == sorted(i.id for i in env.unwrapped.simulator.scene.instances)


def test_who_has_the_oracle_map_walks_to_what_it_chose(env):
    agent = make_agent("oracle_map", env, protocol="navigation")
    actions, metrics = play(env, agent)
    assert actions[-1] == Action.STOP
    assert metrics["sr_1"] == metrics["nav_success"] == 1.0
    assert metrics["spl"] > 0.9
    assert play(env, agent)[0] == actions


def test_who_has_the_oracle_map_grounds_with_the_model_that_is_named(env):
    agent = make_agent("oracle_map", env, llm="openai:some-model@http://127.0.0.1:9/v1")
    assert "some-model" in agent.grounder.llm.name
    assert make_agent("oracle_map", env).grounder.llm is None
    with pytest.raises(ValueError, match="'magic'"):
        make_agent("oracle_map", env, llm="magic")


def test_who_stands_still_stops_at_once_and_is_not_there(env):
    actions, metrics = play(env, make_agent("stand_still", env))
    assert actions == [Action.STOP]
    assert metrics["sr_1"] == 0.0


def test_the_random_agent_repeats_itself_by_seed_alone(env):
    walks = [play(env, make_agent("random", env, seed=seed))[0] for seed in (1, 1, 2)]
    assert walks[0] == walks[1] != walks[2]


def test_the_random_agent_stops_as_often_as_it_says():
    agent = RandomAgent(np.random.default_rng(0), mean_steps=20)
    stops = np.mean([agent.act({}) == Action.STOP for _ in range(4000)])
    assert 0.035 < stops < 0.065


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "magic"}, "'magic'.*openmap, random, stand_still, oracle, oracle_map"),
        ({"name": "openmap", "perception": "eyes"}, "'eyes'"),
        ({"name": "openmap", "protocol": "swim"}, "'swim'.*retrieval or navigation"),
    ],
)
def test_the_factory_says_what_it_cannot_make(env, arguments, message):
    with pytest.raises(ValueError, match=message):
        make_agent(env=env, **arguments)


def test_agents_are_for_this_environment_only():
    with pytest.raises(ValueError, match=r"CartPole.*OpenMapNavEnv"):
        make_agent("oracle", gym.make("CartPole-v1"))
