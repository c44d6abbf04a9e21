"""Class-agnostic masks against the things that are there: average precision as COCO computes it, best IoU, recall.

A thing counts in a view where it covers at least ``MIN_PIXELS`` of a 640 x 480 picture. Pixels of what is smaller, of what has no
usable name and of no instance at all are an ignore region: a mask that lies there for the most part and matches nothing is not
counted. Walls, floors and ceilings are background: a mask on them is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.overlap import ious, true_masks
from openmap_agents.perception.protocol import Masks
from openmap_eval.bootstrap import Figure, draws, interval, mean_figure

THRESHOLDS = np.round(np.arange(0.5, 1.0, 0.05), 2)
"""IoU from which a mask shows a thing; AP is the mean over them."""
SIZES = {
    "all": (0.0, np.inf),
    "small": (0.0, 32.0**2),
    "medium": (32.0**2, 96.0**2),
    "large": (96.0**2, np.inf),
}
"""COCO's, px of a 640 x 480 picture: from, up to."""
FALSE, TRUE, LEFT_OUT = 0, 1, -1
_MOSTLY = 0.5
_RECALLS = np.linspace(0.0, 1.0, 101)
_VGA = 640 * 480
_RESAMPLES = 500  # each ranks all masks again


@dataclass(frozen=True)
class ViewMasks:
    """How n masks of a view lie on its m things.

    Parameters
    ----------
    things : (m,) int32
        Instance ids, ascending.
    iou : (m, n) float64
    scores : (n,) float64
    thing_pixels, mask_pixels : (m,), (n,) float64
        Sizes in pixels of a 640 x 480 picture.
    ignored : (n,) bool
        Whether the mask lies in the ignore region for the most part.
    """

    things: npt.NDArray[np.int32]
    iou: npt.NDArray[np.float64]
    scores: npt.NDArray[np.float64]
    thing_pixels: npt.NDArray[np.float64]
    mask_pixels: npt.NDArray[np.float64]
    ignored: npt.NDArray[np.bool_]

    @property
    def best(self) -> npt.NDArray[np.float64]:
        """The best IoU of any mask with each thing, (m,)."""
        return np.asarray(self.iou.max(axis=1, initial=0.0))


def compare(
    masks: Masks, ids: npt.NDArray[np.int32], things: AbstractSet[int], background: AbstractSet[int]
) -> ViewMasks:
    """Masks (H, W) against true ids (H, W); ``things`` and ``background`` are instance ids, all others are ignored."""
    n = len(masks)
    _, kept = true_masks(ids, sorted(things))
    wanted = np.array(kept, np.int32)
    present, overlap = ious(masks.labels, ids)
    iou = np.zeros((len(wanted), n))
    iou[:, : overlap.shape[1]] = overlap[np.searchsorted(present, wanted), :n]
    known = np.isin(ids, [*kept, *sorted(background)])
    pixels = np.bincount(masks.labels.ravel(), minlength=n + 1)[1 : n + 1].astype(np.float64)
    outside = np.bincount(masks.labels[~known], minlength=n + 1)[1 : n + 1]
    scale = np.float64(_VGA / ids.size)
    return ViewMasks(
        wanted,
        iou,
        np.asarray(masks.scores, np.float64),
        np.array([(ids == i).sum() for i in kept], np.float64) * scale,
        pixels * scale,
        outside > _MOSTLY * pixels,
    )


def verdicts(view: ViewMasks, threshold: float, low: float = 0.0, high: float = np.inf) -> npt.NDArray[np.int8]:
    """TRUE, FALSE or LEFT_OUT for each mask (n,): the surer chooses first, the thing of the best IoU that is still free.

    Of things and masks outside ``low <= pixels < high``, as COCO has it: a mask that matches such a thing, or is such a one and
    matches nothing, is left out.
    """
    wanted = (view.thing_pixels >= low) & (view.thing_pixels < high)
    free = np.ones(len(view.things), bool)
    out = np.full(len(view.scores), FALSE, np.int8)
    for k in np.argsort(-view.scores, kind="stable").tolist():
        iou = view.iou[:, k]
        matches = free & (iou >= threshold)
        if not matches.any():
            if view.ignored[k] or not low <= view.mask_pixels[k] < high:
                out[k] = LEFT_OUT
            continue
        of_size = matches & wanted
        chosen = int(np.where(of_size if of_size.any() else matches, iou, -1.0).argmax())
        free[chosen] = False
        out[k] = TRUE if wanted[chosen] else LEFT_OUT
    return out


class RankedMasks:
    """All masks of a set of views, surest first, with their verdict at every threshold; equal scores keep the views' order.

    Parameters
    ----------
    views : sequence of ViewMasks
    low, high : float
        Which things count, px of a 640 x 480 picture.
    """

    def __init__(self, views: Sequence[ViewMasks], low: float = 0.0, high: float = np.inf) -> None:
        scores = np.concatenate([v.scores for v in views]) if views else np.zeros(0)
        order = np.argsort(-scores, kind="stable")
        self.view = np.repeat(np.arange(len(views)), [len(v.scores) for v in views])[order]
        rows = [np.concatenate([verdicts(v, t, low, high) for v in views]) for t in THRESHOLDS] if views else []
        self.verdict = np.array(rows, np.int8).reshape(len(THRESHOLDS), -1)[:, order]
        self.things = np.array([((v.thing_pixels >= low) & (v.thing_pixels < high)).sum() for v in views], np.int64)

    def average_precision(self, times: npt.NDArray[np.integer] | None = None) -> npt.NDArray[np.float64]:
        """AP at each of ``THRESHOLDS``, (10,); NaN where there is nothing to find. ``times`` (views,) counts each view so often."""
        times = np.ones(len(self.things), np.int64) if times is None else times
        total = int((self.things * times).sum())
        if total == 0:
            return np.full(len(THRESHOLDS), np.nan)
        weight = times[self.view]
        found = np.cumsum((self.verdict == TRUE) * weight, axis=1)
        wrong = np.cumsum((self.verdict == FALSE) * weight, axis=1)
        return np.array([interpolated_precision(f, w, total) for f, w in zip(found, wrong, strict=True)])


def interpolated_precision(found: npt.NDArray[np.integer], wrong: npt.NDArray[np.integer], total: int) -> float:
    """Mean over 101 recalls of the best precision at that recall or beyond; running counts (p,) down the ranking."""
    if not len(found):
        return 0.0
    precision = found / np.maximum(found + wrong, 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    place = np.searchsorted(found / total, _RECALLS, side="left")
    return float(np.append(envelope, 0.0)[place].mean())


def mask_figures(views: Sequence[ViewMasks], seed: int = 0) -> dict[str, dict[str, Figure]]:
    """For each of ``SIZES``: AP, AP50, AP75, best IoU, recall@.5; views are what is drawn for the intervals."""
    return {size: found for size, bounds in SIZES.items() if (found := _of_size(views, bounds, seed))}


def _of_size(views: Sequence[ViewMasks], bounds: tuple[float, float], seed: int) -> dict[str, Figure]:
    low, high = bounds
    ranked = RankedMasks(views, low, high)
    things = int(ranked.things.sum())
    if not things:
        return {}
    picks = draws(len(views), seed, _RESAMPLES)
    times = (np.bincount(p, minlength=len(views)) for p in picks)
    again = np.stack([ranked.average_precision(t) for t in times])
    value = ranked.average_precision()
    figures = {}
    for name, columns in (("AP", slice(None)), ("AP50", slice(0, 1)), ("AP75", slice(5, 6))):
        figures[name] = Figure(float(value[columns].mean()), *interval(again[:, columns].mean(1)), things)
    kept = [(v.thing_pixels >= low) & (v.thing_pixels < high) for v in views]
    best = np.concatenate([v.best[k] for v, k in zip(views, kept, strict=True)])
    of_view = np.repeat(np.arange(len(views)), ranked.things)
    for name, values in (("best IoU", best), ("recall@.5", best >= 0.5)):
        figure = mean_figure(values, of_view, seed)
        assert figure is not None
        figures[name] = figure
    return figures
