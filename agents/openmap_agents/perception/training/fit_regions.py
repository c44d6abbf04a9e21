"""Trains the region heads: what is known of a region -> a place among words, so that its own name is the nearest of the bank.

Each head has two layers and its own columns of the description (``encoder.HEADS``). The loss is that of ``naming_loss``. The words'
vectors are the text encoder's own less their mean, and stay as they are: what is learned for "armchair" is then also said of "easy
chair".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.maps import cover, means
from openmap_agents.perception.neck import Features, Neck
from openmap_agents.perception.training.fit_neck import Bank, naming_loss
from openmap_agents.perception.training.shards import Lesson, Shard, dequantised

_BATCH = 512


@dataclass(frozen=True)
class Regions:
    """Descriptions (n, N_DESCRIPTION) float16, names' numbers (n,), things (n,), pixels (n,), colours' features and words."""

    x: npt.NDArray[np.float16]
    own: npt.NDArray[np.int64]
    things: npt.NDArray[np.int64]
    pixels: npt.NDArray[np.float32]
    colour: npt.NDArray[np.float16]
    colour_words: list[str]

    def __len__(self) -> int:
        return len(self.own)


def neck_means(lesson: Lesson, features: Features) -> npt.NDArray[np.float32]:
    """The neck's shape and looks under the masks of a lesson's rows, side by side."""
    out = []
    for kind, labels in enumerate((lesson.local, lesson.rough)):
        cells = cover(labels, len(lesson.present), *lesson.grid)[1]
        chosen = cells[lesson.regions[lesson.kind_of_mask == kind].astype(np.int64) - 1]
        out.append(np.hstack([means(chosen, m) for m in (features.shape, features.looks)]))
    return np.concatenate(out)


def collect(paths: list[Path], bank: Bank, neck: Neck, progress: Callable[[], None]) -> Regions:
    """The regions of all lessons whose names are in the bank."""
    x, own, things, pixels, colour, words = [], [], [], [], [], []
    for home, path in enumerate(paths):
        shard = Shard(path)
        for k in range(shard.n):
            lesson = shard.lesson(k)
            ids = lesson.present[lesson.regions.astype(np.int64) - 1]
            number = np.array([bank.number(shard.names.get(i)) for i in ids.tolist()], np.int64)
            known = number >= 0
            if not known.any():
                continue
            looked = neck_means(lesson, neck(dequantised(lesson), lesson.geometry.astype(np.float32)))
            rows = np.hstack([lesson.pooled, lesson.shape, looked.astype(np.float16)])
            x.append(rows[known])
            own.append(number[known])
            things.append(home * 100_000 + ids[known].astype(np.int64))
            pixels.append(lesson.pixels[known])
            colour.append(lesson.colour[known])
            words += [shard.colours.get(i, "") for i in ids[known].tolist()]
        progress()
    parts = {"x": x, "own": own, "things": things, "pixels": pixels, "colour": colour}
    stacked: dict[str, Any] = {name: np.concatenate(part) for name, part in parts.items()}
    return Regions(colour_words=words, **stacked)


def weights_of(regions: Regions) -> npt.NDArray[np.float32]:
    """So that a name counts with the root of how often it was seen, and a thing's views share among them with the root too."""
    _, thing, views = np.unique(regions.things, return_inverse=True, return_counts=True)
    per_view = 1.0 / np.sqrt(views[thing])
    mass = np.bincount(regions.own, per_view)
    weight = per_view / np.sqrt(mass[regions.own])
    return np.asarray(weight / weight.mean(), np.float32)


def fit_head(
    regions: Regions,
    columns: slice,
    bank: npt.NDArray[np.float32],
    weight: npt.NDArray[np.float32],
    hidden: int,
    seed: int,
    epochs: int,
    dropout: float,
    report: Callable[[dict[str, float]], None],
) -> dict[str, npt.NDArray[np.float32]]:
    """Weights of a two-layer head from some columns of the descriptions to the bank's space (names, D)."""
    torch.manual_seed(seed)
    x, n = regions.x[:, columns], len(regions)
    sample = x[:: max(1, n // 20_000)].astype(np.float32)
    mean, std = sample.mean(0), sample.std(0) + 1e-2
    model = nn.Sequential(
        nn.Dropout(dropout / 2),
        nn.Linear(x.shape[1], hidden),
        nn.ReLU(),
        nn.Dropout(dropout),
        nn.Linear(hidden, bank.shape[1]),
    )
    words, own, weights = torch.from_numpy(bank), torch.from_numpy(regions.own), torch.from_numpy(weight)
    optimiser = torch.optim.AdamW(model.parameters(), 1e-3, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, total_steps=epochs * -(-n // _BATCH))
    for epoch in range(epochs):
        losses = []
        for rows in torch.split(torch.randperm(n), _BATCH):
            xs = torch.from_numpy((x[rows.numpy()].astype(np.float32) - mean) / std)
            loss = naming_loss(nn.functional.normalize(model(xs), dim=1), words, own[rows], weights[rows], 1.0)
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            optimiser.step()
            schedule.step()
            losses.append(float(loss.detach()))
        report({"epoch": float(epoch + 1), "loss": float(np.mean(losses))})
    w1, b1, w2, b2 = (p.detach().numpy() for p in model.parameters())
    return {"mean": mean, "std": std, "w1": w1, "b1": b1, "w2": w2, "b2": b2}
