"""Camera poses of recordings: what is lost tracking, what is wrong, and how they get into the world frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_scenes.camera import PinholeCamera
from openmap_scenes.errors import DataError
from openmap_scenes.formats.rigid import TOLERANCE, check_rigid
from openmap_scenes.formats.scannet import read_T_world_scan

# Camera axes of most files (x right, y down, z forward) from OpenGL's (x right, y up, looking along -z).
T_OPENCV_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
# How much wider or narrower than its camera a picture may be, as a share, and still be one of another size.
SAME_SHAPE = 0.02


def is_lost(pose: npt.NDArray[np.float64]) -> bool:
    """Whether a pose (4, 4) is ScanNet's mark for lost tracking: minus infinity all over."""
    return bool(np.isneginf(pose[:3]).all())


def T_world_camera(
    source: str | Path,
    frame: int,
    T_scan_camera: npt.NDArray[np.float64],
    T_world_scan: npt.NDArray[np.float64],
    opengl: bool = False,
) -> npt.NDArray[np.float64]:
    """The pose (4, 4) of a frame, OpenGL axes to world, from a file's camera-to-scan matrix; DataError where that is none.

    ``opengl``: the camera's axes in the file are OpenGL's already; else x is right, y down, z forward.
    """
    check_rigid(source, f"a pose of frame {frame}", T_scan_camera)
    T_scan_opengl = T_scan_camera if opengl else T_scan_camera @ T_OPENCV_OPENGL
    return np.asarray(T_world_scan @ T_scan_opengl, np.float64)


def pose_of_quaternion(
    source: str | Path, quaternion: Sequence[float], shift: Sequence[float]
) -> npt.NDArray[np.float64]:
    """The matrix (4, 4) of a unit quaternion (x, y, z, w) and a shift (3,) m; DataError where it is none."""
    q = np.array(quaternion, np.float64)
    with np.errstate(over="ignore"):
        norm = float(np.sqrt((q * q).sum()))
    if not abs(norm - 1) <= TOLERANCE:
        raise DataError(source, f"a quaternion of length {norm:.6g}", "one of length 1 (x, y, z, w)")
    x, y, z, w = q / norm
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = shift
    return T


def camera_of(source: str | Path, matrix: npt.NDArray[np.float64], size: tuple[int, int]) -> PinholeCamera:
    """The camera of an intrinsic matrix (4, 4) or (3, 3) px and a size (width, height); DataError where it is none."""
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return camera_from(source, (fx, fy, cx, cy), size)


def camera_from(
    source: str | Path, intrinsics: tuple[float, float, float, float], size: tuple[int, int]
) -> PinholeCamera:
    """The camera of fx, fy, cx, cy px and a size (width, height); DataError where it is none."""
    fx, fy, cx, cy = intrinsics
    largest = 100.0 * max(size)
    if not (0 < fx < largest and 0 < fy < largest and abs(cx) < largest and abs(cy) < largest):
        raise DataError(
            source, f"intrinsics fx={fx}, fy={fy}, cx={cx}, cy={cy}", f"a camera of {size[0]} x {size[1]} px"
        )
    return PinholeCamera(*size, fx, fy, cx, cy)


def resized(source: str | Path, camera: PinholeCamera, size: tuple[int, int]) -> PinholeCamera:
    """The camera whose pictures of the same view have another size (width, height).

    The edges of the picture stay where they are, half a pixel beyond the outermost centres.

    Raises
    ------
    DataError
        The shape is another one, so the picture was cut or is of another camera.
    """
    x, y = size[0] / camera.width, size[1] / camera.height
    if abs(x - y) > SAME_SHAPE * max(x, y) + 1 / min(camera.width, camera.height):
        found = f"pictures of {size[0]} x {size[1]} px for a camera of {camera.width} x {camera.height} px"
        raise DataError(source, found, "the same shape", "Give the camera of these pictures.")
    if size == (camera.width, camera.height):
        return camera
    cx, cy = (camera.cx + 0.5) * x - 0.5, (camera.cy + 0.5) * y - 0.5
    return camera_from(source, (camera.fx * x, camera.fy * y, cx, cy), size)


def find_T_world_scan(folder: Path, names: tuple[str, ...]) -> npt.NDArray[np.float64]:
    """The scan's transform to the world by the first ``<name>.txt`` there is in a folder, else that without an alignment.

    It is the one that meshes get, so that a recording and its mesh lie on one another.
    """
    paths = [folder / f"{name}.txt" for name in names]
    return read_T_world_scan(next((p for p in paths if p.is_file()), paths[0]))
