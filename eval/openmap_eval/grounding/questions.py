"""What is asked: the episodes of a scene, and questions of other scenes for things that this one does not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from openmap_env.episodes import Episode
from openmap_env.episodes.benchmark import frozen_home
from openmap_env.episodes.demands import needs
from openmap_env.episodes.source import evenly
from openmap_env.episodes.vocabulary import vocabulary
from openmap_eval.runner import EvalSettings, SceneTask, make_env
from openmap_scenes import Scene, load_scene


@dataclass(frozen=True)
class Asked:
    """A scene and what is asked in it; the episodes were made for the scene."""

    spec: str
    scene: Scene
    episodes: list[Episode]


def asked_in(spec: str, count: int, seed: int) -> Asked:
    """``count`` of the benchmark's episodes of a home, evenly over their kinds; generated ones for any other scene."""
    home = frozen_home(spec)
    scene = load_scene(spec)
    if home is not None and home.makeup.difference(scene) is None:
        return Asked(spec, scene, evenly(home.episodes(), count))
    env = make_env(SceneTask(spec, count), EvalSettings(seed=seed, renderer="raycast", width=64, height=48))
    try:
        env.reset(seed=seed)
        return Asked(spec, scene, list(env.unwrapped.episodes))  # type: ignore[attr-defined]
    finally:
        env.close()


def is_absent(episode: Episode, source: Scene, scene: Scene) -> bool:
    """Whether nothing in ``scene`` would answer a question asked in ``source``, not even in the eyes of some.

    A need: nothing serves it. A thing: no instance shares a kind with a target, so that an armchair is no absent chair.
    """
    need = next((n for n in needs() if n.name == episode.info.get("need")), None)
    if need is not None:
        return not any(need.serves(scene, i) or need.divides(scene, i) for i in scene.instances)
    words = vocabulary()
    names = {i.id: i.category for i in source.instances}
    if any(t.instance_id not in names for t in episode.targets):
        return False
    meant = {kind for t in episode.targets for kind in words.lineage(names[t.instance_id])}
    return meant.isdisjoint(kind for i in scene.instances for kind in words.lineage(i.category))


def absent_from(here: Asked, others: Sequence[Asked], count: int, seed: int) -> list[Episode]:
    """At most ``count`` questions of the others for what is not here, as many of each kind; which ones depends on the seed and on
    the scenes, not on their order."""
    found: dict[str, list[Episode]] = {}
    for other in sorted((o for o in others if o.spec != here.spec), key=lambda o: o.spec):
        for episode in other.episodes:
            if is_absent(episode, other.scene, here.scene):
                found.setdefault(episode.kind, []).append(episode)
    rng = np.random.default_rng([seed, *here.spec.encode()])
    drawn: list[Episode] = []
    for kind in sorted(found):
        order = rng.permutation(len(found[kind]))[: -(-count // max(len(found), 1))]
        drawn.extend(found[kind][k] for k in order)
    return drawn[:count]
