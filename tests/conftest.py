"""Fixtures that all tests share: the folder of real scene files, and a home small enough to reason about."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import settings

from openmap_env.navigation import NavigableSurface
from openmap_scenes import Instance, Material, Room, Scene
from openmap_scenes.catalog import READERS

# Continuous integration judges a change, not its luck: there, properties are tested on the same examples each time.
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

_kept: tempfile.TemporaryDirectory[str] | None = None


def pytest_configure() -> None:
    """Scenes that the tests load are kept for this run alone, not in the user's cache."""
    global _kept
    if "OPENMAP_CACHE" not in os.environ:
        _kept = tempfile.TemporaryDirectory(prefix="openmap-tests-")
        os.environ["OPENMAP_CACHE"] = _kept.name


def pytest_unconfigure() -> None:
    if _kept is not None:
        _kept.cleanup()


# Rooms, 4 m x 4 m each, along x; doors 1 m wide at z = 0 in the walls between them.
ROOMS = {1: ("bedroom", -6.0), 2: ("living_room", -2.0), 3: ("kitchen", 2.0)}
# category, room, attributes, min, max
FURNITURE: list[tuple[str, int, dict[str, str], tuple[float, float, float], tuple[float, float, float]]] = [
    ("bed", 1, {"colour": "white"}, (-6.0, 0.0, -2.0), (-4.0, 0.5, -0.6)),
    ("pillow", 1, {"colour": "white"}, (-5.9, 0.5, -1.6), (-5.5, 0.65, -1.1)),
    ("wardrobe", 1, {"colour": "brown"}, (-5.8, 0.0, 1.4), (-4.6, 2.0, 2.0)),
    ("corner sofa", 2, {"colour": "grey"}, (-1.5, 0.0, 1.2), (0.3, 0.8, 2.0)),
    ("armchair", 2, {"colour": "blue"}, (1.0, 0.0, 1.2), (1.7, 0.8, 1.9)),
    ("armchair", 2, {"colour": "red"}, (1.0, 0.0, -1.9), (1.7, 0.8, -1.2)),
    ("picture", 2, {}, (-1.2, 1.4, 1.95), (-0.4, 2.0, 2.0)),
    ("dining table", 3, {"colour": "brown", "material": "wood"}, (3.4, 0.0, -1.8), (4.6, 0.75, -1.0)),
    ("chair", 3, {"colour": "brown"}, (3.7, 0.0, -0.9), (4.1, 0.9, -0.5)),
    ("sink", 3, {"colour": "white"}, (5.2, 0.0, 1.4), (6.0, 0.9, 2.0)),
    ("refrigerator", 3, {"colour": "white"}, (2.4, 0.0, 1.3), (3.1, 1.8, 2.0)),
    ("vase", 3, {"colour": "blue"}, (4.2, 0.75, -1.5), (4.35, 1.0, -1.35)),
]

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
_SIDES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


def make_toy_scene() -> Scene:
    """The scene of ``FURNITURE``, with walls, floor and ceiling as instances after it."""
    boxes = [
        (category, room, attributes, np.array(low), np.array(high))
        for category, room, attributes, low, high in FURNITURE
    ]
    boxes.append(("floor", 1, {}, np.array([-6.0, -0.1, -2.0]), np.array([6.0, 0.0, 2.0])))
    boxes.append(("ceiling", 1, {}, np.array([-6.0, 2.5, -2.0]), np.array([6.0, 2.6, 2.0])))
    for low_x, low_z, high_x, high_z in (
        (-6.1, -2.1, 6.1, -2.0),
        (-6.1, 2.0, 6.1, 2.1),
        (-6.1, -2.0, -6.0, 2.0),
        (6.0, -2.0, 6.1, 2.0),
        (-2.05, -2.0, -1.95, -0.5),
        (-2.05, 0.5, -1.95, 2.0),
        (1.95, -2.0, 2.05, -0.5),
        (1.95, 0.5, 2.05, 2.0),
    ):
        boxes.append(("wall", 1, {}, np.array([low_x, 0.0, low_z]), np.array([high_x, 2.5, high_z])))
    vertices, faces, owner, material, instances = [], [], [], [], []
    for number, (category, room, attributes, low, high) in enumerate(boxes, 1):
        faces.append(_SIDES + 8 * (number - 1))
        vertices.append(low + _CORNERS * (high - low))
        owner += [number] * 12
        material += [(number - 1) % 5] * 12
        instances.append(Instance(number, category, (low + high) / 2, low, high, room, None, attributes, number + 100))
    colours: list[npt.NDArray[np.float32]] = [np.array(c, np.float32) for c in np.eye(3)] + [
        np.array([0.8, 0.8, 0.5], np.float32),
        np.array([0.4, 0.6, 0.6], np.float32),
    ]
    return Scene(
        name="toy",
        vertices=np.concatenate(vertices).astype(np.float32),
        faces=np.concatenate(faces).astype(np.int32),
        face_material=np.array(material, np.int32),
        face_instance=np.array(owner, np.int32),
        materials=[Material(f"m{i}", c) for i, c in enumerate(colours)],
        instances=instances,
        rooms=[
            Room(i, name, np.array([x, 0.0, -2.0]), np.array([x + 4.0, 2.5, 2.0])) for i, (name, x) in ROOMS.items()
        ],
        source="toy:0",
    )


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """The folder of scene fixtures that lies beside a checkout; skips where there is none, as on a user's machine."""
    default = Path(__file__).resolve().parents[2] / "shared" / "scenes"
    folder = Path(os.environ.get("OPENMAP_SHARED_SCENES", default))
    if not folder.is_dir():
        pytest.skip(f"scene fixtures are not at {folder}; set OPENMAP_SHARED_SCENES to their folder")
    return folder


@pytest.fixture(scope="session")
def toy_scene() -> Scene:
    return make_toy_scene()


@pytest.fixture(scope="session")
def toy_surface(toy_scene: Scene) -> NavigableSurface:
    return NavigableSurface.from_scene(toy_scene)


@pytest.fixture(scope="session")
def toy_specs(toy_scene: Scene) -> Iterator[list[str]]:
    """Catalogue specs that load the toy scene, as any other scene is loaded; there are two, so that scenes can be changed."""
    READERS["toy"] = lambda rest: toy_scene
    yield ["toy:0", "toy:1"]
    del READERS["toy"]
