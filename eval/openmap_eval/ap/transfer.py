"""From a map's voxels to the points of a labelled cloud, on which average precision is counted."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_agents.mapping import InstanceMap
from openmap_agents.perception.scannet200 import category_number
from openmap_eval.ap.protocol import Proposal


def owner_of_points(
    instance_map: InstanceMap, points: npt.NDArray[np.floating], reach: float | None = None
) -> npt.NDArray[np.int32]:
    """Id (N,) int32 of the instance whose voxel centre is nearest to each point (N, 3) m; 0 = none within reach.

    Parameters
    ----------
    instance_map, points
        In one frame.
    reach : float, optional
        m. By default the half diagonal of a voxel, within which a point of the voxel lies, and half a voxel for noise.

    Raises
    ------
    ValueError
        The map does not say how large its voxels are, and no reach is given.
    """
    if reach is None:
        if instance_map.voxel_size <= 0:
            raise ValueError("the map does not know its voxel size, expected a reach")
        reach = (np.sqrt(3) + 1) / 2 * instance_map.voxel_size
    owner = np.zeros(len(points), np.int32)
    if len(points) == 0 or not any(len(i.points) for i in instance_map):
        return owner
    instances = sorted(instance_map, key=lambda i: i.id)
    voxels = np.concatenate([i.points for i in instances])
    ids = np.repeat(np.array([i.id for i in instances], np.int32), [len(i.points) for i in instances])
    # A voxel that two instances have goes to the lower id, whatever the tree would take.
    order = np.lexsort((ids, *voxels.T))
    voxels, ids = voxels[order], ids[order]
    first = np.append(True, (np.diff(voxels, axis=0) != 0).any(1))
    voxels, ids = voxels[first], ids[first]
    # Rounding must not lose a point in the corner of its voxel.
    _, nearest = cKDTree(voxels).query(points, distance_upper_bound=reach * (1 + 1e-6))
    near = nearest < len(voxels)
    owner[near] = ids[nearest[near]]
    return owner


def proposals_of_map(
    instance_map: InstanceMap,
    points: npt.NDArray[np.floating],
    reach: float | None = None,
    *,
    ranked: bool = True,
) -> list[Proposal]:
    """The instances of a map that have points of a cloud, by ascending id.

    Parameters
    ----------
    points : (N, 3) m
        In the map's frame.
    reach : float, optional
        As for ``owner_of_points``.
    ranked : bool
        With the map's confidences; else 1 for all, as the public code of MaskClustering and OpenMap has it.

    Raises
    ------
    ValueError
        As ``owner_of_points``.
    """
    owner = owner_of_points(instance_map, points, reach)
    order = np.argsort(owner, kind="stable")
    ids, starts = np.unique(owner[order], return_index=True)
    ends = np.append(starts, len(order))[1:]
    indices = {i: order[a:b].astype(np.int64) for i, a, b in zip(ids.tolist(), starts, ends, strict=True)}
    return [
        Proposal(indices[i.id], i.confidence if ranked else 1.0, category_number(i.label) if i.label else 0)
        for i in sorted(instance_map, key=lambda i: i.id)
        if i.id in indices
    ]
