"""The whole road once, for a first look: a home, a walk that maps it, questions of all three kinds, scores and pictures."""

from __future__ import annotations

import shutil
from pathlib import Path

from rich.console import Console

from openmap_eval.commands import evaluate_and_report
from openmap_eval.runner import EvalSettings, SceneTask

QUESTIONS = 12
STEPS = 450
"""Enough to see nearly every thing of a home of 80 m2; what is left to win after that takes as long again."""


def run_demo(out: Path, scene: str, seed: int, console: Console) -> None:
    """Write a fresh demonstration into ``out``; an earlier one there is replaced."""
    if (out / "settings.json").exists():
        shutil.rmtree(out)
    settings = EvalSettings(seed=seed, max_steps=STEPS)
    console.print(f"walking through {scene}, mapping it, and asking {QUESTIONS} questions", soft_wrap=True)
    evaluate_and_report([SceneTask(scene, QUESTIONS)], settings, out, console, video=True)
    console.print(f"open {out / 'report.html'} in a browser", soft_wrap=True)
