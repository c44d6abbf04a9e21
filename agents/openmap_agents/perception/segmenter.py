"""RGB, depth and gravity -> class-agnostic masks of things, without any network on the picture.

Patches (``superpixels``) are joined (``regions``) until the pairs left more likely belong to different things; regions that look
like floor, wall or ceiling are dropped, and the rest carry a score. All of it on the working picture of ``surface``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.regions import N_PAIR, Network, agglomerate, describe, region_features
from openmap_agents.perception.superpixels import superpixels
from openmap_agents.perception.surface import to_full_size, working_picture
from openmap_scenes import PinholeCamera

MIN_PIXELS_VGA = 250  # smallest mask of a 640 x 480 picture; other sizes in proportion


def _plain_network() -> Network:
    """A hand-set linear rule: gaps, creases and colour edges separate, convex edges and small size join."""
    w = np.zeros(N_PAIR)
    w[[0, 4, 5, 7, 8, 9, 10, 11]] = [-0.4, -1.5, -3.0, -1.5, 2.0, -0.8, -0.8, -0.8]
    return Network(np.stack([w, -w]), np.zeros(2), np.array([[1.0, -1.0]]), np.array([2.2]))


def _is_structure(x: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Which rows of ``region_features`` (n, 22) are floor, ceiling or wall: large, flat, and where such things are."""
    flat = np.exp(x[:, 1]) - 0.01 < 0.04
    floor = flat & (x[:, 5] > 0.9) & (x[:, 8] < 0.12)
    ceiling = flat & (x[:, 5] < -0.9) & (x[:, 7] > 1.9)
    wall = flat & (np.abs(x[:, 5]) < 0.15) & ((x[:, 10] > 1.8) | ((x[:, 19] / 5 > 0.12) & (x[:, 8] > 1.9)))
    return np.asarray(floor | ceiling | wall)


class EmbeddedSegmenter:
    """The default segmenter.

    Parameters
    ----------
    stop : float
        Probability of belonging together below which regions stay apart; lower gives larger masks.
    """

    def __init__(self, stop: float = 0.5) -> None:
        if not 0.0 < stop < 1.0:
            raise ValueError(f"stop is {stop}, expected a probability between 0 and 1")
        self.stop = stop
        self._join = _plain_network()

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of a picture; none where there is no depth, none of floors, walls and ceilings."""
        surface = working_picture(rgb, depth, T_world_camera, camera)
        patches = superpixels(surface)
        # Patches without depth have no place in the world, so they take no part.
        patches = _without(patches, surface.depth <= 0)
        if patches.max() < 0:
            return Masks(np.zeros((camera.height, camera.width), np.int32), np.zeros(0, np.float32))
        owner, joined, _ = agglomerate(describe(patches, surface), surface.floor, self._join, self.stop)
        features = region_features(joined, surface.floor, patches.size)
        smallest = MIN_PIXELS_VGA / (640 * 480) * patches.size
        keep = (joined.sums[:, 0] >= smallest) & ~_is_structure(features)
        number = np.zeros(len(keep) + 1, np.int32)
        number[1:][keep] = np.arange(1, keep.sum() + 1)
        labels = number[np.append(owner, -1)[patches] + 1]
        scores = 1.0 - 0.5 * np.minimum(joined.sums[keep, 19] / np.sqrt(joined.sums[keep, 0]), 1.0)
        return Masks(to_full_size(labels, surface.step, camera.height, camera.width), scores.astype(np.float32))


def _without(patches: npt.NDArray[np.int32], dropped: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
    """Patch numbers from 0 without gaps after the pixels of ``dropped`` have become -1."""
    kept, inverse = np.unique(np.where(dropped, -1, patches), return_inverse=True)
    shift = 1 if kept[0] == -1 else 0
    return (inverse.reshape(patches.shape) - shift).astype(np.int32)
