"""What ``openmap scenes check`` says of scenes and recordings: nothing of sound ones, the one thing of those with one damage."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
import tiny_scans
from fuzzing import CASES, damaged

from openmap_eval.cli import main
from openmap_eval.scene_check import Finding, check
from openmap_scenes import Scene
from openmap_scenes.catalog import READERS
from openmap_scenes.scene import instance_boxes

BROKEN = {
    "01_truncated_glb": ("aws_small_house.glb", "300000"),
    "02_house_missing_region": ("aws_small_house.house", "object 70 in region 3"),
    "03_semantic_ids_beyond_table": ("aws_small_house_semantic.ply", "207 faces"),
    "04_nan_pose": ("pose/1.txt", "not finite"),
    "05_zero_byte_depth": ("depth/1.png", "empty"),
    "06_truncated_sens": ("scene0900_00.sens", "truncated in frame"),
    "07_semantic_txt_bad_lines": ("aws_small_house.semantic.txt", "line 10"),
    "08_segs_length_mismatch": ("scene0900_00_vh_clean_2.0.010000.segs.json", "105100"),
}
HEALTHY = {
    "01": "mp3d/aws_small_house", "02": "mp3d/aws_small_house", "03": "mp3d/aws_small_house",
    "07": "hm3d/00001-aws_small_house", "08": "scannet/scene0900_00",
}  # fmt: skip


def serious(findings: list[Finding]) -> list[Finding]:
    return [f for f in findings if f.severity != "note"]


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch):
    """Findings of a scene that is not in a file."""

    def run(scene: Scene, thorough: bool = False) -> list[Finding]:
        monkeypatch.setitem(READERS, "memory", lambda rest: scene)
        return check("memory:scene", thorough)

    return run


# The last one is about a mesh that lies among the healthy files, so it makes no sense alone.
@pytest.mark.parametrize(
    ("name", "mixed"), [(n, m) for n in sorted(BROKEN) for m in (False, True) if m or not n.startswith("08")]
)
def test_a_broken_file_is_the_one_error(shared_scenes: Path, tmp_path: Path, name: str, mixed: bool):
    file, what = BROKEN[name]
    source = next((shared_scenes / "broken" / name).iterdir())
    folder = tmp_path / source.name
    if mixed and name[:2] in HEALTHY:
        healthy = shared_scenes / HEALTHY[name[:2]]
        # Frames of the recording have no say here.
        shutil.copytree(healthy, folder, ignore=lambda _, names: {"color", "depth", "pose"} & set(names))
        for sens in folder.glob("*.sens"):
            sens.unlink()
    shutil.copytree(source, folder, dirs_exist_ok=True)
    found = serious(check(str(folder)))
    assert [f.severity for f in found] == ["error"], found
    assert str(folder / file) in found[0].what
    assert what in found[0].what


def test_a_truncated_recording_beside_an_intact_export_is_found(shared_scenes: Path, tmp_path: Path):
    folder = tmp_path / "scene0900_00"
    shutil.copytree(next((shared_scenes / "broken" / "06_truncated_sens").iterdir()), folder)
    for part, ending in (("color", "jpg"), ("depth", "png"), ("pose", "txt")):
        (folder / part).mkdir()
        for number in range(2):
            name = f"{part}/{number}.{ending}"
            shutil.copyfile(shared_scenes / "scannet" / "scene0900_00" / name, folder / name)
    shutil.copytree(shared_scenes / "scannet" / "scene0900_00" / "intrinsic", folder / "intrinsic")
    found = serious(check(str(folder)))
    assert [f.severity for f in found] == ["error"]
    assert "scene0900_00.sens" in found[0].what


@pytest.mark.parametrize("path", ["mp3d/aws_small_house", "hm3d/00001-aws_small_house", "replica/aws_small_house"])
def test_nothing_is_wrong_with_the_house(shared_scenes: Path, path: str):
    assert not serious(check(str(shared_scenes / path)))


def test_nothing_is_wrong_with_a_sound_home(toy_scene: Scene, checked):
    assert not serious(checked(toy_scene))


def moved(scene: Scene, R: np.ndarray) -> Scene:
    """The scene with all its places (and boxes) under a 3x3 matrix."""
    vertices = (scene.vertices @ R.T).astype(np.float32)
    boxes = instance_boxes(vertices, scene.faces, scene.face_instance)
    instances = [
        dataclasses.replace(i, aabb_min=boxes[i.id][0], aabb_max=boxes[i.id][1], centre=np.mean(boxes[i.id], axis=0))
        for i in scene.instances
    ]
    rooms = []
    for room in scene.rooms:
        corners = np.array([room.aabb_min, room.aabb_max]) @ R.T
        rooms.append(dataclasses.replace(room, aabb_min=corners.min(0), aabb_max=corners.max(0)))
    return dataclasses.replace(scene, vertices=vertices, instances=instances, rooms=rooms)


def without_semantics(scene: Scene) -> Scene:
    return dataclasses.replace(scene, face_instance=np.zeros_like(scene.face_instance), instances=[], rooms=[])


@pytest.mark.parametrize("scale", [100.0, 1000.0, 0.01, 39.37])
def test_another_unit(toy_scene: Scene, checked, scale: float):
    (found,) = serious(checked(moved(toy_scene, np.eye(3) * scale)))
    assert found.severity == "error"
    assert "metres" in found.remedy


@pytest.mark.parametrize("axes", [(0, 2, 1), (1, 0, 2)])
@pytest.mark.parametrize("semantics", [True, False])
def test_a_home_that_lies_on_its_side(toy_scene: Scene, checked, axes: tuple[int, int, int], semantics: bool):
    # Walls of 2.7 m and rooms of 4 m and 12 m: the height alone would not tell.
    R = np.eye(3)[list(axes)]
    R *= np.linalg.det(R)
    scene = moved(toy_scene, R)
    found = serious(checked(scene if semantics else without_semantics(scene)))
    lying = [f for f in found if "on its side" in f.what]
    assert [f.severity for f in lying] == ["error" if semantics else "warning"]
    assert "Y up" in lying[0].remedy


def test_no_semantics(toy_scene: Scene, checked):
    (found,) = serious(checked(without_semantics(toy_scene)))
    assert "no semantics" in found.what
    assert "instances.json" in found.remedy


def test_a_missing_texture(toy_scene: Scene, checked):
    materials = [dataclasses.replace(toy_scene.materials[0], missing_texture="oak.jpg"), *toy_scene.materials[1:]]
    (found,) = serious(checked(dataclasses.replace(toy_scene, materials=materials)))
    assert found.what.startswith("1 texture missing")
    assert "oak.jpg" in found.what
    assert found.remedy


def boxes_added(scene: Scene, category: str, *boxes: tuple[tuple[float, ...], tuple[float, ...]]) -> Scene:
    """The scene with further boxes, each one an instance of that category."""
    n, first = len(scene.vertices), len(scene.instances) + 1
    vertices = [np.array(low) + tiny_scans.CORNERS * (np.array(high) - low) for low, high in boxes]
    template = scene.instances[0]
    added = [
        dataclasses.replace(
            template, id=first + k, category=category, room=2,
            aabb_min=np.array(low), aabb_max=np.array(high), centre=(np.array(low) + high) / 2,
        )
        for k, (low, high) in enumerate(boxes)
    ]  # fmt: skip
    faces = np.concatenate([tiny_scans.SIDES + n + 8 * k for k in range(len(boxes))])
    return dataclasses.replace(
        scene,
        vertices=np.concatenate([scene.vertices, *vertices]).astype(np.float32),
        faces=np.concatenate([scene.faces, faces]).astype(np.int32),
        face_material=np.append(scene.face_material, np.zeros(len(faces))).astype(np.int32),
        face_instance=np.append(scene.face_instance, np.repeat(np.arange(len(boxes)) + first, 12)).astype(np.int32),
        instances=[*scene.instances, *added],
    )


def test_a_room_behind_a_closed_door(toy_scene: Scene, checked):
    (found,) = serious(checked(boxes_added(toy_scene, "door", ((1.95, 0.0, -0.5), (2.05, 2.0, 0.5)))))
    assert "kitchen" in found.what
    assert "cannot be reached" in found.what
    assert "door" in found.remedy


def test_a_hole_in_the_floor(toy_scene: Scene, checked):
    floor = next(i.id for i in toy_scene.instances if i.category == "floor")
    keep = toy_scene.face_instance != floor
    bare = dataclasses.replace(
        toy_scene,
        faces=toy_scene.faces[keep],
        face_material=toy_scene.face_material[keep],
        face_instance=toy_scene.face_instance[keep],
        instances=[i for i in toy_scene.instances if i.id != floor],
    )
    # The bedroom, beyond x = -2, has a strip of 1 m along its middle that is open.
    tiles = (
        ((-2.0, -0.1, -2.0), (6.0, 0.0, 2.0)),
        ((-6.0, -0.1, -2.0), (-3.5, 0.0, 2.0)),
        ((-3.5, -0.1, -2.0), (-2.0, 0.0, 1.0)),
    )
    whole = (*tiles, ((-3.5, -0.1, 1.0), (-2.0, 0.0, 2.0)))
    assert not serious(checked(boxes_added(bare, "floor", *whole)))
    (found,) = serious(checked(boxes_added(bare, "floor", *tiles)))
    assert "of the bedroom has no floor" in found.what
    assert "Fill the hole" in found.remedy


@pytest.mark.parametrize("size", [1e6, 1e5, 300.0])
def test_a_room_of_absurd_size_takes_no_memory(toy_scene: Scene, checked, size: float):
    room = dataclasses.replace(toy_scene.rooms[0], aabb_min=np.full(3, -size), aabb_max=np.full(3, size))
    found = serious(checked(dataclasses.replace(toy_scene, rooms=[room])))
    assert ["has no floor" in f.what for f in found] == [True]


@pytest.mark.parametrize("target", ["nowhere", "", " ", "mp3d:nowhere", "file:nowhere.glb"])
def test_what_is_not_there_is_one_error(target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert [f.severity for f in check(target)] == ["error"]


def test_the_command_checks_all_scans_below_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for name, data in (("good", tiny_scans.boxes_glb(False)), ("cut", tiny_scans.boxes_glb(False)[:400])):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mesh.glb").write_bytes(data)
    with pytest.raises(SystemExit) as ended:
        main(["scenes", "check", str(tmp_path)])
    assert ended.value.code == 1
    said = capsys.readouterr().out
    assert f"file:{tmp_path}/cut/mesh.glb:" in said
    assert f"file:{tmp_path}/good/mesh.glb:" in said


def test_a_folder_that_cannot_be_made_is_named(
    toy_specs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "file").write_text("")
    for command in (["show", "--out", str(tmp_path / "file" / "x.png")], ["build", "--out", str(tmp_path / "file")]):
        with pytest.raises(SystemExit) as ended:
            main(["scenes", *command, toy_specs[0]])
        assert ended.value.code == 2
        assert "no folder can be made" in capsys.readouterr().out


def test_fuzz_a_finding_for_whatever_is_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    rng = np.random.default_rng(5)
    folder = tiny_scans.write_mp3d(tmp_path / "tiny")
    healthy = {file: file.read_bytes() for file in sorted(folder.iterdir())}
    files, errors = list(healthy), 0
    for _ in range(CASES or 60):
        file = files[int(rng.integers(len(files)))]
        file.write_bytes(damaged(healthy[file], rng))
        found = check(str(folder))
        assert all(f.what and str(f).strip() for f in found)
        errors += any(f.severity == "error" for f in found)
        file.write_bytes(healthy[file])
    assert errors
