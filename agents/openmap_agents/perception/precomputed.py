"""Masks and features from disk, so that what CropFormer, OVSAM or any other model made elsewhere can be used and compared.

A folder of one .npz a picture; ``stored_frames`` has the format, how files are found and ``write_frame``, which writes them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.oracle import WORDS
from openmap_agents.perception.protocol import Calibration, Masks
from openmap_agents.perception.stored_frames import REMEDY, Order, StoredFrame, StoredFrames, read_frame
from openmap_scenes import DataError, PinholeCamera


class TextTower(Protocol):
    """What words go through to come into the space of the features."""

    dim: int

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32."""
        ...


class PrecomputedSegmenter:
    """Masks that were made before.

    Parameters
    ----------
    folder : path
    frames : {"picture", "order"}

    Raises
    ------
    DataError
        The folder cannot be used.
    """

    def __init__(self, folder: str | Path, frames: Order = "picture") -> None:
        self._folder = StoredFrames(folder, frames)

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """The masks of a picture, as they are stored; depth and pose are not looked at."""
        return self._folder.read(rgb).masks


class PrecomputedEncoder:
    """Features that were made before, or names, for the masks of the same files.

    Parameters
    ----------
    folder : path
    text : TextTower, optional
        In the space of the features: an encoder of the model that made them. all-MiniLM-L6-v2 (D = 384) if not given. Its
        ``calibration`` and ``encode_crops`` are taken over where it has them.
    frames : {"picture", "order"}

    Raises
    ------
    DataError
        The folder cannot be used, or its first file has neither names nor features of the text tower's length.
    """

    def __init__(self, folder: str | Path, text: TextTower | None = None, frames: Order = "picture") -> None:
        self._folder = StoredFrames(folder, frames)
        if text is None:
            from openmap_agents.perception.text import TextEncoder

            text = TextEncoder()
        self._text, self.dim = text, text.dim
        self.calibration: Calibration = getattr(text, "calibration", WORDS)
        self._encoded(read_frame(self._folder.files[0]))

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32."""
        return self._text.encode_text(texts)

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of the file's own masks; pixels of them may have been taken away since.

        Raises
        ------
        DataError
            The masks are not those of the file.
        """
        frame = self._folder.read(rgb)
        same = len(masks) == len(frame.masks) and bool(
            ((masks.labels == frame.masks.labels) | (masks.labels == 0)).all()
        )
        if not same:
            raise DataError(
                frame.path,
                f"features of {len(frame.masks)} other masks than the {len(masks)} asked for",
                "those that the segmenter gave",
                "Take the masks from the same folder: --perception precomputed:FOLDER.",
            )
        return self._encoded(frame)

    def _encoded(self, frame: StoredFrame) -> npt.NDArray[np.float32]:
        if frame.features is not None:
            if frame.features.shape[1] != self.dim:
                raise DataError(
                    frame.path,
                    f"features of {frame.features.shape[1]} values",
                    f"{self.dim}, as the text tower's",
                    "Name the text tower of the model that made them: precomputed:FOLDER?text=clip-onnx:FOLDER.",
                )
            return frame.features
        if frame.names is not None:
            return self._text.encode_text(frame.names)
        if len(frame.masks) == 0:
            return np.zeros((0, self.dim), np.float32)
        raise DataError(frame.path, "neither features nor names", "one of them, to encode masks by", REMEDY)

    def encode_crops(self, crops: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, where the text tower comes with one for pictures.

        Raises
        ------
        ValueError
            It does not.
        """
        tower = getattr(self._text, "encode_crops", None)
        if tower is None:
            raise ValueError(
                "the precomputed encoder was given crops, which no file is of; expected regions, or ?text= an encoder of pictures"
            )
        return np.asarray(tower(crops), np.float32)
