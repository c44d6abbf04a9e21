"""Whether a 4x4 matrix from a file is a pose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.errors import DataError
from openmap_scenes.formats.transfer import FARTHEST

# Files write six digits, trackers drift a little; a scale or a shear of one per cent is neither.
TOLERANCE = 1e-2


def check_rigid(source: str | Path, what: str, matrix: npt.NDArray[np.float64]) -> None:
    """DataError where a matrix (4, 4) is not a rotation and a shift in metres: not finite, sheared, scaled, mirrored, far out."""
    expected = "a rotation and a shift in metres"
    if not np.isfinite(matrix).all():
        raise DataError(source, f"{what} that is not finite", expected)
    if np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-4 or np.abs(matrix[:3, 3]).max() > FARTHEST:
        raise DataError(source, f"{what} with a last row or a shift out of bounds", expected)
    R = matrix[:3, :3]
    if np.abs(R).max() > 2 or np.abs(R @ R.T - np.eye(3)).max() > TOLERANCE or np.linalg.det(R) < 0:
        raise DataError(source, f"{what} whose 3x3 part is not a rotation", expected)
