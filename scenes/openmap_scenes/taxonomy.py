"""Label sets of the field and how a free name maps to them: mpcat40 (Matterport3D), ScanNet200, LVIS.

``taxonomy.tsv`` is written by hand: one line is one thing with all the ways in which annotators write its name, and what it is
called in each label set. A name that is not listed goes by its head noun ("carved dining chair" -> "chair"); nothing is matched
by likeness of spelling, since a label that is wrong is worse than none.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

from openmap_scenes.errors import DataError

_TABLE = Path(__file__).with_name("taxonomy.tsv")

# Matterport3D's forty classes at their indices 1..40, between "nothing" and "nobody knows".
_MPCAT40 = """
    void wall floor chair door table picture cabinet cushion window sofa bed curtain chest_of_drawers plant sink
    stairs ceiling toilet stool towel mirror tv_monitor shower column bathtub counter fireplace lighting beam
    railing shelving blinds gym_equipment seating board_panel furniture appliances clothes objects misc unlabeled
"""
MPCAT40: tuple[str, ...] = tuple(_MPCAT40.split())

# ScanNet200 in the order of its ids; behind each name the group of the benchmark that it is scored in.
_SCANNET200 = """
    wall:h, chair:h, floor:h, table:h, door:h, couch:h, cabinet:h, shelf:h, desk:h, office chair:h, bed:h, pillow:h,
    sink:h, picture:h, window:h, toilet:h, bookshelf:h, monitor:h, curtain:h, book:h, armchair:h, coffee table:h,
    box:h, refrigerator:h, lamp:h, kitchen cabinet:h, towel:h, clothes:h, tv:h, nightstand:h, counter:h, dresser:h,
    stool:h, cushion:c, plant:h, ceiling:h, bathtub:h, end table:c, dining table:c, keyboard:c, bag:c, backpack:h,
    toilet paper:c, printer:c, tv stand:h, whiteboard:h, blanket:c, shower curtain:h, trash can:h, closet:h,
    stairs:h, microwave:c, stove:h, shoe:c, computer tower:c, bottle:c, bin:c, ottoman:c, bench:c, board:h, washing
    machine:h, mirror:h, copier:h, basket:c, sofa chair:h, file cabinet:h, fan:c, laptop:c, shower:h, paper:t,
    person:c, paper towel dispenser:c, oven:c, blinds:h, rack:c, plate:t, blackboard:h, piano:c, suitcase:c, rail:c,
    radiator:h, recycling bin:h, container:c, wardrobe:h, soap dispenser:t, telephone:c, bucket:t, clock:t, stand:c,
    light:c, laundry basket:c, pipe:c, clothes dryer:h, guitar:t, toilet paper holder:t, seat:c, speaker:t,
    column:c, bicycle:c, ladder:c, bathroom stall:h, shower wall:h, cup:t, jacket:c, storage bin:c, coffee maker:c,
    dishwasher:c, paper towel roll:t, machine:c, mat:c, windowsill:c, bar:t, toaster:t, bulletin board:c, ironing
    board:t, fireplace:c, soap dish:t, kitchen counter:h, doorframe:h, toilet paper dispenser:t, mini fridge:c, fire
    extinguisher:t, ball:t, hat:t, shower curtain rod:t, water cooler:c, paper cutter:t, tray:t, shower door:c,
    pillar:c, ledge:c, toaster oven:t, mouse:t, toilet seat cover dispenser:t, furniture:c, cart:c, storage
    container:t, scale:t, tissue box:t, light switch:t, crate:t, power outlet:t, decoration:c, sign:t, projector:t,
    closet door:c, vacuum cleaner:c, candle:t, plunger:t, stuffed animal:t, headphones:t, dish rack:c, broom:t,
    guitar case:t, range hood:c, dustpan:t, hair dryer:t, water bottle:t, handicap bar:t, purse:t, vent:t, shower
    floor:t, water pitcher:t, mailbox:h, bowl:t, paper bag:t, alarm clock:t, music stand:t, projector screen:c,
    divider:c, laundry detergent:t, bathroom counter:c, object:h, bathroom vanity:h, closet wall:h, laundry
    hamper:c, bathroom stall door:c, ceiling light:c, trash bin:c, dumbbell:t, stair rail:h, tube:t, bathroom
    cabinet:c, cd case:t, closet rod:t, coffee kettle:t, structure:c, shower head:t, keyboard piano:t, case of water
    bottles:t, coat rack:t, storage organizer:c, folded chair:t, fire alarm:t, power strip:t, calendar:t, poster:t,
    potted plant:c, luggage:t, mattress:c
"""
_GROUPS = {"h": "head", "c": "common", "t": "tail"}
_SCANNET200_GROUP = {
    name: _GROUPS[letter] for name, letter in (" ".join(entry.split()).split(":") for entry in _SCANNET200.split(","))
}
SCANNET200: tuple[str, ...] = tuple(_SCANNET200_GROUP)

# Longer names than this are sentences, and their heads are not found by counting words.
_MOST_WORDS = 12
_QUANTITY = """
    stack stacks pile piles set sets pair pairs row rows group bunch piece pieces lot lots heap collection part
    remains
"""
_PREPOSITION = """
    of with w in on for at by from under over above behind near next to inside beside without
"""
_FILLER = "a an the some other another unknown possibly probably maybe otherroom"
# Words that say too little, or too many things, to tell what a longer name that ends in them means.
_NO_HEAD = """
    accessory adapter angel arm arrow art baby bar base bead bear belongings bill block bow bracket branch burner
    bush button can cap car case chain child clip clutter coil compass cone construction control controls cooler
    cover cross cube cylinder dart decor device display drain equipment feather felt figure file frame game grass
    gum hanging hatch head holder hood horn human icon image ink item jack label lace leaf letter level lift log
    machine man mask material medal misc model mount nail note nut object oil organizer other page paint panel
    people pin plain platform pot present print pump rail range record register remove ring robot rock rod roll
    screen server service shade shades shell skull sphere stage stamp stand star station step stick sticker stone
    storage string structure stuff supply tag tank tap thing throw top trim trunk tube twine unclear undefined unit
    unknown void wheel wire woman wood
"""
_QUANTITIES, _PREPOSITIONS, _FILLERS, _NO_HEADS = (
    frozenset(words.split()) for words in (_QUANTITY, _PREPOSITION, _FILLER, _NO_HEAD)
)


@dataclass(frozen=True)
class Labels:
    """What a thing is called in each label set; None where the set has no name for it."""

    mpcat40: str | None = None
    scannet200: str | None = None
    lvis: str | None = None


def scannet200_group(name: str) -> str:
    """The group in which the ScanNet200 benchmark scores a class, "head", "common" or "tail"; KeyError for other names."""
    return _SCANNET200_GROUP[name]


@lru_cache(maxsize=8192)
def labels_of(name: str) -> Labels:
    """The labels of a free name ("Office Chair", "coffee_table", "armchairs"); all None where the table does not know it.

    Tried in this order: the name as it is, without a remark in brackets or behind ``/`` or a comma, what stands before a
    preposition ("desk with clutter"), what stands behind a quantity ("stack of chairs"), and the longest known end of the name.
    """
    whole, alternatives = _parts(name)
    for part in (*whole, *alternatives):
        found = _exact(part)
        if found:
            return found
    for part in alternatives:
        found = _by_phrase(part)
        if found:
            return found
    return Labels()


def _parts(name: str) -> tuple[list[list[str]], list[list[str]]]:
    """The words of a name as a whole, with and without its brackets, and of each alternative that it offers ("shelf / cabinet")."""
    text = unicodedata.normalize("NFKD", name[:400]).encode("ascii", "ignore").decode().lower()
    bare = re.sub(r"\([^)]*\)?", " ", text)
    # "w/" is how annotators abbreviate "with".
    pieces = re.split(r"[/,;|?]", re.sub(r"\bw/|/w\b", " with ", bare))
    whole, alternatives = [_words(text), _words(bare)], [_words(piece) for piece in pieces]
    short = range(1, _MOST_WORDS + 1)
    return [words for words in whole if len(words) in short], [words for words in alternatives if len(words) in short]


def _words(text: str) -> list[str]:
    """Words of letters and digits, without articles, apostrophes and the number that tells copies apart ("chair_02")."""
    words = re.sub(r"[^a-z0-9]+", " ", text.replace("'", "")).split()
    while len(words) > 1 and words[-1].isdigit():
        words.pop()
    kept = [word for word in words if word not in _FILLERS]
    return kept or words


def _exact(words: list[str]) -> Labels | None:
    """The entry of exactly these words, in singular or plural, written together or apart."""
    table = _table()
    *front, last = words
    for ending in (last, *_singular(last)):
        phrase = [*front, ending]
        found = table.get(" ".join(phrase)) or _squeezed().get("".join(phrase))
        if found:
            return found
    return None


def _by_phrase(words: list[str]) -> Labels | None:
    """The entry of the noun that a phrase is about."""
    at = next((i for i, word in enumerate(words) if i and word in _PREPOSITIONS), None)
    if at is not None:
        before, after = words[:at], words[at + 1 :]
        if words[at] == "of" and before[-1] in _QUANTITIES:
            return (_exact(after) or _by_phrase(after)) if after else None
        found = _exact(before) or _by_head(before)
        if found:
            return found
    return _by_head(words)


def _by_head(words: list[str]) -> Labels | None:
    """The entry of the longest end of the words; English compounds carry their head last."""
    for start in range(1, len(words)):
        end = words[start:]
        if len(end) == 1 and (end[0] in _NO_HEADS or any(word in _NO_HEADS for word in _singular(end[0]))):
            return None
        found = _exact(end)
        if found:
            return found
    return None


def _singular(word: str) -> list[str]:
    """What a word may be the plural of, likeliest first."""
    if not word.endswith("s") or word.endswith("ss") or len(word) < 4:
        return []
    forms = []
    if word.endswith("ies"):
        forms.append(word[:-3] + "y")
    if word.endswith("ves"):
        forms += [word[:-3] + "f", word[:-3] + "fe"]
    forms.append(word[:-1])
    if word.endswith("es"):
        forms.append(word[:-2])
    return forms


@cache
def _table() -> dict[str, Labels]:
    """Labels by normalised name, in the order of the table."""
    table: dict[str, Labels] = {}
    for number, line in enumerate(_TABLE.read_text(encoding="utf-8").splitlines(), start=1):
        if not line or line.startswith("#"):
            continue
        fields = line.split("\t")
        if len(fields) != 4:
            raise DataError(f"{_TABLE}, line {number}", f"{len(fields)} columns", "names, mpcat40, scannet200, lvis")
        labels = Labels(*(text or None for text in fields[1:]))
        for name in fields[0].split("|"):
            key = " ".join(_words(name.lower()))
            if key in table:
                raise DataError(f"{_TABLE}, line {number}", f"{name!r} a second time", "each name once")
            table[key] = labels
    return table


@cache
def _squeezed() -> dict[str, Labels]:
    """Labels by the name's letters alone, for what is written together or apart ("arm chair", "book shelf")."""
    squeezed: dict[str, Labels] = {}
    for key, labels in _table().items():
        squeezed.setdefault(key.replace(" ", ""), labels)
    return squeezed


LVIS: tuple[str, ...] = tuple(sorted({labels.lvis for labels in _table().values() if labels.lvis}))
