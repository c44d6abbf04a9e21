"""Gibson homes in both layouts, with and without semantics."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error
from tiny_scans import BOXES, boxes_mesh, boxes_ply, obj_text, write_gibson

from openmap_scenes import DataError
from openmap_scenes.formats.gibson import files_gibson, read_gibson


@pytest.mark.parametrize("raw", [False, True])
def test_a_home_with_semantics(tmp_path, raw):
    folder = write_gibson(tmp_path / "Rosser", raw=raw)
    scene = read_gibson(folder)
    assert scene.name == "Rosser"
    assert [(i.id, i.category, i.room) for i in scene.instances] == [(3, "couch", 1), (7, "potted plant", 2)]
    assert [i.attributes for i in scene.instances] == [{"material": "fabric"}, {"pattern": "striped"}]
    for instance, (low, high) in zip(scene.instances, BOXES, strict=True):
        np.testing.assert_allclose(instance.aabb_min, low, atol=1e-6)
        np.testing.assert_allclose(instance.aabb_max, high, atol=1e-6)
    assert np.bincount(scene.face_instance)[[0, 3, 7]].tolist() == [1, 12, 11]
    assert [(r.id, r.name, r.level) for r in scene.rooms] == [(1, "living room", 0), (2, "bedroom", 1)]
    np.testing.assert_allclose([scene.rooms[1].aabb_min, scene.rooms[1].aabb_max], [[-3, 3, -3], [3, 6, 3]])
    low, high = scene.aabb
    np.testing.assert_allclose([low, high], [[-2, 0, -2], [1.4, 4.5, 2]], atol=1e-6)
    expected = {"Rosser_semantic.ply", "Rosser.scn"}
    expected |= {"mesh_z_up.obj", "tiny.mtl", "tiny_0.png"} if raw else {"Rosser.glb"}
    assert {f.name for f in files_gibson(folder)} == expected


def test_a_home_without_semantics_by_file_or_folder(tmp_path):
    folder = write_gibson(tmp_path / "Oyens", semantics=False)
    for path in (folder, folder / "Oyens.glb", str(folder)):
        scene = read_gibson(path)
        assert scene.instances == scene.rooms == []
        assert not scene.face_instance.any()
        assert scene.name == "Oyens"


def test_many_homes_in_one_folder_are_told_apart_by_name(tmp_path):
    folder = write_gibson(tmp_path / "gibson", semantics=False)
    (folder / "gibson.glb").rename(folder / "Pablo.glb")
    shutil.copy(folder / "Pablo.glb", folder / "Sands.glb")
    assert read_gibson(folder / "Sands.glb").name == "Sands"
    with pytest.raises(DataError, match=r"2 \.glb files.*Name the \.glb itself"):
        read_gibson(folder)


def test_the_dataset_s_own_mesh_obj_is_y_up(tmp_path):
    folder = write_gibson(tmp_path / "Goffs", raw=True)
    (folder / "mesh_z_up.obj").unlink()
    (folder / "mesh.obj").write_text(obj_text(z_up=False))
    np.testing.assert_allclose(read_gibson(folder).aabb, [[-2, 0, -2], [1.4, 4.5, 2]], atol=1e-6)


@pytest.mark.parametrize("missing", ["Nuevo_semantic.ply", "Nuevo.scn"])
def test_half_of_the_semantics_is_an_error_that_says_what_to_do(tmp_path, missing):
    folder = write_gibson(tmp_path / "Nuevo")
    (folder / missing).unlink()
    for function in (read_gibson, files_gibson):
        with pytest.raises(DataError, match=f"{missing}: found no such file.*without semantics"):
            function(folder)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("id", "3", r"'3' at objects\[0\]\.id"),
        ("id", 7, "object id more than once"),
        ("id", 0, r"0 at objects\[0\]\.id"),
        ("class_", None, r"nothing at objects\[0\]\.class_"),
        ("parent_room", 5, r"5 at objects\[0\]\.parent_room"),
    ],
)
def test_a_table_with_a_wrong_value_says_where(tmp_path, key, value, says):
    folder = write_gibson(tmp_path / "Nuevo")
    document = json.loads((folder / "Nuevo.scn").read_text())
    document["objects"][0][key] = value
    (folder / "Nuevo.scn").write_text(json.dumps(document))
    with pytest.raises(DataError, match=rf"Nuevo\.scn.*{says}"):
        read_gibson(folder)


def test_ids_beyond_the_table_are_counted(tmp_path):
    folder = write_gibson(tmp_path / "Nuevo")
    ids = (boxes_mesh()[2] * 4 + 3).astype("<u2")
    ids[20:] = 9000
    (folder / "Nuevo_semantic.ply").write_bytes(boxes_ply({"object_id": ids}))
    with pytest.raises(DataError, match=r"Nuevo_semantic\.ply: found 4 faces with an object_id outside .*first: 9000"):
        read_gibson(folder)


def test_no_home_at_all(tmp_path):
    with pytest.raises(DataError, match="no mesh"):
        read_gibson(tmp_path)
    with pytest.raises(DataError, match="no such file or folder"):
        files_gibson(tmp_path / "absent")


def test_a_matterport_mesh_under_a_gibson_path_stands_upright(shared_scenes: Path, tmp_path):
    source = shared_scenes / "mp3d" / "aws_small_house" / "aws_small_house.glb"
    folder = tmp_path / "House"
    folder.mkdir()
    shutil.copy(source, folder / "House.glb")
    for path in (folder, source):
        low, high = read_gibson(path).aabb
        assert abs(low[1]) < 0.05
        assert 2.5 < high[1] < 3.5


@pytest.mark.parametrize("raw", [False, True])
def test_fuzz(tmp_path, raw):
    healthy = write_gibson(tmp_path / "healthy" / "Rosser", raw=raw)
    files = sorted(f.name for f in healthy.iterdir())
    assert hold_to_data_error(read_gibson, healthy, files, tmp_path, cases=1000) > 300
