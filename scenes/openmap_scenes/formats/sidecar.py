"""The table of instances and rooms beside a plain mesh: ``<stem>.instances.json``, or ``instances.json`` for the folder.

::

    {
      "format": "openmap-instances", "version": 1,
      "name": "my_flat",                                        optional: Scene.name
      "credits": ["Sofa by A. Author, CC-BY 4.0"],              optional: Scene.credits
      "rooms": [{"id": 1, "name": "kitchen", "aabb_min": [0, 0, 0], "aabb_max": [4, 2.5, 3], "level": 0}],
      "instances": [{"id": 7, "category": "armchair",
                     "room": 1,                                 optional: the id of a room above
                     "attributes": {"colour": "blue"},          optional
                     "mpcat40": "chair", "scannet200": "armchair", "lvis": "armchair",
                                                                optional: left out, the taxonomy says; null, it has none
                     "source_id": 7,                            optional
                     "aabb_min": [...], "aabb_max": [...],      optional: left out, the box of its faces' vertices
                     "nodes": ["Armchair_01"],                  optional: faces of these nodes, meshes or OBJ groups are it
                     "materials": ["blue_fabric"]}],            optional: faces of these materials are it
      "faces": [[0, 120, 7], [120, 36, 0]]                      optional: [first face, how many, instance id] runs
    }

Ids are whole numbers from 1; id 0 in a run means none. Boxes are in metres in the world frame, which is the mesh's own:
Y up. Faces count in the file's order, a polygon of n corners as n - 2 triangles; glTF primitives follow one another by node,
depth first. Runs may not overlap; they win over materials, and materials win over nodes. Categories are lower case.
"""

from __future__ import annotations

import dataclasses
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import Value, read_json
from openmap_scenes.formats.instances import make_instance
from openmap_scenes.formats.mesh import TexturedMesh
from openmap_scenes.scene import Instance, Room, Scene, instance_boxes

FORMAT, VERSION = "openmap-instances", 1
LABEL_SETS = ("mpcat40", "scannet200", "lvis")
FARTHEST = 1e6


@dataclass(frozen=True)
class Labels:
    """What a table says of a mesh of F faces; fields as in ``Scene``."""

    name: str
    face_instance: npt.NDArray[np.int32]
    instances: list[Instance]
    rooms: list[Room]
    credits: tuple[str, ...]


def find_table(mesh: Path) -> Path | None:
    """The table that belongs to a mesh file, or None."""
    for name in (f"{mesh.stem}.instances.json", "instances.json"):
        if (mesh.parent / name).is_file():
            return mesh.parent / name
    return None


def read_table(path: Path, mesh: TexturedMesh) -> Labels:
    """Read and check a table against its mesh.

    Raises
    ------
    DataError
        Not the format, a value of the wrong type, an id twice or out of the table, faces that the mesh does not have, an
        instance without faces and without a box.
    """
    top = read_json(path, "a table of instances")
    if top["format"].text("") != FORMAT or top["version"].integer(0, 10**6, 0) != VERSION:
        found = f"format {str(top['format'].raw)[:40]!r} version {str(top['version'].raw)[:20]}"
        top.fail(f"'format': '{FORMAT}', 'version': {VERSION}", found=found)
    rooms = [_room(entry) for entry in top["rooms"].items()]
    _once(top["rooms"], [room.id for room in rooms])
    entries = top["instances"].items()
    ids = [entry["id"].integer(1) for entry in entries]
    _once(top["instances"], ids)
    face_instance = _face_instance(top, entries, ids, mesh)
    boxes = instance_boxes(mesh.vertices, mesh.faces, face_instance)
    room_ids = {room.id for room in rooms}
    instances = [_instance(entry, boxes, room_ids) for entry in entries]
    return Labels(
        top["name"].text(""),
        face_instance,
        sorted(instances, key=lambda i: i.id),
        rooms,
        tuple(entry.text() for entry in top["credits"].items()),
    )


def _once(table: Value, ids: list[int]) -> None:
    twice = sorted({i for i in ids if ids.count(i) > 1}) if len(set(ids)) < len(ids) else []
    if twice:
        table.fail("each id once", found=f"id {twice[0]} more than once")


def _room(entry: Value) -> Room:
    low, high = _box(entry)
    return Room(entry["id"].integer(), entry["name"].text(), low, high, entry["level"].integer(-100, 1000, 0))


def _box(entry: Value) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    low, high = np.array(entry["aabb_min"].numbers(3)), np.array(entry["aabb_max"].numbers(3))
    if (low > high).any() or np.abs([low, high]).max() > FARTHEST:
        entry.fail(f"aabb_min <= aabb_max within {FARTHEST:.0f} m", found=f"a box {low.tolist()} to {high.tolist()}")
    return low, high


def _instance(
    entry: Value, boxes: dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]], room_ids: set[int]
) -> Instance:
    number = entry["id"].integer(1)
    if entry["aabb_min"].exists or entry["aabb_max"].exists:
        low, high = _box(entry)
    elif number in boxes:
        low, high = boxes[number]
    else:
        entry.fail("faces, by run, node or material, or a box", found=f"instance {number} without faces")
    room = entry["room"].integer() if entry["room"].exists else None
    if room is not None and room not in room_ids:
        entry["room"].fail(f"the id of a room of the table ({sorted(room_ids)[:20]})")
    attributes: dict[str, str] = {}
    if entry["attributes"].exists:
        if not isinstance(entry["attributes"].raw, dict):
            entry["attributes"].fail("an object of strings")
        attributes = {key: entry["attributes"][key].text() for key in entry["attributes"].raw}
    said: dict[str, Any] = {
        key: entry[key].text() if entry[key].exists else None for key in LABEL_SETS if key in entry.raw
    }
    source_id = entry["source_id"].integer(-(2**31), 2**31 - 1, number)
    instance = make_instance(number, entry["category"].text(), low, high, room, source_id, attributes=attributes)
    return dataclasses.replace(instance, **said)


def _face_instance(top: Value, entries: list[Value], ids: list[int], mesh: TexturedMesh) -> npt.NDArray[np.int32]:
    """The instance id of each face (F,), from nodes, then materials, then runs."""
    n_faces = len(mesh.faces)
    result = np.zeros(n_faces, np.int32)
    by_node, by_material = _names(entries, ids, "nodes"), _names(entries, ids, "materials")
    if by_node:
        part_ids = [by_node.get(p.node, by_node.get(p.mesh, 0)) for p in mesh.parts]
        lengths = [p.n_faces for p in mesh.parts]
        if sum(lengths) == n_faces:
            result = np.repeat(np.array(part_ids, np.int32), lengths)
        _all_known(top, by_node, {n for p in mesh.parts for n in (p.node, p.mesh)}, "nodes")
    if by_material:
        of_material = np.array([by_material.get(m.name, 0) for m in mesh.materials], np.int32)[mesh.face_material]
        result = np.where(of_material > 0, of_material, result).astype(np.int32)
        _all_known(top, by_material, {m.name for m in mesh.materials}, "materials")
    known, covered = {0, *ids}, np.zeros(n_faces, bool)
    for run in top["faces"].items():
        if not isinstance(run.raw, list) or len(run.raw) != 3:
            run.fail("[first face, how many, instance id]")
        first, count, number = (item.integer() for item in run.items())
        if first + count > n_faces:
            run.fail(f"faces within the {n_faces} of the mesh")
        if number not in known:
            run.fail("the id of an instance of the table, or 0")
        if covered[first : first + count].any():
            run.fail("runs that do not overlap")
        covered[first : first + count] = True
        result[first : first + count] = number
    return result


def _names(entries: list[Value], ids: list[int], key: str) -> dict[str, int]:
    """Which instance each node or material name belongs to."""
    table: dict[str, int] = {}
    for entry, number in zip(entries, ids, strict=True):
        for name in entry[key].items():
            if table.setdefault(name.text(), number) != number:
                name.fail(
                    "a name that one instance has", found=f"{name.raw!r}, which is also that of {table[name.text()]}"
                )
    return table


def _all_known(top: Value, named: dict[str, int], present: set[str], what: str) -> None:
    unknown = sorted(set(named) - present)
    if unknown:
        found = f"{what} that the mesh does not have ({', '.join(map(repr, unknown[:3]))})"
        top["instances"].fail(f"names of its {len(present)} {what}", found=found)


def table_text(scene: Scene) -> bytes:
    """The table of a scene, such that ``read_table`` gives back its instances, rooms, ids, name and credits."""
    ids = np.asarray(scene.face_instance)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(ids)) + 1])
    counts = np.diff(np.concatenate([starts, [len(ids)]]))
    runs = [[int(s), int(n), int(ids[s])] for s, n in zip(starts, counts, strict=True) if ids[s]]
    document = {
        "format": FORMAT,
        "version": VERSION,
        "name": scene.name,
        "credits": list(scene.credits),
        "rooms": [
            {
                "id": r.id,
                "name": r.name,
                "aabb_min": r.aabb_min.tolist(),
                "aabb_max": r.aabb_max.tolist(),
                "level": r.level,
            }
            for r in scene.rooms
        ],
        "instances": [
            {
                "id": i.id,
                "category": i.category,
                "room": i.room,
                "attributes": dict(sorted(i.attributes.items())),
                **{key: getattr(i, key) for key in LABEL_SETS},
                "source_id": i.source_id,
                "aabb_min": i.aabb_min.tolist(),
                "aabb_max": i.aabb_max.tolist(),
            }
            for i in scene.instances
        ],
        "faces": runs,
    }
    return (json.dumps(document, allow_nan=False, ensure_ascii=False) + "\n").encode()


def write_whole(files: dict[Path, bytes]) -> None:
    """Write files so that all are there completely or none is: to temporary names, then renamed; DataError where that fails."""
    temporary = {path: path.with_name(f".{path.name}.{os.getpid()}.part") for path in files}
    try:
        for path, data in files.items():
            temporary[path].write_bytes(data)
        for path in files:
            os.replace(temporary[path], path)
    except OSError as error:
        size = sum(map(len, files.values())) / 2**20
        raise DataError(
            path, f"{error.strerror or error}", f"room for {size:.1f} MiB in a folder that can be written to"
        ) from error
    finally:
        for unfinished in temporary.values():
            unfinished.unlink(missing_ok=True)
