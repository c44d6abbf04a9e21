"""Wrappers for learning libraries."""

from __future__ import annotations

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FilterObservation, FlattenObservation, FrameStackObservation
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_env.embedding import hashed
from openmap_env.wrappers import EmbedInstruction, NormalizeDepth, RelativeDepth, TopDownOccupancy


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


@given(st.text(max_size=60))
@settings(deadline=None, max_examples=60)
def test_a_hashed_text_has_length_one_or_is_nothing(text):
    vector = hashed(text)
    assert vector.shape == (128,)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=1e-5) or not vector.any()
    np.testing.assert_array_equal(vector, hashed(text.casefold().swapcase().casefold()))


def test_texts_that_share_words_are_near_each_other_in_every_process():
    chair, chairs, sink = map(hashed, ("Find the blue chair", "find the chairs", "I want to wash my hands"))
    assert chair @ chairs > 0.3 > abs(chair @ sink)
    code = "from openmap_env.embedding import hashed; print(hashed('Find the blue chair').tobytes().hex())"
    elsewhere = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}; {code}"], capture_output=True, check=True
    )
    assert bytes.fromhex(elsewhere.stdout.decode()) == chair.tobytes()


def test_embedding_an_instruction_needs_no_argument_and_an_unknown_name_is_refused(env):
    wrapped = EmbedInstruction(env)
    observation, _ = wrapped.reset(seed=0)
    np.testing.assert_array_equal(observation["instruction_embedding"], hashed(env.unwrapped.episode.instruction))
    with pytest.raises(ValueError, match="expected a callable or one of hashed"):
        EmbedInstruction(env, "bert")


def test_relative_depth_knows_no_scale(env):
    wrapped = RelativeDepth(env)
    near = wrapped.observation({"depth": np.array([[[0.0], [1.0], [2.0], [4.0]]], np.float32)})["depth"]
    far = wrapped.observation({"depth": np.array([[[0.0], [3.0], [6.0], [12.0]]], np.float32)})["depth"]
    np.testing.assert_allclose(near.ravel(), [0.0, 1.0, 1 / 3, 0.0], atol=1e-6)
    np.testing.assert_allclose(near, far, atol=1e-6)
    alike = wrapped.observation({"depth": np.full((1, 2, 1), 2.0, np.float32)})["depth"]
    assert not alike.any()
    observation, _ = wrapped.reset(seed=0)
    assert wrapped.observation_space.contains(observation)
    assert observation["depth"].max() == 1.0


def test_the_map_shows_what_bars_the_way_and_where_the_agent_was(env):
    wrapped = TopDownOccupancy(env, size=40, resolution=0.2)
    # In the living room, looking through the door along -x into the bedroom.
    start = ((0.5, 0.0, 0.0), np.pi / 2)
    observation, _ = wrapped.reset(seed=0, options={"start": start, "instruction": "?"})
    assert wrapped.observation_space.contains(observation)
    picture = observation["map"]
    assert picture[..., 2].sum() == 255, "one place so far"
    ahead = picture[3:10, 18:22]  # 1.9 to 3.3 m: the camera does not see the floor at its feet
    assert (ahead[..., 1] == 255).mean() > 0.5, "the floor ahead is free"
    assert (picture[25:, :, :2] == 0).all(), "nothing is known of what lies behind"
    for _ in range(8):
        observation = wrapped.step(1)[0]
    assert (observation["map"][21:, 19:21, 2] == 255).any(), "it came from behind"
    turned = wrapped.step(2)[0]["map"]
    assert (turned != observation["map"]).any()
    fresh, _ = wrapped.reset(options={"start": start, "instruction": "?"})
    np.testing.assert_array_equal(fresh["map"], picture)
    with pytest.raises(ValueError, match="before"):
        TopDownOccupancy(NormalizeDepth(env))


WRAPS = {
    "embedding": (EmbedInstruction,),
    "depth": (EmbedInstruction, NormalizeDepth),
    "relative depth": (EmbedInstruction, RelativeDepth),
    "map": (TopDownOccupancy,),
    "stack": (TopDownOccupancy, EmbedInstruction, RelativeDepth, lambda env: FrameStackObservation(env, 3)),
    "filter": (lambda env: FilterObservation(env, ["depth", "gps"]), FlattenObservation),
}


@pytest.mark.parametrize("wraps", WRAPS.values(), ids=WRAPS)
def test_gymnasium_has_nothing_to_say_against_a_wrapped_environment(env, wraps):
    wrapped = env
    for wrap in wraps:
        wrapped = wrap(wrapped)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_env(wrapped, skip_close_check=True)
    strange = [str(w.message) for w in said if "different from the unwrapped version" not in str(w.message)]
    assert not strange


def test_stacked_frames_are_the_last_ones_oldest_first(env):
    stacked = FrameStackObservation(EmbedInstruction(env), 2)
    first, _ = stacked.reset(seed=0)
    np.testing.assert_array_equal(first["rgb"][0], first["rgb"][1])
    second = stacked.step(2)[0]
    np.testing.assert_array_equal(second["rgb"][0], first["rgb"][1])
    assert (second["rgb"][1] != first["rgb"][1]).any()
    assert second["rgb"].shape == (2, 24, 32, 3)


def test_wrappers_are_in_the_spec_and_an_environment_can_be_made_again_from_it(env):
    wrapped = RelativeDepth(TopDownOccupancy(EmbedInstruction(env, key="asked"), size=8))
    names = [w.name for w in wrapped.spec.additional_wrappers]
    assert names == ["EmbedInstruction", "TopDownOccupancy", "RelativeDepth"]
    again = gym.make(gym.envs.registration.EnvSpec.from_json(wrapped.spec.to_json()))
    assert again.observation_space == wrapped.observation_space
    one, other = wrapped.reset(seed=4)[0], again.reset(seed=4)[0]
    assert all(np.array_equal(one[name], other[name]) for name in one)
    again.close()


def test_wrapped_environments_come_in_batches(toy_specs):
    envs = gym.make_vec(
        "OpenMapNav-v0", num_envs=2, vectorization_mode="sync", wrappers=[EmbedInstruction, TopDownOccupancy, NormalizeDepth],
        scene=toy_specs[0], episodes_per_scene=3, width=16, height=12,
    )  # fmt: skip
    observation, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observation)
    assert observation["map"].shape == (2, 64, 64, 3)
    envs.close()


def test_arguments_of_wrappers_are_refused_by_name(toy_specs):
    env = gym.make("OpenMapNav-v0", scene=toy_specs[0], width=16, height=12)
    for wrap, wrong, said in (
        (EmbedInstruction, {"embed": 3}, "embed is 3, expected a callable or one of hashed"),
        (EmbedInstruction, {"embed": lambda text: "a"}, r"embed\('find the chair'\) is 'a', expected finite numbers"),
        (EmbedInstruction, {"key": "rgb"}, "key is 'rgb', expected a name that the observation does not have"),
        (EmbedInstruction, {"key": 3}, "key is 3"),
        (NormalizeDepth, {"max_depth": "far"}, "max_depth is 'far', expected a number"),
        (NormalizeDepth, {"min_depth": np.nan}, "min_depth is nan"),
        (TopDownOccupancy, {"size": 3.5}, "size is 3.5, expected an integer from 1 to 2048"),
        (TopDownOccupancy, {"size": 10**6}, "size is 1000000"),
        (TopDownOccupancy, {"resolution": "fine"}, "resolution is 'fine'"),
        (TopDownOccupancy, {"resolution": 1e-9}, "resolution is 1e-09"),
    ):
        with pytest.raises(ValueError, match=said):
            wrap(env, **wrong)
    env.close()
