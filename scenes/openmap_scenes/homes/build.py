"""A home by seed: plan, shell, furniture, light, put together as one scene."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation, label

from openmap_scenes.errors import DataError
from openmap_scenes.homes.furnish import furnish_room
from openmap_scenes.homes.kinds import SPLITS, mpcat40
from openmap_scenes.homes.light import DAY, LAMP, SKY, WARM, Light, bake
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.placement import BODY_HEIGHT, BODY_RADIUS, CELL, Item, RoomSpace, turn_of
from openmap_scenes.homes.plan import WALL, Plan, make_plan
from openmap_scenes.homes.shell import Piece, build_shell
from openmap_scenes.homes.stock import Stock
from openmap_scenes.scene import Instance, Material, Room, Scene, instance_boxes

MIN_OBJECTS, MIN_KINDS = 25, 20
LAMPS = ("ceiling lamp", "pendant lamp", "table lamp", "desk lamp", "floor lamp")


def build_home(rest: str) -> Scene:
    """The home that a catalogue spec names.

    Parameters
    ----------
    rest : str
        ``<split>/<number>``, as in "val/3" or "val/003"; splits are train, val and test and share no furniture.

    Raises
    ------
    DataError
        The spec is not of that form, or the furniture library is not installed.
    """
    split, slash, number = rest.partition("/")
    if not slash or split not in SPLITS or not number.isdecimal():
        raise DataError(f"home {rest!r}", f"{rest!r}", f"<split>/<number> with a split of {', '.join(SPLITS)}")
    return build_home_from_seed(split, int(number))


def build_home_from_seed(split: str, seed: int, folder: Path | None = None) -> Scene:
    """The home of a split and a seed: the same bytes for the same library, in every process.

    Parameters
    ----------
    split : "train", "val" or "test"
        Which furniture may be used.
    seed : int
        0 or more.
    folder : Path or None
        Of the furniture catalogues; None = ``OPENMAP_FURNITURE`` or where the Debian package puts them.
    """
    if split not in SPLITS or seed < 0:
        raise ValueError(f"split {split!r} and seed {seed}; expected one of {SPLITS} and a seed of 0 or more")
    key = int.from_bytes(hashlib.sha256(f"{split}/{seed}".encode()).digest()[:8], "big")
    for attempt in range(20):
        rng = np.random.default_rng([key, attempt])
        plan = make_plan(rng)
        stock = Stock(split, rng, folder)
        items = [item for room in range(len(plan.names)) for item in furnish_room(RoomSpace(plan, room, rng), stock)]
        kinds = {item.thing.kind for item in items}
        if len(items) >= MIN_OBJECTS and len(kinds) >= MIN_KINDS and rooms_connected(plan, items):
            return _assemble(
                f"{split}-{seed:03d}",
                f"homes:{split}/{seed}",
                plan,
                build_shell(plan, rng, _counters(plan, items)),
                items,
            )
    raise RuntimeError(f"no home for {split}/{seed} in 20 attempts: the furniture library may be incomplete")


def _counters(plan: Plan, items: list[Item]) -> dict[int, set[int]]:
    """By kitchen, the walls (indices into its sides) that its stove and its sink stand against."""
    walls: dict[int, set[int]] = {}
    for item in items:
        if plan.kinds[item.room] == "kitchen" and item.thing.kind in ("stove", "kitchen sink"):
            turns = [abs(np.angle(np.exp(1j * (turn_of(s) - item.angle)))) for s in plan.sides(item.room)]
            walls.setdefault(item.room, set()).add(int(np.argmin(turns)))
    return walls


def rooms_connected(plan: Plan, items: list[Item]) -> bool:
    """Whether a body of 0.2 m can walk from every room to every other, on a 5 cm grid of the whole home."""
    out = plan.outline
    shape = int(np.ceil(out.depth / CELL)), int(np.ceil(out.width / CELL))
    solid = np.ones(shape, bool)

    def cells(x0: float, z0: float, x1: float, z1: float) -> tuple[slice, slice]:
        x = np.clip(np.round((np.array([x0, x1]) - out.x0) / CELL), 0, shape[1]).astype(int)
        z = np.clip(np.round((np.array([z0, z1]) - out.z0) / CELL), 0, shape[0]).astype(int)
        return slice(z[0], z[1]), slice(x[0], x[1])

    inner = [plan.inner(room) for room in range(len(plan.names))]
    for r in inner:
        solid[cells(r.x0, r.z0, r.x1, r.z1)] = False
    for o in plan.openings:
        if o.kind == "door":
            z = o.zone(CELL)
            solid[cells(z.x0, z.z0, z.x1, z.z1)] = False
    blocks = [leaf.footprint for leaf in plan.leaves]
    blocks += [item.footprint for item in items if item.low[1] < BODY_HEIGHT and item.high[1] > 0.03]
    for f in blocks:
        solid[cells(f.x0, f.z0, f.x1, f.z1)] = True
    n = round(BODY_RADIUS / CELL)
    disc = np.hypot(*np.mgrid[-n : n + 1, -n : n + 1]) <= n + 1e-6
    areas, _ = label(~binary_dilation(solid, disc, border_value=1))
    found = [set(np.unique(areas[cells(r.x0, r.z0, r.x1, r.z1)]).tolist()) - {0} for r in inner]
    return bool(set.intersection(*found))


def _assemble(name: str, source: str, plan: Plan, shell: list[Piece], items: list[Item]) -> Scene:
    parts: list[tuple[Model, npt.NDArray[np.float64], npt.NDArray[np.float64]]] = []
    labels: list[tuple[str, int, dict[str, str]]] = []
    for piece in shell:
        parts.append((piece.mesh, piece.mesh.vertices.astype(np.float64), piece.mesh.normals.astype(np.float64)))
        labels.append((piece.kind, piece.room, piece.attributes))
    for item in items:
        model = item.thing.model
        parts.append((model, item.world(model.vertices), model.normals.astype(np.float64) @ item.rotation.T))
        labels.append((item.thing.kind, item.room, item.thing.attributes))
    vertices = np.concatenate([p[1] for p in parts]).astype(np.float32)
    normals = np.concatenate([p[2] for p in parts]).astype(np.float32)
    offsets = np.cumsum([0] + [len(p[1]) for p in parts[:-1]])
    faces = np.concatenate([p[0].faces + o for p, o in zip(parts, offsets, strict=True)]).astype(np.int32)
    materials, face_material = _materials([p[0] for p in parts])
    face_instance = np.repeat(np.arange(1, len(parts) + 1), [len(p[0].faces) for p in parts]).astype(np.int32)
    # Thin things on walls cast no shadow: the walls' vertices are too far apart to show it as more than a stain.
    casts = np.array([True] * len(shell) + [float((i.high - i.low).min()) > 0.05 for i in items])[face_instance - 1]
    loose = [p.kind not in ("floor", "wall", "ceiling") for p in shell] + [True] * len(items)
    may_hide = np.repeat(loose, [len(p[1]) for p in parts])
    points = _samples(plan, shell, vertices)
    colour = bake(points, normals, vertices, faces[casts], _lights(plan, items), may_hide)
    shines = np.concatenate(
        [p.shines for p in shell] + [np.full(len(i.thing.model.vertices), i.thing.kind in LAMPS) for i in items]
    )
    colour[shines] = np.maximum(colour[shines], 225)
    boxes = instance_boxes(vertices, faces, face_instance)
    instances = [
        Instance(
            i,
            kind,
            (boxes[i][0] + boxes[i][1]) / 2,
            boxes[i][0],
            boxes[i][1],
            room + 1,
            mpcat40(kind),
            dict(attributes),
            i,
        )
        for i, (kind, room, attributes) in enumerate(labels, start=1)
    ]
    rooms = []
    for room, room_name in enumerate(plan.names):
        r = plan.inner(room)
        rooms.append(Room(room + 1, room_name, np.array([r.x0, 0.0, r.z0]), np.array([r.x1, plan.ceiling, r.z1])))
    return Scene(
        name=name,
        vertices=vertices,
        faces=faces,
        face_material=face_material,
        face_instance=face_instance,
        materials=materials,
        instances=instances,
        rooms=rooms,
        uv=np.concatenate([p[0].uv for p in parts]).astype(np.float32),
        vertex_colour=colour,
        source=source,
        credits=tuple(sorted({item.thing.credit for item in items} - {""})),
    )


def _samples(plan: Plan, shell: list[Piece], vertices: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Where the light of each vertex is measured: at itself, but for floors, walls and ceilings a little out of the corners."""
    points, start = vertices.copy(), 0
    for piece in shell:
        own = points[start : start + len(piece.mesh.vertices)]
        start += len(own)
        r = plan.inner(piece.room)
        if piece.kind in ("floor", "wall", "ceiling"):
            low, high = np.array([r.x0, 0.0, r.z0]), np.array([r.x1, plan.ceiling, r.z1])
            inside = np.all((own > low - 1e-3) & (own < high + 1e-3), axis=1)
            own[inside] = np.clip(own[inside], low + 0.07, high - 0.07)
    return points


def _materials(models: list[Model]) -> tuple[list[Material], npt.NDArray[np.int32]]:
    """One list for all models, a material that several share kept once, and each face's index into it."""
    materials: list[Material] = []
    index: dict[int, int] = {}
    face_material = []
    for model in models:
        for m in model.materials:
            if id(m) not in index:
                index[id(m)] = len(materials)
                materials.append(m)
        face_material.append(np.array([index[id(m)] for m in model.materials], np.int32)[model.face_material])
    return materials, np.concatenate(face_material)


def _lights(plan: Plan, items: list[Item]) -> list[Light]:
    """Windows shine inwards from a few points each; every room has a lamp under its ceiling."""
    lights = []
    for o in plan.openings:
        if not o.glazed:
            continue
        rect = plan.inner(o.rooms[0])
        inward = 1.0 if (rect.z0 if o.axis == "x" else rect.x0) > o.at - WALL else -1.0
        along = o.start + (o.end - o.start) * np.array([0.2, 0.8, 0.2, 0.8])
        height = o.sill + (o.top - o.sill) * np.array([0.25, 0.25, 0.75, 0.75])
        off = np.full(4, o.at + inward * 0.09)
        points = np.stack([along, height, off] if o.axis == "x" else [off, height, along], 1)
        normal = np.array([0.0, 0.0, inward] if o.axis == "x" else [inward, 0.0, 0.0])
        lights.append(Light(points, normal, SKY * (o.end - o.start) * (o.top - o.sill), DAY))
    for room in range(len(plan.names)):
        r = plan.inner(room)
        x, z, s = (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, 0.35
        lamps = [i for i in items if i.room == room and i.thing.kind in LAMPS[:2]]
        y = min([float(i.low[1]) for i in lamps], default=plan.ceiling) - 0.08
        points = np.array([[x - s, y, z - s], [x + s, y, z - s], [x, y, z + s]])
        lights.append(Light(points, None, LAMP * (r.width * r.depth / 12.0) ** 0.5, WARM))
    return lights
