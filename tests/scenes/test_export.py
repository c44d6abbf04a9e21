"""Export: a scene comes back from its GLB and table as it went in, and other libraries show it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from conftest import make_toy_scene
from hypothesis import given
from hypothesis import strategies as st

from openmap_scenes import DataError, Instance, Material, Room, Scene
from openmap_scenes.formats import export
from openmap_scenes.formats.export import export_scene
from openmap_scenes.formats.glb import files_file, read_file


def random_scene(seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    n_vertices, n_faces = int(rng.integers(3, 40)), int(rng.integers(1, 60))
    texture = rng.integers(0, 256, (int(rng.integers(1, 6)), int(rng.integers(1, 6)), 3), np.uint8)
    materials = [
        Material("plain", rng.random(3).astype(np.float32)),
        Material("wood", np.ones(3, np.float32), texture),
        Material("wood, dark", np.array([0.5, 0.25, 0.0], np.float32), texture),
    ]
    instances = []
    for number in sorted(rng.choice(np.arange(1, 1000), 4, replace=False).tolist()):
        low = rng.normal(size=3)
        high = low + rng.random(3)
        attributes = {"colour": "grün"} if rng.random() < 0.5 else {}
        room = 7 if rng.random() < 0.5 else None
        mpcat40 = "chair" if rng.random() < 0.5 else None
        instances.append(
            Instance(number, "office chair", (low + high) / 2, low, high, room, mpcat40, attributes, number * 3 - 1)
        )
    ids = np.array([0] + [i.id for i in instances], np.int32)
    return Scene(
        name="random",
        vertices=rng.normal(size=(n_vertices, 3)).astype(np.float32),
        faces=rng.integers(0, n_vertices, (n_faces, 3)).astype(np.int32),
        face_material=rng.integers(0, 3, n_faces).astype(np.int32),
        face_instance=ids[rng.integers(0, len(ids), n_faces)],
        materials=materials,
        instances=instances,
        rooms=[Room(7, "living_room", np.array([-1.0, 0.1, -2.0]), np.array([1.0, 2.5, 3.0]), 1)],
        uv=rng.normal(size=(n_vertices, 2)).astype(np.float32) if rng.random() < 0.7 else None,
        vertex_colour=rng.integers(0, 256, (n_vertices, 3), np.uint8) if rng.random() < 0.7 else None,
        source="test",
        credits=("Sofa by Ä. Author, CC-BY 4.0", "Rest CC0"),
    )


def assert_same(a: Scene, b: Scene) -> None:
    if b.uv is None and any(m.texture is not None for m in b.materials):
        b = Scene(**{**vars(b), "uv": np.zeros((len(b.vertices), 2), np.float32)})
    for name in ("vertices", "faces", "face_material", "face_instance", "uv", "vertex_colour"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert (a.name, a.credits) == (b.name, b.credits)
    for x, y in zip(a.materials, b.materials, strict=True):
        assert x.name == y.name
        np.testing.assert_allclose(x.colour, y.colour, atol=1e-6)
        assert (x.texture is None) == (y.texture is None)
        if x.texture is not None:
            np.testing.assert_array_equal(x.texture, y.texture)
    for i, j in zip(a.instances, b.instances, strict=True):
        for name in ("id", "category", "room", "mpcat40", "scannet200", "lvis", "attributes", "source_id"):
            assert getattr(i, name) == getattr(j, name), name
        np.testing.assert_array_equal([i.centre, i.aabb_min, i.aabb_max], [j.centre, j.aabb_min, j.aabb_max])
    for r, s in zip(a.rooms, b.rooms, strict=True):
        assert (r.id, r.name, r.level) == (s.id, s.name, s.level)
        np.testing.assert_array_equal([r.aabb_min, r.aabb_max], [s.aabb_min, s.aabb_max])


@given(st.integers(0, 2**32 - 1))
def test_a_scene_comes_back_as_it_went(tmp_path_factory, seed):
    scene = random_scene(seed)
    path = tmp_path_factory.mktemp("export") / "deeper" / "home.glb"
    files = export_scene(scene, path)
    assert [f.name for f in files] == ["home.glb", "home.instances.json", "home.credits.txt"]
    assert sorted(path.parent.iterdir()) == sorted(files)
    assert_same(read_file(path), scene)
    assert set(files_file(path)) == {path, path.with_name("home.instances.json")}
    assert "Ä. Author" in files[2].read_text("utf-8")


def test_all_256_colours_survive_linear_light(tmp_path):
    scene = random_scene(0)
    bytes_ = np.arange(256, dtype=np.uint8)
    every = Scene(
        **{
            **vars(scene),
            "vertices": np.random.default_rng(0).normal(size=(256, 3)).astype(np.float32),
            "uv": None,
            "vertex_colour": np.stack([bytes_, bytes_[::-1], bytes_], axis=1),
        }
    )
    export_scene(every, tmp_path / "every.glb")
    np.testing.assert_array_equal(read_file(tmp_path / "every.glb").vertex_colour, every.vertex_colour)


def test_same_scene_same_bytes(tmp_path):
    for name in ("a", "b"):
        export_scene(random_scene(3), tmp_path / name / "home.glb")
    for suffix in ("glb", "instances.json", "credits.txt"):
        assert (tmp_path / "a" / f"home.{suffix}").read_bytes() == (tmp_path / "b" / f"home.{suffix}").read_bytes()


def test_other_libraries_read_it(tmp_path):
    scene = make_toy_scene()
    export_scene(scene, tmp_path / "toy.glb")
    loaded = trimesh.load(tmp_path / "toy.glb").to_geometry()
    np.testing.assert_allclose(loaded.bounds, scene.aabb, atol=1e-6)
    assert loaded.area == pytest.approx(trimesh.Trimesh(scene.vertices, scene.faces, process=False).area)


def test_faces_in_very_many_runs_are_sorted_by_material(tmp_path, monkeypatch):
    monkeypatch.setattr(export, "MOST_PRIMITIVES", 4)
    scene = random_scene(5)
    export_scene(scene, tmp_path / "home.glb")
    back = read_file(tmp_path / "home.glb")
    assert np.count_nonzero(np.diff(back.face_material)) == 2
    order = np.argsort(scene.face_material, kind="stable")
    np.testing.assert_array_equal(back.faces, scene.faces[order])
    np.testing.assert_array_equal(back.face_instance, scene.face_instance[order])


def test_a_path_that_is_no_glb_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(DataError, match=r"ends in \.glb"):
        export_scene(random_scene(0), tmp_path / "home.obj")
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_behind_where_writing_fails(tmp_path):
    (tmp_path / "home.glb").mkdir()
    with pytest.raises(DataError, match=r"home\.glb"):
        export_scene(random_scene(0), tmp_path / "home.glb")
    assert [f.name for f in tmp_path.iterdir()] == ["home.glb"]


def test_the_shared_house_comes_back_whole(shared_scenes, tmp_path):
    from openmap_scenes.formats.mp3d import read_mp3d

    scene = read_mp3d(shared_scenes / "mp3d" / "aws_small_house")
    export_scene(scene, tmp_path / "house.glb")
    assert read_file(tmp_path / "house.glb").digest() == scene.digest()


def test_a_full_disk_leaves_nothing_and_names_the_file(
    toy_scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, data: bytes) -> int:
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(DataError, match=r"No space left on device.*MiB"):
        export_scene(toy_scene, tmp_path / "toy.glb")
    assert list(tmp_path.iterdir()) == []
