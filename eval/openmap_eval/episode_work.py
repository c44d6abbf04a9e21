"""What the commands on episodes do in processes of their own, and what they print."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from openmap_env.episodes import KINDS, Episode, load_episodes
from openmap_env.episodes.benchmark import FrozenHome, freeze, read_split
from openmap_env.episodes.checking import Problem, check_episodes
from openmap_env.episodes.readers import complete
from openmap_env.navigation import NavigableSurface
from openmap_eval.records import write_json
from openmap_scenes import Scene, load_scene
from openmap_scenes.formats.checked_json import Value

T = TypeVar("T")
R = TypeVar("R")


def each(work: Callable[[T], R], tasks: Sequence[T], jobs: int, what: str, console: Console) -> Iterator[R]:
    """The results of ``work`` on all tasks, as they come, from ``jobs`` processes; with a bar."""
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task(what, total=len(tasks))
        if jobs == 1 or len(tasks) == 1:
            for task in tasks:
                yield work(task)
                progress.advance(bar)
            return
        # Children that are forked from a process with threads may hang.
        with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
            futures = [pool.submit(work, task) for task in tasks]
            try:
                for future in as_completed(futures):
                    yield future.result()
                    progress.advance(bar)
            finally:
                pool.shutdown(cancel_futures=True)


def make_home(task: tuple[str, int, int]) -> dict[str, Any]:
    """The episodes of (spec, how many, seed), frozen, as plain JSON, with what is wrong with them and how long it took."""
    spec, n, seed = task
    started = time.perf_counter()
    scene = load_scene(spec)
    loaded = time.perf_counter()
    surface = NavigableSurface.from_scene(scene)
    home = freeze(scene, spec, surface, n, seed)
    made = time.perf_counter()
    problems = check_episodes(home.episodes(), spec, scene, surface, benchmark=n >= 25)
    return {
        "spec": spec,
        "header": home.header.raw,
        "lines": [line.decode() for line in home.lines],
        "problems": [asdict(p) for p in problems],
        "seconds": [round(t, 1) for t in (loaded - started, made - loaded, time.perf_counter() - made)],
    }


class Parts:
    """The homes of a split that are made already, one file each, until its file is written."""

    def __init__(self, folder: Path, n: int, seed: int) -> None:
        self.folder, self._key = folder, _key(n, seed)

    def _file(self, spec: str) -> Path:
        return self.folder / f"{int(spec.rpartition('/')[2]):03d}.json"

    def get(self, spec: str) -> dict[str, Any] | None:
        """A home that was made by the code, words and settings at hand, or None."""
        try:
            part: dict[str, Any] = json.loads(self._file(spec).read_bytes())
            return part if part["key"] == self._key and part["spec"] == spec else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def put(self, part: dict[str, Any]) -> None:
        """Keep a home."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_json(self._file(part["spec"]), {**part, "key": self._key})

    def clear(self, specs: Sequence[str]) -> None:
        """Forget homes; the folder goes with the last."""
        for spec in specs:
            self._file(spec).unlink(missing_ok=True)
        if self.folder.is_dir() and not any(self.folder.iterdir()):
            self.folder.rmdir()


def _key(n: int, seed: int) -> str:
    """Of all that decides what a home's episodes are, but for the home: settings, code, words."""
    hasher = hashlib.sha256(f"{n} {seed}".encode())
    package = Path(str(files("openmap_env")))
    code = [*package.glob("*.py"), *package.glob("episodes/*.py"), *package.glob("navigation/*.py")]
    for path in sorted([*code, *package.glob("episodes/data/*.json")]):
        hasher.update(path.name.encode() + path.read_bytes())
    return hasher.hexdigest()[:16]


def frozen_of(part: dict[str, Any]) -> FrozenHome:
    """A home that ``make_home`` made."""
    spec = part["spec"]
    return FrozenHome(spec, Value(part["header"], spec), tuple(line.encode() for line in part["lines"]))


def check_scene(task: tuple[str, str, bool]) -> tuple[str, list[str], list[Problem]]:
    """A row for the table, and what is wrong, for (scene, episode file, whether it is the benchmark's)."""
    spec, file, benchmark = task
    scene = load_scene(spec)
    surface = NavigableSurface.from_scene(scene)
    problems = []
    if benchmark:
        home = read_split(Path(file)).homes[spec]
        episodes, difference = home.episodes(), home.makeup.difference(scene)
        if difference is not None:
            problems.append(Problem(spec, "", f"is another home here: {difference}"))
    else:
        episodes = load_episodes(file, spec)
    problems += check_episodes(episodes, spec, scene, surface, benchmark)
    counts = Counter(e.kind for e in episodes)
    targets = [len(e.targets) for e in episodes]
    ways = [e.info["geodesic_distance"] for e in episodes if isinstance(e.info.get("geodesic_distance"), int | float)]
    row = [str(len(episodes)), *(str(counts[kind]) for kind in KINDS)]
    row += [f"{np.mean(targets):.1f}", f"{min(ways):.1f} to {max(ways):.1f}" if ways else "?"]
    return spec, row, problems


def print_problems(console: Console, problems: Sequence[Problem]) -> None:
    """One line for each thing that is wrong."""
    for problem in problems:
        where = f"{problem.scene} {problem.episode_id}".strip()
        console.print(f"[red]wrong[/] {escape(where)}: {escape(problem.what)}", soft_wrap=True, highlight=False)


def print_episodes(console: Console, episodes: Sequence[Episode], scene: Scene, names: dict[str, str]) -> None:
    """A table of a scene's instructions, kind by kind."""
    table = Table(title=episodes[0].scene if episodes else scene.name, title_justify="left", pad_edge=False)
    table.add_column("kind")
    table.add_column("instruction", overflow="fold", ratio=3)
    table.add_column("targets", overflow="fold", ratio=2)
    table.add_column("way", justify="right")
    rooms = {room.id: room.name for room in scene.rooms}
    by_id = {i.id: i for i in scene.instances}
    for kind in KINDS:
        for episode in (complete(e, scene) for e in episodes if e.kind == kind):
            things: Counter[str] = Counter()
            for target in episode.targets:
                thing = by_id.get(target.instance_id)
                room = None if thing is None or thing.room is None else rooms.get(thing.room)
                name = "a place" if thing is None else thing.category
                things[f"{name} ({room})" if room else name] += 1
            said = ", ".join(f"{n} × {thing}" if n > 1 else thing for thing, n in things.items())
            way = episode.info.get("geodesic_distance")
            shown = f"{way:.1f} m" if isinstance(way, int | float) else "?"
            table.add_row(names[kind], escape(episode.instruction), escape(said), shown)
    console.print(table)
