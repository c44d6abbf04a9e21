"""What the pieces of the furniture library are called here, and which split of homes may use them.

``kinds.tsv`` is written by hand: one line per piece that belongs in a home, with its kind in plain English and, where the
library's name tells it, what it is made of. Pieces that are not listed (people, vehicles, garden, models that are broken)
are never used.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from openmap_scenes.errors import DataError

SPLITS = ("train", "val", "test")
_TABLE = Path(__file__).with_name("kinds.tsv")

_MPCAT40 = {
    "chair": "chair|armchair|office chair|child chair|folding chair|high chair|floor chair|recliner|wheelchair",
    "table": "dining table|round table|coffee table|desk|nightstand|folding table|bar table|dressing table|child table"
    "|changing table",
    "picture": "picture",
    "cabinet": "kitchen cabinet|wall cabinet|glass cabinet|tall cabinet|cabinet|cupboard|wardrobe|sideboard|tv stand"
    "|tv cabinet|kitchen drawers|kitchen island|filing cabinet|vanity|double vanity|entertainment center",
    "sofa": "sofa|corner sofa|loveseat|sofa bed|futon",
    "bed": "bed|child bed|bunk bed|captain's bed|day bed|crib|cradle",
    "curtain": "curtain",
    "chest_of_drawers": "dresser|chest of drawers",
    "plant": "potted plant|bonsai|cactus|ficus|yucca|orchid|lilies|tulips|flowers|peace lily|spider plant|succulent"
    "|bamboo plant|planter|christmas tree",
    "sink": "washbasin|kitchen sink",
    "toilet": "toilet",
    "stool": "stool|bar stool|piano bench",
    "towel": "towel|hanging towel",
    "mirror": "mirror",
    "tv_monitor": "television|wall television|computer",
    "shower": "shower stall",
    "bathtub": "bathtub|corner bathtub",
    "fireplace": "fireplace",
    "lighting": "table lamp|desk lamp|floor lamp|ceiling lamp|pendant lamp|candle",
    "shelving": "bookcase|shelves|wall shelf",
    "gym_equipment": "exercise bike|treadmill|punching bag",
    "seating": "bench|bean bag",
    "board_panel": "whiteboard",
    "appliances": "refrigerator|stove|oven|double oven|microwave|washing machine|dryer|range hood|chest freezer"
    "|toaster oven",
    "clothes": "folded clothes|slippers|sneakers|shoes|hat|cap",
    "furniture": "piano|grand piano|room divider|clothes rack|trunk",
    "wall": "wall",
    "floor": "floor",
    "ceiling": "ceiling",
    "window": "window",
    "door": "door frame|front door",
    "misc": "rug|round rug|bath mat|doormat",
}


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


@cache
def read_splits() -> dict[str, str]:
    """Split by piece id: no piece is in two, and a kind of three pieces or more is in all of them.

    Within a kind the pieces are ordered by a digest of their ids; about 20 % go to val and 15 % to test. Of two pieces one
    goes to train; a single one goes where its digest says.
    """
    groups: dict[str, list[str]] = defaultdict(list)
    for piece, kind in read_kinds().items():
        groups[kind.kind].append(piece)
    splits = {}
    for pieces in groups.values():
        ordered = sorted(pieces, key=_digest)
        n = len(ordered)
        n_val, n_test = max(1, round(0.2 * n)), max(1, round(0.15 * n))
        for i, piece in enumerate(ordered):
            share = int(_digest(piece)[:8], 16) / 16**8
            if n == 1:
                splits[piece] = "val" if share < 0.2 else "test" if share < 0.35 else "train"
            elif n == 2:
                splits[piece] = "train" if i else ("val" if share < 0.55 else "test")
            else:
                splits[piece] = "val" if i < n_val else "test" if i < n_val + n_test else "train"
    return splits


def mpcat40(kind: str) -> str:
    """The Matterport category of a kind; "objects" for all small things."""
    return _mpcat40_by_kind().get(kind, "objects")


@cache
def _mpcat40_by_kind() -> dict[str, str]:
    return {kind: category for category, kinds in _MPCAT40.items() for kind in kinds.split("|")}


def _digest(piece: str) -> str:
    return hashlib.sha256(piece.encode()).hexdigest()
