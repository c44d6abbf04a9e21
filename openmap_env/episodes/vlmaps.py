"""Tasks of VLMaps' object goal navigation: a JSON list in each scene's folder, ``<scene>_<n>/object_navigation_tasks.json``.

A task starts at ``tf_habitat``, a 4x4 body-to-world matrix, and asks in one ``instruction`` for several kinds of things one after
the other, ``objects_info[].name`` in their order. VLMaps stops once at each and counts a stop within 1 m of the box, on the floor
plan, of any thing of that kind on the storey. Which things those are, the files do not say: the scene does.

Here every subgoal is an episode by itself that starts where its task starts: an environment ends at STOP, and where an agent would
have stopped before is its own doing. ``info`` keeps the task's number, its whole instruction, and which subgoal of which this is,
so that VLMaps' rate of whole tasks can be formed from the records.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from openmap_env.episodes.episode import Episode, target_of
from openmap_env.episodes.expressions import with_article
from openmap_env.episodes.fields import name, pose_of, text
from openmap_scenes import DataError, Instance, Scene
from openmap_scenes.formats.checked_json import Value

STOREY = (-1.0, 2.0)
"""The centre of a thing on the same storey is this far above the start, m. VLMaps itself sets only the upper bound (its camera's
height and half a metre), so that what lies a storey below counts there; here it does not."""
MOST_SUBGOALS = 1000


def vlmaps_episodes(task: Value, scene: str) -> Iterator[Episode]:
    """An episode for each subgoal of a task; its targets are not known until ``with_things`` has seen the scene."""
    goals = [text(goal["name"]) for goal in task["objects_info"].items()]
    if not 1 <= len(goals) <= MOST_SUBGOALS:
        task["objects_info"].fail(f"1 to {MOST_SUBGOALS} subgoals", found=f"{len(goals)} subgoals")
    number, instruction = name(task["task_id"]), " ".join(text(task["instruction"]).split())
    position, heading = pose_of(task["tf_habitat"])
    for order, category in enumerate(goals):
        noun = category.replace("_", " ")
        yield Episode(
            episode_id=number if len(goals) == 1 else f"{number}-{order}",
            scene=scene,
            instruction=instruction if len(goals) == 1 else f"Go to {with_article(noun, noun, unique=False)}.",
            kind="object_goal",
            start_position=position,
            start_heading=heading,
            targets=(),
            info={
                "scene_id": text(task["scene"]),
                "task_id": number,
                "task_instruction": instruction,
                "subgoals": goals,
                "subgoal": order,
                "things_called": category,
            },
        )


def with_things(episode: Episode, scene: Scene) -> Episode:
    """The episode with every thing of its category that is on the storey of its start.

    Raises
    ------
    DataError
        The scene has no such thing there.
    """
    category = episode.info.get("things_called")
    if episode.targets or not isinstance(category, str):
        return episode
    found = tuple(target_of(i) for i in scene.instances if _is_called(i, category) and _on_storey(i, episode))
    if not found:
        called = sum(_is_called(i, category) for i in scene.instances)
        raise DataError(
            f"episode {episode.episode_id} of {scene.source or scene.name}",
            f"{called} things called {category!r} in the home and none on the storey of its start",
            "at least one",
            "Leave the episode out, or check that the scene is the one that the task was made for.",
        )
    return replace(episode, targets=found)


def _is_called(instance: Instance, category: str) -> bool:
    """By Matterport's forty names, as VLMaps asks, or by its own name."""
    word = category.lower().replace("_", " ")
    return word in (instance.category, (instance.mpcat40 or "").replace("_", " "))


def _on_storey(instance: Instance, episode: Episode) -> bool:
    low, high = STOREY
    return bool(low <= instance.centre[1] - episode.start_position[1] < high)
