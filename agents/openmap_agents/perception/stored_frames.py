"""Masks and features of pictures on disk: the format, a writer, a reader.

A folder holds one .npz a picture, with these arrays, all plain (nothing is ever unpickled):

- ``labels`` (H, W), any integer type: 0 = no mask, 1..n = mask of that number;
- ``scores`` (n,), optional: how sure it is that mask i+1 is one whole thing, 0..1; 1 without it;
- ``features`` (n, D), optional: row i belongs to mask i+1, in the space of the text tower at hand; made unit length on reading;
- ``names`` (n,) text, optional: what mask i+1 is called, which an encoder takes where there are no features.

Without scores, features and names, n is the largest label.

Which file belongs to which picture:

- by picture, the default: the file is called ``<digest>.npz``, or ``index.json`` says {"frames": {"<digest>": "<file>.npz"}}.
  The digest is ``picture_digest``: the first 24 hex digits of the SHA-256 of b"<height>x<width>:" and the RGB bytes, row by row.
  It does not matter which pictures of a stream are used, nor in which order, but they must be the same to the bit.
- by order (``?frames=order``): the n-th picture takes the n-th file, in the order of the numbers that their names are. For streams
  of which every picture is used, from the first on.

``write_frame`` writes a file by picture, or under a name of its own; ``write_index`` says which pictures named files belong to.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError

Order = Literal["picture", "order"]
ORDERS: tuple[str, ...] = get_args(Order)
INDEX = "index.json"
_LARGEST = 1 << 30  # bytes of one array, before it is unpacked
_FORMAT = "an .npz of labels (H, W) and, if there are any, scores (n,), features (n, D), names (n,)"
REMEDY = "Write it with openmap_agents.perception.stored_frames.write_frame."


@dataclass(frozen=True, eq=False)
class StoredFrame:
    """What a file says of a picture.

    Parameters
    ----------
    path : Path
    masks : Masks
    features : (n, D) float32 or None
        Unit vectors.
    names : list of n str, or None
    """

    path: Path
    masks: Masks
    features: npt.NDArray[np.float32] | None
    names: list[str] | None


def picture_digest(rgb: npt.NDArray[np.uint8]) -> str:
    """What a picture (H, W, 3) uint8 is known by: 24 hex digits."""
    if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
        raise ValueError(f"rgb is {rgb.dtype} {rgb.shape}, expected uint8 (H, W, 3)")
    height, width, _ = rgb.shape
    return hashlib.sha256(f"{height}x{width}:".encode() + np.ascontiguousarray(rgb).tobytes()).hexdigest()[:24]


def write_frame(
    folder: str | Path,
    picture: npt.NDArray[np.uint8] | str,
    labels: npt.NDArray[np.integer],
    *,
    scores: npt.ArrayLike | None = None,
    features: npt.ArrayLike | None = None,
    names: Sequence[str] | None = None,
) -> Path:
    """Write what there is to say of a picture, under a temporary name first.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    picture : (H, W, 3) uint8, or str
        The picture that the file will be found by, or the file's name without its suffix.
    labels, scores, features, names
        As in the module.

    Raises
    ------
    ValueError
        The arrays do not fit each other; nothing was written.
    """
    if isinstance(picture, str):
        if Path(picture).name != picture or not picture:
            raise ValueError(f"picture is {picture!r}, expected a file name without folders")
        stem, shape = picture, None
    else:
        stem, shape = picture_digest(picture), picture.shape[:2]
    arrays: dict[str, npt.NDArray[Any]] = {"labels": np.asarray(labels)}
    if scores is not None:
        arrays["scores"] = np.asarray(scores, np.float32)
    if features is not None:
        arrays["features"] = np.asarray(features, np.float32)
    if names is not None:
        arrays["names"] = np.asarray(list(names), np.str_)
    path = Path(folder) / f"{stem}.npz"
    _frame(path, arrays, shape)  # what could not be read is not written
    with replacing(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    return path


def write_index(folder: str | Path, pictures: Mapping[str, npt.NDArray[np.uint8] | str]) -> Path:
    """Write ``index.json``: file name -> its picture (H, W, 3) uint8, or the picture's digest.

    What an index there says of other files is kept.
    """
    path = Path(folder) / INDEX
    frames = _read_index(path) if path.exists() else {}
    for name, rgb in pictures.items():
        frames[rgb if isinstance(rgb, str) else picture_digest(rgb)] = _plain_name(name, path)
    with replacing(path) as file:
        file.write((json.dumps({"frames": dict(sorted(frames.items()))}, indent=1) + "\n").encode())
    return path


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A binary file that takes its name when it is complete."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}", suffix=".tmp", delete=False) as file:
        try:
            yield file
            file.close()
            # A temporary file is private; this one is as readable as any other file made here.
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(file.name, 0o666 & ~umask)
            os.replace(file.name, path)
        except BaseException:
            file.close()
            Path(file.name).unlink(missing_ok=True)
            raise


class StoredFrames:
    """The files of a folder, found by picture or by order.

    Raises
    ------
    DataError
        No such folder, no frame in it, an index that cannot be read, or (by order) names that are no numbers.
    """

    def __init__(self, folder: str | Path, frames: Order = "picture") -> None:
        self.path = Path(folder)
        if frames not in ORDERS:
            raise ValueError(f"frames is {frames!r}, expected one of {', '.join(ORDERS)}")
        if not self.path.is_dir():
            raise DataError(self.path, "no such folder", "a folder of one .npz a picture", REMEDY)
        self.files = sorted(p for p in self.path.glob("*.npz") if not p.name.startswith("."))
        if not self.files:
            raise DataError(self.path, "no .npz file", "one for each picture", REMEDY)
        self._by_order = frames == "order"
        self._index = {} if self._by_order or not (self.path / INDEX).exists() else _read_index(self.path / INDEX)
        self._next = 0
        if self._by_order:
            self.files = _by_number(self.files)

    def read(self, rgb: npt.NDArray[np.uint8]) -> StoredFrame:
        """What is stored of a picture (H, W, 3) uint8; by order, of the next one.

        Raises
        ------
        DataError
            Nothing is, or the file does not hold what it should.
        """
        path = self._take_next() if self._by_order else self._find(picture_digest(rgb))
        return read_frame(path, (rgb.shape[0], rgb.shape[1]))

    def _take_next(self) -> Path:
        if self._next == len(self.files):
            raise DataError(
                self.path,
                f"{len(self.files)} frames",
                "one more",
                "Find frames by picture if not all pictures are used.",
            )
        self._next += 1
        return self.files[self._next - 1]

    def _find(self, digest: str) -> Path:
        path = self.path / self._index.get(digest, f"{digest}.npz")
        if not path.is_file():
            raise DataError(
                self.path,
                f"no frame of this picture ({path.name})",
                "one for each picture that is looked at",
                "Compute it for these very pictures, or add ?frames=order where every picture of a stream is used.",
            )
        return path


def _by_number(files: list[Path]) -> list[Path]:
    for path in files:
        if not path.stem.isdecimal():
            raise DataError(path, "a name that is no number", "names such as 000123.npz, to be taken in order")
    return sorted(files, key=lambda p: (int(p.stem), p.name))


def _plain_name(name: Any, path: Path) -> str:
    if not isinstance(name, str) or Path(name).name != name or not name.endswith(".npz"):
        raise DataError(path, f"the file {name!r}", "the name of an .npz in the same folder")
    return name


def _read_index(path: Path) -> dict[str, str]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(path, f"no JSON ({error})", 'an object {"frames": {digest: file}}') from None
    frames = document.get("frames") if isinstance(document, dict) else None
    if not isinstance(frames, dict):
        raise DataError(path, "no frames", 'an object {"frames": {digest: file}}')
    return {digest: _plain_name(name, path) for digest, name in frames.items()}


def read_frame(path: Path, shape: tuple[int, int] | None = None) -> StoredFrame:
    """Read one file; ``shape`` is the (H, W) that it must have.

    Raises
    ------
    DataError
        It is not there, damaged, holds Python objects, or its arrays do not fit each other or the picture.
    """
    arrays = {}
    try:
        with zipfile.ZipFile(path) as archive:
            present = set(archive.namelist())
            for name in ("labels", "scores", "features", "names"):
                if f"{name}.npy" not in present:
                    continue
                size = archive.getinfo(f"{name}.npy").file_size
                if size > _LARGEST:
                    raise DataError(path, f"{name} of {size} bytes", f"at most {_LARGEST}", REMEDY)
                with archive.open(f"{name}.npy") as file:
                    arrays[name] = np.lib.format.read_array(file, allow_pickle=False)
    except FileNotFoundError:
        raise DataError(path, "no such file", _FORMAT, REMEDY) from None
    except DataError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise all kinds for damaged files
        raise DataError(path, f"an unreadable file ({type(error).__name__}: {error})", _FORMAT, REMEDY) from None
    return _frame(path, arrays, shape)


def _frame(path: Path, arrays: dict[str, npt.NDArray[Any]], shape: tuple[int, ...] | None) -> StoredFrame:
    """The arrays of a file, checked."""
    labels = arrays.get("labels")
    if labels is None or labels.ndim != 2 or labels.dtype.kind not in "iu":
        found = "no labels" if labels is None else f"labels {labels.dtype} {labels.shape}"
        raise DataError(path, found, "labels (H, W) of integers", REMEDY)
    if shape is not None and labels.shape != shape:
        raise DataError(path, f"labels {labels.shape}", f"{shape} as the picture", REMEDY)
    counts = {name: len(a) for name, a in arrays.items() if name != "labels" and a.ndim}
    largest, smallest = int(labels.max(initial=0)), int(labels.min(initial=0))
    n = max(counts.values(), default=largest)
    if smallest < 0 or largest > n or n > max(labels.size, 1) or any(count != n for count in counts.values()):
        sizes = ", ".join(f"{count} {name}" for name, count in counts.items())
        raise DataError(
            path,
            f"labels {smallest}..{largest}{' and ' + sizes if sizes else ''}",
            "labels 0..n and n of each",
            REMEDY,
        )
    return StoredFrame(
        path,
        Masks(labels.astype(np.int32), _scores(path, arrays.get("scores"), n)),
        None if "features" not in arrays else unit_rows(path, arrays["features"]),
        None if "names" not in arrays else _names(path, arrays["names"]),
    )


def _scores(path: Path, scores: npt.NDArray[Any] | None, n: int) -> npt.NDArray[np.float32]:
    if scores is None:
        return np.ones(n, np.float32)
    if scores.shape != (n,) or scores.dtype.kind not in "fiu" or not ((scores >= 0) & (scores <= 1)).all():
        raise DataError(path, f"scores {scores.dtype} {scores.shape}", f"({n},) numbers from 0 to 1", REMEDY)
    return scores.astype(np.float32)


def unit_rows(path: str | Path, features: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Features (n, D) as a reader gives them: unit length, float32. DataError, naming ``path``, where a row has no direction."""
    if features.ndim != 2 or features.dtype.kind != "f":
        raise DataError(path, f"features {features.dtype} {features.shape}", "(n, D) floats", REMEDY)
    lengths = np.linalg.norm(features.astype(np.float64), axis=1, keepdims=True)
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise DataError(path, "features that are zero or not finite", "a direction for each mask", REMEDY)
    return np.asarray(features / lengths, np.float32)


def _names(path: Path, names: npt.NDArray[Any]) -> list[str]:
    if names.ndim != 1 or (names.dtype.kind != "U" and len(names)):
        raise DataError(path, f"names {names.dtype} {names.shape}", "(n,) text", REMEDY)
    return [str(name) for name in names]
