"""What a person sees in the terminal: progress, and the table of answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from openmap_eval.records import EpisodeRecord
from openmap_eval.report import KIND_NAMES, KS, ORACLE, first_answer, lost_rows, oracle_note, target_names


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
        said = (escape(text) for text in (record.instruction, label, target_names(record)))
        table.add_row(*said, shown, *hits)
    console.print(table)


def print_summary(console: Console, summary: Mapping[str, Any]) -> None:
    """SR and SR_k by kind, with intervals, in the navigation protocol what the walks came to, and where targets were lost."""
    oracle = oracle_note(summary["settings"])
    said = f"Success rates [95 % interval over {summary['intervals_over']}]"
    table = Table(
        title=escape(f"ORACLE: {oracle}\n{said}" if oracle else said),
        title_justify="left",
        pad_edge=False,
        padding=(0, 0),
    )
    table.add_column("kind", no_wrap=True)
    table.add_column("episodes", justify="right")
    for k in KS:
        table.add_column("SR" if k == 1 else f"SR_{k}", justify="right")
    names = [f"sr_{k}" for k in KS]
    if summary["settings"]["protocol"] == "navigation":
        names += ["nav_success", "spl"]
        table.add_column("stopped there", justify="right")
        table.add_column("SPL", justify="right")
    rows = {KIND_NAMES.get(kind, kind): values for kind, values in summary["by_kind"].items()}
    rows["all"] = {"episodes": summary["episodes"], **summary["all"]}
    for kind, values in rows.items():
        cells = [values.get(name) for name in names]
        shown = [f"{c['mean']:.2f}\n[dim]\\[{c['low']:.2f}, {c['high']:.2f}][/]" if c else "-" for c in cells]
        table.add_row(kind, str(values["episodes"]), *shown)
    console.print(table)
    print_losses(console, summary)


def print_losses(console: Console, summary: Mapping[str, Any]) -> None:
    """How many failed episodes of each kind each stage lost; nothing where no stage is known of any."""
    stages, rows = lost_rows(summary)
    if not rows:
        return
    table = Table(
        title="Failed episodes, by the first stage that lost the target", title_justify="left", pad_edge=False
    )
    table.add_column("lost at", no_wrap=True)
    for row in rows:
        table.add_column(row["kind"], justify="right")
    for k, stage in enumerate(stages):
        table.add_row(stage, *(str(row["counts"][k] or "-") for row in rows))
    table.add_row("failed", *(f"{sum(row['counts'])} of {row['episodes']}" for row in rows), style="bold")
    console.print(table)
