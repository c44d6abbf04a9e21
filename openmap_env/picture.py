"""One picture of an episode for people: what was asked, what the agent sees, how far that is, and where it stands."""

from __future__ import annotations

import textwrap
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

from openmap_env.floor_plan import ANSWER, BODY, PATH, TARGET, Colour, FloorPlan, Image
from openmap_env.measures import Walk
from openmap_env.navigation import NavigableSurface
from openmap_env.rendering import Frame
from openmap_scenes import PinholeCamera, Scene

DEPTH_SHOWN = 6.0
"""Depths from here on, m, have the same colour."""
_GROUND, _TEXT, _FAINT = (24, 26, 30), (238, 240, 243), (150, 156, 165)
_PANEL, _GAP, _CAPTION, _FOOT = 400, 8, 62, 30
_SIZES = (21, 19, 17, 15, 13)


def coloured_depth(depth: npt.NDArray[np.float32]) -> Image:
    """A planar depth picture (H, W) m as (H, W, 3) uint8: near is warm, far is cold, nothing is black."""
    picture = _colours(np.clip(depth / DEPTH_SHOWN, 0.0, 1.0))
    picture[depth <= 0.0] = 0
    return picture


def _colours(share: npt.NDArray[np.floating]) -> Image:
    level = (255.0 * (1.0 - share)).astype(np.uint8)
    return np.ascontiguousarray(cv2.applyColorMap(level, cv2.COLORMAP_TURBO)[..., ::-1], np.uint8)


class EpisodePicture:
    """Draws the episodes of a home, pictures of one size: caption, camera, depth and floor plan side by side, legend.

    Small cameras are shown enlarged by a whole number, so that text beside them can be read.
    """

    def __init__(self, scene: Scene, surface: NavigableSurface, camera: PinholeCamera) -> None:
        self._zoom = max(1, round(_PANEL / camera.height))
        self._h, self._w = camera.height * self._zoom, camera.width * self._zoom
        self._plan = FloorPlan(scene, surface, self._h)
        # Video codecs want even sizes.
        width, height = 2 * self._w + self._h + 4 * _GAP, _CAPTION + self._h + _FOOT
        self._blank = np.full((height + height % 2, width + width % 2, 3), _GROUND, np.uint8)
        self._depth_scale = _depth_scale(min(self._w // 2, 220))

    def draw(self, frame: Frame, instruction: str, walk: Walk, heading: float) -> Image:
        """The picture (h, w, 3) uint8 of a moment; a heading is in radians."""
        picture = self._blank.copy()
        self._paste(picture, self._enlarged(frame.rgb), _GAP, _CAPTION)
        self._paste(picture, self._enlarged(coloured_depth(frame.depth)), 2 * _GAP + self._w, _CAPTION)
        plan = self._plan.draw(np.array(walk.path), heading, walk.targets, walk.declared)
        self._paste(picture, plan, 3 * _GAP + 2 * self._w, _CAPTION)
        caption = _caption(instruction, picture.shape[1] - 2 * _GAP)
        self._paste(picture, caption, _GAP, (_CAPTION - caption.shape[0]) // 2)
        foot = _CAPTION + self._h + 4
        self._paste(picture, _status(walk), _GAP, foot)
        self._paste(picture, self._depth_scale, 2 * _GAP + self._w, foot)
        self._paste(picture, _legend(), 3 * _GAP + 2 * self._w, foot)
        return picture

    def _enlarged(self, picture: Image) -> Image:
        return picture.repeat(self._zoom, 0).repeat(self._zoom, 1) if self._zoom > 1 else picture

    @staticmethod
    def _paste(picture: Image, part: Image, x: int, y: int) -> None:
        part = part[: picture.shape[0] - y, : picture.shape[1] - x]
        picture[y : y + part.shape[0], x : x + part.shape[1]] = part


@cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """DejaVu, which has Greek and Cyrillic, and which matplotlib brings."""
    matplotlib = find_spec("matplotlib")
    if matplotlib is not None and matplotlib.origin is not None:
        file = Path(matplotlib.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if file.exists():
            return ImageFont.truetype(str(file), size)
    return ImageFont.load_default(size)


def _written(text: str, size: int, colour: Colour = _TEXT) -> Image:
    """Lines of text as a picture as large as they are."""
    font = _font(size)
    measure = ImageDraw.Draw(Pictures.new("RGB", (1, 1)))
    _, _, right, bottom = measure.multiline_textbbox((0, 0), text, font=font, spacing=3)
    image = Pictures.new("RGB", (int(right) + 2, int(bottom) + 2), _GROUND)
    ImageDraw.Draw(image).multiline_text((0, 0), text, fill=colour, font=font, spacing=3)
    return np.asarray(image, np.uint8)


@lru_cache(8)
def _caption(instruction: str, width: int) -> Image:
    """An instruction on at most two lines, in the largest type in which it fits; shortened where none does."""
    for size in _SIZES:
        columns = max(8, int(width / _font(size).getlength("n")))
        for attempt in range(columns, columns // 2, -1):
            lines = textwrap.wrap(instruction, attempt)
            if len(lines) > 2:
                break
            written = _written("\n".join(lines), size)
            if written.shape[1] <= width:
                return written
    columns = max(8, int(width / _font(_SIZES[-1]).getlength("n")))
    return _written("\n".join(textwrap.wrap(instruction, columns, max_lines=2, placeholder=" …")), _SIZES[-1])[
        :, :width
    ]


def _status(walk: Walk) -> Image:
    state = "stopped" if walk.stopped else f"step {len(walk.path) - 1}"
    parts = [state]
    if walk.collisions:
        parts.append(f"{walk.collisions} collision{'s' if walk.collisions > 1 else ''}")
    return _written("   ".join(parts), 14, _FAINT)


def _depth_scale(width: int) -> Image:
    ends = _written("0 m", 14, _FAINT), _written(f"{DEPTH_SHOWN:g} m +", 14, _FAINT)
    height = max(end.shape[0] for end in ends)
    bar = np.full((height, width, 3), _GROUND, np.uint8)
    bar[3:-3] = _colours(np.linspace(0.0, 1.0, width)[None].repeat(height - 6, 0))
    return _row([ends[0], bar, ends[1]])


@cache
def _legend() -> Image:
    entries: list[tuple[str, Colour]] = [("agent", BODY), ("path", PATH), ("target", TARGET), ("answer", ANSWER)]
    parts = []
    for name, colour in entries:
        text = _written(name, 14, _FAINT)
        dot = np.full((text.shape[0], 12, 3), _GROUND, np.uint8)
        cv2.circle(dot, (6, text.shape[0] // 2 + 1), 5, colour, -1, cv2.LINE_AA)
        parts.append(_row([dot, text], 4))
    return _row(parts, 14)


def _row(parts: list[Image], gap: int = 8) -> Image:
    height = max(part.shape[0] for part in parts)
    row = np.full((height, sum(part.shape[1] for part in parts) + gap * (len(parts) - 1), 3), _GROUND, np.uint8)
    x = 0
    for part in parts:
        row[: part.shape[0], x : x + part.shape[1]] = part
        x += part.shape[1] + gap
    return row
