"""Episode records -> the figures that are reported: means by kind, with 95 % bootstrap intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from openmap_eval.bootstrap import mean_figure
from openmap_eval.records import EpisodeRecord


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
    names = sorted({scene for scene, _ in values})
    units = [names.index(scene) for scene, _ in values] if len(names) > 1 else None
    figure = mean_figure([value for _, value in values], units, seed)
    assert figure is not None  # there are values
    return {"mean": figure.value, "low": figure.low, "high": figure.high}
