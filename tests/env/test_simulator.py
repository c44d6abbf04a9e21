"""The body in a home: poses, steps, collisions, and what it asks of a renderer."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from openmap_env.actions import Action
from openmap_env.navigation import Body, NavigableSurface
from openmap_env.rendering import Frame
from openmap_env.simulator import PITCH_LIMIT, Simulator
from openmap_scenes import Material, PinholeCamera, Scene

CAMERA = PinholeCamera.from_hfov(8, 6, 90)


class CountingRenderer:
    """Answers with the number of the call, and remembers the poses."""

    def __init__(self, scene: Scene, camera: PinholeCamera) -> None:
        self.scene, self.camera = scene, camera
        self.poses: list[npt.NDArray[np.floating]] = []
        self.closed = 0

    def render(self, T_world_camera: npt.NDArray[np.floating]) -> Frame:
        self.poses.append(T_world_camera)
        size = (self.camera.height, self.camera.width)
        return Frame(
            np.full((*size, 3), len(self.poses), np.uint8), np.ones(size, np.float32), np.zeros(size, np.int32)
        )

    def close(self) -> None:
        self.closed += 1


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A floor of 4 x 4 m at y = 1 without walls."""
    vertices = np.array([[0, 1, 0], [4, 1, 0], [4, 1, 4], [0, 1, 4]], np.float32)
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)
    none = np.zeros(2, np.int32)
    return Scene("slab", vertices, faces, none, none, [Material("grey", np.full(3, 0.5, np.float32))], [])


@pytest.fixture
def simulator(scene: Scene) -> Simulator:
    return Simulator(scene, CAMERA, renderer=CountingRenderer(scene, CAMERA))


def test_zero_heading_looks_along_minus_z_and_left_is_positive(simulator: Simulator) -> None:
    simulator.reset([2, 1.05, 2], 0.0)
    assert simulator.position == pytest.approx([2, 1, 2])
    assert not simulator.step(Action.MOVE_FORWARD)
    assert simulator.position == pytest.approx([2, 1, 1.75])
    for _ in range(6):
        assert not simulator.step(Action.TURN_LEFT)
    assert simulator.heading == pytest.approx(math.pi / 2)
    simulator.step(Action.MOVE_FORWARD)
    assert simulator.position == pytest.approx([1.75, 1, 1.75])
    simulator.step(Action.TURN_RIGHT)
    assert simulator.heading == pytest.approx(math.radians(75))


def test_camera_pose_is_body_pose_raised_and_pitched(simulator: Simulator) -> None:
    simulator.reset([2, 1, 2], math.pi / 2)
    assert simulator.T_world_camera[:3, 3] == pytest.approx([2, 2.25, 2])
    assert -simulator.T_world_camera[:3, 2] == pytest.approx([-1, 0, 0])
    simulator.step(Action.LOOK_UP)
    a = math.radians(15)
    assert -simulator.T_world_camera[:3, 2] == pytest.approx([-math.cos(a), math.sin(a), 0])
    assert simulator.T_world_camera[:3, 0] == pytest.approx([0, 0, -1])
    R = simulator.T_world_camera[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1)
    assert -simulator.T_world_body[:3, 2] == pytest.approx([-1, 0, 0])
    assert simulator.T_world_camera.dtype == simulator.T_world_body.dtype == np.float64


def test_pitch_is_clamped_and_heading_wraps(simulator: Simulator) -> None:
    simulator.reset([2, 1, 2], 3.0)
    for _ in range(9):
        simulator.step(Action.LOOK_DOWN)
    assert simulator.pitch == -PITCH_LIMIT
    for _ in range(24):
        simulator.step(Action.TURN_LEFT)
    assert simulator.heading == pytest.approx(3.0)
    simulator.reset([2, 1, 2], 0.0)
    assert simulator.pitch == 0


def test_a_step_over_the_edge_is_a_collision(simulator: Simulator) -> None:
    simulator.reset([2, 1, 0.6], 0.0)
    collided = [simulator.step(Action.MOVE_FORWARD) for _ in range(4)]
    assert collided == [False, True, True, True]
    assert simulator.position[2] == pytest.approx(0.2, abs=simulator.surface.grid.cell)


def test_a_frame_is_rendered_once_a_pose(simulator: Simulator) -> None:
    renderer = simulator.renderer
    assert isinstance(renderer, CountingRenderer)
    simulator.reset([2, 1, 2], 0.0)
    first = simulator.observe()
    simulator.step(Action.STOP)
    assert simulator.observe() is first
    simulator.step(Action.TURN_LEFT)
    assert simulator.observe().rgb[0, 0, 0] == 2
    simulator.reset([2, 1, 2], 0.0)
    assert simulator.observe().rgb[0, 0, 0] == 3
    assert np.array_equal(renderer.poses[2], simulator.T_world_camera)
    simulator.close()
    assert renderer.closed == 1


def test_what_cannot_be_done_is_said(simulator: Simulator, scene: Scene) -> None:
    fresh = Simulator(scene, CAMERA, renderer=simulator.renderer, surface=simulator.surface)
    with pytest.raises(RuntimeError, match="call reset"):
        fresh.step(Action.MOVE_FORWARD)
    with pytest.raises(ValueError, match="not navigable in slab"):
        fresh.reset([9, 1, 9], 0.0)
    with pytest.raises(ValueError, match="finite radians"):
        fresh.reset([2, 1, 2], math.nan)
    fresh.reset([2, 1, 2], 0.0)
    with pytest.raises(ValueError, match="1 MOVE_FORWARD"):
        fresh.step(6)
    with pytest.raises(ValueError, match="forward_step"):
        Simulator(scene, CAMERA, renderer=simulator.renderer, surface=simulator.surface, forward_step=0)
    with pytest.raises(ValueError, match="was made for"):
        Simulator(scene, CAMERA, renderer=simulator.renderer, surface=simulator.surface, body=Body(radius=0.3))


def test_the_same_actions_give_the_same_bytes(scene: Scene) -> None:
    poses = []
    for _ in range(2):
        renderer = CountingRenderer(scene, CAMERA)
        simulator = Simulator(scene, CAMERA, renderer=renderer, surface=NavigableSurface.from_scene(scene))
        rng = np.random.default_rng(7)
        simulator.reset(simulator.surface.random_point(rng), rng.uniform(-math.pi, math.pi))
        for action in rng.integers(1, 6, 200):
            simulator.step(int(action))
        poses.append(simulator.T_world_camera.tobytes())
    assert poses[0] == poses[1]
