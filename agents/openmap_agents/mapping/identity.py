"""Who is who over the life of a map: ids that stay, and a log that says what became of each id that was ever given.

The log is a table of rows (moment, id, other, kind), int32, to which rows are only ever added:

======  =========  ==========================================================================================
kind    name       meaning
======  =========  ==========================================================================================
1       BORN       ``id`` is given to something that was in no earlier instance; ``other`` is 0
2       SPLIT      ``id`` is given to a part of ``other`` that is now an instance of its own
3       JOINED     ``id`` is now part of ``other``; for good
4       GONE       the masks of ``id`` make no instance any more; ``other`` is 0
5       BACK       they do again; ``other`` is 0
======  =========  ==========================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping.voxel_store import grown

IntArray = npt.NDArray[np.int32]

BORN, SPLIT, JOINED, GONE, BACK = 1, 2, 3, 4, 5


class History:
    """What the log says.

    Parameters
    ----------
    rows : (L, 4) int32
        See the module.

    Raises
    ------
    ValueError
        No life of a map could have written these rows.
    """

    def __init__(self, rows: npt.ArrayLike) -> None:
        table = np.asarray(rows)
        if table.ndim != 2 or table.shape[1] != 4 or table.dtype.kind not in "iu":
            raise ValueError(
                f"the history has shape {table.shape} and type {table.dtype}, expected (L, 4) whole numbers"
            )
        self.rows = table

    @cached_property
    def _heir(self) -> dict[int, int]:
        """Of every id that was ever given: itself while it is there, 0 while it is gone, else the id that it is part of."""
        heir: dict[int, int] = {}
        latest = -1
        for number, (moment, own, other, kind) in enumerate(self.rows.tolist()):
            if kind in (BORN, SPLIT):
                # A part may come from an instance that is gone meanwhile, not from one that is in another.
                fits = own > 0 and own not in heir and (other == 0 if kind == BORN else heir.get(other) in (0, other))
                becomes = own
            elif kind == JOINED:
                fits = heir.get(own) in (0, own) and other != own and heir.get(other) == other
                becomes = other
            elif kind == GONE:
                fits, becomes = heir.get(own) == own and other == 0, 0
            else:
                fits, becomes = kind == BACK and heir.get(own) == 0 and other == 0, own
            if not fits or moment < latest:
                raise ValueError(
                    f"row {number} of the history, {(moment, own, other, kind)}, cannot follow those before it"
                )
            latest = moment
            heir[own] = becomes
        return heir

    def check(self) -> None:
        """ValueError where a row cannot follow those before it."""
        _ = self._heir

    @property
    def alive(self) -> list[int]:
        """Ids that are instances now, ascending."""
        return sorted(own for own, heir in self._heir.items() if own == heir)

    def resolve(self, instance_id: int) -> int | None:
        """The id that the instance goes by now: its own, or that of what it became part of; None if it is gone.

        Raises
        ------
        KeyError
            The id was never given.
        """
        if instance_id not in self._heir:
            raise KeyError(f"the map never had an instance {instance_id}")
        own = instance_id
        # A row names an id that is there at that moment, so a chain goes forward in time and ends.
        while (heir := self._heir[own]) not in (0, own):
            own = heir
        return own if heir else None

    def holders(self, instance_id: int) -> list[int]:
        """Ids, ascending, of all instances that hold something of it now: ``resolve`` and what was split from it."""
        self.resolve(instance_id)
        holding = {instance_id}
        for _, own, other, kind in self.rows.tolist():
            if kind == SPLIT and other in holding:
                holding.add(own)
            elif kind == JOINED and own in holding:
                holding.add(other)
        return sorted(own for own in holding if self._heir[own] == own)


class Identities:
    """Gives instances their ids, each time the map is made anew, and keeps the log.

    An instance keeps the id of the earlier one of which it has most, in voxels of masks; of the parts of one that fell apart, the
    largest keeps it. What an earlier instance was is what its masks are, so an id that is gone comes back when most of its masks
    make an instance again, and never for another thing. The same calls give the same ids; asking for the map more or less often
    may give other ones, since it is the maps that were made that are compared.

    A call costs as much as a few passes over the masks of the instances and one over the sizes of all masks.
    """

    def __init__(self) -> None:
        self._owner: IntArray = np.zeros(256, np.int32)
        """(S,) id of the instance that a mask is in, or was in last; 0 = never in one."""
        self._alive: npt.NDArray[np.bool_] = np.zeros(64, np.bool_)
        """By id: whether it is an instance now."""
        self._next_id = 1
        self._moment = 0
        self._rows: IntArray = np.empty((64, 4), np.int32)
        self._n_rows = 0

    @property
    def history(self) -> IntArray:
        """The log so far (L, 4); later calls add to it and change nothing of it."""
        rows = self._rows[: self._n_rows]
        rows.flags.writeable = False
        return rows

    def assign(
        self, members: Sequence[npt.NDArray[np.integer]], size: npt.NDArray[np.integer], moment: int
    ) -> list[int]:
        """Ids of the instances of a new map.

        Parameters
        ----------
        members : sequence of (n,) int
            The masks of each instance, at least one, by number; no mask is in two.
        size : (S,) int
            Voxels of every mask.
        moment : int
            Goes into the log; no lower than before.

        Returns
        -------
        list of int
            One for each instance; new ids ascend.

        Raises
        ------
        ValueError
            The members or the moment cannot be; nothing was changed.
        """
        flat, piece = _flattened(members, len(size))
        if moment < self._moment:
            raise ValueError(f"moment {moment} after moment {self._moment}, expected none that is earlier")
        self._moment = moment
        self._owner = grown(self._owner, len(size))
        # A mask without voxels still counts for something, so that what has masks has weight.
        weight = np.maximum(size, 1).astype(np.float64)
        owned = _sums(self._owner[: len(size)], weight, self._next_id)
        old, of_piece, share = self._claims(flat, piece, weight[flat], len(members))
        ids = np.zeros(len(members), np.int32)
        taken = np.zeros(self._next_id, np.bool_)
        # What is gone comes back only as the greater part of what it was.
        valid = self._alive[old] | (2 * share > owned[old])
        order = np.lexsort((of_piece, old, -share))
        for known, p in zip(old[order[valid[order]]].tolist(), of_piece[order[valid[order]]].tolist(), strict=True):
            if ids[p] == 0 and not taken[known]:
                ids[p], taken[known] = known, True
        self._name_new(ids, old[order], of_piece[order], moment)
        self._settle(ids, taken, owned, old[order], of_piece[order], share[order], moment)
        self._owner[flat] = ids[piece]
        return [int(i) for i in ids]

    def _claims(
        self, flat: npt.NDArray[np.int64], piece: npt.NDArray[np.int64], weight: npt.NDArray[np.float64], n_pieces: int
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Earlier ids, the new instances that have masks of them, and the voxels of those masks."""
        owner = self._owner[flat].astype(np.int64)
        known = owner > 0
        pairs, inverse = np.unique(owner[known] * n_pieces + piece[known], return_inverse=True)
        share = _sums(inverse, weight[known], len(pairs))
        return pairs // max(n_pieces, 1), pairs % max(n_pieces, 1), share

    def _name_new(
        self, ids: IntArray, old: npt.NDArray[np.int64], of_piece: npt.NDArray[np.int64], moment: int
    ) -> None:
        """Give new ids where there is none yet; the claims come with the largest share first."""
        source = np.zeros(len(ids), np.int64)
        source[of_piece[::-1]] = old[::-1]
        new = np.flatnonzero(ids == 0)
        ids[new] = self._next_id + np.arange(len(new))
        self._next_id += len(new)
        self._alive = grown(self._alive, self._next_id)
        self._alive[ids[new]] = True
        self._log(moment, ids[new], source[new], np.where(source[new] > 0, SPLIT, BORN))

    def _settle(
        self,
        ids: IntArray,
        taken: npt.NDArray[np.bool_],
        owned: npt.NDArray[np.float64],
        old: npt.NDArray[np.int64],
        of_piece: npt.NDArray[np.int64],
        share: npt.NDArray[np.float64],
        moment: int,
    ) -> None:
        """Log what is back, what is part of another now and what is gone; the claims come with the largest share first."""
        n = len(taken)
        back = np.flatnonzero(taken & ~self._alive[:n])
        self._log(moment, back, 0, BACK)
        self._alive[back] = True
        held = _sums(old, share, n)
        joined = np.flatnonzero(~taken & (2 * held > owned))
        heir = np.zeros(n, np.int64)
        heir[old[::-1]] = ids[of_piece[::-1]]
        self._log(moment, joined, heir[joined], JOINED)
        becomes = np.arange(n, dtype=np.int32)
        becomes[joined] = heir[joined]
        if len(joined):
            # Masks of it that are in no instance now are from here on masks of what it is part of.
            self._owner = becomes[self._owner]
        absent = ~taken & self._alive[:n]
        self._alive[:n][absent] = False
        absent[joined] = False
        self._log(moment, np.flatnonzero(absent), 0, GONE)

    def _log(self, moment: int, own: npt.ArrayLike, other: npt.ArrayLike, kind: npt.ArrayLike) -> None:
        rows = np.stack(np.broadcast_arrays(moment, own, other, kind), axis=-1).reshape(-1, 4)
        end = self._n_rows + len(rows)
        self._rows = grown(self._rows, end)
        self._rows[self._n_rows : end] = rows
        self._n_rows = end


def _flattened(
    members: Sequence[npt.NDArray[np.integer]], n_masks: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """All members one after the other, and whose each is."""
    lengths = np.array([len(m) for m in members], np.int64)
    flat = np.concatenate([np.empty(0, np.int64), *members]).astype(np.int64)
    if (lengths == 0).any() or ((flat < 0) | (flat >= n_masks)).any():
        raise ValueError(f"an instance without masks or with masks outside 0..{n_masks - 1}")
    if np.bincount(flat, minlength=1).max() > 1:
        raise ValueError(f"mask {np.bincount(flat).argmax()} in two instances, expected each in one")
    return flat, np.repeat(np.arange(len(members)), lengths)


def _sums(group: npt.NDArray[np.integer], values: npt.NDArray[np.float64], n: int) -> npt.NDArray[np.float64]:
    """Sums (n,) of the values of each group; whole numbers, so exact."""
    return np.asarray(np.bincount(group, weights=values, minlength=n), np.float64)
