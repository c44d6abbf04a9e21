"""Trains everything that perception learns, on views of the built-in homes' train split, and writes it to ``weights/``.

    OMP_NUM_THREADS=1 python -m openmap_agents.perception.train

Two passes over the homes: the first teaches the segmenter (``train_segmenter``), the second the region heads
(``train_regions``) with true masks and the segmenter's own. Half of the homes are seen at 640 x 480 pixels, half at 320 x 240,
so that the size of the picture does not matter much. The same seed gives the same views; on the same machine, the same weights.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro

from openmap_agents.perception.backbone import N_FEATURES, Backbone
from openmap_agents.perception.conse import unit
from openmap_agents.perception.segmenter import EmbeddedSegmenter
from openmap_agents.perception.text import TextEncoder
from openmap_agents.perception.train_regions import collect, fit_head, weights_of
from openmap_agents.perception.train_segmenter import Sample, train_segmenter
from openmap_agents.perception.views import STRUCTURE, random_views
from openmap_agents.perception.weights import FOLDER, save_weights
from openmap_scenes import PinholeCamera, load_scene

CAMERAS = (PinholeCamera.from_hfov(640, 480, 90.0), PinholeCamera.from_hfov(320, 240, 90.0))


@dataclass(frozen=True)
class Settings:
    """What to train on and where to put the result."""

    split: str = "homes:train"
    """Scene spec without its number."""
    homes: int = 100
    """How many homes the heads learn from: 0, 1, ..."""
    views: int = 18
    """Views of each of them."""
    segmenter_homes: int = 30
    """How many of the homes the segmenter learns from."""
    segmenter_views: int = 12
    """Views of each of those."""
    seed: int = 0
    out: Path = FOLDER
    """Where the weights go."""


def samples(s: Settings, homes: int, views: int, purpose: int) -> Iterator[tuple[int, Sample, dict[int, str]]]:
    """(home, view, names by id) of every view; ``purpose`` draws other views of the same homes."""
    start = time.monotonic()
    for home in range(homes):
        scene, camera = load_scene(f"{s.split}/{home}"), CAMERAS[home % len(CAMERAS)]
        names = {i.id: i.category for i in scene.instances if i.category}
        structure = frozenset(i for i, name in names.items() if name in STRUCTURE)
        for view in random_views(scene, camera, views, np.random.default_rng([s.seed, purpose, home])):
            yield home, Sample(view, camera, structure), names
        print(f"home {home + 1} of {homes}, {time.monotonic() - start:.0f} s", flush=True)


def main(s: Settings) -> None:
    """Train the segmenter, then the heads."""
    torch.use_deterministic_algorithms(True)
    lessons = [sample for _, sample, _ in samples(s, s.segmenter_homes, s.segmenter_views, 0)]
    save_weights(s.out / "segmenter.npz", train_segmenter(lessons, s.seed))
    del lessons

    regions = collect(samples(s, s.homes, s.views, 1), Backbone(), EmbeddedSegmenter(s.out / "segmenter.npz"))
    names = sorted(set(regions.names))
    words = TextEncoder().encode_text(names)
    mean = words.mean(0)
    bank = unit(words - mean)
    own = np.array([names.index(name) for name in regions.names])
    weight = weights_of(regions, own)
    x = regions.looks.astype(np.float32)
    print(f"{len(regions)} regions of {len(set(regions.things.tolist()))} things, {len(names)} names")
    heads = {
        "looks": fit_head(x, own, weight, bank, hidden=320, seed=s.seed, epochs=12, dropout=0.6),
        "shape": fit_head(x[:, N_FEATURES:], own, weight, bank, hidden=128, seed=s.seed, epochs=20, dropout=0.1),
    }
    arrays = {"words.mean": mean} | {
        f"{name}.{part}": array for name, head in heads.items() for part, array in head.items()
    }
    save_weights(s.out / "regions.npz", arrays)


if __name__ == "__main__":
    main(tyro.cli(Settings))
