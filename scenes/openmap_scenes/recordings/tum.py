"""TUM RGB-D recordings: ``rgb.txt``, ``depth.txt`` and ``groundtruth.txt``, lines that begin with a time stamp, and the pictures.

Depth is registered to colour, 16 bits, 5000 units a metre. Poses are ``tx ty tz qx qy qz qw`` of the colour camera, optical axes
(x right, y down, z forward), in the frame of the motion capture, Z up. What belongs together is told by time, as the benchmark's
``associate.py`` does it: pairs no farther apart than 0.02 s, the nearest first, each line once.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.mesh import T_WORLD_ZUP
from openmap_scenes.recordings.files import bytes_of, floats, inside, rows_of
from openmap_scenes.recordings.folder import FolderRecording, FrameFiles
from openmap_scenes.recordings.images import size_of
from openmap_scenes.recordings.poses import T_world_camera, camera_from, pose_of_quaternion

METRES = 1 / 5000
FARTHEST_APART = 0.02
# A stamp's candidates are looked for among so many neighbours on each side: more are not within reach in any true recording.
NEIGHBOURS = 8
SIZE = (640, 480)
# The benchmark's calibration of each colour camera, fx fy cx cy, px; the distortion that freiburg1 and 2 also have is left.
CAMERAS = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
DEFAULT = (525.0, 525.0, 319.5, 239.5)
CAMERA_FILES = ("camera.txt", "intrinsics.txt")
LISTS = ("rgb.txt", "depth.txt", "groundtruth.txt")

_log = logging.getLogger(__name__)


class TumRecording(FolderRecording):
    """The recording in a TUM RGB-D folder.

    The camera is that of ``camera.txt`` or ``intrinsics.txt`` (``fx fy cx cy``, or a 3 x 3 matrix) where there is one, else the
    benchmark's for a folder named after freiburg1, 2 or 3, else its default, with a warning. The last two are for 640 x 480
    pixels; pictures of another size with the same view are allowed. Frames are numbered by the lines of ``rgb.txt``; pictures
    that have depth but no pose near in time are skipped, and lines of the trajectory that hold NaN are passed over.

    Raises
    ------
    DataError
        A list or a picture is missing or broken.
    """

    def __init__(self, folder: str | Path) -> None:
        folder = Path(folder)
        colour, depth = _pictures(folder, "rgb.txt"), _pictures(folder, "depth.txt")
        stamps, poses = _trajectory(folder / "groundtruth.txt")
        colour_stamps, depth_stamps = np.array([t for t, _ in colour]), np.array([t for t, _ in depth])
        depth_of = associated(colour_stamps, depth_stamps)
        if not depth_of:
            found = "no two lines of rgb.txt and depth.txt of one time"
            raise DataError(folder, found, f"pictures at most {FARTHEST_APART} s apart")
        with_depth = sorted(depth_of)
        pose_of = associated(colour_stamps[with_depth], stamps)
        frames, skipped = [], []
        for position, index in enumerate(with_depth):
            if position not in pose_of:
                skipped.append(index)
                continue
            T = T_world_camera(folder / "groundtruth.txt", index, poses[pose_of[position]], T_WORLD_ZUP)
            frames.append(FrameFiles(index, colour[index][1], depth[depth_of[index]][1], T))
        super().__init__(folder, _camera(folder), frames, skipped, METRES)


def associated(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> dict[int, int]:
    """Which stamp of ``other`` (M,) belongs to which of ``one`` (N,), s: the nearest pairs first, each stamp at most once."""
    if not len(one) or not len(other):
        return {}
    order = np.argsort(other, kind="stable")
    near = np.searchsorted(other[order], one)[:, None] + np.arange(-NEIGHBOURS, NEIGHBOURS)
    rows, columns = np.nonzero((near >= 0) & (near < len(other)))
    partner = order[near[rows, columns]]
    apart = np.abs(one[rows] - other[partner])
    close = apart < FARTHEST_APART
    rows, partner, apart = rows[close], partner[close], apart[close]
    pairs: dict[int, int] = {}
    taken: set[int] = set()
    for k in np.lexsort((partner, rows, apart)).tolist():
        a, b = int(rows[k]), int(partner[k])
        if a not in pairs and b not in taken:
            pairs[a] = b
            taken.add(b)
    return pairs


def _pictures(folder: Path, name: str) -> list[tuple[float, Path]]:
    """The time (s) and the file of each line of a list, in its order."""
    expected = "lines of a time stamp and a file"
    pictures = []
    for number, words in rows_of(folder / name, f"{expected}, as in a TUM RGB-D recording"):
        source = f"{folder / name} line {number}"
        if len(words) < 2:
            raise DataError(source, f"{len(words)} words", expected)
        stamp = float(floats(source, words[:1], expected)[0])
        if not np.isfinite(stamp):
            raise DataError(source, f"the time {words[0]}", expected)
        pictures.append((stamp, inside(folder, words[1], source)))
    if not pictures:
        raise DataError(folder / name, "no lines", expected)
    return pictures


def _trajectory(path: Path) -> tuple[npt.NDArray[np.float64], list[npt.NDArray[np.float64]]]:
    """Times (N,) s and camera-to-capture matrices (4, 4) of a trajectory, without its lines that hold NaN."""
    expected = "timestamp tx ty tz qx qy qz qw"
    stamps, poses = [], []
    for number, words in rows_of(path, f"lines of {expected}"):
        source = f"{path} line {number}"
        values = floats(source, words, expected)
        if len(values) != 8:
            raise DataError(source, f"{len(values)} numbers", f"8: {expected}")
        if np.isnan(values).any():
            continue
        if not np.isfinite(values).all():
            raise DataError(source, "an infinite number", expected)
        stamps.append(values[0])
        poses.append(pose_of_quaternion(source, values[4:8].tolist(), values[1:4].tolist()))
    if not stamps:
        raise DataError(path, "no poses", f"lines of {expected}")
    return np.array(stamps), poses


def _camera(folder: Path) -> PinholeCamera:
    path = next((folder / name for name in CAMERA_FILES if (folder / name).is_file()), None)
    if path is not None:
        values = floats(str(path), [w for _, words in rows_of(path, "a camera") for w in words], "fx fy cx cy")
        if len(values) == 9:
            values = values[[0, 4, 2, 5]]
        if len(values) != 4:
            raise DataError(path, f"{len(values)} numbers", "fx fy cx cy, or a 3 x 3 matrix")
        # Where the camera is given, it is given for the pictures as they are.
        return _for_pictures(folder, path, (float(values[0]), float(values[1]), float(values[2]), float(values[3])))
    match = re.search(r"(?:freiburg|fr)_?([123])(?![0-9])", folder.resolve().name.lower())
    if match:
        return PinholeCamera(*SIZE, *CAMERAS[f"freiburg{match[1]}"])
    _log.warning(
        "%s: camera not known, taking fx=%g fy=%g cx=%g cy=%g; write `fx fy cx cy` to camera.txt", folder, *DEFAULT
    )
    return PinholeCamera(*SIZE, *DEFAULT)


def _for_pictures(folder: Path, path: Path, values: tuple[float, float, float, float]) -> PinholeCamera:
    first = _pictures(folder, "rgb.txt")[0][1]
    return camera_from(path, values, size_of(str(first), bytes_of(first)))
