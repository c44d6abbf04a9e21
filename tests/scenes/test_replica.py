"""Replica's format against ground truth that nobody of this project wrote, on tiny scans made here, and on damaged files."""

from __future__ import annotations

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error

from openmap_scenes import DataError
from openmap_scenes.formats.replica import files_replica, read_replica

SCAN = "aws_small_house"
FILES = ["mesh.ply", "habitat/mesh_semantic.ply", "habitat/info_semantic.json"]


@pytest.fixture(scope="module")
def house(shared_scenes: Path):
    return read_replica(shared_scenes / "replica" / SCAN)


@pytest.fixture(scope="module")
def truth(shared_scenes: Path):
    found = json.loads((shared_scenes / f"ground_truth_{SCAN}.json").read_text())["instances"]
    return {i["replica_id"]: i for i in found if i["replica_id"]}


def test_instances_equal_the_ground_truth(house, truth):
    """The mesh is decimated, hence 2 cm; only one small thing lost so much that its centre moved by more than 1 cm."""
    assert {i.id: i.category for i in house.instances} == {k: v["category"] for k, v in truth.items()}
    centres = []
    for instance in house.instances:
        expected = truth[instance.id]
        np.testing.assert_allclose(instance.aabb_min, expected["aabb_min"], atol=0.02)
        np.testing.assert_allclose(instance.aabb_max, expected["aabb_max"], atol=0.02)
        centres.append(np.abs(instance.centre - expected["center"]).max())
        assert instance.source_id == instance.id
        assert instance.room is None
    assert np.sort(centres)[-2] < 0.005
    assert max(centres) < 0.0125


def test_faces_carry_the_ids_of_the_semantic_mesh(house, truth):
    """The two files order their faces differently, so that ids in the wrong order would spread things over the house."""
    assert house.name == SCAN
    assert house.vertex_colour is not None
    assert set(np.unique(house.face_instance)) == {0, *truth}
    corners = house.vertices[house.faces]
    for instance in house.instances:
        mine = corners[house.face_instance == instance.id].reshape(-1, 3)
        np.testing.assert_allclose(mine.min(0), instance.aabb_min, atol=1e-6)
        np.testing.assert_allclose(mine.max(0), instance.aabb_max, atol=1e-6)


def write_quads(path: Path, vertices: np.ndarray, quads: list[list[int]], ids: list[int] | None) -> None:
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    head += "".join(f"property float {c}\n" for c in "xyz") + "".join(
        f"property uchar {c}\n" for c in ("red", "green", "blue")
    )
    head += f"element face {len(quads)}\nproperty list uchar int vertex_indices\n"
    head += ("" if ids is None else "property int object_id\n") + "end_header\n"
    body = b"".join(struct.pack("<3f3B", *v, 10, 20, 30) for v in vertices)
    for row, quad in enumerate(quads):
        body += struct.pack("<B4i", 4, *quad) + (b"" if ids is None else struct.pack("<i", ids[row]))
    path.write_bytes(head.encode() + body)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """Three quads in a row along x, 1 m each, on the floor: a rug, nobody's, and a tv screen that stands 2 m up."""
    folder = tmp_path / "flat"
    (folder / "habitat").mkdir(parents=True)
    vertices = np.array([[x, y, 2.0 * (x == 4)] for x in range(5) for y in range(2)], float)
    quads = [[0, 2, 3, 1], [2, 4, 5, 3], [4, 6, 7, 5], [6, 8, 9, 7]]
    write_quads(folder / "habitat/mesh_semantic.ply", vertices, quads, [7, 3, 0, 9])
    write_quads(folder / "mesh.ply", vertices, [[7, 6, 8, 9], *quads[:3]], None)
    info = {
        "classes": [{"id": 4, "name": "tv-screen"}],
        "objects": [{"id": 7, "class_id": 1, "class_name": "rug"}, {"id": 9, "class_id": 4}],
        "id_to_label": [-1] * 11,
    }
    (folder / "habitat/info_semantic.json").write_text(json.dumps(info))
    return folder


def test_ids_that_the_table_leaves_out_are_nobody(small: Path):
    scene = read_replica(small)
    assert scene.face_instance.tolist() == [9, 9, 7, 7, 0, 0, 0, 0]
    rug, screen = scene.instances
    assert (rug.id, rug.category, screen.id, screen.category) == (7, "rug", 9, "tv screen")
    # world = (x, z, -y)
    np.testing.assert_array_equal([rug.aabb_min, rug.aabb_max], [[0, 0, -1], [1, 0, 0]])
    np.testing.assert_array_equal([screen.aabb_min, screen.aabb_max], [[3, 0, -1], [4, 2, 0]])
    assert scene.vertex_colour is not None
    assert scene.vertex_colour[0].tolist() == [10, 20, 30]


def test_a_mesh_made_anew_takes_ids_from_where_its_faces_lie(small: Path):
    vertices = np.array([[x, y, 2.0 * (x == 4)] for x in (4, 3, 2, 1, 0) for y in (0, 1)], float)
    write_quads(small / "mesh.ply", vertices, [[0, 1, 3, 2], [2, 3, 5, 4], [4, 5, 7, 6], [6, 7, 9, 8]], None)
    assert read_replica(small).face_instance.tolist() == [9, 9, 0, 0, 0, 0, 7, 7]


def test_the_semantic_mesh_is_shown_where_it_is_alone(small: Path):
    assert len(files_replica(small)) == 3
    (small / "mesh.ply").unlink()
    assert len(files_replica(small)) == 2
    assert read_replica(small).face_instance.tolist() == [7, 7, 0, 0, 0, 0, 9, 9]


@pytest.mark.parametrize("name", ["habitat/mesh_semantic.ply", "habitat/info_semantic.json"])
def test_missing_files_are_named(small: Path, name: str):
    (small / name).unlink()
    with pytest.raises(DataError, match=f"{name}: found no such file"):
        read_replica(small)
    with pytest.raises(DataError, match="no such folder"):
        read_replica(small / "elsewhere")


@pytest.mark.parametrize(
    ("info", "says"),
    [
        ("{", "broken JSON"),
        ("[" * 200_000, "broken JSON"),
        ("[]", "a JSON list"),
        ("{}", "no list 'objects'"),
        ('{"objects": [{"id": 1.5}]}', r"objects\[0\]: found no id"),
        ('{"objects": [{"id": 1, "class_name": "a"}, {"id": 1, "class_name": "b"}]}', "id 1 a second time"),
        ('{"objects": [{"id": 9, "class_id": 4}]}', "no class"),
        ('{"objects": [{"id": 7, "class_name": "rug"}]}', r"2 faces with an object_id outside the table \(first: 9\)"),
    ],
)
def test_broken_tables_are_refused(small: Path, info: str, says: str):
    (small / "habitat/info_semantic.json").write_text(info)
    with pytest.raises(DataError, match=says):
        read_replica(small)


def test_negative_ids_are_refused(small: Path):
    path = small / "habitat/mesh_semantic.ply"
    path.write_bytes(path.read_bytes()[:-4] + struct.pack("<i", -7))
    with pytest.raises(DataError, match=r"outside the table \(first: -7\)"):
        read_replica(small)


def test_fuzz_only_data_errors(small: Path, tmp_path: Path):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    healthy = tmp_path / "healthy"
    shutil.copytree(small, healthy)
    assert hold_to_data_error(read_replica, healthy, FILES, scratch, cases=2000) > 500


def test_entries_of_nobody_are_passed_over_and_things_without_a_class_kept(small: Path):
    path = small / "habitat/info_semantic.json"
    info = json.loads(path.read_text())
    info["objects"] = [{"id": -1, "class_id": -1}, {"id": 0}, info["objects"][0], {"id": 9, "class_id": -1}]
    path.write_text(json.dumps(info))
    assert [(i.id, i.category) for i in read_replica(small).instances] == [(7, "rug"), (9, "unlabelled")]
