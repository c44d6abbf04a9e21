"""What is wrong with a scene or a recording, and how to mend it: the findings of ``openmap scenes check``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from openmap_env.navigation import NavigableSurface
from openmap_eval.scene_audit import ENOUGH_PIXELS, Solid, best_views, clashes, things, unreachable_rooms
from openmap_scenes import DataError, Instance, Scene, load_scene
from openmap_scenes.catalog import READERS, guess_spec
from openmap_scenes.recordings import open_recording

UNLABELLED_AREA = 0.3
"""Share of the surface that may lie on no instance before it is worth a word."""
FLOOR_HOLES = 0.02
"""Share of a room's floor that may be open."""
HEIGHTS = (1.8, 30.0)
"""A home is this high, m; anything else is another unit or another axis."""
NAMELESS = frozenset({"", "unlabelled", "unlabeled", "unknown", "undefined", "object", "remove", "misc"})


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Parameters
    ----------
    severity : "error", "warning" or "note"
        The data cannot be used; can be used with a loss; is as it is, but good to know.
    what : str
    remedy : str
    """

    severity: str
    what: str
    remedy: str = ""


def check(target: str, thorough: bool = False) -> list[Finding]:
    """Everything that is wrong with what a spec or a path names: a scene, a recording, or a folder that holds both.

    Parameters
    ----------
    target : str
        A spec of the catalogue, or a path whose kind is told by the files that lie there.
    thorough : bool
        Also look for solids that run into each other and for things that cannot be seen, which takes some seconds.
    """
    kind = target.partition(":")[0]
    if kind in READERS:
        return list(_scene_findings(target, thorough))
    path = Path(target)
    if not path.exists():
        return [
            Finding("error", f"{target}: no such file or folder, and no spec of the catalogue", "Check the spelling.")
        ]
    found: list[Finding] = []
    recorded = holds_recording(path)
    if recorded:
        found += _recording_findings(path)
    try:
        spec = guess_spec(path)
    except DataError as error:
        return found if recorded else [Finding("error", str(error))]
    return found + list(_scene_findings(spec, thorough))


def holds_recording(path: Path) -> bool:
    """Whether posed RGB-D frames lie at a path."""
    if path.is_file():
        return path.suffix == ".sens"
    return any((path / name).is_dir() for name in ("color", "depth", "pose")) or bool(list(path.glob("*.sens")))


def _recording_findings(path: Path) -> list[Finding]:
    try:
        recording = open_recording(path)
        frames = sum(1 for _ in recording)
    except DataError as error:
        return [Finding("error", str(error))]
    if frames == 0:
        return [Finding("error", f"{path}: a recording without a single posed frame", "Record or export it again.")]
    found = [Finding("note", f"a recording of {frames} posed frames")]
    if recording.skipped:
        lost = ", ".join(map(str, recording.skipped[:8])) + (", ..." if len(recording.skipped) > 8 else "")
        found.append(Finding("note", f"{len(recording.skipped)} frames were not tracked and are left out: {lost}"))
    return found


def _scene_findings(spec: str, thorough: bool) -> Iterator[Finding]:
    try:
        scene = load_scene(spec)
    except DataError as error:
        yield Finding("error", str(error))
        return
    yield from _looks(scene)
    yield from _semantics(scene)
    low, high = scene.aabb
    if not HEIGHTS[0] <= high[1] - low[1] <= HEIGHTS[1]:
        size = " x ".join(f"{x:.2f}" for x in high - low)
        yield Finding(
            "error",
            f"the scene is {size} m (x, y, z), and y is up",
            "Scale it to metres and turn it Y up, or use the reader of its dataset, which knows the file's axes.",
        )
    try:
        surface = NavigableSurface.from_scene(scene)
    except ValueError as error:
        yield Finding("error", str(error), "Check the units and which axis is up.")
        return
    yield from _floor(scene, surface)
    if thorough:
        yield from _things(scene, surface)


def _looks(scene: Scene) -> Iterator[Finding]:
    missing = sorted({m.missing_texture for m in scene.materials if m.missing_texture})
    if missing:
        yield Finding(
            "warning",
            f"{len(missing)} textures are missing, the first is {missing[0]}; plain colours stand in",
            "Put the images where the mesh names them, or fetch the archive of textures of the dataset.",
        )
    plain = all(m.texture is None for m in scene.materials)
    if plain and scene.vertex_colour is None and len({m.colour.tobytes() for m in scene.materials}) == 1:
        yield Finding("warning", "the mesh has neither textures nor colours", "Use the textured release of the scene.")
    corners = scene.vertices[scene.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    flat = int((area <= 1e-12).sum())
    if flat > 0.05 * len(area):
        yield Finding("note", f"{flat} of {len(area)} faces have no area", "Harmless here; a cleaned mesh is smaller.")


def _semantics(scene: Scene) -> Iterator[Finding]:
    if not scene.instances:
        yield Finding(
            "warning",
            "no semantics: not one instance is known, so no episodes can be made and nothing be scored",
            "Put the semantic files of the dataset beside the mesh, or an instances.json (scenes/README.md).",
        )
        return
    corners = scene.vertices[scene.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    bare = float(area[scene.face_instance == 0].sum() / max(area.sum(), 1e-12))
    if bare > UNLABELLED_AREA:
        yield Finding(
            "warning", f"{bare:.0%} of the surface belongs to no instance", "Check that the files are of one scan."
        )
    drawn = set(np.unique(scene.face_instance).tolist())
    for text, severity, some in (
        ("listed instances have no face", "warning", [i for i in scene.instances if i.id not in drawn]),
        ("instances have no name", "note", [i for i in scene.instances if i.category in NAMELESS]),
        ("instances are in no room", "note", [i for i in scene.instances if scene.rooms and i.room is None]),
        ("instances have names that no label set knows", "note", [i for i in scene.instances if _unknown(i)]),
    ):
        if some:
            names = ", ".join(f"{i.category} ({i.id})" for i in some[:4]) + (", ..." if len(some) > 4 else "")
            yield Finding(severity, f"{len(some)} {text}: {names}")
    if not scene.rooms:
        yield Finding("note", "no rooms are known: instructions will not speak of any")


def _unknown(instance: Instance) -> bool:
    labels = (instance.mpcat40, instance.scannet200, instance.lvis)
    return instance.category not in NAMELESS and not any(labels)


def _floor(scene: Scene, surface: NavigableSurface) -> Iterator[Finding]:
    for room in unreachable_rooms(scene, surface):
        yield Finding(
            "warning",
            f"the {room.name} (room {room.id}) cannot be reached: no body of radius {surface.body.radius} m gets in from the rest",
            "Open its door, fill the hole in its floor, or leave its things out of the episodes.",
        )
    floors = [i.id for i in scene.instances if i.category == "floor"]
    if floors:
        faces = np.sort(scene.faces[np.isin(scene.face_instance, floors)][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, uses = np.unique(faces, axis=0, return_counts=True)
        crowded = int((uses > 2).sum())
        if crowded:
            yield Finding(
                "warning",
                f"the floor is not manifold: {crowded} edges belong to more than two faces",
                "Remove doubled faces.",
            )
    for name, share in _holes(scene):
        yield Finding(
            "warning", f"{share:.0%} of the {name} has no floor", "Fill the holes, or it cannot be walked on there."
        )


def _holes(scene: Scene) -> Iterator[tuple[str, float]]:
    """Rooms in whose box some rays straight down meet nothing, and the share of those."""
    caster = Solid.of(scene)
    for room in scene.rooms:
        low, high = room.aabb_min, room.aabb_max
        margin = np.minimum(0.3, (high - low) / 4)
        x, z = (
            np.arange(low[0] + margin[0], high[0] - margin[0], 0.1),
            np.arange(low[2] + margin[2], high[2] - margin[2], 0.1),
        )
        if len(x) == 0 or len(z) == 0:
            continue
        grid = np.stack(np.meshgrid(x, z), -1).reshape(-1, 2)
        top = (low[1] + high[1]) / 2
        origin = np.insert(grid, 1, top, axis=1).astype(np.float32)
        hit = caster.distance(origin, np.array([0.0, -1.0, 0.0], np.float32))
        open_share = float((hit > top - low[1] + 0.5).mean())
        if open_share > FLOOR_HOLES:
            yield room.name, open_share


def _things(scene: Scene, surface: NavigableSurface) -> Iterator[Finding]:
    for clash in clashes(scene):
        a, b = (f"{i.category} ({i.id})" for i in (clash.first, clash.second))
        place = ", ".join(f"{x:.2f}" for x in clash.place)
        yield Finding("warning", f"{a} and {b} run into each other at ({place}) m", "Move one of them.")
    pixels = best_views(scene, surface)
    hidden = [i for i in things(scene) if pixels[i.id] < ENOUGH_PIXELS]
    if hidden:
        names = ", ".join(f"{i.category} ({i.id}: {pixels[i.id]} px)" for i in hidden[:6])
        yield Finding(
            "note",
            f"{len(hidden)} of {len(pixels)} things never cover {ENOUGH_PIXELS} pixels from a reachable place: {names}",
            "Leave them out of the episodes.",
        )
