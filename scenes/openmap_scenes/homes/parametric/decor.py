"""Things to look at: pictures, photo frames, mirrors, vases, clocks, figurines, globes, baskets."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns, scenery
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    CERAMIC,
    DARK,
    GLASSES,
    METALS,
    SOFT,
    VIVID,
    WHITES,
    WOODS,
    between,
    chance,
    finish,
    paint,
    pick,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.parametric.plants import bouquet
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import Array, ellipsoid, lathe, placed, soft_box, spline, tube, turn, vessel
from openmap_scenes.scene import Material


def frame_material(rng: np.random.Generator) -> tuple[Material, str]:
    """Wood, black, white, gold or silver."""
    stuff = pick(rng, "wood", "black", "white", "gold", "silver")
    if stuff == "wood":
        return skin("frame", patterns.wood(rng)), "wood"
    colour = {"black": (0.10, 0.09, 0.09), "white": (0.93, 0.92, 0.90), "gold": (0.72, 0.58, 0.28), "silver": (0.72, 0.73, 0.75)}
    return solid("frame", colour[stuff]), "metal" if stuff in ("gold", "silver") else "wood"


def framed(w: float, h: float, border: float, depth: float, frame: Material, layers: list[tuple[float, Material]], bevel: float = 0.004) -> list[Model]:
    """A frame that stands on y = 0 with flat layers in it, each inset by so much: a mat, then the picture."""
    z = depth / 2
    bars = [
        soft_box((-w / 2, 0, -z), (w / 2, border, z), frame, bevel),
        soft_box((-w / 2, h - border, -z), (w / 2, h, z), frame, bevel),
        soft_box((-w / 2, border - 0.002, -z), (-w / 2 + border, h - border + 0.002, z), frame, bevel),
        soft_box((w / 2 - border, border - 0.002, -z), (w / 2, h - border + 0.002, z), frame, bevel),
    ]
    for k, (inset, sheet) in enumerate(layers):
        i = border - 0.001 + inset
        front = -z + 0.35 * depth + 0.0015 * k
        bars.append(box((-w / 2 + i, i, -z + 0.001), (w / 2 - i, h - i, front), sheet, step=0.25))
    return bars


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
        sides = solid("canvas edge", tuple((image.reshape(-1, 3).mean(0) / 340.0).tolist()))  # type: ignore[arg-type]
        parts = [box((-w / 2, 0, -0.016), (w / 2, h, 0.016), {**dict.fromkeys(range(1, 6), sides), 0: canvas}, step=0.12)]
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
            parts += [placed(soft_box((x - 0.015, 0, -0.012), (x + 0.015, h * 0.75, 0.0), frame, 0.003), (0, 0, -0.38), turn(0, 0.2)) for x in (-w * 0.35, w * 0.35)]
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
    return finish(parts, limits, {"shape": "round" if shape != "oval" else "oval", "material": stuff}, elevation=1.3, smallest=0.5)


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
        image = {"striped": lambda: patterns.stripes(rng, [a, b], int(rng.integers(4, 9)), False, 64), "speckled": lambda: patterns.speckle(rng, b, a, 0.12), "floral": lambda: patterns.floral(rng, b, [a, tone(rng, VIVID)])}[pattern]()  # fmt: skip
        mat = skin("vase", image)
    parts = [vessel(_vase_shape(rng) * [r, h], 0.004, mat, mat if mat.texture is None else solid("vase inside", b), 24)]
    filled = pick(rng, "empty", "empty", "flowers", "grass")
    if filled == "flowers":
        parts += [placed(p, (0, h * 0.6, 0)) for p in bouquet(rng, h * 0.4 + 0.16, between(rng, 0.07, 0.12))]
    elif filled == "grass":
        straw = paint(rng, ((0.78, 0.66, 0.42), (0.86, 0.78, 0.62), (0.60, 0.42, 0.32)), "straw")
        for k in range(9):
            tip = np.array([0.1 * np.cos(2.4 * k), 0.3 + 0.1 * np.sin(k), 0.1 * np.sin(2.4 * k)])
            stem = spline([(0, h * 0.5, 0), (0.2 * tip[0], h * 0.5 + 0.6 * tip[1], 0.2 * tip[2]), (tip[0], h * 0.6 + tip[1], tip[2])], 9)
            parts.append(tube(stem, [0.0015] * 5 + [0.004, 0.011, 0.012, 0.002], straw, 6))
    return finish(parts, limits, {"material": stuff, "pattern": pattern}, smallest=0.6)


def _dial(rng: np.random.Generator, r: float) -> Model:
    """A clock's face, a disc in the xy plane that looks along +z."""
    pale = chance(rng, 0.7)
    face = skin("clock face", patterns.clock_face(rng, (0.95, 0.94, 0.90) if pale else tone(rng, DARK + SOFT), (0.10, 0.10, 0.11) if pale else (0.95, 0.94, 0.90)))
    disc = lathe([(r, -0.008), (r, 0), *((x, 0.0) for x in np.linspace(r, 0, 3)[1:])], face, 32)
    uv = (0.5 + disc.vertices[:, [0, 2]] / (2 * r)).astype(np.float32)
    return placed(Model(disc.vertices, disc.normals, uv, disc.faces, disc.face_material, disc.materials), rotation=turn(0, np.pi / 2))


def clock(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A wall clock, round or square."""
    r, (frame, stuff) = between(rng, 0.12, 0.2), frame_material(rng)
    if chance(rng, 0.4):
        frame = paint(rng, VIVID + DARK, "frame")
    shape = pick(rng, "round", "round", "square")
    parts = [placed(_dial(rng, r), (0, 0, 0.022))]
    if shape == "round":
        rim = lathe([(0, 0), (r + 0.012, 0), (r + 0.016, 0.006), (r + 0.014, 0.03), (r + 0.004, 0.034), (r - 0.002, 0.026)], frame, 32)
        parts.append(placed(rim, rotation=turn(0, np.pi / 2)))
    else:
        s = r + 0.02
        parts.append(soft_box((-s, -s, 0), (s, s, 0.02), frame, 0.006))
    return finish(parts, limits, {"shape": shape, "material": stuff}, elevation=1.7, smallest=0.6)


def alarm_clock(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An alarm clock with bells, a box with a dial, or one with lit figures."""
    style, body = pick(rng, "bells", "box", "digital"), paint(rng, VIVID + DARK + METALS, "case")
    r, metal = between(rng, 0.04, 0.055), paint(rng, METALS, "metal")
    if style == "digital":
        w, h = 0.15, 0.065
        glass = np.full((32, 80, 3), 16, np.uint8)
        for k, x in enumerate((8, 24, 46, 62)):
            glass[6:26, x : x + 3] = glass[6:26, x + 8 : x + 11] = (235, 60, 40)
            if k % 2:
                glass[6:9, x : x + 11] = glass[23:26, x : x + 11] = (235, 60, 40)
        glass[11:14, 39:41] = glass[19:22, 39:41] = (235, 60, 40)
        return finish([soft_box((-w / 2, 0, -0.04), (w / 2, h, 0.035), body, 0.012, 2), soft_box((-w * 0.44, h * 0.14, 0.02), (w * 0.44, h * 0.86, 0.037), skin("digits", glass), 0.001)], limits, {"style": style})
    if style == "box":
        s = r * 1.25
        return finish([soft_box((-s, -s, -0.04), (s, s, 0), body, 0.014, 2), placed(_dial(rng, r), (0, 0, 0.002))], limits, {"style": style, "shape": "square"})
    case = lathe([(0, -0.05), (r * 0.9, -0.05), (r + 0.004, -0.04), (r + 0.006, 0), (r + 0.002, 0.004), (r - 0.002, 0.0)], body, 26)
    parts = [placed(case, rotation=turn(0, np.pi / 2)), placed(_dial(rng, r), (0, 0, 0.0015))]
    dome = lathe([(0, 0), (0.021, 0), (0.02, 0.008), (0.012, 0.017), (0, 0.02)], metal, 14)
    for side in (-1, 1):
        parts.append(placed(dome, (side * r * 0.62, r * 0.86, -0.022), turn(2, -side * 0.6)))
        parts.append(tube([(side * r * 0.55, -r * 0.7, -0.022), (side * r * 0.9, -r * 1.25, -0.022)], 0.005, metal, 6))
    parts.append(tube(spline([(-r * 0.5, r + 0.016, -0.022), (0, r + 0.034, -0.022), (r * 0.5, r + 0.016, -0.022)], 7), 0.003, metal, 5))
    return finish(parts, limits, {"style": style, "shape": "round"})


def figurine(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small sculpture: a bird, a cat, an elephant, a standing figure or a knot of rings."""
    mat = paint(rng, METALS + CERAMIC + WOODS + DARK, "figurine")
    style = pick(rng, "bird", "cat", "elephant", "person", "abstract")
    e = ellipsoid
    if style == "bird":
        parts = [placed(e((0, 0, 0), (0.032, 0.034, 0.055), mat), (0, 0.075, 0), turn(0, -0.3)), e((0, 0.12, 0.038), (0.022, 0.022, 0.024), mat), placed(tube([(0, 0, 0), (0, 0, 0.026)], [0.007, 0.001], mat, 6), (0, 0.12, 0.055))]
        parts += [placed(e((0, 0, 0), (0.014, 0.005, 0.045), mat), (0, 0.075, -0.065), turn(0, 0.35)), *(tube([(x, 0.005, 0), (x, 0.055, 0)], 0.0035, mat, 5) for x in (-0.012, 0.012))]
    elif style == "cat":
        parts = [e((0, 0.05, 0), (0.034, 0.055, 0.045), mat), e((0, 0.12, 0.02), (0.027, 0.025, 0.025), mat), tube(spline([(0.0, 0.014, -0.04), (0.05, 0.014, -0.03), (0.055, 0.016, 0.03)], 8), 0.009, mat, 7)]
        for x in (-0.016, 0.016):
            parts += [placed(lathe([(0, 0), (0.011, 0), (0, 0.026)], mat, 8), (x, 0.135, 0.018)), e((x, 0.03, 0.036), (0.011, 0.03, 0.013), mat, 8, 6)]
    elif style == "elephant":
        parts = [e((0, 0.085, 0), (0.042, 0.042, 0.06), mat), e((0, 0.11, 0.06), (0.03, 0.032, 0.028), mat), tube(spline([(0, 0.1, 0.085), (0, 0.06, 0.1), (0, 0.03, 0.1), (0, 0.03, 0.118)], 9), np.linspace(0.013, 0.006, 9), mat, 8)]
        parts += [tube([(x, 0, z), (x, 0.07, z)], 0.016, mat, 10) for x in (-0.024, 0.024) for z in (-0.034, 0.034)]
        parts += [e((x, 0.115, 0.05), (0.022, 0.03, 0.006), mat, 10, 6) for x in (-0.04, 0.04)]
    elif style == "person":
        robe = spline([(0.045, 0), (0.034, 0.06), (0.024, 0.12), (0.034, 0.165), (0.012, 0.19)], 12)
        parts = [lathe(np.concatenate([[[0, 0]], robe, [[0, 0.19]]]), mat, 16), e((0, 0.212, 0), (0.019, 0.024, 0.02), mat)]
        parts += [tube(spline([(s * 0.032, 0.16, 0), (s * 0.05, 0.12, 0.012), (s * 0.012, 0.1, 0.036)], 8), 0.009, mat, 7) for s in (-1, 1)]
    else:
        phi = np.linspace(0, 2 * np.pi, 41)[:-1]
        knot = np.stack([(2 + np.cos(3 * phi)) * np.cos(2 * phi), (2 + np.cos(3 * phi)) * np.sin(2 * phi), np.sin(3 * phi)], 1) * 0.027
        parts = [placed(tube(knot, 0.012, mat, 8, closed=True), (0, 0.105, 0))]
    if style in ("bird", "person", "abstract"):
        parts.append(soft_box((-0.04, 0, -0.035), (0.04, 0.02, 0.035), paint(rng, WOODS + DARK, "plinth"), 0.003))
    size = between(rng, 0.8, 1.5)
    return finish([placed(p, scale=size) for p in parts], limits, {"shape": style}, smallest=0.6)


def globe(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A globe on a foot, tilted in its arc."""
    r, metal = between(rng, 0.1, 0.16), paint(rng, METALS, "arc")
    old = chance(rng, 0.35)
    sea, land = ((0.82, 0.72, 0.52), (0.55, 0.42, 0.26)) if old else ((0.22, 0.45, 0.70), (0.50, 0.62, 0.32))
    y = r + 0.11
    ball = ellipsoid((0, 0, 0), (r, r, r), skin("map", patterns.globe_map(rng, sea, land)), 28, 16)
    tilt = turn(2, -0.41)
    a = np.linspace(-np.pi / 2 - 0.1, np.pi / 2 + 0.1, 16)
    arc = np.stack([-(r + 0.014) * np.cos(a), (r + 0.014) * np.sin(a), 0 * a], 1)
    foot = [(0, 0), (r * 0.7, 0), (r * 0.7, 0.012), (r * 0.3, 0.028), (0.012, 0.04), (0.012, 0.1), (0, 0.1)]
    parts = [placed(ball, (0, y, 0), tilt), placed(tube(arc, 0.006, metal, 6), (0, y, 0), tilt)]
    parts += [lathe(foot, paint(rng, WOODS + METALS, "foot"), 22), placed(tube([(0, -r - 0.014, 0), (0, r + 0.02, 0)], 0.004, metal, 6), (0, y, 0), tilt)]
    return finish(parts, limits, {"material": "plastic"})


def basket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A woven basket, round or oblong, low or tall; with a handle, a lid of cloth, or balls of wool in it."""
    weave = skin("wicker", patterns.wicker(rng, tone(rng, (*WOODS, *SOFT[:3])), 10, 26))
    r, h = between(rng, 0.13, 0.22), between(rng, 0.14, 0.34)
    outline = spline([(r * 0.8, 0), (r * 0.97, h * 0.4), (r, h)], 7)
    body = vessel(outline, 0.012, weave, weave, 24)
    phi = np.linspace(0, 2 * np.pi, 25)[:-1]
    rim = tube(np.stack([(r - 0.005) * np.cos(phi), np.full(24, h), (r - 0.005) * np.sin(phi)], 1), 0.011, weave, 6, closed=True)
    oblong = chance(rng, 0.4)
    parts = [placed(p, scale=(1.35 if oblong else 1.0, 1.0, 0.9 if oblong else 1.0)) for p in (body, rim)]
    extra = pick(rng, "handle", "wool", "cloth", "handles")
    if extra == "handle":
        wide = r * (1.35 if oblong else 1.0)
        parts.append(tube(spline([(-wide + 0.01, h * 0.8, 0), (-wide * 0.8, h * 1.5, 0), (0, h * 1.8, 0), (wide * 0.8, h * 1.5, 0), (wide - 0.01, h * 0.8, 0)], 16), 0.01, weave, 7))
    elif extra == "handles":
        wide = r * (1.35 if oblong else 1.0)
        for s in (-1, 1):
            parts.append(tube(spline([(s * wide, h * 0.8, -0.05), (s * (wide + 0.03), h * 0.95, -0.03), (s * (wide + 0.03), h * 0.95, 0.03), (s * wide, h * 0.8, 0.05)], 10), 0.008, weave, 6))
    elif extra == "wool":
        for k in range(5):
            a, q = 1.3 * k, 0.5 * r * (k > 0)
            wool = skin("wool", patterns.stripes(rng, [c := tone(rng, VIVID + SOFT), (0.8 * c[0], 0.8 * c[1], 0.8 * c[2])], 9, False, 64))
            parts.append(placed(ellipsoid((0, 0, 0), (r * 0.36, r * 0.34, r * 0.36), wool, 14, 8), (q * np.cos(a), h - 0.02, q * np.sin(a)), turn(0, a)))
    else:
        parts.append(ellipsoid((0, h - 0.02, 0), (r * 0.85, 0.05, r * 0.75), skin("cloth", patterns.fabric(rng, 0.5)[0]), 18, 8, 0.8))
    return finish(parts, limits, {"material": "wicker", "shape": "oval" if oblong else "round"})


GENERATORS: dict[str, Generator] = {
    "picture": picture,
    "photo frame": photo_frame,
    "mirror": mirror,
    "vase": vase,
    "clock": clock,
    "alarm clock": alarm_clock,
    "figurine": figurine,
    "globe": globe,
    "basket": basket,
}
