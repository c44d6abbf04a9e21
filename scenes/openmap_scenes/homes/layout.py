"""Which rooms a home has and how they lie: rows of rooms along a hall or along the living room, or one room for all.

Three families, as small houses and flats are drawn. *Corridor*: a hall with a row of rooms on each side, the living room
across its end. *Hub*: the living room in the middle, rows of rooms on its sides, perhaps a small hall among them. *Studio*:
one room, a bathroom, perhaps a hall. Rows that are nearly as long as what they lie along are stretched to match; others leave
a corner open, so that the outline becomes an L or a T. The whole is mirrored and turned at random.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from openmap_scenes.homes.rooms import WALL, Rect

# Kind: (area wanted in m2, shortest side allowed in m, longest side over shortest allowed).
ROOM_SIZES = {
    "studio": (28.0, 4.0, 1.8),
    "living room": (25.0, 3.4, 1.95),
    "kitchen": (12.0, 2.6, 1.9),
    "bedroom": (14.5, 3.0, 1.8),
    "children's room": (12.0, 2.7, 1.8),
    "bathroom": (7.0, 1.9, 2.1),
    "hall": (8.0, 1.35, 6.2),
    "office": (11.0, 2.6, 1.8),
    "dining room": (13.5, 2.9, 1.9),
    "laundry room": (6.0, 1.7, 2.3),
}
# The kinds and the shortest side in m, for those who need no more.
ROOM_KINDS = {kind: (area, short) for kind, (area, short, _) in ROOM_SIZES.items()}
SECOND_NAMES = {"bedroom": "guest bedroom", "bathroom": "guest bathroom"}
_BASE = ["living room", "kitchen", "bedroom", "bathroom"]
_EXTRA = ("children's room", "office", "dining room", "bedroom", "laundry room", "bathroom")
_WEIGHT = np.array([0.26, 0.2, 0.2, 0.12, 0.12, 0.1])
_COUNTS = ((2, 0.03), (3, 0.05), (4, 0.09), (5, 0.19), (6, 0.24), (7, 0.22), (8, 0.18))
# The narrowest stretch of open ground between two wings, and what rows are stretched by to avoid less, m.
_NOTCH = 1.3
Layout = tuple[list[str], list[Rect]]


def draw_layout(rng: np.random.Generator) -> Layout | None:
    """Kinds and rectangles (between wall middles, m) of a home's rooms, or None where this draw is of no use."""
    numbers, shares = zip(*_COUNTS, strict=True)
    count = int(rng.choice(numbers, p=np.array(shares) / sum(shares)))
    if count <= 3:
        return _finished(_studio(count == 3, rng), rng)
    extra = [str(k) for k in rng.choice(_EXTRA, max(0, count - 5), replace=False, p=_WEIGHT)]
    if "bathroom" in extra and count < 7:
        return None
    kinds = [*_BASE, *extra]
    family: Callable[[list[str], np.random.Generator], Layout | None] = _corridor
    if count == 4 or (count <= 6 and rng.random() < 0.35):
        family = _hub
    return _finished(family(kinds if count == 4 else [*kinds, "hall"], rng), rng)


def _finished(layout: Layout | None, rng: np.random.Generator) -> Layout | None:
    """Mirrored and turned at random, centred, in the order in which rooms are listed; None where a room is out of shape."""
    if layout is None or not all(_usable(k, r) for k, r in zip(*layout, strict=True)):
        return None
    kinds, rects = layout
    if any(a.overlaps(b, 1e-6) for i, a in enumerate(rects) for b in rects[i + 1 :]):
        return None
    sx, sz, swap = (bool(rng.random() < 0.5) for _ in range(3))
    turned = [_turned(r, sx, sz, swap) for r in rects]
    cx = (min(r.x0 for r in turned) + max(r.x1 for r in turned)) / 2
    cz = (min(r.z0 for r in turned) + max(r.z1 for r in turned)) / 2
    placed = [Rect(round(r.x0 - cx, 3), round(r.z0 - cz, 3), round(r.x1 - cx, 3), round(r.z1 - cz, 3)) for r in turned]
    order = sorted(range(len(kinds)), key=lambda i: list(ROOM_SIZES).index(kinds[i]))
    return [kinds[i] for i in order], [placed[i] for i in order]


def _turned(r: Rect, mirror_x: bool, mirror_z: bool, swap: bool) -> Rect:
    x0, x1 = (-r.x1, -r.x0) if mirror_x else (r.x0, r.x1)
    z0, z1 = (-r.z1, -r.z0) if mirror_z else (r.z0, r.z1)
    return Rect(z0, x0, z1, x1) if swap else Rect(x0, z0, x1, z1)


def _usable(kind: str, rect: Rect) -> bool:
    short, long = sorted((rect.width - WALL, rect.depth - WALL))
    _, least, ratio = ROOM_SIZES[kind]
    return short >= least and long / short <= ratio


def _width(kind: str, depth: float, rng: np.random.Generator) -> float:
    """How wide a room of a kind is in a row of that depth, between wall middles, m."""
    area, short, ratio = ROOM_SIZES[kind]
    wanted = area * float(rng.uniform(0.88, 1.2)) / depth
    low = max(short, (depth - WALL) / ratio) + WALL + 0.02
    return min(max(wanted, low), (depth - WALL) * ratio + WALL - 0.02)


def _blocks(kinds: list[str], rng: np.random.Generator) -> list[list[str]]:
    """The rooms in random order, a second bathroom beside a bedroom half of the time."""
    blocks = [[k] for k in kinds]
    if kinds.count("bathroom") == 2 and rng.random() < 0.5:
        blocks.remove(["bathroom"])
        bedroom = blocks[blocks.index(["bedroom"])]
        bedroom.insert(int(rng.integers(2)), "bathroom")
    return [blocks[i] for i in rng.permutation(len(blocks))]


def _share(blocks: list[list[str]], first: float, second: float) -> tuple[list[str], list[str]]:
    """Blocks shared between two rows that have ``first`` and ``second`` m2 already: always to the shorter one."""
    rows: tuple[list[str], list[str]] = ([], [])
    areas = [first, second]
    for block in blocks:
        k = int(areas[1] < areas[0])
        rows[k].extend(block)
        areas[k] += sum(ROOM_SIZES[kind][0] for kind in block)
    return rows


def _fit(widths: list[float], target: float) -> list[float] | None:
    """Widths stretched or pressed so that they sum to the target, if that takes no more than an eighth."""
    factor = target / sum(widths)
    return [w * factor for w in widths] if 0.9 < factor < 1.16 else None


def _lay(kinds: list[str], widths: list[float], x: float, z0: float, z1: float) -> list[Rect]:
    """A row of rooms from x on, between z0 and z1."""
    edges = np.cumsum([x, *widths]).tolist()
    return [Rect(edges[i], z0, edges[i + 1], z1) for i in range(len(kinds))]


def _corridor(kinds: list[str], rng: np.random.Generator) -> Layout | None:
    """A hall along x from 0 on, rooms above (-z) and below it, the living room across its right end and over the upper row."""
    day = ["kitchen", *(k for k in kinds if k == "dining room")]
    rest = [k for k in kinds if k not in (*day, "living room", "hall")]
    upper, lower = _share(_blocks(rest, rng), 0.0, 4.0)
    if not upper or not lower:
        return None
    # The dining room lies under the living room, the kitchen before it and so also on the hall, or the other way round.
    lower = lower + (day if rng.random() < 0.75 else day[::-1])
    above, below = float(rng.uniform(3.3, 4.3)), float(rng.uniform(3.1, 4.1))
    up = [_width(k, above, rng) for k in upper]
    low = [_width(k, below, rng) for k in lower]
    porch = float(rng.uniform(_NOTCH, 2.0)) if rng.random() < 0.25 else 0.0
    length = sum(up) + porch
    if length > 9.5:
        return None
    hall = float(rng.uniform(1.48, 1.75)) if length > 5.5 else float(rng.uniform(1.55, 2.2))
    bulge = float(rng.choice([0.0, 0.0, 0.0, rng.uniform(_NOTCH, 1.7), -rng.uniform(_NOTCH, 1.7)]))
    tall = above + hall + bulge
    head = _width("living room", tall, rng)
    start = 0.0
    over = sum(low) - length
    fitted = _fit(low, length + head)
    if fitted is None and over > 1.7:
        fitted = _fit(low, length + min(over, head - _NOTCH))
    if fitted is not None:
        low = fitted
    elif head - over > _NOTCH:
        # Ends under the living room and begins where that leaves it, at least a notch away from the hall's end.
        start = length + min(head, max(1.8, head - _NOTCH)) - sum(low)
        # A hall that stands out alone is a waste.
        if abs(start) < _NOTCH or (porch and start > 0):
            return None
    else:
        return None
    rooms = _lay(upper, up, length - sum(up), -above, 0.0) + _lay(lower, low, start, hall, hall + below)
    rooms += [Rect(0.0, 0.0, length, hall), Rect(length, hall - tall, length + head, hall)]
    return [*upper, *lower, "hall", "living room"], rooms


def _hub(kinds: list[str], rng: np.random.Generator) -> Layout | None:
    """The living room in the middle, the day rooms and others above it, the rest below."""
    day = [k for k in kinds if k in ("kitchen", "dining room")]
    rest = [k for k in kinds if k not in (*day, "living room", "hall")]
    upper, lower = _share(_blocks(rest, rng), sum(ROOM_SIZES[k][0] for k in day), 0.0)
    upper = day + upper
    if "hall" in kinds:
        row = upper if "bathroom" in upper else lower
        at = row.index("bathroom")
        row.insert(at + int(rng.integers(2)), "hall")
    above, below, deep = (float(rng.uniform(a, b)) for a, b in ((3.0, 3.8), (3.1, 4.1), (3.7, 4.7)))
    up, low = ([_row_width(k, d, rng) for k in row] for row, d in ((upper, above), (lower, below)))
    length = _width("living room", deep, rng)
    longest = max((sum(w) for w in (up, low)), default=length)
    length = longest if 0.8 < longest / length < 1.3 else length
    rooms: list[Rect] = []
    for row, widths, z0, z1 in ((upper, up, -above, 0.0), (lower, low, deep, deep + below)):
        if not row:
            continue
        fitted, left = _fit(widths, length), bool(rng.random() < 0.5)
        widths = fitted or widths
        gap = length - sum(widths)
        if fitted is None and (abs(gap) < _NOTCH or gap < -2.5):
            return None
        rooms += _lay(row, widths, 0.0 if fitted or left else gap, z0, z1)
    return [*upper, *lower, "living room"], [*rooms, Rect(0.0, 0.0, length, deep)]


def _row_width(kind: str, depth: float, rng: np.random.Generator) -> float:
    return float(rng.uniform(1.55, 2.0)) if kind == "hall" else _width(kind, depth, rng)


def _studio(hall: bool, rng: np.random.Generator) -> Layout | None:
    """One large room; beside it the bathroom, and the hall in line with it or the open."""
    width, depth = float(rng.uniform(4.4, 5.8)), float(rng.uniform(5.0, 6.8))
    room = Rect(0.0, 0.0, width, depth)
    if hall:
        strip = float(rng.uniform(2.05, 2.5))
        bath = float(rng.uniform(2.1, min(3.2, width - 1.7)))
        rooms = [room, Rect(0.0, -strip, bath, 0.0), Rect(bath, -strip, width, 0.0)]
        return ["studio", "bathroom", "hall"], rooms
    along, out = float(rng.uniform(2.3, 3.2)), float(rng.uniform(2.05, 2.6))
    if depth - along < _NOTCH:
        return None
    return ["studio", "bathroom"], [room, Rect(width, 0.0, width + out, along)]
