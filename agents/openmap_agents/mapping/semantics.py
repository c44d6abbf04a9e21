"""The semantic term R_seman: how much a cosine between two masks says about their being one thing.

The paper multiplies by the bare cosine. That presumes an encoder whose cosines are near 1 for two views of a thing and far
below for two things; with a weaker one it costs more than it brings. The walk itself tells what a cosine is worth: masks of two
frames that contain each other are the same thing, two masks of one frame are not. With both sets taken as normal distributions of
one variance (linear discriminant analysis) the chance p of "same" given a cosine is a logistic curve, flat at 1/2 where the encoder
tells nothing. The weight

    w(p) = p / (p + (1 - p) * (tau_structural / tau_thres - 1))

is 1 where features are sure of "same" (merge at R_struc >= tau_thres, as OpenMap does), tau_thres / tau_structural at p = 1/2
(merge at R_struc >= tau_structural, as MaskClustering does without features), and falls to 0 where they are sure of "different".

Cosines are rounded to 1e-4 and summed as integers: sums then do not depend on their order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.settings import MappingSettings

COSINE_STEPS = 10_000
_FEWEST = 20
LEAST_SEPARATION = 2.0


@dataclass
class CosineStatistics:
    """Count, sum and sum of squares of cosines in units of 1 / ``COSINE_STEPS``, as Python integers."""

    count: int = 0
    total: int = 0
    squares: int = 0

    @property
    def mean(self) -> float:
        """Mean cosine; 0 without any."""
        return self.total / self.count / COSINE_STEPS if self.count else 0.0

    def add(self, cosines: npt.NDArray[np.floating]) -> None:
        """Take in cosines (n,)."""
        steps = np.rint(np.asarray(cosines, np.float64) * COSINE_STEPS).astype(np.int64)
        self.count += len(steps)
        self.total += int(steps.sum())
        self.squares += int((steps * steps).sum())


@dataclass(frozen=True)
class SemanticWeight:
    """R_seman = w(1 / (1 + exp(-(slope * cosine + offset)))) if ``logistic``, else max(0, cosine); 1 for "structural".

    Parameters
    ----------
    kind : int
        0 structural, 1 product, 2 calibrated, 3 alone: the product with R_struc = 1.
    threshold : float
        What R_struc * R_seman has to reach.
    slope, offset, gap : float
        Of the logistic curve; gap = tau_structural / tau_thres - 1.
    """

    kind: int
    threshold: float
    slope: float = 0.0
    offset: float = 0.0
    gap: float = 0.0

    def __call__(self, cosine: float) -> float:
        """R_seman of a cosine that was rounded to 1e-4; of NaN, "one of the two has no feature"."""
        if self.kind == 0:
            return 1.0
        if self.kind == 3:
            return 0.0 if math.isnan(cosine) else max(0.0, cosine)
        if self.kind == 1:
            return 1.0 if math.isnan(cosine) else max(0.0, cosine)
        exponent = 0.0 if math.isnan(cosine) else self.slope * cosine + self.offset
        p = 1.0 / (1.0 + math.exp(-min(max(exponent, -30.0), 30.0)))
        return p / (p + (1.0 - p) * self.gap)


def rounded_cosine(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> float:
    """Cosine of two unit vectors (D,) rounded to 1e-4; NaN if one of them is all zeros."""
    if not a.any() or not b.any():
        return math.nan
    return float(np.rint(float(np.dot(a.astype(np.float64), b.astype(np.float64))) * COSINE_STEPS) / COSINE_STEPS)


def semantic_weight(settings: MappingSettings, same: CosineStatistics, different: CosineStatistics) -> SemanticWeight:
    """The weight for what the walk has shown so far; uninformative until both sides have a few examples."""
    if settings.semantics == "structural":
        return SemanticWeight(0, settings.tau_structural)
    if settings.semantics == "product":
        return SemanticWeight(1, settings.tau_thres)
    if settings.semantics == "alone":
        return SemanticWeight(3, settings.tau_thres)
    curve = logistic_curve(same, different)
    gap = settings.tau_structural / settings.tau_thres - 1
    return SemanticWeight(2, settings.tau_thres, curve.slope, curve.offset, gap)


@dataclass(frozen=True)
class LogisticCurve:
    """The chance of "same" is 1 / (1 + exp(-(slope * cosine + offset))); ``deviation`` is that of cosines within each set."""

    slope: float = 0.0
    offset: float = 0.0
    deviation: float = math.inf


def logistic_curve(same: CosineStatistics, different: CosineStatistics) -> LogisticCurve:
    """Linear discriminant analysis of the two sets of cosines; flat until both have a few examples."""
    if min(same.count, different.count) < _FEWEST:
        return LogisticCurve()
    spread = sum(s.squares - s.total * s.total / s.count for s in (same, different))
    variance = max(spread / (same.count + different.count - 2) / COSINE_STEPS**2, 1e-6)
    slope = max(0.0, (same.mean - different.mean) / variance)
    return LogisticCurve(slope, -slope * (same.mean + different.mean) / 2, math.sqrt(variance))


@dataclass(frozen=True)
class SoftWeight:
    """R_seman of the soft consensus.

    Parameters
    ----------
    threshold : float
        What R_struc * R_seman has to reach.
    table : (2 * COSINE_STEPS + 2,) float64
        By mean cosine in steps from -1 to 1; the last entry is for "one of the two has no feature".
    ignores_structure : bool
        R_struc counts as 1.
    """

    threshold: float
    table: npt.NDArray[np.float64]
    ignores_structure: bool = False

    def __call__(self, cosine: float) -> float:
        """R_seman of a cosine; of NaN, "no feature"."""
        if math.isnan(cosine):
            return float(self.table[-1])
        return float(self.table[min(max(int(np.rint((cosine + 1.0) * COSINE_STEPS)), 0), 2 * COSINE_STEPS)])


def soft_weight(settings: MappingSettings, same: CosineStatistics, different: CosineStatistics) -> SoftWeight:
    """The weight of the soft consensus for what the walk has shown so far.

    Calibrated: 1 where features tell nothing, down to 1 / ``trust`` where they are sure of "different", up to ``trust`` where they
    are sure of "same": they tip scales and never rule. Only an encoder whose two sets of cosines lie at least
    ``LEAST_SEPARATION`` standard deviations apart may say "same": a weaker one finds most things alike, and would make one of them.
    """
    cosines = np.linspace(-1.0, 1.0, 2 * COSINE_STEPS + 1)
    if settings.semantics == "structural":
        return SoftWeight(settings.tau_soft, np.ones(len(cosines) + 1))
    if settings.semantics in ("product", "alone"):
        alone = settings.semantics == "alone"
        threshold = settings.tau_thres if alone else settings.tau_soft
        return SoftWeight(threshold, np.append(np.maximum(cosines, 0.0), 0.0 if alone else 1.0), alone)
    curve = logistic_curve(same, different)
    exponent = np.clip(curve.slope * cosines + curve.offset, -30.0, 30.0)
    surer = 2.0 / (1.0 + np.exp(-exponent)) - 1.0
    if same.mean - different.mean < LEAST_SEPARATION * curve.deviation:
        surer = np.minimum(surer, 0.0)
    return SoftWeight(settings.tau_soft, np.append(settings.trust**surer, 1.0))
