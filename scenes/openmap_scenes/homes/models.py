"""Furniture ready to be put down: scaled, thinned, split for the light, with its textures; kept in a cache between runs."""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.library import Piece
from openmap_scenes.homes.obj import Surface, read_obj
from openmap_scenes.homes.surface import corner_normals, split, thin, tidy, turn_outward
from openmap_scenes.scene import Material

CACHE_VERSION = 9
TEXTURE_SIZE = 256
LONGEST_EDGE = 0.5


@dataclass(frozen=True)
class Model:
    """A piece of furniture: x right, y up, front along +z, m, origin in the middle of the base.

    Parameters
    ----------
    vertices, normals : (V, 3) float32
    uv : (V, 2) float32
        (0, 0) = top left corner of the texture, v down.
    faces : (F, 3) int32
    face_material : (F,) int32
    materials : list of Material
    """

    vertices: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    uv: npt.NDArray[np.float32]
    faces: npt.NDArray[np.int32]
    face_material: npt.NDArray[np.int32]
    materials: list[Material]

    @property
    def size(self) -> npt.NDArray[np.float64]:
        """Extent (3,) m along x, y, z."""
        return np.asarray(np.ptp(self.vertices, axis=0), np.float64)


def load_model(piece: Piece) -> Model:
    """The model of a piece, from the cache where it is there."""
    path = cache_folder() / f"{piece.content_key()}.npz"
    if path.is_file():
        try:
            return _unpack(path.read_bytes())
        except (ValueError, KeyError, zipfile.BadZipFile):
            path.unlink(missing_ok=True)
    packed = _pack(prepare_model(piece))
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
        file.write(packed)
    os.replace(file.name, path)
    return _unpack(packed)


def cache_folder() -> Path:
    """Where prepared models are kept, per user and per version of this code."""
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "openmapnav" / f"furniture-v{CACHE_VERSION}"


def face_budget(size: npt.NDArray[np.float64]) -> int:
    """How many triangles a thing of that size (3,) m may have: a cup is seen from afar, a sofa fills the picture."""
    return int(np.clip(5000 * float(size.max()), 2200, 9500))


def prepare_model(piece: Piece) -> Model:
    """Read and prepare the model of a piece, without the cache."""
    with zipfile.ZipFile(piece.archive) as archive:
        surface, materials, opacity = read_obj(archive, piece.model, TEXTURE_SIZE)
    visible = np.asarray(opacity)[surface.material] > 0.02
    surface = surface.keep(visible) if visible.any() else surface
    surface = tidy(_scaled(surface, piece))
    surface = tidy(thin(surface, face_budget(piece.size)))
    surface = turn_outward(split(surface, LONGEST_EDGE))
    return _indexed(surface, materials)


def _scaled(surface: Surface, piece: Piece) -> Surface:
    """Rotated as the catalogue says and stretched to its size; the base's middle becomes the origin."""
    vertices = surface.vertices @ piece.rotation.T
    low, high = vertices.min(0), vertices.max(0)
    vertices = (vertices - (low + high) / 2.0) * (piece.size / np.maximum(high - low, 1e-9))
    vertices[:, 1] += piece.size[1] / 2.0
    return Surface(vertices, surface.faces, surface.uv, surface.material)


def _indexed(surface: Surface, materials: list[Material]) -> Model:
    """One vertex for each different corner (place, uv, normal), and only the materials that are used."""
    uv = surface.uv * [1.0, -1.0] + [0.0, 1.0]
    uv -= np.floor(uv.mean(1, keepdims=True))
    textured = np.array([m.texture is not None for m in materials])[surface.material]
    uv[~textured] = 0.0
    corners = np.concatenate([surface.vertices[surface.faces], corner_normals(surface), uv], 2)
    rows, inverse = np.unique(np.round(corners.reshape(-1, 8), 5), axis=0, return_inverse=True)
    used, face_material = np.unique(surface.material, return_inverse=True)
    return Model(
        rows[:, :3].astype(np.float32),
        rows[:, 3:6].astype(np.float32),
        rows[:, 6:].astype(np.float32),
        inverse.reshape(-1, 3).astype(np.int32),
        face_material.reshape(-1).astype(np.int32),
        [materials[m] for m in used],
    )


def _pack(model: Model) -> bytes:
    arrays: dict[str, npt.NDArray[np.generic]] = {
        "vertices": model.vertices,
        "normals": model.normals,
        "uv": model.uv,
        "faces": model.faces,
        "face_material": model.face_material,
        "names": np.array([m.name for m in model.materials]),
        "colours": np.array([m.colour for m in model.materials], np.float32),
    }
    arrays |= {f"texture{i}": m.texture for i, m in enumerate(model.materials) if m.texture is not None}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _unpack(data: bytes) -> Model:
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        materials = [
            Material(str(name), colour, file.get(f"texture{i}"))
            for i, (name, colour) in enumerate(zip(file["names"], file["colours"], strict=True))
        ]
        return Model(file["vertices"], file["normals"], file["uv"], file["faces"], file["face_material"], materials)
