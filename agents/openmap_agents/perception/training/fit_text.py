"""Trains the text side: a small step in the space of words that takes what a thing is for to what it is called.

The text encoder puts "something to sit on" nearer to "sitting" than to "chair". From a table of what household things are for,
and from names in other phrases ("a wooden chair"), a residual network learns to go from the phrase to the name, by the
cross-entropy over all names of the table, the look-alikes among them. Names themselves, of the table, of the homes and of
ImageNet, are to stay where they are, so that no word is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_agents.perception.conse import class_names, unit
from openmap_agents.perception.text import TextEncoder
from openmap_agents.perception.training.fit_neck import TEMPERATURE

_HIDDEN, _EPOCHS, _BATCH = 96, 60, 256
_STAY = 25.0  # what a name's leaving its place costs
_PHRASES = (
    "a {}",
    "the {}",
    "{} in a home",
    "a photo of a {}",
    "a wooden {}",
    "the white {}",
    "a small black {}",
    "my {}",
)


class _Step(nn.Module):
    """unit(x + w2 relu(w1 x + b1) + b2)."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.first, self.last = nn.Linear(dim, _HIDDEN), nn.Linear(_HIDDEN, dim)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        hidden = torch.relu(self.first(nn.functional.dropout(x, 0.1, self.training)))
        return nn.functional.normalize(x + self.last(hidden), dim=1)


def fit_text(
    uses: Mapping[str, Sequence[str]],
    names: Sequence[str],
    text: TextEncoder,
    mean: npt.NDArray[np.float32],
    seed: int,
    report: Callable[[dict[str, float]], None],
) -> dict[str, npt.NDArray[np.float32]]:
    """Weights of the step.

    Parameters
    ----------
    uses : {name: phrases}
        What things are for.
    names : names learned by the heads
    mean : (D,)
        Taken from every vector first.
    """

    def vectors(texts: Sequence[str]) -> torch.Tensor:
        return torch.from_numpy(unit(text.encode_many(list(texts)) - mean))

    torch.manual_seed(seed)
    kinds = list(uses)
    pairs = [(phrase, i) for i, kind in enumerate(kinds) for phrase in uses[kind]]
    pairs += [(phrase.format(kind), i) for i, kind in enumerate(kinds) for phrase in _PHRASES]
    x, own = vectors([phrase for phrase, _ in pairs]), torch.tensor([i for _, i in pairs])
    known = vectors(kinds)
    stay = torch.cat([known, vectors(names), vectors([group[0] for group in class_names()])])
    step = _Step(known.shape[1])
    optimiser = torch.optim.AdamW(step.parameters(), 2e-3, weight_decay=1e-2)
    for epoch in range(_EPOCHS):
        losses = []
        for rows in torch.split(torch.randperm(len(x)), _BATCH):
            logits = step(x[rows]) @ known.T / TEMPERATURE
            loss = nn.functional.cross_entropy(logits, own[rows], label_smoothing=0.1)
            moved = (1.0 - (step(stay) * stay).sum(1)).mean()
            optimiser.zero_grad()
            torch.autograd.backward(loss + _STAY * moved)
            optimiser.step()
            losses.append(float(loss.detach()))
        if (epoch + 1) % 10 == 0:
            report({"epoch": epoch + 1.0, "loss": float(np.mean(losses)), "moved": float(moved.detach())})
    parts = zip(("w1", "b1", "w2", "b2"), step.parameters(), strict=True)
    return {f"text.{name}": p.detach().numpy() for name, p in parts}
