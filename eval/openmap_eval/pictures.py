"""Pictures for people: depth in colours, masks over a picture, the map from above with names, similarity as heat."""

from __future__ import annotations

import colorsys
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_agents.exploration.occupancy import FREE, OCCUPIED, OccupancyMap
from openmap_agents.grounding.lexicon import STRUCTURE
from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.mapping.whole_file import write_whole_file

Picture = npt.NDArray[np.uint8]
"""(h, w, 3) uint8 sRGB."""

PAPER, FLOOR, WALL, INK, PATH = (250, 250, 247), (228, 229, 226), (120, 122, 126), (35, 38, 44), (214, 69, 65)
FONT = cv2.FONT_HERSHEY_SIMPLEX


def instance_colour(instance_id: int) -> tuple[int, int, int]:
    """A colour that neighbouring ids do not share; the same for an id everywhere."""
    hue = (instance_id * 0.61803398875) % 1.0
    light = (0.45, 0.58, 0.70)[instance_id % 3]
    red, green, blue = colorsys.hls_to_rgb(hue, light, 0.65)
    return round(red * 255), round(green * 255), round(blue * 255)


def mask_picture(rgb: Picture, labels: npt.NDArray[np.int32]) -> Picture:
    """Masks (H, W) 0..n in colours over their picture, with edges."""
    colours = np.array([(0, 0, 0)] + [instance_colour(i) for i in range(1, int(labels.max(initial=0)) + 1)], np.float32)
    shown = rgb.astype(np.float32)
    inside = labels > 0
    shown[inside] = 0.45 * shown[inside] + 0.55 * colours[labels[inside]]
    edges = np.zeros(labels.shape, bool)
    edges[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edges[1:] |= labels[1:] != labels[:-1]
    shown[edges] = 255
    return shown.astype(np.uint8)


@dataclass(frozen=True)
class Plan:
    """A window onto the floor, seen from above: x to the right, z down.

    Parameters
    ----------
    low, high : (2,) float
        Corners (x, z) m.
    scale : float
        Pixels a metre.
    """

    low: npt.NDArray[np.float64]
    high: npt.NDArray[np.float64]
    scale: float

    @classmethod
    def around(
        cls, points: npt.NDArray[np.floating], size: tuple[int, int], margin: float = 0.4, tight: bool = False
    ) -> Plan:
        """The window of (width, height) px, or at most that if ``tight``, that holds the points (n, 3) m in its middle."""
        flat = np.asarray(points, np.float64)[:, [0, 2]] if len(points) else np.zeros((1, 2))
        low, high = flat.min(0) - margin, flat.max(0) + margin
        scale = float(np.min(np.array(size) / np.maximum(high - low, 1.0)))
        if tight:
            return cls(low, high, scale)
        half, middle = np.array(size) / scale / 2, (low + high) / 2
        return cls(middle - half, middle + half, scale)

    def pixels(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
        """Pixel (column, row) of points (n, 3) m."""
        return np.floor((np.asarray(points, np.float64)[:, [0, 2]] - self.low) * self.scale).astype(np.int32)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) px."""
        width, height = np.rint((self.high - self.low) * self.scale).astype(int)
        return int(width), int(height)

    def blank(self) -> Picture:
        width, height = self.size
        return np.full((height, width, 3), PAPER, np.uint8)


def draw_occupancy(picture: Picture, plan: Plan, occupancy: OccupancyMap) -> None:
    """Floor and obstacles as the agent knows them."""
    grid = occupancy.grid
    colours = np.full((*grid.shape, 3), PAPER, np.uint8)
    colours[grid == FREE] = FLOOR
    colours[grid == OCCUPIED] = WALL
    # Picture = window of the grid, scaled; the grid's corner lies at its origin.
    factor = plan.scale * occupancy.resolution
    shift = (np.asarray(occupancy.origin) - plan.low) * plan.scale
    T_plan_grid = np.array([[factor, 0, shift[0]], [0, factor, shift[1]]], np.float64)
    warped = cv2.warpAffine(colours, T_plan_grid, plan.size, flags=cv2.INTER_NEAREST, borderValue=PAPER)
    picture[:] = warped


def draw_points(picture: Picture, plan: Plan, points: npt.NDArray[np.floating], colours: npt.NDArray[np.uint8]) -> None:
    """Points (n, 3) m in colours (n, 3), the highest on top, as squares of a voxel's size."""
    order = np.argsort(points[:, 1], kind="stable")
    columns, rows = plan.pixels(points[order]).T
    colours = colours[order]
    half = max(1, round(plan.scale * 0.05 / 2))
    width, height = plan.size
    for dr in range(-half, half + 1):
        for dc in range(-half, half + 1):
            r, c = rows + dr, columns + dc
            inside = (r >= 0) & (r < height) & (c >= 0) & (c < width)
            picture[r[inside], c[inside]] = colours[inside]


def things(instance_map: InstanceMap) -> list[MapInstance]:
    """The instances that are no floor, wall or ceiling, by shape or by name."""
    return [i for i in instance_map.instances if not i.is_structure and i.label not in STRUCTURE]


def draw_instances(picture: Picture, plan: Plan, instances: Sequence[MapInstance]) -> None:
    """Instances in their colours."""
    if not instances:
        return
    points = np.concatenate([i.points for i in instances])
    colours = np.concatenate(
        [np.tile(np.array(instance_colour(i.id), np.uint8), (len(i.points), 1)) for i in instances]
    )
    draw_points(picture, plan, points, colours)


def draw_path(picture: Picture, plan: Plan, trajectory: npt.NDArray[np.floating]) -> None:
    """The walk (n, 3) m as a line with a dot where it ends."""
    if len(trajectory) == 0:
        return
    pixels = plan.pixels(trajectory)
    cv2.polylines(picture, [pixels.reshape(-1, 1, 2)], False, PATH, 1, cv2.LINE_AA)
    cv2.circle(picture, tuple(map(int, pixels[-1])), 5, PATH, -1, cv2.LINE_AA)


def draw_labels(
    picture: Picture, plan: Plan, places: Sequence[tuple[npt.NDArray[np.floating], str]], size: float = 0.42
) -> None:
    """Names beside their places (3,) m; see ``draw_names``."""
    if places:
        pixels = plan.pixels(np.stack([place for place, _ in places]))
        draw_names(picture, [(int(u), int(v), text) for (u, v), (_, text) in zip(pixels, places, strict=True)], size)


def draw_names(picture: Picture, names: Sequence[tuple[int, int, str]], size: float = 0.42) -> None:
    """Write (column, row, text); each finds the free spot nearest to its pixel, and one that finds none is left out."""
    height, width = picture.shape[:2]
    taken = np.zeros((height, width), bool)
    for column, row, text in names:
        (w, h), _ = cv2.getTextSize(text, FONT, size, 1)
        spot = _free_spot(taken, column, row, w + 4, h + 6)
        if spot is None:
            continue
        left, top = spot
        taken[top : top + h + 6, left : left + w + 4] = True
        middle = (left + w // 2, top + h // 2)
        if abs(middle[0] - column) > w // 2 + 6 or abs(middle[1] - row) > h + 6:
            cv2.line(picture, (column, row), middle, INK, 1, cv2.LINE_AA)
        cv2.circle(picture, (column, row), 2, INK, -1, cv2.LINE_AA)
        box = picture[top : top + h + 6, left : left + w + 4]
        box[:] = (0.25 * box + 0.75 * 255).astype(np.uint8)
        cv2.putText(picture, text, (left + 2, top + h + 2), FONT, size, INK, 1, cv2.LINE_AA)


def _free_spot(taken: npt.NDArray[np.bool_], column: int, row: int, w: int, h: int) -> tuple[int, int] | None:
    """Top left corner of the free w x h box nearest to a pixel, on rings around it."""
    height, width = taken.shape
    for ring in range(12):
        for dy in sorted(range(-ring, ring + 1), key=abs):
            for dx in (-ring, ring) if abs(dy) != ring else range(-ring, ring + 1):
                left, top = column - w // 2 + dx * (w // 3), row - h // 2 + dy * h
                inside = left >= 0 and top >= 0 and left + w <= width and top + h <= height
                if inside and not taken[top : top + h, left : left + w].any():
                    return left, top
    return None


def heat_colours(values: npt.NDArray[np.floating]) -> npt.NDArray[np.uint8]:
    """Colours (n, 3) of values (n,), the smallest dark and the largest bright."""
    low, high = float(values.min()), float(values.max())
    scaled = (40 + 215 * (values - low) / max(high - low, 1e-9)).astype(np.uint8)
    bgr = cv2.applyColorMap(scaled.reshape(-1, 1), cv2.COLORMAP_INFERNO)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).reshape(-1, 3), np.uint8)


def map_picture(
    instance_map: InstanceMap,
    labels: Mapping[int, str],
    occupancy: OccupancyMap | None = None,
    trajectory: npt.NDArray[np.floating] | None = None,
    size: tuple[int, int] = (1400, 1000),
) -> Picture:
    """The map from above: floor, instances in colours, the walk, names."""
    shown = things(instance_map)
    plan = Plan.around(_extent(instance_map), size, tight=True)
    picture = plan.blank()
    if occupancy is not None:
        draw_occupancy(picture, plan, occupancy)
    draw_instances(picture, plan, shown)
    if trajectory is not None:
        draw_path(picture, plan, trajectory)
    by_size = sorted(shown, key=lambda i: -len(i.points))
    draw_labels(picture, plan, [(i.centre, labels[i.id]) for i in by_size if i.id in labels])
    return picture


def recording_picture(
    instance_map: InstanceMap, trajectory: npt.NDArray[np.floating], size: tuple[int, int] = (1400, 1000)
) -> Picture:
    """The map of a recording from above: what is built in grey and without ceilings, things in colours with their names, the
    camera's way (n, 3) m."""
    shown = things(instance_map)
    plan = Plan.around(_extent(instance_map), size, tight=True)
    picture = plan.blank()
    built = {i.id for i in instance_map} - {i.id for i in shown}
    parts = [i.points for i in instance_map if i.id in built and not _overhead(i, trajectory)]
    if parts:
        points = np.concatenate(parts)
        low, high = np.percentile(points[:, 1], [1.0, 99.0])
        share = np.clip((points[:, 1:2] - low) / max(high - low, 1e-9), 0.0, 1.0)
        draw_points(picture, plan, points, (np.array(FLOOR) * (1 - share) + np.array(WALL) * share).astype(np.uint8))
    draw_instances(picture, plan, shown)
    draw_path(picture, plan, trajectory)
    by_size = sorted(shown, key=lambda i: (-len(i.points), i.id))
    draw_labels(picture, plan, [(i.centre, i.label) for i in by_size if i.label])
    return picture


def _overhead(instance: MapInstance, trajectory: npt.NDArray[np.floating]) -> bool:
    """Whether it would hide the rest from above: a ceiling by name, or all of it above the camera."""
    highest = float(trajectory[:, 1].max()) if len(trajectory) else np.inf
    return instance.label == "ceiling" or float(instance.aabb_min[1]) > highest


def heat_picture(
    instance_map: InstanceMap,
    scores: Mapping[int, float],
    labels: Mapping[int, str],
    occupancy: OccupancyMap | None = None,
    top: int = 5,
    size: tuple[int, int] = (1000, 720),
) -> Picture:
    """The map from above, each instance in the heat of its score, the ``top`` best with rank and name."""
    shown = sorted(
        (i for i in instance_map.instances if i.id in scores and not i.is_structure), key=lambda i: scores[i.id]
    )
    plan = Plan.around(_extent(instance_map), size, tight=True)
    picture = plan.blank()
    if occupancy is not None:
        draw_occupancy(picture, plan, occupancy)
    if shown:
        heat = heat_colours(np.array([scores[i.id] for i in shown]))
        points = np.concatenate([i.points for i in shown])
        draw_points(picture, plan, points, np.repeat(heat, [len(i.points) for i in shown], axis=0))
    best = shown[::-1][:top]
    draw_labels(picture, plan, [(i.centre, f"{n}. {labels.get(i.id, '?')}") for n, i in enumerate(best, start=1)], 0.5)
    return picture


def _extent(instance_map: InstanceMap) -> npt.NDArray[np.floating]:
    """Two corners (2, 3) m around everything in the map, but for the farthest thousandth of its points."""
    if not len(instance_map):
        return np.zeros((1, 3))
    return np.asarray(np.percentile(np.concatenate([i.points for i in instance_map]), [0.1, 99.9], axis=0))


def titled(picture: Picture, title: str) -> Picture:
    """A picture with a title in its upper left corner."""
    shown = picture.copy()
    (w, h), _ = cv2.getTextSize(title, FONT, 0.5, 1)
    cv2.rectangle(shown, (0, 0), (w + 12, h + 12), (20, 20, 20), -1)
    cv2.putText(shown, title, (6, h + 6), FONT, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return shown


def write_png(path: Path, picture: Picture) -> None:
    """Write a picture under a temporary name, then rename it; DataError where it cannot be written."""
    data = io.BytesIO()
    Image.fromarray(picture).save(data, format="PNG")
    write_whole_file(path, data.getvalue())
