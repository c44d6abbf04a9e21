"""``openmap eval grounding``: how often the thing meant is found in a map that is right."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console


@dataclass(frozen=True)
class EvalGrounding:
    """Measure grounding alone, on the true map of each scene (ORACLE): success by kind, what each round adds, "not here".

    Nothing is walked and nothing is seen: the instances, their names, boxes and colours are the scene's own.
    """

    out: Path
    """Folder for grounding.json and threshold.png."""
    scene: tuple[str, ...] = ()
    """Scenes of the catalogue: mp3d:<scan folder>, file:<mesh> or homes:<split>/<n>."""
    split: Literal["homes/train", "homes/val", "homes/test"] | None = None
    """Instead of --scene: a split of the built-in homes."""
    first: int = 0
    """The first home of the split."""
    homes: int = 10
    """How many homes of the split."""
    episodes: int = 30
    """Questions a scene: the benchmark's, or generated where it has none."""
    absent: int = 30
    """Questions a scene for things that only other scenes of this run have; 0 = none."""
    ablation: bool = True
    """Also without parsing, without selecting, and without both."""
    llm: str = "builtin"
    """As for ``openmap eval``."""
    seed: int = 0
    """Draws the absent questions, and generates where the benchmark has none."""

    def run(self, console: Console) -> None:
        from openmap_eval.grounding.report import run_eval_grounding

        run_eval_grounding(self, console)
