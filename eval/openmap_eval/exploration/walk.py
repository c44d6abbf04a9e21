"""One walk of the explorer through a scene, and what could be seen on it.

What counts is what can be asked for: the things that ``openmap_env.episodes`` makes instructions of, which are visible from
somewhere on the main floor and are no part of the building. The explorer is given depth and poses; ids are for measuring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.exploration import Explorer, ExplorerSettings
from openmap_env.episodes.benchmark import frozen_home
from openmap_env.episodes.referring import Things
from openmap_env.episodes.source import evenly
from openmap_env.navigation import NavigableSurface
from openmap_env.settings import Start
from openmap_env.simulator import Simulator
from openmap_scenes import PinholeCamera, Scene

REFERENCE_PIXELS = 640 * 480
"""Pixel thresholds are said for pictures of this size."""
MOVED, TURNED = 0.01, math.radians(1.0)
"""Less than this, m and radians, is standing still."""
LOITERING = 0.3
"""Steps that end within this distance of where a run of them began are spent in one place, m."""


@dataclass(frozen=True)
class WalkSettings:
    """What a walk's figures depend on, beside scene and start."""

    pixels: int = 400
    width: int = 160
    height: int = 120
    max_steps: int = 1500
    renderer: str = "raycast"
    seed: int = 0
    explorer: ExplorerSettings = field(default_factory=ExplorerSettings)

    @property
    def enough(self) -> int:
        """Pixels of a thing in one picture that show it, at this walk's size."""
        return max(1, round(self.pixels * self.width * self.height / REFERENCE_PIXELS))


@dataclass(frozen=True)
class Walked:
    """What came of a walk; plain numbers, for JSON.

    Parameters
    ----------
    scene : str
    start : int
        Which of the scene's starts.
    area : float
        Floor of the home, m2.
    steps : int
        Actions until the explorer was done, or its budget spent.
    done : bool
        It ended by itself.
    seen_at : dict of str to int
        Instance id of each thing that counts -> steps after which it was first seen well, -1 = never.
    categories : dict of str to str
        Of the same.
    most : dict of str to int
        Most pixels seen of each in one picture.
    still, loitered : int
        Longest run of steps without moving or turning; longest run of steps within ``LOITERING`` m, the look around at the
        start left out.
    path : float
        Length of the walk, m.
    """

    scene: str
    start: int
    area: float
    steps: int
    done: bool
    seen_at: dict[str, int]
    categories: dict[str, str]
    most: dict[str, int]
    still: int
    loitered: int
    path: float

    def coverage(self, steps: float) -> float:
        """Share of the things seen after so many steps."""
        at = np.array(list(self.seen_at.values()))
        return float(np.mean((at >= 0) & (at <= steps))) if len(at) else 1.0

    @property
    def missed(self) -> list[str]:
        """What was never seen well: category and most pixels, by id."""
        return [f"{self.categories[i]} ({self.most[i]} px)" for i, at in self.seen_at.items() if at < 0]


def things_asked_for(scene: Scene, surface: NavigableSurface) -> dict[int, str]:
    """Id -> category of everything that an instruction may be about (``openmap_env.episodes``), by id."""
    by_kind = Things(scene, surface).by_kind
    return dict(sorted((thing.id, thing.category) for things in by_kind.values() for thing in things))


def floor_area(scene: Scene, surface: NavigableSurface) -> float:
    """Floor of a home, m2: that of its rooms' boxes, overlaps once; without rooms what a body can stand on."""
    boxes = [(r.level, *r.aabb_min[[0, 2]].tolist(), *r.aabb_max[[0, 2]].tolist()) for r in scene.rooms]
    if not boxes:
        return float(surface.grounded_areas.max())
    cell, total = 0.1, 0.0
    low = np.min([b[1:3] for b in boxes], axis=0)
    size = np.ceil((np.max([b[3:5] for b in boxes], axis=0) - low) / cell).astype(int) + 1
    for level in sorted({b[0] for b in boxes}):
        mask = np.zeros(size, bool)
        for _, x0, z0, x1, z1 in (b for b in boxes if b[0] == level):
            i0, k0, i1, k1 = np.round((np.array([x0, z0, x1, z1]) - np.tile(low, 2)) / cell).astype(int)
            mask[i0:i1, k0:k1] = True
        total += float(mask.sum()) * cell * cell
    return total


def starts_of(spec: str, surface: NavigableSurface, n: int, seed: int) -> list[Start]:
    """Where walks begin: at the benchmark's starts, evenly over its kinds, or at drawn places of the main floor."""
    home = frozen_home(spec)
    if home is not None:
        return [(e.start_position, e.start_heading) for e in evenly(home.episodes(), n)]
    rng = np.random.default_rng(seed)
    drawn = [(surface.random_point(rng).tolist(), float(rng.uniform(-math.pi, math.pi))) for _ in range(n)]
    return [((x, y, z), heading) for (x, y, z), heading in drawn]


def simulator_of(scene: Scene, settings: WalkSettings) -> Simulator:
    """The body and the camera that walk."""
    camera = PinholeCamera.from_hfov(settings.width, settings.height, 90.0)
    return Simulator(scene, camera, renderer=settings.renderer)


def explorer_of(simulator: Simulator, settings: WalkSettings) -> Explorer:
    """The explorer for that body, as an agent has it."""
    walker = replace(
        settings.explorer.walker,
        forward=simulator.forward_step,
        turn_deg=math.degrees(simulator.turn),
        tilt_deg=math.degrees(simulator.look),
    )
    walker = replace(walker, planner=replace(walker.planner, body_radius=simulator.body.radius))
    explorer = replace(settings.explorer, walker=walker, max_steps=settings.max_steps)
    return Explorer(explorer, np.random.default_rng(settings.seed))


def walk(spec: str, number: int, start: Start, simulator: Simulator, settings: WalkSettings) -> Walked:
    """Explore until the explorer is done, and measure."""
    scene, explorer = simulator.scene, explorer_of(simulator, settings)
    things = things_asked_for(scene, simulator.surface)
    most = np.zeros(max((i.id for i in scene.instances), default=0) + 1, np.int64)
    seen_at = np.full(len(most), -1, np.int64)
    simulator.reset(*start)
    T_episode_world = np.linalg.inv(simulator.T_world_body)
    poses: list[tuple[float, float, float]] = []
    while True:
        frame = simulator.observe()
        counts = np.bincount(frame.instance.ravel(), minlength=len(most))[: len(most)]
        most = np.maximum(most, counts)
        seen_at[(seen_at < 0) & (counts >= settings.enough)] = len(poses)
        x, _, z = simulator.position.tolist()
        poses.append((x, z, simulator.heading))
        explorer.update(frame.depth, T_episode_world @ simulator.T_world_camera, simulator.camera)
        action = explorer.next_action()
        if action is None:
            break
        simulator.step(action)
    at = np.array(poses)
    return Walked(
        scene=spec,
        start=number,
        area=round(floor_area(scene, simulator.surface), 2),
        steps=explorer.steps,
        done=explorer.steps < settings.max_steps,
        seen_at={str(i): int(seen_at[i]) for i in things},
        categories={str(i): category for i, category in things.items()},
        most={str(i): int(most[i]) for i in things},
        still=longest_still(at),
        loitered=longest_loitering(at, explorer.look_around),
        path=round(float(np.hypot(*np.diff(at[:, :2], axis=0).T).sum()), 2),
    )


def longest_still(poses: npt.NDArray[np.float64]) -> int:
    """Longest run of steps that changed neither place nor heading; poses (n, 3) are x, z in m and heading in radians."""
    change = np.diff(poses, axis=0)
    turned = np.abs(np.arctan2(np.sin(change[:, 2]), np.cos(change[:, 2])))
    return _longest_run((np.hypot(change[:, 0], change[:, 1]) < MOVED) & (turned < TURNED))


def longest_loitering(poses: npt.NDArray[np.float64], first: int) -> int:
    """Longest run of steps, after the first few, that stayed within ``LOITERING`` m of where the run began."""
    longest, begin = 0, min(first, len(poses) - 1)
    for k in range(begin, len(poses)):
        if math.hypot(*(poses[k, :2] - poses[begin, :2])) > LOITERING:
            begin = k
        longest = max(longest, k - begin)
    return longest


def _longest_run(flags: npt.NDArray[np.bool_]) -> int:
    longest = run = 0
    for flag in flags.tolist():
        run = run + 1 if flag else 0
        longest = max(longest, run)
    return longest


def as_walked(raw: dict[str, Any]) -> Walked:
    """A walk as it was kept; TypeError where it is none."""
    return Walked(**raw)
