"""The navigable surface of a real format's house against what habitat-sim says of the same house."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

from openmap_env.navigation import Body, NavigableSurface
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


def test_walks_in_the_house_go_through_nothing(house: Scene) -> None:
    surface = NavigableSurface.from_scene(house)
    rays = o3d.t.geometry.RaycastingScene()
    rays.add_triangles(o3d.core.Tensor(house.vertices), o3d.core.Tensor(house.faces.astype(np.uint32)))
    rng = np.random.default_rng(11)
    origins, ways = [], []
    for _ in range(5):
        position, heading = surface.random_point(rng), rng.uniform(-math.pi, math.pi)
        for _ in range(300):
            before = position
            position = surface.try_step(before, [-0.25 * math.sin(heading), 0, -0.25 * math.cos(heading)])
            assert surface.island_of(position) == 0
            heading += rng.choice([0.0, 0.0, 1.0, -1.0]) * math.radians(15)
            if np.linalg.norm(position - before) < 0.1:
                heading += math.radians(15)
            for height in (0.3, 0.8, 1.4):
                origins.append(before + np.array([0, height, 0]))
                ways.append(position - before)
    cast = rays.cast_rays(o3d.core.Tensor(np.hstack([origins, ways]).astype(np.float32)))
    moved = np.linalg.norm(ways, axis=1) > 1e-6
    assert (cast["t_hit"].numpy()[moved] > 1).all()
