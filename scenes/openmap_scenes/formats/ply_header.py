"""The header of a polygon file (PLY): which elements it has, and whether the file is large enough for what it announces."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
FORMATS: dict[str, Literal["<", ">"] | None] = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
HEADER_LIMIT = 1 << 16
MEND = "The file is damaged or was cut: fetch it again."


@dataclass(frozen=True)
class Property:
    """One column. ``count`` is the type of a list's length, None for a single number; ``declared`` is what the header says,
    ``dtype`` and ``count`` are how the bytes lie in memory."""

    name: str
    declared: np.dtype[Any]
    dtype: np.dtype[Any]
    count: np.dtype[Any] | None


@dataclass(frozen=True)
class Element:
    name: str
    rows: int
    properties: tuple[Property, ...]

    @property
    def least(self) -> int:
        """Bytes of the shortest possible row."""
        return sum((p.count or p.dtype).itemsize for p in self.properties)


def open_ply(path: Path) -> tuple[npt.NDArray[np.uint8], Literal["<", ">"] | None, list[Element], int]:
    """Bytes of the file, byte order (None = ASCII), its elements, and where the rows begin."""
    if not path.is_file():
        raise DataError(path, "no such file", "a PLY file")
    data = np.fromfile(path, np.uint8)
    head = data[:HEADER_LIMIT].tobytes()
    match = re.match(rb"ply(\r\n|\n|\r)(.*?\1)end_header\1", head, re.DOTALL)
    if match is None:
        found = "no PLY header" if head else "an empty file"
        raise DataError(path, found, "a first line 'ply' and a line 'end_header'", MEND)
    order, elements = "", []
    for number, line in enumerate(match[2].split(match[1])[:-1], 2):
        words = line.decode("ascii", "replace").split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in FORMATS:
            order = words[1]
        elif words[0] == "element" and len(words) == 3 and re.fullmatch(r"\d{1,18}", words[2]):
            elements.append(Element(words[1], int(words[2]), ()))
        elif words[0] == "property" and elements and (new := _property(words)) is not None:
            last = elements.pop()
            elements.append(Element(last.name, last.rows, (*last.properties, new)))
        else:
            raise DataError(f"{path} line {number}", repr(" ".join(words))[:80], "a line of a PLY header", MEND)
    if not order:
        raise DataError(path, "no format line", f"format {' or '.join(FORMATS)}", MEND)
    return data, FORMATS[order], _in_order(path, elements, FORMATS[order] or "<"), match.end()


def _property(words: list[str]) -> Property | None:
    if len(words) == 3 and words[1] in TYPES:
        dtype = np.dtype(TYPES[words[1]])
        return Property(words[2], dtype, dtype, None)
    if len(words) == 5 and words[1] == "list" and words[2] in TYPES and TYPES[words[2]][0] != "f" and words[3] in TYPES:
        dtype = np.dtype(TYPES[words[3]])
        return Property(words[4], dtype, dtype, np.dtype(TYPES[words[2]]))
    return None


def _in_order(path: Path, elements: list[Element], order: Literal["<", ">"]) -> list[Element]:
    """The elements with types in the file's byte order, after a look at whether there are vertices and faces."""
    names = [e.name for e in elements]
    if len(set(names)) < len(names) or not {"vertex", "face"} <= set(names):
        raise DataError(path, f"elements {names[:8]}", "one element vertex and one element face")
    for e in elements:
        properties = [p.name for p in e.properties]
        if len(set(properties)) < len(properties) or (e.rows and not properties):
            raise DataError(path, f"element {e.name} with properties {properties[:12]}", "properties, each one once")
    return [
        replace(
            e,
            properties=tuple(
                replace(p, dtype=p.dtype.newbyteorder(order), count=p.count.newbyteorder(order) if p.count else None)
                for p in e.properties
            ),
        )
        for e in elements
    ]


def check_size(path: Path, elements: list[Element], size: int, ascii_text: bool) -> None:
    """Refuse a header that announces more than the file can hold: a number in text takes two bytes, digit and blank."""
    for e in elements:
        if e.rows >= 2**31:
            raise DataError(path, f"{e.rows} rows of {e.name}", "fewer than 2147483648", MEND)
    need = sum(e.rows * (2 * len(e.properties) if ascii_text else e.least) for e in elements)
    if need > size + ascii_text:  # the last number of a text needs no blank
        rows = ", ".join(f"{e.rows} {e.name}" for e in elements)
        raise DataError(path, f"{size} bytes after the header", f"at least {need} for its rows ({rows})", MEND)
