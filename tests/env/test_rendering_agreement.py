"""Every renderer shows what rays meet: ids to the pixel but for borders, depth to the millimetre, colours within filtering."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rendering_cases import (
    CAMERA,
    Make,
    assert_same_as_reference,
    cluttered_room,
    differing,
    every_backend,
    every_rasteriser,
    frames,
    indoor_poses,
    look,
    on_edge,
)

from openmap_eval.bench.render_home import make_render_home
from openmap_scenes import PinholeCamera, Scene, load_scene


@every_rasteriser
@pytest.mark.parametrize("seed", [0, 1])
def test_random_rooms_look_as_they_do_to_rays(make: Make, backend: str, seed: int) -> None:
    scene = cluttered_room(seed)
    poses = indoor_poses(scene, 20, seed)
    shown, reference = (frames(make(name, scene, CAMERA), poses) for name in (backend, "raycast"))
    assert_same_as_reference(shown, reference, rgb_tolerance=2.0)
    assert np.unique(np.stack([f.instance for f in shown])).size > 15
    assert np.mean([np.mean(f.depth > 0) for f in shown]) > 0.9


def turned_over(scene: Scene, seed: int) -> Scene:
    """The scene with half of its faces, at random, wound the other way round."""
    flip = np.random.default_rng(seed).random(len(scene.faces)) < 0.5
    return replace(scene, faces=np.where(flip[:, None], scene.faces[:, ::-1], scene.faces).astype(np.int32))


@every_rasteriser
def test_faces_that_are_inside_out_are_seen_as_well(make: Make, backend: str) -> None:
    scene = make_render_home(12_000, 1, textures=3)
    poses = indoor_poses(scene, 8, 1)
    camera = PinholeCamera(161, 121, 80.0, 85.0, 70.3, 66.1)
    plain, turned = (frames(make(backend, s, camera), poses) for s in (scene, turned_over(scene, 0)))
    reference = frames(make("raycast", turned_over(scene, 0), camera), poses)
    assert_same_as_reference(turned, reference, rgb_tolerance=6.0, depth_tolerance=REACH_OF_DEPTH[backend.split()[0]])
    for a, b in zip(plain, turned, strict=True):
        assert np.mean(a.instance != b.instance) < 1e-3
        assert np.mean(np.abs(a.depth - b.depth) > 1e-3) < 1e-3


# A depth buffer of 24 bits resolves z^2 / (near 2^24) at depth z: 1 mm at 29 m, less at home; its readers add as much again.
REACH_OF_DEPTH = {"opengl": 1e-3, "pyrender": 2e-3}


@every_rasteriser
def test_a_house_looks_as_it_does_to_rays(make: Make, backend: str, shared_scenes: Path) -> None:
    scene = load_scene(f"mp3d:{shared_scenes}/mp3d/aws_small_house")
    poses = indoor_poses(scene, 12, 0)
    camera = PinholeCamera(321, 241, 170.0, 165.0, 150.3, 126.1)
    shown, reference = (frames(make(name, scene, camera), poses) for name in (backend, "raycast"))
    # Without mipmaps, distant textures are noisy.
    assert_same_as_reference(shown, reference, rgb_tolerance=6.0, depth_tolerance=REACH_OF_DEPTH[backend.split()[0]])
    assert np.unique(np.stack([f.instance for f in shown])).size > 30


@pytest.mark.slow
@every_rasteriser
def test_a_built_home_looks_as_it_does_to_rays(make: Make, backend: str) -> None:
    scene = load_scene("homes:train/0")
    poses = indoor_poses(scene, 10, 0)
    camera = PinholeCamera.from_hfov(321, 241, 90.0)
    shown, reference = (frames(make(name, scene, camera), poses) for name in (backend, "raycast"))
    assert_same_as_reference(shown, reference, rgb_tolerance=6.0, depth_tolerance=REACH_OF_DEPTH[backend.split()[0]])


@every_rasteriser
@pytest.mark.parametrize("where", ["tilted", "outside", "inside a box", "grazing"])
def test_odd_places_to_look_from(make: Make, backend: str, where: str) -> None:
    scene = cluttered_room(3)
    box = scene.instances[4]
    poses = {
        "tilted": [look(np.array([0, 1.2, 0]), yaw, pitch) for yaw in (0.3, 2.0) for pitch in (-1.5, 1.2)],
        "outside": [look(np.array([0, 1.2, 9]), 0.0, 0.0), look(np.array([-8, 6, 0]), -1.5, -0.5)],
        "inside a box": [look(box.centre, yaw, 0.1) for yaw in (0.0, 1.0)],
        "grazing": [look(np.array([-2.99, 1.2, 2.4]), 0.0, 0.0)],
    }[where]
    for T in poses if where == "tilted" else ():
        roll = np.eye(4)
        roll[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
        T[:] = T @ roll
    shown, reference = (frames(make(name, scene, CAMERA, near=0.02), poses) for name in (backend, "raycast"))
    assert_same_as_reference(shown, reference, rgb_tolerance=4.0)


@every_backend
def test_a_kilometre_away_from_the_origin_depth_still_holds(make: Make, backend: str) -> None:
    scene = cluttered_room(4)
    scene = replace(
        scene, vertices=(np.round(scene.vertices * 64) / 64).astype(np.float32)
    )  # so that they stay what they are
    offset = np.array([1000.0, 64.0, -1000.0])
    away = replace(scene, vertices=(scene.vertices + offset).astype(np.float32))
    poses = indoor_poses(scene, 6, 4)
    moved = [T.copy() for T in poses]
    for T in moved:
        T[:3, 3] += offset
    shown = frames(make(backend, away, CAMERA), moved)
    reference = frames(make("raycast", scene, CAMERA), poses)
    for a, b in zip(shown, reference, strict=True):
        share, on_borders = differing(b, a)
        assert share < 5e-3
        assert on_borders
        flat = ~(on_edge(a) | on_edge(b))
        assert np.abs(a.depth - b.depth)[flat].max() < 2e-3
