"""The numbers that the ScanNet200 benchmark's files give to its classes: those of ScanNet's own label table, with gaps.

Source: the benchmark's published constants. The names, in the same order, are ``openmap_scenes.taxonomy.SCANNET200``.
"""

from __future__ import annotations

from openmap_scenes.taxonomy import SCANNET200, labels_of

_IDS = """
    1-11 13-19 21-24 26-29 31-36 38-42 44-52 54-59 62-80 82 84 86-90 93 95-107 110 112 115 116 118 120-122 125 128
    130-132 134 136 138-141 145 148 154-157 159 161 163 165 166 168-170 177 180 185 188 191 193 195 202 208 213 214
    221 229 230 232 233 242 250 261 264 276 283 286 300 304 312 323 325 331 342 356 370 392 395 399 408 417 488 540
    562 570 572 581 609 748 776 1156 1163-1176 1178-1191
"""


def _numbers(text: str) -> list[int]:
    found: list[int] = []
    for word in text.split():
        first, _, last = word.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


NAME_OF: dict[int, str] = dict(zip(_numbers(_IDS), SCANNET200, strict=True))
"""Class name by number, all 200."""
NUMBER_OF: dict[str, int] = {name: number for number, name in NAME_OF.items()}
"""The other way round."""
STRUCTURE: frozenset[int] = frozenset({NUMBER_OF["wall"], NUMBER_OF["floor"]})
"""What the benchmark's instance task leaves out."""
INSTANCE_CLASSES: tuple[int, ...] = tuple(n for n in NAME_OF if n not in STRUCTURE)
"""The 198 classes of the instance task, ascending."""


def category_number(name: str) -> int:
    """The number of the class that a free name belongs to; 0 where the benchmark has none for it."""
    label = labels_of(name).scannet200
    return NUMBER_OF[label] if label else 0
