"""Wrappers for learning libraries."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from openmap_env.wrappers import EmbedInstruction, NormalizeDepth


@pytest.fixture
def env(toy_specs):
    env = gym.make("OpenMapNav-v0", scene=toy_specs[0], episodes_per_scene=3, width=32, height=24)
    yield env
    env.close()


def test_an_instruction_becomes_a_vector_asked_for_once_an_episode(env):
    asked = []

    def embed(text):
        asked.append(text)
        return np.array([len(text), text.count("e"), 1.0])

    wrapped = EmbedInstruction(env, embed)
    observation, _ = wrapped.reset(seed=0)
    assert wrapped.observation_space.contains(observation)
    assert "instruction" not in observation
    text = env.unwrapped.episode.instruction
    np.testing.assert_array_equal(observation["instruction_embedding"], [len(text), text.count("e"), 1.0])
    observation["instruction_embedding"][:] = 0.0
    np.testing.assert_array_equal(wrapped.step(2)[0]["instruction_embedding"][0], len(text))
    assert asked.count(text) == 1


def test_an_embedding_that_changes_its_size_is_refused(env):
    wrapped = EmbedInstruction(env, lambda text: np.ones(len(text)))
    with pytest.raises(ValueError, match=r"expected finite numbers of shape \(14,\)"):
        wrapped.reset(seed=0, options={"instruction": "Where am I?"})
    with pytest.raises(ValueError, match="embed"):
        EmbedInstruction(env, lambda text: [[1.0]])
    with pytest.raises(ValueError, match="instruction"):
        EmbedInstruction(gym.make("CartPole-v1"), lambda text: [1.0])


def test_depth_is_scaled_and_nothing_stays_nothing(env):
    wrapped = NormalizeDepth(env, 1.0, 3.0)
    metres, _ = env.reset(seed=0)
    scaled, _ = wrapped.reset(seed=0)
    assert wrapped.observation_space.contains(scaled)
    np.testing.assert_allclose(scaled["depth"], np.clip((metres["depth"] - 1.0) / 2.0, 0.0, 1.0), atol=1e-6)
    hole = wrapped.observation({**metres, "depth": np.array([[[0.0], [0.5], [2.0], [9.0]]], np.float32)})
    np.testing.assert_allclose(hole["depth"].ravel(), [0.0, 0.0, 0.5, 1.0])
    with pytest.raises(ValueError, match="min_depth"):
        NormalizeDepth(env, 3.0, 1.0)
