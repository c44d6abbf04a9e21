"""Arrays of ``.npy`` files whose header is checked before anything is read."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib import format as npy

from openmap_scenes.errors import DataError
from openmap_scenes.recordings.images import check_size

KINDS = "fiu"
LONGEST_HEADER = 4096


def array_size(path: Path, data: bytes) -> tuple[int, int]:
    """Width and height of an array (h, w), from its header, or DataError."""
    shape, _, _, _ = _header(path, data)
    if len(shape) != 2:
        raise DataError(path, f"an array of shape {shape}", "a picture (height, width)")
    check_size(str(path), shape[1], shape[0])
    return shape[1], shape[0]


def read_array(path: Path, data: bytes, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """The numbers of an ``.npy`` file of a known shape; DataError where it is cut short, of another shape, or no numbers."""
    found, fortran, dtype, start = _header(path, data)
    if found != shape:
        raise DataError(path, f"an array of shape {found}", f"shape {shape}, as the camera or the other frames have")
    expected = int(np.prod(shape)) * dtype.itemsize
    if len(data) - start != expected:
        raise DataError(path, f"{len(data) - start} bytes of numbers", f"{expected}", "Write the file again.")
    return np.frombuffer(data, dtype, offset=start).reshape(shape, order="F" if fortran else "C")


def _header(path: Path, data: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    stream = io.BytesIO(data)
    try:
        version = npy.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"version {version}")
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = read(stream, max_header_size=LONGEST_HEADER)
    except Exception as error:  # the header is a Python literal, which may fail in many ways
        found = f"no array ({type(error).__name__})"
        raise DataError(path, found, "an .npy file of numbers", "Write the file again.") from error
    if dtype.kind not in KINDS or dtype.hasobject:
        raise DataError(path, f"an array of {dtype}", "numbers")
    return tuple(int(n) for n in shape), fortran, dtype, stream.tell()
