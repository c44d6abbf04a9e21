"""Rendered Replica sequences as NICE-SLAM released them: ``results/frame000000.jpg``, ``results/depth000000.png``, ``traj.txt``.

A line of ``traj.txt`` is a camera-to-world matrix, 16 numbers by rows, optical axes (x right, y down, z forward), Z up.
``cam_params.json`` in the folder or the one above holds ``{"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}``; scale is the
depth units a metre.
"""

from __future__ import annotations

import logging
from pathlib import Path

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import read_json
from openmap_scenes.formats.mesh import T_WORLD_ZUP
from openmap_scenes.recordings.files import floats, numbered, rows_of
from openmap_scenes.recordings.folder import FolderRecording, FrameFiles
from openmap_scenes.recordings.images import check_size
from openmap_scenes.recordings.poses import T_world_camera, camera_from

CAMERA_FILE, TRAJECTORY, PICTURES = "cam_params.json", "traj.txt", "results"
# The camera of the released sequences, which a folder copied from among them is without.
RELEASED, RELEASED_SCALE = PinholeCamera(1200, 680, 600.0, 600.0, 599.5, 339.5), 6553.5

_log = logging.getLogger(__name__)


class ReplicaStyleRecording(FolderRecording):
    """The recording in such a folder; the n-th line of the trajectory belongs to the n-th picture.

    Parameters
    ----------
    folder : str or Path
    lenient : bool
        Of a sequence that was cut short give the frames that have both pictures and a pose.

    Raises
    ------
    DataError
        Something is missing or broken, or there are not as many poses as pictures.
    """

    def __init__(self, folder: str | Path, *, lenient: bool = False) -> None:
        folder = Path(folder)
        colour = numbered(folder / PICTURES, (".jpg", ".jpeg", ".png"), "frame")
        depth = numbered(folder / PICTURES, (".png", ".npy"), "depth")
        path = folder / TRAJECTORY
        lines = rows_of(path, "lines of 16 numbers, camera to world")
        if not colour or not depth:
            found = f"{len(colour)} pictures of colour and {len(depth)} of depth"
            raise DataError(folder / PICTURES, found, "frame000000.jpg, depth000000.png, ...")
        numbers = sorted(colour.keys() | depth.keys())
        whole = colour.keys() & depth.keys()
        for number in numbers:
            if number not in whole and not lenient:
                what = "depth" if number in colour else "colour"
                raise DataError(folder / PICTURES, f"no {what} of frame {number}", "both pictures of a frame")
        if len(numbers) != len(lines) and not lenient:
            found, remedy = (
                f"{len(lines)} poses for {len(numbers)} frames",
                "Open it leniently for those that have both.",
            )
            raise DataError(path, found, "one line a frame", remedy)
        frames = []
        for number, (line, words) in zip(numbers, lines, strict=False):
            if number not in whole:
                continue
            source = f"{path} line {line}"
            values = floats(source, words, "16 numbers")
            if len(values) != 16:
                raise DataError(source, f"{len(values)} numbers", "16, a camera-to-world matrix")
            T = T_world_camera(source, number, values.reshape(4, 4), T_WORLD_ZUP)
            frames.append(FrameFiles(number, colour[number], depth[number], T))
        camera, scale = _camera(folder)
        super().__init__(folder, camera, frames, (), 1 / scale)


def _camera(folder: Path) -> tuple[PinholeCamera, float]:
    """The camera and the depth units a metre."""
    path = next((p / CAMERA_FILE for p in (folder, folder.resolve().parent) if (p / CAMERA_FILE).is_file()), None)
    if path is None:
        _log.warning(
            "%s: no %s here or above, taking the camera of the released Replica sequences", folder, CAMERA_FILE
        )
        return RELEASED, RELEASED_SCALE
    value = read_json(path, "the camera of a Replica sequence")["camera"]
    size = value["w"].integer(), value["h"].integer()
    check_size(str(path), *size)
    fx, fy, cx, cy = (value[key].number() for key in ("fx", "fy", "cx", "cy"))
    scale = value["scale"].number(RELEASED_SCALE)
    if not 1e-3 <= scale <= 1e6:
        value["scale"].fail("depth units a metre, usually 6553.5")
    return camera_from(path, (fx, fy, cx, cy), size), scale
