"""A Scene -> a GLB that any viewer shows, with its table of instances and its credits beside it.

``read_file`` of the GLB gives the scene back: vertices, faces, ids, categories, rooms, attributes, credits and textures
exactly, colours to the byte (a scene with textures and without uv gets uv of zeros). Colours are written linear, as glTF
rules; materials carry KHR_materials_unlit, because a scene's light is in its textures and vertex colours, and a viewer that
does not know the extension shows them as rough surfaces.
"""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes.errors import DataError
from openmap_scenes.formats.mesh import linear_from_srgb
from openmap_scenes.formats.sidecar import table_text, write_whole
from openmap_scenes.scene import Material, Scene

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, REPEAT, LINEAR, LINEAR_MIPMAP = 34962, 34963, 10497, 9729, 9987
# Faces keep their order as one primitive a run of equal material, unless that made more primitives than a viewer likes.
MOST_PRIMITIVES = 4096
LARGEST = 2**32 - 1


class _Writer:
    """The binary chunk and the views and accessors into it."""

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self.length = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, target: int | None = None) -> int:
        padded = data + bytes(-len(data) % 4)
        entry: dict[str, Any] = {"buffer": 0, "byteOffset": self.length, "byteLength": len(data)}
        self.views.append(entry if target is None else {**entry, "target": target})
        self.chunks.append(padded)
        self.length += len(padded)
        return len(self.views) - 1

    def accessor(self, view: int, component: int, count: int, kind: str, **more: Any) -> int:
        self.accessors.append({"bufferView": view, "componentType": component, "count": count, "type": kind, **more})
        return len(self.accessors) - 1


def export_scene(scene: Scene, path: str | Path) -> list[Path]:
    """Write ``<stem>.glb``, ``<stem>.instances.json`` and ``<stem>.credits.txt``.

    Faces whose materials alternate more than ``MOST_PRIMITIVES`` times are sorted by material; otherwise they keep their order.

    Parameters
    ----------
    scene : Scene
    path : str or Path
        Where the GLB goes; its folder is made where there is none.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    DataError
        The path is not that of a .glb or cannot be written to, or the scene is larger than a GLB can be (4 GiB).
    """
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise DataError(path, f"suffix {path.suffix!r}", "a path that ends in .glb")
    path.parent.mkdir(parents=True, exist_ok=True)
    scene = _few_runs(scene)
    files = {
        path: _glb(scene, path),
        path.with_name(f"{path.stem}.instances.json"): table_text(scene),
        path.with_name(f"{path.stem}.credits.txt"): _credits_text(scene).encode(),
    }
    write_whole(files)
    return list(files)


def _few_runs(scene: Scene) -> Scene:
    """The scene with its faces sorted by material, if they are not in few runs already."""
    if np.count_nonzero(np.diff(scene.face_material)) < MOST_PRIMITIVES:
        return scene
    order = np.argsort(scene.face_material, kind="stable")
    fields = {name: getattr(scene, name)[order] for name in ("faces", "face_material", "face_instance")}
    return Scene(**{**vars(scene), **fields})


def _glb(scene: Scene, path: Path) -> bytes:
    """The bytes of the GLB: one node, one mesh, one primitive a run of faces of one material; all share their vertices."""
    writer = _Writer()
    attributes = _attributes(scene, writer)
    document = {
        "asset": {"version": "2.0", "generator": "openmap-nav", "copyright": "; ".join(scene.credits)},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": scene.name, "mesh": 0}],
        "meshes": [{"name": scene.name, "primitives": _primitives(scene, attributes, writer)}],
        **_look(scene.materials, writer),
        "extensionsUsed": ["KHR_materials_unlit"],
        "accessors": writer.accessors,
        "bufferViews": writer.views,
        "buffers": [{"byteLength": writer.length}],
    }
    text = json.dumps(document, allow_nan=False, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + writer.length
    if length > LARGEST:
        raise DataError(path, f"a scene of {length} bytes", f"at most the {LARGEST} that a GLB can hold")
    head = struct.pack("<4sIIII", b"glTF", 2, length, len(text), 0x4E4F534A)
    return b"".join([head, text, struct.pack("<II", writer.length, 0x004E4942), *writer.chunks])


def _attributes(scene: Scene, writer: _Writer) -> dict[str, int]:
    n = len(scene.vertices)
    vertices = np.ascontiguousarray(scene.vertices, "<f4")
    low, high = vertices.min(0).tolist(), vertices.max(0).tolist()
    view = writer.view(vertices.tobytes(), ARRAY_BUFFER)
    attributes = {"POSITION": writer.accessor(view, FLOAT, n, "VEC3", min=low, max=high)}
    uv = scene.uv
    if uv is None and any(material.texture is not None for material in scene.materials):
        uv = np.zeros((n, 2), np.float32)  # glTF wants coordinates wherever there is a texture
    if uv is not None:
        view = writer.view(np.ascontiguousarray(uv, "<f4").tobytes(), ARRAY_BUFFER)
        attributes["TEXCOORD_0"] = writer.accessor(view, FLOAT, n, "VEC2")
    if scene.vertex_colour is not None:
        view = writer.view(_linear_colours(scene.vertex_colour).tobytes(), ARRAY_BUFFER)
        attributes["COLOR_0"] = writer.accessor(view, UNSIGNED_SHORT, n, "VEC4", normalized=True)
    return attributes


def _linear_colours(srgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint16]:
    """Linear RGBA (V, 4) of sRGB bytes (V, 3); sixteen bits tell all 256 bytes apart, eight would not."""
    table = np.rint(linear_from_srgb(np.arange(256) / 255.0) * 65535.0).astype("<u2")
    colours = np.full((len(srgb), 4), 65535, "<u2")
    colours[:, :3] = table[srgb]
    return colours


def _primitives(scene: Scene, attributes: dict[str, int], writer: _Writer) -> list[dict[str, Any]]:
    faces = np.ascontiguousarray(scene.faces, "<u4")
    view = writer.view(faces.tobytes(), ELEMENT_ARRAY_BUFFER)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(scene.face_material)) + 1])
    ends = np.concatenate([starts[1:], [len(faces)]])
    primitives = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        indices = writer.accessor(view, UNSIGNED_INT, 3 * (end - start), "SCALAR", byteOffset=12 * start)
        material = int(scene.face_material[start])
        primitives.append({"attributes": attributes, "indices": indices, "material": material, "mode": 4})
    return primitives


def _look(materials: list[Material], writer: _Writer) -> dict[str, Any]:
    """The document's materials, textures, images and their sampler; a texture that several materials share is written once."""
    entries: list[dict[str, Any]] = []
    images: list[dict[str, Any]] = []
    numbers: dict[int, int] = {}
    for material in materials:
        factor = [*linear_from_srgb(np.asarray(material.colour, np.float64)).tolist(), 1.0]
        pbr: dict[str, Any] = {"baseColorFactor": factor, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        if material.texture is not None:
            if id(material.texture) not in numbers:
                numbers[id(material.texture)] = len(images)
                stream = io.BytesIO()
                Image.fromarray(np.ascontiguousarray(material.texture)).save(stream, "PNG", compress_level=6)
                images.append({"bufferView": writer.view(stream.getvalue()), "mimeType": "image/png"})
            pbr["baseColorTexture"] = {"index": numbers[id(material.texture)]}
        entries.append(
            {
                "name": material.name,
                "pbrMetallicRoughness": pbr,
                "doubleSided": True,
                "extensions": {"KHR_materials_unlit": {}},
            }
        )
    look: dict[str, Any] = {"materials": entries}
    if images:
        sampler = {"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP, "wrapS": REPEAT, "wrapT": REPEAT}
        textures = [{"source": number, "sampler": 0} for number in range(len(images))]
        look |= {"images": images, "samplers": [sampler], "textures": textures}
    return look


def _credits_text(scene: Scene) -> str:
    lines = list(scene.credits) or ["No credits are known."]
    return f"What {scene.name} is made of:\n\n" + "\n".join(lines) + "\n"
