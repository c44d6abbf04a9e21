"""What the tests of saved and of kept scenes share."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from openmap_scenes import Scene

ARRAYS = ("vertices", "faces", "face_material", "face_instance", "uv", "vertex_colour")


class Reader:
    """Gives a scene and counts how often."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.calls = scene, 0

    def __call__(self) -> Scene:
        self.calls += 1
        return self.scene


def entries(folder: Path) -> list[Path]:
    return sorted(item for item in folder.iterdir() if not item.name.startswith("."))


def unfinished(folder: Path) -> list[Path]:
    return sorted(item for item in folder.rglob("*.tmp"))


def assert_same(one: Scene, other: Scene) -> None:
    for name in ARRAYS:
        a, b = getattr(one, name), getattr(other, name)
        assert (a is None) == (b is None), name
        if a is not None:
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
    for field in ("name", "source", "credits"):
        assert getattr(one, field) == getattr(other, field)
    for a, b in zip(
        [*one.instances, *one.rooms, *one.materials], [*other.instances, *other.rooms, *other.materials], strict=True
    ):
        for field in dataclasses.fields(a):
            x, y = getattr(a, field.name), getattr(b, field.name)
            if isinstance(x, np.ndarray):
                assert x.dtype == y.dtype
                np.testing.assert_array_equal(x, y)
            else:
                assert type(x) is type(y)
                assert x == y
    assert one.digest() == other.digest()
