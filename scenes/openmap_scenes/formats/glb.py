"""Plain meshes (GLB, glTF, OBJ, PLY, STL) -> Scene, with instances and rooms where a table lies beside the mesh.

A plain mesh is Y up and in metres, as glTF rules. The table is ``<stem>.instances.json`` or ``instances.json``
(``formats/sidecar.py`` says what it holds); without one the scene has neither instances nor rooms.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh

from openmap_scenes.errors import DataError
from openmap_scenes.formats.gltf import read_document
from openmap_scenes.formats.gltf_mesh import files_gltf, read_gltf
from openmap_scenes.formats.mesh import T_WORLD_YUP, T_WORLD_ZUP, TexturedMesh, check_mesh, moved, srgb_from_linear
from openmap_scenes.formats.obj import files_obj, read_obj
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.sidecar import find_table, read_table
from openmap_scenes.scene import Material, Scene

__all__ = [
    "MESH_SUFFIXES", "T_WORLD_YUP", "T_WORLD_ZUP", "TexturedMesh", "check_glb", "files_file", "files_textured_mesh",
    "read_file", "read_glb", "read_textured_mesh", "srgb_from_linear",
]  # fmt: skip

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
STL_HEADER, STL_TRIANGLE = 84, 50


def read_file(path: str | Path) -> Scene:
    """A mesh file (Y up, metres) as a scene, with what the table beside it says.

    Raises
    ------
    DataError
        The mesh or the table cannot be read, or they do not fit each other.
    """
    path = Path(path)
    mesh = read_textured_mesh(path, T_WORLD_YUP)
    table = find_table(path)
    labels = read_table(table, mesh) if table is not None else None
    return Scene(
        name=labels.name if labels and labels.name else path.stem,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=labels.face_instance if labels else np.zeros(len(mesh.faces), np.int32),
        materials=mesh.materials,
        instances=labels.instances if labels else [],
        rooms=labels.rooms if labels else [],
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"file:{path}",
        credits=labels.credits if labels else (),
    )


read_glb = read_file


def files_file(path: str | Path) -> list[Path]:
    """Every file that decides what ``read_file`` gives; DataError where one of them is missing."""
    path = Path(path)
    table = find_table(path)
    return files_textured_mesh(path) + ([table] if table is not None else [])


def read_textured_mesh(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    """Read every triangle of a mesh file and bring it to the world frame by ``T_world_file`` (4, 4).

    Raises
    ------
    DataError
        No such file, not a mesh, truncated, compressed textures or geometry, no triangles.
    """
    suffix = _check_suffix(path)
    if suffix in (".glb", ".gltf"):
        return read_gltf(path, T_world_file)
    if suffix == ".obj":
        return read_obj(path, T_world_file)
    return _read_ply_mesh(path, T_world_file) if suffix == ".ply" else _read_stl(path, T_world_file)


def files_textured_mesh(path: Path) -> list[Path]:
    """The mesh file and those that it names (buffers, material libraries, textures); DataError where it is missing."""
    suffix = _check_suffix(path)
    if suffix in (".glb", ".gltf"):
        return files_gltf(path)
    return files_obj(path) if suffix == ".obj" else [path]


def check_glb(path: Path) -> None:
    """Check a GLB's header, document and buffers against its file, without decoding; DataError says what is wrong."""
    read_document(path)


def _check_suffix(path: Path) -> str:
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file"
        raise DataError(path, found, f"a mesh ({', '.join(MESH_SUFFIXES)})")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise DataError(path, f"suffix {path.suffix!r}", f"one of {', '.join(MESH_SUFFIXES)}")
    return path.suffix.lower()


def _plain(
    vertices: npt.NDArray[np.floating],
    faces: npt.NDArray[np.int32],
    colour: npt.NDArray[np.uint8] | None,
    T_world_file: npt.NDArray[np.float64],
    path: Path,
) -> TexturedMesh:
    """A mesh of one white material."""
    with np.errstate(over="ignore"):  # what overflows is refused by check_mesh
        placed = moved(vertices.astype(np.float32), T_world_file)
    material = [Material("default", np.ones(3, np.float32))]
    return check_mesh(TexturedMesh(placed, faces, np.zeros(len(faces), np.int32), material, None, colour), path)


def _read_ply_mesh(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    ply = read_ply(path)
    return _plain(ply.vertices, ply.faces, ply.vertex_colour, T_world_file, path)


def _read_stl(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(STL_HEADER)
    n_triangles = int.from_bytes(head[80:84], "little")
    if head[:5].lower() != b"solid" and STL_HEADER + STL_TRIANGLE * n_triangles != size:
        found = f"{n_triangles} triangles announced in {size} bytes"
        raise DataError(path, found, f"{STL_HEADER} + {STL_TRIANGLE} bytes a triangle", "Fetch it again.")
    try:
        # An STL repeats each corner; welding gives triangles their neighbours back.
        mesh = trimesh.load(path, process=True, force="mesh")
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32)
    except Exception as error:  # a broken file may fail anywhere inside the mesh library
        found = f"unreadable content ({type(error).__name__}: {error})"
        raise DataError(path, found, "an intact STL file", "Fetch it again.") from error
    return _plain(vertices, faces, None, T_world_file, path)
