"""How the default perception is trained. Without torch, so that a command line can show it at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Settings:
    """What to train on, for how long, and where to put the result."""

    out: Path
    """Folder for the weights, curves.png, log.jsonl and training.json."""
    work: Path = Path("runs/perception")
    """Folder for what was seen of the homes (70 MB a home) and for checkpoints; a second call with it goes on."""
    split: str = "homes:train"
    """Scene spec without its number."""
    homes: int = 240
    """How many homes: 0, 1, ..."""
    views: int = 64
    """Views of each of them."""
    patch_views: int = 16
    """How many of these the segmenter learns from."""
    held: int = 12
    """The last homes are kept back from the heads, to calibrate them on and to see what they reach."""
    neck_homes: int = 128
    """How many of the homes the neck learns from."""
    neck_epochs: int = 4
    neck_share: float = 0.35
    """Share of every home's views that an epoch of the neck uses; others each time."""
    head_epochs: int = 8
    segmenter_homes: int = 160
    seed: int = 0
    processes: int = 2
    """For looking at homes."""
    threads: int = 1
    """For learning."""
