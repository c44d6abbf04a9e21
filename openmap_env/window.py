"""A window for people who watch: shows one picture after the other, with pygame."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled

_INSTEAD = "or take render_mode='rgb_array', which gymnasium.wrappers.RecordVideo turns into a film"


def check_display() -> None:
    """Return if a window can be opened.

    Raises
    ------
    gymnasium.error.DependencyNotInstalled
        There is no pygame.
    ValueError
        There is no display.
    """
    if find_spec("pygame") is None:
        raise DependencyNotInstalled(
            f"render_mode is 'human', expected pygame for it; pip install 'openmap-nav[window]', {_INSTEAD}"
        )
    places = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, places)):
        raise ValueError(
            f"render_mode is 'human', expected a display for it: {' and '.join(places[:2])} are not set; "
            f"run where one is (ssh -X, xvfb-run), {_INSTEAD}"
        )


def has_display() -> bool:
    """Whether a window can be opened, as far as can be told without opening one."""
    try:
        check_display()
    except (DependencyNotInstalled, ValueError):
        return False
    return True


class Window:
    """One window; it opens with the first picture.

    Parameters
    ----------
    title : str
    pictures_per_second : float
        ``show`` waits as long as that takes.
    """

    def __init__(self, title: str, pictures_per_second: float) -> None:
        self._title, self._rate = title, pictures_per_second
        self._screen: Any = None
        self._clock: Any = None

    def show(self, picture: npt.NDArray[np.uint8]) -> None:
        """Show a picture (H, W, 3) uint8; RuntimeError where the display refuses."""
        import pygame

        if self._screen is None:
            try:
                pygame.display.init()
                pygame.display.set_caption(self._title)
                self._screen = pygame.display.set_mode((picture.shape[1], picture.shape[0]))
            except pygame.error as error:
                raise RuntimeError(f"no window opens ({error}); run where a display is, {_INSTEAD}") from error
            self._clock = pygame.time.Clock()
        pygame.event.pump()
        self._screen.blit(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
        pygame.display.flip()
        self._pause()

    def _pause(self) -> None:
        self._clock.tick(self._rate)

    def close(self) -> None:
        """Close the window; again is harmless."""
        if self._screen is not None:
            import pygame

            pygame.display.quit()
        self._screen = self._clock = None
