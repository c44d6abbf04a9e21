"""What depth says of the floor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_env.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, mark_cells
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(24, 18, 90.0)


def pose(x=0.0, z=0.0, heading=0.0, pitch=0.0, height=1.25) -> np.ndarray:
    """Camera-to-episode (4, 4)."""
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    c, s = math.cos(pitch), math.sin(pitch)
    T = np.eye(4)
    T[:3, :3] = turn @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    T[:3, 3] = (x, height, z)
    return T


def marked_plainly(depth, T, first, shape, resolution, low, high, max_depth) -> np.ndarray:
    """``mark_cells`` once more: all points, then all that bars the way over all that is free."""
    free, occupied = set(), set()
    for v, u in np.argwhere((depth > 0.0) & (depth <= max_depth)):
        d = float(depth[v, u])
        end = T[:3, :3] @ [(u - CAMERA.cx) / CAMERA.fx * d, -(v - CAMERA.cy) / CAMERA.fy * d, -d]
        rises = T[1, 3] + end[1]

        def cell(t, end=end):
            x, z = T[0, 3] + t * end[0], T[2, 3] + t * end[2]
            return math.floor(z / resolution) - first[0], math.floor(x / resolution) - first[1]

        if low < rises <= high:
            occupied.add(cell(1.0))
        elif abs(rises) <= low:
            free.add(cell(1.0))
            flat = max(math.hypot(end[0], end[2]), 0.5 * resolution)
            t = (T[1, 3] - low) / (T[1, 3] - rises) if T[1, 3] > low else 0.0
            while t < 1.0:
                free.add(cell(t))
                t += 0.5 * resolution / flat
    mark = np.zeros(shape, np.uint8)
    for cells, state in ((free, FREE), (occupied, OCCUPIED)):
        for r, c in cells:
            mark[r, c] = state
    return mark


@given(st.integers(0, 2**32 - 1), st.floats(-3, 3), st.floats(-0.9, 0.9), st.sampled_from([0.1, 1.25]))
@settings(deadline=None, max_examples=25)
def test_the_fast_way_agrees_with_the_plain_one(seed, heading, pitch, height):
    depth = np.random.default_rng(seed).uniform(-0.5, 5.0, (18, 24)).clip(0.0).astype(np.float32)
    T, first, shape = pose(0.3, -0.2, heading, pitch, height), np.array([-80, -80]), (160, 160)
    mark = np.zeros(shape, np.uint8)
    c = CAMERA
    mark_cells(depth, 1, c.fx, c.fy, c.cx, c.cy, T, 0.0, first, 0.1, 0.2, 1.5, 4.0, mark)
    np.testing.assert_array_equal(mark, marked_plainly(depth, T, first, shape, 0.1, 0.2, 1.5, 4.0))


def wall_ahead(distance: float) -> np.ndarray:
    """Depth (18, 24) of a floor, and a wall across the way at ``distance`` m, seen from 1.25 m."""
    down = (np.arange(18)[:, None] - CAMERA.cy) / CAMERA.fy
    floor = np.where(down > 0, 1.25 / np.maximum(down, 1e-9), np.inf)
    return np.broadcast_to(np.minimum(floor, distance), (18, 24)).astype(np.float32)


def test_a_wall_bars_the_way_the_floor_before_it_is_free_and_behind_it_nothing_is_known():
    seen = Occupancy(CAMERA, resolution=0.1)
    seen.integrate(wall_ahead(2.6), pose(0.05, 0.05), 0.0)
    x, z = seen.origin

    def states(at_z):
        """What is said of a strip across the way, 2 m wide."""
        left, right = (math.floor((at - x) / 0.1) for at in (-1.0, 1.0))
        return set(seen.grid[math.floor((at_z - z) / 0.1), left:right].tolist())

    assert OCCUPIED in states(-2.55)
    assert FREE in states(-1.75)
    assert OCCUPIED not in states(-1.75)
    assert states(-3.0) == states(1.0) == {UNKNOWN}
    view = seen.crop(pose(0.05, 0.05), 61, 0.1)
    assert (view[:4] == UNKNOWN).all()
    assert OCCUPIED in view[4], "26 cells ahead is 26 rows up"
    behind = seen.crop(pose(0.05, 0.05, heading=math.pi), 61, 0.1)
    np.testing.assert_array_equal(behind, view[::-1, ::-1])


def test_what_went_away_is_forgotten_after_a_while():
    seen = Occupancy(CAMERA, resolution=0.2)
    seen.integrate(wall_ahead(1.5), pose(), 0.0)
    barred = seen.grid == OCCUPIED
    for _ in range(12):
        seen.integrate(wall_ahead(6.0), pose(pitch=-0.3), 0.0)
        seen.integrate(wall_ahead(6.0), pose(), 0.0)
    assert barred.sum() > (barred & (seen.grid == OCCUPIED)).sum()


@given(st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40), st.floats(-3, 3)), min_size=1, max_size=4))
@settings(deadline=None, max_examples=20)
def test_the_grid_grows_to_hold_what_is_seen_and_keeps_what_was(poses):
    seen = Occupancy(CAMERA, resolution=0.5)
    for x, z, heading in poses:
        T = pose(x, z, heading)
        seen.integrate(wall_ahead(3.0), T, 0.0)
        before = seen.crop(T, 21, 0.5)
        seen.integrate(np.zeros((18, 24), np.float32), pose(x + 30.0, z), 0.0)
        np.testing.assert_array_equal(seen.crop(T, 21, 0.5), before)
        assert (before == OCCUPIED).any()


def test_settings_that_make_no_sense_are_refused():
    for wrong in ({"resolution": 0.0}, {"low": 2.0}, {"max_depth": -1.0}, {"pixels": 0}):
        with pytest.raises(ValueError, match="expected"):
            Occupancy(CAMERA, **wrong)
