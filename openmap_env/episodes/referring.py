"""Phrases that people would use for a thing of a home: its name if that says enough, or with what sets it apart from its like."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np
from scipy.spatial import cKDTree

from openmap_env.episodes.attributes import looks
from openmap_env.episodes.expressions import Expression, Most, is_clear, named, room_count, room_name
from openmap_env.episodes.relations import Relation, RelationName, holds, plan_gap
from openmap_env.episodes.routes import apart, stands_free
from openmap_env.episodes.sight import seen
from openmap_env.episodes.vocabulary import vocabulary
from openmap_env.navigation.surface import NavigableSurface
from openmap_scenes import Instance, Scene

T = TypeVar("T")

MAX_TARGETS = 4
"""A phrase that more things satisfy than this is too easy to ask."""
JUST_THE_NAME = 0.6
"""How often the name alone is said where it is enough; now and then people say more all the same."""
HIGH = 1.9
"""What hangs higher above its floor than this, m, hangs from the ceiling."""
NEIGHBOURS = 10


class Things:
    """What can be asked for in a scene, by kind, and what the surface says of it."""

    def __init__(self, scene: Scene, surface: NavigableSurface) -> None:
        words = vocabulary()
        self.scene = scene
        self.all = [i for i in scene.instances if not words.is_structure(i.category)]
        self.seen = [i for i, is_seen in zip(self.all, seen(scene, surface, self.all), strict=True) if is_seen]
        self.by_kind: dict[str, list[Instance]] = {}
        for thing in self.seen:
            kind = words.kind(thing.category)
            if kind not in looks().between_rooms:
                self.by_kind.setdefault(kind, []).append(thing)
        self._rooms = {i.id: room_name(scene, i) for i in self.all}
        self._floors = _floors(surface, self.all)

    def room(self, thing: Instance) -> str | None:
        """The everyday name of the room a thing is in."""
        return self._rooms[thing.id]

    def height(self, thing: Instance) -> float:
        """How high above the floor a thing begins, m."""
        return float(thing.aabb_min[1]) - self._floors[thing.id]

    def on_something(self, thing: Instance) -> bool:
        """Whether a thing stands on or in another."""
        return any(holds("on", thing, other) for other in self.all)

    def end_of(self, thing: Instance) -> str:
        """The group of end clauses that fit the thing: one stops under a lamp, and in front of what stands."""
        hangs = not vocabulary().lineage(thing.category).isdisjoint(("ceiling lamp", "ceiling fan"))
        if hangs or self.height(thing) > HIGH:
            return "end_under"
        tall = float(thing.aabb_max[1] - thing.aabb_min[1]) >= 0.6
        return "end_standing" if tall and stands_free(thing, self._floors[thing.id]) else "end"

    def landmarks(self, goal: Instance, expression: Expression) -> list[tuple[Instance, str]]:
        """Things with their nouns that a way to the goal can be told by: large, apart from it, and not called like it."""
        words, found = vocabulary(), []
        anchor = None if expression.relation is None else expression.relation.noun
        for thing in self.seen:
            noun = words.sayable(thing.category)[0]
            if thing.id == goal.id or not stands_free(thing, self._floors[thing.id]) or not apart(goal, thing):
                continue
            if not looks().not_passed.isdisjoint(words.lineage(thing.category)):
                continue
            if words.is_a(goal.category, noun) or words.is_a(thing.category, expression.noun) or noun == anchor:
                continue
            found.append((thing, noun))
        return found


class Phrases:
    """Finds phrases for the things of a scene.

    Parameters
    ----------
    things : Things
    rng : np.random.Generator
    """

    def __init__(self, things: Things, rng: np.random.Generator) -> None:
        self.things, self.scene, self._rng = things, things.scene, rng

    def of(self, thing: Instance, within: str | None = None) -> Expression | None:
        """A phrase that is true of the thing, clear, and of at most ``MAX_TARGETS`` things; None where none was found.

        With ``within`` the phrase is of one thing and about that room, which the thing is in; else the room may be said.
        """
        plain = Expression(self._pick(vocabulary().sayable(thing.category)), room=within)
        meant = plain.matches(self.scene)
        enough = len(meant) == 1 and is_clear(self.scene, plain)
        lineage = vocabulary().lineage(thing.category)
        if enough and (not looks().one_of_a_kind.isdisjoint(lineage) or self._rng.random() < JUST_THE_NAME):
            return plain
        sorts = [self._looks, self._size, self._relations]
        if not enough and within is None:
            sorts += [self._room, self._looks_and_room, self._relations_and_room]
        for number in self._rng.permutation(len(sorts)).tolist():
            options: list[Expression] = list(sorts[number](thing, plain))
            for choice in self._rng.permutation(len(options)):
                phrase = options[int(choice)]
                if len(phrase.matches(self.scene)) == 1 and is_clear(self.scene, phrase):
                    return phrase
        several = vocabulary().kind(thing.category) not in looks().only_the
        few = (
            several and within is None and 1 <= len(meant) <= MAX_TARGETS and vocabulary().number(plain.noun) != "many"
        )
        return plain if few and is_clear(self.scene, plain) and self._all_seen(meant) else None

    def _all_seen(self, meant: Sequence[Instance]) -> bool:
        ids = {i.id for i in self.things.seen}
        return all(i.id in ids for i in meant)

    def _pick(self, options: Sequence[T]) -> T:
        return options[int(self._rng.integers(len(options)))]

    def _looks(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        colour, material = looks().colour_said(thing), looks().material_said(thing)
        words = looks().looks_said(thing)
        singles = [{"look": word} for word in words]
        singles += [{"material": material}] if material else []
        singles += [{"colour": colour}] * 2 if colour else []
        for single in singles:
            yield _with(plain, **single)
        if colour and not any(len(_with(plain, **s).matches(self.scene)) == 1 for s in singles):
            for word in words:
                yield _with(plain, colour=colour, look=word)

    def _size(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        lineage = vocabulary().lineage(thing.category)
        options: list[Most] = ["largest", "biggest"] if not looks().largest_of.isdisjoint(lineage) else []
        options += ["tallest"] if not looks().tallest_of.isdisjoint(lineage) else []
        rooms = [phrase.room for phrase in self._room(thing, plain)]
        for most in options:
            for where in [plain.room] if plain.room else [None, *rooms]:
                phrase = _with(plain, most=most, room=where)
                if phrase.matches(self.scene) == [thing]:
                    yield phrase

    def _room(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        room = self.things.room(thing)
        if room is not None and room_count(self.scene, room) == 1 and room.split()[0] not in plain.noun.split():
            yield _with(plain, room=room)

    def _looks_and_room(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        for where in self._room(thing, plain):
            if len(where.matches(self.scene)) > 1:
                yield from self._looks(thing, where)

    def _relations_and_room(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        for where in self._room(thing, plain):
            if len(where.matches(self.scene)) > 1:
                yield from self._relations(thing, where)

    def _relations(self, thing: Instance, plain: Expression) -> Iterator[Expression]:
        """With what may be said of where the thing is, by the things around it, if these are the only ones of their name."""
        words = vocabulary()
        around = sorted((i for i in self.things.seen if i.id != thing.id), key=lambda i: (plan_gap(thing, i), i.id))
        for other in around[:NEIGHBOURS]:
            noun = words.sayable(other.category)[0]
            if words.is_a(thing.category, noun) or words.is_a(other.category, plain.noun):
                continue
            if not set(noun.split()).isdisjoint(plain.noun.split()):
                continue
            by_name = looks().stay_by & words.lineage(other.category)
            if len(named(self.scene, noun, plain.room)) != 1 and "window" not in by_name:
                continue
            if "window" in by_name and not looks().at_windows.isdisjoint(words.lineage(thing.category)):
                continue
            for name in _relations_between(thing, other, bool(by_name), self.things):
                yield _with(plain, relation=Relation(name, noun))


def _relations_between(thing: Instance, other: Instance, stays_by: bool, things: Things) -> list[RelationName]:
    """The relations that hold and that somebody would mention: by something as large, on something that things stand on."""
    words = vocabulary()
    lineage, found = words.lineage(other.category), list[RelationName]()
    mine, its = thing.aabb_max - thing.aabb_min, other.aabb_max - other.aabb_min
    as_large = float(its.max()) >= 0.8 * float(mine.max())
    if not looks().supports.isdisjoint(lineage) and as_large and holds("on", thing, other):
        found.append("on")
    level = abs(things.height(thing) - things.height(other)) < 0.4 and things.height(thing) < HIGH
    low = things.height(thing) < HIGH and min(float(mine.max()), float(its[1])) > 0.1
    beside = looks().not_beside.isdisjoint(lineage) or stays_by
    if as_large and low and beside and (level or stays_by) and holds("next to", thing, other):
        found += ["by"] if stays_by and "window" in lineage else ["next to", "beside"]
    wide_enough = float(max(its[0], its[2])) >= 0.4 * float(max(mine[0], mine[2]))
    hangs = thing.aabb_min[1] - other.aabb_max[1] >= 0.15 and not things.on_something(thing)
    hangs = hangs and looks().at_windows.isdisjoint(words.lineage(thing.category))
    if hangs and things.height(other) < 0.3 and wide_enough and float(its[1]) > 0.3 and holds("above", thing, other):
        found.append("above")
    if not looks().covering.isdisjoint(lineage) and holds("under", thing, other):
        found.append("under")
    return found


def _with(expression: Expression, **more: object) -> Expression:
    return Expression(**{**expression.__dict__, **more})


def _floors(surface: NavigableSurface, things: Sequence[Instance]) -> dict[int, float]:
    """The height of the floor below each thing, m: that of the highest place near it that is not above its underside.

    Places are those of the main island: one can stand on tables, too.
    """
    places = surface.centres[surface.island == 0]
    tree = cKDTree(places[:, [0, 2]])
    floors = {}
    for thing in things:
        _, near = tree.query(thing.centre[[0, 2]], k=min(200, len(places)))
        heights = places[np.atleast_1d(near), 1]
        below = heights[heights <= thing.aabb_min[1] + 0.15]
        floors[thing.id] = float(below.max() if len(below) else heights.min())
    return floors
