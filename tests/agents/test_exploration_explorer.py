"""The explorer sees a whole home, stops by itself and gets out of places where nothing moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from openmap_agents.exploration import FREE, Explorer, ExplorerSettings
from openmap_env.actions import Action
from openmap_env.rendering.raycast import RaycastRenderer
from openmap_env.simulator import Simulator
from openmap_scenes import Instance, Material, PinholeCamera, Scene

CAMERA = PinholeCamera.from_hfov(80, 60, 90.0)


@pytest.fixture(scope="module")
def simulator(two_rooms):
    simulator = Simulator(two_rooms, CAMERA, renderer=RaycastRenderer(two_rooms, CAMERA, threads=1))
    yield simulator
    simulator.close()


def explore(simulator, settings=None, start=(-1.5, 0.0, -1.0), heading=1.0):
    """Walk until the explorer is done; the explorer, its actions, most pixels of each instance, episode-to-world."""
    explorer, actions, seen = Explorer(settings, np.random.default_rng(0)), [], {}
    simulator.reset(start, heading)
    T_world_episode = simulator.T_world_body
    while True:
        frame = simulator.observe()
        for i, n in zip(*np.unique(frame.instance, return_counts=True), strict=True):
            seen[int(i)] = max(seen.get(int(i), 0), int(n))
        explorer.update(frame.depth, np.linalg.inv(T_world_episode) @ simulator.T_world_camera, CAMERA)
        action = explorer.next_action()
        if action is None:
            return explorer, actions, seen, T_world_episode
        actions.append(action)
        simulator.step(action)


def test_two_rooms_are_covered_and_the_explorer_stops_by_itself(simulator, two_rooms):
    explorer, actions, seen, T_world_episode = explore(simulator)
    assert explorer.done
    assert len(actions) < 300
    assert len(explorer.trajectory) == len(actions) + 1
    things = [i for i in two_rooms.instances if i.category in ("bed", "table", "refrigerator")]
    assert all(seen[i.id] > 100 for i in things)
    floor = simulator.surface.centres[simulator.surface.island == 0]
    T_episode_world = np.linalg.inv(T_world_episode)
    cells = explorer.occupancy.cells(floor @ T_episode_world[:3, :3].T + T_episode_world[:3, 3])
    assert np.mean(explorer.occupancy.grid[cells[:, 0], cells[:, 1]] == FREE) > 0.97


def test_the_same_walk_comes_of_the_same_seed(simulator):
    settings = ExplorerSettings(max_steps=60)
    assert explore(simulator, settings)[1] == explore(simulator, settings)[1]


def test_steps_are_not_overspent(simulator):
    assert len(explore(simulator, ExplorerSettings(max_steps=17))[1]) == 17


def test_an_explorer_that_has_seen_nothing_says_what_to_call():
    with pytest.raises(ValueError, match="call update first"):
        Explorer().next_action()


def test_a_body_that_does_not_move_marks_what_bars_it_and_turns_away():
    explorer = Explorer(rng=np.random.default_rng(1))
    walker, T = explorer.walker, np.eye(4)
    T[1, 3] = 1.25
    rays = CAMERA.rays()
    depth = np.where(rays[..., 1] < 0, 1.25 / np.maximum(-rays[..., 1], 1e-9), 0.0)
    actions = []
    for _ in range(150):
        explorer.update(depth, T, CAMERA)  # glass all around: much to see, and the body never moves
        action = explorer.next_action()
        if action is None:
            break
        actions.append(action)
        turn = {Action.TURN_LEFT: 1, Action.TURN_RIGHT: -1}.get(action, 0) * math.radians(15.0)
        tilt = {Action.LOOK_UP: 1, Action.LOOK_DOWN: -1}.get(action, 0) * math.radians(15.0)
        c, s, cp, sp = (f(a) for a in (walker.heading + turn, walker.pitch + tilt) for f in (math.cos, math.sin))
        T[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    forward = [a == Action.MOVE_FORWARD for a in actions]
    assert any(forward)
    assert explorer.occupancy.bumped.any()
    longest = max(len(run) for run in "".join("F" if f else " " for f in forward).split())
    assert longest <= walker.settings.patience


def boxes_scene(boxes):
    meshes = [trimesh.creation.box(bounds=(low, high)) for _, low, high in boxes]
    first = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    owner = np.repeat(np.arange(len(boxes)), [len(m.faces) for m in meshes]).astype(np.int32)
    return Scene(
        name="boxes",
        vertices=np.concatenate([m.vertices for m in meshes]).astype(np.float32),
        faces=np.concatenate([m.faces + f for m, f in zip(meshes, first, strict=False)]).astype(np.int32),
        face_material=np.zeros(len(owner), np.int32),
        face_instance=owner + np.int32(1),
        materials=[Material("grey", np.full(3, 0.5, np.float32))],
        instances=[
            Instance(n, name, (np.array(low) + high) / 2, np.array(low), np.array(high))
            for n, (name, low, high) in enumerate(boxes, start=1)
        ],
        source="boxes:0",
    )


def shell(low_x, low_z, high_x, high_z):
    a, b, c, d = low_x, low_z, high_x, high_z
    walls = [(a - 0.1, b, a, d), (c, b, c + 0.1, d), (a, b - 0.1, c, b), (a, d, c, d + 0.1)]
    return [
        ("floor", (a, -0.1, b), (c, 0.0, d)),
        ("ceiling", (a, 2.5, b), (c, 2.6, d)),
        *(("wall", (x0, 0.0, z0), (x1, 2.5, z1)) for x0, z0, x1, z1 in walls),
    ]


def walked_through(boxes, start, heading):
    scene = boxes_scene(boxes)
    simulator = Simulator(scene, CAMERA, renderer=RaycastRenderer(scene, CAMERA, threads=1))
    try:
        return explore(simulator, ExplorerSettings(max_steps=500), start, heading)
    finally:
        simulator.close()


def test_a_door_of_80_cm_in_the_side_of_a_corridor_is_gone_through():
    # A corridor along x; the room beyond it has its only door at the corridor's far end, in its side.
    wall = [("wall", (-4.0, 0.0, -0.05), (2.4, 2.5, 0.05)), ("wall", (3.2, 0.0, -0.05), (4.0, 2.5, 0.05))]
    hidden = ("bed", (-4.0, 0.0, 2.0), (-2.2, 0.5, 3.0))
    boxes = [*shell(-4.0, -1.4, 4.0, 3.0), *wall, hidden]
    explorer, _, seen, _ = walked_through(boxes, (-3.4, 0.0, -0.7), -math.pi / 2)
    assert explorer.done
    assert seen[len(boxes)] > 100


def test_a_trap_in_the_shape_of_a_u_is_walked_out_of():
    # The body starts inside of a U that opens away from the thing.
    trap = [
        ("wall", (0.5, 0.0, -1.0), (0.6, 2.5, 1.0)),
        ("wall", (-1.5, 0.0, -1.1), (0.6, 2.5, -1.0)),
        ("wall", (-1.5, 0.0, 1.0), (0.6, 2.5, 1.1)),
    ]
    boxes = [*shell(-3.5, -2.5, 3.5, 2.5), *trap, ("table", (2.2, 0.0, -0.4), (3.0, 0.7, 0.4))]
    explorer, actions, seen, _ = walked_through(boxes, (0.0, 0.0, 0.0), -math.pi / 2)
    assert explorer.done
    assert len(actions) < 400
    assert seen[len(boxes)] > 100
