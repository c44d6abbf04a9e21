"""``openmap bench perception``: what seeing costs, frame by frame and stage by stage, in a process that does nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from itertools import islice, product
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from openmap_eval.bench.machine import describe_machine, write_json

_THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_WARM = 3
_PATIENCE_S = 900


@dataclass(frozen=True)
class Perception:
    """Wall and CPU time of every stage, and resident memory, over different frames of one scene; words by the thousand.

    A process of its own loads perception and is shown frames that were rendered before; the first three do not count. The stages
    are those of the embedded perception; any other segmenter and encoder has its whole time alone.
    """

    scene: str = "homes:val/0"
    """A scene of the catalogue."""
    width: int = 640
    """Picture width, px."""
    height: int = 480
    """Picture height, px."""
    frames: int = 30
    """How many are measured."""
    threads: int = 1
    """How many the process may use."""
    labels: int = 1000
    """How many different labels are encoded."""
    perception: str = "embedded"
    """Spec of both; --segmenter and --encoder override it."""
    segmenter: str | None = None
    """As for ``openmap eval``."""
    encoder: str | None = None
    """As for ``openmap eval``."""
    seed: int = 0
    """Of the views."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        result = measure(self)
        for table in _tables(result):
            console.print(table)
        if self.out is not None:
            write_json(self.out, result)
            console.print(f"written: {self.out}", soft_wrap=True)


def measure(settings: Perception) -> dict[str, Any]:
    """All figures, as they are written: the settings, the machine, times by stage, memory."""
    from openmap_agents.perception import is_oracle, resolve

    for name, least in (("frames", 1), ("threads", 1), ("labels", 1), ("width", 32), ("height", 32)):
        if getattr(settings, name) < least:
            raise ValueError(f"{getattr(settings, name)} {name}; expected {least} or more")
    segmenter, encoder = resolve(settings.perception, settings.segmenter, settings.encoder)
    if is_oracle(segmenter) or is_oracle(encoder):
        raise ValueError("an oracle does not see, so there is nothing to measure; expected other specs")
    with tempfile.TemporaryDirectory(prefix="openmap-bench-") as scratch:
        folder = Path(scratch)
        paths = write_frames(settings, folder)
        task = {
            "segmenter": segmenter,
            "encoder": encoder,
            "threads": settings.threads,
            "hfov_deg": 90.0,
            "labels": words(settings.labels),
        }
        # What is compiled and exported once for all goes into the caches here, not into the figures.
        _child({**task, "frames": paths[:2], "warm": 1, "labels": ["a"]}, settings.threads, folder / "first")
        figures = _child({**task, "frames": paths, "warm": _WARM}, settings.threads, folder / "second")
    kept = {k: v for k, v in asdict(settings).items() if k not in ("out", "perception", "segmenter", "encoder")}
    return {
        "benchmark": "perception",
        "settings": {"segmenter": segmenter, "encoder": encoder, **kept},
        "machine": describe_machine(),
        **figures,
    }


def write_frames(settings: Perception, folder: Path) -> list[str]:
    """Views of the scene, a file each, the warm ones included."""
    import numpy as np

    from openmap_agents.perception.views import random_views
    from openmap_scenes import DataError, PinholeCamera, load_scene

    camera = PinholeCamera.from_hfov(settings.width, settings.height, 90.0)
    wanted = settings.frames + _WARM
    paths = []
    views = random_views(load_scene(settings.scene), camera, wanted, np.random.default_rng(settings.seed))
    for number, view in enumerate(views):
        path = folder / f"{number:05d}.npz"
        np.savez(path, rgb=view.frame.rgb, depth=view.frame.depth, T_world_camera=view.T_world_camera)
        paths.append(str(path))
    if len(paths) < wanted:
        raise DataError(
            settings.scene, f"{len(paths)} views that show anything", f"{wanted}", "Ask for fewer --frames."
        )
    return paths


def words(n: int) -> list[str]:
    """n different labels, such as people use: names of things, then with a colour before them, then numbered."""
    from openmap_agents.perception.colour import COLOURS
    from openmap_env.episodes.vocabulary import vocabulary

    names = sorted(vocabulary().names)
    described = (f"{colour} {name}" for colour, name in product(COLOURS, names))
    numbered = (f"{name} {k}" for k, name in product(range(2, n + 2), names))
    return list(islice((label for part in (names, described, numbered) for label in part), n))


def _child(task: dict[str, Any], threads: int, cache: Path) -> dict[str, Any]:
    """What the process says. Words that were encoded before are not in its cache; models and scenes are."""
    from openmap_scenes.cache import cache_root

    environment = {**os.environ, "OPENMAP_CACHE": str(cache_root()), "XDG_CACHE_HOME": str(cache)}
    environment |= {name: str(threads) for name in _THREADS}
    done = subprocess.run(
        [sys.executable, "-m", "openmap_eval.bench.perception_child"],
        input=json.dumps(task) + "\n",
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        timeout=_PATIENCE_S,
    )
    if done.returncode:
        raise ValueError(f"the measured process ended with status {done.returncode}; its message is above")
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return figures


def _tables(result: dict[str, Any]) -> list[Table]:
    settings = result["settings"]
    title = f"perception, {settings['width']} x {settings['height']}, threads: {settings['threads']}, ms a frame"
    times = Table(title=title, title_justify="left")
    for name in ("", "wall median", "wall p90", "CPU median", "CPU p90"):
        times.add_column(name, justify="right" if name else "left")
    rows = {"whole frame": result["whole"]["frame"], "  segment": result["whole"]["segment"]}
    rows |= {"  encode": result["whole"]["encode"]}
    rows |= {f"    {stage}": values for stage, values in result["stages"].items()}
    for name, values in rows.items():
        cells = (values[clock][part] for clock in ("wall", "cpu") for part in ("median", "p90"))
        times.add_row(name, *(f"{ms:.1f}" for ms in cells))
    times.caption = f"{settings['frames']} frames, {result['masks']:.1f} masks each; colour is not in the whole frame"
    text = Table(title="words, ms in all", title_justify="left")
    for name in ("", "wall", "CPU"):
        text.add_column(name, justify="right" if name else "left")
    for name, values in result["text"].items():
        text.add_row(name, f"{values['wall']:.1f}", f"{values['cpu']:.1f}")
    memory = Table(title="resident memory, MiB", title_justify="left")
    memory.add_column("")
    memory.add_column("MiB", justify="right")
    for name, mib in result["memory_mib"].items():
        memory.add_row(name, f"{mib:.0f}")
    return [times, text, memory]
