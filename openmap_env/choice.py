"""Which episode a reset runs: what its options name, and for all they leave open what the random generator draws."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from openmap_env.episodes import Episode
from openmap_env.episodes.readers import same_scene
from openmap_env.episodes.source import EpisodeSource
from openmap_env.navigation import NavigableSurface
from openmap_env.observations import check_instruction
from openmap_env.prefetch import Home, Homes
from openmap_env.rendering import prepare
from openmap_env.settings import Settings, Start, checked_episode, refuse, scene_specs, start_of
from openmap_scenes import load_scene

OPTIONS = ("scene", "episode", "instruction", "start")


@dataclass(frozen=True)
class Wishes:
    """The options of a reset, checked; None = left open."""

    scene: str | None = None
    episode: Episode | str | int | None = None
    instruction: str | None = None
    start: Start | None = None

    @classmethod
    def of(cls, options: Any) -> Wishes:
        """Check the options; ValueError where one is unknown or ill-typed."""
        if options is None:
            return cls()
        if not isinstance(options, Mapping):
            refuse("options", options, f"None or a dict with any of {', '.join(OPTIONS)}")
        unknown = sorted(map(repr, set(options) - set(OPTIONS)))
        if unknown:
            raise ValueError(f"options has the unknown {', '.join(unknown)}, expected any of {', '.join(OPTIONS)}")
        scene, episode, instruction, start = (options.get(name) for name in OPTIONS)
        if scene is not None:
            scene = _one_scene(scene)
        if isinstance(episode, Episode):
            checked_episode("option episode", episode)
        elif isinstance(episode, bool) or not isinstance(episode, str | int | np.integer | None):
            refuse("option episode", episode, "an Episode, the id of one, or an index")
        if instruction is not None:
            check_instruction(instruction)
        return cls(
            scene,
            int(episode) if isinstance(episode, np.integer) else episode,
            instruction,
            None if start is None else start_of(start, "option start"),
        )


class EpisodeChoice:
    """Chooses the episodes of an environment.

    Parameters
    ----------
    settings : Settings
        With the protocol ``retrieval`` all episodes of a scene begin where its first one does, if they were given or frozen, and
        otherwise at a place that ``episode_seed`` draws.
    """

    def __init__(self, settings: Settings) -> None:
        s = self._settings = settings
        self._source = EpisodeSource(s.scenes, s.episodes, s.episodes_per_scene, s.episode_seed, s.kinds)
        self._homes = Homes(self._load, self._warm)

    def choose(self, wishes: Wishes, rng: np.random.Generator) -> tuple[Episode, Home]:
        """An episode as it is to be run and its home, which is at hand from now on.

        The scene is drawn first, then the episode, or the start of a free question; nothing is drawn that was named.

        Raises
        ------
        ValueError
            What was named does not exist.
        """
        if wishes.episode is not None:
            episode = self._named(wishes.episode, wishes.scene)
            home = self._homes.enter(episode.scene)
        else:
            home = self._homes.enter(wishes.scene or self._source.draw_scene(rng))
            episode = self._draw(home, rng) if wishes.instruction is None else _free(home, wishes.instruction, rng)
        episode = self._source.complete(episode, home.scene)
        check_instruction(episode.instruction)
        position, heading = wishes.start or self._start_of(episode, home)
        instruction = wishes.instruction or episode.instruction
        return replace(episode, instruction=instruction, start_position=position, start_heading=heading), home

    def look_ahead(self, rng: np.random.Generator) -> None:
        """Begin to load the home that the next reset without options will draw; the generator stays as it is."""
        if self._settings.prefetch and len(self._source.scenes) > 1:
            self._homes.look_ahead(self._source.draw_scene(copy.deepcopy(rng)))

    def of(self, home: Home) -> list[Episode]:
        """All episodes of a home."""
        return list(self._source.of(home.spec, home.scene, home.surface))

    def close(self) -> None:
        """Let go of all homes, and wait for the thread that looks ahead."""
        self._homes.close()

    def _load(self, spec: str) -> Home:
        scene = load_scene(spec)
        return Home(spec, scene, NavigableSurface.from_scene(scene, self._settings.body))

    def _warm(self, home: Home) -> None:
        """What a reset in a home would have to wait for, done in the background; what goes wrong here goes wrong again there."""
        with suppress(ValueError):
            prepare(scene=home.scene, camera=self._settings.camera, **self._settings.renderer)
        with suppress(ValueError):
            self.of(home)

    def _named(self, named: Episode | str | int, scene: str | None) -> Episode:
        if isinstance(named, Episode):
            if scene is not None and not same_scene(named.scene, scene):
                refuse("option scene", scene, f"that of the episode, {named.scene!r}; its targets are nowhere else")
            return named if scene is None else replace(named, scene=scene)
        passed = 0
        for spec in [scene] if scene else self._source.scenes:
            # Generated episodes exist once their home does.
            episodes = self._source.given_for(spec) or self.of(self._homes.get(spec))
            if isinstance(named, str):
                found = next((e for e in episodes if e.episode_id == named), None)
            else:
                found = episodes[named - passed] if 0 <= named - passed < len(episodes) else None
            if found is not None:
                return found
            passed += len(episodes)
        where = scene or ", ".join(self._source.scenes[:5])
        raise ValueError(f"option episode is {named!r}, expected one of the {passed} episodes of {where}")

    def _draw(self, home: Home, rng: np.random.Generator) -> Episode:
        episodes = self.of(home)
        if not episodes:
            raise ValueError(f"option scene is {home.spec!r}, expected a scene of which there are episodes")
        return episodes[int(rng.integers(len(episodes)))]

    def _start_of(self, episode: Episode, home: Home) -> Start:
        if self._settings.protocol == "navigation":
            return episode.start_position, episode.start_heading
        shared = self._source.start_of(home.spec, home.scene, home.surface)
        return shared or _somewhere(home.surface, np.random.default_rng(self._settings.episode_seed or 0))


def _free(home: Home, instruction: str, rng: np.random.Generator) -> Episode:
    position, heading = _somewhere(home.surface, rng)
    return Episode("free", home.spec, instruction, "object_goal", position, heading, ())


def _somewhere(surface: NavigableSurface, rng: np.random.Generator) -> Start:
    x, y, z = surface.random_point(rng).tolist()
    return (x, y, z), float(rng.uniform(-math.pi, math.pi))


def _one_scene(scene: Any) -> str:
    if not isinstance(scene, str) or not scene:
        refuse("option scene", scene, "a catalogue spec such as 'homes:val/0'")
    specs = scene_specs(scene, "option scene")
    if len(specs) > 1:
        refuse("option scene", scene, f"one scene; these are {len(specs)}")
    return specs[0]
