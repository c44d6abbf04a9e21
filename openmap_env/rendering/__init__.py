"""What a camera at a place sees of a scene: one Renderer protocol, three backends.

``opengl`` (the default) draws colour, depth and ids in one pass; ``pyrender`` draws with that library on OSMesa; ``raycast`` is
the plain reference, which needs no OpenGL. They agree within texture filtering.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from openmap_env.rendering.protocol import Frame, Renderer, RendererUnavailableError
from openmap_scenes import PinholeCamera, Scene

__all__ = ["RENDERERS", "Frame", "Renderer", "RendererUnavailableError", "make_renderer"]


def _opengl(scene: Scene, camera: PinholeCamera, **settings: Any) -> Renderer:
    from openmap_env.rendering.opengl import OpenGLRenderer

    return OpenGLRenderer(scene, camera, **settings)


def _pyrender(scene: Scene, camera: PinholeCamera, **settings: Any) -> Renderer:
    from openmap_env.rendering.pyrender import PyrenderRenderer

    return PyrenderRenderer(scene, camera, **settings)


def _raycast(scene: Scene, camera: PinholeCamera, **settings: Any) -> Renderer:
    from openmap_env.rendering.raycast import RaycastRenderer

    return RaycastRenderer(scene, camera, **settings)


# Imported when chosen: each brings libraries that the others can do without.
RENDERERS: dict[str, Callable[..., Renderer]] = {"opengl": _opengl, "pyrender": _pyrender, "raycast": _raycast}


def make_renderer(
    name: str, scene: Scene, camera: PinholeCamera, *, near: float = 0.05, far: float = 100.0, **settings: Any
) -> Renderer:
    """A renderer by name.

    Parameters
    ----------
    name : {"opengl", "pyrender", "raycast"}
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is seen.
    **settings
        What that backend takes besides, such as ``platform="osmesa"`` for ``opengl``.

    Raises
    ------
    ValueError
        There is no renderer of that name, or near and far make no sense.
    RendererUnavailableError
        The backend cannot run on this machine; the message names the package that is missing.
    """
    if name not in RENDERERS:
        raise ValueError(f"renderer is {name!r}, expected one of {', '.join(RENDERERS)}")
    return RENDERERS[name](scene, camera, near=near, far=far, **settings)
