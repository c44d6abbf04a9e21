"""Who takes part in the rendering benchmark: this package's renderers on each platform, and what other people use."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

HFOV_DEG = 90.0
BASELINES = ("opengl frustum egl", "opengl frustum osmesa")
"""The plain one-pass renderer of each platform, which the others are compared with."""
REFERENCE = "raycast"
"""What depth and ids are held against."""


@dataclass(frozen=True)
class Contender:
    """A renderer with its settings.

    Parameters
    ----------
    backend : str
        Of ``make_renderer``, or a key of ``render_peers.PEERS``.
    settings : dict
        Keywords of ``make_renderer``.
    environment : dict
        Variables of its process.
    baseline : str
        The contender that it is compared with.
    module : str
        What has to be importable; "" = nothing beyond this package's own dependencies.
    peer : bool
        Whether it is someone else's.
    learns : bool
        Whether it is told before the first round from where it will look, as ``openmap scenes prepare`` does.
    """

    backend: str
    settings: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=dict)
    baseline: str = BASELINES[0]
    module: str = ""
    peer: bool = False
    learns: bool = False


def _contenders() -> dict[str, Contender]:
    found = {}
    for baseline, platform in zip(BASELINES, ("egl", "osmesa"), strict=True):
        hiding: dict[str, Any] = {"culling": "occlusion", "platform": platform}
        # Large pieces, as one would cut a home that nothing else is known of.
        plain: dict[str, Any] = {"culling": "frustum", "platform": platform, "faces_per_batch": 2048}
        found[f"opengl prepared {platform}"] = Contender("opengl", hiding, baseline=baseline, learns=True)
        found[f"opengl {platform}"] = Contender("opengl", hiding, baseline=baseline)
        found[f"opengl frustum {platform}"] = Contender("opengl", plain, baseline=baseline)
        found[f"pyrender {platform}"] = Contender("pyrender", {"platform": platform}, baseline=baseline)
    found[REFERENCE] = Contender("raycast")
    # Not on OSMesa: it would compile, and never free, a program for every draw there.
    found["stock pyrender egl"] = Contender("pyrender", {}, {"PYOPENGL_PLATFORM": "egl"}, module="pyrender", peer=True)
    for name, module, environment in (
        ("habitat-sim", "habitat_sim", {}),
        ("mujoco", "mujoco", {"MUJOCO_GL": "egl"}),
        ("pyvista", "pyvista", {"PYVISTA_OFF_SCREEN": "true", "VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"}),
        ("open3d rays", "open3d", {}),
    ):
        found[name] = Contender(name, {}, environment, module=module, peer=True)
    return found


CONTENDERS = _contenders()
