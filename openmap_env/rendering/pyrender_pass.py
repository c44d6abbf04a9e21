"""pyrender's two forward passes without what they repeat. Imported late: it needs PyOpenGL loaded for its platform.

pyrender's own passes set every uniform of every primitive and ask for its place each time. Here the camera is set once a frame
and program, a material where it changes, and what is read goes into arrays that are there.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt
import pyrender
from OpenGL import GL
from pyrender.constants import ProgramFlags, RenderFlags

Matrix = npt.NDArray[np.floating]


class _Program:
    """A pyrender shader program, the places of its uniforms, and what they were set to last."""

    def __init__(self, program: Any) -> None:
        self.number = program._program_id
        self._places: dict[str, int] = {}
        GL.glUseProgram(self.number)
        GL.glUniformMatrix4fv(self.place("M"), 1, GL.GL_TRUE, np.eye(4, dtype=np.float32))
        if self.place("material.base_color_texture") >= 0:
            GL.glUniform1i(self.place("material.base_color_texture"), 0)

    def place(self, name: str) -> int:
        if name not in self._places:
            self._places[name] = GL.glGetUniformLocation(self.number, name)
        return self._places[name]

    def use(self, V: Matrix, P: Matrix) -> None:
        """Bind it for a pass from a camera."""
        GL.glUseProgram(self.number)
        GL.glUniformMatrix4fv(self.place("V"), 1, GL.GL_TRUE, V)
        GL.glUniformMatrix4fv(self.place("P"), 1, GL.GL_TRUE, P)


class LeanRenderer(pyrender.Renderer):  # type: ignore[misc]
    """pyrender's Renderer for a scene that never changes: all nodes have one primitive, stand at the origin and are opaque.

    Parameters
    ----------
    world : pyrender.Scene
    nodes : list of pyrender.Node
        What is drawn, by number; number n has n + 1 as its segmentation code.
    width, height : int
    """

    def __init__(self, world: Any, nodes: list[Any], width: int, height: int) -> None:
        super().__init__(width, height)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        self._size = (width, height)
        self._update_context(world, RenderFlags.NONE)
        programs: dict[int, _Program] = {}
        self._colour, self._codes = [], []
        for number, node in enumerate(nodes, 1):
            primitive = node.mesh.primitives[0]
            parts = []
            for flags in (RenderFlags.FLAT | RenderFlags.SKIP_CULL_FACES, RenderFlags.SEG):
                program = self._get_primitive_program(primitive, flags, ProgramFlags.USE_MATERIAL)
                if program._program_id not in programs:
                    programs[program._program_id] = _Program(program)
                parts.append(programs[program._program_id])
            shade = (number & 255, number >> 8 & 255, number >> 16)
            self._colour.append((parts[0], primitive._vaid, int(primitive.indices.size), primitive.material))
            self._codes.append((parts[1], primitive._vaid, int(primitive.indices.size), [c / 255.0 for c in shade]))
        self._buffers = [GL.glGenFramebuffers(1), *GL.glGenRenderbuffers(2)]
        frame, colour, depth = self._buffers
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, frame)
        for buffer, kind, place in (
            (colour, GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0),
            (depth, GL.GL_DEPTH_COMPONENT24, GL.GL_DEPTH_ATTACHMENT),
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, width, height)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, place, GL.GL_RENDERBUFFER, buffer)

    def draw(
        self, seen: list[int], V: Matrix, P: Matrix, rgb: Matrix, depth: Matrix, code: npt.NDArray[np.uint32]
    ) -> None:
        """Draw numbers of nodes in this order and read into contiguous arrays: bytes, depth buffer, codes in 24 bits.

        ``V`` and ``P`` (4, 4) are T_camera_world and the projection; row 0 of the arrays is what the projection puts at y = -1.
        """
        V, P = np.ascontiguousarray(V, np.float32), np.ascontiguousarray(P, np.float32)
        w, h = self._size
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._buffers[0])
        GL.glViewport(0, 0, w, h)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDisable(GL.GL_BLEND)
        GL.glClearColor(0.0, 0.0, 0.0, 0.0)
        GL.glActiveTexture(GL.GL_TEXTURE0)
        self._draw_colours(seen, V, P)
        _read(w, h, GL.GL_RGB, GL.GL_UNSIGNED_BYTE, rgb)
        _read(w, h, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, depth)
        self._draw_codes(seen, V, P)
        _read(w, h, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, code)
        GL.glBindVertexArray(0)
        GL.glUseProgram(0)

    def _draw_colours(self, seen: list[int], V: Matrix, P: Matrix) -> None:
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        ready: set[int] = set()
        bound, look, picture = -1, None, -1
        for node in seen:
            program, vertices, count, material = self._colour[node]
            _make_current(program, bound, ready, V, P)
            if program.number != bound or material is not look:
                bound, look = program.number, material
                GL.glUniform4f(program.place("material.base_color_factor"), *material.baseColorFactor.tolist())
                texture = material.baseColorTexture
                if texture is not None and texture._texid != picture:
                    picture = texture._texid
                    GL.glBindTexture(GL.GL_TEXTURE_2D, picture)
            GL.glBindVertexArray(vertices)
            GL.glDrawElements(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(0))

    def _draw_codes(self, seen: list[int], V: Matrix, P: Matrix) -> None:
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)
        ready: set[int] = set()
        bound = -1
        for node in seen:
            program, vertices, count, shade = self._codes[node]
            _make_current(program, bound, ready, V, P)
            bound = program.number
            GL.glUniform3f(program.place("color"), *shade)
            GL.glBindVertexArray(vertices)
            GL.glDrawElements(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, ctypes.c_void_p(0))

    def delete(self) -> None:
        """Free what was made in the context, which has to be current; again is harmless."""
        super().delete()
        if self._buffers:
            GL.glDeleteFramebuffers(1, [self._buffers[0]])
            GL.glDeleteRenderbuffers(2, self._buffers[1:])
            self._buffers = []

    def __del__(self) -> None:
        """Nothing: pyrender's own would delete in whatever context is current by then; ``delete`` has been called."""


def _make_current(program: _Program, bound: int, ready: set[int], V: Matrix, P: Matrix) -> None:
    """Bind a program unless it is the one that is ``bound``; its camera is set the first time of a pass."""
    if program.number not in ready:
        program.use(V, P)
        ready.add(program.number)
    elif program.number != bound:
        GL.glUseProgram(program.number)


def _read(width: int, height: int, layout: int, kind: int, out: npt.NDArray[Any]) -> None:
    GL.glReadPixels(0, 0, width, height, layout, kind, ctypes.c_void_p(out.ctypes.data))
