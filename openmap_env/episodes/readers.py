"""Episode files of others: R2R-CE and Habitat's ObjectNav, and the one door to every format, ``load_episodes``.

Both write world-frame metres with Y up, rotations as quaternions [x, y, z, w] and scene files relative to a folder of scene data
sets. Positions lie on the navigation mesh of the data set's own tools, a few centimetres above the floor.
"""

from __future__ import annotations

import gzip
import json
import logging
import math
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from openmap_env.episodes.episode import Episode, Target
from openmap_env.episodes.expressions import with_article
from openmap_env.episodes.jsonl import number, point, read_episodes
from openmap_scenes import DataError, Instance, Scene

logger = logging.getLogger(__name__)

_KINDS_BY_FOLDER = {"mp3d": "mp3d", "hm3d": "hm3d", "replica": "replica", "scannet": "scannet"}
_SAME_OBJECT = 1.0
"""A goal and an instance of the same id are the same thing if their centres are this close, m."""


def load_episodes(path: str | Path, scene_spec: str | None = None, scene: Scene | None = None) -> list[Episode]:
    """Read episodes of any known format: R2R-CE or ObjectNav (.json.gz, content/), our own (.jsonl), or a folder of them.

    Parameters
    ----------
    path : str or Path
        A file, or a folder such as ``objectnav/mp3d/v1/val``.
    scene_spec : str, optional
        Catalogue spec of the scene at hand. Episodes of other scenes are dropped with a line in the log. Without it, scene
        files are looked for in the folders above the episode file: ``<folder>/<scene_id>``, ``<folder>/scene_datasets/<scene_id>``.
    scene : Scene, optional
        Gives ObjectNav goals their boxes: ``object_id`` is looked up as ``Instance.source_id``. Without it a goal is its position.

    Raises
    ------
    DataError
        A file cannot be read, is of no known format, holds an unusable episode, or no episode is left.
    """
    path = Path(path)
    episodes: list[Episode] = []
    for file in _episode_files(path):
        if file.suffix == ".jsonl":
            own = read_episodes(file)
            episodes += own
            continue
        data = _read_json(file)
        entries = data.get("episodes")
        if not isinstance(entries, list):
            raise DataError(file, f"the keys {sorted(data)[:6]}", "an 'episodes' list, as R2R-CE and ObjectNav have")
        if "goals_by_category" in data:
            episodes += [
                _objectnav(f"{file}: episode {i}", file, e, data, scene_spec, scene) for i, e in enumerate(entries)
            ]
        elif all(isinstance(e, dict) and "instruction" in e for e in entries):
            episodes += [_r2r(f"{file}: episode {i}", file, e, scene_spec) for i, e in enumerate(entries)]
        else:
            raise DataError(
                file, "episodes of an unknown kind", "R2R-CE ('instruction') or ObjectNav ('goals_by_category')"
            )
    kept = [e for e in episodes if scene_spec is None or same_scene(e.info.get("scene_id", e.scene), scene_spec)]
    if len(kept) < len(episodes):
        logger.info(
            "%s: dropped %d of %d episodes, their scene is not %s",
            path,
            len(episodes) - len(kept),
            len(episodes),
            scene_spec,
        )
    if not kept:
        found = f"{len(episodes)} episodes, none of scene {scene_spec}" if episodes else "no episode"
        raise DataError(path, found, "at least one episode to run")
    return _with_unique_ids(kept)


def same_scene(scene_id: str, scene_spec: str) -> bool:
    """Whether a scene file ("mp3d/X/X.glb") or spec and a catalogue spec ("mp3d:/data/mp3d/X") name the same home."""
    return _short_name(scene_id) == _short_name(scene_spec)


def _short_name(scene: str) -> str:
    kind, colon, rest = scene.partition(":")
    if kind == "homes" and colon:
        return scene
    name = (rest if colon else scene).rstrip("/").rsplit("/", 1)[-1]
    for ending in (".glb", ".ply", ".basis"):
        name = name.removesuffix(ending)
    head, dash, tail = name.partition("-")
    return tail if dash and len(head) == 5 and head.isdigit() else name


def _episode_files(path: Path) -> list[Path]:
    """The episode files that a path names; a folder's or file's ``content/`` is included, R2R's ground-truth files are not."""
    if path.is_dir():
        here = sorted(p for p in path.iterdir() if p.name.endswith((".json.gz", ".json", ".jsonl")))
    elif path.is_file():
        here = [path]
    else:
        raise DataError(path, "no such file or folder", "an episode file, or a folder of them")
    content = (path if path.is_dir() else path.parent) / "content"
    files = [p for p in here if not p.name.split(".")[0].endswith("_gt")]
    if content.is_dir() and content not in path.parents:
        files = [p for p in files if p.suffix == ".jsonl" or _read_json(p).get("episodes") != []]
        files += sorted(p for p in content.iterdir() if p.name.endswith((".json.gz", ".json")))
    if not files:
        raise DataError(path, "no episode file", "files that end in .json.gz, .json or .jsonl")
    return files


def _read_json(path: Path) -> dict[str, Any]:
    try:
        raw = path.read_bytes()
        data = json.loads(gzip.decompress(raw) if path.name.endswith(".gz") else raw)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, json.JSONDecodeError) as error:
        remedy = "Fetch the file again; it may be incomplete."
        raise DataError(path, f"no readable JSON ({error})", "JSON, gzipped if the name ends in .gz", remedy) from error
    if not isinstance(data, dict):
        raise DataError(path, f"a JSON {type(data).__name__}", "an object with an 'episodes' list")
    return data


def _scene_spec(file: Path, scene_id: str) -> str:
    """The catalogue spec of a scene file that an episode file names, found in the folders above the latter."""
    for folder in file.resolve().parents:
        for base in (folder, folder / "scene_datasets"):
            found = base / scene_id
            if found.is_file():
                kind = _KINDS_BY_FOLDER.get(Path(scene_id).parts[0])
                return f"{kind}:{found.parent}" if kind else f"file:{found}"
    remedy = "Pass scene_spec, for example mp3d:<scan folder>."
    raise DataError(
        file, f"scene_id {scene_id!r}, which is no file under the folders above", "the scene's file", remedy
    )


def _common(where: str, file: Path, entry: Any, scene_spec: str | None) -> dict[str, Any]:
    """What both formats share: the id, the scene and the start pose."""
    names = ("episode_id", "scene_id", "start_position", "start_rotation")
    if not isinstance(entry, dict) or not set(names) <= set(entry):
        missing = sorted(set(names) - set(entry)) if isinstance(entry, dict) else list(names)
        raise DataError(where, f"an entry without {', '.join(missing)}", f"an object with {', '.join(names)}")
    scene_id = entry["scene_id"]
    if not isinstance(scene_id, str) or not scene_id:
        raise DataError(where, f"scene_id {scene_id!r}", "the path of a scene file")
    return {
        "episode_id": str(entry["episode_id"]),
        "scene": scene_spec or _scene_spec(file, scene_id),
        "start_position": point(where, "start_position", entry["start_position"]),
        "start_heading": heading_of(where, entry["start_rotation"]),
    }


def heading_of(where: str, quaternion: Any) -> float:
    """The heading in radians, positive to the left of -Z, of a quaternion [x, y, z, w].

    Raises
    ------
    DataError
        It is no rotation, or looks straight up or down.
    """
    if not isinstance(quaternion, list) or len(quaternion) != 4:
        raise DataError(where, f"start_rotation {quaternion!r}", "a quaternion [x, y, z, w]")
    q = [number(where, "start_rotation", v) for v in quaternion]
    if abs(math.hypot(*q) - 1.0) > 0.01:
        raise DataError(where, f"start_rotation {q} of length {math.hypot(*q):.3f}", "a unit quaternion [x, y, z, w]")
    forward = Rotation.from_quat(q).apply([0.0, 0.0, -1.0])
    if math.hypot(forward[0], forward[2]) < 1e-3:
        raise DataError(where, f"start_rotation {q}, which looks straight up or down", "a rotation about the Y axis")
    return math.atan2(-forward[0], -forward[2])


def _r2r(where: str, file: Path, entry: Any, scene_spec: str | None) -> Episode:
    common = _common(where, file, entry, scene_spec)
    text = entry["instruction"].get("instruction_text") if isinstance(entry["instruction"], dict) else None
    goals = entry.get("goals")
    if not isinstance(text, str) or not text.strip():
        raise DataError(where, f"instruction_text {text!r}", "a text that is not empty")
    if not isinstance(goals, list) or not goals or not all(isinstance(g, dict) and "position" in g for g in goals):
        raise DataError(where, f"goals {goals!r}", "a list of at least one {position, radius}")
    info = {
        "scene_id": entry["scene_id"],
        "radius": goals[0].get("radius"),
        "trajectory_id": entry.get("trajectory_id"),
        "reference_path": entry.get("reference_path"),
        **(entry.get("info") or {}),
    }
    targets = tuple(_place(point(where, "goal position", g["position"])) for g in goals)
    return Episode(instruction=" ".join(text.split()), kind="language_guided", targets=targets, info=info, **common)


def _objectnav(
    where: str, file: Path, entry: Any, data: dict[str, Any], scene_spec: str | None, scene: Scene | None
) -> Episode:
    common = _common(where, file, entry, scene_spec)
    category = entry.get("object_category")
    if not isinstance(category, str) or not category:
        raise DataError(where, f"object_category {category!r}", "a category's name")
    key = f"{entry['scene_id'].rsplit('/', 1)[-1]}_{category}"
    goals = data["goals_by_category"].get(key)
    if not isinstance(goals, list) or not goals or not all(isinstance(g, dict) and "position" in g for g in goals):
        raise DataError(where, f"no goals under {key!r} in goals_by_category", "at least one goal with a position")
    noun = category.replace("_", " ")
    instruction = f"Find {with_article(noun, noun, unique=len(goals) == 1)}."
    targets = tuple(_place(point(where, "goal position", goal["position"])) for goal in goals)
    object_ids = [goal.get("object_id") for goal in goals]
    info = {"scene_id": entry["scene_id"], "category": category, "object_ids": object_ids, **(entry.get("info") or {})}
    episode = Episode(instruction=instruction, kind="object_goal", targets=targets, info=info, **common)
    return episode if scene is None else with_boxes(episode, scene)


def with_boxes(episode: Episode, scene: Scene) -> Episode:
    """An ObjectNav episode whose goals are the scene's instances, with their boxes; other episodes as they are.

    A goal whose id is no instance of the scene, or one elsewhere, stays a position.
    """
    object_ids = episode.info.get("object_ids", ())
    if len(object_ids) != len(episode.targets) or any(target.instance_id for target in episode.targets):
        return episode
    by_source = {instance.source_id: instance for instance in scene.instances}
    targets = []
    for source_id, target in zip(object_ids, episode.targets, strict=True):
        instance = by_source.get(source_id)
        same = instance is not None and np.linalg.norm(instance.centre - np.array(target.centre)) <= _SAME_OBJECT
        targets.append(target_of(instance) if instance is not None and same else target)
    return replace(episode, targets=tuple(targets))


def _place(centre: tuple[float, float, float]) -> Target:
    return Target(0, centre, centre, centre)


def target_of(instance: Instance) -> Target:
    """An instance as a target."""

    def triple(v: Any) -> tuple[float, float, float]:
        return float(v[0]), float(v[1]), float(v[2])

    return Target(instance.id, triple(instance.centre), triple(instance.aabb_min), triple(instance.aabb_max))


def _with_unique_ids(episodes: list[Episode]) -> list[Episode]:
    """The same episodes; where files repeat ids, each gets its home's name in front."""
    if len({e.episode_id for e in episodes}) == len(episodes):
        return episodes
    renamed = [replace(e, episode_id=f"{_short_name(e.scene)}/{e.episode_id}") for e in episodes]
    if len({e.episode_id for e in renamed}) < len(renamed):
        renamed = [replace(e, episode_id=f"{e.episode_id}#{i}") for i, e in enumerate(renamed)]
    return renamed
