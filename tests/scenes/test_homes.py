"""Generated homes: what every one of them must hold, whatever its seed."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections import Counter, defaultdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, label

from openmap_env.navigation import NavigableSurface
from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.homes import build_home, build_home_from_seed
from openmap_scenes.homes.assemble import assemble
from openmap_scenes.homes.build import Drawn, draw_home
from openmap_scenes.homes.kinds import KEPT_FOR, SPLITS, TEST_ONLY, mpcat40, read_kinds, read_splits
from openmap_scenes.homes.library import FOLDER_VARIABLE, furniture_folder, read_library
from openmap_scenes.homes.models import load_model, prepare_model
from openmap_scenes.homes.parametric import GENERATORS
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.stock import Stock
from openmap_scenes.homes.wishes import NEEDS
from openmap_scenes.scene import Instance
from openmap_scenes.taxonomy import labels_of

SPECS = ("val/8", "test/1")
STRUCTURE = {"wall", "floor", "ceiling", "window", "door", "door frame", "front door", "balcony door"}

needs_library = pytest.mark.skipif(
    not list(furniture_folder().glob("*.sh3f")),
    reason=f"no furniture at {furniture_folder()}; install sweethome3d-furniture or set {FOLDER_VARIABLE}",
)


@pytest.fixture(scope="module")
def drawn() -> dict[str, Drawn]:
    return {spec: draw_home(spec.split("/")[0], int(spec.split("/")[1])) for spec in (*SPECS, "train/12")}


@pytest.fixture(scope="module")
def homes(drawn: dict[str, Drawn]) -> dict[str, Scene]:
    return {spec: assemble(spec, spec, d.plan, d.shell, d.items, d.rng) for spec, d in drawn.items() if spec in SPECS}


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
        "from openmap_scenes.homes import build_home; print(digest(build_home('val/8')))"
    )
    here = str(Path(__file__).parent)
    other = subprocess.run([sys.executable, "-c", code, here], capture_output=True, text=True, check=True)
    assert other.stdout.split()[-1] == digest(homes["val/8"])


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
    assert len(objects(home)) >= 12 * len(home.rooms)
    assert len({i.category for i in objects(home)}) >= 45
    assert 30_000 < len(home.faces) < 500_000
    assert len(home.credits) > 10


@needs_library
def test_every_instance_has_words_a_room_and_faces(home: Scene) -> None:
    rooms = {room.id for room in home.rooms}
    seen = set(np.unique(home.face_instance).tolist())
    for i in home.instances:
        assert i.category == i.category.lower().strip()
        assert i.room in rooms
        assert i.id in seen
        assert i.mpcat40 == mpcat40(i.category)
        labels = labels_of(i.category)
        assert (i.scannet200, i.lvis) == (labels.scannet200, labels.lvis)
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
    """Where boxes share room (a chair under a table, a bed at a wall) no edge of one goes a centimetre through the other."""
    meshes: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for i in home.instances:
        used, inverse = np.unique(home.faces[home.face_instance == i.id], return_inverse=True)
        meshes[i.id] = home.vertices[used].astype(np.float64), inverse.reshape(-1, 3)
    casters: dict[int, RayCaster] = {}
    for a, b in combinations(home.instances, 2):
        if a.category in STRUCTURE and b.category in STRUCTURE:
            continue
        if np.any(np.minimum(a.aabb_max - b.aabb_min, b.aabb_max - a.aabb_min) <= 0.01):
            continue
        low, high = np.maximum(a.aabb_min, b.aabb_min), np.minimum(a.aabb_max, b.aabb_max)
        for (points, faces), other in ((meshes[a.id], b.id), (meshes[b.id], a.id)):
            pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
            start, end = points[pairs[:, 0]], points[pairs[:, 1]]
            near = np.all((np.minimum(start, end) <= high) & (np.maximum(start, end) >= low), axis=1)
            start, way = start[near], (end - start)[near]
            caster = casters.setdefault(other, RayCaster(*meshes[other])) if len(start) else None
            if caster is not None:
                t, face = caster.first_hit(start, way)
                corner = meshes[other][0][meshes[other][1][face]]
                normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
                across = np.abs((normal * way).sum(1)) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
                hit = np.isfinite(t) & (t < 1.0)
                t = np.where(hit, t, 0.0)
                assert not (hit & (across * t > 0.01) & (across * (1 - t) > 0.01)).any(), (a.category, b.category)


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
def test_every_room_has_what_it_is_for(drawn: dict[str, Drawn]) -> None:
    for home in drawn.values():
        for room, kind in enumerate(home.plan.kinds):
            there = {i.thing.kind for i in home.items if i.room == room}
            for row in NEEDS[kind]:
                assert there & set(row), (kind, row)


@needs_library
def test_no_model_is_in_homes_of_two_splits(drawn: dict[str, Drawn]) -> None:
    """Neither by its name nor, for what is made by rule, by its shape and colours."""
    pieces, looks = defaultdict(set), defaultdict(set)
    for spec, home in drawn.items():
        split = spec.split("/")[0]
        for item in home.items:
            if item.thing.piece:
                pieces[item.thing.piece].add(split)
            if item.thing.made:
                model = item.thing.model
                look = model.vertices.tobytes() + b"".join(
                    m.colour.tobytes() + (b"" if m.texture is None else m.texture.tobytes()) for m in model.materials
                )
                looks[hashlib.sha256(look).hexdigest()].add(split)
    assert len(pieces) > 100
    assert not [piece for piece, splits in pieces.items() if len(splits) > 1]
    assert not [look for look, splits in looks.items() if len(splits) > 1]


def test_kinds_kept_for_a_split_are_in_no_other() -> None:
    splits, kinds = read_splits(), read_kinds()
    assert len(TEST_ONLY) >= 12
    for piece, kind in kinds.items():
        assert splits[piece] == KEPT_FOR.get(kind.kind, splits[piece]), piece
    stocks = {split: Stock(split, np.random.default_rng(0)) for split in SPLITS}
    for name, kept in KEPT_FOR.items():
        for split, stock in stocks.items():
            assert split == kept or not stock.has(name), (name, split)


def test_without_the_library_a_home_is_made_by_rule_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, "none")
    home = draw_home("train", 12)
    assert len(home.items) > 8 * len(home.plan.kinds)
    assert not any(i.thing.credit for i in home.items)
    assert sum(i.thing.made for i in home.items) > 0.9 * len(home.items)


def test_the_taxonomy_knows_every_kind() -> None:
    kinds = {kind.kind for kind in read_kinds().values()} | set(GENERATORS) | STRUCTURE
    assert not [kind for kind in sorted(kinds) if labels_of(kind).mpcat40 != mpcat40(kind)]


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


@needs_library
def test_the_navigable_surface_of_the_environment_reaches_every_room(home: Scene) -> None:
    surface = NavigableSurface.from_scene(home)
    main = surface.centres[surface.island == 0]
    for room in home.rooms:
        inside = (main[:, [0, 2]] > room.aabb_min[[0, 2]]) & (main[:, [0, 2]] < room.aabb_max[[0, 2]])
        assert inside.all(1).sum() > 20, room.name
