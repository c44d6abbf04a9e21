"""Recordings of the Record3D app, unpacked: ``metadata`` (JSON) and, for each frame, colour, depth and perhaps confidence.

Read are
- an unpacked ``.r3d``: ``metadata``, ``rgbd/N.jpg`` and ``N.depth`` (``dh`` x ``dw`` float32 m) or, converted, ``N.npy`` or
  ``N.png``, perhaps ``N.conf`` or ``N.conf.npy``,
- the export as pictures: ``metadata.json``, ``rgb/N.jpg``, ``depth/N.exr`` or, converted, ``.npy`` or ``.png`` (mm),
- what scripts of ConceptGraphs and others make of an ``.r3d``: ``metadata``, ``rgb/N.png``, ``depth/N.png`` (mm), ``conf/N.npy``,
  ``poses/N.npy``.

``metadata`` has ``w``, ``h`` and ``K`` (9 numbers by columns) of the colour camera and ``poses``, a list of qx qy qz qw tx ty tz,
camera to world, OpenGL camera axes; ARKit's world is Y up. ``initPose`` and intrinsics of single frames are not used.

``.depth`` and ``.conf`` are packed with LZFSE and need pyliblzfse, ``.exr`` needs OpenEXR; neither is a dependency of this package.
"""

from __future__ import annotations

import logging
import math
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import Value, read_json
from openmap_scenes.formats.mesh import T_WORLD_YUP
from openmap_scenes.recordings.arrays import read_array
from openmap_scenes.recordings.files import bytes_of, numbered
from openmap_scenes.recordings.folder import FolderRecording, FrameFiles
from openmap_scenes.recordings.images import check_size
from openmap_scenes.recordings.packed import PACKED, library_of, lzfse_size
from openmap_scenes.recordings.poses import T_world_camera, camera_from, pose_of_quaternion

METRES = 1e-3
METADATA = ("metadata", "metadata.json")
COLOURS, DEPTHS = (".jpg", ".jpeg", ".png"), (".npy", ".png", ".exr", ".depth")

_log = logging.getLogger(__name__)


class Record3DRecording(FolderRecording):
    """The recording in an unpacked folder; frames are numbered from 0, and the n-th pose is that of frame n.

    Depth of low confidence is dropped. Colour and depth may have any size with the view of ``w`` x ``h``.

    Parameters
    ----------
    folder : str or Path
    lenient : bool
        Give the frames that have pictures and a pose, instead of an error where some lack one.

    Raises
    ------
    DataError
        Something is missing, broken, or packed in a way that cannot be read.
    """

    def __init__(self, folder: str | Path, *, lenient: bool = False) -> None:
        folder = Path(folder)
        metadata = read_metadata(folder)
        colour = numbered(folder / "rgb", COLOURS) or numbered(folder / "rgbd", COLOURS)
        depth = _depths(folder)
        confidence = _confidences(folder)
        if not colour:
            raise DataError(folder, "no pictures", "rgbd/0.jpg, ... or rgb/0.jpg, ...")
        poses = _poses(folder, metadata)
        whole = colour.keys() & depth.keys() & poses.keys()
        # Poses alone make no frame, but with fewer pictures than poses something was lost.
        for number in sorted(colour.keys() | depth.keys() | poses.keys()):
            if number not in whole and not lenient:
                lacks = [
                    n for n, there in (("colour", colour), ("depth", depth), ("pose", poses)) if number not in there
                ]
                remedy = "Export it again, or open it leniently for the frames that are whole."
                raise DataError(
                    folder, f"frame {number} without {' and '.join(lacks)}", "all three of each frame", remedy
                )
        frames = [FrameFiles(n, colour[n], depth[n], poses[n], confidence.get(n)) for n in sorted(whole)]
        size = _packed_size(metadata, frames[0].depth) if frames and frames[0].depth.suffix == ".depth" else None
        super().__init__(folder, _camera(metadata), frames, (), METRES, size)


def read_metadata(folder: Path) -> Value:
    """The object of a recording's metadata file, or DataError."""
    paths = [folder / name for name in METADATA]
    value = read_json(next((p for p in paths if p.is_file()), paths[0]), "the metadata of a Record3D recording")
    if not isinstance(value.raw, dict):
        value.fail("an object with w, h, K and poses")
    return value


def _confidences(folder: Path) -> dict[int, Path]:
    """Confidence in a folder of its own or beside the pictures (``N.conf.npy``, ``N.conf``); none where it cannot be unpacked."""
    beside = {
        p.stem.removesuffix(".conf"): p for p in sorted(folder.glob("rgbd/*.conf.*")) if p.suffix in (".npy", ".png")
    }
    found = {int(stem): path for stem, path in beside.items() if re.fullmatch("[0-9]{1,9}", stem)}
    files = numbered(folder / "conf", (".npy", ".png")) or found or numbered(folder / "rgbd", (".conf",))
    for path in files.values():
        if path.suffix == ".conf":
            try:
                library_of(path)
            except DataError as error:
                _log.warning("depth of low confidence is kept: %s", error)
                return {}
            break
    return files


def _depths(folder: Path) -> dict[int, Path]:
    """Depth by frame, in the encoding that is easiest to read; DataError where there is none or a library for it is missing."""
    for endings in ((ending,) for ending in DEPTHS):
        for part in ("depth", "rgbd"):
            depth = numbered(folder / part, endings)
            if depth:
                if endings[0] in PACKED:
                    library_of(next(iter(depth.values())))
                return depth
    raise DataError(folder, "no depth", "rgbd/N.depth, depth/N.exr, N.npy in metres or N.png in millimetres")


def _packed_size(metadata: Value, path: Path) -> tuple[int, int]:
    """Width and height of packed depth: ``dw`` and ``dh``, else what has as many pixels and the shape of the colour picture."""
    if metadata["dw"].exists and metadata["dh"].exists:
        width, height = metadata["dw"].integer(), metadata["dh"].integer()
    else:
        pixels = lzfse_size(path, bytes_of(path)) // 4
        width = round(math.sqrt(pixels * metadata["w"].integer(1) / metadata["h"].integer(1)))
        height = pixels // max(width, 1)
    check_size(str(metadata.source), width, height)
    return width, height


def _poses(folder: Path, metadata: Value) -> dict[int, npt.NDArray[np.float64]]:
    """Poses (4, 4) in the world by frame: those of ``poses/N.npy`` where there are any, else those of the metadata."""
    files = numbered(folder / "poses", (".npy",))
    if files:
        return {
            number: T_world_camera(
                path,
                number,
                read_array(path, bytes_of(path, "a pose"), (4, 4)).astype(np.float64),
                T_WORLD_YUP,
                opengl=True,
            )
            for number, path in files.items()
        }
    poses = {}
    for number, value in enumerate(metadata["poses"].items()):
        numbers = value.numbers(7)
        source = f"{metadata.source} {value.place}"
        T = pose_of_quaternion(source, numbers[:4], numbers[4:])
        poses[number] = T_world_camera(source, number, T, T_WORLD_YUP, opengl=True)
    if not poses:
        metadata["poses"].fail("a list of qx qy qz qw tx ty tz")
    return poses


def _camera(metadata: Value) -> PinholeCamera:
    size = metadata["w"].integer(), metadata["h"].integer()
    check_size(str(metadata.source), *size)
    K = metadata["K"].numbers(9)
    return camera_from(metadata.source, (K[0], K[4], K[6], K[7]), size)
