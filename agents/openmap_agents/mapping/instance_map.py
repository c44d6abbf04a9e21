"""The map that everybody reads: instances with points, a feature and a place, in the frame the poses were given in."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class MapInstance:
    """One instance of the map.

    Parameters
    ----------
    id : int
        > 0, stable over the life of a map.
    points : (N, 3) float32 m
        Centres of its voxels.
    feature : (D,) float32 or None
        Unit vector in the encoder's space.
    n_observations : int
        In how many frames it was seen as a mask.
    confidence : float
        0..1.
    """

    id: int
    points: npt.NDArray[np.float32]
    feature: npt.NDArray[np.float32] | None
    n_observations: int = 1
    confidence: float = 1.0

    @property
    def aabb_min(self) -> npt.NDArray[np.float32]:
        return np.asarray(self.points.min(0), np.float32)

    @property
    def aabb_max(self) -> npt.NDArray[np.float32]:
        return np.asarray(self.points.max(0), np.float32)

    @property
    def centre(self) -> npt.NDArray[np.float32]:
        """Centre (3,) m of the axis-aligned box."""
        return (self.aabb_min + self.aabb_max) / np.float32(2)


@dataclass(frozen=True)
class InstanceMap:
    """All instances, ascending by id."""

    instances: list[MapInstance] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.instances)
