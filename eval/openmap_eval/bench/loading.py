"""``openmap bench loading``: a big textured mesh, by the mesh library alone, by the reader, and from the cache."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, Literal, NamedTuple

from rich.console import Console
from rich.table import Table

from openmap_eval.bench.machine import describe_machine, write_json


class Row(NamedTuple):
    """A way of ``loading_child``, and whether the cache is emptied and the files are dropped from memory before."""

    way: str
    empty: bool = False
    cold: bool = False


ROWS = {
    "trimesh alone": Row("trimesh_alone"),
    "reader, nothing kept": Row("uncached"),
    "first load (read and kept)": Row("first", empty=True),
    "cached, opened": Row("opened"),
    "cached, every page read": Row("kept"),
    "trimesh alone, file from disk": Row("trimesh_alone", cold=True),
    "cached, opened, files from disk": Row("opened", cold=True),
    "cached, every page read, files from disk": Row("kept", cold=True),
}
COLUMNS = {
    "seconds": "wall s", "cpu_seconds": "CPU s", "process_seconds": "whole process s",
    "peak_mib": "peak RSS MiB", "uss_mib": "USS MiB", "pss_mib": "PSS MiB",
}  # fmt: skip


@dataclass(frozen=True)
class Loading:
    """How fast a big textured mesh loads, and what a second process that opens it adds: trimesh alone, first load, cached load.

    Every load is in a process of its own; the clock starts after libraries were imported. Where a row does not say otherwise the
    files are in memory already, as they are for the second worker of a machine.
    """

    faces: int = 2_000_000
    """Triangles of the synthetic home."""
    textures: int = 60
    """How many textures, one a material."""
    texture_size: int = 2048
    """Their side, px."""
    image: Literal["jpeg", "png"] = "jpeg"
    """How they are compressed."""
    repeats: int = 3
    """Processes for each row; the median counts."""
    seed: int = 0
    """Of the synthetic home."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        result = measure(self)
        console.print(_table(result))
        console.print(_sentence(result), highlight=False)
        if self.out is not None:
            write_json(self.out, result)
            console.print(f"written: {self.out}", soft_wrap=True)


def measure(settings: Loading) -> dict[str, Any]:
    """All figures, as they are written: the settings, the machine, the rows, the second process."""
    from openmap_eval.bench.synthetic import write_glb

    if settings.repeats < 1:
        raise ValueError(f"{settings.repeats} repeats; expected 1 or more")
    with tempfile.TemporaryDirectory(prefix="openmap-bench-") as scratch:
        path, cache = Path(scratch) / "home.glb", Path(scratch) / "cache"
        started = time.perf_counter()
        write_glb(path, settings.faces, settings.textures, settings.texture_size, settings.image, settings.seed)
        written = time.perf_counter() - started
        rows = {}
        for row, (way, empty, cold) in ROWS.items():
            if cold and not hasattr(os, "posix_fadvise"):
                continue
            runs = []
            for _ in range(settings.repeats):
                if empty:
                    shutil.rmtree(cache, ignore_errors=True)
                if cold:
                    _drop_from_memory(Path(scratch))
                runs.append(_once(way, path, cache))
            rows[row] = {key: round(median(run[key] for run in runs), 4) for key in runs[0]}
        second = _beside(path, cache)
        disk = {"glb": _size(path), "cache": _size(cache)}
    alone, cached = rows["trimesh alone"], rows["cached, every page read"]
    return {
        "benchmark": "loading",
        "settings": {
            name: getattr(settings, name) for name in ("faces", "textures", "texture_size", "image", "repeats", "seed")
        },
        "machine": describe_machine(),
        "write_seconds": round(written, 2),
        "disk_mib": disk,
        "rows": rows,
        "cached_times_faster_than_trimesh": round(alone["seconds"] / cached["seconds"], 1),
        "process_times_faster_than_trimesh": round(alone["process_seconds"] / cached["process_seconds"], 1),
        "second_process": second,
    }


@contextmanager
def _child(way: str, path: Path, cache: Path) -> Iterator[subprocess.Popen[str]]:
    environment = {**os.environ, "OPENMAP_CACHE": str(cache), "OPENMAP_CACHE_GB": "1000"}
    command = [sys.executable, "-m", "openmap_eval.bench.loading_child", way, str(path)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            yield process
        finally:
            process.kill() if sys.exc_info()[0] else process.communicate()


def _once(way: str, path: Path, cache: Path) -> dict[str, float]:
    started = time.perf_counter()
    with _child(way, path, cache) as process:
        figures = _answer(process)
        return figures | {"process_seconds": time.perf_counter() - started}


def _beside(path: Path, cache: Path) -> dict[str, float]:
    """What a second process adds, MiB, while the first one holds the same kept scene; both have read every page."""
    with _child("kept", path, cache) as first:
        alone = _answer(first)
        with _child("kept", path, cache) as second:
            _answer(second)
            both = [_ask(process) for process in (first, second)]
    added = sum(p["pss_mib"] for p in both) - alone["pss_mib"]
    return {
        "first_alone_pss_mib": round(alone["pss_mib"], 1),
        "first_alone_uss_mib": round(alone["uss_mib"], 1),
        "first_beside_pss_mib": round(both[0]["pss_mib"], 1),
        "second_pss_mib": round(both[1]["pss_mib"], 1),
        "second_uss_mib": round(both[1]["uss_mib"], 1),
        "added_pss_mib": round(added, 1),
        "added_share": round(added / alone["pss_mib"], 4),
        "second_uss_share": round(both[1]["uss_mib"] / alone["pss_mib"], 4),
    }


def _answer(process: subprocess.Popen[str]) -> dict[str, float]:
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise RuntimeError(f"a measured process ended with status {process.wait()}; its message is above")
    figures: dict[str, float] = json.loads(line)
    return figures


def _ask(process: subprocess.Popen[str]) -> dict[str, float]:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()
    return _answer(process)


def _drop_from_memory(folder: Path) -> None:
    """Let the system forget the pages of all files below a folder, so that the next read of them goes to the disk."""
    for path in folder.rglob("*"):
        if path.is_file():
            with path.open("rb") as file:
                os.fsync(file.fileno())  # a page that is not on the disk yet would stay
                os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _size(path: Path) -> float:
    files = path.rglob("*") if path.is_dir() else [path]
    return round(sum(file.stat().st_size for file in files if file.is_file()) / 2**20, 1)


def _table(result: dict[str, Any]) -> Table:
    s = result["settings"]
    title = f"{s['faces']:,} faces, {s['textures']} textures of {s['texture_size']} px ({s['image']})"
    table = Table(title=title, title_justify="left")
    table.add_column("load")
    for column in COLUMNS.values():
        table.add_column(column, justify="right")
    for row, figures in result["rows"].items():
        table.add_row(
            row, *(f"{figures[key]:.3f}" if key.endswith("seconds") else f"{figures[key]:.0f}" for key in COLUMNS)
        )
    return table


def _sentence(result: dict[str, Any]) -> str:
    second, disk = result["second_process"], result["disk_mib"]
    return (
        f"cached load {result['cached_times_faster_than_trimesh']} times as fast as trimesh alone "
        f"(whole processes: {result['process_times_faster_than_trimesh']}); a second process adds "
        f"{second['added_pss_mib']} MiB, {second['added_share']:.1%} of the first one's {second['first_alone_pss_mib']} MiB; "
        f"on disk {disk['glb']} MiB as GLB, {disk['cache']} MiB in the cache"
    )
