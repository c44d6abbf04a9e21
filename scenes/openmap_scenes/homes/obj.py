"""Wavefront OBJ and MTL files, as far as furniture uses them: polygons, texture coordinates, diffuse colours and textures."""

from __future__ import annotations

import io
import posixpath
import zipfile
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes.errors import DataError
from openmap_scenes.scene import Material

GLASS = np.array([0.80, 0.86, 0.88])


@dataclass(frozen=True)
class Surface:
    """Triangles with texture coordinates per corner.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
    uv : (F, 3, 2) float64
        v up, as in OBJ files; zeros where a face has none.
    material : (F,) int64
    """

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int64]
    uv: npt.NDArray[np.float64]
    material: npt.NDArray[np.int64]

    def keep(self, mask: npt.NDArray[np.bool_]) -> Surface:
        """The faces of a mask (F,) bool, with the vertices that they use."""
        used, inverse = np.unique(self.faces[mask], return_inverse=True)
        return Surface(self.vertices[used], inverse.reshape(-1, 3), self.uv[mask], self.material[mask])


def read_obj(archive: zipfile.ZipFile, path: str, texture_size: int) -> tuple[Surface, list[Material], list[float]]:
    """Read an OBJ file and its materials from an archive.

    Returns
    -------
    surface : Surface
        Polygons as triangle fans.
    materials : list of Material
        Textures no larger than ``texture_size`` px, row 0 on top.
    opacity : list of float
        Per material, 0 = invisible.
    """
    lines = archive.read(path).decode("latin-1").replace("\\\n", " ").splitlines()
    vertices, uvs, corners, face_material, names, libraries = _parse(lines, f"{archive.filename}:{path}")
    library: dict[str, tuple[Material, float]] = {}
    for file in libraries:
        library |= _read_mtl(archive, posixpath.join(posixpath.dirname(path), file), texture_size)
    grey = Material("none", np.full(3, 0.8, np.float32))
    found = [library.get(name, (grey, 1.0)) for name in names]
    uv = np.concatenate([uvs, np.zeros((1, 2))])[corners[:, :, 1]]
    surface = Surface(vertices, corners[:, :, 0], uv, face_material)
    return surface, [material for material, _ in found], [opacity for _, opacity in found]


def _parse(
    lines: list[str], where: str
) -> tuple[
    npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.int64], list[str], list[str]
]:
    """Vertices (V, 3), texture coordinates (T, 2), triangle corners (F, 3, [vertex, uv or -1]), materials and names."""
    vertices: list[list[str]] = []
    uvs: list[list[str]] = []
    triangles: list[tuple[tuple[int, int], ...]] = []
    face_material: list[int] = []
    names: dict[str, int] = {"": 0}
    libraries: list[str] = []
    current = 0

    def corner(word: str) -> tuple[int, int]:
        v, _, rest = word.partition("/")
        t = rest.partition("/")[0]
        i, j = int(v), int(t) if t else 0
        return (i - 1 if i > 0 else len(vertices) + i), (j - 1 if j > 0 else (len(uvs) + j if j < 0 else -1))

    try:
        for line in lines:
            word, _, rest = line.strip().partition(" ")
            if word == "v":
                vertices.append(rest.split()[:3])
            elif word == "vt":
                uvs.append(rest.split()[:2])
            elif word == "f":
                polygon = [corner(w) for w in rest.split()]
                for k in range(1, len(polygon) - 1):
                    triangles.append((polygon[0], polygon[k], polygon[k + 1]))
                    face_material.append(current)
            elif word == "usemtl":
                current = names.setdefault(rest.strip(), len(names))
            elif word == "mtllib":
                libraries.append(rest.strip())
        corners = np.array(triangles, np.int64).reshape(-1, 3, 2)
        vertex_array = np.array(vertices, np.float64).reshape(-1, 3)
        uv_array = np.array(uvs, np.float64).reshape(-1, 2)
    except ValueError as error:
        raise DataError(where, f"{error}", "a Wavefront OBJ file") from error
    if len(corners) == 0 or corners[..., 0].max() >= len(vertex_array) or corners[..., 1].max() >= len(uv_array):
        raise DataError(where, "no faces, or faces of vertices that are not there", "a Wavefront OBJ file")
    return vertex_array, uv_array, corners, np.array(face_material, np.int64), list(names), libraries


def _read_mtl(archive: zipfile.ZipFile, path: str, texture_size: int) -> dict[str, tuple[Material, float]]:
    """Materials by name with their opacity; a missing file has none."""
    if path not in archive.namelist():
        return {}
    blocks: dict[str, dict[str, str]] = {}
    block: dict[str, str] = {}
    for line in archive.read(path).decode("latin-1").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "newmtl":
            block = blocks.setdefault(rest.strip(), {})
        elif word:
            block[word] = rest.strip()
    return {name: _material(archive, path, name, entry, texture_size) for name, entry in blocks.items()}


def _material(
    archive: zipfile.ZipFile, path: str, name: str, entry: dict[str, str], texture_size: int
) -> tuple[Material, float]:
    """A material without light: its texture or its diffuse colour, glass paled because nothing here is transparent."""
    opacity = float(entry["d"].split()[-1]) if "d" in entry else 1.0
    # Some authors left the full path of their own disk in the file; the picture lies beside it.
    picture = entry.get("map_Kd", "").replace("\\", "/").rsplit("/", 1)[-1]
    texture = _texture(archive, _beside(archive, path, picture), texture_size) if picture else None
    colour = np.clip([float(c) for c in entry.get("Kd", "0.8 0.8 0.8").split()[:3]], 0.0, 1.0)
    if texture is not None:
        colour = np.ones(3)
    else:
        # Chrome and the like are nearly black in Kd and live from what they mirror.
        specular = np.clip([float(c) for c in entry.get("Ks", "0 0 0").split()[:3]], 0.0, 1.0)
        colour = np.clip(colour + 0.12 * specular * (float(entry.get("Ns", "0").split()[0]) > 60.0), 0.03, 0.97)
        colour = opacity * colour + (1.0 - opacity) * GLASS
    return Material(name, colour.astype(np.float32), texture), opacity


def _beside(archive: zipfile.ZipFile, path: str, picture: str) -> str:
    """Where a picture lies that an MTL file names: beside it, under its name or as the only picture of the folder."""
    folder = posixpath.dirname(path)
    named = posixpath.join(folder, picture)
    files = archive.namelist()
    others = [f for f in files if posixpath.dirname(f) == folder and f.lower().endswith((".jpg", ".jpeg", ".png"))]
    return others[0] if named not in files and len(others) == 1 else named


def _texture(archive: zipfile.ZipFile, path: str, size: int) -> npt.NDArray[np.uint8] | None:
    """A picture of the archive, (h, w, 3) uint8; see-through pixels take the mean colour of the others."""
    try:
        data = archive.read(posixpath.normpath(path))
    except KeyError:
        return None
    with Image.open(io.BytesIO(data)) as image:
        rgba = image.convert("RGBA")
    if max(rgba.size) > size:
        scale = size / max(rgba.size)
        shape = (max(1, round(rgba.width * scale)), max(1, round(rgba.height * scale)))
        rgba = rgba.resize(shape, Image.Resampling.BOX)
    pixels = np.asarray(rgba, np.float64)
    alpha = pixels[..., 3:] / 255.0
    mean = (pixels[..., :3] * alpha).sum((0, 1)) / max(alpha.sum(), 1e-9)
    return np.asarray(np.round(pixels[..., :3] * alpha + mean * (1.0 - alpha)), np.uint8)
