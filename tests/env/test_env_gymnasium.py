"""The environment as Gymnasium itself sees it: its checker, its wrappers, its specs, and the life of an environment."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import imageio.v3 as imageio
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo

import openmap_env
from openmap_env import window
from openmap_env.env import OpenMapNavEnv
from openmap_env.navigation import Body

SPECS = [name for name, spec in gym.registry.items() if str(spec.entry_point).startswith("openmap_env")]
SMALL = {"width": 32, "height": 24, "episodes_per_scene": 6}
# Warnings of Gymnasium's checker that may appear, each with its reason; every other one fails.
EXPECTED_WARNINGS: tuple[str, ...] = ()


@pytest.fixture
def make(toy_specs):
    """Makes environments in the toy home and closes them."""
    made = []

    def make(name="OpenMapNav-v0", **settings):
        env = gym.make(name, **{"scene": toy_specs[0], **SMALL, **settings})
        made.append(env)
        return env

    yield make
    for env in made:
        env.close()


def complaints(env):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env.unwrapped)
    return [str(w.message) for w in caught if not any(text in str(w.message) for text in EXPECTED_WARNINGS)]


@pytest.mark.parametrize("renderer", ["opengl", "pyrender", "raycast"])
@pytest.mark.parametrize("sensors", [("rgb", "depth"), ("rgb", "depth", "semantic"), ("semantic",)])
@pytest.mark.parametrize("name", SPECS)
def test_gymnasium_finds_nothing_to_complain_of(make, name, sensors, renderer):
    assert complaints(make(name, sensors=sensors, renderer=renderer)) == []


def test_gymnasium_finds_nothing_to_complain_of_in_the_other_protocol_and_in_a_window(make, toy_specs, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make(protocol="navigation", scene=toy_specs, render_mode="human")
    assert env.unwrapped.metadata["render_modes"] == ["rgb_array", "human"]
    assert complaints(env) == []


def test_both_names_make_it():
    assert gym.spec("OpenMapNav-v0").entry_point == "openmap_env.env:OpenMapNavEnv"
    assert gym.spec("OpenMapNav-v0").max_episode_steps is None, "max_steps is the environment's own"
    assert openmap_env.ENV_ID == "OpenMapNav-v0"
    code = "import gymnasium as g, sys; print(g.make('openmap_env:OpenMapNav-v0').action_space, 'torch' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "Discrete(6) False"


@pytest.mark.parametrize(
    "settings",
    [
        {"episodes_per_scene": None, "episodes": "generate"},
        {"body": Body(radius=0.15, height=1.2), "camera_height": 1.1},
        {"body": {"radius": 0.15}, "forward_step": 0.5, "turn_deg": 30, "look_deg": 10.0},
        {"renderer": {"name": "raycast", "threads": 1}, "sensors": ("semantic", "depth"), "hfov_deg": 79.0},
        {"protocol": "navigation", "kinds": ("demand",), "episode_seed": 5, "max_steps": 7, "prefetch": False},
    ],
)
def test_a_spec_goes_through_json_and_makes_the_same_environment(make, toy_specs, settings):
    env = make(scene=toy_specs, **settings)
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.settings == env.unwrapped.settings
    assert json.loads(again.spec.to_json()) == json.loads(env.spec.to_json())
    (one, told), (two, told_again) = env.reset(seed=2), again.reset(seed=2)
    assert told == told_again
    assert one.keys() == two.keys()
    assert all(np.array_equal(one[key], two[key]) for key in one)
    again.close()


def test_given_episodes_go_through_json_as_well(make):
    first = make()
    first.reset(seed=0)
    env = make(scene=None, episodes=first.unwrapped.episodes[:3], episodes_per_scene=None)
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.settings == env.unwrapped.settings
    assert again.reset(seed=4)[1] == env.reset(seed=4)[1]
    again.close()


def test_what_an_agent_writes_into_an_observation_stays_there(make):
    for render_mode in (None, "rgb_array"):
        env, twin = make(render_mode=render_mode), make(render_mode=render_mode)
        for one in (env, twin):
            one.reset(seed=0)
        observation = env.step(2)[0]
        expected = twin.step(2)[0]["rgb"].copy()
        for value in observation.values():
            if isinstance(value, np.ndarray):
                value[...] = 1
        np.testing.assert_array_equal(env.unwrapped.simulator.observe().rgb, expected)
        for action in (1, 4, 0):
            ours, theirs = env.step(action)[0], twin.step(action)[0]
            assert all(np.array_equal(ours[key], theirs[key]) for key in ours)


def test_the_picture_shows_what_was_asked_seen_and_walked(make):
    env = make(render_mode="rgb_array", width=64, height=48)
    env.reset(seed=0, options={"start": ((-4.0, 0.0, 0.0), -1.5)})
    before = env.render()
    assert before.dtype == np.uint8
    assert before.shape[0] % 2 == before.shape[1] % 2 == 0, "video codecs want even sizes"
    zoom = 8
    view = before[62 : 62 + 48 * zoom : zoom, 8 : 8 + 64 * zoom : zoom]
    np.testing.assert_array_equal(view, env.unwrapped.simulator.observe().rgb)
    env.step(1)
    after = env.render()
    thirds = [slice(8, 8 + 64 * zoom), slice(16 + 64 * zoom, 16 + 128 * zoom), slice(24 + 128 * zoom, None)]
    assert all((before[62:-30, part] != after[62:-30, part]).any() for part in thirds)
    np.testing.assert_array_equal(before[:60], after[:60])
    env.reset(options={"instruction": "Πού είναι το κρεβάτι; " * 60})
    assert env.render().shape == before.shape
    assert (env.render()[:60] != before[:60]).any(), "another caption"


def test_frames_are_collected_and_filmed(make, tmp_path):
    env = make(render_mode="rgb_array_list")
    env.reset(seed=0)
    env.step(1)
    env.step(2)
    assert [frame.shape for frame in env.render()] == [env.unwrapped.render().shape] * 3
    film = RecordVideo(
        make(render_mode="rgb_array", max_steps=4), str(tmp_path / "films"), episode_trigger=lambda n: True
    )
    film.reset(seed=0)
    while not film.step(2)[3]:
        pass
    film.close()
    frames = imageio.imread(tmp_path / "films" / "rl-video-episode-0.mp4", plugin="FFMPEG")
    assert len(frames) == 5
    assert frames.shape[1:] == env.unwrapped.render().shape
    assert all(frame.std() > 20.0 for frame in frames)


def test_a_window_shows_every_step(make, monkeypatch):
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(window.Window, "_pause", lambda self: None)
    env = make(render_mode="human")
    env.reset(seed=0)
    first = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert first.std() > 20.0
    env.step(1)
    second = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert first.shape == second.shape
    assert (first != second).any()
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()


def test_without_a_display_or_pygame_it_is_said_what_to_do(make, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform.startswith("linux"):
        with pytest.raises(ValueError, match=r"render_mode is 'human'.*display.*RecordVideo"):
            make(render_mode="human")
        assert make().unwrapped.metadata["render_modes"] == ["rgb_array"]
        assert OpenMapNavEnv.metadata["render_modes"] == ["rgb_array", "human"]
    monkeypatch.setattr(window, "find_spec", lambda name: None)
    with pytest.raises(DependencyNotInstalled, match=r"openmap-nav\[window\]"):
        make(render_mode="human")


def test_turns_out_of_order_are_refused(make, toy_specs):
    env = make(render_mode="rgb_array")
    for call in (lambda: env.step(1), env.render):
        with pytest.raises(ResetNeeded):
            call()
    bare = OpenMapNavEnv(scene=toy_specs[0], **SMALL)
    for call in (
        lambda: bare.step(1),
        bare.render,
        lambda: bare.declare([]),
        lambda: bare.episode,
        lambda: bare.episodes,
    ):
        with pytest.raises(RuntimeError, match=r"reset\(\)"):
            call()
    env.reset(seed=0)
    assert env.step(0)[2]
    for call in (lambda: env.step(1), lambda: env.unwrapped.declare([])):
        with pytest.raises(RuntimeError, match=r"over.*reset\(\)"):
            call()
    assert env.render().std() > 20.0, "the last moment can still be looked at"


def test_it_closes_twice_wakes_up_again_and_travels_as_a_pickle(make):
    env = make().unwrapped
    first, _ = env.reset(seed=3)
    copy = pickle.loads(pickle.dumps(env))
    second, _ = copy.reset(seed=3)
    copy.close()
    env.close()
    env.close()
    for call in (lambda: env.step(1), env.render, lambda: env.simulator):
        with pytest.raises(RuntimeError, match=r"reset\(\)"):
            call()
    third, _ = env.reset(seed=3)
    for key, value in first.items():
        assert np.array_equal(value, second[key])
        assert np.array_equal(value, third[key])


RUN = """if True:
    import hashlib, sys, gymnasium as gym, numpy as np, openmap_env, conftest
    from openmap_scenes.catalog import READERS
    scene = conftest.make_toy_scene()
    READERS["toy"] = lambda rest: scene
    env = gym.make("OpenMapNav-v0", scene=["toy:0", "toy:1"], sensors=("rgb", "depth", "semantic"), episodes_per_scene=6,
                   width=32, height=24, max_steps=60, protocol=sys.argv[1], prefetch=sys.argv[2] == "True",
                   render_mode="rgb_array")
    digest, seed = hashlib.sha256(), 7
    rng, over = np.random.default_rng(0), True
    def take(*told):
        for part in told:
            for value in part.values() if isinstance(part, dict) else [part]:
                if isinstance(value, dict):
                    take(value)
                else:
                    digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    for _ in range(500):
        if over:
            take(*env.reset(seed=seed))
            seed = None
        observation, reward, terminated, truncated, info = env.step(int(rng.choice([0, 1, 1, 1, 1, 1, 2, 3, 4, 5])))
        over = terminated or truncated
        take(observation, reward, terminated, truncated, info)
    take({"picture": env.render()})
    env.close()
    print(digest.hexdigest())
"""


@pytest.mark.parametrize("protocol", ["retrieval", "navigation"])
def test_two_processes_see_the_same_bytes_over_500_steps(protocol):
    path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", RUN, protocol, prefetch],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": path},
        )
        for hash_seed, prefetch in (("1", "True"), ("2", "False"))
    ]
    told = [run.communicate(timeout=120)[0] for run in runs]
    assert [run.returncode for run in runs] == [0, 0]
    assert told[0] == told[1]
    assert told[0]


def test_a_killed_environment_leaves_nothing_that_bars_the_next(tmp_path, shared_scenes):
    code = (
        "import sys, time, gymnasium as g, openmap_env;"
        "e = g.make('OpenMapNav-v0', scene=sys.argv[1], width=32, height=24, episodes_per_scene=2);"
        "e.reset(seed=0); print('up', flush=True); time.sleep(float(sys.argv[2])); e.close()"
    )
    command = [sys.executable, "-c", code, f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"]
    environment = {**os.environ, "OPENMAP_CACHE": str(tmp_path)}
    # One is killed in the middle of reading and keeping the scene, one while it runs.
    early = subprocess.Popen([*command, "60"], env=environment, stdout=subprocess.DEVNULL)
    try:
        early.wait(2.5)
    except subprocess.TimeoutExpired:
        early.send_signal(signal.SIGKILL)
    late = subprocess.Popen([*command, "60"], stdout=subprocess.PIPE, env=environment)
    assert late.stdout is not None
    assert late.stdout.readline().strip() == b"up"
    late.send_signal(signal.SIGKILL)
    assert early.wait() == late.wait() == -signal.SIGKILL
    late.stdout.close()
    run = subprocess.run([*command, "0"], capture_output=True, text=True, env=environment, timeout=120)
    assert (run.returncode, run.stdout.strip()) == (0, "up"), run.stderr


def test_after_a_reset_that_failed_the_next_one_begins_an_episode(make, toy_specs):
    env = make(protocol="navigation")
    for options in ({"scene": "nowhere:1"}, {"start": ((90.0, 0.0, 0.0), 0.0)}):
        with pytest.raises(ValueError, match="expected"):
            env.reset(options=options)
        with pytest.raises(RuntimeError, match=r"reset\(\)"):
            env.unwrapped.episode  # noqa: B018 - not even half of one
    env.reset(seed=0)
    env.step(1)
    told = env.unwrapped.episode
    with pytest.raises(ValueError, match=r"option scene is .*expected that of the episode"):
        env.reset(options={"episode": told, "scene": toy_specs[1]})
    for wrong, said in (
        ({"kind": "quiz"}, "kind of option episode is 'quiz', expected one of"),
        ({"start_position": (0.0, np.nan, 0.0)}, "start of option episode is .*finite"),
        ({"instruction": "  "}, "instruction of option episode is '  '"),
        ({"targets": (3,)}, "targets of option episode is"),
    ):
        episode = replace(told, **wrong)
        with pytest.raises(ValueError, match=said):
            env.reset(options={"episode": episode})
        with pytest.raises(ValueError, match=said.replace("option episode", r"episodes\[0\]")):
            make(scene=None, episodes=[episode], episodes_per_scene=None)
