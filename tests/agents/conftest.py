"""A home of two rooms made of boxes, for agents that walk."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import trimesh

from openmap_scenes import Instance, Material, Scene
from openmap_scenes.catalog import READERS

# category, min, max, colour; rooms 4 m x 4 m along x, a door 0.9 m wide at z = 1 in the wall between them.
BOXES = [
    ("floor", (-4.0, -0.1, -2.0), (4.0, 0.0, 2.0), (0.6, 0.5, 0.4)),
    ("ceiling", (-4.0, 2.5, -2.0), (4.0, 2.6, 2.0), (1.0, 1.0, 1.0)),
    ("wall", (-4.1, 0.0, -2.1), (4.1, 2.5, -2.0), (0.9, 0.9, 0.8)),
    ("wall", (-4.1, 0.0, 2.0), (4.1, 2.5, 2.1), (0.9, 0.9, 0.8)),
    ("wall", (-4.1, 0.0, -2.0), (-4.0, 2.5, 2.0), (0.8, 0.9, 0.9)),
    ("wall", (4.0, 0.0, -2.0), (4.1, 2.5, 2.0), (0.8, 0.9, 0.9)),
    ("wall", (-0.05, 0.0, -2.0), (0.05, 2.5, 0.55), (0.8, 0.8, 0.8)),
    ("wall", (-0.05, 0.0, 1.45), (0.05, 2.5, 2.0), (0.8, 0.8, 0.8)),
    ("bed", (-4.0, 0.0, -2.0), (-2.2, 0.5, -0.8), (0.9, 0.1, 0.1)),
    ("table", (2.0, 0.0, -0.6), (2.8, 0.7, 0.2), (0.1, 0.6, 0.1)),
    ("refrigerator", (3.3, 0.0, 1.3), (4.0, 1.8, 2.0), (0.1, 0.1, 0.9)),
]


def _scene() -> Scene:
    meshes = [trimesh.creation.box(bounds=(low, high)) for _, low, high, _ in BOXES]
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    owner = np.repeat(np.arange(len(BOXES)), [len(m.faces) for m in meshes]).astype(np.int32)
    instances = [
        Instance(n, category, (np.array(low) + high) / 2, np.array(low), np.array(high))
        for n, (category, low, high, _) in enumerate(BOXES, start=1)
    ]
    return Scene(
        name="two_rooms",
        vertices=np.concatenate([m.vertices for m in meshes]).astype(np.float32),
        faces=np.concatenate([m.faces + f for m, f in zip(meshes, first, strict=False)]).astype(np.int32),
        face_material=owner,
        face_instance=owner + np.int32(1),
        materials=[Material(f"m{n}", np.array(colour, np.float32)) for n, (*_, colour) in enumerate(BOXES)],
        instances=instances,
        source="two_rooms:0",
    )


@pytest.fixture(scope="session")
def two_rooms() -> Scene:
    return _scene()


@pytest.fixture(scope="session")
def two_rooms_spec(two_rooms: Scene) -> Iterator[str]:
    """A catalogue spec that loads the two rooms."""
    READERS["two_rooms"] = lambda rest: two_rooms
    yield "two_rooms:0"
    del READERS["two_rooms"]
