"""Recordings of the Record3D app, unpacked: ``metadata`` (JSON) and, for each frame, colour, depth and perhaps confidence.

Read are
- an unpacked ``.r3d``: ``metadata``, ``rgbd/N.jpg`` with depth beside it as ``N.npy`` or ``N.png``, perhaps ``N.conf.npy``,
- the export as pictures: ``metadata.json``, ``rgb/N.jpg``, ``depth/N.png`` or ``.npy``,
- what scripts of ConceptGraphs and others make of an ``.r3d``: ``metadata``, ``rgb/N.png``, ``depth/N.png`` (mm), ``conf/N.npy``,
  ``poses/N.npy``.

``metadata`` has ``w``, ``h`` and ``K`` (9 numbers by columns) of the colour camera and ``poses``, a list of qx qy qz qw tx ty tz,
camera to world, OpenGL camera axes; ARKit's world is Y up. ``initPose`` and intrinsics of single frames are not used.

The app's own ``N.depth`` and ``N.conf`` are packed with LZFSE, and one of its exports has EXR; no library here reads either.
"""

from __future__ import annotations

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
from openmap_scenes.recordings.poses import T_world_camera, camera_from, pose_of_quaternion

METRES = 1e-3
METADATA = ("metadata", "metadata.json")
COLOURS, DEPTHS = (".jpg", ".jpeg", ".png"), (".npy", ".png")
PACKED = {
    ".depth": (
        "depth packed with LZFSE",
        "Unpack N.depth (pyliblzfse does: float32 m, as many as dw x dh) and save it as N.npy.",
    ),
    ".exr": (
        "depth as EXR",
        "Convert N.exr to N.npy (float32 m) with a program that reads EXR, or export the recording as .r3d.",
    ),
}


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
        confidence = numbered(folder / "conf", (".npy", ".png")) or numbered_confidence(folder / "rgbd")
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
        super().__init__(folder, _camera(metadata), frames, (), METRES)


def read_metadata(folder: Path) -> Value:
    """The object of a recording's metadata file, or DataError."""
    paths = [folder / name for name in METADATA]
    value = read_json(next((p for p in paths if p.is_file()), paths[0]), "the metadata of a Record3D recording")
    if not isinstance(value.raw, dict):
        value.fail("an object with w, h, K and poses")
    return value


def numbered_confidence(folder: Path) -> dict[int, Path]:
    """Confidence beside the pictures, ``N.conf.npy`` or ``N.conf.png``."""
    names = {
        path.stem.removesuffix(".conf"): path for path in folder.glob("*.conf.*") if path.suffix in (".npy", ".png")
    }
    return {int(stem): names[stem] for stem in sorted(names) if stem.isascii() and stem.isdigit() and len(stem) < 10}


def _depths(folder: Path) -> dict[int, Path]:
    for part in ("depth", "rgbd"):
        depth = numbered(folder / part, (".npy",)) or numbered(folder / part, DEPTHS[1:])
        if depth:
            return depth
    for part in ("depth", "rgbd"):
        for ending, (found, remedy) in PACKED.items():
            packed = numbered(folder / part, (ending,))
            if packed:
                raise DataError(next(iter(packed.values())), found, "N.npy in metres or N.png in millimetres", remedy)
    raise DataError(folder, "no depth", "depth/N.png, depth/N.npy or rgbd/N.npy")


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
