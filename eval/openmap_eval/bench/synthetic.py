"""A big textured home by seed, written as one GLB: the size of a scan, without its licence.

Rooms stand in a row of rows; each has a floor, a ceiling, walls and two pieces of furniture, each of them one primitive with a
material and a texture of its own. Surfaces are as uneven as scanned ones, and textures as noisy, so that they compress alike.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

ROOM, HEIGHT = 5.0, 2.7
PARTS = ("floor", "ceiling", "walls", "sofa", "table")
JPEG_QUALITY = 90


@dataclass(frozen=True)
class Part:
    """One primitive: vertices (V, 3) float32 m, Y up; uv (V, 2) float32; faces (F, 3) uint32."""

    vertices: npt.NDArray[np.float32]
    uv: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]


def write_glb(path: Path, faces: int, textures: int, texture_size: int, image: str, seed: int) -> None:
    """Write a home of exactly ``faces`` triangles and ``textures`` square textures; same arguments, same geometry.

    Parameters
    ----------
    path : Path
    faces : int
        At least 8 for each texture.
    textures : int
        At least 1.
    texture_size : int
        Side of a texture, px.
    image : "jpeg" or "png"
    seed : int
    """
    if textures < 1 or faces < 8 * textures or texture_size < 8 or image not in ("jpeg", "png"):
        found = f"{faces} faces, {textures} textures of {texture_size} px as {image}"
        raise ValueError(f"{found}; expected 8 faces a texture or more, textures of 8 px or more, as jpeg or png")
    share = np.diff(np.linspace(0, faces, textures + 1).astype(int)).tolist()
    rng = np.random.default_rng(seed)
    chunks, document = _Chunks(), _empty_document()
    for number, count in enumerate(share):
        part = make_part(PARTS[number % len(PARTS)], number // len(PARTS), textures // len(PARTS) + 1, count, rng)
        _add_part(document, chunks, part, number)
        _add_texture(document, chunks, make_texture(texture_size, image, rng), f"image/{image}", number)
    document["buffers"] = [{"byteLength": chunks.size}]
    document["bufferViews"] = chunks.views
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with path.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + chunks.size))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", chunks.size, 0x004E4942))
        for data in chunks.data:
            file.write(data)


def make_part(kind: str, room: int, rooms: int, faces: int, rng: np.random.Generator) -> Part:
    """One part of a room with exactly ``faces`` triangles, at the room's place among ``rooms``."""
    side = int(np.ceil(np.sqrt(rooms)))
    offset = np.array([room % side * (ROOM + 0.2), 0.0, room // side * (ROOM + 0.2)])
    patches = {"walls": _WALLS}.get(kind, [_SURFACES[kind]] if kind in _SURFACES else [])
    pieces = []
    for surface, count in zip(patches, np.diff(np.linspace(0, faces, len(patches) + 1).astype(int)), strict=True):
        n = int(np.ceil(np.sqrt(count / 2)))
        s, t = (a.reshape(-1) for a in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
        vertices = surface(s, t) + rng.normal(0.0, 0.003, (len(s), 3)) + offset
        corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
        quads = np.stack([corner, corner + 1, corner + n + 2, corner, corner + n + 2, corner + n + 1], 1)
        pieces.append((vertices, np.stack([s, t], 1), quads.reshape(-1, 3)[:count]))
    starts = np.cumsum([0] + [len(v) for v, _, _ in pieces[:-1]])
    return Part(
        np.concatenate([v for v, _, _ in pieces]).astype(np.float32),
        np.concatenate([uv for _, uv, _ in pieces]).astype(np.float32),
        np.concatenate([f + start for (_, _, f), start in zip(pieces, starts, strict=True)]).astype(np.uint32),
    )


Grid = npt.NDArray[np.float64]


def _plane(x: Callable[[Grid, Grid], Any], y: Callable[[Grid, Grid], Any], z: Callable[[Grid, Grid], Any]) -> Any:
    return lambda s, t: np.stack([np.broadcast_to(f(s, t), s.shape) for f in (x, y, z)], 1)


def _blob(x: float, z: float, size: tuple[float, float, float]) -> Any:
    """A rounded box that stands at (x, z) m of the room."""

    def surface(s: Grid, t: Grid) -> Grid:
        around, up = -2 * np.pi * s, np.pi * (t - 0.5)
        unit = np.stack([np.cos(up) * np.cos(around), np.sin(up), np.cos(up) * np.sin(around)], 1)
        rounded = np.sign(unit) * np.abs(unit) ** 0.5
        return np.asarray(rounded * np.array(size) / 2 + [x, size[1] / 2, z])

    return surface


_SURFACES: dict[str, Any] = {
    "floor": _plane(lambda s, t: s * ROOM, lambda s, t: 0.0 * s, lambda s, t: (1 - t) * ROOM),
    "ceiling": _plane(lambda s, t: s * ROOM, lambda s, t: HEIGHT + 0.0 * s, lambda s, t: t * ROOM),
    "sofa": _blob(1.5, 0.8, (2.0, 0.8, 0.9)),
    "table": _blob(3.4, 3.2, (1.4, 0.7, 0.9)),
}
_WALLS = [
    _plane(lambda s, t: s * ROOM, lambda s, t: t * HEIGHT, lambda s, t: 0.0 * s),
    _plane(lambda s, t: (1 - s) * ROOM, lambda s, t: t * HEIGHT, lambda s, t: ROOM + 0.0 * s),
    _plane(lambda s, t: 0.0 * s, lambda s, t: t * HEIGHT, lambda s, t: (1 - s) * ROOM),
    _plane(lambda s, t: ROOM + 0.0 * s, lambda s, t: t * HEIGHT, lambda s, t: s * ROOM),
]


def make_texture(size: int, image: str, rng: np.random.Generator) -> bytes:
    """A picture (size, size) with large soft shapes and a camera's grain, encoded."""
    soft = Image.fromarray(rng.integers(40, 230, (size // 64 + 2, size // 64 + 2, 3), np.uint8))
    picture = np.asarray(soft.resize((size, size), Image.Resampling.BICUBIC), np.int16)
    grain = rng.integers(-6, 7, (size, size, 1), np.int8)
    shot = Image.fromarray(np.clip(picture + grain, 0, 255).astype(np.uint8))
    buffer = io.BytesIO()
    shot.save(buffer, "JPEG", quality=JPEG_QUALITY) if image == "jpeg" else shot.save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()


class _Chunks:
    """The binary chunk as it grows: pieces aligned to 4 bytes, and a buffer view for each."""

    def __init__(self) -> None:
        self.data: list[bytes] = []
        self.views: list[dict[str, int]] = []
        self.size = 0

    def add(self, data: bytes) -> int:
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(data)})
        self.data.append(data + bytes(-len(data) % 4))
        self.size += len(self.data[-1])
        return len(self.views) - 1


def _empty_document() -> dict[str, Any]:
    lists = ("nodes", "meshes", "materials", "textures", "images", "accessors")
    return {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]} | {name: [] for name in lists}


def _add_part(document: dict[str, Any], chunks: _Chunks, part: Part, number: int) -> None:
    first = len(document["accessors"])
    extent = {"min": part.vertices.min(0).tolist(), "max": part.vertices.max(0).tolist()}
    arrays: tuple[tuple[npt.NDArray[Any], int, str, dict[str, Any]], ...] = (
        (part.vertices, 5126, "VEC3", extent),
        (part.uv, 5126, "VEC2", {}),
        (part.faces.reshape(-1), 5125, "SCALAR", {}),
    )
    for array, component, kind, more in arrays:
        view = chunks.add(array.tobytes())
        accessor = {"bufferView": view, "componentType": component, "count": len(array), "type": kind}
        document["accessors"].append(accessor | more)
    attributes = {"POSITION": first, "TEXCOORD_0": first + 1}
    primitive = {"attributes": attributes, "indices": first + 2, "material": number}
    document["meshes"].append({"name": f"part{number}", "primitives": [primitive]})
    document["nodes"].append({"name": f"part{number}", "mesh": number})
    document["scenes"][0]["nodes"].append(number)


def _add_texture(document: dict[str, Any], chunks: _Chunks, data: bytes, mime: str, number: int) -> None:
    document["images"].append({"bufferView": chunks.add(data), "mimeType": mime})
    document["textures"].append({"source": number})
    look = {"baseColorTexture": {"index": number}, "metallicFactor": 0.0}
    document["materials"].append({"name": f"material{number}", "pbrMetallicRoughness": look})
