"""One picture of an episode for people: what the agent sees, how far that is, and where it stands among the targets."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from openmap_env.episodes.episode import Target
from openmap_env.navigation import NavigableSurface

Image = npt.NDArray[np.uint8]

_GROUND, _FREE = (32, 34, 38), (206, 210, 214)
_TARGET, _PATH, _BODY = (46, 160, 67), (60, 110, 220), (220, 60, 50)
DEPTH_SHOWN = 6.0
"""Depths from here on, m, have the same colour."""


def coloured_depth(depth: npt.NDArray[np.float32]) -> Image:
    """A planar depth picture (H, W) m as (H, W, 3) uint8: near is warm, far is cold, nothing is black."""
    level = (255.0 * (1.0 - np.clip(depth / DEPTH_SHOWN, 0.0, 1.0))).astype(np.uint8)
    picture = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_TURBO)[..., ::-1], np.uint8).copy()
    picture[depth <= 0.0] = 0
    return picture


class TopDownPicture:
    """The floor of a scene from above, ``size`` pixels square; ``draw`` puts an episode on it."""

    def __init__(self, surface: NavigableSurface, size: int) -> None:
        top_down = surface.top_down_map()
        rows, columns = np.nonzero(top_down.navigable)
        low, high = np.array([rows.min(), columns.min()]), np.array([rows.max(), columns.max()]) + 1
        margin = 0.06 * float((high - low).max()) + 4.0
        self._scale = size / (float((high - low).max()) + 2.0 * margin)
        self._offset = (low + high) / 2.0 - size / 2.0 / self._scale
        self._map, self.size = top_down, size
        shift = np.array(
            [[self._scale, 0.0, -self._scale * self._offset[1]], [0.0, self._scale, -self._scale * self._offset[0]]]
        )
        free = cv2.warpAffine(top_down.navigable.astype(np.uint8) * 255, shift, (size, size), flags=cv2.INTER_AREA)
        weight = free[..., None].astype(np.float32) / 255.0
        self._floor = (weight * np.array(_FREE) + (1.0 - weight) * np.array(_GROUND)).astype(np.uint8)

    def _pixel(self, positions: npt.ArrayLike) -> npt.NDArray[np.int32]:
        """(x, y) (..., 2) of world positions (..., 3) m."""
        row_column = (self._map.pixel(positions) + 0.5 - self._offset) * self._scale
        return np.asarray(np.round(row_column[..., ::-1]), np.int32)

    def draw(
        self,
        path: npt.NDArray[np.float64],
        heading: float,
        targets: tuple[Target, ...],
        answers: npt.NDArray[np.float64],
    ) -> Image:
        """The floor with the targets' boxes, the path walked (n, 3) m, the body and its declared places (k, 3) m, world frame."""
        picture = self._floor.copy()
        for target in targets:
            a, b = self._pixel(target.aabb_min), self._pixel(target.aabb_max)
            cv2.rectangle(picture, a.tolist(), b.tolist(), _TARGET, -1 if np.ptp([a, b]) < 3 else 2, cv2.LINE_AA)
            cv2.circle(picture, self._pixel(target.centre).tolist(), 4, _TARGET, -1, cv2.LINE_AA)
        if len(path) > 1:
            cv2.polylines(picture, [self._pixel(path)], False, _PATH, 2, cv2.LINE_AA)
        for answer in answers:
            cv2.drawMarker(picture, self._pixel(answer).tolist(), _BODY, cv2.MARKER_TILTED_CROSS, 10, 2, cv2.LINE_AA)
        ahead = np.array([-np.sin(heading), -np.cos(heading)])
        side = np.array([-ahead[1], ahead[0]])
        corners = np.array([1.0 * ahead, -0.6 * ahead + 0.6 * side, -0.6 * ahead - 0.6 * side]) * max(
            7.0, self.size / 45.0
        )
        cv2.fillPoly(picture, [np.round(self._pixel(path[-1]) + corners).astype(np.int32)], _BODY, cv2.LINE_AA)
        return np.asarray(picture, np.uint8)
