"""The pinhole camera that every part shares: renderers, perception and the map.

Image coordinates (u, v) have their origin at the *centre* of the top left pixel, u to the right, v down. Camera axes are
OpenGL's: x right, y up, the camera looks along -z. Depth is planar: depth = -z_camera in metres, 0 where nothing was seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class PinholeCamera:
    """A pinhole camera without distortion.

    Parameters
    ----------
    width, height : int
        Image size in pixels.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels; pixel centres lie at integers.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"camera size is {self.width} x {self.height}, expected at least 1 x 1")
        if not (self.fx > 0 and self.fy > 0 and all(map(math.isfinite, (self.fx, self.fy, self.cx, self.cy)))):
            raise ValueError(
                f"camera has fx={self.fx}, fy={self.fy}, cx={self.cx}, cy={self.cy}; expected finite, fx, fy > 0"
            )

    @classmethod
    def from_hfov(cls, width: int, height: int, hfov_deg: float) -> PinholeCamera:
        """A camera with square pixels, its principal point in the image centre and ``hfov_deg`` degrees across its width."""
        if not 0.0 < hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {hfov_deg}, expected more than 0 and less than 180")
        focal = width / (2.0 * math.tan(math.radians(hfov_deg) / 2.0))
        return cls(width, height, focal, focal, (width - 1) / 2.0, (height - 1) / 2.0)

    def rays(self) -> npt.NDArray[np.float32]:
        """Camera-frame directions through the pixel centres, (H, W, 3) float32, scaled so that z = -1.

        ``depth[..., None] * rays()`` are the camera-frame points of a depth picture.
        """
        u = (np.arange(self.width) - self.cx) / self.fx
        v = (np.arange(self.height) - self.cy) / self.fy
        rays = np.empty((self.height, self.width, 3), np.float32)
        rays[..., 0], rays[..., 1], rays[..., 2] = u[None, :], -v[:, None], -1.0
        return rays

    def unproject(
        self, depth: npt.NDArray[np.floating], T_world_camera: npt.NDArray[np.floating]
    ) -> npt.NDArray[np.float32]:
        """World points (H, W, 3) float32 m of a planar depth picture (H, W) m; meaningless where depth is 0."""
        points = depth.astype(np.float32)[..., None] * self.rays()
        R, t = T_world_camera[:3, :3].astype(np.float32), T_world_camera[:3, 3].astype(np.float32)
        return np.asarray(points @ R.T + t, np.float32)

    def project(
        self, points: npt.NDArray[np.floating], T_world_camera: npt.NDArray[np.floating]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Image coordinates (N, 2) px and planar depth (N,) m of world points (N, 3); depth <= 0 lies behind the camera."""
        R, t = np.asarray(T_world_camera, np.float64)[:3, :3], np.asarray(T_world_camera, np.float64)[:3, 3]
        camera_points = (np.asarray(points, np.float64) - t) @ R
        depth = -camera_points[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            uv = np.stack(
                [self.fx * camera_points[:, 0] / depth + self.cx, -self.fy * camera_points[:, 1] / depth + self.cy],
                axis=1,
            )
        return uv, depth
