"""Many environments at once: the same as Gymnasium's own batches, and gone when they should be."""

from __future__ import annotations

import copy
import os
import pickle
import signal
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import psutil
import pytest
from conftest import make_toy_scene
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import FlattenObservation

from openmap_env import ENV_ID
from openmap_env.vector import OpenMapNavVectorEnv
from openmap_env.vector_worker import Layout
from openmap_env.wrappers import EmbedInstruction
from openmap_scenes.formats.export import export_scene

SIZE = {"width": 16, "height": 12}


@pytest.fixture(scope="session")
def toy_files(tmp_path_factory) -> list[str]:
    """Specs of two files of the toy home, which any process can load."""
    folder = tmp_path_factory.mktemp("toy")
    for name in ("a.glb", "b.glb"):
        export_scene(make_toy_scene(), folder / name)
    return [f"file:{folder / name}" for name in ("a.glb", "b.glb")]


@pytest.fixture
def settings(toy_files):
    return {**SIZE, "scene": toy_files, "episodes_per_scene": 4, "max_steps": 6}


def assert_same(a, b, where="") -> None:
    """Same types, keys in the same order, same bytes."""
    assert type(a) is type(b), where
    if isinstance(a, dict):
        assert list(a) == list(b), where
        for key in a:
            assert_same(a[key], b[key], f"{where}/{key}")
    elif isinstance(a, np.ndarray) and a.dtype != object:
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    elif isinstance(a, np.ndarray):
        for x, y in zip(a, b, strict=True):
            assert_same(x, y, where)
    else:
        assert a == b, where


@pytest.mark.parametrize(("workers", "mode"), [(2, "NextStep"), (0, "NextStep"), (0, "SameStep")])
def test_it_equals_gymnasiums_own_batch_step_by_step(settings, workers, mode):
    settings["sensors"] = ("rgb", "depth", "semantic")
    ours = gym.make_vec(ENV_ID, num_envs=3, workers=workers, autoreset_mode=mode, **settings)
    theirs = gym.make_vec(
        ENV_ID, num_envs=3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **settings
    )
    assert isinstance(ours, OpenMapNavVectorEnv)
    assert isinstance(theirs, SyncVectorEnv)
    assert ours.metadata == theirs.metadata
    assert ours.observation_space == theirs.observation_space
    assert ours.single_action_space == theirs.single_action_space
    for one, other in zip(ours.reset(seed=3), theirs.reset(seed=3), strict=True):
        assert_same(one, other)
    rng, ended = np.random.default_rng(0), 0
    for k in range(20):
        actions = rng.choice(6, 3, p=[0.1, 0.5, 0.1, 0.1, 0.1, 0.1])
        mine, its = ours.step(actions), theirs.step(actions)
        assert_same(dict(enumerate(mine)), dict(enumerate(its)), f"step {k}")
        assert ours.observation_space.contains(mine[0])
        ended += int((mine[2] | mine[3]).sum())
    assert ended > 3, "several episodes came to their end"
    scenes = ours.get_attr("episode")
    assert len({episode.scene for episode in scenes}) == 2, "each environment draws its scene by its own seed"
    ours.close()
    theirs.close()


def test_workers_do_what_they_are_asked_and_say_what_goes_wrong(settings):
    envs = gym.make_vec(ENV_ID, num_envs=3, workers=2, render_mode="rgb_array", **settings)
    envs.reset(seed=[5, None, 7])
    assert envs.np_random_seed[0] == 5
    assert envs.np_random_seed[2] == 7
    assert [(frame.shape[2], frame.dtype) for frame in envs.render()] == [(3, np.uint8)] * 3
    centres = [episode.targets[0].centre for episode in envs.get_attr("episode")]
    T_world_episode = envs.get_attr("T_world_episode")
    places = [(np.linalg.inv(T) @ [*c, 1.0])[None, :3] for T, c in zip(T_world_episode, centres, strict=True)]
    envs.declare([places[0], None, places[2]])
    with pytest.raises(ValueError, match=r"shape \(k, 3\)") as raised:
        envs.call_on([1], "declare", [[1.0, 2.0]])
    assert "in worker 1 of the vector environment" in raised.value.__notes__[0]
    assert "in declare" in raised.value.__notes__[0], "the traceback of the worker"
    _, rewards, terminated, _, infos = envs.step(np.zeros(3, int))
    assert infos["metrics"]["sr_1"][[0, 2]].tolist() == [1.0, 1.0]
    assert terminated.all()
    assert rewards[0] > 0.9
    with pytest.raises(ValueError, match="nowhere"):
        envs.reset(options={"scene": "nowhere:1"})
    envs.set_attr("max_steps", [2, 3, 4])
    assert envs.get_attr("max_steps") == (2, 3, 4)
    observation, infos = envs.reset(options={"instruction": "Wo ist die Tür?", "scene": settings["scene"][0]})
    assert observation["instruction"] == ("Wo ist die Tür?",) * 3
    mask = np.array([False, True, False])
    again, infos = envs.reset(seed=1, options={"reset_mask": mask})
    assert infos["_kind"].tolist() == mask.tolist()
    assert_same(again["rgb"][0], observation["rgb"][0])
    assert again["instruction"][1] != observation["instruction"][1]
    for another in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="make another with the same arguments"):
            another(envs)
    with pytest.raises(ValueError, match="2 actions"):
        envs.step([1, 1])
    os.kill(envs._processes[1].pid, signal.SIGKILL)
    envs._processes[1].wait()
    with pytest.raises(RuntimeError, match=r"worker 1 \(environments 1 to 2\) was killed by signal 9"):
        envs.step([1, 1, 1])
    envs.close()
    envs.close()
    with pytest.raises(ClosedEnvironmentError):
        envs.reset()
    assert all(process.returncode is not None for process in envs._processes)


def test_an_interrupt_ends_the_workers_and_is_passed_on(settings, monkeypatch):
    envs = OpenMapNavVectorEnv(1, workers=1, **settings)

    class Interrupted:
        def recv(self):
            raise KeyboardInterrupt

        def send_bytes(self, content):
            pass

        def close(self):
            pass

    monkeypatch.setattr(envs, "_pipes", [Interrupted()])
    with pytest.raises(KeyboardInterrupt):
        envs.reset(seed=0)
    assert envs.closed
    assert envs._processes[0].returncode is not None


SCRIPT = """
import gymnasium as gym, openmap_env, os, signal, sys
envs = gym.make_vec("OpenMapNav-v0", num_envs=1, workers=1, scene=sys.argv[1], width=8, height=8)
print(envs._processes[0].pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_script_needs_no_main_guard_and_its_workers_do_not_outlive_it(settings, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (p for p in sys.path if p)))}
    done = subprocess.run(
        [sys.executable, str(script), settings["scene"][0]], stdout=subprocess.PIPE, env=environment, check=False
    )
    worker = int(done.stdout)
    deadline = time.monotonic() + 60.0
    while psutil.pid_exists(worker) and psutil.Process(worker).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline, "the worker is still there"
        time.sleep(0.05)


def test_wrapped_environments_and_views_without_a_copy(settings):
    envs = OpenMapNavVectorEnv(2, workers=0, copy=False, env_wrappers=(EmbedInstruction,), **settings)
    observation, _ = envs.reset(seed=0)
    assert envs.observation_space.contains(observation)
    assert observation["instruction_embedding"].shape == (
        2,
        *envs.single_observation_space["instruction_embedding"].shape,
    )
    before = observation["rgb"].copy()
    after = envs.step([2, 2])[0]
    assert after["rgb"] is observation["rgb"]
    assert (before != after["rgb"]).any()
    envs.close()
    flat = OpenMapNavVectorEnv(2, workers=0, env_wrappers=(EmbedInstruction, FlattenObservation), **settings)
    observation, _ = flat.reset(seed=0)
    assert flat.observation_space.contains(observation), "an observation need not be a Dict"
    flat.close()


def test_instructions_come_through_the_shared_memory_of_gymnasiums_processes(settings):
    # A fork of this process, which has drawn with OpenGL, could draw nothing.
    kwargs = {"shared_memory": True, "context": "spawn"}
    envs = gym.make_vec(ENV_ID, num_envs=2, vectorization_mode="async", vector_kwargs=kwargs, **settings)
    observation, _ = envs.reset(seed=0)
    assert list(observation["instruction"]) == [episode.instruction for episode in envs.get_attr("episode")]
    assert envs.observation_space.contains(observation)
    later, _ = envs.reset(options={"instruction": "Ein Stuhl?"})
    assert later["instruction"] == ("Ein Stuhl?",) * 2, "a shorter one leaves nothing of a longer one"
    assert observation["instruction"] != later["instruction"], "what was handed out stays"
    envs.close()


def test_arguments_that_make_no_sense_are_refused_before_anything_is_started(settings):
    for name, wrong in (
        *(("num_envs", wrong) for wrong in (0, "2", 2.0, True, None)),
        *(("workers", wrong) for wrong in (-1, "1", 1.5)),
        *(("autoreset_mode", wrong) for wrong in ("never", None)),
        *(("env_wrappers", wrong) for wrong in (3, [3])),
        ("max_steps", 0),
    ):
        with pytest.raises(ValueError, match=f"{name} is .*expected"):
            OpenMapNavVectorEnv(**{"num_envs": 2, **settings, name: wrong})
    envs = OpenMapNavVectorEnv(2, workers=0, autoreset_mode=AutoresetMode.DISABLED, **settings)
    for call, said in (
        (lambda: envs.reset(seed=[1, 2, 3]), "3 seeds"),
        (lambda: envs.reset(seed="7"), "got 1 seeds|seed.* is '7'"),
        (lambda: envs.reset(seed=1.5), "seed is 1.5, expected"),
        (lambda: envs.reset(seed=[1, -2]), r"seed\[1\] is -2, expected"),
        (lambda: envs.reset(options=3), "options is 3, expected"),
        (lambda: envs.reset(options={"reset_mask": np.array([1, 0])}), "reset_mask"),
        (lambda: envs.call_on([2], "episode"), r"indices\[0\] is 2, expected an integer from 0 to 1"),
        (lambda: envs.call_on(1, "episode"), "indices is 1, expected"),
        (lambda: envs.declare(None), "declarations is None, expected"),
        (lambda: envs.step(3), "actions is 3, expected"),
    ):
        with pytest.raises(ValueError, match=said):
            call()
    envs.reset(seed=0)
    before = [len(walk.path) for walk in envs.get_attr("_walk")]
    for wrong in ([1, 9], [1, 1.0], [1, None]):
        with pytest.raises(ValueError, match=r"actions\[1\] is .*expected one of Discrete"):
            envs.step(wrong)
    assert [len(walk.path) for walk in envs.get_attr("_walk")] == before, "none was played"
    envs.step([0, 1])
    with pytest.raises(RuntimeError, match="environment 0 is over"):
        envs.step([1, 1])
    envs.close()


def test_blocks_lie_one_behind_the_other(settings):
    space = gym.spaces.Dict(
        {"a": gym.spaces.Box(0, 255, (3, 5), np.uint8), "b": gym.spaces.Discrete(4), "t": gym.spaces.Text(3)}
    )
    layout = Layout(space, 7)
    memory = bytearray(layout.size)
    blocks = layout.arrays(memory)
    assert layout.names == {"a", "b"}
    blocks["a"][:], blocks["b"][:] = 255, -1
    assert sum(byte == 255 for byte in memory) == 7 * 15 + 7 * 8, "no byte twice"
