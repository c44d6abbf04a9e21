"""The soft view consensus written plainly: all frames at once, slow, obvious. The online mapper is tested against it.

The paper (``reference.py``) asks of every frame a yes or no: does one of its masks hold 80 % of both? It joins whole connected
components of yeses and takes unions. One wrong yes then joins two things for good, and with a segmenter that splits, merges and
wavers most right pairs get a no. Here a frame answers with a share. Of a node A, a set of masks, and a frame t that observes some
of them,

    p_A(m) = voxels of A's masks under mask m of t / voxels of A's masks under any mask of t       (masks that t observes)
    R_struc(A, B) = sum over t in O(A, B) and masks m of t of p_A(m) p_B(m) / (|O(A, B)| + doubt)

the chance that a bit of A and a bit of B lie under one mask, averaged over the frames that observe both. It is 1 where all frames
hold both under one mask, as the paper's rate is; a mask that spans two things is half with each instead of making them one.
Two nodes that are each other's best partners join; rounds go on until no pair reaches ``tau_soft``. Nothing is dropped as
under-segmented: such a mask is outvoted when every voxel elects the instance that most of its sightings name.

Shares and features are whole numbers of small steps, so that sums are exact.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.agglomeration import FEATURE_STEPS, MEAN_STEPS, SHARES
from openmap_agents.mapping.reference import (
    Frame,
    Recording,
    ReferenceInstance,
    Voxel,
    drop_overlapping,
    learn_statistics,
    observe,
    pieces_with_masks,
    record,
)
from openmap_agents.mapping.semantics import SoftWeight, soft_weight
from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

_DEFAULT = MappingSettings()


@dataclass
class SoftNode:
    """A set of masks: voxels of theirs by mask of a frame that observes them (mask -> voxels), and the sum of their features."""

    members: list[int]
    held: dict[int, int]
    features: npt.NDArray[np.float64] | None
    n_features: int


def reference_soft_map(
    camera: PinholeCamera, frames: Iterable[Frame], settings: MappingSettings = _DEFAULT
) -> list[ReferenceInstance]:
    """The instances of frames ``(depth, masks, features or None, T_world_camera)``, in no particular order."""
    recording = record(camera, frames, settings)
    weight = soft_weight(settings, *learn_statistics(recording, *observe(recording, settings)))
    nodes = single_nodes(recording, settings)
    while True:
        joined = join_round(nodes, recording, weight, settings)
        if len(joined) == len(nodes):
            break
        nodes = joined
    instances = elect(nodes, recording, settings)
    return drop_overlapping(instances, settings)


def single_nodes(recording: Recording, settings: MappingSettings) -> list[SoftNode]:
    """Every mask by itself."""
    nodes = []
    for k, mask in enumerate(recording.masks):
        held: dict[int, int] = {}
        for t, seen in recording.seen.items():
            if len(mask.voxels & seen) > settings.tau_obs * len(mask.voxels):
                for m in recording.of_frame(t):
                    if common := len(mask.voxels & recording.masks[m].voxels):
                        held[m] = common
        known = mask.feature is not None and mask.feature.any()
        feature = None if mask.feature is None else np.rint(mask.feature.astype(np.float64) * FEATURE_STEPS)
        nodes.append(SoftNode([k], held, feature, int(known)))
    return nodes


def shares(node: SoftNode, recording: Recording, settings: MappingSettings) -> tuple[dict[int, int], set[int]]:
    """p_A by mask, in rounded units of 1 / ``SHARES``, without those below ``min_share``; and the frames that observe A."""
    total: dict[int, int] = {}
    for m, voxels in node.held.items():
        total[recording.masks[m].frame] = total.get(recording.masks[m].frame, 0) + voxels
    least = max(1, round(settings.min_share * SHARES))
    rounded = {}
    for m, voxels in node.held.items():
        of = total[recording.masks[m].frame]
        rounded[m] = (2 * SHARES * voxels + of) // (2 * of)
    return {m: share for m, share in rounded.items() if share >= least}, set(total)


def mean_cosine(a: SoftNode, b: SoftNode) -> float:
    """Mean cosine of a mask of a and a mask of b; NaN if one of the nodes has no feature."""
    if a.features is None or b.features is None or not a.n_features or not b.n_features:
        return math.nan
    scale = MEAN_STEPS // FEATURE_STEPS
    means = [np.rint(n.features * (scale / n.n_features)).astype(np.int64) for n in (a, b) if n.features is not None]
    return float(int(means[0] @ means[1]) / float(MEAN_STEPS * MEAN_STEPS))


def join_round(
    nodes: list[SoftNode], recording: Recording, weight: SoftWeight, settings: MappingSettings
) -> list[SoftNode]:
    """Join nodes that are each other's best partners; the partner of the lower number is better on a tie."""
    looks = [shares(node, recording, settings) for node in nodes]
    best: list[tuple[float, int]] = [(0.0, -1)] * len(nodes)
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes):
            common = sum(p * looks[j][0].get(m, 0) for m, p in looks[i][0].items())
            if i == j or common == 0:
                continue
            observers = len(looks[i][1] & looks[j][1])
            r_struc = common / (float(SHARES * SHARES) * (observers + settings.doubt))
            score = (1.0 if weight.ignores_structure else r_struc) * weight(mean_cosine(a, b))
            if score >= weight.threshold and score > best[i][0]:
                best[i] = (score, j)
    joined = []
    for i, node in enumerate(nodes):
        j = best[i][1]
        mutual = j >= 0 and best[j][1] == i
        if not mutual:
            joined.append(node)
        elif i < j:
            joined.append(_sum(node, nodes[j]))
    return joined


def _sum(a: SoftNode, b: SoftNode) -> SoftNode:
    held = {m: a.held.get(m, 0) + b.held.get(m, 0) for m in a.held.keys() | b.held.keys()}
    known = [f for f in (a.features, b.features) if f is not None]
    features = np.sum(known, axis=0) if known else None
    return SoftNode(sorted(a.members + b.members), held, features, a.n_features + b.n_features)


def elect(nodes: list[SoftNode], recording: Recording, settings: MappingSettings) -> list[ReferenceInstance]:
    """Every voxel elects one of the nodes of enough masks: that of most of the masks which hold the voxel, the first on a tie.

    A winner needs ``min_vote`` of all the masks that hold it. What a node has won is then cut into connected pieces.
    """
    votes: dict[Voxel, list[int]] = {}
    for n, node in enumerate(nodes):
        for k in node.members:
            for v in recording.masks[k].voxels:
                votes.setdefault(v, []).append(n)
    won: list[set[Voxel]] = [set() for _ in nodes]
    for v, names in votes.items():
        standing = sorted(n for n in names if len(nodes[n].members) >= settings.min_masks)
        if standing:
            winner = max(standing, key=lambda n: (standing.count(n), -n))
            if standing.count(winner) >= settings.min_vote * len(names):
                won[winner].add(v)
    instances = []
    for node, voxels in zip(nodes, won, strict=True):
        if len(node.members) >= settings.min_masks and len(voxels) >= settings.min_voxels:
            instances += pieces_with_masks(voxels, [recording.masks[k] for k in node.members], settings)
    return instances
