"""Which things of a home can be seen by somebody who walks through it: nobody is sent for what is shut in a cupboard."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_env.navigation.surface import NavigableSurface
from openmap_scenes import Instance, Scene
from openmap_scenes.homes.rays import RayCaster

EYE = 1.25
"""Height of the eyes above the floor, m."""
FAR = 3.0
"""How far away, m on the floor plan, small things are looked for."""
EYES, SPOTS = 16, 48
"""Places to look from and spots on a thing's surface to look at."""
SEEN_SPOTS = 3
"""A thing is seen if that many of its spots are, from one place."""


def seen(scene: Scene, surface: NavigableSurface, things: Sequence[Instance]) -> list[bool]:
    """Whether each thing is seen from somewhere on the main island of the surface. Spots are the middles of faces."""
    caster = RayCaster(scene.vertices, scene.faces)
    places = surface.centres[surface.island == 0]
    tree = cKDTree(places[:, [0, 2]])
    order = np.argsort(scene.face_instance, kind="stable")
    first = np.searchsorted(scene.face_instance[order], [i.id for i in things])
    last = np.searchsorted(scene.face_instance[order], [i.id for i in things], side="right")
    found = []
    for thing, start, end in zip(things, first, last, strict=True):
        faces = order[start:end]
        spots = scene.vertices[scene.faces[faces[_spread(len(faces), SPOTS)]]].mean(axis=1) if len(faces) else None
        eyes = _eyes(thing, places, tree)
        found.append(spots is not None and len(eyes) > 0 and _any_eye_sees(caster, eyes, spots.astype(np.float64)))
    return found


def _eyes(thing: Instance, places: npt.NDArray[np.float64], tree: cKDTree) -> npt.NDArray[np.float64]:
    """Eyes (k, 3) m spread over the places (n, 3) m around a thing."""
    reach = FAR + float(np.hypot(*(thing.aabb_max - thing.aabb_min)[[0, 2]])) / 2
    around = np.array(sorted(tree.query_ball_point(thing.centre[[0, 2]], reach)), np.int64)
    around = around[np.abs(thing.centre[1] - places[around, 1] - EYE) <= 2.0] if len(around) else around
    if len(around) == 0:
        return np.empty((0, 3))
    off = places[around] - thing.centre
    turn = np.argsort(np.arctan2(off[:, 0], off[:, 2]), kind="stable")
    eyes = places[around[turn[_spread(len(around), EYES)]]].copy()
    eyes[:, 1] += EYE
    return eyes


def _any_eye_sees(caster: RayCaster, eyes: npt.NDArray[np.float64], spots: npt.NDArray[np.float64]) -> bool:
    origins = np.repeat(eyes, len(spots), axis=0)
    ways = np.tile(spots, (len(eyes), 1)) - origins
    free = ~caster.blocked(origins, ways, 0.995).reshape(len(eyes), len(spots))
    return bool(free.sum(axis=1).max() >= min(SEEN_SPOTS, len(spots)))


def _spread(n: int, most: int) -> npt.NDArray[np.int64]:
    """At most ``most`` indices spread evenly over 0..n-1."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64))
