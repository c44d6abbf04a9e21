"""A home by seed: plan, shell, furniture, light, put together as one scene."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from openmap_scenes.errors import DataError
from openmap_scenes.homes.assemble import assemble
from openmap_scenes.homes.bodies import Body, meetings
from openmap_scenes.homes.furnish import furnish_room, missing
from openmap_scenes.homes.items import Item
from openmap_scenes.homes.kinds import SPLITS
from openmap_scenes.homes.placement import RoomSpace, turn_of
from openmap_scenes.homes.plan import Plan, make_plan
from openmap_scenes.homes.shell import Piece, build_shell
from openmap_scenes.homes.sight import drop_unseen
from openmap_scenes.homes.stock import Stock
from openmap_scenes.homes.walk import standing_places
from openmap_scenes.homes.wishes import NEEDS
from openmap_scenes.scene import Scene

# A home with less than this in a room, or with fewer kinds, looks as if people had moved out.
MIN_OBJECTS, MIN_KINDS = 7, 20


def build_home(rest: str) -> Scene:
    """The home that a catalogue spec names.

    Parameters
    ----------
    rest : str
        ``<split>/<number>``, as in "val/3" or "val/003"; splits are train, val and test and share no furniture.

    Raises
    ------
    DataError
        The spec is not of that form, or the furniture library is not installed.
    """
    split, slash, number = rest.partition("/")
    if not slash or split not in SPLITS or not number.isdecimal():
        raise DataError(f"home {rest!r}", f"{rest!r}", f"<split>/<number> with a split of {', '.join(SPLITS)}")
    return build_home_from_seed(split, int(number))


def build_home_from_seed(split: str, seed: int, folder: Path | None = None) -> Scene:
    """The home of a split and a seed: the same bytes for the same library, in every process.

    Parameters
    ----------
    split : "train", "val" or "test"
        Which furniture may be used.
    seed : int
        0 or more.
    folder : Path or None
        Of the furniture catalogues; None = ``OPENMAP_FURNITURE`` or where the Debian package puts them.
    """
    drawn = draw_home(split, seed, folder)
    return assemble(f"{split}-{seed:03d}", f"homes:{split}/{seed}", drawn.plan, drawn.shell, drawn.items, drawn.rng)


@dataclass(frozen=True)
class Drawn:
    """A furnished plan before it becomes a scene, and the generator for what is still to be drawn: the light."""

    plan: Plan
    shell: list[Piece]
    items: list[Item]
    rng: np.random.Generator


def draw_home(split: str, seed: int, folder: Path | None = None) -> Drawn:
    """Plan, shell and furniture of the home of a split and a seed; parameters as for ``build_home_from_seed``."""
    if split not in SPLITS or seed < 0:
        raise ValueError(f"split {split!r} and seed {seed}; expected one of {SPLITS} and a seed of 0 or more")
    key = int.from_bytes(hashlib.sha256(f"{split}/{seed}".encode()).digest()[:8], "big")
    for attempt in range(20):
        rng = np.random.default_rng([key, attempt])
        plan = make_plan(rng)
        stock = Stock(split, rng, folder)
        # A room that lacks a bed or a stove is drawn anew with its home, but not for ever.
        rooms = _furnished(plan, stock, rng, complete=attempt < 6)
        if rooms is None:
            continue
        items = [item for space in rooms for item in space.items]
        enough = 1.0 if stock.full else 0.5
        if len(items) < enough * MIN_OBJECTS * len(rooms) or len({i.thing.kind for i in items}) < enough * MIN_KINDS:
            continue
        places = standing_places(plan, items)
        if places is None:
            continue
        shell = build_shell(plan, rng, _counters(plan, items))
        return Drawn(plan, shell, drop_unseen(apart(items, shell), shell, places), rng)
    raise RuntimeError(f"no home for {split}/{seed} in 20 attempts: the furniture library may be incomplete")


def apart(items: list[Item], shell: list[Piece]) -> list[Item]:
    """The items without those that run into the building or into a larger item, and without what stands on those."""
    walls = [Body(piece.mesh.vertices, piece.mesh.faces) for piece in shell]
    bears = {id(item.support) for item in items}
    size = [(id(item) in bears, float(np.prod(item.high - item.low))) for item in items]
    gone: set[int] = set()
    for i, j in meetings([item.body for item in items], walls):
        if j >= len(items):
            gone.add(id(items[i]))
        elif not {id(items[i]), id(items[j])} & gone:
            gone.add(id(items[i] if size[i] < size[j] else items[j]))
    kept = []
    for item in items:
        if id(item) in gone or id(item.support) in gone:
            gone.add(id(item))
        else:
            kept.append(item)
    return kept


def _furnished(plan: Plan, stock: Stock, rng: np.random.Generator, complete: bool) -> list[RoomSpace] | None:
    """All rooms by their number, furnished from the most demanding kind on; None as soon as one of ``complete`` ones lacks."""
    rooms: dict[int, RoomSpace] = {}
    for room in sorted(range(len(plan.names)), key=lambda k: (-len(NEEDS[plan.kinds[k]]), k)):
        rooms[room] = furnish_room(plan, room, stock, rng, complete)
        if complete and missing(rooms[room], stock):
            return None
    return [rooms[room] for room in range(len(rooms))]


def _counters(plan: Plan, items: list[Item]) -> dict[int, set[int]]:
    """By kitchen, the walls (indices into its sides) that its stove and its sink stand against."""
    walls: dict[int, set[int]] = {}
    for item in items:
        if plan.kinds[item.room] == "kitchen" and item.thing.kind in ("stove", "kitchen sink"):
            turns = [abs(np.angle(np.exp(1j * (turn_of(s) - item.angle)))) for s in plan.sides(item.room)]
            walls.setdefault(item.room, set()).add(int(np.argmin(turns)))
    return walls
