"""Solids that meet and solids that stay apart, and the products of vectors under them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from openmap_scenes.homes.bodies import Body, meetings, run_together
from openmap_scenes.homes.build import apart
from openmap_scenes.homes.items import Item, Thing
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.primitives import box, material
from openmap_scenes.homes.shell import Piece
from openmap_scenes.homes.vectors import area_vectors, cross, gradient, lengths

GREY = material("grey", (0.5, 0.5, 0.5))
ARRAYS = arrays.arrays(np.float64, (5, 4, 3), elements=st.floats(-9, 9, width=32))


def cube(size: float = 1.0) -> Model:
    """A cube on its base, its faces not split."""
    return box((-size / 2, 0.0, -size / 2), (size / 2, size, size / 2), GREY, step=9.0)


def standing(x: float, z: float, size: float = 1.0, y: float = 0.0) -> Item:
    return Item(Thing("cube", cube(size), {}), np.array([x, y, z]), 0.0, 0)


def wall(at: float) -> Piece:
    """A wall that looks along +x at x = ``at`` m."""
    return Piece("wall", 0, box((at - 0.1, 0.0, -3.0), (at, 2.6, 3.0), GREY, step=9.0), {})


@pytest.mark.parametrize(("overlap", "clash"), [(-0.01, False), (0.004, False), (0.012, True), (0.3, True)])
def test_two_cubes_run_together_where_they_share_more_than_a_centimetre(overlap: float, clash: bool) -> None:
    a, b = standing(0.0, 0.0), standing(1.0 - overlap, 0.31, y=0.13)
    assert run_together(a.body, b.body) is clash
    assert run_together(b.body, a.body) is clash


def test_a_thing_in_the_hollow_of_another_does_not_run_into_it() -> None:
    """Their boxes share all of the smaller one, their faces nothing."""
    open_box = box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5), dict.fromkeys(range(1, 6), GREY))
    assert not run_together(Body(open_box.vertices, open_box.faces), standing(0.0, 0.0, 0.4, y=0.2).body)


def test_meetings_are_those_of_the_loose_with_all_others() -> None:
    loose = [standing(0.0, 0.0).body, standing(0.9, 0.2, y=0.1).body, standing(5.0, 0.0).body]
    fixed = [wall(-0.45), wall(-0.3)]
    bodies = [Body(p.mesh.vertices, p.mesh.faces) for p in fixed]
    assert meetings(loose, bodies) == [(0, 1), (0, 3), (0, 4)]


def test_what_runs_into_another_goes_with_all_that_stands_on_it() -> None:
    table, cup, chest, small = (
        standing(0.0, 0.0),
        standing(0.0, 0.0, 0.1, y=1.0),
        standing(3.0, 0.0),
        standing(3.55, 0.1, 0.5, 0.1),
    )
    cup.support = table
    assert apart([table, cup, chest, small], []) == [table, cup, chest]
    assert apart([table, cup, chest, small], [wall(-0.4)]) == [chest]


@given(ARRAYS, ARRAYS)
def test_products_are_those_of_numpy(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(gradient(a), np.gradient(a, axis=0))
    np.testing.assert_allclose(lengths(a), np.linalg.norm(a, axis=-1), rtol=1e-12)


def test_the_area_vectors_of_a_closed_body_cancel() -> None:
    model = cube()
    area = area_vectors(model.vertices.astype(np.float64), model.faces)
    np.testing.assert_allclose(area.sum(0), 0.0, atol=1e-6)
    assert lengths(area).sum() / 2 == pytest.approx(6.0)
