"""A textured home of twelve rooms by seed, for the rendering benchmark: closed rooms, doors between them, furniture and clutter.

What makes a real scan costly to draw is kept: rooms hide one another, large faces stand beside tiny ones, textures are many and
large, and each room is full.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_scenes import Instance, Material, Room, Scene
from openmap_scenes.scene import instance_boxes

COLUMNS, ROWS = 4, 3
WIDTH, LENGTH, HEIGHT = 5.0, 4.2, 2.6
"""Of a room along x, z and y, m, from wall to wall."""
WALL = 0.12
DOOR_WIDTH, DOOR_HEIGHT = 0.95, 2.05
TEXTURE_SIZES = (512, 640, 768, 1024)
_STRUCTURE_SHARE = 0.25
_FEWEST_FACES = 10_000
_NAMES = ("bedroom", "bathroom", "living room", "kitchen", "hallway", "study")

Points = npt.NDArray[np.float64]
Surface = Callable[[Points, Points], Points]


@dataclass(frozen=True)
class _Patch:
    """A surface over the unit square, to be cut into a grid: whose it is, its share of the faces, how its texture repeats."""

    surface: Surface
    instance: int
    material: int
    weight: float
    repeats: tuple[float, float] = (1.0, 1.0)
    ratio: float = 1.0
    """How many times more cells along s than along t."""


@dataclass
class _Plan:
    """The patches as they come up, structure and furniture apart since they share the faces differently."""

    structure: list[_Patch] = field(default_factory=list)
    furniture: list[_Patch] = field(default_factory=list)
    categories: dict[int, tuple[str, int]] = field(default_factory=dict)

    def add_instance(self, category: str, room: int) -> int:
        number = len(self.categories) + 1
        self.categories[number] = (category, room)
        return number


def make_render_home(faces: int, seed: int, textures: int = 40) -> Scene:
    """A home of about ``faces`` triangles (within 1 %) and ``textures`` textures of 512 to 1024 px; same arguments, same bytes.

    Raises
    ------
    ValueError
        Fewer than 10,000 faces or no texture.
    """
    if faces < _FEWEST_FACES or textures < 1:
        raise ValueError(f"{faces} faces and {textures} textures; expected {_FEWEST_FACES} faces and 1 texture or more")
    rng = np.random.default_rng(seed)
    plan = _Plan()
    doors = _doors(rng)
    for room in range(COLUMNS * ROWS):
        _build_room(plan, room, doors, textures, rng)
        _furnish(plan, room, doors, textures, rng)
    _build_jambs(plan, doors, textures, rng)
    meshes = _cut(plan.structure, int(_STRUCTURE_SHARE * faces), rng, rough=0.003)
    meshes += _cut(plan.furniture, faces - sum(len(f) for _, _, f, _ in meshes), rng, rough=0.001)
    return _assemble(meshes, plan, [_picture(n, rng) for n in range(textures)], f"render-home-{faces}-{seed}")


def _origin(room: int) -> tuple[float, float]:
    """Where a room's lowest x and z lie, m."""
    return room % COLUMNS * (WIDTH + WALL), room // COLUMNS * (LENGTH + WALL)


def _doors(rng: np.random.Generator) -> dict[tuple[int, int], float]:
    """Pairs of neighbouring rooms with a door between them, and how far along their wall (m) it begins: a tree and a few more."""
    pairs = [(r, r + 1) for r in range(COLUMNS * ROWS) if (r + 1) % COLUMNS]
    pairs += [(r, r + COLUMNS) for r in range(COLUMNS * (ROWS - 1))]
    joined = {room: room for room in range(COLUMNS * ROWS)}
    doors = {}
    for index in rng.permutation(len(pairs)).tolist():
        a, b = pairs[index]
        wall = LENGTH if b == a + 1 else WIDTH
        begin = float(rng.uniform(0.5, wall - DOOR_WIDTH - 0.5))
        if joined[a] != joined[b] or rng.random() < 0.25:
            old, new = joined[b], joined[a]
            joined = {room: new if group == old else group for room, group in joined.items()}
            doors[a, b] = begin
    return doors


def _quad(corner: npt.ArrayLike, along: npt.ArrayLike, up: npt.ArrayLike) -> Surface:
    """The parallelogram from a corner along two edges."""
    c, a, u = (np.asarray(v, np.float64) for v in (corner, along, up))
    return lambda s, t: np.asarray(c + s[:, None] * a + t[:, None] * u)


def _add_flat(
    plan: _Plan, instance: int, material: int, corner: npt.ArrayLike, along: npt.ArrayLike, up: npt.ArrayLike
) -> None:
    """A piece of structure, its faces by its area, its texture repeated every two metres."""
    a, u = float(np.linalg.norm(along)), float(np.linalg.norm(up))
    if a > 1e-6 and u > 1e-6:
        plan.structure.append(_Patch(_quad(corner, along, up), instance, material, a * u, (a / 2, u / 2), ratio=a / u))


def _build_room(
    plan: _Plan, room: int, doors: dict[tuple[int, int], float], textures: int, rng: np.random.Generator
) -> None:
    """Floor, ceiling and four walls, with an opening where a door is."""
    x, z = _origin(room)
    floor, ceiling, wall = (int(m) for m in rng.integers(textures, size=3))
    _add_flat(plan, plan.add_instance("floor", room), floor, (x, 0, z), (WIDTH, 0, 0), (0, 0, LENGTH))
    _add_flat(plan, plan.add_instance("ceiling", room), ceiling, (x, HEIGHT, z), (WIDTH, 0, 0), (0, 0, LENGTH))
    sides = (
        ((room - COLUMNS, room), (x, z), (1, 0), WIDTH),
        ((room, room + COLUMNS), (x, z + LENGTH), (1, 0), WIDTH),
        ((room - 1, room), (x, z), (0, 1), LENGTH),
        ((room, room + 1), (x + WIDTH, z), (0, 1), LENGTH),
    )
    for pair, (wx, wz), (dx, dz), length in sides:
        number = plan.add_instance("wall", room)
        begin = doors.get(pair)
        pieces = [(0.0, length, 0.0, HEIGHT)]
        if begin is not None:
            end = begin + DOOR_WIDTH
            pieces = [(0.0, begin, 0.0, HEIGHT), (end, length, 0.0, HEIGHT), (begin, end, DOOR_HEIGHT, HEIGHT)]
        for a, b, low, high in pieces:
            along = ((b - a) * dx, 0, (b - a) * dz)
            _add_flat(plan, number, wall, (wx + a * dx, low, wz + a * dz), along, (0, high - low, 0))


def _build_jambs(plan: _Plan, doors: dict[tuple[int, int], float], textures: int, rng: np.random.Generator) -> None:
    """What lines each doorway, through the thickness of the wall: two sides, a lintel, a threshold."""
    for (a, b), begin in sorted(doors.items()):
        x, z = _origin(a)
        through, along = ((WALL, 0, 0), (0, 0, DOOR_WIDTH)) if b == a + 1 else ((0, 0, WALL), (DOOR_WIDTH, 0, 0))
        low = np.array([x + WIDTH, 0, z + begin] if b == a + 1 else [x + begin, 0, z + LENGTH])
        number, material = plan.add_instance("door frame", a), int(rng.integers(textures))
        for corner, edge, up in (
            (low, through, (0, DOOR_HEIGHT, 0)),
            (low + along, through, (0, DOOR_HEIGHT, 0)),
            (low, through, along),
            (low + np.array([0, DOOR_HEIGHT, 0]), through, along),
        ):
            _add_flat(plan, number, material, corner, edge, up)


def _before_doors(room: int, doors: dict[tuple[int, int], float]) -> list[tuple[float, float, float, float]]:
    """What has to stay free to walk through the doors of a room: (low x, low z, high x, high z) m, from the room's corner."""
    free = []
    for (a, b), begin in doors.items():
        end, depth = begin + DOOR_WIDTH, 0.9
        if room in (a, b) and b == a + 1:
            low = WIDTH - depth if room == a else 0.0
            free.append((low, begin, low + depth, end))
        elif room in (a, b):
            low = LENGTH - depth if room == a else 0.0
            free.append((begin, low, end, low + depth))
    return free


def _furnish(
    plan: _Plan, room: int, doors: dict[tuple[int, int], float], textures: int, rng: np.random.Generator
) -> None:
    """Large things that stand along the walls, and small ones on top of them; the middle and the doors stay free to walk."""
    x, z = _origin(room)
    taken = _before_doors(room, doors)
    most = len(taken) + 10
    for _ in range(60):
        size = np.array([rng.uniform(0.3, 2.0), rng.uniform(0.35, 2.0), rng.uniform(0.3, 0.9)])
        along_x = rng.random() < 0.5
        w, d = (size[0], size[2]) if along_x else (size[2], size[0])
        px = float(rng.uniform(0.05, WIDTH - w - 0.05))
        pz = float(rng.uniform(0.05, LENGTH - d - 0.05))
        if along_x:
            pz = 0.05 if rng.random() < 0.5 else LENGTH - d - 0.05
        else:
            px = 0.05 if rng.random() < 0.5 else WIDTH - w - 0.05
        box = (px - 0.1, pz - 0.1, px + w + 0.1, pz + d + 0.1)
        if (
            any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken)
            or len(taken) >= most
        ):
            continue
        taken.append(box)
        low = np.array([x + px, 0.0, z + pz])
        high = low + np.array([w, size[1], d])
        _add_object(plan, plan.add_instance("furniture", room), low, high, textures, rng)
        for _ in range(int(rng.integers(1, 5))):
            small = np.minimum(rng.uniform(0.05, 0.35, 3), (w, 1.0, d))
            place = low + rng.uniform(0.0, 1.0, 3) * (high - low - small)
            place[1] = high[1]
            if high[1] + small[1] < HEIGHT:
                _add_object(plan, plan.add_instance("clutter", room), place, place + small, textures, rng)


def _add_object(plan: _Plan, instance: int, low: Points, high: Points, textures: int, rng: np.random.Generator) -> None:
    """A box, a rounded body, a turned one, or a table, as large and as finely cut as chance has it."""
    material, weight = int(rng.integers(textures)), float(rng.lognormal(0.0, 1.6))
    kind = int(rng.integers(4))
    if kind == 0:
        _add_box(plan, instance, material, weight, low, high)
    elif kind == 3 and (high - low).min() > 0.25:
        top = np.array([low[0], high[1] - 0.04, low[2]])
        _add_box(plan, instance, material, weight / 2, top, high)
        for cx, cz in ((0, 0), (0, 1), (1, 0), (1, 1)):
            foot = low + np.array([cx, 0, cz]) * (high - low - 0.06)
            _add_box(plan, instance, material, weight / 8, foot, np.array([foot[0] + 0.06, top[1], foot[2] + 0.06]))
    else:
        shape = _rounded if kind == 1 else _turned
        surface = shape((low + high) / 2, (high - low) / 2, float(rng.uniform(0.2, 1.0)))
        plan.furniture.append(_Patch(surface, instance, material, weight, (2.0, 1.0), ratio=2.0))


def _add_box(plan: _Plan, instance: int, material: int, weight: float, low: Points, high: Points) -> None:
    for axis in range(3):
        for side in (low, high):
            along, up = np.zeros(3), np.zeros(3)
            along[(axis + 1) % 3], up[(axis + 2) % 3] = (high - low)[(axis + 1) % 3], (high - low)[(axis + 2) % 3]
            corner = low.copy()
            corner[axis] = side[axis]
            plan.furniture.append(_Patch(_quad(corner, along, up), instance, material, weight / 6))


def _rounded(centre: Points, half: Points, power: float) -> Surface:
    """A superellipsoid: a box with round edges at small powers, an ellipsoid at 1."""

    def surface(s: Points, t: Points) -> Points:
        around, up = 2 * np.pi * s, np.pi * (t - 0.5)
        unit = np.stack([np.cos(up) * np.cos(around), np.sin(up), np.cos(up) * np.sin(around)], 1)
        return np.asarray(centre + half * np.sign(unit) * np.abs(unit) ** power)

    return surface


def _turned(centre: Points, half: Points, power: float) -> Surface:
    """A vase: a profile with a waist, turned about the upright axis."""

    def surface(s: Points, t: Points) -> Points:
        radius = (0.65 + 0.35 * np.cos(2 * np.pi * t * (1 + power))) * np.clip(t * 20, 0, 1)
        around = 2 * np.pi * s
        unit = np.stack([radius * np.cos(around), 2 * t - 1, radius * np.sin(around)], 1)
        return np.asarray(centre + half * unit)

    return surface


Mesh = tuple[Points, Points, npt.NDArray[np.int64], _Patch]


def _cut(patches: list[_Patch], faces: int, rng: np.random.Generator, rough: float) -> list[Mesh]:
    """Each patch as (vertices, uv, faces, patch), the faces shared out by weight, inner vertices ``rough`` m uneven."""
    # A cell is at least two faces, so small patches take more than their share and the others less.
    weights = np.array([p.weight for p in patches])
    shares = np.maximum(2.0, faces * weights / weights.sum())
    shares *= np.where(shares > 2.0, (faces - 2.0 * np.sum(shares <= 2.0)) / np.sum(shares[shares > 2.0]), 1.0)
    meshes = []
    for patch, share in zip(patches, shares.tolist(), strict=True):
        n = max(1, round(np.sqrt(share / 2 * patch.ratio)))
        m = max(1, round(share / 2 / n))
        t, s = (a.reshape(-1) for a in np.meshgrid(np.linspace(0, 1, m + 1), np.linspace(0, 1, n + 1), indexing="ij"))
        inner = (s > 0) & (s < 1) & (t > 0) & (t < 1)
        vertices = patch.surface(s, t) + rng.normal(0.0, rough, (len(s), 3)) * inner[:, None]
        corner = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
        quads = np.stack([corner, corner + 1, corner + n + 2, corner, corner + n + 2, corner + n + 1], 1)
        meshes.append((vertices, np.stack([s, t], 1) * patch.repeats, quads.reshape(-1, 3), patch))
    return meshes


def _picture(number: int, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """A texture with large soft shapes and a camera's grain."""
    size = TEXTURE_SIZES[number % len(TEXTURE_SIZES)]
    shades = rng.integers(60, 200, 3) + rng.integers(-30, 31, (10, 10, 1)) + rng.integers(-12, 13, (10, 10, 3))
    soft = Image.fromarray(shades.astype(np.uint8))
    picture = np.asarray(soft.resize((size, size), Image.Resampling.BICUBIC), np.int16)
    return np.asarray(np.clip(picture + rng.integers(-6, 7, (size, size, 1), np.int8), 0, 255), np.uint8)


def _assemble(meshes: list[Mesh], plan: _Plan, pictures: list[npt.NDArray[np.uint8]], name: str) -> Scene:
    starts = np.cumsum([0] + [len(v) for v, _, _, _ in meshes])[:-1].tolist()
    vertices = np.concatenate([v for v, _, _, _ in meshes]).astype(np.float32)
    faces = np.concatenate([f + start for (_, _, f, _), start in zip(meshes, starts, strict=True)]).astype(np.int32)
    counts = [len(f) for _, _, f, _ in meshes]
    face_instance = np.repeat([p.instance for _, _, _, p in meshes], counts).astype(np.int32)
    instances = []
    for number, (low, high) in sorted(instance_boxes(vertices, faces, face_instance).items()):
        category, room = plan.categories[number]
        instances.append(Instance(number, category, (low + high) / 2, low, high, room))
    rooms = []
    for room in range(COLUMNS * ROWS):
        x, z = _origin(room)
        low, high = np.array([x, 0.0, z]), np.array([x + WIDTH, HEIGHT, z + LENGTH])
        rooms.append(Room(room, _NAMES[room % len(_NAMES)], low, high))
    return Scene(
        name=name,
        vertices=vertices,
        faces=faces,
        face_material=np.repeat([p.material for _, _, _, p in meshes], counts).astype(np.int32),
        face_instance=face_instance,
        materials=[Material(f"m{n}", np.ones(3, np.float32), picture) for n, picture in enumerate(pictures)],
        instances=instances,
        rooms=rooms,
        uv=np.concatenate([uv for _, uv, _, _ in meshes]).astype(np.float32),
        source=name,
    )
