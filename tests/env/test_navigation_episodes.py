"""The navigable surface of a real format's house: its episodes, and what habitat-sim says of the same house."""

from __future__ import annotations

import gzip
import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from openmap_env.actions import Action
from openmap_env.episodes import load_episodes
from openmap_env.navigation import Body, NavigableSurface, ShortestPathFollower
from openmap_scenes import Scene, load_scene


def read(path: Path) -> Any:
    return json.loads(gzip.decompress(path.read_bytes()))


@pytest.fixture(scope="module")
def house(shared_scenes: Path) -> Scene:
    return load_scene(f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}")


@pytest.fixture(scope="module")
def surface(house: Scene) -> NavigableSurface:
    """For the body that the episodes were made for."""
    return NavigableSurface.from_scene(house, Body(radius=0.1))


def test_r2r_distances_agree_with_habitat(surface: NavigableSurface, shared_scenes: Path) -> None:
    episodes = read(shared_scenes / "episodes" / "r2r_ce" / "val" / "val.json.gz")["episodes"]
    for e in episodes:
        goals = [g["position"] for g in e["goals"]]
        assert surface.geodesic_distance(e["start_position"], goals) == pytest.approx(
            e["info"]["geodesic_distance"], rel=0.05
        ), e["episode_id"]
        assert all(surface.island_of(p) == 0 for p in e["reference_path"])
    assert len(episodes) == 12


def test_objectnav_distances_agree_with_habitat(surface: NavigableSurface, shared_scenes: Path) -> None:
    content = read(shared_scenes / "episodes/objectnav/mp3d/v1/val/content/aws_small_house.json.gz")
    for e in content["episodes"]:
        goals = content["goals_by_category"][f"aws_small_house.glb_{e['object_category']}"]
        views = [v["agent_state"]["position"] for g in goals for v in g["view_points"]]
        assert surface.geodesic_distance(e["start_position"], views) == pytest.approx(
            e["info"]["geodesic_distance"], rel=0.05
        ), e["object_category"]
    assert len(content["episodes"]) == 12


TOLERANCE = 0.15
"""Positions in the files lie on another program's navigation mesh, which rounds at corners and floats over the floor, m."""


def follow(surface: NavigableSurface, start: Any, heading: float, goals: Any) -> tuple[float, float]:
    """Length walked, m, and distance left, m, of a follower that goes from a start to the nearest of the goals."""
    position = surface.snap(start, TOLERANCE)
    assert position is not None
    follower = ShortestPathFollower(surface, goals)
    walked = 0.0
    for _ in range(1000):
        action = follower.next_action(position, heading)
        if action == Action.STOP:
            return walked, follower.field.distance(position)
        if action == Action.MOVE_FORWARD:
            before = position
            position = surface.try_step(before, [-0.25 * math.sin(heading), 0.0, -0.25 * math.cos(heading)])
            walked += float(np.linalg.norm(position - before))
        else:
            heading += math.radians(15) * (1 if action == Action.TURN_LEFT else -1)
    raise AssertionError("the follower does not arrive")


def test_every_r2r_position_is_on_the_surface_and_the_follower_walks_the_reference_path(
    surface: NavigableSurface, shared_scenes: Path
) -> None:
    episodes = load_episodes(shared_scenes / "episodes" / "r2r_ce" / "val" / "val.json.gz")
    raw = read(shared_scenes / "episodes" / "r2r_ce" / "val" / "val.json.gz")["episodes"]
    assert len(episodes) == len(raw) == 12
    for e, r in zip(episodes, raw, strict=True):
        goals = [g["position"] for g in r["goals"]]
        for place in (e.start_position, *r["reference_path"], *goals):
            assert surface.snap(place, TOLERANCE, island=0) is not None, (e.episode_id, place)
        shortest = surface.geodesic_distance(e.start_position, goals)
        walked, left = follow(surface, e.start_position, e.start_heading, goals)
        assert left <= 0.25
        assert shortest / max(shortest, walked + left) >= 0.95
        for a, b in itertools.pairwise(r["reference_path"]):
            walked, left = follow(surface, a, 0.0, b)
            assert left <= 0.25
            assert walked <= 1.06 * surface.geodesic_distance(a, b) + 0.05


def test_every_objectnav_start_and_view_point_is_on_the_surface_and_the_follower_gets_there(
    surface: NavigableSurface, shared_scenes: Path
) -> None:
    folder = shared_scenes / "episodes/objectnav/mp3d/v1/val"
    content = read(folder / "content/aws_small_house.json.gz")
    episodes = load_episodes(folder)
    assert len(episodes) == len(content["episodes"]) == 12
    for e, raw in zip(episodes, content["episodes"], strict=True):
        goals = content["goals_by_category"][f"aws_small_house.glb_{raw['object_category']}"]
        views = [v["agent_state"]["position"] for g in goals for v in g["view_points"]]
        for place in (e.start_position, *views):
            assert surface.snap(place, TOLERANCE, island=0) is not None, (e.episode_id, place)
        shortest = surface.geodesic_distance(e.start_position, views)
        walked, left = follow(surface, e.start_position, e.start_heading, views)
        assert left <= 0.25
        assert shortest / max(shortest, walked + left) >= 0.95 or walked - shortest <= 0.1
