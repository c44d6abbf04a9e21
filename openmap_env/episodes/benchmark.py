"""OpenMapNav-Homes: the built-in homes' episodes, made once by seed and kept as data, so that everybody is asked the same.

``data/homes/<split>.jsonl.gz`` is an episode file whose first line tells for each home what it was made from: how many rooms, faces
and instances, and of every instance its id, category and centre, to 1 cm. By that a home is recognised; its bytes may differ
between machines in the last bit, and a home built without the furniture library is another home.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.episode import Episode, Point, Target
from openmap_env.episodes.fields import number, parse, read_bytes, text
from openmap_env.episodes.generator import generate_episodes
from openmap_env.episodes.jsonl import as_line, episode_of, write_lines
from openmap_env.goals import way_to
from openmap_env.navigation.surface import NavigableSurface
from openmap_scenes import DataError, Scene, load_scene
from openmap_scenes.formats.checked_json import Value

NAME = "OpenMapNav-Homes"
VERSION = 1
SIZES = {"train": 20, "val": 10, "test": 10}
"""Homes of each split, from 0 on."""
EPISODES = 30
"""Episodes a home, the three kinds in turn."""
SEED = 0
CENTIMETRE = 100.0
_SPEC = re.compile(r"homes:(train|val|test)/0*(\d+)", re.ASCII)
_REMEDY = "Make the file again with 'openmap episodes make'."

Thing = tuple[int, str, int, int, int]
"""An instance by which a home is recognised: id, category, and centre in cm, world frame."""


@dataclass(frozen=True)
class Makeup:
    """What a home was when its episodes were made.

    Parameters
    ----------
    rooms, faces : int
        For people.
    things : tuple of Thing
        Every instance, ascending by id.
    """

    rooms: int
    faces: int
    things: tuple[Thing, ...]

    @classmethod
    def of(cls, scene: Scene) -> Makeup:
        """What a scene is made of."""
        things = [(i.id, i.category, *(round(CENTIMETRE * float(c)) for c in i.centre)) for i in scene.instances]
        return cls(len(scene.rooms), len(scene.faces), tuple(things))  # type: ignore[arg-type]

    def difference(self, scene: Scene) -> str | None:
        """The first thing in which a scene is another home, in words, or None; centres may be off by 1 cm."""
        if len(scene.instances) != len(self.things):
            return f"{len(scene.instances)} instances instead of {len(self.things)}"
        for (instance_id, category, *centre), instance in zip(self.things, scene.instances, strict=True):
            if (instance_id, category) != (instance.id, instance.category):
                return f"instance {instance.id} is a {instance.category}, and was {instance_id}, a {category}"
            off = max(abs(CENTIMETRE * float(c) - cm) for c, cm in zip(instance.centre, centre, strict=True))
            if off > 1.0:
                return f"instance {instance_id}, a {category}, lies {off:.0f} cm from where it was"
        return None


@dataclass(frozen=True)
class FrozenHome:
    """A home's episodes, and what the home was when they were made; both are read only when they are asked for."""

    spec: str
    header: Value
    lines: tuple[bytes, ...]

    @property
    def makeup(self) -> Makeup:
        """What the home was; DataError where the file does not say it well."""
        return _makeup(self.header)

    def digest(self) -> str:
        """A hexadecimal fingerprint of the episodes."""
        return hashlib.sha256(b"\n".join(self.lines)).hexdigest()[:16]

    def episodes(self) -> list[Episode]:
        """The episodes, in the order of the file; DataError where a line is none."""
        places = [f"{self.header.source}, {self.spec}, episode {n}" for n in range(len(self.lines))]
        return [episode_of(parse(line, where), where) for line, where in zip(self.lines, places, strict=True)]


@dataclass(frozen=True)
class FrozenSplit:
    """A file of the benchmark: how it was made, and its homes by their spec."""

    split: str
    seed: int
    episodes_per_home: int
    homes: dict[str, FrozenHome]


def split_file(split: str) -> Path:
    """Where the episodes of a split are."""
    return Path(str(files("openmap_env.episodes").joinpath("data", "homes", f"{split}.jsonl.gz")))


def specs_of(split: str) -> list[str]:
    """The homes of a split of the benchmark."""
    return [f"homes:{split}/{n}" for n in range(SIZES[split])]


def frozen_home(spec: str) -> FrozenHome | None:
    """The frozen episodes of a home, or None where the benchmark has none for it; milliseconds, nothing is kept in memory."""
    match = _SPEC.fullmatch(spec)
    if match is None or f"homes:{match[1]}/{match[2]}" not in _frozen_specs(match[1]):
        return None
    return read_split(split_file(match[1])).homes[f"homes:{match[1]}/{match[2]}"]


@cache
def _frozen_specs(split: str) -> frozenset[str]:
    path = split_file(split)
    return frozenset(read_split(path).homes) if path.is_file() else frozenset()


def read_split(path: Path) -> FrozenSplit:
    """A file of the benchmark; episodes themselves are not looked at.

    Raises
    ------
    DataError
        It cannot be read, is no file of the benchmark, or is of another version.
    """
    first, *lines = read_bytes(path).rstrip(b"\n").split(b"\n")
    header = Value(parse(first, f"{path}:1"), f"{path}:1")
    if not isinstance(header.raw, dict) or header.raw.get("format") != NAME:
        raise DataError(path, "no episodes of the benchmark", f"a first line with the format {NAME!r}", _REMEDY)
    if header["version"].raw != VERSION:
        header["version"].fail(f"version {VERSION}", _REMEDY)
    homes: dict[str, FrozenHome] = {}
    at = 0
    for home in header["homes"].items():
        count, spec = home["episodes"].integer(), text(home["home"])
        if at + count > len(lines):
            raise DataError(path, f"{len(lines)} episodes", f"{at + count} or more, as the first line says", _REMEDY)
        homes[spec] = FrozenHome(spec, home, tuple(lines[at : at + count]))
        at += count
    if at != len(lines):
        raise DataError(path, f"{len(lines)} episodes", f"{at}, as the first line says", _REMEDY)
    return FrozenSplit(text(header["split"]), header["seed"].integer(), header["episodes_per_home"].integer(), homes)


def is_benchmark_file(path: Path) -> bool:
    """Whether a file is one of the benchmark's, as far as its first line tells."""
    if not path.name.endswith((".jsonl", ".jsonl.gz")) or not path.is_file():
        return False
    first = read_bytes(path).partition(b"\n")[0]
    return first.startswith(b"{") and f'"format":"{NAME}"'.encode() in first


def _makeup(home: Value) -> Makeup:
    things = []
    for thing in home["things"].items():
        if not isinstance(thing.raw, list) or len(thing.raw) != 5:
            thing.fail("an instance's id, category and centre in cm")
        instance_id, category, *centre = thing.items()
        x, y, z = (round(number(c, 1e8)) for c in centre)
        things.append((instance_id.integer(), text(category), x, y, z))
    return Makeup(home["rooms"].integer(), home["faces"].integer(), tuple(things))


def write_split(path: Path, split: str, seed: int, episodes_per_home: int, homes: Sequence[FrozenHome]) -> None:
    """Write a file of the benchmark, whole or not at all; the same homes give the same bytes."""
    header = {
        "format": NAME,
        "version": VERSION,
        "split": split,
        "seed": seed,
        "episodes_per_home": episodes_per_home,
        "homes": [{**h.header.raw, "home": h.spec, "episodes": len(h.lines)} for h in homes],
    }
    write_lines(path, [as_line(header), *(line.decode() for home in homes for line in home.lines)])


def freeze_home(spec: str, n: int = EPISODES, seed: int = SEED) -> FrozenHome:
    """Make a home's episodes as the benchmark has them: positions to 1 mm, every one of them still usable."""
    scene = load_scene(spec)
    surface = NavigableSurface.from_scene(scene)
    return freeze(scene, spec, surface, n, seed)


def freeze(scene: Scene, spec: str, surface: NavigableSurface, n: int, seed: int) -> FrozenHome:
    """As ``freeze_home``, of a scene and surface at hand."""
    episodes = generate_episodes(scene, spec, surface, n, np.random.default_rng(seed))
    lines = tuple(as_line(asdict(_rounded(e, scene, surface))).encode() for e in episodes)
    return FrozenHome(spec, Value(asdict(Makeup.of(scene)), spec), lines)


def _rounded(episode: Episode, scene: Scene, surface: NavigableSurface) -> Episode:
    """The episode with all lengths to 1 mm, its start on the surface and its distance measured from there."""
    start, island = _millimetres(episode.start_position), surface.island_of(episode.start_position)
    if surface.island_of(start) != island:
        # On the edge of a cell; half a cell away the same rounding stays inside.
        start = _millimetres(surface.centres[surface.locate(episode.start_position)])
    way = way_to(surface, scene, episode.targets, island)
    distance = math.inf if way is None else way.distance(np.array(start))
    targets = tuple(
        Target(t.instance_id, *(_millimetres(p) for p in (t.centre, t.aabb_min, t.aabb_max))) for t in episode.targets
    )
    info = {**_shorter(episode.info), "geodesic_distance": round(distance, 3)}
    return replace(
        episode, start_position=start, start_heading=round(episode.start_heading, 4), targets=targets, info=info
    )


def _millimetres(p: Point | npt.NDArray[np.float64]) -> Point:
    x, y, z = (round(float(c), 3) + 0.0 for c in p)
    return x, y, z


def _shorter(value: Any) -> Any:
    """JSON with all fractions to three places."""
    if isinstance(value, dict):
        return {key: _shorter(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_shorter(entry) for entry in value]
    return round(value, 3) if isinstance(value, float) else value
