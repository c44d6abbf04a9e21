"""Runs ``openmap eval grounding`` and says what came of it: tables, the JSON file, the curve of the threshold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track

from openmap_agents.baselines.true_map import true_map
from openmap_agents.grounding import Grounder
from openmap_agents.grounding.grounder import GroundingSettings
from openmap_agents.perception.text import TextEncoder
from openmap_env.episodes.episode import KINDS
from openmap_eval.bootstrap import Figure, mean_figure
from openmap_eval.grounding.command import EvalGrounding
from openmap_eval.grounding.measure import KS, Outcome, ask, ask_in_vain, auroc, threshold_curve
from openmap_eval.grounding.questions import Asked, absent_from, asked_in
from openmap_eval.perception.tables import Cell, TextTable, percent, rich_table
from openmap_eval.records import write_json
from openmap_scenes import DataError

ROUNDS = (("both rounds", True, True), ("no select", True, False), ("no parse", False, True), ("neither", False, False))
CURVE = "threshold.png"
LISTED = 40


def run_eval_grounding(command: EvalGrounding, console: Console) -> None:
    """Ask everything, print the tables, write ``grounding.json`` and the curve."""
    specs = _specs(command)
    try:
        command.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError("--out", f"{command.out} ({error.strerror})", "a folder, or a place to make one") from None
    scenes = [
        asked_in(s, command.episodes, command.seed) for s in track(specs, "scenes", console=console, transient=True)
    ]
    results = measure(scenes, command, console)
    for table in (success_table(results), absent_table(results["both rounds"]), failures_table(results["both rounds"])):
        console.print(rich_table(table))
        console.print()
    write_json(command.out / "grounding.json", document(results, command, specs))
    draw(results["both rounds"], command.out / CURVE)
    console.print(f"written: grounding.json and {CURVE} in {command.out}", soft_wrap=True)


def _specs(command: EvalGrounding) -> list[str]:
    """The scenes; DataError where the command line makes no sense."""
    for name, least in (("homes", 1), ("episodes", 1), ("first", 0), ("absent", 0), ("seed", 0)):
        if getattr(command, name) < least:
            raise DataError(f"--{name}", str(getattr(command, name)), f"at least {least}")
    if bool(command.scene) == (command.split is not None):
        found = "both --scene and --split" if command.scene else "neither --scene nor --split"
        raise DataError("the command line", found, "one of them")
    if command.scene:
        return list(dict.fromkeys(command.scene))
    split = str(command.split).partition("/")[2]
    return [f"homes:{split}/{n}" for n in range(command.first, command.first + command.homes)]


def measure(scenes: Sequence[Asked], command: EvalGrounding, console: Console) -> dict[str, list[Outcome]]:
    """Outcomes by which rounds were used; absent things are asked for with both."""
    encoder = TextEncoder()
    settings = GroundingSettings()
    rounds = ROUNDS if command.ablation else ROUNDS[:1]
    grounders = {
        name: Grounder(command.llm, encoder=encoder, settings=replace(settings, parse=parse, select=select))
        for name, parse, select in rounds
    }
    results: dict[str, list[Outcome]] = {name: [] for name in grounders}
    for here in track(scenes, "questions", console=console, transient=True):
        instance_map = true_map(here.scene, encoder)
        for name, grounder in grounders.items():
            results[name] += [ask(grounder, e, instance_map, here.scene, here.spec) for e in here.episodes]
        whole = grounders["both rounds"]
        absent = absent_from(here, scenes, command.absent, command.seed) if command.absent else []
        results["both rounds"] += [ask_in_vain(whole, e, instance_map, here.scene, here.spec) for e in absent]
    return results


def figure(outcomes: Sequence[Outcome], k: int) -> Figure | None:
    """SR_k over the questions for what is there; its interval resamples scenes, or questions where there is one scene."""
    present = [o for o in outcomes if not o.absent]
    names = {scene: n for n, scene in enumerate(dict.fromkeys(o.scene for o in present))}
    units = [names[o.scene] for o in present] if len(names) > 1 else None
    return mean_figure([o.hit(k) for o in present], units)


def _of_kind(outcomes: Sequence[Outcome], kind: str) -> list[Outcome]:
    return [o for o in outcomes if kind in ("all", o.kind)]


def success_table(results: dict[str, list[Outcome]]) -> TextTable:
    """SR_k by kind, and SR of the ablation."""
    rows = []
    for name, outcomes in results.items():
        for kind in (*KINDS, "all"):
            found = _of_kind(outcomes, kind)
            count = sum(not o.absent for o in found)
            rows.append((f"{name}, {kind}", [Cell(str(count)), *(percent(figure(found, k)) for k in KS)]))
    scenes = len({o.scene for outcomes in results.values() for o in outcomes})
    note = f"true maps (ORACLE); 95 % bootstrap over {f'{scenes} scenes' if scenes > 1 else 'questions'}"
    return TextTable("Found in the true map, %", note, ("questions", *(f"SR_{k}" for k in KS)), rows)


def _absence(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    present = [o for o in outcomes if not o.absent]
    absent = [o for o in outcomes if o.absent]
    return {
        "present": len(present),
        "absent": len(absent),
        "auroc": auroc([o.confidence for o in present], [o.confidence for o in absent]),
        "absent_refused": float(np.mean([not o.chosen for o in absent])) if absent else float("nan"),
        "present_refused": float(np.mean([not o.chosen for o in present])) if present else float("nan"),
    }


def absent_table(outcomes: Sequence[Outcome]) -> TextTable:
    """How well confidence tells what is there from what is not, and how often "not here" is said."""
    rows = []
    for kind in (*KINDS, "all"):
        found = _absence(_of_kind(outcomes, kind))
        numbers = [found["auroc"], found["absent_refused"], found["present_refused"]]
        cells = [Cell("–" if np.isnan(n) else f"{n:.3f}") for n in numbers]
        rows.append((kind, [Cell(str(found["present"])), Cell(str(found["absent"])), *cells]))
    columns = ("there", "absent", "AUROC", "absent, refused", "there, refused")
    return TextTable("Is it here?", "confidence against questions for what only other scenes have", columns, rows)


def failures_table(outcomes: Sequence[Outcome]) -> TextTable:
    """What went wrong."""
    failed = [o for o in outcomes if o.cause is not None]
    counts = {cause: sum(o.cause == cause for o in failed) for cause in ("parse", "selection")}
    rows = [
        (o.instruction, [Cell(o.cause or ""), Cell(o.wanted), Cell(o.got), Cell(str(o.rank or "–"))])
        for o in failed[:LISTED]
    ]
    note = (
        f"{len(failed)} failures: parse {counts['parse']} (the target is no candidate), selection {counts['selection']}"
    )
    note += f"; the first {LISTED}" if len(failed) > LISTED else ""
    return TextTable("What was missed", note, ("cause", "wanted", "got", "rank"), rows)


def document(results: dict[str, list[Outcome]], command: EvalGrounding, specs: list[str]) -> dict[str, Any]:
    """``grounding.json``."""
    whole = results["both rounds"]
    settings = {key: value for key, value in asdict(command).items() if key not in ("out", "scene", "split")}
    found: dict[str, Any] = {
        "settings": {**settings, "scenes": specs},
        "success": {
            name: {
                kind: {f"sr_{k}": None if (f := figure(_of_kind(o, kind), k)) is None else asdict(f) for k in KS}
                for kind in (*KINDS, "all")
            }
            for name, o in results.items()
        },
        "absence": {
            kind: {key: None if value != value else value for key, value in _absence(_of_kind(whole, kind)).items()}
            for kind in (*KINDS, "all")
        },
        "threshold": threshold_curve(whole, np.linspace(0, 1, 21)),
        "questions": [asdict(o) for o in whole],
    }
    return found


def draw(outcomes: Sequence[Outcome], path: Path) -> None:
    """SR and false answers against the least confidence of an answer."""
    from matplotlib.figure import Figure as Picture

    rows = threshold_curve(outcomes, np.linspace(0, 1, 101))
    picture = Picture(figsize=(7, 4.5), layout="constrained")
    panel = picture.subplots()
    x = [row["confidence"] for row in rows]
    for key, label, colour in (("sr", "SR", "#0072b2"), ("false_answers", "absent things answered", "#d55e00")):
        values = [np.nan if row[key] is None else 100 * row[key] for row in rows]
        panel.plot(x, values, color=colour, linewidth=2, label=label)
    panel.axvline(GroundingSettings().min_confidence, color="0.5", linestyle="--", linewidth=1, label="default")
    panel.set(xlim=(0, 1), ylim=(0, 101), xlabel="least confidence of an answer", ylabel="%", title="Not here")
    panel.grid(alpha=0.3)
    panel.legend()
    unfinished = path.with_name(f".{path.name}.tmp")
    picture.savefig(unfinished, dpi=110, format="png", metadata={"Software": None})
    unfinished.replace(path)
