"""Texts and instances in one space: cached text features, similarities, labels for instances, and needs matched with
uses."""

from __future__ import annotations

import re
from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_agents.grounding.lexicon import Lexicon, load_lexicon, singular, words_of

FloatArray = npt.NDArray[np.float32]


class TextEncoder(Protocol):
    """Anything that puts words into the space of the instances' features."""

    def encode_text(self, texts: list[str]) -> FloatArray:
        """Vectors (n, D) float32."""
        ...


class TextSpace:
    """A text encoder with a memory; every vector is a unit vector."""

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


def unit(vectors: FloatArray) -> FloatArray:
    """Rows scaled to length 1; what is not finite becomes 0."""
    clean = np.nan_to_num(vectors, nan=0.0, posinf=0.0, neginf=0.0)
    return np.asarray(clean / np.maximum(np.linalg.norm(clean, axis=1, keepdims=True), 1e-9), np.float32)


def content_words(text: str) -> frozenset[str]:
    """The words that carry meaning, roughly stemmed."""
    stems = (
        re.sub(r"(?:ing|ed)$", "", singular(w))
        for w in words_of(text.lower())
        if w not in load_lexicon().words["function_words"]
    )
    return frozenset(stem for stem in stems if len(stem) > 1)


class Needs:
    """Needs -> kinds of things that answer them, through a table of what things are for.

    The score of a kind is the best, over its phrasings, of cosine + ``LEXICAL`` x the share of the need's content words that the
    phrasing holds: sentence embeddings miss exact words in short texts, word overlap misses paraphrases.
    """

    LEXICAL = 0.25
    KEPT = 16
    STEEPNESS = 1.5
    """What a kind's lower score costs, in similarity."""

    def __init__(self, lexicon: Lexicon, space: TextSpace) -> None:
        self._lexicon, self._space = lexicon, space
        self._kinds = [kind for kind, uses in lexicon.affordances.items() for _ in uses]
        self._uses = [use for uses in lexicon.affordances.values() for use in uses]
        self._use_words = [content_words(use) for use in self._uses]

    def serving(self, needs: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
        """Kinds that answer any of the needs, best first, each with what it costs in similarity (0 for the best)."""
        ranked = self._ranked(needs)
        return tuple((kind, self.STEEPNESS * (ranked[0][1] - score)) for kind, score in ranked)

    def strength(self, text: str) -> float:
        """How surely a text states a need that the table knows: the best kind's score."""
        return self._ranked((text,))[0][1]

    def _ranked(self, needs: tuple[str, ...]) -> list[tuple[str, float]]:
        best: dict[str, float] = {}
        for need in needs:
            row = self._space.vectors(self._uses) @ self._space.vectors([need])[0]
            words = content_words(need)
            for kind, use_words, cos in zip(self._kinds, self._use_words, row.tolist(), strict=True):
                shared = len(words & use_words) / max(len(words), 1)
                named = 0.1 if content_words(kind) <= words else 0.0
                best[kind] = max(best.get(kind, -1.0), cos + self.LEXICAL * shared + named)
        return sorted(best.items(), key=lambda item: (-item[1], item[0]))[: self.KEPT]
