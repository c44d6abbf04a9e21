"""The pyrender backend: that library's scene, materials, textures and shaders, with what keeps it from long walks put right.

- PyOpenGL names a context by a fresh pointer object at every question, so pyrender's shader cache never hits and every draw
  compiles a program that is never freed. Here a context is named by its address.
- pyrender culls back faces in its segmentation pass whatever the material says, so ids would disagree with colours on scans.
- It walks over every mesh of the scene for every pass, and asks for the place of every uniform at every draw; here only what
  the frustum holds is drawn, nearest first, and only what changes is set (``pyrender_pass``).
- It uploads textures without saying that their rows are not padded to four bytes, which shears those of odd widths.
- It draws to the window, with several samples a pixel on EGL, and hands out flipped views; here it draws to a buffer of one
  sample a pixel, upside down, and reads once into the caller's arrays.
"""

from __future__ import annotations

import ctypes
import logging
import os
import sys
import weakref
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.rendering.context import (
    EGLContext,
    OSMesaContext,
    Platform,
    announce,
    bare_context,
    check_not_forked,
    lost_by_fork,
    osmesa_library,
    unavailable,
    wanted_platforms,
)
from openmap_env.rendering.geometry import (
    Batches,
    check_pose,
    check_range,
    projection_matrix,
    split_into_batches,
    view_matrix,
    visible_boxes,
)
from openmap_env.rendering.protocol import Frame, RendererUnavailableError
from openmap_scenes import PinholeCamera, Scene

# Python time is spent on every primitive of every pass, so batches are large.
_FACES_PER_PRIMITIVE = 1 << 13


class PyrenderRenderer:
    """Renders a scene with pyrender, colours first and ids in a second pass.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is drawn.
    platform : str
        Where the OpenGL context comes from, see ``context.Platform``. PyOpenGL is loaded for one platform a process, for the
        first that is used; from then on ``auto`` means that one.

    Raises
    ------
    RendererUnavailableError
        No such context can be had on this machine, or PyOpenGL was loaded for another platform earlier in this process.
    """

    def __init__(
        self,
        scene: Scene,
        camera: PinholeCamera,
        *,
        near: float = 0.05,
        far: float = 100.0,
        platform: Platform = "auto",
    ) -> None:
        check_range(near, far)
        self.scene, self.camera = scene, camera
        self._near, self._far = near, far
        self._projection = projection_matrix(camera, near, far)
        looks = np.stack([scene.face_instance, scene.face_material], 1)
        kinds, kind = np.unique(looks, axis=0, return_inverse=True)
        self._batches = split_into_batches(scene.vertices, scene.faces, kind.reshape(-1), _FACES_PER_PRIMITIVE)
        # Segmentation colours count the batches, so that ids of any size survive three bytes.
        self._batch_instance = np.concatenate([[0], kinds[self._batches.group, 0]]).astype(np.int32)
        self.platform, context, library = _open(platform)
        # Also runs when the renderer is forgotten, or at exit, while the libraries are still whole.
        self._release = weakref.finalize(self, _close, context, library)
        self._context, pyrender = context, library.pyrender
        materials = _materials(pyrender, scene)
        # Drawn from its middle, so that shaders, which count in float32, keep millimetres wherever the scene lies.
        self._T_world_drawn = np.eye(4)
        self._T_world_drawn[:3, 3] = middle = (scene.aabb[0] + scene.aabb[1]) / 2.0
        world = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 0.0))
        nodes = [
            world.add(pyrender.Mesh([_primitive(pyrender, scene, self._batches, b, materials, middle)]))
            for b in range(len(self._batches))
        ]
        with context:
            self._pass = library.make_pass(world, nodes, camera.width, camera.height)
        self._release.detach()
        self._release = weakref.finalize(self, _close, context, library, self._pass)

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4); ValueError if it is not rigid, RuntimeError after ``close``."""
        pose = check_pose(T_world_camera)
        if not self._release.alive:
            raise RuntimeError("the renderer is closed; make a new one")
        T_camera_world = view_matrix(pose)
        seen = visible_boxes(self._batches.low, self._batches.high, self._projection @ T_camera_world, pose[:3, 3])
        size = (self.camera.height, self.camera.width)
        rgb, depth = np.empty((*size, 3), np.uint8), np.empty(size, np.float32)
        code = np.empty(size, np.uint32)
        with self._context:
            self._pass.draw(seen.tolist(), T_camera_world @ self._T_world_drawn, self._projection, rgb, depth, code)
        # From the depth buffer's 0..1 to planar metres; what stayed at 1 saw nothing.
        empty = depth == 1.0
        depth *= np.float32((self._near - self._far) / self._far)
        depth += np.float32(1.0)
        np.divide(np.float32(self._near), depth, out=depth)
        depth[empty] = 0.0
        code &= 0xFFFFFF
        return Frame(rgb, depth, self._batch_instance[code])

    def close(self) -> None:
        """Give back the graphics context; closing twice is harmless."""
        self._release()


def _open(platform: Platform) -> tuple[str, EGLContext | OSMesaContext, _Library]:
    """The first platform that is wanted and works, a context of it, and pyrender loaded for it."""
    check_not_forked()
    wanted = wanted_platforms(platform)
    loaded = _loaded_for()
    if platform == "auto" and loaded:
        wanted = tuple(name for name in wanted if name.startswith(loaded)) or (loaded,)
    failures = []
    for name in wanted:
        try:
            context = bare_context(name)
        except Exception as error:  # a missing library or driver, in whatever words
            failures.append(f"{name}: {error}")
            continue
        try:
            library = _load(name.partition(":")[0])
        except BaseException:
            context.release()
            raise
        return name, context, library
    raise unavailable(failures)


def _loaded_for() -> str:
    """The platform that PyOpenGL is loaded for in this process, or will be by its own variable; "" while that is open."""
    module = sys.modules.get("OpenGL.platform")
    if module is not None:
        return {"OSMesaPlatform": "osmesa", "EGLPlatform": "egl"}.get(type(module.PLATFORM).__name__, "")
    variable = os.environ.get("PYOPENGL_PLATFORM", "")
    return variable if variable in ("egl", "osmesa") else ""


def _close(context: EGLContext | OSMesaContext, library: _Library, drawing: Any = None) -> None:
    if lost_by_fork():
        return
    address = context.address
    if drawing is not None:
        with context:
            drawing.delete()
    context.release()
    library.forget_context(address)


def _materials(pyrender: Any, scene: Scene) -> list[Any]:
    """pyrender's material of each of the scene's: two-sided, textured where the scene has texture coordinates."""
    materials = []
    for material in scene.materials:
        texture = None
        if material.texture is not None and scene.uv is not None:
            texture = pyrender.Texture(source=material.texture, source_channels="RGB")
        factor = (*material.colour.tolist(), 1.0)
        materials.append(
            pyrender.MetallicRoughnessMaterial(baseColorFactor=factor, baseColorTexture=texture, doubleSided=True)
        )
    return materials


def _primitive(
    pyrender: Any,
    scene: Scene,
    batches: Batches,
    batch: int,
    materials: list[Any],
    origin: npt.NDArray[np.float64],
) -> Any:
    """One batch of faces as a pyrender primitive with its own vertices, measured from an origin (3,) m."""
    faces = batches.order[batches.starts[batch] : batches.starts[batch + 1]]
    vertices, indices = np.unique(scene.faces[faces], return_inverse=True)
    colour = None
    if scene.vertex_colour is not None:
        colour = np.ones((len(vertices), 4), np.float32)
        colour[:, :3] = scene.vertex_colour[vertices] / np.float32(255.0)
    return pyrender.Primitive(
        positions=scene.vertices[vertices] - origin,
        # pyrender puts the origin of texture coordinates at the bottom left.
        texcoord_0=None if scene.uv is None else scene.uv[vertices] * (1.0, -1.0) + (0.0, 1.0),
        color_0=colour,
        indices=indices.reshape(-1, 3),
        material=materials[scene.face_material[faces[0]]],
        mode=pyrender.GLTF.TRIANGLES,
    )


class _Library:
    """pyrender, loaded once a process for one platform.

    Parameters
    ----------
    platform : {"egl", "osmesa"}
    """

    def __init__(self, platform: str) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", platform)  # PyOpenGL reads it once, when first imported
        if platform == "osmesa":
            osmesa_library()  # PyOpenGL's own search finds it only if it is there already
        # It reports, at every start, that its optional accelerator is not there.
        logging.getLogger("OpenGL.acceleratesupport").setLevel(logging.WARNING)
        import OpenGL

        if "OpenGL.GL" not in sys.modules:
            OpenGL.ERROR_CHECKING = False  # a question to the driver after every call takes half of a frame's time
        import pyrender
        from OpenGL import contextdata

        found = _loaded_for()
        if found != platform:
            raise RendererUnavailableError(
                f"pyrender: found PyOpenGL loaded for {found or 'a window system'}, expected {platform}. PyOpenGL takes one "
                f"platform a process: use that one, set PYOPENGL_PLATFORM={platform} before anything imports OpenGL or "
                "pyrender, or use the opengl renderer."
            )
        self.pyrender, self._platform = pyrender, platform
        self._contextdata = contextdata
        pointer_of_context = contextdata.getContext
        contextdata.getContext = lambda context=None: _address(pointer_of_context(context))

    def make_pass(self, world: Any, nodes: list[Any], width: int, height: int) -> Any:
        """What draws the nodes of a pyrender scene, in the current context."""
        from OpenGL import GL

        from openmap_env.rendering.pyrender_pass import LeanRenderer

        announce(f"{self._platform} (pyrender)", GL.glGetString(GL.GL_RENDERER).decode(errors="replace"))
        return LeanRenderer(world, nodes, width, height)

    def forget_context(self, address: int) -> None:
        """Forget the arrays that PyOpenGL keeps alive for a context."""
        for storage in self._contextdata.STORAGES:
            storage.pop(address, None)


@cache
def _load(platform: str) -> _Library:
    return _Library(platform)


def _address(context: Any) -> int:
    return context if isinstance(context, int) else int(ctypes.cast(context, ctypes.c_void_p).value or 0)
