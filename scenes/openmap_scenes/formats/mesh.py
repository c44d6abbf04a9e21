"""What every reader makes of a mesh file: its triangles with their look, in one frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.transfer import check_coordinates
from openmap_scenes.scene import Material

T_WORLD_YUP = np.eye(4)
# Matterport's raw frame (x right, y front, z up) to the world frame: world = (x, z, -y).
T_WORLD_ZUP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)
# No texture repeats as often; larger coordinates are damage, and renderers lose their fractions.
FARTHEST_UV = 1e5


@dataclass(frozen=True)
class Part:
    """A run of faces as the file groups them: the names of its node (or group) and of its mesh, and how many they are."""

    node: str
    mesh: str
    n_faces: int


@dataclass(frozen=True)
class TexturedMesh:
    """All geometry of one mesh file in one frame; fields as in ``Scene``. ``parts`` name its faces' runs, in order."""

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    face_material: npt.NDArray[np.int32]
    materials: list[Material]
    uv: npt.NDArray[np.float32] | None
    vertex_colour: npt.NDArray[np.uint8] | None
    parts: tuple[Part, ...] = ()


def check_mesh(mesh: TexturedMesh, source: Path) -> TexturedMesh:
    """The mesh, if every number of it can be used; DataError names the first kind that cannot."""
    if not len(mesh.faces):
        raise DataError(source, "no triangles", "a triangle mesh")
    check_coordinates(mesh.vertices, source)
    low, high = mesh.faces.min(), mesh.faces.max()
    if low < 0 or high >= len(mesh.vertices):
        raise DataError(source, f"vertex indices from {low} to {high}", f"0..{len(mesh.vertices) - 1}")
    if mesh.uv is not None and not (mesh.uv.min() >= -FARTHEST_UV and mesh.uv.max() <= FARTHEST_UV):
        raise DataError(source, "texture coordinates that are not finite or huge", f"at most {FARTHEST_UV:.0f}")
    return mesh


def moved(vertices: npt.NDArray[np.float32], T_to_from: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Vertices (V, 3) after a transform (4, 4), in single precision throughout."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by check_mesh
        rotated = vertices @ T_to_from[:3, :3].T.astype(np.float32)
        return np.asarray(rotated + T_to_from[:3, 3].astype(np.float32), np.float32)


def srgb_from_linear(linear: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Display values 0..1 of linear light 0..1 (IEC 61966-2-1)."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_from_srgb(srgb: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Linear light 0..1 of display values 0..1 (IEC 61966-2-1)."""
    srgb = np.clip(srgb, 0.0, 1.0)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
