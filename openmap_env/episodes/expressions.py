"""Referring expressions: which things a phrase like "the blue armchair in the kitchen" means, and how it is said.

An expression is a set of conditions; what it means in a home is found by testing every instance against them, so a phrase can
never mean more or less than its listed targets. Everything is in the world frame, metres.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from openmap_env.episodes.attributes import looks
from openmap_env.episodes.relations import Relation, half_holds, holds
from openmap_env.episodes.vocabulary import vocabulary
from openmap_scenes import Instance, Scene

Most = Literal["largest", "biggest", "tallest"]
CLEARLY_LARGER, CLEARLY_TALLER = 1.5, 1.25
"""How many times as large (the two longest sides of the box multiplied) or tall as the second the largest or tallest has to be."""


@dataclass(frozen=True)
class Expression:
    """What a phrase says of a thing; conditions that are None are not said.

    Parameters
    ----------
    noun : str
    colour : str or None
        As in ``Instance.attributes``.
    material : str or None
        A word of ``attributes.json``: "wooden" is true of oak.
    look : str or None
        A word of ``attributes.json`` for shape, pattern or make.
    most : Most or None
        The thing is the largest or tallest of those that the other conditions are true of.
    room : str or None
        A room's everyday name.
    relation : Relation or None
    """

    noun: str
    colour: str | None = None
    material: str | None = None
    look: str | None = None
    most: Most | None = None
    room: str | None = None
    relation: Relation | None = None

    def matches(self, scene: Scene) -> list[Instance]:
        """Every instance of the scene that the phrase is true of, ascending by id; never structure."""
        found = [
            i
            for i in named(scene, self.noun, self.room)
            if (self.colour is None or i.attributes.get("colour") == self.colour)
            and (self.material is None or looks().is_made_of(i, self.material))
            and (self.look is None or looks().has_look(i, self.look))
        ]
        if self.relation is not None:
            others = named(scene, self.relation.noun)
            found = [i for i in found if any(holds(self.relation.name, i, o) for o in others)]
        return found if self.most is None else sorted(found, key=lambda i: (-size(i, self.most), i.id))[:1]

    def say(self, scene: Scene, with_room: bool = True) -> str:
        """The phrase with its article: "the" if it means one thing here, else "a"; the room may have been said before."""
        material, noun = self.material, self.noun
        phrase = " ".join(word for word in (self.most, self.look, self.colour, material, noun) if word)
        phrase = with_article(phrase, noun, unique=len(self.matches(scene)) == 1)
        if self.relation is not None:
            phrase += f" {self.relation.name} the {self.relation.noun}"
        if self.room is not None and with_room:
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


def named(scene: Scene, noun: str, room: str | None = None) -> list[Instance]:
    """Every instance that people call by the noun, in rooms of that name only if one is given, ascending by id."""
    words = vocabulary()
    kind = words.kind(noun)
    found = [i for i in scene.instances if kind in words.lineage(i.category) and not words.is_structure(i.category)]
    return found if room is None else [i for i in found if room_name(scene, i) == room]


def size(thing: Instance, most: Most | None) -> float:
    """What "largest" or "tallest" compares: the two longest sides of the box multiplied, m2, or its height, m."""
    sides = np.sort(thing.aabb_max - thing.aabb_min)
    return float(thing.aabb_max[1] - thing.aabb_min[1]) if most == "tallest" else float(sides[2] * sides[1])


def with_article(phrase: str, noun: str, unique: bool) -> str:
    """ "the", "a", "an" or "some" before a phrase, by its first sound and its noun's number."""
    if unique:
        return f"the {phrase}"
    if vocabulary().number(noun) != "one":
        return f"some {phrase}"
    first = phrase.lower()
    vowel = first[0] in "aeiou" and not first.startswith(("uni", "use", "ute", "uri", "one", "eu"))
    return f"{'an' if vowel else 'a'} {phrase}"


def room_name(scene: Scene, instance: Instance) -> str | None:
    """The everyday name of the room an instance is in, or None."""
    room = next((r for r in scene.rooms if r.id == instance.room), None) or scene.room_of(instance.centre)
    return None if room is None else vocabulary().room(room.name)


def room_count(scene: Scene, name: str) -> int:
    """How many rooms have that everyday name."""
    return sum(vocabulary().room(room.name) == name for room in scene.rooms)


def room_phrase(scene: Scene, name: str) -> str:
    """ "the kitchen", or "one of the bedrooms" where there are several."""
    return f"the {name}" if room_count(scene, name) <= 1 else f"one of the {name}s"


def is_clear(scene: Scene, expression: Expression) -> bool:
    """Whether people would agree on what the phrase means: what it says is known of every thing so named, nothing half near."""
    if expression.room is not None and any(room_name(scene, i) is None for i in named(scene, expression.noun)):
        return False
    like = named(scene, expression.noun, expression.room)
    if expression.colour is not None and not all(looks().colour_clear(i, expression.colour) for i in like):
        return False
    if expression.material is not None and not all(looks().material_clear(i) for i in like):
        return False
    if expression.look is not None and not all(looks().look_clear(i, expression.look) for i in like):
        return False
    if expression.relation is not None:
        name, others = expression.relation.name, named(scene, expression.relation.noun)
        if any(half_holds(name, i, o) for i in like for o in others):
            return False
    return expression.most is None or _stands_out(scene, expression)


def _stands_out(scene: Scene, expression: Expression) -> bool:
    """Whether the largest or tallest is so by far, of at least two, and not small the other way."""
    rest = Expression(**{**expression.__dict__, "most": None}).matches(scene)
    ordered = sorted(rest, key=lambda i: (-size(i, expression.most), i.id))
    if len(ordered) < 2:
        return False
    first, second = ordered[:2]
    if expression.most == "tallest":
        return size(first, "tallest") >= CLEARLY_TALLER * size(second, "tallest")
    longest = max(float((i.aabb_max - i.aabb_min).max()) for i in ordered[1:])
    by_far = size(first, "largest") >= CLEARLY_LARGER * size(second, "largest")
    return by_far and float((first.aabb_max - first.aabb_min).max()) >= longest
