"""Runs ``openmap eval perception``: scene by scene, then tables, the JSON file and the page."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import Progress

from openmap_agents.perception import Encoder, Segmenter, is_oracle, make_perception, read_encoder_spec, resolve
from openmap_agents.perception.views import View, random_views
from openmap_eval.bench.machine import describe_machine
from openmap_eval.bench.memory import peak_mib
from openmap_eval.bootstrap import Figure
from openmap_eval.perception.command import EvalPerception
from openmap_eval.perception.confusions import confusions
from openmap_eval.perception.figures import SceneResult, figures, scene_result
from openmap_eval.perception.frames import DrawnFrame, drawn_frames
from openmap_eval.perception.labels import NameList
from openmap_eval.perception.names import INSTALLED, names_of_homes, trained_names
from openmap_eval.perception.observe import Clock, Observed, Observer, Roles, Sensor, observe
from openmap_eval.perception.page import write_page
from openmap_eval.perception.tables import overview, rich_table, tables
from openmap_eval.records import write_json
from openmap_scenes import DataError, PinholeCamera, load_scene

if TYPE_CHECKING:
    from openmap_agents.perception.text import TextEncoder

N_FRAMES = 12


def run_eval_perception(command: EvalPerception, console: Console) -> None:
    """Measure, print the tables, write ``perception.json`` and ``perception.html``."""
    specs = scene_specs(command)
    chosen = resolve(command.perception, command.segmenter, command.encoder)
    oracle = any(map(is_oracle, chosen))
    trained = _trained(command, chosen[1])
    _make_folder(command.out)  # before anything is measured that could not be written
    run = Run(command, chosen, trained)
    show = shown_views(len(specs), command.views)
    with Progress(console=console, transient=True) as bars:
        for spec, views in zip(specs, show, strict=True):
            task = bars.add_task(spec, total=command.views)
            run.scene(spec, views, lambda task=task: bars.advance(task))  # type: ignore[misc]
    together = figures(run.results, command.seed)
    several = len(specs) > 1
    each = {s: figures([r], command.seed) for s, r in zip(specs, run.results, strict=True)} if several else {}
    timing = run.timing()
    shown = [*([overview(each)] if several else []), *tables(together, timing)]
    for table in shown:
        console.print(rich_table(table, "ORACLE · " if oracle else ""))
        console.print()
    settings = _settings(command, specs, chosen)
    content = {
        "oracle": oracle,
        "settings": {**settings, "trained names": len(trained)},
        "machine": describe_machine(),
        "figures": together if several else {},
        "scenes": each or {specs[0]: together},
        "timing": timing,
    }
    write_json(command.out / "perception.json", _plain(content))
    confused = confusions(run.observed, trained, run.encode)
    write_page(command.out / "perception.html", settings, oracle, shown, run.frames, confused)
    console.print(f"written: perception.json, perception.html in {command.out}", soft_wrap=True)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError("--out", f"{path} ({error.strerror})", "a folder, or a place to make one") from None


def scene_specs(command: EvalPerception) -> list[str]:
    """What to measure on; DataError where the command line does not say it."""
    if bool(command.scene) == (command.split is not None):
        found = "both --scene and --split" if command.scene else "neither --scene nor --split"
        raise DataError("the command line", found, "one of them")
    for name, least in (("views", 1), ("homes", 1), ("train_homes", 0), ("width", 32), ("height", 32)):
        if getattr(command, name) < least:
            raise DataError(f"--{name.replace('_', '-')}", str(getattr(command, name)), f"at least {least}")
    if command.scene:
        if len(set(command.scene)) < len(command.scene):
            raise DataError("--scene", "a scene twice", "each scene once")
        return list(command.scene)
    split = str(command.split).partition("/")[2]
    return [f"homes:{split}/{n}" for n in range(command.homes)]


def shown_views(scenes: int, views: int) -> list[frozenset[int]]:
    """Which views of each scene go on the page: ``N_FRAMES`` evenly over all of them."""
    numbers = np.unique(np.linspace(0, scenes * views - 1, min(N_FRAMES, scenes * views)).astype(int))
    return [frozenset(int(k) - s * views for k in numbers if k // views == s) for s in range(scenes)]


def make_sensor(name: str) -> Sensor:
    """What the camera makes of a rendered picture: nothing, or what a real one does to every picture."""
    if name == "ideal":
        return lambda rgb, depth, rng: (rgb, depth)
    from openmap_agents.perception.training.augment import SensorNoise

    return SensorNoise(ideal_share=0.0)


class Run:
    """What is kept from scene to scene.

    Parameters
    ----------
    command : EvalPerception
    specs : (str, str)
        Of the segmenter and of the encoder.
    trained : list of str
        Names that the weights know.
    """

    def __init__(self, command: EvalPerception, specs: tuple[str, str], trained: list[str]) -> None:
        self._command, self._specs, self._trained = command, specs, trained
        # Features that were made elsewhere are of the masks that were made with them.
        self._any_masks = read_encoder_spec(specs[1]).family != "precomputed"
        self._told = any(map(is_oracle, specs))
        self._ids = np.zeros((0, 0), np.int32)
        self._known: dict[str, npt.NDArray[np.float32]] = {}
        self._perception: tuple[Segmenter, Encoder] | None = None
        self._text: TextEncoder | None = None
        self.clock = Clock()
        self.results: list[SceneResult] = []
        self.observed: list[Observed] = []
        self.frames: list[DrawnFrame] = []

    def scene(self, spec: str, show: frozenset[int], on_view: Callable[[], None]) -> None:
        """Look at one scene; DataError if none of its things can be asked for, or no view shows any."""
        command, scene = self._command, load_scene(spec)
        roles = Roles.of(scene)
        if not roles.things:
            raise DataError(spec, "no instance with a name", "a scene with semantics", "Take one of the catalogue's.")
        if self._perception is None or self._told:
            self._perception = self._make({i.id: i.category for i in scene.instances})
        segmenter, encoder = self._perception
        camera = PinholeCamera.from_hfov(command.width, command.height, command.hfov_deg)
        sensor_rng = np.random.default_rng([command.seed, 1])
        sensor = make_sensor(command.sensor)
        observer = Observer(roles, camera, segmenter, encoder, sensor, sensor_rng, self.clock, self._any_masks)
        views = random_views(scene, camera, command.views, np.random.default_rng(command.seed))

        def seen() -> Any:
            for view in views:
                yield self._looking_at(view)
                on_view()

        observed = observe(seen(), observer, spec, show)
        if not observed.things:
            raise DataError(
                spec, "no view that shows a thing with a name", "things to be seen", "Ask for more --views."
            )
        self._learn_words(observed, encoder)
        self.observed.append(observed)
        self.results.append(scene_result(observed, self._trained, self.encode))
        calibration = getattr(encoder, "calibration", None)
        self.frames.extend(drawn_frames(observed, self._trained, self.encode, calibration))

    def _make(self, categories: dict[int, str]) -> tuple[Segmenter, Encoder]:
        if self._told and self._text is None:
            from openmap_agents.perception.text import TextEncoder

            self._text = TextEncoder()  # each scene has an oracle of its own; they share what reads words
        return make_perception(*self._specs, semantic=lambda: self._ids, categories=categories, text=self._text)

    def encode(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) of words; each is encoded once."""
        new = [t for t in dict.fromkeys(texts) if t not in self._known]
        if new:
            assert self._perception is not None  # words are asked of what was seen
            self._known.update(zip(new, self._perception[1].encode_text(new), strict=True))
        return np.stack([self._known[t] for t in texts])

    def timing(self) -> dict[str, Any]:
        """Milliseconds by stage, and the most memory that this process held."""
        ms = {
            stage: {"wall": _spread(self.clock.wall[stage]), "cpu": _spread(self.clock.cpu[stage]), "n": len(wall)}
            for stage, wall in self.clock.wall.items()
        }
        return {"ms": ms, "peak_mib": peak_mib()}

    def _looking_at(self, view: View) -> View:
        self._ids = view.frame.instance
        return view

    def _learn_words(self, observed: Observed, encoder: Encoder) -> None:
        """Encode all names and take the time; a word's is the mean of the list."""
        words = NameList.every(self._trained, [i.category for i in observed.things]).words
        new = [word for word in words if word not in self._known]
        if new:
            clock = Clock()
            with clock("text"):
                vectors = encoder.encode_text(new)
            self._known.update(zip(new, vectors, strict=True))
            for mine, once in ((self.clock.wall, clock.wall), (self.clock.cpu, clock.cpu)):
                mine.setdefault("text", []).append(once["text"][0] / len(new))


def _trained(command: EvalPerception, encoder: str) -> list[str]:
    """What the weights know: by default, what the list beside those of the encoder says."""
    if command.train_homes:
        if command.names is not None:
            raise DataError("the command line", "both --names and --train-homes", "one of them")
        return names_of_homes(command.train_homes)
    read = read_encoder_spec(encoder)
    own = read.family == "embedded" and read.rest
    return trained_names(command.names or (Path(read.rest) / INSTALLED.name if own else INSTALLED))


def _settings(command: EvalPerception, specs: Sequence[str], chosen: tuple[str, str]) -> dict[str, Any]:
    """What a page and a file say of a run; no paths but those that name scenes and models."""
    kept = ("views", "seed", "sensor", "width", "height", "hfov_deg", "train_homes")
    return {
        "segmenter": chosen[0],
        "encoder": chosen[1],
        "scenes": list(specs),
        **{name: getattr(command, name) for name in kept},
        "names": None if command.names is None else Path(command.names).name,
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p90": float(np.percentile(values, 90))}


def _plain(value: Any) -> Any:
    """For JSON: figures as objects, what is not a number as null."""
    if isinstance(value, Figure):
        return _plain(dataclasses.asdict(value))
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value
