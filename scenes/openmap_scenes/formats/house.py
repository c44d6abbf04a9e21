"""Matterport3D's ``.house`` text file: rooms, objects and their categories, in the raw Z-up frame.

Format: niessner/Matterport, data_organization.md. One line is one record; its first letter says of what.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from openmap_scenes.errors import DataError

ROOM_NAMES = {
    "a": "bathroom", "b": "bedroom", "c": "closet", "d": "dining room", "e": "entryway", "f": "family room", "g": "garage",
    "h": "hallway", "i": "library", "j": "laundry room", "k": "kitchen", "l": "living room", "m": "meeting room",
    "n": "lounge", "o": "office", "p": "porch", "r": "game room", "s": "stairs", "t": "toilet", "u": "utility room",
    "v": "tv room", "w": "workout/gym/exercise", "x": "outdoor area", "y": "balcony", "z": "other room", "B": "bar",
    "C": "classroom", "D": "dining booth", "S": "spa", "Z": "junk", "-": "no label",
}  # fmt: skip

# Fields of the H line that announce how many records follow.
COUNTS = {"objects": 8, "categories": 9, "regions": 10, "levels": 12}


@dataclass(frozen=True)
class HouseRoom:
    """Region record; ``box`` are its corners, (x, y, z) m each in the raw frame, None for a region without surfaces, whose box
    is inside out; ``level`` is None where the file says -1."""

    name: str
    box: tuple[tuple[float, ...], tuple[float, ...]] | None
    level: int | None


@dataclass(frozen=True)
class HouseCategory:
    """Category record: the annotators' raw name and the class of the forty that it belongs to."""

    name: str
    mpcat40: str


@dataclass(frozen=True)
class HouseObject:
    """Object record; ``room`` and ``category`` are None where the file says -1."""

    room: int | None
    category: int | None


@dataclass(frozen=True)
class House:
    """A scan's tables by index; ``levels`` are the heights (m) of the storeys, ``segments`` pairs (segment id, object)."""

    rooms: dict[int, HouseRoom]
    categories: dict[int, HouseCategory]
    objects: dict[int, HouseObject]
    levels: dict[int, float]
    segments: list[tuple[int, int]]


def read_house(path: Path) -> House:
    """Parse a ``.house`` file.

    Raises
    ------
    DataError
        No such file, another format, a line that does not parse, or a record that another one refers to and that is missing.
    """
    if not path.is_file():
        raise DataError(path, "no such file", "the scan's .house file")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    if not lines or not lines[0].startswith("ASCII"):
        raise DataError(path, f"first line {lines[0][:40]!r}" if lines else "an empty file", "'ASCII 1.1'")
    announced = _parse(path, lines, "H", lambda f: (0, {plural: int(f[at]) for plural, at in COUNTS.items()}))
    rooms = _parse(path, lines, "R", _room)
    categories = _parse(path, lines, "C", lambda f: (int(f[1]), HouseCategory(f[3].replace("#", " ").lower(), f[5])))
    objects = _parse(path, lines, "O", lambda f: (int(f[1]), HouseObject(_index(f[2]), _index(f[3]))))
    levels = _parse(path, lines, "L", lambda f: (int(f[1]), _finite(f[6])))
    segments = _parse(path, lines, "E", lambda f: (int(f[1]), (int(f[3]), int(f[2]))))
    if 0 not in announced:
        raise DataError(path, "no H line", "a header that announces how many records follow")
    house = House(rooms, categories, objects, levels, list(segments.values()))
    _check_references(path, house, announced[0])
    return house


Record = TypeVar("Record")


def _parse(
    path: Path, lines: list[str], letter: str, parse: Callable[[list[str]], tuple[int, Record]]
) -> dict[int, Record]:
    records: dict[int, Record] = {}
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields or fields[0] != letter:
            continue
        try:
            index, record = parse(fields)
        except (ValueError, IndexError) as error:
            raise DataError(
                f"{path}, line {number}", f"{line[:60]!r} ({error})", f"a complete {letter} record"
            ) from error
        if index in records:
            raise DataError(f"{path}, line {number}", f"{letter} record {index} a second time", "each index once")
        records[index] = record
    return records


def _room(fields: list[str]) -> tuple[int, HouseRoom]:
    low, high = fields[9:12], fields[12:15]
    if len(low) != 3 or len(high) != 3:
        raise ValueError("a box of six numbers is missing")
    is_empty = any(float(a) > float(b) for a, b in zip(low, high, strict=True))
    box = None if is_empty else (tuple(map(_finite, low)), tuple(map(_finite, high)))
    return int(fields[1]), HouseRoom(ROOM_NAMES.get(fields[5], "other room"), box, _index(fields[2]))


def _finite(text: str) -> float:
    value = float(text)
    if not abs(value) <= 1e6:
        raise ValueError(f"a coordinate of {value} m")
    return value


def _index(text: str) -> int | None:
    value = int(text)
    return value if value >= 0 else None


def _check_references(path: Path, house: House, announced: dict[str, int]) -> None:
    for index, item in sorted(house.objects.items()):
        for what, plural, reference, table in (
            ("region", "regions", item.room, house.rooms.keys()),
            ("category", "categories", item.category, house.categories.keys()),
        ):
            if reference is not None and reference not in table:
                raise DataError(
                    path,
                    f"object {index} in {what} {reference}, which is not in the file",
                    f"a record for each of the {announced[plural]} {plural} announced, {len(table)} are there",
                )
    for index, room in sorted(house.rooms.items()):
        if room.level is not None and room.level not in house.levels:
            found = f"region {index} on level {room.level}, which is not in the file"
            raise DataError(path, found, f"a record for each of the {announced['levels']} levels announced")
    for segment, item_index in house.segments:
        if item_index >= 0 and item_index not in house.objects:
            found = f"segment {segment} of object {item_index}, which is not in the file"
            raise DataError(path, found, f"a record for each of the {announced['objects']} objects announced")
    counts = {
        "objects": len(house.objects),
        "categories": len(house.categories),
        "regions": len(house.rooms),
        "levels": len(house.levels),
    }
    for plural, count in counts.items():
        if count != announced[plural]:
            raise DataError(path, f"{count} {plural}", f"the {announced[plural]} that its H line announces")
