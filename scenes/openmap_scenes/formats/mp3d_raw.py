"""Matterport3D as it is downloaded: which object each face of ``house_segmentations/<scan>.ply`` is of.

A face is of a segment: ``<scan>.fsegs.json`` (``segIndices``, one a face), else the face property ``material_id`` of the PLY.
A segment is of an object: the E lines of the ``.house``, else ``<scan>.semseg.json`` (``segGroups``), else the face property
``segment_id`` of the PLY says the object at once. Format: niessner/Matterport, data_organization.md, "house_segmentations".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import read_json
from openmap_scenes.formats.house import House
from openmap_scenes.formats.mesh import T_WORLD_ZUP, moved
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.ply_header import open_ply

# Property names of the PLY: those in the files, and those of the documentation.
SEGMENT_NAMES, OBJECT_NAMES = ("material_id", "face_material"), ("segment_id", "face_segment")
LARGEST_ID = 2**53


def find_raw(folder: Path, scan: str = "") -> tuple[Path, Path, Path]:
    """The house file, the textured OBJ and the segmented PLY of a scan's folder; DataError where one is not to be found."""
    segmentations = folder / "house_segmentations"
    houses = [segmentations / f"{scan}.house"] if scan else sorted(segmentations.glob("*.house"))
    if len(houses) != 1:
        expected = "one: <scan>.house, beside <scan>.ply, <scan>.fsegs.json and <scan>.semseg.json"
        raise DataError(segmentations, f"{len(houses)} .house files", expected, "Unpack house_segmentations.zip.")
    # The archive holds <hash>/<hash>.obj; unpacked by hand, the files may lie one folder up or down.
    meshes = sorted((folder / "matterport_mesh").glob("**/*.obj"))
    if len(meshes) != 1:
        expected = "the textured mesh <hash>/<hash>.obj"
        raise DataError(
            folder / "matterport_mesh", f"{len(meshes)} .obj files", expected, "Unpack matterport_mesh.zip."
        )
    return houses[0], meshes[0], houses[0].with_suffix(".ply")


def read_raw_object_ids(
    path: Path, house: House
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """World vertices (V, 3) m, faces (F, 3) and object index (F,), -1 = none, of the segmented mesh.

    Raises
    ------
    DataError
        The PLY or its tables are broken, or their counts do not fit; indices outside the house file are left to the caller.
    """
    segments_file, groups_file = path.with_suffix(".fsegs.json"), path.with_suffix(".semseg.json")
    element = next(e for e in open_ply(path)[2] if e.name == "face")
    present = {p.name for p in element.properties if p.count is None}
    segment_name = next((n for n in SEGMENT_NAMES if n in present), None)
    object_name = next((n for n in OBJECT_NAMES if n in present), None)
    ply = read_ply(path, face_properties=[n for n in (segment_name, object_name) if n is not None])
    segment: npt.NDArray[np.int64] | None = None
    if segments_file.is_file():
        segment = _segments(segments_file, path, element.rows, ply.polygon)
    elif segment_name is not None:
        segment = _whole(path, ply.face_properties[segment_name])
    table = _of_lines(path.with_suffix(".house"), house)
    if not table and groups_file.is_file():
        table = _groups(groups_file)
    if segment is not None and table:
        object_id = _looked_up(segment, table)
    elif object_name is not None:
        object_id = _whole(path, ply.face_properties[object_name])
    else:
        expected = f"{segments_file.name} or a face property {SEGMENT_NAMES[0]}, with E lines in the .house or {groups_file.name}"
        raise DataError(path, "no way from faces to objects", expected)
    return moved(ply.vertices.astype(np.float32), T_WORLD_ZUP), ply.faces, object_id


def _segments(path: Path, ply: Path, n_faces: int, polygon: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    """Segment of each triangle (F,), from that of each face of the PLY."""
    entry = read_json(path, "the segments of a scan's faces")["segIndices"]
    if not isinstance(entry.raw, list):
        entry.fail("a list of segment ids, one a face")
    if len(entry.raw) != n_faces:
        raise DataError(path, f"{len(entry.raw)} segIndices", f"one for each of the {n_faces} faces of {ply.name}")
    if not all(type(s) is int and -1 <= s <= LARGEST_ID for s in entry.raw):
        entry.fail("whole numbers, one a face", found="a segment id that is none")
    return np.array(entry.raw, np.int64)[polygon]


def _of_lines(path: Path, house: House) -> dict[int, int]:
    """Object index of each segment that the house file lists."""
    table: dict[int, int] = {}
    for segment, number in house.segments:
        if table.setdefault(segment, number) != number:
            raise DataError(
                path, f"segment {segment} of objects {table[segment]} and {number}", "a segment of one object"
            )
    return table


def _groups(path: Path) -> dict[int, int]:
    """Object index of each segment that a group lists."""
    table: dict[int, int] = {}
    for group in read_json(path, "the objects of a scan's segments")["segGroups"].items():
        number = group["objectId" if group["objectId"].exists else "id"].integer()
        for item in group["segments"].items():
            if table.setdefault(item.integer(-1, LARGEST_ID), number) != number:
                item.fail("a segment of one object", found=f"segment {item.raw} of two objects")
    return table


def _looked_up(segment: npt.NDArray[np.int64], table: dict[int, int]) -> npt.NDArray[np.int64]:
    """``table`` at each segment (F,); -1 for a segment of no object."""
    keys = np.array(sorted(table), np.int64)
    values = np.array([table[k] for k in keys.tolist()], np.int64)
    at = np.minimum(np.searchsorted(keys, segment), len(keys) - 1)
    return np.where(keys[at] == segment, values[at], -1)


def _whole(path: Path, values: npt.NDArray[np.generic]) -> npt.NDArray[np.int64]:
    numbers = values.astype(np.float64)
    if not (np.abs(numbers) <= LARGEST_ID).all() or (numbers != np.round(numbers)).any():
        raise DataError(path, "ids that are no whole numbers", "segment and object ids")
    return np.maximum(numbers.astype(np.int64), -1)
