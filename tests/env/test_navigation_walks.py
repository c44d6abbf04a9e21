"""Long random walks on meshes of every kind: they stay on the surface, go through nothing, and never stick."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numba as nb
import numpy as np
import numpy.typing as npt
import open3d as o3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_env.navigation import Body, NavigableSurface
from openmap_env.navigation.motion import locate, step
from openmap_scenes import load_scene

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
SIDES = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
LONGEST = 0.6


def box(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> Mesh:
    low, high = np.array([x0, y0, z0]), np.array([x1, y1, z1])
    return low + CORNERS * (high - low), np.concatenate([SIDES[:, [0, 1, 2]], SIDES[:, [0, 2, 3]]])


def quad(*corners: tuple[float, float, float]) -> Mesh:
    return np.array(corners, np.float64), np.array([[0, 1, 2], [0, 2, 3]])


def sheet(x0: float, x1: float, z0: float, z1: float, y0: float = 0.0, y1: float | None = None, n: int = 1) -> Mesh:
    """A floor of 2 n^2 triangles; with ``y1`` a ramp along x."""
    t = np.linspace(0.0, 1.0, n + 1)
    u, w = (a.ravel() for a in np.meshgrid(t, t))
    v = np.stack([x0 + u * (x1 - x0), y0 + u * ((y0 if y1 is None else y1) - y0), z0 + w * (z1 - z0)], 1)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    return v, np.concatenate([np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)])


def wall(x0: float, z0: float, x1: float, z1: float, y: float = 0.0, height: float = 2.5) -> Mesh:
    """A wall without thickness."""
    return quad((x0, y, z0), (x1, y, z1), (x1, y + height, z1), (x0, y + height, z0))


def together(*parts: Mesh) -> Mesh:
    first = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    return np.concatenate([v for v, _ in parts]), np.concatenate(
        [f + n for (_, f), n in zip(parts, first, strict=True)]
    )


def hall(width: float = 6.0, depth: float = 5.0) -> list[Mesh]:
    around = [(0, 0, width, 0), (width, 0, width, depth), (width, depth, 0, depth), (0, depth, 0, 0)]
    return [sheet(0, width, 0, depth), *(wall(*w) for w in around)]


def thin_walls(rng: np.random.Generator) -> Mesh:
    """Walls without thickness at all angles, in ones, in crosses and in corners."""
    return together(*hall(), *(wall(*rng.uniform((0, 0, 0, 0), (6, 5, 6, 5))) for _ in range(6)))


def narrow_doors(rng: np.random.Generator) -> Mesh:
    """Three rooms in a row with doors barely wider than the body, one of the walls slanted."""
    doors = rng.uniform(1.0, 3.0, 2)
    parts = hall()
    for x, lean, door in ((2.0, 0.0, doors[0]), (4.0, rng.uniform(-0.6, 0.6), doors[1])):
        at = [x + lean * z / 5.0 for z in (0.0, door, door + 0.6, 5.0)]
        parts += [wall(at[0], 0.0, at[1], door), wall(at[2], door + 0.6, at[3], 5.0)]
    return together(*parts)


def stairs(rng: np.random.Generator) -> Mesh:
    """A flight of stairs without a rail up to a mezzanine, over a floor that goes on below; a storey above has no stairs."""
    rise, run = rng.uniform(0.12, 0.19), rng.uniform(0.22, 0.3)
    steps = int(2.4 / rise)
    top, end = steps * rise, 1.2 + steps * run
    treads = [box(1.2 + k * run, 1.2 + (k + 1) * run, 0.0, (k + 1) * rise, 1.0, 2.2) for k in range(steps)]
    upper = box(end - 0.01, end + 3.0, top - 0.2, top, 0.0, 5.0)
    return together(*hall(end + 3.0), *treads, upper, sheet(0, end + 3.0, 0, 5, top + 2.6))


def slopes(rng: np.random.Generator) -> Mesh:
    """A ramp that can be climbed, one that cannot, and kerbs below and above a step."""
    up, steep = rng.uniform(0.2, 0.8), rng.uniform(1.3, 3.0)
    parts = [sheet(1, 3, 0, 1.5, 0.0, 2 * up), sheet(3, 5, 0, 1.5, 2 * up), sheet(1, 2, 2, 3, 0.0, steep)]
    kerbs = [box(3, 4, 0, 0.15, 2, 3), box(4.2, 5.2, 0, 0.3, 3.2, 4.2), box(1, 2, 0, 0.19, 3.6, 4.6)]
    return together(*hall(), *parts, *kerbs)


def broken(rng: np.random.Generator) -> Mesh:
    """A floor of small triangles with holes of all sizes, noise, T-junctions, faces twice, faces inside out, clutter."""
    v, f = sheet(0, 6, 0, 5, n=60)
    v[:, 1] += rng.normal(0, 0.008, len(v))
    middle = v[f].mean(1)
    for x, z, radius in rng.uniform((0, 0, 0.03), (6, 5, 0.4), (14, 3)):
        f = f[np.hypot(*(middle[:, [0, 2]] - (x, z)).T) > radius]
        middle = v[f].mean(1)
    clutter = [
        box(x, x + w, y, y + h, z, z + w)
        for x, z, w, y, h in rng.uniform((0, 0, 0.05, 0, 0.02), (6, 5, 0.8, 1, 1), (8, 5))
    ]
    v, f = together((v, f), sheet(2, 4.03, 1, 3.02, 0.001), *hall()[1:], *clutter)
    turned = rng.random(len(f)) < 0.5
    f[turned] = f[turned][:, ::-1]
    return v, np.concatenate([f, f[rng.random(len(f)) < 0.3]])


MESHES: list[Callable[[np.random.Generator], Mesh]] = [thin_walls, narrow_doors, stairs, slopes, broken]


@nb.njit(cache=True)
def walk(ground, reach, x, y, z, headings, lengths):  # type: ignore[no-untyped-def]
    """Positions (n + 1, 3) and cells (n + 1,) of a walk, one step after the other."""
    n = len(headings)
    positions, cells = np.empty((n + 1, 3)), np.empty(n + 1, np.int64)
    positions[0], cells[0] = np.array((x, y, z)), locate(ground, x, y, z, reach)
    for i in range(n):
        x, y, z, cell = step(
            ground, reach, x, y, z, -lengths[i] * np.sin(headings[i]), -lengths[i] * np.cos(headings[i])
        )
        positions[i + 1], cells[i + 1] = np.array((x, y, z)), cell
    return positions, cells


@nb.njit(cache=True)
def longer_ways(neighbour, ix, iz, size, positions, cells):  # type: ignore[no-untyped-def]
    """How much longer, m, than straight on the shortest way over the cells is from each position to the next; inf for none near.

    Plain relaxation over the cells around, with the lengths of side and diagonal steps.
    """
    longer = np.zeros(len(cells) - 1)
    near, way = np.empty(4000, np.int64), np.empty(4000)
    for k in range(len(cells) - 1):
        a, b = cells[k], cells[k + 1]
        straight = np.hypot(positions[k + 1, 0] - positions[k, 0], positions[k + 1, 2] - positions[k, 2])
        if a == b:
            continue
        reach = straight / size + 4.0
        near[0], way[0], count, head = a, 0.0, 1, 0
        changed = True
        while changed:
            changed = False
            head = 0
            while head < count:
                i = near[head]
                for d in range(8):
                    j = neighbour[i, d]
                    if j < 0 or np.hypot(ix[j] - ix[a], iz[j] - iz[a]) > reach:
                        continue
                    through = way[head] + (size if d < 4 else np.sqrt(2.0) * size)
                    at = -1
                    for m in range(count):
                        if near[m] == j:
                            at = m
                            break
                    if at < 0 and count < len(near):
                        near[count], way[count] = j, through
                        count += 1
                        changed = True
                    elif at >= 0 and through < way[at] - 1e-9:
                        way[at] = through
                        changed = True
                head += 1
        longer[k] = np.inf
        for m in range(count):
            if near[m] == b:
                longer[k] = way[m] - straight
    return longer


def random_walk(surface: NavigableSurface, rng: np.random.Generator, steps: int) -> tuple[npt.NDArray[np.float64], ...]:
    """Positions (n + 1, 3), cells (n + 1,), headings (n,) and lengths (n,) of a walk that mostly goes straight on."""
    turns = rng.choice([0.0, 0.0, 0.0, 1.0], steps) * rng.uniform(-math.pi, math.pi, steps)
    headings, lengths = np.cumsum(turns), rng.uniform(0.01, LONGEST, steps)
    start = surface.random_point(rng)
    return (*walk(surface.ground, surface.reach, *start, headings, lengths), headings, lengths)


def check_walk(surface: NavigableSurface, mesh: Mesh, rng: np.random.Generator, steps: int, looked_at: int) -> None:
    positions, cells, _, lengths = random_walk(surface, rng, steps)
    c, size = surface.cells, surface.grid.cell
    assert (cells >= 0).all()
    assert (surface.island[cells] == 0).all()
    assert np.array_equal(positions[:, 1], c.floor[cells])
    inside = np.abs(positions[:, [0, 2]] - surface.centres[cells][:, [0, 2]])
    assert inside.max() <= 0.5 * size + 1e-9
    moved = np.hypot(*(positions[1:] - positions[:-1])[:, [0, 2]].T)
    assert (moved <= lengths + 1e-9).all()
    # Never tunnels: the way over the cells is no longer than straight on but for the grid's directions and a corner's rounding.
    some = slice(0, looked_at)
    longer = longer_ways(c.neighbour, c.ix, c.iz, size, positions[: looked_at + 1], cells[: looked_at + 1])
    assert (longer <= 0.09 * moved[some] + 4.0 * size).all(), longer.max()
    assert_nothing_between(mesh, positions, moved, surface.body)
    assert_never_stuck(surface, positions[rng.integers(0, steps, 200)])


def assert_nothing_between(
    mesh: Mesh, positions: npt.NDArray[np.float64], moved: npt.NDArray[np.float64], body: Body
) -> None:
    """No step leads through a face, seen by a ray caster that knows nothing of cells."""
    rays = o3d.t.geometry.RaycastingScene()
    rays.add_triangles(
        o3d.core.Tensor(np.ascontiguousarray(mesh[0], np.float32)),
        o3d.core.Tensor(np.ascontiguousarray(mesh[1], np.uint32)),
    )
    ways = positions[1:] - positions[:-1]
    walks = moved > 1e-6
    for height in (2.0 * body.step_height, 0.9 * body.height):
        cast = np.hstack([positions[:-1] + np.array([0.0, height, 0.0]), ways]).astype(np.float32)[walks]
        hit = rays.cast_rays(o3d.core.Tensor(cast))["t_hit"].numpy() <= 1.0
        assert not hit.any(), (positions[:-1][walks][hit][:3], ways[walks][hit][:3], height)


def assert_never_stuck(surface: NavigableSurface, places: npt.NDArray[np.float64]) -> None:
    """From anywhere some heading leads on."""
    for place in places:
        best = max(
            np.linalg.norm(surface.try_step(place, [0.25 * math.sin(a), 0.0, 0.25 * math.cos(a)]) - place)
            for a in np.arange(24) * math.pi / 12
        )
        assert best >= 0.2, place


@pytest.mark.parametrize("make", MESHES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("radius", [0.1, 0.2])
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_walks_on_made_meshes(make: Callable[[np.random.Generator], Mesh], radius: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = make(rng)
    surface = NavigableSurface.from_scene(mesh, Body(radius=radius))
    if surface.island_areas[0] > 1.0:
        check_walk(surface, mesh, rng, 5_000, 300)


def test_a_walk_of_a_hundred_thousand_steps_in_a_home_of_three_rooms(toy_scene, toy_surface) -> None:
    check_walk(toy_surface, (toy_scene.vertices, toy_scene.faces), np.random.default_rng(3), 100_000, 5_000)


def test_a_walk_of_a_hundred_thousand_steps_in_a_real_format_house(shared_scenes: Path) -> None:
    house = load_scene(f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}")
    surface = NavigableSurface.from_scene(house, Body(radius=0.1))
    check_walk(surface, (house.vertices, house.faces), np.random.default_rng(4), 100_000, 5_000)
