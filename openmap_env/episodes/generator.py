"""Episodes for any home with semantics: three kinds of instruction, in words people use, with everything that satisfies them.

An object goal names a thing, by colour, room or neighbour where the name alone is not enough. A demand says what a person needs;
whatever serves the need counts. A guided instruction follows a real shortest path through the rooms. What an instruction means is
always found by testing every instance of the scene (``expressions``, ``vocabulary``), never remembered from how it was made.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.episode import KINDS, Episode, Kind, Target
from openmap_env.episodes.expressions import (
    Expression,
    Relation,
    RelationName,
    is_clear,
    plan_gap,
    related,
    room_name,
    with_article,
)
from openmap_env.episodes.readers import target_of
from openmap_env.episodes.vocabulary import load_data, needs, vocabulary
from openmap_env.goals import way_to
from openmap_env.navigation.surface import DistanceField, NavigableSurface
from openmap_scenes import DataError, Instance, Scene

logger = logging.getLogger(__name__)
T = TypeVar("T")

MAX_TARGETS = 10
"""An instruction that more things satisfy than this is too easy to ask."""
MIN_WAY = 1.5
"""Starts are at least this far, m of way, from every target if the home is large enough."""
MAX_TRIES = 60
PASSING = 1.0
"""A thing this close to the path, m on the floor plan, is passed."""


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
    from where at least one target can be reached. ``Episode.info`` holds the expression or need, the rooms of a guided path and
    the geodesic distance to the nearest target.

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
    if n and not episodes:
        found = f"{len(generator.things)} things that can be asked for"
        raise DataError(scene_spec, found, "a home in which an instruction has a reachable target")
    if len(episodes) < n:
        made_of = ", ".join(f"{sum(e.kind == kind for e in episodes)} {kind}" for kind in kinds)
        logger.warning("%s: made %d of %d episodes (%s): found no more to ask", scene_spec, len(episodes), n, made_of)
    return episodes


class _Generator:
    """One scene's things and what has been asked of them so far."""

    def __init__(self, scene: Scene, surface: NavigableSurface, rng: np.random.Generator) -> None:
        self.scene, self.surface, self.rng = scene, surface, rng
        words = vocabulary()
        self.things = [i for i in scene.instances if not words.is_structure(i.category)]
        self.by_kind: dict[str, list[Instance]] = {}
        for thing in self.things:
            self.by_kind.setdefault(words.kind(thing.category), []).append(thing)
        self.patterns: dict[str, Any] = load_data("patterns.json")
        self.asked: set[str] = set()
        self._ways: dict[tuple[int, ...], DistanceField | None] = {}

    def episode(self, kind: Kind) -> tuple[_Question, npt.NDArray[np.float64], float] | None:
        """A question of that kind not asked before and a start for it, or None where none was found."""
        if not self.things:
            return None
        for _ in range(MAX_TRIES):
            if kind == "language_guided":
                made = self._guided()
            else:
                question = self._object_goal() if kind == "object_goal" else self._demand()
                made = None if question is None else self._with_start(question)
            if made is not None and made[0].instruction not in self.asked:
                self.asked.add(made[0].instruction)
                return made
        return None

    def _pick(self, options: Sequence[T]) -> T:
        return options[int(self.rng.integers(len(options)))]

    def _way(self, targets: tuple[Target, ...]) -> DistanceField | None:
        key = tuple(target.instance_id for target in targets)
        if key not in self._ways:
            self._ways[key] = way_to(self.surface, self.scene, targets, island=0)
        return self._ways[key]

    def _with_start(self, question: _Question) -> tuple[_Question, npt.NDArray[np.float64], float] | None:
        way = self._way(question.targets)
        if way is None:
            return None
        for attempt in range(MAX_TRIES):
            position = self.surface.random_point(self.rng)
            distance = way.distance(position)
            if math.isfinite(distance) and (distance >= MIN_WAY or attempt == MAX_TRIES - 1):
                info = {**question.info, "geodesic_distance": distance}
                return _Question(question.instruction, question.targets, info), position, self._heading()
        return None

    def _heading(self) -> float:
        return float(self.rng.uniform(-math.pi, math.pi))

    # Object goals

    def _object_goal(self) -> _Question | None:
        thing = self._pick(self.by_kind[self._pick(sorted(self.by_kind))])
        expression = self._expression(thing)
        if expression is None:
            return None
        instruction = self._pick(self.patterns["object_goal"]).format(ref=expression.say(self.scene))
        return _Question(instruction, self._targets(expression), {"expression": expression.to_json()})

    def _expression(self, thing: Instance) -> Expression | None:
        """A phrase that is true of the thing: its name if that says enough, or with what sets it apart from its like."""
        plain = Expression(self._pick(vocabulary().sayable(thing.category)))
        options = [e for e in [plain, *self._refined(thing, plain.noun)] if is_clear(self.scene, e)]
        counts = [len(e.matches(self.scene)) for e in options]
        options = [e for e, count in zip(options, counts, strict=True) if 1 <= count <= MAX_TARGETS]
        unique = [e for e in options if len(e.matches(self.scene)) == 1]
        if plain in unique:
            # The name alone is enough; now and then people say more all the same.
            return plain if self.rng.random() < 0.6 else self._pick_sort(unique)
        if unique and self.rng.random() < 0.7:
            return self._pick_sort(unique)
        return self._pick_sort(options) if options else None

    def _pick_sort(self, options: Sequence[Expression]) -> Expression:
        """One of the phrases, the sorts (by name, looks, room, neighbour) being as likely as each other."""
        sorts: dict[tuple[bool, bool, bool], list[Expression]] = {}
        for e in options:
            looks = e.colour is not None or e.material is not None
            sorts.setdefault((looks, e.room is not None, e.relation is not None), []).append(e)
        return self._pick(sorts[self._pick(sorted(sorts))])

    def _refined(self, thing: Instance, noun: str) -> list[Expression]:
        colour, material = thing.attributes.get("colour"), thing.attributes.get("material")
        room = room_name(self.scene, thing)
        refined = [Expression(noun, colour=colour)] if colour else []
        refined += [Expression(noun, material=material)] if material else []
        refined += [Expression(noun, room=room)] if room else []
        refined += [Expression(noun, colour=colour, room=room)] if colour and room else []
        return refined + [Expression(noun, relation=r) for r in self._relations(thing, noun)]

    def _relations(self, thing: Instance, noun: str) -> list[Relation]:
        """What may be said of where the thing is, by each kind of thing around it, nearest first."""
        words = vocabulary()
        around = sorted((i for i in self.things if i.id != thing.id), key=lambda i: (plan_gap(thing, i), i.id))
        relations: list[Relation] = []
        names: tuple[RelationName, ...] = ("on", "next to", "above")
        for other in around[:8]:
            anchor = words.sayable(other.category)[0]
            if words.is_a(thing.category, anchor) or words.is_a(other.category, noun):
                continue
            for name in names:
                relation = Relation(name, anchor)
                if relation not in relations and related(self.scene, thing, relation):
                    relations.append(relation)
        return relations

    def _targets(self, expression: Expression) -> tuple[Target, ...]:
        return tuple(target_of(i) for i in expression.matches(self.scene))

    # Demands

    def _demand(self) -> _Question | None:
        served = [(need, [i for i in self.things if need.serves(i.category)]) for need in needs()]
        served = [(need, things) for need, things in served if 1 <= len(things) <= MAX_TARGETS]
        if not served:
            return None
        need, things = self._pick(served)
        sentence = self._pick(need.sentences)
        lower = sentence if sentence.split()[0] in ("I", "I'm", "TV") else sentence[0].lower() + sentence[1:]
        instruction = self._pick(self.patterns["demand"]).format(need=sentence, need_lower=lower)
        return _Question(instruction, tuple(target_of(i) for i in things), {"need": need.name, "sentence": sentence})

    # Guided instructions

    def _guided(self) -> tuple[_Question, npt.NDArray[np.float64], float] | None:
        thing = self._pick(self.by_kind[self._pick(sorted(self.by_kind))])
        expression = self._expression(thing)
        if expression is None:
            return None
        targets = self._targets(expression)
        way = self._way(targets)
        if way is None:
            return None
        position = self.surface.random_point(self.rng)
        distance = way.distance(position)
        if not math.isfinite(distance) or distance < MIN_WAY:
            return None
        path = _every(way.path(position), 0.25)
        rooms = rooms_along(self.scene, path)
        if rooms_along(self.scene, path[:1]) != rooms[:1]:
            return None
        if rooms and any(room_name(self.scene, i) != rooms[-1] for i in expression.matches(self.scene)):
            # A thing of that name in another room would satisfy the name and not the way.
            return None
        landmarks = self._landmarks(path, thing, expression)
        text = self._route_text(expression, rooms, landmarks)
        if text is None:
            return None
        info = {"expression": expression.to_json(), "rooms": rooms, "geodesic_distance": distance}
        # Looking along the way, give or take, as someone about to leave does.
        ahead = path[min(4, len(path) - 1)] - position
        heading = math.atan2(-ahead[0], -ahead[2]) + float(self.rng.uniform(-0.5, 0.5))
        return _Question(text, targets, info), position, math.remainder(heading, math.tau)

    def _route_text(self, expression: Expression, rooms: list[str], landmarks: list[str]) -> str | None:
        patterns, scene = self.patterns["language_guided"], self.scene
        if len(rooms) > 4 or len(set(rooms)) < len(rooms):
            return None
        options = []
        if len(rooms) == 2:
            options += patterns["two_rooms"]
        if len(rooms) > 2:
            options += patterns["more_rooms"]
        if landmarks:
            options += patterns["landmark"] if len(rooms) >= 2 else patterns["one_room"]
        if not options:
            return None
        pattern = self._pick(options)
        said = expression
        if "{last}" in pattern and expression.room == rooms[-1]:
            # "Enter the kitchen and stop at the sink": the room has been said; it still is part of what is meant.
            unique = len(expression.matches(scene)) == 1
            ref = (
                with_article(said.noun, said.noun, unique)
                if said == Expression(said.noun, room=said.room)
                else said.say(scene)
            )
        else:
            ref = said.say(scene)
        between = " and ".join(f"the {room}" for room in rooms[1:-1])
        landmark = self._pick(landmarks) if landmarks else ""
        first, last = (rooms[0], rooms[-1]) if rooms else ("", "")
        return str(pattern.format(first=first, last=last, via=between, ref=ref, landmark=landmark))

    def _landmarks(self, path: npt.NDArray[np.float64], thing: Instance, expression: Expression) -> list[str]:
        """ "the sofa", ...: things of a kind that the home has once, passed on the way, in the order of passing."""
        passed: list[tuple[int, str]] = []
        for kind in sorted(self.by_kind):
            noun = vocabulary().sayable(kind)[0]
            others = Expression(noun).matches(self.scene)
            if len(others) != 1 or others[0].id == thing.id or expression.noun == noun:
                continue
            if expression.relation is not None and expression.relation.noun == noun:
                continue
            other = others[0]
            outside = np.maximum(np.maximum(other.aabb_min - path, path - other.aabb_max), 0.0)
            near = np.flatnonzero(np.hypot(outside[:, 0], outside[:, 2]) <= PASSING)
            if not len(near) or near[0] < 4 or near[-1] >= len(path) - 4:
                continue
            room = room_name(self.scene, other)
            if room in rooms_along(self.scene, path[near]) if room is not None else self._at_hand(other, path[near]):
                passed.append((int(near[0]), with_article(noun, noun, unique=True)))
        return [name for _, name in sorted(passed)]

    def _at_hand(self, thing: Instance, places: npt.NDArray[np.float64]) -> bool:
        """Whether few steps lead to the thing from one of the places (n, 3) m: where rooms have no names, a wall may part them."""
        way = self._way((target_of(thing),))
        return way is not None and min(way.distance(place) for place in places) <= 1.5 * PASSING


def rooms_along(scene: Scene, path: npt.NDArray[np.float64]) -> list[str]:
    """The everyday names of the rooms that a path (n, 3) m leads through, in order; a room grazed for one point is left out."""
    names: list[str | None] = []
    for position in path:
        room = scene.room_of(position + np.array([0.0, 0.3, 0.0]))
        names.append(None if room is None else vocabulary().room(room.name))
    rooms: list[str] = []
    for i, name in enumerate(names):
        lasts = i + 1 < len(names) and names[i + 1] == name
        if name is not None and (lasts or len(names) == 1) and (not rooms or rooms[-1] != name):
            rooms.append(name)
    return rooms


def _every(corners: npt.NDArray[np.float64], step: float) -> npt.NDArray[np.float64]:
    """Points (n, 3) m every ``step`` m along a path, both ends included."""
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(np.arange(0.0, along[-1], step), along[-1])
    return np.stack([np.interp(places, along, corners[:, axis]) for axis in range(3)], axis=1)


def _triple(v: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
