"""The navigable surface on meshes that are drawn here: what can be stood on, how far things are, what walking does."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt
from scipy.optimize import linprog
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from openmap_env.actions import Action
from openmap_env.navigation import Body, NavigableSurface, ShortestPathFollower
from openmap_env.navigation.heightfield import Grid, solid_spans

Mesh = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]
Segment = tuple[float, float, float, float]
SLIM = Body(radius=0.02)


def quads(*corners: list[list[float]]) -> Mesh:
    """A mesh of separate quadrilaterals, four corners (x, y, z) each."""
    v = np.array(corners, np.float64).reshape(-1, 3)
    first = 4 * np.arange(len(corners))[:, None]
    return v, np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])


def floor(x0: float, x1: float, z0: float, z1: float, y: float = 0.0, y1: float | None = None) -> list[list[float]]:
    """A floor; with ``y1`` a ramp that rises along x."""
    top = y if y1 is None else y1
    return [[x0, y, z0], [x1, top, z0], [x1, top, z1], [x0, y, z1]]


def wall(x0: float, z0: float, x1: float, z1: float, y: float = 0.0, height: float = 2.5) -> list[list[float]]:
    return [[x0, y, z0], [x1, y, z1], [x1, y + height, z1], [x0, y + height, z0]]


def room(width: float, depth: float, *segments: Segment) -> Mesh:
    """A floor with four walls and more walls as given, none of them with a thickness."""
    outer = [(0, 0, width, 0), (width, 0, width, depth), (width, depth, 0, depth), (0, depth, 0, 0)]
    return quads(floor(0, width, 0, depth), *(wall(*s) for s in [*outer, *segments]))


def raster_surface(free: npt.NDArray[np.bool_], body: Body = SLIM) -> NavigableSurface:
    """A surface whose columns (iz, ix) can be stood on where ``free`` says so; cell centres are at multiples of 5 cm.

    On the others stand pillars: a hole that small would be walked over.
    """
    tiles = [floor(x - 0.024, x + 0.024, z - 0.024, z + 0.024) for z, x in 0.05 * np.argwhere(free)]
    pillars = [wall(x, z - 0.024, x, z + 0.024) for z, x in 0.05 * np.argwhere(~free)]
    return NavigableSurface.from_scene(quads(*tiles, *pillars), body)


@pytest.fixture(scope="module")
def two_rooms() -> NavigableSurface:
    """6 x 4 m, parted at x = 3 by a wall without thickness that has a doorway of 0.8 m at z = 1..1.8."""
    return NavigableSurface.from_scene(room(6, 4, (3, 0, 3, 1), (3, 1.8, 3, 4)))


def crosses(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64], s: Segment) -> bool:
    """Whether the way from a to b, seen from above, crosses a wall; its last 2 cm aside, around which a slim body slides."""
    length = math.hypot(s[2] - s[0], s[3] - s[1])
    cut_x, cut_z = (0.02 * (s[2] - s[0]) / length, 0.02 * (s[3] - s[1]) / length) if length > 0.04 else (0.0, 0.0)
    s = (s[0] + cut_x, s[1] + cut_z, s[2] - cut_x, s[3] - cut_z)

    def side(px: float, pz: float, qx: float, qz: float, rx: float, rz: float) -> float:
        return (qx - px) * (rz - pz) - (qz - pz) * (rx - px)

    return (
        side(*s, a[0], a[2]) * side(*s, b[0], b[2]) < 0
        and side(a[0], a[2], b[0], b[2], s[0], s[1]) * side(a[0], a[2], b[0], b[2], s[2], s[3]) < 0
    )


def gap(p: npt.NDArray[np.float64], s: Segment) -> float:
    """Horizontal distance from a point to a wall."""
    a, b, q = np.array(s[:2]), np.array(s[2:]), p[[0, 2]]
    t = np.clip((q - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
    return float(np.linalg.norm(q - a - t * (b - a)))


# --- the height field against linear programming


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_spans_hold_exactly_what_the_triangles_cover(seed: int) -> None:
    rng = np.random.default_rng(seed)
    v, f = rng.uniform(0, 0.22, (6, 3)), np.array([[0, 1, 2], [3, 4, 5]])
    grid = Grid.over(v, 0.1)
    spans = solid_spans(v, f, grid, 0.01)
    for iz, ix in itertools.product(range(grid.nz), range(grid.nx)):
        x, z = grid.origin_x + ix * grid.cell, grid.origin_z + iz * grid.cell
        pieces = []
        for t in v[f]:
            # Barycentric weights w >= 0, sum 1, with the point inside the column: extremes of its height.
            sides = np.array([t[:, 0], -t[:, 0], t[:, 2], -t[:, 2]])
            limits = [x + grid.cell, -x, z + grid.cell, -z]
            ends = [linprog(s * t[:, 1], sides, limits, np.ones((1, 3)), [1.0]) for s in (1, -1)]
            if ends[0].status == 0:
                pieces.append((ends[0].fun, -ends[1].fun))
        expected: list[list[float]] = []
        for low, high in sorted(pieces):
            if expected and low <= expected[-1][1]:
                expected[-1][1] = max(expected[-1][1], high)
            else:
                expected.append([low, high])
        here = slice(*spans.start[iz * grid.nx + ix :][:2])
        assert np.stack([spans.low[here], spans.high[here]], 1) == pytest.approx(
            np.reshape(expected, (-1, 2)), abs=1e-6
        )


def test_which_way_faces_look_changes_nothing() -> None:
    v, f = room(3, 3, (1, 0, 1, 2))
    a, b = NavigableSurface.from_scene((v, f)), NavigableSurface.from_scene((v, f[:, ::-1]))
    assert np.array_equal(a.centres, b.centres)
    assert np.array_equal(a.cells.neighbour, b.cells.neighbour)


@pytest.mark.parametrize(
    ("rise", "stands"), [(0.0, True), (0.95, True), (1.1, False)], ids=["flat", "under 45 degrees", "over 45 degrees"]
)
def test_slopes_are_walkable_up_to_45_degrees(rise: float, stands: bool) -> None:
    mesh = quads(floor(0, 1, 0, 2, 0), floor(1, 3, 0, 2, 0, 2 * rise))
    surface = NavigableSurface.from_scene(mesh)
    assert surface.is_navigable([2, rise, 1]) == stands
    if stands:
        expected = 0.4 + 1.5 * math.hypot(1, rise)
        assert surface.geodesic_distance([0.6, 0, 1], [2.5, 1.5 * rise, 1]) == pytest.approx(expected, rel=0.03)


def test_a_table_takes_the_floor_below_it_and_is_an_island_above() -> None:
    v, f = room(4, 4)
    tv, tf = quads(floor(1, 3, 1, 3, 0.75))
    surface = NavigableSurface.from_scene((np.concatenate([v, tv]), np.concatenate([f, tf + len(v)])))
    assert not surface.is_navigable([2, 0, 2])
    assert surface.island_of([2, 0.75, 2]) == 1
    assert surface.island_of([0.5, 0, 0.5]) == 0
    assert surface.geodesic_distance([0.5, 0, 0.5], [2, 0.75, 2]) == math.inf


def test_the_main_island_is_the_floor_though_the_roof_is_larger() -> None:
    boxes = [floor(1, 3, 1, 3, 1.0)]
    v, f = room(4, 4)
    rv, rf = quads(floor(-1, 5, -1, 5, 2.5), *boxes)
    surface = NavigableSurface.from_scene((np.concatenate([v, rv]), np.concatenate([f, rf + len(v)])))
    assert surface.island_areas[0] < surface.island_areas.max()
    assert surface.island_of([0.5, 0, 0.5]) == 0
    rng = np.random.default_rng(0)
    assert all(surface.random_point(rng)[1] == 0 for _ in range(50))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.02, 0.1, 0.2]))
def test_erosion_keeps_the_radius_from_every_obstacle_and_ledge(seed: int, radius: float) -> None:
    free = np.random.default_rng(seed).random((24, 30)) < 0.97
    distance = distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    expected = distance >= radius / 0.05 + 0.5 - 1e-9
    if not expected.any():
        return
    surface = raster_surface(free, Body(radius=radius))
    got = np.zeros_like(free)
    columns = np.rint(surface.centres / 0.05).astype(int)
    got[columns[:, 2], columns[:, 0]] = True
    assert np.array_equal(got, expected)


def test_a_wall_without_thickness_blocks_and_a_doorway_lets_through(two_rooms: NavigableSurface) -> None:
    closed = NavigableSurface.from_scene(room(6, 4, (3, 0, 3, 4)))
    assert closed.geodesic_distance([2, 0, 2], [4, 0, 2]) == math.inf
    slanted = NavigableSurface.from_scene(room(6, 4, (2, 0, 4.1, 4)), SLIM)
    assert slanted.geodesic_distance([1, 0, 2], [5, 0, 2]) == math.inf
    assert two_rooms.geodesic_distance([2, 0, 1.4], [4, 0, 1.4]) == pytest.approx(2.0)
    narrow = NavigableSurface.from_scene(room(6, 4, (3, 0, 3, 1), (3, 1.35, 3, 4)))
    assert narrow.geodesic_distance([2, 0, 1.2], [4, 0, 1.2]) == math.inf


def test_stairs_join_two_storeys_and_their_sides_are_ledges() -> None:
    steps, rise, run = 15, 0.18, 0.27
    top, end = steps * rise, 2 + steps * run
    parts = [floor(0, 9, 0, 4), floor(end - 0.01, 9, 0, 4, top)]
    for k in range(steps):
        x = 2 + k * run
        parts += [floor(x, x + run, 1, 2.2, (k + 1) * rise), wall(x, 1, x, 2.2, k * rise, rise)]
    surface = NavigableSurface.from_scene(quads(*parts))
    distance = surface.geodesic_distance([1, 0, 1.6], [8, top, 1.6])
    assert distance == pytest.approx(1 + math.hypot(end - 2, top) + 8 - end, rel=0.02)
    path = surface.shortest_path([1, 0, 1.6], [8, top, 1.6])
    assert path is not None
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(distance)
    middle = surface.snap([2 + 7.5 * run, 8 * rise, 1.6], 0.1)
    assert middle is not None
    position = middle
    for _ in range(20):
        position = surface.try_step(position, [0, 0, 0.25])
    assert position[1] == middle[1], "nobody falls off the side of a stair"
    without = NavigableSurface.from_scene(quads(parts[0], parts[1]))
    assert without.geodesic_distance([1, 0, 1.6], [8, top, 1.6]) == math.inf


# --- distances


def plain_distances(free: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Distances in cells between all free cells: along all lines of sight (exact integer geometry), and along eight directions."""
    cells = np.argwhere(free)
    walls = np.argwhere(~np.pad(free, 1)) - 1
    corners = 2 * walls[:, None, :] + np.array([[0, 0], [0, 2], [2, 0], [2, 2]])
    n = len(cells)
    any_angle, octile = np.zeros((n, n)), np.zeros((n, n))
    for i, j in itertools.combinations(range(n), 2):
        a, b = 2 * cells[i] + 1, 2 * cells[j] + 1
        d = b - a
        side = d[0] * (corners[..., 1] - a[1]) - d[1] * (corners[..., 0] - a[0])
        meets = (side.min(1) <= 0) & (side.max(1) >= 0)
        meets &= (corners.max(1) >= np.minimum(a, b)).all(1) & (corners.min(1) <= np.maximum(a, b)).all(1)
        if not meets.any():
            any_angle[i, j] = np.hypot(*d) / 2
            octile[i, j] = any_angle[i, j] if np.abs(d).max() <= 2 else 0.0
    return dijkstra(coo_array(any_angle), directed=False), dijkstra(coo_array(octile), directed=False)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_distances_are_those_of_the_plain_visibility_graph(seed: int, narrow: bool) -> None:
    rng = np.random.default_rng(seed)
    free = rng.random((9, 9)) < 0.8 if narrow else np.kron(rng.random((5, 5)) < 0.8, np.ones((2, 2))) > 0
    free[0, 0] = True
    surface = raster_surface(free)
    exact, octile = plain_distances(free)
    columns = np.rint(surface.centres / 0.05).astype(int)
    order = np.lexsort((columns[:, 0], columns[:, 2]))
    got = np.array([surface.distance_field(g)._distance[order] for g in surface.centres[order]]) / 0.05
    assert np.array_equal(np.isinf(got), np.isinf(exact))
    reached = np.isfinite(exact)
    assert (got[reached] >= exact[reached] - 1e-9).all()
    assert (got[reached] <= octile[reached] + 1e-9).all()
    if not narrow:
        assert (got[reached] <= 1.06 * exact[reached] + 1e-9).all()
        assert got[reached].mean() <= 1.01 * exact[reached].mean()


def test_distance_is_that_of_the_taut_string_around_the_door_post(two_rooms: NavigableSurface) -> None:
    a, b = np.array([1.0, 0, 3.5]), np.array([5.0, 0, 3.5])
    # Two tangents to a disc of 0.2 m around the post's end (3, 1.8), and the arc between them on its far side.
    away = math.hypot(2.0, 1.7)
    arc = 2 * math.pi - 2 * math.atan2(2.0, 1.7) - 2 * math.acos(0.2 / away)
    exact = 2 * math.sqrt(away**2 - 0.2**2) + 0.2 * arc
    assert two_rooms.geodesic_distance(a, b) == pytest.approx(exact, rel=0.03)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_distance_is_a_metric(two_rooms: NavigableSurface, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = (two_rooms.random_point(rng) for _ in range(3))
    ab, bc, ac = (two_rooms.geodesic_distance(*pair) for pair in ((a, b), (b, c), (a, c)))
    assert ab == pytest.approx(two_rooms.geodesic_distance(b, a), rel=0.01, abs=0.01)
    assert ac <= 1.01 * (ab + bc) + 0.01
    assert ab >= np.linalg.norm(a - b) - 1e-9
    assert two_rooms.geodesic_distance(a, a) == 0
    assert two_rooms.distance_field([b, c]).distance(a) == pytest.approx(min(ab, ac), rel=0.01, abs=0.01)
    path = two_rooms.shortest_path(a, b)
    assert path is not None
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(ab)
    assert not any(crosses(*leg, s) for leg in itertools.pairwise(path) for s in ((3, 0, 3, 1), (3, 1.8, 3, 4)))


def test_goals_out_of_reach_are_infinitely_far(two_rooms: NavigableSurface) -> None:
    assert two_rooms.geodesic_distance([1, 0, 1], [50, 0, 1]) == math.inf
    assert two_rooms.shortest_path([50, 0, 1], [1, 0, 1]) is None
    assert two_rooms.geodesic_distance([1, 0, 1], [[50, 0, 1], [2, 0, 1]]) == pytest.approx(1.0)
    with pytest.raises(ValueError, match=r"none of 1 goals is within 0\.5 m"):
        two_rooms.distance_field([50, 0, 1])


def test_snap_goes_to_the_nearest_place_and_no_further(two_rooms: NavigableSurface) -> None:
    assert two_rooms.snap([1, 0.05, 1]) == pytest.approx([1, 0, 1])
    assert two_rooms.snap([-0.1, 0, 2]) == pytest.approx([0.225, 0, 2], abs=0.03)
    assert two_rooms.snap([-1, 0, 2]) is None
    assert two_rooms.snap([1, 1.0, 1]) is None
    assert two_rooms.snap([1, 1.0, 1], 1.5) == pytest.approx([1, 0, 1])
    with pytest.raises(ValueError, match="three finite numbers"):
        two_rooms.snap([math.nan, 0, 0])


def test_places_near_a_box_are_on_its_storey(two_rooms: NavigableSurface) -> None:
    points = two_rooms.points_near_box([1, 0.7, 1], [2, 1.2, 2], 0.5)
    outside = np.maximum(np.maximum([1, 1] - points[:, [0, 2]], points[:, [0, 2]] - [2, 2]), 0)
    assert len(points) > 500
    assert np.hypot(*outside.T).max() <= 0.5
    assert len(two_rooms.points_near_box([1, 3, 1], [2, 3.5, 2], 0.5)) == 0


def test_top_down_map_shows_the_cells(two_rooms: NavigableSurface) -> None:
    picture = two_rooms.top_down_map()
    assert picture.navigable.sum() * picture.resolution**2 == pytest.approx(two_rooms.island_areas[0])
    rng = np.random.default_rng(1)
    for point in (two_rooms.random_point(rng) for _ in range(50)):
        row, column = np.rint(picture.pixel(point)).astype(int)
        assert picture.navigable[row, column]


def test_meshes_that_cannot_be_used_are_refused() -> None:
    v, f = room(2, 2)
    with pytest.raises(ValueError, match="Y up"):
        NavigableSurface.from_scene(quads(wall(0, 0, 3, 0)))
    with pytest.raises(ValueError, match="stray vertices"):
        NavigableSurface.from_scene((v * 1e4, f))
    with pytest.raises(ValueError, match="not finite"):
        NavigableSurface.from_scene((np.where(v == 2, np.nan, v), f))
    with pytest.raises(ValueError, match="without a vertex"):
        NavigableSurface.from_scene((v, f + 9999))
    with pytest.raises(ValueError, match="expected a radius"):
        Body(radius=0)


def test_the_same_mesh_gives_the_same_bytes() -> None:
    mesh = room(4, 3, (1, 0, 2.3, 2))
    a, b = NavigableSurface.from_scene(mesh), NavigableSurface.from_scene(mesh)
    goal = a.random_point(np.random.default_rng(5))
    assert goal.tobytes() == b.random_point(np.random.default_rng(5)).tobytes()
    for x, y in ((a.centres, b.centres), (a.distance_field(goal)._distance, b.distance_field(goal)._distance)):
        assert x.tobytes() == y.tobytes()


# --- walking


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.05, 0.2]))
def test_walks_stay_on_the_surface_cross_no_wall_and_never_stick(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    walls: list[Segment] = [tuple(rng.uniform(0, 5, 4).tolist()) for _ in range(4)]
    surface = NavigableSurface.from_scene(room(5, 5, *walls), Body(radius=radius))
    position, heading = surface.random_point(rng), rng.uniform(-math.pi, math.pi)
    island = surface.island_of(position)
    for k in range(500):
        heading += rng.choice([0.0, 0.0, math.radians(15), -math.radians(15)])
        before, step = position, 0.25 * np.array([-math.sin(heading), 0.0, -math.cos(heading)])
        position = surface.try_step(before, step)
        assert surface.island_of(position) == island
        assert np.linalg.norm(position - before) <= 0.25 + 1e-9
        assert min(gap(position, s) for s in walls) >= radius - surface.grid.cell
        assert not any(crosses(before, position, s) for s in walls)
        if k % 50 == 0:
            around = [[-0.25 * math.sin(a), 0, -0.25 * math.cos(a)] for a in np.arange(24) * math.pi / 12]
            assert max(np.linalg.norm(surface.try_step(position, d) - position) for d in around) > 0.1


@pytest.mark.parametrize("slope_deg", [0, 10, 30, 45, 70])
def test_a_body_slides_along_a_slanted_wall(slope_deg: float) -> None:
    slope = math.radians(slope_deg)
    end = (0.5 + 4 * math.cos(slope), 1 + 4 * math.sin(slope))
    surface = NavigableSurface.from_scene(room(6, 6, (0.5, 1, *end)))
    along, into = np.array([math.cos(slope), 0, math.sin(slope)]), np.array([math.sin(slope), 0, -math.cos(slope)])
    position = start = np.array([0.5, 0, 1]) + 1.5 * along - 0.3 * into
    # Half into the wall and half along it, 45 degrees: 8 steps of 0.2 m along it remain, less what the grid's corners cost.
    for _ in range(8):
        position = surface.try_step(position, 0.2 * (along + into))
    assert (position - start) @ along == pytest.approx(1.6, rel=0.2)
    head_on = surface.try_step(position, 0.2 * into)
    assert np.linalg.norm(head_on - position) < 0.1


def test_a_step_from_off_the_surface_is_refused(two_rooms: NavigableSurface) -> None:
    with pytest.raises(ValueError, match="snap it first"):
        two_rooms.try_step([-3, 0, 0], [1, 0, 0])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_the_follower_arrives_by_about_the_shortest_way(two_rooms: NavigableSurface, seed: int) -> None:
    rng = np.random.default_rng(seed)
    position, goal, heading = two_rooms.random_point(rng), two_rooms.random_point(rng), rng.uniform(-math.pi, math.pi)
    follower = ShortestPathFollower(two_rooms, goal, goal_radius=0.2)
    shortest, walked, turns = follower.field.distance(position), 0.0, 0
    while (action := follower.next_action(position, heading)) != Action.STOP:
        if action == Action.MOVE_FORWARD:
            before = position
            position = two_rooms.try_step(position, [-0.25 * math.sin(heading), 0, -0.25 * math.cos(heading)])
            walked += float(np.linalg.norm(position - before))
        else:
            heading += math.radians(15) * (1 if action == Action.TURN_LEFT else -1)
            turns += 1
        assert turns + walked / 0.1 < 150, "the follower goes round and round"
    assert follower.field.distance(position) <= 0.2
    assert walked <= 1.1 * shortest + 0.3


def test_the_floor_of_a_flat_without_ceiling_goes_before_the_inside_of_a_cupboard() -> None:
    vertices, faces = [], []
    for low, high in (
        ((-3.0, -0.1, -3.0), (3.0, 0.0, 3.0)),
        *(((x, 0.0, z), (x + 0.02, 2.0, z + 0.8)) for x, z in ((1.0, 1.0), (1.98, 1.0))),
        *(((1.0, 0.0, z), (2.0, 2.0, z + 0.02)) for z in (1.0, 1.8)),
        ((1.0, 2.0, 1.0), (2.0, 2.02, 1.82)),
    ):
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
        quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
        faces.append(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) + 8 * len(vertices))
        vertices.append(np.array(low) + corners * (np.array(high) - np.array(low)))
    surface = NavigableSurface.from_scene((np.concatenate(vertices), np.concatenate(faces)))
    assert surface.island_of([-1.5, 0.0, -1.5]) == 0
    assert surface.island_of([1.5, 0.0, 1.4]) > 0
