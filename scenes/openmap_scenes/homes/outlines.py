"""Outlines and ways that solids are made along: ovals, rounded rectangles, arcs, bends."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Triple = tuple[float, float, float]
Floats = npt.NDArray[np.float64]


def oval(a: float, b: float, sides: int = 32, power: float = 2.0) -> Floats:
    """Outline (sides, 2) of a superellipse with half axes a, b m: power 2 an ellipse, 4 a rounded rectangle."""
    phi = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    c, s = np.cos(phi), np.sin(phi)
    return np.stack([a * np.sign(c) * np.abs(c) ** (2 / power), b * np.sign(s) * np.abs(s) ** (2 / power)], 1)


def rounded_outline(a: float, b: float, radius: float, segments: int = 4, step: float = 9.0) -> Floats:
    """Outline (N, 2) of a rectangle of half sizes a, b m with rounded corners, its sides split to ``step`` m."""
    radius = min(radius, a, b)
    points: list[Floats] = []
    for k, (sx, sz) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        phi = np.pi / 2 * (k + np.linspace(0, 1, segments + 1))
        centre = np.array([sx * (a - radius), sz * (b - radius)])
        points.append(centre + radius * np.stack([np.cos(phi), np.sin(phi)], 1))
    ring = np.concatenate(points)
    out = []
    for p, q in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        gap = float(np.linalg.norm(q - p))
        if gap < 1e-9:
            continue
        n = max(1, int(np.ceil(gap / step - 1e-6)))
        out.append(p + np.arange(n)[:, None] / n * (q - p))
    return np.concatenate(out)


def arc(start: Triple, through: Triple, end: Triple, n: int = 9) -> Floats:
    """Points (n, 3) on the parabola from ``start`` to ``end`` whose middle is ``through``, m."""
    a, m, b = np.array(start, np.float64), np.array(through, np.float64), np.array(end, np.float64)
    t = np.linspace(0, 1, n)[:, None]
    c = 2 * m - (a + b) / 2
    return np.asarray((1 - t) ** 2 * a + 2 * t * (1 - t) * c + t**2 * b)


def bent(corners: npt.ArrayLike, radius: float, n: int = 4) -> Floats:
    """A way through corners (K, 3) m with its bends rounded to about ``radius`` m."""
    p = np.asarray(corners, np.float64)
    out = [p[:1]]
    for a, b, c in zip(p[:-2], p[1:-1], p[2:], strict=True):
        before, after = a - b, c - b
        r = min(radius, 0.49 * float(np.linalg.norm(before)), 0.49 * float(np.linalg.norm(after)))
        s, e = b + before / np.linalg.norm(before) * r, b + after / np.linalg.norm(after) * r
        t = np.linspace(0, 1, n + 1)[:, None]
        out.append((1 - t) ** 2 * s + 2 * t * (1 - t) * b + t**2 * e)
    return np.concatenate([*out, p[-1:]])
