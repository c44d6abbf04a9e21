"""Section 3.2 of the paper, written plainly: all frames at once, dense, slow, obvious. The online mapper is tested against it.

In the paper's terms: mask k has voxel set P_k; frame t sees V_t; observers I(k) are the frames that see more than tau_obs of it; a
frame's mask that holds at least tau_sub of what the frame sees of k *contains* k; supporters S(i, j) are the observers of both
in which one mask contains both; R_struc = |S| / |O| in frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.back_projection import pixel_voxels
from openmap_agents.mapping.frame import check_frame, large_enough, unpack_keys
from openmap_agents.mapping.semantics import CosineStatistics, SemanticWeight, rounded_cosine, semantic_weight
from openmap_agents.mapping.settings import MappingSettings
from openmap_scenes import PinholeCamera

Frame = tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike | None, npt.ArrayLike]
Voxel = int
_DEFAULT = MappingSettings()


@dataclass
class Mask:
    """One mask m_k: where it is from, its voxel set P_k and its unit feature (zeros = none)."""

    frame: int
    label: int
    voxels: set[Voxel]
    feature: npt.NDArray[np.float32] | None


@dataclass
class Node:
    """A set of masks with the union of their observers (frames) and of the masks that contain them."""

    members: list[int]
    observers: set[int]
    containers: set[int]


@dataclass(frozen=True)
class ReferenceInstance:
    """One instance: its masks as (frame, label), its voxel keys, its unit feature or None."""

    views: frozenset[tuple[int, int]]
    voxels: frozenset[Voxel]
    feature: npt.NDArray[np.float32] | None


@dataclass
class Recording:
    """All masks, and V_t of every frame that counts (frame number -> voxels)."""

    masks: list[Mask] = field(default_factory=list)
    seen: dict[int, set[Voxel]] = field(default_factory=dict)

    def of_frame(self, t: int) -> list[int]:
        return [k for k, mask in enumerate(self.masks) if mask.frame == t]


def reference_map(
    camera: PinholeCamera, frames: Iterable[Frame], settings: MappingSettings = _DEFAULT
) -> list[ReferenceInstance]:
    """The instances of frames ``(depth, masks, features or None, T_world_camera)``, in no particular order."""
    recording = record(camera, frames, settings)
    observers, containers = observe(recording, settings)
    weight = semantic_weight(settings, *learn_statistics(recording, observers, containers))
    nodes = drop_undersegmented(observers, containers, recording, settings)
    for n_o in observer_schedule(nodes, settings):
        nodes = merge_round(nodes, n_o, recording, weight)
    instances = [i for node in nodes for i in split(node, recording, settings)]
    return drop_overlapping(instances, settings)


def frame_sets(
    depth: npt.NDArray[np.float32],
    masks: npt.NDArray[np.int32],
    camera: PinholeCamera,
    T_world_camera: npt.NDArray[np.float64],
    settings: MappingSettings,
) -> tuple[set[Voxel], dict[int, set[Voxel]]]:
    """V_t, and P_k by label: each voxel goes to the label of most of its pixels, to the lowest on a tie."""
    pixels = large_enough(masks, settings)
    keys, labels = pixel_voxels(depth, masks, camera, T_world_camera, settings)
    counts: dict[Voxel, dict[int, int]] = {}
    for key, label in zip(keys.tolist(), labels.tolist(), strict=True):
        own = label if pixels[label] > 0 else 0
        of_voxel = counts.setdefault(key, {})
        of_voxel[own] = of_voxel.get(own, 0) + 1
    sets: dict[int, set[Voxel]] = {}
    for key, of_voxel in counts.items():
        label = min(of_voxel, key=lambda own: (-of_voxel[own], own))
        sets.setdefault(label, set()).add(key)
    sets = {label: sets[label] for label in sorted(sets) if label > 0 and len(sets[label]) >= settings.min_mask_voxels}
    seen = set(counts) if settings.visibility == "depth" else set().union(*sets.values())
    return seen, sets


def record(camera: PinholeCamera, frames: Iterable[Frame], settings: MappingSettings) -> Recording:
    """Masks and V_t of the frames that bring something new."""
    recording = Recording()
    views: dict[Voxel, int] = {}
    for t, (depth, masks, features, T_world_camera) in enumerate(frames):
        depth_, masks_, features_, T = check_frame(camera, depth, masks, features, T_world_camera)
        seen, sets = frame_sets(depth_, masks_, camera, T, settings)
        novel = sum(views.get(v, 0) < settings.max_views for v in seen)
        if not seen or novel < settings.min_novelty * len(seen):
            continue
        for v in seen:
            views[v] = views.get(v, 0) + 1
        recording.seen[t] = seen
        for label, voxels in sets.items():
            recording.masks.append(Mask(t, label, voxels, None if features_ is None else features_[label - 1]))
    return recording


def observe(recording: Recording, settings: MappingSettings) -> tuple[list[set[int]], list[set[int]]]:
    """Observers I(k) (frames) and containers (masks, one a frame at most) of every mask."""
    observers: list[set[int]] = [set() for _ in recording.masks]
    containers: list[set[int]] = [set() for _ in recording.masks]
    for t, seen in recording.seen.items():
        others = recording.of_frame(t)
        for k, mask in enumerate(recording.masks):
            visible = mask.voxels & seen
            if not len(visible) > settings.tau_obs * len(mask.voxels):
                continue
            observers[k].add(t)
            for other in others:
                if len(visible & recording.masks[other].voxels) >= settings.tau_sub * len(visible):
                    containers[k].add(other)
    return observers, containers


def _cosine(recording: Recording, i: int, j: int) -> float:
    a, b = recording.masks[i].feature, recording.masks[j].feature
    return float("nan") if a is None or b is None else rounded_cosine(a, b)


def learn_statistics(
    recording: Recording, observers: list[set[int]], containers: list[set[int]]
) -> tuple[CosineStatistics, CosineStatistics]:
    """Cosines of masks that contain each other (same) and of masks of one frame (different)."""
    same, different = CosineStatistics(), CosineStatistics()
    for i in range(len(recording.masks)):
        for j in range(i):
            cosine = _cosine(recording, i, j)
            if np.isnan(cosine):
                continue
            if recording.masks[i].frame == recording.masks[j].frame:
                different.add(np.array([cosine]))
            elif j in containers[i] and i in containers[j]:
                same.add(np.array([cosine]))
    return same, different


def drop_undersegmented(
    observers: list[set[int]], containers: list[set[int]], recording: Recording, settings: MappingSettings
) -> list[Node]:
    """The initial nodes: masks that few of their observers split.

    An under-segmented mask becomes no node, and the frame it is from is no witness for the masks that it contained.
    """
    frame_of = [mask.frame for mask in recording.masks]
    dropped = set()
    for k in range(len(recording.masks)):
        split_in = observers[k] - {frame_of[c] for c in containers[k]}
        if len(split_in) > settings.tau_undersegmented * len(observers[k]):
            dropped.add(k)
    nodes = []
    for k in range(len(recording.masks)):
        witnesses = observers[k] - {frame_of[c] for c in containers[k] & dropped}
        if settings.observers == "contained":
            witnesses = {frame_of[c] for c in containers[k] - dropped}
        if k not in dropped:
            nodes.append(Node([k], witnesses, containers[k] - dropped))
    return nodes


def observer_schedule(nodes: list[Node], settings: MappingSettings) -> list[int]:
    """N_o of each round: falling percentiles of the common observers |O(i, j)| > 0 of all pairs, i = j included.

    N_o is never below 1, and below the 50th percentile a value of 1 ends the schedule (code). The last round is always N_o = 1, two
    common observers, else a walk whose pairs all have the same count would merge nothing (the code has >= for the paper's >).
    """
    counts = sorted(n for a in nodes for b in nodes if (n := len(a.observers & b.observers)) > 0)
    schedule = []
    for percent in range(settings.observer_start, -1, -settings.observer_step):
        n_o = counts[(len(counts) - 1) * percent // 100] if counts else 1
        if n_o <= 1 and percent < 50:
            break
        schedule.append(max(n_o, 1))
    return [*schedule, 1]


def representative(node: Node, recording: Recording) -> int:
    """The member mask that covers most of the node: the largest, the first of them on a tie."""
    return min(node.members, key=lambda k: (-len(recording.masks[k].voxels), k))


def merge_round(nodes: list[Node], n_o: int, recording: Recording, weight: SemanticWeight) -> list[Node]:
    """Join the connected components of the graph in which R_struc * R_seman >= threshold and |O| > N_o."""
    component = list(range(len(nodes)))
    for j, b in enumerate(nodes):
        for i, a in enumerate(nodes[:j]):
            common = a.observers & b.observers
            if len(common) <= n_o:
                continue
            supporters = {recording.masks[c].frame for c in a.containers & b.containers} & common
            r_struc = 1.0 if weight.kind == 3 else len(supporters) / len(common)
            r_seman = weight(_cosine(recording, representative(a, recording), representative(b, recording)))
            if supporters and r_struc * r_seman >= weight.threshold:
                old, new = max(component[i], component[j]), min(component[i], component[j])
                component = [new if c == old else c for c in component]
    merged: dict[int, Node] = {}
    for c, node in zip(component, nodes, strict=True):
        into = merged.setdefault(c, Node([], set(), set()))
        into.members += node.members
        into.observers |= node.observers
        into.containers |= node.containers
    return list(merged.values())


def split(node: Node, recording: Recording, settings: MappingSettings) -> list[ReferenceInstance]:
    """The connected pieces of a node, after voxels that its own frames mostly deny it were removed."""
    members = [recording.masks[k] for k in node.members]
    frames = {mask.frame for mask in members}
    kept = set()
    for v in set().union(*(mask.voxels for mask in members)):
        held = sum(v in mask.voxels for mask in members)
        seen = sum(v in recording.seen[t] for t in frames)
        if held > settings.detection_ratio * seen:
            kept.add(v)
    return pieces_with_masks(kept, members, settings)


def pieces_with_masks(voxels: set[Voxel], members: list[Mask], settings: MappingSettings) -> list[ReferenceInstance]:
    """The connected pieces of voxels that have enough of the masks.

    Two voxels are connected if their cells, about ``split_distance`` wide, touch in a chain (corners count). A mask goes to the
    piece that has most of it, the piece with the lowest voxel on a tie.
    """
    pieces = connected_pieces(voxels, settings)
    owned: list[list[Mask]] = [[] for _ in pieces]
    for mask in members:
        overlaps = [len(mask.voxels & piece) for piece in pieces]
        if pieces and max(overlaps) > 0:
            owned[overlaps.index(max(overlaps))].append(mask)
    return [
        ReferenceInstance(
            frozenset((m.frame, m.label) for m in of_piece), frozenset(piece), mean_feature(of_piece, settings)
        )
        for piece, of_piece in zip(pieces, owned, strict=True)
        if len(piece) >= settings.min_voxels and len(of_piece) >= settings.min_masks
    ]


def connected_pieces(voxels: set[Voxel], settings: MappingSettings) -> list[set[Voxel]]:
    """Connected sets of voxels, by their lowest voxel."""
    factor = cell_factor(settings)
    of_cell: dict[tuple[int, ...], list[Voxel]] = {}
    for key in sorted(voxels):
        cell = unpack_keys(np.array([key]))[0] // factor
        of_cell.setdefault(tuple(cell.tolist()), []).append(key)
    pieces, todo = [], dict.fromkeys(of_cell)
    while todo:
        stack, piece = [next(iter(todo))], set()
        del todo[stack[0]]
        while stack:
            x, y, z = stack.pop()
            piece |= set(of_cell[(x, y, z)])
            for cell in [(x + i, y + j, z + k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]:
                if cell in todo:
                    del todo[cell]
                    stack.append(cell)
        pieces.append(piece)
    return sorted(pieces, key=min)


def cell_factor(settings: MappingSettings) -> int:
    """Edge in voxels of the cells in which pieces are connected."""
    return max(1, round(settings.split_distance / settings.voxel_size))


def mean_feature(masks: list[Mask], settings: MappingSettings) -> npt.NDArray[np.float32] | None:
    """Mean feature of the ``top_k`` largest masks that have one (by frame and label on a tie), as a unit vector."""
    best = sorted(masks, key=lambda m: (-len(m.voxels), m.frame, m.label))
    features = [m.feature for m in best if m.feature is not None and m.feature.any()][: settings.top_k]
    if not features:
        return None
    mean = np.mean(np.stack(features).astype(np.float64), axis=0)
    norm = float(np.linalg.norm(mean))
    return None if norm < 1e-9 else np.asarray(mean / norm, np.float32)


def drop_overlapping(instances: list[ReferenceInstance], settings: MappingSettings) -> list[ReferenceInstance]:
    """From the largest down (by lowest mask on a tie): an instance goes if one that stayed holds most of it."""
    kept: list[ReferenceInstance] = []
    for instance in sorted(instances, key=lambda i: (-len(i.voxels), min(i.views))):
        if all(len(instance.voxels & k.voxels) <= settings.tau_overlap * len(instance.voxels) for k in kept):
            kept.append(instance)
    return kept
