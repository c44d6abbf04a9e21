"""The ScanNet200 instance benchmark's average precision, for any labelled point clouds.

As the benchmark's public evaluator has it, class by class and for each threshold t of .50, .55, .. .90 (AP is their mean) and .25:

- An instance of the truth of fewer than ``min_points`` points is not looked for. A proposal of fewer is not looked at.
- Void is what has no category that is scored, or no instance.
- Instances are gone through by ascending id, and the proposals of each by falling confidence. The first one of IoU > t that is not
  another instance's already finds it; every further one is a false positive. An instance that none finds is missed.
- A proposal of IoU <= t with every instance of its class is a false positive, unless more than t of it is void or lies on instances
  that are too small.
- Precision and recall over all scans, once for each different confidence, with (recall 0, precision 1) added; the area under them
  by the trapezium rule, which is what the benchmark's stepwise sum with half steps to both sides comes to.
- A class with instances but without proposals has 0, one without instances has none and is left out of the means.

Above .5 a proposal can belong to one instance only, and the order of proposals decides nothing. At .25 the benchmark takes them as
the file lists them; here the order is that of confidence, then of size, then of the points themselves, so that it never matters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.scannet200 import NAME_OF
from openmap_scenes.taxonomy import scannet200_group

# The benchmark's very floats: some lie a little above their decimals, and a share that equals a threshold has to be above it.
AP_THRESHOLDS: tuple[float, ...] = tuple(float(t) for t in np.arange(0.5, 0.95, 0.05))
THRESHOLDS: tuple[float, ...] = (*AP_THRESHOLDS, 0.25)
GROUPS = ("head", "common", "tail")


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """The truth of a scan: N points.

    Parameters
    ----------
    points : (N, 3) float32 m
    instance : (N,) int32
        0 = none.
    category : (N,) int32
        0 = void, not scored. Elsewhere any numbers, ScanNet200's for its groups.

    Raises
    ------
    ValueError
        Arrays of other shapes, or negative numbers.
    """

    points: npt.NDArray[np.float32]
    instance: npt.NDArray[np.int32]
    category: npt.NDArray[np.int32]

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.points.shape != (n, 3) or self.instance.shape != (n,) or self.category.shape != (n,):
            shapes = f"{self.points.shape}, {self.instance.shape} and {self.category.shape}"
            raise ValueError(f"a labelled cloud has arrays of {shapes}, expected (N, 3), (N,) and (N,)")
        for name in ("instance", "category"):
            values = getattr(self, name)
            if values.dtype.kind not in "iu" or (n and values.min() < 0):
                raise ValueError(f"{name} of a labelled cloud is {values.dtype}, expected whole numbers from 0")

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A predicted instance.

    Parameters
    ----------
    indices : (n,) int64
        Its points in the cloud, ascending, each once.
    confidence : float
    category : int
        Not looked at by class-agnostic scores.

    Raises
    ------
    ValueError
        Indices out of order, or a confidence that is no number.
    """

    indices: npt.NDArray[np.int64]
    confidence: float
    category: int

    def __post_init__(self) -> None:
        if self.indices.ndim != 1 or self.indices.dtype.kind not in "iu":
            raise ValueError(
                f"indices of a proposal are {self.indices.dtype} {self.indices.shape}, expected int64 (n,)"
            )
        if len(self.indices) and (self.indices[0] < 0 or (np.diff(self.indices) <= 0).any()):
            raise ValueError("indices of a proposal are not from 0, ascending, each once")
        if not np.isfinite(self.confidence):
            raise ValueError(f"confidence of a proposal is {self.confidence}, expected a number")


@dataclass(frozen=True)
class Score:
    """Average precision, 0..1, nan where there was nothing to find: the mean over nine thresholds, at .50 and at .25."""

    ap: float
    ap50: float
    ap25: float


@dataclass(frozen=True)
class ClassScore(Score):
    """Of one class.

    Parameters
    ----------
    by_threshold : tuple of float
        In the order of ``THRESHOLDS``.
    n_truth, n_proposals : int
        How many instances were looked for, and how many proposals were looked at.
    """

    by_threshold: tuple[float, ...] = ()
    n_truth: int = 0
    n_proposals: int = 0


@dataclass(frozen=True)
class APScores(Score):
    """Means over the classes that have instances.

    Parameters
    ----------
    by_class : dict of int to ClassScore
        Ascending; class-agnostic scores have all under 0.
    groups : dict of str to Score
        Head, common and tail classes; empty for class-agnostic scores.
    """

    by_class: dict[int, ClassScore] = field(default_factory=dict)
    groups: dict[str, Score] = field(default_factory=dict)


def average_precision(
    scans: Sequence[tuple[Sequence[Proposal], LabelledCloud]],
    *,
    class_agnostic: bool,
    min_points: int = 100,
    classes: Collection[int] | None = None,
    groups: Mapping[int, str] | None = None,
) -> APScores:
    """Score proposals against the truth, all scans together.

    Parameters
    ----------
    scans : sequence of (proposals, truth)
    class_agnostic : bool
        Take everything that is not void as one class, and every proposal as of it.
    min_points : int
        Of instances and of proposals.
    classes : collection of int, optional
        The categories that are scored; others are void, and proposals of them not looked at. All but 0 unless given.
    groups : mapping of int to str, optional
        Group of a category; ScanNet200's unless given.

    Raises
    ------
    ValueError
        A proposal has points that its cloud does not have.
    """
    counted = [_Scan.of(proposals, truth, class_agnostic, min_points, classes) for proposals, truth in scans]
    found = sorted({int(c) for scan in counted for c in (*scan.truth_class, *scan.proposal_class)})
    by_class = {c: _score_class([scan.of_class(c, min_points) for scan in counted]) for c in found}
    of_groups: dict[str, Score] = {}
    if not class_agnostic:
        group_of = groups if groups is not None else {n: scannet200_group(name) for n, name in NAME_OF.items()}
        names = GROUPS if groups is None else tuple(sorted(set(groups.values())))
        of_groups = {g: _mean(s for c, s in by_class.items() if group_of.get(c) == g) for g in names}
    mean = _mean(by_class.values())
    return APScores(mean.ap, mean.ap50, mean.ap25, by_class, of_groups)


class _OfClass(NamedTuple):
    """What one scan has of one class: T instances of the truth and P proposals in their order."""

    truth_size: npt.NDArray[np.int64]  # (T,)
    is_small: npt.NDArray[np.bool_]  # (T,) not looked for
    confidence: npt.NDArray[np.float64]  # (P,)
    iou: npt.NDArray[np.float64]  # (T, P)
    ignored: npt.NDArray[np.float64]  # (P,) share of void and of instances that are too small


@dataclass(frozen=True)
class _Scan:
    """Overlaps of one scan: T instances of the truth by ascending category and id, P proposals by falling confidence."""

    truth_class: npt.NDArray[np.int64]  # (T,)
    truth_size: npt.NDArray[np.int64]  # (T,)
    proposal_class: npt.NDArray[np.int64]  # (P,)
    confidence: npt.NDArray[np.float64]  # (P,)
    overlap: npt.NDArray[np.int64]  # (P, 1 + T) points; column 0 is void

    @classmethod
    def of(
        cls,
        proposals: Sequence[Proposal],
        truth: LabelledCloud,
        class_agnostic: bool,
        min_points: int,
        classes: Collection[int] | None,
    ) -> _Scan:
        kept = [p for p in proposals if len(p.indices) >= max(min_points, 1)]
        if not class_agnostic:
            kept = [p for p in kept if p.category > 0 and (classes is None or p.category in classes)]
        for proposal in kept:
            if proposal.indices[-1] >= len(truth):
                raise ValueError(f"a proposal has point {proposal.indices[-1]}, expected < {len(truth)}, the cloud's")
        kept.sort(key=lambda p: (-p.confidence, -len(p.indices), p.indices.astype(">i8").tobytes()))
        scored = (truth.category > 0) & (truth.instance > 0)
        if classes is not None:
            scored &= np.isin(truth.category, sorted(classes))
        category = np.zeros(len(truth), np.int64) if class_agnostic else truth.category.astype(np.int64)
        keys, owner = np.unique((category[scored] << 32) | truth.instance[scored], return_inverse=True)
        column = np.zeros(len(truth), np.int64)
        column[scored] = 1 + owner
        overlap = [np.bincount(column[p.indices], minlength=1 + len(keys)) for p in kept]
        return cls(
            truth_class=keys >> 32,
            truth_size=np.bincount(owner, minlength=len(keys)).astype(np.int64),
            proposal_class=np.array([0 if class_agnostic else p.category for p in kept], np.int64),
            confidence=np.array([p.confidence for p in kept], np.float64),
            overlap=np.array(overlap, np.int64).reshape(len(kept), 1 + len(keys)),
        )

    def of_class(self, category: int, min_points: int) -> _OfClass:
        rows, columns = self.proposal_class == category, self.truth_class == category
        size, truth_size = self.overlap[rows].sum(1), self.truth_size[columns]
        shared, is_small = self.overlap[rows][:, 1:][:, columns], truth_size < min_points
        ignored = (self.overlap[rows, 0] + shared[:, is_small].sum(1)) / size
        iou = shared / (size[:, None] + truth_size - shared)
        return _OfClass(truth_size, is_small, self.confidence[rows], iou.T, ignored)


def _score_class(scans: list[_OfClass]) -> ClassScore:
    n_truth = sum(int((~s.is_small).sum()) for s in scans)
    n_proposals = sum(len(s.confidence) for s in scans)
    values = [_area([_judge(s, t) for s in scans], n_truth) if n_truth else float("nan") for t in THRESHOLDS]
    at50, at25 = values[0], values[-1]
    return ClassScore(float(np.mean(values[:-1])), at50, at25, tuple(values), n_truth, n_proposals)


def _judge(scan: _OfClass, threshold: float) -> tuple[list[float], list[float]]:
    """Confidences of the right and of the wrong proposals of a scan."""
    right: list[float] = []
    wrong: list[float] = []
    taken = np.zeros(len(scan.confidence), bool)
    fits = scan.iou > threshold
    for t in np.flatnonzero(~scan.is_small):
        candidates = np.flatnonzero(fits[t] & ~taken)
        if len(candidates):
            taken[candidates[0]] = True
            right.append(float(scan.confidence[candidates[0]]))
            wrong += scan.confidence[candidates[1:]].tolist()
    # One that fits an instance which is too small, or found already, has been dealt with.
    stray = ~fits.any(0) & (scan.ignored <= threshold)
    return right, wrong + scan.confidence[stray].tolist()


def _area(judged: list[tuple[list[float], list[float]]], n_truth: int) -> float:
    """Area under precision over recall."""
    right, wrong = (np.sort([c for scan in judged for c in scan[which]]) for which in (0, 1))
    levels = np.unique(np.concatenate([right, wrong]))
    if len(levels) == 0:
        return 0.0
    # Every level is a threshold on confidence: what is at it or above it counts.
    n_right = len(right) - np.searchsorted(right, levels)
    n_wrong = len(wrong) - np.searchsorted(wrong, levels)
    precision = np.append(n_right / (n_right + n_wrong), 1.0)
    recall = np.append(n_right / n_truth, 0.0)
    return float(-np.trapezoid(precision, recall))


def _mean(scores: Iterable[Score]) -> Score:
    """Over those that had anything to find; nan where none had."""
    values = np.array([(s.ap, s.ap50, s.ap25) for s in scores if not np.isnan(s.ap)])
    return Score(*(values.mean(0).tolist() if len(values) else (float("nan"),) * 3))
