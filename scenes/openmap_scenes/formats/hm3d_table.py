"""HM3D's ``.semantic.txt``: which colour of the semantic mesh is which object, of what name, in which region.

After a header line, one object a line: ``id,RRGGBB,"category",region``. Ids start at 1; black is nobody's.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from openmap_scenes.errors import DataError

HEADER = "HM3D Semantic Annotations"
LARGEST_ID = 2**31 - 1
# A table of ten thousand objects has half a megabyte.
_MOST_BYTES = 1 << 26
_MOST_NAMED = 20
# The name may hold commas and quotes, so the line is taken apart from both ends.
_ROW = re.compile(r'\s*(?P<id>[^,]*?)\s*,\s*(?P<colour>[^,"]*?)\s*,\s*(?P<rest>.*\S)\s*')
_REST = re.compile(r"(?P<name>.*?)\s*,\s*(?P<region>-?\d{1,9})")


@dataclass(frozen=True)
class Row:
    """One object: colour (r, g, b) 0..255, the annotators' name, the region's number or None where the file says -1."""

    colour: tuple[int, int, int]
    category: str
    region: int | None


def read_table(path: Path) -> dict[int, Row]:
    """The objects of a ``.semantic.txt`` by id, ascending.

    Raises
    ------
    DataError
        Another file; or lines that cannot be used, all of them in one message, each with its number and what is wrong with it.
    """
    if not path.is_file():
        raise DataError(path, "no such file", "the scene's table of objects")
    size = path.stat().st_size
    if size > _MOST_BYTES:
        raise DataError(path, f"{size} bytes", f"a table of objects, below {_MOST_BYTES}")
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    if not lines or lines[0][1].strip().lower() != HEADER.lower():
        found = f"first line {lines[0][1].strip()[:60]!r}" if lines else "an empty file"
        raise DataError(path, found, repr(HEADER), "Fetch it again.")
    rows: dict[int, Row] = {}
    line_of_id: dict[int, int] = {}
    id_of_colour: dict[tuple[int, int, int], int] = {}
    wrong: list[str] = []
    for number, line in lines[1:]:
        object_id, row, reason = _parse(line)
        if row is not None and object_id in line_of_id:
            reason = f"id {object_id} is that of line {line_of_id[object_id]} already"
        elif row is not None and row.colour in id_of_colour:
            other = id_of_colour[row.colour]
            reason = f"id {object_id} has the colour of id {other} (line {line_of_id[other]}), {_hex(row.colour)}"
        if reason or row is None:
            wrong.append(f"line {number}: {reason}")
            continue
        rows[object_id], line_of_id[object_id], id_of_colour[row.colour] = row, number, object_id
    if wrong:
        more = f"; and {len(wrong) - _MOST_NAMED} more" if len(wrong) > _MOST_NAMED else ""
        raise DataError(
            path,
            f"{len(wrong)} line{'s' * (len(wrong) > 1)} that cannot be used ({'; '.join(wrong[:_MOST_NAMED])}{more})",
            'id,RRGGBB,"category",region in each, every id and colour once',
            "Fetch it again, or mend these lines: objects of one colour cannot be told apart.",
        )
    return dict(sorted(rows.items()))


def _parse(line: str) -> tuple[int, Row | None, str]:
    """Id and row of one line, or 0, None and what is wrong with it."""
    fields = _ROW.fullmatch(line)
    if fields is None:
        return 0, None, f"{line.strip()[:60]!r} does not have four fields"
    number, colour, rest = fields["id"], fields["colour"].removeprefix("#"), fields["rest"]
    if not re.fullmatch(r"[0-9]{1,10}", number) or not 0 < int(number) <= LARGEST_ID:
        return 0, None, f"id {number[:20]!r} is not a whole number from 1 to {LARGEST_ID}"
    if not re.fullmatch(r"[0-9a-fA-F]{6}", colour):
        return 0, None, f"id {number} has the colour {colour[:20]!r}, which is not six hexadecimal digits"
    red, green, blue = bytes.fromhex(colour)
    if not red + green + blue:
        return 0, None, f"id {number} is black, which is nobody's colour"
    named = _REST.fullmatch(rest)
    if named is None:
        return 0, None, f"id {number} has no region (a whole number at the end)"
    region = int(named["region"])
    return int(number), Row((red, green, blue), _unquoted(named["name"]), region if region >= 0 else None), ""


def _unquoted(name: str) -> str:
    if len(name) >= 2 and name[0] == name[-1] == '"':
        name = name[1:-1].replace('""', '"')
    return name.strip()


def _hex(colour: tuple[int, int, int]) -> str:
    return bytes(colour).hex().upper()
