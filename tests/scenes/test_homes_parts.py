"""The parts of the home generator that need no furniture library: plans, OBJ files, thinning, colour words."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from openmap_scenes import DataError
from openmap_scenes.homes.colour import WORDS, colour_words
from openmap_scenes.homes.items import Thing
from openmap_scenes.homes.library import parse_properties, read_library
from openmap_scenes.homes.obj import Surface, read_obj
from openmap_scenes.homes.placement import RoomSpace
from openmap_scenes.homes.plan import make_plan
from openmap_scenes.homes.primitives import box, material
from openmap_scenes.homes.surface import split, thin

OBJ = """mtllib thing.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
usemtl skin
f 1/1 2/2 3/3 4/1
usemtl glass
f -4 -3 -2
"""
MTL = """newmtl skin
Kd 0.1 0.1 0.1
map_Kd /elsewhere/skin.png
newmtl glass
Kd 0 0 0
d 0.25
"""


def archive(files: dict[str, bytes]) -> zipfile.ZipFile:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        for name, data in files.items():
            file.writestr(name, data)
    return zipfile.ZipFile(buffer)


def picture() -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (600, 300), (200, 10, 10)).save(buffer, "PNG")
    return buffer.getvalue()


def test_an_obj_file_gives_triangles_textures_and_opacity() -> None:
    file = archive({"m/thing.obj": OBJ.encode(), "m/thing.mtl": MTL.encode(), "m/skin.png": picture()})
    surface, materials, opacity = read_obj(file, "m/thing.obj", texture_size=128)
    np.testing.assert_array_equal(surface.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]])
    names = [materials[m].name for m in surface.material]
    assert names == ["skin", "skin", "glass"]
    skin, glass = materials[surface.material[0]], materials[surface.material[2]]
    assert skin.texture is not None
    assert skin.texture.shape == (64, 128, 3)
    assert opacity[surface.material[2]] == 0.25
    assert glass.colour.min() > 0.5
    np.testing.assert_allclose(surface.uv[0], [[0, 0], [1, 0], [1, 1]])


@pytest.mark.parametrize("text", ["", "v 0 0 0\nf 1 2 3\n", "v 0 0 x\n", "v 0 0 0\nf 1 a 1\n"])
def test_a_broken_obj_file_is_named(text: str) -> None:
    with pytest.raises(DataError, match=r"thing\.obj"):
        read_obj(archive({"thing.obj": text.encode()}), "thing.obj", 64)


def test_a_broken_catalogue_is_named(tmp_path: Path) -> None:
    (tmp_path / "bad.sh3f").write_bytes(b"not a zip")
    with pytest.raises(DataError, match=r"bad\.sh3f"):
        read_library(tmp_path)


def test_properties_join_lines_and_resolve_escapes() -> None:
    text = "# note\nname#1=Caf\\u00e9 \\\n  table\nwidth#1=3\n"
    assert parse_properties(text) == {"name#1": "Café table", "width#1": "3"}


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000), st.integers(40, 400))
def test_thinning_meets_its_target_and_keeps_the_extent(seed: int, target: int) -> None:
    rng = np.random.default_rng(seed)
    n = 24
    u, v = (g.reshape(-1) for g in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n)))
    vertices = np.stack([u, 0.1 * np.sin(6 * u + rng.uniform(0, 6)) * v, v], 1)
    i = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])
    uv = np.stack([u, v], 1)[faces]
    surface = Surface(vertices, faces, uv, np.zeros(len(faces), np.int64))
    thinned = thin(surface, target)
    assert 0 < len(thinned.faces) <= target
    assert np.abs(np.ptp(thinned.vertices, axis=0) - np.ptp(vertices, axis=0)).max() < 0.2


def test_splitting_bounds_every_edge_and_keeps_area_and_uv() -> None:
    surface = Surface(
        np.array([[0.0, 0, 0], [3, 0, 0], [0, 0, 2]]),
        np.array([[0, 1, 2]]),
        np.array([[[0.0, 0], [3, 0], [0, 2]]]),
        np.zeros(1, np.int64),
    )
    fine = split(surface, 0.5)
    corners = fine.vertices[fine.faces]
    assert np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max() <= 0.5
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(3.0)
    np.testing.assert_allclose(fine.uv, corners[..., [0, 2]], atol=1e-12)


def test_colour_words_are_what_a_person_would_say() -> None:
    named = {
        "black": (0.05, 0.05, 0.06),
        "white": (0.95, 0.95, 0.93),
        "grey": (0.5, 0.5, 0.52),
        "red": (0.8, 0.1, 0.1),
        "orange": (0.95, 0.5, 0.1),
        "yellow": (0.95, 0.85, 0.2),
        "green": (0.2, 0.6, 0.2),
        "blue": (0.15, 0.25, 0.7),
        "purple": (0.45, 0.2, 0.6),
        "brown": (0.45, 0.28, 0.15),
        "beige": (0.9, 0.82, 0.68),
    }
    found = [WORDS[i] for i in colour_words(np.array(list(named.values())))]
    assert found == list(named)


def test_a_thing_is_not_put_where_it_would_shut_a_door() -> None:
    rng = np.random.default_rng(3)
    plan = make_plan(rng)
    room = plan.openings[0].rooms[0]
    space = RoomSpace(plan, room, rng)
    cube = Thing("cube", box((-0.3, 0, -0.3), (0.3, 0.6, 0.3), material("red", (1, 0, 0))), {})
    placed = [item for _ in range(60) if (item := space.anywhere(cube)) is not None]
    assert placed
    assert not any(item.footprint.overlaps(zone) for item in placed for zone in space.zones)
    assert space.reachable(space.items) is not None
