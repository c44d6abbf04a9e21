"""What a home may be furnished with: the pieces of one split, by kind, as things with words for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from openmap_scenes.homes.colour import model_colour
from openmap_scenes.homes.kinds import read_kinds, read_splits
from openmap_scenes.homes.library import Piece, read_library
from openmap_scenes.homes.models import Model, load_model
from openmap_scenes.homes.placement import Thing

# What lies on the floor and is stood upon is pressed to this height, m, so that nothing sinks into it.
FLAT, FLAT_HEIGHT = ("rug", "round rug", "bath mat", "doormat"), 0.008


class Stock:
    """The furniture of one split; a piece that is in the home already is taken again only where nothing else is left.

    Parameters
    ----------
    split : str
    rng : np.random.Generator
        Chooses among the pieces of a kind.
    folder : Path or None
        Of the catalogues; None = the default.
    """

    def __init__(self, split: str, rng: np.random.Generator, folder: Path | None = None) -> None:
        library, splits = read_library(folder), read_splits()
        self._rng = rng
        self._pieces: dict[str, list[Piece]] = {}
        self._uses: dict[str, int] = {}
        self._things: dict[str, Thing] = {}
        for piece, kind in read_kinds().items():
            if splits[piece] == split and piece in library:
                self._pieces.setdefault(kind.kind, []).append(library[piece])

    def has(self, kind: str) -> bool:
        """Whether the split has a piece of that kind."""
        return kind in self._pieces

    def get(
        self, *kinds: str, width: float = 9.0, depth: float = 9.0, height: float = 9.0, fresh: bool = False
    ) -> Thing | None:
        """A thing of one of the kinds, no larger than the given size, m; ``fresh``: none that is in the home already."""
        kinds = tuple(k for k in kinds if k in self._pieces)
        for k in self._rng.permutation(len(kinds)).tolist():
            fitting = [p for p in self._pieces[kinds[k]] if np.all(p.size <= (width, height, depth))]
            if fresh:
                fitting = [p for p in fitting if p.id not in self._uses]
            if fitting:
                least = min(self._uses.get(p.id, 0) for p in fitting)
                fitting = [p for p in fitting if self._uses.get(p.id, 0) == least]
                piece = fitting[int(self._rng.integers(len(fitting)))]
                self._uses[piece.id] = self._uses.get(piece.id, 0) + 1
                return self._thing(kinds[k], piece)
        return None

    def _thing(self, kind: str, piece: Piece) -> Thing:
        if piece.id not in self._things:
            model = load_model(piece)
            if kind in FLAT and model.size[1] > FLAT_HEIGHT:
                press = np.array([1.0, FLAT_HEIGHT / model.size[1], 1.0], np.float32)
                model = replace(model, vertices=model.vertices * press)
            attributes = {"colour": model_colour(model)} | read_kinds()[piece.id].attributes
            self._things[piece.id] = Thing(
                kind, model, attributes, piece.id, piece.elevation, piece.surface is not None, piece.credit
            )
        return self._things[piece.id]


def own(kind: str, model: Model, **attributes: str) -> Thing:
    """A thing made here and not taken from the library."""
    return Thing(kind, model, {"colour": model_colour(model)} | attributes)
