"""Learning on the environment: it runs, goes on where it was stopped, and what was learned can be scored."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from conftest import make_toy_scene
from safetensors.torch import save_file

from openmap_agents import make_agent
from openmap_agents.training.batch import StableBatch
from openmap_agents.training.policy import Saved, load, read, stable_baselines, write
from openmap_agents.training.ppo import Args, train
from openmap_agents.training.view import LearnersView, view
from openmap_env.wrappers import EmbedInstruction, NormalizeDepth
from openmap_scenes import DataError
from openmap_scenes.formats.export import export_scene


@pytest.fixture(scope="session")
def toy_file(tmp_path_factory) -> str:
    """Spec of a file of the toy home, which any process can load."""
    path = tmp_path_factory.mktemp("toy") / "toy.glb"
    export_scene(make_toy_scene(), path)
    return f"file:{path}"


@pytest.fixture(scope="session")
def trained(toy_file, tmp_path_factory) -> tuple[Args, Path]:
    """2,000 steps of training in the toy home, stopped after 1,200."""
    args = Args(
        out=tmp_path_factory.mktemp("ppo"), scene=(toy_file,), steps=1200, envs=4, workers=0, width=48, height=48,
        rollout=100, minibatch=100, epochs=1, max_steps=25, save_every=400,
    )  # fmt: skip
    train(args)
    return replace(args, steps=2000), args.out / "policy.safetensors"


@pytest.mark.slow
def test_training_goes_on_where_it_was_stopped_and_writes_what_it_did(trained):
    args, path = trained
    before = read(path)
    assert before.steps == 1200
    train(args)
    after = read(path)
    assert after.steps == 2000
    assert any((before.weights[name] != after.weights[name]).any() for name in before.weights)
    assert int(after.optimiser["0.step"]) == 20, "a step of the optimiser for each of 5 x 4 minibatches, in one count"
    lines = [json.loads(line) for line in (args.out / "progress.jsonl").read_text().splitlines()]
    assert [line["steps"] for line in lines] == [400, 800, 1200, 1600, 2000]
    assert all(0.0 <= line["mean_nav_success"] <= 1.0 and line["mean_steps"] <= 25 for line in lines)
    assert train(args) == path, "nothing is left to do"
    assert not list(args.out.glob(".*")), "no unfinished file stays"
    with pytest.raises(ValueError, match=r"was trained with gamma = 0.99; give the same settings"):
        train(replace(args, gamma=0.5, steps=3000))


def test_what_was_learned_plays_as_an_agent_at_any_size_of_picture(trained, toy_file):
    _, path = trained
    env = gym.make("OpenMapNav-v0", scene=toy_file, width=64, height=40, episodes_per_scene=3)
    played = []
    for _ in range(2):
        observation, info = env.reset(seed=0)
        agent = make_agent(f"ppo:{path}", env, seed=3)
        agent.reset(observation, info)
        actions = []
        for _ in range(12):
            actions.append(agent.act(observation))
            observation, _, terminated, *_ = env.step(actions[-1])
            if terminated:
                break
        played.append(actions)
        assert agent.answer() is None
    env.close()
    assert played[0] == played[1]
    assert all(0 <= action < 6 for action in played[0])


def test_stable_baselines_finds_nothing_wrong_with_the_wrapped_environment(toy_specs, recwarn):
    from stable_baselines3.common.env_checker import check_env

    env = NormalizeDepth(EmbedInstruction(gym.make("OpenMapNav-v0", scene=toy_specs[0], width=48, height=48)))
    check_env(env)
    check_env(LearnersView(EmbedInstruction(gym.make("OpenMapNav-v0", scene=toy_specs[0], width=48, height=48))))
    env.close()


def test_a_batch_sets_an_attribute_of_the_environments_that_are_named_and_of_no_other(toy_file):
    settings = {"scene": toy_file, "width": 24, "height": 16, "workers": 0, "autoreset_mode": "SameStep"}
    envs = gym.make_vec("openmap_env:OpenMapNav-v0", 3, vectorization_mode="vector_entry_point", **settings)
    batch = StableBatch(envs)
    batch.set_attr("nickname", "a")
    batch.set_attr("nickname", "b", indices=[1])
    assert batch.get_attr("nickname") == ["a", "b", "a"]
    batch.close()


def test_a_view_has_colour_depth_heading_and_words():
    observation = {
        "rgb": np.full((4, 6, 3), 9, np.uint8),
        "depth": np.array([0.0, 5.0, 10.0, 40.0, 2.5, 1.0] * 4, np.float32).reshape(4, 6, 1),
        "gps": np.array([1.0, -2.0], np.float32),
        "compass": np.array([np.pi / 2], np.float32),
    }
    seen = view(observation, np.zeros(3, np.float32), 6, 4)
    assert seen["rgbd"].shape == (4, 6, 4)
    assert seen["rgbd"][0, :, 3].tolist() == [0, 128, 255, 255, 64, 26]
    np.testing.assert_allclose(seen["heading"], [0.0, 1.0], atol=1e-6)
    assert view(observation, np.zeros(3, np.float32), 3, 2)["rgbd"].shape == (2, 3, 4)


def test_files_that_are_no_policies_are_refused(tmp_path):
    with pytest.raises(DataError, match=r"nothing.safetensors: found no file"):
        load(tmp_path / "nothing.safetensors")
    text = tmp_path / "text.safetensors"
    text.write_bytes(b"PK\x03\x04 not one of ours")
    with pytest.raises(DataError, match="found no safetensors file"):
        load(text)
    other = tmp_path / "other.safetensors"
    save_file({"a": torch.zeros(2)}, other)
    with pytest.raises(DataError, match="found another kind of file"):
        load(other)
    good = Saved(48, 48, "hashed", 1, {}, {"a": torch.zeros(2)}, {})
    for wrong, said in (
        ({}, "Missing key"),
        ({"width": "48"}, "found width = '48'"),
        ({"height": 10**9}, "found pictures of"),
        ({"embedding": "bert"}, "found embedding 'bert'"),
    ):
        write(other, replace(good, **wrong))
        with pytest.raises(DataError, match=said):
            load(other)


def test_without_the_library_one_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(RuntimeError, match=r"pip install 'openmap-nav\[train\]'"):
        stable_baselines()
    with pytest.raises(RuntimeError, match="not installed"):
        train(Args())


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"width": 16}, "width is 16, expected an integer from 36"),
        ({"steps": "many"}, "steps is 'many'"),
        ({"epochs": 0}, "epochs is 0"),
        ({"minibatch": 1}, "minibatch is 1"),
        ({"rollout": 33, "envs": 1, "minibatch": 32}, "minibatch is 32, expected a number that leaves no rest of 1"),
        ({"gamma": 2.0}, "gamma is 2.0, expected more than 0 and at most 1$"),
        ({"clip": 0.0}, "clip is 0.0"),
        ({"entropy": float("nan")}, "entropy is nan"),
        ({"torch_threads": 0}, "torch_threads is 0"),
        ({"seed": -1}, "seed is -1"),
        ({"renderer": "pencil"}, "renderer is 'pencil'"),
    ],
)
def test_arguments_that_make_no_sense_are_refused_by_name(tmp_path, toy_file, wrong, said):
    with pytest.raises(ValueError, match=said):
        train(replace(Args(out=tmp_path / "out", scene=(toy_file,), workers=0), **wrong))
    assert not (tmp_path / "out").exists(), "nothing is begun"
