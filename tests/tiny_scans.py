"""Scans of two boxes in the layouts that datasets have, written here byte by byte, so that readers meet files of others."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

# World frame: a sofa in room 0 and a lamp on the floor above, in room 1.
BOXES = [((-2.0, 0.0, 1.0), (-0.5, 0.8, 2.0)), ((1.0, 3.0, -2.0), (1.4, 4.5, -1.5))]
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
SIDES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip
T_FILE_WORLD = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], np.float64)  # a Z-up file: (x, -z, y)


def boxes_mesh(z_up: bool = True) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Vertices (16, 3) in the file's frame, faces (24, 3), and which box (24,) each face is of, from 0."""
    vertices = np.concatenate([np.array(low) + CORNERS * (np.array(high) - low) for low, high in BOXES])
    if z_up:
        vertices = vertices @ T_FILE_WORLD.T
    faces = np.concatenate([SIDES, SIDES + 8]).astype(np.int32)
    return vertices.astype(np.float32), faces, np.repeat(np.arange(2, dtype=np.int32), 12)


def png(colour: tuple[int, int, int] = (200, 100, 50), size: int = 4) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (size, size), colour).save(stream, "PNG")
    return stream.getvalue()


def glb(document: dict[str, Any], binary: bytes) -> bytes:
    """The bytes of a GLB."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    return (
        struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A)
        + text
        + struct.pack("<II", len(binary), 0x004E4942)
        + binary
    )


def gltf_document(
    arrays: dict[str, npt.NDArray[Any]], image: bytes | None = None, **more: Any
) -> tuple[dict[str, Any], bytes]:
    """A document of one node with one primitive, and its binary chunk.

    ``arrays`` has POSITION and may have ``indices`` and further attributes; integer attributes are marked as normalised.
    """
    components = {"float32": 5126, "uint8": 5121, "uint16": 5123, "uint32": 5125, "int8": 5120, "int16": 5122}
    kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
    binary, views, accessors = b"", [], []
    for name, array in arrays.items():
        data = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
        entry = {
            "bufferView": len(views) - 1,
            "componentType": components[array.dtype.name],
            "count": len(array),
            "type": kinds[array.shape[1] if array.ndim > 1 else 1],
        }
        accessors.append(entry | ({"normalized": True} if name.startswith(("COLOR", "TEXCOORD")) else {}))
        binary += data + bytes(-len(data) % 4)
    names = list(arrays)
    primitive: dict[str, Any] = {"attributes": {n: names.index(n) for n in names if n != "indices"}}
    if "indices" in arrays:
        primitive["indices"] = names.index("indices")
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "thing", "mesh": 0}],
        "meshes": [{"name": "thing_mesh", "primitives": [primitive]}],
        "accessors": accessors,
        "bufferViews": views,
    }
    if image is not None:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(image)})
        binary += image + bytes(-len(image) % 4)
        primitive["material"] = 0
        document |= {
            "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}],
            "images": [{"bufferView": len(views) - 1, "mimeType": "image/png", "name": "wood"}],
        }
    document["buffers"] = [{"byteLength": len(binary)}]
    return document | more, binary


def boxes_glb(z_up: bool = True) -> bytes:
    vertices, faces, _ = boxes_mesh(z_up)
    uv = np.zeros((16, 2), np.float32)
    colours = np.full((16, 4), 65535, np.uint16)
    arrays = {"POSITION": vertices, "TEXCOORD_0": uv, "COLOR_0": colours, "indices": faces.ravel().astype(np.uint16)}
    return glb(*gltf_document(arrays, png()))


def boxes_ply(properties: dict[str, npt.NDArray[Any]]) -> bytes:
    """The boxes as a binary PLY, Z up, with face properties (24,)."""
    vertices, faces, _ = boxes_mesh()
    names = {"i": "int", "u": "ushort"}
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    header += [f"property {names[values.dtype.kind]} {name}" for name, values in properties.items()]
    rows = np.zeros(
        len(faces), [("n", "u1"), ("v", "<i4", 3)] + [(name, values.dtype.str) for name, values in properties.items()]
    )
    rows["n"], rows["v"] = 3, faces
    for name, values in properties.items():
        rows[name] = values
    return ("\n".join(header) + "\nend_header\n").encode() + vertices.astype("<f4").tobytes() + rows.tobytes()


def house_text(segments: bool = True) -> str:
    """The ``.house`` of the boxes: sofa (object 0) and a floor lamp (object 1), on two levels that the file lists from above."""
    lines = [
        "ASCII 1.1",
        "H tiny - 0 0 0 0 4 3 2 2 0 2 0 0 0 0 0 -3 -3 0 3 3 6 0 0 0 0 0",
        "L 0 1 - 0 0 3 -3 -3 3 3 3 6 0 0 0 0 0",
        "L 1 1 - 0 0 0 -3 -3 0 3 3 3 0 0 0 0 0",
        "R 0 1 0 0 l 0 0 0 -3 -3 0 3 3 3 3 0 0 0 0",
        "R 1 0 0 0 b 0 0 3 -3 -3 3 3 3 6 3 0 0 0 0",
        "C 0 10 sofa 10 sofa 0 0 0 0 0",
        "C 1 20 floor#lamp 28 lighting 0 0 0 0 0",
        "O 0 0 0 -1.2 -1.5 0.4 1 0 0 0 1 0 1 1 1 0 0 0 0 0 0 0 0",
        "O 1 1 1 1.2 1.7 3.7 1 0 0 0 1 0 1 1 1 0 0 0 0 0 0 0 0",
        "O 2 1 -1 1.2 1.7 3.7 1 0 0 0 1 0 1 1 1 0 0 0 0 0 0 0 0",
    ]
    if segments:
        # Two segments of the sofa, one of the lamp, one of nothing.
        for number, (segment, item) in enumerate([(0, 0), (1, 0), (1000000, 1), (1000001, -1)]):
            lines.append(f"E {number} {item} {segment} 1 0 0 0 0 0 0 1 1 1 0 0 0 0 0")
    return "\n".join(lines) + "\n"


def write_mp3d(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / "tiny.glb").write_bytes(boxes_glb())
    (folder / "tiny.house").write_text(house_text())
    (folder / "tiny_semantic.ply").write_bytes(boxes_ply({"object_id": boxes_mesh()[2]}))
    return folder


def obj_text(z_up: bool = True) -> str:
    """The boxes as an OBJ of two materials, with texture coordinates."""
    vertices, faces, owner = boxes_mesh(z_up)
    lines = ["mtllib tiny.mtl", *(f"v {x} {y} {z}" for x, y, z in vertices), "vt 0.25 0.75", "vt 0.5 0.5"]
    for box, name in enumerate(("red", "green")):
        lines += [f"o {name}_box", f"usemtl {name}"]
        lines += ["f " + " ".join(f"{i + 1}/{box + 1}" for i in face) for face in faces[owner == box]]
    return "\n".join(lines) + "\n"


MTL = "newmtl red\nKd 1 1 1\nmap_Kd tiny_0.png\n\nnewmtl green\nKd 0.25 0.5 0.75\n"


def write_raw_mp3d(folder: Path) -> Path:
    """The layout of the Matterport3D download; five of the lamp's faces are of its unlabelled segment."""
    mesh, names = folder / "matterport_mesh" / "0123abcd", folder / "house_segmentations"
    mesh.mkdir(parents=True)
    names.mkdir()
    (mesh / "0123abcd.obj").write_text(obj_text())
    (mesh / "tiny.mtl").write_text(MTL)
    (mesh / "tiny_0.png").write_bytes(png())
    segment = np.array([0] * 6 + [1] * 6 + [1000000] * 7 + [1000001] * 5, "<i4")
    item = np.array([0] * 12 + [1] * 7 + [-1] * 5, "<i4")
    (names / "tiny.house").write_text(house_text())
    (names / "tiny.ply").write_bytes(boxes_ply({"material_id": segment, "segment_id": item, "category_id": item}))
    (names / "tiny.fsegs.json").write_text(json.dumps({"sceneId": "tiny", "segIndices": segment.tolist()}))
    groups = [
        {"id": 0, "objectId": 0, "label": "sofa", "segments": [0, 1]},
        {"id": 1, "objectId": 1, "label": "floor lamp", "segments": [1000000]},
    ]
    (names / "tiny.semseg.json").write_text(json.dumps({"sceneId": "tiny", "segGroups": groups}))
    return folder


def write_gibson(folder: Path, raw: bool = False, semantics: bool = True) -> Path:
    """A Gibson home, Habitat's or the dataset's own, with 3DSceneGraph's semantics; the lamp's last face is of nothing."""
    folder.mkdir(parents=True)
    name = folder.name
    if raw:
        (folder / "mesh_z_up.obj").write_text(obj_text())
        (folder / "tiny.mtl").write_text(MTL)
        (folder / "tiny_0.png").write_bytes(png())
    else:
        (folder / f"{name}.glb").write_bytes(boxes_glb())
    if semantics:
        ids = np.array([3] * 12 + [7] * 11 + [0], "<u2")
        (folder / f"{name}_semantic.ply").write_bytes(boxes_ply({"object_id": ids}))
        objects = [
            {
                "id": 3,
                "class_": "couch",
                "parent_room": 1,
                "material": ["fabric", None],
                "location": None,
                "size": None,
            },
            {"id": 7, "class_": "potted plant", "parent_room": 2, "material": None, "visual_texture": "striped"},
        ]
        rooms = [
            {"id": 1, "scene_category": "living_room", "floor_number": "A", "location": [0, 0, 1.5], "size": [6, 6, 3]},
            {"id": 2, "scene_category": "bedroom", "floor_number": "B", "location": [0, 0, 4.5], "size": [6, 6, 3]},
        ]
        (folder / f"{name}.scn").write_text(json.dumps({"objects": objects, "rooms": rooms}))
    return folder
