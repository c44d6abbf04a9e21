"""Occupancy says free only of what was seen, and lets a body through a door."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.exploration import FREE, OCCUPIED, UNKNOWN, OccupancyMap, PlannerSettings
from openmap_agents.exploration.planner import distances, traversal_cost
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(160, 120, 90.0)
HEIGHT = 1.25


def pose(x=0.0, z=0.0, heading=0.0, pitch=0.0):
    c, s, cp, sp = math.cos(heading), math.sin(heading), math.cos(pitch), math.sin(pitch)
    T = np.eye(4)
    T[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    T[:3, 3] = x, HEIGHT, z
    return T


def room_depth(wall_at):
    """Depth of a level camera over an endless floor, before walls across its view at ``wall_at(x at the wall)`` m."""
    rays = CAMERA.rays().astype(np.float64)
    with np.errstate(divide="ignore"):
        floor = np.where(rays[..., 1] < 0, -HEIGHT / rays[..., 1], np.inf)
    depth = np.minimum(floor, wall_at(rays[..., 0]))
    return np.where(depth < 20.0, depth, 0.0).astype(np.float32)


def state(occupancy, x, z):
    return occupancy.grid[occupancy.cell(x, z)]


def test_a_wall_is_occupied_the_floor_before_it_free_and_the_rest_unknown():
    occupancy = OccupancyMap()
    occupancy.integrate(room_depth(lambda a: np.full_like(a, 2.97)), pose(), CAMERA, 0.0)
    for x in (-1.0, 0.0, 1.0):
        assert state(occupancy, x, -2.97) == OCCUPIED
        assert state(occupancy, x, -2.5) == FREE
        assert state(occupancy, x, -3.5) == UNKNOWN
    assert state(occupancy, 0.0, -0.5) == UNKNOWN, "the camera does not see the floor at its feet"
    assert state(occupancy, 0.0, 1.0) == UNKNOWN, "nothing was seen behind the body"


def test_without_depth_nothing_is_known():
    occupancy = OccupancyMap()
    occupancy.integrate(np.zeros((120, 160), np.float32), pose(), CAMERA, 0.0)
    assert (occupancy.grid == UNKNOWN).all()


@pytest.mark.parametrize(("width", "passable"), [(0.8, True), (0.3, False)])
def test_a_body_fits_through_a_doorway_but_not_through_a_slit(width, passable):
    occupancy = OccupancyMap()
    depth = room_depth(lambda a: np.where(np.abs(a * 2.5) < width / 2, 4.5, 2.5))
    occupancy.integrate(depth, pose(), CAMERA, 0.0)
    # Seen from straight ahead, the floor right behind the jambs is hidden; a step nearer shows it.
    depth = room_depth(lambda a: np.where(np.abs(a * 1.5) < width / 2, 3.5, 1.5))
    occupancy.integrate(depth, pose(z=-1.0), CAMERA, 0.0)
    cost = traversal_cost(occupancy, occupancy.grid, 0.0, -1.0, PlannerSettings())
    distance, _ = distances(cost, occupancy.cell(0.0, -1.0), occupancy.resolution)
    assert np.isfinite(distance[occupancy.cell(0.0, -3.5)]) == passable


def test_a_ray_over_a_table_does_not_make_the_floor_under_it_free():
    occupancy = OccupancyMap()
    # The table's top, 0.7 m high from 1.5 m to 2.5 m ahead, hides the floor behind it up to 5.7 m; beyond is floor again.
    rays = CAMERA.rays().astype(np.float64)
    down = np.where(rays[..., 1] < 0, -rays[..., 1], 1e-9)
    floor, top = HEIGHT / down, (HEIGHT - 0.7) / down
    depth = np.where((top > 1.5) & (top < 2.5), top, floor)
    occupancy.integrate(np.where(depth < 8.0, depth, 0.0).astype(np.float32), pose(), CAMERA, 0.0)
    assert state(occupancy, 0.0, -2.0) == OCCUPIED
    assert state(occupancy, 0.0, -3.5) == UNKNOWN
    assert state(occupancy, 0.0, -6.5) == FREE


def test_what_lies_above_the_head_or_below_a_step_is_no_obstacle():
    occupancy = OccupancyMap()
    rays = CAMERA.rays().astype(np.float64)
    with np.errstate(divide="ignore"):
        carpet = np.where(rays[..., 1] < 0, -(HEIGHT - 0.05) / rays[..., 1], np.inf)
        lamp = np.where(rays[..., 1] > 0.2, 2.0, np.inf)
    depth = np.minimum(carpet, lamp)
    occupancy.integrate(np.where(depth < 8.0, depth, 0.0).astype(np.float32), pose(), CAMERA, 0.0)
    assert not (occupancy.grid == OCCUPIED).any()


def test_growing_keeps_what_is_known_where_it_is():
    occupancy = OccupancyMap()
    occupancy.integrate(room_depth(lambda a: np.full_like(a, 2.97)), pose(), CAMERA, 0.0)
    occupancy.bump(1.0, -1.0)
    before = {(x, z): state(occupancy, x, z) for x in (-1.0, 0.3, 1.0) for z in (-2.97, -2.0, 1.0)}
    shape = occupancy.grid.shape
    for x, z in ((-30.0, 0.0), (0.0, 25.0), (40.0, -40.0)):
        occupancy.stand(x, z)
    assert occupancy.grid.shape > shape
    assert {place: state(occupancy, *place) for place in before} == before
    assert occupancy.bumped[occupancy.cell(1.0, -1.0)]
    for layer in (occupancy.hits, occupancy.top, occupancy.seen_from, occupancy.stood, occupancy.looked):
        assert layer.shape == occupancy.grid.shape


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(ValueError, match=r"\(60, 80\).*\(120, 160\)"):
        OccupancyMap().integrate(np.zeros((60, 80), np.float32), pose(), CAMERA, 0.0)


def plain_marks(depth, camera, T, occupancy):
    """The cells that are hit and passed, pixel by pixel as the module says it."""
    s, hit, passed = occupancy.settings, set(), set()
    for v in range(camera.height):
        for u in range(camera.width):
            d = float(depth[v, u])
            if not s.min_depth <= d <= s.max_depth:
                continue
            ray = T[:3, :3] @ np.array([(u - camera.cx) / camera.fx * d, -(v - camera.cy) / camera.fy * d, -d])
            x, y, z = T[:3, 3] + ray
            if -s.drop < y <= s.min_height:
                passed.add(occupancy.cell(x, z))
            elif y < s.max_height:
                hit.add(occupancy.cell(x, z))
            if -s.drop < y < s.low_height:
                t = (T[1, 3] - s.low_height) / (T[1, 3] - y)
                while t < 1.0:
                    cell = occupancy.cell(T[0, 3] + t * ray[0], T[2, 3] + t * ray[2])
                    if cell != occupancy.cell(x, z):
                        passed.add(cell)
                    t += s.resolution / max(math.hypot(ray[0], ray[2]), s.resolution)
    return hit, passed


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), heading=st.floats(-3, 3), pitch=st.floats(-1.0, 0.5))
def test_the_kernel_marks_the_cells_that_the_plain_twin_marks(seed, heading, pitch):
    camera = PinholeCamera.from_hfov(24, 18, 90.0)
    depth = np.random.default_rng(seed).uniform(-0.5, 9.0, (18, 24)).astype(np.float32)
    occupancy, T = OccupancyMap(), pose(0.3, -0.2, heading, pitch)
    occupancy.integrate(depth, T, camera, 0.0)
    hit, passed = plain_marks(depth, camera, T, occupancy)
    assert set(map(tuple, np.argwhere(occupancy.hits).tolist())) == hit
    assert set(map(tuple, np.argwhere(occupancy.passes).tolist())) == passed - hit
