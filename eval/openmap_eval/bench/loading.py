"""``openmap bench loading``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console


@dataclass(frozen=True)
class Loading:
    """How fast a big textured mesh loads, and what a second process that opens it adds: trimesh alone, first load, cached load."""

    faces: int = 2_000_000
    """Triangles of the synthetic home."""
    textures: int = 60
    """How many textures, one a material."""
    texture_size: int = 2048
    """Their side, px."""
    image: str = "jpeg"
    """jpeg or png."""
    repeats: int = 3
    """Fresh processes for each row; the median of the wall times counts."""
    seed: int = 0
    out: Path | None = None
    """Write the figures to this JSON file."""

    def run(self, console: Console) -> None:
        raise NotImplementedError
