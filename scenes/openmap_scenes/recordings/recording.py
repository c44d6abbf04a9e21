"""What a recording is: a sequence of posed RGB-D frames, read one at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
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

    def frame(self, position: int) -> Frame:
        """The frame at a position in 0..len - 1, read now and no other one; IndexError beyond."""
        ...


class RandomAccess(ABC):
    """Gives frames in turn and by position, from a method that reads the one at a position."""

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def _read(self, position: int) -> Frame:
        """The frame at a position that is there."""

    def frame(self, position: int) -> Frame:
        """The frame at a position in 0..len - 1, read now and no other one; IndexError beyond."""
        if not 0 <= position < len(self):
            raise IndexError(f"frame {position} of a recording of {len(self)}, expected 0..{len(self) - 1}")
        return self._read(position)

    def __iter__(self) -> Iterator[Frame]:
        return (self._read(position) for position in range(len(self)))


class _Part(RandomAccess):
    def __init__(self, recording: Recording, positions: range) -> None:
        self._recording, self._positions = recording, positions
        self.name, self.camera, self.skipped = recording.name, recording.camera, recording.skipped

    def __len__(self) -> int:
        return len(self._positions)

    def _read(self, position: int) -> Frame:
        return self._recording.frame(self._positions[position])


def subsampled(recording: Recording, every: int = 1, first: int = 0, last: int | None = None) -> Recording:
    """A part of a recording: the frames at positions first, first + every, ... up to and with ``last``.

    What is left out is not read. ``skipped`` stays that of the whole recording.

    Parameters
    ----------
    recording : Recording
    every : int
        1 = each frame.
    first, last : int
        Positions among the frames that have a pose, 0 the first; None = to the end.

    Raises
    ------
    ValueError
        ``every`` is less than 1, or ``first`` or ``last`` is negative.
    """
    if every < 1 or first < 0 or (last is not None and last < 0):
        raise ValueError(f"every={every}, first={first}, last={last}; expected every >= 1, first and last >= 0")
    end = len(recording) if last is None else min(last + 1, len(recording))
    return _Part(recording, range(first, end, every))
