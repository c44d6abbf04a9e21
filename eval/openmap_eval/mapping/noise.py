"""What goes wrong on a real robot: depth errors and holes, poses that drift and shake, frames lost or out of order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from openmap_eval.mapping.inputs import MapperFrame

_WINDOW = 1.5
"""Over so many px depth errors are alike, as in what matches patches or averages light."""
_HOLE = 8.0


@dataclass(frozen=True)
class Trouble:
    """How bad each of it is. All zero, the default, changes nothing.

    Parameters
    ----------
    depth_sigma : float
        Standard error of depth at 1 m, m; it grows with the square of depth, as that of stereo and structured light does.
    holes : float
        Share of the picture without depth, in blobs of some 20 px of a 640 px wide picture.
    drift, drift_deg : float
        Standard deviation of the pose error, m and degrees along each axis, that a random walk has at the last frame.
    jitter, jitter_deg : float
        The same, drawn for each frame anew.
    keep_every : int
        Frames between are lost.
    shuffle : int
        0 = in order; any other number seeds a random order.
    """

    depth_sigma: float = 0.0
    holes: float = 0.0
    drift: float = 0.0
    drift_deg: float = 0.0
    jitter: float = 0.0
    jitter_deg: float = 0.0
    keep_every: int = 1
    shuffle: int = 0

    def __post_init__(self) -> None:
        for name in ("depth_sigma", "drift", "drift_deg", "jitter", "jitter_deg"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, expected at least 0")
        if not 0 <= self.holes < 1 or self.keep_every < 1:
            raise ValueError(f"holes {self.holes}, keep_every {self.keep_every}; expected 0 to 1, and at least 1")


def troubled(frames: Iterable[MapperFrame], n_frames: int, trouble: Trouble, seed: int) -> Iterator[MapperFrame]:
    """The frames as they come from a robot in trouble; each kind has a stream of random numbers of its own."""
    drift = wandering(n_frames, trouble.drift, trouble.drift_deg, np.random.default_rng([seed, 11]))
    jitter = shaking(n_frames, trouble.jitter, trouble.jitter_deg, np.random.default_rng([seed, 12]))
    kept: list[MapperFrame] = []
    for n, (depth, labels, features, T_world_camera) in enumerate(frames):
        if n % trouble.keep_every:
            continue
        depth = noisy_depth(depth, trouble.depth_sigma, trouble.holes, np.random.default_rng([seed, 13, n]))
        frame = depth, labels, features, T_world_camera @ drift[n] @ jitter[n]
        if trouble.shuffle:
            kept.append(frame)
        else:
            yield frame
    order = np.random.default_rng([seed, 14, trouble.shuffle]).permutation(len(kept))
    yield from (kept[k] for k in order)


def noisy_depth(
    depth: npt.NDArray[np.float32], sigma: float, holes: float, rng: np.random.Generator
) -> npt.NDArray[np.float32]:
    """Depth (H, W) m with errors of ``sigma * depth ** 2`` and holes; 0 stays 0."""
    error, blobs = (rng.standard_normal(depth.shape, np.float32) for _ in range(2))
    out = depth
    if sigma > 0:
        out = np.where(depth > 0, np.maximum(depth + sigma * depth**2 * _smooth(error, _WINDOW), 1e-3), 0)
    if holes > 0:
        field = _smooth(blobs, _HOLE * depth.shape[1] / 640)
        out = np.where(field < np.quantile(field, holes), 0, out)
    return np.asarray(out, np.float32)


def _smooth(white: npt.NDArray[np.float32], radius: float) -> npt.NDArray[np.float32]:
    """White noise blurred, of unit variance again."""
    blurred = cv2.GaussianBlur(white, (0, 0), max(radius, 0.3), borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred / max(float(blurred.std()), 1e-12), np.float32)


def wandering(n: int, metres: float, degrees: float, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """Errors (n, 4, 4) T_camera_estimate that grow as a random walk from none at the first frame."""
    steps = rng.standard_normal((n, 6)) / np.sqrt(max(n - 1, 1))
    steps[:1] = 0
    return _motions(np.cumsum(steps, axis=0), metres, degrees)


def shaking(n: int, metres: float, degrees: float, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """Errors (n, 4, 4) T_camera_estimate, each frame's its own."""
    return _motions(rng.standard_normal((n, 6)), metres, degrees)


def _motions(amounts: npt.NDArray[np.float64], metres: float, degrees: float) -> npt.NDArray[np.float64]:
    """Shifts and turns (n, 4, 4) of amounts (n, 6) times metres and degrees."""
    out = np.tile(np.eye(4), (len(amounts), 1, 1))
    for T, amount in zip(out, amounts, strict=True):
        T[:3, :3] = cv2.Rodrigues(amount[3:] * np.deg2rad(degrees))[0]
        T[:3, 3] = amount[:3] * metres
    return out
