"""MaskClustering (Yan et al., CVPR 2024), written anew from its paper and from reading its public code: what ours is compared with.

It works offline on a finished point cloud: every 2-D mask becomes a set of the cloud's points, masks are nodes, and those that
most frames put into one mask are merged, pairs with many common observers first. Where paper and code disagree the code is
followed, since the published figures are its: a frame observes a mask only if it contains it; supporters are counted as masks
after nodes were joined, so that a rate can exceed 1; thresholds compare with >=, in float32.

What the source leaves open, and what is done here:

- The code crops the cloud to the open bounding box of a mask's points before the ball query. On noisy depth that trims a rim; a
  flat mask along an axis it deletes. ``box_margin`` is the query's radius, which undoes the crop; 0 is the code.
- The ball query keeps the first ``max_neighbours`` points by index, not the nearest (its GPU kernel does so); so here.
- The code visits points in the order of a Python set. Here they are ascending, which may give border points of a DBSCAN cluster
  to another cluster, nothing more.
- An object found to lie in another goes on being compared and may take out a third. So here.
- The segmenter's own filters (score, area in the picture) come before this.
- The code holds dense tables, points x frames and masks x masks. Sparse products give the same numbers here for less memory
  and CPU time.

Point filters are Open3D's, as in the code. ``semantics="product"`` is OpenMap's (MM '25) public code: edges where rate times cosine
exceeds 0.62, a node having the feature of its member with most points. Where one of two has none, the rate alone decides.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from openmap_agents.mapping.frame import check_frame
from openmap_scenes import PinholeCamera

Frame = tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike | None, npt.ArrayLike]
Points = npt.NDArray[np.int32]
_ROWS = 256  # nodes whose pairs are looked at together; bounds the memory of a round


@dataclass(frozen=True)
class MaskClusteringSettings:
    """Constants of the public code, by step; lengths in m.

    Parameters
    ----------
    max_depth, voxel_size, min_points : float, float, int
        Readings from ``max_depth`` on are ignored; a mask's points are averaged in voxels; masks with fewer pixels or points go.
    denoise_eps, denoise_min_points, min_component, outlier_neighbours, outlier_sigma
        DBSCAN of a mask's points, share below which a component (or the noise) goes, statistical outlier removal.
    radius, max_neighbours, box_margin, min_coverage
        Ball query onto the cloud; crop of the cloud (see the module); masks go if fewer of their points find a neighbour.
    tau_visible, min_visible : float, int
        A frame sees a mask if it labels this share of its points, or this many.
    tau_contained, tau_undersegmented : float
        A frame contains a mask if one of its masks holds more than this of what it sees, else it splits it; a mask is
        under-segmented if more than this share of the frames that see it split it.
    tau_consensus, tau_product : float
        Nodes are joined from this rate on; with ``semantics="product"`` above this rate times cosine.
    split_eps, split_min_points, tau_detection, tau_overlap, min_masks, top_k
        DBSCAN that splits an object, share of frames in which a point must be detected, overlap of two objects above which
        one goes, masks an object needs, masks whose features are averaged.
    """

    max_depth: float = 20.0
    voxel_size: float = 0.03
    min_points: int = 25
    denoise_eps: float = 0.04
    denoise_min_points: int = 4
    min_component: float = 0.2
    outlier_neighbours: int = 20
    outlier_sigma: float = 2.0
    radius: float = 0.03
    max_neighbours: int = 20
    box_margin: float = 0.03
    min_coverage: float = 0.3
    tau_visible: float = 0.3
    min_visible: int = 500
    tau_contained: float = 0.8
    tau_undersegmented: float = 0.3
    semantics: Literal["structural", "product"] = "structural"
    tau_consensus: float = 0.9
    tau_product: float = 0.62
    split_eps: float = 0.1
    split_min_points: int = 4
    tau_detection: float = 0.5
    tau_overlap: float = 0.8
    min_masks: int = 2
    top_k: int = 5

    def __post_init__(self) -> None:
        if self.semantics not in ("structural", "product"):
            raise ValueError(f"semantics is {self.semantics!r}, expected structural or product")


@dataclass(frozen=True)
class ClusteredInstance:
    """One object: the cloud's points (n,) int64 ascending, its masks (K, 2) int32 (frame, label), its unit feature or None."""

    points_index: npt.NDArray[np.int64]
    views: npt.NDArray[np.int32]
    feature: npt.NDArray[np.float32] | None
    confidence: float = 1.0


@dataclass(frozen=True)
class Masks:
    """All M masks: frame (M,), label (M,), the cloud's points of each, unit features (M, D) (zeros = none)."""

    frame: npt.NDArray[np.int32]
    label: npt.NDArray[np.int32]
    points: list[Points]
    feature: npt.NDArray[np.float32]
    n_frames: int

    def of_frame(self) -> Any:
        """(M, F) sparse, 1 where the mask is from the frame."""
        return _one_hot(self.frame, self.n_frames)


def mask_clustering(
    camera: PinholeCamera,
    frames: Iterable[Frame],
    cloud: npt.NDArray[np.floating],
    settings: MaskClusteringSettings | None = None,
) -> list[ClusteredInstance]:
    """Objects of frames ``(depth m, label picture, features by label - 1 or None, T_world_camera)`` as points of a finished cloud.

    ``cloud`` is (N, 3) m in the same world frame. Frames with a pose that is not finite are passed over, but counted. Raises
    ValueError on other frames that make no sense, and on a cloud of another shape.
    """
    settings = settings or MaskClusteringSettings()
    scan = np.asarray(cloud, np.float64)
    if scan.ndim != 2 or scan.shape[1] != 3 or not np.isfinite(scan).all():
        raise ValueError(f"cloud is of shape {scan.shape}, expected finite (N, 3) m")
    masks = back_project(camera, frames, scan, settings)
    if not masks.points:
        return []
    membership = _membership(masks.points, len(scan))
    visible, containers, sound = observe(masks, membership, settings)
    visible, owner = cluster(masks, visible, containers, sound, settings)
    seen_in = sparse.csr_matrix(membership.T @ masks.of_frame())
    seen_in.data[:] = 1
    objects: list[ClusteredInstance] = []
    for node, members in enumerate(_groups(owner, len(visible))):
        if len(members) >= settings.min_masks:
            objects += split_node(members, visible[node], masks, seen_in, scan, settings)
    return drop_overlapping(objects, len(scan), settings.tau_overlap)


def back_project(
    camera: PinholeCamera, frames: Iterable[Frame], cloud: npt.NDArray[np.float64], settings: MaskClusteringSettings
) -> Masks:
    """The masks of all frames as point sets of the cloud; those too small, or of which the cloud holds too little, are left out."""
    tree = cKDTree(cloud)
    origin: list[tuple[int, int]] = []
    points: list[Points] = []
    features: list[npt.NDArray[np.float32] | None] = []
    t = -1
    for t, (depth, labels, feature, T_world_camera) in enumerate(frames):
        if not np.isfinite(np.asarray(T_world_camera, np.float64)).all():
            continue
        depth_, labels_, feature_, T = check_frame(camera, depth, labels, feature, T_world_camera)
        valid = (depth_ > 0) & (depth_ < settings.max_depth) & (labels_ > 0)
        world = camera.unproject(depth_, T)[valid].astype(np.float64)
        of_pixel = labels_[valid]
        order = np.argsort(of_pixel, kind="stable")
        names, starts = np.unique(of_pixel[order], return_index=True)
        for name, pixels in zip(names.tolist(), np.split(order, starts[1:]), strict=False):
            found = _cloud_points(world[pixels], cloud, tree, settings)
            if found is not None:
                origin.append((t, name))
                points.append(found)
                features.append(None if feature_ is None else feature_[name - 1])
    none = np.zeros(max((len(f) for f in features if f is not None), default=0), np.float32)
    stacked = np.array([none if f is None else f for f in features], np.float32).reshape(len(features), len(none))
    pairs = np.array(origin, np.int32).reshape(-1, 2)
    return Masks(pairs[:, 0], pairs[:, 1], points, stacked, t + 1)


def _cloud_points(
    pixels: npt.NDArray[np.float64], cloud: npt.NDArray[np.float64], tree: Any, settings: MaskClusteringSettings
) -> Points | None:
    """The cloud's points (ascending) near a mask's pixels (n, 3) m, or None if the mask is dropped."""
    if len(pixels) < settings.min_points:
        return None
    mask = denoise(pixels, settings)
    if len(mask) < settings.min_points:
        return None
    pairs = cKDTree(mask).sparse_distance_matrix(tree, settings.radius, output_type="ndarray")
    low, high = mask.min(0) - settings.box_margin, mask.max(0) + settings.box_margin
    inside = ((cloud[pairs["j"]] > low) & (cloud[pairs["j"]] < high)).all(1)
    of_mask, of_cloud = pairs["i"][inside], pairs["j"][inside]
    order = np.lexsort((of_cloud, of_mask))
    of_mask, of_cloud = of_mask[order], of_cloud[order]
    covered, first = np.unique(of_mask, return_index=True)
    if len(covered) / len(mask) < settings.min_coverage:
        return None
    rank = np.arange(len(of_mask)) - np.repeat(first, np.diff(np.append(first, len(of_mask))))
    return np.unique(of_cloud[rank < settings.max_neighbours]).astype(np.int32)


def denoise(points: npt.NDArray[np.float64], settings: MaskClusteringSettings) -> npt.NDArray[np.float64]:
    """A mask's points (n, 3) m averaged in voxels, without small components and outliers."""
    import open3d as o3d

    thin = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(settings.voxel_size)
    cluster = np.asarray(thin.cluster_dbscan(settings.denoise_eps, settings.denoise_min_points)) + 1  # 0 = noise
    large = np.bincount(cluster) >= settings.min_component * len(cluster)
    thin = thin.select_by_index(np.flatnonzero(large[cluster]).tolist())
    if len(thin.points) < settings.min_points:
        return np.asarray(thin.points, np.float64)
    thin, _ = thin.remove_statistical_outlier(settings.outlier_neighbours, settings.outlier_sigma)
    return np.asarray(thin.points, np.float64)


def observe(
    masks: Masks, membership: Any, settings: MaskClusteringSettings
) -> tuple[npt.NDArray[np.float32], Any, npt.NDArray[np.bool_]]:
    """V (M, F) float32, the frames that contain a mask; C (M, M) sparse, the masks that do so; which masks are not under-segmented.

    Points in several masks of one frame are on a boundary and count for no mask in any frame. What under-segmented masks
    contain is erased from both.
    """
    alone = (membership.T @ masks.of_frame()).max(axis=1).toarray().ravel() <= 1
    inner = membership[:, np.flatnonzero(alone)]
    common = (inner @ inner.T).tocoo()
    size = np.asarray(inner.sum(axis=1)).ravel()
    labelled = (common @ masks.of_frame()).toarray()
    sees = (labelled / np.maximum(size, 1)[:, None] >= settings.tau_visible) | (labelled >= settings.min_visible)
    frame = masks.frame[common.col]
    held = (common.data / labelled[common.row, frame] > settings.tau_contained) & sees[common.row, frame]
    row, col = common.row[held], common.col[held]
    visible = np.zeros(labelled.shape, np.float32)
    visible[row, masks.frame[col]] = 1
    n_seen, n_held = sees.sum(1), visible.astype(np.int64).sum(1)
    sound = (n_seen > 0) & ((n_seen - n_held) / np.maximum(n_seen, 1) <= settings.tau_undersegmented)
    erased = ~sound[col]
    visible[row[erased], masks.frame[col[erased]]] = 0
    ones = np.ones(int((~erased).sum()), np.float32)
    return visible, sparse.csr_matrix((ones, (row[~erased], col[~erased])), common.shape), sound


def observer_schedule(visible: npt.NDArray[np.float32]) -> list[float]:
    """Common observers that each round asks for: percentiles 95, 90, .. 0 of the non-zero entries of V V^T, over all masks and with
    the diagonal; a value of at most 1 is 1 from the 50th percentile up and ends the schedule below it."""
    counts = np.zeros(visible.shape[1] + 1, np.int64)
    for start in range(0, len(visible), _ROWS):
        common = visible[start : start + _ROWS] @ visible.T
        counts += np.bincount(common.astype(np.int64).ravel(), minlength=len(counts))
    counts[0] = 0
    up_to = np.cumsum(counts)
    schedule: list[float] = []
    for percent in range(95, -5, -5):
        rank = percent / 100 * (up_to[-1] - 1)
        low, high = np.searchsorted(up_to, [np.floor(rank), np.ceil(rank)], side="right") if up_to[-1] else (0, 0)
        observers = float(np.float32(low + (rank - np.floor(rank)) * (high - low)))
        if observers <= 1 and percent < 50:
            break
        schedule.append(max(observers, 1.0))
    return schedule


def cluster(
    masks: Masks,
    visible: npt.NDArray[np.float32],
    containers: Any,
    sound: npt.NDArray[np.bool_],
    settings: MaskClusteringSettings,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int64]]:
    """V of the nodes after all rounds, and the node that owns each mask (-1 = none)."""
    owner = np.where(sound, np.cumsum(sound) - 1, -1).astype(np.int64)
    schedule = observer_schedule(visible)
    visible, containers = visible[sound], containers[np.flatnonzero(sound)]
    sizes = np.array([len(p) for p in masks.points])
    for n_o in schedule:
        feature = None
        if settings.semantics == "product":
            largest = [members[np.argmax(sizes[members])] for members in _groups(owner, len(visible))]
            feature = masks.feature[largest]
        joined = connected_components(_edges(visible, containers, feature, n_o, settings), directed=False)[1]
        groups = _one_hot(joined, int(joined.max(initial=-1)) + 1).T.tocsr()
        visible = (groups @ visible > 0).astype(np.float32)
        containers = sparse.csr_matrix(groups @ containers)
        containers.data[:] = 1
        owner[owner >= 0] = joined[owner[owner >= 0]]
    return visible, owner


def _edges(
    visible: npt.NDArray[np.float32],
    containers: Any,
    feature: npt.NDArray[np.float32] | None,
    n_o: float,
    settings: MaskClusteringSettings,
) -> Any:
    """(n, n) sparse: pairs with at least ``n_o`` common observers that enough of them support."""
    supporters = sparse.csr_matrix(containers @ containers.T)
    rows, cols = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for start in range(0, len(visible), _ROWS):
        pairs = supporters[start : start + _ROWS].tocoo()
        row, col = pairs.row.astype(np.int64), pairs.col.astype(np.int64)
        observers = (visible[start : start + _ROWS] @ visible.T)[row, col]
        rate = pairs.data / (observers + np.float32(1e-7))
        agree = rate >= np.float32(settings.tau_consensus)
        if feature is not None:
            cosine = (feature[start : start + _ROWS] @ feature.T)[row, col]
            known = (feature != 0).any(axis=1)[np.stack([row + start, col])].all(axis=0)
            agree = np.where(known, rate * cosine > settings.tau_product, agree)
        agree = agree & (observers >= n_o) & (row + start != col)
        rows.append(row[agree] + start)
        cols.append(col[agree])
    index = np.concatenate(rows), np.concatenate(cols)
    return sparse.csr_matrix((np.ones(len(index[0]), bool), index), supporters.shape)


def split_node(
    members: npt.NDArray[np.int64],
    frames: npt.NDArray[np.float32],
    masks: Masks,
    seen_in: Any,
    cloud: npt.NDArray[np.float64],
    settings: MaskClusteringSettings,
) -> list[ClusteredInstance]:
    """The pieces of a node (DBSCAN, its noise being a piece too), each with the points that enough of the node's ``frames`` (its
    row of V) which see them detect, and with the masks that lie in it most; pieces of too few masks are dropped."""
    import open3d as o3d

    points = np.unique(np.concatenate([masks.points[k] for k in members]))
    shape = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud[points]))
    piece = np.asarray(shape.cluster_dbscan(settings.split_eps, settings.split_min_points)) + 1
    sizes = np.bincount(piece)
    at = [np.searchsorted(points, masks.points[k]) for k in members]
    detections = np.unique(
        np.concatenate([int(masks.frame[k]) * len(points) + a for k, a in zip(members, at, strict=True)])
    )
    detected = np.bincount(detections % len(points), minlength=len(points))
    kept = np.asarray(detected / (seen_in[points] @ frames + 1e-6)) > settings.tau_detection
    views: list[list[tuple[float, int]]] = [[] for _ in sizes]
    for k, a in zip(members.tolist(), at, strict=True):
        overlap = np.bincount(piece[a], minlength=len(sizes))
        most = int(np.argmax(overlap))
        views[most].append((-float(overlap[most]) / int(sizes[most]), k))
    found = []
    for n, of_piece in enumerate(views):
        inside = points[(piece == n) & kept]
        if len(inside) and len(of_piece) >= settings.min_masks:
            best = np.array([k for _, k in sorted(of_piece)])
            pairs = np.stack([masks.frame[np.sort(best)], masks.label[np.sort(best)]], axis=1)
            feature = _mean_feature(masks.feature[best[: settings.top_k]])
            found.append(ClusteredInstance(inside.astype(np.int64), pairs, feature))
    return found


def drop_overlapping(objects: list[ClusteredInstance], n_points: int, tau: float) -> list[ClusteredInstance]:
    """Without the objects of which another, in the order of the list, holds more than ``tau``; the earlier of two alike goes."""
    if not objects:
        return []
    points = _membership([o.points_index.astype(np.int32) for o in objects], n_points)
    common = sparse.csr_matrix(points @ points.T)
    common.sort_indices()
    gone = np.zeros(len(objects), bool)
    for i in range(len(objects)):
        if gone[i]:
            continue
        row = slice(common.indptr[i], common.indptr[i + 1])
        for j, both in zip(common.indices[row].tolist(), common.data[row].tolist(), strict=True):
            if j > i and not gone[j]:
                if both / len(objects[i].points_index) > tau:
                    gone[i] = True
                elif both / len(objects[j].points_index) > tau:
                    gone[j] = True
    return [o for o, drop in zip(objects, gone.tolist(), strict=True) if not drop]


def _mean_feature(features: npt.NDArray[np.float32]) -> npt.NDArray[np.float32] | None:
    mean = features.astype(np.float64).sum(0)
    norm = float(np.linalg.norm(mean))
    return None if norm < 1e-9 else np.asarray(mean / norm, np.float32)


def _groups(owner: npt.NDArray[np.int64], n: int) -> list[npt.NDArray[np.int64]]:
    """Masks of each of n nodes, ascending."""
    order = np.argsort(owner, kind="stable")
    return np.split(order, np.searchsorted(owner[order], np.arange(n + 1)))[1 : n + 1]


def _membership(points: list[Points], n_points: int) -> Any:
    """(len(points), n_points) sparse int32, 1 where a set holds the point."""
    ends = np.cumsum([0, *(len(p) for p in points)])
    index = np.concatenate(points)
    return sparse.csr_matrix((np.ones(len(index), np.int32), index, ends), (len(points), n_points))


def _one_hot(columns: npt.NDArray[np.integer], n: int) -> Any:
    return sparse.csr_matrix((np.ones(len(columns), np.int32), columns, np.arange(len(columns) + 1)), (len(columns), n))
