"""Figures of ``openmap bench map``: what the times of single frames come to, and the tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

CLOCKS = ("wall", "cpu")


def spread(milliseconds: Sequence[float]) -> dict[str, float]:
    """Median and 90th percentile."""
    values = np.asarray(milliseconds, np.float64)
    if len(values) == 0:
        return {"median": float("nan"), "p90": float("nan")}
    return {"median": float(np.median(values)), "p90": float(np.percentile(values, 90))}


def summary_of_walk(found: dict[str, Any], window: int) -> dict[str, Any]:
    """Of the first and last ``window`` frames, of all of them and of those that were used alone, and of every such stretch.

    A ratio is the late median over the early one; None where a stretch has no frame that was used.
    """
    used = np.array(found["used"], bool)
    times = {clock: np.array(found[f"{clock}_ms"]) for clock in CLOCKS}
    n = len(used)

    def part(start: int, stop: int) -> dict[str, Any]:
        inside, own = np.arange(start, min(stop, n)), used[start:stop]
        out: dict[str, Any] = {"frames": [start + 1, min(stop, n)], "used": int(own.sum())}
        for clock, values in times.items():
            out[clock] = spread(values[inside].tolist())
            out[f"{clock}_of_used"] = spread(values[inside][own].tolist()) if own.any() else None
        return out

    early, late = part(0, window), part(n - window, n)
    ratio: dict[str, float | None] = {}
    for clock in CLOCKS:
        ratio[clock] = late[clock]["median"] / early[clock]["median"]
        a, b = early[f"{clock}_of_used"], late[f"{clock}_of_used"]
        ratio[f"{clock}_of_used"] = b["median"] / a["median"] if a and b else None
    kept = ("asked", "finalize_seconds", "cpu_seconds", "instances", "voxels", "before_mib", "peak_mib")
    return {
        "frames": n,
        "frames_used": int(used.sum()),
        "all": part(0, n),
        "early": early,
        "late": late,
        "late over early": ratio,
        "stretches": [part(start, start + window) for start in range(0, n, window)],
        **{name: found[name] for name in kept},
    }


def tables(result: dict[str, Any]) -> list[Table]:
    """For the terminal."""
    settings, walk = result["settings"], result["long walk"]
    size = f"{settings['width']} x {settings['height']}, threads: {settings['threads']}"
    frames = _table(
        f"{settings['scene']}, {size}: ms a frame of {walk['frames']}, {settings['consensus']} consensus",
        ("frames", "used", "wall median", "p90", "CPU median", "p90", "CPU median of used", "p90"),
    )
    for stretch in walk["stretches"]:
        frames.add_row(*_stretch(stretch))
    frames.add_section()
    frames.add_row(*_stretch(walk["all"]))
    ratio = walk["late over early"]
    of_used = ratio["cpu_of_used"]
    frames.caption = (
        f"last {settings['window']} over first {settings['window']}, medians: wall {ratio['wall']:.2f}, "
        f"CPU {ratio['cpu']:.2f}, of used frames {'–' if of_used is None else f'{of_used:.2f}'} CPU; "
        f"finalize {walk['finalize_seconds']['wall']:.2f} s; {walk['voxels']} voxels, {walk['instances']} instances; "
        f"{walk['before_mib']:.0f} MiB before the first frame, {walk['peak_mib']:.0f} at most"
    )
    out = [frames]
    if walk["asked"]:
        asked = _table("Asking for the instances on the way", ("after frame", "wall ms", "CPU ms", "instances", "MiB"))
        for row in walk["asked"]:
            cells = (f"{row['wall']:.0f}", f"{row['cpu']:.0f}", str(row["instances"]), f"{row['mib']:.0f}")
            asked.add_row(str(row["after"]), *cells)
        out.append(asked)
    out.append(_maps(f"A map of {settings['job_frames']} frames of one round", result["one round"]))
    if result["small"]:
        few = f"Every eighth pixel of {settings['reference_frames']} of these frames, {settings['consensus']} consensus"
        out.append(_maps(few, result["small"]))
    return out


def _maps(title: str, rows: dict[str, Any]) -> Table:
    table = _table(title, ("", "CPU s", "ms a frame, median", "p90", "used", "instances", "MiB before", "MiB at most"))
    for name, row in rows.items():
        ms = row.get("ms", {}).get("wall")
        cells = [f"{ms['median']:.1f}", f"{ms['p90']:.1f}", str(row["frames_used"])] if ms else ["–"] * 3
        memory = f"{row['before_mib']:.0f}", f"{row['peak_mib']:.0f}"
        table.add_row(name, f"{row['cpu_seconds']:.2f}", *cells, str(row["instances"]), *memory)
    return table


def _stretch(part: dict[str, Any]) -> list[str]:
    own = part["cpu_of_used"]
    cells = [f"{part['frames'][0]}-{part['frames'][1]}", str(part["used"])]
    cells += [f"{part[clock][name]:.1f}" for clock in CLOCKS for name in ("median", "p90")]
    return cells + (["–", "–"] if own is None else [f"{own['median']:.1f}", f"{own['p90']:.1f}"])


def _table(title: str, columns: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", pad_edge=False)
    for number, name in enumerate(columns):
        table.add_column(name, justify="left" if number == 0 else "right")
    return table
