"""The arguments of the environment and the options of its reset: what they do, and what is said of those that cannot be used."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

from openmap_env.env import OpenMapNavEnv
from openmap_env.measures import PathLength
from openmap_env.settings import scene_specs

SMALL = {"width": 32, "height": 24, "episodes_per_scene": 6}


@pytest.fixture
def make(toy_specs):
    """Makes environments in the toy homes and closes them."""
    made = []

    def make(**settings):
        env = gym.make("OpenMapNav-v0", **{"scene": toy_specs, **SMALL, **settings})
        made.append(env)
        return env

    yield make
    for env in made:
        env.close()


class Nameless:
    needs_targets = False

    def value(self, walk):
        return 0.0


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"scene": []}, "scene is .*at least one"),
        ({"scene": 3}, "scene is 3, expected a catalogue spec"),
        ({"scene": ["toy:0", 3]}, "scene is .*expected a catalogue spec"),
        ({"scene": ""}, "scene is"),
        ({"scene": "moon:1"}, "moon"),
        ({"scene": "homes:vla"}, "homes:val"),
        ({"episodes": []}, "episodes is .*at least one"),
        ({"episodes": [3]}, r"episodes\[0\] is 3"),
        ({"episodes": [{"episode_id": "one"}]}, r"episodes\[0\]"),
        ({"episodes": 3}, "episodes is 3"),
        ({"sensors": "rgb"}, "sensors is 'rgb', expected a list"),
        ({"sensors": ()}, "sensors is .*one or more"),
        ({"sensors": ("rgb", "lidar")}, "sensors is .*lidar.*semantic"),
        ({"sensors": ("rgb", "rgb")}, "sensors is .*each once"),
        ({"width": 1e9}, "width is 1000000000.0, expected an integer"),
        ({"width": 10**9}, "width is 1000000000, expected an integer from 1 to"),
        ({"height": 0}, "height is 0"),
        ({"height": True}, "height is True"),
        ({"width": "640"}, "width is '640'"),
        ({"hfov_deg": 200.0}, "hfov_deg is 200.0, expected more than 0 and at most 179 degrees"),
        ({"hfov_deg": math.nan}, "hfov_deg is nan"),
        ({"camera_height": 9}, "camera_height is 9, expected more than 0 and at most 3 m"),
        ({"camera_height": None}, "camera_height is None, expected a number"),
        ({"body": 0.2}, "body is 0.2, expected"),
        ({"body": {"weight": 80}}, "body is .*radius, height, step_height"),
        ({"body": {"radius": -1}}, "body's radius is -1"),
        ({"body": {"height": 0.1}}, "body has .*height 0.1"),
        ({"forward_step": 0}, "forward_step is 0"),
        ({"forward_step": math.inf}, "forward_step is inf"),
        ({"turn_deg": -15}, "turn_deg is -15"),
        ({"look_deg": 500}, "look_deg is 500"),
        ({"max_steps": 0}, "max_steps is 0, expected an integer from 1 to"),
        ({"max_steps": 2.5}, "max_steps is 2.5"),
        ({"renderer": "blender"}, "renderer is 'blender', expected one of opengl"),
        ({"renderer": {"platform": "egl"}}, "renderer is .*as 'name'"),
        ({"renderer": {"name": "opengl", "shiny": True}}, "renderer 'opengl' takes no setting 'shiny'"),
        ({"renderer": None}, "renderer is None"),
        ({"protocol": "teleport"}, "protocol is 'teleport', expected one of retrieval, navigation"),
        ({"protocol": ["navigation"]}, "protocol is"),
        ({"protocol": np.array(["navigation", "retrieval"])}, "protocol is array.*expected one of"),
        ({"max_steps": 10**30}, "max_steps is 1000.*expected an integer from 1 to"),
        ({"measures": [PathLength]}, r"measures\[0\] is"),
        ({"measures": [Nameless()]}, r"measures\[0\] is"),
        ({"measures": [PathLength()]}, "'path_length' is"),
        ({"measures": PathLength()}, "measures is"),
        ({"episodes_per_scene": 0}, "episodes_per_scene is 0"),
        ({"episode_seed": -1}, "episode_seed is -1, expected an integer from 0 to"),
        ({"kinds": ()}, "kinds is"),
        ({"kinds": ("object_goal", "quiz")}, "kinds is .*quiz"),
        ({"prefetch": 1}, "prefetch is 1"),
        ({"render_mode": "hologram"}, "render_mode is 'hologram', expected None or one of rgb_array, human"),
    ],
)
def test_settings_that_make_no_sense_are_refused_by_name(toy_specs, settings, said):
    with pytest.raises(ValueError, match=said):
        OpenMapNavEnv(**{"scene": toy_specs[0], **settings})


def test_scenes_are_specs_ranges_splits_and_lists(toy_specs):
    assert scene_specs("homes:val/3") == ("homes:val/3",)
    assert scene_specs("homes:train/0-2") == ("homes:train/0", "homes:train/1", "homes:train/2")
    assert scene_specs("homes:val") == tuple(f"homes:val/{n}" for n in range(10))
    assert scene_specs(["homes:val/003", *toy_specs, "homes:val/3"]) == ("homes:val/3", *toy_specs)
    env = OpenMapNavEnv(scene="homes:test")
    assert env.settings.scenes == tuple(f"homes:test/{n}" for n in range(10))


def test_numbers_of_numpy_are_numbers(toy_specs):
    env = OpenMapNavEnv(scene=toy_specs[0], width=np.int64(32), hfov_deg=np.float32(90), max_steps=np.int32(5))
    assert (env.camera.width, env.max_steps) == (32, 5)


def test_a_measure_of_ones_own_is_told_at_the_end(make):
    class Turns:
        name = "stood"
        needs_targets = False

        def value(self, walk):
            return float(sum(np.array_equal(a, b) for a, b in zip(walk.path, walk.path[1:], strict=False)))

    env = make(measures=[Turns()])
    env.reset(seed=0)
    env.step(2)
    env.step(3)
    assert env.step(0)[4]["metrics"]["stood"] == 3.0


def test_each_option_alone(make, toy_specs):
    env = make(protocol="navigation")
    unwrapped = env.unwrapped
    env.reset(seed=0, options={"scene": toy_specs[1]})
    assert unwrapped.episode.scene == toy_specs[1]
    chosen = unwrapped.episodes[4]
    assert env.reset(options={"episode": chosen.episode_id})[1]["episode_id"] == chosen.episode_id
    env.reset(options={"episode": chosen})
    assert unwrapped.episode == chosen
    env.reset(options={"episode": np.int64(2)})
    assert (unwrapped.episode.scene, unwrapped.episode) == (toy_specs[0], unwrapped.episodes[2])
    env.reset(options={"episode": 6})
    assert (unwrapped.episode.scene, unwrapped.episode) == (toy_specs[1], unwrapped.episodes[0])
    observation, info = env.reset(options={"instruction": "What is this?"})
    assert (info["kind"], info["episode_id"], observation["instruction"]) == ("free", "free", "What is this?")
    metrics = env.step(0)[4]["metrics"]
    assert {"path_length", "steps"} <= set(metrics)
    assert not {"sr_1", "nav_success", "spl"} & set(metrics)
    env.reset(options={"start": ((-4.0, 0.0, 0.0), 1.0)})
    np.testing.assert_allclose(unwrapped.simulator.position, (-4.0, 0.0, 0.0), atol=1e-6)
    assert unwrapped.simulator.heading == pytest.approx(1.0)
    for nothing in (None, {}, dict.fromkeys(("scene", "episode", "instruction", "start"))):
        env.reset(seed=3, options=nothing)
        drawn = unwrapped.episode
        env.reset(seed=3)
        assert unwrapped.episode == drawn


def test_options_combine(make, toy_specs):
    env = make(protocol="navigation")
    unwrapped = env.unwrapped
    env.reset(seed=0, options={"scene": toy_specs[1]})
    chosen, start = unwrapped.episodes[4], ((-4.0, 0.0, 0.0), 1.0)
    env.reset(options={"scene": toy_specs[1], "episode": 4})
    assert unwrapped.episode == chosen
    observation, _ = env.reset(
        options={"scene": toy_specs[1], "episode": 4, "instruction": "Where do I sit?", "start": start}
    )
    assert observation["instruction"] == "Where do I sit?"
    assert unwrapped.episode.targets == chosen.targets
    assert (unwrapped.episode.start_position, unwrapped.episode.start_heading) == start
    env.reset(options={"scene": toy_specs[0], "instruction": "What is this?", "start": start})
    assert (unwrapped.episode.scene, unwrapped.episode.targets) == (toy_specs[0], ())
    np.testing.assert_allclose(unwrapped.simulator.position, start[0], atol=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([1], r"options is \[1\], expected None or a dict"),
        ("scene", "options is 'scene'"),
        ({"sceen": "x"}, "sceen.*expected any of scene, episode, instruction, start"),
        ({3: "x"}, "unknown 3"),
        ({"episode": "nobody"}, "'nobody', expected one of the 12 episodes"),
        ({"episode": 99}, "99, expected one of the 12"),
        ({"episode": -1}, "-1"),
        ({"episode": 1.5}, "option episode is 1.5"),
        ({"episode": True}, "option episode is True"),
        ({"instruction": ""}, "1 to"),
        ({"instruction": "口渴"}, "characters"),
        ({"instruction": 7}, "text"),
        ({"start": (0.0, 0.0)}, "option start"),
        ({"start": "door"}, "option start"),
        ({"start": ((0.0, 0.0, math.nan), 0.0)}, "option start.*finite"),
        ({"start": ((90.0, 0.0, 0.0), 0.0)}, "not navigable"),
        ({"scene": 3}, "option scene is 3, expected a catalogue spec"),
        ({"scene": "moon:1"}, "moon"),
        ({"scene": "homes:val/0-3"}, "one scene; these are 4"),
    ],
)
def test_options_that_cannot_be_used_are_refused(make, options, said):
    env = make(protocol="navigation")
    with pytest.raises(ValueError, match=said):
        env.reset(seed=0, options=options)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation), "and the environment lives on"


def test_seeds_are_gymnasiums(make):
    env = make()
    with pytest.raises(gym.error.Error, match="-1"):
        env.reset(seed=-1)
    assert env.reset(seed=0)[1] == env.reset(seed=0)[1]
    names = [env.reset()[1]["episode_id"] for _ in range(6)]
    env.reset(seed=0)
    assert [env.reset()[1]["episode_id"] for _ in range(6)] == names, "given once, it goes on"
