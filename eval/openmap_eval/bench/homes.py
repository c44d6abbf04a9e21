"""``openmap bench homes``: what the built-in homes cost to build, and whether each is fit to be searched."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from openmap_eval.bench.machine import describe_machine, write_json

_DIGEST = "import sys; from openmap_scenes import load_scene; [print(load_scene(s, cache=False).digest()) for s in sys.argv[1:]]"


@dataclass(frozen=True)
class Homes:
    """Build homes of every split, audit each, and build them again in another process to compare every byte."""

    train: int = 20
    """How many homes of the split, from 0 on."""
    val: int = 10
    test: int = 10
    again: bool = True
    """Build each a second time, in another process."""
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        specs = [f"homes:{split}/{n}" for split in ("train", "val", "test") for n in range(getattr(self, split))]
        audits = []
        for spec in track(specs, "building and looking", console=console, transient=True):
            audits.append(audit_home(spec))
            if self.again:
                audits[-1]["same_bytes"] = digest_elsewhere(spec) == audits[-1]["digest"]
        console.print(_table(audits))
        summary = summarise(audits)
        for key, value in summary.items():
            console.print(f"{key}: {value}", highlight=False)
        if self.out is not None:
            write_json(self.out, {"machine": describe_machine(), "summary": summary, "homes": audits})
            console.print(f"written: {self.out}", soft_wrap=True)


def audit_home(spec: str) -> dict[str, Any]:
    """Build one home, without the cache, and hold it to everything that a home is held to."""
    from openmap_env.navigation import NavigableSurface
    from openmap_eval.scene_audit import ENOUGH_PIXELS, best_views, clashes, things, unreachable_rooms
    from openmap_scenes import load_scene

    wall, cpu = time.perf_counter(), time.process_time()
    scene = load_scene(spec, cache=False)
    seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
    surface = NavigableSurface.from_scene(scene)
    pixels = best_views(scene, surface)
    hidden = [i for i in things(scene) if pixels[i.id] < ENOUGH_PIXELS]
    run_in = clashes(scene)
    return {
        "spec": spec,
        "seconds": round(seconds, 2),
        "cpu_seconds": round(cpu_seconds, 2),
        "rooms": len(scene.rooms),
        "objects": len(pixels),
        "kinds": sorted({i.category for i in things(scene)}),
        "faces": len(scene.faces),
        "unreachable": [room.name for room in unreachable_rooms(scene, surface)],
        "clashes": [f"{c.first.category} / {c.second.category}" for c in run_in],
        "visible": round(1.0 - len(hidden) / max(1, len(pixels)), 4),
        "hidden": [f"{i.category} ({pixels[i.id]} px)" for i in hidden],
        "digest": scene.digest(),
    }


def digest_elsewhere(spec: str) -> str:
    """The digest of a home that another process builds, without the cache."""
    done = subprocess.run([sys.executable, "-c", _DIGEST, spec], capture_output=True, text=True, check=True)
    return done.stdout.split()[-1]


def summarise(audits: list[dict[str, Any]]) -> dict[str, Any]:
    """The worst and the sum of what was found over all homes."""
    seconds = sorted(a["seconds"] for a in audits)
    by_split: dict[str, set[str]] = {}
    for a in audits:
        by_split.setdefault(a["spec"].split(":")[1].split("/")[0], set()).update(a["kinds"])
    hidden = Counter(name.partition(" (")[0] for a in audits for name in a["hidden"])
    summary: dict[str, Any] = {
        "homes": len(audits),
        "seconds (median, worst)": (seconds[len(seconds) // 2], seconds[-1]),
        "rooms (fewest, most)": (min(a["rooms"] for a in audits), max(a["rooms"] for a in audits)),
        "objects (fewest, most)": (min(a["objects"] for a in audits), max(a["objects"] for a in audits)),
        "kinds": len(set().union(*by_split.values())),
        "homes with an unreachable room": sum(bool(a["unreachable"]) for a in audits),
        "clashes": sum(len(a["clashes"]) for a in audits),
        "share visible (worst)": min(a["visible"] for a in audits),
        "hidden most often": dict(hidden.most_common(8)),
    }
    if "train" in by_split and "test" in by_split:
        summary["kinds of test that train has not"] = sorted(by_split["test"] - by_split["train"])
    if any("same_bytes" in a for a in audits):
        summary["homes that differ in another process"] = [a["spec"] for a in audits if not a.get("same_bytes", True)]
    return summary


def _table(audits: list[dict[str, Any]]) -> Table:
    table = Table(title="homes", title_justify="left")
    for name in ("home", "s", "rooms", "objects", "kinds", "faces", "closed", "clashes", "visible", "same"):
        table.add_column(name, justify="left" if name == "home" else "right")
    for a in audits:
        row = (a["spec"], a["seconds"], a["rooms"], a["objects"], len(a["kinds"]), a["faces"], len(a["unreachable"]))
        same = "" if "same_bytes" not in a else "yes" if a["same_bytes"] else "NO"
        table.add_row(*map(str, row), str(len(a["clashes"])), f"{a['visible']:.1%}", same)
    return table
