"""Means with 95 % percentile intervals (Efron, 1979): what belongs together is drawn together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RESAMPLES = 2000
PERCENTILES = (2.5, 97.5)


@dataclass(frozen=True)
class Figure:
    """A measured value and its 95 % interval; ``n`` counts what it is the mean of."""

    value: float
    low: float
    high: float
    n: int


def draws(n: int, seed: int, resamples: int = RESAMPLES) -> npt.NDArray[np.int64]:
    """Which of n units each resample holds, (resamples, n), drawn with replacement."""
    return np.random.default_rng(seed).integers(n, size=(resamples, n))


def interval(values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """The percentile interval of a statistic's values over resamples, (resamples,); those that are not finite do not count."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return float("nan"), float("nan")
    low, high = np.percentile(finite, PERCENTILES)
    return float(low), float(high)


def mean_figure(
    values: npt.ArrayLike, units: Sequence[int] | npt.NDArray[np.integer] | None = None, seed: int = 0
) -> Figure | None:
    """The mean of values (n,), and its interval over resampled units; None without values.

    Parameters
    ----------
    values : (n,) numbers or truth values
    units : (n,) int, optional
        Values with the same number are drawn together, such as all views of one thing; each on its own by default.
    seed : int
    """
    numbers = np.asarray(values, np.float64)
    if not len(numbers):
        return None
    group = np.arange(len(numbers)) if units is None else np.unique(np.asarray(units), return_inverse=True)[1]
    sums, counts = np.bincount(group, weights=numbers), np.bincount(group)
    picks = draws(len(sums), seed)
    low, high = interval(sums[picks].sum(1) / counts[picks].sum(1))
    return Figure(float(numbers.mean()), low, high, len(numbers))


def balanced_figure(values: npt.ArrayLike, classes: Sequence[str], seed: int = 0) -> Figure | None:
    """The mean over classes of the mean of each class's values (n,); classes are what is drawn."""
    numbers = np.asarray(values, np.float64)
    if not len(numbers):
        return None
    group = np.unique(np.asarray(classes), return_inverse=True)[1]
    return mean_figure(np.bincount(group, weights=numbers) / np.bincount(group), seed=seed)
