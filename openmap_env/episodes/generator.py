"""Episodes for any home with semantics: three kinds of instruction, in words people use, with everything that satisfies them.

An object goal names a thing, by looks, size, room or neighbour where the name alone is not enough. A demand says what a person
needs; whatever serves the need counts. A guided instruction follows a real shortest path through the rooms. What an instruction
means is always found by testing every instance of the scene, never remembered from how it was made.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.demands import demands
from openmap_env.episodes.episode import KINDS, Episode, Kind, Target, target_of
from openmap_env.episodes.expressions import Expression
from openmap_env.episodes.referring import Phrases, Things
from openmap_env.episodes.routes import Landmark, Stretch, Wording, passed, rooms_along, spaced, stretches
from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_env.goals import way_to
from openmap_env.navigation.surface import DistanceField, NavigableSurface
from openmap_scenes import DataError, Instance, Scene

logger = logging.getLogger(__name__)
T = TypeVar("T")

MAX_SERVING = 6
"""A need that more things serve than this is too easy to ask."""
MIN_WAY = 1.5
"""Starts are at least this far, m of way, from every target,"""
MIN_GAP = 1.05
"""and this far, m, from its box: who stands still must not succeed."""
MAX_TRIES = 60
STARTS = 6
"""Starts tried for one guided goal: finding the ways to a goal costs more than looking at where they begin."""
PURPOSEFUL = 0.2
"""How often an object goal says what for, where the kind of thing has such sentences."""

_Made = tuple["_Question", npt.NDArray[np.float64], float]


@dataclass(frozen=True)
class _Question:
    """An instruction before it has a start: its words, what satisfies it, and what to note in ``Episode.info``."""

    instruction: str
    targets: tuple[Target, ...]
    info: dict[str, Any]


def generate_episodes(
    scene: Scene,
    scene_spec: str,
    surface: NavigableSurface,
    n: int,
    rng: np.random.Generator,
    kinds: Sequence[Kind] = KINDS,
) -> list[Episode]:
    """Make ``n`` episodes, the kinds in turn; the same arguments give the same episodes.

    No instruction comes twice, so a small home may give fewer; the log says so. Starts lie on the main island of the surface,
    from where at least one target can be reached. ``Episode.info`` holds the pattern, the expression or need, the geodesic
    distance to the nearest target, and of a guided way its rooms, landmarks and ``reference_path`` (corners, world frame, m).

    Raises
    ------
    DataError
        The scene has nothing to ask for.
    ValueError
        A kind is unknown, or n is negative.
    """
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown or not kinds or n < 0:
        raise ValueError(f"asked for {n} episodes of kinds {list(kinds)}, expected n >= 0 and kinds among {KINDS}")
    if n == 0:
        return []
    generator = _Generator(scene, surface, rng)
    episodes: list[Episode] = []
    for number in range(n):
        kind = kinds[number % len(kinds)]
        made = generator.episode(kind)
        if made is None:
            continue
        question, position, heading = made
        name = f"{scene.name}-{kind}-{number:04d}"
        episodes.append(
            Episode(
                name,
                scene_spec,
                question.instruction,
                kind,
                _triple(position),
                heading,
                question.targets,
                question.info,
            )
        )
    if not episodes:
        found = f"{len(generator.things.seen)} things that can be asked for"
        raise DataError(scene_spec, found, "a home in which an instruction has a reachable target")
    if len(episodes) < n:
        made_of = ", ".join(f"{sum(e.kind == kind for e in episodes)} {kind}" for kind in kinds)
        logger.warning("%s: made %d of %d episodes (%s): found no more to ask", scene_spec, len(episodes), n, made_of)
    return episodes


class _Generator:
    """One scene's things and what has been asked of them so far."""

    def __init__(self, scene: Scene, surface: NavigableSurface, rng: np.random.Generator) -> None:
        self.scene, self.surface, self.rng = scene, surface, rng
        self.things = Things(scene, surface)
        self.phrases = Phrases(self.things, rng)
        self.patterns: dict[str, Any] = load_data("patterns.json")
        self.purposes: dict[str, list[str]] = load_data("purposes.json")
        self.wording = Wording(self.patterns["language_guided"], rng)
        self.demands = demands(scene, self.things.all, MAX_SERVING)
        seen = {i.id for i in self.things.seen}
        self.demands = [[d for d in options if any(i.id in seen for i in d.things)] for options in self.demands]
        self.demands = [options for options in self.demands if options]
        self.asked: set[str] = set()
        self._meant: dict[str, int] = {}
        self._ways: dict[tuple[int, ...], DistanceField | None] = {}

    def episode(self, kind: Kind) -> _Made | None:
        """A question of that kind not asked before and a start for it, or None where none was found."""
        if not self.things.seen:
            return None
        for attempt in range(MAX_TRIES):
            if kind == "language_guided":
                made = self._guided()
            else:
                question = self._object_goal() if kind == "object_goal" else self._demand()
                made = None if question is None else self._with_start(question)
            if made is None or made[0].instruction in self.asked:
                continue
            # The same meaning again in other words, only once nothing else is found.
            meaning = f"{kind} {made[0].info.get('expression', made[0].info.get('need'))}"
            if self._meant.get(meaning, 0) > attempt // 12:
                continue
            self.asked.add(made[0].instruction)
            self._meant[meaning] = self._meant.get(meaning, 0) + 1
            return made
        return None

    def _pick(self, options: Sequence[T]) -> T:
        return options[int(self.rng.integers(len(options)))]

    def _way(self, targets: tuple[Target, ...]) -> DistanceField | None:
        key = tuple(target.instance_id for target in targets)
        if key not in self._ways:
            self._ways[key] = way_to(self.surface, self.scene, targets, island=0)
        return self._ways[key]

    def _with_start(self, question: _Question) -> _Made | None:
        way = self._way(question.targets)
        if way is None:
            return None
        for _ in range(MAX_TRIES):
            position = self.surface.random_point(self.rng)
            distance = way.distance(position)
            if _far(position, distance, question.targets):
                info = {**question.info, "geodesic_distance": distance}
                heading = float(self.rng.uniform(-math.pi, math.pi))
                return _Question(question.instruction, question.targets, info), position, heading
        return None

    def _targets(self, expression: Expression) -> tuple[Target, ...]:
        return tuple(target_of(i) for i in expression.matches(self.scene))

    # Object goals

    def _object_goal(self) -> _Question | None:
        thing = self._pick(self.things.by_kind[self._pick(sorted(self.things.by_kind))])
        expression = self.phrases.of(thing)
        if expression is None:
            return None
        targets = self._targets(expression)
        purposes = self.purposes.get(vocabulary().kind(thing.category), [])
        if purposes and self.rng.random() < PURPOSEFUL:
            pattern = self._pick(purposes)
        else:
            pattern = self._pick(self.patterns["object_goal"]["one" if len(targets) == 1 else "several"])
        verb = "are" if vocabulary().number(expression.noun) == "many" else "is"
        instruction = pattern.format(ref=expression.say(self.scene), **{"is": verb})
        return _Question(instruction, targets, {"pattern": pattern, "expression": expression.to_json()})

    # Demands

    def _demand(self) -> _Question | None:
        if not self.demands:
            return None
        demand = self._pick(self._pick(self.demands))
        pattern = self._pick(self.patterns["demand"])
        instruction = pattern.format(need=demand.said(), need_inside=demand.said_inside())
        info = {"pattern": pattern, "need": demand.need.name, "sentence": demand.sentence}
        if demand.room is not None:
            info["room"] = demand.room
        return _Question(instruction, tuple(target_of(i) for i in demand.things), info)

    # Guided instructions

    def _guided(self) -> _Made | None:
        thing = self._pick(self.things.by_kind[self._pick(sorted(self.things.by_kind))])
        room = self.things.room(thing)
        # Who is led into the room looks for the thing there: it has to stand out among its like in that room alone.
        expression = self.phrases.of(thing, within=room)
        if expression is None:
            return None
        targets = self._targets(expression)
        way = self._way(targets) if len(targets) == 1 else None
        if way is None:
            return None
        for _ in range(STARTS):
            position = self.surface.random_point(self.rng)
            distance = way.distance(position)
            if not _far(position, distance, targets):
                continue
            corners = way.path(position)
            told = self._tell(thing, expression, spaced(corners))
            if told is None:
                continue
            text, info = told
            info = {
                "expression": expression.to_json(),
                **info,
                "reference_path": corners.tolist(),
                "geodesic_distance": distance,
            }
            return _Question(text, targets, info), position, self._setting_off(spaced(corners))
        return None

    def _setting_off(self, path: npt.NDArray[np.float64]) -> float:
        """Looking along the way, give or take, as someone about to leave does."""
        ahead = path[min(10, len(path) - 1)] - path[0]
        heading = math.atan2(-ahead[0], -ahead[2]) + float(self.rng.uniform(-0.4, 0.4))
        return math.remainder(heading, math.tau)

    def _tell(
        self, thing: Instance, expression: Expression, path: npt.NDArray[np.float64]
    ) -> tuple[str, dict[str, Any]] | None:
        """The way in words and what to note of it, or None if it cannot be told."""
        marks = self.things.landmarks(thing, expression)

        def landmarks(room: str | None, first: int, last: int) -> list[Landmark]:
            return passed(self.scene, path, marks, room, first, last)

        if self.things.room(thing) is None:
            at_hand = [m for m in landmarks(None, 0, len(path) - 1) if self._at_hand(m, marks, path)]
            way: list[Stretch] | None = [Stretch(None, 0, len(path) - 1, None, tuple(at_hand))]
        else:
            way = stretches(self.scene, path, landmarks)
        if (
            way is None
            or way[-1].room != self.things.room(thing)
            or rooms_along(self.scene, path)[:1] != _names(way)[:1]
        ):
            return None
        told = self.wording.tell(
            way, lambda room_said: expression.say(self.scene, not room_said), self.things.end_of(thing)
        )
        return None if told is None else (told[0], {"rooms": _names(way), **told[1]})

    def _at_hand(self, mark: Landmark, marks: Sequence[tuple[Instance, str]], path: npt.NDArray[np.float64]) -> bool:
        """Whether few steps lead from the path to the thing: where rooms have no names, a wall may part them."""
        thing = next(i for i, noun in marks if noun == mark.noun)
        way = self._way((target_of(thing),))
        return way is not None and way.distance(path[mark.at]) <= 1.8


def _far(position: npt.NDArray[np.float64], distance: float, targets: Sequence[Target]) -> bool:
    """Whether a start (3,) m, ``distance`` m of way from the targets, can reach them and is not yet there."""
    gaps = (
        np.maximum(np.maximum(np.subtract(t.aabb_min, position), np.subtract(position, t.aabb_max)), 0.0)
        for t in targets
    )
    return MIN_WAY <= distance < math.inf and all(float(np.linalg.norm(gap)) > MIN_GAP for gap in gaps)


def _names(way: Sequence[Stretch]) -> list[str]:
    return [stretch.room for stretch in way if stretch.room is not None]


def _triple(v: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
