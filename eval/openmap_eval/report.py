"""Records and pictures -> one self-contained HTML page."""

from __future__ import annotations

import base64
import mimetypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from openmap_eval.records import STAGES, EpisodeRecord, write_atomically
from openmap_eval.summary import lost_at
from openmap_eval.traces import laid_out

KS = (1, 4, 8, 16)
COLUMNS = {
    "sr_1": "SR",
    "sr_4": "SR₄",
    "sr_8": "SR₈",
    "sr_16": "SR₁₆",
    "sr_surface_1": "SR to the box",
}
WALKED_COLUMNS = {"nav_success": "stopped there", "spl": "SPL"}
"""Say something only where every episode is walked by itself."""
KIND_NAMES = {"object_goal": "object goal", "demand": "demand-driven", "language_guided": "language-guided"}
ORACLE = "ORACLE · "
"""Before every title of what comes from a run in which something was read from the simulator."""
LARGEST_VIDEO = 24 * 2**20


def write_report(
    path: Path,
    summary: Mapping[str, Any],
    records: Sequence[EpisodeRecord],
    *,
    maps: Mapping[str, Path] | None = None,
    heatmaps: Mapping[str, Path] | None = None,
    video: Path | None = None,
) -> None:
    """Write the page of an evaluation; pictures are embedded, captions are the mappings' keys.

    A video over 24 MiB is left out, since browsers hold an embedded one in memory.
    """
    settings = summary["settings"]
    oracle = oracle_note(settings)
    stages, lost = lost_rows(summary)
    columns = COLUMNS if settings["protocol"] == "retrieval" else COLUMNS | WALKED_COLUMNS
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("openmap_eval"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    page = environment.get_template("report.html").render(
        title=(ORACLE if oracle else "") + "OpenMapNav evaluation",
        oracle=oracle,
        settings=settings,
        summary=summary,
        columns=list(columns.values()),
        rows=_rows(summary, columns),
        drawn=summary.get("intervals_over", "scenes" if len(summary["scenes"]) > 1 else "episodes"),
        stages=stages,
        lost=lost,
        ks=[f"@{k}" for k in KS],
        episodes=[_episode(record) for record in records],
        maps=_pictures(maps),
        heatmaps=_pictures(heatmaps),
        video=_embedded(video) if video and video.stat().st_size <= LARGEST_VIDEO else None,
    )
    write_atomically(path, page.encode())


def oracle_note(settings: Mapping[str, Any]) -> str:
    """What of a run was read from the simulator instead of perceived; empty where nothing was."""
    if settings["agent"] == "oracle_map":
        return "the agent's map comes from the simulator, not from pixels."
    if settings["agent"].startswith("oracle"):
        return "the agent reads the answers from the simulator."
    told = [
        (what, f" (noise: {noise})" if noise else "")
        for key, what in (("segmenter", "masks"), ("encoder", "names"))
        for family, _, noise in [str(settings[key]).partition(":")]
        if family == "oracle"
    ]
    if len(told) == 2 and told[0][1] == told[1][1]:
        return f"masks and names come from the simulator{told[0][1]}, not from pixels."
    if not told:
        return ""
    return " and ".join(what + noise for what, noise in told) + " come from the simulator, not from pixels."


def first_answer(record: EpisodeRecord) -> tuple[str, float | None]:
    """What the agent named first, and how far (m) that is from the centre of the nearest valid target."""
    if not record.answer:
        return "(where it stands)", None
    place = np.asarray(record.answer[0]["position"])
    distances = [float(np.linalg.norm(place - np.asarray(t["centre"]))) for t in record.targets]
    return record.answer[0]["label"], min(distances, default=None)


def target_names(record: EpisodeRecord) -> str:
    """The categories of the valid targets, with how many of each there are."""
    names = [t["category"] for t in record.targets]
    counted = {name: names.count(name) for name in dict.fromkeys(names)}
    return ", ".join(name if n == 1 else f"{name} × {n}" for name, n in counted.items())


def lost_rows(summary: Mapping[str, Any]) -> tuple[list[str], list[dict[str, Any]]]:
    """The stages, and a row for each kind with how many failed episodes each of them lost; no rows where no stage is known."""
    lost = summary.get("lost_at")
    if not lost or not any(lost["all"].get(stage) for stage in STAGES):
        return [], []
    stages = list(lost["all"])
    groups = {
        KIND_NAMES.get(kind, kind): (values, lost["by_kind"][kind]) for kind, values in summary["by_kind"].items()
    }
    groups["all"] = (summary, lost["all"])
    return stages, [
        {"kind": kind, "episodes": values["episodes"], "counts": [counts.get(stage, 0) for stage in stages]}
        for kind, (values, counts) in groups.items()
    ]


def _rows(summary: Mapping[str, Any], columns: Mapping[str, str]) -> list[dict[str, Any]]:
    groups = {KIND_NAMES.get(kind, kind): values for kind, values in summary["by_kind"].items()}
    groups["all"] = {"episodes": summary["episodes"], **summary["all"]}
    empty = {"mean": float("nan"), "low": float("nan"), "high": float("nan")}
    return [
        {"kind": kind, "episodes": values["episodes"], "cells": [values.get(name, empty) for name in columns]}
        for kind, values in groups.items()
    ]


def _episode(record: EpisodeRecord) -> dict[str, Any]:
    label, distance = first_answer(record)
    return {
        "instruction": record.instruction,
        "kind": KIND_NAMES.get(record.kind, record.kind),
        "scene": record.scene,
        "episode_id": record.episode_id,
        "answer": label,
        "target": target_names(record),
        "distance": "-" if distance is None else f"{distance:.2f} m",
        "hits": [(record.metrics.get(f"sr_{k}") or 0.0) >= 1.0 for k in KS],
        "lost_at": lost_at(record) or "",
        "evidence": ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in record.evidence.items()),
        "trace": laid_out(record.trace),
    }


def _pictures(paths: Mapping[str, Path] | None) -> list[dict[str, str]]:
    return [{"caption": caption, "data": _embedded(path)} for caption, path in (paths or {}).items()]


def _embedded(path: Path) -> str:
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
