"""Texts in the space of the instances' features: unit vectors with a memory, of which the fixed lists outlive the
process."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_agents import vector_cache

FloatArray = npt.NDArray[np.float32]


class TextEncoder(Protocol):
    """Anything that puts words into the space of the instances' features."""

    def encode_text(self, texts: list[str]) -> FloatArray:
        """Vectors (n, D) float32."""
        ...


class TextSpace:
    """A text encoder with a memory; every vector is a unit vector."""

    PROBE = "a red cup on the table beside the window"
    """Encoders are told apart by the vector that they give this text."""

    def __init__(self, encoder: TextEncoder) -> None:
        self._encoder = encoder
        self._known: dict[str, FloatArray] = {}

    def vectors(self, texts: list[str]) -> FloatArray:
        """Unit vectors (n, D) float32 of the texts, in their order."""
        missing = [text for text in dict.fromkeys(texts) if text not in self._known]
        if missing:
            found = np.asarray(self._encoder.encode_text(missing), np.float32)
            if found.ndim != 2 or len(found) != len(missing):
                raise ValueError(
                    f"encode_text gave shape {found.shape} for {len(missing)} texts; expected ({len(missing)}, D)"
                )
            self._known.update(zip(missing, unit(found), strict=True))
        return np.stack([self._known[text] for text in texts]) if texts else np.zeros((0, 0), np.float32)

    def listed(self, texts: list[str]) -> FloatArray:
        """As ``vectors``, for a long list that never changes: read from the user's cache folder if it is there."""
        if any(text not in self._known for text in texts):
            # The last bits of a vector differ between processors; the cached list is as good there.
            probe = np.round(self.vectors([self.PROBE]), 3).astype("<f4").tobytes()
            key = vector_cache.key(texts, probe)
            found = vector_cache.load(key, len(texts))
            if found is None:
                found = self.vectors(texts)
                vector_cache.store(key, found)
            self._known.update(zip(texts, found, strict=True))
        return self.vectors(texts)


def unit(vectors: FloatArray) -> FloatArray:
    """Rows scaled to length 1; what is not finite becomes 0."""
    clean = np.nan_to_num(vectors, nan=0.0, posinf=0.0, neginf=0.0)
    return np.asarray(clean / np.maximum(np.linalg.norm(clean, axis=1, keepdims=True), 1e-9), np.float32)
