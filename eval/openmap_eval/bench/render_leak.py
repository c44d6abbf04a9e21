"""``openmap bench render --leak``: what thousands of frames and many changes of the scene leave behind in memory."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress

from openmap_env.navigation import NavigableSurface
from openmap_eval.bench.render import Render, as_settings, picture_size
from openmap_eval.bench.render_contenders import CONTENDERS
from openmap_eval.bench.render_home import make_render_home
from openmap_eval.bench.render_poses import scattered
from openmap_eval.bench.render_process import ContenderError, ContenderProcess, chosen_contenders
from openmap_scenes.store import save_scene

FRAMES, SWITCHES = 5000, 30
_FACES = 50_000


def measure(settings: Render, console: Console, frames: int = FRAMES, switches: int = SWITCHES) -> dict[str, Any]:
    """Growth of resident memory, MiB, of each of this package's renderers, on two homes of 50,000 faces."""
    own = [name for name in settings.backends or CONTENDERS if settings.backends or not CONTENDERS[name].peer]
    names, missing = chosen_contenders(own)
    rows: dict[str, dict[str, float]] = {}
    with (
        tempfile.TemporaryDirectory(prefix="openmap-bench-") as folder,
        Progress(console=console, transient=True) as progress,
    ):
        scratch = Path(folder)
        homes = [scratch / f"home{n}" for n in range(2)]
        for number, home in enumerate(homes):
            scene = make_render_home(_FACES, settings.seed + number, settings.textures)
            save_scene(scene, home)
        poses = scattered(NavigableSurface.from_scene(scene), 100, np.random.default_rng(settings.seed))
        np.save(scratch / "poses.npy", poses)
        np.save(scratch / "places.npy", poses[:, :3, 3])
        width, height = picture_size(settings.sizes[0])
        common = {"poses": str(scratch / "poses.npy"), "places": str(scratch / "places.npy")}
        for name in progress.track(names, description="looking for leaks"):
            try:
                with ContenderProcess(name, homes, scratch, settings.lp_threads, 1800.0) as process:
                    process.ask("open", width=width, height=height, **common)
                    grown = process.ask("grow", frames=frames, **common)["mib"]
                    changed = process.ask("grow", switches=switches, **common)["mib"]
                    rows[name] = {"frames_mib": grown, "switches_mib": changed}
            except ContenderError as error:
                missing[name] = str(error)
    return {
        "settings": as_settings(settings) | {"faces": [_FACES], "sizes": [settings.sizes[0]]},
        "frames": frames, "switches": switches, "missing": missing, "growth": rows,
    }  # fmt: skip
