"""What an instruction asks for, as plain data: the first of grounding's three steps ends in a ``Description``.

A description is free-form: names are whatever words the instruction used, no dictionary limits them. It serialises to
plain JSON for the trace, and it is made either by the built-in interpreter (``interpreter.py``) or from a language
model's reply (``dialogue.py``).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

Kind = Literal["object_goal", "demand", "language_guided"]
RelationName = Literal["near", "facing", "side", "on", "under", "above", "in", "between", "closest", "farthest", "away"]
Superlative = Literal["largest", "smallest", "tallest", "shortest", "longest", "highest", "lowest"]


@dataclass(frozen=True)
class Relation:
    """Where a thing is with respect to its landmarks.

    Parameters
    ----------
    name : RelationName
        ``side`` (left or right of) counts as near: from which side it is looked at is not known.
    landmarks : tuple of Thing
        Two or more for ``between``, one otherwise.
    negated : bool
        "not the one by the door".
    """

    name: RelationName
    landmarks: tuple[Thing, ...]
    negated: bool = False


@dataclass(frozen=True)
class Thing:
    """A noun phrase, taken apart.

    Parameters
    ----------
    phrase : str
        The name without articles, colour and place: "dining chair"; empty for "the blue thing".
    queries : tuple of (str, float)
        Texts to look for in the map, with what is taken off the similarity found for each
        (a synonym fits a little less than the word said).
    colour, not_colour, superlative, ordinal, room, not_room
        What the phrase says besides; ``ordinal`` counts from 1.
    strict : bool
        "the largest plant" (strict) against "the large plant".
    relations : tuple of Relation
    """

    phrase: str
    queries: tuple[tuple[str, float], ...] = ()
    colour: str | None = None
    not_colour: str | None = None
    superlative: Superlative | None = None
    strict: bool = False
    ordinal: int | None = None
    room: str | None = None
    not_room: str | None = None
    relations: tuple[Relation, ...] = ()


@dataclass(frozen=True)
class RouteClause:
    """One leg of a described walk: ``leave``, ``pass`` or ``approach`` a room or a thing."""

    motion: Literal["leave", "pass", "approach"]
    room: str | None = None
    thing: Thing | None = None


@dataclass(frozen=True)
class Description:
    """What is wanted.

    Parameters
    ----------
    kind : Kind
    target : Thing or None
        The thing named, if one is.
    needs : tuple of str
        What the speaker wants to do or suffers from, one sentence each.
    needs_room : str or None
        Where they are to be met.
    serves : tuple of (str, float)
        Kinds of things that answer the needs, most probable first, each with its probability.
    route : tuple of RouteClause
        Soft context for where the target is.
    avoid : tuple of Thing
        What is not wanted ("anything but the sofa").
    """

    kind: Kind
    target: Thing | None = None
    needs: tuple[str, ...] = ()
    needs_room: str | None = None
    serves: tuple[tuple[str, float], ...] = ()
    route: tuple[RouteClause, ...] = ()
    avoid: tuple[Thing, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain JSON; fields that say nothing are left out."""
        pruned = _pruned(asdict(self))
        return pruned if isinstance(pruned, dict) else {}


def _pruned(value: Any) -> Any:
    if isinstance(value, dict):
        kept = {key: _pruned(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item not in (None, False, [], "")}
    if isinstance(value, list | tuple):
        return [_pruned(item) for item in value]
    return round(value, 4) if isinstance(value, float) else value
