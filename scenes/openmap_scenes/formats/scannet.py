"""ScanNet scans: ``<scan>_vh_clean_2.ply`` (look), ``.segs.json`` and ``.aggregation.json`` (objects), ``<scan>.txt`` (heading).

The scan frame is Z up with a heading and an offset of its own. ``axisAlignment`` of the text file turns the walls along the axes
and puts the floor at zero, still Z up; where it is absent the scan frame is taken as it is. Then world = (x, z, -y).

An object's vertices are those of its segments, and its box is theirs. ``Instance.id`` is ``objectId + 1``, as in the benchmark and
in the ``instance-filt`` pictures; 0 is what nobody annotated. A segment that two objects claim goes to the later one of the file,
as in ScanNet's own export. ScanNet has no rooms; ``.labels.ply`` says nothing that the objects' labels do not, and is not read.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import is_id, is_whole, read_json_object
from openmap_scenes.formats.glb import T_WORLD_ZUP
from openmap_scenes.formats.instances import make_instance
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.rigid import check_rigid
from openmap_scenes.scene import Instance, Material, Scene

MESH, SEGMENTS = "_vh_clean_2.ply", "_vh_clean_2.0.010000.segs.json"
AGGREGATIONS = (".aggregation.json", "_vh_clean.aggregation.json")


@dataclass(frozen=True)
class _Object:
    id: int
    label: str
    segments: tuple[int, ...]


def files_scannet(folder: str | Path) -> list[Path]:
    """The files of a scan that decide its ``Scene``: the mesh first, then those that are there of segments, objects and text file.

    Raises
    ------
    DataError
        Not a folder with one ``*_vh_clean_2.ply``, or only one of segments and objects is there.
    """
    folder = Path(folder)
    meshes = sorted(folder.glob(f"*{MESH}")) if folder.is_dir() else []
    if len(meshes) != 1:
        found = f"{len(meshes)} files *{MESH}" if folder.is_dir() else "no such folder"
        raise DataError(folder, found, f"a ScanNet scan: <scan>{MESH}, <scan>{SEGMENTS}, <scan>.aggregation.json")
    scan = _scan_name(meshes[0])
    segments = folder / f"{scan}{SEGMENTS}"
    objects = [folder / f"{scan}{ending}" for ending in AGGREGATIONS if (folder / f"{scan}{ending}").is_file()][:1]
    # A scan of the test split has the segments alone.
    if objects and not segments.is_file():
        raise DataError(segments, "no such file", f"the segments that {objects[0].name} is about")
    text = folder / f"{scan}.txt"
    return [*meshes, *(p for p in (segments, *objects, text) if p.is_file())]


def read_scannet(folder: str | Path) -> Scene:
    """The scan in a folder of the ScanNet release; without an aggregation file it has no instances.

    Raises
    ------
    DataError
        A file is missing, broken, or the files do not belong together.
    """
    files = files_scannet(folder)
    scan = _scan_name(files[0])
    T_world_scan = read_T_world_scan(Path(folder) / f"{scan}.txt")
    mesh = read_ply(files[0])
    vertices = (mesh.vertices @ T_world_scan[:3, :3].T + T_world_scan[:3, 3]).astype(np.float32)
    vertex_instance = np.zeros(len(vertices), np.int32)
    instances: list[Instance] = []
    aggregation = [f for f in files if f.name.endswith(AGGREGATIONS)]
    if aggregation:
        segment = _read_segments(Path(folder) / f"{scan}{SEGMENTS}", len(vertices))
        objects = _read_objects(aggregation[0])
        vertex_instance = _vertex_instance(aggregation[0], segment, objects)
        instances = _instances(objects, vertices, vertex_instance)
    return Scene(
        name=scan,
        vertices=vertices,
        faces=mesh.faces,
        face_material=np.zeros(len(mesh.faces), np.int32),
        face_instance=face_majority(vertex_instance[mesh.faces]),
        materials=[Material("vertex colours", np.ones(3, np.float32))],
        instances=instances,
        vertex_colour=mesh.vertex_colour,
        source=f"scannet:{folder}",
    )


def _scan_name(mesh: Path) -> str:
    return mesh.name.removesuffix(MESH)


def read_T_world_scan(path: Path) -> npt.NDArray[np.float64]:
    """The transform (4, 4) from the scan frame, in which meshes and poses are, to the world frame, by the scan's text file.

    The file may be missing or lack the line ``axisAlignment``, as it does in the test split.

    Raises
    ------
    DataError
        The line is not a rotation and a shift of 16 numbers.
    """
    text = path.read_bytes().decode("utf-8", "replace") if path.is_file() else ""
    for number, line in enumerate(text.splitlines(), 1):
        if re.match(r"\s*axisAlignment\s*=", line):
            words = line.partition("=")[2].split()
            try:
                values = np.array([float(word) for word in words])
            except ValueError:
                values = np.zeros(0)
            if len(values) != 16:
                raise DataError(f"{path} line {number}", f"axisAlignment of {len(words)} words", "16 numbers")
            T_aligned_scan = values.reshape(4, 4)
            check_rigid(f"{path} line {number}", "an axisAlignment", T_aligned_scan)
            return np.asarray(T_WORLD_ZUP @ T_aligned_scan, np.float64)
    return T_WORLD_ZUP.copy()


def _read_segments(path: Path, n_vertices: int) -> npt.NDArray[np.int64]:
    """Segment number (V,) of each vertex."""
    value = read_json_object(path, "the segments of a ScanNet mesh").get("segIndices")
    try:
        segment = np.asarray(value)
    except ValueError:  # lists in the list
        segment = np.zeros(0, object)
    if not isinstance(value, list) or segment.ndim != 1 or (value and segment.dtype.kind != "i"):
        raise DataError(path, "segIndices that are not a list of whole numbers", "one number for each vertex")
    if len(segment) != n_vertices:
        raise DataError(
            path,
            f"{len(segment)} entries of segIndices",
            f"{n_vertices}, one for each vertex of {path.name.removesuffix(SEGMENTS)}{MESH}",
            "The two files are not of one scan, or one of them was cut: fetch both again.",
        )
    return segment.astype(np.int64)


def _read_objects(path: Path) -> list[_Object]:
    """The objects of an aggregation file in its order; those of no segment too."""
    value = read_json_object(path, "the objects of a ScanNet scan")
    about = value.get("segmentsFile", "")
    # A file "_vh_clean.aggregation.json" usually speaks of the full mesh, whose segments have other numbers.
    if isinstance(about, str) and about and not about.endswith(SEGMENTS):
        raise DataError(
            path, f"objects of {about}", f"objects of <scan>{SEGMENTS}", "Put <scan>.aggregation.json beside the mesh."
        )
    groups = value.get("segGroups")
    if not isinstance(groups, list):
        raise DataError(path, "no list 'segGroups'", "the objects of a ScanNet scan")
    objects: list[_Object] = []
    seen: set[int] = set()
    for row, group in enumerate(groups):
        where = f"{path} segGroups[{row}]"
        if not isinstance(group, dict) or not is_id(group.get("objectId")):
            raise DataError(where, "no objectId", "an object with a whole number as its objectId")
        number, label, segments = group["objectId"], group.get("label"), group.get("segments")
        if number in seen:
            raise DataError(where, f"objectId {number} a second time", "each objectId once")
        if not isinstance(label, str):
            raise DataError(where, f"no label for object {number}", "its name")
        if not isinstance(segments, list) or not all(is_whole(s) for s in segments):
            raise DataError(where, f"no list of segments for object {number}", "whole numbers")
        seen.add(number)
        objects.append(_Object(number, label, tuple(segments)))
    return objects


def _vertex_instance(path: Path, segment: npt.NDArray[np.int64], objects: list[_Object]) -> npt.NDArray[np.int32]:
    """Instance id (V,) of each vertex, 0 = none."""
    numbers, inverse = np.unique(segment, return_inverse=True)
    owner = np.zeros(len(numbers), np.int32)
    for item in objects:
        wanted = np.array(item.segments, np.int64)
        known = np.isin(wanted, numbers)
        if not known.all():
            raise DataError(
                path,
                f"object {item.id} ({item.label}) with segment {wanted[~known][0]}, which no vertex has",
                "segments of the .segs.json beside it",
                "The two files are not of one scan.",
            )
        owner[np.searchsorted(numbers, wanted)] = item.id + 1
    return owner[inverse]


def face_majority(corner_instance: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Instance id (F,) of faces from those of their corners (F, 3): what two corners say.

    Where all three differ nobody has the face: such a triangle bridges a seam between three things, and giving it to one of
    them would let a stray tip stick out of it.
    """
    a, b, c = corner_instance.T
    return np.where((a == b) | (a == c), a, np.where(b == c, b, 0)).astype(np.int32)


def _instances(
    objects: list[_Object], vertices: npt.NDArray[np.float32], vertex_instance: npt.NDArray[np.int32]
) -> list[Instance]:
    """One instance for each object that has vertices, with the box of all of them."""
    order = np.argsort(vertex_instance, kind="stable")
    ids, starts = np.unique(vertex_instance[order], return_index=True)
    points = dict(zip(ids.tolist(), np.split(vertices[order], starts[1:]), strict=True))
    return [
        make_instance(o.id + 1, o.label, points[o.id + 1].min(0), points[o.id + 1].max(0), source_id=o.id)
        for o in sorted(objects, key=lambda o: o.id)
        if o.id + 1 in points
    ]
