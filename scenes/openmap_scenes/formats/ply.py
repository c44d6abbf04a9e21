"""Polygon files (PLY): triangles with their colours and properties, from ASCII or binary of either byte order.

The header is held against the file's size before anything is allocated, because a header may announce any number of rows.
Rows of one length are read as one array; rows of different lengths (triangles and quads in one file) by a compiled loop.
plyfile reads the latter row by row in Python, which takes minutes for a scan of millions of faces.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.ply_header import MEND, Element, Property, check_size, open_ply
from openmap_scenes.formats.transfer import check_coordinates

# A polygon with more corners is left to the loop.
LONGEST = 1 << 16
INDEX_NAMES = ("vertex_indices", "vertex_index")
KEPT = ("x", "y", "z", "red", "green", "blue")

Numbers = npt.NDArray[Any]


@dataclass(frozen=True)
class PlyMesh:
    """The triangles of a PLY file with V vertices and F triangles, in the file's own frame.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int32
        A polygon a, b, c, d, ... becomes the triangles a b c, a c d, ..., which lie side by side and face the same way.
    polygon : (F,) int32
        Row of the face element that a triangle came from.
    vertex_colour : (V, 3) uint8 or None
        Red, green, blue; transparency is left out, since scans use it for nothing.
    vertex_properties : dict of str to (V,) array
        The properties that were asked for, in the file's type.
    face_properties : dict of str to (F,) array
        The same for faces; all triangles of a polygon have its value.
    """

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int32]
    polygon: npt.NDArray[np.int32]
    vertex_colour: npt.NDArray[np.uint8] | None
    vertex_properties: dict[str, Numbers]
    face_properties: dict[str, Numbers]


@dataclass(frozen=True)
class _Columns:
    """What was read of one element of R rows: numbers (R,), lists as lengths (R,) and all items one after another, the end."""

    single: dict[str, Numbers]
    lists: dict[str, tuple[npt.NDArray[np.int64], Numbers]]
    end: int


def read_ply(
    path: str | Path, *, vertex_properties: Sequence[str] = (), face_properties: Sequence[str] = ()
) -> PlyMesh:
    """Read the triangles of a PLY file.

    Parameters
    ----------
    path : str or Path
    vertex_properties, face_properties : sequence of str
        Which further properties to read, single numbers only; the file must have them.

    Raises
    ------
    DataError
        The file is missing, cut short, longer than its header says, not a PLY file with vertices and faces, lacks a property, has
        coordinates that are not finite or absurdly far out, or faces that name vertices it does not have.
    """
    path = Path(path)
    data, order, elements, at = open_ply(path)
    check_size(path, elements, len(data) - at, ascii_text=not order)
    unit = 1
    if not order:
        data, elements, at, unit = _numbers(path, data[at:]), _as_numbers(elements), 0, 8
    columns = {}
    wanted = {"vertex": vertex_properties, "face": face_properties}
    for element in elements:
        columns[element.name] = _read_element(path, data, at, unit, element, (*wanted.get(element.name, ()), *KEPT))
        at = columns[element.name].end
    if data[at:].tobytes().strip():
        found = f"{(len(data) - at) // unit} {'bytes' if order else 'numbers'} after the last row"
        raise DataError(path, found, "only the rows that its header announces", MEND)
    return _mesh(path, columns["vertex"], columns["face"], wanted)


def _numbers(path: Path, text: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """All numbers of an ASCII body, as the bytes of float64, which holds every 32-bit integer exactly."""
    body = text.tobytes().strip()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.fromstring(body.decode("ascii"), np.float64, sep=" ") if body else np.zeros(0)
    except (ValueError, DeprecationWarning) as error:
        raise DataError(path, f"rows that are not all numbers ({error})", "numbers and blanks", MEND) from error
    return np.ascontiguousarray(numbers, np.float64).view(np.uint8)


def _as_numbers(elements: list[Element]) -> list[Element]:
    """The same elements as ``_numbers`` gives them: everything, a list's length too, is a float64."""
    f8 = np.dtype(np.float64)
    return [
        replace(e, properties=tuple(replace(p, dtype=f8, count=f8 if p.count else None) for p in e.properties))
        for e in elements
    ]


def _read_element(
    path: Path, data: npt.NDArray[np.uint8], at: int, unit: int, element: Element, wanted: Sequence[str]
) -> _Columns:
    """Read one element whose rows begin at byte ``at``; single numbers only where ``wanted``, lists of vertex indices always."""
    keep = [p for p in element.properties if p.name in (INDEX_NAMES if p.count else wanted)]
    uniform = _uniform_rows(data, at, element)
    single: dict[str, Numbers] = {}
    lists: dict[str, tuple[npt.NDArray[np.int64], Numbers]] = {}
    if uniform is not None:
        for p in keep:
            values = uniform[p.name]
            if p.count:
                lists[p.name] = (np.full(element.rows, values.shape[1]), values.ravel())
            else:
                single[p.name] = _cast(path, p, values)
        return _Columns(single, lists, at + uniform.nbytes)
    starts, lengths, end = _walked(path, data, at, unit, element)
    for p in keep:
        i = element.properties.index(p)
        values = _packed(data, starts[:, i], lengths[:, i] * p.dtype.itemsize).view(p.dtype)
        if p.count:
            lists[p.name] = (lengths[:, i].copy(), values)
        else:
            single[p.name] = _cast(path, p, values)
    return _Columns(single, lists, end)


def _uniform_rows(data: npt.NDArray[np.uint8], at: int, element: Element) -> Numbers | None:
    """The rows as one structured array, or None where they differ in length (or are cut short, which ``_walked`` explains)."""
    fields: list[tuple[str, np.dtype[Any]] | tuple[str, np.dtype[Any], tuple[int]]] = []
    first = at
    for i, p in enumerate(element.properties):
        if p.count is None:
            fields.append((p.name, p.dtype))
            first += p.dtype.itemsize
            continue
        if not element.rows or first + p.count.itemsize > len(data):
            return None
        length = np.frombuffer(data, p.count, 1, first)[0]
        # NaN fails this comparison, as a length of ASCII files may be.
        if not 0 <= length <= min(LONGEST, (len(data) - first) // p.dtype.itemsize) or length != int(length):
            return None
        fields += [(f"length {i}", p.count), (p.name, p.dtype, (int(length),))]
        first += p.count.itemsize + int(length) * p.dtype.itemsize
    dtype = np.dtype(fields)
    if element.rows * dtype.itemsize > len(data) - at:
        return None
    rows = np.frombuffer(data, dtype, element.rows, at) if element.rows else np.zeros(0, dtype)
    same = all((rows[f[0]] == rows[f[0]][0]).all() for f in fields if f[0].startswith("length "))
    return rows if same else None


def _walked(
    path: Path, data: npt.NDArray[np.uint8], at: int, unit: int, element: Element
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], int]:
    """Byte at which each property of each row begins (R, P), after a list's length; how many items it has (R, P); the end."""
    shape = (element.rows, len(element.properties))
    starts, lengths = np.zeros(shape, np.int64), np.ones(shape, np.int64)
    sizes = np.array([p.dtype.itemsize // unit for p in element.properties], np.int64)
    counts = np.array([p.count.itemsize // unit if p.count else 0 for p in element.properties], np.int64)
    big = any(p.count is not None and p.count.byteorder == ">" for p in element.properties)
    body = data if unit == 1 else data.view(np.float64)
    end, row = _walk(body, at // unit, sizes, counts, big, starts, lengths)
    if row < element.rows:
        found = f"row {row} of {element.rows} of element {element.name} running past the end of the file"
        raise DataError(path, found, "whole rows and lists of sensible lengths", MEND)
    return starts * unit, lengths, int(end) * unit


@numba.njit(cache=True)
def _walk(
    data: Numbers,
    at: int,
    sizes: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    big: bool,
    starts: npt.NDArray[np.int64],
    lengths: npt.NDArray[np.int64],
) -> tuple[int, int]:
    """Fill starts and lengths row by row; sizes are in items of ``data`` (bytes, or numbers of a text).

    Returns where the last row ends, and how many rows are whole.
    """
    for row in range(starts.shape[0]):
        for i in range(len(sizes)):
            if counts[i]:
                if at + counts[i] > len(data):
                    return at, row
                length = 0.0
                for k in range(counts[i]):
                    length = length * 256.0 + float(data[at + (k if big else counts[i] - 1 - k)])
                at += counts[i]
                if not (0.0 <= length <= len(data) - at) or length != np.floor(length):
                    return at, row
                lengths[row, i] = int(length)
            starts[row, i] = at
            at += lengths[row, i] * sizes[i]
            if at > len(data):
                return at, row
    return at, starts.shape[0]


def _packed(
    data: npt.NDArray[np.uint8], starts: npt.NDArray[np.int64], sizes: npt.NDArray[np.int64]
) -> npt.NDArray[np.uint8]:
    """The stretches of ``data`` from ``starts``, each of its size in bytes, one after another."""
    packed = np.empty(int(sizes.sum()), np.uint8)
    _pack(data, np.ascontiguousarray(starts), np.ascontiguousarray(sizes), packed)
    return packed


@numba.njit(cache=True)
def _pack(
    data: npt.NDArray[np.uint8],
    starts: npt.NDArray[np.int64],
    sizes: npt.NDArray[np.int64],
    packed: npt.NDArray[np.uint8],
) -> None:
    to = 0
    for row in range(len(starts)):
        for k in range(sizes[row]):
            packed[to] = data[starts[row] + k]
            to += 1


def _cast(path: Path, p: Property, values: Numbers) -> Numbers:
    """Values in native byte order and of the declared type, which an ASCII file may break."""
    if p.declared.kind in "iu" and values.dtype.kind == "f":
        _check_whole(path, p.name, values, int(np.iinfo(p.declared).min), int(np.iinfo(p.declared).max))
    with np.errstate(over="ignore"):  # a float beyond float32 becomes infinite, which is refused below
        return values.astype(p.declared.newbyteorder("="))


def _check_whole(path: Path, name: str, values: Numbers, low: int, high: int) -> None:
    """DataError where values are not all whole numbers in low..high."""
    if not len(values):
        return
    bad = ~((values >= low) & (values <= high))
    if values.dtype.kind == "f":
        bad |= np.floor(values) != values
    if bad.any():
        found = f"{int(bad.sum())} values of {name} out of range (first: {values[bad][0]})"
        raise DataError(path, found, f"whole numbers in {low}..{high}", MEND)


def _mesh(path: Path, vertex: _Columns, face: _Columns, wanted: dict[str, Sequence[str]]) -> PlyMesh:
    for name, columns, needed in (
        ("vertex", vertex, ("x", "y", "z", *wanted["vertex"])),
        ("face", face, wanted["face"]),
    ):
        missing = [p for p in needed if p not in columns.single]
        if missing:
            raise DataError(path, f"no {name} property {missing[0]}", f"{name} properties {', '.join(needed)}")
    if not face.lists:
        raise DataError(path, "faces without vertex indices", "a face property list vertex_indices")
    with np.errstate(invalid="ignore"):  # of a damaged file's signalling NaN, which is refused next
        vertices = np.stack([vertex.single[axis] for axis in "xyz"], axis=1).astype(np.float64)
    check_coordinates(vertices, path)
    lengths, indices = next(iter(face.lists.values()))
    _check_whole(path, "vertex_indices", indices, 0, len(vertices) - 1)
    if (lengths < 3).any():
        row = int(np.argmax(lengths < 3))
        raise DataError(path, f"face {row} with {lengths[row]} corners", "at least 3", MEND)
    faces, polygon = _triangles(lengths, indices.astype(np.int32))
    return PlyMesh(
        vertices=vertices,
        faces=faces,
        polygon=polygon,
        vertex_colour=_colours(path, vertex),
        vertex_properties={name: vertex.single[name] for name in wanted["vertex"]},
        face_properties={name: face.single[name][polygon] for name in wanted["face"]},
    )


def _triangles(
    lengths: npt.NDArray[np.int64], indices: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Triangles (F, 3) of polygons, fanned out from each one's first corner, and the polygon (F,) of each."""
    if (lengths == 3).all():
        return indices.reshape(-1, 3), np.arange(len(lengths), dtype=np.int32)
    polygon = np.repeat(np.arange(len(lengths), dtype=np.int32), lengths - 2)
    first = np.cumsum(lengths) - lengths
    number = np.arange(len(polygon)) - np.repeat(np.cumsum(lengths - 2) - (lengths - 2), lengths - 2)
    second = first[polygon] + number + 1
    return np.stack([indices[first[polygon]], indices[second], indices[second + 1]], axis=1), polygon


def _colours(path: Path, vertex: _Columns) -> npt.NDArray[np.uint8] | None:
    """Vertex colours (V, 3), from bytes or from numbers in 0..1."""
    channels = [vertex.single[c] for c in ("red", "green", "blue") if c in vertex.single]
    if len(channels) < 3:
        return None
    colour = np.stack(channels, axis=1)
    if colour.dtype.kind == "f":
        if not ((colour >= 0) & (colour <= 1)).all():
            raise DataError(path, "vertex colours outside 0..1", "numbers in 0..1, or bytes", MEND)
        colour = np.round(colour * 255.0)
    elif colour.dtype != np.uint8:
        _check_whole(path, "vertex colours", colour.ravel(), 0, 255)
    return colour.astype(np.uint8)
