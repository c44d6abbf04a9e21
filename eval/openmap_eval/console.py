"""What a person sees in the terminal: progress, and the table of answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from openmap_eval.records import EpisodeRecord
from openmap_eval.report import KIND_NAMES, KS, ORACLE, first_answer, oracle_note, target_names


class ProgressBars:
    """A progress observer for ``evaluate`` that draws one bar for each thing that goes on; a context manager."""

    def __init__(self, console: Console) -> None:
        self._progress = Progress(
            TextColumn("{task.description:>12}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=False,
        )
        self._tasks: dict[str, Any] = {}

    def __call__(self, what: str, done: int, total: int) -> None:
        if what not in self._tasks:
            self._tasks[what] = self._progress.add_task(what, total=total)
        self._progress.update(self._tasks[what], completed=done, total=total)

    def __enter__(self) -> ProgressBars:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()


def print_answers(console: Console, records: Sequence[EpisodeRecord], oracle: bool = False) -> None:
    """Instruction -> answer -> distance -> hit at 1/4/8/16, a row an episode; the title says whether an oracle was used."""
    table = Table(
        title=f"{ORACLE if oracle else ''}What was asked, and what was found",
        title_justify="left",
        pad_edge=False,
        padding=(0, 0),
        show_lines=True,
    )
    for name, share in (("instruction", 2), ("first answer", 1), ("target", 1)):
        table.add_column(name, overflow="fold", ratio=share)
    table.add_column("distance", justify="right")
    for k in KS:
        table.add_column(f"@{k}", justify="center")
    for record in records:
        label, distance = first_answer(record)
        hits = ["[green]✓[/]" if (record.metrics.get(f"sr_{k}") or 0.0) >= 1.0 else "[red]✗[/]" for k in KS]
        shown = "-" if distance is None else f"{distance:.2f} m"
        table.add_row(record.instruction, label, target_names(record), shown, *hits)
    console.print(table)


def print_summary(console: Console, summary: Mapping[str, Any]) -> None:
    """SR and SR_k by kind, with intervals."""
    oracle = oracle_note(summary["settings"])
    table = Table(
        title=("ORACLE: " + oracle) if oracle else "Success rates [95 % interval]",
        title_justify="left",
        pad_edge=False,
        padding=(0, 0),
    )
    table.add_column("kind", no_wrap=True)
    table.add_column("episodes", justify="right")
    for k in KS:
        table.add_column("SR" if k == 1 else f"SR_{k}", justify="right")
    rows = {KIND_NAMES.get(kind, kind): values for kind, values in summary["by_kind"].items()}
    rows["all"] = {"episodes": summary["episodes"], **summary["all"]}
    for kind, values in rows.items():
        cells = [values[f"sr_{k}"] for k in KS]
        shown = [f"{c['mean']:.2f}\n[dim]\\[{c['low']:.2f}, {c['high']:.2f}][/]" for c in cells]
        table.add_row(kind, str(values["episodes"]), *shown)
    console.print(table)
