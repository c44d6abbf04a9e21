"""One way to make an ``Instance`` for every reader: centre from the box, a clean name, label sets filled from the taxonomy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from openmap_scenes.scene import Instance
from openmap_scenes.taxonomy import labels_of

# What an object is called that the source lists without a name.
UNLABELLED = "unlabelled"


def clean_category(name: str) -> str:
    """A source's name as ``Instance.category`` holds it: lower case, single blanks ("Coffee  Table " -> "coffee table").

    The underscore, and the ``#`` that Matterport3D writes, are blanks; a name without a letter or digit is "unlabelled".
    """
    cleaned = " ".join(name.replace("#", " ").replace("_", " ").lower().split())
    return cleaned if any(c.isalnum() for c in cleaned) else UNLABELLED


def make_instance(
    id: int,
    category: str,
    low: npt.ArrayLike,
    high: npt.ArrayLike,
    room: int | None = None,
    source_id: int = -1,
    mpcat40: str | None = None,
    attributes: Mapping[str, str] | None = None,
    scannet200: str | None = None,
    lvis: str | None = None,
) -> Instance:
    """An instance from what a reader knows of it.

    Parameters
    ----------
    id : int
        As in ``Scene.face_instance``, > 0.
    category : str
        The source's name, in any case and with any blanks.
    low, high : (3,) m, world frame
        Corners of the axis-aligned box of all its vertices; the centre is the middle between them.
    room : int or None
        ``Room.id``.
    source_id : int
        The id that the source file uses.
    mpcat40, scannet200, lvis : str or None
        What the source itself says; where it says nothing ``taxonomy.labels_of(category)`` does.
    attributes : mapping or None
        Words that describe it.
    """
    name = clean_category(category)
    aabb_min, aabb_max = np.array(low, np.float64), np.array(high, np.float64)
    known = labels_of(name)
    return Instance(
        id=int(id),
        category=name,
        centre=(aabb_min + aabb_max) / 2,
        aabb_min=aabb_min,
        aabb_max=aabb_max,
        room=room,
        mpcat40=mpcat40 or known.mpcat40,
        attributes=dict(attributes or {}),
        source_id=int(source_id),
        scannet200=scannet200 or known.scannet200,
        lvis=lvis or known.lvis,
    )
