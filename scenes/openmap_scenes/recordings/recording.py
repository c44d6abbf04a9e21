"""What a recording is: a sequence of posed RGB-D frames, read one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera


@dataclass(frozen=True)
class Frame:
    """One picture of a recording.

    Parameters
    ----------
    index : int
        Its number in the source.
    rgb : (H, W, 3) uint8
        As large as the depth: resampled to the depth camera's pixels where the source has another size.
    depth : (H, W) float32 m
        Planar, 0 = no reading.
    T_world_camera : (4, 4) float64
        World frame (Y up); OpenGL camera axes (x right, y up, looking along -z).
    """

    index: int
    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    T_world_camera: npt.NDArray[np.float64]


class Recording(Protocol):
    """A posed RGB-D sequence.

    Frames whose tracking was lost by the source's own mark are left out and listed in ``skipped``; anything else that is wrong
    raises ``DataError`` with the file, when the recording is opened where that is cheap and else when the frame is read.
    """

    @property
    def name(self) -> str: ...

    @property
    def camera(self) -> PinholeCamera:
        """The depth camera, which all frames share."""
        ...

    @property
    def skipped(self) -> tuple[int, ...]:
        """Indices of the frames without a pose."""
        ...

    def __len__(self) -> int:
        """How many frames it gives."""
        ...

    def __iter__(self) -> Iterator[Frame]: ...
