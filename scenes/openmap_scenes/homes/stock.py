"""What a home may be furnished with: the library's pieces of one split and things made by rule, as things with words for them."""

from __future__ import annotations

import logging
import os
import zlib
from collections import Counter
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from openmap_scenes.homes.colour import model_colour
from openmap_scenes.homes.items import Thing
from openmap_scenes.homes.kinds import KEPT_FOR, SPLITS, read_kinds, read_splits
from openmap_scenes.homes.library import DEFAULT_FOLDER, FOLDER_VARIABLE, Piece, read_library
from openmap_scenes.homes.models import Model, load_model
from openmap_scenes.homes.parametric import GENERATORS, Limits

_log = logging.getLogger(__name__)

# What lies on the floor and is stood upon is pressed to this height, m, so that nothing sinks into it.
FLAT, FLAT_HEIGHT = ("rug", "round rug", "bath mat", "doormat"), 0.008
# How often a thing comes from the library, by the number of pieces of its kind that the split has: 0, 1, 2, more.
LIBRARY_SHARE = (0.0, 0.35, 0.45, 0.6)
# How many small things of one kind a home has.
OFTEN = 3
# What has to be of one make in a kitchen.
KITCHEN = ("kitchen cabinet", "kitchen drawers", "kitchen sink", "wall cabinet")
# The value of FOLDER_VARIABLE that asks for homes without the library.
NO_LIBRARY = "none"


def library_or_nothing(folder: Path | None = None) -> dict[str, Piece]:
    """The furniture library, or nothing where none is installed or ``OPENMAP_FURNITURE=none`` asks for homes without it.

    Raises
    ------
    DataError
        A folder is named and holds no catalogue, or a catalogue cannot be read.
    """
    if folder is not None:
        return read_library(folder)
    named = os.environ.get(FOLDER_VARIABLE)
    if named == NO_LIBRARY or (named is None and not DEFAULT_FOLDER.is_dir()):
        _say_once(named == NO_LIBRARY)
        return {}
    return read_library()


@cache
def _say_once(wanted: bool) -> None:
    why = f"{FOLDER_VARIABLE}={NO_LIBRARY}" if wanted else f"no furniture library at {DEFAULT_FOLDER}"
    _log.warning(
        "%s: homes are furnished with parametric pieces alone. For the full homes install the Debian package "
        "sweethome3d-furniture, or set %s to a folder that holds its catalogues (*.sh3f).",
        why,
        FOLDER_VARIABLE,
    )


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
        library, splits = library_or_nothing(folder), read_splits()
        self._rng, self._split = rng, split
        self._pieces: dict[str, list[Piece]] = {}
        self._uses: dict[str, int] = {}
        self._kinds_used: Counter[str] = Counter()
        self._things: dict[str, Thing] = {}
        # One look for all that shall match: doors of cabinets, worktops.
        self._style = int(rng.integers(2**31))
        for piece, kind in read_kinds().items():
            if splits[piece] == split and piece in library:
                self._pieces.setdefault(kind.kind, []).append(library[piece])
        self.full = bool(library)
        # Whether the units of the kitchen are made by rule: all of them or none.
        mine = all(self.makes(k) for k in KITCHEN)
        self.kitchen_made = mine and (bool(rng.random() < 0.6) or not set(KITCHEN) <= set(self._pieces))

    def has(self, kind: str) -> bool:
        """Whether the split has things of that kind."""
        return kind in self._pieces or self.makes(kind)

    def makes(self, kind: str) -> bool:
        """Whether things of that kind can be made by rule for this split."""
        return kind in GENERATORS and KEPT_FOR.get(kind, self._split) == self._split

    def get(
        self,
        *kinds: str,
        width: float = 9.0,
        depth: float = 9.0,
        height: float = 9.0,
        fresh: bool = False,
        made: bool | None = None,
        match: bool = False,
    ) -> Thing | None:
        """A thing of one of the kinds, no larger than the given size, m.

        Parameters
        ----------
        fresh : bool
            None whose library piece is in the home already, or whose kind is there often enough.
        made : bool or None
            True: only made by rule. False: only from the library. None: either.
        match : bool
            In the one style of this home, as the units of a kitchen.
        """
        kinds = tuple(k for k in kinds if self.has(k))
        limits = Limits(width, depth, height)
        for k in self._rng.permutation(len(kinds)).tolist():
            kind = kinds[k]
            if fresh and self._kinds_used[kind] >= OFTEN:
                continue
            fitting = [p for p in self._pieces.get(kind, []) if np.all(p.size <= (width, height, depth))]
            if fresh:
                fitting = [p for p in fitting if p.id not in self._uses]
            share = LIBRARY_SHARE[min(len(fitting), 3)] if self.makes(kind) else 1.0
            first_made = made if made is not None else bool(self._rng.random() >= share)
            ways = (first_made, not first_made) if made is None else (made,)
            for by_rule in ways:
                thing = (
                    self._make(kind, limits, self._style if match else None) if by_rule else self._take(kind, fitting)
                )
                if thing is not None:
                    self._kinds_used[kind] += 1
                    return thing
        return None

    def again(self, seed: int, kind: str, width: float, depth: float, height: float) -> Thing | None:
        """A thing made by rule from a seed of the caller's: the same look at another size, as the curtains of a room."""
        return self._make(kind, Limits(width, depth, height), seed)

    def _take(self, kind: str, fitting: list[Piece]) -> Thing | None:
        if not fitting:
            return None
        least = min(self._uses.get(p.id, 0) for p in fitting)
        fitting = [p for p in fitting if self._uses.get(p.id, 0) == least]
        piece = fitting[int(self._rng.integers(len(fitting)))]
        self._uses[piece.id] = self._uses.get(piece.id, 0) + 1
        return self._thing(kind, piece)

    def _make(self, kind: str, limits: Limits, shared: int | None = None) -> Thing | None:
        if not self.makes(kind):
            return None
        for _ in range(3):
            seed = int(self._rng.integers(2**31)) if shared is None else shared
            # The split is in the seed, so no two splits make the same thing; what matches shares its first draws.
            words = [SPLITS.index(self._split), seed, *([zlib.crc32(kind.encode())] if shared is None else [])]
            made = GENERATORS[kind](np.random.default_rng(words), limits)
            if made is not None and np.all(
                made.model.size <= np.array([limits.width, limits.height, limits.depth]) + 1e-3
            ):
                attributes = {"colour": model_colour(made.model)} | made.attributes
                name = f"made/{kind}/{self._split}-{seed}"
                return Thing(kind, _pressed(kind, made.model), attributes, name, made.elevation, made.surface)
            if shared is not None:
                break
        return None

    def _thing(self, kind: str, piece: Piece) -> Thing:
        if piece.id not in self._things:
            model = _pressed(kind, _centred(load_model(piece)))
            attributes = {"colour": model_colour(model)} | read_kinds()[piece.id].attributes
            self._things[piece.id] = Thing(
                kind, model, attributes, piece.id, piece.elevation, piece.surface is not None, piece.credit
            )
        return self._things[piece.id]


def _pressed(kind: str, model: Model) -> Model:
    if kind not in FLAT or model.size[1] <= FLAT_HEIGHT:
        return model
    press = np.array([1.0, FLAT_HEIGHT / model.size[1], 1.0], np.float32)
    return replace(model, vertices=model.vertices * press)


def _centred(model: Model) -> Model:
    """Stood on y = 0 with its box centred in x and z: thinning moves the outermost vertices by up to a centimetre."""
    low, high = model.vertices.min(0), model.vertices.max(0)
    shift = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2], np.float32)
    return replace(model, vertices=model.vertices - shift)


def own(kind: str, model: Model, **attributes: str) -> Thing:
    """A thing made here and not taken from the library."""
    return Thing(kind, model, {"colour": model_colour(model)} | attributes)


def scaled(thing: Thing, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Thing:
    """A thing stretched a little along its axes, so that it fits in a row with others."""
    factors = np.array([x, y, z], np.float32)
    normals = thing.model.normals / factors
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.float32(1e-9))
    return replace(thing, model=replace(thing.model, vertices=thing.model.vertices * factors, normals=normals))
