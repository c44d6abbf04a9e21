"""HM3D's format against ground truth that nobody of this project wrote, against broken files and against tiny ones made here."""

from __future__ import annotations

import io
import json
import shutil
import struct
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from openmap_env.rendering import make_renderer
from openmap_scenes import DataError, PinholeCamera
from openmap_scenes.formats.hm3d import files_hm3d, read_hm3d
from openmap_scenes.formats.hm3d_paint import face_ids, majority
from openmap_scenes.formats.hm3d_rooms import make_rooms
from openmap_scenes.formats.hm3d_table import read_table
from openmap_scenes.formats.instances import make_instance
from openmap_scenes.formats.mesh import TexturedMesh, linear_from_srgb
from openmap_scenes.formats.mp3d import read_mp3d
from openmap_scenes.scene import Material

SCAN = "aws_small_house"
HOME = "00007-tiny"
# Colour and file-frame (Z up) square of each object of the tiny scene: x from, y from, z; all are 2 m wide.
SQUARES = {1: ("0A1403", 0.0, 0.0, 0.0), 2: ("C86432", 3.0, 0.0, 0.5), 3: ("FFFF01", 0.0, 4.0, 1.0)}
TABLE = 'HM3D Semantic Annotations\n1,0A1403,"floor",0\n2,C86432,"table, ""round""",0\n3,FFFF01,"bed",1\n'
TILE = 16


def colour_of(hexadecimal: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(hexadecimal)
    return red, green, blue


def write_glb(path: Path, vertices, faces, uv=None, texture=None, colour=None, translation=(0, 0, 0)) -> None:
    """A GLB of one mesh in one node; ``colour`` (V, 3) sRGB bytes become linear 16 bit ones, as glTF wants."""
    chunks: list[bytes] = []
    views: list[dict] = []
    accessors: list[dict] = []

    def view(data: bytes) -> int:
        views.append({"buffer": 0, "byteOffset": sum(map(len, chunks)), "byteLength": len(data)})
        chunks.append(data + bytes(-len(data) % 4))
        return len(views) - 1

    def accessor(array: np.ndarray, kind: str, component: int, **more) -> int:
        entry = {"bufferView": view(array.tobytes()), "componentType": component, "count": len(array), "type": kind}
        accessors.append(entry | more)
        return len(accessors) - 1

    vertices = np.asarray(vertices, np.float32)
    bounds = {"min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()}
    attributes = {"POSITION": accessor(vertices, "VEC3", 5126, **bounds)}
    indices = accessor(np.asarray(faces, np.uint32).ravel(), "SCALAR", 5125)
    document: dict = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
    material: dict = {"pbrMetallicRoughness": {}}
    if uv is not None:
        attributes["TEXCOORD_0"] = accessor(np.asarray(uv, np.float32), "VEC2", 5126)
        png = io.BytesIO()
        Image.fromarray(texture).save(png, "PNG")
        document |= {
            "images": [{"bufferView": view(png.getvalue()), "mimeType": "image/png"}],
            "textures": [{"source": 0}],
        }
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    if colour is not None:
        linear = np.rint(linear_from_srgb(np.asarray(colour) / 255.0) * 65535).astype(np.uint16)
        rgba = np.column_stack([linear, np.full(len(linear), 65535, np.uint16)])
        attributes["COLOR_0"] = accessor(np.ascontiguousarray(rgba), "VEC4", 5123, normalized=True)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    document |= {
        "nodes": [{"mesh": 0, "translation": list(translation)}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [material],
        "bufferViews": views,
        "accessors": accessors,
        "buffers": [{"byteLength": sum(map(len, chunks))}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = b"".join(chunks)
    total = 12 + 8 + len(text) + 8 + len(body)
    header = struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<II", len(text), 0x4E4F534A)
    path.write_bytes(header + text + struct.pack("<II", len(body), 0x004E4942) + body)


def squares() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces and texture coordinates of the tiny scene, and its texture: a tile of its colour for each square."""
    vertices, faces, uv = [], [], []
    texture = np.zeros((TILE, TILE * len(SQUARES), 3), np.uint8)
    for k, (hexadecimal, x, y, z) in enumerate(SQUARES.values()):
        faces += [[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
        vertices += [[x, y, z], [x + 2, y, z], [x + 2, y + 2, z], [x, y + 2, z]]
        left, right = k / len(SQUARES), (k + 1) / len(SQUARES)
        uv += [[left, 0], [right, 0], [right, 1], [left, 1]]
        texture[:, TILE * k : TILE * (k + 1)] = colour_of(hexadecimal)
    return np.array(vertices, np.float32), np.array(faces), np.array(uv, np.float32), texture


def write_tiny(folder: Path, paint: str = "texture", semantic_folder: Path | None = None) -> Path:
    """The tiny scene, its ids in the "texture", in the "vertices", or nowhere ("none")."""
    folder.mkdir(parents=True)
    vertices, faces, uv, texture = squares()
    write_glb(folder / "tiny.glb", vertices, faces, uv, np.full_like(texture, 128), translation=(0, 0, 1))
    if paint != "none":
        target = semantic_folder or folder
        target.mkdir(parents=True, exist_ok=True)
        look = {"uv": uv, "texture": texture}
        if paint == "vertices":
            look = {"colour": np.repeat([colour_of(entry[0]) for entry in SQUARES.values()], 4, axis=0)}
        write_glb(target / "tiny.semantic.glb", vertices, faces, **look, translation=(0, 0, 1))
        (target / "tiny.semantic.txt").write_text(TABLE)
    return folder


def expect_tiny(folder: Path) -> None:
    scene = read_hm3d(folder)
    assert scene.face_instance.tolist() == [1, 1, 2, 2, 3, 3]
    assert [i.category for i in scene.instances] == ["floor", 'table, "round"', "bed"]
    # (x, y, z) of the file, raised by the node's metre, is (x, z, -y) of the world.
    np.testing.assert_allclose(scene.instance(2).aabb_min, [3, 1.5, -2], atol=1e-6)
    np.testing.assert_allclose(scene.instance(2).aabb_max, [5, 1.5, 0], atol=1e-6)
    assert [i.room for i in scene.instances] == [0, 0, 1]


@pytest.fixture(scope="module")
def house(shared_scenes: Path):
    return read_hm3d(shared_scenes / "hm3d" / f"00001-{SCAN}")


@pytest.fixture(scope="module")
def truth(shared_scenes: Path):
    return json.loads((shared_scenes / f"ground_truth_{SCAN}.json").read_text())


def test_instances_equal_the_ground_truth(house, truth):
    labelled = {entry["hm3d_id"]: entry for entry in truth["instances"] if entry["hm3d_id"]}
    assert [i.id for i in house.instances] == sorted(labelled)
    for instance in house.instances:
        expected = labelled[instance.id]
        np.testing.assert_allclose(instance.aabb_min, expected["aabb_min"], atol=1e-3)
        np.testing.assert_allclose(instance.aabb_max, expected["aabb_max"], atol=1e-3)
        np.testing.assert_allclose(instance.centre, expected["center"], atol=1e-3)
        assert (instance.category, instance.room) == (expected["category"], expected["room"])
        assert instance.source_id == instance.id
        # The format has no classes; of the house's names one ("tablet") means two things.
        assert instance.mpcat40 == expected["mpcat40"] or instance.category == "tablet"


def test_rooms_are_those_of_the_ground_truth_without_names(house, truth):
    assert [room.id for room in house.rooms] == [entry["id"] for entry in truth["rooms"]]
    for room, expected in zip(house.rooms, truth["rooms"], strict=True):
        np.testing.assert_allclose(room.aabb_min, expected["aabb_min"], atol=1e-3)
        np.testing.assert_allclose(room.aabb_max, expected["aabb_max"], atol=1e-3)
        assert room.name in (expected["name"], f"region {room.id}")
        assert room.level == 0
    assert sum(room.name.startswith("region") for room in house.rooms) <= 2


def test_what_is_painted_black_is_nobodys(house, truth):
    unlabelled = [entry for entry in truth["instances"] if entry["unlabeled"]]
    assert np.count_nonzero(house.face_instance == 0) == sum(entry["faces"] for entry in unlabelled)
    for entry in truth["instances"]:
        if entry["hm3d_id"]:
            assert np.count_nonzero(house.face_instance == entry["hm3d_id"]) == entry["faces"]


def test_the_same_picture_as_the_matterport_variant(house, shared_scenes):
    other = read_mp3d(shared_scenes / "mp3d" / SCAN)
    camera = PinholeCamera.from_hfov(160, 120, 90)
    renderers = [make_renderer("raycast", scene, camera) for scene in (house, other)]
    colour, ids = [], []
    for room in house.rooms:
        for turn in (0.3, 2.4):
            cos, sin = np.cos(turn), np.sin(turn)
            T_world_camera = np.eye(4)
            T_world_camera[:3, :3] = [[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]
            T_world_camera[:3, 3] = (room.aabb_min + room.aabb_max) / 2
            ours, theirs = (renderer.render(T_world_camera) for renderer in renderers)
            np.testing.assert_allclose(ours.depth, theirs.depth, atol=1e-3)
            colour.append(np.abs(ours.rgb.astype(int) - theirs.rgb).mean())
            # The one object that HM3D does not list has an id in Matterport's table, its last.
            expected = np.where(theirs.instance == 119, 0, theirs.instance)
            ids.append((ours.instance != expected).mean())
    for renderer in renderers:
        renderer.close()
    print(f"{len(ids)} views: mean RGB difference {np.mean(colour):.4f} of 255, id mismatch {np.mean(ids):.6f}")
    assert max(colour) < 0.5
    assert max(ids) < 1e-3


def test_all_bad_lines_of_the_table_are_in_one_message(shared_scenes, tmp_path):
    folder = tmp_path / f"00001-{SCAN}"
    shutil.copytree(shared_scenes / "hm3d" / folder.name, folder)
    folder.chmod(0o755)
    (folder / f"{SCAN}.semantic.txt").unlink()
    broken = shared_scenes / "broken" / "07_semantic_txt_bad_lines" / folder.name / f"{SCAN}.semantic.txt"
    shutil.copyfile(broken, folder / broken.name)
    with pytest.raises(DataError) as error:
        read_hm3d(folder)
    for part in (
        broken.name,
        "3 lines",
        "line 6",
        "ZZ12",
        "line 10",
        "id 8",
        "id 9",
        "CB4102",
        "line 13",
        "id 12",
        "no region",
    ):
        assert part in str(error.value)
    # The table alone says so as well, before the meshes that are not there.
    for function in (read_hm3d, files_hm3d):
        lonely = tmp_path / function.__name__ / "a" / "b" / folder.name
        lonely.mkdir(parents=True)
        shutil.copyfile(broken, lonely / broken.name)
        with pytest.raises(DataError, match="3 lines"):
            function(lonely)


@pytest.mark.parametrize("paint", ["texture", "vertices"])
def test_ids_come_from_the_texture_or_the_vertices(tmp_path, paint):
    folder = write_tiny(tmp_path / HOME, paint)
    expect_tiny(folder)
    assert {file.name for file in files_hm3d(folder)} == {"tiny.glb", "tiny.semantic.glb", "tiny.semantic.txt"}
    for name in ("tiny.glb", "tiny.semantic.txt"):
        expect_tiny(folder / name)


def test_semantics_lie_in_another_archives_tree(tmp_path):
    annotations = tmp_path / "hm3d-minival-semantic-annots-v0.2" / HOME
    expect_tiny(write_tiny(tmp_path / "hm3d-minival-glb-v0.2" / HOME, semantic_folder=annotations))
    split = tmp_path / "nested" / "hm3d" / "val" / HOME
    expect_tiny(write_tiny(split, semantic_folder=tmp_path / "nested" / "hm3d-val-semantic-annots-v0.1" / HOME))
    expect_tiny(annotations)


def test_a_mesh_of_other_triangles_takes_the_ids_over(tmp_path):
    folder = write_tiny(tmp_path / HOME)
    vertices, faces, uv, texture = squares()
    # Every square cut along its other diagonal, in another order.
    other = faces.reshape(-1, 2, 3)[::-1, :, :] * 0 + 4 * np.arange(3)[::-1, None, None] + [[[1, 2, 3], [1, 3, 0]]]
    write_glb(folder / "tiny.glb", vertices, other.reshape(-1, 3), uv, texture, translation=(0, 0, 1))
    assert read_hm3d(folder).face_instance.tolist() == [3, 3, 2, 2, 1, 1]


def test_without_semantics_it_is_a_mesh(tmp_path):
    scene = read_hm3d(write_tiny(tmp_path / HOME, "none"))
    assert (scene.instances, scene.rooms) == ([], [])
    assert not scene.face_instance.any()
    assert scene.name == "tiny"


def test_compressed_textures_name_the_release_without(tmp_path):
    folder = write_tiny(tmp_path / HOME)
    (folder / "tiny.glb").rename(folder / "tiny.basis.glb")
    for path in (folder, folder / "tiny.basis.glb"):
        with pytest.raises(DataError, match="uncompressed release"):
            read_hm3d(path)


@pytest.mark.parametrize("missing", ["tiny.semantic.glb", "tiny.semantic.txt", "tiny.glb"])
def test_a_missing_file_is_named(tmp_path, missing):
    folder = write_tiny(tmp_path / "one" / "two" / HOME)
    (folder / missing).unlink()
    for function in (read_hm3d, files_hm3d):
        with pytest.raises(DataError, match=missing):
            function(folder)


def test_files_of_two_scenes_are_told_apart(tmp_path):
    folder = write_tiny(tmp_path / HOME)
    shutil.copyfile(folder / "tiny.glb", folder / "other.glb")
    assert read_hm3d(folder).name == "tiny"
    renamed = folder.rename(tmp_path / "mine")
    with pytest.raises(DataError, match="2 scenes"):
        read_hm3d(renamed)
    others = TABLE.replace("0A1403", "0A0AAA").replace("C86432", "BB0000").replace("FFFF01", "0000CC")
    (renamed / "tiny.semantic.txt").write_text(others)
    with pytest.raises(DataError, match="no face in one of the 3 colours"):
        read_hm3d(renamed / "tiny.glb")
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "empty", tmp_path / "nothing", renamed / "tiny.semantic.csv"):
        with pytest.raises(DataError):
            read_hm3d(path)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("4,12345,\"a\",0", "six hexadecimal"),
        ("4,GGGGGG,\"a\",0", "six hexadecimal"),
        ("4,000000,\"a\",0", "black"),
        ("4,ABCDEF,\"a, 3\"", "no region"),
        ("4,ABCDEF,\"a\",x", "no region"),
        ("4", "four fields"),
        ("0,ABCDEF,\"a\",0", "from 1 to"),
        ("-4,ABCDEF,\"a\",0", "from 1 to"),
        ("99999999999,ABCDEF,\"a\",0", "from 1 to"),
        ("3,ABCDEF,\"a\",0", "line 4 already"),
        ("4,ffff01,\"a\",0", "colour of id 3"),
    ],
)  # fmt: skip
def test_a_bad_line_is_named_with_its_number(tmp_path, line, reason):
    path = tmp_path / "tiny.semantic.txt"
    path.write_text(f"{TABLE}{line}\n")
    with pytest.raises(DataError, match="line 5") as error:
        read_table(path)
    assert reason in str(error.value)


def test_names_hold_commas_and_quotes_and_regions_may_be_none(tmp_path):
    path = tmp_path / "tiny.semantic.txt"
    path.write_bytes(
        b'\xef\xbb\xbfHM3D Semantic Annotations\r\n7,aabbcc,"shelf, "left", 2nd",12\r\n\r\n2,AABBCD,lamp,-1\r\n'
    )
    rows = read_table(path)
    assert [(i, row.category, row.region) for i, row in rows.items()] == [
        (2, "lamp", None),
        (7, 'shelf, "left", 2nd', 12),
    ]
    for text in ("", '1,AABBCC,"a",0\n', "HM3D\n"):
        path.write_text(text)
        with pytest.raises(DataError, match="HM3D Semantic Annotations"):
            read_table(path)


def painted(texture: np.ndarray, uv: list[list[float]]) -> TexturedMesh:
    """One triangle with a texture."""
    return TexturedMesh(
        np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32),
        [Material("m", np.ones(3, np.float32), texture)], np.array(uv, np.float32), None,
    )  # fmt: skip


@pytest.mark.parametrize(("share", "expected"), [(0.9, 1), (0.1, 2)])
def test_a_face_goes_to_whom_most_of_it_belongs(share, expected):
    texture = np.zeros((100, 100, 3), np.uint8)
    texture[: round(100 * share)] = (200, 10, 10)
    texture[round(100 * share) :] = (10, 200, 10)
    mesh = painted(texture, [[0.5, 0], [0, 1], [1, 1]])
    # The corner at the top is the triangle's narrow end: 0.9 of the height hold 0.81 of the area.
    assert face_ids(mesh, {1: (200, 10, 10), 2: (10, 200, 10)}).tolist() == [expected]


def test_rounded_colours_count_and_others_do_not():
    colours = {1: (100, 100, 100), 2: (102, 100, 100), 3: (255, 0, 1)}
    for rgb, expected in (
        ((100, 100, 100), 1), ((99, 101, 100), 1), ((103, 101, 99), 2), ((254, 1, 0), 3), ((101, 100, 100), 1),
        ((100, 98, 100), 0), ((0, 0, 0), 0), ((253, 0, 1), 0),
    ):  # fmt: skip
        texture = np.full((2, 2, 3), rgb, np.uint8)
        assert face_ids(painted(texture, [[-3.2, 0.1], [0.9, 5.1], [0.2, 0.9]]), colours).tolist() == [expected], rgb


def test_the_fast_count_is_the_plain_one():
    @given(hnp.arrays(np.int32, st.tuples(st.integers(0, 12), st.integers(1, 17)), elements=st.integers(0, 4)))
    def check(samples):
        for row, winner in zip(samples.tolist(), majority(samples).tolist(), strict=True):
            votes = Counter(row)
            if 2 * votes[0] <= len(row):
                del votes[0]
            assert winner == min(votes, key=lambda i: (-votes[i], i))

    check()


def test_rooms_are_named_where_their_contents_tell_it_and_lie_on_storeys():
    def thing(number: int, category: str, room: int | None, height: float = 0.0, size: float = 4.0):
        return make_instance(number, category, [0, height, 0], [size, height, size], room)

    rooms = make_rooms(
        [
            thing(1, "floor", 3), thing(2, "bed", 3, 0.5, 2), thing(3, "couch", 3, 0.5, 1),
            thing(4, "floor", 5, 3.0), thing(5, "gas stove", 5, 3.5, 1), thing(6, "couch", 5, 3.5, 1),
            thing(7, "floor", 6, 2.8), thing(8, "dining table", 6, 3.5, 1), thing(9, "ceiling", 6, 5.3),
            thing(10, "lamp", None), thing(11, "floor", 9, 0.4), thing(12, "rug", 9, 0.4, 40.0),
        ]
    )  # fmt: skip
    assert [(room.id, room.name, room.level) for room in rooms] == [
        (3, "bedroom", 0), (5, "region 5", 1), (6, "dining room", 1), (9, "region 9", 0)
    ]  # fmt: skip
    np.testing.assert_allclose([rooms[2].aabb_min, rooms[2].aabb_max], [[0, 2.8, 0], [4, 5.3, 4]])


@pytest.mark.parametrize("paint", ["texture", "vertices"])
def test_fuzz_raises_nothing_but_its_own_error(tmp_path, paint):
    healthy = write_tiny(tmp_path / "healthy" / HOME, paint)
    scratch = tmp_path / "scratch" / "deep"
    scratch.mkdir(parents=True)
    names = ["tiny.glb", "tiny.semantic.glb", "tiny.semantic.txt"]
    refused = hold_to_data_error(read_hm3d, healthy, names, scratch, cases=1000, seed=len(paint))
    assert refused > 100
