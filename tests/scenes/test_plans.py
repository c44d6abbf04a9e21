"""Floor plans and the shells built on them: what must hold whatever the seed."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, label

from openmap_scenes.homes.layout import ROOM_SIZES
from openmap_scenes.homes.plan import CLEARANCE, OUTER, ROOM_KINDS, WALL, Opening, Plan, Rect, make_plan
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.shell import Piece, build_shell

PUBLIC = {"hall", "living room", "kitchen", "dining room", "studio"}
seeds = st.integers(0, 1_000_000)


def plan_of(seed: int) -> Plan:
    return make_plan(np.random.default_rng(seed))


def shell_of(seed: int) -> tuple[Plan, list[Piece]]:
    rng = np.random.default_rng(seed)
    plan = make_plan(rng)
    return plan, build_shell(plan, rng)


def triangles(pieces: list[Piece]) -> np.ndarray:
    return np.concatenate([p.mesh.vertices[p.mesh.faces] for p in pieces]).astype(np.float64)


def doors(plan: Plan) -> list[Opening]:
    return [o for o in plan.openings if o.kind == "door"]


def reached(plan: Plan, start: int, without: int = -1) -> set[int]:
    found = {start}
    for _ in plan.rects:
        for o in doors(plan):
            if set(o.rooms) & found and without not in o.rooms:
                found |= set(o.rooms)
    return found


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_rooms_are_usable_named_and_apart(seed: int) -> None:
    plan = plan_of(seed)
    assert 2 <= len(plan.names) == len(set(plan.names)) == len(plan.kinds) == len(plan.rects) <= 8
    assert 2.4 <= plan.ceiling <= 2.9
    for kind, rect in zip(plan.kinds, plan.rects, strict=True):
        short, long = sorted((rect.width - WALL, rect.depth - WALL))
        assert short >= ROOM_KINDS[kind][1] - 2e-3
        assert long / short <= ROOM_SIZES[kind][2] + 5e-3
        assert rect.area < 2.1 * ROOM_SIZES[kind][0]
    assert not any(a.overlaps(b, 1e-9) for a, b in combinations(plan.rects, 2))
    assert 24 < sum(r.area for r in plan.rects) < 150
    for name, kind in zip(plan.names, plan.kinds, strict=True):
        assert name == kind or plan.kinds.count(kind) > 1
    assert {"bathroom"} < set(plan.kinds)
    assert "studio" in plan.kinds or {"living room", "kitchen", "bedroom"} < set(plan.kinds)


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_private_rooms_lead_nowhere(seed: int) -> None:
    plan = plan_of(seed)
    everything = set(range(len(plan.rects)))
    assert reached(plan, 0) == everything
    front = [o for o in plan.openings if o.kind == "front door"]
    assert len(front) == 1
    assert plan.kinds[front[0].rooms[0]] in PUBLIC
    assert "hall" not in plan.kinds or plan.kinds[front[0].rooms[0]] == "hall"
    for room, kind in enumerate(plan.kinds):
        if kind in PUBLIC:
            continue
        others = {sum(o.rooms) - room for o in doors(plan) if room in o.rooms}
        behind = everything - {room} - reached(plan, front[0].rooms[0], without=room)
        assert all(kind == "bedroom" and plan.names[r] == "en suite bathroom" for r in behind)
        if kind == "bathroom":
            assert len(others) == 1
            assert plan.kinds[others.pop()] in (PUBLIC - {"kitchen"} | {"bedroom"})


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_openings_lie_in_walls_of_their_rooms_and_apart(seed: int) -> None:
    plan = plan_of(seed)
    for o in plan.openings:
        for room in (r for r in o.rooms if r >= 0):
            side = next(s for s in plan.sides(room) if o in plan.on_side(s))
            assert side.start + 0.1 < o.start < o.end < side.end - 0.1
        if o.rooms[1] >= 0:
            assert o.kind == "door"
            assert (1.39 if o.wide else 0.879) < o.width < (2.21 if o.wide else 1.001)
        else:
            assert any(a - 1e-9 <= o.start and o.end <= b + 1e-9 for a, b in plan.open_spans(side))
            # Nothing but the open behind it, a good step far.
            zone = o.zone(OUTER + 0.6)
            assert not any(zone.overlaps(r, 1e-9) for k, r in enumerate(plan.rects) if k != o.rooms[0])
        assert 0.0 <= o.sill < o.top < plan.ceiling - 0.1
    for a, b in combinations(plan.openings, 2):
        if a.axis == b.axis and abs(a.at - b.at) < 1e-6:
            assert a.end < b.start + 1e-9 or b.end < a.start + 1e-9


@settings(max_examples=60, deadline=None)
@given(seeds)
def test_leaves_stand_in_their_room_and_before_no_opening(seed: int) -> None:
    plan = plan_of(seed)
    assert len({leaf.opening for leaf in plan.leaves}) == len(plan.leaves)
    for leaf in plan.leaves:
        own = plan.openings[leaf.opening]
        assert own.kind == "door"
        assert not own.wide
        assert leaf.room in own.rooms
        assert plan.inner(leaf.room).contains(leaf.footprint)
        for o in plan.openings:
            if o is not own and leaf.room in o.rooms:
                assert not leaf.footprint.overlaps(o.zone(0.7 if o.kind != "window" else 0.2))
    for a, b in combinations(plan.leaves, 2):
        assert a.room != b.room or not a.footprint.overlaps(b.footprint)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_a_body_of_26_cm_walks_through_every_door_past_its_leaf(seed: int) -> None:
    plan, cell = plan_of(seed), 0.02
    out = plan.outline
    free = np.zeros((int(out.depth / cell) + 1, int(out.width / cell) + 1), bool)

    def cells(r: Rect) -> tuple[slice, slice]:
        z = slice(max(0, round((r.z0 - out.z0) / cell)), max(0, round((r.z1 - out.z0) / cell)))
        return z, slice(max(0, round((r.x0 - out.x0) / cell)), max(0, round((r.x1 - out.x0) / cell)))

    for room in range(len(plan.rects)):
        free[cells(plan.inner(room))] = True
    for o in doors(plan):
        free[cells(o.zone(0.01))] = True
    for leaf in plan.leaves:
        free[cells(leaf.footprint)] = False
    n = 13
    disc = np.hypot(*np.mgrid[-n : n + 1, -n : n + 1]) <= n
    areas, _ = label(~binary_dilation(~free, disc, border_value=1))
    found = [set(np.unique(areas[cells(plan.inner(room))]).tolist()) - {0} for room in range(len(plan.rects))]
    assert set.intersection(*found)


def test_plans_vary_from_studios_to_eight_rooms_with_open_corners() -> None:
    plans = [plan_of(seed) for seed in range(120)]
    counts = Counter(len(p.rects) for p in plans)
    assert set(counts) == set(range(2, 9))
    assert min(counts[n] for n in (5, 6, 7, 8)) >= 8
    assert {k for p in plans for k in p.kinds} == set(ROOM_KINDS)
    cornered = [p for p in plans if sum(r.area for r in p.rects) < p.outline.area - 1.0]
    assert 0.25 < len(cornered) / len(plans) < 0.95
    shares = [len(p.leaves) / len(doors(p)) for p in plans]
    assert 0.4 < np.mean(shares) < 0.9
    assert any(o.wide for p in plans for o in doors(p))
    assert any(o.kind == "balcony door" for p in plans for o in p.openings)


def test_a_plan_is_the_same_for_the_same_seed() -> None:
    for seed in range(10):
        assert plan_of(seed) == plan_of(seed)


@pytest.fixture(scope="module", params=(2, 7, 21))
def shell(request: pytest.FixtureRequest) -> tuple[Plan, list[Piece]]:
    return shell_of(request.param)


def test_a_shell_is_the_same_for_the_same_seed(shell: tuple[Plan, list[Piece]]) -> None:
    seed = next(s for s in (2, 7, 21) if plan_of(s) == shell[0])
    for a, b in zip(shell[1], shell_of(seed)[1], strict=True):
        assert (a.kind, a.room, a.attributes) == (b.kind, b.room, b.attributes)
        assert a.mesh.vertices.tobytes() == b.mesh.vertices.tobytes()
        assert a.mesh.faces.tobytes() == b.mesh.faces.tobytes()
        for m, n in zip(a.mesh.materials, b.mesh.materials, strict=True):
            assert m.colour.tobytes() == n.colour.tobytes()
            assert (m.texture is None) == (n.texture is None)
            assert m.texture is None or m.texture.tobytes() == n.texture.tobytes()


def test_floors_cover_rooms_and_doorways_once(shell: tuple[Plan, list[Piece]]) -> None:
    plan, pieces = shell
    corners = triangles([p for p in pieces if p.kind == "floor"])[:, :, [0, 2]]
    edges = corners[:, 1:] - corners[:, :1]
    area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]).sum() / 2
    wanted = sum(plan.inner(k).area for k in range(len(plan.rects)))
    for o in plan.openings:
        if o.kind != "window":
            wanted += o.width * (WALL if o.rooms[1] >= 0 else WALL / 2 + OUTER)
    assert area == pytest.approx(wanted, rel=1e-4)
    caster = RayCaster(*_soup(triangles([p for p in pieces if p.kind == "floor"])))
    for o in doors(plan):
        zone = o.zone(0.3).shrunk(0.01)
        x, z = (
            g.reshape(-1) for g in np.meshgrid(np.linspace(zone.x0, zone.x1, 23), np.linspace(zone.z0, zone.z1, 23))
        )
        start = np.stack([x, np.full(len(x), 1.0), z], 1)
        down = np.broadcast_to([0.0, -1.0, 0.0], start.shape)
        np.testing.assert_allclose(caster.distance(start, down), 1.0, atol=1e-4)


def _soup(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)


def test_no_ray_leaves_a_shell(shell: tuple[Plan, list[Piece]]) -> None:
    """From the middle of every room, whichever way one looks, something of the house is hit from its front."""
    plan, pieces = shell
    corners = triangles(pieces)
    vertices, faces = _soup(corners)
    caster = RayCaster(vertices, faces)
    rng = np.random.default_rng(0)
    reach = float(np.hypot(plan.outline.width, plan.outline.depth)) + 1.0
    for room in range(len(plan.rects)):
        r = plan.inner(room)
        way = rng.standard_normal((1500, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        start = np.broadcast_to([(r.x0 + r.x1) / 2, 1.3, (r.z0 + r.z1) / 2], way.shape)
        distance = caster.distance(start, way)
        assert np.isfinite(distance).all()
        assert distance.max() < reach
        end = start + distance[:, None] * way
        outline = plan.outline.shrunk(-OUTER - 1e-3)
        assert (end[:, 0] > outline.x0).all()
        assert (end[:, 0] < outline.x1).all()


def test_nothing_sticks_out_of_the_outer_walls(shell: tuple[Plan, list[Piece]]) -> None:
    plan, pieces = shell
    points = np.concatenate([p.mesh.vertices for p in pieces]).astype(np.float64)
    inside = np.zeros(len(points), bool)
    for rect in plan.rects:
        r = rect.shrunk(-OUTER - 2e-3)
        inside |= (points[:, 0] > r.x0) & (points[:, 0] < r.x1) & (points[:, 2] > r.z0) & (points[:, 2] < r.z1)
    assert inside.all()
    assert points[:, 1].min() > -1e-6
    assert points[:, 1].max() < plan.ceiling + 1e-3


def test_the_building_is_closed_from_outside(shell: tuple[Plan, list[Piece]]) -> None:
    """Rays towards the house at any height meet an outer face, a pane or the front door before any room."""
    plan, pieces = shell
    caster = RayCaster(*_soup(triangles(pieces)))
    out = plan.outline.shrunk(-3.0)
    for height in (0.3, 1.4, 2.3):
        for axis, low, high, at in ((0, out.z0, out.z1, out.x0), (2, out.x0, out.x1, out.z0)):
            along = np.linspace(low, high, 301)
            start = np.zeros((301, 3))
            start[:, axis], start[:, 2 - axis], start[:, 1] = at, along, height
            way = np.zeros((301, 3))
            way[:, axis] = 1.0
            hit = caster.distance(start, way)
            for s, d in zip(start, hit, strict=True):
                if np.isfinite(d):
                    x, z = (s + d * way[0])[[0, 2]]
                    # An outer face, or what is set into it: never past the inner face of a wall.
                    assert not any(_within(plan.inner(k).shrunk(0.03), x, z) for k in range(len(plan.rects)))


def _within(r: Rect, x: float, z: float) -> bool:
    return r.x0 < x < r.x1 and r.z0 < z < r.z1


def test_faces_look_where_their_normals_do(shell: tuple[Plan, list[Piece]]) -> None:
    for piece in shell[1]:
        corners = piece.mesh.vertices[piece.mesh.faces].astype(np.float64)
        geometric = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        shading = piece.mesh.normals[piece.mesh.faces].mean(1)
        assert ((geometric * shading).sum(1) > 0).all(), piece.kind
        assert np.isfinite(piece.mesh.uv).all()


def test_walls_are_fine_enough_for_their_light_and_each_room_has_all_its_parts(
    shell: tuple[Plan, list[Piece]],
) -> None:
    plan, pieces = shell
    kinds = Counter((p.kind, p.room) for p in pieces)
    for room in range(len(plan.rects)):
        assert kinds["floor", room] == kinds["ceiling", room] == 1
        assert kinds["wall", room] == 4
    assert sum(p.kind == "door" for p in pieces) == len(plan.leaves)
    assert sum(p.kind == "window" for p in pieces) == sum(o.kind == "window" for o in plan.openings)
    for p in (p for p in pieces if p.kind == "floor"):
        corners = p.mesh.vertices[p.mesh.faces]
        assert np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max() < 0.28


def test_a_leaf_fills_its_footprint(shell: tuple[Plan, list[Piece]]) -> None:
    plan, pieces = shell
    found = [p.mesh.vertices for p in pieces if p.kind == "door"]
    for leaf, vertices in zip(sorted(plan.leaves, key=lambda a: a.opening), found, strict=True):
        low, high = vertices.min(0), vertices.max(0)
        f = leaf.footprint
        np.testing.assert_allclose([low[0], low[2], high[0], high[2]], [f.x0, f.z0, f.x1, f.z1], atol=0.03)
        assert f.contains(Rect(low[0], low[2], high[0], high[2]), tolerance=0.008)


def test_zones_reach_to_both_sides() -> None:
    o = Opening("door", (0, 1), "x", 2.0, 1.0, 1.9, 0.0, 2.05)
    assert o.zone(CLEARANCE) == Rect(1.0, 2.0 - WALL / 2 - CLEARANCE, 1.9, 2.0 + WALL / 2 + CLEARANCE)


def test_tiles_lie_behind_the_counter_and_nowhere_else_in_a_kitchen() -> None:
    tiled = 0
    for seed in (2, 3, 5, 8):
        plan = plan_of(seed)
        kitchen = plan.kinds.index("kitchen")
        rng = np.random.default_rng(seed)
        walls = [p for p in build_shell(make_plan(rng), rng, {kitchen: {2}}) if p.kind == "wall" and p.room == kitchen]
        has = [any(m.name == "wall tiles" for m in p.mesh.materials) for p in walls]
        assert not any(has[k] for k in (0, 1, 3))
        tiled += has[2]
    assert tiled
