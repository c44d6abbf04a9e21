"""Small gaps in a floor are walked over: holes of scans, and slivers between the floors of two rooms.

A gap is a run of columns, in x or in z, between two places to stand of about one height, that holds neither floor nor obstacle at
that height; or whose floor is there, but too rough to be walkable by its faces (the noise of a scan). A gap wider than
``MAX_GAP`` stays one: a ledge, a stairwell.
"""

from __future__ import annotations

import numba as nb
import numpy as np
import numpy.typing as npt

from openmap_env.navigation.cells import Body
from openmap_env.navigation.heightfield import Grid, Spans

MAX_GAP = 0.15
"""Metres. A foot is longer."""


def close_gaps(spans: Spans, grid: Grid, body: Body) -> Spans:
    """The spans with a floor of no thickness in each gap, and with rough floors between walkable ones made walkable."""
    widest = round(MAX_GAP / grid.cell)
    for stride in (1, grid.nx):
        walkable, column, height = _bridge(
            spans.start, spans.low, spans.high, spans.walkable, grid.nx, stride, widest, body.step_height, body.height
        )
        spans = _with_floors(Spans(spans.start, spans.low, spans.high, walkable), column, height)
    return spans


def _with_floors(spans: Spans, column: npt.NDArray[np.int64], height: npt.NDArray[np.float64]) -> Spans:
    """The spans and walkable ones of no thickness at a height in a column, one of those that are nearly the same."""
    if len(column) == 0:
        return spans
    n_columns = len(spans.start) - 1
    of = np.concatenate([np.repeat(np.arange(n_columns), np.diff(spans.start)), column])
    low, high = np.concatenate([spans.low, height]), np.concatenate([spans.high, height])
    walkable = np.concatenate([spans.walkable, np.ones(len(column), bool)])
    order = np.lexsort((low, of))
    start = np.concatenate([np.zeros(1, np.int64), np.cumsum(np.bincount(of, minlength=n_columns))])
    return Spans(start, low[order], high[order], walkable[order])


@nb.njit(cache=True)
def _at(start, low, high, column, y, step_height):  # type: ignore[no-untyped-def]
    """What a column holds about height y: the span whose top is at most a step off, -1 for nothing, -2 for an obstacle."""
    found = -1
    for i in range(start[column], start[column + 1]):
        if high[i] >= y - step_height and low[i] <= y + step_height:
            if high[i] > y + step_height:
                return -2
            found = i
    return found


@nb.njit(cache=True)
def _bridge(start, low, high, walkable, nx, stride, widest, step_height, room):  # type: ignore[no-untyped-def]
    """Which spans are walkable now, and the columns and heights of new floors, each once, along one direction of the grid."""
    out = walkable.copy()
    columns, heights = [np.int64(0) for _ in range(0)], [0.0 for _ in range(0)]
    n_columns = len(start) - 1
    for c in range(n_columns):
        for i in range(start[c], start[c + 1]):
            if not walkable[i] or (i + 1 < start[c + 1] and low[i + 1] - high[i] < room):
                continue
            y = high[i]
            for k in range(1, widest + 2):
                e = c + k * stride
                # Columns are numbered along x: a run in x ends with its row.
                if e >= n_columns or (stride == 1 and e // nx != c // nx):
                    break
                beyond = _at(start, low, high, e, y, step_height)
                if beyond == -2:
                    break
                if beyond < 0 or not walkable[beyond]:
                    continue
                for m in range(1, k):
                    height = y + (high[beyond] - y) * m / k
                    rough = _at(start, low, high, c + m * stride, height, step_height)
                    if rough >= 0:
                        out[rough] = True
                    elif rough == -1:
                        columns.append(np.int64(c + m * stride))
                        heights.append(height)
                break
    return out, np.array(columns, np.int64), np.array(heights, np.float64)
