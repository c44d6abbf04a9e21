"""Trains the neck: the means of its maps under a thing's mask must name it, and pixels must tell with which others they belong.

Names are learned as for the region heads (``fit_regions``): the cross-entropy over the cosines with all names of the bank, and the
same down the columns, over the regions of a batch, so that of two things the one called so is the nearer to a name. Belonging is
learned from pairs of pixels that lie near each other: the odds that both are of one thing are b - a |e_p - e_q|^2 (after
De Brabandere et al., Semantic Instance Segmentation with a Discriminative Loss Function, 2017, and Kong and Fowlkes, CVPR 2018).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.maps import N_BELONGING, cells_of, cover
from openmap_agents.perception.neck import N_LOOKS, N_SHAPE_MAP
from openmap_agents.perception.shape import N_SHAPE
from openmap_agents.perception.training.network import Neck
from openmap_agents.perception.training.shards import Lesson, Shard, dequantised
from openmap_agents.perception.views import STRUCTURE

TEMPERATURE = 0.06
_BATCH = 4  # views of one home
_OPEN = 6  # homes that batches are drawn from in turn
_PAIRS = 4000  # of pixels, a view
_REACH = 12  # cells of stride 4
_ALL_STRUCTURE = ("wall", "floor", "ceiling")


@dataclass(frozen=True)
class Bank:
    """The names that are learned.

    Parameters
    ----------
    names : list of str
    vectors : (n, 384) float32
        Unit, less the mean of all.
    weights : (n,) float32
        What a region of each counts: rare names more, by the root.
    """

    names: list[str]
    vectors: npt.NDArray[np.float32]
    weights: npt.NDArray[np.float32]

    def number(self, name: str | None) -> int:
        """Its place, -1 for what is not in the bank."""
        return self._places.get(name or "", -1)

    @property
    def _places(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.names)}


class Head(nn.Module):
    """Means under masks and shape -> unit vectors in the words' space; only to teach the neck."""

    def __init__(self, inputs: int, hidden: int, outputs: int) -> None:
        super().__init__()
        self.steps = nn.Sequential(
            nn.BatchNorm1d(inputs),
            nn.Dropout(0.1),
            nn.Linear(inputs, hidden),
            nn.ReLU(),
            nn.Dropout(0.2),
            nn.Linear(hidden, outputs),
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return nn.functional.normalize(self.steps(x), dim=1)


def naming_loss(
    vectors: torch.Tensor, bank: torch.Tensor, own: torch.Tensor, weight: torch.Tensor, across: float = 0.5
) -> torch.Tensor:
    """Cross-entropy of rows (n, D) with their names (n,), and ``across`` times that of names with their rows."""
    logits = vectors @ bank.T / TEMPERATURE
    along = nn.functional.cross_entropy(logits, own, reduction="none", label_smoothing=0.05)
    loss = (along * weight).sum() / weight.sum()
    if across == 0.0:
        return loss
    down = nn.functional.log_softmax(logits + weight.log()[:, None], 0)
    names, which = torch.unique(own, return_inverse=True)
    right = nn.functional.one_hot(which, len(names)).bool()
    return loss - across * torch.logsumexp(down[:, names].masked_fill(~right, -1e9), 0).mean()


@dataclass(frozen=True)
class Example:
    """A lesson as tensors: maps, mean of cells (n, h8 * w8) of each region, its shape, name and weight; labels at stride 4."""

    inputs: list[torch.Tensor]
    cells: torch.Tensor
    shape: torch.Tensor
    own: torch.Tensor
    weight: torch.Tensor
    local: npt.NDArray[np.int64]
    classes: npt.NDArray[np.int64]


def example(lesson: Lesson, shard: Shard, bank: Bank) -> Example:
    """A lesson made ready."""
    maps = dequantised(lesson)
    step, height, width = lesson.grid
    rows, cells = lesson.regions.astype(np.int64), []
    for kind, labels in enumerate((lesson.local, lesson.rough)):
        level = cover(labels, len(lesson.present), step, height, width)[1]
        level /= np.maximum(level.sum(1, keepdims=True), 1.0)
        cells.append(level[rows[lesson.kind_of_mask == kind] - 1])
    names = [shard.names.get(int(i)) for i in lesson.present]
    own = np.array([bank.number(name) for name in names], np.int64)[rows - 1]
    known = own >= 0
    at_rows, at_columns = cells_of(step, 4, height, width)
    v, u = (np.searchsorted(at, np.arange(at[-1] + 1)) for at in (at_rows, at_columns))
    local = lesson.local[v[:, None], u].astype(np.int64)
    classes = np.array([0, *(1 + _ALL_STRUCTURE.index(n) if n in STRUCTURE else 0 for n in names)], np.int64)[local]
    weight = bank.weights[np.maximum(own, 0)] * np.sqrt(lesson.pixels / 2000.0).clip(0.5, 1.5)
    return Example(
        [torch.from_numpy(x) for x in (*maps, lesson.geometry.astype(np.float32))],
        torch.from_numpy(np.concatenate(cells)[known]),
        torch.from_numpy(lesson.shape.astype(np.float32)[known]),
        torch.from_numpy(own[known]),
        torch.from_numpy(weight[known].astype(np.float32)),
        local,
        np.where(local > 0, classes, -1),
    )


class Teacher(nn.Module):
    """The neck with what is needed to teach it."""

    def __init__(self, neck: Neck, dim: int) -> None:
        super().__init__()
        self.neck = neck
        self.shape_head = Head(N_SHAPE_MAP + N_SHAPE, 160, dim)
        self.looks_head = Head(N_LOOKS + N_SHAPE_MAP + N_SHAPE, 224, dim)
        self.spread = nn.Parameter(torch.tensor([1.0, 2.0]))

    def forward(
        self, batch: list[Example], bank: torch.Tensor, rng: np.random.Generator
    ) -> tuple[torch.Tensor, dict[str, float]]:
        """The loss of a batch, and its parts."""
        inputs = [
            torch.stack(x).contiguous(memory_format=torch.channels_last)
            for x in zip(*(e.inputs for e in batch), strict=True)
        ]
        shape, looks, belonging = self.neck(*inputs)
        by_shape = torch.cat([e.cells @ s.flatten(1).T for e, s in zip(batch, shape, strict=True)])
        by_looks = torch.cat([e.cells @ s.flatten(1).T for e, s in zip(batch, looks, strict=True)])
        size, own, weight = (torch.cat([getattr(e, f) for e in batch]) for f in ("shape", "own", "weight"))
        parts = {
            "shape": naming_loss(self.shape_head(torch.cat([by_shape, size], 1)), bank, own, weight),
            "looks": naming_loss(self.looks_head(torch.cat([by_looks, by_shape, size], 1)), bank, own, weight),
        }
        pairs, classes = zip(*(self._pixels(b, e, rng) for b, e in zip(belonging, batch, strict=True)), strict=True)
        parts |= {"pairs": torch.stack(pairs).mean(), "classes": torch.stack(classes).mean()}
        loss = parts["shape"] + parts["looks"] + 2.0 * parts["pairs"] + parts["classes"]
        return loss, {k: float(v.detach()) for k, v in parts.items()}

    def _pixels(
        self, belonging: torch.Tensor, e: Example, rng: np.random.Generator
    ) -> tuple[torch.Tensor, torch.Tensor]:
        h, w = e.local.shape
        p = np.stack([rng.integers(0, h, _PAIRS), rng.integers(0, w, _PAIRS)])
        q = (p + rng.integers(-_REACH, _REACH + 1, (2, _PAIRS))).clip(0, np.array([[h - 1], [w - 1]]))
        a, b = e.local[p[0], p[1]], e.local[q[0], q[1]]
        kept = np.flatnonzero((a > 0) & (b > 0) & (p != q).any(0))
        ep, eq = (belonging[:N_BELONGING, x[0, kept], x[1, kept]] for x in (p, q))
        logit = self.spread[1] - nn.functional.softplus(self.spread[0]) * (ep - eq).square().sum(0)
        same = torch.from_numpy((a == b)[kept].astype(np.float32))
        share = same.mean().clamp(0.02, 0.98)
        weight = torch.where(same > 0, 0.5 / share, 0.5 / (1 - share))
        pairs = nn.functional.binary_cross_entropy_with_logits(logit, same, weight=weight)
        target = torch.from_numpy(e.classes[p[0], p[1]])
        classes = nn.functional.cross_entropy(belonging[N_BELONGING:, p[0], p[1]].T, target, ignore_index=-1)
        return pairs, classes


def batches(paths: list[Path], bank: Bank, share: float, rng: np.random.Generator) -> Iterator[list[Example]]:
    """Batches of views, each of one home, homes in turn; ``share`` of every home's views."""
    waiting = [paths[i] for i in rng.permutation(len(paths))]
    active: list[tuple[Shard, list[int]]] = []
    while waiting or active:
        while waiting and len(active) < _OPEN:
            shard = Shard(waiting.pop())
            order = rng.permutation(shard.n)[: max(_BATCH, round(shard.n * share))]
            active.append((shard, order.tolist()))
        shard, left = active[int(rng.integers(len(active)))]
        chosen, left[:] = left[:_BATCH], left[_BATCH:]
        if len(left) < _BATCH:
            active = [a for a in active if a[0] is not shard]
        made = [example(shard.lesson(k), shard, bank) for k in chosen]
        made = [e for e in made if len(e.own)]
        if len(made) > 1:
            yield made


def channel_statistics(paths: list[Path]) -> tuple[list[torch.Tensor], list[torch.Tensor]]:
    """Mean and deviation of the backbone's channels over some views of some homes."""
    seen: list[list[npt.NDArray[np.float32]]] = [[], [], []]
    for path in paths[:12]:
        shard = Shard(path)
        for k in range(0, shard.n, 16):
            for store, m in zip(seen, dequantised(shard.lesson(k)), strict=True):
                store.append(m.reshape(len(m), -1))
    stacked = [np.concatenate(s, 1) for s in seen]
    return [torch.from_numpy(s.mean(1)) for s in stacked], [torch.from_numpy(s.std(1) + 1e-3) for s in stacked]


def fit_neck(
    paths: list[Path],
    bank: Bank,
    seed: int,
    epochs: int,
    share: float,
    checkpoint: Path,
    report: Callable[[dict[str, float]], None],
    rate: float = 3e-3,
) -> Neck:
    """The trained neck. A run that was stopped goes on at the last whole epoch that ``checkpoint`` holds.

    Parameters
    ----------
    paths : list of Path
        Shards.
    epochs : int
    share : float
        Of each home's views that an epoch uses.
    report : callable
        Takes the mean losses and the step of every fifty steps.
    """
    torch.manual_seed(seed)
    teacher = Teacher(Neck(*channel_statistics(paths)), bank.vectors.shape[1]).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    views = sum(max(_BATCH, round(Shard(p).n * share)) // _BATCH for p in paths)
    optimiser = torch.optim.AdamW(teacher.parameters(), rate, weight_decay=2e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, rate, total_steps=epochs * views + epochs, pct_start=0.15)
    first = 0
    if checkpoint.exists():
        state = torch.load(checkpoint, weights_only=True)
        teacher.load_state_dict(state["teacher"])
        optimiser.load_state_dict(state["optimiser"])
        schedule.load_state_dict(state["schedule"])
        first = int(state["epoch"])
    vectors = torch.from_numpy(bank.vectors)
    for epoch in range(first, epochs):
        rng = np.random.default_rng([seed, 17, epoch])
        torch.manual_seed(seed * 1000 + epoch)
        teacher.train()
        sums: dict[str, float] = {}
        for i, batch in enumerate(batches(paths, bank, share, rng), start=1):
            loss, parts = teacher(batch, vectors, rng)
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            nn.utils.clip_grad_norm_(teacher.parameters(), 5.0)
            optimiser.step()
            if schedule.last_epoch < schedule.total_steps - 1:
                schedule.step()
            sums = {k: sums.get(k, 0.0) + v for k, v in parts.items()}
            if i % 50 == 0:
                report({"step": float(epoch * views + i)} | {k: v / 50 for k, v in sums.items()})
                sums = {}
        state = {
            "teacher": teacher.state_dict(),
            "optimiser": optimiser.state_dict(),
            "schedule": schedule.state_dict(),
        }
        unfinished = checkpoint.with_suffix(".part")
        torch.save(state | {"epoch": epoch + 1}, unfinished)
        unfinished.replace(checkpoint)
    neck: Neck = teacher.neck.eval()
    return neck
