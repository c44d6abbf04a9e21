"""Points of a scan from whatever file has them, in the world frame."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes import DataError
from openmap_scenes.formats.ply import read_ply
from openmap_scenes.formats.scannet import MESH, read_T_world_scan

_LARGEST = 1 << 31  # bytes of one array, before it is unpacked
_FARTHEST = 1e5  # m


def read_points(path: str | Path) -> npt.NDArray[np.float32]:
    """Points (N, 3) float32 m of a file, in its order.

    ``<scan>_vh_clean_2.ply`` of ScanNet is turned into the world frame by the ``<scan>.txt`` beside it, as scenes of ScanNet are.
    Any other .ply (with or without faces) and an .npz (array ``points``) are in the world frame already.

    Raises
    ------
    DataError
        Nothing that can be read, no points, or points that are not finite.
    """
    path = Path(path)
    if path.suffix == ".npz":
        points = read_arrays(path, ("points",))["points"]
    elif path.suffix == ".ply":
        points = _ply_points(path)
        if path.name.endswith(MESH):
            T_world_scan = read_T_world_scan(path.with_name(f"{path.name.removesuffix(MESH)}.txt"))
            points = points @ T_world_scan[:3, :3].T + T_world_scan[:3, 3]
    else:
        raise DataError(path, f"a file that ends in {path.suffix!r}", "points in a .ply or an .npz")
    return as_points(points, path)


def scan_name(path: str | Path) -> str:
    """What a scan is called, by one of its files: "scene0000_00" for scene0000_00_vh_clean_2.ply, .map.npz, .txt ..."""
    return Path(path).name.partition(".")[0].removesuffix(MESH.partition(".")[0])


def as_points(values: npt.NDArray[Any], path: Path) -> npt.NDArray[np.float32]:
    """The same as (N, 3) float32; DataError if they cannot be points."""
    if values.ndim != 2 or values.shape[1:] != (3,) or values.dtype.kind not in "fiu" or not len(values):
        raise DataError(path, f"points {values.dtype} {values.shape}", "numbers (N, 3) in metres")
    # NaN fails this comparison too.
    if not (np.abs(values) < _FARTHEST).all():
        raise DataError(path, "points that are not finite, or absurdly far out", "metres in the world frame")
    return values.astype(np.float32)


def read_arrays(path: Path, names: Collection[str]) -> dict[str, npt.NDArray[Any]]:
    """Arrays of an .npz, all of ``names``; nothing is ever unpickled.

    Raises
    ------
    DataError
        It is not there, damaged, holds Python objects, or lacks one.
    """
    expected = f"an .npz of the arrays {', '.join(names)}"
    arrays: dict[str, npt.NDArray[Any]] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            present = set(archive.namelist())
            for name in names:
                if f"{name}.npy" not in present:
                    raise DataError(path, f"no array {name}", expected)
                size = archive.getinfo(f"{name}.npy").file_size
                if size > _LARGEST:
                    raise DataError(path, f"{name} of {size} bytes", f"at most {_LARGEST}")
                with archive.open(f"{name}.npy") as file:
                    arrays[name] = np.lib.format.read_array(file, allow_pickle=False)
    except FileNotFoundError:
        raise DataError(path, "no such file", expected) from None
    except DataError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise all kinds for damaged files
        raise DataError(path, f"an unreadable file ({type(error).__name__}: {error})", expected) from None
    return arrays


def _ply_points(path: Path) -> npt.NDArray[np.float64]:
    try:
        with path.open("rb") as file:
            head = file.read(1 << 16)
    except OSError as error:
        found = "no such file" if isinstance(error, FileNotFoundError) else f"an unreadable file ({error.strerror})"
        raise DataError(path, found, "a PLY file") from None
    if re.search(rb"^element face [1-9]", head, re.MULTILINE):
        return read_ply(path).vertices
    # The reader of scenes wants triangles; bare points come from other tools.
    from plyfile import PlyData

    try:
        vertex = PlyData.read(path)["vertex"]
        return np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1)
    except Exception as error:  # a damaged file gives all kinds
        raise DataError(path, f"no points ({type(error).__name__}: {error})", "a PLY file with x, y, z") from None
