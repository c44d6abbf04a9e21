"""Generated homes: what every one of them must hold, whatever its seed."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, label

from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.homes import build_home, build_home_from_seed
from openmap_scenes.homes.kinds import SPLITS, mpcat40, read_kinds, read_splits
from openmap_scenes.homes.library import FOLDER_VARIABLE, furniture_folder, read_library
from openmap_scenes.homes.models import load_model, prepare_model
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.scene import Instance

SPECS = ("val/0", "test/1")
STRUCTURE = {"wall", "floor", "ceiling", "window", "door", "door frame", "front door", "balcony door"}

needs_library = pytest.mark.skipif(
    not list(furniture_folder().glob("*.sh3f")),
    reason=f"no furniture at {furniture_folder()}; install sweethome3d-furniture or set {FOLDER_VARIABLE}",
)


@pytest.fixture(scope="module")
def homes() -> dict[str, Scene]:
    return {spec: build_home(spec) for spec in SPECS}


@pytest.fixture(params=SPECS)
def home(request: pytest.FixtureRequest, homes: dict[str, Scene]) -> Scene:
    return homes[request.param]


def objects(scene: Scene) -> list[Instance]:
    return [i for i in scene.instances if i.category not in STRUCTURE]


def digest(scene: Scene) -> str:
    hasher = hashlib.sha256()
    for array in (scene.vertices, scene.faces, scene.face_material, scene.face_instance, scene.uv, scene.vertex_colour):
        assert array is not None
        hasher.update(np.ascontiguousarray(array).tobytes())
    for material in scene.materials:
        hasher.update(material.colour.tobytes() + (b"" if material.texture is None else material.texture.tobytes()))
    hasher.update(repr([(i.category, i.attributes, i.room) for i in scene.instances]).encode())
    return hasher.hexdigest()


@needs_library
def test_a_home_is_the_same_bytes_in_another_process(homes: dict[str, Scene]) -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from test_homes import digest; "
        "from openmap_scenes.homes import build_home; print(digest(build_home('val/0')))"
    )
    here = str(Path(__file__).parent)
    other = subprocess.run([sys.executable, "-c", code, here], capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == digest(homes["val/0"])


@needs_library
def test_a_model_is_the_same_from_the_cache_as_from_the_archive() -> None:
    piece = read_library()["scopia/bed1"]
    cached, fresh = load_model(piece), prepare_model(piece)
    for name in ("vertices", "normals", "uv", "faces", "face_material"):
        np.testing.assert_array_equal(getattr(cached, name), getattr(fresh, name))
    np.testing.assert_allclose(fresh.size, piece.size, atol=0.03)


@needs_library
def test_a_home_is_full_of_things(home: Scene) -> None:
    assert len(home.rooms) >= 2
    assert len(objects(home)) >= 25
    assert len({i.category for i in objects(home)}) >= 20
    assert 30_000 < len(home.faces) < 400_000
    assert home.credits


@needs_library
def test_every_instance_has_words_a_room_and_faces(home: Scene) -> None:
    rooms = {room.id for room in home.rooms}
    seen = set(np.unique(home.face_instance).tolist())
    for i in home.instances:
        assert i.category == i.category.lower().strip()
        assert i.room in rooms
        assert i.id in seen
        assert i.mpcat40 == mpcat40(i.category)
    assert all("colour" in i.attributes for i in objects(home))
    assert len({room.name for room in home.rooms}) == len(home.rooms)


@needs_library
def test_things_lie_in_their_room(home: Scene) -> None:
    rooms = {room.id: room for room in home.rooms}
    for i in objects(home):
        room = rooms[i.room or 0]
        assert room.contains(i.aabb_min, margin=0.01), (i.category, i.id)
        assert room.contains(i.aabb_max, margin=0.01), (i.category, i.id)


@needs_library
def test_no_two_solids_run_into_each_other_by_more_than_a_centimetre(home: Scene) -> None:
    """Boxes stay apart; where one lies in another's (a lamp on a desk with shelves), it stands on the other's surface."""
    stood = 0
    for a, b in combinations(objects(home), 2):
        depth = np.minimum(a.aabb_max, b.aabb_max) - np.maximum(a.aabb_min, b.aabb_min)
        if depth.min() <= 0.01:
            continue
        below, above = (a, b) if a.aabb_min[1] < b.aabb_min[1] else (b, a)
        mesh = RayCaster(home.vertices, home.faces[home.face_instance == below.id])
        x = np.linspace(above.aabb_min[0], above.aabb_max[0], 9)
        z = np.linspace(above.aabb_min[2], above.aabb_max[2], 9)
        start = np.stack([g.reshape(-1) for g in np.meshgrid(x, [3.0], z)], 1)
        surface = 3.0 - mesh.distance(start, np.broadcast_to([0.0, -1.0, 0.0], start.shape))
        assert surface.max() <= above.aabb_min[1] + 0.01, (below.category, above.category, depth)
        stood += 1
    assert stood < len(objects(home))


@needs_library
def test_nothing_hangs_in_the_air(home: Scene) -> None:
    others = home.instances
    for i in objects(home):
        touches = any(
            j.id != i.id and np.all(np.minimum(i.aabb_max, j.aabb_max) - np.maximum(i.aabb_min, j.aabb_min) > -0.02)
            for j in others
            if j.category != "floor" or i.aabb_min[1] < 0.02
        )
        assert touches, (i.category, i.aabb_min, i.aabb_max)


@needs_library
def test_a_body_of_20_cm_walks_into_every_room(home: Scene) -> None:
    """Measured on the triangles, not on the boxes that the generator used."""
    cell, low = 0.05, home.aabb[0]
    shape = tuple((np.ceil((home.aabb[1] - low) / cell) + 1).astype(int)[[2, 0]])
    solid, floor = np.zeros(shape, bool), np.zeros(shape, bool)
    rng = np.random.default_rng(0)
    corners = home.vertices[home.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    counts = np.ceil(area * 2500).astype(int) + 1
    face = np.repeat(np.arange(len(corners)), counts)
    w = rng.dirichlet((1, 1, 1), len(face))
    points = (corners[face] * w[..., None]).sum(1)
    cells = ((points - low) / cell).astype(int)
    block = (points[:, 1] > 0.06) & (points[:, 1] < 1.5)
    solid[cells[block, 2], cells[block, 0]] = True
    ground = points[:, 1] < 0.03
    floor[cells[ground, 2], cells[ground, 0]] = True
    disc = np.hypot(*np.mgrid[-4:5, -4:5]) <= 4
    areas, _ = label(floor & ~binary_dilation(solid, disc))
    reached = []
    for room in home.rooms:
        a, b = ((room.aabb_min - low) / cell).astype(int), ((room.aabb_max - low) / cell).astype(int)
        sizes = Counter(areas[a[2] : b[2], a[0] : b[0]].reshape(-1).tolist())
        reached.append({k for k, n in sizes.items() if k > 0 and n * cell**2 > 0.4})
    assert set.intersection(*reached)


@needs_library
def test_doors_are_free_on_both_sides(home: Scene) -> None:
    for frame in (i for i in home.instances if i.category == "door frame"):
        size = frame.aabb_max - frame.aabb_min
        across = 0 if size[0] < size[2] else 2
        low, high = frame.aabb_min.copy(), frame.aabb_max.copy()
        low[across], high[across] = frame.centre[across] - 0.9, frame.centre[across] + 0.9
        # The frame is wider than the opening by its trim.
        low[2 - across] += 0.07
        high[2 - across] -= 0.07
        for i in objects(home):
            if i.aabb_max[1] > 0.03 and i.aabb_min[1] < 1.5:
                depth = np.minimum(i.aabb_max, high) - np.maximum(i.aabb_min, low)
                assert depth[[0, 2]].min() <= 0.01, (i.category, i.aabb_min, i.aabb_max)


@needs_library
def test_light_varies_over_a_room(home: Scene) -> None:
    assert home.vertex_colour is not None
    for i in home.instances:
        if i.category == "floor":
            used = np.unique(home.faces[home.face_instance == i.id])
            assert home.vertex_colour[used].mean(1).std() > 4.0


@needs_library
def test_homes_of_two_splits_share_no_piece(homes: dict[str, Scene]) -> None:
    assert not set(homes["val/0"].credits) & set(homes["test/1"].credits)


@needs_library
def test_the_table_of_kinds_names_pieces_of_the_library() -> None:
    library = read_library()
    assert not [piece for piece in read_kinds() if piece not in library]


def test_common_kinds_are_in_every_split_and_train_has_most() -> None:
    splits, kinds = read_splits(), read_kinds()
    assert set(splits) == set(kinds)
    count = Counter(kind.kind for kind in kinds.values())
    for kind, n in count.items():
        if n >= 3:
            assert {splits[p] for p, k in kinds.items() if k.kind == kind} == set(SPLITS), kind
    share = Counter(splits.values())
    assert share["train"] > 0.55 * len(splits)
    assert min(share["val"], share["test"]) > 0.12 * len(splits)


def test_a_missing_library_is_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "nowhere"))
    with pytest.raises(DataError, match=r"no such folder.*sweethome3d-furniture.*OPENMAP_FURNITURE"):
        load_scene("homes:val/3")


@pytest.mark.parametrize("spec", ["val", "val/", "dev/3", "val/-1", "val/x", "/3"])
def test_a_wrong_spec_says_what_is_expected(spec: str) -> None:
    with pytest.raises(DataError, match="train, val, test"):
        build_home(spec)


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="seed"):
        build_home_from_seed("val", -1)
