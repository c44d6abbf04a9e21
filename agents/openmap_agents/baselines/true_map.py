"""The map that a perfect eye would make: every true instance of a scene, called what it is.

With it everything that perception and mapping lose is taken out, and what remains is what grounding loses. For analysis, never a
default.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.grounding.colours import typical
from openmap_agents.grounding.lexicon import STRUCTURE
from openmap_agents.grounding.text_space import TextEncoder
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_scenes import Scene

SPACING = 0.05
"""Side of the squares that the points of surfaces lie in, m."""


def true_map(scene: Scene, encoder: TextEncoder) -> InstanceMap:
    """A scene's instances as a map, with their own ids, in the world frame.

    An instance has the corners of its triangles and points spread over them (so that its box is the true one), the feature of
    its category in the encoder's text space, and the typical RGB of its colour word, where the scene tells one.
    """
    categories = sorted({instance.category for instance in scene.instances})
    features = dict(zip(categories, encoder.encode_text(categories), strict=True)) if categories else {}
    order = np.argsort(scene.face_instance, kind="stable")
    ids = scene.face_instance[order]
    found = []
    for instance in scene.instances:
        first, last = np.searchsorted(ids, [instance.id, instance.id + 1])
        corners = scene.vertices[scene.faces[order[first:last]]]
        if not len(corners):
            continue
        found.append(
            MapInstance(
                id=instance.id,
                points=_points(corners),
                feature=np.asarray(features[instance.category], np.float32),
                is_structure=instance.category in STRUCTURE,
                colour=typical(instance.attributes.get("colour", "")),
                label=instance.category,
            )
        )
    return InstanceMap(found)


def _points(corners: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Points (N, 3) of triangles (F, 3, 3) m: their corners, and a lattice over those that are larger than its squares."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    points = [corners.reshape(-1, 3)]
    for triangle, side in zip(corners[sides > SPACING], sides[sides > SPACING], strict=True):
        n = min(int(np.ceil(side / SPACING)), 100)
        a, b = (k.ravel() / n for k in np.meshgrid(np.arange(n + 1), np.arange(n + 1)))
        a, b = a[a + b <= 1], b[a + b <= 1]
        points.append(triangle[0] + a[:, None] * (triangle[1] - triangle[0]) + b[:, None] * (triangle[2] - triangle[0]))
    stacked = np.concatenate(points).astype(np.float32)
    cells = np.floor(stacked / SPACING).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    # The corners that span the box stay, whatever square they share.
    ends = np.concatenate([stacked.argmin(0), stacked.argmax(0)])
    return np.asarray(stacked[np.union1d(first, ends)], np.float32)
