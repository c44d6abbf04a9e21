"""What an episode is scored by: one small class per measure, each a function of the walk that was made.

One more takes a few lines, and ``gym.make("OpenMapNav-v0", measures=(Backtracking(),))`` adds it to ``info["metrics"]``:

    @dataclass(frozen=True)
    class Backtracking:
        # The share of the walk that was spent where the body had been before, on a grid of 10 cm.
        name = "backtracking"
        needs_targets = False

        def value(self, walk: Walk) -> float:
            places = np.round(np.array(walk.path) / 0.1)
            return 1.0 - len(np.unique(places, axis=0)) / len(places)

The same walk gives the same numbers, so that two runs can be compared: the only measure that reads a clock, ``WallTime``, is not
among those of every episode; ``steps`` is the time that passed in the simulated world.

Positions are world frame, metres. A measure reads a ``Walk`` and gives a number; success counts as 1.0, failure as 0.0.
The answer of an episode is what the agent declared; an agent that stopped and declared nothing has declared where it stands
(on the floor); an agent that did neither gave no answer.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from openmap_env.coverage import covered_share
from openmap_env.episodes.episode import Target
from openmap_env.navigation.surface import DistanceField, NavigableSurface

SUCCESS_RADIUS = 1.0
"""Metres: the paper's success radius, used by every success measure."""
SR_KS = (1, 4, 8, 16)
COVERAGE_RADIUS = 2.0
"""Metres."""


@dataclass
class Walk:
    """What happened in an episode so far.

    Parameters
    ----------
    targets : tuple of Target
        Everything that satisfies the instruction.
    way : DistanceField or None
        Geodesic distance to the nearest place at which a body touches a target (``goals.way_to``); None = out of reach.
    path : list of (3,) float64 m
        Where the body stood, start first, one more a step.
    collisions : int
        Steps forward that were barred.
    declared : (k, 3) float64 m
        Declared places, best first.
    stopped : bool
        Whether the agent has played STOP.
    surface : NavigableSurface or None
        What it was made on; None leaves out what needs it.
    started : float
        When it began, s on ``time.perf_counter``.
    """

    targets: tuple[Target, ...]
    way: DistanceField | None
    path: list[npt.NDArray[np.float64]]
    collisions: int = 0
    declared: npt.NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    stopped: bool = False
    surface: NavigableSurface | None = None
    started: float = field(default_factory=time.perf_counter)

    @property
    def answer(self) -> npt.NDArray[np.float64]:
        """Places (k, 3) m, best first, that the agent answers with; k may be 0."""
        if len(self.declared) or not self.stopped:
            return self.declared
        return self.path[-1][None]

    def distance_to_target(self, position: npt.NDArray[np.float64]) -> float:
        """Geodesic metres from a position (3,) m to the nearest target; inf where there is no way."""
        return math.inf if self.way is None else self.way.distance(position)


class Measure(Protocol):
    """A name in ``info["metrics"]`` and how its number follows from a walk.

    One that reads ``walk.surface`` says so by ``needs_surface = True``.
    """

    @property
    def name(self) -> str: ...

    @property
    def needs_targets(self) -> bool:
        """Whether it says nothing about a walk without targets."""
        ...

    def value(self, walk: Walk) -> float: ...


@dataclass(frozen=True)
class SuccessAtK:
    """``sr_k``: one of the first k answers lies within 1.0 m (3-D) of the centre of a target's box: the paper's SR_k."""

    k: int
    needs_targets = True

    @property
    def name(self) -> str:
        return f"sr_{self.k}"

    def value(self, walk: Walk) -> float:
        centres = np.array([target.centre for target in walk.targets])
        off = np.linalg.norm(walk.answer[: self.k, None] - centres[None], axis=2)
        return float(np.any(off <= SUCCESS_RADIUS))


@dataclass(frozen=True)
class SurfaceSuccessAtK:
    """``sr_surface_k``: one of the first k answers lies within 1.0 m (3-D) of a target's box, or in it."""

    k: int
    needs_targets = True

    @property
    def name(self) -> str:
        return f"sr_surface_{self.k}"

    def value(self, walk: Walk) -> float:
        low = np.array([target.aabb_min for target in walk.targets])
        high = np.array([target.aabb_max for target in walk.targets])
        answers = walk.answer[: self.k, None]
        off = np.linalg.norm(np.maximum(np.maximum(low - answers, answers - high), 0.0), axis=2)
        return float(np.any(off <= SUCCESS_RADIUS))


@dataclass(frozen=True)
class DistanceToGoal:
    """``distance_to_goal``: geodesic metres from where the body stands to the nearest place at which it touches a target.

    Such a place is one of the navigable points nearest to the target's box on the floor plan, in the target's room
    (``goals.places_at``). inf where there is no way.
    """

    name = "distance_to_goal"
    needs_targets = True

    def value(self, walk: Walk) -> float:
        return walk.distance_to_target(walk.path[-1])


@dataclass(frozen=True)
class NavigationSuccess:
    """``nav_success``: the agent stopped, and ``distance_to_goal`` is at most 1.0 m."""

    name = "nav_success"
    needs_targets = True

    def value(self, walk: Walk) -> float:
        return float(walk.stopped and DistanceToGoal().value(walk) <= SUCCESS_RADIUS)


@dataclass(frozen=True)
class Spl:
    """``spl``: success weighted by path length, S * l / max(p, l) (Anderson et al. 2018, eq. 1).

    S is ``nav_success``, l the geodesic distance from the start to the nearest target, p the length walked. Since success leaves
    the last metre out and l does not, p may be shorter than l; spl is 1 then.
    """

    name = "spl"
    needs_targets = True

    def value(self, walk: Walk) -> float:
        if not NavigationSuccess().value(walk):
            return 0.0
        shortest, walked = walk.distance_to_target(walk.path[0]), PathLength().value(walk)
        return 1.0 if walked <= shortest else shortest / walked


@dataclass(frozen=True)
class PathLength:
    """``path_length``: metres walked."""

    name = "path_length"
    needs_targets = False

    def value(self, walk: Walk) -> float:
        return float(np.linalg.norm(np.diff(np.array(walk.path), axis=0), axis=1).sum())


@dataclass(frozen=True)
class Steps:
    """``steps``: actions played, STOP included."""

    name = "steps"
    needs_targets = False

    def value(self, walk: Walk) -> float:
        return float(len(walk.path) - 1)


@dataclass(frozen=True)
class Collisions:
    """``collisions``: steps forward that were barred."""

    name = "collisions"
    needs_targets = False

    def value(self, walk: Walk) -> float:
        return float(walk.collisions)


@dataclass(frozen=True)
class Coverage:
    """``coverage``: share of the floor that it began on, within 2.0 m of where the body stood, in plain sight.

    The floor is the island of the navigable surface that holds the start, by area. In plain sight is what a straight line over
    that surface reaches, so nothing behind a wall, and nothing behind furniture that stands on the floor
    (``coverage.covered_cells``).
    """

    name = "coverage"
    needs_targets = False
    needs_surface = True

    def value(self, walk: Walk) -> float:
        assert walk.surface is not None
        return covered_share(walk.surface, walk.path, COVERAGE_RADIUS)


@dataclass(frozen=True)
class WallTime:
    """``wall_time``: seconds since the episode began, the agent's own included. Differs from run to run: only where asked for."""

    name = "wall_time"
    needs_targets = False

    def value(self, walk: Walk) -> float:
        return time.perf_counter() - walk.started


def default_measures() -> tuple[Measure, ...]:
    """Every measure that ``info["metrics"]`` holds."""
    return (
        *(SuccessAtK(k) for k in SR_KS),
        *(SurfaceSuccessAtK(k) for k in SR_KS),
        NavigationSuccess(),
        Spl(),
        DistanceToGoal(),
        PathLength(),
        Steps(),
        Collisions(),
        Coverage(),
    )


def score(walk: Walk, measures: Sequence[Measure] | None = None, extra: Sequence[Measure] = ()) -> dict[str, float]:
    """The measures of a walk by name, and ``extra`` ones; without targets or surface, only those that need none.

    Raises
    ------
    ValueError
        Two measures have one name, or one gives no number.
    """
    chosen = (*(default_measures() if measures is None else measures), *extra)
    names = [m.name for m in chosen]
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise ValueError(f"several measures are called {', '.join(twice)}, expected a name of its own for each")
    return {
        m.name: _number(m, walk)
        for m in chosen
        if (walk.targets or not m.needs_targets)
        and (walk.surface is not None or not getattr(m, "needs_surface", False))
    }


def _number(measure: Measure, walk: Walk) -> float:
    value = measure.value(walk)
    if not isinstance(value, int | float | np.number | np.bool_):
        raise ValueError(f"the measure {measure.name} gave {str(value)[:80]!r}, expected a number")
    return float(value)
