"""The networks that were trained for this package: plain arrays in ``weights/*.npz``, nothing that could run code."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_scenes import DataError

FOLDER = Path(__file__).parent / "weights"
_REMEDY = "Reinstall the package, or train anew: openmap train perception --out FOLDER."


def save_weights(path: Path, arrays: Mapping[str, npt.NDArray[np.floating]]) -> None:
    """Write arrays as half floats, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".part.npz")
    halves: dict[str, Any] = {k: np.asarray(v, np.float16) for k, v in arrays.items()}
    np.savez_compressed(unfinished, **halves)
    os.replace(unfinished, path)


def load_weights(path: Path, shapes: dict[str, tuple[int | None, ...]]) -> dict[str, npt.NDArray[np.float32]]:
    """The arrays of a file as float32.

    Parameters
    ----------
    path : Path
    shapes : dict
        What must be there, name -> shape; None stands for any length.

    Raises
    ------
    DataError
        Missing, damaged, or of another shape.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name].astype(np.float32) for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise DataError(path, f"no readable weights ({error})", "an .npz of plain arrays", _REMEDY) from error
    for name, shape in shapes.items():
        found = arrays[name].shape if name in arrays else None
        if (
            found is None
            or len(found) != len(shape)
            or any(b not in (None, a) for a, b in zip(found, shape, strict=True))
        ):
            raise DataError(path, f"{name} of shape {found}", f"{shape}", _REMEDY)
        if not np.isfinite(arrays[name]).all():
            raise DataError(path, f"{name} with values that are not finite", "finite weights", _REMEDY)
    return arrays
