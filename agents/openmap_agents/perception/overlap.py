"""How well masks fit the true ids of a picture: what both training and measuring need."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks

MIN_PIXELS = 400
"""Pixels of a 640 x 480 picture below which a thing counts as not seen; other sizes in proportion."""


def ious(
    labels: npt.NDArray[np.int32], ids: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]:
    """The ids > 0 of a picture, (m,), and their IoU with each mask 1..n, (m, n)."""
    present, truth = np.unique(ids, return_inverse=True)
    n, m = int(labels.max(initial=0)) + 1, len(present)
    both = np.bincount(truth.ravel() * n + labels.ravel(), minlength=m * n).reshape(m, n)
    union = both.sum(1, keepdims=True) + both.sum(0, keepdims=True) - both
    return present[present > 0].astype(np.int32), (both / union)[present > 0][:, 1:]


def true_masks(ids: npt.NDArray[np.int32], wanted: Iterable[int]) -> tuple[Masks, list[int]]:
    """Masks of the wanted ids with at least ``MIN_PIXELS`` pixels of a 640 x 480 picture, and which they are."""
    kept = [i for i in wanted if (ids == i).sum() >= MIN_PIXELS * ids.size / (640 * 480)]
    labels = np.zeros(ids.shape, np.int32)
    for k, i in enumerate(kept):
        labels[ids == i] = k + 1
    return Masks(labels, np.ones(len(kept), np.float32)), kept
