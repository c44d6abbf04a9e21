"""The pyrender backend: that library on an OSMesa context, with what keeps it from being used for long walks put right.

- PyOpenGL names a context by a fresh pointer object at every question, so pyrender's shader cache never hits and every draw
  compiles a program that is never freed. Here a context is named by its address.
- pyrender culls back faces in its segmentation pass whatever the material says, so ids would disagree with colours on scans.
- It walks over every mesh of the scene for every pass; here only over what the frustum holds, nearest first.
- It uploads textures without saying that their rows are not padded to four bytes, which shears those of odd widths.
- What it reads back are read-only flipped views; here they are copied.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.rendering.context import OSMesaContext, osmesa_library
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

# pyrender spends Python time on every primitive of every pass, so batches are large.
_FACES_PER_PRIMITIVE = 1 << 15


class PyrenderRenderer:
    """Renders a scene with pyrender on OSMesa, colours first and ids in a second pass.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is drawn.

    Raises
    ------
    RendererUnavailableError
        There is no OSMesa, or PyOpenGL was loaded for another platform earlier in this process.
    """

    def __init__(self, scene: Scene, camera: PinholeCamera, *, near: float = 0.05, far: float = 100.0) -> None:
        check_range(near, far)
        backend = _load_pyrender()
        pyrender, self._flags = backend.pyrender, backend.pyrender.RenderFlags
        self.scene, self.camera = scene, camera
        self._projection = projection_matrix(camera, near, far)
        looks = np.stack([scene.face_instance, scene.face_material], 1)
        kinds, kind = np.unique(looks, axis=0, return_inverse=True)
        self._batches = split_into_batches(scene.vertices, scene.faces, kind.reshape(-1), _FACES_PER_PRIMITIVE)
        materials = _materials(pyrender, scene)
        self._world = pyrender.Scene(bg_color=(0.0, 0.0, 0.0, 0.0))
        self._nodes = [
            self._world.add(pyrender.Mesh([_primitive(pyrender, scene, self._batches, b, materials)]))
            for b in range(len(self._batches))
        ]
        # Segmentation colours count the batches, so that ids of any size survive three bytes.
        self._batch_instance = np.concatenate([[0], kinds[self._batches.group, 0]]).astype(np.int32)
        codes = np.arange(1, len(self._nodes) + 1)
        shades = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], 1).astype(np.uint8)
        self._shade_of_node = dict(zip(self._nodes, shades, strict=True))
        # pyrender counts image coordinates from the corner of the first pixel, not from its centre.
        eye = pyrender.IntrinsicsCamera(camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5, znear=near, zfar=far)
        self._eye = self._world.add(eye)
        self._context = OSMesaContext(width=camera.width, height=camera.height)
        with self._context:
            self._renderer = backend.renderer(camera.width, camera.height)
        # Also runs when the renderer is forgotten, or at exit, while the libraries are still whole.
        self._release = weakref.finalize(self, _close, self._context, self._renderer)

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4); ValueError if it is not rigid, RuntimeError after ``close``."""
        pose = check_pose(T_world_camera)
        if not self._release.alive:
            raise RuntimeError("the renderer is closed; make a new one")
        T_clip_world = self._projection @ view_matrix(pose)
        seen = visible_boxes(self._batches.low, self._batches.high, T_clip_world, pose[:3, 3])
        self._renderer.visible_nodes = [self._nodes[b] for b in seen.tolist()]
        self._world.set_pose(self._eye, pose)
        with self._context:
            self._renderer.render(self._world, self._flags.FLAT | self._flags.SKIP_CULL_FACES)
            rgb = np.array(self._renderer.read_color_buf(), order="C")
            depth = np.array(self._renderer.read_depth_buf(), np.float32, order="C")
            self._renderer.render(self._world, self._flags.SEG, self._shade_of_node)
            shade = self._renderer.read_color_buf().astype(np.int32)
        code = (shade[..., 0] << 16) + (shade[..., 1] << 8) + shade[..., 2]
        return Frame(rgb, depth, self._batch_instance[code])

    def close(self) -> None:
        """Give back the graphics context; closing twice is harmless."""
        self._release()


def _close(context: OSMesaContext, renderer: Any) -> None:
    address = context.address
    with context:
        renderer.delete()
    context.release()
    _load_pyrender().forget_context(address)


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


def _primitive(pyrender: Any, scene: Scene, batches: Batches, batch: int, materials: list[Any]) -> Any:
    """One batch of faces as a pyrender primitive with its own vertices."""
    faces = batches.order[batches.starts[batch] : batches.starts[batch + 1]]
    vertices, indices = np.unique(scene.faces[faces], return_inverse=True)
    colour = None
    if scene.vertex_colour is not None:
        colour = np.ones((len(vertices), 4), np.float32)
        colour[:, :3] = scene.vertex_colour[vertices] / np.float32(255.0)
    return pyrender.Primitive(
        positions=scene.vertices[vertices],
        # pyrender puts the origin of texture coordinates at the bottom left.
        texcoord_0=None if scene.uv is None else scene.uv[vertices] * (1.0, -1.0) + (0.0, 1.0),
        color_0=colour,
        indices=indices.reshape(-1, 3),
        material=materials[scene.face_material[faces[0]]],
        mode=pyrender.GLTF.TRIANGLES,
    )


class _Backend:
    """pyrender, loaded once a process for OSMesa, and the renderer class that corrects it."""

    def __init__(self) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "osmesa")  # PyOpenGL reads it once, when first imported
        osmesa_library()
        import pyrender
        from OpenGL import contextdata, platform

        found = type(platform.PLATFORM).__name__
        if found != "OSMesaPlatform":
            raise RendererUnavailableError(
                f"pyrender: found PyOpenGL loaded as {found}, expected OSMesa. Set PYOPENGL_PLATFORM=osmesa before "
                "anything imports OpenGL or pyrender (Debian package libosmesa6), or use the opengl renderer."
            )
        self.pyrender = pyrender
        self.renderer = _renderer_class(pyrender)
        self._contextdata = contextdata
        pointer_of_context = contextdata.getContext
        contextdata.getContext = lambda context=None: _address(pointer_of_context(context))

    def forget_context(self, address: int) -> None:
        """Forget the arrays that PyOpenGL keeps alive for a context."""
        for storage in self._contextdata.STORAGES:
            storage.pop(address, None)


@cache
def _load_pyrender() -> _Backend:
    return _Backend()


def _address(context: Any) -> int:
    return context if isinstance(context, int) else int(ctypes.cast(context, ctypes.c_void_p).value or 0)


def _renderer_class(pyrender: Any) -> Any:
    """pyrender's Renderer, corrected as the module says; a class made here because its base loads late."""
    from OpenGL import GL

    class CorrectedRenderer(pyrender.Renderer):  # type: ignore[misc]
        def __init__(self, width: int, height: int) -> None:
            super().__init__(width, height)
            self.visible_nodes: list[Any] = []
            GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)

        def _update_context(self, scene: Any, flags: int) -> None:
            if not self._meshes:  # the scene never changes
                super()._update_context(scene, flags)

        def _sorted_mesh_nodes(self, scene: Any) -> Any:
            return self.visible_nodes

        def _bind_and_draw_primitive(self, primitive: Any, pose: Any, program: Any, flags: int) -> None:
            if not flags & pyrender.RenderFlags.SEG:
                super()._bind_and_draw_primitive(primitive, pose, program, flags)
                return
            program.set_uniform("M", pose)
            primitive._bind()
            GL.glDisable(GL.GL_CULL_FACE)
            GL.glDisable(GL.GL_BLEND)
            GL.glDrawElementsInstanced(
                GL.GL_TRIANGLES, primitive.indices.size, GL.GL_UNSIGNED_INT, ctypes.c_void_p(0), 1
            )
            primitive._unbind()

    return CorrectedRenderer
