"""Pictures into a network's frame and its masks back into the picture's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating]


@dataclass(frozen=True)
class Frame:
    """Where a picture lies in the network's input, all in (height, width) or (row, column) pixels.

    Parameters
    ----------
    size : (int, int)
        Of the picture.
    network : (int, int)
        Of the network's input.
    inner : (int, int)
        Of the picture scaled into it.
    corner : (int, int)
        Where its first pixel lies in it.
    """

    size: tuple[int, int]
    network: tuple[int, int]
    inner: tuple[int, int]
    corner: tuple[int, int] = (0, 0)

    def to_picture(self, logits: Floats) -> npt.NDArray[np.float32]:
        """Logits (n, h, w), spread over the network's input at any resolution -> (n, H, W) of the picture, bilinear."""
        (height, width), (top, left) = self.inner, self.corner
        out = np.empty((len(logits), *self.size), np.float32)
        for one, low in zip(out, logits, strict=True):
            full = cv2.resize(np.float32(low), self.network[::-1], interpolation=cv2.INTER_LINEAR)
            cut = np.ascontiguousarray(full[top : top + height, left : left + width])
            cv2.resize(cut, self.size[::-1], dst=one, interpolation=cv2.INTER_LINEAR)
        return out


def check_picture(rgb: npt.NDArray[np.uint8]) -> None:
    """Raise ValueError for anything but a picture (H, W, 3) uint8 with pixels."""
    if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or 0 in rgb.shape:
        raise ValueError(f"rgb is {rgb.shape} {rgb.dtype}, expected (H, W, 3) uint8")


def runs(keys: Sequence[object], limit: int) -> list[list[int]]:
    """Indices cut into runs of equal neighbours of at most ``limit``: what may go through a network together."""
    out: list[list[int]] = []
    for i, key in enumerate(keys):
        if out and keys[out[-1][-1]] == key and len(out[-1]) < limit:
            out[-1].append(i)
        else:
            out.append([i])
    return out
