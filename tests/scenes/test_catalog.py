"""Specs: what they name, what is said where they name nothing, what lies in a folder, what the cache does for whom."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import openmap_scenes.cache as cache_module
import openmap_scenes.catalog as catalog
from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.catalog import FORMATS, HOME_SPLITS, READERS, expand_specs, guess_spec, list_scenes
from openmap_scenes.discovery import MESH_SUFFIXES

SCAN = "aws_small_house"


@pytest.fixture(autouse=True)
def cache_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("OPENMAP_CACHE", str(folder))
    monkeypatch.delenv("OPENMAP_CACHE_GB", raising=False)
    return folder / "scenes-v1"


def put(root: Path, *names: str) -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(b"not to be read")


def entries(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")) if folder.is_dir() else []


# Lists


def datasets(root: Path) -> list[str]:
    """A tree as Habitat lays it out, and beside it raw downloads and loose meshes; returns what should be found."""
    s = "scene_datasets"
    put(root, f"{s}/mp3d/17DR/17DR.glb", f"{s}/mp3d/17DR/17DR.house", f"{s}/mp3d/17DR/17DR_semantic.ply")
    put(root, f"{s}/mp3d/17DR/17DR.navmesh", f"{s}/mp3d/mp3d.scene_dataset_config.json")
    put(root, "v1/scans/2azQ/house_segmentations/2azQ.house", "v1/scans/2azQ/house_segmentations/2azQ.ply")
    put(root, "v1/scans/2azQ/matterport_mesh/ab/ab.obj")
    put(root, f"{s}/hm3d/val/00800-TEEs/TEEs.glb", f"{s}/hm3d/val/00800-TEEs/TEEs.semantic.glb")
    put(root, f"{s}/hm3d/val/00800-TEEs/TEEs.semantic.txt", f"{s}/hm3d/val/00800-TEEs/TEEs.basis.glb")
    put(root, f"{s}/hm3d/val/00801-HaxA/HaxA.glb", f"{s}/hm3d/val/00802-wcoj/wcoj.basis.glb")
    put(root, f"{s}/gibson/Adrian.glb", f"{s}/gibson/Adrian.navmesh", f"{s}/gibson_semantic/Allen.glb")
    put(root, f"{s}/gibson_semantic/Allen_semantic.ply", f"{s}/gibson_semantic/Allen.ids")
    put(root, "replica/room_0/mesh.ply", "replica/room_0/habitat/mesh_semantic.ply")
    put(root, "replica/room_0/habitat/info_semantic.json", "replica/room_0/textures/0-color-ptex.hdr")
    put(root, "scannet/scans/scene0000_00/scene0000_00_vh_clean_2.ply")
    put(root, "scannet/scans/scene0000_00/scene0000_00_vh_clean.ply", "scannet/scans/scene0000_00/scene0000_00.sens")
    put(root, "loose/flat.obj", "loose/flat.mtl", "loose/sofa.STL", "loose/.hidden.glb", "notes.txt", ".git/x.glb")
    return [
        f"file:{root}/loose/flat.obj",
        f"file:{root}/loose/sofa.STL",
        f"gibson:{root}/{s}/gibson/Adrian.glb",
        f"gibson:{root}/{s}/gibson_semantic/Allen.glb",
        f"hm3d:{root}/{s}/hm3d/val/00800-TEEs",
        f"hm3d:{root}/{s}/hm3d/val/00801-HaxA",
        f"mp3d:{root}/{s}/mp3d/17DR",
        f"mp3d:{root}/v1/scans/2azQ",
        f"replica:{root}/replica/room_0",
        f"scannet:{root}/scannet/scans/scene0000_00",
    ]


def test_everything_below_a_folder_is_found(tmp_path: Path) -> None:
    expected = datasets(tmp_path)
    assert list_scenes(tmp_path) == sorted(expected)
    for spec in expected:
        assert guess_spec(spec.partition(":")[2]) == spec
        assert list_scenes(spec.partition(":")[2]) == [spec]
    assert expand_specs(str(tmp_path)) == sorted(expected)
    assert list_scenes(tmp_path / ".git") == [f"file:{tmp_path}/.git/x.glb"]


def test_links_are_followed_and_may_go_in_circles(tmp_path: Path) -> None:
    put(tmp_path / "elsewhere", "a/a.glb", "a/a.house", "a/a_semantic.ply")
    (tmp_path / "data" / "mp3d").mkdir(parents=True)
    (tmp_path / "data" / "mp3d" / "a").symlink_to(tmp_path / "elsewhere" / "a")
    (tmp_path / "data" / "mp3d" / "up").symlink_to(tmp_path / "data")
    assert list_scenes(tmp_path / "data") == [f"mp3d:{tmp_path}/data/mp3d/a"]


def test_a_file_of_a_scan_means_the_scan(tmp_path: Path) -> None:
    datasets(tmp_path)
    folder = tmp_path / "scene_datasets" / "mp3d" / "17DR"
    for name in ("17DR.glb", "17DR.house", "17DR_semantic.ply"):
        assert guess_spec(folder / name) == f"mp3d:{folder}"


@pytest.mark.parametrize(
    ("names", "kind"),
    [
        (["x.house"], "mp3d"),
        (["x.semantic.txt"], "hm3d"),
        (["00001-x/x.basis.glb"], "hm3d"),
        (["s_vh_clean_2.0.010000.segs.json"], "scannet"),
        (["info_semantic.json"], "replica"),
        (["x.glb"], "file"),
    ],
)
def test_a_scan_with_missing_files_is_told_but_not_listed(names: list[str], kind: str, tmp_path: Path) -> None:
    put(tmp_path / "d", *names)
    folder = (tmp_path / "d" / names[0]).parent
    assert guess_spec(folder).partition(":")[0] == kind
    assert [spec.partition(":")[0] for spec in list_scenes(tmp_path)] == (["file"] if kind == "file" else [])


def test_a_folder_without_a_scene_or_with_several_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no scene"):
        guess_spec(tmp_path)
    with pytest.raises(DataError, match="no scene"):
        expand_specs(str(tmp_path))
    put(tmp_path, "a.glb", "b.obj", "c.txt")
    with pytest.raises(DataError, match=r"2 scenes.*a\.glb"):
        guess_spec(tmp_path)
    with pytest.raises(DataError, match=r"suffix '\.txt'"):
        guess_spec(tmp_path / "c.txt")


def test_the_shared_scenes_are_found(shared_scenes: Path) -> None:
    found = {spec.partition(":")[0]: spec for spec in list_scenes(shared_scenes) if "/broken/" not in spec}
    assert found == {
        "mp3d": f"mp3d:{shared_scenes}/mp3d/{SCAN}",
        "hm3d": f"hm3d:{shared_scenes}/hm3d/00001-{SCAN}",
        "replica": f"replica:{shared_scenes}/replica/{SCAN}",
        "scannet": f"scannet:{shared_scenes}/scannet/scene0900_00",
    }


# Specs


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        ("homes:val/0-3", ["homes:val/0", "homes:val/1", "homes:val/2", "homes:val/3"]),
        ("homes:test/7", ["homes:test/7"]),
        ("homes:train/007", ["homes:train/7"]),
        ("homes:val/0,3,5-6", ["homes:val/0", "homes:val/3", "homes:val/5", "homes:val/6"]),
        ("mp3d:/data/a-b", ["mp3d:/data/a-b"]),
    ],
)
def test_ranges(spec: str, expected: list[str]) -> None:
    assert expand_specs(spec) == expected


@given(first=st.integers(0, 10**6), count=st.integers(1, 50))
def test_a_range_is_its_numbers(first: int, count: int) -> None:
    assert expand_specs(f"homes:val/{first}-{first + count - 1}") == [
        f"homes:val/{n}" for n in range(first, first + count)
    ]


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("homes:val", r"no number.*homes:<split>/<n>.*homes:val/0"),
        ("homes:val/", r"no number"),
        ("homes:val/x", r"'x' for a number"),
        ("homes:val/-1", r"'-1' for a number"),
        ("homes:val/5-2", r"range 5-2.*smaller"),
        ("homes:val/0-99999999999", r"at most"),
        ("homes:val/²", "for a number"),
        ("homes:vla/3", r"split 'vla'.*train, val, test.*Did you mean homes:val/3"),
        ("homes:", "nothing after the colon.*homes:val/0"),
        ("homes", "no colon.*homes:val/0"),
        ("mp3d:", "nothing after the colon.*mp3d:<scan folder>"),
        ("mp3d:  ", "nothing after the colon"),
        ("mp4d:/data/x", r"kind 'mp4d'.*mp3d:\.\.\., .*Did you mean mp3d:/data/x"),
        ("HM3D:/data/x", "Did you mean hm3d:/data/x"),
        ("nonsense:1", "kind 'nonsense'"),
        ("", "kind ''"),
        (":", "kind ''"),
    ],
)
def test_a_wrong_spec_says_what_is_meant(spec: str, says: str) -> None:
    for use in (load_scene, expand_specs):
        with pytest.raises(DataError, match=says):
            use(spec)


def test_several_homes_are_not_one() -> None:
    with pytest.raises(DataError, match="3 homes"):
        load_scene("homes:val/0-2")


@pytest.mark.parametrize("kind", [k for k in FORMATS if k not in ("file", "gibson")])
def test_a_missing_folder_is_told_with_what_lies_beside_it(kind: str, tmp_path: Path) -> None:
    put(tmp_path, "scans/17DRP5sb8fy/x", "scans/2azQ1b91cZZ/x")
    with pytest.raises(DataError, match="no such folder") as caught:
        load_scene(f"{kind}:{tmp_path}/scans/17DRP5sb8fx")
    assert f"Did you mean {tmp_path}/scans/17DRP5sb8fy?" in str(caught.value)
    assert "17DRP5sb8fy, 2azQ1b91cZZ" in str(caught.value)
    with pytest.raises(DataError, match=rf"Did you mean {tmp_path}/scans/17DR"):
        load_scene(f"{kind}:{tmp_path}/scan/17DR")


def test_a_missing_mesh_is_told(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no such file.*holds nothing"):
        load_scene(f"file:{tmp_path}/a.glb")
    with pytest.raises(DataError, match="no such file"):
        load_scene(f"{tmp_path}/a.glb")


def test_every_kind_has_a_reader_and_says_which_files_it_reads() -> None:
    for kind in FORMATS:
        assert callable(catalog._function("read", kind))
        assert callable(catalog._function("files", kind))
    assert set(READERS) >= {*FORMATS, "homes"}


def test_what_is_said_twice_is_the_same(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from openmap_scenes.formats import glb
    from openmap_scenes.homes import kinds, library

    assert tuple(kinds.SPLITS) == HOME_SPLITS
    assert MESH_SUFFIXES == glb.MESH_SUFFIXES
    monkeypatch.delenv("OPENMAP_FURNITURE", raising=False)
    assert catalog.furniture_folder() == library.furniture_folder()
    monkeypatch.setenv("OPENMAP_FURNITURE", str(tmp_path))
    assert catalog.furniture_folder() == library.furniture_folder() == tmp_path


# The cache


def write_mesh(path: Path, size: float = 1.0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((size, size, size)).export(path)


def test_a_mesh_is_read_once_and_again_when_it_changes(tmp_path: Path, cache_folder: Path) -> None:
    path = tmp_path / "a" / "box.glb"
    write_mesh(path)
    fresh = load_scene(f"file:{path}", cache=False)
    assert entries(cache_folder) == []
    for _ in range(2):
        scene = load_scene(f"file:{path}")
        assert (scene.digest(), scene.source) == (fresh.digest(), f"file:{path}")
        assert len(entries(cache_folder)) == 1
    write_mesh(path, 2.0)
    assert load_scene(f"file:{path}").vertices.max() == 1.0
    assert len(entries(cache_folder)) == 2
    shutil.copytree(tmp_path / "a", tmp_path / "copy" / "a")
    assert load_scene(f"{tmp_path}/copy/a").source == f"file:{tmp_path}/copy/a/box.glb"
    assert len(entries(cache_folder)) == 2


def test_which_files_a_scene_has_is_noted_until_their_folder_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache_module, "SETTLED", -1.0)
    path = tmp_path / "box.glb"
    write_mesh(path)
    first = load_scene(f"file:{path}")
    asked: list[str] = []
    real = catalog._function

    def counting(verb: str, kind: str) -> object:
        asked.append(verb)
        return real(verb, kind)

    monkeypatch.setattr(catalog, "_function", counting)
    assert load_scene(f"file:{path}").digest() == first.digest()
    assert asked == []
    (tmp_path / "box.instances.json").write_text("{}")
    with pytest.raises(DataError, match=r"box\.instances\.json"):
        load_scene(f"file:{path}")
    assert asked[0] == "files"
    (tmp_path / "box.instances.json").unlink()
    assert load_scene(f"file:{path}").digest() == first.digest()
    for note in (tmp_path / "nowhere", *(p for p in cache_module.cache_root().rglob("notes-v1/*/*") if p.is_file())):
        if note.is_file():
            note.write_bytes(note.read_bytes()[:-1])
    assert load_scene(f"file:{path}").digest() == first.digest()


def test_no_cache_reads_each_time(tmp_path: Path, cache_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "box.glb"
    write_mesh(path)
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    assert load_scene(f"file:{path}").vertices.flags.writeable
    assert not cache_folder.parent.exists() or list(cache_folder.parent.iterdir()) == []


def test_homes_are_kept_by_split_number_and_furniture(
    toy_scene: Scene, tmp_path: Path, cache_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built: list[str] = []

    def build(rest: str) -> Scene:
        built.append(rest)
        return toy_scene

    monkeypatch.setitem(READERS, "homes", build)
    monkeypatch.setenv("OPENMAP_FURNITURE", str(tmp_path / "nothing"))
    for spec in ("homes:val/3", "homes:val/003", "homes:val/3"):
        assert load_scene(spec).digest() == toy_scene.digest()
    assert built == ["val/3"]
    load_scene("homes:train/3")
    load_scene("homes:val/4")
    assert built == ["val/3", "train/3", "val/4"]
    put(tmp_path, "furniture/a.sh3f")
    monkeypatch.setenv("OPENMAP_FURNITURE", str(tmp_path / "furniture"))
    load_scene("homes:val/3")
    load_scene("homes:val/3")
    assert len(built) == 4
    (tmp_path / "furniture" / "a.sh3f").write_bytes(b"a new catalogue")
    load_scene("homes:val/3")
    assert len(built) == 5
    load_scene("homes:val/3", cache=False)
    assert len(built) == 6
    assert len(entries(cache_folder)) == 5


def test_kinds_of_ones_own_are_not_kept(toy_scene: Scene, toy_specs: list[str], cache_folder: Path) -> None:
    assert load_scene(toy_specs[0]) is toy_scene
    assert entries(cache_folder) == []


OPEN = """
import sys
from openmap_scenes import load_scene
scene = load_scene(sys.argv[1])
print(scene.digest(), scene.vertices.flags.writeable, *sorted({"scipy", "trimesh", "numba", "PIL"} & set(sys.modules)))
"""


def test_opening_a_kept_scene_imports_no_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache_module, "SETTLED", -1.0)
    path = tmp_path / "box.glb"
    write_mesh(path)
    digest = load_scene(f"file:{path}").digest()
    done = subprocess.run([sys.executable, "-c", OPEN, f"file:{path}"], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [digest, "False"]


def test_a_real_spec_gives_what_its_reader_gives(shared_scenes: Path) -> None:
    spec = f"mp3d:{shared_scenes}/mp3d/{SCAN}"
    scene = load_scene(str(shared_scenes / "mp3d" / SCAN))
    assert scene.source == spec
    assert np.isfinite(scene.vertices).all()
