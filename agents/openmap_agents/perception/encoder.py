"""The default encoder: what a region looks like and how it is shaped, as a place in the space of words.

Three opinions are fused late: a head trained on looks and shape, one trained on shape alone, and ConSE, which was not trained on
homes and knows a thousand other things. Each is a unit vector f_b in the text encoder's space, from which the mean of the names of
household things has been taken: what all words of a home have in common says nothing. A region's feature is their concatenation
with weights, [sqrt(w_b) f_b], a text's is [sqrt(w_b) t]; so one cosine is the weighted mean of the three cosines.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import CHANNELS, N_FEATURES, Backbone, pool_regions
from openmap_agents.perception.conse import Conse, unit
from openmap_agents.perception.heads import load_heads
from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.shape import N_SHAPE, shape_features
from openmap_agents.perception.surface import check_picture, working_picture
from openmap_agents.perception.text import TextEncoder
from openmap_agents.perception.weights import FOLDER
from openmap_scenes import PinholeCamera

N_DESCRIPTION = N_FEATURES + N_SHAPE
WEIGHTS = {"looks": 1.0, "shape": 0.8, "conse": 0.4}
_SCALES = np.sqrt(np.array(list(WEIGHTS.values())) / sum(WEIGHTS.values())).astype(np.float32)


class EmbeddedEncoder:
    """One frozen EfficientNet-Lite0 pass a picture, pooled under each mask, and gravity-aligned shape -> words.

    Parameters
    ----------
    text : TextEncoder, optional
        Shared with others that need one.
    weights : Path, optional
        The heads; the installed ones by default.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(self, text: TextEncoder | None = None, weights: str | Path = FOLDER / "regions.npz") -> None:
        self._text = text or TextEncoder()
        self._heads, self._mean = load_heads({"looks": N_DESCRIPTION, "shape": N_SHAPE}, self._text.dim, weights)
        self.backbone = Backbone()
        self._conse = Conse(self._text)
        self.dim = len(WEIGHTS) * self._text.dim

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32."""
        return fuse([unit(self._text.encode_text(texts) - self._mean)] * len(WEIGHTS))

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, one for each mask 1..n."""
        check_picture(rgb, depth, camera)
        if len(masks) == 0:
            return np.zeros((0, self.dim), np.float32)
        described = describe(self.backbone.dense(rgb), rgb, depth, masks, T_world_camera, camera)
        return fuse(self.opinions(described))

    def opinions(self, described: npt.NDArray[np.float32]) -> list[npt.NDArray[np.float32]]:
        """What looks, shape and ConSE say, unit vectors (n, 384) each, of descriptions (n, N_DESCRIPTION)."""
        head = described[:, N_FEATURES - CHANNELS[-1] : N_FEATURES]
        return [
            self._heads["looks"](described),
            self._heads["shape"](described[:, N_FEATURES:]),
            unit(self._conse(self.backbone.class_logits(head)) - self._mean),
        ]


def describe(
    maps: list[npt.NDArray[np.float32]],
    rgb: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.float32],
    masks: Masks,
    T_world_camera: npt.NDArray[np.floating],
    camera: PinholeCamera,
) -> npt.NDArray[np.float32]:
    """Pooled features and shape of each mask side by side, (n, N_DESCRIPTION) float32; maps are the backbone's of ``rgb``."""
    surface = working_picture(rgb, depth, T_world_camera, camera)
    return np.hstack([pool_regions(maps, masks.labels, len(masks)), shape_features(surface, masks)])


def fuse(opinions: list[npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    """Unit vectors (n, 384) of each branch -> one unit vector (n, 3 * 384), whose cosines are weighted means of the branches'."""
    return np.hstack([scale * f for scale, f in zip(_SCALES, opinions, strict=True)])
