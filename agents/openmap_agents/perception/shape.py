"""How big a region is, how high it hangs and how flat it is: what gravity-aligned depth says of a thing without its looks."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.surface import Surface

N_SHAPE = 16
_FEWEST = 4


def _row(points: npt.NDArray[np.float64], normals: npt.NDArray[np.float64], floor: float) -> npt.NDArray[np.float64]:
    """Features (N_SHAPE - 2,) of points (n, 3) relative to the camera and their normals (n, 3), Y up."""
    low, high = np.quantile(points[:, 1], [0.02, 0.98]) - floor
    flat = points[:, [0, 2]] - points[:, [0, 2]].mean(0)
    _, axes = np.linalg.eigh(flat.T @ flat)
    short, long = (np.subtract(*np.quantile(flat @ axes[:, k], [0.98, 0.02])) for k in (0, 1))
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points.T)), 0.0))
    distance = float(np.linalg.norm(points.mean(0)))
    up = normals[:, 1]
    return np.array(
        [
            low,
            high,
            (low + high) / 2,
            np.log(high - low + 0.02),
            np.log(long + 0.02),
            np.log(short + 0.02),
            np.log((long + 0.02) / (high - low + 0.02)),
            np.log(spread[0] + 0.005),
            spread[0] / (spread[2] + 0.01),
            float((up > 0.9).mean()),
            float((np.abs(up) < 0.2).mean()),
            float(up.mean()),
            float(np.linalg.norm(normals.mean(0))),
            np.log(distance + 0.1),
        ]
    )


def shape_features(surface: Surface, masks: Masks) -> npt.NDArray[np.float32]:
    """What the working picture says of each mask 1..n, (n, N_SHAPE) float32; a mask without depth gets a row of zeros."""
    offset, step = surface.step // 2, surface.step
    labels = masks.labels[offset::step, offset::step]
    border = np.zeros(labels.shape, bool)
    border[[0, -1]] = border[:, [0, -1]] = True
    seen = surface.depth > 0
    out = np.zeros((len(masks), N_SHAPE), np.float32)
    order = np.argsort(labels, axis=None, kind="stable")
    starts = np.searchsorted(labels.ravel()[order], np.arange(1, len(masks) + 2))
    points, normals = surface.points.reshape(-1, 3), surface.normals.reshape(-1, 3)
    for k in range(len(masks)):
        every = order[starts[k] : starts[k + 1]]
        pixels = every[seen.ravel()[every]]
        if len(pixels) < _FEWEST:
            continue
        distance = np.median(surface.depth.ravel()[pixels])
        out[k, :-2] = _row(points[pixels].astype(np.float64), normals[pixels].astype(np.float64), surface.floor)
        out[k, -2] = np.log(len(pixels) * float(distance) ** 2 / labels.size + 1e-4)
        out[k, -1] = border.ravel()[every].sum() / np.sqrt(len(every))
    return out
