"""Which episodes an environment has: those it was given, or made for each home when it is first entered."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from openmap_env.episodes.episode import KINDS, Episode, Kind
from openmap_env.episodes.generator import generate_episodes
from openmap_env.episodes.readers import load_episodes, same_scene, with_boxes
from openmap_env.navigation.surface import NavigableSurface
from openmap_scenes import Scene

DEFAULT_SCENE = "homes:val/0"


class EpisodeSource:
    """The scenes and episodes of an environment.

    Parameters
    ----------
    scenes : str, list of str or None
        Catalogue specs; None = those of the episodes, or ``homes:val/0``.
    episodes : None, str, Path or list of Episode
        None = generate for each scene; a path is read with ``load_episodes``.
    generated : int
        How many to generate a scene.
    seed : int
        Of what is generated: the same for every environment with the same settings.
    kinds : sequence of Kind
        What to generate.
    """

    def __init__(
        self,
        scenes: str | Sequence[str] | None = None,
        episodes: str | Path | Sequence[Episode] | None = None,
        generated: int = 24,
        seed: int = 0,
        kinds: Sequence[Kind] = KINDS,
    ) -> None:
        specs = [scenes] if isinstance(scenes, str) else list(scenes or ())
        self._given = _given(episodes, specs)
        if self._given is not None and not specs:
            specs = list(dict.fromkeys(e.scene for e in self._given))
        self.scenes = specs or [DEFAULT_SCENE]
        if generated < 1 or seed < 0:
            raise ValueError(f"asked to generate {generated} episodes with seed {seed}, expected at least 1 and 0")
        self._generated_count, self._seed, self._kinds = generated, seed, tuple(kinds)
        self._generated: dict[str, list[Episode]] = {}

    def draw_scene(self, rng: np.random.Generator) -> str:
        """A scene, as often as it has episodes among the given ones, else all alike."""
        if self._given is not None:
            return self._given[int(rng.integers(len(self._given)))].scene
        return self.scenes[int(rng.integers(len(self.scenes)))]

    def find(self, name: str | int) -> Episode | None:
        """A given or already generated episode by its id, or by its index among them; None where there is none."""
        known = self._given if self._given is not None else [e for s in self._generated.values() for e in s]
        if isinstance(name, str):
            return next((e for e in known if e.episode_id == name), None)
        return known[name] if 0 <= name < len(known) else None

    def given_for(self, spec: str) -> list[Episode]:
        """The given episodes of a scene."""
        return [e for e in self._given or () if e.scene == spec]

    def of(self, spec: str, scene: Scene, surface: NavigableSurface) -> list[Episode]:
        """The episodes of a scene, generated if none were given."""
        if self._given is not None:
            return self.given_for(spec)
        if spec not in self._generated:
            rng = np.random.default_rng(self._seed)
            self._generated[spec] = generate_episodes(scene, spec, surface, self._generated_count, rng, self._kinds)
        return self._generated[spec]

    def complete(self, episode: Episode, scene: Scene) -> Episode:
        """The episode with what only its scene knows: the boxes of goals that a file gives as positions."""
        return with_boxes(episode, scene)


def _given(episodes: str | Path | Sequence[Episode] | None, specs: Sequence[str]) -> list[Episode] | None:
    if episodes is None:
        return None
    if isinstance(episodes, str | Path):
        if len(specs) <= 1:
            return load_episodes(episodes, scene_spec=specs[0] if specs else None)
        return [e for spec in specs for e in load_episodes(episodes, scene_spec=spec)]
    given = list(episodes)
    if not given or not all(isinstance(e, Episode) for e in given):
        raise ValueError(f"episodes is a list of {len(given)} entries, expected at least one and only Episode objects")
    if specs and not all(any(same_scene(e.scene, spec) for spec in specs) for e in given):
        strangers = sorted({e.scene for e in given} - set(specs))
        raise ValueError(
            f"episodes are of the scenes {strangers[:3]}, expected only {specs}; leave scene out to use theirs"
        )
    return given
