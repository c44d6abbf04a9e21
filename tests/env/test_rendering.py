"""The three renderers show the same thing, and what a pinhole camera must see by arithmetic."""

from __future__ import annotations

import ctypes.util
import gc
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from openmap_env.rendering import RENDERERS, Frame, Renderer, RendererUnavailableError, context, make_renderer
from openmap_scenes import Instance, Material, PinholeCamera, Scene, load_scene
from openmap_scenes.scene import instance_boxes

NO_OSMESA = ctypes.util.find_library("OSMesa") is None
NO_EGL = ctypes.util.find_library("EGL") is None
needs_osmesa = pytest.mark.skipif(NO_OSMESA, reason="libosmesa6 is not installed")
needs_egl = pytest.mark.skipif(NO_EGL, reason="libegl1 is not installed")
BACKENDS = [pytest.param(name, marks=needs_osmesa if name == "pyrender" else ()) for name in RENDERERS]
every_backend = pytest.mark.parametrize("backend", BACKENDS)

CAMERA = PinholeCamera(97, 71, 60.0, 55.0, 40.3, 37.7)  # odd sizes, off-centre, unequal focal lengths
Make = Callable[..., Renderer]


@pytest.fixture
def make() -> Iterator[Make]:
    """make_renderer, with everything closed at the end."""
    opened: list[Renderer] = []

    def open_one(*args: object, **kwargs: object) -> Renderer:
        opened.append(make_renderer(*args, **kwargs))  # type: ignore[arg-type]
        return opened[-1]

    yield open_one
    for renderer in opened:
        renderer.close()


def scene_of(
    quads: list[tuple[list[list[float]], int, int]],
    materials: list[Material],
    colour: tuple[int, int, int] | None = None,
    flip: bool = False,
) -> Scene:
    """A scene of quads, each four corners in order, a material and an instance; texture corners go round with them."""
    vertices = np.array([corner for corners, _, _ in quads for corner in corners], np.float32)
    faces = np.concatenate([[[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]] for i in range(len(quads))])
    face_instance = np.repeat([q[2] for q in quads], 2).astype(np.int32)
    boxes = instance_boxes(vertices, faces, face_instance)
    return Scene(
        name="quads",
        vertices=vertices,
        faces=np.ascontiguousarray(faces[:, ::-1] if flip else faces, np.int32),
        face_material=np.repeat([q[1] for q in quads], 2).astype(np.int32),
        face_instance=face_instance,
        materials=materials,
        instances=[Instance(i, "thing", (low + high) / 2, low, high) for i, (low, high) in sorted(boxes.items())],
        uv=np.tile(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32), (len(quads), 1)),
        vertex_colour=None if colour is None else np.tile(np.array(colour, np.uint8), (len(vertices), 1)),
    )


def wall(left: float, right: float, z: float, instance: int, material: int = 0) -> tuple[list[list[float]], int, int]:
    """An upright quad across the view of a camera at the origin."""
    return [[left, 9, z], [right, 9, z], [right, -9, z], [left, -9, z]], material, instance


PLAIN = [Material("plain", np.array([0.2, 0.4, 0.8], np.float32))]


def box_quads(
    low: np.ndarray, high: np.ndarray, material: int, instance: int
) -> list[tuple[list[list[float]], int, int]]:
    quads = []
    for axis in range(3):
        for side in (low, high):
            corners = np.tile(side, (4, 1)).astype(float)
            a, b = (axis + 1) % 3, (axis + 2) % 3
            corners[:, a], corners[:, b] = [low[a], high[a], high[a], low[a]], [low[b], low[b], high[b], high[b]]
            quads.append((corners.tolist(), material, instance))
    return quads


def cluttered_room(seed: int) -> Scene:
    """A room with twenty boxes in it, smooth textures of three sizes (one of odd width), tinted and untextured materials."""
    rng = np.random.default_rng(seed)

    def smooth(h: int, w: int) -> np.ndarray:
        return cv2.resize(rng.integers(0, 256, (5, 5, 3)).astype(np.uint8), (w, h), interpolation=cv2.INTER_LINEAR)

    textures = [smooth(64, 64), smooth(45, 31), None, smooth(64, 64), smooth(32, 96)]
    materials = [Material(str(i), rng.uniform(0.3, 1, 3).astype(np.float32), t) for i, t in enumerate(textures)]
    quads = box_quads(np.array([-3, 0, -2.5]), np.array([3, 2.6, 2.5]), 0, 1)
    for i in range(20):
        centre, half = rng.uniform([-2.6, 0.3, -2.1], [2.6, 2.2, 2.1]), rng.uniform(0.05, 0.25, 3)
        quads += box_quads(centre - half, centre + half, int(rng.integers(5)), 2 + i)
    return scene_of(quads, materials, colour=(250, 200, 230))


def look(position: np.ndarray, yaw: float, pitch: float) -> np.ndarray:
    """T_world_camera at a place, turned left by yaw and up by pitch, radians."""
    T = np.eye(4)
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    T[:3, :3] = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    T[:3, 3] = position
    return T


def indoor_poses(scene: Scene, n: int, seed: int) -> list[np.ndarray]:
    """Poses at 1 to 1.6 m above the floor, somewhere in a room, a little off its walls."""
    rng = np.random.default_rng(seed)
    boxes = [(room.aabb_min, room.aabb_max) for room in scene.rooms] or [scene.aabb]
    poses = []
    for _ in range(n):
        low, high = boxes[rng.integers(len(boxes))]
        position = rng.uniform(low + 0.15 * (high - low), high - 0.15 * (high - low))
        position[1] = low[1] + rng.uniform(1.0, 1.6)
        poses.append(look(position, rng.uniform(0, 2 * np.pi), rng.uniform(-0.6, 0.4)))
    return poses


def frames(renderer: Renderer, poses: list[np.ndarray]) -> list[Frame]:
    return [renderer.render(T) for T in poses]


def on_edge(frame: Frame) -> np.ndarray:
    """Pixels within two of a step: a 3 x 3 neighbourhood that holds two ids or whose depths differ by over 5 %, grown by one."""
    kernel = np.ones((3, 3), np.uint8)
    ids = frame.instance.astype(np.float32)
    step = cv2.dilate(frame.depth, kernel) > 1.05 * cv2.erode(frame.depth, kernel)
    step |= cv2.dilate(ids, kernel) != cv2.erode(ids, kernel)
    return cv2.dilate(step.astype(np.uint8), kernel) > 0


def assert_agree(first: list[Frame], second: list[Frame], rgb_tolerance: float) -> None:
    """Depth within 1 mm (mean) and colours within a mean of ``rgb_tolerance`` levels off edges; ids in 99.9 % of all pixels."""
    depth, colour, ids = [], [], []
    for a, b in zip(first, second, strict=True):
        flat = ~(on_edge(a) | on_edge(b))
        depth.append(np.abs(a.depth - b.depth)[flat])
        colour.append(np.abs(a.rgb.astype(int) - b.rgb)[flat])
        ids.append(a.instance != b.instance)
    assert sum(map(len, depth)) > 0.3 * sum(x.size for x in ids)
    assert np.concatenate(depth).mean() < 1e-3
    assert np.concatenate(colour).mean() < rgb_tolerance
    assert np.mean(ids) < 1e-3
    assert np.mean([np.mean(f.depth > 0) for f in first]) > 0.9


@pytest.mark.parametrize("seed", [0, 1])
@needs_osmesa
def test_renderers_agree_in_random_rooms(make: Make, seed: int) -> None:
    scene = cluttered_room(seed)
    poses = indoor_poses(scene, 20, seed)
    opengl, pyrender, raycast = (frames(make(name, scene, CAMERA), poses) for name in RENDERERS)
    assert_agree(opengl, pyrender, rgb_tolerance=0.05)
    assert_agree(opengl, raycast, rgb_tolerance=1.5)
    assert np.unique(np.stack([f.instance for f in opengl])).size > 15


@needs_osmesa
def test_renderers_agree_in_a_house(make: Make, shared_scenes: Path) -> None:
    scene = load_scene(f"mp3d:{shared_scenes}/mp3d/aws_small_house")
    poses = indoor_poses(scene, 20, 0)
    camera = PinholeCamera(160, 120, 90.0, 95.0, 70.3, 66.1)
    opengl, pyrender, raycast = (frames(make(name, scene, camera), poses) for name in RENDERERS)
    assert_agree(opengl, pyrender, rgb_tolerance=0.05)
    assert_agree(opengl, raycast, rgb_tolerance=5.0)  # without mipmaps, distant textures are noisy
    assert np.unique(np.stack([f.instance for f in opengl])).size > 30


@pytest.mark.parametrize("platform", [pytest.param("egl", marks=needs_egl), pytest.param("osmesa", marks=needs_osmesa)])
def test_a_platform_can_be_forced_and_shows_the_same(
    make: Make, platform: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, poses = cluttered_room(2), indoor_poses(cluttered_room(2), 3, 2)
    forced = make("opengl", scene, CAMERA, platform=platform)
    assert forced.platform == platform  # type: ignore[attr-defined]
    monkeypatch.setenv("OPENMAP_GL", platform)
    assert make("opengl", scene, CAMERA).platform == platform  # type: ignore[attr-defined]
    raycast = make("raycast", scene, CAMERA)
    assert_agree(frames(forced, poses), frames(raycast, poses), rgb_tolerance=1.5)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
    renderer = make_renderer(backend, scene, camera, far=1000.0)
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


@needs_osmesa
def test_renderers_live_side_by_side_and_outlive_each_other(make: Make) -> None:
    scenes = [cluttered_room(seed) for seed in (4, 5)]
    poses = indoor_poses(scenes[0], 3, 4)
    kinds = [("opengl", {}), ("pyrender", {}), ("opengl", {"platform": "osmesa"}), ("raycast", {}), ("pyrender", {})]
    alone = []
    for i, (name, extra) in enumerate(kinds):
        renderer = make(name, scenes[i % 2], CAMERA, **extra)
        alone.append(frames(renderer, poses))
        renderer.close()
    together = [make(name, scenes[i % 2], CAMERA, **extra) for i, (name, extra) in enumerate(kinds)]
    for k, T in enumerate(poses):
        for i, renderer in enumerate(together):
            if k == 2 and i == 0:
                together[1].close()
            if k == 2 and i == 1:
                continue
            np.testing.assert_array_equal(renderer.render(T).rgb, alone[i][k].rgb)
            np.testing.assert_array_equal(renderer.render(T).instance, alone[i][k].instance)


@needs_osmesa
@pytest.mark.parametrize("order", ["opengl pyrender", "pyrender opengl"])
def test_backends_load_in_either_order_in_a_fresh_process(order: str) -> None:
    script = f"""
        import numpy as np
        from openmap_env.rendering import make_renderer
        from openmap_scenes import Instance, Material, PinholeCamera, Scene
        corners = np.array([[-9, -9, -2], [9, -9, -2], [0, 20, -2]], np.float32)
        one, box = np.zeros(1, np.int32), (corners.mean(0), corners.min(0), corners.max(0))
        scene = Scene("one", corners, np.array([[0, 1, 2]], np.int32), one, one + 6,
                      [Material("grey", np.full(3, 0.5, np.float32))], [Instance(6, "thing", *box)])
        for name in "{order} {order}".split():
            renderer = make_renderer(name, scene, PinholeCamera(32, 24, 20, 20, 15.5, 11.5))
            frame = renderer.render(np.eye(4))
            assert (frame.instance == 6).all() and (frame.rgb == 128).all() and abs(frame.depth - 2).max() < 1e-3, name
        print("left open, closed by the end of the process")
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@every_backend
def test_three_hundred_frames_take_no_memory(make: Make, backend: str) -> None:
    scene = cluttered_room(6)
    poses = indoor_poses(scene, 10, 6)
    renderer = make(backend, scene, CAMERA)
    growth = _growth_mb(lambda i: renderer.render(poses[i % 10]), warm_up=60, repeats=300)
    assert growth < 5.0


@every_backend
def test_opening_and_closing_takes_no_memory(backend: str) -> None:
    scene = cluttered_room(7)

    def once(_: int) -> None:
        renderer = make_renderer(backend, scene, CAMERA)
        renderer.render(np.eye(4))
        renderer.close()

    assert _growth_mb(once, warm_up=4, repeats=8) < 8.0


def _growth_mb(work: Callable[[int], object], warm_up: int, repeats: int) -> float:
    """Growth of resident memory, MB, over repeats of some work after a warm-up."""
    process = psutil.Process()
    for i in range(warm_up):
        work(i)
    gc.collect()
    before = process.memory_info().rss
    for i in range(repeats):
        work(i)
    gc.collect()
    return float(process.memory_info().rss - before) / 1e6


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


def test_an_unknown_renderer_is_named_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"'vulkan', expected one of opengl, pyrender, raycast"):
        make_renderer("vulkan", scene_of([wall(-9, 9, -2, 4)], PLAIN), CAMERA)


def test_a_missing_library_is_reported_with_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of([wall(-9, 9, -2, 4)], PLAIN)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: f"lib{name}-is-not-here.so")
    with pytest.raises(RendererUnavailableError, match=r"libegl1.*libosmesa6"):
        make_renderer("opengl", scene, CAMERA)
    with pytest.raises(RendererUnavailableError, match="libosmesa6"):
        context.osmesa_library()
    with pytest.raises(ValueError, match="expected auto, egl or osmesa"):
        make_renderer("opengl", scene, CAMERA, platform="x11")
