"""Curves of AP against what goes wrong on a robot, for both kinds of consensus, without features: as jobs, tables and a figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from openmap_agents.mapping.settings import Consensus
from openmap_eval.mapping.inputs import MaskSpec
from openmap_eval.mapping.jobs import Job, Store, mean_of
from openmap_eval.mapping.noise import Trouble
from openmap_eval.mapping.table import CONSENSUS, percent, short
from openmap_eval.mapping.walks import WalkSpec
from openmap_eval.perception.tables import Cell, TextTable

COLOURS: dict[Consensus, str] = {"soft": "#0072b2", "paper": "#d55e00"}
"""Apart for colour-blind eyes too."""


@dataclass(frozen=True)
class Level:
    """A step of a curve: what stands below it, what goes wrong, and how bad the masks are."""

    name: str
    trouble: Trouble = field(default_factory=Trouble)
    strength: float = 1.0


CURVES: dict[str, tuple[Level, ...]] = {
    "depth noise": tuple(
        Level(f"{9e3 * sigma:.0f} mm, {holes:.0%}", Trouble(depth_sigma=sigma, holes=holes))
        for sigma, holes in ((0.0, 0.0), (0.001, 0.02), (0.002, 0.05), (0.004, 0.1), (0.008, 0.2))
    ),
    "pose drift": tuple(
        Level(f"{100 * m:g} cm, {deg:g}°", Trouble(drift=m, drift_deg=deg))
        for m, deg in ((0.0, 0.0), (0.02, 0.5), (0.05, 1.0), (0.1, 2.0), (0.2, 4.0))
    ),
    "pose jitter": tuple(
        Level(f"{100 * m:g} cm, {deg:g}°", Trouble(jitter=m, jitter_deg=deg))
        for m, deg in ((0.0, 0.0), (0.005, 0.1), (0.01, 0.25), (0.02, 0.5), (0.04, 1.0))
    ),
    "mask corruption": tuple(Level(f"x {s:g}", strength=s) for s in (0.0, 0.5, 1.0, 1.5, 2.0)),
    "dropped frames": tuple(Level(f"1/{k}", Trouble(keep_every=k)) for k in (1, 2, 4, 8)),
    "frame order": (
        Level("as walked"), *(Level(f"shuffled {k}", Trouble(shuffle=k)) for k in (1, 2, 3)),
    ),
}  # fmt: skip
AXES = {
    "depth noise": "standard error at 3 m, share of holes",
    "pose drift": "random walk, standard deviation at its end",
    "pose jitter": "standard deviation, each frame anew",
    "mask corruption": "times a good segmenter's faults",
    "dropped frames": "share of the frames that is kept",
    "frame order": "",
}


def curves(quick: bool) -> dict[str, tuple[Level, ...]]:
    """All levels, or the ends and the middle of each."""
    if not quick:
        return CURVES
    return {
        name: tuple(levels[k] for k in sorted({0, len(levels) // 2, len(levels) - 1}))
        for name, levels in CURVES.items()
    }


def curve_jobs(walk: WalkSpec, seed: int, quick: bool) -> dict[tuple[str, str, Consensus], Job]:
    """(curve, level, consensus) -> a map of the walk."""
    return {
        (curve, level.name, c): Job(
            walk, MaskSpec(strength=level.strength, seed=seed if level.strength else 0),
            consensus=c, trouble=level.trouble, seed=seed,
        )
        for curve, levels in curves(quick).items() for level in levels for c in CONSENSUS
    }  # fmt: skip


def curve_rows(walks: Sequence[WalkSpec], store: Store, seed: int, quick: bool) -> list[dict[str, Any]]:
    """Scores of every level, for JSON."""
    return [
        {
            "curve": curve, "level": level, "consensus": c, "walk": walk.source, "masks": job.masks.name,
            **{name: store[job][name] for name in ("ap", "ap50", "ap25", "ranked", "instances")},
        }
        for walk in walks for (curve, level, c), job in curve_jobs(walk, seed, quick).items()
    ]  # fmt: skip


def curve_tables(rows: Sequence[dict[str, Any]]) -> list[TextTable]:
    """One table a curve: AP, AP50 and AP25 of both."""
    tables = []
    columns = tuple(f"{c} {name}" for c in CONSENSUS for name in ("AP", "AP50", "AP25"))
    for curve in dict.fromkeys(r["curve"] for r in rows):
        mine = [r for r in rows if r["curve"] == curve]
        lines = []
        for level in dict.fromkeys(r["level"] for r in mine):
            values = [
                mean_of([r for r in mine if (r["level"], r["consensus"]) == (level, c)], "ap", "ap50", "ap25").tolist()
                for c in CONSENSUS
            ]
            lines.append((level, [Cell(percent(v)) for part in values for v in part]))
        note = f"{AXES[curve]}; %, mean of walks, corrupted masks, no features.".lstrip("; ")
        tables.append(TextTable(f"Robustness: {curve}", note, columns, lines))
    return tables


def draw(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """All curves in one picture: thick lines are means of walks, thin ones single walks."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(r["curve"] for r in rows))
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    panels = np.atleast_1d(figure.subplots(2, -(-len(names) // 2), sharey=True, squeeze=False)).ravel()
    walks = list(dict.fromkeys(r["walk"] for r in rows))
    for panel, curve in zip(panels, names, strict=False):
        mine = [r for r in rows if r["curve"] == curve]
        levels = list(dict.fromkeys(r["level"] for r in mine))
        # Seeds of an order are no steps of anything.
        style = "" if curve == "frame order" else "-"
        for c in CONSENSUS:
            points = {
                w: [100 * r["ap"] for n in levels for r in mine if (r["level"], r["consensus"], r["walk"]) == (n, c, w)]
                for w in walks
            }
            for values in points.values():
                panel.plot(range(len(levels)), values, f"{style}.", color=COLOURS[c], alpha=0.35, linewidth=1)
            panel.plot(
                range(len(levels)),
                np.mean(list(points.values()), axis=0),
                f"{style}o",
                color=COLOURS[c],
                linewidth=2.2,
                label=c,
            )
        panel.set_xticks(range(len(levels)), [level.replace(", ", "\n") for level in levels], fontsize=8)
        panel.set(title=curve, xlabel=AXES[curve])
        panel.grid(alpha=0.3)
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    for panel in panels[:: -(-len(names) // 2)]:
        panel.set_ylabel("AP on things, %")
    panels[0].set_ylim(bottom=0)
    panels[0].legend(title="consensus")
    shown = ", ".join(map(short, walks))
    which = f"{shown} (thin) and their mean (thick)" if len(walks) > 1 else shown
    figure.suptitle(f"Maps without features, corrupted masks; {which}", fontsize=11)
    unfinished = path.with_name(f".{path.name}.tmp")
    figure.savefig(unfinished, dpi=110, format="png", metadata={"Software": None})
    unfinished.replace(path)
