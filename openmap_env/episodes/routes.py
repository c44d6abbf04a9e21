"""A way told in words: which rooms a path leads through, where it turns, what it passes and on which side.

Only what is plain from the geometry is said: a turn that is clearly one, a side on which a thing clearly is. World frame, metres;
a path is (n, 3), spaced evenly by ``STEP``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.expressions import named, room_count, room_name
from openmap_env.episodes.relations import plan_gap
from openmap_env.episodes.vocabulary import vocabulary
from openmap_scenes import Instance, Scene

Path = npt.NDArray[np.float64]
Side = Literal["left", "right"]
Bend = Literal["left", "right", "straight"]

STEP = 0.1
PASSING = 1.2
"""A thing this close to the path, m on the floor plan, is passed."""
BRIEF = 5
"""A room that a path is in for fewer points than this is only grazed, and not said."""
MOST_ROOMS = 5
_CLEAR_TURN = (math.radians(50), math.radians(130))
_CLEAR_SIDE = math.radians(50)
_STRAIGHT = math.radians(20)


@dataclass(frozen=True)
class Landmark:
    """Something passed: its noun, the path's point next to it, and its side where that is clear."""

    noun: str
    at: int
    side: Side | None


@dataclass(frozen=True)
class Stretch:
    """The part of a path in one room: points ``first`` to ``last``, how one turns on entering, what may be said to be passed.

    ``door`` tells whether one leaves it through a door.
    """

    room: str | None
    first: int
    last: int
    bend: Bend | None
    landmarks: tuple[Landmark, ...]
    door: bool = False


def spaced(corners: Path, step: float = STEP) -> Path:
    """Points (n, 3) m every ``step`` m along corners (m, 3), both ends included."""
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(np.arange(0.0, along[-1], step), along[-1])
    return np.stack([np.interp(places, along, corners[:, axis]) for axis in range(3)], axis=1)


def rooms_along(scene: Scene, path: Path) -> list[str]:
    """The everyday names of the rooms that a path (n, 3) m leads through, in order; a room grazed for one point is left out."""
    return [room for room, _, _ in _runs(scene, path, brief=2)]


def _runs(scene: Scene, path: Path, brief: int) -> list[tuple[str, int, int]]:
    """(room, first point, last point) along the path; runs shorter than ``brief`` points are left out, then like ones joined."""
    names: list[str | None] = []
    for position in path:
        room = scene.room_of(position + np.array([0.0, 0.3, 0.0]))
        names.append(None if room is None else vocabulary().room(room.name))
    runs: list[tuple[str | None, int, int]] = []
    for i, name in enumerate(names):
        if runs and runs[-1][0] == name:
            runs[-1] = (name, runs[-1][1], i)
        else:
            runs.append((name, i, i))
    kept: list[tuple[str, int, int]] = []
    for name, first, last in runs:
        if name is None or (last - first + 1 < brief and len(path) > 1):
            continue
        if kept and kept[-1][0] == name:
            kept[-1] = (name, kept[-1][1], last)
        else:
            kept.append((name, first, last))
    return kept


def stretches(
    scene: Scene, path: Path, landmarks: Callable[[str, int, int], Sequence[Landmark]]
) -> list[Stretch] | None:
    """The path room by room, or None where it cannot be told: rooms come twice, or names that several rooms have."""
    runs = _runs(scene, path, BRIEF)
    names = [room for room, _, _ in runs]
    if not runs or runs[0][1] > 0 or len(path) - 1 - runs[-1][2] > BRIEF:
        return None
    if len(set(names)) < len(names) or len(names) > MOST_ROOMS or any(room_count(scene, n) > 1 for n in names[1:]):
        return None
    doors = named(scene, "door")
    return [
        Stretch(
            room,
            first,
            last,
            bend_at(path, first) if number else None,
            tuple(landmarks(room, first, last)),
            any(_touches(path[last - 2 : last + 5], door) for door in doors),
        )
        for number, (room, first, last) in enumerate(runs)
    ]


def _touches(points: Path, thing: Instance, reach: float = 0.35) -> bool:
    """Whether any of the points is within ``reach`` m of the thing's box on the floor plan, at its height."""
    outside = np.maximum(np.maximum(thing.aabb_min - points, points - thing.aabb_max), 0.0)
    return bool(np.any((np.hypot(outside[:, 0], outside[:, 2]) <= reach) & (outside[:, 1] <= 0.5)))


def bend_at(path: Path, at: int) -> Bend | None:
    """How a path bends at one of its points: clearly to one side, clearly not at all, or None."""
    near, far = _turn(path, at, 8), _turn(path, at, 14)
    if near is None or far is None:
        return None
    if max(abs(near), abs(far)) <= _STRAIGHT:
        return "straight"
    low, high = _CLEAR_TURN
    if low <= abs(near) <= high and low * 0.8 <= abs(far) <= high and near * far > 0:
        return "left" if near > 0 else "right"
    return None


def _turn(path: Path, at: int, reach: int) -> float | None:
    """The angle, radians, left positive, between the ways from ``reach`` points before to a point and on to as many after."""
    if at < 5 or at > len(path) - 6:
        return None
    before, after = path[at] - path[max(0, at - reach)], path[min(len(path) - 1, at + reach)] - path[at]
    return _angle(before, after)


def _angle(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> float:
    """The turn about +Y from direction a to direction b, radians, left positive."""
    return math.atan2(a[2] * b[0] - a[0] * b[2], a[0] * b[0] + a[2] * b[2])


def passed(
    scene: Scene, path: Path, things: Sequence[tuple[Instance, str]], room: str | None, first: int, last: int
) -> list[Landmark]:
    """What is passed between two points of a path: of (thing, noun), those that are the only one so called in that room.

    A thing is passed if the path first has it ahead, comes within ``PASSING``, and then leaves it behind.
    """
    found = []
    for thing, noun in things:
        if room is not None and room_name(scene, thing) != room:
            continue
        if len(named(scene, noun, room)) != 1:
            continue
        low, high = max(first, 6), min(last, len(path) - 12)
        if high - low < 4:
            continue
        points = path[low : high + 1]
        outside = np.maximum(np.maximum(thing.aabb_min - points, points - thing.aabb_max), 0.0)
        gap = np.hypot(outside[:, 0], outside[:, 2])
        near = np.flatnonzero(gap <= PASSING)
        if len(near) == 0:
            continue
        at = low + int(near[np.argmin(np.linalg.norm((points[near] - thing.centre)[:, [0, 2]], axis=1))])
        before, after = max(0, at - 8), min(len(path) - 1, at + 8)
        if _ahead(path, before, thing) > 0.2 > -0.2 > _ahead(path, after, thing):
            found.append(Landmark(noun, at, _side(path, at, thing)))
    return sorted(found, key=lambda mark: (mark.at, mark.noun))


def _ahead(path: Path, at: int, thing: Instance) -> float:
    """How far, m, the thing lies ahead of a point of the path, along the way there."""
    way = path[min(at + 3, len(path) - 1)] - path[max(at - 3, 0)]
    length = float(np.hypot(way[0], way[2]))
    off = thing.centre - path[at]
    return float((off[0] * way[0] + off[2] * way[2]) / length) if length > 0 else 0.0


def _side(path: Path, at: int, thing: Instance) -> Side | None:
    """The side on which a thing is passed, if it is clear: to the side at the point beside it, and on it before and after."""
    sides = []
    for point in (max(at - 4, 3), at, min(at + 4, len(path) - 4)):
        way = path[point + 3] - path[point - 3]
        sides.append(_angle(way, thing.centre - path[point]))
    if not (
        _CLEAR_SIDE <= abs(sides[1]) <= math.pi - _CLEAR_SIDE and sides[0] * sides[1] > 0 and sides[2] * sides[1] > 0
    ):
        return None
    return "left" if sides[1] > 0 else "right"


class Wording:
    """Puts the clauses of a way together.

    Parameters
    ----------
    patterns : dict
        Clauses by what they say (``data/patterns.json``).
    rng : np.random.Generator
    """

    def __init__(self, patterns: dict[str, list[str]], rng: np.random.Generator) -> None:
        self._patterns, self._rng = patterns, rng
        self._verbs: set[str] = set()

    def tell(self, way: Sequence[Stretch], ref: Callable[[bool], str], ends: str) -> tuple[str, dict[str, Any]] | None:
        """The instruction and what it says, as plain JSON; None where there is too little to say.

        ``ref`` gives the phrase for the goal, told whether its room has been said; ``ends`` is the group of end clauses
        that fit it.
        """
        marks, self._verbs = self._choose(way), set[str]()
        clauses: list[tuple[str, str]] = []
        for number, stretch in enumerate(way):
            mark = marks.get(number)
            if number:
                clauses.append(self._enter(stretch, on_the_way=number < len(way) - 1 and mark is None))
            if mark is not None:
                group = "pass" if mark.side is None else "pass_side"
                clauses.append(self._clause(group, landmark=f"the {mark.noun}", side=mark.side))
            if number == 0 and len(way) > 1:
                clauses.append(self._clause("leave_door" if stretch.door else "leave", room=stretch.room))
        if not clauses:
            return None
        # The last room may go without saying where the goal says it.
        last_said = len(way) > 1
        if last_said and len(clauses) > 1 and not marks.get(len(way) - 1) and self._rng.random() < 0.2:
            clauses, last_said = clauses[:-1], False
        group = ends if ends == "end_under" or (ends != "end" and self._rng.random() < 0.4) else "end"
        clauses.append(self._clause(group, ref=ref(last_said or len(way) == 1)))
        info = {
            "pattern": [pattern for pattern, _ in clauses],
            "landmarks": [asdict(marks[k]) for k in sorted(marks)],
        }
        return self._join([said for _, said in clauses]), info

    def _choose(self, way: Sequence[Stretch]) -> dict[int, Landmark]:
        """One or two things to mention, at most one a room; one at least where the way stays in one room and there is one."""
        options = [k for k, stretch in enumerate(way) if stretch.landmarks]
        most = 2 if len(way) == 2 and self._rng.random() < 0.3 else 1
        chosen = sorted(self._rng.permutation(len(options))[:most].tolist())
        marks = {}
        for k in (options[c] for c in chosen):
            if len(way) == 1 or self._rng.random() < 0.7:
                stretch = way[k]
                marks[k] = stretch.landmarks[int(self._rng.integers(len(stretch.landmarks)))]
        return marks

    def _enter(self, stretch: Stretch, on_the_way: bool) -> tuple[str, str]:
        if stretch.bend in ("left", "right"):
            return self._clause("turn", room=stretch.room, side=stretch.bend)
        if on_the_way:
            return self._clause("cross", room=stretch.room)
        return self._clause("straight" if stretch.bend == "straight" else "enter", room=stretch.room)

    def _clause(self, group: str, **words: str | None) -> tuple[str, str]:
        """A clause of the group, filled in: one that does not begin as an earlier one does, nor says "by ... by ..."."""
        options = self._patterns[group]
        near = any(f" {word} " in (words.get("ref") or "") for word in ("next to", "beside", "by"))
        options = [o for o in options if not (near and (" by " in o or " next to " in o))]
        options = [o for o in options if o.split()[0] not in self._verbs] or options
        pattern = options[int(self._rng.integers(len(options)))]
        self._verbs.add(pattern.split()[0])
        return pattern, pattern.format(**words)

    def _join(self, clauses: list[str]) -> str:
        """One sentence for up to three clauses, two for more."""
        if len(clauses) <= 3:
            return self._sentence(clauses)
        cut = (len(clauses) + 1) // 2
        then = "then " if self._rng.random() < 0.4 else ""
        rest = clauses[cut:]
        first = self._sentence(clauses[:cut], may_then=False)
        return f"{first} {self._sentence([then + rest[0], *rest[1:]], may_then=not then)}"

    def _sentence(self, clauses: list[str], may_then: bool = True) -> str:
        end = ", then " if may_then and self._rng.random() < 0.35 else " and "
        said = clauses[0] if len(clauses) == 1 else ", ".join(clauses[:-1]) + end + clauses[-1]
        return said[0].upper() + said[1:] + "."


def stands_free(thing: Instance, floor: float) -> bool:
    """Whether a thing is large enough, and low enough, to be noticed by who walks past."""
    extent = thing.aabb_max - thing.aabb_min
    wide, tall = float(max(extent[0], extent[2])), float(extent[1])
    return bool(thing.aabb_min[1] - floor < 0.4 and tall >= 0.35 and (wide >= 0.45 or tall >= 0.8))


def apart(goal: Instance, mark: Instance) -> bool:
    """Whether two things are far enough from each other that passing one is not yet reaching the other."""
    return plan_gap(goal, mark) > 0.6
