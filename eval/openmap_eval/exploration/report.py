"""Runs ``openmap eval exploration``: walks, and the table, the JSON file and the curve that come of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from openmap_eval.bootstrap import Figure, mean_figure
from openmap_eval.exploration.command import EvalExploration
from openmap_eval.exploration.walk import Walked, WalkSettings, as_walked, simulator_of, starts_of, walk
from openmap_eval.perception.tables import Cell, TextTable, percent, rich_table
from openmap_eval.records import write_atomically, write_json
from openmap_scenes import DataError, load_scene

STUCK = 20
"""A run of more steps than this without moving or turning is being stuck."""
ASKED = 0.95
"""The share of a home's things that a walk should show within its steps."""
CURVE = "coverage.png"


def run_eval_exploration(command: EvalExploration, console: Console) -> None:
    """Walk, print the tables, write ``exploration.json`` and the curve."""
    specs = _specs(command)
    settings = WalkSettings(
        command.pixels, command.width, command.height, command.max_steps, command.renderer, command.seed
    )
    try:
        command.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError("--out", f"{command.out} ({error.strerror})", "a folder, or a place to make one") from None
    walks = []
    for walked in _walks(specs, command, settings):
        walks.append(walked)
        late = walked.coverage(budget(walked, command))
        console.print(f"{walked.scene}, start {walked.start}: {late:.1%} in {walked.steps} steps", highlight=False)
    for table in (homes_table(walks, command), missed_table(walks)):
        console.print(rich_table(table))
        console.print()
    write_json(command.out / "exploration.json", document(walks, command, settings))
    draw(walks, command, command.out / CURVE)
    console.print(f"written: exploration.json, {CURVE} and walks.jsonl in {command.out}", soft_wrap=True)


def _specs(command: EvalExploration) -> list[str]:
    """The scenes; DataError where the command line makes no sense."""
    for name, least in (
        ("homes", 1), ("episodes", 1), ("pixels", 1), ("width", 32), ("height", 32), ("max_steps", 1), ("first", 0),
    ):  # fmt: skip
        if getattr(command, name) < least:
            raise DataError(f"--{name.replace('_', '-')}", str(getattr(command, name)), f"at least {least}")
    for name in ("steps", "per_area"):
        if not getattr(command, name) > 0:
            raise DataError(f"--{name.replace('_', '-')}", str(getattr(command, name)), "more than 0")
    if bool(command.scene) == (command.split is not None):
        found = "both --scene and --split" if command.scene else "neither --scene nor --split"
        raise DataError("the command line", found, "one of them")
    if command.scene:
        return list(dict.fromkeys(command.scene))
    split = str(command.split).partition("/")[2]
    return [f"homes:{split}/{n}" for n in range(command.first, command.first + command.homes)]


def _walks(specs: Sequence[str], command: EvalExploration, settings: WalkSettings) -> Iterator[Walked]:
    """Every walk that was asked for, in order; those that the folder has are read from there."""
    path = command.out / "walks.jsonl"
    kept = _read(path, settings)
    for spec in specs:
        todo = [n for n in range(command.episodes) if (spec, n) not in kept]
        if todo:
            simulator = simulator_of(load_scene(spec), settings)
            try:
                starts = starts_of(spec, simulator.surface, command.episodes, settings.seed)
                for n in todo:
                    if n < len(starts):
                        kept[spec, n] = walk(spec, n, starts[n], simulator, settings)
                        _write(path, settings, kept)
            finally:
                simulator.close()
        yield from (kept[spec, n] for n in range(command.episodes) if (spec, n) in kept)


def _described(settings: WalkSettings) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(json.dumps(asdict(settings)))
    return document


def _read(path: Path, settings: WalkSettings) -> dict[tuple[str, int], Walked]:
    if not path.is_file():
        return {}
    try:
        first, *lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        walks = [as_walked(line) for line in lines]
    except (ValueError, TypeError) as error:
        raise DataError(path, f"no walks ({error})", "one JSON object a line", "Give another --out.") from error
    if first != {"settings": _described(settings)}:
        raise DataError(path, "walks with other settings", "the settings of this run", "Give another --out.")
    return {(w.scene, w.start): w for w in walks}


def _write(path: Path, settings: WalkSettings, walks: dict[tuple[str, int], Walked]) -> None:
    lines = [{"settings": _described(settings)}, *(asdict(w) for w in walks.values())]
    text = "".join(json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n" for line in lines)
    write_atomically(path, text.encode())


def budget(walked: Walked, command: EvalExploration) -> float:
    """Steps after which a walk's coverage is judged."""
    return command.steps * walked.area / command.per_area


def over_homes(walks: Sequence[Walked], values: Sequence[float], seed: int) -> Figure | None:
    """The mean and its interval, all walks of a home drawn together."""
    homes = {spec: k for k, spec in enumerate(dict.fromkeys(w.scene for w in walks))}
    return mean_figure(values, [homes[w.scene] for w in walks], seed)


def homes_table(walks: Sequence[Walked], command: EvalExploration) -> TextTable:
    """A row a home, and the mean of all."""
    rows = []
    for spec in dict.fromkeys(w.scene for w in walks):
        mine = [w for w in walks if w.scene == spec]
        rows.append((spec, [Cell(text) for text in _row(mine, command)]))
    late = [w.coverage(budget(w, command)) for w in walks]
    whole = [w.coverage(w.steps) for w in walks]
    reached = [float(min(late[k] for k, w in enumerate(walks) if w.scene == s) >= ASKED) for s in _homes(walks)]
    rows.append(
        (
            "all",
            [
                Cell(f"{np.mean([w.area for w in walks]):.0f}"),
                Cell(f"{np.mean([len(w.seen_at) for w in walks]):.0f}"),
                percent(over_homes(walks, late, command.seed)),
                percent(over_homes(walks, whole, command.seed)),
                Cell(f"{np.mean([budget(w, command) for w in walks]):.0f}"),
                Cell(f"{np.mean([w.steps for w in walks]):.0f}"),
                Cell(str(max(w.still for w in walks))),
                Cell(str(max(w.loitered for w in walks))),
            ],
        )
    )
    note = (
        f"%, of the things that can be asked for, seen with {command.pixels} px of 640 x 480 or more; within the budget of"
        f" {command.steps:g} steps per {command.per_area:g} m2, and on the whole walk. Mean and worst of a home's walks; intervals:"
        f" homes drawn again. {int(sum(reached))} of {len(reached)} homes with {ASKED:.0%} or more on every walk;"
        f" {sum(w.still > STUCK for w in walks)} of {len(walks)} walks stuck for more than {STUCK} steps."
    )
    columns = ("m2", "things", "in budget", "whole walk", "budget", "steps", "still", "loitered")
    return TextTable("Coverage", note, columns, rows)


def _row(mine: Sequence[Walked], command: EvalExploration) -> list[str]:
    late = [100 * w.coverage(budget(w, command)) for w in mine]
    whole = [100 * w.coverage(w.steps) for w in mine]
    worst = f" (worst {min(late):.1f})" if len(mine) > 1 else ""
    steps = f"{np.mean([w.steps for w in mine]):.0f}" + ("" if all(w.done for w in mine) else " (cut off)")
    return [
        f"{mine[0].area:.0f}", str(len(mine[0].seen_at)), f"{np.mean(late):.1f}{worst}", f"{np.mean(whole):.1f}",
        f"{budget(mine[0], command):.0f}", steps, str(max(w.still for w in mine)), str(max(w.loitered for w in mine)),
    ]  # fmt: skip


def _homes(walks: Sequence[Walked]) -> list[str]:
    return list(dict.fromkeys(w.scene for w in walks))


def missed_table(walks: Sequence[Walked]) -> TextTable:
    """What is missed most often."""
    missed = Counter(w.categories[i] for w in walks for i, at in w.seen_at.items() if at < 0)
    there = Counter(category for w in walks for category in w.categories.values())
    ranked = sorted(missed.items(), key=lambda item: (-item[1], item[0]))[:12]
    rows = [(name, [Cell(str(n)), Cell(str(there[name]))]) for name, n in ranked]
    return TextTable("Missed most often on the whole walk", "", ("times", "of"), rows)


def document(walks: Sequence[Walked], command: EvalExploration, settings: WalkSettings) -> dict[str, Any]:
    """All figures, for JSON."""
    late = [w.coverage(budget(w, command)) for w in walks]
    summary = {
        "homes": len(_homes(walks)),
        "walks": len(walks),
        "coverage_in_budget": _plain(over_homes(walks, late, command.seed)),
        "coverage": _plain(over_homes(walks, [w.coverage(w.steps) for w in walks], command.seed)),
        "worst_home_in_budget": min(late),
        "steps": _plain(over_homes(walks, [float(w.steps) for w in walks], command.seed)),
        "longest_still": max(w.still for w in walks),
        "stuck_walks": sum(w.still > STUCK for w in walks),
        "longest_loitering": max(w.loitered for w in walks),
    }
    return {
        "settings": {**_described(settings), "steps": command.steps, "per_area": command.per_area},
        "summary": summary,
        "curve": {"share_of_budget": GRID.tolist(), "coverage": curve(walks, command).mean(axis=0).round(4).tolist()},
        "walks": [
            {**asdict(w), "budget": round(budget(w, command), 1), "in_budget": round(late[k], 4), "missed": w.missed}
            for k, w in enumerate(walks)
        ],
    }


def _plain(figure: Figure | None) -> dict[str, float] | None:
    return None if figure is None else asdict(figure)


GRID = np.linspace(0.0, 1.5, 61)
"""Steps at which curves are drawn, as shares of the budget."""


def curve(walks: Sequence[Walked], command: EvalExploration) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Coverage (walks, len(GRID)) at each share of a walk's budget."""
    return np.array([[w.coverage(share * budget(w, command)) for share in GRID] for w in walks])


def draw(walks: Sequence[Walked], command: EvalExploration, path: Path) -> None:
    """Coverage against steps; thin lines are walks, the thick one their mean, dots where they ended."""
    from matplotlib.figure import Figure as Picture

    picture = Picture(figsize=(8, 5), layout="constrained")
    panel = picture.subplots()
    lines = 100 * curve(walks, command)
    for line, w in zip(lines, walks, strict=True):
        panel.plot(GRID, line, color="#0072b2", alpha=0.3, linewidth=1)
        panel.plot(
            min(w.steps / budget(w, command), GRID[-1]), 100 * w.coverage(w.steps), ".", color="#0072b2", alpha=0.5
        )
    panel.plot(GRID, lines.mean(axis=0), color="#d55e00", linewidth=2.5, label="mean")
    panel.axhline(100 * ASKED, color="0.5", linestyle="--", linewidth=1)
    panel.axvline(1.0, color="0.5", linestyle="--", linewidth=1)
    panel.set(
        xlim=(0, GRID[-1]), ylim=(0, 101), ylabel="things seen, %",
        xlabel=f"steps / budget ({command.steps:g} steps per {command.per_area:g} m2 of floor)",
        title=f"{len(walks)} walks through {len(_homes(walks))} homes; dots: the walk ended",
    )  # fmt: skip
    panel.grid(alpha=0.3)
    panel.legend(loc="lower right")
    unfinished = path.with_name(f".{path.name}.tmp")
    picture.savefig(unfinished, dpi=110, format="png", metadata={"Software": None})
    unfinished.replace(path)
