"""Another method's 3-D instances, Mask3D's say, as the masks of each picture, so that they can be encoded and mapped as any other.

A pixel takes the instance of the cloud's point that is nearest to where it is seen. Where instances overlap the surer one has the
point. This wants poses in the frame of the cloud: recordings have them, episodes of the environment do not.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_agents.perception.cloud_files import read_points, scan_name
from openmap_agents.perception.prediction_format import PredictedInstance, list_scans, read_predictions
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

REACH = 0.05
"""How far from a pixel's place its point may be, m: twice the spacing of a ScanNet mesh."""
CELL = 0.01
"""Pixels are looked up by the centres of cells of this edge, m, so that near things are not looked up pixel by pixel."""
_FEWEST_PIXELS = 25


class ProposalSegmenter:
    """Masks from a folder in the benchmark's prediction format (``prediction_format``).

    Parameters
    ----------
    folder : path
    cloud : path
        The points that the masks are of (``cloud_files``). Where the folder has several scans, the cloud's name says which.

    Raises
    ------
    DataError
        The files cannot be used.
    """

    def __init__(self, folder: str | Path, cloud: str | Path) -> None:
        points = read_points(cloud)
        found = read_predictions(folder, _scan_of(folder, cloud), len(points), any_label=True)
        self._scores = np.clip(np.array([p.confidence for p in found], np.float32), 0.0, 1.0)
        self._owner = owner_of_points(found, len(points))
        self._tree = cKDTree(points)
        self._low, self._high = points.min(0) - REACH, points.max(0) + REACH

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """The instances that are seen, in the order of the file; the colours are not looked at."""
        seen = (depth > 0) & np.isfinite(depth)
        T = np.asarray(T_world_camera, np.float64)
        places = (camera.rays()[seen] * depth[seen][:, None]).astype(np.float64) @ T[:3, :3].T + T[:3, 3]
        picture = np.full(depth.shape, -1, np.int32)
        picture[seen] = self._instance_at(places)
        pixels = np.bincount(picture[seen] + 1, minlength=1 + len(self._scores))[1:]
        shown = np.flatnonzero(pixels >= _FEWEST_PIXELS)
        number = np.zeros(2 + len(self._scores), np.int32)
        number[shown] = np.arange(1, len(shown) + 1)
        return Masks(number[picture], self._scores[shown])

    def _instance_at(self, places: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
        """Index of the instance at each place (n, 3) m, -1 = none."""
        found = np.full(len(places), -1, np.int32)
        inside = ((places >= self._low) & (places <= self._high)).all(1)
        cells = np.floor((places[inside] - self._low) / CELL).astype(np.int64)
        shape = tuple((np.floor((self._high - self._low) / CELL).astype(int) + 1).tolist())
        keys, inverse = np.unique(np.ravel_multi_index(tuple(cells.T), shape), return_inverse=True)
        centres = (np.stack(np.unravel_index(keys, shape), axis=1) + 0.5) * CELL + self._low
        _, nearest = self._tree.query(centres, distance_upper_bound=REACH)
        found[inside] = np.append(self._owner, np.int32(-1))[nearest][inverse]
        return found


def owner_of_points(found: list[PredictedInstance], n_points: int) -> npt.NDArray[np.int32]:
    """Index (N,) int32 of the surest instance that has each point, of equally sure ones the first; -1 = none."""
    owner = np.full(n_points, -1, np.int32)
    for k in sorted(range(len(found)), key=lambda k: (found[k].confidence, -k)):
        owner[found[k].indices] = k
    return owner


def _scan_of(folder: str | Path, cloud: str | Path) -> str:
    scans, own = list_scans(folder), scan_name(cloud)
    if own in scans:
        return own
    if len(scans) > 1:
        raise DataError(folder, f"{len(scans)} scans, none called {own}", f"{own}.txt, as the cloud {Path(cloud).name}")
    return scans[0]
