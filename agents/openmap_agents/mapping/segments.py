"""The masks of the walk as growing columns, and what each frame was found to say about each of them.

A *segment* is a mask of a frame; every frame also has one segment, its first, for "no mask" (size 0). Segments ascend with frames.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.frame import FrameVoxels
from openmap_agents.mapping.voxel_store import grown

IntArray = npt.NDArray[np.int32]


class Segments:
    """Columns over all S segments; the properties are views of what is filled."""

    def __init__(self) -> None:
        self.n = 0
        self.n_frames = 0
        self._frame = np.empty(256, np.int32)
        self._size = np.empty(256, np.int32)
        self._label = np.empty(256, np.int32)
        self._pixels = np.empty(256, np.int32)
        self._colour = np.empty((256, 3), np.float32)
        self._features = np.zeros((256, 1), np.float32)
        self._voxel_start = np.zeros(257, np.int64)
        self._voxels = np.empty(1 << 15, np.int32)
        self._call: list[int] = []
        self.dim: int | None = None

    @property
    def frame(self) -> IntArray:
        """(S,) number of the frame among those that were used."""
        return self._frame[: self.n]

    @property
    def size(self) -> IntArray:
        """(S,) voxels, |P_k|; 0 for "no mask"."""
        return self._size[: self.n]

    @property
    def label(self) -> IntArray:
        """(S,) label in the frame's mask picture."""
        return self._label[: self.n]

    @property
    def pixels(self) -> IntArray:
        """(S,) pixels of the mask."""
        return self._pixels[: self.n]

    @property
    def colour(self) -> npt.NDArray[np.float32]:
        """(S, 3) mean RGB 0..255; NaN where no picture was given."""
        return self._colour[: self.n]

    @property
    def features(self) -> npt.NDArray[np.float32]:
        """(S, D) unit features; zeros = none."""
        return self._features[: self.n]

    def voxels(self, segment: int) -> IntArray:
        """Voxel numbers of a segment."""
        return self._voxels[self._voxel_start[segment] : self._voxel_start[segment + 1]]

    def call(self, frame: int) -> int:
        """Which call of ``integrate`` a frame was."""
        return self._call[frame]

    def add_frame(
        self,
        voxels: FrameVoxels,
        numbers: IntArray,
        features: npt.NDArray[np.float32] | None,
        colour: npt.NDArray[np.float32] | None,
        call: int,
    ) -> None:
        """Append a frame's segments; ``numbers`` are the voxel numbers of ``voxels.keys``, ``features`` one row a label."""
        n_masks, base = len(voxels.labels), self.n
        end = base + 1 + n_masks
        for name in ("_frame", "_size", "_label", "_pixels", "_colour"):
            setattr(self, name, grown(getattr(self, name), end))
        self._voxel_start = grown(self._voxel_start, end + 1)
        if features is not None and self.dim is None:
            self.dim = features.shape[1]
            self._features = np.zeros((max(256, end), self.dim), np.float32)
        self._features = grown(self._features, end)
        self._frame[base:end] = self.n_frames
        for column, values in (("_size", voxels.sizes), ("_label", voxels.labels), ("_pixels", voxels.pixels)):
            getattr(self, column)[base] = 0
            getattr(self, column)[base + 1 : end] = values
        self._colour[base:end] = np.nan
        if colour is not None:
            self._colour[base + 1 : end] = colour[voxels.labels]
        if features is not None:
            self._features[base + 1 : end] = features[voxels.labels - 1]
        order = np.argsort(voxels.mask, kind="stable")
        order = order[voxels.mask[order] > 0]
        start = int(self._voxel_start[base])
        self._voxels = grown(self._voxels, start + len(order))
        self._voxels[start : start + len(order)] = numbers[order]
        self._voxel_start[base + 1] = start
        self._voxel_start[base + 2 : end + 1] = start + np.cumsum(voxels.sizes)
        self.n, self.n_frames = end, self.n_frames + 1
        self._call.append(call)


class Columns:
    """Growing columns of numbers, three abreast."""

    def __init__(self) -> None:
        self.n = 0
        self._columns = [np.empty(1024, np.int32) for _ in range(3)]

    def add(self, a: IntArray, b: IntArray, c: IntArray) -> None:
        """Append rows."""
        end = self.n + len(a)
        for k, values in enumerate((a, b, c)):
            column = grown(self._columns[k], end)
            column[self.n : end] = values
            self._columns[k] = column
        self.n = end

    @property
    def columns(self) -> tuple[IntArray, IntArray, IntArray]:
        """Each (n,)."""
        a, b, c = self._columns
        return a[: self.n], b[: self.n], c[: self.n]
