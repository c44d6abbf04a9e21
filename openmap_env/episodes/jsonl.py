"""Our own episode files: one JSON object a line, with the fields of ``Episode``."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast, get_args

from openmap_env.episodes.episode import Episode, Kind, Target
from openmap_scenes import DataError

_FIELDS = ("episode_id", "scene", "instruction", "kind", "start_position", "start_heading", "targets")
_REMEDY = "Write episode files with openmap_env.episodes.write_episodes."


def write_episodes(path: str | Path, episodes: Iterable[Episode]) -> None:
    """Write episodes to a JSON-lines file; it appears under its name only when it is whole."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.dumps(asdict(e), ensure_ascii=False, sort_keys=True, allow_nan=False) for e in episodes]
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_text("".join(f"{line}\n" for line in lines), "utf-8")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def read_episodes(path: str | Path) -> list[Episode]:
    """Read what ``write_episodes`` wrote.

    Raises
    ------
    DataError
        The file is missing, or a line is no episode; the message names the line.
    """
    path = Path(path)
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(path, str(error), "a UTF-8 file with an episode a line", _REMEDY) from error
    episodes = []
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{path}:{number}"
        if not line.strip():
            continue
        try:
            data = json.loads(line)
        except json.JSONDecodeError as error:
            raise DataError(where, f"no JSON ({error})", "one JSON object a line", _REMEDY) from error
        episodes.append(_episode(where, data))
    if len({e.episode_id for e in episodes}) < len(episodes):
        raise DataError(path, "an episode_id twice", "a different one for every episode")
    return episodes


def _episode(where: str, data: Any) -> Episode:
    if not isinstance(data, dict) or not set(_FIELDS) <= set(data):
        missing = sorted(set(_FIELDS) - set(data)) if isinstance(data, dict) else list(_FIELDS)
        raise DataError(
            where, f"an entry without {', '.join(missing)}", f"an object with {', '.join(_FIELDS)}", _REMEDY
        )
    for name in ("episode_id", "scene", "instruction"):
        if not isinstance(data[name], str) or not data[name].strip():
            raise DataError(where, f"{name} {data[name]!r}", "a text that is not empty")
    if data["kind"] not in get_args(Kind):
        raise DataError(where, f"kind {data['kind']!r}", f"one of {', '.join(get_args(Kind))}")
    if not isinstance(data["targets"], list) or not data["targets"]:
        raise DataError(where, f"targets {data['targets']!r}", "a list of at least one target")
    info = data.get("info", {})
    if not isinstance(info, dict):
        raise DataError(where, f"info {info!r}", "an object")
    return Episode(
        episode_id=data["episode_id"],
        scene=data["scene"],
        instruction=data["instruction"],
        kind=cast(Kind, data["kind"]),
        start_position=point(where, "start_position", data["start_position"]),
        start_heading=number(where, "start_heading", data["start_heading"]),
        targets=tuple(_target(where, target) for target in data["targets"]),
        info=info,
    )


def _target(where: str, data: Any) -> Target:
    names = ("instance_id", "centre", "aabb_min", "aabb_max")
    if not isinstance(data, dict) or not set(names) <= set(data):
        raise DataError(where, f"a target {data!r}", f"an object with {', '.join(names)}", _REMEDY)
    if not isinstance(data["instance_id"], int) or data["instance_id"] < 0:
        raise DataError(where, f"a target with instance_id {data['instance_id']!r}", "an integer of at least 0")
    centre, low, high = (point(where, f"target's {n}", data[n]) for n in names[1:])
    return Target(data["instance_id"], centre, low, high)


def point(where: str, name: str, value: Any) -> tuple[float, float, float]:
    """Three finite numbers, or a DataError that names them."""
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 3:
        raise DataError(where, f"{name} {value!r}", "three finite numbers in metres")
    x, y, z = (number(where, name, v) for v in value)
    return x, y, z


def number(where: str, name: str, value: Any) -> float:
    """A finite number, or a DataError that names it."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise DataError(where, f"{name} {value!r}", "a finite number")
    return float(value)
