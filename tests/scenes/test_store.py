"""Scenes on disk: what is opened equals what was saved, damage is seen, memory is shared, the cache keeps and forgets rightly."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st
from kept_scenes import ARRAYS, Reader, assert_same, entries, unfinished

from openmap_env.navigation import NavigableSurface
from openmap_scenes import DataError, Instance, Material, Scene
from openmap_scenes.cache import cached
from openmap_scenes.store import INDEX, TEXTURES, open_scene, save_scene, stored_bytes

# The folder


@pytest.mark.parametrize("which", ["toy_scene", "rich_scene"])
def test_what_is_opened_equals_what_was_saved(which: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    scene: Scene = request.getfixturevalue(which)
    save_scene(scene, tmp_path / "scene")
    assert_same(scene, open_scene(tmp_path / "scene"))
    assert open_scene(tmp_path / "scene", source="file:moved").source == "file:moved"
    assert unfinished(tmp_path) == []


def test_a_texture_of_two_materials_is_kept_once(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    opened = open_scene(tmp_path / "scene")
    assert opened.materials[0].texture is opened.materials[3].texture
    assert np.load(tmp_path / "scene" / TEXTURES).size == (8 * 6 + 5 * 7) * 3
    written = sum(file.stat().st_size for file in (tmp_path / "scene").iterdir())
    assert written <= stored_bytes(rich_scene)


def test_opened_arrays_are_maps_that_nobody_can_write(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    scene = open_scene(tmp_path / "scene")
    textures = [m.texture for m in scene.materials if m.texture is not None]
    for array in [getattr(scene, name) for name in ARRAYS] + textures:
        assert type(array) is np.ndarray
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
        owner = array
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        assert isinstance(owner, np.memmap)


@given(seed=st.integers(0, 2**32 - 1), with_uv=st.booleans(), with_colour=st.booleans())
def test_any_scene_survives_the_disk(
    seed: int, with_uv: bool, with_colour: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rng = np.random.default_rng(seed)
    n, f, m = (int(x) for x in rng.integers([3, 1, 1], [40, 40, 5]))
    ids = np.unique(rng.integers(1, 2**31 - 1, 3)).tolist()
    boxes = rng.normal(size=(len(ids), 3)) * 10.0 ** rng.integers(-12, 12)
    scene = Scene(
        name=f"s{seed}",
        vertices=rng.normal(size=(n, 3)).astype(np.float32),
        faces=rng.integers(0, n, (f, 3), np.int32),
        face_material=rng.integers(0, m, f, np.int32),
        face_instance=rng.choice(np.array([0, *ids], np.int32), f),
        materials=[
            Material(f"m{k}", rng.random(3, np.float32), rng.integers(0, 256, (k + 1, 2, 3), np.uint8) if k else None)
            for k in range(m)
        ]
        * 1,
        instances=[Instance(i, "thing", b, b - 1, b + 1, None) for i, b in zip(ids, boxes, strict=True)],
        uv=rng.normal(size=(n, 2)).astype(np.float32) if with_uv else None,
        vertex_colour=rng.integers(0, 256, (n, 3), np.uint8) if with_colour else None,
    )
    folder = tmp_path_factory.mktemp("any") / "scene"
    save_scene(scene, folder)
    assert_same(scene, open_scene(folder))


def test_a_scene_replaces_a_scene_and_nothing_else(toy_scene: Scene, rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    before = open_scene(tmp_path / "scene")
    save_scene(toy_scene, tmp_path / "scene")
    assert_same(toy_scene, open_scene(tmp_path / "scene"))
    assert_same(rich_scene, before)  # whoever has the old one open keeps it
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.txt").write_text("work of years")
    with pytest.raises(DataError, match="thesis"):
        save_scene(toy_scene, tmp_path / "thesis")
    assert (tmp_path / "thesis" / "chapter.txt").is_file()


def test_a_wrong_type_of_array_is_not_saved(toy_scene: Scene, tmp_path: Path) -> None:
    wrong = dataclasses.replace(toy_scene, faces=toy_scene.faces.astype(np.int64))
    with pytest.raises(DataError, match="faces of type int64"):
        save_scene(wrong, tmp_path / "scene")
    assert list(tmp_path.iterdir()) == []


FILES = [INDEX, TEXTURES, *(f"{name}.npy" for name in ARRAYS)]


def missing(path: Path) -> None:
    path.unlink()


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def empty(path: Path) -> None:
    path.write_bytes(b"")


def longer(path: Path) -> None:
    path.write_bytes(path.read_bytes() + b"\0")


def other_header(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[:100] = bytes(100)
    path.write_bytes(data)


def other_type(path: Path) -> None:
    if path.suffix == ".npy":
        np.save(path, np.load(path).astype(np.float64))
    else:
        path.write_text(path.read_text().replace('"version": 1', '"version": 2'))


def other_shape(path: Path) -> None:
    if path.suffix == ".npy":
        array = np.load(path)
        np.save(path, array.reshape(-1)[::-1][:-1])
    else:
        path.write_text(path.read_text().replace('"arrays": {', '"arrays": {"normals": [1, 3], '))


def pickled(path: Path) -> None:
    np.save(path.with_suffix(".x.npy"), np.array([{"a": 1}], object), allow_pickle=True)
    path.with_suffix(".x.npy").replace(path)


DAMAGES = [missing, cut, empty, longer, other_header, other_type, other_shape, pickled]


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda d: d.__name__)
@pytest.mark.parametrize("name", FILES)
def test_damage_of_any_file_is_seen_and_mended(
    name: str, damage: Callable[[Path], None], rich_scene: Scene, cache_folder: Path
) -> None:
    reader = Reader(rich_scene)
    cached(["k"], [], reader)
    (entry,) = entries(cache_folder)
    damage(entry / name)
    with pytest.raises(DataError):
        open_scene(entry)
    assert_same(rich_scene, cached(["k"], [], reader))
    assert reader.calls == 2
    assert_same(rich_scene, cached(["k"], [], reader))
    assert reader.calls == 2
    assert entries(cache_folder) == [entry]


def test_every_flipped_bit_of_the_tables_is_seen(toy_scene: Scene, tmp_path: Path) -> None:
    save_scene(toy_scene, tmp_path / "scene")
    path = tmp_path / "scene" / INDEX
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for at in [*range(130), *rng.integers(0, len(whole), 300).tolist()]:
        data = bytearray(whole)
        data[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        with pytest.raises(DataError):
            open_scene(tmp_path / "scene")


@pytest.mark.parametrize(
    ("name", "value"), [("faces", 10**6), ("faces", -1), ("face_material", 99), ("face_instance", 9999)]
)
def test_numbers_out_of_range_are_seen(name: str, value: int, toy_scene: Scene, tmp_path: Path) -> None:
    save_scene(toy_scene, tmp_path / "scene")
    array = np.load(tmp_path / "scene" / f"{name}.npy", mmap_mode="r+")
    array.reshape(-1)[5] = value
    array.flush()
    with pytest.raises(DataError, match=str(value)):
        open_scene(tmp_path / "scene")


def with_tables(path: Path, change: Callable[[dict[str, object]], None]) -> None:
    """Change the tables of a saved scene and give them the digest that fits."""
    whole = json.loads(path.read_bytes())
    change(whole["scene"])
    payload = json.dumps(whole["scene"]).encode()
    digest = hashlib.blake2b(payload, digest_size=32).hexdigest()
    head = f'{{"format": "openmap-scene", "version": 1, "blake2b": "{digest}", "scene": '
    path.write_bytes(head.encode() + payload + b"}")


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.pop("name"),
        lambda t: t.update(arrays={}),
        lambda t: t["arrays"].update(vertices=[2**62, 3]),
        lambda t: t["arrays"].update({"../scene": [1]}),
        lambda t: t.update(textures=[[8, 6]]),
        lambda t: t.update(textures=[[-8, 6], [5, 7]]),
        lambda t: t["materials"][0].update(texture=7),
        lambda t: t["materials"][0].update(colour="red"),
        lambda t: t["instances"][0].update(shape="round"),
        lambda t: t["rooms"].append(3),
        lambda t: t.update(instances=[]),
    ],
)
def test_tables_that_do_not_fit_together_are_seen(
    change: Callable[[dict[str, object]], None], rich_scene: Scene, tmp_path: Path
) -> None:
    save_scene(rich_scene, tmp_path / "scene")
    with_tables(tmp_path / "scene" / INDEX, change)
    with pytest.raises(DataError):
        open_scene(tmp_path / "scene")


def test_fuzz_a_damaged_folder_opens_or_is_refused(rich_scene: Scene, tmp_path: Path) -> None:
    save_scene(rich_scene, tmp_path / "healthy" / "scene")
    (tmp_path / "scratch").mkdir()

    def read(folder: Path) -> str:
        return open_scene(folder).digest()

    assert hold_to_data_error(read, tmp_path / "healthy" / "scene", FILES, tmp_path / "scratch", 400) > 100


# The checks of a scene, plain and in blocks


def plain_unlisted(face_instance: np.ndarray, listed: set[int]) -> list[int]:
    return sorted(set(np.unique(face_instance).tolist()) - {0} - listed)


@given(
    faces=st.lists(
        st.one_of(st.integers(-3, 9), st.sampled_from([2**20, 2**31 - 1, -(2**31)])), min_size=1, max_size=30
    ),
    listed=st.sets(st.one_of(st.integers(-2, 9), st.sampled_from([2**20, 2**31 - 1, 2**40]))),
)
def test_unlisted_ids_are_those_that_the_plain_way_finds(faces: list[int], listed: set[int]) -> None:
    from openmap_scenes.scene import _unlisted

    array = np.array(faces, np.int32)
    assert _unlisted(array, listed) == plain_unlisted(array, listed)


def test_what_is_wrong_in_a_late_block_is_seen(toy_scene: Scene) -> None:
    n = 200_000
    big = {
        "vertices": np.zeros((n, 3), np.float32),
        "faces": np.zeros((n, 3), np.int32),
        "face_material": np.zeros(n, np.int32),
        "face_instance": np.ones(n, np.int32),
    }
    Scene("big", **big, materials=toy_scene.materials, instances=toy_scene.instances)
    for name, value, says in (("vertices", np.nan, "not finite"), ("face_instance", 77, "77")):
        wrong = big[name].copy()
        wrong[-1] = value
        with pytest.raises(DataError, match=says):
            Scene("big", **(big | {name: wrong}), materials=toy_scene.materials, instances=toy_scene.instances)


RACE = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from conftest import make_toy_scene
from openmap_scenes.store import open_scene, save_scene
scene = make_toy_scene()
for _ in range(30):
    save_scene(scene, Path(sys.argv[2]))
print(open_scene(Path(sys.argv[2])).digest() if sys.argv[3] == "last" else scene.digest())
"""


def test_processes_that_write_one_folder_at_once_leave_a_whole_scene(toy_scene: Scene, tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", RACE, str(Path(__file__).parents[1]), str(tmp_path / "race" / "scene"), "any"]
    writers = [subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    whole = 0
    while any(writer.poll() is None for writer in writers):
        try:
            assert open_scene(tmp_path / "race" / "scene").digest() == toy_scene.digest()
            whole += 1
        except DataError:
            pass  # between the two renames of a replacement
    assert [writer.wait() for writer in writers] == [0, 0]
    assert {writer.communicate()[0].strip() for writer in writers} == {toy_scene.digest()}
    assert whole > 0
    assert open_scene(tmp_path / "race" / "scene").digest() == toy_scene.digest()
    assert [item.name for item in (tmp_path / "race").iterdir()] == ["scene"]


# What uses a scene


def test_navigation_and_pictures_work_on_what_was_kept(rich_scene: Scene, tmp_path: Path) -> None:
    from openmap_env.rendering.raycast import RaycastRenderer
    from openmap_scenes import PinholeCamera

    save_scene(rich_scene, tmp_path / "scene")
    opened = open_scene(tmp_path / "scene")
    fresh, kept = NavigableSurface.from_scene(rich_scene), NavigableSurface.from_scene(opened)
    np.testing.assert_array_equal(fresh.centres, kept.centres)
    T_world_camera = np.eye(4)
    T_world_camera[:3, 3] = (0.0, 1.2, 0.0)
    camera = PinholeCamera.from_hfov(64, 48, 90.0)
    one, other = (RaycastRenderer(s, camera, threads=1).render(T_world_camera) for s in (rich_scene, opened))
    np.testing.assert_array_equal(one.rgb, other.rgb)
    np.testing.assert_array_equal(one.depth, other.depth)
    np.testing.assert_array_equal(one.instance, other.instance)
