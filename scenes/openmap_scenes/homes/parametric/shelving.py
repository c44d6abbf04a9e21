"""Open shelving with what stands on it: bookcase, shelves, wall shelf."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import carcass, doors, draw_size, drawer_fronts, made
from openmap_scenes.homes.solids import box, lathe, moved, rounded_box, turned


class Filling:
    """Draws what stands on boards, from a few covers and pots that one piece of furniture shares."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        spines = (*finishes.CLOTHS, *finishes.HIDES, (0.93, 0.92, 0.88))
        self.covers = [finishes.painted(finishes.shade(rng, spines), "book") for _ in range(8)]
        self.pots = [finishes.painted(finishes.shade(rng, finishes.PAINTS), "pot") for _ in range(3)]
        self.basket = finishes.wicker(rng)

    def board(self, x0: float, x1: float, y: float, z0: float, z1: float, room: float) -> list[Model]:
        """Things from x0 to x1 on a board at height y, between its back z0 and its front z1, under ``room`` m of air."""
        style = finishes.choose(self.rng, "books", "books", "books", "mixed", "mixed", "boxes", "ornaments", "free")
        if room < 0.12 or style == "free":
            return []
        if style == "boxes" and x1 - x0 > 0.3:
            return self._boxes(x0, x1, y, z0, z1, room)
        if style == "ornaments":
            return self.ornaments(x0, x1, y, z0, z1, room)
        end = x1 if style == "books" else x0 + float(self.rng.uniform(0.35, 0.7)) * (x1 - x0)
        out = self._books(x0 + 0.005, end - 0.01, y, z0, z1, room)
        return out + (self.ornaments(end + 0.03, x1, y, z0, z1, room) if style == "mixed" else [])

    def _books(self, x0: float, x1: float, y: float, z0: float, z1: float, room: float) -> list[Model]:
        """Upright books side by side, the last one leaning, or now and then a pile."""
        rng, x = self.rng, x0
        out: list[Model] = []
        deep = min(z1 - z0 - 0.02, 0.22)
        while True:
            t = float(rng.uniform(0.018, 0.042))
            tall = min(float(rng.uniform(0.17, 0.29)), room - 0.02)
            if x + t > x1:
                return out
            m = self.covers[int(rng.integers(len(self.covers)))]
            front = z0 + 0.01 + deep * float(rng.uniform(0.8, 1.0))
            if rng.random() < 0.06 and x + 0.25 < x1:
                rise = y
                for _ in range(int(rng.integers(2, 5))):
                    h = float(rng.uniform(0.02, 0.035))
                    if rise + h > y + room - 0.02:
                        break
                    w, m = float(rng.uniform(0.17, 0.23)), self.covers[int(rng.integers(len(self.covers)))]
                    out.append(box((x, rise, z0 + 0.01), (x + w, rise + h, front), m))
                    rise += h
                x += 0.25
                continue
            if rng.random() < 0.05 and x + 0.12 < x1:
                lean = turned(box((0, 0, z0 + 0.01), (t, tall * 0.95, front), m), "z", 0.22)
                out.append(moved(lean, x - float(lean.vertices[:, 0].min()), y - float(lean.vertices[:, 1].min()), 0))
                x += 0.11
                continue
            out.append(box((x, y, z0 + 0.01), (x + t - 0.001, y + tall, front), m))
            x += t
            if rng.random() < 0.04:
                x += float(rng.uniform(0.03, 0.15))

    def _boxes(self, x0: float, x1: float, y: float, z0: float, z1: float, room: float) -> list[Model]:
        n = max(1, int((x1 - x0) / 0.34))
        w, tall = (x1 - x0) / n, min(room - 0.03, float(self.rng.uniform(0.14, 0.24)))
        m = self.basket if self.rng.random() < 0.5 else self.pots[0]
        return [
            rounded_box(
                (x0 + k * w + 0.015, y, z0 + 0.015), (x0 + (k + 1) * w - 0.015, y + tall, z1 - 0.015), m, 0.01, 2
            )
            for k in range(n)
            if self.rng.random() < 0.85
        ]

    def ornaments(self, x0: float, x1: float, y: float, z0: float, z1: float, room: float) -> list[Model]:
        rng, x = self.rng, x0 + 0.02
        out: list[Model] = []
        while x < x1 - 0.14:
            size, z = float(rng.uniform(0.05, 0.07)), (z0 + z1) / 2
            tall = min(float(rng.uniform(0.12, 0.26)), room - 0.03)
            m = self.pots[int(rng.integers(len(self.pots)))]
            kind = finishes.choose(rng, "vase", "ball", "frame", "box")
            if kind == "vase":
                line = [
                    (0.5, 0),
                    (0.9, 0.3),
                    (1.0, 0.5),
                    (0.55, 0.8),
                    (0.5, 0.92),
                    (0.65, 1.0),
                    (0.45, 0.99),
                    (0.3, 0.8),
                ]
                thing = lathe([(r * size, q * tall) for r, q in line], m, {0}, 14)
            elif kind == "ball":
                size = min(size, (room - 0.02) / 2)
                angles = np.linspace(-np.pi / 2, np.pi / 2, 8)
                thing = lathe([(size * float(np.cos(a)), size * (1 + float(np.sin(a)))) for a in angles], m, (), 14)
            elif kind == "frame":
                thing = turned(rounded_box((-size, 0, -0.008), (size, tall * 0.8, 0.008), m), "x", -0.15)
                picture = finishes.painted(finishes.shade(rng, finishes.CLOTHS), "picture")
                inner = box((-size * 0.75, tall * 0.12, 0.007), (size * 0.75, tall * 0.68, 0.0095), picture)
                thing = moved(thing, y=0.002)
                out.append(moved(turned(inner, "x", -0.15), x + size, y + 0.002, z))
            else:
                thing = rounded_box((-size, 0, -size), (size, min(0.1, room - 0.02), size), m, 0.004)
            out.append(moved(thing, x + size, y, z))
            x += 2 * size + float(rng.uniform(0.02, 0.12))
        return out


def bookcase(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tall case of boards full of books: plain, with doors or drawers below, or divided into cubes."""
    size = draw_size(rng, limits, (0.6, 1.3), (0.26, 0.36), (1.3, 2.1))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng)
    style, fill = finishes.choose(rng, "plain", "plain", "doors", "drawers", "cubes"), Filling(rng)
    t, low = 0.022, float(rng.uniform(0.05, 0.1))
    parts = carcass(w, d, low, h, m, t)
    parts.append(box((-w / 2 + 0.005, 0, -d / 2), (w / 2 - 0.005, low, d / 2 - 0.03), m))
    z0, z1 = -d / 2 + 0.008, d / 2 - 0.012
    columns = max(1, round(w / (0.42 if style == "cubes" else 0.85)))
    rows = max(3, round((h - low) / (0.40 if style == "cubes" else float(rng.uniform(0.30, 0.38)))))
    ys = np.linspace(low + t / 2, h - t / 2, rows + 1)
    closed = (1 if style == "drawers" else 2) if style in ("doors", "drawers") else 0
    wide = (w - 2 * t) / columns
    for c in range(columns):
        x0 = -w / 2 + t + c * wide
        if c:
            parts.append(rounded_box((x0 - t / 2, low + t, z0), (x0 + t / 2, h - t, z1), m, 0.001, grain="y"))
        a, b = x0 + (t / 2 if c else 0), x0 + wide - (t / 2 if c < columns - 1 else 0)
        for r in range(rows):
            y = float(ys[r]) + t / 2
            if r:
                parts.append(rounded_box((a, y - t, z0), (b, y, z1), m, 0.001, grain="x"))
            if r >= closed:
                parts += fill.board(a, b, y, z0, z1 - 0.01, float(ys[r + 1] - ys[r]) - t)
    top = float(ys[closed])
    if style == "doors":
        parts += doors(
            (-w / 2 + t, low + t), (w / 2 - t, top), z1 - 0.006, 2 if w > 0.5 else 1, m, iron, "knob", True, 0.8
        )
    elif style == "drawers":
        parts += drawer_fronts(
            (-w / 2 + t, low + t), (w / 2 - t, top), z1 - 0.006, 2 if w > 0.9 else 1, 1, m, iron, "knob"
        )
    return made(parts, size, {"material": name}, surface=False)


def shelves(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An open shelving unit: boards between ladders or posts of metal or wood, or a low stack of cubes."""
    size = draw_size(rng, limits, (0.6, 1.2), (0.28, 0.42), (0.8, 1.9))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    iron, word = finishes.metal(rng, "black metal", "steel", "brass")
    style, fill = finishes.choose(rng, "posts", "metal", "ladder"), Filling(rng)
    post, t = iron if style == "metal" else m, 0.03
    rows = max(3, round(h / 0.42))
    x, z = w / 2, d / 2
    tilt = 0.0 if style != "ladder" else min(0.12, 0.3 * d)
    parts = []
    for s in (-1, 1):
        parts.append(
            rounded_box((s * (x - t / 2) - t / 2, 0, -z), (s * (x - t / 2) + t / 2, h, -z + t), post, grain="y")
        )
        lean = rounded_box((s * (x - t / 2) - t / 2, 0, z - t), (s * (x - t / 2) + t / 2, h, z), post, grain="y")
        parts.append(turned(lean, "x", -float(np.arctan2(tilt, h)), (0, 0, z)))
    levels = np.linspace(0.1, h - 0.025, rows)
    for k, y in enumerate(levels.tolist()):
        front = z - tilt * y / h - (t if style == "ladder" else 0.0)
        a, b = -x + t + 0.001, x - t - 0.001
        parts.append(rounded_box((a, y, -z + 0.004), (b, y + 0.022, front - 0.004), m, grain="x"))
        parts += [
            rounded_box((s * (x - t / 2) - 0.008, y, -z + t), (s * (x - t / 2) + 0.008, y + 0.02, front - t), post)
            for s in (-1, 1)
        ]
        if k < rows - 1:
            parts += fill.board(a + 0.01, b - 0.01, y + 0.022, -z + 0.01, front - 0.02, float(levels[k + 1]) - y - 0.03)
    return made(parts, size, {"material": word if style == "metal" else name}, surface=True)


def wall_shelf(rng: np.random.Generator, limits: Limits) -> Made | None:
    """One or two boards on a wall with things on them, on brackets, or a box."""
    size = draw_size(rng, limits, (0.5, 1.1), (0.18, 0.26), (0.22, 0.6))
    if size is None:
        return None
    w, d, h = size
    m, name = finishes.wood_or_paint(rng)
    iron, _ = finishes.metal(rng, "black metal", "brass", "steel")
    style, fill = finishes.choose(rng, "brackets", "floating", "box"), Filling(rng)
    parts: list[Model] = []
    t = 0.022 if style != "floating" else 0.04
    if style == "box":
        h = min(h, 0.4)
        parts += carcass(w, d, 0.0, h, m, t)
        n = 2 if w > 0.7 else 1
        wide = (w - 2 * t) / n
        for c in range(n):
            a = -w / 2 + t + c * wide
            if c:
                parts.append(rounded_box((a - 0.01, t, -d / 2 + 0.01), (a + 0.01, h - t, d / 2 - 0.01), m))
            parts += fill.board(a + 0.012, a + wide - 0.012, t, -d / 2 + 0.01, d / 2 - 0.015, h - 2 * t)
        return made(parts, (w, d, h), {"material": name}, 1.35)
    drop = 0.12 if style == "brackets" else 0.0
    rows = 2 if h > 0.45 else 1
    room = (h - drop) / rows
    for r in range(rows):
        y = drop + r * room
        parts.append(rounded_box((-w / 2, y, -d / 2), (w / 2, y + t, d / 2), m, grain="x"))
        parts += fill.board(-w / 2 + 0.02, w / 2 - 0.02, y + t, -d / 2 + 0.01, d / 2 - 0.02, room - t)
        if style == "brackets":
            for s in (-1, 1):
                x = s * (w / 2 - 0.1)
                parts.append(rounded_box((x - 0.012, y - 0.11, -d / 2), (x + 0.012, y, -d / 2 + 0.008), iron))
                parts.append(rounded_box((x - 0.012, y - 0.008, -d / 2 + 0.008), (x + 0.012, y, d / 2 - 0.03), iron))
    tall = max(float(p.vertices[:, 1].max()) for p in parts) - min(float(p.vertices[:, 1].min()) for p in parts)
    return made(parts, (w, d, min(h, tall)), {"material": name}, 1.35)


GENERATORS: dict[str, Generator] = {"bookcase": bookcase, "shelves": shelves, "wall shelf": wall_shelf}
