"""Depth in packings that only optional libraries read: LZFSE (``.depth`` and ``.conf`` of Record3D) and OpenEXR.

Sizes are taken from headers and checked before anything is unpacked. LZFSE's are those of its reference implementation
(``lzfse_internal.h``): blocks that begin with a magic and the number of bytes that they unpack to.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.recordings.images import MEND, check_size

# Module and package of the libraries, and what to do without them.
LZFSE, EXR = ("liblzfse", "pyliblzfse"), ("OpenEXR", "OpenEXR")
ELSE = {
    ".depth": "or save what N.depth unpacks to (float32 m) as N.npy",
    ".conf": "or save what N.conf unpacks to (bytes) as N.conf.npy",
    ".exr": "or convert N.exr to N.npy (float32 m)",
}
PACKED = tuple(ELSE)
# Channels that hold depth, the likelier ones first; a file with one channel may name it as it likes.
DEPTH_CHANNELS = ("Z", "R", "Y", "depth")
MOST_CHANNELS = 8
LARGEST_UNPACKED = 1 << 30


def library_of(path: Path) -> Any:
    """The library that unpacks a file, or a DataError that says how to get it or do without."""
    module, package = EXR if path.suffix.lower() == ".exr" else LZFSE
    try:
        return import_module(module)
    except ImportError as error:
        remedy = f"Install {package} (pip install {package}), {ELSE[path.suffix.lower()]}."
        raise DataError(path, f"data that {package} unpacks", f"{package}, which is not installed", remedy) from error


def lzfse_size(path: Path, data: bytes) -> int:
    """How many bytes LZFSE data unpack to, from the headers of its blocks, or DataError."""
    at, total = 0, 0
    try:
        while data[at : at + 4] != b"bvx$":
            magic, raw = struct.unpack_from("<4sI", data, at)
            if magic == b"bvx-":
                at += 8 + raw
            elif magic == b"bvxn":
                at += 12 + struct.unpack_from("<I", data, at + 8)[0]
            elif magic == b"bvx2":
                literals, lmd, header = struct.unpack_from("<3Q", data, at + 8)
                at += (header & 0xFFFFFFFF) + (literals >> 20 & 0xFFFFF) + (lmd >> 40 & 0xFFFFF)
            else:
                raise DataError(path, f"a block {magic!r} at byte {at}", "LZFSE data", MEND)
            total += raw
            if total > LARGEST_UNPACKED:
                raise DataError(path, f"data that unpack to {total} bytes and more", "a picture of sensible size", MEND)
    except struct.error as error:
        raise DataError(path, f"LZFSE data that end in a block at byte {at}", "whole data", MEND) from error
    return total


def unpack_lzfse(path: Path, data: bytes, size: int) -> bytes:
    """The ``size`` bytes that LZFSE data unpack to, never more, or DataError."""
    found = lzfse_size(path, data)
    if found != size:
        raise DataError(path, f"data that unpack to {found} bytes", f"{size} bytes, as the size of depth has it", MEND)
    library = library_of(path)
    try:
        plain = bytes(library.decompress(data))
    except Exception as error:  # the library's own error type
        raise DataError(path, f"data that cannot be unpacked ({error})", "LZFSE data", MEND) from error
    if len(plain) != size:
        raise DataError(path, f"{len(plain)} bytes", f"{size} bytes", MEND)
    return plain


def exr_size(path: Path) -> tuple[int, int]:
    """Width and height of an EXR picture, from its header alone, or DataError."""
    header = _of_exr(path, lambda library: library.File(str(path), header_only=True).header())
    low, high = header["dataWindow"]
    width, height = (int(high[i]) - int(low[i]) + 1 for i in (0, 1))
    check_size(str(path), width, height)
    if len(header["channels"]) > MOST_CHANNELS:
        raise DataError(path, f"{len(header['channels'])} channels", "depth in one")
    return width, height


def read_exr(path: Path, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """The depth channel of an EXR picture of ``size`` (width, height) as (h, w) float32, or DataError."""
    found = exr_size(path)
    if found != size:
        raise DataError(path, f"{found[0]} x {found[1]} pixels", f"{size[0]} x {size[1]}, as the other frames have")
    channels = _of_exr(
        path,
        lambda library: {
            name: np.asarray(channel.pixels)
            for name, channel in library.File(str(path), separate_channels=True).channels().items()
        },
    )
    name = next((name for name in DEPTH_CHANNELS if name in channels), None)
    if name is None and len(channels) == 1:
        name = next(iter(channels))
    if name is None:
        raise DataError(path, f"channels {sorted(channels)}", f"one of {DEPTH_CHANNELS}")
    pixels = channels[name]
    if pixels.shape != (size[1], size[0]) or pixels.dtype.kind != "f":
        raise DataError(path, f"{pixels.dtype} pixels of shape {pixels.shape}", "floats, one a pixel")
    return np.asarray(pixels, np.float32)


def _of_exr(path: Path, read: Callable[[Any], Any]) -> Any:
    """What a function makes of the library for a picture; DataError where it cannot."""
    library = library_of(path)
    try:
        return read(library)
    except Exception as error:  # the library's own error types
        raise DataError(path, f"a picture that cannot be decoded ({error})", "an EXR picture", MEND) from error
