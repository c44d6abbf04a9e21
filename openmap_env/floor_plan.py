"""A home from above, with an episode on it: rooms, furniture, the path walked, the targets and the answers."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from openmap_env.episodes.episode import Target
from openmap_env.navigation import NavigableSurface
from openmap_scenes import Instance, Scene

Image = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

TARGET, PATH, BODY, ANSWER = (34, 150, 66), (38, 98, 214), (214, 48, 40), (230, 140, 0)
_OUTSIDE, _ROOM, _FREE = (24, 26, 30), (204, 207, 212), (230, 232, 235)
_THING, _EDGE, _NAME = (172, 176, 183), (136, 140, 148), (58, 63, 72)
_SMOOTH, _SHIFT = 8, 3
"""OpenCV draws at 2**-3 of a pixel."""
_STRUCTURE = frozenset(
    {
        "wall",
        "floor",
        "ceiling",
        "door",
        "doorway",
        "door frame",
        "window",
        "room",
        "skirting",
        "beam",
        "column",
        "roof",
    }
)
_TALLEST, _FLATTEST = 2.2, 0.05


class FloorPlan:
    """The floor of a scene from above, ``size`` pixels square, -Z up; ``draw`` puts an episode on it."""

    def __init__(self, scene: Scene, surface: NavigableSurface, size: int) -> None:
        top_down = surface.top_down_map()
        rows, columns = np.nonzero(top_down.navigable)
        low, high = np.array([rows.min(), columns.min()]), np.array([rows.max(), columns.max()]) + 1
        margin = 0.06 * float((high - low).max()) + 4.0
        self._scale = size / (float((high - low).max()) + 2.0 * margin)
        self._offset = (low + high) / 2.0 - size / 2.0 / self._scale
        self._map, self.size = top_down, size
        self._ground = self._background(scene, surface)

    def _background(self, scene: Scene, surface: NavigableSurface) -> Image:
        size = self.size
        picture = np.full((size, size, 3), _OUTSIDE, np.uint8)
        for room in scene.rooms:
            self._box(picture, room.aabb_min, room.aabb_max, _ROOM, -1)
        floor = cv2.resize(self._map.navigable.astype(np.uint8), None, fx=2.0, fy=2.0, interpolation=cv2.INTER_NEAREST)
        # Bodies keep their radius from walls; what they can touch is floor as well.
        reach = max(1, round(2.0 * surface.body.radius / self._map.resolution))
        floor = cv2.dilate(floor, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
        s = self._scale / 2.0
        shift = np.array([[s, 0.0, -2.0 * s * self._offset[1]], [0.0, s, -2.0 * s * self._offset[0]]])
        free = cv2.warpAffine(floor * 255, shift, (size, size), flags=cv2.INTER_AREA)
        weight = free[..., None].astype(np.float32) / 255.0
        picture = (weight * np.array(_FREE) + (1.0 - weight) * picture).astype(np.uint8)
        level = float(np.median(surface.centres[surface.island == 0, 1]))
        for thing in sorted(scene.instances, key=lambda i: float(i.aabb_max[1])):
            if _stands_about(thing, level):
                self._box(picture, thing.aabb_min, thing.aabb_max, _THING, -1)
                self._box(picture, thing.aabb_min, thing.aabb_max, _EDGE, 1)
        for room in scene.rooms:
            self._name(picture, room.name.replace("_", " "), room.aabb_min, room.aabb_max)
        return np.asarray(picture, np.uint8)

    def _pixel(self, positions: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(x, y) (..., 2) of world positions (..., 3) m, pixel centres at integers."""
        row_column = (self._map.pixel(positions) + 0.5 - self._offset) * self._scale - 0.5
        return np.asarray(row_column[..., ::-1], np.float64)

    def _fine(self, positions: npt.ArrayLike) -> npt.NDArray[np.int32]:
        """Pixels in OpenCV's fixed point of ``_SHIFT`` binary digits."""
        return np.asarray(np.round(self._pixel(positions) * _SMOOTH), np.int32)

    def _box(self, picture: Image, low: npt.ArrayLike, high: npt.ArrayLike, colour: Colour, thickness: int) -> None:
        a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
        corners = np.round(self._pixel([a, b])).astype(int)
        cv2.rectangle(picture, corners.min(0).tolist(), corners.max(0).tolist(), colour, thickness)

    def _name(self, picture: Image, name: str, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]) -> None:
        ends = self._pixel([low, high])
        room = float(np.ptp(ends[:, 0])) - 6.0
        (width, height), _ = cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, 1.0, 1)
        scale = min(room / max(width, 1), self.size / 900.0)
        if scale >= 0.28:
            x, y = ends.mean(0) - (0.5 * scale * width, -0.5 * scale * height)
            place = (round(float(x)), round(float(y)))
            for colour, thickness in ((_FREE, 3), (_NAME, 1)):
                cv2.putText(picture, name, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thickness, cv2.LINE_AA)

    def draw(
        self,
        path: npt.NDArray[np.float64],
        heading: float,
        targets: tuple[Target, ...],
        answers: npt.NDArray[np.float64],
    ) -> Image:
        """The floor with the targets' boxes, the path walked (n, 3) m, the body and its declared places (k, 3) m, world frame."""
        picture = self._ground.copy()
        width = max(2, self.size // 160)
        for target in targets:
            self._box(picture, target.aabb_min, target.aabb_max, TARGET, width)
            self._dot(picture, target.centre, 1.5 * width, TARGET)
        if len(path) > 1:
            cv2.polylines(picture, [self._fine(path)], False, PATH, width, cv2.LINE_AA, _SHIFT)
        for rank, answer in enumerate(answers[::-1], 1):
            best = rank == len(answers)
            at = np.round(self._pixel(answer)).astype(int).tolist()
            cv2.drawMarker(
                picture,
                at,
                ANSWER,
                cv2.MARKER_TILTED_CROSS,
                (6 if best else 4) * width,
                width if best else 1,
                cv2.LINE_AA,
            )
        ahead = np.array([-np.sin(heading), -np.cos(heading)])
        side = np.array([-ahead[1], ahead[0]])
        corners = np.array([ahead, -0.7 * ahead + 0.65 * side, -0.4 * ahead, -0.7 * ahead - 0.65 * side])
        shape = self._pixel(path[-1]) + corners * max(8.0, self.size / 36.0)
        cv2.fillPoly(picture, [np.round(shape * _SMOOTH).astype(np.int32)], BODY, cv2.LINE_AA, _SHIFT)
        cv2.polylines(
            picture, [np.round(shape * _SMOOTH).astype(np.int32)], True, (255, 255, 255), 1, cv2.LINE_AA, _SHIFT
        )
        return np.asarray(picture, np.uint8)

    def _dot(self, picture: Image, position: npt.ArrayLike, radius: float, colour: Colour) -> None:
        x, y = self._fine(position).tolist()
        cv2.circle(picture, (x, y), round(radius * _SMOOTH), colour, -1, cv2.LINE_AA, _SHIFT)


def _stands_about(thing: Instance, level: float) -> bool:
    """Whether it is furniture that a plan shows: no part of the building, neither flat on the floor nor under the ceiling."""
    bottom, top = float(thing.aabb_min[1]) - level, float(thing.aabb_max[1]) - level
    return (
        thing.category not in _STRUCTURE and bottom < 1.0 and top > _FLATTEST and bottom > -0.5 and top < _TALLEST + 0.6
    )
