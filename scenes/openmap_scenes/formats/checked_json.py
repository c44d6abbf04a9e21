"""JSON whose every value is checked before it is used: a wrong type or range is a DataError that names file and place."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

from openmap_scenes.errors import DataError

# Larger text than any scene's tables is refused before it is parsed, bytes.
LARGEST_TEXT = 512 * 2**20


class Value:
    """A JSON value, the file that it is from and where in it ("accessors[3].count"), as checks want it.

    Parameters
    ----------
    raw : Any
        What ``json.loads`` gave; None also stands for a key that is not there.
    source : Path
    place : str
    """

    def __init__(self, raw: Any, source: str | Path, place: str = "") -> None:
        self.raw, self.source, self.place = raw, source, place

    @property
    def exists(self) -> bool:
        return self.raw is not None

    def fail(self, expected: str, remedy: str = "", found: str | None = None) -> NoReturn:
        """Raise the DataError for this value."""
        if found is None:
            found = "nothing" if self.raw is None else repr(self.raw)[:60]
        raise DataError(self.source, f"{found} at {self.place or 'the top'}", expected, remedy)

    def __getitem__(self, key: str) -> Value:
        """A member of an object; a Value that does not exist where it has none."""
        if not isinstance(self.raw, dict):
            self.fail("an object")
        return Value(self.raw.get(key), self.source, f"{self.place}.{key}" if self.place else key)

    def items(self) -> list[Value]:
        """The members of a list; none where there is no list at all."""
        if self.raw is None:
            return []
        if not isinstance(self.raw, list):
            self.fail("a list")
        return [Value(raw, self.source, f"{self.place}[{n}]") for n, raw in enumerate(self.raw)]

    def integer(self, low: int = 0, high: int = 2**31 - 1, default: int | None = None) -> int:
        """A whole number in low..high."""
        if self.raw is None and default is not None:
            return default
        raw = int(self.raw) if isinstance(self.raw, float) and self.raw.is_integer() else self.raw
        if not isinstance(raw, int) or isinstance(raw, bool) or not low <= raw <= high:
            self.fail(f"a whole number in {low}..{high}")
        return raw

    def number(self, default: float | None = None) -> float:
        """A finite number."""
        if self.raw is None and default is not None:
            return default
        if isinstance(self.raw, bool) or not isinstance(self.raw, int | float) or abs(self.raw) > 1e300:
            self.fail("a finite number")
        if not math.isfinite(self.raw):
            self.fail("a finite number")
        return float(self.raw)

    def numbers(self, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """A list of ``count`` finite numbers."""
        if self.raw is None and default is not None:
            return default
        if not isinstance(self.raw, list) or len(self.raw) != count:
            self.fail(f"a list of {count} numbers")
        return tuple(item.number() for item in self.items())

    def text(self, default: str | None = None) -> str:
        """A string; halves of characters, which JSON can escape and no file can hold, come as question marks."""
        if self.raw is None and default is not None:
            return default
        if not isinstance(self.raw, str):
            self.fail("a string")
        return self.raw.encode("utf-8", "replace").decode()

    def pick(self, table: list[Any], what: str) -> int:
        """An index into a table."""
        if not table:
            self.fail(f"no reference, since there are no {what}")
        return self.integer(0, len(table) - 1)


def parse_json(text: bytes, source: str | Path) -> Value:
    """Parse JSON text; DataError where it is none, holds NaN or infinity, or nests without end."""

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"the constant {constant}, which JSON does not have")

    try:
        return Value(json.loads(text, parse_constant=refuse), source)
    except (ValueError, RecursionError) as error:
        raise DataError(source, f"broken JSON ({error})", "JSON text", "Fetch it again.") from error


def read_json(path: Path, what: str) -> Value:
    """Parse a JSON file; ``what`` says what the file is for, where there is none."""
    if not path.is_file():
        raise DataError(path, "no such file", what)
    size = path.stat().st_size
    if size > LARGEST_TEXT:
        raise DataError(path, f"{size} bytes of JSON", f"at most {LARGEST_TEXT}")
    return parse_json(path.read_bytes(), path)


def read_json_object(path: Path, what: str) -> dict[str, Any]:
    """The object (``{...}``) that a JSON file holds, not checked any further; DataError where it holds something else."""
    value = read_json(path, what).raw
    if not isinstance(value, dict):
        raise DataError(path, f"a JSON {type(value).__name__}", what)
    return value


def is_id(value: object) -> bool:
    """Whether a JSON value can be an instance id: whole, and small enough for arrays by id and for the 24 bits of a picture."""
    return is_whole(value) and 0 <= value < 2**24 - 1


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a JSON value is a whole number of at most 63 bits."""
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
