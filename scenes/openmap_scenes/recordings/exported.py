"""ScanNet recordings as its tools export them: ``color/N.jpg``, ``depth/N.png`` (mm), ``pose/N.txt``, ``intrinsic/*.txt``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.recordings.files import bytes_of, numbered
from openmap_scenes.recordings.images import ColourToDepth, decode_colour, decode_depth, size_of
from openmap_scenes.recordings.poses import T_world_camera, camera_of, find_T_world_scan, is_lost
from openmap_scenes.recordings.recording import Frame, RandomAccess

METRES = 1e-3
PARTS = {"color": (".jpg", ".jpeg", ".png"), "depth": (".png",), "pose": (".txt",)}
# The largest matrix file that is read; a pose has some 150 bytes.
LARGEST_TEXT = 4096
EXPECTED = "an exported ScanNet recording: color, depth, pose, intrinsic"


class ExportedRecording(RandomAccess):
    """The recording in an exported folder.

    Frame numbers may be any with one step between them (0, 1, 2 or 0, 20, 40). Names, poses and cameras are checked when it is
    opened, pictures when they are read. ``<folder's name>.txt``, in the folder or beside it, gives the alignment.

    Raises
    ------
    DataError
        Something is missing or broken; the error names the file and the frame.
    """

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder)
        self.name = self._folder.resolve().name
        self._files = {part: _numbered(self._folder / part, endings) for part, endings in PARTS.items()}
        numbers = _common_numbers(self._folder, self._files)
        first = numbers[0]
        size = size_of(str(self._files["depth"][first]), bytes_of(self._files["depth"][first]))
        self._colour_size = size_of(str(self._files["color"][first]), bytes_of(self._files["color"][first]))
        self.camera = self._camera("depth", size)
        self._to_depth = ColourToDepth(str(self._folder), self._camera("color", self._colour_size), self.camera)
        T_world_scan = self._alignment()
        poses = {}
        for number in numbers:
            path = self._files["pose"][number]
            pose = read_matrix(path)
            if not is_lost(pose):
                poses[number] = T_world_camera(path, number, pose, T_world_scan)
        self._poses = list(poses.items())
        self.skipped = tuple(n for n in numbers if n not in poses)

    def _alignment(self) -> npt.NDArray[np.float64]:
        folder = self._folder.resolve()
        inside = folder / f"{folder.name}.txt"
        return find_T_world_scan(folder if inside.is_file() else folder.parent, (folder.name, folder.parent.name))

    def _camera(self, part: str, size: tuple[int, int]) -> PinholeCamera:
        path = self._folder / "intrinsic" / f"intrinsic_{part}.txt"
        return camera_of(path, read_matrix(path), size)

    def __len__(self) -> int:
        return len(self._poses)

    def _read(self, position: int) -> Frame:
        number, pose = self._poses[position]
        colour, depth = self._files["color"][number], self._files["depth"][number]
        rgb = decode_colour(str(colour), bytes_of(colour), self._colour_size)
        millimetres = decode_depth(str(depth), bytes_of(depth), (self.camera.width, self.camera.height))
        return Frame(number, self._to_depth(rgb), millimetres.astype(np.float32) * np.float32(METRES), pose.copy())


def _numbered(folder: Path, endings: tuple[str, ...]) -> dict[int, Path]:
    """The files of a folder that are named by a frame number, in its order; DataError where there is no folder."""
    if not folder.is_dir():
        raise DataError(folder, "no such folder", EXPECTED)
    return numbered(folder, endings)


def _common_numbers(folder: Path, files: dict[str, dict[int, Path]]) -> list[int]:
    """The frame numbers, ascending; DataError where a frame lacks a file or is missing altogether."""
    numbers = sorted(set().union(*files.values()))
    if not numbers:
        raise DataError(folder, "no frames", "color/N.jpg, depth/N.png, pose/N.txt")
    for number in numbers:
        for part, endings in PARTS.items():
            if number not in files[part]:
                raise DataError(
                    folder / part, f"no file of frame {number}", f"{number}{endings[0]}", "Export the frame again."
                )
    steps = np.diff(numbers)
    if len(steps) and steps.max() > steps.min():
        missing = numbers[int(np.argmax(steps > steps.min()))] + int(steps.min())
        raise DataError(folder, f"no frame {missing}", f"frames in steps of {steps.min()}", "Export the frame again.")
    return numbers


def read_matrix(path: Path) -> npt.NDArray[np.float64]:
    """A matrix (4, 4) from a text file of four lines of four numbers, or DataError."""
    data = bytes_of(path, "four lines of four numbers", LARGEST_TEXT)
    rows = [line.split() for line in data.decode("ascii", "replace").splitlines() if line.strip()]
    try:
        values = [[float(word) for word in row] for row in rows]
    except ValueError as error:
        raise DataError(path, f"words that are no numbers ({error})", "four lines of four numbers") from error
    if [len(row) for row in values] != [4, 4, 4, 4]:
        raise DataError(path, f"lines of {[len(row) for row in values][:6]} numbers", "four lines of four numbers")
    return np.array(values, np.float64)
