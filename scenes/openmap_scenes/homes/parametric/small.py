"""Small things about a home: boxes, bins, toys, bags, shoes, things for cleaning."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import luggage, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
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
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import ellipsoid, grid, lathe, leaf, placed, soft_box, spline, tube, turn, vessel

BLACK = solid("black plastic", (0.10, 0.10, 0.11))


def cardboard_box(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A carton: taped shut, or open with its flaps out."""
    w, h, d = between(rng, 0.25, 0.5), between(rng, 0.18, 0.4), between(rng, 0.22, 0.4)
    card = tone(rng, ((0.70, 0.54, 0.36), (0.76, 0.60, 0.42), (0.62, 0.47, 0.32)))
    board, inner = skin("cardboard", patterns.cloth(rng, card, 48, 0.02)), solid("cardboard inside", tuple(0.78 * c for c in card))  # type: ignore[arg-type]
    x, z, t = w / 2, d / 2, 0.004
    if chance(rng, 0.55):
        tape = solid("tape", tone(rng, ((0.80, 0.70, 0.52), (0.55, 0.42, 0.28), (0.88, 0.86, 0.80))))
        parts = [box((-x, 0, -z), (x, h, z), board, 0.25), box((-x - 0.001, h * 0.8, -0.025), (x + 0.001, h + 0.001, 0.025), tape, 0.25)]
        if chance(rng, 0.5):
            parts.append(box((x * 0.2, h * 0.5, z - 0.002), (x * 0.75, h * 0.8, z + 0.001), solid("label", (0.93, 0.93, 0.91))))
        return finish(parts, limits, {"material": "cardboard", "state": "closed"}, surface=True)
    parts = [box((-x, 0, -z), (x, t, z), inner, 0.25)]
    for s in (-1, 1):
        a, b = sorted((s * x, s * (x - t)))
        parts.append(box((a, 0, -z), (b, h, z), {**dict.fromkeys(range(6), board), (3 if s > 0 else 2): inner}, 0.25))
        a, b = sorted((s * z, s * (z - t)))
        parts.append(box((-x, 0, a), (x, h, b), {**dict.fromkeys(range(6), board), (1 if s > 0 else 0): inner}, 0.25))
        flap = box((0, -t, -z), (d * 0.45, 0, z), {**dict.fromkeys(range(6), board), 4: inner}, 0.25)
        angle = between(rng, -0.6, 0.9)
        parts.append(placed(flap, (s * x, h, 0), (turn(1, np.pi) if s < 0 else np.eye(3)) @ turn(2, angle)))
        flap = box((-x * 0.98, -t, 0), (x * 0.98, 0, d * 0.4), {**dict.fromkeys(range(6), board), 4: inner}, 0.25)
        angle = between(rng, -0.4, 0.9)
        parts.append(placed(flap, (0, h, s * z), (turn(1, np.pi) if s < 0 else np.eye(3)) @ turn(0, -angle)))
    return finish(parts, limits, {"material": "cardboard", "state": "open"})


def storage_box(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A box with a lid: of cloth, wicker, plastic or wood."""
    stuff = pick(rng, "fabric", "plastic", "wicker", "wood")
    w, h, d = between(rng, 0.28, 0.45), between(rng, 0.18, 0.3), between(rng, 0.24, 0.34)
    side = {
        "fabric": lambda: skin("cloth", patterns.fabric(rng, 0.5)[0]),
        "plastic": lambda: paint(rng, VIVID + SOFT + WHITES, "plastic"),
        "wicker": lambda: skin("wicker", patterns.wicker(rng, tone(rng, WOODS))),
        "wood": lambda: skin("wood", patterns.wood(rng)),
    }[stuff]()
    lid = side if chance(rng, 0.5) else paint(rng, SOFT + WHITES, "lid")
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), side, 0.012), soft_box((-w / 2 - 0.008, h - 0.03, -d / 2 - 0.008), (w / 2 + 0.008, h + 0.012, d / 2 + 0.008), lid, 0.008)]
    metal = paint(rng, METALS, "grip")
    grip = spline([(-0.045, h * 0.62, d / 2 - 0.002), (-0.04, h * 0.58, d / 2 + 0.016), (0.04, h * 0.58, d / 2 + 0.016), (0.045, h * 0.62, d / 2 - 0.002)], 9)
    parts.append(tube(grip, 0.005, metal, 6))
    if stuff == "fabric":
        parts.append(box((-0.04, h * 0.25, d / 2 - 0.002), (0.04, h * 0.45, d / 2 + 0.002), solid("label", (0.93, 0.92, 0.88))))
    return finish(parts, limits, {"material": stuff, "shape": "rectangular"}, surface=True)


def wastebasket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A small open bin, some crumpled paper in it."""
    stuff = pick(rng, "plastic", "metal", "wicker")
    mat = {"plastic": lambda: paint(rng, VIVID + DARK + SOFT, "bin"), "metal": lambda: skin("mesh", patterns.checks(rng, tone(rng, METALS), (0.25, 0.25, 0.26), 32)), "wicker": lambda: skin("wicker", patterns.wicker(rng, tone(rng, WOODS), 12, 26))}[stuff]()
    r, h = between(rng, 0.11, 0.15), between(rng, 0.25, 0.33)
    parts = [vessel([(r * 0.78, 0), (r * 0.9, h * 0.55), (r, h - 0.01), (r + 0.006, h)], 0.006, mat, mat, 24)]
    if chance(rng, 0.6):
        for k in range(5):
            ball = ellipsoid((0, 0, 0), (0.04, 0.035, 0.038), solid("paper", (0.94, 0.93, 0.90)), 7, 4)
            parts.append(placed(ball, (0.06 * np.cos(1.3 * k), h * 0.72 + 0.02 * (k % 2), 0.06 * np.sin(1.3 * k)), turn(0, k)))
    if stuff != "plastic" and chance(rng, 0.2):
        parts = [placed(p, scale=(1.2, 1, 0.8)) for p in parts]
    return finish(parts, limits, {"material": stuff})


def trash_can(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A kitchen bin: round with a pedal and a domed lid, or square with a swing lid."""
    body, dark = paint(rng, METALS[:3] + WHITES + VIVID[:1], "bin"), BLACK
    if chance(rng, 0.55):
        r, h = between(rng, 0.13, 0.17), between(rng, 0.4, 0.62)
        parts = [lathe([(0, 0), (r, 0), (r, 0.03)], dark, 26), lathe([(r - 0.003, 0.03), (r - 0.003, h * 0.5), (r - 0.003, h)], body, 26), lathe([(r, h), (r, h + 0.025), (r * 0.8, h + 0.06), (r * 0.4, h + 0.075), (0, h + 0.078)], dark if chance(rng, 0.5) else body, 26)]
        parts.append(soft_box((-0.05, 0.008, r * 0.8), (0.05, 0.025, r + 0.05), dark, 0.005))
        return finish(parts, limits, {"shape": "round", "style": "pedal"})
    w, d, h = between(rng, 0.26, 0.32), between(rng, 0.2, 0.26), between(rng, 0.45, 0.62)
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h * 0.82, d / 2), body, 0.025, 2), soft_box((-w / 2 - 0.006, h * 0.8, -d / 2 - 0.006), (w / 2 + 0.006, h * 0.88, d / 2 + 0.006), dark, 0.01)]
    parts.append(placed(soft_box((-w * 0.42, -0.09, -0.09), (w * 0.42, 0.09, 0.09), dark, 0.03, 2), (0, h * 0.85, 0), turn(0, np.pi / 4), (1, 0.9, 0.9)))
    return finish(parts, limits, {"shape": "rectangular", "style": "swing"})


def laundry_basket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tall basket for washing, closed or with clothes over its rim; or a low one of plastic."""
    stuff = pick(rng, "wicker", "fabric", "plastic")
    r, h = between(rng, 0.19, 0.24), between(rng, 0.45, 0.6)
    if stuff == "plastic":
        h = between(rng, 0.24, 0.3)
    mat = {"wicker": lambda: skin("wicker", patterns.wicker(rng, tone(rng, WOODS + SOFT[:1]), 16, 30)), "fabric": lambda: skin("cloth", patterns.fabric(rng, 0.5)[0]), "plastic": lambda: skin("holes", patterns.dots(rng, tone(rng, SOFT + VIVID), (0.2, 0.2, 0.22), 9))}[stuff]()
    stretch = (1.25, 1, 0.9) if stuff == "plastic" or chance(rng, 0.3) else (1, 1, 1)
    parts = [vessel([(r * 0.85, 0), (r * 0.95, h * 0.5), (r, h)], 0.01, mat, mat, 26)]
    if stuff != "plastic" and chance(rng, 0.4):
        parts.append(lathe([(r + 0.008, h - 0.02), (r + 0.01, h + 0.01), (r * 0.7, h + 0.03), (0.02, h + 0.036), (0.02, h + 0.05), (0, h + 0.052)], mat, 26))
    else:
        for k in range(5):
            cloth = skin("clothes", patterns.fabric(rng, 0.6, SOFT + VIVID)[0])
            heap = ellipsoid((0, 0, 0), (r * 0.52, 0.07, r * 0.36), cloth, 12, 7, 1.0, 0.8)
            parts.append(placed(heap, (0.4 * r * np.cos(1.4 * k), h - 0.03 + 0.03 * (k % 2), 0.4 * r * np.sin(1.4 * k)), turn(1, 1.1 * k) @ turn(2, 0.25)))
    return finish([placed(p, scale=stretch) for p in parts], limits, {"material": stuff})


def tissue_box(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A box of tissues, oblong or a cube, one tissue out."""
    w, h, d = (0.23, 0.07, 0.12) if chance(rng, 0.6) else (0.12, 0.13, 0.12)
    side = skin("box", patterns.fabric(rng, 0.15, SOFT + VIVID)[0])
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), side, 0.003), ellipsoid((0, h, 0), (w * 0.25, 0.002, d * 0.2), BLACK, 16, 4)]
    white = paint(rng, WHITES, "tissue")
    for k in range(3):
        fold = spline([(0.012 * (k - 1), h - 0.004, 0.01 * (k - 1)), (0.022 * (k - 1), h + 0.035, 0.008), (0.05 * (k - 1), h + 0.065 - 0.012 * (k % 2), 0.012 * (k - 1))], 6)
        parts.append(leaf(fold, [0.03, 0.05, 0.06, 0.055, 0.04, 0.004], white, (0, 0, 1), 0.4))
    return finish(parts, limits, {"material": "cardboard"})


def teddy_bear(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A sitting teddy bear; with a bow, or as a rabbit with long ears."""
    fur_colour = tone(rng, ((0.60, 0.40, 0.22), (0.76, 0.58, 0.36), (0.90, 0.84, 0.74), (0.38, 0.26, 0.18), (0.84, 0.62, 0.66), (0.62, 0.62, 0.64)))
    fur, pale = skin("fur", patterns.fur(rng, fur_colour, 64, 0.09)), solid("snout", tuple(0.5 + 0.5 * c for c in fur_colour))  # type: ignore[arg-type]
    e, dark = ellipsoid, solid("eye", (0.06, 0.05, 0.05))
    rabbit = chance(rng, 0.25)
    parts = [e((0, 0.11, 0), (0.075, 0.1, 0.066), fur), e((0, 0.105, 0.03), (0.05, 0.065, 0.045), pale), e((0, 0.255, 0.012), (0.072, 0.066, 0.064), fur), e((0, 0.237, 0.068), (0.032, 0.026, 0.024), pale), e((0, 0.248, 0.09), (0.011, 0.008, 0.008), dark, 8, 5)]
    for s in (-1, 1):
        parts.append(e((s * 0.028, 0.272, 0.067), (0.008, 0.009, 0.006), dark, 8, 5))
        if rabbit:
            parts += [placed(e((0, 0.075, 0), (0.022, 0.08, 0.012), fur), (s * 0.03, 0.3, 0), turn(2, -s * 0.2))]
        else:
            parts += [e((s * 0.055, 0.31, 0.0), (0.027, 0.027, 0.014), fur), e((s * 0.055, 0.31, 0.009), (0.016, 0.016, 0.009), pale)]
        parts += [placed(e((0, -0.055, 0), (0.028, 0.068, 0.03), fur), (s * 0.068, 0.175, 0.012), turn(2, s * 0.5) @ turn(0, -0.5))]
        parts += [placed(e((0, 0, 0.065), (0.033, 0.035, 0.08), fur), (s * 0.05, 0.036, 0.01), turn(1, s * 0.4)), placed(e((0, 0, 0.142), (0.022, 0.024, 0.006), pale), (s * 0.05, 0.036, 0.01), turn(1, s * 0.4))]
    if chance(rng, 0.5):
        bow = paint(rng, VIVID, "bow")
        parts += [placed(e((s * 0.024, 0, 0), (0.026, 0.016, 0.01), bow, 10, 6), (0, 0.19, 0.068), turn(2, s * 0.3)) for s in (-1, 1)] + [e((0, 0.19, 0.072), (0.01, 0.01, 0.01), bow, 8, 5)]
    size = between(rng, 0.75, 1.5)
    return finish([placed(p, scale=size) for p in parts], limits, {"material": "plush", "shape": "rabbit" if rabbit else "bear"}, smallest=0.5)


def toy_car(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A toy car, truck or bus, about 15-28 cm long."""
    body, glass, tyre, hub = paint(rng, VIVID, "body"), solid("window", (0.62, 0.76, 0.84)), solid("tyre", (0.10, 0.10, 0.10)), paint(rng, METALS + VIVID, "hub")
    style, long = pick(rng, "car", "truck", "bus"), 0.1
    parts = []
    if style == "car":
        parts += [soft_box((-0.1, 0.022, -0.042), (0.1, 0.062, 0.042), body, 0.014, 2), soft_box((-0.055, 0.05, -0.037), (0.05, 0.097, 0.037), body, 0.016, 2)]
        parts += [soft_box((-0.045, 0.064, -0.0385), (0.04, 0.087, 0.0385), glass, 0.004), soft_box((-0.057, 0.066, -0.028), (0.053, 0.086, 0.028), glass, 0.004)]
        parts += [ellipsoid((0.098, 0.046, z), (0.006, 0.008, 0.008), solid("headlight", (0.98, 0.94, 0.7)), 8, 5) for z in (-0.028, 0.028)]
    elif style == "truck":
        load = paint(rng, VIVID, "bed")
        parts += [soft_box((0.035, 0.022, -0.045), (0.12, 0.11, 0.045), body, 0.012, 2), soft_box((0.06, 0.07, -0.0465), (0.105, 0.1, 0.0465), glass, 0.004), soft_box((0.1, 0.07, -0.036), (0.1215, 0.1, 0.036), glass, 0.004), soft_box((-0.13, 0.022, -0.04), (0.05, 0.04, 0.04), BLACK, 0.006)]
        parts += [soft_box((-0.13, 0.04, s * 0.047 - 0.003), (0.028, 0.09, s * 0.047 + 0.003), load, 0.002) for s in (-1, 1)] + [soft_box((x, 0.04, -0.047), (x + 0.006, 0.09, 0.047), load, 0.002) for x in (-0.13, 0.022)] + [soft_box((-0.13, 0.038, -0.047), (0.028, 0.05, 0.047), load, 0.003)]
        long = 0.12
    else:
        parts += [soft_box((-0.13, 0.022, -0.045), (0.13, 0.12, 0.045), body, 0.016, 2), soft_box((0.11, 0.07, -0.036), (0.1315, 0.105, 0.036), glass, 0.004)]
        parts += [soft_box((x - 0.018, 0.07, -0.0465), (x + 0.018, 0.105, 0.0465), glass, 0.003) for x in (-0.095, -0.047, 0.001, 0.049)]
        long = 0.12
    wheel = lathe([(0, 0.012), (0.013, 0.012), (0.013, 0.009), (0.024, 0.008), (0.025, 0), (0.024, -0.008), (0, -0.008)][::-1], tyre, 16)
    cap = lathe([(0.013, 0.0085), (0.011, 0.013), (0, 0.014)], hub, 12)
    for x in (-long * 0.62, long * 0.62):
        for s in (-1, 1):
            parts += [placed(p, (x, 0.025, s * 0.04), turn(0, s * np.pi / 2)) for p in (wheel, cap)]
    size = between(rng, 0.7, 1.2)
    return finish([placed(p, scale=size) for p in parts], limits, {"shape": style, "material": pick(rng, "plastic", "metal", "wood")})


def ball(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A ball: beach, foot, basket, tennis or plain rubber."""
    style = pick(rng, "beach ball", "football", "basketball", "tennis ball", "rubber ball")
    r = {"beach ball": between(rng, 0.12, 0.2), "football": 0.11, "basketball": 0.12, "tennis ball": 0.034, "rubber ball": between(rng, 0.06, 0.11)}[style]
    u, v = patterns.unit(96)
    if style == "beach ball":
        colours = np.array([tone(rng, VIVID), (0.95, 0.95, 0.93), tone(rng, VIVID), (0.95, 0.95, 0.93), tone(rng, VIVID), tone(rng, VIVID)])
        rgb = colours[np.floor(u * 6).astype(int)]
    elif style == "football":
        rows = np.floor(v * 5)
        spot = np.hypot(((u * 5 + 0.5 * (rows % 2)) % 1 - 0.5) * np.sin(np.pi * v), (v * 5) % 1 - 0.5) < 0.27
        rgb = np.where(spot[..., None], 0.10, 0.95) * np.ones(3)
    elif style == "basketball":
        line = (np.abs((u * 4) % 1 - 0.5) > 0.48) | (np.abs(v - 0.5) < 0.012)
        rgb = np.where(line[..., None], 0.10, np.array([0.80, 0.42, 0.16]))
    elif style == "tennis ball":
        line = np.abs(v - 0.5 - 0.25 * np.sin(4 * np.pi * u)) < 0.025
        rgb = np.where(line[..., None], 0.93, np.array([0.78, 0.86, 0.22]))
    else:
        rgb = np.ones((96, 96, 1)) * np.array(tone(rng, VIVID))
        rgb = np.where((np.abs(v - 0.5) < 0.07)[..., None], np.array(tone(rng, WHITES)), rgb)
    sphere = placed(ellipsoid((0, 0, 0), (r, r, r), skin("ball", patterns.to_image(rgb)), 24, 14), rotation=turn(0, between(rng, 0.2, 1.2)) @ turn(1, between(rng, 0, 6.3)))
    return finish([sphere], limits, {"shape": "round", "style": style})


def building_blocks(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Wooden blocks: a tower with an arch, or a heap; cubes, roofs, pillars in bright colours."""
    mats = [paint(rng, VIVID, "block") for _ in range(5)] + [skin("wood", patterns.wood(rng))]
    s, parts = between(rng, 0.035, 0.05), []

    def cube(x: float, y: float, z: float, w: float = 1.0, h: float = 1.0) -> None:
        mat = mats[int(rng.integers(6))]
        one = soft_box((-s * w / 2, 0, -s / 2), (s * w / 2, s * h, s / 2), mat, 0.003)
        parts.append(placed(one, (x * s, y * s, z * s), turn(1, float(rng.normal(0, 0.08)))))

    for x in (-1.1, 1.1):
        cube(x, 0, 0, 1, 1)
        cube(x, 1.01, 0, 1, 1)
    cube(0, 2.03, 0, 3.4, 0.6)
    cube(0, 2.66, 0)
    roof = lathe([(0, 0), (s * 0.6, 0), (0, s)], mats[0], 4 if chance(rng, 0.5) else 16)
    parts.append(placed(roof, (0, 3.68 * s, 0)))
    for k in range(int(rng.integers(3, 7))):
        a = 1.1 * k + between(rng, 0, 0.5)
        cube(2.4 * np.cos(a), 0, 1.4 + 1.2 * abs(np.sin(a)) + 0.3 * k, 1 + (k % 2))
    return finish(parts, limits, {"material": "wood"})


def fan(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A fan with blades in a wire cage, for a table or on a pole."""
    body, tall = paint(rng, WHITES + DARK + METALS + VIVID[1:2], "fan"), chance(rng, 0.4) and limits.height > 1.0
    r, h = between(rng, 0.14, 0.2), between(rng, 0.75, 1.0) if tall else between(rng, 0.2, 0.26)
    foot = r * (1.0 if tall else 0.75)
    parts = [lathe([(0, 0), (foot, 0), (foot, 0.015), (foot * 0.5, 0.035), (0.016, 0.05), (0.014, h), (0, h)], body, 22)]
    wire, head = paint(rng, METALS, "cage"), []
    phi = np.linspace(0, 2 * np.pi, 29)[:-1]
    for z, q in ((0.0, 1.0), (0.05, 0.8), (-0.05, 0.8), (0.058, 0.45), (-0.058, 0.45)):
        head.append(tube(np.stack([q * r * np.cos(phi), q * r * np.sin(phi), np.full(28, z)], 1), 0.0025, wire, 4, closed=True))
    for k in range(14):
        a = 2 * np.pi * k / 14
        for s in (-1, 1):
            path = [(0.03, s * 0.06), (0.8 * r, s * 0.05), (r, 0.0)]
            head.append(tube([(q * np.cos(a), q * np.sin(a), z) for q, z in path], 0.0018, wire, 4))
    blade = soft_box((0.02, -0.05, -0.002), (r * 0.82, 0.05, 0.002), paint(rng, VIVID + WHITES + METALS, "blade"), 0.0015)
    for k in range(3):
        head.append(placed(blade, rotation=turn(2, 2.1 * k) @ turn(0, 0.5)))
    head += [ellipsoid((0, 0, 0.05), (0.032, 0.032, 0.018), body, 14, 8), placed(lathe([(0, 0), (0.045, 0), (0.05, 0.03), (0.035, 0.12), (0, 0.13)], body, 16), (0, 0, -0.05), turn(0, -np.pi / 2))]
    R = turn(1, between(rng, -0.4, 0.4)) @ turn(0, between(rng, -0.2, 0.1))
    return finish([*parts, *(placed(p, (0, h + r * 0.55 if not tall else h, 0.08), R) for p in head)], limits, {"style": "standing" if tall else "table"})


def broom(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A broom, upright: flat with bristles, or a bundle of straw."""
    stick, h = paint(rng, WOODS + VIVID + METALS, "stick"), between(rng, 1.2, 1.4)
    path = np.stack([np.zeros(6), np.linspace(0.18, h, 6), np.zeros(6)], 1)
    bristle = skin("bristles", patterns.stripes(rng, [a := tone(rng, ((0.80, 0.66, 0.36), (0.20, 0.20, 0.22), (0.72, 0.20, 0.18), (0.22, 0.42, 0.62))), (0.7 * a[0], 0.7 * a[1], 0.7 * a[2])], 20, True, 96))
    if chance(rng, 0.5):
        parts = [soft_box((-0.15, 0.09, -0.028), (0.15, 0.135, 0.028), paint(rng, WOODS + VIVID, "head"), 0.008), soft_box((-0.16, 0, -0.035), (0.16, 0.1, 0.035), bristle, 0.01), lathe([(0.02, 0.13), (0.016, 0.2), (0, 0.2)], stick, 12)]
    else:
        swell = spline([(0.14, 0), (0.12, 0.12), (0.06, 0.26), (0.022, 0.34)], 8)
        parts = [placed(lathe(np.concatenate([[[0, 0]], swell, [[0, 0.34]]]), bristle, 20), scale=(1, 1, 0.4)), placed(lathe([(0.075, 0.2), (0.079, 0.21), (0.066, 0.24)], paint(rng, VIVID, "cord"), 18), scale=(1.25, 1, 0.6))]
    return finish([*parts, tube(path, 0.012, stick, 8)], limits, {"material": "wood"})


def vacuum_cleaner(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A canister with its hose and wand, or an upright stick."""
    body, dark, grey = paint(rng, VIVID + DARK, "body"), BLACK, solid("tube", (0.66, 0.67, 0.69))
    if chance(rng, 0.5):
        lean = turn(0, -0.12)
        wand = [tube([(0, 0.06, 0), (0, 0.4, 0), (0, 0.75, 0)], 0.017, grey, 10), tube([(0, 0.72, 0), (0, 1.0, 0)], [0.05, 0.045], body, 16), tube([(0, 0.68, 0.055), (0, 0.9, 0.055)], 0.035, paint(rng, WHITES + METALS, "cup"), 14)]
        wand.append(tube(spline([(0, 0.98, -0.02), (0, 1.1, -0.06), (0, 1.13, -0.15), (0, 1.02, -0.13)], 9), 0.016, dark, 8))
        return finish([*(placed(p, (0, 0.0, 0), lean) for p in wand), soft_box((-0.13, 0, -0.02), (0.13, 0.055, 0.1), dark, 0.02, 2)], limits, {"style": "stick"})
    parts = [ellipsoid((0, 0.15, 0), (0.14, 0.12, 0.2), body, 20, 12, 0.7, 0.8), ellipsoid((0, 0.2, 0.05), (0.1, 0.09, 0.12), paint(rng, METALS + DARK, "lid"), 18, 10)]
    wheel = lathe([(0, -0.02), (0.09, -0.02), (0.095, 0), (0.09, 0.02), (0, 0.02)], dark, 20)
    parts += [placed(wheel, (s * 0.14, 0.095, -0.08), turn(2, np.pi / 2)) for s in (-1, 1)]
    hose = spline([(0, 0.2, 0.17), (0.05, 0.3, 0.34), (0.28, 0.45, 0.34), (0.36, 0.75, 0.1), (0.34, 0.82, 0.02)], 26)
    radius = 0.02 + 0.0025 * (np.arange(26) % 2)
    parts += [tube(hose, radius, dark, 8), tube([(0.34, 0.86, 0.0), (0.33, 0.45, 0.16), (0.32, 0.05, 0.32)], 0.016, grey, 10), soft_box((0.18, 0, 0.29), (0.46, 0.05, 0.39), dark, 0.015, 2)]
    return finish(parts, limits, {"style": "canister"})


def ironing_board(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A board with a pointed end on crossed legs; now and then with the iron."""
    cover, metal = skin("cover", patterns.fabric(rng, 0.25, SOFT + VIVID)[0]), paint(rng, METALS[:2] + WHITES, "legs")
    h, half = between(rng, 0.82, 0.9), between(rng, 0.58, 0.66)
    t = np.linspace(0, 1, 12)
    width = 0.18 * np.clip(1 - np.clip((t - 0.6) / 0.4, 0, 1) ** 2.2, 0.12, 1)
    x = -half + 2 * half * t
    rows = []
    for edge, y in ((0.9, -0.028), (1.0, -0.02), (1.0, -0.006), (0.92, 0.0), (0.0, 0.002)):
        loop = np.concatenate([np.stack([x, np.full(12, y), width * edge], 1), np.stack([x[::-1], np.full(12, y), -width[::-1] * edge], 1), [[x[0], y, width[0] * edge]]])
        rows.append(loop)
    bottom = [rows[0] * [1, 1, 0], rows[0]]
    parts = [placed(grid(np.stack([*bottom, *rows[1:]]), cover), (0, h, 0))]
    for s in (-1, 1):
        parts.append(tube([(-s * half * 0.75, 0.015, 0.14 * s), (0, h / 2, 0.05 * s), (s * half * 0.6, h - 0.03, 0.05 * s)], 0.011, metal, 8))
        parts.append(tube([(-s * half * 0.75, 0.012, -0.17), (-s * half * 0.75, 0.012, 0.17)], 0.012, metal, 8))
    if chance(rng, 0.5):
        sole, shell = paint(rng, METALS[:1], "sole"), paint(rng, VIVID + WHITES, "iron")
        iron = [soft_box((-0.12, 0, -0.055), (0.1, 0.012, 0.055), sole, 0.005), ellipsoid((-0.01, 0.035, 0), (0.12, 0.035, 0.052), shell, 16, 8, 0.7), tube(spline([(0.06, 0.05, 0), (0.05, 0.1, 0), (-0.06, 0.105, 0), (-0.1, 0.05, 0)], 10), 0.012, shell, 8)]
        parts += [placed(p, (-half * 0.55, h + 0.003, 0)) for p in iron]
    return finish(parts, limits, {"material": "metal"})


GENERATORS: dict[str, Generator] = {
    "cardboard box": cardboard_box,
    "storage box": storage_box,
    "wastebasket": wastebasket,
    "trash can": trash_can,
    "laundry basket": laundry_basket,
    "tissue box": tissue_box,
    "teddy bear": teddy_bear,
    "toy car": toy_car,
    "ball": ball,
    "building blocks": building_blocks,
    "fan": fan,
    "broom": broom,
    "vacuum cleaner": vacuum_cleaner,
    "ironing board": ironing_board,
    **luggage.GENERATORS,
}
