"""Pictures of recordings from bytes to arrays, and colour brought to the pixels of the depth camera."""

from __future__ import annotations

import io
import zlib
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError

MEND = "The file is damaged: fetch or export it again."
# More pixels than any camera of a recording has; also a bound for what a damaged header can ask for.
MOST_PIXELS = 1 << 26
MOST_SIDE = 1 << 14
# How many times finer or coarser colour may be than depth.
MOST_SCALE = 16.0


def size_of(source: str, data: bytes) -> tuple[int, int]:
    """Width and height of an encoded picture, from its header alone.

    Raises
    ------
    DataError
        No bytes, no picture, or an absurd size.
    """
    if not data:
        raise DataError(source, "0 bytes, an empty file", "a picture", MEND)
    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
            width, height = image.size
    except Exception as error:  # a damaged header may fail anywhere in the decoder
        raise DataError(source, f"no picture ({type(error).__name__})", "a JPEG or a PNG", MEND) from error
    check_size(source, width, height)
    return width, height


def check_size(source: str, width: int, height: int) -> None:
    """DataError where a picture would have no pixels or absurdly many."""
    if not (0 < width <= MOST_SIDE and 0 < height <= MOST_SIDE and width * height <= MOST_PIXELS):
        raise DataError(source, f"{width} x {height} pixels", "a picture of sensible size", MEND)


def decode_colour(source: str, data: bytes, size: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """A JPEG or PNG of ``size`` (width, height) as (h, w, 3) uint8, whole, or DataError."""
    pixels = _decode(source, data, size, "RGB")
    if pixels.shape != (size[1], size[0], 3) or pixels.dtype != np.uint8:
        raise DataError(source, f"pixels of shape {pixels.shape}", "8-bit colours", MEND)
    return pixels


def decode_depth(source: str, data: bytes, size: tuple[int, int]) -> npt.NDArray[np.uint16]:
    """A 16-bit PNG of ``size`` (width, height) as (h, w) uint16, whole, or DataError."""
    pixels = _decode(source, data, size, None)
    if pixels.shape != (size[1], size[0]) or not (
        pixels.dtype == np.int32 or pixels.dtype.newbyteorder("=") == np.uint16
    ):
        raise DataError(source, f"{pixels.dtype} pixels of shape {pixels.shape}", "one 16-bit channel", MEND)
    return pixels.astype(np.uint16)


def _decode(source: str, data: bytes, size: tuple[int, int], mode: str | None) -> npt.NDArray[Any]:
    found = size_of(source, data)
    if found != size:
        raise DataError(source, f"{found[0]} x {found[1]} pixels", f"{size[0]} x {size[1]}, as the other frames have")
    try:
        with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
            return np.array(image.convert(mode) if mode else image)
    except Exception as error:  # truncated or damaged pixels may fail anywhere in the decoder
        raise DataError(source, f"a picture that cannot be decoded ({error})", "a whole picture", MEND) from error


def inflate(source: str, data: bytes, size: int) -> bytes:
    """``size`` bytes from a zlib stream, never more, or DataError."""
    decoder = zlib.decompressobj()
    try:
        plain = decoder.decompress(data, size + 1)
    except zlib.error as error:
        raise DataError(source, f"depth that cannot be unpacked ({error})", "a zlib stream", MEND) from error
    if len(plain) != size or not decoder.eof:
        raise DataError(source, f"{len(plain)} bytes of depth or no end of them", f"{size} bytes", MEND)
    return plain


class ColourToDepth:
    """Resamples colour pictures to the pixels of the depth camera.

    Both cameras are taken to stand in one place, as in ScanNet's own reader (their extrinsics are identities), so that a
    depth pixel's ray needs no depth to be found in the colour picture: u_c = fx_c (u_d - cx_d) / fx_d + cx_c. The picture is
    first shrunk by area to depth's resolution, so that nothing flickers, and then sampled bilinearly. Depth pixels beyond
    the colour picture's edge are black.

    Parameters
    ----------
    source : str
        What an error names.
    colour, depth : PinholeCamera

    Raises
    ------
    DataError
        The two cameras differ too much to be of one device.
    """

    def __init__(self, source: str, colour: PinholeCamera, depth: PinholeCamera) -> None:
        scale_x, scale_y = depth.fx / colour.fx, depth.fy / colour.fy
        if not all(1 / MOST_SCALE <= scale <= MOST_SCALE for scale in (scale_x, scale_y)):
            raise DataError(
                source, f"colour and depth cameras that differ by {scale_x:.3g} x {scale_y:.3g}", "like ones"
            )
        self._size = (max(round(colour.width * min(scale_x, 1)), 1), max(round(colour.height * min(scale_y, 1)), 1))
        shrink_x, shrink_y = self._size[0] / colour.width, self._size[1] / colour.height
        u = (np.arange(depth.width) - depth.cx) / scale_x + colour.cx
        v = (np.arange(depth.height) - depth.cy) / scale_y + colour.cy
        # Shrinking keeps the picture's edges, which lie half a pixel beyond the outermost centres.
        u, v = (u + 0.5) * shrink_x - 0.5, (v + 0.5) * shrink_y - 0.5
        self._same = (colour.width, colour.height) == (depth.width, depth.height) and bool(
            np.abs(u - np.arange(depth.width)).max() < 0.01 and np.abs(v - np.arange(depth.height)).max() < 0.01
        )
        u, v = _to_edge(u, self._size[0]), _to_edge(v, self._size[1])
        self._u, self._v = np.meshgrid(u.astype(np.float32), v.astype(np.float32))

    def __call__(self, rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
        """A colour picture as the depth camera sees it, (H, W, 3) uint8."""
        if self._same:
            return rgb
        small = cv2.resize(rgb, self._size, interpolation=cv2.INTER_AREA) if self._size != rgb.shape[1::-1] else rgb
        return np.asarray(
            cv2.remap(small, self._u, self._v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT), np.uint8
        )


def _to_edge(positions: npt.NDArray[np.floating], size: int) -> npt.NDArray[np.float64]:
    """Pixel positions (N,), those in the outer half of an edge pixel at its centre and those outside far out: never half black."""
    inside = (positions >= -0.5) & (positions <= size - 0.5)
    return np.where(inside, np.clip(positions, 0, size - 1), -9.0)
