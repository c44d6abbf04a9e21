"""The built-in interpreter: an instruction in plain English -> ``Description``, without a language model.

An instruction is cut into clauses, each clause is known by the verb it begins with (``data/lexicon.json``): it
leaves, passes, approaches, stops, looks for something, or states a need. A walk's target is what its last stopping
clause names ("it" is the thing named before); a need is handed on as a sentence, to be matched with what things are
for (``needs.py``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

from openmap_agents.grounding import speech
from openmap_agents.grounding.description import Description, Kind, RouteClause, Thing
from openmap_agents.grounding.lexicon import Lexicon, leading, load_lexicon, normalised, words_of
from openmap_agents.grounding.noun_phrases import SPELLING_COST, NounPhrases

Motion = Literal["goal", "approach", "stop", "pass", "leave", "turn", "need", "bare"]


@dataclass(frozen=True)
class _Clause:
    motion: Motion
    rest: str
    text: str


class Interpreter:
    """Rules over a lexicon; stateless and deterministic."""

    def __init__(self, lexicon: Lexicon | None = None) -> None:
        self.lexicon = lexicon or load_lexicon()
        self.nouns = NounPhrases(self.lexicon)
        words = self.lexicon.words
        self._verbs: dict[Motion, frozenset[str]] = {
            "stop": frozenset(words["stop_verbs"]),
            "leave": frozenset(words["leave_verbs"]),
            "pass": frozenset(words["pass_verbs"]),
            "turn": frozenset(words["turn_verbs"]),
            "need": frozenset(words["need_markers"]),
            "goal": frozenset(words["goal_verbs"]),
            "approach": frozenset(words["approach_verbs"]),
        }
        self._connectives = frozenset(words["connectives"])
        self._polite = frozenset(words["polite"])
        self._places = frozenset(words["place_words"])
        self._prepositions = self.nouns.relation_phrases | {
            "to",
            "towards",
            "toward",
            "of",
            "from",
            "when",
            "once",
            "you",
            "me",
            "for",
        }
        self._pronouns = frozenset(words["pronouns"])
        rooms = "|".join(sorted(map(re.escape, self.lexicon.room_names), key=lambda name: (-len(name), name)))
        self._in_room = re.compile(rf"\s*\b(?:in|inside|within|from|into|around) (?:the |my |our )?({rooms})\b")
        # "Air the bathroom": what is done to a room is done in it.
        self._to_room = re.compile(
            r"\b((?:air|ventilate|cool|heat|warm|light|clean|mop|sweep|tidy|vacuum|brighten|darken|freshen)(?: up| out)?)"
            rf" (?:the |my |our )({rooms})\b"
        )
        self._frame = frozenset(words["function_words"]) | frozenset(words["frame_words"])

    def parse(self, instruction: str) -> Description:
        """What the instruction asks for; never raises, an instruction without a thing gives a description without a target."""
        clauses = self._clauses(speech.meant(normalised(instruction)))
        if (
            any(c.motion == "stop" for c in clauses)
            or sum(c.motion in ("leave", "pass", "turn", "approach") for c in clauses) > 1
            or (clauses and clauses[0].motion in ("leave", "pass") and len(clauses) > 1)
        ):
            return self._walk(clauses)
        return self._wish(clauses)

    def knows(self, thing: Thing) -> bool:
        """Whether the thing is called by a household name, or something is said of it that only a thing can have."""
        named = any(self.lexicon.name_of(text) is not None for text, cost in thing.queries if cost < SPELLING_COST)
        return named or bool(thing.colour or thing.room or thing.relations or thing.superlative)

    # clauses -----------------------------------------------------------------------------------------------------------

    def _clauses(self, text: str) -> list[_Clause]:
        clauses: list[_Clause] = []
        for sentence in re.split(r"[.!?;:]+", text):
            begins = True
            for piece in self._pieces(sentence):
                if not self._without_courtesy(words_of(piece)):
                    continue
                clause = self._clause(piece)
                continues = clause.motion == "bare" and not begins
                if continues and clauses:
                    last = clauses[-1]
                    clauses[-1] = replace(last, rest=f"{last.rest} {piece}".strip(), text=f"{last.text}, {piece}")
                elif clause.text:
                    clauses.append(clause)
                begins = False
        return clauses

    def _pieces(self, sentence: str) -> list[str]:
        """Cut at commas, and at connectives that a verb follows."""
        pieces: list[str] = []
        for part in sentence.split(","):
            words = words_of(part)
            start = 0
            for at in range(1, len(words)):
                if (
                    words[at] in self._connectives
                    and words[at - 1] not in self._connectives
                    and self._verb_follows(words, at)
                ):
                    pieces.append(" ".join(words[start:at]))
                    start = at
            pieces.append(" ".join(words[start:]))
        return [piece for piece in pieces if piece]

    def _verb_follows(self, words: list[str], at: int) -> bool:
        if leading(words, self.nouns.relation_phrases, at) > 1:
            return False
        if any(leading(words, phrases, at) > 1 for phrases in self._verbs.values()):
            return True
        while at < len(words) and words[at] in self._connectives:
            at += 1
        return any(leading(words, phrases, at) for motion, phrases in self._verbs.items()) and not self._is_relation(
            words, at
        )

    def _is_relation(self, words: list[str], at: int) -> bool:
        """ "... and in the bedroom" goes on with the noun phrase; "... and into the bedroom" with the walk."""
        return words[at] not in ("into", "through", "past") and leading(words, self.nouns.relation_phrases, at) > 0

    def _clause(self, piece: str) -> _Clause:
        words = self._without_courtesy(words_of(piece))
        while (
            words
            and words[0] in self._connectives
            and not (words[0] == "there" and words[1:2] and words[1] in ("is", "are", "was", "were", "has", "have"))
            and not leading(words, self.nouns.relation_phrases)
            and not any(leading(words, p) > 1 for p in self._verbs.values())
        ):
            words = self._without_courtesy(words[1:])
        # "... where the red chair is"
        if len(words) > 2 and words[-1] in ("is", "are", "was", "were") and words[0] != "where":
            words = words[:-1]
        if found := speech.PUT.match(" ".join(words)):
            words = words_of(" ".join(words)[found.end() :])
        best: tuple[int, Motion] = (0, "bare")
        for motion, phrases in self._verbs.items():
            length = leading(words, phrases)
            if length > best[0]:
                best = (length, motion)
        length, motion = best
        if motion == "need" and length == 1 and words[0] == "my" and not speech.NEED_STATE.match(" ".join(words)):
            motion, length = "bare", 0
        if motion == "bare" and (taken := self._unknown_verb(words)):
            motion, length = "goal", taken
        if motion == "bare" and (speech.NEED_STATE.match(" ".join(words)) or speech.SAYS.match(" ".join(words))):
            motion = "need"
        if motion == "goal" and words[length - 1] in ("see", "open", "use", "watch") and "want" in words[:length]:
            # "I want to see the red chair" names a thing, "I want to see pictures" states a wish.
            motion = "goal" if words[length:] and words[length] in speech.DEFINITE else "need"
        rest = words if motion == "need" else words[length:]
        return _Clause(motion, " ".join(rest), " ".join(words))

    def _unknown_verb(self, words: list[str]) -> int:
        """How many words an imperative that no list knows has: "straighten the picture", "plump up the cushions"; 0 = none."""
        particle = 1 if len(words) > 2 and words[1] in ("up", "off", "on", "down", "out", "away") else 0
        if len(words) < 3 + particle or words[1 + particle] not in speech.DEFINITE or words[0] in speech.NO_VERBS:
            return 0
        known = self.lexicon.name_of(words[0]) or self.lexicon.room_of(words[0]) or self.nouns.is_attribute(words[0])
        return 0 if known or words[0] in self.nouns.articles or words[0] in self._prepositions else 1 + particle

    def _without_courtesy(self, words: list[str]) -> list[str]:
        changed = True
        while changed and words:
            changed = False
            length = leading(words, self._polite)
            if length:
                words, changed = words[length:], True
            for size in (1, 2, 3):
                if len(words) > size and " ".join(words[-size:]) in self._polite:
                    words, changed = words[:-size], True
        return words

    # walks -------------------------------------------------------------------------------------------------------------

    def _walk(self, clauses: list[_Clause]) -> Description:
        route: list[RouteClause] = []
        target: Thing | None = None
        last_room: str | None = None
        needs: list[str] = []
        for clause in clauses:
            if clause.motion == "need":
                needs.append(clause.text)
                continue
            if clause.motion == "turn" and not clause.rest:
                continue
            if self._asks_for_use(clause.rest):
                needs.append(clause.rest)
                continue
            thing = self._named(clause.rest)
            if clause.motion == "leave":
                clause = replace(clause, rest=re.split(r" (?:through|by|via|using) ", clause.rest)[0])
                thing = self._named(clause.rest)
            room = self.lexicon.room_of(self._stripped(clause.rest))
            if room is not None:
                route.append(RouteClause(_leg(clause.motion), room=room))
                last_room = None if clause.motion == "leave" else room
                if clause.motion in ("stop", "approach") and clause is clauses[-1]:
                    target = Thing(phrase="", room=room)
                continue
            if thing is None:
                continue
            if thing.room and clause.motion != "leave":
                last_room = thing.room
            if clause.motion in ("stop", "approach", "goal", "bare"):
                target = thing if thing.room or thing.not_room else replace(thing, room=last_room)
            route.append(RouteClause(_leg(clause.motion), thing=thing))
        if target is None:
            named = [leg.thing for leg in route if leg.thing is not None]
            target = named[-1] if named else (Thing(phrase="", room=last_room) if last_room else None)
        legs = tuple(leg for leg in route if leg.thing is None or target is None or leg.thing.phrase != target.phrase)
        stated, where = self._needs(needs if target is None else [])
        return Description(kind="language_guided", target=target, needs=stated, needs_room=where, route=legs)

    def _named(self, rest: str) -> Thing | None:
        """The thing that a clause's remainder names; None for a pronoun or nothing."""
        text = self._stripped(rest)
        if not text or text.split()[0] in self._pronouns:
            return None
        thing = self.nouns.parse(text)
        return thing if thing.queries or thing.colour else None

    def _stripped(self, rest: str) -> str:
        """Without the prepositions, adverbs and verbs before the noun phrase: "when you reach the sink" -> "the sink"."""
        words = rest.split()
        skippable = (
            self._verbs["approach"] | self._verbs["goal"] | self._prepositions | self._connectives | self._polite
        )
        skippable |= {
            "right",
            "straight",
            "directly",
            "are",
            "can",
            "get",
            "up",
            "down",
            "out",
            "it and",
            "it",
            "is",
            "ahead",
        }
        while words and (length := leading(words, frozenset(skippable))):
            if length == len(words) and words[-1] in self._pronouns:
                return words[-1]
            words = words[length:]
        return " ".join(words)

    # wishes ------------------------------------------------------------------------------------------------------------

    def _wish(self, clauses: list[_Clause]) -> Description:
        target: Thing | None = None
        said: list[str] = []
        avoid: list[Thing] = []
        asked_for = False
        for clause in clauses:
            if len(clauses) > 1 and self._frame.issuperset(words_of(clause.text)):
                continue
            if found := speech.AVOID.match(clause.text):
                avoid.append(self.nouns.parse(clause.text[found.end() :]))
                continue
            if (found := speech.MENTION.match(clause.text)) and target is None and self._acts_on_it(clauses):
                target = self.nouns.parse(clause.text[found.end() :])
                continue
            if target is not None and self._acts_on_it([clause]):
                continue
            rest = self._stripped(clause.rest)
            asked = clause.motion == "need" or self._asks_for_use(clause.rest) or speech.SAYS.match(rest)
            thing = None if asked else self._wanted(clause)
            if thing is None:
                said.append(clause.text)
            elif target is None or (clause.motion == "goal" and not asked_for):
                # What is asked for with a verb counts more than what is only mentioned.
                target, asked_for = thing, clause.motion == "goal"
        needs, where = self._needs(said)
        kind: Kind = "demand" if needs or target is None else "object_goal"
        if target is not None and where is not None and not target.room:
            target = replace(target, room=where)
        return Description(kind=kind, target=target, needs=needs, needs_room=where, avoid=tuple(avoid))

    def _acts_on_it(self, clauses: list[_Clause]) -> bool:
        """Whether one of the clauses says what to do with a thing named before: "turn it on"."""
        return any(
            c.motion in ("goal", "approach", "stop", "bare", "turn") and self._pronouns.intersection(words_of(c.text))
            for c in clauses
        )

    def _needs(self, said: list[str]) -> tuple[tuple[str, ...], str | None]:
        """Sentences that state needs, without the room that they are to be met in and without those that say nothing else."""
        room: str | None = None
        told: list[str] = []
        for sentence in said:
            if found := self._in_room.search(sentence):
                room = self.lexicon.room_names[found[1]]
                sentence = (sentence[: found.start()] + sentence[found.end() :]).strip()
            elif found := self._to_room.search(sentence):
                room = self.lexicon.room_names[found[2]]
                sentence = f"{sentence[: found.start()]}{found[1]} the room{sentence[found.end() :]}"
            told.append(sentence)
        telling = [text for text in told if not self._frame.issuperset(words_of(text))]
        return tuple(telling or [text for text in said if text]), room

    def _asks_for_use(self, rest: str) -> bool:
        """ "something to drink", "a quiet corner where I can sit": described by its use alone."""
        words = [w for w in rest.split() if w != "me" and w not in self.nouns.articles]
        for at, word in enumerate(words[:3]):
            if word in self._places:
                return at + 1 < len(words) and words[at + 1] not in self.nouns.relation_phrases
            if self.lexicon.name_of(word) is not None:
                break
        return False

    def _wanted(self, clause: _Clause) -> Thing | None:
        text = self._stripped(clause.rest)
        if not text:
            return None
        thing = self.nouns.parse(text)
        verb = clause.text[: len(clause.text) - len(clause.rest)].strip()
        if not thing.queries:
            known = any(self.knows(mark) for relation in thing.relations for mark in relation.landmarks)
            return thing if thing.colour or known or thing.room or thing.superlative else None
        # "I want a drink", "get me a cup of tea": what is wanted is no thing that a home holds, so it is a need.
        wishful = verb.endswith(("need", "want", "like", "give me", "get", "get me", "bring me", "fetch"))
        if wishful and re.search(r"(?<!front)(?<!left)(?<!right)(?<!top)(?<!side) of ", text):
            return None
        if (
            wishful
            and self.lexicon.name_of(thing.phrase.split()[-1]) is None
            and self.lexicon.name_of(thing.phrase) is None
        ):
            return None
        return thing


def _leg(motion: Motion) -> Literal["leave", "pass", "approach"]:
    if motion == "leave":
        return "leave"
    return "pass" if motion in ("pass", "turn") else "approach"
