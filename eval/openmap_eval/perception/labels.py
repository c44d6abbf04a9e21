"""Names given to regions: is the right one first, or among the first five.

Two lists of names are asked. A scene's own: its categories, each a name of its own. All names: those that the embedded weights
were trained on and the scene's own; there what people call the same thing counts as one name ("tv", "television"), which is as
like a region as the likest of its words. A kind is unseen if no name that the weights were trained on is of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.vocabulary import vocabulary
from openmap_eval.bootstrap import Figure, balanced_figure, mean_figure
from openmap_eval.perception.retrieval import NEVER

TOPS = (1, 5)


@dataclass(frozen=True)
class NameList:
    """Words that are asked, and which of them name the same kind of thing.

    Parameters
    ----------
    words : tuple of str
    groups : tuple of str
        Each word's kind.
    kinds : tuple of str
        The distinct ones, sorted.
    """

    words: tuple[str, ...]
    groups: tuple[str, ...]
    kinds: tuple[str, ...]

    @classmethod
    def own(cls, categories: Sequence[str]) -> NameList:
        """The categories of a scene, each by itself."""
        words = tuple(sorted(set(categories)))
        return cls(words, words, words)

    @classmethod
    def every(cls, trained: Sequence[str], categories: Sequence[str]) -> NameList:
        """What the weights know and what the scene has, by kind."""
        words = tuple(sorted({*trained, *categories}))
        groups = tuple(vocabulary().kind(word) for word in words)
        return cls(words, groups, tuple(sorted(set(groups))))

    def by_kind(self, similarity: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """Similarities (n, words) -> (n, kinds), that of the likest word."""
        out = np.full((len(similarity), len(self.kinds)), -np.inf)
        place = {kind: c for c, kind in enumerate(self.kinds)}
        for column, group in enumerate(self.groups):
            c = place[group]
            out[:, c] = np.maximum(out[:, c], similarity[:, column])
        return out

    def kind_of(self, category: str) -> str:
        """The kind that a category is listed under."""
        return self.groups[self.words.index(category)]


def own_ranks(similarity: npt.NDArray[np.floating], own: npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    """How many kinds come before the right one; similarity (n, kinds), ``own`` (n,): its column; the earlier of equal ones."""
    right = similarity[np.arange(len(own)), own][:, None]
    earlier = np.arange(similarity.shape[1])[None] < own[:, None]
    return np.asarray(((similarity > right) | ((similarity == right) & earlier)).sum(1), np.int64)


@dataclass(frozen=True)
class Ranks:
    """Of n regions or instances: how many names came before the right one, what they are, and which belong together.

    Parameters
    ----------
    ranks : (n,) int64
        ``NEVER`` for what no mask showed.
    categories : tuple of str
    unseen : (n,) bool
    units : (n,) int64
        The thing that each shows; a thing's views are drawn together.
    """

    ranks: npt.NDArray[np.int64]
    categories: tuple[str, ...]
    unseen: npt.NDArray[np.bool_]
    units: npt.NDArray[np.int64]

    @classmethod
    def joined(cls, parts: Sequence[Ranks]) -> Ranks:
        """Those of several scenes; things of different scenes stay apart."""
        shift = np.cumsum([0, *(int(p.units.max(initial=-1)) + 1 for p in parts)])
        return cls(
            np.concatenate([p.ranks for p in parts]),
            tuple(c for p in parts for c in p.categories),
            np.concatenate([p.unseen for p in parts]),
            np.concatenate([p.units + s for p, s in zip(parts, shift, strict=False)]),
        )

    def figures(self, seed: int = 0) -> dict[str, dict[str, Figure]]:
        """{"all" | "seen" | "unseen": {"top-1", "top-5", "balanced top-1", "balanced top-5"}}, where there are any."""
        chosen = {"all": np.ones(len(self.ranks), bool), "seen": ~self.unseen, "unseen": self.unseen}
        return {name: self._of(rows, seed) for name, rows in chosen.items() if rows.any()}

    def _of(self, rows: npt.NDArray[np.bool_], seed: int) -> dict[str, Figure]:
        categories = [c for c, kept in zip(self.categories, rows, strict=True) if kept]
        figures: dict[str, Figure | None] = {}
        for k in TOPS:
            figures[f"top-{k}"] = mean_figure(self.ranks[rows] < k, self.units[rows], seed)
            figures[f"balanced top-{k}"] = balanced_figure(self.ranks[rows] < k, categories, seed)
        return {name: figure for name, figure in figures.items() if figure is not None}


def ranks_of(
    similarity: npt.NDArray[np.floating], names: NameList, categories: Sequence[str], there: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int64]:
    """``own_ranks`` among a list of names of n regions with these categories, similarity (n, words); NEVER where not there."""
    column = {kind: c for c, kind in enumerate(names.kinds)}
    own = np.array([column[names.kind_of(c)] for c in categories], np.int64)
    if not len(own):
        return own
    return np.where(there, own_ranks(names.by_kind(similarity), own), NEVER)
