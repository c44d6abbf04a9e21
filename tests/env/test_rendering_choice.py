"""Which renderer on which platform, and what is said where none can be had."""

from __future__ import annotations

import ctypes.util
import logging
import os
import re

import numpy as np
import pytest
from rendering_cases import (
    CAMERA,
    NO_EGL,
    NO_OSMESA,
    PLAIN,
    Make,
    cluttered_room,
    indoor_poses,
    needs_egl,
    needs_opengl,
    needs_osmesa,
    scene_of,
    wall,
)

from openmap_env import rendering
from openmap_env.rendering import RENDERERS, RendererUnavailableError, context, make_renderer, prepare


@pytest.mark.parametrize("platform", [pytest.param("egl", marks=needs_egl), pytest.param("osmesa", marks=needs_osmesa)])
def test_a_platform_can_be_forced(make: Make, platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = cluttered_room(2)
    assert make("opengl", scene, CAMERA, platform=platform).platform == platform  # type: ignore[attr-defined]
    monkeypatch.setenv("OPENMAP_GL", platform)
    assert make("opengl", scene, CAMERA).platform == platform  # type: ignore[attr-defined]


@needs_opengl
def test_a_platform_is_announced_once(
    make: Make, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(context, "_announced", set())
    with caplog.at_level(logging.INFO):
        for seed in range(3):
            make("opengl", cluttered_room(seed), CAMERA).render(np.eye(4))
    (line,) = [r.getMessage() for r in caplog.records if "OpenGL on" in r.getMessage()]
    assert re.fullmatch(r"OpenGL on (egl|osmesa): .+", line)


@needs_egl
def test_a_device_can_be_chosen_and_a_missing_one_is_named(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = cluttered_room(0)
    monkeypatch.setenv("OPENMAP_GL", "egl:0")
    assert make("opengl", scene, CAMERA).platform == "egl:0"  # type: ignore[attr-defined]
    monkeypatch.setenv("GLCONTEXT_DEVICE_INDEX", "0")
    with pytest.raises(RendererUnavailableError, match="egl:97"):
        make("opengl", scene, CAMERA, platform="egl:97")
    assert os.environ["GLCONTEXT_DEVICE_INDEX"] == "0"


def test_auto_casts_rays_where_no_context_opens(
    make: Make, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    scene = cluttered_room(0)
    monkeypatch.setattr(rendering, "_warned", set())
    monkeypatch.delenv("OPENMAP_GL", raising=False)
    with monkeypatch.context() as patch:
        patch.setattr(ctypes.util, "find_library", lambda name: f"lib{name}-is-not-here.so")
        for _ in range(2):
            assert type(make("auto", scene, CAMERA, near=0.1)).__name__ == "RaycastRenderer"
    (warning,) = [r for r in caplog.records if r.levelno >= logging.WARNING]
    assert "libosmesa6" in warning.getMessage()
    if not (NO_EGL and NO_OSMESA):
        assert type(make("auto", scene, CAMERA, near=0.1)).__name__ == "OpenGLRenderer"


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("raycast", {"platform": "egl"}, "'raycast' takes no setting 'platform', expected some of near, far, threads"),
        ("raycast", {"threads": 1.5}, "threads of renderer 'raycast' is 1.5, expected a whole number"),
        ("raycast", {"threads": True}, "threads .* expected a number"),
        ("raycast", {"near": "0.1"}, "near .* expected a finite number"),
        ("raycast", {"far": float("inf")}, "far .* expected a finite number"),
        ("pyrender", {"platform": 3}, "platform .* expected a text"),
        ("pyrender", {"platform": "x11"}, "expected auto, egl or osmesa"),
        ("opengl", {"colour": 1}, "takes no setting 'colour'"),
        ("opengl", {"culling": "some"}, "culling of renderer 'opengl' is 'some', expected one of occlusion, frustum"),
        ("opengl", {"platform": "egl:x"}, "expected auto, egl or osmesa"),
        ("auto", {"anisotropy": None}, "anisotropy .* expected a finite number"),
    ],
)
def test_settings_that_make_no_sense_are_refused(name: str, given: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_renderer(name, scene_of([wall(-9, 9, -2, 4)], PLAIN), CAMERA, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [*RENDERERS, "auto"])
def test_preparing_ahead_needs_no_context_and_changes_nothing(
    make: Make, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, T = cluttered_room(1), indoor_poses(cluttered_room(1), 1, 1)[0]
    with monkeypatch.context() as patch:
        patch.setattr(ctypes.util, "find_library", lambda name: f"lib{name}-is-not-here.so")
        prepare(name, scene, CAMERA)
    if name in ("raycast", "auto") or not (NO_EGL and NO_OSMESA):
        frame, again = (make(name, s, CAMERA).render(T) for s in (scene, cluttered_room(1)))
        np.testing.assert_array_equal(frame.rgb, again.rgb)
    with pytest.raises(ValueError, match="takes no setting 'colour'"):
        prepare(name, scene, CAMERA, colour=1)
    with pytest.raises(ValueError, match="expected one of"):
        prepare("vulkan", scene, CAMERA)


def test_an_unknown_renderer_is_named_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'vulkan', expected one of opengl, pyrender, raycast, auto"):
        make_renderer("vulkan", scene_of([wall(-9, 9, -2, 4)], PLAIN), CAMERA)


def test_a_missing_library_is_reported_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of([wall(-9, 9, -2, 4)], PLAIN)
    monkeypatch.delenv("OPENMAP_GL", raising=False)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: f"lib{name}-is-not-here.so")
    with pytest.raises(RendererUnavailableError, match=r"libegl1.*libosmesa6"):
        make_renderer("opengl", scene, CAMERA)
    with pytest.raises(RendererUnavailableError, match="libosmesa6"):
        context.osmesa_library()
    with pytest.raises(ValueError, match="expected auto, egl or osmesa"):
        make_renderer("opengl", scene, CAMERA, platform="x11")
