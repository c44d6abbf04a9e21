"""What can be seen: things that nobody who walks through a home could make out are not put into it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.items import Item
from openmap_scenes.homes.rays import RayCaster
from openmap_scenes.homes.shell import Piece
from openmap_scenes.homes.vectors import cross

# The camera of a searcher: height m, focal length px (640 wide, 90 degrees), and the pixels that make a thing visible, with
# some to spare for what a grid of rays misses.
EYE, FOCAL, ENOUGH = 1.25, 320.0, 480.0
NEAR, FAR = 0.3, 2.4
VIEWS, GRID = 12, 14


def drop_unseen(items: list[Item], shell: list[Piece], places: npt.NDArray[np.float64]) -> list[Item]:
    """The items without those that show fewer than ``ENOUGH`` pixels from all places (N, 2) x, z m; supports stay."""
    supports = {id(i.support) for i in items if i.support is not None}
    pixels = seen_pixels(items, shell, places)
    return [i for i, n in zip(items, pixels.tolist(), strict=True) if n >= ENOUGH or id(i) in supports]


def seen_pixels(items: list[Item], shell: list[Piece], places: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """About how many pixels of each item are seen from the best of some places around it, the camera turned to it."""
    meshes = [(p.mesh.vertices.astype(np.float64), p.mesh.faces) for p in shell]
    meshes += [(i.world(i.thing.model.vertices), i.thing.model.faces) for i in items]
    offsets = np.cumsum([0] + [len(v) for v, _ in meshes[:-1]])
    faces = np.concatenate([f + o for (_, f), o in zip(meshes, offsets, strict=True)])
    owner = np.repeat(np.arange(len(meshes)) - len(shell), [len(f) for _, f in meshes])
    caster = RayCaster(np.concatenate([v for v, _ in meshes]), faces)
    origins, ways, cells = [], [], []
    for item in items:
        eyes = _eyes(item, places)
        way, cell = _views(item, eyes)
        origins.append(np.repeat(eyes, GRID * GRID, axis=0))
        ways.append(way)
        cells.append(cell)
    hit = caster.first_face(np.concatenate(origins), np.concatenate(ways))
    seen = np.where(hit >= 0, owner[hit], -len(shell) - 1)
    out, start = np.zeros(len(items)), 0
    for n, cell in enumerate(cells):
        rays = len(cell) * GRID * GRID
        mine = (seen[start : start + rays] == n).reshape(len(cell), -1).sum(1)
        start += rays
        out[n] = float((mine * cell).max(initial=0.0))
    return out


def _eyes(item: Item, places: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Where to look from, (K, 3): the nearest place in each of some directions around an item."""
    low, high = item.low[[0, 2]], item.high[[0, 2]]
    gap = np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0.0), axis=1)
    near = np.flatnonzero((gap >= NEAR) & (gap <= FAR))
    if len(near) == 0:
        near = np.argsort(gap)[:VIEWS]
    off = places[near] - item.middle
    sector = ((np.arctan2(off[:, 1], off[:, 0]) / (2 * np.pi) + 0.5) * VIEWS).astype(int) % VIEWS
    order = np.lexsort((near, gap[near], sector))
    _, first = np.unique(sector[order], return_index=True)
    chosen = near[order][first]
    return np.insert(places[chosen], 1, EYE, axis=1)


def _views(item: Item, eyes: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Rays (K * GRID * GRID, 3) over the image of an item's box from each eye (K, 3), and the pixels that each stands for, (K,)."""
    centre = (item.low + item.high) / 2
    corners = np.array(np.meshgrid(*zip(item.low, item.high, strict=True))).reshape(3, -1).T
    ways, cells = [], []
    for eye in eyes:
        z = (centre - eye) / np.linalg.norm(centre - eye)
        x = cross(z, np.array([0.0, 1.0, 0.0]))
        x /= max(float(np.linalg.norm(x)), 1e-6)
        y = cross(x, z)
        rel = corners - eye
        depth = np.maximum(rel @ z, 0.1)
        u, v = np.clip(rel @ x / depth, -1, 1), np.clip(rel @ y / depth, -0.75, 0.75)
        step = (np.arange(GRID) + 0.5) / GRID
        s, t = np.meshgrid(u.min() + step * np.ptp(u), v.min() + step * np.ptp(v))
        ways.append(z + s.reshape(-1, 1) * x + t.reshape(-1, 1) * y)
        cells.append(np.ptp(u) * np.ptp(v) * FOCAL**2 / GRID**2)
    return np.concatenate(ways), np.array(cells)
