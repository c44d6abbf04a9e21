"""``openmap scenes prepare``: what it finds out is what a later simulator has from its first picture on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import make_toy_scene
from rendering_cases import needs_opengl
from rich.console import Console

from openmap_env.rendering.opengl import OpenGLRenderer
from openmap_env.simulator import Simulator, eye_places
from openmap_eval.scene_commands import PrepareScenes
from openmap_scenes import PinholeCamera, load_scene
from openmap_scenes.formats.export import export_scene


@needs_opengl
def test_a_prepared_scene_is_known_to_the_next_simulator_and_looks_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "cache"))
    export_scene(make_toy_scene(), tmp_path / "toy.glb")
    spec, camera = f"file:{tmp_path / 'toy.glb'}", PinholeCamera.from_hfov(81, 61, 90.0)

    def simulator() -> Simulator:
        made = Simulator(load_scene(spec), camera, renderer="opengl")
        made.reset(made.surface.random_point(np.random.default_rng(0)), 0.5)
        return made

    first = simulator()
    places = eye_places(first.surface, first.camera_height)
    assert isinstance(first.renderer, OpenGLRenderer)
    assert not first.renderer.recall(places)
    before = first.observe()
    first.close()

    console = Console(record=True, width=120)
    PrepareScenes((spec,)).run(console)
    assert "ready" in console.export_text()

    second = simulator()
    assert isinstance(second.renderer, OpenGLRenderer)
    assert second.renderer.recall(places)
    after = second.observe()
    for name in ("rgb", "depth", "instance"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    second.close()


def test_eyes_are_above_every_cell_of_large_floors(toy_surface) -> None:
    places = eye_places(toy_surface, 1.25)
    floors = places - np.array([0.0, 1.25, 0.0])
    assert len(places) >= (toy_surface.island == 0).sum()
    assert all(toy_surface.is_navigable(place) for place in floors[::50])
