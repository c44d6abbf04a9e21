"""What a real camera does to a rendered picture: exposure, white balance, blur, noise; depth with error, steps and holes.

Depth follows structured-light and stereo cameras: a triangulating sensor errs by a constant in disparity, so by z^2 in depth
(Khoshelham and Elberink, Sensors 12(2), 2012; Nguyen et al., 3DIMPVT 2012), in steps of its disparity, and sees nothing at
depth edges, at grazing surfaces and beyond its range (Barron and Malik, CVPR 2013, shift the picture as well, as here).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class SensorNoise:
    """Strengths of the model; every picture draws its own between nothing and these.

    Parameters
    ----------
    exposure : float
        Largest gain, in powers of two; darker by as much.
    white_balance : float
        Largest relative gain of red and of blue.
    noise : float
        Largest standard deviation of a channel, of 255.
    blur : int
        Longest motion blur, px of a picture of 640.
    depth : float
        Error of depth at 1 m, m; grows with the square.
    shift : float
        Standard deviation with which depth edges wander, px.
    range : (float, float)
        Nearest and farthest depth that is measured, m.
    ideal_share : float
        Share of pictures whose depth stays as rendered.
    """

    exposure: float = 0.7
    white_balance: float = 0.15
    noise: float = 6.0
    blur: int = 9
    depth: float = 0.0025
    shift: float = 0.6
    range: tuple[float, float] = (0.25, 8.0)
    ideal_share: float = 0.4

    def __call__(
        self, rgb: npt.NDArray[np.uint8], depth: npt.NDArray[np.float32], rng: np.random.Generator
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """Picture (H, W, 3) uint8 and planar depth (H, W) m as the camera would give them."""
        return self.colour(rgb, rng), self.distance(depth, rng)

    def colour(self, rgb: npt.NDArray[np.uint8], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
        """The picture with another exposure and white balance, blurred by motion now and then, with noise."""
        gain = 2.0 ** rng.uniform(-self.exposure, self.exposure) * np.ones(3)
        gain[[0, 2]] *= 1.0 + rng.uniform(-self.white_balance, self.white_balance, 2)
        levels = np.arange(256) / 255.0
        # Sensors add up light; the picture holds its 2.2th root.
        table = 255.0 * (levels[:, None] ** 2.2 * gain).clip(0, 1) ** (1 / 2.2)
        out = cv2.LUT(rgb, table.astype(np.uint8)[None])
        if rng.random() < 0.25:
            out = self._moved(out, rng)
        strength = rng.uniform(0, self.noise)
        grain = rng.standard_normal(rgb.shape[:2], np.float32)[..., None] * strength
        return np.asarray((out + grain).clip(0, 255), np.uint8)

    def _moved(self, rgb: npt.NDArray[np.uint8], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
        length = int(rng.integers(2, max(3, round(self.blur * rgb.shape[1] / 640) + 1)))
        kernel = np.zeros((length, length), np.float32)
        angle = rng.uniform(0, np.pi)
        half = (length - 1) / 2
        ends = [np.array([half, half]) + s * half * np.array([np.cos(angle), np.sin(angle)]) for s in (-1, 1)]
        first, last = ((round(float(e[0])), round(float(e[1]))) for e in ends)
        cv2.line(kernel, first, last, 1.0)  # type: ignore[call-overload,unused-ignore]
        return np.asarray(cv2.filter2D(rgb, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE), np.uint8)

    def distance(self, depth: npt.NDArray[np.float32], rng: np.random.Generator) -> npt.NDArray[np.float32]:
        """Depth with error, steps and holes; a share of the pictures keeps what was rendered."""
        if rng.random() < self.ideal_share:
            return depth
        h, w = depth.shape
        shift = rng.uniform(0, self.shift)
        v, u = np.mgrid[:h, :w].astype(np.float32)
        wander = [cv2.resize(rng.standard_normal((h // 2 + 1, w // 2 + 1), np.float32), (w, h)) for _ in (0, 1)]
        z = cv2.remap(
            depth, u + shift * wander[0], v + shift * wander[1], cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE
        )
        strength = rng.uniform(0.2, 1.0) * self.depth
        coarse = cv2.resize(rng.standard_normal((h // 4 + 1, w // 4 + 1), np.float32), (w, h))
        with np.errstate(divide="ignore"):
            disparity = np.where(z > 0, 1.0 / z, 0.0)
        # An error in 1/z of e is one of e z^2 in z.
        disparity += strength * np.where(z > 0, coarse, 0.0)
        step = strength * rng.uniform(0.3, 1.0)
        disparity = np.round(disparity / step) * step
        with np.errstate(divide="ignore"):
            z = np.where(disparity > 1e-3, 1.0 / disparity, 0.0).astype(np.float32)
        near, far = self.range[0], self.range[1] * rng.uniform(0.7, 1.3)
        z[(z < near) | (z > far)] = 0
        return np.asarray(np.where(self._unseen(depth, rng), 0, z), np.float32)

    @staticmethod
    def _unseen(depth: npt.NDArray[np.float32], rng: np.random.Generator) -> npt.NDArray[np.bool_]:
        """Where a sensor sees nothing: at edges of depth as wide as its shadow, and in blots (black or shiny surfaces)."""
        h, w = depth.shape
        edge = (cv2.morphologyEx(depth, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0.08 * depth).astype(np.uint8)
        width = int(rng.integers(0, 4)) * max(1, w // 320)
        holes = cv2.dilate(edge, np.ones((1, width + 1), np.uint8)).astype(bool) if width else np.zeros((h, w), bool)
        field = cv2.resize(rng.standard_normal((7, 9), np.float32), (w, h), interpolation=cv2.INTER_CUBIC)
        return np.asarray(holes | (field > rng.uniform(1.6, 3.0)), bool)
