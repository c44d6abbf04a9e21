"""What every generator of small, soft, hanging and growing things keeps to, whatever the seed and the room it is given."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_scenes.homes import revolve
from openmap_scenes.homes.models import LONGEST_EDGE, Model
from openmap_scenes.homes.parametric import (
    decor,
    fixtures,
    food,
    lighting,
    media,
    patterns,
    plants,
    small,
    tableware,
    textiles,
)
from openmap_scenes.homes.parametric.base import Limits
from openmap_scenes.homes.parametric.making import split_edges
from openmap_scenes.homes.primitives import box, material

MODULES = (textiles, lighting, decor, plants, tableware, food, media, small, fixtures)
GENERATORS = {kind: make for module in MODULES for kind, make in module.GENERATORS.items()}
ROOM = Limits(3.0, 3.0, 2.6)
MOST_FACES = 4500
GREY = material("grey", (0.5, 0.5, 0.5))


def digest(model: Model) -> str:
    h = hashlib.sha256()
    for array in (model.vertices, model.normals, model.uv, model.faces, model.face_material):
        h.update(np.ascontiguousarray(array).tobytes())
    for m in model.materials:
        h.update(m.colour.tobytes() + (b"" if m.texture is None else np.ascontiguousarray(m.texture).tobytes()))
    return h.hexdigest()


def area_vectors(model: Model) -> np.ndarray:
    a, b, c = (model.vertices[model.faces[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a) / 2


def check_model(model: Model, limits: Limits) -> None:
    """Everything the contract of a generator says of its model."""
    v = model.vertices.astype(np.float64)
    assert np.isfinite(v).all()
    assert np.isfinite(model.normals).all()
    assert np.isfinite(model.uv).all()
    low, high = v.min(0), v.max(0)
    assert np.all(high - low <= np.array([limits.width, limits.height, limits.depth]) + 1e-5)
    np.testing.assert_allclose([low[1], low[0] + high[0], low[2] + high[2]], 0.0, atol=2e-5)
    corners = v[model.faces]
    assert np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max() <= LONGEST_EDGE
    assert 40 <= len(model.faces) <= MOST_FACES
    assert len(model.face_material) == len(model.faces)
    assert 0 <= model.face_material.min() <= model.face_material.max() < len(model.materials)
    assert all(m.colour.min() >= 0 and m.colour.max() <= 1 for m in model.materials)
    np.testing.assert_allclose(np.linalg.norm(model.normals[np.unique(model.faces)], axis=1), 1.0, atol=1e-3)
    area = area_vectors(model)
    size = np.linalg.norm(area, axis=1)
    against = (area * model.normals[model.faces].mean(1)).sum(1) < 0.0
    assert size[against].sum() < 0.01 * size.sum(), "faces wind against their normals"
    assert (corners[:, 0] * area).sum() > 0.0, "the surfaces face inwards"


@pytest.mark.parametrize("kind", sorted(GENERATORS))
def test_a_generator_keeps_its_contract(kind: str) -> None:
    seen = set()
    for seed in range(6):
        made, again = (GENERATORS[kind](np.random.default_rng([seed, 3]), ROOM) for _ in range(2))
        assert made is not None
        assert again is not None
        check_model(made.model, ROOM)
        assert digest(made.model) == digest(again.model)
        assert made.attributes == again.attributes
        assert all(k.islower() and v.islower() and v for k, v in made.attributes.items())
        assert 0.0 <= made.elevation < 2.6
        seen.add(digest(made.model))
    assert len(seen) == 6


@settings(max_examples=150, deadline=None)
@given(
    kind=st.sampled_from(sorted(GENERATORS)),
    seed=st.integers(0, 2**32 - 1),
    width=st.floats(0.02, 3.0),
    depth=st.floats(0.02, 3.0),
    height=st.floats(0.01, 2.6),
)
def test_what_is_made_fits_or_nothing_is_made(kind: str, seed: int, width: float, depth: float, height: float) -> None:
    limits = Limits(width, depth, height)
    made = GENERATORS[kind](np.random.default_rng(seed), limits)
    if made is not None:
        check_model(made.model, limits)


def test_curtains_and_pendant_lamps_take_their_size_from_the_limits() -> None:
    for width, height in ((1.2, 1.5), (2.6, 2.4)):
        made = textiles.curtain(np.random.default_rng(1), Limits(width, 0.3, height))
        assert made is not None
        np.testing.assert_allclose(made.model.size[:2], [width, height], atol=0.12)
    for drop in (0.7, 1.2):
        made = lighting.pendant_lamp(np.random.default_rng(2), Limits(1.0, 1.0, drop))
        assert made is not None
        np.testing.assert_allclose(made.model.size[1], drop, atol=0.02)


CLOSED = {
    "lathe": revolve.lathe([(0, 0), (0.1, 0), (0.1, 0.2), (0.09, 0.2), (0.09, 0.01), (0, 0.01)], GREY),
    "vessel": revolve.vessel([(0.05, 0), (0.09, 0.1), (0.07, 0.2)], 0.005, GREY, GREY),
    "tube": revolve.tube(revolve.spline([(0, 0, 0), (0.1, 0.3, 0), (0.3, 0.3, 0.2)], 10), 0.02, GREY),
    "ellipsoid": revolve.ellipsoid((0, 1, 0), (0.4, 0.2, 0.3), GREY, round_up=0.5, round_across=0.6),
    "soft box": revolve.soft_box((0, 0, 0), (1, 0.5, 2), GREY, 0.05, 2),
    "puffed box": revolve.soft_box((0, 0, 0), (0.5, 0.1, 0.4), GREY, 0.03, 2, puff=0.02),
    "leaf": revolve.leaf(revolve.spline([(0, 0, 0), (0.1, 0.1, 0), (0.3, 0, 0)], 6),
         [0.001, 0.05, 0.06, 0.05, 0.03, 0.001], GREY),
    "sheet": revolve.sheet(np.stack([*np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 4)), np.zeros((4, 5))], 2), 0.01, GREY),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(CLOSED))
def test_shapes_are_closed_and_face_outwards(name: str) -> None:
    model = CLOSED[name]
    area = area_vectors(model)
    # A closed surface has no net area; its volume is positive where it faces outwards.
    assert np.linalg.norm(area.sum(0)) < 0.01 * np.linalg.norm(area, axis=1).sum()
    assert (model.vertices[model.faces[:, 0]] * area).sum() > 0
    along = (area * model.normals[model.faces].mean(1)).sum(1)
    assert (along > 0).all()


def test_volumes_are_those_of_the_solids() -> None:
    def volume(model: Model) -> float:
        return float((model.vertices[model.faces[:, 0]] * area_vectors(model)).sum() / 3)

    assert volume(revolve.ellipsoid((1, 2, 3), (0.3, 0.4, 0.5), GREY, 64, 32)) == pytest.approx(
        4 / 3 * np.pi * 0.06, rel=0.01
    )
    cylinder = revolve.lathe([(0, 0), (0.2, 0), (0.2, 0.5), (0, 0.5)], GREY, 64)
    assert volume(cylinder) == pytest.approx(np.pi * 0.04 * 0.5, rel=0.01)
    wall = np.pi * (0.2**2 - 0.19**2) * 0.49 + np.pi * 0.2**2 * 0.01
    assert volume(revolve.vessel([(0.2, 0), (0.2, 0.5)], 0.01, GREY, GREY, 64)) == pytest.approx(wall, rel=0.01)


def test_splitting_edges_keeps_the_surface() -> None:
    whole = box((0, 0, 0), (2, 1, 0.5), GREY, step=9.0)
    fine = split_edges(whole, 0.3)
    corners = fine.vertices[fine.faces]
    assert np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max() <= 0.3
    total = [np.linalg.norm(area_vectors(m), axis=1).sum() for m in (whole, fine)]
    np.testing.assert_allclose(total[0], total[1], rtol=1e-5)
    assert (area_vectors(fine) * fine.normals[fine.faces].mean(1) > -1e-9).all()


def test_a_spline_goes_through_its_points() -> None:
    points = np.array([(0.0, 0), (1, 2), (2, -1), (4, 0)])
    np.testing.assert_allclose(revolve.spline(points, 10)[::3], points, atol=1e-12)


def test_copies_are_the_model_at_every_place() -> None:
    one = revolve.ellipsoid((0, 0, 0), (0.1, 0.2, 0.3), GREY, 8, 4)
    R = np.stack([revolve.turn(k, 0.3 + k) for k in range(3)])
    at = np.arange(9.0).reshape(3, 3)
    many = revolve.copies(one, at, R, 2.0)
    for k, part in enumerate(np.split(many.vertices, 3)):
        expected = revolve.placed(one, at[k], R[k], 2.0).vertices
        np.testing.assert_allclose(part, expected, atol=1e-5)


def test_textures_are_pictures() -> None:
    rng = np.random.default_rng(0)
    for image in (
        patterns.wicker(rng, (0.5, 0.4, 0.3)),
        patterns.clock_face(rng, (0.9, 0.9, 0.9), (0.1, 0.1, 0.1)),
        patterns.cover(rng),
        patterns.fabric(rng)[0],
        patterns.globe_map(rng, (0.2, 0.4, 0.7), (0.5, 0.6, 0.3)),
    ):
        assert image.dtype == np.uint8
        assert image.ndim == 3
        assert image.shape[2] == 3
        assert image.std() > 1.0
