"""Observations -> figures: those of each scene, and of all scenes together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_eval.bootstrap import Figure
from openmap_eval.perception.colour import colour_figures, true_colour, voted
from openmap_eval.perception.labels import NameList, Ranks, ranks_of
from openmap_eval.perception.masks import ViewMasks, mask_figures
from openmap_eval.perception.names import kinds_of, unseen
from openmap_eval.perception.observe import Observed, Regions
from openmap_eval.perception.retrieval import category_ranks, first_rank, mean_features, recall_figures
from openmap_eval.perception.uses import serves, that_apply

SIDES = ("true masks", "predicted masks")
LISTS = ("own names", "all names")
GRAINS = ("instances", "views")
EncodeText = Callable[[list[str]], npt.NDArray[np.float32]]


@dataclass(frozen=True)
class Colours:
    """What was said of the colour of n regions or instances, what it is, and which of them belong together."""

    said: tuple[str | None, ...]
    truth: tuple[str, ...]
    units: npt.NDArray[np.int64]

    @classmethod
    def joined(cls, parts: Sequence[Colours]) -> Colours:
        shift = np.cumsum([0, *(int(p.units.max(initial=-1)) + 1 for p in parts)])[:-1]
        return cls(
            tuple(w for p in parts for w in p.said),
            tuple(w for p in parts for w in p.truth),
            np.concatenate([p.units + s for p, s in zip(parts, shift, strict=True)]),
        )


@dataclass(frozen=True)
class SideResult:
    """What came of one way of getting masks.

    Parameters
    ----------
    labels : dict of (list of names, grain) -> Ranks
    categories, uses : (questions,) int64
        Rank of the first instance that serves.
    found_categories : (questions,) int64
        Of the categories of which an instance has a feature.
    colours : dict of grain -> Colours
    """

    labels: dict[tuple[str, str], Ranks]
    categories: npt.NDArray[np.int64]
    found_categories: npt.NDArray[np.int64]
    uses: npt.NDArray[np.int64]
    colours: dict[str, Colours]


@dataclass(frozen=True)
class SceneResult:
    """Everything that figures are made of, for one scene."""

    views: list[ViewMasks]
    sides: dict[str, SideResult]
    counts: dict[str, int]


def scene_result(observed: Observed, trained: Sequence[str], encode: EncodeText) -> SceneResult:
    """Rank everything that is asked of a scene; ``trained`` are the names that the weights know."""
    categories = [i.category for i in observed.things]
    lists = {"own names": NameList.own(categories), "all names": NameList.every(trained, categories)}
    known = kinds_of(list(trained))
    new = np.array([unseen(c, known) for c in categories], bool)
    sides = {
        title: _side(regions, observed, categories, new, lists, encode)
        for title, regions in zip(SIDES, (observed.true, observed.predicted), strict=True)
        if regions is not None
    }
    counts = {
        "views": len(observed.views),
        "things": len(observed.things),
        "categories": len(set(categories)),
        "unseen things": int(new.sum()),
        "unseen categories": len({c for c, n in zip(categories, new, strict=True) if n}),
        "own names": len(lists["own names"].words),
        "all names": len(lists["all names"].words),
        "kinds of all names": len(lists["all names"].kinds),
        "uses": len(that_apply(categories)),
        "masks": sum(len(v.scores) for v in observed.views),
    }
    return SceneResult(observed.views, sides, counts)


def _side(
    regions: Regions,
    observed: Observed,
    categories: Sequence[str],
    new: npt.NDArray[np.bool_],
    lists: Mapping[str, NameList],
    encode: EncodeText,
) -> SideResult:
    n = len(categories)
    means, there = mean_features(regions.features[regions.there], regions.things[regions.there], n)
    grains = {
        "instances": (means, np.arange(n), there),
        "views": (regions.features, regions.things, regions.there),
    }
    labels = {}
    for title, names in lists.items():
        text = encode(list(names.words)).T
        for grain, (features, things, present) in grains.items():
            own = [categories[t] for t in things]
            ranks = ranks_of(features @ text if len(own) else np.zeros((0, len(names.words))), names, own, present)
            labels[title, grain] = Ranks(ranks, tuple(own), new[things], things)
    words = lists["own names"].words
    asked = category_ranks(means @ encode(list(words)).T, categories, words, there) if n else np.zeros(0, np.int64)
    have = np.array([there[[c == word for c in categories]].any() for word in words], bool)
    questions = that_apply(categories)
    fit = means @ encode(questions).T if questions else np.zeros((n, 0))
    uses = [first_rank(fit[:, k], serves(q, categories), there) for k, q in enumerate(questions)]
    return SideResult(labels, asked, asked[have], np.array(uses, np.int64), _colours(regions, observed))


def _colours(regions: Regions, observed: Observed) -> dict[str, Colours]:
    truth = [true_colour(i) for i in observed.things]
    said = [(w, t) for w, t in zip(regions.colours, regions.things.tolist(), strict=True) if w is not None]
    votes = voted([w for w, _ in said], np.array([t for _, t in said], np.int64), len(truth))
    return {
        "instances": _with_truth(votes, truth, np.arange(len(truth))),
        "views": _with_truth(regions.colours, truth, regions.things),
    }


def _with_truth(said: Sequence[str | None], truth: Sequence[str | None], things: npt.NDArray[np.int64]) -> Colours:
    rows = [
        (word, colour, t) for word, t in zip(said, things.tolist(), strict=True) if (colour := truth[t]) is not None
    ]
    return Colours(tuple(r[0] for r in rows), tuple(r[1] for r in rows), np.array([r[2] for r in rows], np.int64))


def figures(scenes: Sequence[SceneResult], seed: int = 0) -> dict[str, Any]:
    """All figures of some scenes together; what is asked of a scene is answered by that scene's things alone."""
    found: dict[str, Any] = {
        "counts": _counts(scenes),
        "masks": mask_figures([v for s in scenes for v in s.views], seed),
    }
    for side in (s for s in SIDES if s in scenes[0].sides):
        parts = [s.sides[side] for s in scenes]
        found[side] = {
            "labels": {
                names: {grain: Ranks.joined([p.labels[names, grain] for p in parts]).figures(seed) for grain in GRAINS}
                for names in LISTS
            },
            "categories": recall_figures(np.concatenate([p.categories for p in parts]), seed),
            "found categories": recall_figures(np.concatenate([p.found_categories for p in parts]), seed),
            "uses": recall_figures(np.concatenate([p.uses for p in parts]), seed),
            "colour": {grain: _colour(parts, grain, seed) for grain in GRAINS},
        }
    return found


def _colour(parts: Sequence[SideResult], grain: str, seed: int) -> dict[str, Figure]:
    joined = Colours.joined([p.colours[grain] for p in parts])
    return colour_figures(joined.said, joined.truth, joined.units, seed)


def _counts(scenes: Sequence[SceneResult]) -> dict[str, Any]:
    """Sums over scenes; of the lists of names, which differ from scene to scene, the shortest and the longest."""
    lists = ("own names", "all names", "kinds of all names")
    counts: dict[str, Any] = {key: sum(s.counts[key] for s in scenes) for key in scenes[0].counts if key not in lists}
    for key in lists:
        few, many = min(s.counts[key] for s in scenes), max(s.counts[key] for s in scenes)
        counts[key] = few if few == many else [few, many]
    return counts
