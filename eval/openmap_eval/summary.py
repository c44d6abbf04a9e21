"""Episode records -> the figures that are reported: means by kind, with 95 % bootstrap intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from openmap_eval.records import EpisodeRecord

RESAMPLES = 2000


def summarise(records: Sequence[EpisodeRecord], seed: int = 0) -> dict[str, Any]:
    """Means of every measure over all episodes and by kind.

    Intervals resample whole scenes where there are several, because episodes of one scene share one map, and episodes otherwise.

    Returns
    -------
    dict
        ``{"episodes": n, "all": {measure: {"mean", "low", "high"}}, "by_kind": {kind: {"episodes": n, measure: ...}}}``
    """
    kinds = sorted({record.kind for record in records})
    return {
        "episodes": len(records),
        "scenes": sorted({record.scene for record in records}),
        "all": _means(records, seed),
        "by_kind": {
            kind: {
                "episodes": sum(r.kind == kind for r in records),
                **_means([r for r in records if r.kind == kind], seed),
            }
            for kind in kinds
        },
    }


def _means(records: Sequence[EpisodeRecord], seed: int) -> dict[str, Any]:
    names = sorted(set.intersection(*(set(r.metrics) for r in records))) if records else []
    result = {}
    for name in names:
        values = [(r.scene, value) for r in records if (value := r.metrics[name]) is not None]
        if values:
            result[name] = _mean_and_interval(values, seed)
    return result


def _mean_and_interval(values: Sequence[tuple[str, float]], seed: int) -> dict[str, float]:
    """Of (scene, value) pairs."""
    numbers = np.array([value for _, value in values], np.float64)
    names = sorted({scene for scene, _ in values})
    group = np.array([names.index(scene) for scene, _ in values]) if len(names) > 1 else np.arange(len(values))
    sums, counts = np.bincount(group, weights=numbers), np.bincount(group)
    picks = np.random.default_rng(seed).integers(len(sums), size=(RESAMPLES, len(sums)))
    means = sums[picks].sum(1) / counts[picks].sum(1)
    low, high = np.percentile(means, [2.5, 97.5])
    return {"mean": float(numbers.mean()), "low": float(low), "high": float(high)}
