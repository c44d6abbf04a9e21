"""The two protocols of perception: which pixels are one thing, and what does a thing look like in the space of words.

``T_world_camera`` may be in any right-handed frame with Y up (the agent gives the episode frame): perception may use gravity
and the height above the lowest thing seen, and nothing else of the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera


@dataclass(frozen=True)
class Masks:
    """Disjoint, class-agnostic masks of one picture.

    Parameters
    ----------
    labels : (H, W) int32
        0 = no mask, 1..n = mask of that number.
    scores : (n,) float32
        How sure it is that mask i+1 is one whole thing, 0..1.
    """

    labels: npt.NDArray[np.int32]
    scores: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        """ValueError for numbers that no score goes with, or below 0: what counts pixels by them would go astray."""
        low, high = (int(f(initial=0)) for f in (self.labels.min, self.labels.max))
        if self.labels.ndim != 2 or low < 0 or high > len(self.scores):
            raise ValueError(
                f"masks with labels {self.labels.shape} of {low} to {high} and {len(self.scores)} scores, "
                "expected labels (H, W) of 0 to the number of scores"
            )

    def __len__(self) -> int:
        return len(self.scores)


class Segmenter(Protocol):
    """Picture -> masks."""

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of a picture rgb (H, W, 3) uint8 with planar depth (H, W) float32 m."""
        ...


@dataclass(frozen=True)
class Calibration:
    """What a cosine between a region and a text means: p = 1 / (1 + exp(-(slope * cosine + offset))).

    An encoder's own, so that one threshold on p means the same whatever encoder made the features.

    Parameters
    ----------
    slope, offset : float
        Platt's (Advances in Large Margin Classifiers, 1999); ``slope`` is positive.
    """

    slope: float
    offset: float

    def __call__(self, cosine: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Probabilities 0..1 that the text is a word for the region, of cosines of any shape."""
        return np.asarray(1.0 / (1.0 + np.exp(-(self.slope * np.asarray(cosine, np.float64) + self.offset))))


class Encoder(Protocol):
    """Words and regions -> one space of D dimensions, in which the cosine says how well they fit."""

    dim: int

    @property
    def calibration(self) -> Calibration:
        """What a cosine of this encoder's means."""
        ...

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32."""
        ...

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, one for each mask 1..n of the picture, in that order."""
        ...

    def encode_crops(self, crops: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of n pictures (h, w, 3) uint8, each of one thing and of any size."""
        ...
