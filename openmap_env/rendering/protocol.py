"""One Renderer protocol, three backends: what a camera at a place sees of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from openmap_scenes import PinholeCamera, Scene


class RendererUnavailableError(RuntimeError):
    """A backend cannot run on this machine; the message names what is missing and the package that brings it."""


@dataclass(frozen=True)
class Frame:
    """What one camera pose sees.

    Parameters
    ----------
    rgb : (H, W, 3) uint8
        sRGB; black where nothing is.
    depth : (H, W) float32 m
        Planar; 0 = nothing seen.
    instance : (H, W) int32
        ``Instance.id``; 0 = none.
    """

    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32]
    instance: npt.NDArray[np.int32]


class Renderer(Protocol):
    """Renders one scene through one camera. Faces are seen from both sides. The arrays of a frame are the caller's to keep."""

    scene: Scene
    camera: PinholeCamera

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4)."""
        ...

    def close(self) -> None:
        """Give back the graphics context; closing twice is harmless."""
        ...


@runtime_checkable
class LooksAhead(Protocol):
    """A renderer that is faster where it knows ahead from where it will look; its pictures are the same."""

    def learn(self, places: npt.NDArray[np.floating], progress: Callable[[int, int], None] | None = None) -> None:
        """Find out what shows from places (n, 3) m, or take it from the disk, where it is kept."""
        ...

    def recall(self, places: npt.NDArray[np.floating]) -> bool:
        """Take what was found out earlier for the same places from the disk; whether there was something."""
        ...
