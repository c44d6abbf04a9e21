"""The default renderer: colour, instance ids and depth in one OpenGL pass, in software or on a GPU.

One draw writes three targets: RGBA8 colour, R32I instance id and R32F planar depth. Faces are drawn in compact batches, those
inside the view frustum only, front to back. Textures of one size share a texture array, so that a batch is cut by place and
not by material.
"""

from __future__ import annotations

import weakref
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from openmap_env.rendering.context import Platform, open_context
from openmap_env.rendering.geometry import (
    Batches,
    check_pose,
    check_range,
    projection_matrix,
    split_into_batches,
    view_matrix,
    visible_boxes,
)
from openmap_env.rendering.protocol import Frame
from openmap_scenes import PinholeCamera, Scene

_VERTEX_SHADER = """
#version 330 core
uniform mat4 T_clip_world;
in vec3 position;
in vec2 uv;
in vec3 colour;
in int layer;
in int instance;
out vec3 texture_place;
out vec3 tint;
flat out int id;
void main() {
    gl_Position = T_clip_world * vec4(position, 1.0);
    texture_place = vec3(uv, layer);
    tint = colour;
    id = instance;
}
"""

# In a perspective view w_clip is the planar depth, and gl_FragCoord.w is 1 / w_clip.
_FRAGMENT_SHADER = """
#version 330 core
uniform sampler2DArray textures;
in vec3 texture_place;
in vec3 tint;
flat in int id;
layout(location = 0) out vec4 out_colour;
layout(location = 1) out int out_id;
layout(location = 2) out float out_depth;
void main() {
    out_colour = vec4(texture(textures, texture_place).rgb * tint, 1.0);
    out_id = id;
    out_depth = 1.0 / gl_FragCoord.w;
}
"""

_VERTEX_TYPE = np.dtype(
    [("position", "3f4"), ("uv", "2f4"), ("colour", "3f4"), ("layer", "i4"), ("instance", "i4")], align=False
)
_VERTEX_FORMAT = "3f4 2f4 3f4 1i4 1i4"
_FACES_PER_BATCH = 2048
_LAYERS_PER_ARRAY = 256  # OpenGL 3.3 promises no more
_TEXELS_PER_ARRAY = 1 << 26  # Mesa refuses single textures beyond a gigabyte
_WHITE = np.full((1, 1, 3), 255, np.uint8)


class OpenGLRenderer:
    """Renders a scene with OpenGL 3.3, off screen.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    near, far : float
        Planar depths, m; nothing nearer or farther is drawn.
    platform : {"auto", "egl", "osmesa"}
        Where the OpenGL context comes from; ``auto`` follows the environment variable ``OPENMAP_GL`` or takes EGL, else
        OSMesa. Mesa's software rasteriser uses ``LP_NUM_THREADS`` threads: 0 is best in the workers of a vector environment.
    anisotropy : float
        Samples along the steeper direction of a slanted texture; 1 = plain mipmaps.

    Raises
    ------
    RendererUnavailableError
        No such context can be had on this machine.
    """

    def __init__(
        self,
        scene: Scene,
        camera: PinholeCamera,
        *,
        near: float = 0.05,
        far: float = 100.0,
        platform: Platform = "auto",
        anisotropy: float = 1.0,
    ) -> None:
        check_range(near, far)
        self.scene, self.camera = scene, camera
        self._projection = projection_matrix(camera, near, far)
        pictures = _pictures(scene)
        layers, groups = _group_pictures(pictures)
        self._batches = split_into_batches(scene.vertices, scene.faces, groups[scene.face_material], _FACES_PER_BATCH)
        vertices, indices = _vertex_buffer(scene, self._batches, layers)
        self._context = open_context(platform)
        # Also runs when the renderer is forgotten, or at exit, while the libraries are still whole.
        self._release = weakref.finalize(self, self._context.close)
        self.platform = self._context.platform
        with self._context.current() as gl:
            self._program = gl.program(vertex_shader=_VERTEX_SHADER, fragment_shader=_FRAGMENT_SHADER)
            self._arrays = [
                _upload_pictures(gl, [pictures[m] for m in np.flatnonzero(groups == group)], anisotropy)
                for group in range(int(groups.max()) + 1)
            ]
            self._mesh = gl.vertex_array(
                self._program,
                [(gl.buffer(vertices), _VERTEX_FORMAT, *(_VERTEX_TYPE.names or ()))],
                index_buffer=gl.buffer(indices),
            )
            size = (camera.width, camera.height)
            self._target = gl.framebuffer(
                [gl.renderbuffer(size, 4), gl.renderbuffer(size, 1, dtype="i4"), gl.renderbuffer(size, 1, dtype="f4")],
                gl.depth_renderbuffer(size),
            )

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4); ValueError if it is not rigid, RuntimeError after ``close``."""
        pose = check_pose(T_world_camera)
        T_clip_world = self._projection @ view_matrix(pose)
        batches = self._batches
        with self._context.current() as gl:
            self._target.use()
            self._target.clear()
            gl.enable_only(moderngl.DEPTH_TEST)
            self._program["T_clip_world"].write(np.ascontiguousarray(T_clip_world.T, np.float32))
            bound = -1
            for batch in visible_boxes(batches.low, batches.high, T_clip_world, pose[:3, 3]).tolist():
                if batches.group[batch] != bound:
                    bound = int(batches.group[batch])
                    self._arrays[bound].use(0)
                first, last = 3 * int(batches.starts[batch]), 3 * int(batches.starts[batch + 1])
                self._mesh.render(moderngl.TRIANGLES, vertices=last - first, first=first)
            return self._read()

    def _read(self) -> Frame:
        h, w = self.camera.height, self.camera.width
        frame = Frame(np.empty((h, w, 3), np.uint8), np.empty((h, w), np.float32), np.empty((h, w), np.int32))
        self._target.read_into(frame.rgb, components=3, attachment=0, alignment=1)
        self._target.read_into(frame.instance, components=1, attachment=1, dtype="i4", alignment=1)
        self._target.read_into(frame.depth, components=1, attachment=2, dtype="f4", alignment=1)
        return frame

    def close(self) -> None:
        """Give back the graphics context; closing twice is harmless."""
        self._release()


def _pictures(scene: Scene) -> list[npt.NDArray[np.uint8]]:
    """The texture (h, w, 3) of each material; one white texel where there is none."""
    return [_WHITE if m.texture is None or scene.uv is None else m.texture for m in scene.materials]


def _group_pictures(pictures: list[npt.NDArray[np.uint8]]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """For each picture its layer (M,) in, and its number (M,) of, an array of pictures of one size."""
    by_size: dict[tuple[int, ...], list[int]] = {}
    for index, picture in enumerate(pictures):
        by_size.setdefault(picture.shape, []).append(index)
    layers, groups, number = np.zeros(len(pictures), np.int32), np.zeros(len(pictures), np.int64), 0
    for (h, w, _), members in sorted(by_size.items()):
        capacity = max(1, min(_LAYERS_PER_ARRAY, _TEXELS_PER_ARRAY // (h * w)))
        for first in range(0, len(members), capacity):
            part = members[first : first + capacity]
            layers[part], groups[part] = np.arange(len(part)), number
            number += 1
    return layers, groups


def _vertex_buffer(
    scene: Scene, batches: Batches, layers: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.void], npt.NDArray[np.uint32]]:
    """Vertices (n,) of ``_VERTEX_TYPE`` and indices (3F,), batch after batch.

    A vertex is repeated for every instance and material that uses it, so that the three corners of a face agree on both and
    "flat" needs no convention about which corner provokes.
    """
    faces = scene.faces[batches.order].astype(np.int64)
    looks = np.stack([scene.face_instance[batches.order], scene.face_material[batches.order]], 1)
    kinds, kind = np.unique(looks, axis=0, return_inverse=True)
    keys = (faces * len(kinds) + kind.reshape(-1, 1)).reshape(-1)
    unique, firsts, indices = np.unique(keys, return_index=True, return_inverse=True)
    # Numbered in order of first use, so that a batch's vertices lie together.
    rank = np.empty(len(unique), np.int64)
    order = np.argsort(firsts, kind="stable")
    rank[order] = np.arange(len(unique))
    vertex, (instance, material) = unique[order] // len(kinds), kinds[unique[order] % len(kinds)].T
    buffer = np.zeros(len(unique), _VERTEX_TYPE)
    buffer["position"] = scene.vertices[vertex]
    if scene.uv is not None:
        buffer["uv"] = scene.uv[vertex]
    buffer["colour"] = np.stack([m.colour for m in scene.materials])[material]
    if scene.vertex_colour is not None:
        buffer["colour"] *= scene.vertex_colour[vertex] / np.float32(255.0)
    buffer["layer"], buffer["instance"] = layers[material], instance
    return buffer, rank[indices.reshape(-1)].astype(np.uint32)


def _upload_pictures(gl: Any, pictures: list[npt.NDArray[np.uint8]], anisotropy: float) -> Any:
    """A repeating texture array with mipmaps from pictures (h, w, 3) of one size."""
    h, w = pictures[0].shape[:2]
    array = gl.texture_array((w, h, len(pictures)), 3, alignment=1)
    for layer, picture in enumerate(pictures):
        array.write(np.ascontiguousarray(picture), viewport=(0, 0, layer, w, h, 1), alignment=1)
    array.repeat_x = array.repeat_y = True
    if (h, w) == (1, 1):
        array.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return array
    array.build_mipmaps()
    array.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    array.anisotropy = anisotropy
    return array
