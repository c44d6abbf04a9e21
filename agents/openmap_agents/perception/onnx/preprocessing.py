"""Pictures -> what an image tower takes, as the model's own ``preprocessor_config.json`` (transformers) says.

Resize with Pillow, centre crop, rescale, normalise, pad: the same steps in the same order as the image processors of transformers
(a test holds the two together). open_clip's ``preprocess_cfg`` is read too and says the same in other words.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes import DataError

_REMEDY = "Copy the preprocessor's configuration again from where the model was published."
_CLIP_MEAN, _CLIP_STD = (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
_RESAMPLING = {
    "nearest": Image.Resampling.NEAREST,
    "bilinear": Image.Resampling.BILINEAR,
    "bicubic": Image.Resampling.BICUBIC,
    "lanczos": Image.Resampling.LANCZOS,
}


@dataclass(frozen=True)
class Preprocessing:
    """The way from a picture to an input (3, h, w) float32 of one size.

    Parameters
    ----------
    mode : {"shortest", "exact", "longest", "none"}
        Whether the shorter edge becomes ``size``'s, both do, the longer one does, or the picture stays as large as it is.
    size : (int, int)
        (h, w); for "shortest" and "longest" the two are equal.
    resample : Image.Resampling
    crop : (int, int), optional
        Of the middle, (h, w), after the resize; what is too small is padded with zeros.
    scale : float
        What bytes are multiplied with.
    mean, std : (float, float, float)
    pad : (int, int), optional
        Grow to (h, w) at last, with zeros below and on the right.
    fill : int
        Byte around a picture of mode "longest".
    half_to_even : bool
        Which row an odd crop begins at: Python's ``round`` as in torchvision, instead of the one above as in transformers.
    """

    mode: str = "shortest"
    size: tuple[int, int] = (224, 224)
    resample: Image.Resampling = Image.Resampling.BICUBIC
    crop: tuple[int, int] | None = (224, 224)
    scale: float = 1 / 255
    mean: tuple[float, ...] = _CLIP_MEAN
    std: tuple[float, ...] = _CLIP_STD
    pad: tuple[int, int] | None = None
    fill: int = 0
    half_to_even: bool = False

    @property
    def output(self) -> tuple[int, int] | None:
        """The size (h, w) that every picture comes to; None where it depends on the picture."""
        if self.pad is not None:
            return self.pad
        if self.crop is not None:
            return self.crop
        return self.size if self.mode in ("exact", "longest") else None

    def __call__(self, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Inputs (n, 3, h, w) float32 of n >= 1 pictures (h_i, w_i, 3) uint8."""
        return np.stack([self._one(picture) for picture in pictures])

    def whole(self, picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Input (1, 3, h, w) float32 with all of the picture in it, squashed to the output's size: nothing is cut off or padded."""
        assert self.output is not None
        return self._values(_resized(picture, self.output, self.resample))[None]

    def _one(self, picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        pixels = _resized(picture, self._target(*picture.shape[:2]), self.resample)
        if self.mode == "longest":
            pixels = _centred(pixels, self.size, self.fill, self.half_to_even)
        if self.crop is not None:
            pixels = _centred(pixels, self.crop, 0, self.half_to_even)
        values = self._values(pixels)
        if self.pad is not None:
            grow = [(0, 0), *((0, want - have) for want, have in zip(self.pad, values.shape[1:], strict=True))]
            values = np.pad(values, grow)
        return values

    def _target(self, height: int, width: int) -> tuple[int, int]:
        """What a picture of that size is resized to."""
        if self.mode == "none":
            return height, width
        if self.mode == "exact":
            return self.size
        edge = self.size[0]
        if self.mode == "shortest":
            short, long = min(height, width), max(height, width)
            other = int(edge * long / short)
            return (edge, other) if height <= width else (other, edge)
        ratio = max(height, width) / edge
        return max(1, round(height / ratio)), max(1, round(width / ratio))

    def _values(self, pixels: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        rescaled = (pixels.astype(np.float64) * self.scale).astype(np.float32)
        values = (rescaled - np.array(self.mean, np.float32)) / np.array(self.std, np.float32)
        return np.ascontiguousarray(values.transpose(2, 0, 1))


def _resized(
    picture: npt.NDArray[np.uint8], size: tuple[int, int], resample: Image.Resampling
) -> npt.NDArray[np.uint8]:
    return np.asarray(Image.fromarray(picture).resize((size[1], size[0]), resample))


def _centred(
    pixels: npt.NDArray[np.uint8], size: tuple[int, int], fill: int, half_to_even: bool
) -> npt.NDArray[np.uint8]:
    """The middle (h, w) of a picture (height, width, 3); what is missing is ``fill``."""
    out = np.full((*size, 3), fill, np.uint8)
    kept, filled = [], []
    for have, want in zip(pixels.shape[:2], size, strict=True):
        start = max(round((have - want) / 2) if half_to_even else (have - want) // 2, 0)
        # torchvision leaves the odd row that is missing below, transformers above.
        at = max((want - have + (0 if half_to_even else 1)) // 2, 0)
        kept.append(slice(start, start + min(have, want)))
        filled.append(slice(at, at + min(have, want)))
    out[filled[0], filled[1]] = pixels[kept[0], kept[1]]
    return out


def from_transformers(config: Mapping[str, Any], path: Path, *, siglip: bool) -> Preprocessing:
    """What a ``preprocessor_config.json`` says; what it leaves out is as in that model's image processor.

    Parameters
    ----------
    config : mapping
    path : Path
        For the errors.
    siglip : bool
        The kind of a file that does not name its image processor: SigLIP's (a size of one number means a square, nothing is
        cropped, colours are -1..1) instead of CLIP's (the shorter edge, the middle, colours of mean 0 and variance 1).

    Raises
    ------
    DataError
        A value that is no size, or a way that is not known here.
    """
    name = config.get("image_processor_type", config.get("feature_extractor_type"))
    kinds = {None: siglip, "CLIPFeatureExtractor": False}
    for suffix in ("", "Fast", "Pil"):
        kinds |= {f"CLIPImageProcessor{suffix}": False, f"SiglipImageProcessor{suffix}": True}
    if name not in kinds:
        expected = "CLIPImageProcessor or SiglipImageProcessor"
        raise DataError(
            path, f"image_processor_type {name!r}", expected, "Other ways of preparing a picture are not known."
        )
    square = kinds[name]
    standard = (0.5, 0.5, 0.5)
    mode, size = _size(config.get("size", 224), path, "size", square)
    if not config.get("do_resize", True):
        mode = "none"
    crop = None
    if config.get("do_center_crop", not square):
        _, crop = _size(config.get("crop_size", 224), path, "crop_size", True)
    pad = None
    if config.get("do_pad") and config.get("pad_size") is not None:
        _, pad = _size(config["pad_size"], path, "pad_size", True)
    normal = config.get("do_normalize", True)
    scale = float(_number(config.get("rescale_factor", 1 / 255), path, "rescale_factor"))
    resample = config.get("resample", 3)
    if resample not in list(Image.Resampling):
        raise DataError(path, f"resample {resample!r}", "one of Pillow's filters, 0 to 5", _REMEDY)
    return _checked(
        Preprocessing(
            mode,
            size,
            Image.Resampling(resample),
            crop,
            scale if config.get("do_rescale", True) else 1.0,
            _colour(config, "image_mean", standard if square else _CLIP_MEAN, path) if normal else (0.0, 0.0, 0.0),
            _colour(config, "image_std", standard if square else _CLIP_STD, path) if normal else (1.0, 1.0, 1.0),
            pad,
        ),
        path,
    )


def from_open_clip(config: Mapping[str, Any], path: Path, default: int | tuple[int, int] = 224) -> Preprocessing:
    """What the ``preprocess_cfg`` of an ``open_clip_config.json`` says; ``default`` is the tower's own picture size.

    Raises
    ------
    DataError
        A value that is no size, or a way that is not known here.
    """
    _, size = _size(config.get("size", default), path, "size", True)
    modes = {"shortest": "shortest", "squash": "exact", "longest": "longest"}
    mode, filter_name = config.get("resize_mode", "shortest"), config.get("interpolation", "bicubic")
    if mode not in modes or filter_name not in _RESAMPLING:
        raise DataError(
            path,
            f"resize_mode {mode!r} with interpolation {filter_name!r}",
            f"one of {', '.join(modes)} with one of {', '.join(_RESAMPLING)}",
            _REMEDY,
        )
    if mode != "squash" and size[0] != size[1]:
        raise DataError(path, f"resize_mode {mode!r} to {size[0]} x {size[1]}", "a square", _REMEDY)
    return _checked(
        Preprocessing(
            modes[mode],
            size,
            _RESAMPLING[filter_name],
            size if mode == "shortest" else None,
            mean=_colour(config, "mean", _CLIP_MEAN, path),
            std=_colour(config, "std", _CLIP_STD, path),
            fill=int(_number(config.get("fill_color", 0), path, "fill_color")),
            half_to_even=True,
        ),
        path,
    )


def _checked(preprocessing: Preprocessing, path: Path) -> Preprocessing:
    if preprocessing.output is None:
        raise DataError(path, f"resize {preprocessing.mode!r} without a crop", "pictures that end in one size", _REMEDY)
    if 0.0 in preprocessing.std or preprocessing.scale <= 0.0:
        raise DataError(path, "a std or rescale factor of zero", "positive numbers", _REMEDY)
    return preprocessing


def _size(value: object, path: Path, name: str, square: bool) -> tuple[str, tuple[int, int]]:
    """Mode and (h, w) of what transformers and open_clip write: a number, a pair, {"shortest_edge"}, {"height", "width"}."""
    pair: object = None
    mode = "exact"
    if isinstance(value, int):
        mode, pair = "exact" if square else "shortest", (value, value)
    elif isinstance(value, list | tuple):
        pair = tuple(value)
    elif isinstance(value, Mapping) and "height" in value and "width" in value:
        pair = (value["height"], value["width"])
    elif isinstance(value, Mapping) and "shortest_edge" in value and not value.get("longest_edge"):
        mode, pair = "shortest", (value["shortest_edge"],) * 2
    if not (isinstance(pair, tuple) and len(pair) == 2 and all(type(n) is int and 1 <= n <= 8192 for n in pair)):
        raise DataError(path, f"{name} {value!r}", "a number, a height and a width, or a shortest edge", _REMEDY)
    return mode, pair


def _number(value: object, path: Path, name: str) -> int | float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise DataError(path, f"{name} {value!r}", "a finite number", _REMEDY)
    return value


def _colour(config: Mapping[str, Any], name: str, default: tuple[float, ...], path: Path) -> tuple[float, ...]:
    value = config.get(name, default)
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise DataError(path, f"{name} {value!r}", "three numbers, of red, green and blue", _REMEDY)
    return tuple(float(_number(v, path, name)) for v in value)
