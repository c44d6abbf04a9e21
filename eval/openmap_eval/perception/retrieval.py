"""Things asked for by a word: which of them comes first, and is it one that was meant.

An instance's feature is the mean of its views' unit features. Every category of a scene is asked for once, and all instances of
the scene that were seen are ranked; R@k is the share of categories of which an instance is among the first k.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from openmap_eval.bootstrap import Figure, mean_figure

KS = (1, 4, 8)
NEVER = np.iinfo(np.int64).max
"""Rank of what is not there."""


def mean_features(
    features: npt.NDArray[np.floating], rows: npt.NDArray[np.integer], n: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Unit means (n, D) float32 of the features (v, D) of instance ``rows`` (v,), and which of the n have any view, (n,)."""
    sums = np.zeros((n, features.shape[1]))
    np.add.at(sums, rows, features)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return (sums / np.where(length > 0, length, 1.0)).astype(np.float32), np.bincount(rows, minlength=n) > 0


def first_rank(
    similarity: npt.NDArray[np.floating], serves: npt.NDArray[np.bool_], there: npt.NDArray[np.bool_]
) -> int:
    """Rank from 0 of the first instance that serves; ``NEVER`` if none of those is there.

    Parameters
    ----------
    similarity : (n,) float
        Of each instance with the question; equal ones rank in the order given.
    serves, there : (n,) bool
        Which are meant; which have a feature. The others are not ranked.
    """
    order = np.argsort(-similarity, kind="stable")
    hits = np.flatnonzero(serves[order[there[order]]])
    return int(hits[0]) if len(hits) else NEVER


def category_ranks(
    similarity: npt.NDArray[np.floating], categories: Sequence[str], names: Sequence[str], there: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int64]:
    """``first_rank`` of every name (m,); ``similarity`` is (n instances, m names), ``categories`` are the instances' own."""
    own = np.array(categories)
    return np.array([first_rank(similarity[:, c], own == name, there) for c, name in enumerate(names)], np.int64)


def recall_figures(ranks: npt.NDArray[np.int64], seed: int = 0) -> dict[str, Figure]:
    """R@1, R@4, R@8 over questions with these ranks; questions are what is drawn for the intervals. Empty without questions."""
    figures = {f"R@{k}": mean_figure(ranks < k, seed=seed) for k in KS}
    return {name: figure for name, figure in figures.items() if figure is not None}
