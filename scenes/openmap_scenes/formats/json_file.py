"""Reading JSON files that datasets bring, so that whatever is wrong with one is said in one way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TypeGuard

from openmap_scenes.errors import DataError


def read_json_object(path: Path, expected: str) -> dict[str, Any]:
    """The object (``{...}``) that a JSON file holds.

    Parameters
    ----------
    path : Path
    expected : str
        What the file should be, for the error.

    Raises
    ------
    DataError
        The file is missing, empty, not JSON, nested absurdly deep, or holds something else than an object.
    """
    if not path.is_file():
        raise DataError(path, "no such file", expected)
    try:
        value = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:  # not JSON, not UTF-8, numbers without end, brackets without end
        raise DataError(path, f"unreadable JSON ({error})", expected, "The file is damaged: fetch it again.") from error
    if not isinstance(value, dict):
        raise DataError(path, f"a JSON {type(value).__name__}", expected)
    return value


def is_id(value: object) -> bool:
    """Whether a JSON value can be an instance id: whole, and small enough for arrays by id and for the 24 bits of a picture."""
    return is_whole(value) and 0 <= value < 2**24 - 1


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a JSON value is a whole number of at most 63 bits."""
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
