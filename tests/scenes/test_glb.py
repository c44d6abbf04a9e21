"""Plain meshes: looks, transforms and names survive a file; what is broken, compressed or hostile ends in one clear error."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from tiny_scans import MTL, boxes_glb, boxes_mesh, boxes_ply, glb, gltf_document, obj_text, png

from openmap_scenes import DataError
from openmap_scenes.formats.glb import files_file, read_file
from openmap_scenes.formats.mesh import linear_from_srgb, srgb_from_linear

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def textured_quad() -> trimesh.Trimesh:
    texture = np.zeros((4, 4, 3), np.uint8)
    texture[:2] = (255, 0, 0)
    texture[2:] = (0, 0, 255)
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    material = trimesh.visual.material.PBRMaterial(name="paint", baseColorTexture=Image.fromarray(texture))
    # trimesh counts v from the bottom: the upper edge (y = 1) shows the texture's first row.
    mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]], material=material)
    return mesh


def read_document(tmp_path: Path, document: dict, binary: bytes):
    path = tmp_path / "thing.glb"
    path.write_bytes(glb(document, binary))
    return read_file(path)


# --- what is right ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj"])
def test_textures_stand_the_right_way_up(tmp_path, suffix):
    path = tmp_path / f"quad.{suffix}"
    if suffix == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(textured_quad())).items():
            (tmp_path / ("quad.gltf" if name.endswith(".gltf") else name)).write_bytes(data)
    else:
        textured_quad().export(path)
    scene = read_file(path)
    top = scene.vertices[:, 1] > 0.5
    assert np.allclose(scene.uv[top, 1], 0.0)
    assert scene.materials[0].texture[0, 0].tolist() == [255, 0, 0]
    assert scene.materials[0].texture[3, 0].tolist() == [0, 0, 255]
    assert path in files_file(path)
    assert set(files_file(path)) == {f for f in tmp_path.iterdir() if f.suffix != ".json"}


@given(st.integers(0, 2**32 - 1))
def test_a_scene_written_by_another_library_is_read_as_that_library_reads_it(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    graph = trimesh.Scene()
    for number in range(int(rng.integers(1, 4))):
        mesh = trimesh.creation.box(rng.uniform(0.1, 2, 3))
        T = trimesh.transformations.random_rotation_matrix(rng.random(3))
        T[:3, 3] = rng.uniform(-5, 5, 3)
        T[:3, :3] *= rng.uniform(0.5, 2)
        graph.add_geometry(mesh, node_name=f"n{number}", transform=T)
    path = tmp_path_factory.mktemp("twin") / "scene.glb"
    graph.export(path)
    scene, twin = read_file(path), trimesh.load(path).to_geometry()
    ours = np.sort(scene.vertices[scene.faces].reshape(-1, 9).round(3), axis=0)
    theirs = np.sort(twin.vertices[twin.faces].reshape(-1, 9).round(3), axis=0)
    np.testing.assert_allclose(ours, theirs, atol=2e-3)


def test_nodes_nest_and_a_mirrored_one_keeps_its_faces_outward(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE, "indices": np.arange(3, dtype=np.uint32)})
    document["nodes"] = [
        {"translation": [0, 0, 5], "children": [1, 2]},
        {"scale": [2, 2, 2], "mesh": 0},
        {"matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1], "mesh": 0},
    ]
    scene = read_document(tmp_path, document, binary)
    np.testing.assert_allclose(scene.vertices[:3], TRIANGLE * 2 + [0, 0, 5])
    np.testing.assert_allclose(scene.vertices[3:], TRIANGLE * [-1, 1, 1] + [3, 0, 5])
    corners = scene.vertices[scene.faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("dtype", ["float32", "uint8", "uint16"])
@pytest.mark.parametrize("width", [3, 4])
def test_vertex_colours_of_any_type_are_linear_in_the_file(tmp_path, dtype, width):
    srgb = np.array([[0, 13, 255], [128, 200, 77], [1, 2, 3]], np.uint8)
    linear = np.ones((3, width))
    linear[:, :3] = linear_from_srgb(srgb / 255.0)
    values = linear.astype(np.float32) if dtype == "float32" else np.rint(linear * np.iinfo(dtype).max).astype(dtype)
    if values.itemsize * width % 4:  # rows of a vertex attribute begin at multiples of four bytes
        values = np.concatenate([values, np.zeros((3, 4 - width), dtype)], axis=1)
    arrays = {"POSITION": TRIANGLE, "COLOR_0": values, "indices": np.arange(3, dtype=np.uint8)}
    scene = read_document(tmp_path, *gltf_document(arrays))
    if dtype == "uint8":
        expected = np.rint(srgb_from_linear(values[:, :3] / 255.0) * 255)
        np.testing.assert_array_equal(scene.vertex_colour, expected)
    else:
        np.testing.assert_array_equal(scene.vertex_colour, srgb)


def test_base_colours_are_linear_and_textures_are_shared(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2].copy()}, png())
    shared = {"baseColorTexture": {"index": 0}, "baseColorFactor": [0.5, 1.0, 0.0, 1.0]}
    document["materials"].append({"name": "tinted", "pbrMetallicRoughness": shared})
    document["meshes"][0]["primitives"].append({**document["meshes"][0]["primitives"][0], "material": 1})
    document["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}})
    scene = read_document(tmp_path, document, binary)
    assert [m.name for m in scene.materials] == ["paint", "tinted", "default"]
    np.testing.assert_allclose(scene.materials[1].colour, [0.7354, 1, 0], atol=1e-3)
    assert scene.materials[0].texture is scene.materials[1].texture
    assert scene.materials[0].texture[0, 0].tolist() == [200, 100, 50]
    assert scene.face_material.tolist() == [0, 1, 2]
    # The two textured primitives have the same vertices, which are kept once.
    assert len(scene.vertices) == 6


def test_strips_fans_transforms_and_unlisted_indices(tmp_path):
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    uv = np.array([[0, 0], [65535, 0], [0, 65535], [65535, 65535]], np.uint16)
    document, binary = gltf_document({"POSITION": square, "TEXCOORD_0": uv}, png())
    primitive = document["meshes"][0]["primitives"][0]
    transform = {"offset": [0.25, 0.5], "scale": [2, 3], "rotation": np.pi / 2}
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {
        "KHR_texture_transform": transform
    }
    document["meshes"][0]["primitives"] = [{**primitive, "mode": mode} for mode in (5, 6, 1)]
    document["extensionsUsed"] = ["KHR_texture_transform", "ACME_nobody_knows"]
    scene = read_document(tmp_path, document, binary)
    assert scene.faces.tolist() == [[0, 1, 2], [2, 1, 3], [0, 1, 2], [0, 2, 3]]
    # Khronos' formula: shift * turn * scale, the turn being [[cos, sin], [-sin, cos]].
    np.testing.assert_allclose(scene.uv[3], [0.25 + 3.0, 0.5 - 2.0], atol=1e-4)


def test_obj_keeps_the_order_of_faces_and_counts_back_from_negative_indices(tmp_path):
    path = tmp_path / "mixed.obj"
    path.write_text(
        "# a comment\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvt 0 0\nvn 0 0 1\n"
        "o first\nf 1 2 3 4\nv 5 0 0 1 1 1\nv 6 0 0 1 1 1\nv 5 1 0 1 1 1\no second\nf -3/1/1 -2/-1/1 \\\n -1//1\nf 1//1 2//1 3//1\n"
    )
    scene = read_file(path)
    corners = scene.vertices[scene.faces]
    np.testing.assert_array_equal(corners[1], [[0, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(corners[2], [[5, 0, 0], [6, 0, 0], [5, 1, 0]])
    np.testing.assert_array_equal(corners[3], [[0, 0, 0], [1, 0, 0], [1, 1, 0]])
    assert scene.vertex_colour[scene.faces[0, 1]].tolist() == [0, 255, 0]


def test_obj_materials_and_the_textures_that_are_missed(tmp_path):
    (tmp_path / "boxes.obj").write_text(obj_text(z_up=False))
    (tmp_path / "tiny.mtl").write_text(MTL + "map_Kd -s 1 1 1 -o 0 0 C:\\work\\no such wood.jpg\n")
    (tmp_path / "tiny_0.png").write_bytes(png())
    scene = read_file(tmp_path / "boxes.obj")
    assert [(m.name, m.missing_texture) for m in scene.materials] == [
        ("red", ""),
        ("green", "C:\\work\\no such wood.jpg"),
    ]
    np.testing.assert_allclose(scene.materials[1].colour, [0.25, 0.5, 0.75])
    assert scene.materials[0].texture[0, 0].tolist() == [200, 100, 50]
    assert scene.face_material.tolist() == [0] * 12 + [1] * 12
    assert {f.name for f in files_file(tmp_path / "boxes.obj")} == {"boxes.obj", "tiny.mtl", "tiny_0.png"}
    # Once the picture lies beside the mesh it is found by its name.
    (tmp_path / "no such wood.jpg").write_bytes(png((0, 0, 200)))
    assert read_file(tmp_path / "boxes.obj").materials[1].texture[0, 0].tolist() == [0, 0, 200]
    (tmp_path / "tiny.mtl").unlink()
    assert {m.missing_texture for m in read_file(tmp_path / "boxes.obj").materials} == {"tiny.mtl"}


def test_a_name_that_no_file_can_hold_is_read_all_the_same(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE}, png())
    document["materials"][0]["name"] = "half \ud800"
    assert read_document(tmp_path, document, binary).materials[0].name == "half ?"


def test_a_gltf_whose_picture_is_not_there_says_so_in_its_material(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE}, png())
    document["images"] = [{"uri": "gone%20away.png"}]
    scene = read_document(tmp_path, document, binary)
    assert scene.materials[0].missing_texture == "gone away.png"


def test_ply_and_stl(tmp_path):
    vertices, faces, _ = boxes_mesh(z_up=False)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.export(tmp_path / "boxes.stl")
    (tmp_path / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(mesh))
    (tmp_path / "boxes.ply").write_bytes(boxes_ply({}))
    for name in ("boxes.stl", "text.stl", "boxes.ply"):
        scene = read_file(tmp_path / name)
        assert len(scene.faces) == 24
        assert len(scene.vertices) == 16
        assert files_file(tmp_path / name) == [tmp_path / name]


def test_linear_light_and_back():
    values = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb_from_linear(linear_from_srgb(values)), values, atol=1e-6)


# --- the table of instances ------------------------------------------------------------------------------------------


def table(**more) -> dict:
    return {
        "format": "openmap-instances",
        "version": 1,
        "rooms": [{"id": 2, "name": "study", "aabb_min": [-3, 0, -3], "aabb_max": [3, 3, 3]}],
        "instances": [{"id": 4, "category": "Red Sofa", "room": 2}, {"id": 9, "category": "lamp", "mpcat40": None}],
        "faces": [[0, 12, 4], [12, 12, 9]],
        **more,
    }


def boxes_obj(tmp_path: Path) -> Path:
    (tmp_path / "boxes.obj").write_text(obj_text(z_up=False))
    (tmp_path / "tiny.mtl").write_text(MTL)
    (tmp_path / "tiny_0.png").write_bytes(png())
    return tmp_path / "boxes.obj"


@pytest.mark.parametrize("name", ["boxes.instances.json", "instances.json"])
@pytest.mark.parametrize("by", ["faces", "nodes", "materials"])
def test_a_table_beside_a_mesh_names_its_faces_by_run_node_or_material(tmp_path, name, by):
    path = boxes_obj(tmp_path)
    document = table()
    if by != "faces":
        del document["faces"]
        for entry, value in zip(document["instances"], ("red", "green"), strict=True):
            entry[by] = [f"{value}_box"] if by == "nodes" else [value]
    (tmp_path / name).write_text(json.dumps(document))
    scene = read_file(path)
    assert [(i.id, i.category, i.room) for i in scene.instances] == [(4, "red sofa", 2), (9, "lamp", None)]
    assert scene.instances[1].mpcat40 is None
    assert scene.face_instance.tolist() == [4] * 12 + [9] * 12
    np.testing.assert_allclose(scene.instances[1].aabb_max, [1.4, 4.5, -1.5], atol=1e-6)
    assert scene.rooms[0].name == "study"
    assert tmp_path / name in files_file(path)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"version": 2}, "version 2"),
        ({"format": None}, "openmap-instances"),
        ({"faces": [[0, 25, 4]]}, r"faces\[0\].*24"),
        ({"faces": [[0, 10**9, 4]]}, r"faces\[0\]"),
        ({"faces": [[0, 4, 5]]}, r"faces\[0\].*id of an instance"),
        ({"faces": [[0, 4, 4], [3, 4, 9]]}, r"faces\[1\].*overlap"),
        ({"faces": [[0, 12]]}, r"faces\[0\]"),
        ({"faces": [[0, 24, 4]]}, "instance 9 without faces"),
        ({"instances": [{"id": 4, "category": "a"}, {"id": 4, "category": "b"}]}, "id 4 more than once"),
        ({"instances": [{"id": 0, "category": "a"}]}, r"instances\[0\]\.id"),
        ({"instances": [{"id": 4}], "faces": [[0, 12, 4]]}, r"instances\[0\]\.category"),
        ({"instances": [{"id": 4, "category": "a", "room": 7}], "faces": [[0, 12, 4]]}, r"instances\[0\]\.room"),
        (
            {"instances": [{"id": 4, "category": "a", "nodes": ["x"]}], "faces": [[0, 1, 4]]},
            "nodes that the mesh does not",
        ),
        ({"instances": [{"id": 4, "category": "a", "attributes": {"b": 1}}], "faces": [[0, 1, 4]]}, r"attributes\.b"),
        ({"rooms": [{"id": 2, "name": "x", "aabb_min": [1, 0, 0], "aabb_max": [0, 0, 0]}]}, "aabb_min <= aabb_max"),
        ({"rooms": [{"id": 2, "name": "x", "aabb_min": [1e400, 0, 0], "aabb_max": [0, 0, 0]}]}, "JSON"),
    ],
)
def test_a_wrong_table_says_where(tmp_path, changes, says):
    path = boxes_obj(tmp_path)
    (tmp_path / "instances.json").write_text(json.dumps(table(**changes)))
    with pytest.raises(DataError, match=rf"instances\.json.*{says}"):
        read_file(path)


# --- what is wrong ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("content", [b"", b"glTF", b"not a mesh at all, but long enough", b"glTF" + bytes(40)])
@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_garbage_is_named(tmp_path, content, suffix):
    path = tmp_path / f"garbage.{suffix}"
    path.write_bytes(content)
    with pytest.raises(DataError, match=rf"garbage\.{suffix}"):
        read_file(path)


def test_every_truncation_ends_in_the_same_error_type(tmp_path):
    data = boxes_glb()
    path = tmp_path / "cut.glb"
    for length in range(0, len(data), 7):
        path.write_bytes(data[:length])
        with pytest.raises(DataError, match=r"cut\.glb"):
            read_file(path)


def set_at(document: dict, place: str, value: object) -> None:
    """Set ``accessors.0.count`` and the like."""
    *path, last = [int(p) if p.isdigit() else p for p in place.split(".")]
    at = document
    for step in path:
        at = at[step] if isinstance(step, int) else at.setdefault(step, {})
    at[last] = value


HUGE = 2**31 - 1
MESH = "meshes.0.primitives.0"


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        ("accessors.0.count", HUGE, r"accessors\[0\]"),
        ("accessors.0.count", 10**18, r"accessors\[0\]\.count"),
        ("accessors.0.count", 0, r"accessors\[0\]\.count"),
        ("accessors.0.count", 2, "texture coordinates"),
        ("accessors.0.byteOffset", 4, r"accessors\[0\]"),
        ("accessors.0.byteOffset", -4, r"accessors\[0\]\.byteOffset"),
        ("accessors.0.type", "VEC9", r"accessors\[0\]\.type"),
        ("accessors.0.componentType", 5124, r"accessors\[0\]\.componentType"),
        ("accessors.0.bufferView", 99, r"accessors\[0\]\.bufferView"),
        ("accessors.0.sparse", {"count": HUGE}, "sparse"),
        ("accessors.2.type", "VEC3", r"accessors\[2\]\.type"),
        ("accessors.2.count", 2, "2 corners"),
        ("bufferViews.0.byteLength", HUGE, r"bufferViews\[0\]"),
        ("bufferViews.0.byteOffset", HUGE, r"bufferViews\[0\]"),
        ("bufferViews.0.byteStride", 5000, r"bufferViews\[0\]\.byteStride"),
        ("bufferViews.0.buffer", 1, r"bufferViews\[0\]\.buffer"),
        ("bufferViews.3.byteLength", HUGE, r"bufferViews\[3\]"),
        ("bufferViews.3.byteLength", 40, r"image 0 'wood'.*cannot be decoded"),
        ("buffers.0.byteLength", HUGE, r"buffers\[0\]"),
        ("buffers.0.uri", "gone.bin", "found no such file"),
        ("buffers.0.uri", "../secret.bin", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "a/../../secret.bin", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "..%2Fsecret.bin", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "/etc/passwd", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "file:///etc/passwd", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "https://example.org/a.bin", r"buffers\[0\]\.uri.*inside"),
        ("buffers.0.uri", "data:text/plain,hello", "base64"),
        ("images.0", {"uri": "../secret.png"}, r"images\[0\]\.uri.*inside"),
        ("images.0", {"uri": "http://example.org/a.png"}, r"images\[0\]\.uri.*inside"),
        ("images.0.bufferView", 0, "image 0 'wood'"),
        ("images.0.mimeType", "image/ktx2", "KTX2.*uncompressed release"),
        ("textures.0.source", 3, r"textures\[0\]\.source"),
        ("textures.0", {"extensions": {"KHR_texture_basisu": {"source": 0}}}, "KTX2.*uncompressed release"),
        ("extensionsRequired", ["KHR_texture_basisu"], "KTX2.*uncompressed release"),
        ("extensionsRequired", ["KHR_draco_mesh_compression"], "Draco"),
        ("extensionsRequired", ["EXT_meshopt_compression"], "meshopt"),
        ("extensionsRequired", ["ACME_no_one_knows"], "ACME_no_one_knows"),
        ("extensionsRequired", "KHR", "extensionsRequired"),
        ("materials.0.pbrMetallicRoughness.baseColorTexture.index", 4, r"baseColorTexture\.index"),
        ("materials.0.pbrMetallicRoughness.baseColorFactor", [1, 1], "baseColorFactor"),
        (f"{MESH}.material", 7, "material"),
        (f"{MESH}.mode", 9, "mode"),
        (f"{MESH}.mode", 0, "no triangles"),
        (f"{MESH}.indices", 0, r"accessors\[0\]\.type"),
        (f"{MESH}.indices", True, "indices"),
        (f"{MESH}.attributes", {}, "POSITION"),
        (f"{MESH}.attributes.COLOR_0", 1, r"accessors\[1\]\.type"),
        ("nodes.0.children", [0], "reached twice"),
        ("nodes.0.children", [5], r"nodes\[0\]\.children\[0\]"),
        ("nodes.0.mesh", 5, r"nodes\[0\]\.mesh"),
        ("nodes.0.matrix", [1] * 15, "16 numbers"),
        ("nodes.0.scale", [1e300, 1, 1], "out of all bounds"),
        ("nodes.0.rotation", [0, 0, 0, 0], "unit quaternion"),
        ("scenes.0.nodes", [0, 0], "reached twice"),
        ("scene", 4, "scene"),
        ("scenes.0.nodes", [], "no triangles"),
        ("asset.version", "1.0", "version"),
        ("nodes", {"0": {}}, "a list"),
        ("meshes.0", "mesh", "an object"),
    ],
)  # fmt: skip
def test_a_document_that_contradicts_its_bytes_says_where(tmp_path, place, value, says):
    arrays = {
        "POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2].copy(), "indices": np.arange(3, dtype=np.uint16),
    }  # fmt: skip
    document, binary = gltf_document(arrays, png())
    (tmp_path.parent / "secret.bin").write_bytes(binary)
    (tmp_path.parent / "secret.png").write_bytes(png())
    set_at(document, place, value)
    with pytest.raises(DataError, match=rf"(thing\.glb|gone\.bin).*{says}"):
        read_document(tmp_path, document, binary)


@pytest.mark.parametrize(
    ("array", "value", "says"),
    [
        ("POSITION", np.nan, "out of all bounds"),
        ("POSITION", 1e30, "out of all bounds"),
        ("TEXCOORD_0", np.inf, "texture coordinates"),
        ("COLOR_0", np.nan, "colours that are not finite"),
        ("indices", 3, "a vertex index of 3"),
    ],
)
def test_numbers_that_cannot_be_used_are_named(tmp_path, array, value, says):
    arrays = {
        "POSITION": TRIANGLE.copy(),
        "TEXCOORD_0": TRIANGLE[:, :2].copy(),
        "COLOR_0": TRIANGLE.copy(),
        "indices": np.arange(3, dtype=np.uint32),
    }
    arrays[array].flat[1] = value
    with pytest.raises(DataError, match=rf"thing\.glb.*{says}"):
        read_document(tmp_path, *gltf_document(arrays))


def test_compressed_geometry_without_fallback_says_what_it_is(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE})
    del document["accessors"][0]["bufferView"]
    document["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    with pytest.raises(DataError, match=r"Draco compressed geometry.*without compression"):
        read_document(tmp_path, document, binary)


def test_one_mesh_in_very_many_nodes_does_not_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("openmap_scenes.formats.gltf_mesh.MOST_FACES", 50)
    document, binary = gltf_document({"POSITION": TRIANGLE})
    document["nodes"] = [{"mesh": 0} for _ in range(60)]
    document["scenes"] = [{"nodes": list(range(60))}]
    with pytest.raises(DataError, match="found too many"):
        read_document(tmp_path, document, binary)


def test_deep_trees_and_deep_json_end(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE})
    document["nodes"] = [{"children": [n + 1]} for n in range(5000)] + [{"mesh": 0}]
    assert len(read_document(tmp_path, document, binary).faces) == 1
    (tmp_path / "deep.gltf").write_text("[" * 10**6)
    with pytest.raises(DataError, match=r"deep\.gltf.*JSON"):
        read_file(tmp_path / "deep.gltf")


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_a_picture_that_is_cut_short_or_announces_too_much(tmp_path, kind):
    stream = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (40, 40, 3), np.uint8)).save(stream, kind)
    cut = stream.getvalue()[: len(stream.getvalue()) // 2]
    with pytest.raises(DataError, match=r"thing\.glb, image 0 'wood'"):
        read_document(tmp_path, *gltf_document({"POSITION": TRIANGLE}, cut))
    huge = png().replace((4).to_bytes(4, "big") * 2, (60000).to_bytes(4, "big") * 2)
    with pytest.raises(DataError, match="image 0 'wood'"):
        read_document(tmp_path, *gltf_document({"POSITION": TRIANGLE}, huge))


def test_buffers_and_pictures_as_data_within_the_document(tmp_path):
    document, binary = gltf_document({"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2].copy()}, png())
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    document["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(png((1, 2, 3))).decode()}]
    (tmp_path / "all.gltf").write_text(json.dumps(document))
    scene = read_file(tmp_path / "all.gltf")
    assert scene.materials[0].texture[0, 0].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(scene.vertices, TRIANGLE)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "v index 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "v index 0"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", "v index -4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/2\n", "vt index 2"),
        ("v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n", "different lengths"),
        ("v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n", "could not convert"),
        ("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "out of all bounds"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "three corners"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 x 3\n", "face corner b'x'"),
        ("v 0 0 0\n", "no triangles"),
    ],
)
def test_an_obj_that_does_not_parse_says_why(tmp_path, text, says):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(DataError, match=rf"bad\.obj.*{says}"):
        read_file(tmp_path / "bad.obj")


def test_what_is_no_mesh_or_not_there(tmp_path):
    (tmp_path / "a.txt").write_text("x")
    for function in (read_file, files_file):
        with pytest.raises(DataError, match="suffix"):
            function(tmp_path / "a.txt")
        with pytest.raises(DataError, match="no such file"):
            function(tmp_path / "b.glb")


def write_fuzzed(folder: Path, suffix: str) -> Path:
    folder.mkdir(parents=True)
    if suffix == "glb":
        (folder / "boxes.glb").write_bytes(boxes_glb(z_up=False))
    elif suffix == "gltf":
        document, binary = gltf_document({"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE[:, :2].copy()}, png())
        document["buffers"][0]["uri"], document["images"] = "boxes.bin", [{"uri": "boxes.png"}]
        (folder / "boxes.gltf").write_text(json.dumps(document))
        (folder / "boxes.bin").write_bytes(binary)
        (folder / "boxes.png").write_bytes(png())
    elif suffix == "obj":
        boxes_obj(folder)
        (folder / "instances.json").write_text(json.dumps(table()))
    elif suffix == "ply":
        (folder / "boxes.ply").write_bytes(boxes_ply({}))
    else:
        vertices, faces, _ = boxes_mesh()
        trimesh.Trimesh(vertices, faces, process=False).export(folder / "boxes.stl")
    return folder


@pytest.mark.parametrize(
    ("suffix", "cases"), [("glb", 2000), ("gltf", 1000), ("obj", 2000), ("ply", 500), ("stl", 500)]
)
def test_fuzz(tmp_path, suffix, cases):
    healthy = write_fuzzed(tmp_path / "healthy" / "boxes", suffix)
    files = sorted(f.name for f in healthy.iterdir())
    refused = hold_to_data_error(lambda folder: read_file(folder / f"boxes.{suffix}"), healthy, files, tmp_path, cases)
    assert refused > 50
