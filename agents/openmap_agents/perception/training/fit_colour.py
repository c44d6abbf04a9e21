"""Trains the colour word of a region: ``colour_features`` -> one of thirteen, as the homes' furniture is described."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.colour import COLOURS
from openmap_agents.perception.training.fit_regions import Regions

_HIDDEN, _EPOCHS, _BATCH = 64, 12, 512


def _rows(regions: Regions) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    known = np.array([word in COLOURS for word in regions.colour_words], bool)
    x, y = (
        regions.colour[known].astype(np.float32),
        np.array([COLOURS.index(w) for w in regions.colour_words if w in COLOURS]),
    )
    _, thing, views = np.unique(regions.things[known], return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(views[thing])
    mass = np.bincount(y, weight, len(COLOURS)) if len(y) else np.ones(len(COLOURS))
    return x, y.astype(np.int64), (weight / np.sqrt(mass[y])).astype(np.float32)


def fit_colour(
    learn: Regions, held: Regions, seed: int, report: Callable[[dict[str, float]], None]
) -> dict[str, npt.NDArray[np.float32]]:
    """Weights of the network; rare colours count more, by the root."""
    torch.manual_seed(seed)
    x, y, weight = _rows(learn)
    mean, std = x.mean(0), x.std(0) + 1e-2
    model = nn.Sequential(nn.Linear(x.shape[1], _HIDDEN), nn.ReLU(), nn.Dropout(0.1), nn.Linear(_HIDDEN, len(COLOURS)))
    data = [torch.from_numpy(a) for a in ((x - mean) / std, y, weight)]
    optimiser = torch.optim.AdamW(model.parameters(), 2e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 4e-3, total_steps=_EPOCHS * -(-len(x) // _BATCH))
    for _ in range(_EPOCHS):
        for rows in torch.split(torch.randperm(len(x)), _BATCH):
            xs, ys, ws = (a[rows] for a in data)
            loss = nn.functional.cross_entropy(model(xs), ys, reduction="none", label_smoothing=0.05)
            optimiser.zero_grad()
            torch.autograd.backward((loss * ws).sum() / ws.sum())
            optimiser.step()
            schedule.step()
    hx, hy, _ = _rows(held)
    if len(hy):
        with torch.no_grad():
            model.eval()
            said = model(torch.from_numpy((hx - mean) / std)).argmax(1).numpy()
        report({"held_views": float(len(hy)), "right": float((said == hy).mean())})
    w1, b1, w2, b2 = (p.detach().numpy() for p in model.parameters())
    return {"mean": mean, "std": std, "w1": w1, "b1": b1, "w2": w2, "b2": b2}
