"""Perception that is told: the renderer's ids as masks, the scene's category words as features. For analysis, never a default.

It separates what perception costs from what mapping and grounding cost, and ``OracleNoise`` is the dial between the two: how good
must masks and features be? ``semantic`` is called for the picture at hand, so it must return the ids of the very frame that is
passed to ``segment`` and ``encode_regions``.

What noise a picture gets depends on the seed and on the picture, not on how many came before it: the same stream gives the same
masks in any process, also in an evaluation that was stopped and goes on.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.corruption import Corruption, corrupt
from openmap_agents.perception.noise import NO_NOISE, OracleNoise
from openmap_agents.perception.protocol import Calibration, Masks
from openmap_scenes import PinholeCamera

if TYPE_CHECKING:
    from openmap_agents.perception.text import TextEncoder

Semantic = Callable[[], npt.NDArray[np.int32]]
_UNKNOWN = "thing"
_MASKS, _FEATURES, _NAMES = range(3)

WORDS = Calibration(16.2, -6.62)
"""Of names as all-MiniLM-L6-v2 embeds them: fitted so that, of all names and synonyms of the grounding's vocabulary, a name's own
ones and those of other things weigh the same; 0.41 is even."""


def _corruption(noise: OracleNoise) -> Corruption:
    """What the noise does to masks; walls and floors fare as everything else."""
    b = noise.boundary
    return Corruption(split=noise.split, split_pieces=(2, 2), merge=noise.merge, drop=noise.drop, warp=b, grow=b)


def _ids(semantic: Semantic, shape: tuple[int, ...]) -> npt.NDArray[np.int32]:
    ids = np.asarray(semantic())
    ids = ids[..., 0] if ids.ndim == 3 and ids.shape[2] == 1 else ids
    if ids.shape != shape:
        raise ValueError(f"semantic() gave {ids.shape}, expected {shape} as the picture")
    return ids.astype(np.int32)


def _generator(
    noise: OracleNoise, stream: int, rgb: npt.NDArray[np.uint8], ids: npt.NDArray[np.int32]
) -> np.random.Generator:
    """For one kind of noise in one picture."""
    picture = zlib.crc32(ids.tobytes(), zlib.crc32(rgb.tobytes()))
    return np.random.default_rng([noise.seed, picture, stream])


class OracleSegmenter:
    """Every instance of the picture, structure included, is a mask; ascending by instance id, scores 1.

    Pixels without depth belong to none, as in any other segmenter.

    Parameters
    ----------
    semantic : () -> (H, W) or (H, W, 1) int32
        Instance ids of the current picture, 0 = none.
    noise : OracleNoise
        The scores stay 1, as if the segmenter did not know how wrong it is.
    """

    def __init__(self, semantic: Semantic, noise: OracleNoise = NO_NOISE) -> None:
        self._semantic, self._noise, self._corruption = semantic, noise, _corruption(noise)

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of the current picture."""
        ids = _ids(self._semantic, rgb.shape[:2])
        labels = corrupt(ids, depth, _generator(self._noise, _MASKS, rgb, ids), self._corruption)
        return Masks(labels, np.ones(int(labels.max(initial=0)), np.float32))


class OracleEncoder:
    """A mask's feature is the text embedding of the category word of the instance that most of its pixels show.

    Parameters
    ----------
    semantic : as for ``OracleSegmenter``
    categories : mapping of instance id to words
        ``Instance.category``, or with attributes before it ("blue armchair").
    text : TextEncoder, optional
        Shared with others that need one.
    noise : OracleNoise
    """

    def __init__(
        self,
        semantic: Semantic,
        categories: Mapping[int, str],
        text: TextEncoder | None = None,
        noise: OracleNoise = NO_NOISE,
    ) -> None:
        from openmap_agents.perception.text import TextEncoder

        self._semantic, self._categories, self._noise = semantic, dict(categories), noise
        self._words = sorted(set(self._categories.values()))
        self._text = text or TextEncoder()
        self.dim: int = self._text.dim
        # A cosine of c without noise is one of about c / sqrt(1 + s^2) with it.
        self.calibration = Calibration(WORDS.slope * math.hypot(1.0, noise.features), WORDS.offset)

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
        words = [self._categories.get(i, _UNKNOWN) for i in _majorities(masks, ids)]
        if self._noise.names > 0:
            words = self._misnamed(words, _generator(self._noise, _NAMES, rgb, ids))
        features = self._text.encode_text(words)
        if self._noise.features > 0 and len(features):
            away = _generator(self._noise, _FEATURES, rgb, ids).standard_normal(features.shape)
            features = features + self._noise.features * away / np.linalg.norm(away, axis=1, keepdims=True)
            features = (features / np.linalg.norm(features, axis=1, keepdims=True)).astype(np.float32)
        return features

    def _misnamed(self, words: list[str], rng: np.random.Generator) -> list[str]:
        """The words, some of them replaced by another word of the scene."""
        wrong, which = rng.random(len(words)) < self._noise.names, rng.random(len(words))
        out = []
        for k, word in enumerate(words):
            others = [w for w in self._words if w != word]
            out.append(others[int(which[k] * len(others))] if wrong[k] and others else word)
        return out

    def encode_crops(self, crops: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Always refused: a crop does not say which instance it shows.

        Raises
        ------
        ValueError
        """
        raise ValueError(
            "the oracle encoder was given crops, which carry no ids; expected regions of the current picture"
        )


def _majorities(masks: Masks, ids: npt.NDArray[np.int32]) -> list[int]:
    """The id that most pixels of each mask 1..n show; 0 where a mask has no pixel."""
    present, inverse = np.unique(ids, return_inverse=True)
    table = np.bincount(
        masks.labels.ravel().astype(np.int64) * len(present) + inverse.ravel(),
        minlength=(len(masks) + 1) * len(present),
    ).reshape(-1, len(present))[1 : len(masks) + 1]
    return [int(present[row.argmax()]) if row.any() else 0 for row in table]
