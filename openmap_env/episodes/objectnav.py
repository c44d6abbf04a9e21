"""Episodes of Habitat's ObjectNav: ``{"episodes": [...], "goals_by_category": {...}}``, gzipped, one file a scene in ``content/``.

``goals_by_category`` is keyed ``<scene file>_<category>``; each goal has a ``position`` (the centre of the thing) and the
``object_id`` that the scene's own files use. Older files list the goals in each episode.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from openmap_env.episodes.episode import Episode, place, target_of
from openmap_env.episodes.expressions import with_article
from openmap_env.episodes.fields import heading_of, name, point, remarks, text
from openmap_scenes import Scene
from openmap_scenes.formats.checked_json import Value

_SAME_OBJECT = 1.0
"""A goal and an instance of the same id are the same thing if their centres are this close, m."""


def objectnav_episode(entry: Value, goals_by_category: Value, scene: str) -> Episode:
    """One entry of ``episodes``, whose goals are places until ``with_boxes`` has seen the scene."""
    scene_id, category = text(entry["scene_id"]), text(entry["object_category"])
    key = f"{scene_id.rsplit('/', 1)[-1]}_{category}"
    shared = goals_by_category[key] if goals_by_category.exists else entry["goals"]
    goals = shared.items()
    if not goals:
        # The entry is what the reader of the message looks for, wherever its goals stand.
        entry.fail("at least one goal with a position", found=f"no goals under {key!r} in goals_by_category")
    noun = category.replace("_", " ")
    return Episode(
        episode_id=name(entry["episode_id"]),
        scene=scene,
        instruction=f"Find {with_article(noun, noun, unique=len(goals) == 1)}.",
        kind="object_goal",
        start_position=point(entry["start_position"]),
        start_heading=heading_of(entry["start_rotation"]),
        targets=tuple(place(point(goal["position"])) for goal in goals),
        info={
            **remarks(entry["info"]),
            "scene_id": scene_id,
            "category": category,
            "object_ids": [goal["object_id"].raw if isinstance(goal["object_id"].raw, int) else None for goal in goals],
        },
    )


def with_boxes(episode: Episode, scene: Scene) -> Episode:
    """The episode with the scene's instances, and their boxes, for goals.

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
