"""Camera poses of ScanNet's recordings: what is lost tracking, what is wrong, and how they get into the world frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.rigid import check_rigid
from openmap_scenes.formats.scannet import read_T_world_scan

# Camera axes of the files (x right, y down, z forward) from OpenGL's (x right, y up, looking along -z).
T_FILE_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def is_lost(pose: npt.NDArray[np.float64]) -> bool:
    """Whether a pose (4, 4) is ScanNet's mark for lost tracking: minus infinity all over."""
    return bool(np.isneginf(pose[:3]).all())


def T_world_camera(
    source: str | Path, frame: int, pose: npt.NDArray[np.float64], T_world_scan: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """The pose (4, 4) of a frame, OpenGL axes to world, from a file's camera-to-scan matrix; DataError where that is none."""
    check_rigid(source, f"a pose of frame {frame}", pose)
    return np.asarray(T_world_scan @ pose @ T_FILE_OPENGL, np.float64)


def camera_of(source: str | Path, matrix: npt.NDArray[np.float64], size: tuple[int, int]) -> PinholeCamera:
    """The camera of an intrinsic matrix (4, 4) px and a size (width, height); DataError where it is none."""
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    largest = 100.0 * max(size)
    if not (0 < fx < largest and 0 < fy < largest and abs(cx) < largest and abs(cy) < largest):
        raise DataError(
            source, f"intrinsics fx={fx}, fy={fy}, cx={cx}, cy={cy}", f"a camera of {size[0]} x {size[1]} px"
        )
    return PinholeCamera(*size, fx, fy, cx, cy)


def find_T_world_scan(folder: Path, names: tuple[str, ...]) -> npt.NDArray[np.float64]:
    """The scan's transform to the world by the first ``<name>.txt`` there is in a folder, else that without an alignment.

    It is the one that meshes get, so that a recording and its mesh lie on one another.
    """
    paths = [folder / f"{name}.txt" for name in names]
    return read_T_world_scan(next((p for p in paths if p.is_file()), paths[0]))
