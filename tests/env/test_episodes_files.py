"""Episode files: ours, R2R-CE's and ObjectNav's, and what is said of those that cannot be read."""

from __future__ import annotations

import gzip
import json
import logging
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from openmap_env.episodes import Episode, Target, load_episodes, read_episodes, write_episodes
from openmap_env.episodes.fields import heading_of
from openmap_env.episodes.readers import complete, same_scene
from openmap_scenes import DataError, load_scene
from openmap_scenes.formats.checked_json import Value

TARGET = Target(4, (1.0, 0.5, -2.0), (0.5, 0.0, -2.5), (1.5, 1.0, -1.5))
EPISODE = Episode(
    "a", "toy:0", "Find the “blue” armchair.", "object_goal", (0.1, 0.0, -0.3), 1.25, (TARGET,), {"x": [1]}
)


def test_our_own_files_give_back_what_was_written(tmp_path):
    episodes = [EPISODE, replace(EPISODE, episode_id="b", kind="demand", instruction="Müde.", targets=(TARGET, TARGET))]
    write_episodes(tmp_path / "deep" / "e.jsonl", episodes)
    assert read_episodes(tmp_path / "deep" / "e.jsonl") == episodes
    assert load_episodes(tmp_path / "deep") == episodes
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["e.jsonl"], "no temporary file is left"


def test_a_failed_write_leaves_the_old_file(tmp_path):
    write_episodes(tmp_path / "e.jsonl", [EPISODE])
    with pytest.raises(ValueError, match="JSON"):
        write_episodes(tmp_path / "e.jsonl", [EPISODE, replace(EPISODE, start_heading=math.nan)])
    assert read_episodes(tmp_path / "e.jsonl") == [EPISODE]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "riddle"}, "riddle"),
        ({"instruction": "  "}, "instruction"),
        ({"targets": []}, "at least one target"),
        ({"start_position": [0, None, 0]}, "start_position"),
        ({"start_heading": "north"}, "start_heading"),
        ({"targets": [{"instance_id": 1}]}, "targets\\[0\\].aabb_min"),
        ({"targets": [{**TARGET.__dict__, "aabb_min": [9, 9, 9]}]}, "box"),
        ({"targets": [{**TARGET.__dict__, "instance_id": -1}]}, "instance_id"),
        ({"targets": {"a": 1}}, "targets"),
        ({"start_position": [0, 10**400, 0]}, "start_position"),
        ({"info": [1]}, "info"),
        ({"scene": 3}, "scene"),
    ],
)
def test_a_bad_line_is_named(tmp_path, change, said):
    path = tmp_path / "e.jsonl"
    write_episodes(path, [EPISODE])
    good = path.read_text()
    path.write_text(good + json.dumps({**json.loads(good), **change}) + "\n")
    with pytest.raises(DataError, match=said) as error:
        read_episodes(path)
    assert "e.jsonl:2" in str(error.value)


def test_what_is_no_episode_file_is_refused(tmp_path):
    for name, content in (
        ("a.json", b"[1]"),
        ("b.json.gz", b"not gzip"),
        ("c.json.gz", gzip.compress(b"{")),
        ("d.json", b"{}"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DataError, match=name):
            load_episodes(tmp_path / name)
    whole = gzip.compress(json.dumps({"episodes": []}).encode() * 50)
    (tmp_path / "e.json.gz").write_bytes(whole[:-9])
    with pytest.raises(DataError, match="may be incomplete"):
        load_episodes(tmp_path / "e.json.gz")
    with pytest.raises(DataError, match="no such file"):
        load_episodes(tmp_path / "missing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="no episode file"):
        load_episodes(tmp_path / "empty")


@given(st.floats(-3.1, 3.1))
@settings(deadline=None, max_examples=50)
def test_headings_come_back_from_their_quaternions(heading):
    quaternion = Rotation.from_euler("y", heading).as_quat().tolist()
    assert heading_of(Value(quaternion, "test", "start_rotation")) == pytest.approx(heading, abs=1e-6)


@pytest.mark.parametrize(
    "quaternion", [[0, 0, 0, 0], [1, 2], [0.7071068, 0, 0, 0.7071068], "0001", [0, 0, 0, math.nan]]
)
def test_what_is_no_heading_is_refused(quaternion):
    with pytest.raises(DataError, match="start_rotation"):
        heading_of(Value(quaternion, "test", "start_rotation"))


def test_r2r_files_as_their_ground_truth_starts(shared_scenes):
    episodes = load_episodes(shared_scenes / "episodes" / "r2r_ce" / "val")
    assert len(episodes) == 12
    raw = json.loads(gzip.decompress((shared_scenes / "episodes/r2r_ce/val/val.json.gz").read_bytes()))["episodes"]
    walked = json.loads(gzip.decompress((shared_scenes / "episodes/r2r_ce/val/val_gt.json.gz").read_bytes()))
    for episode, source in zip(episodes, raw, strict=True):
        assert episode.kind == "language_guided"
        assert episode.scene == f"mp3d:{(shared_scenes / 'mp3d' / 'aws_small_house').resolve()}"
        assert episode.instruction == " ".join(source["instruction"]["instruction_text"].split())
        assert episode.targets[0].centre == tuple(source["goals"][0]["position"])
        assert episode.targets[0].instance_id == 0
        assert episode.info["radius"] == 3.0
        # The ground truth's actions, played from the start's heading, must lead where it says they lead.
        truth = walked[episode.episode_id]
        turns = np.cumsum([{2: 1, 3: -1}.get(a, 0) for a in truth["actions"]])
        first = truth["actions"].index(1)
        heading = episode.start_heading + math.radians(15.0) * turns[first]
        step = np.subtract(truth["locations"][first + 1], truth["locations"][first])
        ahead = np.array([-math.sin(heading), 0.0, -math.cos(heading)])
        assert np.dot(step, ahead) == pytest.approx(0.25, abs=0.05)


def test_objectnav_goals_get_the_boxes_of_their_instances(shared_scenes):
    folder = shared_scenes / "episodes" / "objectnav" / "mp3d" / "v1" / "val"
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    scene = load_scene(spec)
    bare, boxed = load_episodes(folder, spec), load_episodes(folder, spec, scene)
    assert len(bare) == len(boxed) == 12
    raw = json.loads(gzip.decompress((folder / "content/aws_small_house.json.gz").read_bytes()))
    for without, episode, source in zip(bare, boxed, raw["episodes"], strict=True):
        category = source["object_category"]
        goals = raw["goals_by_category"][f"aws_small_house.glb_{category}"]
        assert episode.kind == "object_goal"
        assert category.replace("_", " ") in episode.instruction
        assert [scene.instance(t.instance_id).source_id for t in episode.targets] == [g["object_id"] for g in goals]
        assert all(t.instance_id == 0 and t.aabb_min == t.centre for t in without.targets)
        for target, goal in zip(episode.targets, goals, strict=True):
            np.testing.assert_allclose(target.centre, goal["position"], atol=0.01)
            assert np.all(np.subtract(target.aabb_max, target.aabb_min) > 0)
    assert load_episodes(folder / "val.json.gz", spec) == bare, "the file above content/ names the same episodes"
    assert load_episodes(folder / "content", spec) == bare


def test_a_goal_that_is_elsewhere_in_the_scene_stays_a_position(shared_scenes, toy_scene):
    folder = shared_scenes / "episodes" / "objectnav" / "mp3d" / "v1" / "val"
    episodes = load_episodes(folder, "mp3d:/x/aws_small_house", toy_scene)
    assert all(t.instance_id == 0 for e in episodes for t in e.targets)


def test_episodes_of_other_scenes_are_dropped_with_a_word(shared_scenes, caplog, tmp_path):
    raw = json.loads(gzip.decompress((shared_scenes / "episodes/r2r_ce/val/val.json.gz").read_bytes()))
    raw["episodes"][0]["scene_id"] = "mp3d/elsewhere/elsewhere.glb"
    (tmp_path / "val.json").write_text(json.dumps(raw))
    with caplog.at_level(logging.INFO):
        kept = load_episodes(tmp_path / "val.json", "mp3d:/data/aws_small_house")
    assert len(kept) == 11
    assert len([r for r in caplog.records if "dropped 1 of 12" in r.getMessage()]) == 1
    with pytest.raises(DataError, match="none of scene"):
        load_episodes(tmp_path / "val.json", "mp3d:/data/third")
    with pytest.raises(DataError, match="scene_spec"):
        load_episodes(tmp_path / "val.json")


R2R = {
    "episode_id": 7,
    "trajectory_id": 3,
    "scene_id": "mp3d/toy/toy.glb",
    "start_position": [0.0, 0.05, 0.0],
    "start_rotation": [0.0, 0.0, 0.0, 1.0],
    "info": {"geodesic_distance": 3.5},
    "goals": [{"position": [1.0, 0.0, 1.0], "radius": 3.0}],
    "instruction": {"instruction_text": "Go  to\nthe sofa. "},
    "reference_path": [[0.0, 0.05, 0.0], [1.0, 0.0, 1.0]],
}
OBJECTNAV = {
    "episode_id": "7",
    "scene_id": "mp3d/toy/toy.glb",
    "start_position": [0.0, 0.05, 0.0],
    "start_rotation": [0.0, 1.0, 0.0, 0.0],
    "info": {},
    "goals": [],
    "object_category": "tv_monitor",
}
GOALS = {"toy.glb_tv_monitor": [{"position": [1.0, 0.5, 1.0], "object_id": 3}, {"position": [2.0, 0.5, 1.0]}]}


def written(path, entry, shared=None):
    """A file with three entries, the last of them the given one; between them a good one."""
    good = R2R if shared is None else OBJECTNAV
    data = {
        "episodes": [good, {**good, "episode_id": 8}, entry],
        **({} if shared is None else {"goals_by_category": shared}),
    }
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"goals": []}, "goals"),
        ({"goals": [3]}, r"goals\[0\]"),
        ({"goals": [{"position": [1, 2]}]}, r"goals\[0\].position"),
        ({"goals": {"position": [1, 2, 3]}}, "goals"),
        ({"start_rotation": [0, 0, 0]}, "start_rotation"),
        ({"start_position": [0, 1e300, 0]}, "start_position"),
        ({"instruction": {}}, "instruction.instruction_text"),
        ({"instruction": []}, "instruction"),
        ({"scene_id": 5}, "scene_id"),
        ({"episode_id": [1]}, "episode_id"),
        ({"info": "near"}, "info"),
        ({"reference_path": [[0, 0]]}, r"reference_path\[0\]"),
    ],
)
def test_a_bad_r2r_entry_and_its_field_are_named(tmp_path, change, field):
    path = written(tmp_path / "val.json", {**R2R, **change})
    with pytest.raises(DataError, match=f"val.json: episode 2: .* {field}") as error:
        load_episodes(path, "mp3d:/data/toy")
    assert error.value.expected


@pytest.mark.parametrize(
    ("change", "shared", "said"),
    [
        ({"object_category": ""}, GOALS, "object_category"),
        ({"object_category": "bed"}, GOALS, "toy.glb_bed"),
        ({}, {"toy.glb_tv_monitor": 3}, "toy.glb_tv_monitor"),
        ({}, {"toy.glb_tv_monitor": [{"position": None}]}, r"toy.glb_tv_monitor\[0\].position"),
        ({"start_rotation": [0, 0, 0, 2]}, GOALS, "start_rotation"),
    ],
)
def test_a_bad_objectnav_entry_and_its_field_are_named(tmp_path, change, shared, said):
    path = written(tmp_path / "val.json", {**OBJECTNAV, **change}, shared)
    with pytest.raises(DataError, match=rf"val.json.*{said}"):
        load_episodes(path, "mp3d:/data/toy")


def test_a_good_entry_beside_is_read_as_it_is_meant(tmp_path):
    episode = load_episodes(written(tmp_path / "a.json", {**R2R, "episode_id": 9}), "mp3d:/data/toy")[0]
    assert (episode.episode_id, episode.instruction) == ("7", "Go to the sofa.")
    assert episode.start_heading == 0.0
    assert episode.info["reference_path"] == R2R["reference_path"]
    assert episode.info["geodesic_distance"] == 3.5
    found = load_episodes(written(tmp_path / "b.json", {**OBJECTNAV, "episode_id": 9}, GOALS), "mp3d:/data/toy")[0]
    assert found.instruction == "Find a tv monitor."
    assert abs(found.start_heading) == pytest.approx(math.pi)
    assert [t.centre for t in found.targets] == [(1.0, 0.5, 1.0), (2.0, 0.5, 1.0)]


def test_what_python_writes_for_infinity_does_not_spoil_a_file(tmp_path):
    path = written(tmp_path / "a.json", {**R2R, "episode_id": 9, "info": {"geodesic_distance": math.inf}})
    assert "Infinity" in path.read_text()
    episodes = load_episodes(path, "mp3d:/data/toy")
    write_episodes(tmp_path / "b.jsonl", episodes)
    assert read_episodes(tmp_path / "b.jsonl")[2].info["geodesic_distance"] is None


def test_scenes_are_found_in_the_folders_above(tmp_path):
    (tmp_path / "scene_datasets" / "mp3d" / "toy").mkdir(parents=True)
    (tmp_path / "scene_datasets" / "mp3d" / "toy" / "toy.glb").touch()
    (tmp_path / "episodes").mkdir()
    episodes = load_episodes(written(tmp_path / "episodes" / "val.json", {**R2R, "episode_id": 9}))
    assert episodes[0].scene == f"mp3d:{tmp_path.resolve()}/scene_datasets/mp3d/toy"


def test_a_scene_gives_rounded_boxes_their_digits_back(toy_scene):
    bed = toy_scene.instances[0]
    off = tuple(float(x) + 0.0004 for x in bed.centre)
    rounded = Target(bed.id, off, tuple(map(float, bed.aabb_min)), tuple(map(float, bed.aabb_max)))
    elsewhere = replace(rounded, centre=(0.0, 0.0, 0.0))
    done = complete(replace(EPISODE, targets=(rounded, elsewhere, TARGET)), toy_scene)
    assert done.targets[0].centre == tuple(bed.centre)
    assert done.targets[1:] == (elsewhere, TARGET)


def test_packed_files_are_the_same_bytes_each_time_and_hold_the_same(tmp_path):
    for name in ("a.jsonl.gz", "b.jsonl.gz"):
        write_episodes(tmp_path / name, [EPISODE])
    assert (tmp_path / "a.jsonl.gz").read_bytes() == (tmp_path / "b.jsonl.gz").read_bytes()
    assert read_episodes(tmp_path / "a.jsonl.gz") == [EPISODE]
    assert load_episodes(tmp_path / "b.jsonl.gz") == [EPISODE]


def test_a_small_file_that_unpacks_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("openmap_env.episodes.fields.LARGEST_FILE", 2**20)
    (tmp_path / "a.json.gz").write_bytes(gzip.compress(bytes(2**24)))
    with pytest.raises(DataError, match="unpacked"):
        load_episodes(tmp_path / "a.json.gz")


def test_scene_names_match_across_formats():
    assert same_scene("mp3d/a/a.glb", "mp3d:/data/mp3d/a/")
    assert same_scene("hm3d/00001-a/a.basis.glb", "hm3d:/data/00001-a")
    assert same_scene("homes:val/3", "homes:val/3")
    assert same_scene("homes:val/003", "homes:val/3")
    assert not same_scene("homes:val/30", "homes:val/3")
    assert not same_scene("homes:val/3", "homes:train/3")
    assert not same_scene("mp3d/a/a.glb", "mp3d:/data/mp3d/b")
