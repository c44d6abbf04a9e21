"""Is a scene fit to be searched: which rooms can be reached, which things can be seen, which solids run into each other.

Everything is measured on the triangles themselves, with the same body, camera and renderer as an agent has.
"""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import make_renderer
from openmap_env.simulator import PITCH_LIMIT
from openmap_scenes import Instance, PinholeCamera, Room, Scene

STRUCTURE = frozenset(
    {
        "wall",
        "floor",
        "ceiling",
        "window",
        "door",
        "door frame",
        "balcony door",
        "front door",
        "doorway",
        "unlabelled",
        "beam",
        "column",
    }
)
"""What is part of the building; not counted among the things that are looked for."""
SOLID_OVERLAP = 0.01
"""How far, m, one solid may reach into another."""
ENOUGH_PIXELS = 400
CAMERA = PinholeCamera.from_hfov(640, 480, 90.0)
CAMERA_HEIGHT = 1.25
_NEAR, _FAR = 0.3, 2.5
_CANDIDATES, _RENDERED, _SAMPLES = 64, 4, 48


def things(scene: Scene) -> list[Instance]:
    """The instances that are not part of the building."""
    return [i for i in scene.instances if i.category not in STRUCTURE]


def unreachable_rooms(scene: Scene, surface: NavigableSurface) -> list[Room]:
    """Rooms in which no place belongs to the main island of the surface."""
    main = surface.centres[surface.island == 0]
    closed = []
    for room in scene.rooms:
        # A floor may lie a little below or above the box that the source gives.
        low, high = room.aabb_min - (0.0, 0.3, 0.0), room.aabb_max + np.array((0.0, 0.3, 0.0))
        if not ((main >= low) & (main <= high)).all(1).any():
            closed.append(room)
    return closed


@dataclass(frozen=True)
class Clash:
    """Two instances of which one reaches into the other by more than ``SOLID_OVERLAP``, at a world ``place`` (3,) m."""

    first: Instance
    second: Instance
    place: npt.NDArray[np.float64]


def clashes(scene: Scene) -> list[Clash]:
    """Pairs of solids that run into each other; pairs of which both are part of the building are left out.

    An edge of one that goes through a face of the other and ends more than ``SOLID_OVERLAP`` m before and behind its plane makes a
    clash; so does a solid that lies wholly inside the other.
    """
    solids = {i.id: Solid.of(scene, i.id) for i in scene.instances}
    found = []
    for a, b in combinations(scene.instances, 2):
        if a.category in STRUCTURE and b.category in STRUCTURE:
            continue
        # How far one would have to be moved along each axis, so that a wall without thickness counts as well.
        reach = np.minimum(a.aabb_max - b.aabb_min, b.aabb_max - a.aabb_min)
        if np.any(reach <= SOLID_OVERLAP):
            continue
        low, high = np.maximum(a.aabb_min, b.aabb_min) - 1e-3, np.minimum(a.aabb_max, b.aabb_max) + 1e-3
        place = solids[a.id].pierced_by(solids[b.id], low, high)
        if place is None:
            place = solids[b.id].pierced_by(solids[a.id], low, high)
        if place is None:
            place = solids[a.id].encloses(solids[b.id])
        if place is None:
            place = solids[b.id].encloses(solids[a.id])
        if place is not None:
            found.append(Clash(a, b, place))
    return found


class Solid:
    """The triangles of one instance; the ray structure is built when it is first asked."""

    def __init__(self, vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> None:
        self.vertices = np.ascontiguousarray(vertices, np.float32)
        self.faces = np.ascontiguousarray(faces, np.uint32)
        self._caster: Any = None

    @classmethod
    def of(cls, scene: Scene, instance_id: int | None = None) -> Solid:
        """One instance, or the whole scene."""
        if instance_id is None:
            return cls(scene.vertices, scene.faces)
        used, inverse = np.unique(scene.faces[scene.face_instance == instance_id], return_inverse=True)
        return cls(scene.vertices[used], inverse.reshape(-1, 3))

    def caster(self) -> Any:
        if self._caster is None:
            self._caster = _open3d().t.geometry.RaycastingScene()
            self._caster.add_triangles(self.vertices, self.faces)
        return self._caster

    def edges(
        self, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Both ends (E, 3) m of every edge whose box meets the box."""
        pairs = np.sort(self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        pairs = np.unique(pairs, axis=0)
        a, b = self.vertices[pairs[:, 0]], self.vertices[pairs[:, 1]]
        near = ((np.minimum(a, b) <= high) & (np.maximum(a, b) >= low)).all(1)
        return a[near], b[near]

    def pierced_by(
        self, other: Solid, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64] | None:
        """Where an edge of the other goes through a face of this one by more than the allowed overlap, or None."""
        a, b = other.edges(low, high)
        if len(a) == 0 or len(self.faces) == 0:
            return None
        for start, end in ((a, b), (b, a)):
            way = end - start
            hit = self._cast(start, way)
            t = hit["t_hit"].numpy()
            crossing = np.flatnonzero((t > 0.0) & (t < 1.0))
            if len(crossing) == 0:
                continue
            normal = hit["primitive_normals"].numpy()[crossing]
            across = np.abs((normal * way[crossing]).sum(1))
            deep = (across * t[crossing] > SOLID_OVERLAP) & (across * (1.0 - t[crossing]) > SOLID_OVERLAP)
            if deep.any():
                k = crossing[np.flatnonzero(deep)[0]]
                return np.asarray(start[k] + t[k] * way[k], np.float64)
        return None

    def encloses(self, other: Solid) -> npt.NDArray[np.float64] | None:
        """A place of the other that is closed in by this one on all 26 sides and off its surface, or None."""
        place = other.vertices[:: max(1, len(other.vertices) // 32)]
        way = np.array(
            [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], np.float32
        )
        hits = np.zeros(len(place), np.int64)
        for direction in way:
            hits += np.isfinite(self.distance(place, direction))
        distance = self.caster().compute_distance(_open3d().core.Tensor(np.ascontiguousarray(place))).numpy()
        inside = np.flatnonzero((hits >= len(way)) & (distance > SOLID_OVERLAP))
        # One closed-in corner (of a drawer, under a lid) is no solid in a solid; most of it has to be.
        return np.asarray(place[inside[0]], np.float64) if len(inside) > len(place) / 2 else None

    def distance(self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
        """How far, in lengths of ``way`` ((N, 3) or (3,)), the first hit lies from ``origin`` (N, 3) m; inf = none. (N,)."""
        return np.asarray(self._cast(origin, np.broadcast_to(way, origin.shape))["t_hit"].numpy())

    def _cast(self, origin: npt.NDArray[np.floating], way: npt.NDArray[np.floating]) -> Any:
        rays = np.concatenate([origin, way], 1).astype(np.float32)
        return self.caster().cast_rays(_open3d().core.Tensor(rays))


def _open3d() -> Any:
    """Imported late, and without its type stubs, which do not take arrays."""
    return importlib.import_module("open3d")


def best_views(scene: Scene, surface: NavigableSurface, seed: int = 0, renderer: str = "opengl") -> dict[int, int]:
    """For each thing the most pixels of it that were seen from a reachable place, counting stops at ``ENOUGH_PIXELS``.

    Places of the main island around the thing are ranked by how much of it rays from the camera reach; the best ones are rendered
    with the camera turned to it, as far as an agent can look up and down.
    """
    rng = np.random.default_rng(seed)
    centres = surface.centres[surface.island == 0]
    whole = Solid.of(scene)
    pixels = {i.id: 0 for i in things(scene)}
    backend = make_renderer(renderer, scene, CAMERA)
    try:
        for instance in things(scene):
            if pixels[instance.id] >= ENOUGH_PIXELS:
                continue
            for eye, target in _places(scene, instance, centres, whole, rng):
                ids = backend.render(look_at(eye, target)).instance
                for i, n in zip(*np.unique(ids, return_counts=True), strict=True):
                    if int(i) in pixels:
                        pixels[int(i)] = max(pixels[int(i)], int(n))
                if pixels[instance.id] >= ENOUGH_PIXELS:
                    break
    finally:
        backend.close()
    return pixels


def _places(
    scene: Scene,
    instance: Instance,
    centres: npt.NDArray[np.float64],
    whole: Solid,
    rng: np.random.Generator,
) -> list[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """(camera place, what it looks at), (3,) m each, the most promising first."""
    gap = np.maximum(np.maximum(instance.aabb_min - centres, centres - instance.aabb_max), 0.0)
    distance = np.hypot(gap[:, 0], gap[:, 2])
    floor_below = (centres[:, 1] <= instance.aabb_max[1] + 0.3) & (centres[:, 1] >= instance.aabb_min[1] - 3.0)
    near = np.flatnonzero((distance <= _FAR) & (distance >= _NEAR) & floor_below)
    if len(near) == 0:
        near = np.argsort(distance)[:_CANDIDATES]
    near = rng.permutation(near)[:_CANDIDATES]
    faces = scene.faces[scene.face_instance == instance.id]
    corners = scene.vertices[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) + 1e-12
    pick = rng.choice(len(faces), _SAMPLES, p=area / area.sum())
    u, v = rng.random(_SAMPLES), rng.random(_SAMPLES)
    u, v = np.where(u + v > 1, 1 - u, u)[:, None], np.where(u + v > 1, 1 - v, v)[:, None]
    targets = corners[pick, 0] * (1 - u - v) + corners[pick, 1] * u + corners[pick, 2] * v
    ranked = []
    for k in near.tolist():
        eye = centres[k] + [0.0, CAMERA_HEIGHT, 0.0]
        way = targets - eye
        seen = whole.distance(np.broadcast_to(eye, way.shape), way) > 0.995
        if seen.any():
            reach = float(np.linalg.norm(way[seen], axis=1).mean())
            ranked.append((seen.mean() / reach**2, k, targets[seen].mean(0)))
    ranked.sort(key=lambda r: (-r[0], r[1]))
    return [(centres[k] + [0.0, CAMERA_HEIGHT, 0.0], target) for _, k, target in ranked[:_RENDERED]]


def look_at(eye: npt.NDArray[np.float64], target: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """T_world_camera (4, 4) of an upright camera at ``eye`` (3,) m turned to ``target``, tilted no further than an agent can."""
    way = target - eye
    heading = math.atan2(-way[0], -way[2])
    pitch = float(np.clip(math.atan2(way[1], math.hypot(way[0], way[2])), -PITCH_LIMIT, PITCH_LIMIT))
    c, s, cp, sp = math.cos(heading), math.sin(heading), math.cos(pitch), math.sin(pitch)
    T_world_camera = np.eye(4)
    yaw = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]])
    T_world_camera[:3, :3], T_world_camera[:3, 3] = yaw @ tilt, eye
    return T_world_camera
