"""Runs ``openmap eval mapping``: prepares walks and masks, makes the maps, prints tables, writes JSON, figure and page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from rich.console import Console

from openmap_eval.console import ProgressBars
from openmap_eval.mapping.command import EvalMapping
from openmap_eval.mapping.inputs import masks_of
from openmap_eval.mapping.jobs import Job, Store, run_jobs
from openmap_eval.mapping.robustness import curve_jobs, curve_rows, curve_tables, draw
from openmap_eval.mapping.table import (
    PAPER,
    as_rows,
    joint_table,
    main_tables,
    mask_specs,
    paper_table,
    peer_jobs,
    peer_table,
    reference_jobs,
    reference_table,
    table_jobs,
)
from openmap_eval.mapping.walks import WalkSpec, open_walk
from openmap_eval.perception.tables import TextTable, rich_table
from openmap_eval.records import write_atomically, write_json
from openmap_scenes import DataError

DEFAULT_SCENES = ("homes:val/0", "homes:val/1")
FIGURE = "robustness.png"


def run_eval_mapping(command: EvalMapping, console: Console) -> None:
    """Measure, print the tables, write ``mapping.json``, ``mapping.html`` and the figure."""
    walks = walk_specs(command)
    try:
        command.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError("--out", f"{command.out} ({error.strerror})", "a folder, or a place to make one") from None
    store = Store(command.out / "scores.jsonl")
    parts = plan(command, walks)
    jobs = [job for part in parts.values() for job in part]
    with ProgressBars(console) as bars:
        prepare([job for job in jobs if job not in store], bars)
        todo = {job for job in jobs if job not in store}
        done = 0

        def on_done(job: Job) -> None:
            nonlocal done
            done += 1
            bars("maps", done, len(todo))

        if todo:
            bars("maps", 0, len(todo))
        run_jobs(jobs, store, command.workers, on_done)
    content = collect(command, walks, parts, store)
    tables = shown_tables(content)
    for table in tables:
        console.print(rich_table(table))
        console.print()
    written = ["mapping.json", "mapping.html", "scores.jsonl"]
    write_json(command.out / "mapping.json", _plain(content))
    figure = None
    if content["robustness"]:
        figure = command.out / FIGURE
        draw(content["robustness"], figure)
        written.append(FIGURE)
    write_page(command.out / "mapping.html", content["settings"], tables, figure)
    console.print(f"written: {', '.join(written)} in {command.out}", soft_wrap=True)


def walk_specs(command: EvalMapping) -> list[WalkSpec]:
    """What to measure on; DataError where the command line makes no sense."""
    for name, least in (("frames", 1), ("width", 32), ("height", 32), ("workers", 1)):
        if getattr(command, name) < least:
            raise DataError(f"--{name}", str(getattr(command, name)), f"at least {least}")
    scenes = command.scene or (() if command.recording else DEFAULT_SCENES)
    if len({*scenes, *map(str, command.recording)}) < len(scenes) + len(command.recording):
        raise DataError("the command line", "a scene or recording twice", "each once")
    every, step = (4, 2) if command.quick else (1, 1)
    rendered = [
        WalkSpec(s, "scene", command.frames, command.width, command.height, command.seed, every=every, step=step)
        for s in scenes
    ]
    # Most recordings that are handed round are short.
    return rendered + [WalkSpec(str(path), "recording", step=step) for path in command.recording]


def plan(command: EvalMapping, walks: Sequence[WalkSpec]) -> dict[str, list[Job]]:
    """The maps of each part of the report, those of a walk with the same masks together."""
    parts: dict[str, list[Job]] = {"table": [], "peer": [], "reference": [], "robustness": []}
    for walk in walks:
        for masks in mask_specs(command.masks, command.seed) if "table" in command.part else ():
            parts["table"] += table_jobs(walk, masks, command.seed)
            if command.peer:
                parts["peer"] += peer_jobs(walk, masks, command.seed)
            if command.reference and masks.kind == "true":
                parts["reference"] += reference_jobs(walk, masks, command.seed)
        if "robustness" in command.part:
            parts["robustness"] += curve_jobs(walk, command.seed, command.quick).values()
    return parts


def prepare(jobs: Sequence[Job], bars: ProgressBars) -> None:
    """Make walks, truths and masks that are not kept yet."""
    for walk_spec in dict.fromkeys(job.walk for job in jobs):
        source = walk_spec.source.rstrip("/").rpartition("/")[2]
        walk = open_walk(walk_spec, lambda done, of, s=source: bars(f"{s}: walk", done, of))  # type: ignore[misc]
        walk.make_cloud()
        for masks in dict.fromkeys(job.masks for job in jobs if job.walk == walk_spec):
            title = f"{source}: {masks.name} masks" + (" (small)" if walk_spec.first else "")
            masks_of(walk, masks, lambda done, of, t=title: bars(t, done, of))  # type: ignore[misc]


def collect(
    command: EvalMapping, walks: Sequence[WalkSpec], parts: dict[str, list[Job]], store: Store
) -> dict[str, Any]:
    """Everything that was measured, as it is written; no times, which are in scores.jsonl."""
    kept = ("quick", "frames", "width", "height", "seed")
    return {
        "settings": {"walks": [w.source for w in walks], **{name: getattr(command, name) for name in kept}},
        "table": as_rows(parts["table"], store),
        "peer": as_rows(parts["peer"], store),
        "reference": as_rows(parts["reference"], store),
        "robustness": curve_rows(walks, store, command.seed, command.quick) if parts["robustness"] else [],
        "paper, other data": {
            name: dict(zip(("ap", "ap50", "ap25"), values, strict=True)) for name, values in PAPER.items()
        },
    }


def shown_tables(content: dict[str, Any]) -> list[TextTable]:
    """All tables of the report."""
    tables: list[TextTable] = []
    if content["table"]:
        tables += [*main_tables(content["table"]), joint_table(content["table"]), paper_table()]
    if content["peer"]:
        tables.append(peer_table(content["peer"]))
    if content["reference"]:
        tables.append(reference_table(content["reference"]))
    if content["robustness"]:
        tables += curve_tables(content["robustness"])
    return tables


def write_page(path: Path, settings: dict[str, Any], tables: Sequence[TextTable], figure: Path | None) -> None:
    """Write ``mapping.html``, whole or not at all; the figure is inside."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("openmap_eval"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    data = None if figure is None else f"data:image/png;base64,{base64.b64encode(figure.read_bytes()).decode()}"
    page = environment.get_template("mapping.html").render(settings=settings, tables=tables, figure=data)
    write_atomically(path, page.encode())


def _plain(value: Any) -> Any:
    """For JSON: what is not a number as null."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
