"""ScanNet recordings as its tools export them: ``color/N.jpg``, ``depth/N.png`` (mm), ``pose/N.txt``, ``intrinsic/*.txt``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.recordings.images import ColourToDepth, decode_colour, decode_depth, size_of
from openmap_scenes.recordings.poses import T_world_camera, camera_of, find_T_world_scan, is_lost
from openmap_scenes.recordings.recording import Frame

METRES = 1e-3
PARTS = {"color": (".jpg", ".jpeg", ".png"), "depth": (".png",), "pose": (".txt",)}
# The largest matrix file that is read; a pose has some 150 bytes.
LARGEST_TEXT = 4096


class ExportedRecording:
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
        size = size_of(str(self._files["depth"][first]), self._files["depth"][first].read_bytes())
        self._colour_size = size_of(str(self._files["color"][first]), self._files["color"][first].read_bytes())
        self.camera = self._camera("depth", size)
        self._to_depth = ColourToDepth(str(self._folder), self._camera("color", self._colour_size), self.camera)
        T_world_scan = self._alignment()
        self._poses: dict[int, npt.NDArray[np.float64]] = {}
        for number in numbers:
            path = self._files["pose"][number]
            pose = read_matrix(path)
            if not is_lost(pose):
                self._poses[number] = T_world_camera(path, number, pose, T_world_scan)
        self.skipped = tuple(n for n in numbers if n not in self._poses)

    def _alignment(self) -> npt.NDArray[np.float64]:
        folder = self._folder.resolve()
        inside = folder / f"{folder.name}.txt"
        return find_T_world_scan(folder if inside.is_file() else folder.parent, (folder.name, folder.parent.name))

    def _camera(self, part: str, size: tuple[int, int]) -> PinholeCamera:
        path = self._folder / "intrinsic" / f"intrinsic_{part}.txt"
        return camera_of(path, read_matrix(path), size)

    def __len__(self) -> int:
        return len(self._poses)

    def __iter__(self) -> Iterator[Frame]:
        for number, pose in self._poses.items():
            colour, depth = self._files["color"][number], self._files["depth"][number]
            rgb = decode_colour(str(colour), _bytes_of(colour), self._colour_size)
            millimetres = decode_depth(str(depth), _bytes_of(depth), (self.camera.width, self.camera.height))
            yield Frame(number, self._to_depth(rgb), millimetres.astype(np.float32) * np.float32(METRES), pose.copy())


def _numbered(folder: Path, endings: tuple[str, ...]) -> dict[int, Path]:
    """The files of a folder that are named by a frame number, in its order."""
    if not folder.is_dir():
        raise DataError(folder, "no such folder", "an exported ScanNet recording: color, depth, pose, intrinsic")
    files: dict[int, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in endings and re.fullmatch(r"[0-9]{1,9}", path.stem):
            if int(path.stem) in files:
                raise DataError(folder, f"{files[int(path.stem)].name} and {path.name}", "one file a frame")
            files[int(path.stem)] = path
    return dict(sorted(files.items()))


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


def _bytes_of(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:  # gone since it was listed, or not readable
        raise DataError(path, f"a file that cannot be read ({error.strerror})", "a picture") from error


def read_matrix(path: Path) -> npt.NDArray[np.float64]:
    """A matrix (4, 4) from a text file of four lines of four numbers, or DataError."""
    if not path.is_file():
        raise DataError(path, "no such file", "four lines of four numbers")
    if path.stat().st_size > LARGEST_TEXT:
        raise DataError(path, f"{path.stat().st_size} bytes", "four lines of four numbers")
    rows = [line.split() for line in path.read_bytes().decode("ascii", "replace").splitlines() if line.strip()]
    try:
        values = [[float(word) for word in row] for row in rows]
    except ValueError as error:
        raise DataError(path, f"words that are no numbers ({error})", "four lines of four numbers") from error
    if [len(row) for row in values] != [4, 4, 4, 4]:
        raise DataError(path, f"lines of {[len(row) for row in values][:6]} numbers", "four lines of four numbers")
    return np.array(values, np.float64)
