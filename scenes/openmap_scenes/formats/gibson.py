"""Gibson homes: Habitat's ``<name>.glb`` (with an optional ``<name>.navmesh``) or the dataset's own folder with ``mesh_z_up.obj``.

Semantics are optional and are those of 3DSceneGraph as Habitat's tools write them: ``<name>_semantic.ply`` carries an
``object_id`` a face, 0 = none; ``<name>.scn`` is JSON: objects (``id``, ``class_``, ``parent_room``, ``material``, ...) and rooms
(``id``, ``scene_category``, ``floor_number``, ``location`` and ``size`` of their box). All of them are Z up: world = (x, z, -y),
except for ``mesh.obj`` of the dataset, which is Y up and is read where there is no ``mesh_z_up.obj``.
Source: habitat-sim, tools/gen_gibson_semantics.sh and src/esp/scene/GibsonSemanticScene.cpp.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import Value, read_json
from openmap_scenes.formats.glb import files_textured_mesh, read_textured_mesh
from openmap_scenes.formats.instances import make_instance
from openmap_scenes.formats.mesh import T_WORLD_YUP, T_WORLD_ZUP, TexturedMesh, moved
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.transfer import transfer_face_ids
from openmap_scenes.scene import Instance, Room, Scene, instance_boxes

EXPECTED = "a Gibson home: <name>.glb, or a folder with <name>.glb or mesh_z_up.obj"
RAW_MESHES = ("mesh_z_up.obj", "mesh.obj")
# Attributes of an object that are taken over, and what a Scene calls them.
ATTRIBUTES = {"material": "material", "visual_texture": "pattern"}


@dataclass(frozen=True)
class _Files:
    name: str
    mesh: Path
    semantic: Path | None
    table: Path | None


def read_gibson(path: str | Path) -> Scene:
    """A Gibson home, named by its mesh or its folder.

    Without the two files of its semantics it has neither instances nor rooms.

    Raises
    ------
    DataError
        No such home, a broken file, one of the two semantic files without the other, ids that the table does not list.
    """
    files = _locate(path)
    T_world_file = T_WORLD_YUP if files.mesh.name == "mesh.obj" else T_WORLD_ZUP
    mesh = read_textured_mesh(files.mesh, T_world_file)
    face_instance, instances, rooms = np.zeros(len(mesh.faces), np.int32), list[Instance](), list[Room]()
    if files.semantic is not None and files.table is not None:
        face_instance, instances, rooms = _semantics(files, files.semantic, files.table, mesh)
    return Scene(
        name=files.name,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=face_instance,
        materials=mesh.materials,
        instances=instances,
        rooms=rooms,
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"gibson:{path}",
    )


def files_gibson(path: str | Path) -> list[Path]:
    """Every file that decides what ``read_gibson`` gives; DataError where one is missing."""
    files = _locate(path)
    return [*files_textured_mesh(files.mesh), *(f for f in (files.semantic, files.table) if f is not None)]


def _locate(path: str | Path) -> _Files:
    path = Path(path)
    if path.is_file():
        return _with_semantics(path)
    if not path.is_dir():
        raise DataError(path, "no such file or folder", EXPECTED)
    named = path / f"{path.resolve().name}.glb"
    glbs = [named] if named.is_file() else sorted(path.glob("*.glb"))
    if len(glbs) == 1:
        return _with_semantics(glbs[0])
    if glbs:
        raise DataError(path, f"{len(glbs)} .glb files, none of them {named.name}", "one home", "Name the .glb itself.")
    for name in RAW_MESHES:
        if (path / name).is_file():
            return _with_semantics(path / name)
    raise DataError(path, "no mesh", EXPECTED)


def _with_semantics(mesh: Path) -> _Files:
    """A mesh with the files of its semantics; the raw meshes are named alike in all homes, their folder is not."""
    name = mesh.parent.resolve().name if mesh.name in RAW_MESHES else mesh.stem
    semantic, table = mesh.with_name(f"{name}_semantic.ply"), mesh.with_name(f"{name}.scn")
    if mesh.with_name(f"{name}.house").is_file() and not table.is_file():
        return _Files(name, mesh, None, None)  # the semantic mesh is that of a Matterport3D scan, which `mp3d` reads
    if semantic.is_file() != table.is_file():
        present, absent = (semantic, table) if semantic.is_file() else (table, semantic)
        remedy = "Fetch it too, or take the other one away to read the home without semantics."
        raise DataError(absent, "no such file", f"it beside {present.name}", remedy)
    return _Files(name, mesh, *((semantic, table) if semantic.is_file() else (None, None)))


def _semantics(
    files: _Files, semantic: Path, table: Path, mesh: TexturedMesh
) -> tuple[npt.NDArray[np.int32], list[Instance], list[Room]]:
    ply = read_ply(semantic, face_properties=("object_id",))
    object_id = ply.face_properties["object_id"]
    document = read_json(table, "the table of a home's objects")
    entries = {entry["id"].integer(1, 2**31 - 2): entry for entry in document["objects"].items()}
    if len(entries) < len(document["objects"].items()):
        document["objects"].fail("each object id once", found="an object id more than once")
    known = np.array([0, *entries], np.int64)
    wrong = object_id[~np.isin(object_id, known)]
    if len(wrong):
        found = f"{len(wrong)} faces with an object_id outside the table (first: {wrong[0]})"
        raise DataError(semantic, found, f"0 for none, or an id that {table.name} lists")
    vertices, ids = moved(ply.vertices.astype(np.float32), T_WORLD_ZUP), object_id.astype(np.int32)
    rooms = _from_lowest([_room(entry) for entry in document["rooms"].items()])
    if len({room.id for room in rooms}) < len(rooms):
        document["rooms"].fail("each room id once", found="a room id more than once")
    boxes = instance_boxes(vertices, ply.faces, ids)
    instances = [_instance(entries[i], i, boxes[i], rooms) for i in sorted(boxes)]
    face_instance = transfer_face_ids(vertices, ply.faces, ids, mesh.vertices, mesh.faces, semantic, files.mesh)
    return face_instance, instances, rooms


def _room(entry: Value) -> Room:
    """A room; location and size are those of its box, in the raw frame."""
    centre, size = np.array(entry["location"].numbers(3)), np.abs(np.array(entry["size"].numbers(3)))
    if max(np.abs(centre).max(), size.max()) > 1e6:
        entry.fail("a box in metres", found="a box beyond all bounds")
    corners = np.array([centre - size / 2, centre + size / 2]) @ T_WORLD_ZUP[:3, :3].T
    # Storeys have letters ("A" is the lowest) or numbers.
    floor = entry["floor_number"].raw
    is_letter = isinstance(floor, str) and len(floor) == 1 and floor.isascii() and floor.isalpha()
    level = ord(str(floor).upper()) - ord("A") if is_letter else entry["floor_number"].integer(0, 1000, 0)
    name = entry["scene_category"].text("room").replace("_", " ").lower()
    return Room(entry["id"].integer(), name, corners.min(0), corners.max(0), level)


def _from_lowest(rooms: list[Room]) -> list[Room]:
    """Rooms with storeys counted from 0, wherever the file begins."""
    lowest = min((room.level for room in rooms), default=0)
    return [dataclasses.replace(room, level=room.level - lowest) for room in rooms]


def _instance(
    entry: Value, number: int, box: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]], rooms: list[Room]
) -> Instance:
    room = entry["parent_room"].integer(0) if entry["parent_room"].exists else None
    if room is not None and rooms and room not in {r.id for r in rooms}:
        entry["parent_room"].fail("the id of a room of the file")
    attributes = {}
    for key, name in ATTRIBUTES.items():
        words = _words(entry[key])
        if words:
            attributes[name] = words
    known_room = room if rooms else None
    return make_instance(number, entry["class_"].text(), *box, known_room, number, attributes=attributes)


def _words(value: Value) -> str:
    """A text, or a list of texts, as words separated by blanks; "" for none."""
    if not value.exists:
        return ""
    texts = [value.text()] if isinstance(value.raw, str) else [item.text("") for item in value.items()]
    return " ".join(t.strip().lower() for t in texts if t.strip() and t.strip().lower() != "none")
