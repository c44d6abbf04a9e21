"""Noun phrases -> ``Thing``: "the second red chair from the window in the dining room" taken apart by rules over the
lexicon.

The grammar is: determiners, ordinal, superlative, colour, other modifiers, name, then any number of (relation, noun
phrase). A relation belongs to the noun phrase just before it unless "and" or a comma puts it back to the first one.
Names outside the lexicon are kept as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

from openmap_agents.grounding.description import Relation, RelationName, Superlative, Thing
from openmap_agents.grounding.lexicon import Lexicon, leading, words_of

SYNONYM_COST = 0.03
HEAD_COST = 0.06
SPELLING_COST = 0.08


@dataclass(frozen=True)
class _Segment:
    relation: RelationName | None
    words: list[str]
    negated: bool
    to_first: bool


class NounPhrases:
    """Parses noun phrases with the words of a lexicon."""

    def __init__(self, lexicon: Lexicon) -> None:
        words = lexicon.words
        self.lexicon = lexicon
        self.relation_of: dict[str, RelationName] = {
            surface: cast(RelationName, name) for name, surfaces in words["relations"].items() for surface in surfaces
        }
        self.relation_phrases = frozenset(self.relation_of)
        self._fillers = frozenset(words["fillers"])
        self._negations = frozenset(words["negations"])
        self.articles = frozenset(words["articles"])
        self.generic = frozenset(words["generic_nouns"])
        self.materials = frozenset(words["materials"])
        self.colour_of = {surface: colour for colour, surfaces in words["colours"].items() for surface in surfaces}
        self.superlative_of: dict[str, Superlative] = {
            surface: cast(Superlative, name) for name, surfaces in words["superlatives"].items() for surface in surfaces
        }
        self.strict = frozenset(words["strict_superlatives"])
        self.ordinals: dict[str, int] = words["ordinals"]

    def parse(self, text: str) -> Thing:
        """A noun phrase with its relations, e.g. "the lamp on the desk in the study"; empty phrase if no name is in it."""
        words = words_of(text)
        segments = self._segments(words)
        first = self._head(segments[0].words)
        return replace(self._attached(first, segments[1:]), not_colour=self._denied_colour(words))

    def _denied_colour(self, words: list[str]) -> str | None:
        """ "... not the blue one" -> "blue"."""
        denials = [at for at, word in enumerate(words) if word in self._negations]
        denied = [w for at in denials for w in words[at + 1 : at + 4] if w in self.colour_of]
        return self.colour_of[denied[0]] if denied else None

    def _segments(self, words: list[str]) -> list[_Segment]:
        """Cut before every relation: [head, (relation, words), ...]."""
        segments = [_Segment(None, [], False, False)]
        negated = to_first = False
        at = 0
        while at < len(words):
            if whole := self._compound_at(words, at):
                segments[-1].words.extend(words[at : at + whole])
                at += whole
                continue
            length = self._relation_at(words, at, bool(segments[-1].words) or segments[-1].relation is None)
            if length:
                name = self._relation_name(words[at : at + length], segments[0].words)
                segments.append(_Segment(name, [], negated, to_first))
                negated = to_first = False
                at += length
                continue
            word = words[at]
            if word in self._negations:
                negated = to_first = True
            elif negated and (word in self.articles or word in self.generic or word in self.colour_of):
                pass  # "not the blue one by the door": said of the first noun phrase, and no name
            elif word == "and" and self._relation_at(words, at + 1, True):
                to_first = True
            elif word not in self._fillers:
                segments[-1].words.append(word)
            at += 1
        return segments

    def _compound_at(self, words: list[str], at: int) -> int:
        """How many words from ``at`` on are a known name with a relation's word in it ("chest of drawers"); 0 = none."""
        for length in range(min(4, len(words) - at), 2, -1):
            within = words[at : at + length]
            if "of" in within[1:-1] and self.lexicon.name_of(" ".join(within)) is not None:
                return length
        return 0

    def _relation_at(self, words: list[str], at: int, may_begin: bool) -> int:
        if not may_begin or at >= len(words):
            return 0
        length = leading(words, self.relation_phrases, at)
        if not length and words[at] in ("from", "of"):
            return 1
        # "the nearest chair": a superlative before a name, not a relation to what follows it.
        if length == 1 and words[at] in ("nearest", "closest") and at <= 1:
            return 0
        return length if at + length < len(words) else 0

    def _relation_name(self, words: list[str], head: list[str]) -> RelationName:
        if words == ["from"] and any(w in self.ordinals or w in ("closest", "nearest") for w in head):
            return "closest"
        return self.relation_of.get(" ".join(words), "near")

    def _attached(self, first: Thing, segments: list[_Segment]) -> Thing:
        """Hang the relations onto their noun phrases, from the last to the first."""
        pending: list[Relation] = []
        room: str | None = None
        not_room: str | None = None
        for number in range(len(segments) - 1, -1, -1):
            segment = segments[number]
            named = self.lexicon.room_of(" ".join(segment.words))
            if named and segment.relation in ("in", "near", "on"):
                room, not_room = (room, named) if segment.negated else (named, not_room)
                continue
            names = self._joined(segment.words) if segment.relation == "between" else [segment.words]
            marks = [mark for mark in map(self._head, names) if mark.queries or mark.colour]
            if not marks or segment.relation is None:
                continue
            back_to_first = any(later.to_first for later in segments[number + 1 : number + 2])
            if pending and not back_to_first:
                marks[-1] = replace(marks[-1], relations=tuple(pending))
                pending = []
            pending.insert(0, Relation(segment.relation, tuple(marks), segment.negated))
        return replace(first, relations=tuple(pending), room=room or first.room, not_room=not_room)

    @staticmethod
    def _joined(words: list[str]) -> list[list[str]]:
        parts: list[list[str]] = [[]]
        for word in words:
            if word == "and":
                parts.append([])
            else:
                parts[-1].append(word)
        return [part for part in parts if part]

    def _head(self, words: list[str]) -> Thing:
        """A noun phrase without relations."""
        rest = [w for w in words if w not in self.articles]
        start, stop = self._name_span(rest)
        name, modifiers = rest[start:stop], rest[:start]
        if rest[stop:] and rest[-1] in self.generic:
            # "the wardrobe, the smaller one"
            modifiers = modifiers + [word for word in rest[stop:-1] if self.is_attribute(word)]
        colour: str | None = None
        superlative: Superlative | None = None
        strict = False
        ordinal: int | None = None
        room: str | None = None
        kept: list[str] = []
        for word in modifiers:
            if word in self.colour_of:
                colour = self.colour_of[word]
            elif word in self.superlative_of:
                superlative, strict = self.superlative_of[word], word in self.strict
            elif word in self.ordinals:
                ordinal = self.ordinals[word]
            elif word in self.lexicon.room_names:
                room = self.lexicon.room_names[word]
            elif word not in self.materials:
                kept.append(word)
        if kept and (named := self.lexicon.room_names.get(" ".join(kept))):
            room, kept = named, []
        attributes = [w for w in modifiers if w in self.materials]
        return Thing(
            phrase=" ".join(kept + name),
            queries=self._queries(name, kept, attributes),
            colour=colour,
            superlative=superlative,
            strict=strict,
            ordinal=ordinal,
            room=room,
        )

    def _name_span(self, words: list[str]) -> tuple[int, int]:
        """Where the name stands: the longest known name that ends last, else everything after the last attribute."""
        if words and words[-1] in self.generic:
            return len(words) - 1, len(words) - 1
        for stop in range(len(words), 0, -1):
            for start in range(max(0, stop - 4), stop):
                if self.lexicon.name_of(" ".join(words[start:stop])) is not None:
                    return start, stop
        start = len(words)
        while start > 0 and not self.is_attribute(words[start - 1]):
            start -= 1
        return start, len(words)

    def is_attribute(self, word: str) -> bool:
        """Whether a word says how a thing is and not what it is."""
        known = (self.colour_of, self.superlative_of, self.ordinals, self.materials, self.generic)
        return any(word in words for words in known)

    def _queries(self, name: list[str], kept: list[str], attributes: list[str]) -> tuple[tuple[str, float], ...]:
        """Texts to compare with the map, dearest last."""
        if not name:
            return ()
        plain = " ".join(name)
        known = self.lexicon.name_of(plain)
        costs: dict[str, float] = {}
        if kept:
            costs[" ".join(kept + name)] = 0.0
        if attributes and known:
            costs[" ".join(attributes + kept + name)] = 0.0
        costs.setdefault(plain, HEAD_COST if kept else 0.0)
        base = costs[plain]
        if known is not None:
            for other in (known, *self.lexicon.names[known]):
                costs.setdefault(other, base + SYNONYM_COST)
        else:
            spelled = " ".join(self.lexicon.spelled(w) or w for w in name)
            corrected = self.lexicon.name_of(spelled) or (
                self.lexicon.name_of(spelled.split()[-1]) if spelled != plain else None
            )
            if corrected is not None:
                costs.setdefault(corrected, SPELLING_COST)
        return tuple(sorted(costs.items(), key=lambda item: (item[1], item[0])))
