"""The file of a map: one .npz of plain arrays, M instances, with a JSON header that says how to read and check them.

The header holds the format's name and version, the labels, what made masks and features, and dtype, shape and SHA-256 of every
array. A reader trusts none of it: sizes are checked before anything is unpacked, and nothing is ever unpickled.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.instance_map import InstanceMap, MapInstance
from openmap_scenes import DataError

FORMAT, VERSION = "openmap-instance-map", 1
_LARGEST_HEADER = 16 << 20
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
}
_REMEDY = "Write the map again with InstanceMap.save."


def save_map(instance_map: InstanceMap, path: str | Path) -> None:
    """Write a map to ``path``, under a temporary name first."""
    columns = _to_columns(instance_map.instances)
    header = {
        "format": FORMAT,
        "version": VERSION,
        "voxel_size": instance_map.voxel_size,
        "segmenter": instance_map.segmenter,
        "encoder": instance_map.encoder,
        "labels": [i.label for i in instance_map.instances],
        "arrays": {
            name: {"dtype": str(a.dtype), "shape": list(a.shape), "sha256": _digest(a)} for name, a in columns.items()
        },
    }
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.name, suffix=".tmp", delete=False) as file:
        try:
            columns["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
            np.savez_compressed(file, allow_pickle=False, **columns)
            file.close()
            # A temporary file is private; a map is as readable as any other file made here.
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(file.name, 0o666 & ~umask)
            os.replace(file.name, path)
        except BaseException:
            file.close()
            Path(file.name).unlink(missing_ok=True)
            raise


def load_map(path: str | Path) -> InstanceMap:
    """Read a map that ``save_map`` wrote.

    Raises
    ------
    DataError
        There is no such file, or it is cut off, altered, of another format or of a newer version.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            header = _read_header(archive, path)
            columns = {name: _read_array(archive, name, header, path) for name in _COLUMNS}
    except FileNotFoundError:
        raise DataError(path, "no such file", "a map written by InstanceMap.save") from None
    except (OSError, zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise DataError(path, f"an unreadable file ({error})", "a whole .npz map", _REMEDY) from None
    except Exception as error:
        if isinstance(error, DataError):
            raise
        raise DataError(path, f"damaged contents ({type(error).__name__}: {error})", "a map", _REMEDY) from error
    return _from_columns(columns, header, path)


def _digest(array: npt.NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def _to_columns(instances: list[MapInstance]) -> dict[str, npt.NDArray[Any]]:
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
    }
    return {name: np.asarray(values, _COLUMNS[name][0]) for name, values in columns.items()}


def _read_header(archive: zipfile.ZipFile, path: str | Path) -> dict[str, Any]:
    if "header.npy" not in archive.namelist():
        raise DataError(path, "an archive without a header", "a map written by InstanceMap.save")
    if archive.getinfo("header.npy").file_size > _LARGEST_HEADER:
        raise DataError(path, "a header of over 16 MiB", "a map written by InstanceMap.save")
    with archive.open("header.npy") as file:
        raw = np.lib.format.read_array(file, allow_pickle=False)
    header = json.loads(raw.tobytes())
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise DataError(path, "a file of another kind", f"format {FORMAT!r}")
    if header.get("version") != VERSION:
        raise DataError(
            path,
            f"map version {header.get('version')!r}",
            f"version {VERSION}",
            "Read it with the release that wrote it.",
        )
    return header


def _read_array(archive: zipfile.ZipFile, name: str, header: dict[str, Any], path: str | Path) -> npt.NDArray[Any]:
    dtype, expected = _COLUMNS[name]
    entry = header["arrays"][name]
    shape = tuple(int(n) for n in entry["shape"])
    fits = len(shape) == len(expected) and all(n >= 0 and m in (None, n) for n, m in zip(shape, expected, strict=True))
    n_bytes = np.dtype(dtype).itemsize * int(np.prod(shape, dtype=object))
    size = archive.getinfo(f"{name}.npy").file_size
    if entry["dtype"] != dtype or not fits or not 0 <= size - n_bytes <= 1024:
        raise DataError(
            path, f"{name} declared as {entry['dtype']} {shape} in {size} bytes", f"{dtype} {expected}", _REMEDY
        )
    with archive.open(f"{name}.npy") as file:
        array = np.lib.format.read_array(file, allow_pickle=False)
    if array.dtype != np.dtype(dtype) or array.shape != shape or _digest(array) != entry["sha256"]:
        raise DataError(path, f"{name} that does not match its checksum", "an unaltered map", _REMEDY)
    return np.asarray(array)


def _from_columns(columns: dict[str, npt.NDArray[Any]], header: dict[str, Any], path: str | Path) -> InstanceMap:
    n, labels, voxel_size = len(columns["id"]), header.get("labels"), header.get("voxel_size")
    per_instance = [name for name in _COLUMNS if name not in ("points", "views")]
    if any(len(columns[name]) != n for name in per_instance) or not isinstance(labels, list) or len(labels) != n:
        raise DataError(path, "columns of different lengths", f"{n} of each", _REMEDY)
    if not all(isinstance(label, str) for label in labels) or not isinstance(voxel_size, (int, float)):
        raise DataError(path, "labels or a voxel size of the wrong type", "text and a number", _REMEDY)
    for count, rows in (("point_count", "points"), ("view_count", "views")):
        if (columns[count] < 0).any() or int(columns[count].sum()) != len(columns[rows]):
            raise DataError(path, f"{count} that does not add up", f"{len(columns[rows])} {rows}", _REMEDY)
    ids, points = columns["id"], columns["points"]
    if (
        not np.isfinite(points).all()
        or (columns["point_count"] == 0).any()
        or (ids < 1).any()
        or (np.diff(ids) <= 0).any()
    ):
        raise DataError(path, "points or ids out of range", "finite points, at least one each, ids ascending", _REMEDY)
    made_by = [header.get(name, "") for name in ("segmenter", "encoder")]
    if not all(isinstance(spec, str) for spec in made_by):
        raise DataError(path, "a segmenter or an encoder of the wrong type", "text", _REMEDY)
    points_of = np.split(points, np.cumsum(columns["point_count"])[:-1])
    views_of = np.split(columns["views"], np.cumsum(columns["view_count"])[:-1])
    instances = [
        MapInstance(
            id=int(ids[i]),
            points=points_of[i],
            feature=columns["feature"][i] if columns["has_feature"][i] else None,
            n_observations=int(columns["n_observations"][i]),
            confidence=float(columns["confidence"][i]),
            views=views_of[i],
            is_structure=bool(columns["is_structure"][i]),
            colour=columns["colour"][i] if columns["has_colour"][i] else None,
            label=labels[i],
        )
        for i in range(n)
    ]
    return InstanceMap(instances, float(voxel_size), *made_by)
