"""Perception that is told: the renderer's ids as masks, the scene's category words as features. For analysis, never a default.

It separates what perception costs from what mapping and grounding cost. ``semantic`` is called for the picture at hand, so it
must return the ids of the very frame that is passed to ``segment`` and ``encode_regions``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import PinholeCamera

Semantic = Callable[[], npt.NDArray[np.int32]]
_UNKNOWN = "thing"


def _ids(semantic: Semantic, shape: tuple[int, ...]) -> npt.NDArray[np.int32]:
    ids = np.asarray(semantic())
    ids = ids[..., 0] if ids.ndim == 3 and ids.shape[2] == 1 else ids
    if ids.shape != shape:
        raise ValueError(f"semantic() gave {ids.shape}, expected {shape} as the picture")
    return ids.astype(np.int32)


class OracleSegmenter:
    """Every instance of the picture, structure included, is a mask; ascending by instance id, scores 1.

    Pixels without depth belong to none, as in any other segmenter.

    Parameters
    ----------
    semantic : () -> (H, W) or (H, W, 1) int32
        Instance ids of the current picture, 0 = none.
    """

    def __init__(self, semantic: Semantic) -> None:
        self._semantic = semantic

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of the current picture."""
        ids = np.where(depth > 0, _ids(self._semantic, rgb.shape[:2]), 0)
        present, labels = np.unique(ids, return_inverse=True)
        labels = labels.reshape(ids.shape) + (0 if present[0] == 0 else 1)
        return Masks(labels.astype(np.int32), np.ones(int((present != 0).sum()), np.float32))


class OracleEncoder:
    """A mask's feature is the text embedding of the category word of the instance that most of its pixels show.

    Parameters
    ----------
    semantic : as for ``OracleSegmenter``
    categories : mapping of instance id to words
        ``Instance.category``, or with attributes before it ("blue armchair").
    text : TextEncoder, optional
        Shared with others that need one.
    """

    dim = TextEncoder.dim

    def __init__(self, semantic: Semantic, categories: Mapping[int, str], text: TextEncoder | None = None) -> None:
        self._semantic, self._categories = semantic, dict(categories)
        self._text = text or TextEncoder()

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, 384) float32."""
        return self._text.encode_text(texts)

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, 384) float32; what shows no instance, or one without a word, is a "thing"."""
        ids = _ids(self._semantic, rgb.shape[:2])
        words = []
        for label in range(1, len(masks) + 1):
            present, counts = np.unique(ids[masks.labels == label], return_counts=True)
            majority = int(present[counts.argmax()]) if len(present) else 0
            words.append(self._categories.get(majority, _UNKNOWN))
        return self._text.encode_text(words)
