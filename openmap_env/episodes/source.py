"""Which episodes an environment has: those it was given, the benchmark's, or made for each home when it is first entered."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from openmap_env.episodes.benchmark import NAME, frozen_home
from openmap_env.episodes.episode import KINDS, Episode, Kind, Point
from openmap_env.episodes.generator import generate_episodes
from openmap_env.episodes.readers import complete, load_episodes, same_scene
from openmap_env.navigation.surface import NavigableSurface
from openmap_scenes import Scene
from openmap_scenes.catalog import furniture_folder

logger = logging.getLogger(__name__)

DEFAULT_SCENE = "homes:val/0"
GENERATED = 24
"""Episodes to generate a scene, unless told otherwise."""
BENCHMARK, GENERATE = "benchmark", "generate"

_warned: set[str] = set()


class EpisodeSource:
    """The scenes and episodes of an environment.

    Parameters
    ----------
    scenes : str, list of str or None
        Catalogue specs; None = those of the episodes, or ``homes:val/0``.
    episodes : None, "benchmark", "generate", str, Path or list of Episode
        "benchmark" = the frozen episodes of OpenMapNav-Homes for its homes, generated ones for every other scene, and for a home
        that was built otherwise than the benchmark's; "generate" = generated for every scene; None = "benchmark", or "generate"
        if ``generated`` or ``seed`` is given; any other text is a path, read with ``load_episodes``.
    generated : int or None
        How many to generate a scene; None = 24.
    seed : int or None
        Of what is generated: the same for every environment with the same settings; None = 0.
    kinds : sequence of Kind
        What to generate, and which of the benchmark's episodes to take.

    Raises
    ------
    DataError
        A file of episodes cannot be used.
    ValueError
        An argument cannot be used.
    """

    def __init__(
        self,
        scenes: str | Sequence[str] | None = None,
        episodes: str | Path | Sequence[Episode] | None = None,
        generated: int | None = None,
        seed: int | None = None,
        kinds: Sequence[Kind] = KINDS,
    ) -> None:
        specs = [scenes] if isinstance(scenes, str) else list(scenes or ())
        if episodes is None:
            episodes = BENCHMARK if generated is None and seed is None else GENERATE
        made = isinstance(episodes, str) and episodes in (BENCHMARK, GENERATE)
        self._frozen_first = made and episodes == BENCHMARK
        self._given = None if made else _given(episodes, specs)
        if self._given is not None and not specs:
            specs = list(dict.fromkeys(e.scene for e in self._given))
        self.scenes = specs or [DEFAULT_SCENE]
        self._generated_count = GENERATED if generated is None else generated
        self._seed = 0 if seed is None else seed
        if self._generated_count < 1 or self._seed < 0:
            raise ValueError(
                f"asked to generate {generated} episodes with seed {seed}, expected at least 1 and a seed of 0 or more"
            )
        unknown = [kind for kind in kinds if kind not in KINDS]
        if unknown or not kinds:
            raise ValueError(f"kinds are {list(kinds)}, expected at least one of {', '.join(KINDS)}")
        self._kinds = tuple(kinds)
        self._by_scene: dict[str, list[Episode]] = {}
        self._frozen: set[str] = set()

    def draw_scene(self, rng: np.random.Generator) -> str:
        """A scene, as often as it has episodes among the given ones, else all alike."""
        if self._given is not None:
            return self._given[int(rng.integers(len(self._given)))].scene
        return self.scenes[int(rng.integers(len(self.scenes)))]

    def given_for(self, spec: str) -> list[Episode]:
        """The given episodes of a scene."""
        return [e for e in self._given or () if e.scene == spec]

    def of(self, spec: str, scene: Scene, surface: NavigableSurface) -> list[Episode]:
        """The episodes of a scene: given, frozen, or generated."""
        if self._given is not None:
            return self.given_for(spec)
        if spec not in self._by_scene:
            frozen = self._from_benchmark(spec, scene) if self._frozen_first else []
            if frozen:
                self._frozen.add(spec)
            self._by_scene[spec] = frozen or self._made(spec, scene, surface)
        return self._by_scene[spec]

    def start_of(self, spec: str, scene: Scene, surface: NavigableSurface) -> tuple[Point, float] | None:
        """The start that all episodes of a scene share where a map is made once: that of the first given or frozen one.

        None where episodes are generated; then any place will do.
        """
        episodes = self.of(spec, scene, surface) if self._given is not None or self._frozen_first else []
        if not episodes or not (self._given is not None or spec in self._frozen):
            return None
        return episodes[0].start_position, episodes[0].start_heading

    def complete(self, episode: Episode, scene: Scene) -> Episode:
        """The episode with what only its scene knows, see ``readers.complete``."""
        return complete(episode, scene)

    def _made(self, spec: str, scene: Scene, surface: NavigableSurface) -> list[Episode]:
        rng = np.random.default_rng(self._seed)
        return generate_episodes(scene, spec, surface, self._generated_count, rng, self._kinds)

    def _from_benchmark(self, spec: str, scene: Scene) -> list[Episode]:
        """The frozen episodes of the chosen kinds, or none where the benchmark has no such home or another one."""
        home = frozen_home(spec)
        if home is None:
            return []
        difference = home.makeup.difference(scene)
        if difference is not None:
            _warn_of_another_home(spec, difference)
            return []
        episodes = [complete(e, scene) for e in home.episodes() if e.kind in self._kinds]
        return [replace(e, scene=spec) for e in episodes]


def _warn_of_another_home(spec: str, difference: str) -> None:
    """Say once what is missing: the library, or, for each home, what is other about it."""
    if any(furniture_folder().glob("*.sh3f")):
        why, what = spec, f"{spec} is another home here than in {NAME} ({difference})"
    else:
        why = "library"
        what = (
            f"homes are built without the furniture library and are others than those of {NAME}; "
            "install the Debian package sweethome3d-furniture"
        )
    if why not in _warned:
        _warned.add(why)
        logger.warning("%s: %s. Its episodes are generated, and scores on them are not the benchmark's", spec, what)


def evenly(episodes: Sequence[Episode], n: int) -> list[Episode]:
    """The first ``n`` episodes, taken from each kind in turn, in their own order."""
    by_kind = [[k for k, e in enumerate(episodes) if e.kind == kind] for kind in KINDS]
    turns = max(map(len, by_kind))
    taken = [places[turn] for turn in range(turns) for places in by_kind if turn < len(places)][:n]
    return [episodes[k] for k in sorted(taken)]


def _given(episodes: str | Path | Sequence[Episode] | None, specs: Sequence[str]) -> list[Episode]:
    if isinstance(episodes, str | Path):
        if len(specs) <= 1:
            return load_episodes(episodes, scene_spec=specs[0] if specs else None)
        return [e for spec in specs for e in load_episodes(episodes, scene_spec=spec)]
    given = list(episodes or ())
    if not given or not all(isinstance(e, Episode) for e in given):
        raise ValueError(f"episodes is a list of {len(given)} entries, expected at least one and only Episode objects")
    if not specs:
        return given
    spec_of = {e.scene: next((s for s in specs if same_scene(e.scene, s)), None) for e in given}
    strangers = sorted(scene for scene, spec in spec_of.items() if spec is None)
    if strangers:
        raise ValueError(
            f"episodes are of the scenes {strangers[:3]}, expected only {specs}; leave scene out to use theirs"
        )
    return [replace(e, scene=spec_of[e.scene] or e.scene) for e in given]
