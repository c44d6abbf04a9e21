"""Fixtures of the scenes' tests."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from openmap_scenes import Room, Scene


@pytest.fixture(scope="module")
def rich_scene(toy_scene: Scene) -> Scene:
    """The toy scene with everything that a scene can have: shared and single textures, uv, colours, odd names."""
    rng = np.random.default_rng(3)
    wood, cloth = rng.integers(0, 256, (8, 6, 3), np.uint8), rng.integers(0, 256, (5, 7, 3), np.uint8)
    textures = [wood, None, cloth, wood, None]
    materials = [
        dataclasses.replace(m, texture=t, missing_texture="" if t is not None else "gone.png")
        for m, t in zip(toy_scene.materials, textures, strict=True)
    ]
    first = dataclasses.replace(
        toy_scene.instances[0], category='a "bed" – 床', mpcat40="bed", scannet200="bed", lvis="bed", room=None
    )
    rooms = [*toy_scene.rooms, Room(9, "attic", np.array([0.1, 3, 0]), np.array([1, 5, 1 / 3]), 1)]
    return dataclasses.replace(
        toy_scene,
        materials=materials,
        instances=[first, *toy_scene.instances[1:]],
        rooms=rooms,
        uv=rng.random((len(toy_scene.vertices), 2), np.float32),
        vertex_colour=rng.integers(0, 256, toy_scene.vertices.shape, np.uint8),
        credits=("a by b", "c"),
    )


@pytest.fixture
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("OPENMAP_CACHE_GB", raising=False)
    return tmp_path / "cache" / "scenes-v1"
