"""The figures of the rendering benchmark as tables."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from openmap_eval.bench.render_contenders import BASELINES, CONTENDERS


def show(result: dict[str, Any], console: Console) -> None:
    """Print the tables of a result, then what is missing and why."""
    if "growth" in result:
        console.print(_growth(result))
    for part in result.get("results", []):
        title = f"{part['faces']:,} faces, {part['size']}"
        console.print(_speed(title, part["contenders"]))
        console.print(_rest(title, part["contenders"]))
        for line in _sentences(part["contenders"]):
            console.print(line, highlight=False)
    if result.get("results"):
        console.print(
            "RGB + depth + ids; ms and CPU ms a frame; x: times the plain one-pass renderer (opengl frustum) of the same "
            "platform, in the same rounds; prepared: what shows from where was found out ahead, as openmap scenes prepare does; "
            "else every round is a first visit; depth and colour (mean levels) away from edges",
            highlight=False,
        )
    for name, reason in result["missing"].items():
        console.print(f"{name}: {reason}", highlight=False, markup=False, soft_wrap=True)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", padding=(0, 0), pad_edge=False)
    for number, column in enumerate(columns):
        table.add_column(column, justify="right" if number else "left", no_wrap=number == 0)
    return table


def _number(value: float | None, digits: int = 1) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _speed(title: str, rows: dict[str, dict[str, Any]]) -> Table:
    each = ("f/s", "ms", "CPU", "x")
    table = _table(f"{title}: speed along a walk, and scattered", "", *each, *each)
    for name, row in rows.items():
        figures = []
        for kind in ("walk", "scattered"):
            speed = row[kind]
            figures += [_number(speed[key]) for key in ("frames_per_s", "wall_ms", "cpu_ms")]
            figures.append(_number(speed["ratio"], 2))
        table.add_row(name, *figures)
    return table


def _rest(title: str, rows: dict[str, dict[str, Any]]) -> Table:
    table = _table(
        f"{title}: set-up first and again, looking ahead, memory; against raycast",
        *("", "first s", "again s", "ahead s", "RSS MiB", "ids % off", "depth mm", "max mm", "colour"),
    )
    for name, row in rows.items():
        a = row["agreement"] or {}
        table.add_row(
            name,
            *(_number(row["setup_s"]), _number(row["setup_again_s"])),
            *(_number(row["learn_s"]) if CONTENDERS[name].learns else "", _number(row["rss_mib"], 0)),
            *(_number(a.get("ids_differ_percent"), 4), _number(a.get("depth_mean_mm"), 4)),
            *(_number(a.get("depth_max_mm"), 2), _number(a.get("rgb_mean"))),
        )
    return table


def _sentences(rows: dict[str, dict[str, Any]]) -> list[str]:
    """How the renderer that the environment uses compares with the plain one, for each platform that has both."""
    found = []
    for name, row in rows.items():
        if CONTENDERS[name].backend == "opengl" and name not in BASELINES and row["walk"]["ratio"] is not None:
            walk, scattered = row["walk"], row["scattered"]
            found.append(
                f"{name}: {walk['ratio']:.2f} times the plain one-pass renderer along a walk, {scattered['ratio']:.2f} "
                f"scattered (CPU time: {walk['cpu_ratio']:.2f} and {scattered['cpu_ratio']:.2f} times less)"
            )
    return found


def _growth(result: dict[str, Any]) -> Table:
    table = _table(
        "growth of resident memory", "", f"{result['frames']:,} frames MiB", f"{result['switches']} scenes MiB"
    )
    for name, row in result["growth"].items():
        table.add_row(name, _number(row["frames_mib"]), _number(row["switches_mib"]))
    return table
