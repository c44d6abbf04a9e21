"""Tasks of VLMaps' object goal navigation: a subgoal is an episode, and the scene says what its kind of thing is."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from openmap_env.episodes import load_episodes
from openmap_env.episodes.source import EpisodeSource
from openmap_scenes import DataError, load_scene


def pose(position, heading):
    T_world_body = np.eye(4)
    T_world_body[:3, :3] = Rotation.from_euler("y", heading).as_matrix()
    T_world_body[:3, 3] = position
    return T_world_body


def task(number=0, goals=("sofa", "chair"), position=(-1.0, 0.0, 0.0), heading=0.5, **changes):
    return {
        "task_id": number,
        "tf_habitat": pose(position, heading).ravel().tolist(),
        "map_grid_size": 1000,
        "map_cell_size": 0.05,
        "scene": "toy",
        "instruction": "go to the sofa, then to the chair",
        "objects_info": [{"name": name} for name in goals],
        **changes,
    }


@pytest.fixture
def write(tmp_path):
    def _write(*tasks):
        path = tmp_path / "toy_1" / "object_navigation_tasks.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(tasks))
        return path

    return _write


def test_every_subgoal_is_an_episode_that_starts_where_its_task_does(write):
    rows = pose((1.0, 0.0, 2.0), -2.0).tolist()
    path = write(task(), task(1, ("bed",), instruction=" find a\nbed ", tf_habitat=rows))
    first, second, third = load_episodes(path, "toy:toy")
    assert [e.episode_id for e in (first, second, third)] == ["0-0", "0-1", "1"]
    assert first.start_position == second.start_position == (-1.0, 0.0, 0.0)
    assert first.start_heading == second.start_heading == pytest.approx(0.5)
    assert third.start_position == (1.0, 0.0, 2.0)
    assert third.start_heading == pytest.approx(-2.0)
    assert [e.instruction for e in (first, second, third)] == ["Go to a sofa.", "Go to a chair.", "find a bed"]
    assert second.info["subgoals"] == ["sofa", "chair"]
    assert second.info["subgoal"] == 1
    assert second.info["task_instruction"] == "go to the sofa, then to the chair"
    assert load_episodes(path.parent, "toy:toy") == [first, second, third]


def test_the_scene_says_which_things_are_meant(write, toy_scene, toy_specs):
    path = write(task(goals=("armchair", "dining_table"), scene="0"))
    targets = [e.targets for e in load_episodes(path, toy_specs[0], toy_scene)]
    assert [[toy_scene.instance(t.instance_id).category for t in ts] for ts in targets] == [
        ["armchair", "armchair"],
        ["dining table"],
    ]
    source = EpisodeSource(toy_specs[0], path)
    bare = source.of(toy_specs[0], toy_scene, None)
    assert [e.targets for e in bare] == [(), ()]
    assert [source.complete(e, toy_scene).targets for e in bare] == targets


def test_what_is_on_another_storey_is_not_meant(write, toy_scene):
    for height in (-2.5, 3.0):
        path = write(task(goals=("bed",), position=(0.0, height, 0.0)))
        with pytest.raises(DataError, match="1 things called 'bed' in the home and none on the storey"):
            load_episodes(path, "toy:toy", toy_scene)
    with pytest.raises(DataError, match="0 things called 'piano'"):
        load_episodes(write(task(goals=("piano",))), "toy:toy", toy_scene)


def test_names_are_matterports(write, shared_scenes):
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    scene = load_scene(spec)
    start = (-6.16, 0.05, -0.8)
    path = write(task(goals=("chest_of_drawers", "sofa"), scene="aws_small_house", position=start))
    for episode in load_episodes(path, spec, scene):
        things = {scene.instance(t.instance_id).mpcat40 for t in episode.targets}
        assert things == {episode.info["things_called"]}
        same = [i for i in scene.instances if i.mpcat40 == episode.info["things_called"]]
        assert len(episode.targets) == len(same)


def test_scenes_are_found_by_their_name(write, tmp_path):
    folder = tmp_path / "scene_datasets" / "mp3d" / "toy"
    folder.mkdir(parents=True)
    (folder / "toy.glb").touch()
    assert load_episodes(write(task()))[0].scene == f"mp3d:{folder.resolve()}"
    with pytest.raises(DataError, match="scene_spec"):
        load_episodes(write(task(scene="other")))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"objects_info": []}, "objects_info"),
        ({"objects_info": [{}]}, r"objects_info\[0\].name"),
        ({"objects_info": 3}, "objects_info"),
        ({"tf_habitat": [1, 2]}, "tf_habitat"),
        ({"tf_habitat": [0] * 16}, "tf_habitat"),
        ({"tf_habitat": np.diag([1, 1, -1, 1]).ravel().tolist()}, "tf_habitat"),
        ({"tf_habitat": (2 * np.eye(4)).ravel().tolist()}, "tf_habitat"),
        ({"tf_habitat": ["x", *np.eye(4).ravel().tolist()[1:]]}, r"tf_habitat\[0\]"),
        ({"instruction": None}, "instruction"),
        ({"task_id": 1.5}, "task_id"),
        ({"scene": 5}, "scene"),
    ],
)
def test_a_bad_task_and_its_field_are_named(write, change, said):
    path = write(task(), task(1, **change))
    with pytest.raises(DataError, match=f"tasks.json: episode 1: .*{said}"):
        load_episodes(path, "toy:toy")


def test_a_pose_that_looks_up_has_no_heading(write):
    tilted = np.eye(4)
    tilted[:3, :3] = Rotation.from_euler("x", math.pi / 2).as_matrix()
    with pytest.raises(DataError, match="straight up or down"):
        load_episodes(write(task(tf_habitat=tilted.ravel().tolist())), "toy:toy")
