"""ScanNet's format against ground truth that nobody of this project wrote, on a tiny scan made here, and on damaged files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error

from openmap_scenes import DataError
from openmap_scenes.formats.scannet import face_majority, files_scannet, read_scannet, read_T_world_scan

SCAN = "scene0900_00"


@pytest.fixture(scope="module")
def scan(shared_scenes: Path):
    return read_scannet(shared_scenes / "scannet" / SCAN)


@pytest.fixture(scope="module")
def truth(shared_scenes: Path):
    return json.loads((shared_scenes / f"ground_truth_{SCAN}.json").read_text())


def test_the_frame_is_that_of_the_ground_truth(shared_scenes: Path, truth):
    """Alignment, then (x, z, -y), is what the ground truth calls habitat_from_scannet; the file has six digits of it."""
    T_world_scan = read_T_world_scan(shared_scenes / "scannet" / SCAN / f"{SCAN}.txt")
    np.testing.assert_allclose(T_world_scan, truth["habitat_from_scannet"], atol=1e-6)


def test_instances_equal_the_ground_truth(scan, truth, shared_scenes: Path):
    assert {i.id: i.category for i in scan.instances} == {i["objectId"] + 1: i["label"] for i in truth["instances"]}
    T_world_scan = read_T_world_scan(shared_scenes / "scannet" / SCAN / f"{SCAN}.txt")
    by_id = {i.id: i for i in scan.instances}
    for expected in truth["instances"]:
        instance = by_id[expected["objectId"] + 1]
        assert instance.source_id == expected["objectId"]
        # The boxes of the ground truth lie along the axes of the scan frame; turning the corners gives a box around.
        low, high = np.array(expected["aabb_min"]), np.array(expected["aabb_max"])
        corners = np.array([[(low, high)[k >> a & 1][a] for a in range(3)] for k in range(8)])
        around = corners @ T_world_scan[:3, :3].T + T_world_scan[:3, 3]
        assert (instance.aabb_min >= around.min(0) - 1e-3).all()
        assert (instance.aabb_max <= around.max(0) + 1e-3).all()


def test_boxes_are_exact_in_the_scan_frame(truth, shared_scenes: Path, tmp_path: Path):
    """Without its text file a scan stays in its own frame but for the axes, and there the ground truth is exact."""
    for path in (shared_scenes / "scannet" / SCAN).glob("*.*"):
        if path.suffix in (".ply", ".json"):
            (tmp_path / path.name).symlink_to(path)
    scan = read_scannet(tmp_path)
    for instance, expected in zip(scan.instances, truth["instances"], strict=True):
        low, high = np.array(expected["aabb_min"]), np.array(expected["aabb_max"])
        np.testing.assert_allclose(instance.aabb_min, [low[0], low[2], -high[1]], atol=1e-4)
        np.testing.assert_allclose(instance.aabb_max, [high[0], high[2], -low[1]], atol=1e-4)
        x, y, z = expected["center"]
        np.testing.assert_allclose(instance.centre, [x, z, -y], atol=1e-4)
    assert len(scan.vertices) == truth["vertices"]
    assert len(scan.faces) == truth["faces"]


def test_faces_and_pictures_carry_the_same_ids(scan, shared_scenes: Path):
    """Where an ``instance-filt`` picture's ray hits the mesh, the face has the picture's id."""
    import open3d as o3d
    from PIL import Image

    from openmap_scenes.recordings import open_recording

    recording = open_recording(shared_scenes / "scannet" / SCAN)
    frame = next(iter(recording))
    picture = np.asarray(Image.open(shared_scenes / "scannet" / SCAN / "instance-filt" / f"{frame.index}.png"))
    surface = o3d.t.geometry.RaycastingScene()
    surface.add_triangles(scan.vertices, scan.faces.astype(np.uint32))
    seen = np.zeros(picture.shape, bool)
    seen[::8, ::8] = True
    seen &= frame.depth > 0
    points = recording.camera.unproject(frame.depth, frame.T_world_camera)[seen]
    closest = surface.compute_closest_points(points.astype(np.float32))["primitive_ids"].numpy()
    assert (scan.face_instance[closest] == picture[seen]).mean() > 0.95


def test_corners_that_differ_vote():
    corners = np.array([[1, 1, 2], [1, 2, 1], [2, 1, 1], [1, 2, 3], [0, 0, 5], [5, 5, 0], [4, 4, 4]], np.int32)
    assert face_majority(corners).tolist() == [1, 1, 1, 0, 0, 5, 4]


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Nine vertices, three a triangle, one segment a triangle, numbered 50, 60, 70: a lamp, a shared one, nobody's."""
    folder = tmp_path / "scene0001_00"
    folder.mkdir()
    text = "ply\nformat ascii 1.0\nelement vertex 9\n"
    text += "".join(f"property float {c}\n" for c in "xyz")
    text += "".join(f"property uchar {c}\n" for c in ("red", "green", "blue", "alpha"))
    text += "element face 3\nproperty list uchar int vertex_indices\nend_header\n"
    text += "".join(f"{k} {k % 3} {k // 3} {k} 100 200 255\n" for k in range(9))
    text += "".join(f"3 {k} {k + 1} {k + 2}\n" for k in (0, 3, 6))
    (folder / "scene0001_00_vh_clean_2.ply").write_text(text)
    segments = {"sceneId": "scene0001_00", "segIndices": [50, 50, 50, 60, 60, 60, 70, 70, 70]}
    (folder / "scene0001_00_vh_clean_2.0.010000.segs.json").write_text(json.dumps(segments))
    write_objects(folder, [group(0, "Lamp", [50, 60]), group(3, "rug", [60]), group(5, "ghost", [])])
    (folder / "scene0001_00.txt").write_text("sceneType = Office\naxisAlignment = 0 -1 0 5 1 0 0 0 0 0 1 -1 0 0 0 1 \n")
    return folder


def group(number: object, label: object, segments: object) -> dict[str, object]:
    return {"id": number, "objectId": number, "label": label, "segments": segments}


def write_objects(folder: Path, groups: object, name: str = "scene0001_00.aggregation.json", about: str = "") -> None:
    about = about or "scannet.scene0001_00_vh_clean_2.0.010000.segs.json"
    value = {"sceneId": "scannet.scene0001_00", "segmentsFile": about, "segGroups": groups}
    (folder / name).write_text(json.dumps(value))


def test_a_scan_by_hand(small: Path):
    scene = read_scannet(small)
    assert scene.name == "scene0001_00"
    assert scene.face_instance.tolist() == [1, 4, 0]
    lamp, rug = scene.instances
    assert (lamp.id, lamp.source_id, lamp.category) == (1, 0, "lamp")
    assert (rug.id, rug.source_id, rug.category) == (4, 3, "rug")
    # scan (x, y, z) -> aligned (5 - y, x, z - 1) -> world (5 - y, z - 1, -x)
    np.testing.assert_allclose([lamp.aabb_min, lamp.aabb_max], [[3, -1, -2], [5, -1, 0]])
    np.testing.assert_allclose([rug.aabb_min, rug.aabb_max], [[3, 0, -5], [5, 0, -3]])
    assert scene.vertex_colour is not None
    assert scene.vertex_colour[4].tolist() == [4, 100, 200]


def test_a_scan_without_annotations_or_alignment(small: Path):
    assert len(files_scannet(small)) == 4
    for name in (".aggregation.json", ".txt"):
        (small / f"scene0001_00{name}").unlink()
    assert len(files_scannet(small)) == 2
    scene = read_scannet(small)
    assert scene.instances == []
    assert not scene.face_instance.any()
    np.testing.assert_array_equal(scene.vertices[4], [4, 1, -1])


def test_the_aggregation_of_the_full_mesh_is_not_taken_for_that_of_the_small_one(small: Path):
    name = "scene0001_00_vh_clean.aggregation.json"
    (small / "scene0001_00.aggregation.json").rename(small / name)
    assert [i.id for i in read_scannet(small).instances] == [1, 4]
    write_objects(small, [group(0, "lamp", [1])], name, "scannet.scene0001_00_vh_clean.segs.json")
    with pytest.raises(DataError, match=r"found objects of scannet.scene0001_00_vh_clean.segs.json"):
        read_scannet(small)


@pytest.mark.parametrize(
    ("groups", "says"),
    [
        (None, "no list 'segGroups'"),
        ([3], r"segGroups\[0\]: found no objectId"),
        ([group(-1, "a", [])], "no objectId"),
        ([group(2**24, "a", [])], "no objectId"),
        ([group(True, "a", [])], "no objectId"),
        ([group(1, "a", []), group(1, "b", [])], "objectId 1 a second time"),
        ([group(1, None, [])], "no label for object 1"),
        ([group(1, "a", [1.5])], "no list of segments for object 1"),
        ([group(1, "a", [50, 51])], r"object 1 \(a\) with segment 51, which no vertex has"),
    ],
)
def test_broken_objects_are_refused(small: Path, groups: object, says: str):
    write_objects(small, groups)
    with pytest.raises(DataError, match=says):
        read_scannet(small)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("_vh_clean_2.0.010000.segs.json", '{"segIndices": [1, 2]}', "found 2 entries of segIndices, expected 9"),
        ("_vh_clean_2.0.010000.segs.json", '{"segIndices": [1, [2]]}', "not a list of whole numbers"),
        ("_vh_clean_2.0.010000.segs.json", '{"segIndices": [1, 2.5]}', "not a list of whole numbers"),
        ("_vh_clean_2.0.010000.segs.json", "", "broken JSON"),
        (".txt", "axisAlignment = 1 2 3", "line 1: found axisAlignment of 3 words"),
        (".txt", "\naxisAlignment = " + "nan " * 16, "line 2: found an axisAlignment that is not finite"),
        (".txt", "axisAlignment = " + "1 " * 16, "axisAlignment with a last row"),
        (".txt", "axisAlignment = 1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1", "is not a rotation"),
    ],
)
def test_broken_files_are_refused(small: Path, name: str, content: str, says: str):
    path = small / f"scene0001_00{name}"
    path.write_text(content)
    with pytest.raises(DataError, match=says) as caught:
        read_scannet(small)
    assert str(path) in str(caught.value)


def test_missing_files_are_named(small: Path):
    (small / "scene0001_00_vh_clean_2.0.010000.segs.json").unlink()
    with pytest.raises(DataError, match=r"segs.json: found no such file"):
        read_scannet(small)
    (small / "scene0001_00_vh_clean_2.ply").unlink()
    with pytest.raises(DataError, match="found 0 files"):
        read_scannet(small)
    with pytest.raises(DataError, match="no such folder"):
        read_scannet(small / "elsewhere")


def test_segments_that_miss_vertices_are_refused(shared_scenes: Path, tmp_path: Path):
    healthy = shared_scenes / "scannet" / SCAN
    for name in (f"{SCAN}_vh_clean_2.ply", f"{SCAN}.aggregation.json"):
        shutil.copy(healthy / name, tmp_path)
    shutil.copy(next((shared_scenes / "broken" / "08_segs_length_mismatch" / SCAN).glob("*.segs.json")), tmp_path)
    with pytest.raises(DataError, match="found 105100 entries of segIndices, expected 106100, one for each vertex"):
        read_scannet(tmp_path)


def test_fuzz_only_data_errors(small: Path, tmp_path: Path):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    files = [path.name for path in files_scannet(small)]
    assert hold_to_data_error(read_scannet, small, files, scratch, cases=2000) > 500
