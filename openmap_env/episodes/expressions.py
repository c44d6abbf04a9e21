"""Referring expressions: which things a phrase like "the blue armchair in the kitchen" means, and how it is said.

An expression is a set of conditions; what it means in a home is found by testing every instance against them, so a phrase can
never mean more or less than its listed targets. Everything is in the world frame, metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from openmap_env.episodes.vocabulary import vocabulary
from openmap_scenes import Instance, Scene

RelationName = Literal["next to", "on", "above"]

NEAR = 0.5
"""Two things this close, m between their boxes on the floor plan, are next to each other."""
NOT_NEAR = 0.9
"""Beyond this they are not; in between people disagree, and the generator says nothing."""

_MATERIAL_WORDS = {"wood": "wooden", "wool": "woollen", "gold": "golden"}


@dataclass(frozen=True)
class Relation:
    """Where a thing is, by another thing: ``name`` as people say it, ``noun`` what the other is called."""

    name: RelationName
    noun: str


@dataclass(frozen=True)
class Expression:
    """What a phrase says of a thing; conditions that are None are not said.

    Parameters
    ----------
    noun : str
    colour, material : str or None
        As in ``Instance.attributes``.
    room : str or None
        A room's everyday name.
    relation : Relation or None
    """

    noun: str
    colour: str | None = None
    material: str | None = None
    room: str | None = None
    relation: Relation | None = None

    def matches(self, scene: Scene) -> list[Instance]:
        """Every instance of the scene that the phrase is true of, ascending by id; never structure."""
        words = vocabulary()
        named = [i for i in scene.instances if not words.is_structure(i.category) and words.is_a(i.category, self.noun)]
        return [
            i
            for i in named
            if (self.colour is None or i.attributes.get("colour") == self.colour)
            and (self.material is None or i.attributes.get("material") == self.material)
            and (self.room is None or room_name(scene, i) == self.room)
            and (self.relation is None or related(scene, i, self.relation))
        ]

    def say(self, scene: Scene) -> str:
        """The phrase with its article: "the" if it means one thing here, else "a"."""
        material = _MATERIAL_WORDS.get(self.material, self.material) if self.material else None
        phrase = " ".join(word for word in (self.colour, material, self.noun) if word)
        phrase = with_article(phrase, self.noun, unique=len(self.matches(scene)) == 1)
        if self.relation is not None:
            others = Expression(self.relation.noun).matches(scene)
            anchor = with_article(self.relation.noun, self.relation.noun, unique=len(others) == 1)
            phrase += f" {self.relation.name} {anchor}"
        if self.room is not None:
            phrase += f" in {room_phrase(scene, self.room)}"
        return phrase

    def to_json(self) -> dict[str, Any]:
        """The conditions that are said, as plain JSON."""
        return {key: value for key, value in asdict(self).items() if value is not None}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Expression:
        """The inverse of ``to_json``."""
        relation = Relation(**data["relation"]) if "relation" in data else None
        return cls(**{**data, "relation": relation})


def with_article(phrase: str, noun: str, unique: bool) -> str:
    """ "the", "a", "an" or "some" before a phrase, by its first sound and its noun's number."""
    if unique:
        return f"the {phrase}"
    if vocabulary().takes_no_a(noun):
        return f"some {phrase}"
    return f"{'an' if phrase[0].lower() in 'aeiou' and not phrase.startswith('u') else 'a'} {phrase}"


def room_name(scene: Scene, instance: Instance) -> str | None:
    """The everyday name of the room an instance is in, or None."""
    room = next((r for r in scene.rooms if r.id == instance.room), None) or scene.room_of(instance.centre)
    return None if room is None else vocabulary().room(room.name)


def room_phrase(scene: Scene, name: str) -> str:
    """ "the kitchen", or "a bedroom" where there are several."""
    same = sum(vocabulary().room(room.name) == name for room in scene.rooms)
    return with_article(name, name, unique=same <= 1)


def plan_gap(a: Instance, b: Instance) -> float:
    """Distance between the two boxes on the floor plan, m; 0 where they overlap."""
    gap = np.maximum(0.0, np.maximum(a.aabb_min - b.aabb_max, b.aabb_min - a.aabb_max))
    return float(np.hypot(gap[0], gap[2]))


def stands_on(a: Instance, b: Instance) -> bool:
    """Whether a's underside lies on b's top and a's middle over b."""
    rests = -0.05 <= a.aabb_min[1] - b.aabb_max[1] <= 0.1
    over = all(b.aabb_min[axis] <= a.centre[axis] <= b.aabb_max[axis] for axis in (0, 2))
    return bool(rests and over)


def _above(scene: Scene, a: Instance, b: Instance) -> bool:
    higher = 0.0 <= a.aabb_min[1] - b.aabb_max[1] <= 1.5
    return bool(higher and plan_gap(a, b) <= 0.15 and not stands_on(a, b) and _same_room(scene, a, b))


def _next_to(scene: Scene, a: Instance, b: Instance, reach: float = NEAR) -> bool:
    level = a.aabb_min[1] <= b.aabb_max[1] + 0.3 and b.aabb_min[1] <= a.aabb_max[1] + 0.3
    beside = plan_gap(a, b) <= reach and not stands_on(a, b) and not stands_on(b, a)
    return bool(level and beside and _same_room(scene, a, b))


def _same_room(scene: Scene, a: Instance, b: Instance) -> bool:
    return a.room == b.room if a.room is not None and b.room is not None else True


_TESTS: dict[RelationName, Callable[[Scene, Instance, Instance], bool]] = {
    "next to": _next_to,
    "on": lambda scene, a, b: stands_on(a, b),
    "above": _above,
}


def related(scene: Scene, instance: Instance, relation: Relation) -> bool:
    """Whether the relation holds between an instance and any thing called by the relation's noun."""
    return any(
        other.id != instance.id and _TESTS[relation.name](scene, instance, other)
        for other in Expression(relation.noun).matches(scene)
    )


def is_clear(scene: Scene, expression: Expression) -> bool:
    """Whether people would agree on what the phrase means: attributes known of every thing so named, nothing half near."""
    named = Expression(expression.noun).matches(scene)
    for key, value in (("colour", expression.colour), ("material", expression.material)):
        if value is not None and any(key not in i.attributes for i in named):
            return False
    if expression.room is not None and any(room_name(scene, i) is None for i in named):
        return False
    if expression.relation is None or expression.relation.name != "next to":
        return True
    others = Expression(expression.relation.noun).matches(scene)
    pairs = [(i, other) for i in named for other in others if i.id != other.id]
    return not any(_next_to(scene, i, o, NOT_NEAR) and not _next_to(scene, i, o) for i, o in pairs)
