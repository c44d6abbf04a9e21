"""Trains the segmenter's two small networks: which pairs belong together, and how good a mask every node of the tree would be.

The first learns from the pairs that the joining meets, joined by itself, round after round, since its own mistakes make the
pairs (Ross et al., DAgger, AISTATS 2011). The second learns the IoU of every node with the thing most of it shows, and whether
that is floor, wall or ceiling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.joining import N_PAIR, Network, Tree, agglomerate
from openmap_agents.perception.maps import cells_of
from openmap_agents.perception.neck import Neck
from openmap_agents.perception.regions import N_BOUNDARY, Regions, add_belonging
from openmap_agents.perception.segmenter import LOWEST_JOIN, node_features, plain_join
from openmap_agents.perception.training.shards import Shard, dequantised
from openmap_agents.perception.views import STRUCTURE

HIDDEN = 32
_PURE = 0.8  # a region counts as showing one thing if this share of it does
_PAIRS_A_VIEW = 600
_LOG = 60_000
_NODE_NETWORKS = 4
_SMALLEST = 40  # working pixels below which a node teaches nothing


@dataclass(frozen=True)
class Sample:
    """A view: its patches (h, w), their description, the number (h, w) of the thing at each pixel, which numbers are structure.

    Of the boundaries only ``pairs`` (m, 2) of patches that touch are held, with ``between`` (m, N_BOUNDARY): a thousandth.
    """

    patches: npt.NDArray[np.int16]
    sums: npt.NDArray[np.float64]
    extremes: npt.NDArray[np.float64]
    pairs: npt.NDArray[np.int16]
    between: npt.NDArray[np.float32]
    floor: float
    local: npt.NDArray[np.uint8]
    structure: npt.NDArray[np.bool_]

    def regions(self) -> Regions:
        """The description as the joining takes it."""
        n = len(self.sums)
        boundary = np.zeros((n, n, N_BOUNDARY), np.float32)
        boundary[self.pairs[:, 0], self.pairs[:, 1]] = self.between
        return Regions(self.sums, self.extremes, boundary)


def samples(paths: list[Path], neck: Neck, most: int, progress: Callable[[], None]) -> list[Sample]:
    """At most ``most`` views of each home, with what the neck says of their patches."""
    out = []
    for path in paths:
        shard = Shard(path)
        for k in [k for k in range(shard.n) if shard.has_patches(k)][:most]:
            lesson = shard.lesson(k)
            assert lesson.patches is not None
            features = neck(dequantised(lesson), lesson.geometry.astype(np.float32))
            patches, (step, height, width) = lesson.patches, lesson.grid
            where = cells_of(step, 4, height, width)
            add_belonging(patches.regions, patches.patches.astype(np.int32), features.belonging, *where)
            names = [shard.names.get(i, "") for i in lesson.present.tolist()]
            structure = np.array([True, *(name in STRUCTURE for name in names)])
            r = patches.regions
            pairs = np.argwhere(r.boundary[:, :, 0] > 0)
            between = r.boundary[pairs[:, 0], pairs[:, 1]]
            held = (patches.patches, r.sums, r.extremes, pairs.astype(np.int16), between, patches.floor)
            out.append(Sample(*held, lesson.local, structure))
        progress()
    return out


def fit(
    x: npt.NDArray[np.float32],
    y: npt.NDArray[np.float32],
    weight: npt.NDArray[np.float32],
    seed: int,
    epochs: int = 20,
) -> Network:
    """The network that predicts probabilities y (n, outputs) from x (n, inputs), by weighted cross-entropy."""
    torch.manual_seed(seed)
    mean, std = x.mean(0), x.std(0) + 1e-3
    model = nn.Sequential(nn.Linear(x.shape[1], HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, y.shape[1]))
    data = [torch.from_numpy(a) for a in ((x - mean) / std, y, weight)]
    steps = epochs * -(-len(x) // 2048)
    optimiser = torch.optim.AdamW(model.parameters(), 4e-3, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 8e-3, total_steps=steps)
    for _ in range(epochs):
        for rows in torch.split(torch.randperm(len(x)), 2048):
            xs, ys, ws = (a[rows] for a in data)
            loss = nn.functional.binary_cross_entropy_with_logits(model(xs), ys, reduction="none")
            optimiser.zero_grad()
            torch.autograd.backward((loss * ws).sum() / ws.sum())
            optimiser.step()
            schedule.step()
    w1, b1, w2, b2 = (p.detach().numpy().astype(np.float64) for p in model.parameters())
    return Network(w1 / std, b1 - w1 @ (mean / std), w2, b2)


def average(networks: list[Network]) -> Network:
    """One network whose logits are the means of theirs: their hidden units side by side."""
    w1, b1, w2, b2 = zip(*(n.arrays() for n in networks), strict=True)
    share = 1.0 / len(networks)
    return Network(np.concatenate(w1), np.concatenate(b1), share * np.concatenate(w2, axis=1), np.mean(b2, axis=0))


def _histogram(tree: Tree, sample: Sample) -> npt.NDArray[np.float64]:
    """Pixels of each number under each node, (n + k, numbers)."""
    n, m, seen = tree.n_leaves, len(sample.structure), sample.patches >= 0
    counts = np.zeros((len(tree.sums), m))
    flat = sample.patches[seen].astype(np.int64) * m + sample.local[seen]
    counts[:n] = np.bincount(flat, minlength=n * m).reshape(n, m)
    for i, (a, b) in enumerate(tree.children, start=n):
        counts[i] = counts[a] + counts[b]
    return counts


@dataclass
class Lessons:
    """Rows of features, targets and weights, for the joins and for the nodes."""

    pairs: npt.NDArray[np.float32]
    same: npt.NDArray[np.float32]
    pair_weights: npt.NDArray[np.float32]
    nodes: npt.NDArray[np.float32]
    targets: npt.NDArray[np.float32]
    node_weights: npt.NDArray[np.float32]


def lessons(sample: Sample, join: Network, rng: np.random.Generator) -> Lessons:
    """What one view teaches when its patches are joined by ``join``."""
    log = (np.empty((_LOG, 2), np.int32), np.empty((_LOG, N_PAIR)))
    tree, logged = agglomerate(sample.regions(), sample.floor, join, LOWEST_JOIN, log)
    counts = _histogram(tree, sample)
    size, main = counts.sum(1), counts.argmax(1)
    most = counts[np.arange(len(main)), main]
    pure = most >= _PURE * size

    pairs = log[0][:logged]
    chosen = np.flatnonzero(pure[pairs].all(1))
    chosen = rng.permutation(chosen)[:_PAIRS_A_VIEW]
    nodes = np.flatnonzero(size >= _SMALLEST)
    things = np.bincount(sample.local.ravel(), minlength=counts.shape[1])
    iou = most / (size + things[main] - most)
    return Lessons(
        log[1][chosen].astype(np.float32),
        (main[pairs[chosen, 0]] == main[pairs[chosen, 1]]).astype(np.float32)[:, None],
        np.sqrt(size[pairs[chosen]].min(1)).astype(np.float32)[:, None],
        node_features(tree, sample.floor, sample.patches.size)[nodes].astype(np.float32),
        np.stack([iou, sample.structure[main]], 1)[nodes].astype(np.float32),
        np.sqrt(size[nodes]).astype(np.float32)[:, None],
    )


def fit_segmenter(
    every: list[Sample], seed: int, rounds: int, report: Callable[[dict[str, float]], None]
) -> dict[str, npt.NDArray[np.float64]]:
    """The weights of the two networks, as ``EmbeddedSegmenter`` reads them."""
    join, pairs = plain_join(), []
    taught: list[Lessons] = []
    for i in range(rounds):
        rng = np.random.default_rng([seed, i])
        taught = [lessons(s, join, rng) for s in every]
        pairs += taught
        if i < rounds - 1:
            x, y, w = (np.concatenate([getattr(t, a) for t in pairs]) for a in ("pairs", "same", "pair_weights"))
            join = fit(x, y, w, seed)
            report({"round": i + 1.0, "pairs": float(len(x)), "wrong": float(((join(x) > 0.5) != (y > 0.5)).mean())})
    # The nodes of the last round come from the network that is kept.
    x, y, w = (np.concatenate([getattr(t, a) for t in taught]) for a in ("nodes", "targets", "node_weights"))
    # Several, because what one of them takes for a wall in a strange house is a matter of luck.
    node = average([fit(x, y, w, seed + i) for i in range(_NODE_NETWORKS)])
    off, mistaken = float(np.abs(node(x) - y)[:, 0].mean()), float(((node(x) > 0.5) != (y > 0.5))[:, 1].mean())
    report({"nodes": float(len(x)), "iou_off": off, "structure_wrong": mistaken})
    return {
        f"{name}.{part}": array
        for name, network in (("join", join), ("node", node))
        for part, array in zip(("w1", "b1", "w2", "b2"), network.arrays(), strict=True)
    }
