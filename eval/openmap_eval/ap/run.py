"""What ``openmap ap`` does: read, score, print, write."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console
from rich.table import Table

from openmap_agents.perception.scannet200 import INSTANCE_CLASSES, NAME_OF
from openmap_eval.ap.command import Ap
from openmap_eval.ap.format import write_proposals
from openmap_eval.ap.protocol import THRESHOLDS, APScores, Score, average_precision
from openmap_eval.ap.sources import Sources
from openmap_eval.records import write_json
from openmap_scenes import DataError
from openmap_scenes.taxonomy import scannet200_group


def run_ap(command: Ap, console: Console) -> None:
    """Score predictions against the truth; DataError where either cannot be used."""
    if command.min_points < 1 or not (command.reach is None or 0 < command.reach < math.inf):
        found = f"--min-points {command.min_points}, --reach {command.reach}"
        raise DataError("the command line", found, "at least 1, and more than 0 m")
    sources = Sources(
        command.predictions, command.truth, command.points, command.class_agnostic, command.reach, command.ranked
    )
    names, scans = sources.scans(), []
    for name in names:
        proposals, truth = sources.read(name)
        scans.append((proposals, truth))
        if command.write_format is not None:
            # What has no label can only be scored without.
            kept = [p for p in proposals if command.class_agnostic or p.category > 0]
            write_proposals(command.write_format, name, kept, len(truth))
    classes = None if command.class_agnostic else INSTANCE_CLASSES
    scores = average_precision(
        scans, class_agnostic=command.class_agnostic, min_points=command.min_points, classes=classes
    )
    console.print(scores_table(scores, len(names), command.per_class))
    if math.isnan(scores.ap):
        console.print("the truth has no instance that is scored")
    if command.out is not None:
        command.out.parent.mkdir(parents=True, exist_ok=True)
        head = {"scans": names, "class_agnostic": command.class_agnostic, "min_points": command.min_points}
        write_json(command.out, {**head, "ranked": command.ranked, **as_document(scores)})


def scores_table(scores: APScores, n_scans: int, per_class: bool) -> Table:
    """All, groups and, if wanted, classes; in percent."""
    agnostic = not scores.groups
    what = "class-agnostic" if agnostic else "ScanNet200"
    table = Table(
        title=f"Average precision, {what}, {n_scans} scan{'s' if n_scans != 1 else ''} (%)",
        title_justify="left",
        pad_edge=False,
    )
    table.add_column("instances of", no_wrap=True)
    for name in ("AP", "AP50", "AP25", "instances", "proposals"):
        table.add_column(name, justify="right")
    of_classes = [s for s in scores.by_class.values() if s.n_truth]
    counts = [sum(s.n_truth for s in of_classes), sum(s.n_proposals for s in scores.by_class.values())]
    table.add_row("everything" if agnostic else "all classes, mean", *_cells(scores), *map(str, counts), style="bold")
    for group, score in scores.groups.items():
        mine = [s for c, s in scores.by_class.items() if scannet200_group(NAME_OF[c]) == group]
        counts = [sum(s.n_truth for s in mine), sum(s.n_proposals for s in mine)]
        table.add_row(group, *_cells(score), *map(str, counts))
    if per_class and not agnostic:
        table.add_section()
        for category, one in scores.by_class.items():
            table.add_row(NAME_OF[category], *_cells(one), str(one.n_truth), str(one.n_proposals))
    return table


def as_document(scores: APScores) -> dict[str, Any]:
    """The scores as JSON, 0..1, null where there was nothing to find."""
    classes = [
        {
            "number": category,
            "name": NAME_OF.get(category, ""),
            "group": scannet200_group(NAME_OF[category]) if category in NAME_OF else "",
            **_fields(one),
            "instances": one.n_truth,
            "proposals": one.n_proposals,
            "by_threshold": [_finite(value) for value in one.by_threshold],
        }
        for category, one in scores.by_class.items()
    ]
    groups = {group: _fields(score) for group, score in scores.groups.items()}
    return {**_fields(scores), "groups": groups, "thresholds": [round(t, 2) for t in THRESHOLDS], "classes": classes}


def _cells(score: Score) -> list[str]:
    return ["-" if math.isnan(v) else f"{100 * v:.1f}" for v in (score.ap, score.ap50, score.ap25)]


def _fields(score: Score) -> dict[str, float | None]:
    return {"ap": _finite(score.ap), "ap50": _finite(score.ap50), "ap25": _finite(score.ap25)}


def _finite(value: float) -> float | None:
    return None if math.isnan(value) else value
