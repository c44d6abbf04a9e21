"""Trains the segmenter's two networks on views whose ids are known.

The join network learns from the pairs that it meets itself: the first round joins by a hand-set rule, each later one by the
network of the round before (Ross et al., A Reduction of Imitation Learning to No-Regret Online Learning, AISTATS 2011). The node
network learns the IoU of every node of the resulting trees with the thing it shows most of, and whether that is structure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.regions import N_PAIR, Network, Tree, agglomerate, describe
from openmap_agents.perception.segmenter import LOWEST_JOIN, node_features, patches_of, plain_join
from openmap_agents.perception.surface import working_picture
from openmap_agents.perception.views import View
from openmap_scenes import PinholeCamera

HIDDEN = 32
_PURE = 0.8  # a region counts as showing one thing if this share of it does
_PAIRS_A_VIEW = 600
_LOG = 60_000
_NODE_NETWORKS = 4
_SMALLEST = 40  # working pixels below which a node teaches nothing


@dataclass(frozen=True)
class Sample:
    """A view as the networks see it: the patches' ids (h, w) and which ids are structure."""

    view: View
    camera: PinholeCamera
    structure: frozenset[int]


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


def _histogram(
    tree: Tree, patches: npt.NDArray[np.int32], ids: npt.NDArray[np.int64], n_ids: int
) -> npt.NDArray[np.float64]:
    """Pixels of each id under each node, (n + k, n_ids)."""
    n, seen = tree.n_leaves, patches >= 0
    counts = np.zeros((len(tree.sums), n_ids))
    counts[:n] = np.bincount(patches[seen] * n_ids + ids[seen], minlength=n * n_ids).reshape(n, n_ids)
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


def lessons(sample: Sample, join: Network, rng: np.random.Generator) -> Lessons | None:
    """What one view teaches when its patches are joined by ``join``."""
    surface = working_picture(sample.view.frame.rgb, sample.view.frame.depth, sample.view.T_world_camera, sample.camera)
    patches = patches_of(surface)
    if patches.max() < 1:
        return None
    log = (np.empty((_LOG, 2), np.int32), np.empty((_LOG, N_PAIR)))
    tree, logged = agglomerate(describe(patches, surface), surface.floor, join, LOWEST_JOIN, log)
    offset = surface.step // 2
    present, ids = np.unique(
        sample.view.frame.instance[offset :: surface.step, offset :: surface.step], return_inverse=True
    )
    counts = _histogram(tree, patches, ids.reshape(patches.shape), len(present))
    size, main = counts.sum(1), counts.argmax(1)
    most = counts[np.arange(len(main)), main]
    pure = most >= _PURE * size

    pairs = log[0][:logged]
    chosen = np.flatnonzero(pure[pairs].all(1))
    chosen = rng.permutation(chosen)[:_PAIRS_A_VIEW]
    nodes = np.flatnonzero(size >= _SMALLEST)
    things = np.bincount(ids.ravel(), minlength=len(present))
    iou = most / (size + things[main] - most)
    structure = np.isin(present[main], [*sample.structure, 0])
    return Lessons(
        log[1][chosen].astype(np.float32),
        (main[pairs[chosen, 0]] == main[pairs[chosen, 1]]).astype(np.float32)[:, None],
        np.sqrt(size[pairs[chosen]].min(1)).astype(np.float32)[:, None],
        node_features(tree, surface.floor, patches.size)[nodes].astype(np.float32),
        np.stack([iou, structure], 1)[nodes].astype(np.float32),
        np.sqrt(size[nodes]).astype(np.float32)[:, None],
    )


def train_segmenter(samples: list[Sample], seed: int, rounds: int = 3) -> dict[str, npt.NDArray[np.float64]]:
    """The weights of the two networks, as ``EmbeddedSegmenter`` reads them."""
    join, pairs = plain_join(), []
    taught: list[Lessons] = []
    for i in range(rounds):
        rng = np.random.default_rng([seed, i])
        taught = [t for t in (lessons(s, join, rng) for s in samples) if t is not None]
        pairs += taught
        if i < rounds - 1:
            x, y, w = (np.concatenate([getattr(t, a) for t in pairs]) for a in ("pairs", "same", "pair_weights"))
            join = fit(x, y, w, seed)
            error = float(((join(x) > 0.5) != (y > 0.5)).mean())
            print(f"joins, round {i + 1}: {len(x)} pairs, {error:.1%} wrong")
    # The nodes of the last round come from the network that is kept.
    x, y, w = (np.concatenate([getattr(t, a) for t in taught]) for a in ("nodes", "targets", "node_weights"))
    # Several, because what one of them takes for a wall in a strange house is a matter of luck.
    node = average([fit(x, y, w, seed + i) for i in range(_NODE_NETWORKS)])
    error, mistaken = float(np.abs(node(x) - y)[:, 0].mean()), float(((node(x) > 0.5) != (y > 0.5))[:, 1].mean())
    print(f"nodes: {len(x)}, IoU off by {error:.3f}, structure {mistaken:.1%} wrong")
    return {
        f"{name}.{part}": array
        for name, network in (("join", join), ("node", node))
        for part, array in zip(("w1", "b1", "w2", "b2"), network.arrays(), strict=True)
    }
