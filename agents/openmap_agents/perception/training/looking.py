"""Fills the shards: looks at every home of the split, a home after the other, in as many processes as are given."""

from __future__ import annotations

from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.progress import Progress

from openmap_agents.perception.backbone import Backbone
from openmap_agents.perception.training.frames import draw_camera, draw_sights
from openmap_agents.perception.training.shards import Lesson, look, save_shard
from openmap_scenes import load_scene


def shard_path(folder: Path, home: int) -> Path:
    """Where the lessons of a home are kept."""
    return folder / f"home-{home:04d}.npz"


def look_at_home(spec: str, home: int, views: int, with_patches: int, seed: int, path: Path) -> None:
    """The lessons of one home; the first ``with_patches`` of them are for the segmenter as well."""
    rng = np.random.default_rng([seed, home])
    scene, camera, backbone = load_scene(f"{spec}/{home}"), draw_camera(rng), Backbone()
    lessons: list[Lesson] = []
    for sight in draw_sights(scene, camera, views, rng):
        lesson = look(sight, camera, backbone, rng, len(lessons) < with_patches)
        if lesson is not None:
            lessons.append(lesson)
    names = {i.id: i.category for i in scene.instances if i.category}
    colours = {i.id: str(i.attributes["colour"]) for i in scene.instances if "colour" in i.attributes}
    save_shard(path, lessons, names, colours)


def look_at_homes(
    spec: str, homes: int, views: int, with_patches: int, seed: int, folder: Path, processes: int, progress: Progress
) -> list[Path]:
    """The shards of homes 0..homes-1 of a split; those that are there are left as they are."""
    paths = [shard_path(folder, home) for home in range(homes)]
    task = progress.add_task("looking at homes", total=homes, completed=sum(p.exists() for p in paths))
    missing = [home for home, path in enumerate(paths) if not path.exists()]
    jobs = [(spec, home, views, with_patches, seed, paths[home]) for home in missing]
    # Spawned, since a process that has drawn cannot be forked; a few homes each, so that what a renderer holds is given back.
    with get_context("spawn").Pool(processes, maxtasksperchild=12) as pool:
        for _ in pool.imap_unordered(_look, jobs):
            progress.advance(task)
    return paths


def _look(job: tuple[str, int, int, int, int, Path]) -> None:
    look_at_home(*job)
