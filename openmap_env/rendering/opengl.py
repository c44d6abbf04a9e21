"""The default renderer: colour, instance ids and depth in one OpenGL pass, in software or on a GPU.

One draw writes three targets: RGBA8 colour, R32I instance id and R32F planar depth. Faces lie in small compact batches; those that
the view frustum holds and that nothing hides (``visibility``) are gathered, front to back, into one index buffer. Textures
share few arrays (``textures``), so a picture takes as few draws.
"""

from __future__ import annotations

import sys
import weakref
from collections.abc import Callable
from types import ModuleType
from typing import Any, Literal

import moderngl
import numpy as np
import numpy.typing as npt

from openmap_env.kept import kept, kept_before
from openmap_env.rendering import visibility
from openmap_env.rendering.context import Platform, open_context
from openmap_env.rendering.drawing import VERTEX_FORMAT, VERTEX_TYPE, DrawMesh, draw_mesh
from openmap_env.rendering.geometry import check_pose, check_range, projection_matrix, view_matrix
from openmap_env.rendering.protocol import Frame
from openmap_env.rendering.textures import TexturePlan
from openmap_env.rendering.visibility import WIDER, Occlusion, VisibleSets, cells_of, cube_camera, cube_poses
from openmap_scenes import PinholeCamera, Scene

Culling = Literal["occlusion", "frustum"]

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

FIRST_LAYER = 4096
"""So many faces, nearest first, are drawn of what a guess left out before it is asked again what they hide."""
FACES_PER_BATCH = 64
"""Small enough to be hidden as a whole by one thing, large enough that looking at every batch costs less than drawing."""


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
    culling : {"occlusion", "frustum"}
        What is left out: what is certainly hidden, or only what lies outside the view. The pictures are the same to the last bit.
    faces_per_batch : int
        Faces that are drawn or left out together.

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
        culling: Culling = "occlusion",
        faces_per_batch: int = FACES_PER_BATCH,
    ) -> None:
        check_range(near, far)
        if culling not in ("occlusion", "frustum"):
            raise ValueError(f"culling is {culling!r}, expected 'occlusion' or 'frustum'")
        if isinstance(faces_per_batch, bool) or not isinstance(faces_per_batch, int) or faces_per_batch < 1:
            raise ValueError(f"faces_per_batch is {faces_per_batch!r}, expected a whole number of at least 1")
        self.scene, self.camera = scene, camera
        self._near, self._far, self._culling = near, far, culling
        mesh = draw_mesh(scene, faces_per_batch)
        self._geometry = (mesh.vertices["position"], mesh.indices, mesh.batches.starts)
        self._occlusion = Occlusion(mesh.batches, mesh.indices)
        self._sets = VisibleSets(len(mesh.batches))
        self._context = open_context(platform)
        # Also runs when the renderer is forgotten, or at exit, while the libraries are still whole.
        self._release = weakref.finalize(self, self._context.close)
        self.platform = self._context.platform
        with self._context.current() as gl:
            self._upload(gl, mesh, anisotropy)
            self._view = _View(gl, camera, near, far)

    def _upload(self, gl: Any, mesh: DrawMesh, anisotropy: float) -> None:
        self._program = gl.program(vertex_shader=_VERTEX_SHADER, fragment_shader=_FRAGMENT_SHADER)
        self._arrays = [_upload_layers(gl, mesh.textures, g, anisotropy) for g in range(len(mesh.textures.sizes))]
        self._chosen = gl.buffer(reserve=mesh.indices.nbytes, dynamic=True)
        self._mesh = gl.vertex_array(
            self._program,
            [(gl.buffer(mesh.vertices), VERTEX_FORMAT, *(VERTEX_TYPE.names or ()))],
            index_buffer=self._chosen,
        )

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        """The frame from a camera-to-world pose (4, 4); ValueError if it is not rigid, RuntimeError after ``close``."""
        pose = check_pose(T_world_camera)
        occlusion, view = self._occlusion, self._view
        with self._context.current() as gl:
            gl.enable_only(moderngl.DEPTH_TEST)
            self._begin(occlusion, view, pose)
            if self._culling == "occlusion":
                self._draw_what_shows(gl, view, self._sets.at(pose[:3, 3]))
            else:
                self._draw(occlusion, occlusion.in_view)
                view.read_depth()
            return view.read()

    def _draw_what_shows(self, gl: Any, view: _View, seen_before: npt.NDArray[np.bool_]) -> None:
        """Draw a guess, and what it does not hide nearest first, until nothing is missing; note what showed."""
        occlusion = self._occlusion
        drawn, tied = occlusion.guess(seen_before), False
        self._draw(occlusion, drawn)
        layer = FIRST_LAYER
        while len(more := occlusion.missing(view.read_depth(), drawn, layer)):
            # Among faces at one depth the first wins, and the order must not depend on the guess.
            tied = tied or self._ties(gl, more)
            self._draw(occlusion, more)
            drawn, layer = np.union1d(drawn, more), 2 * layer
        if tied:
            view.target.clear()
            self._draw(occlusion, drawn)
            view.read_depth()
        occlusion.remember(seen_before)

    def _ties(self, gl: Any, batches: npt.NDArray[np.int64]) -> bool:
        """Whether any pixel of the batches lies exactly as deep as what was drawn there."""
        target, query = self._view.target, gl.query(samples=True)
        target.color_mask = ((False,) * 4,) * 3
        target.depth_mask = False
        gl.depth_func = "=="
        with query:
            self._draw(self._occlusion, batches)
        gl.depth_func = "<"
        target.depth_mask = True
        target.color_mask = ((True,) * 4,) * 3
        return bool(query.samples)

    def learn(self, places: npt.NDArray[np.floating], progress: Callable[[int, int], None] | None = None) -> None:
        """Find out ahead what shows from about each of the places (n, 3) m, or take it from the disk; pictures stay as they are.

        What was found is kept on disk (``kept``). ``progress`` is told how many of how many cells of places are done.
        """
        middles = cells_of(places)

        def look() -> dict[str, npt.NDArray[np.generic]]:
            sets = VisibleSets(len(self._occlusion))
            with self._context.current() as gl:
                gl.enable_only(moderngl.DEPTH_TEST)
                view = _View(gl, cube_camera(), self._near, self._far)
                occlusion = self._occlusion.widened(WIDER)
                expected = np.zeros(len(occlusion), bool)
                for n, middle in enumerate(middles):
                    shows = sets.at(middle)
                    self._look_around(occlusion, view, middle, expected, shows)
                    expected = shows
                    if progress is not None:
                        progress(n + 1, len(middles))
            return sets.to_arrays()

        self._sets.add(kept("visible", *self._key_of(middles), look))

    def recall(self, places: npt.NDArray[np.floating]) -> bool:
        """Take what ``learn`` found for the same places once from the disk; whether there was something."""
        found = kept_before("visible", *self._key_of(cells_of(places)))
        if found is not None:
            self._sets.add(found)
        return found is not None

    def forget(self) -> None:
        """Forget what shows from where, as a renderer that was just made; pictures stay as they are."""
        self._sets = VisibleSets(len(self._occlusion))
        self._occlusion.forget()

    def _key_of(self, middles: npt.NDArray[np.float64]) -> tuple[list[npt.NDArray[Any] | str | None], list[ModuleType]]:
        return [*self._geometry, middles, f"{self._near} {self._far}"], [visibility, sys.modules[__name__]]

    def _look_around(
        self,
        occlusion: Occlusion,
        view: _View,
        middle: npt.NDArray[np.float64],
        expected: npt.NDArray[np.bool_],
        shows: npt.NDArray[np.bool_],
    ) -> None:
        """Note in a set (B,) what shows from about a place; ``expected`` (B,) is what showed from the place before."""
        for pose in cube_poses(middle):
            self._begin(occlusion, view, pose)
            drawn, layer = occlusion.guess(expected), FIRST_LAYER
            self._draw(occlusion, drawn)
            while len(more := occlusion.missing(view.read_depth(), drawn, layer)):
                self._draw(occlusion, more)
                drawn, layer = np.union1d(drawn, more), 2 * layer
            occlusion.remember(shows)

    def _begin(self, occlusion: Occlusion, view: _View, pose: npt.NDArray[np.float64]) -> None:
        T_clip_world = view.projection @ view_matrix(pose)
        occlusion.begin(T_clip_world, pose[:3, 3], view.camera, self._near)
        view.target.use()
        view.target.clear()
        self._program["T_clip_world"].write(np.ascontiguousarray(T_clip_world.T, np.float32))

    def _draw(self, occlusion: Occlusion, batches: npt.NDArray[np.int64]) -> None:
        """Draw batches of faces on top of what is there."""
        indices, runs = occlusion.gather(batches)
        self._chosen.orphan()
        self._chosen.write(indices)
        first = 0
        for group, count in runs:
            self._arrays[group].use(0)
            self._mesh.render(moderngl.TRIANGLES, vertices=count, first=first)
            first += count

    def close(self) -> None:
        """Give back the graphics context; closing twice is harmless."""
        self._release()


def prepare_opengl(
    scene: Scene, camera: PinholeCamera, *, faces_per_batch: int = FACES_PER_BATCH, **others: object
) -> None:
    """Lay the scene out for drawing and keep that on disk for the renderer to come; no other setting matters to it."""
    draw_mesh(scene, faces_per_batch)


class _View:
    """A camera and the frame buffer that it draws to; its pictures belong to whoever reads them."""

    def __init__(self, gl: Any, camera: PinholeCamera, near: float, far: float) -> None:
        self.camera, self.projection = camera, projection_matrix(camera, near, far)
        size = (camera.width, camera.height)
        self.target = gl.framebuffer(
            [gl.renderbuffer(size, 4), gl.renderbuffer(size, 1, dtype="i4"), gl.renderbuffer(size, 1, dtype="f4")],
            gl.depth_renderbuffer(size),
        )

    def read_depth(self) -> npt.NDArray[np.float32]:
        """The depth (H, W) m of what was drawn."""
        self._depth = np.empty((self.camera.height, self.camera.width), np.float32)
        self.target.read_into(self._depth, components=1, attachment=2, dtype="f4", alignment=1)
        return self._depth

    def read(self) -> Frame:
        """The whole frame, whose depth has been read."""
        h, w = self.camera.height, self.camera.width
        frame = Frame(np.empty((h, w, 3), np.uint8), self._depth, np.empty((h, w), np.int32))
        self.target.read_into(frame.rgb, components=3, attachment=0, alignment=1)
        self.target.read_into(frame.instance, components=1, attachment=1, dtype="i4", alignment=1)
        return frame


def _upload_layers(gl: Any, plan: TexturePlan, group: int, anisotropy: float) -> Any:
    """A repeating texture array with mipmaps."""
    (h, w), n = plan.sizes[group], len(plan.pictures[group])
    array = gl.texture_array((w, h, n), 4)
    for layer in range(n):
        array.write(plan.layer_pixels(group, layer), viewport=(0, 0, layer, w, h, 1))
    array.repeat_x = array.repeat_y = True
    if (h, w) == (1, 1):
        array.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return array
    array.build_mipmaps()
    array.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    array.anisotropy = anisotropy
    return array
