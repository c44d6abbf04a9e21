"""What episode files of every format have in common: JSON that may be gzipped, positions, rotations, texts, remarks.

Every check fails with a DataError that names the file, the entry and the field.
"""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from openmap_env.episodes.episode import Point
from openmap_scenes import DataError
from openmap_scenes.formats.checked_json import Value

LARGEST_FILE = 2**31
"""A file is at most this large when unpacked, bytes; the largest known one, ObjectNav's of one scene, has a tenth of that."""
FARTHEST = 1e6
"""No scene reaches this far from the world's origin, m."""
_UNIT = 0.01
"""Quaternions and rotations that files round are off by less than this."""
_REMEDY = "Fetch the file again; it may be incomplete."


def read_bytes(path: Path) -> bytes:
    """The content of a file, unpacked if its name ends in .gz.

    Raises
    ------
    DataError
        It cannot be read or unpacked, or is far larger than any episode file.
    """
    expected = "a readable file, gzipped if its name ends in .gz"
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise DataError(path, f"{path.stat().st_size} bytes", f"at most {LARGEST_FILE}")
        raw = path.read_bytes()
        return _unpacked(path, raw) if path.name.endswith(".gz") else raw
    except (OSError, zlib.error, EOFError) as error:
        raise DataError(path, f"no readable content ({error})", expected, _REMEDY) from error


def _unpacked(path: Path, raw: bytes) -> bytes:
    parts, left, room = [], raw, LARGEST_FILE
    while left:
        unpacker = zlib.decompressobj(wbits=31)
        parts.append(unpacker.decompress(left, room))
        room -= len(parts[-1])
        if room <= 0:
            raise DataError(path, f"more than {LARGEST_FILE} bytes when unpacked", "an episode file")
        if not unpacker.eof:
            raise EOFError("the compressed data end too early")
        # Padding with zeros may follow the last member.
        left = unpacker.unused_data.lstrip(b"\0")
    if not raw:
        raise EOFError("the file is empty")
    return b"".join(parts)


def parse(text: bytes, source: str | Path) -> Any:
    """The JSON value of a text; NaN and infinity, which some tools write, come as None."""
    try:
        return json.loads(text, parse_constant=lambda _: None)
    except (ValueError, RecursionError) as error:
        raise DataError(source, f"no readable JSON ({error})", "JSON", _REMEDY) from error


def point(value: Value) -> Point:
    """Three finite numbers, metres."""
    if not isinstance(value.raw, list) or len(value.raw) != 3:
        value.fail("three finite numbers in metres")
    x, y, z = (number(item, FARTHEST) for item in value.items())
    return x, y, z


def number(value: Value, largest: float = 1e300) -> float:
    """A finite number of at most that size."""
    found = value.number()
    if abs(found) > largest:
        value.fail(f"a number of at most {largest:g}")
    return found


def text(value: Value, what: str = "a text that is not empty") -> str:
    """A text that is not blank and can be written to a file."""
    if not isinstance(value.raw, str) or not value.raw.strip():
        value.fail(what)
    return value.text()


def name(value: Value) -> str:
    """A name that some tools write as a number."""
    whole = isinstance(value.raw, int) and not isinstance(value.raw, bool) and abs(value.raw) < 2**63
    return str(value.raw) if whole else text(value, "a text or a whole number")


def remarks(value: Value) -> dict[str, Any]:
    """An object of anything, or none at all; what is not finite becomes None, so that it can be written again."""
    if value.raw is None:
        return {}
    if not isinstance(value.raw, dict):
        value.fail("an object")
    return {str(key): _plain(entry) for key, entry in value.raw.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value


def heading_of(value: Value) -> float:
    """The heading in radians, positive to the left of -Z, of a quaternion [x, y, z, w] that is no tilt straight up or down."""
    if not isinstance(value.raw, list) or len(value.raw) != 4:
        value.fail("a quaternion [x, y, z, w]")
    quaternion = [number(item) for item in value.items()]
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > _UNIT:
        value.fail("a unit quaternion [x, y, z, w]", found=f"{quaternion} of length {length:.3g}")
    return _heading(value, Rotation.from_quat(quaternion).as_matrix())


def pose_of(value: Value) -> tuple[Point, float]:
    """Position, m, and heading, rad, of a 4x4 body-to-world matrix, written as four rows or as sixteen numbers."""
    rows = value.raw if isinstance(value.raw, list) else []
    if len(rows) == 4 and all(isinstance(row, list) and len(row) == 4 for row in rows):
        numbers = [number(item, FARTHEST) for row in value.items() for item in row.items()]
    elif len(rows) == 16:
        numbers = [number(item, FARTHEST) for item in value.items()]
    else:
        value.fail("a 4x4 matrix, as four rows or sixteen numbers")
    T_world_body = np.array(numbers).reshape(4, 4)
    R = T_world_body[:3, :3]
    rigid = np.abs(R @ R.T - np.eye(3)).max() < _UNIT and np.linalg.det(R) > 0
    if not rigid or np.abs(T_world_body[3] - [0, 0, 0, 1]).max() > _UNIT:
        value.fail("a rotation and a position, with 0 0 0 1 as the last row")
    x, y, z = T_world_body[:3, 3].tolist()
    return (x, y, z), _heading(value, R)


def _heading(value: Value, R_world_body: Any) -> float:
    forward = -R_world_body[:, 2]
    if math.hypot(forward[0], forward[2]) < 1e-3:
        value.fail("a rotation about the Y axis, not one that looks straight up or down")
    return math.atan2(-forward[0], -forward[2])
