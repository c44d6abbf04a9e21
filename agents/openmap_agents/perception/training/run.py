"""The whole training, step after step; every step's result is on disk before the next begins, so a run that was stopped goes on."""

from __future__ import annotations

import json
import os
import platform
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from openmap_agents.grounding.lexicon import load_lexicon
from openmap_agents.perception.backbone import CHANNELS
from openmap_agents.perception.colour import COLOURS
from openmap_agents.perception.conse import unit
from openmap_agents.perception.encoder import HEADS, EmbeddedEncoder
from openmap_agents.perception.export import export_onnx
from openmap_agents.perception.maps import N_GEOMETRY
from openmap_agents.perception.neck import Neck
from openmap_agents.perception.text import TextEncoder
from openmap_agents.perception.training.curves import draw_curves
from openmap_agents.perception.training.fit_colour import fit_colour
from openmap_agents.perception.training.fit_neck import Bank, fit_neck
from openmap_agents.perception.training.fit_regions import Regions, collect, fit_head, weights_of
from openmap_agents.perception.training.fit_segmenter import fit_segmenter, samples
from openmap_agents.perception.training.fit_text import fit_text
from openmap_agents.perception.training.looking import look_at_homes
from openmap_agents.perception.training.network import Neck as Network
from openmap_agents.perception.training.settings import Settings
from openmap_agents.perception.training.shards import Shard
from openmap_agents.perception.weights import save_weights
from openmap_scenes import DataError


class Log:
    """Figures of the steps, a line each in log.jsonl; those of finished steps survive a stop."""

    def __init__(self, path: Path, console: Console) -> None:
        self._path, self._console, self._start = path, console, time.monotonic()
        path.parent.mkdir(parents=True, exist_ok=True)

    def __call__(self, step: str) -> Callable[[dict[str, float]], None]:
        """A function that takes down figures of a step."""

        def report(values: dict[str, float]) -> None:
            row = {"step_name": step, "seconds": round(time.monotonic() - self._start, 1)} | {
                k: round(v, 5) for k, v in values.items()
            }
            with self._path.open("a") as file:
                file.write(json.dumps(row) + "\n")
            shown = ", ".join(f"{k} {v:.4g}" for k, v in values.items())
            self._console.print(f"{step}: {shown}", highlight=False)

        return report

    def rows(self) -> list[dict[str, Any]]:
        """All that was taken down."""
        return [json.loads(line) for line in self._path.read_text().splitlines()]


def make_bank(paths: list[Path], text: TextEncoder) -> tuple[Bank, npt.NDArray[np.float32]]:
    """The names that things of the homes have, and the mean of their vectors."""
    seen: Counter[str] = Counter()
    for path in paths:
        shard = Shard(path)
        for k in range(shard.n):
            rows = shard.rows(k)
            names = [shard.names.get(i, "") for i in rows["present"].tolist()]
            seen.update(names[i - 1] for i in rows["regions"].tolist())
    del seen[""]
    names = sorted(seen)
    words = text.encode_text(names)
    mean = words.mean(0)
    count = np.array([seen[name] for name in names], np.float64)
    return Bank(names, unit(words - mean), np.sqrt(count.mean() / count).astype(np.float32)), mean


def export_neck(neck: Network, path: Path) -> None:
    """The neck as an ONNX file."""
    shapes = [(1, c, 128 // s, 160 // s) for c, s in zip(CHANNELS[:3], (4, 8, 16), strict=True)]
    inputs = [torch.zeros(shape) for shape in [*shapes, (1, N_GEOMETRY, 32, 40)]]
    neck.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    export_onnx(neck, inputs, ("s4", "s8", "s16", "geometry"), ("shape", "looks", "belonging"), path)


def calibrate(scores: npt.NDArray[np.float32], own: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Platt's slope and offset: from cosines (n, names) to the odds that a name is the region's own.

    Right and wrong names weigh alike, so p = 1/2 means that the cosine is as usual for right names as for wrong ones.
    """
    right = scores[np.arange(len(own)), own]
    wrong = np.delete(scores.ravel(), np.arange(len(own)) * scores.shape[1] + own)
    x = np.concatenate([right, wrong]).astype(np.float64)
    y = np.concatenate([np.ones(len(right)), np.zeros(len(wrong))])
    w = np.concatenate([np.full(len(right), 0.5 / len(right)), np.full(len(wrong), 0.5 / len(wrong))])
    slope, offset = 1.0, 0.0
    for _ in range(50):  # Newton's method on a convex loss of two variables
        p = 1.0 / (1.0 + np.exp(-(slope * x + offset)))
        g = np.array([(w * (p - y) * x).sum(), (w * (p - y)).sum()])
        c = w * p * (1 - p)
        hessian = np.array([[(c * x * x).sum(), (c * x).sum()], [(c * x).sum(), c.sum()]]) + 1e-9 * np.eye(2)
        slope, offset = np.array([slope, offset]) - np.linalg.solve(hessian, g)
    return float(slope), float(offset)


def _heads(s: Settings, regions: Regions, bank: Bank, log: Log) -> dict[str, npt.NDArray[np.float32]]:
    weight = weights_of(regions)
    sizes = {"looks": (320, 0.6, 1), "neck": (224, 0.3, 1), "shape": (160, 0.1, 1)}
    arrays: dict[str, npt.NDArray[np.float32]] = {}
    for name, (hidden, dropout, factor) in sizes.items():
        parts = fit_head(
            regions,
            HEADS[name],
            bank.vectors,
            weight,
            hidden,
            s.seed,
            factor * s.head_epochs,
            dropout,
            log(f"head {name}"),
        )
        arrays |= {f"{name}.{part}": array for part, array in parts.items()}
    return arrays


def _fit_regions(
    s: Settings,
    paths: list[Path],
    bank: Bank,
    mean: npt.NDArray[np.float32],
    text: TextEncoder,
    log: Log,
    progress: Progress,
) -> None:
    """Heads, their calibration and the colours, from all homes but the held ones."""
    neck = Neck(s.out / "neck.onnx", s.threads)
    task = progress.add_task("regions", total=len(paths))
    held_homes = min(s.held, len(paths) // 2)
    learn, held = (
        collect(part, bank, neck, lambda: progress.advance(task))
        for part in (paths[: len(paths) - held_homes], paths[len(paths) - held_homes :])
    )
    log("regions")({"learned_from": float(len(learn)), "held": float(len(held)), "names": float(len(bank.names))})
    arrays = _heads(s, learn, bank, log)
    arrays |= {"words.mean": mean, "words.bank": bank.vectors, "calibration": np.array([1.0, 0.0])}
    arrays |= fit_text(load_lexicon().affordances, bank.names, text, mean, s.seed, log("text"))
    path = s.out / "regions.npz"
    save_weights(path, arrays)
    encoder = EmbeddedEncoder(text, s.out)
    scores = (
        np.concatenate([encoder.vectors(held.x[i : i + 4096].astype(np.float32)) for i in range(0, len(held), 4096)])
        @ encoder.encode_text(bank.names).T
    )
    arrays["calibration"] = np.array(calibrate(scores, held.own))
    save_weights(path, arrays)
    rank = (scores > scores[np.arange(len(held)), held.own][:, None]).sum(1)
    log("held regions")({"top1": float((rank == 0).mean()), "top5": float((rank < 5).mean())})
    save_weights(s.out / "colour.npz", fit_colour(learn, held, s.seed, log("colour")))


def train(s: Settings, console: Console) -> None:
    """Look at the homes, then train the neck, the region heads, the colours and the segmenter.

    Raises
    ------
    DataError
        A number that nothing can be learned with, or two runs of other settings share a work folder.
    """
    _check(s)
    start = time.monotonic()
    torch.use_deterministic_algorithms(True)
    torch.set_num_threads(s.threads)
    _same_settings(s)
    log, text = Log(s.out / "log.jsonl", console), TextEncoder()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        looked = (s.split, s.homes, s.views, s.patch_views, s.seed, s.work, s.processes, progress)
        paths = look_at_homes(*looked)
        bank, mean = make_bank(paths, text)
        if not (s.out / "neck.onnx").exists():
            task = progress.add_task("neck", total=None)
            checkpoint = s.work / "neck.checkpoint"
            report = log("neck")
            known, _ = make_bank(paths[: s.neck_homes], text)
            neck = fit_neck(paths[: s.neck_homes], known, s.seed, s.neck_epochs, s.neck_share, checkpoint, report)
            export_neck(neck, s.out / "neck.onnx")
            progress.update(task, total=1, completed=1)
        if not (s.out / "colour.npz").exists():
            _fit_regions(s, paths, bank, mean, text, log, progress)
        task = progress.add_task("segmenter", total=min(s.segmenter_homes, len(paths)))
        seen = samples(
            paths[: s.segmenter_homes],
            Neck(s.out / "neck.onnx", s.threads),
            s.patch_views,
            lambda: progress.advance(task),
        )
        save_weights(s.out / "segmenter.npz", fit_segmenter(seen, s.seed, 3, log("segmenter")))
    _write_card(s, bank, log, time.monotonic() - start)
    console.print(f"weights are in {s.out}")


def _check(s: Settings) -> None:
    """Refuse numbers that nothing can be learned with, before homes are built for it."""
    # The last homes are held back from the heads, so there are two at least; see ``held_homes``.
    least = {"homes": 2, "seed": 0} | dict.fromkeys(
        ("views", "patch_views", "held", "neck_homes", "segmenter_homes"), 1
    )
    least |= dict.fromkeys(("neck_epochs", "head_epochs", "processes", "threads"), 1)
    for name, lowest in least.items():
        if getattr(s, name) < lowest:
            raise DataError(f"--{name.replace('_', '-')}", str(getattr(s, name)), f"at least {lowest}")
    if s.held >= s.homes:
        raise DataError(
            "--held", f"{s.held} of {s.homes} homes", "fewer than --homes, so that some are left to learn from"
        )
    if not 0.0 < s.neck_share <= 1.0:
        raise DataError("--neck-share", str(s.neck_share), "more than 0, and 1 at most")


def _same_settings(s: Settings) -> None:
    """Refuse a work folder that another run filled."""
    mine = {k: v for k, v in asdict(s).items() if k in ("split", "views", "patch_views", "seed")}
    path = s.work / "settings.json"
    if path.exists() and json.loads(path.read_text()) != mine:
        raise DataError(path, path.read_text(), json.dumps(mine), "Name another --work folder, or delete this one.")
    s.work.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(mine))


def _write_card(s: Settings, bank: Bank, log: Log, seconds: float) -> None:
    settings = {k: v for k, v in asdict(s).items() if k not in ("out", "work")}
    machine = {"cpu": platform.processor() or platform.machine(), "cores": os.cpu_count(), "torch": torch.__version__}
    card = {"settings": settings, "seconds": round(seconds), "machine": machine, "colours": list(COLOURS)}
    (s.out / "training.json").write_text(json.dumps(card, indent=1) + "\n")
    (s.out / "names.json").write_text(json.dumps(bank.names, indent=0) + "\n")
    draw_curves(log.rows(), s.out / "curves.png")
