"""The openmap agent: what it learned lives exactly as long as the episode frame, and the same seed walks the same way."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import openmap_env  # noqa: F401 - registers the environment
from openmap_agents.colour_votes import ColourVotes
from openmap_agents.exploration import ExplorerSettings
from openmap_agents.grounding import Grounder
from openmap_agents.mapping import MapInstance
from openmap_agents.openmap_agent import OpenMapAgent, OpenMapAgentSettings, with_budget
from openmap_agents.perception import Masks
from openmap_env.actions import Action
from openmap_env.episodes import Episode, Target

START = (-1.5, 0.0, -1.0)


def episode(scene, name="refrigerator", start=START, number=0):
    instance = next(i for i in scene.instances if i.category == name)
    target = Target(instance.id, tuple(instance.centre), tuple(instance.aabb_min), tuple(instance.aabb_max))
    return Episode(f"e{number}", "two_rooms:0", f"Go to the {name}.", "object_goal", start, 1.0, (target,))


@pytest.fixture
def env(two_rooms, two_rooms_spec):
    episodes = [episode(two_rooms), episode(two_rooms, "bed", number=1), episode(two_rooms, "bed", (1.0, 0, 1), 2)]
    env = gym.make(
        "OpenMapNav-v0", scene=two_rooms_spec, episodes=episodes, width=80, height=60, renderer="raycast",
        protocol="navigation", max_steps=300,
    )  # fmt: skip
    yield env
    env.close()


class Letters:
    """A toy encoder: the letters of a word are its vector. Regions are told which instance they show."""

    dim = 26

    def __init__(self, env):
        self._env = env

    def encode_text(self, texts):
        out = np.full((len(texts), 26), 1e-3, np.float32)
        for row, text in zip(out, texts, strict=True):
            for letter in text.lower():
                if letter.isascii() and letter.isalpha():
                    row[ord(letter) - ord("a")] += 1.0
        return out / np.linalg.norm(out, axis=1, keepdims=True)

    def segment(self, rgb, depth, T_world_camera, camera):
        ids = self._env.unwrapped.simulator.observe().instance
        present, labels = np.unique(np.where(depth > 0, ids, 0), return_inverse=True)
        self._shown = present[present > 0]
        labels = labels.reshape(ids.shape) + (0 if present[0] == 0 else 1)
        return Masks(labels.astype(np.int32), np.ones(len(self._shown), np.float32))

    def encode_regions(self, rgb, depth, masks, T_world_camera, camera):
        return self.encode_text([self._env.unwrapped.simulator.scene.instance(int(i)).category for i in self._shown])


def make(env, seed=0, **settings):
    explorer = ExplorerSettings(max_steps=settings.pop("explore", 120))
    toy = Letters(env)
    chosen = OpenMapAgentSettings(explorer=explorer, **settings)
    grounder = Grounder(None, encoder=toy)
    return OpenMapAgent(env.unwrapped.camera, toy, toy, grounder, chosen, np.random.default_rng(seed))


def play(env, agent, number):
    observation, info = env.reset(options={"episode": number})
    agent.reset(observation, info)
    actions, over = [], False
    while not over:
        actions.append(agent.act(observation))
        if actions[-1] == Action.STOP:
            env.unwrapped.declare(agent.answer().positions)
        observation, _, terminated, truncated, info = env.step(actions[-1])
        over = terminated or truncated
    return actions, info["metrics"]


def test_it_finds_things_and_answers_the_same_frame_at_once_but_another_frame_not(env):
    agent = make(env)
    actions, metrics = play(env, agent, 0)
    assert len(actions) > 30
    assert metrics["sr_1"] == 1.0
    first_map = agent.instance_map
    assert {i.label for i in first_map} >= {"bed", "refrigerator"}
    assert agent.answer().labels[0] == "refrigerator"
    assert len(agent.trajectory) == len(actions)
    assert agent.last_masks is not None

    actions, metrics = play(env, agent, 1)
    assert actions == [Action.STOP]
    assert metrics["sr_1"] == 1.0
    assert agent.instance_map is first_map

    grid = agent.occupancy
    observation, info = env.reset(options={"episode": 2})
    agent.reset(observation, info)
    assert agent.act(observation) != Action.STOP
    assert agent.occupancy is not grid
    assert len(agent.trajectory) == 1
    assert agent.keyframes == 1


def test_in_navigation_it_walks_to_what_it_found(env):
    agent = make(env, protocol="navigation")
    actions, metrics = play(env, agent, 0)
    assert metrics["nav_success"] == 1.0
    assert len(actions) < 300


def test_the_same_seed_gives_the_same_walk_and_the_same_answer(env):
    agents = [make(env, 3, explore=40) for _ in range(2)]
    (first, _), (second, _) = (play(env, agent, 0) for agent in agents)
    assert first == second
    assert agents[0].answer().positions.tobytes() == agents[1].answer().positions.tobytes()


def test_an_episode_cut_off_while_exploring_leaves_a_map_to_answer_from(env):
    agent = make(env)
    observation, info = env.reset(options={"episode": 0})
    agent.reset(observation, info)
    for _ in range(40):
        observation, *_ = env.step(agent.act(observation))
    assert play(env, agent, 1)[0] == [Action.STOP]


def test_a_saved_map_answers_without_a_walk(env, tmp_path):
    agent = make(env)
    play(env, agent, 0)
    agent.save(tmp_path / "map.npz")
    _, info = env.reset(options={"episode": 1})
    fresh = make(env)
    fresh.load(tmp_path / "map.npz", info["episode_frame"])
    actions, metrics = play(env, fresh, 1)
    assert actions == [Action.STOP]
    assert metrics["sr_1"] == 1.0


def test_not_every_frame_is_a_keyframe(env):
    agent = make(env, explore=40)
    actions, _ = play(env, agent, 0)
    assert 10 <= agent.keyframes < 0.75 * len(actions)


@pytest.mark.parametrize(("protocol", "left"), [("retrieval", 1), ("navigation", 51)])
def test_the_budget_leaves_time_to_answer(protocol, left):
    settings = with_budget(OpenMapAgentSettings(protocol=protocol), 100)
    assert settings.explorer.max_steps == 100 - left


def test_the_colour_of_most_masks_wins_over_the_mean():
    votes = ColourVotes()
    labels = np.ones((30, 30), np.int32)
    for colour in ((200, 25, 30), (205, 30, 35), (10, 10, 10)):
        votes.add(np.full((30, 30, 3), colour, np.uint8), Masks(labels, np.ones(1, np.float32)))
    views = np.array([[0, 1, 900], [1, 1, 900], [2, 1, 900]], np.int32)
    points, mean = np.zeros((1, 3), np.float32), np.array([138, 22, 25], np.uint8)
    elected = votes.colour(MapInstance(1, points, None, views=views, colour=mean))
    assert elected is not None
    assert np.abs(elected.astype(int) - (202, 28, 32)).max() <= 1
    assert votes.colour(MapInstance(2, points, None, colour=mean)) is mean
