"""GLB and other plain meshes -> Scene: geometry, textures and colours, without semantics.

glTF's base colour factors and vertex colours are linear and are brought to sRGB here, since a Scene holds display values.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image

from openmap_scenes.errors import DataError
from openmap_scenes.scene import Material, Scene

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")

T_WORLD_YUP = np.eye(4)
# Matterport's raw frame (x right, y front, z up) to the world frame: world = (x, z, -y).
T_WORLD_ZUP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)


@dataclass(frozen=True)
class TexturedMesh:
    """All geometry of one mesh file in one frame; fields as in ``Scene``."""

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    face_material: npt.NDArray[np.int32]
    materials: list[Material]
    uv: npt.NDArray[np.float32] | None
    vertex_colour: npt.NDArray[np.uint8] | None


def read_glb(path: str | Path) -> Scene:
    """A mesh file (Y up, as glTF rules) as a scene without instances or rooms; DataError where it cannot be read."""
    path = Path(path)
    mesh = read_textured_mesh(path, T_WORLD_YUP)
    return Scene(
        name=path.stem,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=np.zeros(len(mesh.faces), np.int32),
        materials=mesh.materials,
        instances=[],
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"file:{path}",
    )


def read_textured_mesh(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    """Read every triangle of a mesh file and bring it to the world frame by ``T_world_file`` (4, 4).

    Raises
    ------
    DataError
        No such file, not a mesh, truncated, compressed textures, no triangles.
    """
    if not path.is_file():
        raise DataError(path, "no such file", f"a mesh ({', '.join(MESH_SUFFIXES)})")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise DataError(path, f"suffix {path.suffix!r}", f"one of {', '.join(MESH_SUFFIXES)}")
    if path.suffix.lower() == ".glb":
        check_glb(path)
    try:
        loaded = trimesh.load(path, process=False, maintain_order=True)
        parts = _parts(loaded if isinstance(loaded, trimesh.Scene) else trimesh.Scene(loaded))
    except DataError:
        raise
    except Exception as error:  # a broken file may fail anywhere inside the mesh library
        raise DataError(path, f"unreadable content ({type(error).__name__}: {error})", "an intact mesh file") from error
    if not parts:
        raise DataError(path, "no triangles", "a triangle mesh")
    return _join(parts, T_world_file)


def check_glb(path: Path) -> None:
    """Check a GLB's header against its file before anything is decoded; DataError says what is wrong."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(20)
        if len(header) < 20 or header[:4] != b"glTF":
            raise DataError(
                path, f"{size} bytes that start with {header[:4]!r}", "a GLB file, which starts with b'glTF'"
            )
        version, length, json_length, json_type = struct.unpack("<IIII", header[4:20])
        if version != 2:
            raise DataError(path, f"glTF version {version}", "version 2")
        if length > size:
            raise DataError(
                path,
                f"a truncated file of {size} bytes",
                f"the {length} bytes that its header declares",
                "Fetch it again.",
            )
        if json_type != 0x4E4F534A or json_length > size - 20:
            raise DataError(path, "a first chunk that is not JSON", "glTF's JSON chunk", "Fetch it again.")
        try:
            document = json.loads(file.read(json_length))
        except ValueError as error:
            raise DataError(path, f"a broken JSON chunk ({error})", "glTF's JSON chunk", "Fetch it again.") from error
    if "KHR_texture_basisu" in document.get("extensionsRequired", []):
        raise DataError(
            path,
            "KTX2/Basis compressed textures",
            "JPEG or PNG textures",
            "Use the dataset's uncompressed release (HM3D: the files without '.basis').",
        )


def _parts(scene: trimesh.Scene) -> list[tuple[trimesh.Trimesh, npt.NDArray[np.float64]]]:
    """Every triangle mesh of the scene graph with its node's transform into the file's frame."""
    parts = []
    for node in scene.graph.nodes_geometry:
        T_file_node, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            parts.append((mesh, np.asarray(T_file_node, np.float64)))
    return parts


def _join(
    parts: list[tuple[trimesh.Trimesh, npt.NDArray[np.float64]]], T_world_file: npt.NDArray[np.float64]
) -> TexturedMesh:
    vertices, faces, face_material, uvs, colours = [], [], [], [], []
    materials: list[Material] = []
    textures: dict[int, npt.NDArray[np.uint8]] = {}
    offset = 0
    for mesh, T_file_node in parts:
        T = T_world_file @ T_file_node
        vertices.append((np.asarray(mesh.vertices) @ T[:3, :3].T + T[:3, 3]).astype(np.float32))
        faces.append(np.asarray(mesh.faces, np.int32) + np.int32(offset))
        face_material.append(np.full(len(mesh.faces), len(materials), np.int32))
        materials.append(_material(mesh, textures))
        uvs.append(_uv(mesh))
        colours.append(_vertex_colour(mesh))
        offset += len(mesh.vertices)
    white = [np.full((len(v), 3), 255, np.uint8) if c is None else c for v, c in zip(vertices, colours, strict=True)]
    zero = [np.zeros((len(v), 2), np.float32) if t is None else t for v, t in zip(vertices, uvs, strict=True)]
    return TexturedMesh(
        np.concatenate(vertices),
        np.concatenate(faces),
        np.concatenate(face_material),
        materials,
        np.concatenate(zero) if any(t is not None for t in uvs) else None,
        np.concatenate(white) if any(c is not None for c in colours) else None,
    )


def _material(mesh: trimesh.Trimesh, textures: dict[int, npt.NDArray[np.uint8]]) -> Material:
    """The look of a part; ``textures`` holds what was decoded before, by identity of the image."""
    source = getattr(mesh.visual, "material", None)
    if source is None:
        return Material("default", np.ones(3, np.float32))
    factor = getattr(source, "baseColorFactor", None)
    image = getattr(source, "baseColorTexture", None)
    if factor is None and image is None:
        image, factor = getattr(source, "image", None), getattr(source, "diffuse", None)
        colour = np.ones(3) if factor is None or image is not None else np.asarray(factor, np.float64)[:3] / 255.0
    else:
        colour = np.ones(3) if factor is None else srgb_from_linear(np.asarray(factor, np.float64)[:3] / 255.0)
    texture = None
    if isinstance(image, Image.Image):
        if id(image) not in textures:
            textures[id(image)] = np.asarray(image.convert("RGB"), np.uint8)
        texture = textures[id(image)]
    return Material(str(source.name or "material"), colour.astype(np.float32), texture)


def _uv(mesh: trimesh.Trimesh) -> npt.NDArray[np.float32] | None:
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or len(uv) != len(mesh.vertices):
        return None
    # The mesh library turns v upside down on reading; a Scene's v runs down the texture.
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype(np.float32)


def _vertex_colour(mesh: trimesh.Trimesh) -> npt.NDArray[np.uint8] | None:
    if mesh.visual.kind == "vertex":
        rgb = np.asarray(mesh.visual.vertex_colors, np.float64)[:, :3] / 255.0
    else:
        attribute = getattr(mesh.visual, "vertex_attributes", {}).get("color")
        if attribute is None or len(attribute) != len(mesh.vertices):
            return None
        values = np.asarray(attribute)
        scale = float(np.iinfo(values.dtype).max) if values.dtype.kind == "u" else 1.0
        rgb = values[:, :3].astype(np.float64) / scale
    is_linear = mesh.metadata.get("from_gltf_primitive") is not None
    return np.rint((srgb_from_linear(rgb) if is_linear else rgb) * 255.0).astype(np.uint8)


def srgb_from_linear(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Display values 0..1 of linear light 0..1 (IEC 61966-2-1)."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
