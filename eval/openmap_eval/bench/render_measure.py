"""The rounds of the rendering benchmark, and what comes out of them."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import Progress

from openmap_env.navigation import NavigableSurface
from openmap_eval.bench.render import Render, as_settings, picture_size
from openmap_eval.bench.render_contenders import CONTENDERS, REFERENCE
from openmap_eval.bench.render_home import make_render_home
from openmap_eval.bench.render_poses import CAMERA_HEIGHT, scattered, walk
from openmap_eval.bench.render_process import ContenderError, ContenderProcess, chosen_contenders
from openmap_scenes.store import save_scene

WALKS = ("walk", "scattered")
_SHOWN = 6
"""Poses of each kind that the agreement is taken from."""

Rounds = dict[tuple[str, str], list[dict[str, float]]]


def measure(settings: Render, console: Console) -> dict[str, Any]:
    """All figures: settings, why contenders are missing, and one entry for each home and size of picture."""
    names, missing = chosen_contenders(settings.backends)
    results: list[dict[str, Any]] = []
    turns = len(settings.faces) * len(settings.sizes) * settings.rounds * len(WALKS) * len(names)
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task("rendering", total=turns)
        for faces in settings.faces:
            with tempfile.TemporaryDirectory(prefix="openmap-bench-") as scratch, ExitStack() as stack:
                progress.update(bar, description=f"{faces:,} faces: making the home")
                actual = _make_home(settings, faces, Path(scratch))
                running = {
                    name: stack.enter_context(
                        ContenderProcess(name, [Path(scratch) / "home"], Path(scratch), settings.lp_threads)
                    )
                    for name in names
                }
                for size in settings.sizes:
                    progress.update(bar, description=f"{faces:,} faces, {size}")
                    rows = _measure_size(settings, size, running, missing, Path(scratch), progress, bar)
                    results.append({"faces": actual, "size": size, "contenders": rows})
    return {"settings": as_settings(settings), "missing": missing, "results": results}


def _make_home(settings: Render, faces: int, scratch: Path) -> int:
    """Write the home and the poses; how many faces it has."""
    scene = make_render_home(faces, settings.seed, settings.textures)
    save_scene(scene, scratch / "home")
    surface, rng = NavigableSurface.from_scene(scene), np.random.default_rng(settings.seed)
    poses = {
        "walk": walk(scene, surface, settings.frames, rng),
        "scattered": scattered(surface, settings.frames, rng),
    }
    places = surface.centres[surface.island == 0] + np.array([0.0, CAMERA_HEIGHT, 0.0])
    np.save(scratch / "places.npy", places)
    for name, T_world_camera in poses.items():
        np.save(scratch / f"{name}.npy", T_world_camera)
    np.save(
        scratch / "shown.npy", np.concatenate([poses[name][:: max(1, settings.frames // _SHOWN)] for name in WALKS])
    )
    return len(scene.faces)


def _measure_size(
    settings: Render, size: str, running: dict[str, ContenderProcess], missing: dict[str, str],
    scratch: Path, progress: Progress, bar: Any,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """The row of each contender; one that fails moves from ``running`` to ``missing``."""

    def ask(name: str, what: str, **details: Any) -> dict[str, Any]:
        try:
            return running[name].ask(what, **details)
        except ContenderError as error:
            missing[name] = str(error)
            del running[name]
            return {}

    width, height = picture_size(size)
    files = {"poses": str(scratch / "walk.npy"), "places": str(scratch / "places.npy")}
    opening = {"width": width, "height": height, **files}
    opened = {name: ask(name, "open", **opening) for name in list(running)}
    rounds: Rounds = {}
    for _ in range(settings.rounds):
        for kind in WALKS:
            for name in list(running):
                answer = ask(name, "time", poses=str(scratch / f"{kind}.npy"))
                if answer:
                    rounds.setdefault((name, kind), []).append(answer)
                progress.advance(bar)
    agreement = _agreement(list(running), ask, scratch)
    rows = {}
    for name in list(running):
        again = ask(name, "close") if name in running else {}
        again = ask(name, "open", **opening) if name in running else again
        if name in running:
            ask(name, "close")
            memory = max(r["rss_mib"] for kind in WALKS for r in rounds[name, kind])
            rows[name] = {
                "setup_s": opened[name]["seconds"],
                "learn_s": opened[name]["learn_seconds"],
                "setup_again_s": again["seconds"],
                "rss_mib": memory,
                **{kind: _speed(name, kind, rounds) for kind in WALKS},
                "agreement": agreement.get(name),
            }
    return rows


def _speed(name: str, kind: str, rounds: Rounds) -> dict[str, Any]:
    """Medians over rounds; ratios to the baseline are taken within each round."""
    own = rounds[name, kind]
    base = rounds.get((CONTENDERS[name].baseline, kind))
    speed: dict[str, Any] = {
        "frames_per_s": median(r["frames"] / r["wall_s"] for r in own),
        "wall_ms": median(1e3 * r["wall_s"] / r["frames"] for r in own),
        "cpu_ms": median(1e3 * r["cpu_s"] / r["frames"] for r in own),
        "ratio": None,
        "cpu_ratio": None,
    }
    if base is not None and len(base) == len(own):
        speed["ratio"] = median(b["wall_s"] / r["wall_s"] for b, r in zip(base, own, strict=True))
        speed["cpu_ratio"] = median(b["cpu_s"] / r["cpu_s"] for b, r in zip(base, own, strict=True))
    return speed


def _agreement(names: list[str], ask: Any, scratch: Path) -> dict[str, dict[str, Any]]:
    """Of each contender with the reference, over a few poses of each kind."""
    shown = {}
    for name in names:
        path = scratch / f"{name}.npz"
        if ask(name, "show", poses=str(scratch / "shown.npy"), to=str(path)):
            with np.load(path) as arrays:
                shown[name] = dict(arrays)
            path.unlink()
    if REFERENCE not in shown:
        return {}
    return {name: compare(frames, shown[REFERENCE]) for name, frames in shown.items()}


def compare(frames: dict[str, npt.NDArray[Any]], reference: dict[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """How far frames (rgb, depth, ids; (n, H, W, ...) each) are from the reference's.

    Ids: percent of all pixels that differ. Depth, mm, and colour, levels: away from edges, where neighbours in the reference have
    another id or a depth that is over 2 % larger.
    """
    flat = np.stack([_flat(d, i) for d, i in zip(reference["depth"], reference["ids"], strict=True)])
    found: dict[str, Any] = {"depth_mean_mm": None, "depth_max_mm": None, "ids_differ_percent": None, "rgb_mean": None}
    if "depth" in frames:
        gap = 1e3 * np.abs(frames["depth"].astype(np.float64) - reference["depth"])[flat]
        found |= {"depth_mean_mm": float(gap.mean()), "depth_max_mm": float(gap.max())}
    if "ids" in frames:
        found["ids_differ_percent"] = 100.0 * float(np.mean(frames["ids"] != reference["ids"]))
    if "rgb" in frames:
        found["rgb_mean"] = float(np.abs(frames["rgb"].astype(np.int16) - reference["rgb"])[flat].mean())
    return found


def _flat(depth: npt.NDArray[np.float32], ids: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
    kernel = np.ones((3, 3), np.uint8)
    number = ids.astype(np.float64)
    same = cv2.dilate(number, kernel) == cv2.erode(number, kernel)
    return np.asarray(same & (cv2.dilate(depth, kernel) <= 1.02 * cv2.erode(depth, kernel)))
