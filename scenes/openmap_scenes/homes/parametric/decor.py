"""Things to look at: pictures, photo frames, mirrors, vases, clocks, figurines, globes, baskets."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import ornaments, patterns, scenery
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.bouquets import bouquet
from openmap_scenes.homes.parametric.frames import frame_material, framed
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    GLASSES,
    VIVID,
    WHITES,
    between,
    chance,
    finish,
    paint,
    pick,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import Array, lathe, placed, soft_box, spline, tube, turn, vessel
from openmap_scenes.scene import Material


def picture(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A framed picture with or without a mat, or a bare canvas; landscape, portrait or square; now and then a pair."""
    image, subject = scenery.any_picture(rng)
    shape = pick(rng, "landscape", "portrait", "square")
    if subject in ("landscape", "seascape"):
        shape = pick(rng, "landscape", "landscape", "square")
    if subject == "botanical print":
        shape = "portrait"
    long = between(rng, 0.35, 1.0)
    ratio = 1.0 if shape == "square" else between(rng, 0.62, 0.8)
    w, h = (long * ratio, long) if shape == "portrait" else (long, long * ratio)
    size = image.shape[0]
    cut = round(size * min(1.0, h / w)), round(size * min(1.0, w / h))
    image = np.ascontiguousarray(image[(size - cut[0]) // 2 :][: cut[0], (size - cut[1]) // 2 :][:, : cut[1]])
    canvas = skin("picture", image)
    if chance(rng, 0.2):
        sides = solid("canvas edge", tuple((image.reshape(-1, 3).mean(0) / 340.0).tolist()))
        parts = [
            box((-w / 2, 0, -0.016), (w / 2, h, 0.016), {**dict.fromkeys(range(1, 6), sides), 0: canvas}, step=0.12)
        ]
        return finish(parts, limits, {"pattern": subject, "style": "canvas"}, elevation=1.35, smallest=0.5)
    frame, stuff = frame_material(rng)
    border, layers = between(rng, 0.012, 0.05), [(0.0, canvas)]
    if chance(rng, 0.5):
        layers = [(0.0, paint(rng, WHITES, "mat")), (min(w, h) * between(rng, 0.08, 0.16), canvas)]
    parts = framed(w, h, border, between(rng, 0.018, 0.035), frame, layers, min(0.012, border * 0.4))
    return finish(parts, limits, {"pattern": subject, "material": stuff}, elevation=1.35, smallest=0.5)


def photo_frame(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small photograph that leans on its stand."""
    w, h = between(rng, 0.12, 0.18), between(rng, 0.16, 0.24)
    if chance(rng, 0.4):
        w, h = h, w
    makers = (scenery.portrait, scenery.portrait, scenery.landscape, scenery.seaside)
    photo = skin("photo", makers[int(rng.integers(4))](rng))
    frame, stuff = frame_material(rng)
    layers = [(0.0, paint(rng, WHITES, "mat")), (0.015, photo)] if chance(rng, 0.4) else [(0.0, photo)]
    lean = turn(0, -0.22)
    parts = [placed(p, rotation=lean) for p in framed(w, h, between(rng, 0.01, 0.025), 0.014, frame, layers)]
    leg = soft_box((-0.02, 0, -0.002), (0.02, h * 0.72, 0.002), solid("stand", (0.15, 0.14, 0.13)), 0.001)
    parts.append(placed(leg, (0, 0.0, -h * 0.46 - 0.012), turn(0, 0.42)))
    return finish(parts, limits, {"material": stuff})


def _glow(rng: np.random.Generator, size: int = 64) -> Material:
    """A mirror as scans show it: pale, with a slanting sheen."""
    u, v = patterns.unit(size)
    sheen = 0.72 + 0.15 * (u - v) + 0.07 * np.sin(7 * (u + v) + float(rng.uniform(0, 6)))
    return skin("mirror", patterns.to_image(sheen[..., None] * np.array([0.93, 0.98, 1.0])))


def mirror(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A mirror for a wall: rectangular, round, oval, arched or a sun with rays; or a tall one that stands on the floor."""
    shape = pick(rng, "rectangular", "rectangular", "round", "oval", "sunburst", "standing")
    glass, (frame, stuff) = _glow(rng), frame_material(rng)
    if shape in ("rectangular", "standing") and not (shape == "standing" and limits.height < 1.5):
        w, h = between(rng, 0.4, 0.75), between(rng, 0.55, 0.95)
        if shape == "standing":
            w, h = between(rng, 0.4, 0.6), between(rng, 1.45, 1.7)
        parts = framed(w, h, between(rng, 0.015, 0.06), 0.03, frame, [(0.0, glass)])
        if shape == "standing":
            lean = turn(0, -0.12)
            parts = [placed(p, rotation=lean) for p in parts]
            parts += [
                placed(
                    soft_box((x - 0.015, 0, -0.012), (x + 0.015, h * 0.75, 0.0), frame, 0.003),
                    (0, 0, -0.38),
                    turn(0, 0.2),
                )
                for x in (-w * 0.35, w * 0.35)
            ]
            return finish(parts, limits, {"shape": "tall", "style": "standing", "material": stuff})
        return finish(parts, limits, {"shape": shape, "material": stuff}, elevation=1.2, smallest=0.5)
    r, b = between(rng, 0.2, 0.38), between(rng, 0.012, 0.04)
    disc = lathe([(0, 0), (r, 0), (r, 0.012), *((x, 0.012) for x in np.linspace(r, 0, 4)[1:])], glass, 36)
    uv = (0.5 + disc.vertices[:, [0, 2]] / (2 * r)).astype(np.float32)
    disc = Model(disc.vertices, disc.normals, uv, disc.faces, disc.face_material, disc.materials)
    phi = np.linspace(0, 2 * np.pi, 37)[:-1]
    ring = tube(np.stack([r * np.cos(phi), np.full(36, 0.012), r * np.sin(phi)], 1), b / 2, frame, 8, closed=True)
    stretch = (1.0, 1.0, between(rng, 1.25, 1.5)) if shape == "oval" else (1.0, 1.0, 1.0)
    parts = [placed(placed(p, scale=stretch), rotation=turn(0, np.pi / 2)) for p in (disc, ring)]
    if shape == "sunburst":
        for k in range(24):
            long = r * (0.55 if k % 2 else 0.3)
            ray = tube([(r, 0, 0.008), (r + long, 0, 0.008)], [0.012, 0.004], frame, 5)
            parts.append(placed(ray, rotation=turn(2, 2 * np.pi * k / 24)))
    return finish(
        parts, limits, {"shape": "round" if shape != "oval" else "oval", "material": stuff}, elevation=1.3, smallest=0.5
    )


def _vase_shape(rng: np.random.Generator) -> Array:
    """An outline (12, 2) of unit height and about unit radius."""
    shapes = (
        [(0.5, 0), (0.9, 0.25), (1.0, 0.45), (0.6, 0.75), (0.4, 0.88), (0.55, 1)],
        [(0.6, 0), (0.95, 0.15), (1.0, 0.35), (0.5, 0.62), (0.28, 0.8), (0.36, 1)],
        [(0.75, 0), (0.8, 0.5), (0.85, 1)],
        [(0.5, 0), (0.65, 0.4), (0.9, 0.75), (1.0, 0.9), (0.8, 1)],
        [(0.7, 0), (1.05, 0.3), (1.0, 0.6), (0.6, 0.85), (0.62, 1)],
    )
    return spline(shapes[int(rng.integers(len(shapes)))], 14)


def vase(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A vase of ceramic or glass; empty, with flowers, or with dry grass."""
    h = between(rng, 0.16, 0.34)
    r = h * between(rng, 0.22, 0.38)
    stuff, pattern = pick(rng, "ceramic", "ceramic", "glass"), "plain"
    a, b = tone(rng, CERAMIC + VIVID), tone(rng, CERAMIC)
    mat = solid("vase", a)
    if stuff == "glass":
        mat = paint(rng, GLASSES + VIVID[1:4], "glass")
    elif chance(rng, 0.5):
        pattern = pick(rng, "striped", "speckled", "floral")
        image = {
            "striped": lambda: patterns.stripes(rng, [a, b], int(rng.integers(4, 9)), False, 64),
            "speckled": lambda: patterns.speckle(rng, b, a, 0.12),
            "floral": lambda: patterns.floral(rng, b, [a, tone(rng, VIVID)]),
        }[pattern]()
        mat = skin("vase", image)
    parts = [vessel(_vase_shape(rng) * [r, h], 0.004, mat, mat if mat.texture is None else solid("vase inside", b), 24)]
    filled = pick(rng, "empty", "empty", "flowers", "grass")
    if filled == "flowers":
        parts += [placed(p, (0, h * 0.6, 0)) for p in bouquet(rng, h * 0.4 + 0.16, between(rng, 0.07, 0.12))]
    elif filled == "grass":
        straw = paint(rng, ((0.78, 0.66, 0.42), (0.86, 0.78, 0.62), (0.60, 0.42, 0.32)), "straw")
        for k in range(9):
            tip = np.array([0.1 * np.cos(2.4 * k), 0.3 + 0.1 * np.sin(k), 0.1 * np.sin(2.4 * k)])
            stem = spline(
                [
                    (0, h * 0.5, 0),
                    (0.2 * tip[0], h * 0.5 + 0.6 * tip[1], 0.2 * tip[2]),
                    (tip[0], h * 0.6 + tip[1], tip[2]),
                ],
                9,
            )
            parts.append(tube(stem, [0.0015] * 5 + [0.004, 0.011, 0.012, 0.002], straw, 6))
    return finish(parts, limits, {"material": stuff, "pattern": pattern}, smallest=0.6)


GENERATORS: dict[str, Generator] = {
    "picture": picture,
    "photo frame": photo_frame,
    "mirror": mirror,
    "vase": vase,
    **ornaments.GENERATORS,
}
