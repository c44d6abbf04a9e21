"""What colour things are said to have: thirteen words, held against what the makers of a home wrote down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.colour import COLOURS
from openmap_env.episodes.attributes import looks
from openmap_eval.bootstrap import Figure, balanced_figure, mean_figure
from openmap_scenes import Instance


def true_colour(instance: Instance) -> str | None:
    """The word people would use, if its colour is known, is one of the thirteen and is what one would name it by."""
    colour = looks().colour_said(instance)
    return colour if colour in COLOURS else None


def voted(words: Sequence[str], things: npt.NDArray[np.integer], n: int) -> list[str | None]:
    """The word that most views of each of n things got; of equal votes the earlier of ``COLOURS``; None for no view."""
    votes = np.zeros((n, len(COLOURS)), np.int64)
    for word, thing in zip(words, things.tolist(), strict=True):
        votes[thing, COLOURS.index(word)] += 1
    return [COLOURS[int(v.argmax())] if v.any() else None for v in votes]


def colour_figures(
    said: Sequence[str | None], truth: Sequence[str], units: npt.NDArray[np.integer], seed: int = 0
) -> dict[str, Figure]:
    """Share of right words, and its mean over the colours ("balanced"); what belongs to one unit is drawn together."""
    right = np.array([a == b for a, b in zip(said, truth, strict=True)], bool)
    figures = {"right": mean_figure(right, units, seed), "balanced": balanced_figure(right, list(truth), seed)}
    return {name: figure for name, figure in figures.items() if figure is not None}
