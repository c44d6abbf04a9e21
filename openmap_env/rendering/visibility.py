"""Which batches of faces have to be drawn: those in the view frustum that nothing drawn so far hides for certain.

A guess is drawn; its depth picture then tells of every other box in the frustum whether it is hidden: it is if the nearest point
of the box is farther away than the farthest thing in each tile of the picture that the box may touch (Greene, Kass and Miller,
"Hierarchical Z-buffer visibility", 1993). What is not hidden is drawn as well. So the picture is that of the whole scene to the
last bit, whatever was guessed; a good guess only saves time. Guesses are remembered by place (``VisibleSets``): what was not hidden
from a place once is drawn at once there the next time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.rendering.geometry import Batches, Matrix
from openmap_scenes import PinholeCamera

TILE = 8
"""Pixels a side of a tile of the depth picture."""
SLACK, RELATIVE_SLACK = 1e-3, 1e-4
"""A box counts as hidden only if it lies this much, m and in parts of its depth, behind: far more than depth buffers round."""
CELL = 0.5
"""Places closer than this, m, share a remembered set."""
_SHELLS = np.square([*np.arange(0.25, 4.0, 0.25), 4.5, 5.0, 6.0, 8.0])
"""Squares of the distances, m, at which what is drawn front to back may begin with the first group anew."""
WIDER = 0.05
"""Boxes grown by this, m, stand for what other places of a cell see of them."""


@nb.njit(cache=True)
def in_frustum(low, high, T_clip_world, out):  # type: ignore[no-untyped-def]
    """Write the indices of the boxes that may show in the view frustum to ``out``, ascending; returns how many.

    A box is left out only if it lies wholly outside one of the six planes of clip space ``-w <= x, y, z <= w`` (Gribb and
    Hartmann 2001: each plane is a sum or difference of rows of the matrix).
    """
    planes = np.empty((6, 4))
    for k in range(3):
        for j in range(4):
            planes[k, j] = T_clip_world[3, j] + T_clip_world[k, j]
            planes[3 + k, j] = T_clip_world[3, j] - T_clip_world[k, j]
    count = 0
    for b in range(len(low)):
        inside = True
        for k in range(6):
            # The corner that lies farthest along the plane's normal decides.
            reach = planes[k, 3]
            for j in range(3):
                reach += planes[k, j] * (high[b, j] if planes[k, j] > 0.0 else low[b, j])
            if reach < 0.0:
                inside = False
                break
        if inside:
            out[count] = b
            count += 1
    return count


@nb.njit(cache=True)
def farthest_in_tiles(depth, out):  # type: ignore[no-untyped-def]
    """The farthest depth in each tile of a picture (H, W) m into ``out`` (ceil(H / TILE), ceil(W / TILE)); 0 = nothing = inf."""
    h, w = depth.shape
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            farthest = np.float32(0.0)
            for y in range(i * TILE, min((i + 1) * TILE, h)):
                for x in range(j * TILE, min((j + 1) * TILE, w)):
                    d = depth[y, x]
                    farthest = max(farthest, d if d > 0.0 else np.float32(np.inf))
            out[i, j] = farthest


@nb.njit(cache=True)
def is_hidden(low, high, T_clip_world, width, height, near, tiles):  # type: ignore[no-untyped-def]
    """Whether a box (3,), (3,) m lies behind everything that the tiles it may touch show; False where that is not certain."""
    left, right, top, bottom, nearest = np.inf, -np.inf, np.inf, -np.inf, np.inf
    for corner in range(8):
        x = high[0] if corner & 1 else low[0]
        y = high[1] if corner & 2 else low[1]
        z = high[2] if corner & 4 else low[2]
        w = T_clip_world[3, 0] * x + T_clip_world[3, 1] * y + T_clip_world[3, 2] * z + T_clip_world[3, 3]
        if w <= near:
            return False
        u = T_clip_world[0, 0] * x + T_clip_world[0, 1] * y + T_clip_world[0, 2] * z + T_clip_world[0, 3]
        v = T_clip_world[1, 0] * x + T_clip_world[1, 1] * y + T_clip_world[1, 2] * z + T_clip_world[1, 3]
        u, v = (0.5 * u / w + 0.5) * width, (0.5 * v / w + 0.5) * height
        left, right, top, bottom, nearest = min(left, u), max(right, u), min(top, v), max(bottom, v), min(nearest, w)
    # A pixel's margin: rasterisers round where edges fall.
    j_first, j_last = int(max(left - 1.0, 0.0)) // TILE, int(min(right + 1.0, width - 1.0)) // TILE
    i_first, i_last = int(max(top - 1.0, 0.0)) // TILE, int(min(bottom + 1.0, height - 1.0)) // TILE
    limit = nearest * (1.0 - RELATIVE_SLACK) - SLACK
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            if tiles[i, j] >= limit:
                return False
    return True


@nb.njit(cache=True)
def not_hidden(low, high, candidates, T_clip_world, width, height, near, tiles, out):  # type: ignore[no-untyped-def]
    """Write to ``out[b]`` for each candidate whether it may show; returns how many may."""
    count = 0
    for b in candidates:
        shows = not is_hidden(low[b], high[b], T_clip_world, width, height, near, tiles)
        out[b] = shows
        count += shows
    return count


@nb.njit(cache=True)
def gap_to(low, high, batches, position, out):  # type: ignore[no-untyped-def]
    """Squared distance from a position (3,) m to each of the boxes named, into ``out`` (n,)."""
    for k in range(len(batches)):
        square = 0.0
        for j in range(3):
            d = max(low[batches[k], j] - position[j], position[j] - high[batches[k], j], 0.0)
            square += d * d
        out[k] = square


@nb.njit(cache=True)
def gather(batches, starts, indices, out):  # type: ignore[no-untyped-def]
    """Copy the vertex indices of the batches, one after the other, to ``out``; returns how many there are."""
    count = 0
    for b in batches:
        first, last = 3 * starts[b], 3 * starts[b + 1]
        out[count : count + last - first] = indices[first:last]
        count += last - first
    return count


class Occlusion:
    """Which batches of a mesh a view has to draw.

    ``begin`` a view, ask for a ``guess``, draw it, ask what is ``missing`` by the depth picture, draw that too, until nothing is.

    Parameters
    ----------
    batches : Batches
    indices : (3F,) uint32
        Corners of the faces, batch after batch.
    """

    def __init__(self, batches: Batches, indices: npt.NDArray[np.uint32]) -> None:
        self._low, self._high = np.ascontiguousarray(batches.low), np.ascontiguousarray(batches.high)
        self._starts, self._group, self._indices = batches.starts, batches.group, indices
        self._faces = np.diff(batches.starts)
        self._n_groups = int(batches.group.max(initial=0)) + 1
        n = len(batches)
        self._found, self._gaps, self._shows = np.empty(n, np.int64), np.empty(n), np.zeros(n, bool)
        self._last, self._last_in_view = np.zeros(n, bool), np.zeros(n, bool)
        self.forget()
        self._gathered = np.empty(len(indices), np.uint32)
        self.in_view: npt.NDArray[np.int64] = self._found[:0]
        """Batches in the frustum of the view, ascending."""

    def __len__(self) -> int:
        return len(self._low)

    def forget(self) -> None:
        """Forget the view before."""
        self._last_position = np.full(3, np.inf)

    def begin(
        self, T_clip_world: Matrix, position: npt.NDArray[np.float64], camera: PinholeCamera, near: float
    ) -> None:
        """Look at the scene from a position (3,) m through a world-to-clip transform (4, 4)."""
        self._T_clip_world, self._position = np.ascontiguousarray(T_clip_world), np.ascontiguousarray(position)
        self._width, self._height, self._near = camera.width, camera.height, near
        self._tiles = np.empty((-(-camera.height // TILE), -(-camera.width // TILE)), np.float32)
        self.in_view = self._found[: in_frustum(self._low, self._high, self._T_clip_world, self._found)].copy()

    def guess(self, expected: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
        """The batches in view, ascending, to begin with: what showed in the view before, if that was from near by, and of what was
        not in that view what is expected (B,). All, where both say nothing.
        """
        if np.linalg.norm(self._position - self._last_position) <= 2.0 * CELL:
            return self.in_view[np.where(self._last_in_view, self._last, expected)[self.in_view]]
        return self.in_view[expected[self.in_view]] if expected.any() else self.in_view

    def widened(self, by: float) -> Occlusion:
        """The same batches with boxes that reach farther by so many m on all sides."""
        wider = copy(self)
        wider._low, wider._high = self._low - by, self._high + by
        return wider

    def missing(
        self, depth: npt.NDArray[np.float32], drawn: npt.NDArray[np.int64], nearest_faces: int = 0
    ) -> npt.NDArray[np.int64]:
        """The batches, ascending, that have to be drawn besides those that were, which gave a depth picture (H, W) m.

        With ``nearest_faces`` > 0 only the nearest of them, of about as many faces: they may hide the others.
        """
        farthest_in_tiles(depth, self._tiles)
        not_hidden(
            self._low, self._high, self.in_view, self._T_clip_world, self._width, self._height, self._near, self._tiles,
            self._shows,
        )  # fmt: skip
        candidates = self._shows.copy()
        candidates[drawn] = False
        more = self.in_view[candidates[self.in_view]]
        if nearest_faces and len(more):
            more = more[np.argsort(self._gap_to(more), kind="stable")]
            enough = int(np.searchsorted(np.cumsum(self._faces[more]), nearest_faces)) + 1
            more = np.sort(more[:enough])
        return more

    def remember(self, shows: npt.NDArray[np.bool_]) -> None:
        """Note in a set (B,), and for the next guess, what the finished view did not hide."""
        self._last[:], self._last_position = False, self._position
        self._last_in_view[:] = False
        self._last_in_view[self.in_view] = True
        showing = self.in_view[self._shows[self.in_view]]
        self._last[showing] = shows[showing] = True

    def gather(self, batches: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.uint32], list[tuple[int, int]]]:
        """The corners of the batches' faces in the order to draw them, and runs of them: a group and how many corners.

        Front to back, shell by shell of distance, so that groups take few runs. The order depends on nothing but the view and
        the batches.
        """
        gap, group = self._gap_to(batches), self._group[batches]
        run = np.searchsorted(_SHELLS, gap) * self._n_groups + group
        order = np.lexsort((batches, gap, run))
        n = gather(batches[order], self._starts, self._indices, self._gathered)
        corners = np.bincount(run, weights=3 * self._faces[batches]).astype(np.int64)
        return self._gathered[:n], [(r % self._n_groups, int(corners[r])) for r in np.flatnonzero(corners).tolist()]

    def _gap_to(self, batches: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        gap_to(self._low, self._high, batches, self._position, self._gaps)
        return self._gaps[: len(batches)]


class VisibleSets:
    """What was not hidden from where: a set of batches (B,) bool for each cell of ``CELL`` m in which a camera has been.

    Parameters
    ----------
    n_batches : int
    """

    def __init__(self, n_batches: int) -> None:
        self._n_batches = n_batches
        self._sets: dict[tuple[int, int, int], npt.NDArray[np.bool_]] = {}

    def at(self, position: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """The set of the cell that a position (3,) m is in, to be written to."""
        x, y, z = np.floor(position / CELL).astype(np.int64).tolist()
        if (x, y, z) not in self._sets:
            self._sets[x, y, z] = np.zeros(self._n_batches, bool)
        return self._sets[x, y, z]

    def to_arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """The cells (n, 3) and their sets, packed to bits (n, ceil(B / 8))."""
        cells = sorted(self._sets)
        packed = np.packbits(np.array([self._sets[c] for c in cells]).reshape(len(cells), self._n_batches), axis=1)
        return {"cells": np.array(cells, np.int64).reshape(-1, 3), "sets": packed}

    def add(self, arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
        """Add what ``to_arrays`` gave."""
        for cell, packed in zip(arrays["cells"], arrays["sets"], strict=True):
            shows = self.at((cell.astype(np.float64) + 0.5) * CELL)
            shows |= np.unpackbits(packed, count=self._n_batches).astype(bool)


def cells_of(places: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """The middles (n, 3) m of the cells that places (N, 3) m lie in, each once, at the height of one of its places."""
    cells, first = np.unique(np.floor(places / CELL).astype(np.int64), axis=0, return_index=True)
    middles = (cells + 0.5) * CELL
    middles[:, 1] = places[first, 1]
    return np.asarray(middles, np.float64)


def cube_camera(size: int = 128) -> PinholeCamera:
    """The camera of each of the six square views that together see everything around a place."""
    return PinholeCamera.from_hfov(size, size, 90.0)


def cube_poses(position: npt.NDArray[np.float64]) -> Iterator[Matrix]:
    """Camera-to-world transforms (4, 4) of those views: along -z, -x, +z, +x, down and up."""
    for right, up in (
        *(((1, 0, 0), (0, 1, 0)), ((0, 0, -1), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)), ((0, 0, 1), (0, 1, 0))),
        *(((1, 0, 0), (0, 0, -1)), ((1, 0, 0), (0, 0, 1))),
    ):
        T_world_camera = np.eye(4)
        T_world_camera[:3, :3] = np.stack([right, up, np.cross(right, up)], axis=1)
        T_world_camera[:3, 3] = position
        yield T_world_camera
