"""A text as a vector, without a model: what words, word pairs and letter groups are in it, hashed.

The hashing trick (Weinberger et al. 2009): every feature adds +1 or -1 to one of D places, both chosen by a hash of the
feature, so that the scalar product of two vectors is, on average, that of the features' counts. Texts that share words are near
each other, also where the words differ in their endings ("chair", "chairs"); what words mean is unknown to it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

Embedding = Callable[[str], npt.ArrayLike]

_WORD = re.compile(r"\w+")
_GROUPS = (3, 4)
"""Lengths of letter groups, a word's borders included."""
_GROUP_WEIGHT = 0.3
"""Of a letter group beside a word: a word of six letters has eleven."""


def hashed(text: str, size: int = 128) -> npt.NDArray[np.float32]:
    """Vector (size,) float32 of length 1 of a text; 0 where there is no word in it. The same in every process."""
    vector = np.zeros(size, np.float64)
    for feature, weight in _features(text):
        digest = int.from_bytes(hashlib.blake2b(feature.encode(), digest_size=8).digest(), "little")
        vector[(digest >> 1) % size] += weight if digest & 1 else -weight
    length = float(np.linalg.norm(vector))
    return (vector / length if length > 0.0 else vector).astype(np.float32)


def _features(text: str) -> Iterator[tuple[str, float]]:
    words = _WORD.findall(text.casefold())
    for word in words:
        yield f"w {word}", 1.0
        bordered = f"<{word}>"
        for n in _GROUPS:
            yield from ((f"g {bordered[i : i + n]}", _GROUP_WEIGHT) for i in range(len(bordered) - n + 1))
    yield from ((f"p {a} {b}", 1.0) for a, b in pairwise(words))


EMBEDDINGS: dict[str, Embedding] = {"hashed": hashed}
"""Embeddings by name."""
