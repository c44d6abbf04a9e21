"""Matterport3D scans, in Habitat's layout or in that of the download itself.

Habitat: ``<scan>.glb`` (look), ``<scan>_semantic.ply`` (ids), ``<scan>.house`` (names). An ``object_id`` of the PLY is an
``object_index`` of the house file and starts at 0; ``Instance.id`` is one more, because 0 means none.
The download (``mp3d_raw``): ``matterport_mesh/<hash>/<hash>.obj`` with its textures, and in ``house_segmentations/``
``<scan>.house``, ``<scan>.ply``, ``<scan>.fsegs.json`` and ``<scan>.semseg.json``.
All files are Z up (the .glb too, in spite of glTF's rule): world = (x, z, -y).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.glb import files_textured_mesh, read_textured_mesh
from openmap_scenes.formats.house import House, read_house
from openmap_scenes.formats.instances import UNLABELLED, make_instance
from openmap_scenes.formats.mesh import T_WORLD_ZUP, moved
from openmap_scenes.formats.mp3d_raw import find_raw, read_raw_object_ids
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.transfer import transfer_face_ids
from openmap_scenes.scene import Instance, Room, Scene, instance_boxes
from openmap_scenes.taxonomy import MPCAT40

EXPECTED = "a Matterport3D scan: <scan>.glb, <scan>.house and <scan>_semantic.ply, or matterport_mesh/ and house_segmentations/"


def read_mp3d(path: str | Path) -> Scene:
    """The scan in a folder of either layout; ``path`` may also be its ``.house`` or ``.glb`` file.

    Raises
    ------
    DataError
        A file is missing, broken, or they do not belong together.
    """
    house_file, mesh_file, ids_file = _locate(path)
    house = read_house(house_file)
    vertices, faces, object_id = _read_object_ids(ids_file, house)
    _check_ids(ids_file, object_id, house)
    mesh = read_textured_mesh(mesh_file, T_WORLD_ZUP)
    ids = (object_id + 1).astype(np.int32)
    instances = _instances(house, instance_boxes(vertices, faces, ids))
    return Scene(
        name=house_file.stem,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=transfer_face_ids(vertices, faces, ids, mesh.vertices, mesh.faces, ids_file, mesh_file),
        materials=mesh.materials,
        instances=instances,
        rooms=_rooms(house, instances),
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"mp3d:{path}",
    )


def files_mp3d(path: str | Path) -> list[Path]:
    """Every file that decides what ``read_mp3d`` gives; DataError where one is missing."""
    house_file, mesh_file, ids_file = _locate(path)
    files = [house_file, *files_textured_mesh(mesh_file), ids_file]
    if not ids_file.name.endswith("_semantic.ply"):
        tables = [ids_file.with_suffix(suffix) for suffix in (".fsegs.json", ".semseg.json")]
        files += [table for table in tables if table.is_file()]
    for file in files:
        if not file.is_file():
            raise DataError(file, "no such file", EXPECTED)
    return files


def _locate(path: str | Path) -> tuple[Path, Path, Path]:
    """The scan's house file, its textured mesh and the mesh that carries the ids."""
    path = Path(path)
    if path.suffix in (".house", ".glb") and not path.is_dir():
        if not path.is_file():
            raise DataError(path, "no such file", EXPECTED)
        if path.parent.name == "house_segmentations":
            return _check_files(find_raw(path.parent.parent, path.stem))
        return _check_files((path.with_suffix(".house"), path.with_suffix(".glb"), _semantic(path.parent, path.stem)))
    if not path.is_dir():
        raise DataError(path, "no such folder", EXPECTED)
    # The archives of the download hold a folder named after the scan, which ends up within that of the scan.
    for folder in (path, path / path.name):
        if (folder / "house_segmentations").is_dir() or (folder / "matterport_mesh").is_dir():
            return _check_files(find_raw(folder))
    houses = sorted(path.glob("*.house"))
    if len(houses) != 1:
        raise DataError(path, f"{len(houses)} .house files", EXPECTED, "Name the .house file itself." if houses else "")
    scan = houses[0].stem
    return _check_files((houses[0], path / f"{scan}.glb", _semantic(path, scan)))


def _semantic(folder: Path, scan: str) -> Path:
    return folder / f"{scan}_semantic.ply"


def _check_files(files: tuple[Path, Path, Path]) -> tuple[Path, Path, Path]:
    """The files, all there; where one is missing, what is wrong with the others is told first, since it may explain more."""
    roles = ("the scan's .house file", "the scan's mesh", "the scan's semantic mesh")
    missing = [(file, what) for file, what in zip(files, roles, strict=True) if not file.is_file()]
    if missing:
        house_file, _, ids_file = files
        if house_file.is_file():
            house = read_house(house_file)
            if ids_file.is_file():
                _check_ids(ids_file, _read_object_ids(ids_file, house)[2], house)
        raise DataError(missing[0][0], "no such file", missing[0][1])
    return files


def _read_object_ids(
    path: Path, house: House
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """World vertices (V, 3) m, faces (F, 3) and object_id (F,) of the mesh that carries the ids, in either layout."""
    if path.name.endswith("_semantic.ply"):
        return _read_semantic_ply(path)
    return read_raw_object_ids(path, house)


def _read_semantic_ply(path: Path) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """World vertices (V, 3) m, faces (F, 3) and object_id (F,) of the semantic mesh, the latter as the file says."""
    ply = read_ply(path, face_properties=("object_id",))
    object_id = ply.face_properties["object_id"]
    if object_id.dtype.kind == "f" and not (object_id == np.round(object_id)).all():
        raise DataError(path, "an object_id that is no whole number", "object indices of the .house file")
    return moved(ply.vertices.astype(np.float32), T_WORLD_ZUP), ply.faces, object_id.astype(np.int64)


def _check_ids(path: Path, object_id: npt.NDArray[np.int64], house: House) -> None:
    """DataError where faces are of objects that the house file does not list; -1 is none."""
    known = np.array([-1, *house.objects], np.int64)
    wrong = object_id[~np.isin(object_id, known)]
    if len(wrong):
        raise DataError(
            path,
            f"{len(wrong)} faces with an object_id outside the table (first: {wrong[0]})",
            f"0..{max(house.objects, default=-1)}, or -1 for none, as its .house file lists",
            "The two files are not of one scan, or the PLY was cut to fewer bits.",
        )


def _instances(
    house: House, boxes: dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]
) -> list[Instance]:
    instances = []
    for index, item in sorted(house.objects.items()):
        if index + 1 not in boxes:
            continue  # objects that the annotators listed but gave no face
        category = house.categories[item.category] if item.category is not None else None
        name, mpcat40 = (category.name, category.mpcat40) if category else (UNLABELLED, None)
        if mpcat40 not in MPCAT40:
            mpcat40 = None  # such as "-"
        instances.append(make_instance(index + 1, name, *boxes[index + 1], item.room, index, mpcat40))
    return instances


def _rooms(house: House, instances: list[Instance]) -> list[Room]:
    """Rooms in the world frame; storeys are counted from the lowest, in whichever order the file lists them.

    A region without a box has that of what is in it; where nothing is, it is no room.
    """
    storey = {level: n for n, level in enumerate(sorted(house.levels, key=lambda level: house.levels[level]))}
    rooms = []
    for index, room in sorted(house.rooms.items()):
        if room.box is not None:
            corners = np.array(room.box) @ T_WORLD_ZUP[:3, :3].T
        else:
            corners = np.array([c for i in instances if i.room == index for c in (i.aabb_min, i.aabb_max)])
        if not len(corners):
            continue
        level = storey[room.level] if room.level is not None else 0
        rooms.append(Room(index, room.name, corners.min(0), corners.max(0), level))
    return rooms
