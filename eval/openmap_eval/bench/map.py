"""``openmap bench map``: what a frame costs early and late on a long walk, a whole map's time and memory, and others' beside it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.console import Console

from openmap_eval.bench.machine import describe_machine, write_json

if TYPE_CHECKING:
    from openmap_eval.mapping.inputs import KeptMasks
    from openmap_eval.mapping.walks import Walk, WalkSpec

_THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_WARM = 3
_PATIENCE_S = 7200


@dataclass(frozen=True)
class Map:
    """Milliseconds a frame at the start and at the end of one long walk with revisits, asking on the way, memory; then a map of
    one round of the scene, by the mapper, by MaskClustering, and a small one by the plain reference.

    Each is made in a process of its own that reads kept frames and masks, outside the measured time; the first three frames warm
    it up. Masks are true ones, corrupted as a good segmenter corrupts them.
    """

    scene: str = "homes:val/0"
    """A scene of the catalogue."""
    frames: int = 2000
    """Of the long walk."""
    window: int = 100
    """How many of its first and of its last frames are compared."""
    ask_every: int = 100
    """Ask for the instances after so many frames; 0 = only at the end."""
    job_frames: int = 280
    """Of the walk of one round."""
    reference_frames: int = 24
    """First so many of these, every eighth pixel, for the reference; 0 = leave it out."""
    peer: bool = True
    """MaskClustering on the walk of one round, with the published crop of the cloud and without its fault."""
    features: Literal["none", "good", "poor"] = "none"
    """Features of the masks, drawn: as an encoder's that knows categories, or hardly."""
    consensus: Literal["soft", "paper"] = "soft"
    """Of the long walk and the reference; the walk of one round is done with both."""
    threads: int = 1
    """How many a process may use."""
    width: int = 640
    """Picture width, px."""
    height: int = 480
    """Picture height, px."""
    seed: int = 0
    """Of walk, corruption and features."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        from openmap_eval.bench.map_table import tables

        result = measure(self, console)
        for table in tables(result):
            console.print(table)
        if self.out is not None:
            write_json(self.out, result)
            console.print(f"written: {self.out}", soft_wrap=True)


def measure(settings: Map, console: Console | None = None) -> dict[str, Any]:
    """All figures, as they are written: the settings, the machine, the long walk, the maps of one round, the small ones."""
    from openmap_eval.mapping.walks import WalkSpec

    least = {"frames": 2, "window": 1, "ask_every": 0, "job_frames": 1, "reference_frames": 0, "threads": 1}
    for name, value in (least | {"width": 32, "height": 32}).items():
        if getattr(settings, name) < value:
            raise ValueError(f"{getattr(settings, name)} {name}; expected {value} or more")
    if 2 * settings.window > settings.frames:
        raise ValueError(f"a window of {settings.window}; expected at most half of the {settings.frames} frames")
    size = settings.width, settings.height
    long = WalkSpec(settings.scene, "scene", settings.frames, *size, settings.seed, long=True)
    round_ = WalkSpec(settings.scene, "scene", settings.job_frames, *size, settings.seed)
    with tempfile.TemporaryDirectory(prefix="openmap-bench-") as scratch:
        bench = _Bench(settings, Path(scratch), console or Console(quiet=True))
        maps = bench.round_maps(round_)
        small = bench.small_maps(round_) if settings.reference_frames else {}
        walk = bench.long_walk(long)
    return {
        "benchmark": "map",
        "settings": {k: v for k, v in asdict(settings).items() if k != "out"},
        "machine": describe_machine(),
        "long walk": walk,
        "one round": maps,
        "small": small,
    }


class _Bench:
    """Prepares walks and starts the measured processes."""

    def __init__(self, settings: Map, scratch: Path, console: Console) -> None:
        self._settings, self._scratch, self._console = settings, scratch, console
        self._compiled: set[str] = set()

    def long_walk(self, spec: WalkSpec) -> dict[str, Any]:
        from openmap_eval.bench.map_table import summary_of_walk

        s = self._settings
        task = self._task(spec, {"consensus": s.consensus}) | {"ask_every": s.ask_every}
        return summary_of_walk(self._run("long walk", task), s.window)

    def round_maps(self, spec: WalkSpec) -> dict[str, Any]:
        rows = {}
        for consensus in ("soft", "paper"):
            found = self._run(f"one round, {consensus}", self._task(spec, {"consensus": consensus}))
            rows[f"mapper, {consensus}"] = _short(found)
        if self._settings.peer:
            import numpy as np

            from openmap_eval.mapping.walks import open_walk

            cloud = self._scratch / "cloud.npy"
            np.save(cloud, open_walk(spec).make_cloud().points)
            for name, margin in (("as published", 0.0), ("without its fault", 0.03)):
                task = self._task(spec, {"box_margin": margin}) | {"what": "peer", "cloud": str(cloud)}
                rows[f"MaskClustering, {name}"] = self._run(f"one round, MaskClustering {name}", task)
        return rows

    def small_maps(self, spec: WalkSpec) -> dict[str, Any]:
        """The reference and the mapper on the same few small pictures."""
        from openmap_eval.mapping.jobs import COARSE
        from openmap_eval.mapping.table import REFERENCE_STEP

        settings = asdict(replace(COARSE, consensus=self._settings.consensus))
        task = self._task(replace(spec, step=REFERENCE_STEP), settings)
        task["frames"] = task["frames"][: self._settings.reference_frames]
        mapper = self._run("small, mapper", task)
        return {"reference": self._run("small, reference", task | {"what": "reference"}), "mapper": _short(mapper)}

    def _task(self, spec: WalkSpec, settings: dict[str, Any]) -> dict[str, Any]:
        """Of the mapper; frames and masks are made if they are not kept."""
        from openmap_eval.console import ProgressBars
        from openmap_eval.mapping.inputs import MaskSpec, masks_of
        from openmap_eval.mapping.sequence import SequenceSettings, record
        from openmap_eval.mapping.walks import open_walk

        whole = replace(spec, step=1)
        with ProgressBars(self._console) as bars:
            walk = open_walk(whole, lambda done, of: bars("walk", done, of))
            masks = masks_of(walk, MaskSpec(strength=1.0, seed=spec.seed), lambda done, of: bars("masks", done, of))
        sequence = record(
            SequenceSettings(spec.source, spec.frames, spec.seed, spec.width, spec.height, every=spec.long)
        )
        return {
            "what": "mapper",
            "sequence": str(sequence.folder),
            "masks": str(masks.folder),
            "features": self._features(walk, masks),
            "frames": list(range(len(walk))),
            "step": spec.step,
            "warm": _WARM,
            "threads": self._settings.threads,
            "camera": asdict(open_walk(spec).camera),
            "settings": settings,
            "ask_every": 0,
        }

    def _features(self, walk: Walk, masks: KeptMasks) -> str | None:
        """A file of drawn features."""
        if self._settings.features == "none":
            return None
        import numpy as np

        from openmap_eval.mapping.inputs import DrawnFeatures

        draw = DrawnFeatures(self._settings.features, walk.categories, self._settings.seed)
        path = self._scratch / f"features-{walk.key}.npz"
        if not path.is_file():
            drawn = [draw(*masks.shares(n), n) for n in range(len(walk))]
            np.savez(path, features=np.concatenate(drawn), starts=np.cumsum([0, *map(len, drawn)]))
        return str(path)

    def _run(self, title: str, task: dict[str, Any]) -> dict[str, Any]:
        if task["what"] not in self._compiled:
            # What is compiled once for all goes into the caches here, not into the figures.
            _child({**task, "frames": task["frames"][:_WARM]}, self._settings.threads)
            self._compiled.add(task["what"])
        with self._console.status(f"{title} ..."):
            return _child(task, self._settings.threads)


def _short(found: dict[str, Any]) -> dict[str, Any]:
    """A map's figures without those of single frames."""
    from openmap_eval.bench.map_table import spread

    kept = ("cpu_seconds", "finalize_seconds", "instances", "voxels", "before_mib", "peak_mib")
    frames = {"wall": spread(found["wall_ms"]), "cpu": spread(found["cpu_ms"])}
    return {**{name: found[name] for name in kept}, "frames_used": sum(found["used"]), "ms": frames}


def _child(task: dict[str, Any], threads: int) -> dict[str, Any]:
    """What the process says."""
    environment = {**os.environ} | {name: str(threads) for name in _THREADS}
    done = subprocess.run(
        [sys.executable, "-m", "openmap_eval.bench.map_child"],
        input=json.dumps(task) + "\n",
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
        timeout=_PATIENCE_S,
    )
    if done.returncode:
        raise ValueError(f"the measured process ended with status {done.returncode}; its message is above")
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return figures
