"""What would be learned by looking from somewhere: the next-best-view count behind the choice of where to go.

Targets are cells that deserve a look: the edge of the known floor, and surfaces that were only seen from afar. A place is
worth the targets that lie within their reach of it and are not hidden by anything as tall as the camera; they are summed by
bearing, because a camera sees one side at a time. A frontier is a line across the floor: who looks along it, as from a
corridor past an open door, sees nothing of what lies beyond, so it counts for those in front of it.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from openmap_agents.exploration.occupancy import Cell

SECTORS = 24
_SECTOR = 2.0 * math.pi / SECTORS
EDGE_ON = 0.25
"""Cosine between the way to a target and the direction it faces away, below which it is seen edge-on."""


def gains_by_bearing(
    places: npt.NDArray[np.int64],
    targets: npt.NDArray[np.int64],
    weights: npt.NDArray[np.float32],
    reach: npt.NDArray[np.float32],
    opaque: npt.NDArray[np.bool_],
    resolution: float,
    beyond: npt.NDArray[np.float32] | None = None,
) -> npt.NDArray[np.float32]:
    """Weight of the targets in view from each place, by heading.

    Parameters
    ----------
    places, targets : (n, 2), (m, 2) int64
        Cells (row, column).
    weights, reach : (m,) float32
        What a look at each target is worth, and from how far at most it counts, m.
    opaque : (H, W) bool
        Cells that cannot be seen over.
    resolution : float
        Side of a cell, m.
    beyond : (m, 2) float32, optional
        Unit vectors (row, column) to what a look at each target is meant to show beyond it; 0 = from any side.

    Returns
    -------
    (n, SECTORS) float32
        Sector i is centred on the heading ``i * 2 pi / SECTORS`` (0 looks along -z, positive turns left).
    """
    return _gains(  # type: ignore[no-any-return]
        np.ascontiguousarray(places), np.ascontiguousarray(targets), weights, reach, opaque, resolution,
        _sided(beyond, len(targets)),
    )  # fmt: skip


def best_headings(
    gains: npt.NDArray[np.float32], width: int = 5
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float64]]:
    """The best single look of each place: its gain (n,) and its heading (n,) rad, over ``width`` neighbouring sectors (odd)."""
    half = width // 2
    shifted = {shift: np.roll(gains, shift, axis=1) for shift in range(-half, half + 1)}
    window = np.sum(list(shifted.values()), axis=0)
    # Of headings that show about as much, the one with the targets in the middle of the picture.
    centred = np.sum([turned / (1 + abs(shift)) for shift, turned in shifted.items()], axis=0)
    best = np.argmax(window + 0.05 * centred, axis=1)
    return np.asarray(window[np.arange(len(gains)), best], np.float32), best * _SECTOR


def in_view(
    place: Cell,
    heading: float,
    targets: npt.NDArray[np.int64],
    reach: npt.NDArray[np.float32],
    nearest: float,
    half_angle: float,
    opaque: npt.NDArray[np.bool_],
    resolution: float,
    beyond: npt.NDArray[np.float32] | None = None,
) -> npt.NDArray[np.bool_]:
    """Which targets (m,) a camera at a place sees: ``nearest`` m or more away, within ``half_angle`` rad of its heading."""
    return _in_view(  # type: ignore[no-any-return]
        place[0], place[1], heading, np.ascontiguousarray(targets), reach, nearest, half_angle, opaque, resolution,
        _sided(beyond, len(targets)),
    )  # fmt: skip


def sees(place: Cell, target: Cell, opaque: npt.NDArray[np.bool_]) -> bool:
    """Whether nothing tall stands on the line between two cells; the last two cells before the target are left out."""
    return bool(_sees(place[0], place[1], target[0], target[1], opaque))


def _sided(beyond: npt.NDArray[np.float32] | None, n: int) -> npt.NDArray[np.float32]:
    return np.zeros((n, 2), np.float32) if beyond is None else np.ascontiguousarray(beyond, np.float32)


@numba.njit(cache=True)
def _edge_on(dr, dc, beyond_row, beyond_column):  # type: ignore[no-untyped-def]
    """Whether a target (dr, dc) cells away is looked at along its edge, or from beyond it; near ones never are."""
    away = math.sqrt(dr * dr + dc * dc)
    if (beyond_row == 0.0 and beyond_column == 0.0) or away < 3.0:
        return False
    return dr * beyond_row + dc * beyond_column < EDGE_ON * away


@numba.njit(cache=True)
def _sees(row, column, target_row, target_column, opaque):  # type: ignore[no-untyped-def]
    """Whether nothing tall stands between two cells, their ends (2 cells, since walls are thick in a raster) left out."""
    steps = max(abs(target_row - row), abs(target_column - column))
    for i in range(1, steps - 2):
        t = i / steps
        r = math.floor(row + t * (target_row - row) + 0.5)
        c = math.floor(column + t * (target_column - column) + 0.5)
        if opaque[r, c]:
            return False
    return True


@numba.njit(cache=True)
def _gains(places, targets, weights, reach, opaque, resolution, beyond):  # type: ignore[no-untyped-def]
    out = np.zeros((len(places), SECTORS), np.float32)
    for i in range(len(places)):
        row, column = places[i]
        for j in range(len(targets)):
            dr, dc = targets[j, 0] - row, targets[j, 1] - column
            if (dr * dr + dc * dc) * resolution * resolution > reach[j] * reach[j]:
                continue
            if _edge_on(dr, dc, beyond[j, 0], beyond[j, 1]):
                continue
            if not _sees(row, column, targets[j, 0], targets[j, 1], opaque):
                continue
            sector = math.floor(math.atan2(-dc, -dr) / _SECTOR + 0.5) % SECTORS
            out[i, sector] += weights[j]
    return out


@numba.njit(cache=True)
def _in_view(row, column, heading, targets, reach, nearest, half_angle, opaque, resolution, beyond):  # type: ignore[no-untyped-def]
    out = np.zeros(len(targets), np.bool_)
    for j in range(len(targets)):
        dr, dc = targets[j, 0] - row, targets[j, 1] - column
        distance = math.sqrt(dr * dr + dc * dc) * resolution
        if distance > reach[j] or distance < nearest or _edge_on(dr, dc, beyond[j, 0], beyond[j, 1]):
            continue
        off = math.atan2(-dc, -dr) - heading
        off = math.atan2(math.sin(off), math.cos(off))
        out[j] = abs(off) <= half_angle and _sees(row, column, targets[j, 0], targets[j, 1], opaque)
    return out
