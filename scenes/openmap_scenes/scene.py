"""What a home is: one triangle mesh with textures, and who is who on it.

World frame: right-handed, Y up, metres, zero heading looks along -Z. Readers convert to it; nobody else does.
Colours are unlit: a pixel is ``texture * material.colour * vertex colour``, all as sRGB display values, because the scans of
this field carry their light in their textures, and generated homes bake theirs into vertex colours.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError


@dataclass(frozen=True)
class Material:
    """How faces look.

    Parameters
    ----------
    name : str
    colour : (3,) float32
        sRGB display values in 0..1, multiplied with the texture.
    texture : (h, w, 3) uint8 or None
        sRGB, row 0 on top; repeats outside 0..1.
    missing_texture : str
        The image that the material names and that is not there, so that its plain colour stands in for it; "" where none is missed.
    """

    name: str
    colour: npt.NDArray[np.float32]
    texture: npt.NDArray[np.uint8] | None = None
    missing_texture: str = ""


@dataclass(frozen=True)
class Room:
    """A named space: its axis-aligned box in the world frame, (3,) float m each, and the storey that it lies on, 0 = lowest."""

    id: int
    name: str
    aabb_min: npt.NDArray[np.float64]
    aabb_max: npt.NDArray[np.float64]
    level: int = 0

    def contains(self, position: npt.ArrayLike, margin: float = 0.0) -> bool:
        """Whether a world position (3,) m lies in the box, grown by ``margin`` m."""
        p = np.asarray(position, np.float64)
        return bool(np.all(p >= self.aabb_min - margin) and np.all(p <= self.aabb_max + margin))


@dataclass(frozen=True)
class Instance:
    """One object of a home, structure (walls, floors, ceilings) included.

    Parameters
    ----------
    id : int
        As in ``Scene.face_instance``; > 0, since 0 means none.
    category : str
        What it is called, lower case ("coffee table").
    centre, aabb_min, aabb_max : (3,) float64 m, world frame
        Axis-aligned box of all its vertices; the centre is that of the box.
    room : int or None
        ``Room.id``.
    mpcat40, scannet200, lvis : str or None
        Its name in those label sets ("chair", "office chair", "chair"), where the source or the taxonomy knows it.
    attributes : dict
        Words that describe it: ``{"colour": "blue", "material": "wood"}``.
    source_id : int
        The id that the source file uses.
    """

    id: int
    category: str
    centre: npt.NDArray[np.float64]
    aabb_min: npt.NDArray[np.float64]
    aabb_max: npt.NDArray[np.float64]
    room: int | None = None
    mpcat40: str | None = None
    attributes: dict[str, str] = field(default_factory=dict)
    source_id: int = -1
    scannet200: str | None = None
    lvis: str | None = None


@dataclass(frozen=True)
class Scene:
    """A home as plain arrays, V vertices and F triangles.

    Parameters
    ----------
    name : str
        Short and unique among what is compared ("aws_small_house").
    vertices : (V, 3) float32 m, world frame
    faces : (F, 3) int32
    face_material : (F,) int32
        Index into ``materials``.
    face_instance : (F,) int32
        ``Instance.id``, 0 = none.
    materials : list of Material
    instances : list of Instance
        Ascending by id; every id of ``face_instance`` but 0 is here.
    rooms : list of Room
    uv : (V, 2) float32 or None
        Texture coordinates, (0, 0) = the texture's top left corner, v down.
    vertex_colour : (V, 3) uint8 or None
        sRGB; None = white.
    source : str
        Where it came from: the catalogue spec or the file.
    credits : tuple of str
        Authors and licences of what the home is made of.
    """

    name: str
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    face_material: npt.NDArray[np.int32]
    face_instance: npt.NDArray[np.int32]
    materials: list[Material]
    instances: list[Instance]
    rooms: list[Room] = field(default_factory=list)
    uv: npt.NDArray[np.float32] | None = None
    vertex_colour: npt.NDArray[np.uint8] | None = None
    source: str = ""
    credits: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n_vertices, n_faces = len(self.vertices), len(self.faces)
        where = self.source or self.name
        for name, array, shape in (
            ("vertices", self.vertices, (n_vertices, 3)),
            ("faces", self.faces, (n_faces, 3)),
            ("face_material", self.face_material, (n_faces,)),
            ("face_instance", self.face_instance, (n_faces,)),
            ("uv", self.uv, (n_vertices, 2)),
            ("vertex_colour", self.vertex_colour, (n_vertices, 3)),
        ):
            if array is not None and array.shape != shape:
                raise DataError(where, f"{name} of shape {array.shape}", f"{shape}")
        if n_faces == 0:
            raise DataError(where, "a mesh without faces", "at least one triangle")
        if not _all_finite(self.vertices):
            raise DataError(where, "vertices that are not finite", "finite coordinates in metres")
        for name, array, upper in (
            ("faces", self.faces, n_vertices),
            ("face_material", self.face_material, len(self.materials)),
        ):
            if array.min() < 0 or array.max() >= upper:
                raise DataError(where, f"{name} from {array.min()} to {array.max()}", f"0..{upper - 1}")
        missing = _unlisted(self.face_instance, {i.id for i in self.instances})
        if missing:
            raise DataError(where, f"faces of instances {missing[:5]}", "only ids that the instance table lists")

    @property
    def aabb(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Smallest and largest corner (3,) m of the whole mesh, world frame."""
        return self.vertices.min(0).astype(np.float64), self.vertices.max(0).astype(np.float64)

    def digest(self) -> str:
        """A hexadecimal fingerprint of everything that is seen or said of the scene: equal bytes, equal digest, in any process."""
        hasher = hashlib.sha256()
        for array in (
            self.vertices, self.faces, self.face_material, self.face_instance, self.uv, self.vertex_colour,
        ):  # fmt: skip
            hasher.update(b"none" if array is None else np.ascontiguousarray(array).tobytes())
        for material in self.materials:
            hasher.update(material.colour.tobytes())
            hasher.update(b"none" if material.texture is None else np.ascontiguousarray(material.texture).tobytes())
        for i in self.instances:
            names = (i.id, i.category, i.room, i.mpcat40, i.scannet200, i.lvis, sorted(i.attributes.items()))
            hasher.update(repr(names).encode() + i.aabb_min.tobytes() + i.aabb_max.tobytes())
        for room in self.rooms:
            hasher.update(repr((room.id, room.name, room.level)).encode())
            hasher.update(room.aabb_min.tobytes() + room.aabb_max.tobytes())
        return hasher.hexdigest()

    def instance(self, instance_id: int) -> Instance:
        """The instance of that id; KeyError where there is none."""
        for candidate in self.instances:
            if candidate.id == instance_id:
                return candidate
        raise KeyError(f"{self.name} has no instance {instance_id}")

    def room_of(self, position: npt.ArrayLike) -> Room | None:
        """The smallest room whose box holds a world position (3,) m, or None."""
        holding = [room for room in self.rooms if room.contains(position)]
        return min(holding, key=lambda room: float(np.prod(room.aabb_max - room.aabb_min)), default=None)


# Checks look at a block of rows at a time: what they need besides is little, however large and memory-mapped the scene.
_BLOCK = 1 << 16


def _all_finite(array: npt.NDArray[np.floating]) -> bool:
    return all(bool(np.isfinite(array[k : k + _BLOCK]).all()) for k in range(0, len(array), _BLOCK))


def _unlisted(face_instance: npt.NDArray[np.integer], listed: set[int]) -> list[int]:
    """The ids of faces, ascending, that are neither 0 nor listed."""
    low, high = int(face_instance.min()), int(face_instance.max())
    if low >= 0 and high < max(len(face_instance), 1 << 20):
        known = np.zeros(high + 1, np.bool_)
        known[[0, *(i for i in listed if 0 < i <= high)]] = True
        if all(bool(known[face_instance[k : k + _BLOCK]].all()) for k in range(0, len(face_instance), _BLOCK)):
            return []
    return sorted(set(np.unique(face_instance).tolist()) - {0} - listed)


def instance_boxes(
    vertices: npt.NDArray[np.floating], faces: npt.NDArray[np.integer], face_instance: npt.NDArray[np.integer]
) -> dict[int, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """Axis-aligned box (min, max), each (3,) float64 m, of all vertices of each instance id > 0."""
    order = np.argsort(face_instance, kind="stable")
    ids, starts = np.unique(face_instance[order], return_index=True)
    boxes = {}
    for i, chunk in zip(ids.tolist(), np.split(faces[order], starts[1:]), strict=True):
        if i > 0:
            points = vertices[np.unique(chunk)].astype(np.float64)
            boxes[i] = (points.min(0), points.max(0))
    return boxes
