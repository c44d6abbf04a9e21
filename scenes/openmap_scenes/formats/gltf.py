"""glTF 2.0 documents (.glb and .gltf): the JSON checked against the bytes that it announces, accessors as arrays.

Nothing is taken on trust: every range of bytes lies within its buffer before an array is made of it, so that no announced
count allocates memory, and the bytes themselves stay memory-mapped until they are wanted.
Format: Khronos glTF 2.0 specification, sections 3.6 (buffers, accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import os
import struct
import urllib.parse
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.checked_json import LARGEST_TEXT, Value, parse_json, read_json
from openmap_scenes.formats.images import EncodedImage, basis_error

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
# What a file may require: handled, or without a say in geometry and base colours.
KNOWN_EXTENSIONS = frozenset(
    {"KHR_mesh_quantization", "KHR_texture_transform", "EXT_texture_webp", "KHR_lights_punctual", "KHR_xmp_json_ld"}
)
COMPRESSED = {
    "KHR_draco_mesh_compression": "Draco compressed geometry",
    "EXT_meshopt_compression": "meshopt compressed geometry",
    "KHR_meshopt_compression": "meshopt compressed geometry",
}
UNPACK = "Write it without compression, for instance with 'gltf-transform copy' or a modelling tool."
AGAIN = "Fetch it again."
Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Document:
    """A glTF document; ``buffers`` are memory-mapped where they are files, ``files`` are all that were opened."""

    path: Path
    top: Value
    buffers: list[Bytes]
    files: list[Path] = field(default_factory=list)

    @cached_property
    def views(self) -> list[Value]:
        return self.top["bufferViews"].items()

    @cached_property
    def accessors(self) -> list[Value]:
        return self.top["accessors"].items()

    @cached_property
    def images(self) -> list[Value]:
        return self.top["images"].items()

    def view(self, index: int) -> Bytes:
        """The bytes of a buffer view."""
        entry = self.views[index]
        buffer = self.buffers[entry["buffer"].pick(self.buffers, "buffers")]
        start = entry["byteOffset"].integer(0, 2**40, 0)
        length = entry["byteLength"].integer(1, 2**40)
        if start + length > len(buffer):
            entry.fail(f"bytes within its buffer of {len(buffer)} bytes", AGAIN, f"bytes {start}..{start + length}")
        return buffer[start : start + length]

    def accessor(self, reference: Value, kinds: tuple[str, ...]) -> npt.NDArray[np.generic]:
        """The numbers of an accessor as (count, width), (count,) for scalars, in the file's type: a view of its bytes.

        ``kinds`` are the accessor types that are allowed here ("VEC3").
        """
        entry = self.accessors[reference.pick(self.accessors, "accessors")]
        kind = entry["type"].text()
        if kind not in kinds:
            entry["type"].fail(" or ".join(kinds))
        component = entry["componentType"].integer()
        if component not in COMPONENTS:
            entry["componentType"].fail(f"one of {sorted(COMPONENTS)}")
        if entry["sparse"].exists:
            entry["sparse"].fail(
                "an accessor that lists all its values", "Write it without sparse accessors.", "sparse"
            )
        dtype, width = np.dtype(COMPONENTS[component]), WIDTHS[kind]
        count = entry["count"].integer(1)
        view_index = entry["bufferView"].pick(self.views, "buffer views")
        data = self.view(view_index)
        offset = entry["byteOffset"].integer(0, 2**40, 0)
        stride = self.views[view_index]["byteStride"].integer(4, 252, dtype.itemsize * width)
        if stride < dtype.itemsize * width:
            self.views[view_index]["byteStride"].fail(f"at least {dtype.itemsize * width} bytes an element")
        end = offset + stride * (count - 1) + dtype.itemsize * width
        if end > len(data):
            found = f"{count} elements, which end at byte {end}"
            entry.fail(f"elements within the {len(data)} bytes of their buffer view", AGAIN, found)
        shape, strides = ((count, width), (stride, dtype.itemsize)) if width > 1 else ((count,), (stride,))
        return np.ndarray(shape, dtype, buffer=data.data, offset=offset, strides=strides)

    def values(self, reference: Value, kinds: tuple[str, ...]) -> npt.NDArray[np.float32]:
        """An accessor as float32: integers that are normalised come as 0..1 or -1..1."""
        raw = self.accessor(reference, kinds)
        entry = self.accessors[reference.integer()]
        if raw.dtype.kind == "f" or entry["normalized"].raw is not True:
            return raw.astype(np.float32)
        scale = float(2 ** (8 * raw.dtype.itemsize - (raw.dtype.kind == "i")) - 1)
        return np.asarray(np.maximum(raw.astype(np.float32) / np.float32(scale), np.float32(-1)), np.float32)

    def image_at(self, number: int) -> EncodedImage:
        """The encoded bytes or the file of an image; the file need not be there."""
        entry = self.images[number]
        if entry["mimeType"].text("") in ("image/ktx2", "image/basis"):
            raise basis_error(self.path)
        name = f"{self.path}, image {number} {entry['name'].text('')!r}"
        if entry["bufferView"].exists:
            index = entry["bufferView"].pick(self.views, "buffer views")
            return EncodedImage(name, self.view(index))
        content = _external(self.path, entry["uri"])
        if isinstance(content, Path) and content.suffix.lower() in (".ktx2", ".basis"):
            raise basis_error(self.path)
        return EncodedImage(str(content) if isinstance(content, Path) else name, content)


def read_document(path: Path) -> Document:
    """Open and check a .glb or .gltf file.

    Raises
    ------
    DataError
        Not glTF 2, truncated, broken JSON, a buffer that is missing or too short, or an extension without which it cannot be read.
    """
    if path.suffix.lower() == ".gltf":
        top, chunk = read_json(path, "a glTF file"), None
    else:
        top, chunk = _open_glb(path)
    if top["asset"]["version"].text("").split(".")[0] != "2":
        top["asset"]["version"].fail("version 2.0")
    _check_extensions(path, top)
    buffers: list[Bytes] = []
    files = [path]
    for number, entry in enumerate(top["buffers"].items()):
        length = entry["byteLength"].integer(1, 2**40)
        if entry["uri"].exists:
            content = _external(path, entry["uri"])
            if isinstance(content, Path):
                files.append(content)
                content = _mapped(content)
        elif number == 0 and chunk is not None:
            content = chunk
        else:
            entry.fail("a buffer with a uri, or the GLB's binary chunk", UNPACK, "no bytes")
        if len(content) < length:
            entry.fail(f"the {length} bytes that it declares", AGAIN, f"a buffer of {len(content)} bytes")
        buffers.append(content[:length])
    return Document(path, top, buffers, files)


def _open_glb(path: Path) -> tuple[Value, Bytes | None]:
    """The JSON and the binary chunk of a GLB."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(20)
        if len(header) < 20 or header[:4] != b"glTF":
            raise DataError(
                path, f"{size} bytes that start with {header[:4]!r}", "a GLB file, which starts with b'glTF'"
            )
        version, length, json_length, json_type = struct.unpack("<IIII", header[4:20])
        if version != 2:
            raise DataError(path, f"glTF version {version}", "version 2")
        if length > size:
            found = f"a truncated file of {size} bytes"
            raise DataError(path, found, f"the {length} bytes that its header declares", AGAIN)
        if json_type != 0x4E4F534A or json_length > min(length - 20, LARGEST_TEXT):
            raise DataError(path, "a first chunk that is not JSON or does not fit", "glTF's JSON chunk", AGAIN)
        top = parse_json(file.read(json_length), path)
        start = 20 + json_length
        header = file.read(8)
    if length < start + 8:
        return top, None
    chunk_length, chunk_type = struct.unpack("<II", header)
    if chunk_type != 0x004E4942 or start + 8 + chunk_length > length:
        raise DataError(path, "a second chunk that is not binary or does not fit", "glTF's BIN chunk", AGAIN)
    return top, _mapped(path)[start + 8 : start + 8 + chunk_length]


def _check_extensions(path: Path, top: Value) -> None:
    required = [entry.text() for entry in top["extensionsRequired"].items()]
    if "KHR_texture_basisu" in required:
        raise basis_error(path)
    for name in required:
        if name in COMPRESSED:
            raise DataError(path, f"{COMPRESSED[name]} ({name})", "plain geometry", UNPACK)
        if name not in KNOWN_EXTENSIONS and not name.startswith("KHR_materials_"):
            raise DataError(
                path, f"a required extension {name[:60]!r}", "plain glTF 2.0", "Write it without the extension."
            )


def _mapped(path: Path) -> Bytes:
    if not path.is_file():
        raise DataError(path, "no such file", "a file that the glTF document names")
    if not path.stat().st_size:
        raise DataError(path, "an empty file", "the bytes of a glTF buffer", AGAIN)
    return np.memmap(path, np.uint8, mode="r")


def _external(path: Path, uri: Value) -> Path | Bytes:
    """What a URI names: the bytes within it, or a file inside the document's folder."""
    text = uri.text()
    if text.startswith("data:"):
        head, comma, body = text.partition(",")
        if not comma or not head.endswith(";base64"):
            uri.fail("a base64 data URI", found=repr(head[:40]))
        try:
            return np.frombuffer(base64.b64decode(body, validate=True), np.uint8)
        except binascii.Error as error:
            uri.fail("a base64 data URI", AGAIN, str(error))
    inside = inner_path(path.parent, urllib.parse.unquote(text))
    if inside is None:
        uri.fail(f"a file inside {path.parent}", "Put the files of a model into one folder.")
    return inside


def inner_path(folder: Path, name: str) -> Path | None:
    """The file of that relative name inside the folder; None for a name that leads out of it, web addresses too."""
    name = os.path.normpath(name.replace("\\", "/")) if name else ""
    # normpath makes one slash of the two behind a web address's colon.
    if not name or "\0" in name or ":" in name.split("/")[0] or name.startswith(("/", "..")) or len(name) > 1024:
        return None
    return folder / name
