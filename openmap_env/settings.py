"""The arguments of the environment, checked: one ValueError that names the argument, what was found and what is expected."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NoReturn, cast

import numpy as np

from openmap_env.episodes import KINDS, Episode, Kind
from openmap_env.episodes.episode import Target
from openmap_env.episodes.jsonl import episode_of
from openmap_env.measures import Measure, default_measures
from openmap_env.navigation import Body, NavigableSurface
from openmap_env.observations import SENSORS, Sensor, check_instruction
from openmap_env.rendering import AUTO, RENDERERS
from openmap_env.rendering.settings import checked
from openmap_env.simulator import Simulator
from openmap_scenes import PinholeCamera, Scene
from openmap_scenes.catalog import HOME_SPLITS, expand_specs

Start = tuple[tuple[float, float, float], float]
"""World-frame position (3,) m and heading, radians."""
Protocol = Literal["retrieval", "navigation"]
PROTOCOLS: tuple[Protocol, ...] = ("retrieval", "navigation")
HOMES_OF_A_SPLIT = 10
"""``homes:val`` without numbers is this many homes, from the first one on."""
LARGEST_PICTURE = 8192
HIGHEST_CAMERA = 3.0
"""Metres above the floor; higher up there are ceilings."""
LONGEST_STEP = 10.0
LARGEST_SEED = 2**63 - 1


def refuse(name: str, found: Any, expected: str) -> NoReturn:
    """Raise the ValueError of an argument that cannot be used."""
    text = repr(found)
    raise ValueError(f"{name} is {text if len(text) <= 160 else text[:157] + '...'}, expected {expected}")


@dataclass(frozen=True)
class Settings:
    """What an environment was made with; fields as the arguments of ``OpenMapNavEnv``.

    ``scenes`` are single specs; None = those of the episodes. ``renderer`` is a mapping with a ``name``.
    """

    scenes: tuple[str, ...] | None
    episodes: str | Path | list[Episode] | None
    sensors: tuple[Sensor, ...]
    camera: PinholeCamera
    camera_height: float
    body: Body
    forward_step: float
    turn_deg: float
    look_deg: float
    max_steps: int
    renderer: dict[str, Any]
    protocol: Protocol
    measures: tuple[Measure, ...]
    episodes_per_scene: int | None
    episode_seed: int | None
    kinds: tuple[Kind, ...]
    prefetch: bool

    @classmethod
    def check(
        cls, *, scene: Any, episodes: Any, sensors: Any, width: Any, height: Any, hfov_deg: Any, camera_height: Any,
        body: Any, forward_step: Any, turn_deg: Any, look_deg: Any, max_steps: Any, renderer: Any, protocol: Any,
        measures: Any, episodes_per_scene: Any, episode_seed: Any, kinds: Any, prefetch: Any,
    ) -> Settings:  # fmt: skip
        """The settings that the arguments of an environment make.

        Raises
        ------
        ValueError
            One of them cannot be used.
        """
        if not isinstance(protocol, str) or protocol not in PROTOCOLS:
            refuse("protocol", protocol, f"one of {', '.join(PROTOCOLS)}")
        if not isinstance(prefetch, bool | np.bool_):
            refuse("prefetch", prefetch, "True or False")
        return cls(
            scenes=None if scene is None else scene_specs(scene),
            episodes=_episodes(episodes),
            sensors=cast(tuple[Sensor, ...], _names("sensors", sensors, SENSORS)),
            camera=_camera(width, height, hfov_deg),
            camera_height=number("camera_height", camera_height, 0.0, HIGHEST_CAMERA, "m"),
            body=_body(body),
            forward_step=number("forward_step", forward_step, 0.0, LONGEST_STEP, "m"),
            turn_deg=number("turn_deg", turn_deg, 0.0, 180.0, "degrees"),
            look_deg=number("look_deg", look_deg, 0.0, 180.0, "degrees"),
            max_steps=integer("max_steps", max_steps, 1, LARGEST_SEED),
            renderer=_renderer(renderer),
            protocol=protocol,
            measures=_measures(measures),
            episodes_per_scene=None
            if episodes_per_scene is None
            else integer("episodes_per_scene", episodes_per_scene, 1, 100_000),
            episode_seed=None if episode_seed is None else integer("episode_seed", episode_seed, 0, LARGEST_SEED),
            kinds=cast(tuple[Kind, ...], _names("kinds", kinds, KINDS)),
            prefetch=bool(prefetch),
        )

    def simulator(self, scene: Scene, surface: NavigableSurface) -> Simulator:
        """A simulator of a scene, with the navigable surface of it for this body."""
        return Simulator(
            scene,
            self.camera,
            renderer=self.renderer,
            camera_height=self.camera_height,
            forward_step=self.forward_step,
            turn_deg=self.turn_deg,
            look_deg=self.look_deg,
            surface=surface,
        )


def scene_specs(scene: Any, name: str = "scene") -> tuple[str, ...]:
    """The single specs, each once, that a spec, a path, a split of homes, or a list of these stands for.

    Raises
    ------
    ValueError
        It is none of them.
    openmap_scenes.DataError
        One of them names nothing that there is.
    """
    expected = "a catalogue spec such as 'homes:val/0', a path, a split such as 'homes:val', or a list of these"
    if isinstance(scene, str | Path):
        scene = [scene]
    if not isinstance(scene, Sequence) or not all(isinstance(s, str | Path) and str(s) for s in scene):
        refuse(name, scene, expected)
    if not scene:
        refuse(name, scene, f"at least one scene: {expected}")
    return tuple(dict.fromkeys(single for spec in scene for single in expand_specs(_with_numbers(str(spec)))))


def _with_numbers(spec: str) -> str:
    split = re.fullmatch(r"homes:(\w+)/?", spec)
    return f"homes:{split[1]}/0-{HOMES_OF_A_SPLIT - 1}" if split and split[1] in HOME_SPLITS else spec


def _episodes(episodes: Any) -> str | Path | list[Episode] | None:
    if episodes is None or (isinstance(episodes, str | Path) and str(episodes)):
        return episodes
    expected = "None, the path of episodes, or a list of at least one Episode (or its fields as a dict)"
    if isinstance(episodes, str | Mapping) or not isinstance(episodes, Sequence) or not episodes:
        refuse("episodes", episodes, expected)
    return [
        episode_of(episode, name) if isinstance(episode, dict) else checked_episode(name, episode)
        for name, episode in ((f"episodes[{index}]", episode) for index, episode in enumerate(episodes))
    ]


def checked_episode(name: str, episode: Any) -> Episode:
    """An Episode that can be run, as far as can be told without its scene; ValueError where it is none."""
    if not isinstance(episode, Episode):
        refuse(name, episode, "an Episode, or its fields as a dict")
    for part in ("episode_id", "scene"):
        if not isinstance(getattr(episode, part), str) or not getattr(episode, part):
            refuse(f"{part} of {name}", getattr(episode, part), "a text")
    check_instruction(episode.instruction, f"instruction of {name}")
    if episode.kind not in KINDS:
        refuse(f"kind of {name}", episode.kind, f"one of {', '.join(KINDS)}")
    start_of((episode.start_position, episode.start_heading), f"start of {name}")
    if not isinstance(episode.targets, Sequence) or not all(isinstance(target, Target) for target in episode.targets):
        refuse(f"targets of {name}", episode.targets, "a tuple of Target")
    return episode


def start_of(value: Any, name: str) -> Start:
    """A world-frame position (3,) m and a heading in radians; ValueError where they are none."""
    try:
        position, heading = value
        x, y, z, angle = (float(v) for v in (*position, heading))
    except (TypeError, ValueError):
        refuse(name, value, "(position (3,) m, heading in radians), world frame")
    if not all(map(math.isfinite, (x, y, z, angle))):
        refuse(name, value, "finite numbers")
    return (x, y, z), angle


def _names(name: str, values: Any, allowed: Sequence[str]) -> tuple[str, ...]:
    expected = f"a list of one or more of {', '.join(allowed)}, each once"
    if isinstance(values, str | Mapping) or not isinstance(values, Sequence) or not values:
        refuse(name, values, expected)
    if not all(isinstance(v, str) and v in allowed for v in values) or len(set(values)) < len(values):
        refuse(name, values, expected)
    return tuple(values)


def _camera(width: Any, height: Any, hfov_deg: Any) -> PinholeCamera:
    return PinholeCamera.from_hfov(
        integer("width", width, 1, LARGEST_PICTURE),
        integer("height", height, 1, LARGEST_PICTURE),
        number("hfov_deg", hfov_deg, 0.0, 179.0, "degrees"),
    )


def integer(name: str, value: Any, low: int, high: int = LARGEST_SEED) -> int:
    """An integer with ``low`` <= value <= ``high``; ValueError where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not low <= value <= high:
        refuse(name, value, f"an integer from {low} to {high if high < LARGEST_SEED else '2**63 - 1'}")
    return int(value)


def number(name: str, value: Any, above: float, most: float, unit: str) -> float:
    """A finite number with ``above`` < value <= ``most``; ValueError where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        refuse(name, value, f"a number, {unit}".removesuffix(", "))
    if not (math.isfinite(value) and above < value <= most):
        refuse(name, value, f"more than {above:g} and at most {most:g} {unit}".rstrip())
    return float(value)


def _body(body: Any) -> Body:
    if body is None or isinstance(body, Body):
        return body or Body()
    names = [field.name for field in dataclasses.fields(Body)]
    if not isinstance(body, Mapping) or not set(body) <= set(names):
        refuse("body", body, f"None, a Body, or a dict with any of {', '.join(names)}, m")
    return Body(**{name: number(f"body's {name}", value, 0.0, LONGEST_STEP, "m") for name, value in body.items()})


def _renderer(renderer: Any) -> dict[str, Any]:
    chosen = {"name": renderer} if isinstance(renderer, str) else renderer
    names = (*RENDERERS, AUTO)
    expected = f"one of {', '.join(names)}, or a dict with one as 'name' and its settings"
    if not isinstance(chosen, Mapping) or not all(isinstance(name, str) for name in chosen):
        refuse("renderer", renderer, expected)
    name = chosen.get("name")
    if not isinstance(name, str) or name not in names:
        refuse("renderer", renderer, expected)
    module, kind = RENDERERS["opengl" if name == AUTO else name]
    settings = {key: value for key, value in chosen.items() if key != "name"}
    return {"name": name, **checked(getattr(import_module(f"openmap_env.rendering.{module}"), kind), name, settings)}


def _measures(measures: Any) -> tuple[Measure, ...]:
    expected = "a list of objects with a name, needs_targets and value(walk), as openmap_env.measures.Measure"
    if isinstance(measures, str | Mapping) or not isinstance(measures, Sequence):
        refuse("measures", measures, expected)
    taken = [measure.name for measure in default_measures()]
    for index, measure in enumerate(measures):
        name, needs = getattr(measure, "name", None), getattr(measure, "needs_targets", None)
        if isinstance(measure, type) or not isinstance(name, str) or not isinstance(needs, bool):
            refuse(f"measures[{index}]", measure, expected)
        if not callable(getattr(measure, "value", None)):
            refuse(f"measures[{index}]", measure, expected)
        if name in taken:
            refuse(f"measures[{index}]", measure, f"a name that is not taken; {name!r} is")
        taken.append(name)
    return tuple(measures)
