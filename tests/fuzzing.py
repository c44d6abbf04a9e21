"""Damaging files in the ways in which files get damaged, and holding a reader to its one error type."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes import DataError

# More cases by hand: OPENMAP_FUZZ_CASES=20000 pytest tests/scenes -k fuzz
CASES = int(os.environ.get("OPENMAP_FUZZ_CASES", "0"))


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """One random damage: cut short, bits flipped, a stretch zeroed, doubled or taken out, a number in the text changed, noise."""
    if not data:
        return bytes(rng.integers(0, 256, 16, np.uint8))
    kind = int(rng.integers(8))
    at = int(rng.integers(len(data)))
    # Headers are short and decide most, so half of the damage is done there.
    if rng.random() < 0.5:
        at = min(at, int(rng.integers(1, 512)))
    length = int(rng.integers(1, 64))
    if kind == 0:
        return data[:at]
    if kind == 1:
        return _flipped(data, at, rng)
    if kind == 2:
        for _ in range(int(rng.integers(2, 12))):
            data = _flipped(data, int(rng.integers(len(data))), rng)
        return data
    if kind == 3:
        return data[:at] + bytes(len(data[at : at + length])) + data[at + length :]
    if kind == 4:
        return data[:at] + data[at : at + length] * 2 + data[at + length :]
    if kind == 5:
        return data[:at] + data[at + length :]
    if kind == 6:
        return _other_number(data, rng)
    return data[:at] + bytes(rng.integers(0, 256, length, np.uint8)) + data[at + length :]


def _flipped(data: bytes, at: int, rng: np.random.Generator) -> bytes:
    values: npt.NDArray[np.uint8] = np.frombuffer(data, np.uint8).copy()
    values[at] ^= np.uint8(1 << int(rng.integers(8)))
    return values.tobytes()


def _other_number(data: bytes, rng: np.random.Generator) -> bytes:
    """One of the numbers that are written as text, replaced by an awkward one."""
    digits = [i for i, byte in enumerate(data[:4000]) if 48 <= byte <= 57 and (i == 0 or not 48 <= data[i - 1] <= 57)]
    if not digits:
        return data[: len(data) // 2]
    start = digits[int(rng.integers(len(digits)))]
    end = start
    while end < len(data) and 48 <= data[end] <= 57:
        end += 1
    other = (b"-1", b"0", b"999999999", b"4294967296", b"1e308", b"nan", b"inf", b"", b'"x"', b"18446744073709551615")
    return data[:start] + other[int(rng.integers(len(other)))] + data[end:]


def hold_to_data_error(
    read: Callable[[Path], object], healthy: Path, files: Sequence[str], scratch: Path, cases: int, seed: int = 0
) -> int:
    """Read a scene ``cases`` times, each time with one of its files damaged; only DataError may come out.

    Parameters
    ----------
    read : callable
        Takes the folder of the scene.
    healthy : Path
        The folder of an intact scene, small.
    files : sequence of str
        Which of its files to damage, relative to the folder.
    scratch : Path
        An empty folder to work in.
    cases : int
        Overridden by OPENMAP_FUZZ_CASES.

    Returns
    -------
    int
        How many cases were refused; the others were read, which is right where the damage changed a colour or a coordinate.
    """
    rng = np.random.default_rng(seed)
    folder = scratch / healthy.name
    shutil.copytree(healthy, folder)
    refused = 0
    for case in range(CASES or cases):
        name = files[int(rng.integers(len(files)))]
        data = damaged((healthy / name).read_bytes(), rng)
        (folder / name).write_bytes(data)
        try:
            read(folder)
        except DataError:
            refused += 1
        except BaseException as error:
            kept = scratch / f"case-{seed}-{case}-{Path(name).name}"
            kept.write_bytes(data)
            raise AssertionError(
                f"case {case} ({name}, kept as {kept}) raised {type(error).__name__}: {error}"
            ) from error
        shutil.copyfile(healthy / name, folder / name)
    return refused
