"""What an episode is scored by."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_env import measures
from openmap_env.episodes import Target
from openmap_env.episodes.readers import target_of
from openmap_env.goals import places_at, way_to
from openmap_env.measures import SR_KS, Steps, Walk, WallTime, score

numbers = st.floats(-3.0, 3.0, allow_nan=False, width=32)
points = st.tuples(numbers, numbers, numbers)
sizes = st.tuples(*[st.floats(0.0, 2.0, width=32)] * 3)


def box(centre, size) -> Target:
    low, high = (tuple(float(c + s * f) for c, s in zip(centre, size, strict=True)) for f in (-0.5, 0.5))
    return Target(1, tuple(map(float, centre)), low, high)


def walk_of(targets, declared=(), stopped=True, path=((0.0, 0.0, 0.0),)) -> Walk:
    return Walk(tuple(targets), None, [np.array(p) for p in path], 0, np.array(declared, float).reshape(-1, 3), stopped)


@given(st.lists(st.tuples(points, sizes), min_size=1, max_size=4), st.lists(points, max_size=20), st.booleans())
@settings(deadline=None, max_examples=100)
def test_sr_grows_with_k_and_the_box_is_never_farther_than_its_centre(boxes, declared, stopped):
    metrics = score(walk_of([box(c, s) for c, s in boxes], declared, stopped))
    for family in ("sr", "sr_surface"):
        values = [metrics[f"{family}_{k}"] for k in SR_KS]
        assert values == sorted(values)
    assert all(metrics[f"sr_surface_{k}"] >= metrics[f"sr_{k}"] for k in SR_KS)


@given(st.lists(st.tuples(points, sizes), min_size=1, max_size=3), st.lists(points, max_size=20))
@settings(deadline=None, max_examples=100)
def test_sr_agrees_with_its_definition_written_plainly(boxes, declared):
    targets = [box(c, s) for c, s in boxes]
    metrics = score(walk_of(targets, declared, stopped=False))
    for k in SR_KS:
        hit = any(math.dist(place, target.centre) <= 1.0 for place in declared[:k] for target in targets)
        assert metrics[f"sr_{k}"] == float(hit)


def test_sr_counts_from_the_centre_and_the_border_counts():
    target = box((0.0, 1.0, 0.0), (4.0, 0.5, 4.0))
    assert score(walk_of([target], [(1.0, 1.0, 0.0)]))["sr_1"] == 1.0
    beside = score(walk_of([target], [(1.9, 1.0, 0.0)]))
    assert (beside["sr_1"], beside["sr_surface_1"]) == (0.0, 1.0)
    assert score(walk_of([target], [(0.0, 2.1, 0.0)]))["sr_1"] == 0.0, "height counts"


def test_any_of_several_targets_will_do_but_only_within_the_first_k():
    targets = [box((3.0, 0.0, 0.0), (1, 1, 1)), box((-3.0, 0.0, 0.0), (1, 1, 1))]
    metrics = score(walk_of(targets, [(0.0, 0.0, 9.0)] * 4 + [(-3.0, 0.0, 0.5)]))
    assert [metrics[f"sr_{k}"] for k in SR_KS] == [0.0, 0.0, 1.0, 1.0]


def test_who_declares_nothing_has_declared_where_it_stopped_and_who_never_stops_has_not():
    target = box((5.0, 0.5, 0.0), (1, 1, 1))
    path = [(0.0, 0.0, 0.0), (4.5, 0.0, 0.0)]
    assert score(walk_of([target], path=path))["sr_1"] == 1.0
    assert score(walk_of([target], path=path, stopped=False))["sr_16"] == 0.0
    assert score(walk_of([target], [(0.0, 0.0, 0.0)], path=path))["sr_1"] == 0.0, "what was declared counts instead"


def test_walked_length_steps_and_collisions():
    walk = walk_of([box((9, 0, 0), (1, 1, 1))], path=[(0, 0, 0), (3, 0, 0), (3, 0, 0), (3, 0, 4)])
    walk.collisions = 2
    metrics = score(walk)
    assert (metrics["path_length"], metrics["steps"], metrics["collisions"]) == (7.0, 3.0, 2.0)


def test_a_free_question_is_scored_by_what_needs_no_target():
    assert set(score(walk_of([]))) == {"path_length", "steps", "collisions"}


def thing(scene, category):
    return target_of(next(i for i in scene.instances if i.category == category))


def test_navigation_succeeds_at_the_target_and_spl_is_one_on_the_shortest_way(toy_scene, toy_surface):
    target = thing(toy_scene, "sink")
    way = way_to(toy_surface, toy_scene, [target], island=0)
    path = way.path(np.array([-3.0, 0.0, 0.0]))
    walk = Walk((target,), way, list(path), stopped=True)
    metrics = score(walk)
    assert metrics["nav_success"] == 1.0
    assert metrics["spl"] == pytest.approx(1.0)
    assert metrics["distance_to_goal"] == pytest.approx(0.0, abs=0.01)
    assert score(Walk((target,), way, list(path)))["nav_success"] == 0.0, "without STOP nothing was reached"
    detour = Walk((target,), way, [path[0], path[0] + [0.0, 0.0, 1.0], *path], stopped=True)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert score(detour)["spl"] == pytest.approx(length / (length + 2.0), rel=1e-3)


def test_distance_to_goal_goes_around_walls(toy_scene, toy_surface):
    # The refrigerator stands against the wall to the living room: 1 m from its back, and a long way round through the door.
    target = thing(toy_scene, "refrigerator")
    way = way_to(toy_surface, toy_scene, [target], island=0)
    behind = toy_surface.snap([1.4, 0.0, 1.0], island=0, max_distance=1.5)
    assert way.distance(behind) > 1.5
    places = places_at(toy_surface, toy_scene, target, island=0)
    assert len(places) > 0
    assert (places[:, 0] > 2.0).all(), "touching it from its own room"


def test_the_far_side_of_a_wall_is_no_place_to_reach_a_picture_from(toy_scene, toy_surface):
    # On the living room's wall, over an armchair: the kitchen behind the wall is nearer than any place in the living room.
    target = replace(box((1.92, 1.6, -1.55), (0.04, 0.3, 0.4)), instance_id=0)
    places = places_at(toy_surface, toy_scene, target, island=0)
    assert len(places) > 0
    assert (places[:, 0] < 2.0).all()
    roomless = replace(toy_scene, rooms=[])
    assert (places_at(toy_surface, roomless, target, island=0)[:, 0] > 2.0).any(), "only the rooms tell"


def test_what_stands_on_a_table_is_reached_from_beside_the_table(toy_scene, toy_surface):
    vase = thing(toy_scene, "vase")
    places = places_at(toy_surface, toy_scene, vase, island=0)
    gap = np.hypot(
        *np.maximum(np.maximum(np.array(vase.aabb_min) - places, places - np.array(vase.aabb_max)), 0).T[[0, 2]]
    )
    assert len(places) > 0
    assert gap.max() <= 0.75


def test_what_is_out_of_reach_is_infinitely_far(toy_scene, toy_surface):
    far = box((40.0, 0.5, 0.0), (1, 1, 1))
    assert way_to(toy_surface, toy_scene, [far], island=0) is None
    metrics = score(walk_of([far]))
    assert (metrics["distance_to_goal"], metrics["nav_success"], metrics["spl"]) == (math.inf, 0.0, 0.0)


def covered_plainly(scene_surface, path, radius) -> float:
    """``coverage`` once more, on one floor, written as it is defined: cell by cell, each line from scratch."""
    s, reach = scene_surface, round(radius / scene_surface.grid.cell)
    island = s.island_of(path[0])
    where = {(int(s.cells.ix[i]), int(s.cells.iz[i])): int(i) for i in np.flatnonzero(s.island == island)}
    covered = set()
    for place in {s.locate(p) for p in path}:
        covered.add(place)
        at = int(s.cells.ix[place]), int(s.cells.iz[place])
        edges = [
            (a, b) for a in range(-reach, reach + 1) for b in range(-reach, reach + 1) if max(abs(a), abs(b)) == reach
        ]
        for a, b in edges:
            before = at
            for i in range(1, reach + 1):
                x, z = (int(math.copysign(math.floor(abs(v) * i / reach + 0.5), v)) for v in (a, b))
                here = at[0] + x, at[1] + z
                step = here[0] - before[0], here[1] - before[1]
                corners = [here, (before[0] + step[0], before[1]), (before[0], before[1] + step[1])]
                if x * x + z * z > reach * reach or any(c not in where for c in corners):
                    break
                covered.add(where[here])
                before = here
    return len(covered) / int((s.island == island).sum())


def test_coverage_agrees_with_its_definition_written_plainly(toy_surface):
    path = [toy_surface.snap([x, 0.0, 0.0]) for x in (-3.0, -2.5, -2.0)]
    walk = Walk((), None, path, surface=toy_surface)
    plain = covered_plainly(toy_surface, path, 2.0)
    assert 0.1 < plain < 0.9
    assert score(walk)["coverage"] == pytest.approx(plain, abs=1e-12)


def test_coverage_grows_along_the_way_and_stops_at_walls(toy_surface):
    # 1 m from the wall to the bedroom, away from its door: only the living room is near.
    beside = toy_surface.snap([-1.2, 0.0, -1.4])
    covered = score(Walk((), None, [beside], surface=toy_surface))["coverage"]
    living = ((toy_surface.centres[:, 0] > -2.0) & (toy_surface.island == 0)).sum() / (toy_surface.island == 0).sum()
    assert 0.0 < covered < living
    path = [toy_surface.snap([x, 0.0, 0.0]) for x in np.arange(-5.0, 5.5, 0.5)]
    grown = [score(Walk((), None, path[:n], surface=toy_surface))["coverage"] for n in (1, 8, len(path))]
    assert grown == sorted(grown)
    assert 0.9 < grown[-1] <= 1.0


def test_the_measure_in_the_documentation_works_as_it_stands(toy_surface):
    text = measures.__doc__.split('info["metrics"]``:')[1].split("The same walk")[0]
    assert len(text.strip().splitlines()) <= 10
    names = {"dataclass": dataclass, "np": np, "Walk": Walk}
    exec(textwrap.dedent(text), names)
    walk = walk_of([], path=[(0, 0, 0), (1, 0, 0), (0, 0, 0), (1, 0, 0)])
    assert score(walk, extra=[names["Backtracking"]()])["backtracking"] == 0.5


def test_wall_time_is_measured_only_where_asked_for():
    walk = walk_of([])
    assert "wall_time" not in score(walk)
    first = score(walk, extra=[WallTime()])["wall_time"]
    assert 0.0 <= first <= score(walk, extra=[WallTime()])["wall_time"]


def test_two_measures_of_one_name_are_refused():
    with pytest.raises(ValueError, match="called steps, expected a name of its own"):
        score(walk_of([]), extra=[Steps()])


def test_a_measure_that_gives_no_number_is_named():
    @dataclass(frozen=True)
    class Places:
        name = "places"
        needs_targets = False

        def value(self, walk):
            return np.zeros(3)

    with pytest.raises(ValueError, match=r"the measure places gave .*expected a number"):
        score(Walk((), None, [np.zeros(3)]), [Places()])
