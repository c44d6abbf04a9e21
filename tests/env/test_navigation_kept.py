"""Surfaces that are kept between processes, small gaps in floors, and compiled code against plain twins of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from openmap_env.actions import Action
from openmap_env.navigation import Body, NavigableSurface, ShortestPathFollower
from openmap_env.navigation import surface as surface_module

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]


def ground(n: int = 60, size: float = 6.0, noise: float = 0.0, seed: int = 0) -> Mesh:
    """A floor of 2 n^2 triangles, ``size`` m a side."""
    t = np.linspace(0.0, size, n + 1)
    x, z = (a.ravel() for a in np.meshgrid(t, t))
    y = np.random.default_rng(seed).normal(0.0, noise, len(x)) if noise else np.zeros(len(x))
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    return np.stack([x, y, z], 1), np.concatenate(
        [np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)]
    )


def without(mesh: Mesh, centres: npt.NDArray[np.float64], width: float) -> Mesh:
    """The mesh without what lies in squares of a width around points (k, 2)."""
    v, f = mesh
    middle = v[f].mean(1)[:, [0, 2]]
    off = np.abs(middle[:, None] - centres).max(2).min(1)
    return v, f[off >= width / 2]


def test_a_kept_surface_is_the_one_that_was_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path))
    mesh = without(ground(), np.array([[2.0, 2.0], [4.0, 3.0]]), 0.8)
    made = NavigableSurface.from_scene(mesh)
    with monkeypatch.context() as patch:
        patch.setattr(surface_module, "_make", lambda *_: pytest.fail("it is made again"))
        opened = NavigableSurface.from_scene(mesh)
        for other in ((mesh, Body(radius=0.1)), (mesh, Body(), 0.04), ((mesh[0] * 1.01, mesh[1]), Body())):
            with pytest.raises(pytest.fail.Exception):
                NavigableSurface.from_scene(*other)
        with pytest.raises(pytest.fail.Exception):
            NavigableSurface.from_scene(mesh, keep=False)
    fresh = NavigableSurface.from_scene(mesh, keep=False)
    rng = np.random.default_rng(0)
    goal, places = made.random_point(rng), [made.random_point(rng) for _ in range(20)]
    for surface in (opened, fresh):
        assert surface.grid == made.grid
        assert surface.centres.tobytes() == made.centres.tobytes()
        assert surface.cells.neighbour.tobytes() == made.cells.neighbour.tobytes()
        assert surface.island.tobytes() == made.island.tobytes()
        assert surface.island_areas.tolist() == made.island_areas.tolist()
        field = surface.distance_field(goal)
        assert [field.distance(p) for p in places] == [made.distance_field(goal).distance(p) for p in places]


@pytest.mark.parametrize(("width", "noise"), [(0.1, 0.0), (0.1, 0.01), (0.1, 0.02)])
def test_a_scanned_floor_with_small_holes_is_one_floor(width: float, noise: float) -> None:
    whole = ground(120, noise=noise)
    at = np.random.default_rng(1).uniform(0.0, 6.0, (150, 2))
    surface = NavigableSurface.from_scene(without(whole, at, width), keep=False)
    # All but a margin of the body's radius and half a cell.
    assert surface.island_areas[0] >= 0.95 * (6.0 - 0.5) ** 2


def test_a_wide_gap_stays_one() -> None:
    v, f = ground()
    middle = v[f].mean(1)[:, 0]
    apart = NavigableSurface.from_scene((v, f[np.abs(middle - 3.0) >= 0.2]), keep=False)
    assert apart.geodesic_distance([1, 0, 3], [5, 0, 3]) == math.inf
    joined = NavigableSurface.from_scene((v, f[np.abs(middle - 3.0) >= 0.05]), keep=False)
    assert joined.geodesic_distance([1, 0, 3], [5, 0, 3]) == pytest.approx(4.0, rel=0.01)


def test_a_wall_in_a_gap_still_bars_it() -> None:
    v, f = ground()
    f = f[np.abs(v[f].mean(1)[:, 0] - 3.0) >= 0.05]
    wall = np.array([[3, -0.5, 0], [3, -0.5, 6], [3, 2, 6], [3, 2, 0]], np.float64)
    barred = NavigableSurface.from_scene(
        (np.concatenate([v, wall]), np.concatenate([f, np.array([[0, 1, 2], [0, 2, 3]]) + len(v)])), keep=False
    )
    assert barred.geodesic_distance([1, 0, 3], [5, 0, 3]) == math.inf


def test_many_distances_at_once_are_those_one_by_one(toy_surface: NavigableSurface) -> None:
    rng = np.random.default_rng(2)
    field = toy_surface.distance_field(toy_surface.random_point(rng))
    places = np.array([toy_surface.random_point(rng) for _ in range(50)] + [[50.0, 0.0, 0.0]])
    places[:10] += rng.normal(0, 0.1, (10, 3))
    assert field.distances(places).tolist() == [field.distance(p) for p in places]
    assert field.distances(places)[-1] == math.inf
    with pytest.raises(ValueError, match=r"finite numbers of shape \(n, 3\)"):
        field.distances([0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="three finite numbers"):
        field.distance([math.nan, 0.0, 0.0])


def test_snapping_is_that_of_trying_all_cells(toy_surface: NavigableSurface) -> None:
    rng = np.random.default_rng(3)
    half = 0.499 * toy_surface.grid.cell
    for _ in range(200):
        p = rng.uniform((-7, -0.5, -3), (7, 1.5, 3))
        island, limit = (None, 0)[rng.integers(2)], float(rng.choice([0.2, 0.5, 2.0]))
        got = toy_surface.snap(p, limit, island)
        here = toy_surface.locate(p)
        if (
            here >= 0
            and island in (None, toy_surface.island[here])
            and abs(toy_surface.centres[here, 1] - p[1]) <= limit
        ):
            expected = float(abs(toy_surface.centres[here, 1] - p[1]))
        else:
            centres = toy_surface.centres if island is None else toy_surface.centres[toy_surface.island == island]
            nearest = centres.copy()
            nearest[:, [0, 2]] += np.clip(p[[0, 2]] - centres[:, [0, 2]], -half, half)
            expected = float(np.linalg.norm(nearest - p, axis=1).min())
        if expected > limit:
            assert got is None
        else:
            assert got is not None
            assert np.linalg.norm(got - p) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("radius", "forward", "turn_deg", "least"),
    # Ways of legs 45 degrees apart are 5.5 % longer than straight ones on average, and long steps end beside the goal.
    [(0.2, 0.25, 15.0, 0.95), (0.1, 0.1, 10.0, 0.95), (0.3, 0.25, 10.0, 0.95), (0.2, 0.5, 45.0, 0.88)],
)
def test_the_follower_arrives_with_any_body_step_and_turn(
    toy_scene, radius: float, forward: float, turn_deg: float, least: float
) -> None:
    surface = NavigableSurface.from_scene(toy_scene, Body(radius=radius))
    rng, turn, ratios = np.random.default_rng(7), math.radians(turn_deg), []
    for _ in range(10):
        follower = ShortestPathFollower(
            surface, surface.random_point(rng), goal_radius=0.3, forward_step=forward, turn_deg=turn_deg
        )
        for _ in range(10):
            position, heading, walked = surface.random_point(rng), rng.uniform(-math.pi, math.pi), 0.0
            shortest = follower.field.distance(position)
            for _ in range(int(100 + 8 * shortest / forward)):
                action = follower.next_action(position, heading)
                if action == Action.STOP:
                    break
                if action == Action.MOVE_FORWARD:
                    before = position
                    step = [-forward * math.sin(heading), 0.0, -forward * math.cos(heading)]
                    position = surface.try_step(before, step)
                    walked += float(np.linalg.norm(position - before))
                else:
                    # As an environment does: the angle comes back wrapped, and differs in its last bits after a turn and back.
                    heading += turn if action == Action.TURN_LEFT else -turn
                    heading = (heading + math.pi) % (2.0 * math.pi) - math.pi
            left = follower.field.distance(position)
            assert left <= 0.3
            ratios.append(shortest / max(shortest, walked + left, 1e-9))
    assert np.mean(ratios) >= least
