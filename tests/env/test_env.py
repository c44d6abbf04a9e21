"""The environment as an agent and a learning library meet it."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

from openmap_env.actions import Action
from openmap_env.env import OpenMapNavEnv
from openmap_env.episodes import Episode, write_episodes
from openmap_env.episodes.readers import target_of
from openmap_env.goals import way_to
from openmap_env.navigation import ShortestPathFollower
from openmap_scenes import DataError

SMALL = {"width": 64, "height": 48}


@pytest.fixture
def make(toy_specs):
    """Makes environments in the toy home and closes them."""
    made = []

    def make(**settings):
        env = gym.make("OpenMapNav-v0", **{"scene": toy_specs[0], "episodes_per_scene": 9, **SMALL, **settings})
        made.append(env)
        return env

    yield make
    for env in made:
        env.close()


def same(a, b):
    return a.keys() == b.keys() and all(
        a[k].tobytes() == b[k].tobytes() if isinstance(a[k], np.ndarray) else a[k] == b[k] for k in a
    )


@pytest.mark.parametrize("renderer", ["opengl", "pyrender", "raycast"])
def test_it_works_on_a_scan_with_every_renderer(shared_scenes, renderer):
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    env = gym.make("openmap_env:OpenMapNav-v0", scene=spec, renderer=renderer, episodes_per_scene=3, **SMALL)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert observation["rgb"].std() > 10.0
    assert 0.0 < observation["depth"].max() < 30.0
    for action in (1, 2, 4, 1):
        observation, *_ = env.step(action)
        assert env.observation_space.contains(observation)
    info = env.step(0)[4]
    assert info["metrics"]["steps"] == 5
    env.close()


def test_the_same_seed_gives_the_same_bytes_whatever_ran_before(make):
    def run(env, seed):
        seen = [env.reset(seed=seed)[0], env.step(1)[0], env.step(2)[0], env.reset()[0]]
        return seen, env.unwrapped.episode.episode_id

    first, second = make(), make()
    (a, name_a), (b, name_b) = run(first, 0), run(second, 0)
    assert name_a == name_b
    assert all(same(x, y) for x, y in zip(a, b, strict=True))
    run(second, 5)
    again, _ = run(second, 0)
    assert all(same(x, y) for x, y in zip(a, again, strict=True)), "what ran before leaves no trace"
    names = {run(first, seed)[1] for seed in range(12)}
    assert len(names) > 3, "seed 0 is a seed, and seeds differ"


def test_gps_and_compass_follow_habitats_convention(make):
    env = make(protocol="navigation")
    observation, _ = env.reset(options={"episode": 0, "start": ((-4.0, 0.0, 0.0), -math.pi / 2)})  # faces +x
    np.testing.assert_allclose(observation["gps"], [0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(observation["compass"], [0.0], atol=1e-6)
    for _ in range(4):
        observation, *_ = env.step(Action.MOVE_FORWARD)
    np.testing.assert_allclose(observation["gps"], [1.0, 0.0], atol=1e-5)  # ahead of the start
    for _ in range(6):
        observation, *_ = env.step(Action.TURN_RIGHT)
    np.testing.assert_allclose(observation["compass"], [-math.pi / 2], atol=1e-5)
    observation, *_ = env.step(Action.MOVE_FORWARD)
    np.testing.assert_allclose(observation["gps"], [1.0, 0.25], atol=1e-5)  # to the right of it
    np.testing.assert_allclose(
        env.unwrapped.simulator.position, [-3.0, 0.0, 0.25], atol=1e-5
    )  # +x, and right of it is +z


def test_the_camera_pose_is_in_the_frame_of_the_start(make):
    env = make(protocol="navigation", camera_height=1.1)
    observation, _ = env.reset(seed=1)
    expected = np.eye(4)
    expected[1, 3] = 1.1
    np.testing.assert_allclose(observation["T_episode_camera"], expected, atol=1e-6)
    for action in (2, 2, 1, 1, 3, 5, 1, 4, 4):
        observation, *_ = env.step(action)
        unwrapped = env.unwrapped
        T_world_camera = unwrapped.T_world_episode @ observation["T_episode_camera"].astype(float)
        np.testing.assert_allclose(T_world_camera, unwrapped.simulator.T_world_camera, atol=1e-5)
        ahead, right = observation["gps"]
        np.testing.assert_allclose(observation["T_episode_camera"][[2, 0], 3], [-ahead, right], atol=1e-5)


def test_depth_and_pose_put_the_scene_where_it_is(make, toy_scene):
    env = make(sensors=("rgb", "depth", "semantic"))
    observation, _ = env.reset(seed=0)
    for action in (2, 2, 5):
        observation, *_ = env.step(action)
    T_world_camera = env.unwrapped.T_world_episode @ observation["T_episode_camera"]
    points = env.unwrapped.camera.unproject(observation["depth"][..., 0], T_world_camera)
    ids = observation["semantic"][..., 0]
    assert (ids > 0).mean() > 0.9
    for i in np.unique(ids[ids > 0]):
        instance, seen = toy_scene.instance(int(i)), points[ids == i]
        assert (seen >= instance.aabb_min - 0.02).all()
        assert (seen <= instance.aabb_max + 0.02).all()


def test_in_retrieval_the_frame_outlives_the_episode_and_in_navigation_it_does_not(make):
    def frames(env):
        return {env.reset(seed=seed)[1]["episode_frame"] for seed in range(5)}

    assert len(frames(make(protocol="retrieval"))) == 1
    assert len(frames(make(protocol="navigation"))) > 1


def test_the_frame_token_names_scene_and_start(make, toy_specs):
    env = make(scene=toy_specs, protocol="navigation")
    start = ((-4.0, 0.0, 0.0), 1.0)

    def token(spec, where):
        return env.reset(options={"scene": spec, "start": where, "instruction": "Go."})[1]["episode_frame"]

    one = token(toy_specs[0], start)
    assert token(toy_specs[0], start) == one
    assert token(toy_specs[1], start) != one
    assert token(toy_specs[0], (start[0], 1.1)) != one


def test_stop_ends_and_time_runs_out(make):
    env = make(max_steps=3)
    env.reset(seed=0)
    assert env.step(2)[2:4] == (False, False)
    _, reward, terminated, truncated, info = env.step(0)
    assert (terminated, truncated) == (True, False)
    assert reward == pytest.approx(info["metrics"]["sr_1"] - 0.001)
    env.reset(seed=0)
    results = [env.step(2) for _ in range(3)]
    assert [r[2:4] for r in results] == [(False, False), (False, False), (False, True)]
    assert ["metrics" in r[4] for r in results] == [False, False, True]
    assert results[-1][4]["metrics"]["nav_success"] == 0.0
    with pytest.raises(RuntimeError, match="reset"):
        env.step(1)


def test_who_declares_the_targets_wins_and_who_declares_elsewhere_does_not(make):
    env = make()
    for index in range(9):
        env.reset(options={"episode": index})
        unwrapped = env.unwrapped
        T_episode_world = np.linalg.inv(unwrapped.T_world_episode)
        centres = np.array([t.centre for t in unwrapped.episode.targets])
        places = centres @ T_episode_world[:3, :3].T + T_episode_world[:3, 3]
        unwrapped.declare([[99.0, 0.0, 0.0], *places])
        unwrapped.declare(places.astype(np.float32))
        _, reward, _, _, info = env.step(0)
        assert info["metrics"]["sr_1"] == 1.0
        assert reward == pytest.approx(0.999)
        env.reset(options={"episode": index})
        unwrapped.declare(np.concatenate([np.full((4, 3), 50.0), places[:1]]))
        metrics = env.step(0)[4]["metrics"]
        assert [metrics[f"sr_{k}"] for k in (1, 4, 8, 16)] == [0.0, 0.0, 1.0, 1.0]


def test_the_follower_walks_to_every_target(make):
    env = make(protocol="navigation", max_steps=200)
    for index in range(9):
        env.reset(options={"episode": index})
        simulator, walk = env.unwrapped.simulator, env.unwrapped.episode
        way = way_to(simulator.surface, simulator.scene, walk.targets, island=0)
        follower, over = ShortestPathFollower(simulator.surface, way), False
        while not over:
            _, reward, over, truncated, info = env.step(follower.next_action(simulator.position, simulator.heading))
            over = over or truncated
        assert info["metrics"]["nav_success"] == 1.0, walk.instruction
        assert info["metrics"]["spl"] > 0.7
        assert reward == pytest.approx(0.999)


def test_nothing_gives_the_answer_away_before_the_end(make):
    env = make()
    observation, info = env.reset(seed=2)
    assert set(observation) == {"rgb", "depth", "T_episode_camera", "gps", "compass", "instruction"}
    for told in (info, env.step(1)[4]):
        assert set(told) == {"episode_id", "kind", "episode_frame", "collided"}
    # The same episode elsewhere in the world looks alike: nothing that is told depends on world coordinates but the opaque token.
    assert env.unwrapped.episode.scene not in str(info)


@pytest.mark.parametrize(
    "positions",
    [
        [1.0, 2.0, 3.0],
        [[1.0, 2.0]],
        [[1.0, 2.0, math.nan]],
        [[math.inf, 0, 0]],
        "here",
        [["a", "b", "c"]],
        [[1, 2, 3], [4]],
    ],
)
def test_a_bad_declaration_is_refused_and_says_why(make, positions):
    env = make()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"\(k, 3\)"):
        env.unwrapped.declare(positions)


def test_declaring_nothing_takes_a_declaration_back_and_after_the_end_it_is_too_late(make):
    env = make()
    env.reset(seed=0)
    env.unwrapped.declare([[0.0, 0.0, 0.0]])
    env.unwrapped.declare([])
    assert len(env.unwrapped._walk.declared) == 0
    env.step(0)
    with pytest.raises(RuntimeError, match="reset"):
        env.unwrapped.declare([[0.0, 0.0, 0.0]])


@pytest.mark.parametrize("action", [6, -1, 1.5, "left", None])
def test_a_bad_action_is_refused(make, action):
    env = make().unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match="0 to 5"):
        env.step(action)


def test_collisions_are_told_and_counted(make):
    env = make()
    env.reset(options={"episode": 0, "start": ((-4.0, 0.0, 1.0), math.pi)})  # faces the wardrobe
    collided = [env.step(1)[4]["collided"] for _ in range(4)]
    assert collided[-1]
    assert env.step(0)[4]["metrics"]["collisions"] == sum(collided)


def test_accented_and_greek_instructions_are_fine(make):
    env = make()
    text = "Où est l’évier ? Ich bin müde… Πού είναι το κρεβάτι; Где стол?"
    observation, _ = env.reset(options={"instruction": text})
    assert env.observation_space.contains(observation)


def given_episodes(toy_scene, specs):
    chair = target_of(toy_scene.instances[8])
    return [
        Episode("one", specs[0], "Find the chair.", "object_goal", (-4.0, 0.0, 0.0), 0.5, (chair,)),
        Episode("two", specs[0], "I want to sit down.", "demand", (0.0, 0.0, 0.0), -0.5, (chair,)),
        Episode("far", specs[1], "Find the chair again.", "object_goal", (0.0, 0.0, 0.0), 0.0, (chair,)),
    ]


def test_given_episodes_come_from_a_list_or_a_file(toy_scene, toy_specs, tmp_path, make):
    episodes = given_episodes(toy_scene, toy_specs)
    write_episodes(tmp_path / "e.jsonl", episodes)
    for source in (episodes, str(tmp_path / "e.jsonl")):
        env = make(scene=None, episodes=source, protocol="navigation")
        names = {env.reset(seed=seed)[1]["episode_id"] for seed in range(12)}
        assert names == {"one", "two", "far"}
        env.reset(options={"episode": "two"})
        assert env.unwrapped.episode == episodes[1]
        np.testing.assert_allclose(env.unwrapped.simulator.position, (0.0, 0.0, 0.0), atol=1e-6)
    retrieval = make(scene=None, episodes=episodes)
    retrieval.reset(options={"episode": "two"})
    np.testing.assert_allclose(retrieval.unwrapped.simulator.position, (-4.0, 0.0, 0.0), atol=1e-6)
    assert retrieval.unwrapped.simulator.heading == pytest.approx(0.5)


def test_a_file_of_another_home_is_refused(toy_scene, toy_specs, tmp_path):
    write_episodes(tmp_path / "e.jsonl", given_episodes(toy_scene, toy_specs))
    with pytest.raises(DataError, match="none of scene"):
        OpenMapNavEnv(scene="homes:val/7", episodes=tmp_path / "e.jsonl")


def test_files_of_others_run(shared_scenes):
    folder = shared_scenes / "episodes" / "objectnav" / "mp3d" / "v1" / "val"
    env = gym.make("OpenMapNav-v0", episodes=folder, protocol="navigation", **SMALL)
    env.reset(options={"episode": 0})
    episode = env.unwrapped.episode
    assert all(t.instance_id > 0 and t.aabb_max[1] > t.aabb_min[1] for t in episode.targets), "goals have their boxes"
    metrics = env.step(0)[4]["metrics"]
    # Habitat measured to a view point at most 1 m or so from the thing; we measure to where a body touches it.
    assert metrics["distance_to_goal"] == pytest.approx(episode.info["geodesic_distance"], abs=1.5)
    env.close()
