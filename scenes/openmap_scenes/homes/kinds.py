"""What the pieces of the furniture library are called here, and which split of homes may use them.

``kinds.tsv`` is written by hand: one line per piece that belongs in a home, with its kind in plain English and, where the
library's name tells it, what it is made of. Pieces that are not listed (people, vehicles, garden, models that are broken)
are never used.
"""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from openmap_scenes.errors import DataError
from openmap_scenes.taxonomy import labels_of

SPLITS = ("train", "val", "test")

# Kinds that only one split has, from the library or made by rule. Those of ``test`` are the new things that a method meets
# there and nowhere before: common in homes and large enough to be found, one or two of every sort of room, and none that a
# room could not do without. Their library pieces lay in these splits before, so that no piece changes its split for them.
TEST_ONLY = (
    "alarm clock", "briefcase", "changing table", "cuckoo clock", "day bed", "dressing table", "entertainment center",
    "high chair", "potty", "projector", "sandwich maker", "stand mixer", "sushi tray", "towel radiator", "toy plane",
)  # fmt: skip
VAL_ONLY = (
    "bonsai", "ceiling fan", "deep fryer", "midi keyboard", "rocking horse", "room divider", "treadmill", "wheelchair",
)  # fmt: skip
KEPT_FOR = dict.fromkeys(TEST_ONLY, "test") | dict.fromkeys(VAL_ONLY, "val")
_TABLE = Path(__file__).with_name("kinds.tsv")


@dataclass(frozen=True)
class Kind:
    """What one piece of the library is: its kind, and words that describe it ({"material": "oak"})."""

    kind: str
    attributes: dict[str, str]


@cache
def read_kinds() -> dict[str, Kind]:
    """Kind by piece id, in the order of ``kinds.tsv``."""
    kinds = {}
    for line in _TABLE.read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        fields = line.split("\t")
        if len(fields) not in (2, 3):
            raise DataError(_TABLE, f"the line {line!r}", "kind, piece and perhaps attributes, separated by tabs")
        words = (pair.partition("=") for pair in fields[2].split(";")) if len(fields) == 3 else ()
        kinds[fields[1]] = Kind(fields[0], {key: value for key, _, value in words})
    return kinds


# Kinds of one or two pieces are shared out together with others that serve the same end, so that every split can wash, cook
# and sleep; of a pair in no family one goes to train, and single pieces in no family are shared out together.
_FAMILIES = (
    "bathtub|corner bathtub|shower stall",
    "stove|oven|double oven|tall cabinet|toaster oven",
    "tv stand|tv cabinet|entertainment center|sideboard",
    "television|wall television",
    "laptop|computer",
    "washing machine|dryer|laundry basket",
    "piano bench|trunk|suitcase|bench",
    "child bed|bunk bed|captain's bed|day bed|crib|cradle",
    "chest of drawers|dresser|dressing table|cupboard|cabinet",
    (
        "teddy bear|toy car|toy train|toy plane|toy|doll|soccer ball|basketball|puzzle|xylophone|rubik's cube"
        "|rocking horse|dollhouse|tricycle|skateboard"
    ),
    (
        "microwave|toaster|kettle|coffee maker|coffee machine|blender|stand mixer|sandwich maker|juicer"
        "|deep fryer|coffee press"
    ),
    (
        "knife block|cutting board|bread|bread box|pot|bowl|paper towels|spice rack|utensil holder|teapot"
        "|kitchen scale|plate"
    ),
    "bowl of fruit|bowl of apples|bowl of salad|birthday cake|roast chicken|place setting|sushi tray|butter",
    "mug|cup|coffee cup|glass|wine bottle|beer bottle|milk carton|beer glass|cocktail glass",
    "ficus|yucca|peace lily|spider plant|bonsai|cactus|orchid|succulent|flowers|tulips|lilies|bamboo plant",
    "book|newspaper|remote control|tablet|camera|keys|candle|ashtray|sunglasses|chessboard|game controller",
    "hat|cap|handbag|folded clothes|briefcase|backpack|sneakers|shoes|slippers|umbrella",
    "pen holder|phone|letter tray|printer|headphones|calendar|filing cabinet|wastebasket",
    "toilet paper|hanging towel|bath mat|soap dispenser|bottle|brush|towel",
    "floor lamp|ceiling lamp|ceiling fan|fireplace|piano|aquarium",
)


@cache
def read_splits() -> dict[str, str]:
    """Split by piece id: no piece is in two, and a kind of three pieces or more is in all of them.

    Within a kind (or a family of rare ones) the pieces are ordered by a digest of their ids; the first fifth goes to val, the
    next 15 % to test, the rest to train.
    """
    kinds = read_kinds()
    count = Counter(kind.kind for kind in kinds.values())
    family = {kind: f"family {i}" for i, row in enumerate(_FAMILIES) for kind in row.split("|")}
    groups: dict[str, list[str]] = defaultdict(list)
    for piece, kind in kinds.items():
        alone = kind.kind if count[kind.kind] > 1 else "others"
        groups[kind.kind if count[kind.kind] > 2 else family.get(kind.kind, alone)].append(piece)
    splits: dict[str, str] = {}
    for pieces in groups.values():
        n = len(pieces)
        n_val, n_test = max(1, round(0.2 * n)), max(1, round(0.15 * n))
        ordered = sorted(pieces, key=_digest)
        if n == 2:
            splits |= {ordered[0]: "train", ordered[1]: "val" if int(_digest(ordered[1]), 16) % 2 else "test"}
            continue
        for i, piece in enumerate(ordered):
            splits[piece] = "val" if i < n_val else "test" if i < n_val + n_test else "train"
    return splits


def mpcat40(kind: str) -> str:
    """The Matterport category of a kind; "objects" for what has no other."""
    return labels_of(kind).mpcat40 or "objects"


def _digest(piece: str) -> str:
    return hashlib.sha256(piece.encode()).hexdigest()
