"""Our own episode files: one JSON object a line, with the fields of ``Episode``; gzipped if the name ends in .gz.

A first line that is an object with "format" says where the episodes come from, and is no episode.
"""

from __future__ import annotations

import gzip
import json
import os
import secrets
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from openmap_env.episodes.episode import KINDS, Episode, Kind, Target
from openmap_env.episodes.fields import number, parse, point, read_bytes, remarks, text
from openmap_scenes import DataError
from openmap_scenes.formats.checked_json import Value

_FIELDS = ("episode_id", "scene", "instruction", "kind", "start_position", "start_heading", "targets")
_REMEDY = "Write episode files with openmap_env.episodes.write_episodes."
LARGEST_HEADING = 1e3


def write_episodes(path: str | Path, episodes: Iterable[Episode]) -> None:
    """Write episodes to a JSON-lines file; it appears under its name only when it is whole."""
    write_lines(Path(path), [as_line(asdict(episode)) for episode in episodes])


def as_line(data: dict[str, Any]) -> str:
    """An object as one line of JSON; ValueError where it cannot be written as such."""
    return json.dumps(data, ensure_ascii=False, sort_keys=True, allow_nan=False, separators=(",", ":"))


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write lines of text, the same bytes for the same lines; the file appears under its name only when it is whole."""
    content = "".join(f"{line}\n" for line in lines).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        # No time stamp and no name goes into what is packed.
        temporary.write_bytes(gzip.compress(content, 9, mtime=0) if path.suffix == ".gz" else content)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def read_episodes(path: str | Path) -> list[Episode]:
    """Read what ``write_episodes`` wrote.

    Raises
    ------
    DataError
        The file is missing, or a line is no episode; the message names the line and the field.
    """
    path = Path(path)
    episodes: list[Episode] = []
    seen: dict[str, int] = {}
    for line, raw in enumerate(read_bytes(path).split(b"\n"), 1):
        where = f"{path}:{line}"
        if not raw.strip():
            continue
        data = parse(raw, where)
        if not episodes and isinstance(data, dict) and "format" in data:
            continue
        episode = episode_of(data, where)
        if episode.episode_id in seen:
            found = f"episode_id {episode.episode_id!r}, which line {seen[episode.episode_id]} has as well"
            raise DataError(where, found, "a different one for every episode")
        seen[episode.episode_id] = line
        episodes.append(episode)
    return episodes


def episode_of(data: Any, where: str) -> Episode:
    """An episode from its JSON object; ``where`` names the file and line in errors."""
    entry = Value(data, where)
    if not isinstance(data, dict) or not set(_FIELDS) <= set(data):
        missing = sorted(set(_FIELDS) - set(data)) if isinstance(data, dict) else _FIELDS
        found = f"an entry without {', '.join(missing)}"
        raise DataError(where, found, f"an object with {', '.join(_FIELDS)}", _REMEDY)
    if data["kind"] not in KINDS:
        entry["kind"].fail(f"one of {', '.join(KINDS)}")
    if not data["targets"]:
        entry["targets"].fail("a list of at least one target")
    return Episode(
        episode_id=text(entry["episode_id"]),
        scene=text(entry["scene"]),
        instruction=text(entry["instruction"]),
        kind=cast(Kind, data["kind"]),
        start_position=point(entry["start_position"]),
        start_heading=number(entry["start_heading"], LARGEST_HEADING),
        targets=tuple(_target(target) for target in entry["targets"].items()),
        info=remarks(entry["info"]),
    )


def _target(value: Value) -> Target:
    low, high = point(value["aabb_min"]), point(value["aabb_max"])
    if any(a > b for a, b in zip(low, high, strict=True)):
        value.fail("aabb_min at or below aabb_max", found=f"a box from {low} to {high}")
    return Target(value["instance_id"].integer(), point(value["centre"]), low, high)
