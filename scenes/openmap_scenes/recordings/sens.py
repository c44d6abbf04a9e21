"""ScanNet's ``.sens`` files, version 4: all frames of a recording in one file, read one at a time.

Layout, little-endian (ScanNet's ``sensorData.h``): version u32, name (u64 length, bytes), intrinsics and extrinsics of colour and
of depth (4 matrices of 16 f32), compression of colour and of depth (i32), width and height of colour and of depth (u32),
depth shift f32 (depth units a metre), number of frames u64; a frame: camera-to-scan 16 f32, two times u64, bytes of colour and of
depth (u64), colour, depth. What follows the frames (inertial measurements) is not read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.recordings.images import ColourToDepth, check_size, decode_colour, inflate
from openmap_scenes.recordings.poses import T_world_camera, camera_of, find_T_world_scan, is_lost
from openmap_scenes.recordings.recording import Frame, RandomAccess

VERSION = 4
LONGEST_NAME = 4096
CALIBRATION = struct.Struct("<64f2i4IfQ")
FRAME = struct.Struct("<16f4Q")
COLOURS = {0: "raw", 1: "png", 2: "jpeg"}
DEPTHS = {0: "raw_ushort", 1: "zlib_ushort"}
MEND = "Fetch the file again, or open it leniently for the frames before."


@dataclass(frozen=True)
class _Header:
    colour: PinholeCamera
    depth: PinholeCamera
    colour_compression: str
    depth_compression: str
    units_per_metre: float
    frames: int
    end: int


@dataclass(frozen=True)
class _Entry:
    """Where a frame's pictures lie: byte of the colour, bytes of both; its pose in the world, None = lost."""

    number: int
    at: int
    colour_bytes: int
    depth_bytes: int
    pose: npt.NDArray[np.float64] | None


class SensRecording(RandomAccess):
    """The recording in a ``.sens`` file; ``<scan>.txt`` beside it gives the alignment.

    Opening goes from frame to frame by their lengths and reads poses, no pictures.

    Parameters
    ----------
    path : str or Path
    lenient : bool
        Give the whole frames of a file that was cut short, instead of an error.

    Raises
    ------
    DataError
        Not a ``.sens`` file of version 4, a compression that is not known, cut short, or a pose that is none.
    """

    def __init__(self, path: str | Path, *, lenient: bool = False) -> None:
        self._path = Path(path)
        if not self._path.is_file():
            raise DataError(path, "no such file", "a .sens file")
        self.name = self._path.stem
        folder = self._path.resolve().parent
        T_world_scan = find_T_world_scan(folder, (self.name, folder.name))
        with self._path.open("rb") as file:
            size = self._path.stat().st_size
            self._header = _read_header(self._path, file, size)
            entries = list(_index(self._path, file, self._header, size, T_world_scan, lenient))
        self.camera = self._header.depth
        self._to_depth = ColourToDepth(str(path), self._header.colour, self.camera)
        self._entries = [e for e in entries if e.pose is not None]
        self.skipped = tuple(e.number for e in entries if e.pose is None)

    def __len__(self) -> int:
        return len(self._entries)

    def _read(self, position: int) -> Frame:
        entry = self._entries[position]
        with self._path.open("rb") as file:
            file.seek(entry.at)
            colour, depth = file.read(entry.colour_bytes), file.read(entry.depth_bytes)
        assert entry.pose is not None
        source = f"{self._path} frame {entry.number}"
        return Frame(
            entry.number,
            self._to_depth(self._colour(f"{source} colour", colour)),
            self._depth(f"{source} depth", depth),
            entry.pose.copy(),
        )

    def _colour(self, source: str, data: bytes) -> npt.NDArray[np.uint8]:
        width, height = self._header.colour.width, self._header.colour.height
        if self._header.colour_compression != "raw":
            return decode_colour(source, data, (width, height))
        if len(data) != width * height * 3:
            raise DataError(source, f"{len(data)} bytes of colour", f"{width * height * 3}", MEND)
        return np.frombuffer(data, np.uint8).reshape(height, width, 3)

    def _depth(self, source: str, data: bytes) -> npt.NDArray[np.float32]:
        size = self.camera.width * self.camera.height * 2
        if self._header.depth_compression == "zlib_ushort":
            data = inflate(source, data, size)
        if len(data) != size:
            raise DataError(source, f"{len(data)} bytes of depth", f"{size}", MEND)
        units = np.frombuffer(data, "<u2").reshape(self.camera.height, self.camera.width)
        return units.astype(np.float32) / np.float32(self._header.units_per_metre)


def _read_header(path: Path, file: BinaryIO, size: int) -> _Header:
    start = file.read(12)
    if len(start) < 12:
        raise DataError(path, f"{size} bytes", "a .sens file", "The file is damaged: fetch it again.")
    version, name_length = struct.unpack("<IQ", start)
    if version != VERSION or name_length > LONGEST_NAME:
        raise DataError(
            path, f"version {version} and a name of {name_length} bytes", f"a .sens file, version {VERSION}"
        )
    file.seek(name_length, 1)
    data = file.read(CALIBRATION.size)
    if len(data) < CALIBRATION.size:
        raise DataError(path, f"{size} bytes, the header cut short", "a .sens file", "Fetch the file again.")
    values = CALIBRATION.unpack(data)
    matrices = np.array(values[:64], np.float64).reshape(4, 4, 4)
    colour_compression, depth_compression = values[64:66]
    colour_size, depth_size = values[66:68], values[68:70]
    if colour_compression not in COLOURS:
        raise DataError(path, f"colour compression {colour_compression}", f"one of {COLOURS}")
    if depth_compression not in DEPTHS:
        found = (
            "depth compression 2 (occi_ushort)" if depth_compression == 2 else f"depth compression {depth_compression}"
        )
        remedy = "Export the recording with ScanNet's SensReader and open the folder."
        raise DataError(path, found, f"one of {DEPTHS}", remedy)
    for width, height in (colour_size, depth_size):
        check_size(str(path), width, height)
    if not 1e-3 <= values[70] <= 1e6:
        raise DataError(path, f"a depth shift of {values[70]}", "depth units a metre, usually 1000")
    return _Header(
        camera_of(f"{path} colour", matrices[0], colour_size),
        camera_of(f"{path} depth", matrices[2], depth_size),
        COLOURS[colour_compression],
        DEPTHS[depth_compression],
        float(values[70]),
        int(values[71]),
        file.tell(),
    )


def _index(
    path: Path, file: BinaryIO, header: _Header, size: int, T_world_scan: npt.NDArray[np.float64], lenient: bool
) -> Iterator[_Entry]:
    """Where each frame lies; DataError, or an early end where ``lenient``, where the file ends too soon."""
    at = header.end
    for number in range(header.frames):
        file.seek(at)
        data = file.read(FRAME.size)
        values = FRAME.unpack(data) if len(data) == FRAME.size else (0,) * 18 + (size, size)
        colour_bytes, depth_bytes = values[18:20]
        at += FRAME.size
        if at + colour_bytes + depth_bytes > size:
            if lenient:
                return
            found = f"a file that is truncated in frame {number} of {header.frames} (counted from 0)"
            raise DataError(path, found, f"{header.frames} whole frames", MEND)
        pose = np.array(values[:16], np.float64).reshape(4, 4)
        in_world = None if is_lost(pose) else T_world_camera(path, number, pose, T_world_scan)
        yield _Entry(number, at, colour_bytes, depth_bytes, in_world)
        at += colour_bytes + depth_bytes
