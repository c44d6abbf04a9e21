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
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.corruption import Corruption, corrupt
from openmap_agents.perception.protocol import Calibration, Masks
from openmap_scenes import PinholeCamera

if TYPE_CHECKING:
    from openmap_agents.perception.text import TextEncoder

Semantic = Callable[[], npt.NDArray[np.int32]]
_UNKNOWN = "thing"
_RANGES: dict[str, tuple[float, float]] = {
    "split": (0, 1), "merge": (0, 1), "drop": (0, 1), "boundary": (0, 32), "features": (0, 10), "names": (0, 1),
    "seed": (0, 2**32 - 1),
}  # fmt: skip
_MASKS, _FEATURES, _NAMES = range(3)

WORDS = Calibration(16.2, -6.62)
"""Of names as all-MiniLM-L6-v2 embeds them: fitted so that, of all names and synonyms of the grounding's vocabulary, a name's own
ones and those of other things weigh the same; 0.41 is even."""


@dataclass(frozen=True)
class OracleNoise:
    """What is wrong with what the oracle says; nothing by default.

    Ranges: 0..1 for probabilities, ``boundary`` 0..32, ``features`` 0..10, ``seed`` a whole number of 32 bits.
    """

    split: float = 0.0
    """Probability that a mask of at least 2,500 pixels (of 640 x 480) is cut in two: half by position, half by depth."""
    merge: float = 0.0
    """Probability that a mask joins a random one that it touches."""
    drop: float = 0.0
    """Probability that a mask is missing."""
    boundary: float = 0.0
    """Edges wander smoothly by up to so many pixels, and each mask is then eroded or dilated by up to as many."""
    features: float = 0.0
    """Length s of a random vector that is added to a unit feature before it is made a unit vector again: its cosine to what it
    was is about 1 / sqrt(1 + s^2)."""
    names: float = 0.0
    """Probability that a mask is called by the name of something else of the scene."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(_refusal(f"{name}={getattr(self, name)}"))

    @classmethod
    def parse(cls, text: str) -> OracleNoise:
        """The noise of "split=.1,merge=.05,seed=3"; "" is none.

        Raises
        ------
        ValueError
            An unknown or repeated key, or a value out of its range.
        """
        values: dict[str, float] = {}
        for part in filter(None, text.split(",")):
            key, _, value = (x.strip() for x in part.partition("="))
            try:
                number = int(value) if key == "seed" else float(value)
            except ValueError:
                raise ValueError(_refusal(part)) from None
            if key not in _RANGES or key in values:
                raise ValueError(_refusal(part))
            values[key] = number
        return cls(**values)  # type: ignore[arg-type]

    def __str__(self) -> str:
        """What ``parse`` reads; only what is not as by default."""
        return ",".join(
            f"{f.name}={getattr(self, f.name):g}" if f.name != "seed" else f"seed={self.seed}"
            for f in fields(self)
            if getattr(self, f.name) != f.default
        )

    @property
    def corruption(self) -> Corruption:
        """What it does to masks; walls and floors fare as everything else."""
        b = self.boundary
        return Corruption(split=self.split, split_pieces=(2, 2), merge=self.merge, drop=self.drop, warp=b, grow=b)


def _refusal(found: str) -> str:
    ranges = ", ".join(
        f"{key} {low:g}..{high if key == 'seed' else f'{high:g}'}" for key, (low, high) in _RANGES.items()
    )
    return f"oracle noise has {found!r}, expected key=value, each key once, separated by commas: {ranges}"


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

    def __init__(self, semantic: Semantic, noise: OracleNoise = OracleNoise()) -> None:
        self._semantic, self._noise, self._corruption = semantic, noise, noise.corruption

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
        noise: OracleNoise = OracleNoise(),
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
