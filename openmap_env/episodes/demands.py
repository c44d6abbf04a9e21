"""Needs: what people want, in their words, and everything in a home that would do.

The table is hand-written data (``data/needs.json``, which says by which rule). What serves a need is found by testing every
thing of the scene; a home with a thing that only some would accept is not asked for that need.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from openmap_env.episodes.expressions import room_count, room_name
from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_scenes import Instance, Scene

KEPT_CAPITALS = ("I", "I'm", "I'd", "I've")


@dataclass(frozen=True)
class Entry:
    """One line of a need: a kind with all its sorts or without (``exact``), with an attribute, in a room."""

    kind: str
    exact: bool = False
    detail: str | None = None
    room: str | None = None

    @classmethod
    def read(cls, text: str) -> Entry:
        """From "kind", "=kind", "kind:word" or "kind@room"."""
        rest, _, room = text.partition("@")
        kind, _, detail = rest.partition(":")
        return cls(kind.lstrip("="), kind.startswith("="), detail or None, room or None)

    def is_finer_than(self, other: Entry) -> bool:
        """Whether this line names a sort of what the other names, or asks for an attribute."""
        sort = self.kind != other.kind and other.kind in vocabulary().lineage(self.kind)
        return sort or (self.detail is not None and other.detail is None)

    def covers(self, scene: Scene, thing: Instance) -> bool:
        """Whether the line means this thing."""
        words = vocabulary()
        named = words.kind(thing.category) == self.kind if self.exact else self.kind in words.lineage(thing.category)
        return (
            named
            and (self.detail is None or self.detail in thing.attributes.values())
            and (self.room is None or room_name(scene, thing) == self.room)
        )


@dataclass(frozen=True)
class Need:
    """Something people want: how they say it, what serves it, what does so only in the eyes of some, and what never does."""

    name: str
    sentences: tuple[str, ...]
    served_by: tuple[Entry, ...]
    unsure: tuple[Entry, ...] = ()
    exceptions: tuple[Entry, ...] = ()

    def serves(self, scene: Scene, thing: Instance) -> bool:
        """Whether everybody would say that the thing will do."""
        return any(e.covers(scene, thing) for e in self.served_by) and not any(
            e.covers(scene, thing) for e in self.exceptions
        )

    def divides(self, scene: Scene, thing: Instance) -> bool:
        """Whether only some would say that the thing will do: the table doubts it and says nothing finer."""
        if any(e.covers(scene, thing) for e in self.exceptions):
            return False
        serving = [e for e in self.served_by if e.covers(scene, thing)]
        doubtful = [e for e in self.unsure if e.covers(scene, thing)]
        return any(not any(s.is_finer_than(d) for s in serving) for d in doubtful)


@dataclass(frozen=True)
class Demand:
    """A need that can be asked for in a home: a sentence, all things that serve it, and the room it is about, if any."""

    need: Need
    sentence: str
    things: tuple[Instance, ...]
    room: str | None = None

    def said(self) -> str:
        """The sentence with the room's name in it."""
        return self.sentence.format(room=self.room)

    def said_inside(self) -> str:
        """The same as it is written in the middle of a sentence."""
        said = self.said()
        return said if said.split()[0] in KEPT_CAPITALS else said[0].lower() + said[1:]


@cache
def needs() -> tuple[Need, ...]:
    """The table of needs."""
    return tuple(
        Need(
            name,
            tuple(entry["sentences"]),
            *(tuple(map(Entry.read, entry.get(key, ()))) for key in ("served_by", "unsure", "not")),
        )
        for name, entry in load_data("needs.json")["needs"].items()
    )


def demands(scene: Scene, things: Sequence[Instance], most: int) -> list[list[Demand]]:
    """What can be asked for in the home, one list a need: sentences served by one to ``most`` things, none doubtful."""
    return [found for need in needs() if (found := list(_of(scene, things, need, most)))]


def _of(scene: Scene, things: Sequence[Instance], need: Need, most: int) -> Iterator[Demand]:
    serving = [i for i in things if need.serves(scene, i)]
    if not serving:
        return
    doubtful = [i for i in things if need.divides(scene, i)]
    rooms = {i.id: room_name(scene, i) for i in serving + doubtful}
    names = sorted({name for i in serving if (name := rooms[i.id]) is not None and room_count(scene, name) == 1})
    for sentence in need.sentences:
        for room in names if "{room}" in sentence else [None]:
            here = tuple(i for i in serving if room is None or rooms[i.id] == room)
            doubt = any(room is None or rooms[i.id] in (room, None) for i in doubtful)
            if 1 <= len(here) <= most and not doubt:
                yield Demand(need, sentence, here, room)
