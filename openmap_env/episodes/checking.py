"""Whether episodes fit the home they are asked in: nothing is believed of what a file says that the scene can tell."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from openmap_env.episodes.demands import needs
from openmap_env.episodes.episode import KINDS, Episode, same_box
from openmap_env.episodes.expressions import Expression, room_name
from openmap_env.episodes.readers import complete
from openmap_env.episodes.vocabulary import vocabulary
from openmap_env.goals import way_to
from openmap_env.measures import SUCCESS_RADIUS
from openmap_env.navigation.surface import NavigableSurface
from openmap_env.observations import check_instruction
from openmap_scenes import DataError, Scene

DISTANCE_TOLERANCE = 0.02
"""Noted and measured ways may differ by this, m."""
FEWEST = 25
"""A home of the benchmark has at least this many episodes."""


@dataclass(frozen=True)
class Problem:
    """What is wrong with an episode, in words; ``episode_id`` "" = with all of a home's together."""

    scene: str
    episode_id: str
    what: str


def check_episodes(
    episodes: Sequence[Episode], spec: str, scene: Scene, surface: NavigableSurface, benchmark: bool = False
) -> list[Problem]:
    """Everything that is wrong with a scene's episodes; ``benchmark``: also with their number and their kinds."""
    problems = []
    for episode in episodes:
        try:
            found = _episode(complete(episode, scene), scene, surface, benchmark)
        except DataError as error:
            found = [str(error)]
        problems += [Problem(spec, episode.episode_id, what) for what in found]
    said: dict[str, Episode] = {}
    for episode in episodes:
        other = said.setdefault(episode.instruction, episode)
        if _ids(other) != _ids(episode):
            what = f"says what {other.episode_id} says, with other targets: {episode.instruction!r}"
            problems.append(Problem(spec, episode.episode_id, what))
    if benchmark:
        problems += [Problem(spec, "", what) for what in _together(episodes)]
    return problems


def _together(episodes: Sequence[Episode]) -> list[str]:
    counts = Counter(episode.kind for episode in episodes)
    problems = [f"{counts[kind]} episodes of the kind {kind}" for kind in KINDS if counts[kind] < FEWEST // len(KINDS)]
    twice = [text for text, n in Counter(episode.instruction for episode in episodes).items() if n > 1]
    problems += [f"asks twice: {text!r}" for text in twice]
    return problems + ([f"{len(episodes)} episodes, fewer than {FEWEST}"] if len(episodes) < FEWEST else [])


def _episode(episode: Episode, scene: Scene, surface: NavigableSurface, benchmark: bool) -> list[str]:
    problems = [*_targets(episode, scene), *_meaning(episode, scene), *_start(episode, scene, surface, benchmark)]
    try:
        check_instruction(episode.instruction)
    except ValueError as error:
        problems.append(str(error))
    return problems


def _ids(episode: Episode) -> list[int]:
    return sorted(target.instance_id for target in episode.targets)


def _targets(episode: Episode, scene: Scene) -> list[str]:
    """Targets that are not the scene's instances; a target without an id is a place, and has to lie in the scene."""
    by_id = {instance.id: instance for instance in scene.instances}
    low, high = scene.aabb
    problems = [] if episode.targets else ["has no target"]
    for target in episode.targets:
        instance = by_id.get(target.instance_id)
        if target.instance_id == 0:
            if not np.all((low - 1.0 <= target.centre) & (np.array(target.centre) <= high + 1.0)):
                problems.append(f"a target at {target.centre}, outside of the scene")
        elif instance is None:
            problems.append(f"target {target.instance_id} is no instance of the scene")
        elif not same_box(target, instance):
            problems.append(f"target {instance.id}, a {instance.category}, has another box in the scene")
    if len(set(_ids(episode))) < sum(i > 0 for i in _ids(episode)):
        problems.append("has a target twice")
    return problems


def _meaning(episode: Episode, scene: Scene) -> list[str]:
    """What the noted expression or need means in the scene, if that is not the targets."""
    expression, need = episode.info.get("expression"), episode.info.get("need")
    if expression is not None:
        try:
            meant = {i.id for i in Expression.from_json(expression).matches(scene)}
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            return [f"expression {expression!r} cannot be understood ({error})"]
        return _differ("the expression means", meant, episode, scene)
    if need is not None:
        named = next((n for n in needs() if n.name == need), None)
        if named is None:
            return [f"need {need!r} is not in the table of needs"]
        words, room = vocabulary(), episode.info.get("room")
        things = [i for i in scene.instances if not words.is_structure(i.category) and named.serves(scene, i)]
        meant = {i.id for i in things if room is None or room_name(scene, i) == room}
        return _differ("the need is served by", meant, episode, scene)
    return []


def _differ(what: str, meant: set[int], episode: Episode, scene: Scene) -> list[str]:
    given = set(_ids(episode))
    names = {i.id: f"{i.category} {i.id}" for i in scene.instances}
    problems = [f"{what} {names[i]}, which is no target" for i in sorted(meant - given)]
    return problems + [f"{names.get(i, i)} is a target, but not what {what}" for i in sorted(given - meant)]


def _start(episode: Episode, scene: Scene, surface: NavigableSurface, exact: bool) -> list[str]:
    """What is wrong with where it starts; unless ``exact``, it may be moved to the nearest place to stand, as environments do."""
    start = np.array(episode.start_position) if exact else surface.snap(episode.start_position)
    island = -1 if start is None else surface.island_of(start)
    if start is None or island < 0:
        return [f"starts at {episode.start_position}, where nobody can stand"]
    way = way_to(surface, scene, episode.targets, island)
    distance = math.inf if way is None else way.distance(start)
    if not math.isfinite(distance):
        return ["has no target that can be reached from its start"]
    problems = []
    noted = episode.info.get("geodesic_distance")
    # Others measure to other places: only what is ours is noted as we measure it.
    ours = all(target.instance_id for target in episode.targets) and "scene_id" not in episode.info
    if (
        ours
        and noted is not None
        and not (isinstance(noted, int | float) and abs(distance - noted) <= DISTANCE_TOLERANCE)
    ):
        problems.append(f"notes {noted} m of way, {distance:.3f} m are measured")
    straight = min(float(np.linalg.norm(start - np.array(target.centre))) for target in episode.targets)
    if min(distance, straight) <= SUCCESS_RADIUS:
        problems.append(f"starts {min(distance, straight):.2f} m from a target: who stands still succeeds")
    return problems
