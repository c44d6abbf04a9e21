"""What a camera at a place sees of a scene: one Renderer protocol, three backends.

``opengl`` (the default) draws colour, depth and ids in one pass; ``pyrender`` draws with that library in two; ``raycast`` is the
plain reference, which needs no OpenGL; ``auto`` is ``opengl`` where there is a context for it and ``raycast`` elsewhere. They
agree within texture filtering.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from importlib import import_module
from typing import Any

from openmap_env.rendering.protocol import Frame, LooksAhead, Renderer, RendererUnavailableError
from openmap_env.rendering.settings import checked
from openmap_scenes import PinholeCamera, Scene

__all__ = [
    "AUTO",
    "RENDERERS",
    "Frame",
    "LooksAhead",
    "Renderer",
    "RendererUnavailableError",
    "make_renderer",
    "prepare",
]

AUTO = "auto"
"""The name that stands for ``opengl`` or, where no context opens, ``raycast``."""

# Module and class; imported when chosen, since each brings libraries that the others can do without.
RENDERERS = {
    "opengl": ("opengl", "OpenGLRenderer"),
    "pyrender": ("pyrender", "PyrenderRenderer"),
    "raycast": ("raycast", "RaycastRenderer"),
}
_log = logging.getLogger(__name__)
_warned: set[str] = set()


def make_renderer(
    name: str, scene: Scene, camera: PinholeCamera, *, near: float = 0.05, far: float = 100.0, **settings: Any
) -> Renderer:
    """A renderer by name.

    Parameters
    ----------
    name : {"opengl", "pyrender", "raycast", "auto"}
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is seen.
    **settings
        What that backend takes besides, such as ``platform="osmesa"`` for ``opengl``. For ``auto`` those of ``opengl``.

    Raises
    ------
    ValueError
        There is no renderer of that name, it takes no such setting, or a setting makes no sense.
    RendererUnavailableError
        The backend cannot run on this machine; the message names the package that is missing.
    """
    kind = _kind("opengl" if name == AUTO else name)
    given = checked(kind, name, {"near": near, "far": far, **settings})
    if name != AUTO:
        renderer: Renderer = kind(scene, camera, **given)
        return renderer
    try:
        return make_renderer("opengl", scene, camera, **given)
    except RendererUnavailableError as error:
        reason = str(error)
    if reason not in _warned:
        _warned.add(reason)
        _log.warning("rendering by ray casting on the CPU, which is slower: %s", reason)
    return make_renderer("raycast", scene, camera, near=near, far=far)


def prepare(name: str, scene: Scene, camera: PinholeCamera, **settings: Any) -> None:
    """Do ahead what ``make_renderer`` with the same arguments would do before it opens a context, and keep it for then.

    It needs no OpenGL and may run in any thread. Where a backend has nothing to do ahead, nothing happens.

    Raises
    ------
    ValueError
        As ``make_renderer``.
    """
    chosen = "opengl" if name == AUTO else name
    given = checked(_kind(chosen), name, settings)
    ahead: Callable[..., None] | None = getattr(_module(chosen), f"prepare_{chosen}", None)
    if ahead is not None:
        ahead(scene, camera, **given)


def _module(name: str) -> Any:
    return import_module(f"{__name__}.{RENDERERS[name][0]}")


def _kind(name: str) -> Any:
    if name not in RENDERERS:
        raise ValueError(f"renderer is {name!r}, expected one of {', '.join((*RENDERERS, AUTO))}")
    return getattr(_module(name), RENDERERS[name][1])
