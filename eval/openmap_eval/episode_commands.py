"""``openmap episodes list | make | check | show``: the benchmark's episodes and everybody's own: made, held against homes, read."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console
from rich.table import Table

from openmap_scenes import DataError, load_scene

if TYPE_CHECKING:
    from openmap_env.episodes.checking import Problem

Split = Literal["train", "val", "test"]
SHORT = {"object_goal": "object", "demand": "demand", "language_guided": "guided"}


@dataclass(frozen=True)
class ListEpisodes:
    """List the benchmark's frozen episodes: splits, homes, kinds, and the seed they were made with."""

    def run(self, console: Console) -> None:
        from openmap_env.episodes.benchmark import NAME, SIZES, VERSION, read_split, split_file

        table = Table(title=f"{NAME}, version {VERSION}", title_justify="left", pad_edge=False, padding=(0, 0))
        for name in ("split", "homes", "episodes", *SHORT.values(), "instructions", "seed", "KB"):
            table.add_column(name, justify="left" if name == "split" else "right", no_wrap=name == "split")
        for split, size in SIZES.items():
            path = split_file(split)
            if not path.is_file():
                table.add_row(split, f"0 of {size}", "0")
                continue
            frozen = read_split(path)
            episodes = [e for home in frozen.homes.values() for e in home.episodes()]
            counts: Counter[str] = Counter(e.kind for e in episodes)
            said = len({e.instruction for e in episodes})
            row = [f"{len(frozen.homes)} of {size}", len(episodes), *(counts[k] for k in SHORT), said, frozen.seed]
            table.add_row(split, *map(str, row), f"{path.stat().st_size / 1000:.0f}")
        console.print(table)
        console.print("openmap episodes show homes:val/0 prints those of a home", style="dim", highlight=False)


@dataclass(frozen=True)
class MakeEpisodes:
    """Make the benchmark's episodes and freeze them as data; a run that was stopped goes on where it was."""

    out: Path
    """Folder for train.jsonl.gz, val.jsonl.gz and test.jsonl.gz; homes that are there and not made again stay."""
    split: Split | Literal["all"] = "all"
    homes: tuple[int, ...] = ()
    """Which homes of the split, by number; by default all of the benchmark's."""
    n: int = 30
    """Episodes a home, the three kinds in turn."""
    seed: int = 0
    jobs: int = 2
    """Processes."""

    def run(self, console: Console) -> None:
        from openmap_env.episodes.benchmark import SIZES
        from openmap_eval.episode_work import print_problems

        if self.n < 1 or self.seed < 0 or self.jobs < 1 or any(home < 0 for home in self.homes):
            found = f"--n {self.n} --seed {self.seed} --jobs {self.jobs} --homes {self.homes}"
            raise DataError("the command line", found, "at least 1, 0, 1, and homes from 0 on")
        problems: list[Problem] = []
        for split in SIZES if self.split == "all" else [self.split]:
            problems += self._make(split, console)
        print_problems(console, problems)
        if problems:
            raise SystemExit(1)

    def _make(self, split: str, console: Console) -> list[Problem]:
        """Make the homes of a split that have not been made yet, then its file; what is wrong with them."""
        from openmap_env.episodes.benchmark import SIZES, read_split, write_split
        from openmap_env.episodes.checking import Problem
        from openmap_eval.episode_work import Parts, each, frozen_of, make_home

        path, parts = self.out / f"{split}.jsonl.gz", Parts(self.out / f".{split}.unfinished", self.n, self.seed)
        specs = [f"homes:{split}/{n}" for n in self.homes or range(SIZES[split])]
        found = {spec: parts.get(spec) for spec in specs}
        made = {spec: part for spec, part in found.items() if part is not None}
        todo = [(spec, self.n, self.seed) for spec in specs if spec not in made]
        for part in each(make_home, todo, self.jobs, f"{split} homes", console):
            made[part["spec"]] = part
            parts.put(part)
            took = " + ".join(f"{t:.1f}" for t in part["seconds"])
            said = f"{len(part['lines'])} episodes; {took} s to load, make and check"
            console.print(f"{part['spec']}: {said}", highlight=False)
        homes = {spec: frozen_of(part) for spec, part in made.items()}
        if path.is_file():
            old = read_split(path)
            if (old.seed, old.episodes_per_home) == (self.seed, self.n):
                homes = {**old.homes, **homes}
        ordered = sorted(homes.values(), key=lambda home: int(home.spec.rpartition("/")[2]))
        write_split(path, split, self.seed, self.n, ordered)
        parts.clear(specs)
        console.print(f"written: {path}, {len(ordered)} homes, {path.stat().st_size / 1000:.0f} KB", soft_wrap=True)
        return [Problem(**problem) for part in made.values() for problem in part["problems"]]


@dataclass(frozen=True)
class CheckEpisodes:
    """Hold episodes against their homes: targets, starts, ways, what the words mean; exit status 1 where something is wrong."""

    what: tyro.conf.Positional[str] = "benchmark"
    """"benchmark", or a file or folder of episodes."""
    split: Split | None = None
    """Only this split of the benchmark."""
    homes: tuple[int, ...] = ()
    """Only these homes of the benchmark's splits, by number."""
    scene: str | None = None
    """The scene of the file's episodes, where the file does not lie in a folder of scenes."""
    jobs: int = 2
    """Processes."""

    def run(self, console: Console) -> None:
        from openmap_eval.episode_work import check_scene, each, print_problems

        if self.jobs < 1:
            raise DataError("--jobs", str(self.jobs), "at least 1")
        tasks = self._tasks()
        place = {task[0]: number for number, task in enumerate(tasks)}
        results = sorted(each(check_scene, tasks, self.jobs, "scenes", console), key=lambda r: place[r[0]])
        table = Table(title="episodes held against their homes", title_justify="left", pad_edge=False, padding=(0, 0))
        for name in ("scene", "episodes", *SHORT.values(), "targets", "way, m", "wrong"):
            table.add_column(name, justify="left" if name == "scene" else "right", no_wrap=name == "scene")
        for spec, row, found in results:
            table.add_row(spec, *row, f"[red]{len(found)}[/]" if found else "0")
        console.print(table)
        problems = [problem for *_, found in results for problem in found]
        print_problems(console, problems)
        if problems:
            raise SystemExit(1)

    def _tasks(self) -> list[tuple[str, str, bool]]:
        """(scene, file, whether it is the benchmark's) of everything that is to be checked."""
        from openmap_env.episodes import load_episodes
        from openmap_env.episodes.benchmark import SIZES, is_benchmark_file, read_split, split_file

        if self.what == "benchmark":
            files = [split_file(s) for s in SIZES if self.split in (None, s) and split_file(s).is_file()]
        elif is_benchmark_file(Path(self.what)):
            files = [Path(self.what)]
        else:
            episodes = load_episodes(self.what, self.scene)
            return [(spec, self.what, False) for spec in dict.fromkeys(e.scene for e in episodes)]
        specs = [(spec, str(file), True) for file in files for spec in read_split(file).homes]
        tasks = [task for task in specs if not self.homes or int(task[0].rpartition("/")[2]) in self.homes]
        if not tasks:
            remedy = "'openmap episodes list' tells which there are."
            raise DataError(self.what, "no such home", "homes that have frozen episodes", remedy)
        return tasks


@dataclass(frozen=True)
class ShowEpisodes:
    """Print instructions with what they mean: kinds, targets and their rooms, and how far it is."""

    what: tyro.conf.Positional[str]
    """A scene of the catalogue (homes:val/0-2 are three), or a file or folder of episodes."""
    n: int | None = None
    """At most this many for each scene, evenly over the kinds."""
    generate: bool = False
    """Generate them also where there are frozen ones."""
    seed: int = 0
    """Of what is generated."""

    def run(self, console: Console) -> None:
        from openmap_env.episodes import load_episodes
        from openmap_env.episodes.source import GENERATED, EpisodeSource, evenly
        from openmap_env.navigation import NavigableSurface
        from openmap_eval.episode_work import print_episodes
        from openmap_scenes.catalog import expand_specs

        if self.n is not None and self.n < 1:
            raise DataError("--n", str(self.n), "at least 1")
        if _holds_episodes(Path(self.what)):
            episodes = load_episodes(self.what)
            by_scene = {s: [e for e in episodes if e.scene == s] for s in dict.fromkeys(e.scene for e in episodes)}
        else:
            by_scene = {spec: [] for spec in expand_specs(self.what)}
        for spec, found in by_scene.items():
            scene = load_scene(spec)
            if not found:
                how = "generate" if self.generate else "benchmark"
                source = EpisodeSource(spec, how, self.n or GENERATED, self.seed)
                found = source.of(spec, scene, NavigableSurface.from_scene(scene))
            print_episodes(console, evenly(found, self.n or len(found)), scene, SHORT)


def _holds_episodes(path: Path) -> bool:
    """Whether a path is that of an episode file or of a folder with such files, and not that of a scene."""
    endings = (".jsonl", ".jsonl.gz", ".json.gz", ".json")
    if path.is_dir():
        return any(p.name.endswith(endings[:3]) for p in (*path.glob("*"), *path.glob("content/*")))
    return path.is_file() and path.name.endswith(endings)


EpisodeCommand = (
    Annotated[ListEpisodes, tyro.conf.subcommand("list")]
    | Annotated[MakeEpisodes, tyro.conf.subcommand("make")]
    | Annotated[CheckEpisodes, tyro.conf.subcommand("check")]
    | Annotated[ShowEpisodes, tyro.conf.subcommand("show")]
)
