"""What people call things: one kind for the many category words of the data sets, its everyday names, and what it is a sort of.

The tables are hand-written data (``data/kinds.json``). A category word that no table lists is looked up by its head noun ("rattan
sofa" is a sofa) and, failing that, is a kind of its own.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from openmap_scenes.taxonomy import labels_of

BUILDING = frozenset({"wall", "ceiling", "column", "beam", "railing", "void", "unlabeled"})
"""What mpcat40 calls what nobody asks for ("bath wall", "support beam"); its floor also holds rugs, and is not among them."""
_NUMBER = re.compile(r"\s*#?\d+$")


def load_data(name: str) -> Any:
    """The contents of a JSON file in ``episodes/data``."""
    return json.loads(files("openmap_env.episodes").joinpath("data", name).read_text("utf-8"))


@dataclass(frozen=True)
class Vocabulary:
    """Kinds of things and their names.

    Parameters
    ----------
    names : dict
        Kind -> what people say for it, the kind's own name first.
    kind_by_word : dict
        Any listed word, lower case -> kind.
    parents : dict
        Kind -> the more general kinds that it also is.
    called : dict
        Kind -> names of the more general kinds that people also use for it ("sofa" of a loveseat).
    uncounted : frozenset of str
        Kinds of which one says "some" although their name is no plural ("bread").
    plurals : frozenset of str
        Kinds whose names that end in s are plurals ("the keys are").
    not_heads : frozenset of str
        Words that do not follow their last word ("guitar case").
    structure : frozenset of str
        Categories that nobody asks for: walls, floors, things without a name.
    room_names : dict
        A data set's room name -> what people say.
    unnamed_rooms : frozenset of str
        Room names that say nothing to a person.
    """

    names: dict[str, tuple[str, ...]]
    kind_by_word: dict[str, str]
    parents: dict[str, tuple[str, ...]]
    called: dict[str, tuple[str, ...]]
    uncounted: frozenset[str]
    plurals: frozenset[str]
    not_heads: frozenset[str]
    structure: frozenset[str]
    room_names: dict[str, str]
    unnamed_rooms: frozenset[str]
    _lineages: dict[str, frozenset[str]] = field(default_factory=dict, repr=False, compare=False)
    _kinds: dict[str, str] = field(default_factory=dict, repr=False, compare=False)
    _structures: dict[str, bool] = field(default_factory=dict, repr=False, compare=False)

    def kind(self, category: str) -> str:
        """The kind of a category word: as listed, else that of its longest listed ending, else the word itself."""
        if category not in self._kinds:
            self._kinds[category] = self._find_kind(" ".join(category.lower().replace("_", " ").split()))
        return self._kinds[category]

    def _find_kind(self, word: str) -> str:
        if word in self.kind_by_word:
            return self.kind_by_word[word]
        if word in self.not_heads or word in self.structure:
            return word
        parts = word.split()
        for first in range(1, len(parts)):
            ending = " ".join(parts[first:])
            if ending in self.not_heads or ending in self.structure:
                return word
            if ending in self.kind_by_word:
                return self.kind_by_word[ending]
        return word

    def lineage(self, category: str) -> frozenset[str]:
        """The kind of a category word and every more general kind that it also is."""
        if category not in self._lineages:
            found = [self.kind(category)]
            for kind in found:
                found.extend(parent for parent in self.parents.get(kind, ()) if parent not in found)
            self._lineages[category] = frozenset(found)
        return self._lineages[category]

    def is_a(self, category: str, noun: str) -> bool:
        """Whether people would call a thing of that category by that noun: an armchair is a chair, a chair no armchair."""
        return self.kind(noun) in self.lineage(category)

    def is_structure(self, category: str) -> bool:
        """Whether the category belongs to the building, or says nothing ("wall", "bath wall", "unknown /otherroom")."""
        if category not in self._structures:
            self._structures[category] = self._tell_structure(" ".join(category.lower().replace("_", " ").split()))
        return self._structures[category]

    def _tell_structure(self, word: str) -> bool:
        first = word.split("/")[0].strip()
        if not word or word in self.structure or word.replace(" ", "_") in self.structure or first in self.structure:
            return True
        if self.kind(word) in self.names:
            return False
        return word.startswith("unknown ") or labels_of(word).mpcat40 in BUILDING

    def sayable(self, category: str) -> tuple[str, ...]:
        """What people may say for a thing of that category, its own names first."""
        kind = self.kind(category)
        return self.names.get(kind, (kind,)) + self.called.get(kind, ())

    def number(self, noun: str) -> Literal["one", "many", "some"]:
        """Whether one says "is" and "a" of a noun, "are" and "some" ("the keys are"), or "is" and "some" ("bread is")."""
        kind = self.kind(noun)
        if kind in self.uncounted and not noun.endswith("s"):
            return "some"
        listed = kind in self.names and kind not in self.plurals | self.uncounted
        return "one" if listed or not noun.endswith("s") or noun.endswith("ss") else "many"

    def room(self, name: str) -> str | None:
        """What people call a room, or None if its name says nothing; nobody says its number ("bedroom 2", "region 5")."""
        word = _NUMBER.sub("", " ".join(name.lower().replace("_", " ").split()))
        word = self.room_names.get(word, word.split("/")[0].strip())
        return None if word in self.unnamed_rooms else self.room_names.get(word, word)


@cache
def vocabulary() -> Vocabulary:
    """The vocabulary of ``data/kinds.json``."""
    data = load_data("kinds.json")
    kinds: dict[str, dict[str, Any]] = data["kinds"]
    kind_by_word = {
        word.lower().replace("_", " "): kind
        for kind, entry in kinds.items()
        for word in [*entry.get("also", []), *entry["say"]]
    }
    return Vocabulary(
        names={kind: tuple(entry["say"]) for kind, entry in kinds.items()},
        kind_by_word=kind_by_word,
        parents={kind: tuple(entry.get("is_a", ())) for kind, entry in kinds.items()},
        called={kind: tuple(entry["called"]) for kind, entry in kinds.items() if "called" in entry},
        uncounted=frozenset(kind for kind, entry in kinds.items() if entry.get("number") == "some"),
        plurals=frozenset(kind for kind, entry in kinds.items() if entry.get("number") == "many"),
        not_heads=frozenset(data["head_noun_exceptions"]),
        structure=frozenset(data["structure"]),
        room_names=data["rooms"],
        unnamed_rooms=frozenset(data["unsayable_rooms"]),
    )
