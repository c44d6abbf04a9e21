"""Matterport3D scans in Habitat's layout: ``<scan>.glb`` (look), ``<scan>_semantic.ply`` (ids), ``<scan>.house`` (names).

All three files are Z up (the .glb too, in spite of glTF's rule): world = (x, z, -y). An ``object_id`` of the PLY is an
``object_index`` of the house file and starts at 0; ``Instance.id`` is one more, because 0 means none.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from plyfile import PlyData

from openmap_scenes.errors import DataError
from openmap_scenes.formats.glb import T_WORLD_ZUP, read_textured_mesh
from openmap_scenes.formats.house import House, read_house
from openmap_scenes.formats.transfer import transfer_face_ids
from openmap_scenes.scene import Instance, Room, Scene, instance_boxes


def read_mp3d(folder: str | Path) -> Scene:
    """The scan in a folder that holds its three files, named after the folder or after the one ``.house`` file in it.

    Raises
    ------
    DataError
        A file is missing, broken, or the three do not belong together.
    """
    folder = Path(folder)
    houses = sorted(folder.glob("*.house")) if folder.is_dir() else []
    if len(houses) != 1:
        found = f"{len(houses)} .house files" if folder.is_dir() else "no such folder"
        raise DataError(folder, found, "a Matterport3D scan: <scan>.glb, <scan>.house and <scan>_semantic.ply")
    scan = houses[0].stem
    house = read_house(houses[0])
    mesh = read_textured_mesh(folder / f"{scan}.glb", T_WORLD_ZUP)
    vertices, faces, object_id = _read_semantic_ply(folder / f"{scan}_semantic.ply", len(house.objects))
    face_instance = transfer_face_ids(vertices, faces, (object_id + 1).astype(np.int32), mesh.vertices, mesh.faces)
    return Scene(
        name=scan,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_material=mesh.face_material,
        face_instance=face_instance,
        materials=mesh.materials,
        instances=_instances(house, instance_boxes(vertices, faces, object_id + 1)),
        rooms=_rooms(house),
        uv=mesh.uv,
        vertex_colour=mesh.vertex_colour,
        source=f"mp3d:{folder}",
    )


def _read_semantic_ply(
    path: Path, n_objects: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """World vertices (V, 3) m, faces (F, 3) and object_id (F,), -1 = none, of the semantic mesh."""
    if not path.is_file():
        raise DataError(path, "no such file", "the scan's semantic mesh")
    try:
        ply = PlyData.read(str(path), known_list_len={"face": {"vertex_indices": 3}}, mmap="r")
        vertex, face = ply["vertex"], ply["face"]
        vertices = np.stack([vertex["x"], vertex["y"], vertex["z"]], axis=1).astype(np.float64)
        faces = np.array(face["vertex_indices"], np.int32)
        object_id = np.array(face["object_id"], np.int32)
    except Exception as error:  # a broken file may fail anywhere inside the PLY library
        found = f"unreadable content ({type(error).__name__}: {error})"
        raise DataError(path, found, "a PLY of triangles with a face property object_id") from error
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise DataError(path, f"vertex indices up to {faces.max()}", f"0..{len(vertices) - 1}")
    wrong = object_id[(object_id < -1) | (object_id >= n_objects)]
    if len(wrong):
        raise DataError(
            path,
            f"{len(wrong)} faces with an object_id outside the table (first: {wrong[0]})",
            f"0..{n_objects - 1}, or -1 for none, as its .house file lists",
            "The two files are not of one scan, or the PLY was cut to fewer bits.",
        )
    world = vertices @ T_WORLD_ZUP[:3, :3].T
    return world.astype(np.float32), faces, object_id


def _instances(
    house: House, boxes: dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]
) -> list[Instance]:
    instances = []
    for index, item in sorted(house.objects.items()):
        if index + 1 not in boxes:
            continue  # objects that the annotators listed but gave no face
        low, high = boxes[index + 1]
        category = house.categories[item.category] if item.category is not None else None
        instances.append(
            Instance(
                id=index + 1,
                category=category.name if category else "unlabelled",
                centre=(low + high) / 2,
                aabb_min=low,
                aabb_max=high,
                room=item.room,
                mpcat40=category.mpcat40 if category else None,
                source_id=index,
            )
        )
    return instances


def _rooms(house: House) -> list[Room]:
    rooms = []
    for index, room in sorted(house.rooms.items()):
        corners = np.array([room.low, room.high]) @ T_WORLD_ZUP[:3, :3].T
        rooms.append(Room(index, room.name, corners.min(0), corners.max(0)))
    return rooms
