"""Needs: which kinds of things answer one, and in which order to offer the instances of a map.

A need is compared with every phrase of the table of uses and with each kind's whole line. A softmax over the kinds makes
that a belief about which kind is meant. Every instance of a kind serves alike, so a ranking for a need is a list of
different guesses: what comes next is what most raises the chance that at least one of them is right.
"""

from __future__ import annotations

import math
import re
from collections import Counter

import numpy as np
import numpy.typing as npt

from openmap_agents.grounding.lexicon import Lexicon, load_lexicon, singular, words_of
from openmap_agents.grounding.text_space import FloatArray, TextSpace, unit

Array = npt.NDArray[np.float64]


class Needs:
    """Needs -> kinds of things that answer them, through a table of what things are for.

    A kind's score is the cosine of the need with its nearest phrase, plus that with all its phrases read as one text, plus
    ``LEXICAL`` x the share of the need's words (by how telling they are) that its phrases hold: the first finds the very deed,
    the second keeps a single odd phrase from deciding, the third knows "cold" from "warm" better than sentence embeddings do.

    Parameters
    ----------
    lexicon : Lexicon
    space : TextSpace
        For sentences.
    """

    TEMPERATURE = 0.06
    """Of the softmax over the kinds' scores; by likelihood on sentences that the table was not written for."""
    TAIL, TAIL_TEMPERATURE = 0.3, 0.15
    """How much of the belief goes to a softmax this broad: a home may lack the likeliest kind, and then the next best counts."""
    LEXICAL = 0.15
    KEPT = 40

    def __init__(self, lexicon: Lexicon, space: TextSpace) -> None:
        self._space = space
        self._table: tuple[FloatArray, FloatArray] | None = None
        self._kinds = list(lexicon.affordances)
        self._phrases = list(dict.fromkeys(use for uses in lexicon.affordances.values() for use in uses))
        self._lines = [f"{kind}: {'; '.join(uses)}" for kind, uses in lexicon.affordances.items()]
        self._words = [content_words(line) for line in self._lines]
        counted = Counter(word for words in self._words for word in words)
        # Inverse document frequency: 1 for a word that no line holds, near 0 for one that most of them hold.
        self._telling = {word: 1 - math.log(n + 1) / math.log(len(self._lines) + 1) for word, n in counted.items()}
        row = {phrase: k for k, phrase in enumerate(self._phrases)}
        self._rows = np.array([row[use] for uses in lexicon.affordances.values() for use in uses])
        self._starts = np.cumsum([0, *(len(uses) for uses in lexicon.affordances.values())])[:-1]

    def serving(self, needs: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
        """Kinds that answer the needs, most probable first, each with its probability; () without needs."""
        if not needs:
            return ()
        need = ". ".join(needs)
        phrase, line = self._cosines(need)
        scores = phrase + line + self.LEXICAL * self._shared(content_words(need))
        weights = (1 - self.TAIL) * softmax(scores, self.TEMPERATURE) + self.TAIL * softmax(
            scores, self.TAIL_TEMPERATURE
        )
        order = np.argsort(-weights, kind="stable")[: self.KEPT]
        return tuple((self._kinds[k], float(weights[k])) for k in order)

    def strength(self, text: str) -> float:
        """How surely a text states a need that the table knows: cosine with the nearest phrase."""
        return float(self._cosines(text)[0].max())

    def _shared(self, words: frozenset[str]) -> Array:
        """Which share (K,) of the words' weight each kind's line holds."""
        total = sum(self._telling.get(word, 1.0) for word in sorted(words))
        held = [sum(self._telling.get(word, 1.0) for word in sorted(words & line)) for line in self._words]
        return np.array(held) / max(total, 1e-9)

    def _cosines(self, need: str) -> tuple[Array, Array]:
        """Of the need with the nearest phrase and with the whole line of every kind, (K,) each."""
        if self._table is None:
            listed = self._space.listed([*self._kinds, *self._phrases, *self._lines])
            # What all words of a home have in common says nothing; some encoders leave it out and some do not.
            common = listed[: len(self._kinds)].mean(0)
            self._table = unit(listed[len(self._kinds) :] - common), common
        vectors, common = self._table
        cosines = (vectors @ unit(self._space.vectors([need]) - common)[0]).astype(np.float64)
        phrases, lines = cosines[: len(self._phrases)], cosines[len(self._phrases) :]
        return np.maximum.reduceat(phrases[self._rows], self._starts), lines


def softmax(scores: Array, temperature: float) -> Array:
    """Probabilities (K,) of scores (K,)."""
    weights = np.exp((scores - scores.max()) / temperature)
    return np.asarray(weights / weights.sum(), np.float64)


def content_words(text: str) -> frozenset[str]:
    """The words that carry meaning, roughly stemmed."""
    lexicon = load_lexicon()
    empty = {*lexicon.words["function_words"], *lexicon.words["frame_words"]}
    stems = (re.sub(r"(?<=...)(?:ing|ed|e|y)$", "", singular(w)) for w in words_of(text.lower()) if w not in empty)
    return frozenset(stem for stem in stems if len(stem) > 1)


def cover(probabilities: Array, hits: Array, greedy: int = 64) -> Array:
    """The gain (N,) with which each instance enters the ranking; falling gains rank the instances.

    Kind k is the one meant with probability p_k, and then instance i is a hit with chance h_ik. The next instance is the
    one that adds most to P(at least one hit) = sum_k p_k (1 - prod_i (1 - h_ik)), which greedy choice brings within
    1 - 1/e of the best set of every size (Nemhauser et al., 1978).

    Parameters
    ----------
    probabilities : (K,)
    hits : (N, K) 0..1
    greedy : int
        So many are chosen one by one; the others get what each would have added after them.
    """
    count = len(hits)
    gains = np.zeros(count)
    left = np.ones(count, bool)
    missed = np.array(probabilities, np.float64)
    for _ in range(min(greedy, count)):
        added = np.where(left, hits @ missed, -1.0)
        chosen = int(added.argmax())
        gains[chosen] = added[chosen]
        left[chosen] = False
        missed = missed * (1.0 - hits[chosen])
    return np.where(left, hits @ missed, gains)
