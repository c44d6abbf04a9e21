"""The one door to episode files of every format, ``load_episodes``.

R2R-CE's, Habitat ObjectNav's and VLMaps' files write world-frame metres with Y up. Positions lie on the navigation mesh of the data
set's own tools, a few centimetres above the floor. Scenes are named by files relative to a folder of scene data sets.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from openmap_env.episodes.episode import Episode, same_box, target_of
from openmap_env.episodes.fields import parse, read_bytes, text
from openmap_env.episodes.jsonl import read_episodes
from openmap_env.episodes.objectnav import objectnav_episode, with_boxes
from openmap_env.episodes.r2r import r2r_episode
from openmap_env.episodes.vlmaps import vlmaps_episodes, with_things
from openmap_scenes import DataError, Scene
from openmap_scenes.formats.checked_json import Value

__all__ = ["complete", "load_episodes", "same_scene", "target_of"]

logger = logging.getLogger(__name__)

_SCAN_FOLDERS = ("mp3d", "hm3d", "replica", "scannet")
"""Data sets whose scenes are folders; their names, as folders and as kinds of specs."""
_OURS = (".jsonl", ".jsonl.gz")
_THEIRS = (".json", ".json.gz")
_FORMATS = "R2R-CE ('instruction'), ObjectNav ('object_category') or VLMaps ('objects_info')"


def load_episodes(path: str | Path, scene_spec: str | None = None, scene: Scene | None = None) -> list[Episode]:
    """Read episodes of any known format: R2R-CE, ObjectNav (with ``content/``), VLMaps, our own (.jsonl), or a folder of them.

    Parameters
    ----------
    path : str or Path
        A file, or a folder such as ``objectnav/mp3d/v1/val``.
    scene_spec : str, optional
        Catalogue spec of the scene at hand. Episodes of other scenes are dropped with a line in the log. Without it, scene
        files are looked for in the folders above the episode file: ``<folder>/<scene_id>``, ``<folder>/scene_datasets/<scene_id>``.
    scene : Scene, optional
        Says what the files leave to it, see ``complete``.

    Raises
    ------
    DataError
        A file cannot be read, is of no known format, holds an unusable episode, or no episode is left.
    """
    path = Path(path)
    kept: list[Episode] = []
    dropped = 0
    for file in _episode_files(path):
        for scene_id, entry in _entries(file):
            if scene_spec is not None and not same_scene(scene_id, scene_spec):
                dropped += 1
            elif isinstance(entry, Episode):
                kept.append(entry if scene_spec is None else replace(entry, scene=scene_spec))
            else:
                kept += _made(entry, scene_spec or _scene_spec(file, scene_id))
    if dropped:
        total = dropped + len(kept)
        logger.info("%s: dropped %d of %d episodes, their scene is not %s", path, dropped, total, scene_spec)
    if not kept:
        found = f"{dropped} episodes, none of scene {scene_spec}" if dropped else "no episode"
        raise DataError(path, found, "at least one episode to run")
    return _with_unique_ids(kept if scene is None else [complete(episode, scene) for episode in kept])


def complete(episode: Episode, scene: Scene) -> Episode:
    """The episode with what only its scene knows.

    The boxes of ObjectNav's goals, the things that VLMaps' categories mean, and every digit of boxes that a file rounds.
    """
    return _exact(with_things(with_boxes(episode, scene), scene), scene)


def _exact(episode: Episode, scene: Scene) -> Episode:
    """The episode with the scene's own boxes for the targets that are its instances."""
    by_id = {instance.id: instance for instance in scene.instances}
    targets = []
    for target in episode.targets:
        instance = by_id.get(target.instance_id)
        targets.append(target if instance is None or not same_box(target, instance) else target_of(instance))
    return replace(episode, targets=tuple(targets))


def same_scene(scene_id: str, scene_spec: str) -> bool:
    """Whether a scene file ("mp3d/X/X.glb") or spec and a catalogue spec ("mp3d:/data/mp3d/X") name the same home."""
    return _short_name(scene_id) == _short_name(scene_spec)


def _short_name(scene: str) -> str:
    kind, colon, rest = scene.partition(":")
    if kind == "homes" and colon:
        return re.sub(r"/0+(?=\d)", "/", scene)
    short = (rest if colon else scene).rstrip("/").rsplit("/", 1)[-1]
    for ending in (".glb", ".ply", ".basis"):
        short = short.removesuffix(ending)
    head, dash, tail = short.partition("-")
    return tail if dash and len(head) == 5 and head.isdigit() else short


def _episode_files(path: Path) -> list[Path]:
    """The episode files that a path names; a folder's or file's ``content/`` is included, R2R's ground-truth files are not."""
    if path.is_dir():
        here = sorted(p for p in path.iterdir() if p.name.endswith((*_OURS, *_THEIRS)))
    elif path.is_file():
        here = [path]
    else:
        raise DataError(path, "no such file or folder", "an episode file, or a folder of them")
    content = (path if path.is_dir() else path.parent) / "content"
    files = [p for p in here if not p.name.split(".")[0].endswith("_gt")]
    if content.is_dir() and content not in path.parents:
        files = [p for p in files if p.name.endswith(_OURS) or not _is_index(p)]
        files += sorted(p for p in content.iterdir() if p.name.endswith(_THEIRS))
    if not files:
        raise DataError(path, "no episode file", "files that end in .json.gz, .json, .jsonl or .jsonl.gz")
    return files


def _is_index(path: Path) -> bool:
    """Whether a file says no more than that the episodes are in ``content/``."""
    data = parse(read_bytes(path), path)
    return isinstance(data, dict) and data.get("episodes") == []


def _entries(file: Path) -> Iterator[tuple[str, Episode | tuple[Value, Value]]]:
    """What a file holds: the scene of each entry, and the episode, or the entry and what all of its entries share."""
    if file.name.endswith(_OURS):
        for episode in read_episodes(file):
            yield str(episode.info.get("scene_id", episode.scene)), episode
        return
    data: Any = parse(read_bytes(file), file)
    episodes = data.get("episodes") if isinstance(data, dict) else data
    if not isinstance(episodes, list):
        found = f"the keys {sorted(data)[:6]}" if isinstance(data, dict) else f"a JSON {type(data).__name__}"
        raise DataError(file, found, "an object with an 'episodes' list, or VLMaps' list of tasks")
    shared = Value(data.get("goals_by_category") if isinstance(data, dict) else None, file, "goals_by_category")
    for number, raw in enumerate(episodes):
        entry = Value(raw, f"{file}: episode {number}")
        yield text(entry["scene_id" if isinstance(data, dict) else "scene"]), (entry, shared)


def _made(entry_and_shared: tuple[Value, Value], scene: str) -> Iterator[Episode]:
    entry, shared = entry_and_shared
    if "objects_info" in entry.raw:
        yield from vlmaps_episodes(entry, scene)
    elif "object_category" in entry.raw:
        yield objectnav_episode(entry, shared, scene)
    elif "instruction" in entry.raw:
        yield r2r_episode(entry, scene)
    else:
        raise DataError(entry.source, f"the keys {sorted(entry.raw)[:8]}", _FORMATS)


def _scene_spec(file: Path, scene_id: str) -> str:
    """The catalogue spec of a scene that an episode file names by a file or by its name, found in the folders above."""
    names = [scene_id]
    if "/" not in scene_id and "." not in scene_id:
        short = _short_name(scene_id)
        names = [
            f"{kind}/{scene_id}/{short}{end}"
            for kind, end in (("mp3d", ".glb"), ("hm3d", ".basis.glb"), ("hm3d", ".glb"))
        ]
    for folder in file.resolve().parents:
        for found in (base / name for base in (folder, folder / "scene_datasets") for name in names):
            if _is_file(found):
                kind = next((k for k in (*_SCAN_FOLDERS, "gibson") if k in found.parts[len(folder.parts) :]), "file")
                return f"{kind}:{found.parent if kind in _SCAN_FOLDERS else found}"
    remedy = "Pass scene_spec, for example mp3d:<scan folder>."
    raise DataError(
        file, f"scene_id {scene_id!r}, which is no file under the folders above", "the scene's file", remedy
    )


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        # A name that no file can have.
        return False


def _with_unique_ids(episodes: list[Episode]) -> list[Episode]:
    """The same episodes; where files repeat ids, each gets its home's name in front."""
    if len({e.episode_id for e in episodes}) == len(episodes):
        return episodes
    renamed = [replace(e, episode_id=f"{_short_name(e.scene)}/{e.episode_id}") for e in episodes]
    if len({e.episode_id for e in renamed}) < len(renamed):
        renamed = [replace(e, episode_id=f"{e.episode_id}#{i}") for i, e in enumerate(renamed)]
    return renamed
