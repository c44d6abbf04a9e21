"""A furnished plan as one scene: arrays, instances with their names, rooms, credits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.items import Item
from openmap_scenes.homes.kinds import mpcat40
from openmap_scenes.homes.lamps import HIGH_LAMPS, LAMPS, home_lights
from openmap_scenes.homes.light import bake
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.plan import Plan
from openmap_scenes.homes.shell import Piece
from openmap_scenes.scene import Instance, Material, Room, Scene, instance_boxes
from openmap_scenes.taxonomy import labels_of

# How many times as large as the next one a thing is that people would call the large one of its kind.
CLEARLY = 1.6


def assemble(
    name: str, source: str, plan: Plan, shell: list[Piece], items: list[Item], rng: np.random.Generator
) -> Scene:
    """Shell and furniture as one scene with baked light; ``rng`` draws the weather and the colour of the lamps."""
    parts: list[tuple[Model, npt.NDArray[np.float64], npt.NDArray[np.float64]]] = []
    labels: list[tuple[str, int, dict[str, str]]] = []
    for piece in shell:
        parts.append((piece.mesh, piece.mesh.vertices.astype(np.float64), piece.mesh.normals.astype(np.float64)))
        labels.append((piece.kind, piece.room, piece.attributes))
    for item in items:
        model = item.thing.model
        parts.append((model, item.world(model.vertices), model.normals.astype(np.float64) @ item.rotation.T))
    words = describe(items)
    labels += [(item.thing.kind, item.room, words[n]) for n, item in enumerate(items)]
    vertices = np.concatenate([p[1] for p in parts]).astype(np.float32)
    normals = np.concatenate([p[2] for p in parts]).astype(np.float32)
    offsets = np.cumsum([0] + [len(p[1]) for p in parts[:-1]])
    faces = np.concatenate([p[0].faces + o for p, o in zip(parts, offsets, strict=True)]).astype(np.int32)
    materials, face_material = _materials([p[0] for p in parts])
    face_instance = np.repeat(np.arange(1, len(parts) + 1), [len(p[0].faces) for p in parts]).astype(np.int32)
    # Thin things on walls cast no shadow: the walls' vertices are too far apart to show it as more than a stain.
    casts = np.array([True] * len(shell) + [_casts(i) for i in items])[face_instance - 1]
    loose = [p.kind not in ("floor", "wall", "ceiling") for p in shell] + [True] * len(items)
    may_hide = np.repeat(loose, [len(p[1]) for p in parts])
    points = _samples(plan, shell, vertices)
    lights, sun = home_lights(plan, items, rng)
    colour = bake(points, normals, vertices, faces[casts], lights, may_hide, sun)
    shines = np.concatenate(
        [p.shines for p in shell] + [np.full(len(i.thing.model.vertices), i.thing.kind in LAMPS) for i in items]
    )
    colour[shines] = np.maximum(colour[shines], 225)
    boxes = instance_boxes(vertices, faces, face_instance)
    instances = []
    for i, (kind, room, attributes) in enumerate(labels, start=1):
        low, high = boxes[i]
        labels_there = labels_of(kind)
        instances.append(
            Instance(
                id=i,
                category=kind,
                centre=(low + high) / 2,
                aabb_min=low,
                aabb_max=high,
                room=room + 1,
                mpcat40=mpcat40(kind),
                attributes=dict(attributes),
                source_id=i,
                scannet200=labels_there.scannet200,
                lvis=labels_there.lvis,
            )
        )
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
        credits=credits_of(items),
    )


def _casts(item: Item) -> bool:
    """Whether a thing's shadow is baked: not that of thin things on walls, nor that of the lamps which light the room."""
    hangs = item.low[1] > 0.3 and item.support is None
    return item.thing.kind not in HIGH_LAMPS and float((item.high - item.low).min()) > (0.2 if hangs else 0.05)


def describe(items: list[Item]) -> list[dict[str, str]]:
    """Words for every item; "large" and "small" only for the one of its kind that is clearly so."""
    words = [dict(item.thing.attributes) for item in items]
    by_kind: dict[str, list[int]] = {}
    for n, item in enumerate(items):
        by_kind.setdefault(item.thing.kind, []).append(n)
    for same in by_kind.values():
        ordered = sorted(same, key=lambda n: float(np.prod(items[n].thing.model.size)))
        volume = [float(np.prod(items[n].thing.model.size)) for n in ordered]
        if len(ordered) > 1 and volume[-1] > CLEARLY * volume[-2]:
            words[ordered[-1]]["size"] = "large"
        if len(ordered) > 1 and volume[1] > CLEARLY * volume[0]:
            words[ordered[0]]["size"] = "small"
    return words


# What the Creative Commons Attribution licences ask to be told.
CHANGES = "The models named above were scaled and thinned, their glass made opaque, and all of it lit anew."
LICENCES = (
    "Creative Commons Attribution 3.0: https://creativecommons.org/licenses/by/3.0/, United States: "
    "https://creativecommons.org/licenses/by/3.0/us/; public domain: https://creativecommons.org/publicdomain/zero/1.0/"
)


def credits_of(items: list[Item]) -> tuple[str, ...]:
    """Authors and licences of the library's pieces, and one line for what is made by rule."""
    listed = sorted({item.thing.credit for item in items} - {""})
    return (
        *listed,
        *((CHANGES, LICENCES) if listed else ()),
        "Everything else is made by rule by openmap_scenes, Apache-2.0.",
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
