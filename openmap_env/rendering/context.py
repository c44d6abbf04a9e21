"""Off-screen OpenGL contexts for moderngl: EGL where it works, else OSMesa.

A context is current only inside ``with gl.current():``. Outside, no context is: EGL and OSMesa keep separate ideas of what is
current, and one that stays bound would receive the calls meant for the other. So any number of renderers, of this backend or
of pyrender's, live side by side in one process and thread.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, cast

import glcontext
import moderngl

from openmap_env.rendering.protocol import RendererUnavailableError

logger = logging.getLogger(__name__)

Platform = str
"""``auto``, ``egl``, ``egl:N`` (the N-th device that EGL counts, for machines with several GPUs) or ``osmesa``."""
PLATFORM_VARIABLE = "OPENMAP_GL"
"""Environment variable that chooses the platform where the caller left it open."""
MESA_THREADS = "LP_NUM_THREADS"
"""Environment variable with the number of threads that Mesa's software rasteriser draws with; 0 = the caller's own."""
_announced: set[str] = set()
_threads_started = _threads_lost = False
"""Whether a context of this process may have started the threads that Mesa draws with; whether it is a fork, without them."""

# From GL/osmesa.h.
_OSMESA_FORMAT, _OSMESA_RGBA = 0x22, 0x1908
_OSMESA_DEPTH_BITS = 0x30
_OSMESA_PROFILE, _OSMESA_CORE_PROFILE = 0x33, 0x34
_OSMESA_CONTEXT_MAJOR_VERSION, _OSMESA_CONTEXT_MINOR_VERSION = 0x36, 0x37
_GL_UNSIGNED_BYTE = 0x1401


def osmesa_library() -> ctypes.CDLL:
    """Mesa's off-screen library; RendererUnavailableError, naming the Debian package, where there is none."""
    name = ctypes.util.find_library("OSMesa") or "libOSMesa.so.8"
    try:
        library = ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
    except OSError as error:
        raise RendererUnavailableError(
            f"OSMesa: found no {name} ({error}), expected Mesa's off-screen library. "
            "Install it (Debian: apt install libosmesa6), or use EGL (libegl1) or the raycast renderer."
        ) from error
    library.OSMesaCreateContextAttribs.argtypes = [ctypes.POINTER(ctypes.c_int), ctypes.c_void_p]
    library.OSMesaCreateContextAttribs.restype = ctypes.c_void_p
    library.OSMesaMakeCurrent.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
    library.OSMesaMakeCurrent.restype = ctypes.c_ubyte
    library.OSMesaDestroyContext.argtypes = [ctypes.c_void_p]
    library.OSMesaDestroyContext.restype = None
    library.OSMesaGetProcAddress.argtypes = [ctypes.c_char_p]
    library.OSMesaGetProcAddress.restype = ctypes.c_void_p
    return library


class OSMesaContext:
    """An OSMesa context in the shape that moderngl expects of a ``glcontext``: it loads functions and enters and leaves.

    Parameters
    ----------
    width, height : int
        Size of its own buffer; one pixel does where frame buffer objects are drawn to.
    """

    def __init__(self, width: int = 1, height: int = 1) -> None:
        self._library = osmesa_library()
        attributes = (
            *(_OSMESA_FORMAT, _OSMESA_RGBA, _OSMESA_DEPTH_BITS, 24, _OSMESA_PROFILE, _OSMESA_CORE_PROFILE),
            *(_OSMESA_CONTEXT_MAJOR_VERSION, 3, _OSMESA_CONTEXT_MINOR_VERSION, 3, 0),
        )
        array = (ctypes.c_int * len(attributes))(*attributes)
        self.address: int = self._library.OSMesaCreateContextAttribs(array, None) or 0
        if not self.address:
            raise RendererUnavailableError(
                "OSMesa: found no OpenGL 3.3 core context, expected one. Install a newer libosmesa6."
            )
        self._size = (width, height)
        self._pixels = (ctypes.c_ubyte * (4 * width * height))()

    def load_opengl_function(self, name: str) -> int:
        """Address of an OpenGL function, 0 where there is none."""
        return self._library.OSMesaGetProcAddress(name.encode()) or 0

    def __enter__(self) -> OSMesaContext:
        check_not_forked()
        if not self._library.OSMesaMakeCurrent(self.address, self._pixels, _GL_UNSIGNED_BYTE, *self._size):
            raise RuntimeError("OSMesa did not make its context current")
        return self

    def __exit__(self, *_: object) -> None:
        self._library.OSMesaMakeCurrent(None, None, _GL_UNSIGNED_BYTE, 0, 0)

    def release(self) -> None:
        """Destroy the context; again is harmless."""
        if self.address:
            self._library.OSMesaDestroyContext(self.address)
            self.address = 0


class EGLContext:
    """glcontext's EGL context, except that it is really let go of on leaving.

    glcontext's own exit puts back what was current before, which after creation is the context itself.

    Parameters
    ----------
    device : int or None
        Which of EGL's devices; None leaves it to glcontext: its GLCONTEXT_DEVICE_INDEX, else the first.
    """

    address: int

    def __init__(self, device: int | None = None) -> None:
        self._context = _egl_context(device)
        self._egl = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
        self._egl.eglGetCurrentDisplay.restype = self._egl.eglGetCurrentContext.restype = ctypes.c_void_p
        self._egl.eglMakeCurrent.argtypes = [ctypes.c_void_p] * 4
        self._display = self._egl.eglGetCurrentDisplay()
        self.address = self._egl.eglGetCurrentContext() or 0
        self.__exit__()

    def load_opengl_function(self, name: str) -> int:
        """Address of an OpenGL function, 0 where there is none."""
        return int(self._context.load_opengl_function(name))

    def __enter__(self) -> EGLContext:
        check_not_forked()
        self._context.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._egl.eglMakeCurrent(self._display, None, None, None)

    def release(self) -> None:
        """Destroy the context; again is harmless."""
        if self.address:
            self._context.release()
            self.address = 0


def _egl_context(device: int | None) -> Any:
    make = glcontext.get_backend_by_name("egl")
    chosen = {} if device is None else {"device_index": device}
    if device is None or "GLCONTEXT_DEVICE_INDEX" not in os.environ:
        return make(mode="standalone", glversion=330, **chosen)
    kept = os.environ.pop("GLCONTEXT_DEVICE_INDEX")  # would win over what was asked for
    try:
        return make(mode="standalone", glversion=330, **chosen)
    finally:
        os.environ["GLCONTEXT_DEVICE_INDEX"] = kept


class GLContext:
    """A moderngl context of its own and the platform that it runs on.

    Attributes
    ----------
    gl : moderngl.Context
    platform : str
        ``egl``, ``egl:N`` or ``osmesa``.
    """

    def __init__(self, gl: Any, platform: str) -> None:
        self.gl, self.platform = gl, platform
        self._open = True

    @contextmanager
    def current(self) -> Iterator[Any]:
        """Make the context current for the block; RuntimeError once it is closed."""
        if not self._open:
            raise RuntimeError("the renderer is closed; make a new one")
        with self.gl:
            yield self.gl

    def close(self) -> None:
        """Free everything that was made in the context, then the context itself; again is harmless.

        In a fork there is nothing to free: what was made is that of the process it comes from.
        """
        if self._open:
            self._open = False
            if _threads_lost:
                return
            with self.gl:
                self.gl.gc()
            self.gl.release()


def wanted_platforms(platform: Platform) -> tuple[str, ...]:
    """What to try, in order: ``auto`` is the environment variable ``OPENMAP_GL`` if it is set, else EGL and then OSMesa.

    Raises
    ------
    ValueError
        The platform has no such name.
    """
    chosen = (os.environ.get(PLATFORM_VARIABLE) or "auto") if platform == "auto" else platform
    if not isinstance(chosen, str) or not re.fullmatch(r"auto|osmesa|egl(:\d{1,3})?", chosen):
        raise ValueError(
            f"OpenGL platform is {chosen!r}, expected auto, egl or osmesa, or egl:N for EGL's N-th device "
            f"({PLATFORM_VARIABLE} sets it)"
        )
    return ("egl", "osmesa") if chosen == "auto" else (chosen,)


def check_not_forked() -> None:
    """Raise RendererUnavailableError where drawing would wait for ever, for threads that did not come along through a fork."""
    if _threads_lost:
        raise RendererUnavailableError(
            "OpenGL: found a process that was forked from one that had drawn already, expected one of its own: the threads that "
            "draw are not in a fork. Start it with the method 'spawn' or 'forkserver' (AsyncVectorEnv's context), take "
            f"gym.make_vec without a vectorization_mode, or set {MESA_THREADS}=0 before the first picture."
        )


def lost_by_fork() -> bool:
    """Whether this process is a fork in which nothing can be drawn, nor anything be given back."""
    return _threads_lost


def _after_fork() -> None:
    global _threads_lost
    _threads_lost = _threads_started


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def bare_context(platform: str) -> EGLContext | OSMesaContext:
    """A new context of a platform that ``wanted_platforms`` named, not current; it raises whatever its library raises."""
    global _threads_started
    _threads_started |= os.environ.get(MESA_THREADS) != "0"
    kind, _, device = platform.partition(":")
    return OSMesaContext() if kind == "osmesa" else EGLContext(int(device) if device else None)


def announce(platform: str, device: str) -> None:
    """One line in the log for each platform of a process, however many contexts are opened."""
    if platform not in _announced:
        _announced.add(platform)
        logger.info("OpenGL on %s: %s", platform, device)


def open_context(platform: Platform = "auto") -> GLContext:
    """Open an off-screen OpenGL 3.3 context; the first of its platform is announced in the log.

    Parameters
    ----------
    platform : str
        See ``Platform`` and ``wanted_platforms``.

    Raises
    ------
    RendererUnavailableError
        None of those that are wanted works on this machine.
    ValueError
        The platform has no such name.
    """
    check_not_forked()
    failures = []
    for name in wanted_platforms(platform):
        try:
            context = bare_context(name)
            with context:
                gl = moderngl.create_context(standalone=True, context=cast(Any, context), require=330)
        except Exception as error:  # moderngl raises bare Exception and ValueError for a missing driver
            failures.append(f"{name}: {error}")
            continue
        opened = GLContext(gl, name)
        with opened.current():
            gl.gc_mode = "context_gc"
            announce(name, gl.info["GL_RENDERER"])
        return opened
    raise unavailable(failures)


def unavailable(failures: list[str]) -> RendererUnavailableError:
    """The error for a machine where no platform opens a context, from what each of them said."""
    return RendererUnavailableError(
        f"OpenGL: found no working context ({'; '.join(failures)}), expected EGL or OSMesa. "
        "Install one (Debian: apt install libegl1 libegl-mesa0, or libosmesa6), or use the raycast renderer."
    )
