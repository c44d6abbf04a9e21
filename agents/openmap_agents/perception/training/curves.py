"""A picture of what the networks learned, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def draw_curves(rows: list[dict[str, Any]], path: Path) -> None:
    """One plot for the neck's losses, one for the heads'."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    neck, heads = figure.subplots(1, 2)
    steps = [r for r in rows if r["step_name"] == "neck"]
    for name in ("shape", "looks", "pairs", "classes"):
        neck.plot([r["step"] for r in steps], [r[name] for r in steps], label=name)
    neck.set(title="neck", xlabel="step of 4 views", ylabel="loss", yscale="log")
    for name in sorted({r["step_name"] for r in rows if r["step_name"].startswith("head ")}):
        chosen = [r for r in rows if r["step_name"] == name]
        heads.plot([r["epoch"] for r in chosen], [r["loss"] for r in chosen], label=name.removeprefix("head "))
    heads.set(title="region heads", xlabel="epoch", ylabel="loss")
    for axes in (neck, heads):
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend()
    figure.savefig(path, dpi=80)
