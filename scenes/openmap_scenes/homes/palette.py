"""What a home is decorated with: colours that go together, drawn once for the home, and from them each room's surfaces."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes import flooring, wallcovering
from openmap_scenes.homes.plan import Plan
from openmap_scenes.homes.primitives import material
from openmap_scenes.scene import Material

Array = npt.NDArray[np.float64]
RGB = tuple[float, float, float]

# Each home's walls (the usual one, then others), its accents, its woods, and its stone or ceramic, all sRGB.
_SCHEMES: tuple[tuple[tuple[RGB, ...], tuple[RGB, ...], tuple[RGB, ...], tuple[RGB, ...]], ...] = (
    (  # warm
        ((0.95, 0.93, 0.89), (0.93, 0.89, 0.81), (0.90, 0.85, 0.77)),
        ((0.74, 0.55, 0.45), (0.62, 0.64, 0.52), (0.80, 0.70, 0.54)),
        ((0.74, 0.57, 0.39), (0.62, 0.43, 0.27)),
        ((0.84, 0.79, 0.71), (0.72, 0.64, 0.54), (0.90, 0.87, 0.81)),
    ),
    (  # northern
        ((0.96, 0.96, 0.95), (0.90, 0.91, 0.91), (0.87, 0.89, 0.90)),
        ((0.52, 0.60, 0.66), (0.66, 0.71, 0.66), (0.78, 0.72, 0.66)),
        ((0.82, 0.71, 0.55), (0.76, 0.68, 0.57)),
        ((0.80, 0.80, 0.79), (0.62, 0.63, 0.64), (0.93, 0.93, 0.92)),
    ),
    (  # sage and oak
        ((0.95, 0.94, 0.90), (0.87, 0.89, 0.83), (0.92, 0.90, 0.84)),
        ((0.56, 0.62, 0.52), (0.44, 0.52, 0.47), (0.76, 0.66, 0.50)),
        ((0.70, 0.54, 0.36), (0.56, 0.40, 0.26)),
        ((0.78, 0.77, 0.72), (0.66, 0.66, 0.60), (0.90, 0.90, 0.86)),
    ),
    (  # old town
        ((0.95, 0.92, 0.85), (0.91, 0.88, 0.80), (0.86, 0.86, 0.80)),
        ((0.58, 0.36, 0.32), (0.40, 0.46, 0.52), (0.66, 0.60, 0.44)),
        ((0.50, 0.32, 0.19), (0.58, 0.38, 0.22)),
        ((0.70, 0.48, 0.37), (0.86, 0.81, 0.72), (0.80, 0.76, 0.70)),
    ),
    (  # modern grey
        ((0.94, 0.94, 0.94), (0.86, 0.86, 0.86), (0.80, 0.80, 0.80)),
        ((0.42, 0.44, 0.47), (0.32, 0.42, 0.46), (0.70, 0.66, 0.60)),
        ((0.64, 0.56, 0.47), (0.52, 0.47, 0.42)),
        ((0.58, 0.58, 0.58), (0.72, 0.71, 0.69), (0.44, 0.44, 0.45)),
    ),
    (  # soft coast
        ((0.96, 0.95, 0.93), (0.87, 0.91, 0.92), (0.93, 0.91, 0.86)),
        ((0.50, 0.64, 0.70), (0.85, 0.76, 0.62), (0.68, 0.77, 0.78)),
        ((0.80, 0.68, 0.50), (0.70, 0.62, 0.52)),
        ((0.88, 0.86, 0.81), (0.74, 0.78, 0.79), (0.92, 0.93, 0.92)),
    ),
    (  # blush
        ((0.96, 0.94, 0.92), (0.93, 0.88, 0.85), (0.90, 0.89, 0.87)),
        ((0.78, 0.60, 0.56), (0.58, 0.50, 0.50), (0.72, 0.74, 0.66)),
        ((0.78, 0.62, 0.44), (0.66, 0.50, 0.36)),
        ((0.88, 0.86, 0.84), (0.78, 0.72, 0.68), (0.66, 0.64, 0.63)),
    ),
)
_WHITE = np.array([0.96, 0.96, 0.95])
_TRIMS: tuple[RGB, ...] = ((0.95, 0.95, 0.94), (0.95, 0.95, 0.94), (0.93, 0.91, 0.86))
_FRAMES: tuple[RGB, ...] = ((0.95, 0.95, 0.95), (0.95, 0.95, 0.95), (0.48, 0.36, 0.25), (0.24, 0.26, 0.28))


@dataclass(frozen=True)
class Cover:
    """A surface: its material, how many metres its picture covers, (u, v), and what a person would call it."""

    material: Material
    metres: tuple[float, float]
    word: str
    turned: bool = False

    def uv(self, points: Array) -> Array:
        """Texture coordinates (N, 2) of places (N, 2) m on the surface; ``turned``: at 45 degrees."""
        if self.turned:
            points = np.stack([points[:, 0] + points[:, 1], points[:, 0] - points[:, 1]], 1) * np.sqrt(0.5)
        return np.asarray(points / np.array(self.metres))


@dataclass(frozen=True)
class RoomFinish:
    """The surfaces of one room; ``accent`` covers the wall of that index, tiles lie between two heights, m, on some walls."""

    floor: Cover
    wall: Cover
    accent: Cover | None
    accent_side: int
    tile: Cover
    tiled: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class HomeFinish:
    """The surfaces of a home: one per room, and what all rooms share."""

    rooms: list[RoomFinish]
    ceiling: Cover
    trim: Material
    window_frame: Material
    door: Material
    door_word: str
    metal: Material
    plaster: Material
    facade: Material
    skirting: float
    cornice: float


class _Decorator:
    """Draws covers in the colours of one scheme."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.walls, self.accents, self.woods, self.stones = _SCHEMES[int(rng.integers(len(_SCHEMES)))]
        self.wood_base = self.near(self.woods[int(rng.integers(len(self.woods)))], 0.03)
        self.paper_share = float(rng.choice([0.0, 0.15, 0.45], p=[0.45, 0.35, 0.2]))
        self.rough = bool(rng.random() < 0.2)

    def near(self, colour: RGB, spread: float = 0.012) -> Array:
        """A colour a little off: lighter or darker and hardly warmer or colder."""
        shift = float(self.rng.normal(0, spread)) + self.rng.normal(0, spread / 3, 3)
        return np.clip(np.array(colour) + shift, 0.03, 0.985)

    def stone(self) -> Array:
        return self.near(self.stones[int(self.rng.integers(len(self.stones)))], 0.02)

    def wood(self) -> Cover:
        """The wooden floor of the home."""
        rng, base = self.rng, self.wood_base
        style = str(rng.choice(["boards", "planks", "laminate", "herringbone"], p=[0.25, 0.3, 0.25, 0.2]))
        if style == "herringbone":
            stave = float(rng.choice([0.07, 0.09, 0.11]))
            picture = flooring.herringbone(rng, base, 0.045)
            return Cover(material("parquet", (1, 1, 1), picture), (20 * stave, 20 * stave), "wood", turned=True)
        rows, wide, contrast = {"boards": (12, 0.09, 0.05), "planks": (10, 0.16, 0.04), "laminate": (9, 0.2, 0.028)}[
            style
        ]
        picture = flooring.boards(rng, base, rows, contrast)
        word = "laminate" if style == "laminate" else "wood"
        return Cover(material(f"{style} floor", (1, 1, 1), picture), (2.9 if rows < 12 else 2.2, rows * wide), word)

    def floor_tiles(self, wet: bool) -> Cover:
        """A tiled, stone or terrazzo floor."""
        rng, base = self.rng, self.stone()
        style = str(
            rng.choice(["large", "half", "square", "small", "chequer", "terrazzo"], p=[0.3, 0.2, 0.2, 0.14, 0.06, 0.1])
        )
        if style == "terrazzo":
            picture = flooring.terrazzo(rng, np.clip(base * 1.06, 0, 0.93))
            return Cover(material("terrazzo", (1, 1, 1), picture), (1.1, 1.1), "terrazzo")
        rows, columns, size, bond = {
            "large": (4, 4, (2.4, 2.4), False),
            "half": (6, 3, (1.8, 1.8), True),
            "square": (6, 6, (1.98, 1.98), False),
            "small": (8, 8, (1.2 if wet else 1.6, 1.2 if wet else 1.6), False),
            "chequer": (6, 6, (1.8, 1.8), False),
        }[style]
        second = np.clip(base * float(rng.choice([0.62, 0.8])), 0, 1) if style == "chequer" else None
        stone = 0.0 if style in ("small", "chequer") else float(rng.choice([0.0, 0.6, 1.0]))
        joint = 0.8 if base.mean() > 0.6 else 1.25
        picture = flooring.tiles(rng, base, rows, columns, stone, bond, second, joint)
        return Cover(material("floor tiles", (1, 1, 1), picture), size, "stone" if stone > 0.5 else "tile")

    def carpet(self) -> Cover:
        grey = np.array(self.walls[-1]) * float(self.rng.uniform(0.62, 0.86))
        base = grey if self.rng.random() < 0.7 else 0.5 * grey + 0.5 * self.near(self.accents[0])
        picture = flooring.pile(self.rng, base, bool(self.rng.random() < 0.4))
        return Cover(material("carpet", (1, 1, 1), picture), (1.2, 1.2), "carpet")

    def paint(self, base: Array) -> Cover:
        draw = wallcovering.rough_plaster if self.rough else wallcovering.paint
        metres = 0.9 if self.rough else 2.1
        return Cover(material("painted wall", (1, 1, 1), draw(self.rng, base)), (metres, metres), "painted")

    def paper(self, base: Array, bold: bool) -> Cover:
        """Wallpaper; ``bold``: a pattern that shows, for a single wall."""
        rng = self.rng
        style = str(
            rng.choice(["sprigs", "lattice", "damask"] if bold else ["stripes", "linen", "damask", "sprigs", "lattice"])
        )
        if style == "sprigs":
            ink = 0.5 * base + 0.5 * self.near(self.accents[int(rng.integers(3))]) if bold else base * 0.9
            picture, metres = wallcovering.sprigs(rng, base, ink), 1.06
        elif style == "stripes":
            picture, metres = wallcovering.stripes(rng, base), 1.06
        elif style == "linen":
            picture, metres = wallcovering.linen(rng, base), 0.8
        elif style == "damask":
            picture, metres = wallcovering.damask(rng, base), 1.06
        else:
            picture, metres = wallcovering.lattice(rng, base), 1.06
        return Cover(material("wallpaper", (1, 1, 1), picture), (metres, metres), "wallpaper")

    def wall_tiles(self) -> Cover:
        """Tiles of a bathroom's or a kitchen's walls: mostly white or stone, sometimes of an accent's colour."""
        rng = self.rng
        pale = np.array(self.accents[int(rng.integers(3))]) * 0.5 + 0.45
        base = (np.array([0.93, 0.93, 0.92]), self.near(self.stones[-1]), pale)[int(rng.choice(3, p=[0.5, 0.3, 0.2]))]
        style = str(rng.choice(["metro", "square", "upright", "slab"]))
        rows, columns, size, bond = {
            "metro": (12, 6, (1.2, 1.2), True),
            "square": (8, 8, (1.2, 1.2), False),
            "upright": (5, 6, (1.2, 1.25), False),
            "slab": (4, 2, (1.2, 1.2), False),
        }[style]
        stone = 0.4 if style == "slab" else 0.0
        base = np.maximum(base, 0.62)
        picture = flooring.tiles(rng, base, rows, columns, stone, bond, None, 0.86, 2 if style == "slab" else 3)
        return Cover(material("wall tiles", (1, 1, 1), picture), size, "tile")


def draw_finish(plan: Plan, rng: np.random.Generator, counters: Mapping[int, Set[int]]) -> HomeFinish:
    """Decorate a home: wood (or tiles) through the day rooms, tiles in wet rooms, a paint for most walls, a few accents."""
    d = _Decorator(rng)
    main, usual = d.wood(), d.paint(d.near(d.walls[0]))
    wet, carpet = d.floor_tiles(wet=True), d.carpet()
    day_tiles = d.floor_tiles(wet=False) if rng.random() < 0.3 else None
    carpeted = rng.random() < 0.25
    rooms = []
    for room, kind in enumerate(plan.kinds):
        floor = main
        if kind in ("bathroom", "laundry room"):
            floor = wet
        elif kind in ("kitchen", "hall") and rng.random() < 0.55:
            floor = day_tiles or wet
        elif day_tiles is not None and kind in ("living room", "dining room") and rng.random() < 0.35:
            floor = day_tiles
        elif kind in ("bedroom", "office", "children's room") and carpeted:
            floor = carpet
        rooms.append(_room(d, plan, room, kind, (floor, usual), counters.get(room)))
    wood_trim = rng.random() < 0.2
    trim = tuple(d.wood_base * 0.9) if wood_trim else _TRIMS[int(rng.integers(len(_TRIMS)))]
    wooden = wood_trim or rng.random() < 0.25
    door = material("door wood", (1, 1, 1), flooring.veneer(rng, d.wood_base * 0.95)) if wooden else None
    ceiling = material("ceiling", (1, 1, 1), wallcovering.paint(rng, _WHITE))
    metal = [(0.74, 0.74, 0.73), (0.20, 0.20, 0.21), (0.76, 0.66, 0.45)][int(rng.choice(3, p=[0.6, 0.25, 0.15]))]
    return HomeFinish(
        rooms,
        Cover(ceiling, (2.3, 2.3), "painted"),
        material("trim", trim),
        material("window frame", _FRAMES[int(rng.integers(len(_FRAMES)))]),
        door or material("door paint", _TRIMS[0]),
        "wood" if wooden else "painted wood",
        material("handle", metal),
        material("plaster", tuple(_WHITE)),
        material("facade", tuple(0.5 * np.array(d.stones[0]) + 0.45)),
        float(rng.choice([0.06, 0.08, 0.1, 0.12])),
        float(rng.choice([0.0, 0.0, 0.05, 0.07])),
    )


def _room(
    d: _Decorator, plan: Plan, room: int, kind: str, home: tuple[Cover, Cover], counters: Set[int] | None
) -> RoomFinish:
    """The surfaces of a room; ``home``: the floor chosen for it and the usual wall."""
    (floor, usual), rng, accent = home, d.rng, None
    wall = usual
    sides = plan.sides(room)
    wet = kind in ("bathroom", "laundry room", "kitchen")
    if not wet and rng.random() < d.paper_share:
        wall = d.paper(d.near(d.walls[int(rng.integers(len(d.walls)))]), bold=False)
    elif rng.random() < (0.55 if kind in ("bedroom", "children's room", "office", "kitchen") else 0.25):
        tint = d.near(d.walls[1 + int(rng.integers(2))])
        if kind == "children's room":
            tint = 0.72 * tint + 0.28 * np.array(d.accents[int(rng.integers(3))])
        wall = d.paint(tint)
    # The wall that an accent suits is the longest without windows.
    plain = [i for i, s in enumerate(sides) if not any(o.glazed or o.wide for o in plan.on_side(s))]
    suits = kind in ("living room", "bedroom", "dining room", "office", "studio", "children's room")
    if suits and plain and rng.random() < 0.3:
        base = d.near(d.accents[int(rng.integers(3))], 0.02)
        base = base if rng.random() < 0.5 else 0.5 * base + 0.45
        accent = d.paint(base) if rng.random() < 0.65 else d.paper(base, bold=True)
    at = max(plain, key=lambda i: sides[i].end - sides[i].start, default=0)
    return RoomFinish(floor, wall, accent, at, d.wall_tiles() if wet else usual, _tiled(d, plan, room, kind, counters))


def _tiled(
    d: _Decorator, plan: Plan, room: int, kind: str, counters: Set[int] | None
) -> tuple[tuple[float, float], ...]:
    """Between which heights each wall of a room is tiled, m; equal where it is not."""
    none = (0.0, 0.0)
    if kind == "bathroom":
        high = float(d.rng.choice([1.25, 2.05, plan.ceiling], p=[0.25, 0.5, 0.25]))
        return ((0.0, high),) * 4
    if kind == "laundry room" and d.rng.random() < 0.5:
        return ((0.0, 1.25),) * 4
    if kind == "kitchen" and d.rng.random() < 0.75:
        walls = counters or {_longest(plan, room)}
        return tuple((0.85, 1.5) if i in walls else none for i in range(4))
    return (none,) * 4


def _longest(plan: Plan, room: int) -> int:
    """The wall with the longest stretch without a door, where a counter is likely to stand."""
    lengths = []
    for side in plan.sides(room):
        ends = [e for o in plan.on_side(side) if o.kind != "window" for e in (o.start, o.end)]
        ends = sorted([side.start, *ends, side.end])
        lengths.append(max(b - a for a, b in zip(ends[::2], ends[1::2], strict=True)))
    return int(np.argmax(lengths))
