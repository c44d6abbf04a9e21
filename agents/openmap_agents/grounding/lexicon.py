"""The words that the built-in interpreter knows, read from ``data/``: household names, verbs, relations, colours, rooms,
uses.

Nothing here decides what an instruction means. It answers: is this a known name and what is it called, which of these
phrases does the text begin with, which room is meant.
"""

from __future__ import annotations

import difflib
import json
import re
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any

STRUCTURE = frozenset({"wall", "floor", "ceiling", "beam", "baseboard", "column"})
"""Names of what a home is built of: ranked low unless asked for."""
OPENINGS = frozenset({"balcony door", "door", "french door", "front door", "garage door", "window"})
"""Names of what stands in a wall and parts rooms as it does."""
FLAT = frozenset(
    {"balcony door", "bath mat", "blinds", "curtain", "door", "doormat", "french door", "front door", "mirror", "photo frame",
     "picture", "poster", "room divider", "rug", "shower curtain", "wardrobe", "whiteboard", "window"}
)  # fmt: skip
"""Names of things that may be as large and flat as a wall or a floor, so that their shape says nothing against them."""

_IRREGULAR = {"shelves": "shelf", "knives": "knife", "bookshelves": "bookshelf", "people": "person", "scarves": "scarf"}


def singular(word: str) -> str:
    """The singular of a regular English noun: "boxes" -> "box"."""
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    if len(word) > 4 and word.endswith("ies"):
        return word[:-3] + "y"
    if len(word) > 4 and re.search(r"(?:ch|sh|ss|x)es$", word):
        return word[:-2]
    if len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is")):
        return word[:-1]
    return word


_CONTRACTED = re.compile(r"\b(is|are|was|were|do|does|did|ca|wo|could|would|should|have|has|had)nt\b")
_IS = re.compile(r"\b(where|what|there|that|who)s\b")
_I = re.compile(r"\bi(m|ve)\b")


def normalised(text: str) -> str:
    """Lower case, plain quotes, apostrophes where they were left out, single blanks; sentence punctuation stays."""
    text = text.lower().replace("’", "'").replace("‘", "'").replace("“", '"').replace("”", '"')
    text = _I.sub(r"i'\1", _IS.sub(r"\1's", _CONTRACTED.sub(r"\1n't", text)))
    return re.sub(r"\s+", " ", text).strip()


def words_of(text: str) -> list[str]:
    """The words of a normalised text, without punctuation."""
    return re.findall(r"[a-z0-9][a-z0-9'\-]*", text)


@dataclass(frozen=True)
class Lexicon:
    """The data files, indexed.

    Parameters
    ----------
    names : dict
        Household name -> its other names.
    canonical : dict
        Any known surface form -> household name.
    rooms : dict
        Room -> telling things with a weight 0..1.
    room_names : dict
        Any known name of a room -> the room.
    affordances : dict
        Household name -> what such a thing is for, in short phrases.
    words : dict
        ``lexicon.json``: verbs, relations, colours and so on.
    """

    names: dict[str, tuple[str, ...]]
    canonical: dict[str, str]
    rooms: dict[str, dict[str, float]]
    room_names: dict[str, str]
    affordances: dict[str, tuple[str, ...]]
    words: dict[str, Any]
    noun_words: tuple[str, ...] = field(default=())

    def name_of(self, phrase: str) -> str | None:
        """The household name for a phrase in singular or plural, None if it is not known."""
        if phrase in self.canonical:
            return self.canonical[phrase]
        head, _, last = phrase.rpartition(" ")
        one = f"{head} {singular(last)}".strip()
        # "arm chair", "arm-chair" and "armchair" are one name.
        return (
            self.canonical.get(one)
            or self.canonical.get(re.sub("[ -]", "", one))
            or self.canonical.get(one.replace("-", " "))
        )

    def room_of(self, phrase: str) -> str | None:
        """The room that a phrase names, None if it names none."""
        words = [w for w in words_of(phrase) if w not in self.words["articles"]]
        return self.room_names.get(" ".join(words))

    def spelled(self, word: str) -> str | None:
        """The known noun word that an unknown word is probably a misspelling of."""
        if len(word) < 5 or word in self.noun_words or singular(word) in self.noun_words:
            return None
        near = difflib.get_close_matches(word, self.noun_words, n=1, cutoff=0.8)
        return near[0] if near else None


def leading(words: list[str], phrases: frozenset[str], at: int = 0) -> int:
    """How many words from ``at`` on form the longest of the phrases; 0 = none."""
    for length in range(min(8, len(words) - at), 0, -1):
        if " ".join(words[at : at + length]) in phrases:
            return length
    return 0


def _text(name: str) -> str:
    return resources.files(__package__).joinpath("data", name).read_text(encoding="utf-8")


def _lines(name: str) -> list[str]:
    return [line.strip() for line in _text(name).splitlines() if line.strip() and not line.startswith("#")]


@cache
def load_lexicon() -> Lexicon:
    """The lexicon of this package; read once."""
    names: dict[str, tuple[str, ...]] = {}
    for line in _lines("vocabulary.txt"):
        name, _, others = line.partition(":")
        names[name.strip()] = tuple(other.strip() for other in others.split(",") if other.strip())
    canonical = {other: name for name, others in names.items() for other in others}
    canonical.update({name: name for name in names})
    affordances: dict[str, tuple[str, ...]] = {}
    for line in _lines("affordances.txt"):
        kinds, _, uses = line.partition("|")
        for kind in kinds.split(","):
            affordances[kind.strip()] = tuple(use.strip() for use in uses.split(";") if use.strip())
    rooms = json.loads(_text("rooms.json"))
    return Lexicon(
        names=names,
        canonical=canonical,
        rooms={room: entry["things"] for room, entry in rooms.items()},
        room_names={name: room for room, entry in rooms.items() for name in entry["names"]},
        affordances=affordances,
        words=json.loads(_text("lexicon.json")),
        noun_words=tuple(sorted({word for surface in canonical for word in surface.split()})),
    )
