"""Textures of a scene, packed into as few texture arrays as can be, so that what is drawn front to back need not be torn apart.

All layers of a texture array have one size. A picture smaller than its layer is repeated to fill it, and texture coordinates
shrink alike: the texels that a sampler sees, wrapped and on every mipmap level down to the picture's last, are the same as those of
the picture alone. Repetition takes sides that are powers of two; other pictures are resampled to the next one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes import Scene

Picture = npt.NDArray[np.uint8]

MAX_LAYERS = 256
"""OpenGL 3.3 promises no more layers an array."""
MAX_TEXELS = 1 << 26
"""Mesa refuses single textures beyond a gigabyte."""
SPARE_TEXELS = 4 << 20
"""So many texels may be spent on filling larger layers with smaller pictures."""
_WHITE: Picture = np.full((1, 1, 3), 255, np.uint8)


@dataclass(frozen=True)
class TexturePlan:
    """Where the texture of each of M materials lies.

    Parameters
    ----------
    group : (M,) int64
        Texture array.
    layer : (M,) int32
        Layer in it.
    scale : (M, 2) float32
        What texture coordinates (u, v) are multiplied with.
    sizes : list of (height, width)
        Of the layers of each array.
    pictures : list of list of (h, w, 3) uint8
        The pictures of each array, layer by layer, as the scene has them.
    """

    group: npt.NDArray[np.int64]
    layer: npt.NDArray[np.int32]
    scale: npt.NDArray[np.float32]
    sizes: list[tuple[int, int]]
    pictures: list[list[Picture]]

    def layer_pixels(self, group: int, layer: int) -> Picture:
        """The (H, W, 4) uint8 texels of a layer: its picture, resampled where need be, and repeated."""
        (h, w), picture = self.sizes[group], self.pictures[group][layer]
        picture = resampled(picture, _power_of_two(picture.shape[0]), _power_of_two(picture.shape[1]))
        rgba = np.full((h, w, 4), 255, np.uint8)
        rgba[..., :3] = np.tile(picture, (h // picture.shape[0], w // picture.shape[1], 1))
        return rgba


def plan_textures(scene: Scene) -> TexturePlan:
    """Pack the textures of a scene's materials; materials without one share a white layer, and pictures met twice are held once."""
    pictures, picture_of = _distinct(
        [_WHITE if m.texture is None or scene.uv is None else m.texture for m in scene.materials]
    )
    powers = [(_power_of_two(p.shape[0]), _power_of_two(p.shape[1])) for p in pictures]
    sizes = _layer_sizes(powers)
    group_of, layer_of = np.zeros(len(pictures), np.int64), np.zeros(len(pictures), np.int32)
    group_sizes: list[tuple[int, int]] = []
    grouped: list[list[Picture]] = []
    for size in sorted(set(sizes)):
        members = [p for p in range(len(pictures)) if sizes[p] == size]
        capacity = max(1, min(MAX_LAYERS, MAX_TEXELS // (size[0] * size[1])))
        for first in range(0, len(members), capacity):
            part = members[first : first + capacity]
            group_of[part], layer_of[part] = len(grouped), np.arange(len(part))
            group_sizes.append(size)
            grouped.append([pictures[p] for p in part])
    scales = np.array([[w / sizes[p][1], h / sizes[p][0]] for p, (h, w) in enumerate(powers)], np.float32)
    return TexturePlan(group_of[picture_of], layer_of[picture_of], scales[picture_of], group_sizes, grouped)


def _distinct(pictures: list[Picture]) -> tuple[list[Picture], npt.NDArray[np.int64]]:
    """Each picture once, and for each given picture which of them it is."""
    known: dict[tuple[Any, ...], int] = {}
    kept: list[Picture] = []
    which = np.zeros(len(pictures), np.int64)
    for index, picture in enumerate(pictures):
        # Most repeats are one array in several materials; comparing pixels as well would read every page of a large scan.
        key = (picture.shape, picture.__array_interface__["data"][0], picture.strides)
        if key not in known:
            known[key] = len(kept)
            kept.append(picture)
        which[index] = known[key]
    return kept, which


def _layer_sizes(powers: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The size of the layer of each picture: squares at first, small ones then moved to the next larger size that is in use."""
    sides = np.array([max(size) for size in powers])
    spare = SPARE_TEXELS
    for side in sorted(set(sides.tolist()))[:-1]:
        members = sides == side
        larger = int(sides[sides > side].min())
        cost = int(members.sum()) * (larger**2 - side**2)
        if cost <= spare:
            spare -= cost
            sides[members] = larger
    # What stays alone in its size needs no square.
    return [
        powers[p] if np.all([powers[q] == powers[p] for q in np.flatnonzero(sides == side)]) else (int(side), int(side))
        for p, side in enumerate(sides)
    ]


def _power_of_two(n: int) -> int:
    """The smallest power of two that is at least n."""
    return 1 << (n - 1).bit_length()


def resampled(picture: Picture, height: int, width: int) -> Picture:
    """A repeating picture (h, w, 3) at another size, linearly interpolated, its edges meeting those across."""
    if picture.shape[:2] == (height, width):
        return picture
    out = picture.astype(np.float32)
    for axis, size in ((0, height), (1, width)):
        n = out.shape[axis]
        place = (np.arange(size) + 0.5) * n / size - 0.5
        first = np.floor(place).astype(np.int64)
        share = (place - first).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        out = (1.0 - share) * out.take(first % n, axis) + share * out.take((first + 1) % n, axis)
    return np.asarray(np.round(out), np.uint8)
