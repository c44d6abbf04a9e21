"""Matterport3D's format against ground truth that nobody of this project wrote, and against broken files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st
from tiny_scans import BOXES, boxes_mesh, boxes_ply, house_text, write_mp3d, write_raw_mp3d

from openmap_scenes import DataError
from openmap_scenes.formats.house import read_house
from openmap_scenes.formats.mp3d import files_mp3d, read_mp3d
from openmap_scenes.formats.transfer import _nearest_faces, transfer_face_ids

SCAN = "aws_small_house"


@pytest.fixture(scope="module")
def house(shared_scenes: Path):
    return read_mp3d(shared_scenes / "mp3d" / SCAN)


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
        if expected["category"]:  # of what is not labelled the file does not say the class either
            assert instance.mpcat40 == expected["mpcat40"]


def test_rooms_equal_the_ground_truth(house, truth):
    assert [r.name for r in house.rooms] == [r["name"] for r in truth["rooms"]]
    assert [r.id for r in house.rooms] == [r["id"] for r in truth["rooms"]]
    assert {r.level for r in house.rooms} == {0}
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
        ("03_semantic_ids_beyond_table", ["_semantic.ply", "207 faces", "object_id", "first: 5000", "0..118"]),
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
        read_mp3d(folder)
    for words in says:
        assert words in str(caught.value)


def check_tiny(scene, lamp_faces: int = 12) -> None:
    assert [(i.id, i.source_id, i.category, i.room) for i in scene.instances] == [
        (1, 0, "sofa", 0),
        (2, 1, "floor lamp", 1),
    ]
    assert [i.mpcat40 for i in scene.instances] == ["sofa", "lighting"]
    for instance, (low, high) in zip(scene.instances, BOXES, strict=True):
        np.testing.assert_allclose(instance.aabb_min, low, atol=1e-6)
        np.testing.assert_allclose(instance.aabb_max, high, atol=1e-6)
    assert np.bincount(scene.face_instance).tolist() == [12 - lamp_faces, 12, lamp_faces]
    # The file lists the upper storey first.
    assert [(r.name, r.level) for r in scene.rooms] == [("living room", 0), ("bedroom", 1)]
    np.testing.assert_allclose(scene.rooms[1].aabb_min, [-3, 3, -3])


def test_a_tiny_scan_in_habitat_s_layout_by_folder_house_or_mesh(tmp_path):
    folder = write_mp3d(tmp_path / "anything")
    for path in (folder, folder / "tiny.house", folder / "tiny.glb"):
        scene = read_mp3d(path)
        check_tiny(scene)
        assert scene.name == "tiny"
        assert {f.name for f in files_mp3d(path)} == {"tiny.glb", "tiny.house", "tiny_semantic.ply"}


@pytest.mark.parametrize(
    "without",
    [[], [".fsegs.json"], [".semseg.json"], [".fsegs.json", ".semseg.json"]],
)
def test_a_tiny_scan_in_the_layout_of_the_download(tmp_path, without):
    folder = write_raw_mp3d(tmp_path / "tiny")
    for suffix in without:
        (folder / "house_segmentations" / f"tiny{suffix}").unlink()
    for path in (folder, folder / "house_segmentations" / "tiny.house"):
        scene = read_mp3d(path)
        check_tiny(scene, lamp_faces=7)
        assert scene.materials[0].texture is not None
        names = {f.name for f in files_mp3d(path)}
        assert {"tiny.house", "tiny.ply", "0123abcd.obj", "tiny.mtl", "tiny_0.png"} <= names
        assert ("tiny.fsegs.json" in names) == (".fsegs.json" not in without)


def test_the_download_without_segment_lines_takes_its_objects_from_the_groups(tmp_path):
    folder = write_raw_mp3d(tmp_path / "tiny")
    names = folder / "house_segmentations"
    (names / "tiny.house").write_text(house_text(segments=False))
    check_tiny(read_mp3d(folder), lamp_faces=7)
    (names / "tiny.semseg.json").unlink()
    check_tiny(read_mp3d(folder), lamp_faces=7)
    groups = {"segGroups": [{"objectId": 0, "segments": [0]}, {"objectId": 1, "segments": [0]}]}
    (names / "tiny.semseg.json").write_text(json.dumps(groups))
    with pytest.raises(DataError, match=r"semseg\.json: found segment 0 of two objects"):
        read_mp3d(folder)


def test_the_download_unpacked_into_a_folder_of_its_own_name(tmp_path):
    write_raw_mp3d(tmp_path / "tiny" / "tiny")
    check_tiny(read_mp3d(tmp_path / "tiny"), lamp_faces=7)


def test_the_download_with_too_few_segments_is_named(tmp_path):
    folder = write_raw_mp3d(tmp_path / "tiny")
    (folder / "house_segmentations" / "tiny.fsegs.json").write_text(json.dumps({"segIndices": [0] * 23}))
    with pytest.raises(
        DataError, match=r"tiny\.fsegs\.json: found 23 segIndices, expected one for each of the 24 faces"
    ):
        read_mp3d(folder)


@pytest.mark.parametrize("missing", ["matterport_mesh", "house_segmentations"])
def test_a_download_without_one_of_its_archives_says_which(tmp_path, missing):
    folder = write_raw_mp3d(tmp_path / "tiny")
    shutil.rmtree(folder / missing)
    for function in (read_mp3d, files_mp3d):
        with pytest.raises(DataError, match=f"{missing}.*Unpack {missing}.zip"):
            function(folder)


@pytest.mark.parametrize("missing", ["tiny.glb", "tiny_semantic.ply"])
def test_a_missing_file_is_named(tmp_path, missing):
    folder = write_mp3d(tmp_path / "tiny")
    (folder / missing).unlink()
    for function in (read_mp3d, files_mp3d):
        with pytest.raises(DataError, match=f"{missing}: found no such file"):
            function(folder)


def test_a_region_without_surfaces_has_no_box(tmp_path):
    """Its box is inside out in the file: the room is as large as what is in it, and with nothing in it there is none."""
    folder = write_mp3d(tmp_path / "tiny")
    text = (folder / "tiny.house").read_text()
    old, new = "R 1 0 0 0 b 0 0 3 -3 -3 3 3 3 6 3", "R 1 0 0 0 b 0 0 3 1e+20 1e+20 1e+20 -1e+20 -1e+20 -1e+20 3"
    assert old in text
    empty = "R 7 0 0 0 - 0 0 3 1e+20 1e+20 1e+20 -1e+20 -1e+20 -1e+20 3 0 0 0 0"
    text = text.replace(old, new).replace("C 0 10", f"{empty}\nC 0 10", 1)
    (folder / "tiny.house").write_text(text.replace(" 3 2 2 0", " 3 2 3 0"))
    scene = read_mp3d(folder)
    assert [room.id for room in scene.rooms] == [0, 1]
    np.testing.assert_allclose([scene.rooms[1].aabb_min, scene.rooms[1].aabb_max], BOXES[1], atol=1e-6)


def test_a_category_that_is_none_of_the_forty_is_unlabelled(tmp_path):
    folder = write_mp3d(tmp_path / "tiny")
    text = (folder / "tiny.house").read_text()
    (folder / "tiny.house").write_text(text.replace("C 0 10 sofa 10 sofa", "C 0 -1 - -1 -"))
    sofa, _ = read_mp3d(folder).instances
    assert (sofa.category, sofa.mpcat40) == ("unlabelled", "unlabeled")


def test_faces_of_objects_that_are_not_listed_are_counted(tmp_path):
    folder = write_mp3d(tmp_path / "tiny")
    ids = boxes_mesh()[2].copy()
    ids[3:6] = (-7, 90, 3)
    (folder / "tiny_semantic.ply").write_bytes(boxes_ply({"object_id": ids}))
    with pytest.raises(DataError, match=r"3 faces with an object_id outside the table \(first: -7\), expected 0\.\.2"):
        read_mp3d(folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("L 1 1 -", "L 4 1 -", "region 0 on level 1, which is not in the file"),
        ("E 0 0 0 1", "E 0 9 0 1", "segment 0 of object 9, which is not in the file"),
        ("R 0 1 0 0 l 0 0 0 -3", "R 0 1 0 0 l 0 0 0 nan", "line 5"),
        ("O 1 1 1", "O 1 1 8", "object 1 in category 8, which is not in the file"),
        ("O 2 1 -1", "O 1 1 -1", "line 11.*O record 1 a second time"),
        ("ASCII 1.1", "PLY", "first line 'PLY'"),
    ],
)
def test_a_house_file_that_contradicts_itself(tmp_path, old, new, says):
    path = tmp_path / "tiny.house"
    assert old in house_text()
    path.write_text(house_text().replace(old, new))
    with pytest.raises(DataError, match=says):
        read_house(path)


def test_a_folder_that_is_no_scan_is_named(tmp_path):
    with pytest.raises(DataError, match=r"0 \.house files"):
        read_mp3d(tmp_path)
    with pytest.raises(DataError, match="no such folder"):
        read_mp3d(tmp_path / "absent")


def test_ids_go_to_the_nearest_face_where_triangles_differ():
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [1, 0, 0], [2, 0, 0], [2, 0, 1], [1, 0, 1]], np.float32
    )
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    other = np.array([[0, 1, 3], [1, 2, 3], [4, 5, 7], [5, 6, 7]], np.int32)
    ids = np.array([5, 5, 6, 6], np.int32)
    assert transfer_face_ids(vertices, faces, ids, vertices, other).tolist() == [5, 5, 6, 6]
    assert transfer_face_ids(vertices, faces[:0], ids[:0], vertices, other).tolist() == [0] * 4


@given(st.integers(0, 2**32 - 1))
def test_equal_triangles_are_found_as_the_nearest_ones_are(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.integers(-3, 4, (12, 3)).astype(np.float32)  # many faces coincide
    faces = rng.integers(0, 12, (20, 3)).astype(np.int32)
    ids = rng.integers(0, 3, 20).astype(np.int32)
    order = rng.permutation(20)
    turned = np.stack([np.roll(face, int(rng.integers(3))) for face in faces[order]])
    negative = np.where(vertices == 0, np.float32(-0.0), vertices)
    fast = transfer_face_ids(vertices, faces, ids, negative, turned)
    plain = ids[_nearest_faces(vertices, faces, vertices[turned])]
    clear = [
        len({int(ids[k]) for k in range(20) if set_of(vertices, faces[k]) == set_of(vertices, f)}) == 1 for f in turned
    ]
    np.testing.assert_array_equal(fast[clear], ids[order][clear])
    np.testing.assert_array_equal(fast[~np.array(clear)], plain[~np.array(clear)])


def set_of(vertices, face) -> tuple:
    return tuple(sorted(map(tuple, vertices[face].tolist())))


@pytest.mark.parametrize(
    ("vertex", "corner", "n_ids"), [(np.nan, 0, 1), (np.inf, 0, 1), (1e30, 0, 1), (0, 3, 1), (0, -1, 1), (0, 0, 2)]
)
def test_what_would_crash_the_ray_tracer_never_gets_there(vertex, corner, n_ids):
    good = np.eye(3, dtype=np.float32)
    vertices = good.copy()
    vertices[0, 0] = vertex
    faces = np.array([[corner, 1, 2]], np.int32)
    with pytest.raises(DataError, match="the labelled mesh"):
        transfer_face_ids(vertices, faces, np.ones(n_ids, np.int32), good, np.array([[0, 1, 2]], np.int32))


def test_fuzz_habitat_layout(tmp_path):
    healthy = write_mp3d(tmp_path / "healthy" / "tiny")
    files = ["tiny.glb", "tiny.house", "tiny_semantic.ply"]
    assert hold_to_data_error(read_mp3d, healthy, files, tmp_path, cases=1500) > 500


def test_fuzz_layout_of_the_download(tmp_path):
    healthy = write_raw_mp3d(tmp_path / "healthy" / "tiny")
    files = [str(f.relative_to(healthy)) for f in sorted(healthy.rglob("*")) if f.is_file()]
    assert hold_to_data_error(read_mp3d, healthy, files, tmp_path, cases=1500) > 500
