"""The ScanNet benchmark's files of predicted 3-D instances, in which most methods give theirs.

A folder holds ``<scan>.txt`` for each scan, one line an instance: ``predicted_masks/<scan>_000.txt <label number> <confidence>``.
The mask's path is relative to the folder and has no spaces; the mask has one line a point of the scan's cloud, 1 where the point is
of the instance, else 0. Label numbers are ScanNet200's (``scannet200.NAME_OF``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.scannet200 import NAME_OF
from openmap_scenes import DataError

MASKS = "predicted_masks"
_LINE = "<path of a mask> <label number> <confidence>"
_LARGEST = 1 << 28  # bytes of one file
_NEWLINE, _ZERO = ord("\n"), ord("0")


@dataclass(frozen=True, eq=False)
class PredictedInstance:
    """One instance.

    Parameters
    ----------
    indices : (n,) int64
        Its points in the scan's cloud, ascending.
    confidence : float
    category : int
        Label number.
    """

    indices: npt.NDArray[np.int64]
    confidence: float
    category: int


def list_scans(folder: str | Path) -> list[str]:
    """Names of the scans that a folder has predictions of, in order.

    Raises
    ------
    DataError
        No such folder, or no scan in it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise DataError(folder, "no such folder", "a folder of <scan>.txt and their masks")
    scans = sorted(p.stem for p in folder.glob("*.txt") if p.is_file() and not p.name.startswith("."))
    if not scans:
        raise DataError(folder, "no <scan>.txt", "one for each scan")
    return scans


def read_predictions(
    folder: str | Path, scan: str, n_points: int, *, any_label: bool = False
) -> list[PredictedInstance]:
    """The instances of a scan, in the order of its file.

    Parameters
    ----------
    folder, scan
    n_points : int
        Of the scan's cloud.
    any_label : bool
        Take labels that ScanNet200 does not have: class-agnostic methods write what they like.

    Raises
    ------
    DataError
        A file is missing, cut or not as the format has it, a mask lies outside of the folder, has another number of points, or is
        named twice, or a label or a confidence cannot be.
    """
    folder = Path(folder)
    path = folder / f"{scan}.txt"
    found: list[PredictedInstance] = []
    seen: set[Path] = set()
    for number, line in enumerate(_text(path, "the predictions of a scan").splitlines(), 1):
        if not line.strip():
            continue
        where, words = f"{path} line {number}", line.split()
        if len(words) != 3:
            raise DataError(where, f"{len(words)} words", _LINE, "Paths have no spaces.")
        mask = _inside(folder, words[0], where)
        if mask in seen:
            raise DataError(where, f"the mask {words[0]} a second time", "a mask of its own for each instance")
        seen.add(mask)
        category, confidence = _label(words[1], where, any_label), _confidence(words[2], where)
        found.append(PredictedInstance(read_mask(mask, n_points), confidence, category))
    return found


def write_predictions(folder: str | Path, scan: str, instances: Sequence[PredictedInstance], n_points: int) -> Path:
    """Write the instances of a scan of ``n_points`` points; the file that names the masks comes last. Returns its path.

    Raises
    ------
    ValueError
        A name that is no file's name, points that the cloud does not have, or a confidence that is no number.
    """
    if Path(scan).name != scan or not scan or scan.startswith(".") or re.search(r"\s", scan):
        raise ValueError(f"scan is {scan!r}, expected a name without folders and spaces, not hidden")
    folder = Path(folder)
    (folder / MASKS).mkdir(parents=True, exist_ok=True)
    lines = []
    for k, instance in enumerate(instances):
        if len(instance.indices) and not 0 <= instance.indices.min() <= instance.indices.max() < n_points:
            raise ValueError(f"instance {k} has points beyond the {n_points} of the cloud")
        if not math.isfinite(instance.confidence):
            raise ValueError(f"instance {k} has confidence {instance.confidence}, expected a number")
        name = f"{MASKS}/{scan}_{k:03d}.txt"
        rows = np.empty((n_points, 2), np.uint8)
        rows[:] = _ZERO, _NEWLINE
        rows[instance.indices, 0] += 1
        _write(folder / name, rows.tobytes())
        lines.append(f"{name} {instance.category} {float(instance.confidence)!r}\n")
    path = folder / f"{scan}.txt"
    _write(path, "".join(lines).encode())
    return path


def read_mask(path: Path, n_points: int) -> npt.NDArray[np.int64]:
    """Indices (n,) int64, ascending, of the lines that are 1.

    Raises
    ------
    DataError
        The file is missing, has another number of lines, or one that is neither 0 nor 1.
    """
    data = _bytes(path, "a mask")
    if b"\r" in data or b" " in data or b"\t" in data:
        data = b"\n".join(line.strip() for line in data.splitlines())
    data = data.rstrip(b"\n") + b"\n" if data else b""
    rows = np.frombuffer(data, np.uint8)
    at = np.flatnonzero(rows == _NEWLINE)
    if data == b"\n":
        at = at[:0]
    if len(at) != n_points:
        remedy = "It is not of this scan, or it was cut."
        raise DataError(path, f"{len(at)} lines", f"{n_points}, one for each point of the cloud", remedy)
    digits = rows[at - 1]
    good = (np.diff(at, prepend=-1) == 2) & ((digits == _ZERO) | (digits == _ZERO + 1))
    if not good.all():
        bad = int(np.argmin(good))
        line = data.split(b"\n", bad + 1)[bad]
        raise DataError(f"{path} line {bad + 1}", repr(line.decode("ascii", "replace")[:40]), "0 or 1")
    return np.flatnonzero(digits == _ZERO + 1)


def _inside(folder: Path, name: str, where: str) -> Path:
    """The file that a line names, with all links followed, if it lies in the folder."""
    root = folder.resolve()
    try:
        path = (root / name).resolve()
    except (OSError, ValueError, RuntimeError) as error:  # too long, a zero byte, links in a circle
        raise DataError(where, f"the path {name[:80]!r} ({error})", f"a file in {folder}") from None
    if Path(name).is_absolute() or not path.is_relative_to(root) or path == root:
        raise DataError(where, f"the path {name[:80]!r}", f"one relative to {folder}, and in it")
    return path


def _label(word: str, where: str, any_label: bool) -> int:
    number = _number(word)
    # "5.0" is how some write 5.
    if not number.is_integer() or not 0 <= number < 2**31:
        raise DataError(where, f"label {word[:40]!r}", "a whole number")
    if not any_label and int(number) not in NAME_OF:
        remedy = "Class-agnostic scores take any label."
        raise DataError(where, f"label {int(number)}", "a class number of ScanNet200", remedy)
    return int(number)


def _confidence(word: str, where: str) -> float:
    number = _number(word)
    if not math.isfinite(number):
        raise DataError(where, f"confidence {word[:40]!r}", "a finite number")
    return number


def _number(word: str) -> float:
    try:
        return float(word) if "_" not in word else math.nan
    except ValueError:
        return math.nan


def _bytes(path: Path, what: str) -> bytes:
    try:
        if path.stat().st_size > _LARGEST:
            raise DataError(path, f"{path.stat().st_size} bytes", f"at most {_LARGEST}, for {what}")
        return path.read_bytes()
    except FileNotFoundError:
        raise DataError(path, "no such file", what) from None
    except OSError as error:
        raise DataError(path, f"an unreadable file ({error.strerror})", what) from None


def _text(path: Path, what: str) -> str:
    try:
        return _bytes(path, what).decode()
    except UnicodeDecodeError:
        raise DataError(path, "bytes that are no text", what) from None


def _write(path: Path, data: bytes) -> None:
    unfinished = path.with_name(f".{path.name}.tmp")
    unfinished.write_bytes(data)
    unfinished.replace(path)
