"""Figures as tables of text: the same for the terminal and for the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from openmap_eval.bootstrap import Figure
from openmap_eval.perception.figures import GRAINS, LISTS, SIDES
from openmap_eval.perception.labels import TOPS
from openmap_eval.perception.masks import SIZES
from openmap_eval.perception.retrieval import KS
from openmap_eval.perception.uses import uses

_SIZE_NAMES = {"all": "all", "small": "small (< 32² px)", "medium": "medium", "large": "large (≥ 96² px)"}


@dataclass(frozen=True)
class Cell:
    """What stands in a cell, and its interval beside it in small print."""

    text: str
    small: str = ""


@dataclass(frozen=True)
class TextTable:
    """A table; the first column names the row."""

    title: str
    note: str
    columns: tuple[str, ...]
    rows: list[tuple[str, list[Cell]]]


def fraction(figure: Figure | None) -> Cell:
    """A figure as .35 [.31, .40]."""
    if figure is None:
        return Cell("–")
    return Cell(f"{figure.value:.2f}", f"[{figure.low:.2f}, {figure.high:.2f}]")


def percent(figure: Figure | None) -> Cell:
    """A figure as 35.1 [31, 40]."""
    if figure is None:
        return Cell("–")
    return Cell(f"{100 * figure.value:.1f}", f"[{100 * figure.low:.0f}, {100 * figure.high:.0f}]")


def count(figures: Mapping[str, Figure]) -> Cell:
    """How many a row is the mean of."""
    return Cell(str(next(iter(figures.values())).n) if figures else "0")


def tables(found: Mapping[str, Any], timing: Mapping[str, Any]) -> list[TextTable]:
    """All tables of a set of figures; ``timing`` is as in the JSON file."""
    return [
        _masks(found),
        *(_labels(found, names) for names in LISTS),
        _questions(found),
        _colour(found),
        _time(timing),
    ]


def _masks(found: Mapping[str, Any]) -> TextTable:
    columns = ("AP", "AP50", "AP75", "best IoU", "recall@.5")
    counts, things = found["counts"], found["masks"].get("all", {})
    rows = []
    for size in SIZES:
        figures = found["masks"].get(size, {})
        rows.append((_SIZE_NAMES[size], [*(fraction(figures.get(c)) for c in columns), count(figures)]))
    note = (
        f"{counts['views']} views, {count(things).text} views of things, {counts['masks']} masks. AP over IoU .50 to .95; sizes in"
        " pixels of a 640 × 480 picture. Intervals: views drawn again."
    )
    return TextTable("Masks, class-agnostic", note, (*columns, "of"), rows)


def _labels(found: Mapping[str, Any], names: str) -> TextTable:
    heads = {f"{key}top-{k}": f"{shown}top-{k}" for key, shown in (("", ""), ("balanced ", "bal. ")) for k in TOPS}
    rows = []
    for side in _sides(found):
        for grain in GRAINS:
            for group, figures in found[side]["labels"][names][grain].items():
                title = f"{side.split()[0]}, {grain}, {group}"
                rows.append((title, [*(percent(figures[h]) for h in heads), count(figures)]))
    counts = found["counts"]
    asked = {
        "own names": f"The scene's own categories: {_range(counts['own names'])} names.",
        "all names": f"What the weights were trained on and the scene's own: {_range(counts['all names'])} names of "
        f"{_range(counts['kinds of all names'])} kinds; another word for the same kind is right.",
    }[names]
    note = (
        f"{asked} True or predicted masks; all, seen or unseen kinds. Per cent; bal.: the mean over categories."
        " What no mask shows is wrong. Intervals: things drawn again, or categories."
    )
    return TextTable(f"Labels, among {names}", note, (*heads.values(), "of"), rows)


def _questions(found: Mapping[str, Any]) -> TextTable:
    asked = {"categories": "categories", "found categories": "categories some mask shows", "uses": "by use"}
    rows = []
    for side in _sides(found):
        for key, title in asked.items():
            figures = found[side][key]
            if side == "true masks" and key == "found categories":
                continue  # true masks show all
            rows.append(
                (f"{title}, {side.split()[0]}", [*(percent(figures.get(f"R@{k}")) for k in KS), count(figures)])
            )
    counts = found["counts"]
    note = (
        f"{counts['things']} things of {counts['categories']} categories; {counts['uses']} questions by use of {len(uses())} a"
        " scene could be asked. Per cent of questions with a right thing among the first k. Intervals: questions drawn again."
    )
    return TextTable("Retrieval", note, (*(f"R@{k}" for k in KS), "of"), rows)


def _colour(found: Mapping[str, Any]) -> TextTable:
    rows = []
    for side in _sides(found):
        for grain in GRAINS:
            figures = found[side]["colour"][grain]
            rows.append(
                (f"{side}, {grain}", [percent(figures.get(c)) for c in ("right", "balanced")] + [count(figures)])
            )
    if not any(int(cells[-1].text) for _, cells in rows):
        return TextTable("Colour", "No scene says what colour its things are.", ("right", "balanced", "of"), [])
    note = "Thirteen words; an instance has that of most of its views. Per cent; balanced: the mean over colours."
    return TextTable("Colour", note, ("right", "balanced", "of"), rows)


def _time(timing: Mapping[str, Any]) -> TextTable:
    columns = ("wall median", "wall p90", "CPU median", "CPU p90", "of")
    rows = []
    for stage, values in timing["ms"].items():
        cells = [values["wall"]["median"], values["wall"]["p90"], values["cpu"]["median"], values["cpu"]["p90"]]
        rows.append((stage, [Cell(f"{ms:.1f}") for ms in cells] + [Cell(str(values["n"]))]))
    note = (
        "Milliseconds a picture, and a word for text, on as many threads as the libraries take. This process, with scenes and"
        f" renderer, held at most {timing['peak_mib']:.0f} MiB; openmap bench perception measures perception alone."
    )
    return TextTable("Time", note, columns, rows)


def overview(scenes: Mapping[str, Mapping[str, Any]]) -> TextTable:
    """The main figures of each scene, a row each."""
    sides = {"true masks": "", "predicted masks": " pred."}
    columns = ["AP50", "recall@.5"]
    columns += [f"{name}{side}" for side in sides.values() for name in ("top-5", *(f"R@{k}" for k in KS), "use R@4")]
    rows = []
    for spec, found in scenes.items():
        masks = found["masks"].get("all", {})
        cells = [fraction(masks.get(name)) for name in columns[:2]]
        for side in sides:
            part = found.get(side, _NOTHING)
            cells.append(percent(part["labels"]["own names"]["instances"].get("all", {}).get("top-5")))
            cells += [percent(part["categories"].get(f"R@{k}")) for k in KS]
            cells.append(percent(part["uses"].get("R@4")))
        rows.append((spec, [Cell(c.text) for c in cells]))
    note = "Labels of instances among each scene's own names; pred.: predicted masks."
    return TextTable("Scene by scene", note, tuple(columns), rows)


_NOTHING: dict[str, Any] = {"labels": {"own names": {"instances": {}}}, "categories": {}, "uses": {}}


def _sides(found: Mapping[str, Any]) -> list[str]:
    return [side for side in SIDES if side in found]


def rich_table(table: TextTable, title: str = "") -> Table:
    """For the terminal."""
    out = Table(
        title=title + table.title, title_justify="left", caption=table.note, caption_justify="left", pad_edge=False
    )
    out.add_column("", overflow="fold")
    for name in table.columns:
        out.add_column(name, justify="right")
    for name, cells in table.rows:
        shown: Sequence[str] = [f"{c.text} [dim]\\{c.small}[/]" if c.small else c.text for c in cells]
        out.add_row(name, *shown)
    return out


def _range(value: int | list[int]) -> str:
    return str(value) if isinstance(value, int) else f"{value[0]} to {value[1]}"
