"""Files of a recording's folder, none of them trusted: their places, their bytes, tables of numbers in text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError

# Larger files are no pictures of a recording, bytes.
LARGEST_PICTURE = 1 << 28
# Larger files are no lists or trajectories of one, bytes.
LARGEST_TEXT = 1 << 26


def inside(folder: Path, name: str, source: str | Path) -> Path:
    """The path of a file that another file names, which must lie in the recording's folder; DataError where it does not."""
    expected = "a file in the recording's folder, named from there"
    try:
        path = folder / name
        if not name.strip() or Path(name).is_absolute() or not path.resolve().is_relative_to(folder.resolve()):
            raise DataError(source, f"the name {name!r}", expected, "Copy the file into the folder.")
    except (ValueError, OSError, RuntimeError) as error:  # a zero byte, a name too long, a link to itself
        if isinstance(error, DataError):
            raise
        raise DataError(source, f"the name {name[:80]!r}", expected) from error
    return path


def bytes_of(path: Path, what: str = "a picture", largest: int = LARGEST_PICTURE) -> bytes:
    """The bytes of a file, or DataError where it cannot be read or is absurdly large."""
    try:
        if not path.is_file():
            raise DataError(path, "no such file", what)
        size = path.stat().st_size
        if size > largest:
            raise DataError(path, f"{size} bytes", f"{what} of at most {largest} bytes")
        return path.read_bytes()
    except OSError as error:  # gone since it was listed, or not readable
        raise DataError(path, f"a file that cannot be read ({error.strerror})", what) from error


def rows_of(path: Path, what: str) -> list[tuple[int, list[str]]]:
    """The words of each line of a text file, with its number; without comments (#) and empty lines. Commas count as spaces."""
    text = bytes_of(path, what, LARGEST_TEXT).decode("utf-8", "replace").removeprefix("\ufeff")
    rows = ((n, line.partition("#")[0].replace(",", " ").split()) for n, line in enumerate(text.splitlines(), 1))
    return [(n, words) for n, words in rows if words]


def floats(source: str, words: list[str], expected: str) -> npt.NDArray[np.float64]:
    """Words as numbers (n,), NaN and infinity among them; DataError where one is none."""
    try:
        return np.array([float(word) for word in words], np.float64)
    except ValueError as error:
        raise DataError(source, f"words that are no numbers ({str(error)[:60]})", expected) from error


def numbered(folder: Path, endings: tuple[str, ...], prefix: str = "") -> dict[int, Path]:
    """The files of a folder that are named by a frame number after a prefix, in its order; none where there is no folder."""
    files: dict[int, Path] = {}
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        match = re.fullmatch(re.escape(prefix) + r"([0-9]{1,9})", path.stem)
        if match and path.suffix.lower() in endings:
            number = int(match[1])
            if number in files:
                raise DataError(folder, f"{files[number].name} and {path.name}", "one file a frame")
            files[number] = path
    return dict(sorted(files.items()))
