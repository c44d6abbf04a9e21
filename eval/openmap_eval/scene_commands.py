"""``openmap scenes list | build | show | check``: what scenes there are, what they look like, what is wrong with them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import Progress, TaskID, track
from rich.table import Table

from openmap_scenes import DataError, Scene, load_scene


@dataclass(frozen=True)
class ListScenes:
    """List the scenes below a folder of datasets, and the built-in homes."""

    root: tyro.conf.Positional[Path | None] = None
    """A folder that holds datasets, in any of the layouts that can be read."""

    def run(self, console: Console) -> None:
        from openmap_scenes.catalog import list_scenes

        if self.root is None:
            console.print("homes:train/<n>, homes:val/<n>, homes:test/<n>: built-in homes, any n from 0 on")
            console.print("openmap scenes list FOLDER lists what is below a folder of datasets", style="dim")
            return
        specs = list_scenes(self.root)
        for spec in specs:
            console.print(spec, soft_wrap=True, highlight=False)
        if not specs:
            raise DataError(
                self.root,
                "no scene",
                "scans of Matterport3D, HM3D, Gibson, Replica or ScanNet, or plain meshes",
                "scenes/README.md shows each layout.",
            )


@dataclass(frozen=True)
class PrepareScenes:
    """Keep on disk all that an environment needs of scenes: the scene, its floor, its draw order, and what shows from where.

    Environments make the first three by themselves when they first need them; the last makes pictures from places that no one has
    been to cheaper. Pictures are the same with and without it.
    """

    scenes: tyro.conf.Positional[tuple[str, ...]]
    """Specs; homes:val/0-9 means ten of them."""
    camera_height: float = 1.25
    """As the environments will have it, m."""

    def run(self, console: Console) -> None:
        from openmap_env.rendering import LooksAhead
        from openmap_env.simulator import Simulator, eye_places
        from openmap_scenes import PinholeCamera

        with Progress(console=console, transient=True) as progress:
            for spec in _expanded(self.scenes):
                told = partial(_tell, progress, progress.add_task(spec, total=None))
                camera = PinholeCamera.from_hfov(64, 64, 90.0)
                simulator = Simulator(load_scene(spec), camera, camera_height=self.camera_height)
                try:
                    if isinstance(simulator.renderer, LooksAhead):
                        simulator.renderer.learn(eye_places(simulator.surface, self.camera_height), told)
                finally:
                    simulator.close()
                console.print(f"{spec}: ready, {simulator.surface.island_areas[0]:.0f} m2 to walk on", highlight=False)


def _tell(progress: Progress, bar: TaskID, done: int, all_of_them: int) -> None:
    progress.update(bar, completed=done, total=all_of_them)


@dataclass(frozen=True)
class BuildScenes:
    """Write scenes as plain GLB files with their instances and credits beside them; those that are there already are kept."""

    scenes: tyro.conf.Positional[tuple[str, ...]]
    """Specs; homes:val/0-9 means ten of them."""
    out: Path = Path("scenes_out")
    """Folder to write to."""
    again: bool = False
    """Write also those that are there already."""

    def run(self, console: Console) -> None:
        from openmap_scenes.formats.export import export_scene

        for spec in track(_expanded(self.scenes), "building", console=console, transient=True):
            path = self.out / f"{spec.replace(':', '-').replace('/', '-').strip('-.')}.glb"
            if path.is_file() and not self.again:
                console.print(f"there already: {path}", soft_wrap=True, style="dim")
                continue
            started = time.perf_counter()
            scene = load_scene(spec)
            _make_folder(self.out)
            written = export_scene(scene, path)
            things = (
                f"{len(scene.instances)} instances, {len(scene.faces)} faces, {time.perf_counter() - started:.1f} s"
            )
            console.print(f"{spec}: {things} -> {', '.join(map(str, written))}", soft_wrap=True)


@dataclass(frozen=True)
class ShowScene:
    """Show what a scene holds: rooms, things, and a contact sheet (plan with names, six views)."""

    scene: tyro.conf.Positional[str]
    """A scene of the catalogue."""
    out: Path | None = None
    """The PNG to write; by default <name>.png in this folder."""
    seed: int = 0
    """Chooses the places of the views."""

    def run(self, console: Console) -> None:
        from openmap_eval.contact_sheet import contact_sheet
        from openmap_eval.pictures import write_png

        out = self.out
        if out is not None and out.suffix.lower() != ".png":
            raise DataError(f"--out {out}", f"suffix {out.suffix!r}", "a .png")
        scene = load_scene(self.scene)
        if out is not None:
            _make_folder(out.parent)
        console.print(contents(scene))
        low, high = scene.aabb
        size = " × ".join(f"{x:.1f}" for x in high - low)
        console.print(f"{len(scene.instances)} instances; {size} m (x, y, z)")
        out = out or Path(f"{scene.name}.png")
        write_png(out, contact_sheet(scene, self.seed))
        console.print(f"written: {out}", soft_wrap=True)


@dataclass(frozen=True)
class CheckScenes:
    """Tell what is wrong with scenes or recordings and how to mend it; exit status 1 where something cannot be used."""

    scenes: tyro.conf.Positional[tuple[str, ...]]
    """Specs (homes:val/0-9 means ten of them), or paths of scans, meshes and recordings."""
    thorough: bool = False
    """Also look for solids that run into each other and things that cannot be seen."""

    def run(self, console: Console) -> None:
        from openmap_eval.scene_check import check

        style = {"error": "bold red", "warning": "yellow", "note": "dim"}
        unusable = 0
        for target in _expanded(self.scenes, keep_paths=True):
            findings = check(target, self.thorough)
            unusable += any(f.severity == "error" for f in findings)
            if not any(f.severity != "note" for f in findings):
                console.print(f"{target}: [green]nothing wrong[/]", soft_wrap=True, highlight=False)
            else:
                console.print(f"{target}:", soft_wrap=True, highlight=False)
            for f in findings:
                console.print(f"  [{style[f.severity]}]{f.severity}[/] ", end="")
                console.print(str(f), soft_wrap=True, highlight=False, markup=False)
        if unusable:
            raise SystemExit(1)


SceneCommand = (
    Annotated[ListScenes, tyro.conf.subcommand("list")]
    | Annotated[PrepareScenes, tyro.conf.subcommand("prepare")]
    | Annotated[BuildScenes, tyro.conf.subcommand("build")]
    | Annotated[ShowScene, tyro.conf.subcommand("show")]
    | Annotated[CheckScenes, tyro.conf.subcommand("check")]
)


def contents(scene: Scene) -> Table:
    """A table of a scene's rooms and what is in each."""
    title = f"{scene.name}: {len(scene.faces)} faces, {len(scene.materials)} materials"
    table = Table(title=title, title_justify="left")
    for name in ("room", "things"):
        table.add_column(name, overflow="fold")
    rooms: list[tuple[str, int | None]] = [(room.name, room.id) for room in scene.rooms]
    if any(i.room is None for i in scene.instances):
        rooms.append(("in no room", None))
    for name, room_id in rooms:
        names = [i.category for i in scene.instances if i.room == room_id]
        counted = {n: names.count(n) for n in sorted(set(names))}
        table.add_row(name, ", ".join(n if c == 1 else f"{n} × {c}" for n, c in counted.items()))
    return table


def _expanded(specs: tuple[str, ...], keep_paths: bool = False) -> list[str]:
    """Every single spec that the given ones stand for; ``keep_paths``: the path of one scan or recording is kept as it is."""
    from openmap_scenes.catalog import expand_specs

    if not specs:
        raise DataError("scenes", "no scene named", "one spec or more, such as homes:val/0")
    return [one for spec in specs for one in ([spec] if keep_paths and _is_one(spec) else expand_specs(spec))]


def _is_one(target: str) -> bool:
    """Whether something lies at a path that is no folder of several scenes; a scan that is broken is one, too."""
    from openmap_eval.scene_check import find_recordings
    from openmap_scenes.catalog import guess_spec, list_scenes

    path = Path(target)
    if not target or not path.exists():
        return False
    if path.is_file() or find_recordings(path):
        return True
    try:
        guess_spec(path)
    except DataError:
        return len(list_scenes(path)) < 2
    return True


def _make_folder(folder: Path) -> None:
    """Make a folder that is to be written to; DataError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        found = f"a place where no folder can be made ({error.strerror})"
        raise DataError(folder, found, "a folder to write to", "Name another one by --out.") from error
