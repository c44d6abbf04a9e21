"""Which words for looks people use of which things: colours, materials, shapes, patterns, and which of them are hard to tell apart.

The tables are hand-written data (``data/attributes.json``). A word is *clear* of a thing if everybody would agree that it is true
of it or that it is not; what is not clear is never said.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_scenes import Instance


@dataclass(frozen=True)
class Looks:
    """The tables of ``data/attributes.json``; sets are of kinds of things.

    Parameters
    ----------
    colourless : frozenset of str
        Nobody names them by their colour: it is that of a pot or a frame, or all are alike.
    alike : frozenset of frozenset of str
        Pairs of colours that people mix up.
    materials, unclear_materials : dict, frozenset
        Material word -> the values of ``Instance.attributes`` that it is true of; values that do not show.
    material_of : dict
        Material word -> kinds that it is said of.
    words : dict
        Word for shape, pattern or make -> (attribute, its value, kinds that it is said of).
    largest_of, tallest_of : frozenset of str
        Kinds of which one says "the largest", "the tallest".
    holding, supports, covering : frozenset of str
        Kinds inside whose boxes things lie, that things are said to be on, and under.
    stay_by, not_beside, at_windows : frozenset of str
        Kinds that things are by whatever their height, that nothing is said to be next to, and that are at windows anyway.
    not_passed, only_the : frozenset of str
        Kinds that no way is told by, and that nobody asks for any one of.
    between_rooms : frozenset of str
        Kinds that belong to two rooms, so that people would not agree which is meant; their sorts may be in one.
    one_of_a_kind : frozenset of str
        Kinds of which nobody says more than the name where there is but one.
    """

    colourless: frozenset[str]
    alike: frozenset[frozenset[str]]
    materials: dict[str, frozenset[str]]
    unclear_materials: frozenset[str]
    material_of: dict[str, frozenset[str]]
    words: dict[str, tuple[str, str, frozenset[str]]]
    largest_of: frozenset[str]
    tallest_of: frozenset[str]
    holding: frozenset[str]
    supports: frozenset[str]
    covering: frozenset[str]
    stay_by: frozenset[str]
    not_passed: frozenset[str]
    not_beside: frozenset[str]
    only_the: frozenset[str]
    at_windows: frozenset[str]
    between_rooms: frozenset[str]
    one_of_a_kind: frozenset[str]

    def colour_said(self, thing: Instance) -> str | None:
        """The colour that people would name the thing by, if any: not that of a plant, which would be its pot's."""
        colour = thing.attributes.get("colour")
        return None if colour is None or vocabulary().kind(thing.category) in self.colourless else colour

    def colour_clear(self, thing: Instance, colour: str) -> bool:
        """Whether all agree if the thing has the colour: known, not close to it, and not clear glass."""
        own = thing.attributes.get("colour")
        if own is None or (own == "white" and thing.attributes.get("material") == "glass"):
            return False
        return frozenset((own, colour)) not in self.alike

    def material_said(self, thing: Instance) -> str | None:
        """The material word that people would use of the thing, if any ("wooden" of an oak table)."""
        kind = vocabulary().kind(thing.category)
        for word, kinds in self.material_of.items():
            if kind in kinds and thing.attributes.get("material") in self.materials[word]:
                return word
        return None

    def is_made_of(self, thing: Instance, word: str) -> bool:
        """Whether the material word is true of the thing."""
        return thing.attributes.get("material") in self.materials[word]

    def material_clear(self, thing: Instance) -> bool:
        """Whether the thing's material is known and can be seen for what it is."""
        return thing.attributes.get("material") not in {None, *self.unclear_materials}

    def looks_said(self, thing: Instance) -> list[str]:
        """Words for the shape, pattern or make of the thing."""
        kind = vocabulary().kind(thing.category)
        return [word for word, (_, _, kinds) in self.words.items() if kind in kinds and self.has_look(thing, word)]

    def has_look(self, thing: Instance, word: str) -> bool:
        """Whether the word is true of the thing."""
        key, value, _ = self.words[word]
        return thing.attributes.get(key) == value

    def look_clear(self, thing: Instance, word: str) -> bool:
        """Whether it is known if the word is true of the thing."""
        return self.words[word][0] in thing.attributes


@cache
def looks() -> Looks:
    """The tables of ``data/attributes.json``."""
    data = load_data("attributes.json")
    return Looks(
        colourless=frozenset(data["colour_not_said_of"]),
        alike=frozenset(frozenset(pair) for pair in data["alike"]),
        materials={word: frozenset(names) for word, names in data["materials"].items()},
        unclear_materials=frozenset(data["unclear_materials"]),
        material_of={word: frozenset(kinds) for word, kinds in data["material_said_of"].items()},
        words={
            word: (entry["key"], entry.get("value", word), frozenset(entry["of"]))
            for word, entry in data["looks"].items()
        },
        largest_of=frozenset(data["largest_said_of"]),
        tallest_of=frozenset(data["tallest_said_of"]),
        holding=frozenset(data["things_lie_inside"]),
        supports=frozenset(data["can_be_on"]),
        covering=frozenset(data["can_be_under"]),
        stay_by=frozenset(data["stay_by"]),
        not_passed=frozenset(data["not_passed"]),
        not_beside=frozenset(data["not_beside"]),
        only_the=frozenset(data["only_the"]),
        at_windows=frozenset(data["always_at_windows"]),
        between_rooms=frozenset(data["between_rooms"]),
        one_of_a_kind=frozenset(data["one_of_a_kind"]),
    )
