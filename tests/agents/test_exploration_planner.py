"""Ways are the cheapest there are, and views count what can be seen."""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import lil_matrix
from scipy.sparse.csgraph import dijkstra

from openmap_agents.exploration import FREE, UNKNOWN
from openmap_agents.exploration.planner import beyond_frontier, dearest_on_line, distances, path_to
from openmap_agents.exploration.views import SECTORS, best_headings, gains_by_bearing, in_view

RESOLUTION = 0.05


def random_cost(seed, height, width):
    rng = np.random.default_rng(seed)
    cost = rng.uniform(1.0, 5.0, (height, width)).astype(np.float32)
    cost[rng.random((height, width)) < 0.3] = np.inf
    cost[0, 0] = 1.0
    return cost


def plain_distances(cost):
    """Dijkstra of scipy on the graph of the steps that are allowed."""
    height, width = cost.shape
    graph = lil_matrix((cost.size, cost.size))
    for r in range(height):
        for c in range(width):
            for dr in (-1, 0, 1):
                for dc in (-1, 0, 1):
                    rr, cc = r + dr, c + dc
                    if (dr, dc) == (0, 0) or not (0 <= rr < height and 0 <= cc < width):
                        continue
                    if np.isfinite([cost[r, c], cost[rr, cc], cost[rr, c], cost[r, cc]]).all():
                        length = RESOLUTION * math.hypot(dr, dc)
                        graph[r * width + c, rr * width + cc] = length * (float(cost[r, c]) + float(cost[rr, cc])) / 2
    return dijkstra(graph.tocsr(), indices=0).reshape(cost.shape)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), height=st.integers(1, 14), width=st.integers(1, 14))
def test_distances_are_those_of_a_plain_dijkstra(seed, height, width):
    cost = random_cost(seed, height, width)
    distance, parent = distances(cost, (0, 0), RESOLUTION)
    np.testing.assert_allclose(distance, plain_distances(cost), rtol=1e-4)
    for cell in map(tuple, np.argwhere(np.isfinite(distance)).tolist()):
        path = path_to(parent, cell)
        assert path[0] == (0, 0)
        assert path[-1] == cell
        steps = itertools.pairwise(path)
        length = sum(RESOLUTION * math.dist(a, b) * (float(cost[a]) + float(cost[b])) / 2 for a, b in steps)
        assert math.isclose(length, distance[cell], rel_tol=1e-4, abs_tol=1e-6)


def test_a_line_costs_what_its_dearest_cell_costs_and_a_closed_one_closes_it():
    cost = np.ones((9, 9), np.float32)
    cost[4, 4] = 3.0
    assert dearest_on_line(cost, (4, 0), (4, 8)) == 3.0
    assert dearest_on_line(cost, (0, 0), (0, 8)) == 1.0
    assert dearest_on_line(cost, (2, 2), (2, 2)) == 1.0
    cost[4, 4] = np.inf
    assert dearest_on_line(cost, (0, 0), (8, 8)) == np.inf


def plain_gain(place, target, opaque, reach):
    dr, dc = target[0] - place[0], target[1] - place[1]
    if math.hypot(dr, dc) * RESOLUTION > reach:
        return None
    steps = max(abs(dr), abs(dc))
    for i in range(1, steps - 2):
        if opaque[math.floor(place[0] + i / steps * dr + 0.5), math.floor(place[1] + i / steps * dc + 0.5)]:
            return None
    return math.floor(math.atan2(-dc, -dr) / (2 * math.pi / SECTORS) + 0.5) % SECTORS


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_gains_count_the_targets_that_a_plain_look_finds(seed):
    rng = np.random.default_rng(seed)
    opaque = rng.random((30, 30)) < 0.05
    places, targets = rng.integers(0, 30, (6, 2)), rng.integers(0, 30, (20, 2))
    weights = rng.integers(1, 4, 20).astype(np.float32)
    reach = rng.uniform(0.3, 1.5, 20).astype(np.float32)
    expected = np.zeros((6, SECTORS), np.float32)
    for i, place in enumerate(places.tolist()):
        for j, target in enumerate(targets.tolist()):
            sector = plain_gain(place, target, opaque, float(reach[j]))
            if sector is not None:
                expected[i, sector] += weights[j]
    np.testing.assert_array_equal(gains_by_bearing(places, targets, weights, reach, opaque, RESOLUTION), expected)


def test_the_best_heading_points_at_the_targets_and_in_view_agrees():
    opaque = np.zeros((60, 60), bool)
    left = np.array([[30, 10], [31, 10], [29, 10]])  # towards -x: a heading of +90 degrees
    reach = np.full(3, 3.0, np.float32)
    gain, heading = best_headings(
        gains_by_bearing(np.array([[30, 30]]), left, np.ones(3, np.float32), reach, opaque, RESOLUTION)
    )
    assert gain[0] == 3.0
    assert abs(heading[0] - math.pi / 2) <= math.radians(10.0)
    look = (left, reach, 0.0, math.radians(40.0), opaque, RESOLUTION)
    assert in_view((30, 30), math.pi / 2, *look).all()
    assert not in_view((30, 30), -math.pi / 2, *look).any()
    opaque[:, 20] = True
    assert not in_view((30, 30), math.pi / 2, *look).any()


def test_a_frontier_seen_along_its_edge_counts_for_nobody():
    door = np.array([[30, 20]])
    beyond = np.array([[-1.0, 0.0]], np.float32)  # the unknown lies towards smaller rows
    reach, opaque = np.full(1, 3.0, np.float32), np.zeros((60, 60), bool)
    places = np.array([[30, 40], [40, 20], [20, 20]])  # beside it, in front of it, behind it
    gains = gains_by_bearing(places, door, np.ones(1, np.float32), reach, opaque, RESOLUTION, beyond).sum(axis=1)
    np.testing.assert_array_equal(gains, [0.0, 1.0, 0.0])
    heading = math.atan2(20.0, 0.0)  # at the door, from the side
    assert not in_view((30, 40), heading, door, reach, 0.0, 0.7, opaque, RESOLUTION, beyond).any()


def test_beyond_a_frontier_lies_the_unknown():
    grid = np.full((20, 20), FREE, np.uint8)
    grid[:, 12:] = UNKNOWN
    np.testing.assert_allclose(beyond_frontier(grid, np.array([[10, 11]])), [[0.0, 1.0]], atol=1e-6)
