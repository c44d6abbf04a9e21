"""Texture images -> arrays, several at a time, none of them trusted."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes.errors import DataError

# Decoders that may be tried; what textures of scans come in.
IMAGE_FORMATS = ("JPEG", "PNG", "WEBP", "BMP", "TGA", "GIF")
# Above it an announced size is taken for damage, pixels (8192 x 8192).
MOST_PIXELS = 2**26
KTX2_MAGIC = b"\xabKTX 20\xbb"


@dataclass(frozen=True)
class EncodedImage:
    """An image file or the bytes of one; ``source`` is what an error names."""

    source: str
    content: Path | npt.NDArray[np.uint8]


def basis_error(source: str | Path) -> DataError:
    """The error for textures that no library at hand can decode."""
    return DataError(
        source,
        "KTX2/Basis compressed textures (KHR_texture_basisu)",
        "JPEG or PNG textures",
        "There is no well-kept decoder for Python: use the dataset's uncompressed release "
        "(HM3D: the glb archives, whose files are named <scene>.glb, instead of <scene>.basis.glb).",
    )


def decode_images(images: Sequence[EncodedImage]) -> list[npt.NDArray[np.uint8]]:
    """Every image as (h, w, 3) uint8 sRGB, row 0 on top.

    Raises
    ------
    DataError
        Truncated, of an unknown format, or absurdly large; the first one that is.
    """
    if len(images) < 2:
        return [decode_image(image) for image in images]
    with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:
        return list(pool.map(decode_image, images))


def decode_image(image: EncodedImage) -> npt.NDArray[np.uint8]:
    """One image as (h, w, 3) uint8 sRGB; raises as ``decode_images`` does."""
    try:
        data = image.content.read_bytes() if isinstance(image.content, Path) else image.content.tobytes()
        if data.startswith(KTX2_MAGIC):
            raise basis_error(image.source)
        with Image.open(io.BytesIO(data), formats=IMAGE_FORMATS) as picture:
            width, height = picture.size
            if not 0 < width * height <= MOST_PIXELS:
                raise DataError(
                    image.source,
                    f"an image of {width} x {height} pixels",
                    f"1 to {MOST_PIXELS} pixels",
                    "Scale it down.",
                )
            if picture.mode.startswith("I;16"):
                # Sixteen bits a pixel, of which the upper eight are kept.
                grey = (np.asarray(picture) >> 8).astype(np.uint8)
                return np.repeat(grey[:, :, None], 3, axis=2)
            return np.asarray(picture.convert("RGB"), np.uint8)
    except DataError:
        raise
    except Exception as error:  # a broken file may fail anywhere inside the image library
        found = f"an image that cannot be decoded ({type(error).__name__}: {str(error)[:80]})"
        raise DataError(
            image.source, found, f"an intact {', '.join(IMAGE_FORMATS)} image", "Fetch it again."
        ) from error
