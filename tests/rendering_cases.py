"""Scenes, poses and renderers that the tests of rendering share."""

from __future__ import annotations

import ctypes.util
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from openmap_env.rendering import Frame, Renderer, make_renderer
from openmap_scenes import Instance, Material, PinholeCamera, Scene
from openmap_scenes.scene import instance_boxes

NO_OSMESA = ctypes.util.find_library("OSMesa") is None
NO_EGL = ctypes.util.find_library("EGL") is None
needs_osmesa = pytest.mark.skipif(NO_OSMESA, reason="libosmesa6 is not installed")
needs_egl = pytest.mark.skipif(NO_EGL, reason="libegl1 is not installed")
needs_opengl = pytest.mark.skipif(NO_EGL and NO_OSMESA, reason="neither libegl1 nor libosmesa6 is installed")

RASTERISERS = [
    pytest.param("opengl egl", marks=needs_egl),
    pytest.param("opengl osmesa", marks=needs_osmesa),
    pytest.param("opengl frustum", marks=needs_opengl),
    pytest.param("pyrender", marks=needs_opengl),  # on the one platform that PyOpenGL is loaded for in this process
]
BACKENDS = [*RASTERISERS, "raycast"]
every_backend = pytest.mark.parametrize("backend", BACKENDS)
every_rasteriser = pytest.mark.parametrize("backend", RASTERISERS)

CAMERA = PinholeCamera(97, 71, 60.0, 55.0, 40.3, 37.7)  # odd sizes, off-centre, unequal focal lengths
Make = Callable[..., Renderer]


def open_backend(backend: str, scene: Scene, camera: PinholeCamera, **settings: object) -> Renderer:
    """make_renderer for one of ``BACKENDS``."""
    name, _, variant = backend.partition(" ")
    if variant:
        settings = {"culling" if variant == "frustum" else "platform": variant, **settings}
    return make_renderer(name, scene, camera, **settings)  # type: ignore[arg-type]


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


def differing(first: Frame, second: Frame) -> tuple[float, bool]:
    """Share of pixels whose ids differ, and whether each lies beside a border between two ids or depths of the first."""
    apart = first.instance != second.instance
    kernel = np.ones((3, 3), np.uint8)
    ids = first.instance.astype(np.float64)
    border = cv2.dilate(ids, kernel) != cv2.erode(ids, kernel)
    border |= cv2.dilate(first.depth, kernel) > 1.02 * cv2.erode(first.depth, kernel)
    return float(apart.mean()), not (apart & ~border).any()


def assert_same_as_reference(
    shown: list[Frame], reference: list[Frame], *, rgb_tolerance: float, depth_tolerance: float = 1e-3
) -> None:
    """Ids differ in under 0.2 % of pixels, all on borders; off edges depth is within 1 mm in 99.99 %, and colours are near."""
    for a, b in zip(shown, reference, strict=True):
        share, on_borders = differing(b, a)
        assert share < 2e-3
        assert on_borders
        flat = ~(on_edge(a) | on_edge(b))
        assert flat.any()
        # A step of some centimetres within one thing is no edge by that measure, and a ray may pass it on the other side.
        assert np.mean(np.abs(a.depth - b.depth)[flat] > depth_tolerance) < 1e-4
    colour = [np.abs(a.rgb.astype(int) - b.rgb)[~on_edge(b)] for a, b in zip(shown, reference, strict=True)]
    assert np.concatenate(colour).mean() < rgb_tolerance
