"""Wavefront OBJ with its MTL -> one textured mesh, faces in the file's order, polygons as fans of triangles.

Lines of one kind are read as one array, since scans have millions; a file whose faces differ in form is read line by line.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.gltf import inner_path
from openmap_scenes.formats.images import EncodedImage, decode_images
from openmap_scenes.formats.mesh import Part, TexturedMesh, check_mesh, moved
from openmap_scenes.scene import Material

# Options of a texture statement: those followed by one word, and those by up to so many numbers.
WORD_OPTIONS = {"-blendu", "-blendv", "-cc", "-clamp", "-bm", "-boost", "-texres", "-imfchan", "-type"}
NUMBER_OPTIONS = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class ObjMaterial:
    """``texture`` is the file of its colours, None where it has none; ``named`` is what the MTL calls it."""

    colour: tuple[float, float, float]
    texture: Path | None
    named: str


@dataclass(frozen=True)
class _Line:
    """A statement that changes how the faces after it look or are called; ``at`` is how many face lines precede it."""

    at: int
    word: str
    rest: str


def read_obj(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    """Every triangle of an OBJ file, brought to the world frame by ``T_world_file`` (4, 4).

    A texture that is not there leaves its material in plain colour and is named in ``Material.missing_texture``.

    Raises
    ------
    DataError
        A line that does not parse, a face of vertices that the file does not have, an image that cannot be decoded.
    """
    try:
        return _read_obj(path, T_world_file)
    except (ValueError, OverflowError, IndexError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(path, f"lines that do not parse ({error})", "an intact OBJ file", "Fetch it again.") from error


def files_obj(path: Path) -> list[Path]:
    """The OBJ, its material libraries and those of their textures that are there."""
    libraries = [line.rest for line in _split(path.read_bytes())[3] if line.word == "mtllib"]
    present = [library for library in (inner_path(path.parent, name) for name in libraries) if library is not None]
    present = [library for library in present if library.is_file()]
    textures = [m.texture for library in present for m in read_mtl(library).values() if m.texture is not None]
    return list(dict.fromkeys([path, *present, *textures]))


def _read_obj(path: Path, T_world_file: npt.NDArray[np.float64]) -> TexturedMesh:
    positions, texcoords, face_lines, statements, before = _split(path.read_bytes())
    v = _table(path, positions, "v", (3, 4, 6, 7))
    vt = _table(path, texcoords, "vt", (1, 2, 3))
    corners, line_of_face = _faces(path, face_lines, before, len(v), len(vt))
    if not len(corners):
        raise DataError(path, "no triangles", "a triangle mesh")
    vertices, uv, colour, faces = _welded(v, vt, corners)
    face_material, materials = _materials(path, statements, line_of_face)
    mesh = TexturedMesh(
        moved(vertices, T_world_file), faces, face_material, materials, uv, colour, _parts(statements, line_of_face)
    )
    return check_mesh(mesh, path)


def _split(data: bytes) -> tuple[list[bytes], list[bytes], list[bytes], list[_Line], list[tuple[int, int]]]:
    """Lines of positions, of texture coordinates and of faces; other statements; and for each face the (v, vt) count before it."""
    positions: list[bytes] = []
    texcoords: list[bytes] = []
    faces: list[bytes] = []
    before: list[tuple[int, int]] = []
    statements: list[_Line] = []
    for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        head, _, rest = line.lstrip().partition(b" ")
        if head == b"v":
            positions.append(rest)
        elif head == b"vt":
            texcoords.append(rest)
        elif head == b"f":
            faces.append(rest)
            before.append((len(positions), len(texcoords)))
        elif head in (b"usemtl", b"mtllib", b"o", b"g"):
            statements.append(_Line(len(faces), head.decode(), rest.decode("utf-8", "replace").strip()))
    return positions, texcoords, faces, statements, before


def _table(path: Path, lines: list[bytes], word: str, widths: tuple[int, ...]) -> npt.NDArray[np.float32]:
    """The numbers of lines as (N, width) float32; all lines have the width of the first."""
    if not lines:
        return np.zeros((0, widths[0]), np.float32)
    width = len(lines[0].split())
    if width not in widths:
        raise DataError(path, f"'{word} {lines[0][:40].decode('utf-8', 'replace')}'", f"{widths} numbers after {word}")
    tokens = b" ".join(lines).split()
    if len(tokens) != width * len(lines):
        raise DataError(path, f"{word} lines of different lengths", f"{width} numbers in each, as in the first")
    with np.errstate(over="ignore"):
        return np.fromiter(map(float, tokens), np.float64, len(tokens)).astype(np.float32).reshape(-1, width)


def _faces(
    path: Path, lines: list[bytes], before: list[tuple[int, int]], n_v: int, n_vt: int
) -> tuple[Integers, Integers]:
    """Corners (F, 3, 2) as indices (position, texture coordinate or -1) and the face line (F,) that each triangle is of."""
    forms = {(len(line.split()), line.count(b"/"), b"//" in line) for line in lines}
    if len(forms) == 1:
        (n_corners, slashes, is_empty) = forms.pop()
        if n_corners >= 3 and slashes in (0, n_corners, 2 * n_corners):
            polygons = _uniform(lines, n_corners, slashes, is_empty)
            return _fans(path, polygons, np.arange(len(lines)), np.array(before, np.int64), n_v, n_vt)
    by_size: dict[int, tuple[list[list[tuple[int, int]]], list[int]]] = {}
    for number, line in enumerate(lines):
        polygon = [_corner(path, token) for token in line.split()]
        if len(polygon) < 3:
            raise DataError(path, f"face 'f {line[:40].decode('utf-8', 'replace')}'", "three corners or more")
        group = by_size.setdefault(len(polygon), ([], []))
        group[0].append(polygon)
        group[1].append(number)
    counts = np.array(before, np.int64).reshape(-1, 2)
    parts = [
        _fans(path, np.array(polygons, np.int64), np.array(numbers), counts, n_v, n_vt)
        for polygons, numbers in by_size.values()
    ]
    corners = np.concatenate([p[0] for p in parts]) if parts else np.zeros((0, 3, 2), np.int64)
    owner = np.concatenate([p[1] for p in parts]) if parts else np.zeros(0, np.int64)
    order = np.argsort(owner, kind="stable")
    return corners[order], owner[order]


def _uniform(lines: list[bytes], n_corners: int, slashes: int, is_empty: bool) -> Integers:
    """Corners (N, n_corners, 2) of lines of one form; 0 stands for no texture coordinate."""
    text = b" ".join(lines)
    fields = 1 if slashes == 0 else 2 if slashes == n_corners or is_empty else 3
    tokens = text.replace(b"/", b" ").split()
    if len(tokens) != len(lines) * n_corners * fields:
        raise ValueError("a face with an empty field")
    numbers = np.fromiter(map(int, tokens), np.int64, len(tokens)).reshape(-1, n_corners, fields)
    result = np.zeros((len(lines), n_corners, 2), np.int64)
    result[:, :, 0] = numbers[:, :, 0]
    if fields > 1 and not is_empty:
        result[:, :, 1] = numbers[:, :, 1]
    return result


def _corner(path: Path, token: bytes) -> tuple[int, int]:
    fields = token.split(b"/")
    try:
        return int(fields[0]), int(fields[1]) if len(fields) > 1 and fields[1] else 0
    except ValueError as error:
        raise DataError(path, f"face corner {token[:40]!r}", "v, v/vt, v//vn or v/vt/vn") from error


def _fans(
    path: Path, polygons: Integers, numbers: Integers, before: Integers, n_v: int, n_vt: int
) -> tuple[Integers, Integers]:
    """Triangles (F, 3, 2) of polygons (N, k, 2) of face lines ``numbers`` (N,), with indices from 0 and -1 for none."""
    # A negative index counts back from the last one before the line.
    resolved = np.where(polygons < 0, polygons + before[numbers][:, None, :], polygons - 1)
    for column, count, what in ((0, n_v, "v"), (1, n_vt, "vt")):
        low = 0 if column == 0 else -1
        wrong = (resolved[:, :, column] < low) | (resolved[:, :, column] >= count)
        wrong |= (polygons[:, :, column] < 0) & (resolved[:, :, column] < 0)
        if wrong.any():
            first = int(polygons[:, :, column][wrong][0])
            raise DataError(path, f"a face with {what} index {first}", f"1..{count}, as the file has {what} lines")
    k = polygons.shape[1]
    triangles = np.stack(
        [np.broadcast_to(resolved[:, :1], (len(polygons), k - 2, 2)), resolved[:, 1:-1], resolved[:, 2:]], 2
    )
    return triangles.reshape(-1, 3, 2), np.repeat(numbers, k - 2)


def _welded(
    v: npt.NDArray[np.float32], vt: npt.NDArray[np.float32], corners: Integers
) -> tuple[
    npt.NDArray[np.float32], npt.NDArray[np.float32] | None, npt.NDArray[np.uint8] | None, npt.NDArray[np.int32]
]:
    """Vertices, uv, colours and faces: one vertex for each pair of position and texture coordinate that occurs."""
    position, texcoord = corners[..., 0], corners[..., 1]
    uv = None
    if (texcoord >= 0).any():
        pairs, inverse = np.unique(position * (len(vt) + 1) + texcoord + 1, return_inverse=True)
        used, used_uv = pairs // (len(vt) + 1), pairs % (len(vt) + 1) - 1
        table = np.zeros((len(vt) + 1, 2), np.float32)
        table[:-1, 0] = vt[:, 0]
        # The file counts v from the bottom, a Scene from the top; the last row is that of corners without any.
        table[:-1, 1] = 1.0 - vt[:, 1] if vt.shape[1] > 1 else 1.0
        uv, faces = table[used_uv], inverse.reshape(position.shape).astype(np.int32)
    else:
        used, faces = np.arange(len(v)), position.astype(np.int32)
    vertices = np.ascontiguousarray(v[used, :3])
    colour = None
    if v.shape[1] >= 6:
        channels = np.nan_to_num(v[used, 3:6], nan=1.0)
        colour = np.rint(np.clip(channels, 0, 1) * 255).astype(np.uint8)
    return vertices, uv, colour, faces


def _materials(
    path: Path, statements: list[_Line], line_of_face: Integers
) -> tuple[npt.NDArray[np.int32], list[Material]]:
    """Index of the material of each triangle (F,) and the materials in the order of their first use."""
    table: dict[str, ObjMaterial] = {}
    missing_library = ""
    for line in statements:
        if line.word == "mtllib":
            library = inner_path(path.parent, line.rest)
            if library is not None and library.is_file():
                table |= read_mtl(library)
            else:
                missing_library = line.rest
    uses = [(line.at, line.rest) for line in statements if line.word == "usemtl"]
    starts = np.array([0] + [at for at, _ in uses], np.int64)
    names = ["", *[name for _, name in uses]]
    run = np.searchsorted(starts, line_of_face, side="right") - 1
    used = [names[r] for r in np.unique(run)]
    order = {name: n for n, name in enumerate(dict.fromkeys(used))}
    number = np.array([order.get(name, 0) for name in names], np.int32)
    sources = [table.get(name, ObjMaterial((1.0, 1.0, 1.0), None, missing_library if name else "")) for name in order]
    files = list(dict.fromkeys(s.texture for s in sources if s.texture is not None))
    images = dict(zip(files, decode_images([EncodedImage(str(f), f) for f in files]), strict=True))
    materials = []
    for name, source in zip(order, sources, strict=True):
        texture = images[source.texture] if source.texture is not None else None
        colour = (1.0, 1.0, 1.0) if texture is not None else source.colour
        missed = source.named if texture is None else ""
        materials.append(Material(name or "default", np.array(colour, np.float32), texture, missed))
    return number[run], materials


def _parts(statements: list[_Line], line_of_face: Integers) -> tuple[Part, ...]:
    """Runs of triangles of one object and group."""
    changes, name_o, name_g = [(0, "", "")], "", ""
    for line in statements:
        if line.word in ("o", "g"):
            name_o, name_g = (line.rest, name_g) if line.word == "o" else (name_o, line.rest)
            changes.append((line.at, name_o, name_g))
    ends = np.searchsorted(line_of_face, [at for at, _, _ in changes[1:]] + [2**62])
    starts = np.concatenate([[0], ends[:-1]])
    return tuple(
        Part(o or g, g or o, int(end - start))
        for (_, o, g), start, end in zip(changes, starts, ends, strict=True)
        if end > start
    )


def read_mtl(path: Path) -> dict[str, ObjMaterial]:
    """The materials of an MTL file by name: diffuse colour (as sRGB display values) and texture.

    A texture that lies elsewhere (an absolute path of another machine) is looked for beside the file, by its name alone.
    """
    materials: dict[str, ObjMaterial] = {}
    name: str | None = None
    for number, line in enumerate(path.read_text("utf-8", "replace").splitlines(), 1):
        words = line.split()
        if not words:
            continue
        if words[0] == "newmtl":
            name = line.strip()[6:].strip()
            materials[name] = ObjMaterial((1.0, 1.0, 1.0), None, "")
        elif name is not None and words[0] == "Kd":
            materials[name] = ObjMaterial(
                _colour(path, number, words[1:]), materials[name].texture, materials[name].named
            )
        elif name is not None and words[0].lower() == "map_kd":
            named = _texture_name(line.strip()[6:].split())
            materials[name] = ObjMaterial(materials[name].colour, _texture_file(path.parent, named), named)
    return materials


def _colour(path: Path, number: int, words: list[str]) -> tuple[float, float, float]:
    try:
        r, g, b = (float(word) for word in (words[:3] if len(words) >= 3 else words[:1] * 3))
    except ValueError as error:
        raise DataError(f"{path}, line {number}", f"Kd {' '.join(words)[:40]}", "three numbers in 0..1") from error
    if not all(0.0 <= x <= 1e6 for x in (r, g, b)):
        raise DataError(f"{path}, line {number}", f"Kd {' '.join(words)[:40]}", "three numbers in 0..1")
    return min(r, 1.0), min(g, 1.0), min(b, 1.0)


def _texture_name(words: list[str]) -> str:
    """A texture statement without its options; names may hold blanks."""
    while words and (words[0] in WORD_OPTIONS or words[0] in NUMBER_OPTIONS):
        count = NUMBER_OPTIONS.get(words[0], 0)
        words = words[1:] if count else words[2:]
        while words and count and _is_number(words[0]):
            words, count = words[1:], count - 1
    return " ".join(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _texture_file(folder: Path, named: str) -> Path | None:
    for candidate in (named, named.replace("\\", "/").rsplit("/", 1)[-1]):
        file = inner_path(folder, candidate)
        if file is not None and file.is_file():
            return file
    return None
