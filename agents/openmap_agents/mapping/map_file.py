"""The file of a map: a zip of plain arrays (an .npz), M instances, with a JSON header that says how to read and check them.

The header holds the format's name and version, the labels, what made masks and features, and dtype, shape and SHA-256 of every
array. The last bytes of the file, which are the comment of the zip, are the SHA-256 of all bytes before them: no bit of the file,
header and directory included, can change unnoticed. A reader trusts none of it all the same, since anybody can write a matching
sum: sizes are checked before anything is unpacked, nothing is ever unpickled, and what is read has to make sense as a map.

Version 1 had neither the sum of the whole file nor a history; it can be read, and is not written any more.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.identity import History
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_agents.mapping.whole_file import write_whole_file
from openmap_scenes import DataError

FORMAT, VERSION = "openmap-instance-map", 2
_LARGEST_HEADER = 16 << 20
# What a map may unpack to: this, or so many times the size of its file. Maps of walks unpack to under ten times theirs.
_SMALL, _LARGEST_RATIO = 64 << 20, 100
_COLUMNS: dict[str, tuple[str, tuple[int | None, ...]]] = {
    "id": ("int32", (None,)),
    "n_observations": ("int32", (None,)),
    "confidence": ("float64", (None,)),
    "is_structure": ("bool", (None,)),
    "has_feature": ("bool", (None,)),
    "feature": ("float32", (None, None)),
    "has_colour": ("bool", (None,)),
    "colour": ("uint8", (None, 3)),
    "point_count": ("int64", (None,)),
    "points": ("float32", (None, 3)),
    "view_count": ("int64", (None,)),
    "views": ("int32", (None, 3)),
    "history": ("int32", (None, 4)),
}
_SINCE_2 = ("history",)
_REMEDY = "Write the map again with InstanceMap.save."
_SEAL, _SEAL_LENGTH = b"sha256:", len(b"sha256:") + 64


def save_map(instance_map: InstanceMap, path: str | Path) -> None:
    """Write a map to ``path``; the same map gives the same bytes.

    Raises
    ------
    ValueError
        The map cannot be written: features of different lengths, say, or ids that do not ascend.
    DataError
        The path cannot be written to.
    """
    columns = _to_columns(instance_map)
    labels = [i.label for i in instance_map]
    header = {
        "format": FORMAT,
        "version": VERSION,
        "voxel_size": float(instance_map.voxel_size),
        "segmenter": instance_map.segmenter,
        "encoder": instance_map.encoder,
        "labels": labels,
        "arrays": {
            name: {"dtype": str(a.dtype), "shape": list(a.shape), "sha256": _digest(a)} for name, a in columns.items()
        },
    }
    try:
        _from_columns(columns, header, path)
    except DataError as error:
        raise ValueError(f"the map has {error.found}, expected {error.expected}") from error
    write_whole_file(path, _sealed({"header": np.frombuffer(json.dumps(header).encode(), np.uint8), **columns}))


def _sealed(columns: dict[str, npt.NDArray[Any]]) -> bytes:
    """The bytes of the file."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in columns.items():
            # The time of writing is left out: it says nothing of the map.
            member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type, member.external_attr, member.create_system = zipfile.ZIP_DEFLATED, 0o644 << 16, 3
            packed = io.BytesIO()
            np.lib.format.write_array(packed, array, allow_pickle=False)
            archive.writestr(member, packed.getvalue())
        archive.comment = bytes(_SEAL_LENGTH)
    data = file.getvalue()[:-_SEAL_LENGTH]
    return data + _SEAL + hashlib.sha256(data).hexdigest().encode()


def load_map(path: str | Path) -> InstanceMap:
    """Read a map that ``save_map`` wrote, of this version or an earlier one.

    Raises
    ------
    DataError
        There is no such file, or it is cut off, altered, of another format or of a newer version.
    """
    try:
        with Path(path).open("rb") as file:
            size, sealed = _check_seal(file, path)
            with zipfile.ZipFile(file) as archive:
                _check_members(archive, size, path)
                header = _read_header(archive, sealed, path)
                names = [n for n in _COLUMNS if header["version"] > 1 or n not in _SINCE_2]
                _check_names(archive, names, path)
                columns = {name: _read_array(archive, name, header, path) for name in names}
    except FileNotFoundError:
        raise DataError(path, "no such file", "a map written by InstanceMap.save") from None
    except (OSError, zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise DataError(path, f"an unreadable file ({error})", "a whole map", _REMEDY) from None
    except Exception as error:
        if isinstance(error, DataError):
            raise
        raise DataError(path, f"damaged contents ({type(error).__name__}: {error})", "a map", _REMEDY) from error
    return _from_columns(columns, header, path)


def _check_seal(file: BinaryIO, path: str | Path) -> tuple[int, bool]:
    """The size of the file, and whether it ends in the sum of its bytes; DataError if it ends in another sum."""
    size = file.seek(0, io.SEEK_END)
    end = max(size - _SEAL_LENGTH, 0)
    file.seek(end)
    seal = file.read()
    if not seal.startswith(_SEAL):
        return size, False
    file.seek(0)
    digest, left = hashlib.sha256(), end
    while left and (chunk := file.read(min(left, 1 << 20))):
        digest.update(chunk)
        left -= len(chunk)
    if seal != _SEAL + digest.hexdigest().encode():
        raise DataError(path, "contents that do not match the checksum at its end", "an unaltered map", _REMEDY)
    return size, True


def _check_members(archive: zipfile.ZipFile, size: int, path: str | Path) -> None:
    names = archive.namelist()
    if "header.npy" not in names:
        raise DataError(path, "an archive without a header", "a map written by InstanceMap.save")
    if len(set(names)) < len(names):
        raise DataError(path, "members of the same name", "each once", _REMEDY)
    unpacked = sum(member.file_size for member in archive.infolist())
    if unpacked > max(_SMALL, _LARGEST_RATIO * size):
        raise DataError(path, f"{size} bytes that unpack to {unpacked}", f"at most {_LARGEST_RATIO} times as many")
    if archive.getinfo("header.npy").file_size > _LARGEST_HEADER:
        raise DataError(path, "a header of over 16 MiB", "a map written by InstanceMap.save")


def _check_names(archive: zipfile.ZipFile, names: list[str], path: str | Path) -> None:
    expected = {"header.npy", *(f"{name}.npy" for name in names)}
    wrong = sorted(expected ^ set(archive.namelist()))
    if wrong:
        kind = "no" if wrong[0] in expected else "a"
        raise DataError(path, f"{kind} member {wrong[0]!r}", f"{len(expected)} arrays of a map", _REMEDY)


def _digest(array: npt.NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def _to_columns(instance_map: InstanceMap) -> dict[str, npt.NDArray[Any]]:
    instances = instance_map.instances
    dims = sorted({len(i.feature) for i in instances if i.feature is not None})
    if len(dims) > 1:
        raise ValueError(f"the map has features of {' and '.join(map(str, dims))} dimensions, expected one length")
    dim = dims[0] if dims else 0
    nothing, black = np.zeros(dim, np.float32), np.zeros(3, np.uint8)

    def joined(arrays: list[npt.NDArray[Any]], width: int) -> npt.NDArray[Any]:
        return np.concatenate(arrays) if arrays else np.empty((0, width))

    columns: dict[str, Any] = {
        "id": [i.id for i in instances],
        "n_observations": [i.n_observations for i in instances],
        "confidence": [i.confidence for i in instances],
        "is_structure": [i.is_structure for i in instances],
        "has_feature": [i.feature is not None for i in instances],
        "feature": np.array([nothing if i.feature is None else i.feature for i in instances]).reshape(
            len(instances), dim
        ),
        "has_colour": [i.colour is not None for i in instances],
        "colour": np.array([black if i.colour is None else i.colour for i in instances]).reshape(-1, 3),
        "point_count": [len(i.points) for i in instances],
        "points": joined([i.points for i in instances], 3),
        "view_count": [len(i.views) for i in instances],
        "views": joined([i.views for i in instances], 3),
        "history": instance_map.history,
    }
    return {name: np.ascontiguousarray(values, _COLUMNS[name][0]) for name, values in columns.items()}


def _read_header(archive: zipfile.ZipFile, sealed: bool, path: str | Path) -> dict[str, Any]:
    header = json.loads(_read_member(archive, "header", np.dtype(np.uint8), None, path).tobytes())
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DataError(path, "a file of another kind", f"format {FORMAT!r}")
    version = header.get("version")
    if type(version) is not int or not 1 <= version <= VERSION:
        raise DataError(
            path, f"map version {version!r}", f"version 1 to {VERSION}", "Read it with the release that wrote it."
        )
    if version > 1 and not sealed:
        raise DataError(path, "no checksum at its end", "a whole, unaltered map", _REMEDY)
    return header


def _read_array(archive: zipfile.ZipFile, name: str, header: dict[str, Any], path: str | Path) -> npt.NDArray[Any]:
    dtype, expected = _COLUMNS[name]
    entry = header["arrays"][name]
    shape = tuple(entry["shape"])
    fits = len(shape) == len(expected) and all(
        type(n) is int and n >= 0 and m in (None, n) for n, m in zip(shape, expected, strict=True)
    )
    if entry["dtype"] != dtype or not fits:
        raise DataError(path, f"{name} declared as {entry['dtype']} {shape}", f"{dtype} {expected}", _REMEDY)
    array = _read_member(archive, name, np.dtype(dtype), shape, path)
    if _digest(array) != entry["sha256"]:
        raise DataError(path, f"{name} that does not match its checksum", "an unaltered map", _REMEDY)
    return array


def _read_member(
    archive: zipfile.ZipFile, name: str, dtype: np.dtype[Any], shape: tuple[int, ...] | None, path: str | Path
) -> npt.NDArray[Any]:
    """An array of that type and shape (None: any vector); nothing is made room for before the sizes agree."""
    member = archive.getinfo(f"{name}.npy")
    with archive.open(member) as file:
        if np.lib.format.read_magic(file) != (1, 0):
            raise DataError(path, f"{name} in another version of numpy's format", "1.0", _REMEDY)
        found, by_columns, found_dtype = np.lib.format.read_array_header_1_0(file)
        n_bytes = found_dtype.itemsize * math.prod(found)
        shape_fits = len(found) == 1 if shape is None else found == shape
        if found_dtype != dtype or not shape_fits or n_bytes < 0 or not 0 <= member.file_size - n_bytes <= 1024:
            stated = f"{name} as {found_dtype} {found} in {member.file_size} bytes"
            raise DataError(path, stated, f"{dtype} {'of one dimension' if shape is None else shape}", _REMEDY)
        data = bytearray(file.read(n_bytes))
        # Reading to the end is what has the zip's own sum checked.
        if len(data) != n_bytes or file.read(1):
            raise DataError(path, f"{name} of another length than it says", f"{n_bytes} bytes", _REMEDY)
    array: npt.NDArray[Any] = np.frombuffer(data, dtype)
    if dtype == np.bool_ and (array.view(np.uint8) > 1).any():
        raise DataError(path, f"{name} with truth values other than 0 and 1", "0 and 1", _REMEDY)
    return np.ascontiguousarray(array.reshape(found[::-1]).T) if by_columns else array.reshape(found)


def _from_columns(columns: dict[str, npt.NDArray[Any]], header: dict[str, Any], path: str | Path) -> InstanceMap:
    _check_columns(columns, header, path)
    _check_values(columns, path)
    voxel_size, made_by = header["voxel_size"], [header.get(name, "") for name in ("segmenter", "encoder")]
    if type(voxel_size) not in (int, float) or not math.isfinite(voxel_size) or voxel_size < 0:
        raise DataError(path, f"a voxel size of {voxel_size!r}", "a length in metres", _REMEDY)
    if not all(isinstance(spec, str) for spec in made_by):
        raise DataError(path, "a segmenter or an encoder of the wrong type", "text", _REMEDY)
    points_of = np.split(columns["points"], np.cumsum(columns["point_count"])[:-1])
    views_of = np.split(columns["views"], np.cumsum(columns["view_count"])[:-1])
    instances = [
        MapInstance(
            id=int(columns["id"][i]),
            points=points_of[i],
            feature=columns["feature"][i] if columns["has_feature"][i] else None,
            n_observations=int(columns["n_observations"][i]),
            confidence=float(columns["confidence"][i]),
            views=views_of[i],
            is_structure=bool(columns["is_structure"][i]),
            colour=columns["colour"][i] if columns["has_colour"][i] else None,
            label=label,
        )
        for i, label in enumerate(header["labels"])
    ]
    history = columns.get("history", np.empty((0, 4), np.int32))
    return InstanceMap(instances, float(voxel_size), made_by[0], made_by[1], history)


def _check_columns(columns: dict[str, npt.NDArray[Any]], header: dict[str, Any], path: str | Path) -> None:
    """Whether there is as much of everything as there are instances."""
    n, labels = len(columns["id"]), header.get("labels")
    per_instance = [name for name in columns if name not in ("points", "views", "history")]
    if any(len(columns[name]) != n for name in per_instance) or not isinstance(labels, list) or len(labels) != n:
        raise DataError(path, "columns of different lengths", f"{n} of each", _REMEDY)
    if not all(isinstance(label, str) for label in labels):
        raise DataError(path, "labels of the wrong type", "text", _REMEDY)
    for count, rows in (("point_count", "points"), ("view_count", "views")):
        counts, there = columns[count], len(columns[rows])
        # Each by itself first, for a sum of huge ones may overflow to the right one.
        if ((counts < 0) | (counts > there)).any() or int(counts.sum()) != there:
            raise DataError(path, f"{count} that does not add up", f"{there} {rows}", _REMEDY)


def _check_values(columns: dict[str, npt.NDArray[Any]], path: str | Path) -> None:
    """Whether the values can be those of a map."""
    ids, confidence = columns["id"], columns["confidence"]
    if not np.isfinite(columns["points"]).all() or (columns["point_count"] == 0).any():
        raise DataError(path, "points that are not finite, or an instance without any", "a place for each", _REMEDY)
    if (ids < 1).any() or (np.diff(ids.astype(np.int64)) <= 0).any():
        raise DataError(path, "ids out of order", "ids above 0, ascending", _REMEDY)
    if not np.isfinite(columns["feature"]).all():
        raise DataError(path, "features that are not finite", "finite numbers", _REMEDY)
    if not ((confidence >= 0) & (confidence <= 1)).all():
        raise DataError(path, "confidences out of range", "0..1", _REMEDY)
    if (columns["n_observations"] < 0).any() or (columns["views"] < 0).any():
        raise DataError(path, "negative counts of observations or in views", "none below 0", _REMEDY)
    try:
        History(columns.get("history", np.empty((0, 4), np.int32))).check()
    except ValueError as error:
        raise DataError(path, f"an impossible history ({error})", "a history as the map wrote it", _REMEDY) from None
