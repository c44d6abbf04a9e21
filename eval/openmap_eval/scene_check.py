"""What is wrong with a scene or a recording, and how to mend it: the findings of ``openmap scenes check``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_env.navigation import NavigableSurface
from openmap_eval.scene_audit import ENOUGH_PIXELS, Solid, best_views, clashes, things, unreachable_rooms
from openmap_scenes import DataError, Instance, Scene, load_scene
from openmap_scenes.catalog import READERS, guess_spec
from openmap_scenes.recordings import open_recording
from openmap_scenes.recordings.exported import PARTS

UNLABELLED_AREA = 0.3
"""Share of the surface that may lie on no instance before it is worth a word."""
FLOOR_HOLES = 0.02
"""Share of a room's floor that may be open."""
HEIGHTS = (1.8, 30.0)
"""A home is this high, m; anything else is another unit or another axis."""
LYING = 1.25
"""A mesh lies on its side where so many times more area looks along x or z than along y."""
ENOUGH_AREA = 0.9
"""Share of the area that looks along y that must look along an axis for floors to be taken to look along it."""
LAYER = 0.3
"""How thick, m, a layer of faces is that counts as one wall or floor."""
MOST_RAYS = 250_000
"""How many places of a room's floor are looked at, at most."""
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

    def __str__(self) -> str:
        return f"{self.what.rstrip('.')}. {self.remedy}" if self.remedy else self.what


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
    if not target.strip() or not path.exists():
        what = f"{target!r}: no such file or folder, and no spec of the catalogue"
        return [Finding("error", what, "Check the spelling.")]
    recordings = find_recordings(path)
    found = [finding for recording in recordings for finding in _recording_findings(recording)]
    if recordings and path.is_file():
        return found
    try:
        spec = guess_spec(path)
    except (DataError, OSError) as error:
        return found if recordings else [Finding("error", str(error))]
    return found + list(_scene_findings(spec, thorough))


def find_recordings(path: Path) -> list[Path]:
    """The posed RGB-D recordings at a path: a folder with exported frames, and ``.sens`` files."""
    if path.is_file():
        return [path] if path.suffix == ".sens" else []
    exported = [path] if any((path / part).is_dir() for part in PARTS) else []
    return exported + sorted(path.glob("*.sens"))


def _recording_findings(path: Path) -> list[Finding]:
    try:
        recording = open_recording(path)
        frames = sum(1 for _ in recording)
    except (DataError, OSError) as error:
        return [Finding("error", str(error))]
    if frames == 0:
        return [Finding("error", f"{path}: a recording without a single posed frame", "Record or export it again.")]
    found = [Finding("note", f"{path.name} is a recording with {_counted(frames, 'posed frame')}")]
    if recording.skipped:
        lost = ", ".join(map(str, recording.skipped[:8])) + (", ..." if len(recording.skipped) > 8 else "")
        untracked = _counted(len(recording.skipped), "frame")
        found.append(Finding("note", f"{path.name} has {untracked} without tracking, left out: {lost}"))
    return found


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


def _scene_findings(spec: str, thorough: bool) -> Iterator[Finding]:
    try:
        scene = load_scene(spec)
    except (DataError, OSError) as error:
        yield Finding("error", str(error))
        return
    yield from _looks(scene)
    yield from _semantics(scene)
    misplaced = _placement(scene)
    if misplaced is not None:
        yield misplaced
    if misplaced is not None and misplaced.severity == "error":
        return
    try:
        surface = NavigableSurface.from_scene(scene)
    except ValueError as error:
        yield Finding("error", str(error), "Check the units and which axis is up.")
        return
    yield from _floor(scene, surface)
    if thorough:
        yield from _things(scene, surface)


def _placement(scene: Scene) -> Finding | None:
    """What is wrong with the scale or the axes, if anything is; what else could be said of the scene then means little."""
    low, high = scene.aabb
    size = " x ".join(f"{x:.2f}" for x in high - low)
    reader = "or use the reader of its dataset, which knows the file's axes"
    if not HEIGHTS[0] <= high[1] - low[1] <= HEIGHTS[1]:
        what = f"the scene is {size} m (x, y, z), and y is up"
        return Finding("error", what, f"Scale it to metres and turn it Y up, {reader}.")
    axis, is_labelled = _upright(scene)
    if axis != 1:
        lies = "lies on its side: its floors look" if is_labelled else "seems to lie on its side: most of it looks"
        what = f"the scene of {size} m (x, y, z) {lies} along {'xyz'[axis]}, and y is up"
        return Finding("error" if is_labelled else "warning", what, f"Turn it Y up, {reader}.")
    return None


def _upright(scene: Scene) -> tuple[int, bool]:
    """Which axis (0, 1, 2) floors look along, and whether labels say so.

    Without labels it is the axis with the largest layer of faces: in a flat of many rooms walls have more area altogether.
    The walls of a tower are larger than each of its floors, so there must not be much less area in all either. y where in doubt.
    """
    normal = np.abs(_normals(scene))
    floors = np.isin(scene.face_instance, [i.id for i in scene.instances if i.category == "floor"])
    if floors.any():
        return _prevailing(normal[floors].sum(0)), True
    centre, total = scene.vertices[scene.faces].mean(1), np.linalg.norm(normal, axis=1)
    area, largest = np.zeros(3), np.zeros(3)
    for axis in range(3):
        flat = normal[:, axis] > 0.9 * np.maximum(total, 1e-12)
        if flat.any():
            _, layer = np.unique(np.floor(centre[flat, axis] / LAYER), return_inverse=True)
            area[axis], largest[axis] = total[flat].sum(), np.bincount(layer.ravel(), total[flat]).max()
    axis = _prevailing(largest)
    return (axis if area[axis] >= ENOUGH_AREA * area[1] else 1), False


def _prevailing(area: npt.NDArray[np.float64]) -> int:
    """The axis of the largest area (3,); y unless another one has ``LYING`` times as much."""
    return 1 if area[1] * LYING >= area.max() else int(np.argmax(area))


def _normals(scene: Scene) -> npt.NDArray[np.float64]:
    """Normal of each face (F, 3), as long as its area, m2."""
    corners = scene.vertices[scene.faces].astype(np.float64)
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2, np.float64)


def _looks(scene: Scene) -> Iterator[Finding]:
    missing = sorted({m.missing_texture for m in scene.materials if m.missing_texture})
    if missing:
        yield Finding(
            "warning",
            f"{_counted(len(missing), 'texture')} missing, the first is {missing[0]}; plain colours stand in",
            "Put the images where the mesh names them, or fetch the archive of textures of the dataset.",
        )
    plain = all(m.texture is None for m in scene.materials)
    if plain and scene.vertex_colour is None and len({m.colour.tobytes() for m in scene.materials}) == 1:
        yield Finding("warning", "the mesh has neither textures nor colours", "Use the textured release of the scene.")
    area = np.linalg.norm(_normals(scene), axis=1)
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
    area = np.linalg.norm(_normals(scene), axis=1)
    bare = float(area[scene.face_instance == 0].sum() / max(area.sum(), 1e-12))
    if bare > UNLABELLED_AREA:
        yield Finding(
            "warning", f"{bare:.0%} of the surface belongs to no instance", "Check that the files are of one scan."
        )
    drawn = set(np.unique(scene.face_instance).tolist())
    for text, severity, some in (
        ("without any face", "warning", [i for i in scene.instances if i.id not in drawn]),
        ("without a name", "note", [i for i in scene.instances if i.category in NAMELESS]),
        ("in no room", "note", [i for i in scene.instances if scene.rooms and i.room is None]),
        ("with a name that no label set knows", "note", [i for i in scene.instances if _unknown(i)]),
    ):
        if some:
            names = ", ".join(f"{i.category} ({i.id})" for i in some[:4]) + (", ..." if len(some) > 4 else "")
            yield Finding(severity, f"{_counted(len(some), 'instance')} {text}: {names}")
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
        # A box that is damaged may be of any size.
        step = max(0.1, math.sqrt(float((high - low)[0] * (high - low)[2]) / MOST_RAYS))
        x, z = (
            np.arange(low[0] + margin[0], high[0] - margin[0], step),
            np.arange(low[2] + margin[2], high[2] - margin[2], step),
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
