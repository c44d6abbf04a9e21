"""Episode records -> the figures that are reported: means by kind with 95 % bootstrap intervals, and what was lost where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from openmap_eval.bootstrap import mean_figure
from openmap_eval.records import STAGES, EpisodeRecord

UNKNOWN = "unknown"
"""Where a failure is counted that no stage is known of."""


def summarise(records: Sequence[EpisodeRecord], seed: int = 0) -> dict[str, Any]:
    """Means of every measure over all episodes and by kind, and how many failures each stage is to blame for.

    Intervals resample whole scenes where there are several, because episodes of one scene share one map, and episodes otherwise.

    Returns
    -------
    dict
        ``{"episodes": n, "scenes": [...], "intervals_over": "scenes" or "episodes", "all": {measure: figure}, "by_kind":
        {kind: {"episodes": n, measure: figure}}, "lost_at": {"all": {stage: n}, "by_kind": {kind: {stage: n}}}}``; a figure is
        ``{"mean", "low", "high", "over"}``, and ``over`` says what its own interval resamples.
    """
    kinds = sorted({record.kind for record in records})
    return {
        "episodes": len(records),
        "scenes": sorted({record.scene for record in records}),
        "intervals_over": _drawn(records),
        "all": _means(records, seed),
        "by_kind": {
            kind: {
                "episodes": sum(r.kind == kind for r in records),
                **_means([r for r in records if r.kind == kind], seed),
            }
            for kind in kinds
        },
        "lost_at": {
            "all": losses(records),
            "by_kind": {kind: losses([r for r in records if r.kind == kind]) for kind in kinds},
        },
    }


def losses(records: Sequence[EpisodeRecord]) -> dict[str, int]:
    """How many episodes each stage lost, in the order of the stages; ``UNKNOWN`` last, where there are such."""
    stages = [stage for record in records if (stage := lost_at(record))]
    return {stage: stages.count(stage) for stage in (*STAGES, UNKNOWN) if stage != UNKNOWN or UNKNOWN in stages}


def lost_at(record: EpisodeRecord) -> str | None:
    """The stage that lost an episode; None for a success, ``UNKNOWN`` for a failure of which the record does not say."""
    failed = record.metrics.get("sr_1") == 0.0
    return record.lost_at or (UNKNOWN if failed else None)


def _drawn(records: Sequence[EpisodeRecord]) -> str:
    return "scenes" if len({record.scene for record in records}) > 1 else "episodes"


def _means(records: Sequence[EpisodeRecord], seed: int) -> dict[str, Any]:
    names = sorted(set.intersection(*(set(r.metrics) for r in records))) if records else []
    result = {}
    for name in names:
        values = [(r.scene, value) for r in records if (value := r.metrics[name]) is not None]
        if values:
            result[name] = _mean_and_interval(values, seed)
    return result


def _mean_and_interval(values: Sequence[tuple[str, float]], seed: int) -> dict[str, Any]:
    """Of (scene, value) pairs."""
    names = sorted({scene for scene, _ in values})
    units = [names.index(scene) for scene, _ in values] if len(names) > 1 else None
    figure = mean_figure([value for _, value in values], units, seed)
    assert figure is not None  # there are values
    over = "episodes" if units is None else "scenes"
    return {"mean": figure.value, "low": figure.low, "high": figure.high, "over": over}
