"""Matterport3D's format against ground truth that nobody of this project wrote, and against broken files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from openmap_scenes import DataError, load_scene

SCAN = "aws_small_house"


@pytest.fixture(scope="module")
def house(shared_scenes: Path):
    return load_scene(f"mp3d:{shared_scenes / 'mp3d' / SCAN}")


@pytest.fixture(scope="module")
def truth(shared_scenes: Path):
    return json.loads((shared_scenes / f"ground_truth_{SCAN}.json").read_text())


def test_instances_equal_the_ground_truth(house, truth):
    by_source = {i.source_id: i for i in house.instances}
    assert len(by_source) == len(truth["instances"])
    for expected in truth["instances"]:
        instance = by_source[expected["mp3d_object_index"]]
        np.testing.assert_allclose(instance.aabb_min, expected["aabb_min"], atol=1e-3)
        np.testing.assert_allclose(instance.aabb_max, expected["aabb_max"], atol=1e-3)
        np.testing.assert_allclose(instance.centre, expected["center"], atol=1e-3)
        assert instance.category == (expected["category"] or "unlabelled")
        assert instance.room == expected["room"]
        assert instance.id == expected["mp3d_object_index"] + 1


def test_rooms_equal_the_ground_truth(house, truth):
    assert [r.name for r in house.rooms] == [r["name"] for r in truth["rooms"]]
    for room, expected in zip(house.rooms, truth["rooms"], strict=True):
        np.testing.assert_allclose(room.aabb_min, expected["aabb_min"], atol=1e-3)
        np.testing.assert_allclose(room.aabb_max, expected["aabb_max"], atol=1e-3)


def test_faces_of_the_picture_carry_the_ids_of_the_semantic_mesh(house, truth):
    counts = np.bincount(house.face_instance, minlength=len(truth["instances"]) + 1)
    for expected in truth["instances"]:
        assert counts[expected["mp3d_object_index"] + 1] == expected["faces"], expected["source_name"]


def test_the_house_stands_upright(house):
    low, high = house.aabb
    assert abs(low[1]) < 0.05
    assert 2.5 < high[1] < 3.5
    floors = [i for i in house.instances if i.category == "floor"]
    assert all(i.aabb_max[1] < 0.1 for i in floors)


@pytest.mark.parametrize(
    ("broken", "says"),
    [
        ("01_truncated_glb", ["aws_small_house.glb", "300000", "4259640"]),
        ("02_house_missing_region", ["aws_small_house.house", "object 70", "region 3", "6", "5"]),
        ("03_semantic_ids_beyond_table", ["_semantic.ply", "object_id", "0..118"]),
    ],
)
def test_broken_files_end_in_one_clear_error(shared_scenes, tmp_path, broken, says):
    folder = tmp_path / SCAN
    shutil.copytree(shared_scenes / "mp3d" / SCAN, folder)
    for item in folder.iterdir():
        item.chmod(0o644)
    folder.chmod(0o755)
    for replacement in (shared_scenes / "broken" / broken / SCAN).iterdir():
        (folder / replacement.name).unlink()
        shutil.copy(replacement, folder / replacement.name)
    with pytest.raises(DataError) as caught:
        load_scene(f"mp3d:{folder}")
    for words in says:
        assert words in str(caught.value)


def test_a_folder_that_is_no_scan_is_named(tmp_path):
    with pytest.raises(DataError, match=r"0 \.house files"):
        load_scene(f"mp3d:{tmp_path}")


def test_an_unknown_spec_lists_the_known_ones():
    with pytest.raises(DataError, match="mp3d:"):
        load_scene("nonsense:1")
