"""The default encoder: what a region looks like, as a place in the space of words."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import CHANNELS, Backbone, pool_regions
from openmap_agents.perception.conse import Conse
from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.surface import check_picture
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import PinholeCamera


class EmbeddedEncoder:
    """One frozen EfficientNet-Lite0 pass a picture, pooled under each mask, placed among words by ConSE.

    Parameters
    ----------
    text : TextEncoder, optional
        Shared with others that need one.
    """

    def __init__(self, text: TextEncoder | None = None) -> None:
        self._text = text or TextEncoder()
        self._backbone = Backbone()
        self._conse = Conse(self._text)
        self.dim = self._text.dim

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
        """Unit vectors (n, D) float32, one for each mask 1..n."""
        check_picture(rgb, depth, camera)
        if len(masks) == 0:
            return np.zeros((0, self.dim), np.float32)
        pooled = pool_regions(self._backbone.dense(rgb), masks.labels, len(masks))
        return self._conse(self._backbone.class_logits(pooled[:, -CHANNELS[-1] :]))
