"""What recordings in folders have in common: a picture of colour and one of depth for each frame, read when it is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.recordings.arrays import array_size, read_array
from openmap_scenes.recordings.files import bytes_of
from openmap_scenes.recordings.images import ColourToDepth, decode_colour, decode_depth, size_of
from openmap_scenes.recordings.packed import exr_size, read_exr, unpack_lzfse
from openmap_scenes.recordings.poses import resized
from openmap_scenes.recordings.recording import Frame, RandomAccess

# What a camera sees indoors lies nearer, m; larger numbers are another unit.
FARTHEST_DEPTH = 1000.0
# ARKit's confidence: 0 = low, 1 = medium, 2 = high.
LEAST_CONFIDENCE = 1


@dataclass(frozen=True)
class FrameFiles:
    """Where a frame's pictures lie, and its pose (4, 4) in the world; ``confidence`` is None where there is none."""

    index: int
    colour: Path
    depth: Path
    T_world_camera: npt.NDArray[np.float64]
    confidence: Path | None = None


class FolderRecording(RandomAccess):
    """A recording whose frames are files.

    Parameters
    ----------
    folder : Path
    camera : PinholeCamera
        Of any size: pictures of colour and of depth may be larger or smaller, with the same view.
    frames : sequence of FrameFiles
        At least one.
    skipped : sequence of int
        Indices of the frames without a pose.
    metres : float
        What one unit of a depth picture with whole numbers means, m.
    size : (int, int) or None
        Width and height of depth pictures that do not say it themselves.

    Raises
    ------
    DataError
        No frames, or the first pictures do not fit the camera.
    """

    def __init__(
        self,
        folder: Path,
        camera: PinholeCamera,
        frames: Sequence[FrameFiles],
        skipped: Sequence[int],
        metres: float,
        size: tuple[int, int] | None = None,
    ) -> None:
        if not frames:
            found = f"no frame with a pose, and {len(skipped)} without one"
            raise DataError(folder, found, "at least one posed frame", "Record or export it again.")
        self.name = folder.resolve().name
        self.skipped = tuple(skipped)
        self._frames, self._metres = tuple(frames), metres
        first = frames[0]
        self._colour_size = size_of(str(first.colour), bytes_of(first.colour))
        self.camera = resized(first.depth, camera, size or depth_size(first.depth))
        self._to_depth = ColourToDepth(str(folder), resized(first.colour, camera, self._colour_size), self.camera)

    def __len__(self) -> int:
        return len(self._frames)

    def _read(self, position: int) -> Frame:
        files = self._frames[position]
        rgb = decode_colour(str(files.colour), bytes_of(files.colour), self._colour_size)
        size = self.camera.width, self.camera.height
        depth = read_depth(files.depth, size, self._metres)
        if files.confidence is not None:
            depth[read_confidence(files.confidence, size) < LEAST_CONFIDENCE] = 0
        return Frame(files.index, self._to_depth(rgb), depth, files.T_world_camera.copy())


def depth_size(path: Path) -> tuple[int, int]:
    """Width and height of a depth picture, from its header alone, or DataError."""
    if path.suffix.lower() == ".exr":
        return exr_size(path)
    data = bytes_of(path)
    return array_size(path, data) if path.suffix.lower() == ".npy" else size_of(str(path), data)


def read_depth(path: Path, size: tuple[int, int], metres: float) -> npt.NDArray[np.float32]:
    """A depth picture of ``size`` (width, height) as (h, w) float32 m, 0 where nothing was measured.

    A 16-bit PNG or an ``.npy`` of unsigned whole numbers holds units of ``metres``; an ``.npy`` of floats, a ``.depth`` or an
    ``.exr`` holds metres, NaN and infinity for nothing.

    Raises
    ------
    DataError
        Another size or kind, negative, or so far away that it is another unit.
    """
    values = _depth_values(path, size)
    if values.dtype.kind != "f":
        return values.astype(np.float32) * np.float32(metres)
    with np.errstate(over="ignore", invalid="ignore"):
        depth = np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    if depth.min(initial=0) < 0 or depth.max(initial=0) > FARTHEST_DEPTH:
        found = f"depths of {depth.min():.6g} to {depth.max():.6g}"
        raise DataError(path, found, f"metres in 0..{FARTHEST_DEPTH:.0f}", "Convert floats to metres.")
    return depth


def _depth_values(path: Path, size: tuple[int, int]) -> npt.NDArray[Any]:
    """What a depth picture holds (h, w): floats in metres, or unsigned whole numbers."""
    shape = size[1], size[0]
    match path.suffix.lower():
        case ".npy":
            values = read_array(path, bytes_of(path), shape)
            if values.dtype.kind not in "fu":
                raise DataError(path, f"depth of type {values.dtype}", "floats in metres, or unsigned whole numbers")
            return values
        case ".depth":
            return np.frombuffer(unpack_lzfse(path, bytes_of(path), 4 * size[0] * size[1]), "<f4").reshape(shape)
        case ".exr":
            return read_exr(path, size)
        case _:
            return decode_depth(str(path), bytes_of(path), size)


def read_confidence(path: Path, size: tuple[int, int]) -> npt.NDArray[np.integer]:
    """How sure depth is (h, w), whole numbers of 0 (low) and more, from a picture, an ``.npy`` or a ``.conf``."""
    if path.suffix.lower() == ".conf":
        return np.frombuffer(unpack_lzfse(path, bytes_of(path), size[0] * size[1]), np.uint8).reshape(size[1], size[0])
    if path.suffix.lower() == ".npy":
        values = read_array(path, bytes_of(path), (size[1], size[0]))
        if values.dtype.kind not in "ui":
            raise DataError(path, f"confidence of type {values.dtype}", "whole numbers")
        return values
    return decode_colour(str(path), bytes_of(path), size)[..., 0]
