"""Replica scans: ``mesh.ply`` (look), ``habitat/mesh_semantic.ply`` (ids), ``habitat/info_semantic.json`` (names).

All files are Z up: world = (x, z, -y). The semantic mesh has an ``object_id`` on every quad, which is the ``id`` of an object of
the table; 0 is nobody, and so are ids that the table's ``id_to_label`` has but its objects leave out. Ids are kept as they are.

The look is that of the vertex colours, which every ``mesh.ply`` of Replica carries. The release's ``textures/`` (PTex atlases of
half floats, one tile a quad) are not read.

Boxes are those of an object's faces. The table has oriented boxes too, but loose ones, and nothing here needs them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import is_id, is_whole, read_json_object
from openmap_scenes.formats.glb import T_WORLD_ZUP
from openmap_scenes.formats.instances import UNLABELLED, make_instance
from openmap_scenes.formats.ply import PlyMesh, read_ply
from openmap_scenes.formats.transfer import transfer_face_ids
from openmap_scenes.scene import Instance, Material, Scene, instance_boxes

LOOK, IDS, NAMES = "mesh.ply", "habitat/mesh_semantic.ply", "habitat/info_semantic.json"


def files_replica(folder: str | Path) -> list[Path]:
    """The files of a scan that decide its ``Scene``; without ``mesh.ply`` the semantic mesh, which has colours too, is shown.

    Raises
    ------
    DataError
        Not a folder, or the semantic mesh or its table is missing.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DataError(folder, "no such folder", f"a Replica scan: {LOOK}, {IDS}, {NAMES}")
    for name in (IDS, NAMES):
        if not (folder / name).is_file():
            raise DataError(folder / name, "no such file", f"a Replica scan: {LOOK}, {IDS}, {NAMES}")
    return [folder / name for name in (LOOK, IDS, NAMES) if (folder / name).is_file()]


def read_replica(folder: str | Path) -> Scene:
    """The scan in a folder of the Replica release.

    Raises
    ------
    DataError
        A file is missing, broken, or the files do not belong together.
    """
    *look, ids, names = files_replica(folder)
    table, last_id = _read_table(names)
    labelled = read_ply(ids, face_properties=["object_id"])
    face_id = _checked_ids(ids, labelled.face_properties["object_id"], table, last_id)
    vertices = _to_world(labelled)
    shown, shown_vertices, shown_id = labelled, vertices, face_id
    if look:
        shown = read_ply(look[0])
        shown_vertices = _to_world(shown)
        same = _same_faces(labelled, shown, face_id)
        if same is None:
            same = transfer_face_ids(vertices, labelled.faces, face_id, shown_vertices, shown.faces, ids, look[0])
        shown_id = same
    return Scene(
        name=Path(folder).resolve().name,
        vertices=shown_vertices,
        faces=shown.faces,
        face_material=np.zeros(len(shown.faces), np.int32),
        face_instance=shown_id,
        materials=[Material("vertex colours", np.ones(3, np.float32))],
        instances=_instances(table, instance_boxes(vertices, labelled.faces, face_id)),
        vertex_colour=shown.vertex_colour,
        source=f"replica:{folder}",
    )


def _to_world(mesh: PlyMesh) -> npt.NDArray[np.float32]:
    return (mesh.vertices @ T_WORLD_ZUP[:3, :3].T).astype(np.float32)


def _read_table(path: Path) -> tuple[dict[int, str], int]:
    """Class name of each object id, and the largest id that the table speaks of; what has an id below 1 is nobody."""
    value = read_json_object(path, "Replica's table of objects")
    objects = value.get("objects")
    if not isinstance(objects, list):
        raise DataError(path, "no list 'objects'", "Replica's table of objects")
    names: dict[int, str] = {}
    classes = _class_names(path, value.get("classes", []))
    for row, entry in enumerate(objects):
        where = f"{path} objects[{row}]"
        if isinstance(entry, dict) and type(entry.get("id")) is int and entry["id"] < 1:
            continue
        if not isinstance(entry, dict) or not is_id(entry.get("id")):
            raise DataError(where, "no id", "an object with a whole number as its id")
        if entry["id"] in names:
            raise DataError(where, f"id {entry['id']} a second time", "each id once")
        class_id = entry.get("class_id")
        known = UNLABELLED if type(class_id) is int and class_id < 1 else None
        name = entry.get("class_name", classes.get(class_id, known) if is_whole(class_id) else None)
        if not isinstance(name, str):
            raise DataError(where, "no class", "a class_name, or a class_id that 'classes' lists")
        names[entry["id"]] = name
    labels = value.get("id_to_label", [])
    return names, max(len(labels) - 1 if isinstance(labels, list) else 0, max(names, default=0))


def _class_names(path: Path, classes: object) -> dict[Any, str]:
    if not isinstance(classes, list):
        raise DataError(path, "'classes' that is no list", "a list of ids and names")
    return {
        c["id"]: c["name"]
        for c in classes
        if isinstance(c, dict) and is_id(c.get("id")) and isinstance(c.get("name"), str)
    }


def _checked_ids(
    path: Path, object_id: npt.NDArray[np.generic], table: dict[int, str], last_id: int
) -> npt.NDArray[np.int32]:
    """Instance id (F,) of each face; 0 where the table has no object of that id but knows of it."""
    ids = object_id.astype(np.int64)
    wrong = (ids < -1) | (ids > last_id)
    if wrong.any():
        raise DataError(
            path,
            f"{int(wrong.sum())} faces with an object_id outside the table (first: {ids[wrong][0]})",
            f"0..{last_id}, as its info_semantic.json lists",
            "The two files are not of one scan, or one of them is damaged.",
        )
    return np.where(np.isin(ids, sorted(table)), ids, 0).astype(np.int32)


def _same_faces(labelled: PlyMesh, shown: PlyMesh, face_id: npt.NDArray[np.int32]) -> npt.NDArray[np.int32] | None:
    """Ids (F,) by vertex numbers where both meshes have the same vertices and the same triangles in any order, else None.

    This is exact and quick; only a mesh that was made anew needs a look at where its faces lie.
    """
    if not np.array_equal(labelled.vertices, shown.vertices) or labelled.faces.shape != shown.faces.shape:
        return None
    corners, to_corners = np.sort(labelled.faces, axis=1), np.sort(shown.faces, axis=1)
    order, to_order = np.lexsort(corners.T), np.lexsort(to_corners.T)
    if not np.array_equal(corners[order], to_corners[to_order]):
        return None
    result = np.zeros(len(face_id), np.int32)
    result[to_order] = face_id[order]
    return result


def _instances(
    table: dict[int, str], boxes: dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]
) -> list[Instance]:
    """One instance for each object that has faces."""
    return [make_instance(i, table[i].replace("-", " "), *boxes[i], source_id=i) for i in sorted(table) if i in boxes]
