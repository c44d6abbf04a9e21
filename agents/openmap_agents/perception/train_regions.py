"""Trains the region heads: what is known of a region -> a place among words, so that its own name is the nearest of the bank.

One head reads looks and shape, one shape alone; each has two layers. The loss is the cross-entropy of the softmax over the cosines
with all names of the bank, at a fixed temperature. The words' vectors are the text encoder's own less their mean, and stay as they
are: what is learned for "armchair" is then also said of "easy chair".
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.backbone import Backbone
from openmap_agents.perception.encoder import describe
from openmap_agents.perception.overlap import ious, true_masks
from openmap_agents.perception.segmenter import EmbeddedSegmenter
from openmap_agents.perception.train_segmenter import Sample

TEMPERATURE = 0.06
_MIN_IOU = 0.5


@dataclass(frozen=True)
class Regions:
    """Descriptions (n, N) float16 of regions, the names of what they show, and which thing of which home it is."""

    looks: npt.NDArray[np.float16]
    names: list[str]
    things: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.names)


def collect(
    samples: Iterable[tuple[int, Sample, dict[int, str]]], backbone: Backbone, segmenter: EmbeddedSegmenter
) -> Regions:
    """Regions of (home, view, names by id): every thing's true mask, and the predicted masks that show one well."""
    rows: list[npt.NDArray[np.float16]] = []
    names: list[str] = []
    things: list[int] = []
    for home, sample, known in samples:
        frame, pose = sample.view.frame, sample.view.T_world_camera
        maps = backbone.dense(frame.rgb)
        predicted = segmenter.segment(frame.rgb, frame.depth, pose, sample.camera)
        present, overlap = ious(predicted.labels, frame.instance)
        truth, kept = true_masks(frame.instance, (i for i in present.tolist() if i in known))
        good = [
            (int(present[overlap[:, k].argmax()]), k) for k in range(len(predicted)) if overlap[:, k].max() >= _MIN_IOU
        ]
        good = [(i, k) for i, k in good if i in known]
        for masks, chosen in ((truth, list(enumerate(kept))), (predicted, [(k, i) for i, k in good])):
            if chosen:
                described = describe(maps, frame.rgb, frame.depth, masks, pose, sample.camera)
                rows.append(described[[k for k, _ in chosen]].astype(np.float16))
                names += [known[i] for _, i in chosen]
                things += [home * 100_000 + i for _, i in chosen]
    return Regions(np.concatenate(rows), names, np.array(things))


def fit_head(
    x: npt.NDArray[np.float32],
    own: npt.NDArray[np.int64],
    weight: npt.NDArray[np.float32],
    bank: npt.NDArray[np.float32],
    hidden: int,
    seed: int,
    epochs: int,
    dropout: float,
) -> dict[str, npt.NDArray[np.float32]]:
    """Weights of a two-layer head from x (n, inputs) to the bank's space (names, D); ``own`` (n,) says which name is right."""
    torch.manual_seed(seed)
    mean, std = x.mean(0), x.std(0) + 1e-2
    model = nn.Sequential(
        nn.Dropout(dropout / 2),
        nn.Linear(x.shape[1], hidden),
        nn.ReLU(),
        nn.Dropout(dropout),
        nn.Linear(hidden, bank.shape[1]),
    )
    data = [torch.from_numpy(np.ascontiguousarray(a)) for a in ((x - mean) / std, own, weight)]
    words = torch.from_numpy(bank).T
    steps = epochs * -(-len(x) // 512)
    optimiser = torch.optim.AdamW(model.parameters(), 1e-3, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, total_steps=steps)
    for _ in range(epochs):
        for rows in torch.split(torch.randperm(len(x)), 512):
            xs, ys, ws = (a[rows] for a in data)
            logits = nn.functional.normalize(model(xs), dim=1) @ words / TEMPERATURE
            loss = nn.functional.cross_entropy(logits, ys, reduction="none", label_smoothing=0.05)
            optimiser.zero_grad()
            torch.autograd.backward((loss * ws).sum() / ws.sum())
            optimiser.step()
            schedule.step()
    w1, b1, w2, b2 = (p.detach().numpy() for p in model.parameters())
    return {"mean": mean, "std": std, "w1": w1, "b1": b1, "w2": w2, "b2": b2}


def weights_of(regions: Regions, own: npt.NDArray[np.int64]) -> npt.NDArray[np.float32]:
    """So that a name counts with the root of how often it was seen, and a thing's views share among them with the root too."""
    _, thing, views = np.unique(regions.things, return_inverse=True, return_counts=True)
    per_view = 1.0 / np.sqrt(views[thing])
    mass = np.bincount(own, per_view)
    return (per_view / np.sqrt(mass[own])).astype(np.float32)
