"""What is left out of a picture is hidden for certain: boxes against brute force, and pictures against those of everything."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rendering_cases import Make, needs_opengl

from openmap_env.rendering.geometry import Batches, projection_matrix, view_matrix
from openmap_env.rendering.visibility import (
    CELL,
    TILE,
    Occlusion,
    VisibleSets,
    cells_of,
    cube_camera,
    cube_poses,
    farthest_in_tiles,
    is_hidden,
)
from openmap_scenes import PinholeCamera, Scene, load_scene

CAMERA = PinholeCamera.from_hfov(72, 56, 90.0)
NEAR = 0.05


def look(position: npt.ArrayLike, yaw: float = 0.0, pitch: float = 0.0) -> npt.NDArray[np.float64]:
    """T_world_camera (4, 4) at a position (3,) m, turned left and up by radians."""
    (c, s), (cp, sp) = (np.cos(yaw), np.sin(yaw)), (np.cos(pitch), np.sin(pitch))
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ [[1, 0, 0], [0, cp, -sp], [0, sp, cp]]
    T_world_camera[:3, 3] = position
    return T_world_camera


def tiles_of(depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    tiles = np.empty((-(-depth.shape[0] // TILE), -(-depth.shape[1] // TILE)), np.float32)
    farthest_in_tiles(depth, tiles)
    return tiles


def points_show(
    points: npt.NDArray[np.float64], T_clip_world: npt.NDArray[np.float64], depth: npt.NDArray[np.float32]
) -> bool:
    """The plain twin: whether any of the points (n, 3) m is in the picture and no farther than what it shows there."""
    clip = np.c_[points, np.ones(len(points))] @ T_clip_world.T
    clip = clip[clip[:, 3] > NEAR]
    u = np.floor((0.5 * clip[:, 0] / clip[:, 3] + 0.5) * depth.shape[1]).astype(int)
    v = np.floor((0.5 * clip[:, 1] / clip[:, 3] + 0.5) * depth.shape[0]).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < depth.shape[1]) & (v < depth.shape[0])
    there = depth[v[inside], u[inside]]
    return bool(np.any((there == 0.0) | (clip[inside, 3] <= there)))


def test_the_farthest_in_a_tile_is_the_farthest_and_nothing_is_infinitely_far() -> None:
    depth = np.random.default_rng(0).uniform(0.1, 9.0, (21, 30)).astype(np.float32)
    depth[3, 4] = 0.0
    tiles = tiles_of(depth)
    for i in range(tiles.shape[0]):
        for j in range(tiles.shape[1]):
            block = depth[i * TILE : (i + 1) * TILE, j * TILE : (j + 1) * TILE]
            assert tiles[i, j] == (np.inf if (block == 0.0).any() else block.max())


@settings(deadline=None)  # the first example compiles
@given(st.integers(0, 2**32 - 1))
def test_a_box_that_is_called_hidden_shows_no_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (CAMERA.height, CAMERA.width)
    depth = rng.uniform(1.0, rng.uniform(1.5, 8.0), shape).astype(np.float32)
    if rng.random() < 0.3:
        depth[rng.random(shape) < 0.01] = 0.0
    position = rng.uniform(-3.0, 3.0, 3)
    pose = look(position, rng.uniform(-np.pi, np.pi), rng.uniform(-1.0, 1.0))
    T_clip_world = np.ascontiguousarray(projection_matrix(CAMERA, NEAR, 100.0) @ view_matrix(pose))
    tiles = tiles_of(depth)
    for _ in range(30):
        middle, half = position + rng.normal(0.0, 5.0, 3), rng.uniform(0.01, 1.5, 3)
        low, high = middle - half, middle + half
        if is_hidden(low, high, T_clip_world, CAMERA.width, CAMERA.height, NEAR, tiles):
            assert not points_show(rng.uniform(low, high, (400, 3)), T_clip_world, depth)


def test_a_box_behind_a_wall_is_hidden_and_one_before_it_or_beside_it_is_not() -> None:
    wall = np.full((CAMERA.height, CAMERA.width), 3.0, np.float32)
    T_clip_world = np.ascontiguousarray(projection_matrix(CAMERA, NEAR, 100.0) @ view_matrix(look((0, 0, 0))))

    def hidden(depth: npt.NDArray[np.float32], z: float, x: float = 0.0) -> bool:
        low, high = np.array([x - 0.2, -0.2, z - 0.2]), np.array([x + 0.2, 0.2, z + 0.2])
        return bool(is_hidden(low, high, T_clip_world, CAMERA.width, CAMERA.height, NEAR, tiles_of(depth)))

    assert hidden(wall, -4.0)
    assert not hidden(wall, -2.0)
    assert not hidden(wall, -3.1)
    assert not hidden(wall, 0.0)
    half = wall.copy()
    half[:, CAMERA.width // 2 :] = 0.0
    assert hidden(half, -4.0, x=-2.0)
    assert not hidden(half, -4.0, x=2.0)


def test_remembered_sets_come_back_from_arrays_and_add_up() -> None:
    rng = np.random.default_rng(1)
    sets, places = VisibleSets(77), rng.uniform(-4.0, 4.0, (20, 3))
    for place in places:
        sets.at(place)[rng.integers(77, size=9)] = True
    again = VisibleSets(77)
    again.at(places[0])[5] = True
    again.add(sets.to_arrays())
    for n, place in enumerate(places):
        expected = sets.at(place).copy()
        expected[5] |= n == 0 or bool(np.all(np.floor(place / CELL) == np.floor(places[0] / CELL)))
        np.testing.assert_array_equal(again.at(place), expected)


def test_every_place_shares_a_cell_with_one_middle() -> None:
    places = np.random.default_rng(2).uniform(-3.0, 3.0, (500, 3))
    middles = cells_of(places)
    cells = {tuple(c) for c in np.floor(middles / CELL).astype(int)}
    assert len(cells) == len(middles)
    assert {tuple(c) for c in np.floor(places / CELL).astype(int)} == cells


def test_six_views_see_all_around() -> None:
    directions = np.random.default_rng(3).normal(size=(500, 3))
    seen = np.zeros(500, int)
    for pose in cube_poses(np.array([1.0, 2.0, 3.0])):
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        clip = (
            np.c_[directions + pose[:3, 3], np.ones(500)]
            @ (projection_matrix(cube_camera(), NEAR, 100.0) @ view_matrix(pose)).T
        )
        seen += (clip[:, 3] > 0) & (np.abs(clip[:, :2]) <= clip[:, 3:]).all(1)
    assert seen.min() >= 1


def test_what_is_drawn_is_ordered_by_the_view_alone() -> None:
    rng = np.random.default_rng(4)
    low = rng.uniform(-4.0, 4.0, (50, 3))
    starts = np.arange(51)
    batches = Batches(np.arange(50), starts, np.repeat([0, 1], 25), low, low + 0.3)
    occlusion = Occlusion(batches, np.arange(150, dtype=np.uint32))
    occlusion.begin(projection_matrix(CAMERA, NEAR, 100.0) @ view_matrix(look((0, 0, 5))), np.zeros(3), CAMERA, NEAR)
    corners, runs = occlusion.gather(np.arange(50))
    corners = corners.copy()
    shuffled, same_runs = occlusion.gather(rng.permutation(50))
    np.testing.assert_array_equal(corners, shuffled)
    assert runs == same_runs
    np.testing.assert_array_equal(np.sort(corners), np.arange(150))
    groups = np.repeat([group for group, _ in runs], [count for _, count in runs])
    np.testing.assert_array_equal(groups, corners // 75)


def same_pictures(make: Make, scene: Scene, poses: list[npt.NDArray[np.float64]], **settings: object) -> None:
    """Assert that with and without occlusion culling every byte is the same, whatever was seen before."""
    camera = PinholeCamera.from_hfov(161, 121, 90.0)
    everything = make("opengl frustum", scene, camera)
    culled = make("opengl", scene, camera, **settings)
    fresh = make("opengl", scene, camera)
    fresh.learn(np.array([pose[:3, 3] for pose in poses]))  # type: ignore[attr-defined]
    drawn = 0
    for pose in [*poses, *poses[::-2]]:
        frame = everything.render(pose)
        drawn += int((frame.depth > 0.0).sum())
        for other in (culled.render(pose), fresh.render(pose)):
            for name in ("rgb", "depth", "instance"):
                np.testing.assert_array_equal(getattr(other, name), getattr(frame, name), name)
    assert drawn > 1000 * len(poses)


def walk(
    rng: np.random.Generator, low: npt.NDArray[np.float64], high: npt.NDArray[np.float64], n: int
) -> list[npt.NDArray[np.float64]]:
    """Poses of a walk that turns, steps and now and then jumps."""
    poses, position, yaw = [], rng.uniform(low, high), 0.0
    for _ in range(n):
        what = rng.random()
        if what < 0.1:
            position, yaw = rng.uniform(low, high), rng.uniform(-np.pi, np.pi)
        elif what < 0.5:
            yaw += rng.choice([-0.26, 0.26])
        else:
            position = np.clip(position + 0.25 * np.array([-np.sin(yaw), 0.0, -np.cos(yaw)]), low, high)
        poses.append(look(position, yaw, rng.choice([-0.5, 0.0, 0.0, 0.5])))
    return poses


@needs_opengl
def test_pictures_of_a_home_are_the_same_to_the_last_bit(toy_scene: Scene, make: Make) -> None:
    low, high = np.array([-5.8, 1.2, -1.8]), np.array([5.8, 1.3, 1.8])
    same_pictures(make, toy_scene, walk(np.random.default_rng(5), low, high, 40), faces_per_batch=4)


@needs_opengl
def test_pictures_of_surfaces_that_lie_in_each_other_are_the_same_to_the_last_bit(toy_scene: Scene, make: Make) -> None:
    """Every face twice, with another instance: at each pixel two are exactly as deep."""
    ids = toy_scene.face_instance
    twice = replace(
        toy_scene,
        faces=np.concatenate([toy_scene.faces, toy_scene.faces[::-1]]),
        face_material=np.concatenate([toy_scene.face_material, toy_scene.face_material[::-1]]),
        face_instance=np.concatenate([ids, np.roll(ids, 13)]),
    )
    low, high = np.array([-5.8, 1.2, -1.8]), np.array([5.8, 1.3, 1.8])
    same_pictures(make, twice, walk(np.random.default_rng(6), low, high, 25), faces_per_batch=4)


@needs_opengl
def test_the_guess_decides_nothing_where_two_faces_lie_at_one_depth(toy_scene: Scene, make: Make) -> None:
    """Each face a batch, each there twice with another instance, and any of them guessed: the same one must win everywhere."""
    twice = replace(
        toy_scene,
        faces=np.repeat(toy_scene.faces, 2, axis=0),
        face_material=np.repeat(toy_scene.face_material, 2),
        face_instance=np.stack([toy_scene.face_instance, np.roll(toy_scene.face_instance, 13)], 1).reshape(-1),
    )
    camera = PinholeCamera.from_hfov(81, 61, 90.0)
    everything = make("opengl frustum", twice, camera, faces_per_batch=1)
    rng = np.random.default_rng(8)
    for pose in walk(rng, np.array([-5.8, 1.2, -1.8]), np.array([5.8, 1.3, 1.8]), 12):
        frame = everything.render(pose)
        guessing = make("opengl", twice, camera, faces_per_batch=1)
        guessed = guessing._sets.at(pose[:3, 3])  # type: ignore[attr-defined]
        guessed[rng.random(len(guessed)) < 0.5] = True
        np.testing.assert_array_equal(guessing.render(pose).instance, frame.instance)
        guessing.close()


@needs_opengl
def test_pictures_of_a_house_of_scanned_size_are_the_same_to_the_last_bit(shared_scenes: Path, make: Make) -> None:
    scene = load_scene(f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}")
    low, high = scene.aabb
    margin = np.array([1.0, 0.0, 1.0])
    low, high = low + margin, high - margin
    low[1], high[1] = low[1] + 1.2, low[1] + 1.3
    same_pictures(make, scene, walk(np.random.default_rng(7), low, high, 20))
