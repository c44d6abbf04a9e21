"""What every renderer must show, by arithmetic, and what it promises to its caller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rendering_cases import (
    CAMERA,
    PLAIN,
    Make,
    cluttered_room,
    every_backend,
    indoor_poses,
    look,
    open_backend,
    scene_of,
    wall,
)

from openmap_scenes import Instance, Material, PinholeCamera, Scene


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    size=st.tuples(st.integers(1, 60), st.integers(1, 60)),
    focal=st.tuples(st.floats(20, 80), st.floats(20, 80)),
    centre=st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2)),
    yaw=st.floats(-0.4, 0.4),
    pitch=st.floats(-0.4, 0.4),
)
@every_backend
def test_any_pinhole_sees_a_wall_where_arithmetic_puts_it(
    backend: str,
    size: tuple[int, int],
    focal: tuple[float, float],
    centre: tuple[float, float],
    yaw: float,
    pitch: float,
) -> None:
    camera = PinholeCamera(*size, *focal, centre[0] * size[0], centre[1] * size[1])
    scene = scene_of([wall(-40, 0.3, -2, 3), wall(0.3, 40, -2, 5)], PLAIN)
    scene.vertices[:, 1] *= 5
    T = look(np.array([0.1, -0.2, 0.3]), yaw, pitch)
    renderer = open_backend(backend, scene, camera, far=1000.0)
    frame = renderer.render(T)
    renderer.close()
    rays = camera.rays().astype(np.float64) @ T[:3, :3].T
    depth = (-2.0 - T[2, 3]) / rays[..., 2]
    x = T[0, 3] + depth * rays[..., 0]
    y = T[1, 3] + depth * rays[..., 1]
    (low_x, low_y, _), (high_x, high_y, _) = scene.vertices.min(0) + 1e-2, scene.vertices.max(0) - 1e-2
    on_the_wall = (low_x < x) & (x < high_x) & (low_y < y) & (y < high_y)
    seen = (depth > 0.1) & (depth < 20) & on_the_wall
    np.testing.assert_allclose(frame.depth[seen], depth[seen], rtol=1e-3)
    sure = seen & (np.abs(x - 0.3) > 1e-3 * depth)
    np.testing.assert_array_equal(frame.instance[sure], np.where(x < 0.3, 3, 5)[sure])


@every_backend
def test_textures_lie_the_right_way_up_and_are_multiplied(make: Make, backend: str) -> None:
    quadrants = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    texture = quadrants.repeat(11, 0).repeat(9, 1)  # 18 wide: rows of 54 bytes
    material = Material("flag", np.array([1.0, 0.5, 1.0], np.float32), texture)
    square: list[list[float]] = [[-1, 1, -1], [1, 1, -1], [1, -1, -1], [-1, -1, -1]]
    scene = scene_of([(square, 0, 7)], [material], colour=(255, 255, 102))
    rgb = make(backend, scene, PinholeCamera(40, 40, 20, 20, 19.5, 19.5)).render(np.eye(4)).rgb
    expected = quadrants * np.array([1.0, 0.5, 0.4])
    np.testing.assert_allclose(rgb[10:40:20, 10:40:20], expected, atol=1.5)
    scene.uv[:] *= 2  # type: ignore[index]
    rgb = make(backend, scene, PinholeCamera(40, 40, 20, 20, 19.5, 19.5)).render(np.eye(4)).rgb
    np.testing.assert_allclose(rgb[5:20:10, 5:20:10], expected, atol=1.5)
    np.testing.assert_allclose(rgb[25:40:10, 25:40:10], expected, atol=1.5)


@every_backend
def test_faces_are_seen_from_both_sides(make: Make, backend: str) -> None:
    frames = [
        make(backend, scene_of([wall(-9, 9, -2, 4)], PLAIN, flip=flip), CAMERA).render(np.eye(4))
        for flip in (False, True)
    ]
    for frame in frames:
        assert (frame.instance == 4).all()
        assert (frame.rgb == (51, 102, 204)).all()
        np.testing.assert_allclose(frame.depth, 2.0, atol=1e-4)


@every_backend
def test_an_empty_view_is_black_and_zero(make: Make, backend: str) -> None:
    scene = scene_of([wall(-9, 9, -2, 4)], PLAIN)
    frame = make(backend, scene, CAMERA).render(look(np.zeros(3), np.pi, 0.0))
    assert not frame.rgb.any()
    assert not frame.depth.any()
    assert not frame.instance.any()


@every_backend
def test_near_and_far_cut_by_planar_depth(make: Make, backend: str) -> None:
    scene = scene_of([wall(-1, 0, -0.2, 1), wall(-99, 99, -3, 2), wall(-99, 99, -6, 3)], PLAIN)
    renderer = make(backend, scene, CAMERA, near=0.3, far=5.0)
    assert set(np.unique(renderer.render(np.eye(4)).instance)) == {2}
    behind = np.eye(4)
    behind[2, 3] = -3.5
    assert set(np.unique(renderer.render(behind).instance)) == {3}
    behind[2, 3] = 20.0
    assert set(np.unique(renderer.render(behind).depth)) == {0.0}


@every_backend
def test_ids_of_any_size_survive(make: Make, backend: str) -> None:
    ids = [1, 255, 256, 16_777_217, 2_147_483_647]
    scene = scene_of([wall(i - 2.5, i - 1.5, -2, n) for i, n in enumerate(ids)], PLAIN)
    frame = make(backend, scene, PinholeCamera(50, 3, 20, 20, 24.5, 1)).render(np.eye(4))
    assert frame.instance[1, 5::10].tolist() == ids


@every_backend
def test_scenes_of_all_makes_are_shown(make: Make, backend: str) -> None:
    """Faces without texture coordinates, without an id, without area, of vertex colours alone; a single triangle."""
    camera = PinholeCamera(41, 31, 20.0, 20.0, 20.0, 15.0)
    plain = scene_of([wall(-9, 0, -2, 0), wall(0, 9, -2, 6)], PLAIN, colour=(255, 128, 0))
    plain = replace(plain, uv=None, faces=np.concatenate([plain.faces, [[0, 0, 0], [0, 1, 1], [0, 1, 0]]]).astype(np.int32),
                    face_material=np.append(plain.face_material, [0, 0, 0]).astype(np.int32),
                    face_instance=np.append(plain.face_instance, [6, 6, 6]).astype(np.int32))  # fmt: skip
    frame = make(backend, plain, camera).render(np.eye(4))
    assert (frame.instance[:, :20] == 0).all()
    assert (frame.instance[:, 21:] == 6).all()
    assert (frame.depth[:, :20] > 1.9).all()
    np.testing.assert_allclose(frame.rgb[5, 5], (51, 51, 0), atol=1)
    quad = scene_of([wall(-9, 9, -2, 3)], PLAIN)
    single = replace(
        quad, faces=quad.faces[:1], face_material=quad.face_material[:1], face_instance=quad.face_instance[:1]
    )
    frame = make(backend, single, camera).render(np.eye(4))
    assert set(np.unique(frame.instance)) == {0, 3}
    assert np.array_equal(frame.instance > 0, frame.depth > 0)


@every_backend
@pytest.mark.parametrize("size", [(1, 1), (1, 3), (517, 333), (64, 4096)])
def test_textures_of_any_size_are_shown(make: Make, backend: str, size: tuple[int, int]) -> None:
    across = np.linspace(0, 255, size[1]).astype(np.uint8) if size[1] > 1 else np.array([90], np.uint8)
    texture = np.repeat(np.tile(across, (size[0], 1))[..., None], 3, 2)
    square: list[list[float]] = [[-1, 1, -1], [1, 1, -1], [1, -1, -1], [-1, -1, -1]]
    scene = scene_of([(square, 0, 7)], [Material("ramp", np.ones(3, np.float32), texture)])
    rgb = make(backend, scene, PinholeCamera(33, 33, 16.5, 16.5, 16, 16)).render(np.eye(4)).rgb
    expected = 90.0 if size[1] == 1 else 255 * (16.5 + np.arange(-8, 9)) / 33
    if size[1] != 3:  # of which there is nothing between the texels that a ramp would match
        np.testing.assert_allclose(rgb[16, 8:25, 0], np.broadcast_to(expected, 17), atol=5)
    assert (rgb[..., 0] == rgb[..., 1]).all()


@every_backend
def test_thousands_of_materials_keep_their_colours(make: Make, backend: str) -> None:
    shades = np.stack([np.arange(16_000) % 251, np.arange(16_000) // 251, np.full(16_000, 9)], 1)
    materials = [Material(str(i), (shade / 255).astype(np.float32)) for i, shade in enumerate(shades)]
    x = np.repeat(np.arange(16_000) * 0.1, 3).astype(np.float32)
    corner = np.tile(np.array([[-0.2, -0.2], [0.3, -0.2], [0.05, 0.4]], np.float32), (16_000, 1)) * 0.2
    vertices = np.stack([x + corner[:, 0], corner[:, 1], np.full(48_000, -0.2, np.float32)], 1)
    ids = np.ones(16_000, np.int32)
    box = (vertices.mean(0), vertices.min(0), vertices.max(0))
    scene = Scene("many", vertices, np.arange(48_000, dtype=np.int32).reshape(-1, 3), np.arange(16_000, dtype=np.int32),
                  ids, materials, [Instance(1, "thing", *box)])  # fmt: skip
    renderer = make(backend, scene, PinholeCamera(3, 3, 30.0, 30.0, 1.0, 1.0))
    for number in (0, 255, 256, 257, 4_100, 15_999):
        rgb = renderer.render(look(np.array([number * 0.1 + 0.01, 0.0, 0.0]), 0.0, 0.0)).rgb
        np.testing.assert_allclose(rgb[1, 1], shades[number], atol=1)


@every_backend
def test_a_frame_is_the_callers_own(make: Make, backend: str) -> None:
    scene = cluttered_room(3)
    first_pose, second_pose = indoor_poses(scene, 2, 3)
    renderer = make(backend, scene, CAMERA)
    first = renderer.render(first_pose)
    before = [a.copy() for a in (first.rgb, first.depth, first.instance)]
    second = renderer.render(second_pose)
    second.rgb[:], second.depth[:], second.instance[:] = 1, 2, 3
    again = renderer.render(first_pose)
    for kept, now, was in zip(
        (first.rgb, first.depth, first.instance), (again.rgb, again.depth, again.instance), before, strict=True
    ):
        np.testing.assert_array_equal(kept, was)
        np.testing.assert_array_equal(now, was)
        assert kept.flags.c_contiguous
        assert kept.flags.writeable
    assert (first.rgb.dtype, first.depth.dtype, first.instance.dtype) == (np.uint8, np.float32, np.int32)
    assert (first.rgb.shape, first.depth.shape, first.instance.shape) == ((71, 97, 3), (71, 97), (71, 97))


@every_backend
def test_a_closed_renderer_says_so_and_closes_again(make: Make, backend: str) -> None:
    renderer = make(backend, scene_of([wall(-9, 9, -2, 4)], PLAIN), CAMERA)
    renderer.close()
    renderer.close()
    with pytest.raises(RuntimeError, match="closed"):
        renderer.render(np.eye(4))


@every_backend
def test_poses_that_are_none_are_refused(make: Make, backend: str) -> None:
    renderer = make(backend, scene_of([wall(-9, 9, -2, 4)], PLAIN), CAMERA)
    for bad, message in ((np.eye(3), "shape"), (np.full((4, 4), np.nan), "finite"), (2 * np.eye(4), "rigid")):
        with pytest.raises(ValueError, match=message):
            renderer.render(bad)
    with pytest.raises(ValueError, match="near and far"):
        make(backend, renderer.scene, CAMERA, near=2.0, far=1.0)
