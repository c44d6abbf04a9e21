"""Small things about a home: boxes, bins, toys, bags, shoes, things for cleaning."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.parametric import cleaning, luggage, patterns
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.cleaning import BLACK
from openmap_scenes.homes.parametric.making import (
    DARK,
    METALS,
    SOFT,
    VIVID,
    WHITES,
    WOODS,
    between,
    chance,
    dimmed,
    finish,
    paint,
    pick,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.primitives import box
from openmap_scenes.homes.revolve import (
    copies,
    ellipsoid,
    lathe,
    leaf,
    placed,
    soft_box,
    spline,
    tube,
    turn,
)


def cardboard_box(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A carton: taped shut, or open with its flaps out."""
    w, h, d = between(rng, 0.25, 0.5), between(rng, 0.18, 0.4), between(rng, 0.22, 0.4)
    card = tone(rng, ((0.70, 0.54, 0.36), (0.76, 0.60, 0.42), (0.62, 0.47, 0.32)))
    board, inner = (
        skin("cardboard", patterns.cloth(rng, card, 48, 0.02)),
        solid("cardboard inside", dimmed(card, 0.78)),
    )
    x, z, t = w / 2, d / 2, 0.004
    if chance(rng, 0.55):
        tape = solid("tape", tone(rng, ((0.80, 0.70, 0.52), (0.55, 0.42, 0.28), (0.88, 0.86, 0.80))))
        parts = [
            box((-x, 0, -z), (x, h, z), board, 0.25),
            box((-x - 0.001, h * 0.8, -0.025), (x + 0.001, h + 0.001, 0.025), tape, 0.25),
        ]
        if chance(rng, 0.5):
            parts.append(
                box((x * 0.2, h * 0.5, z - 0.002), (x * 0.75, h * 0.8, z + 0.001), solid("label", (0.93, 0.93, 0.91)))
            )
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
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), side, 0.012),
        soft_box((-w / 2 - 0.008, h - 0.03, -d / 2 - 0.008), (w / 2 + 0.008, h + 0.012, d / 2 + 0.008), lid, 0.008),
    ]
    metal = paint(rng, METALS, "grip")
    grip = spline(
        [
            (-0.045, h * 0.62, d / 2 - 0.002),
            (-0.04, h * 0.58, d / 2 + 0.016),
            (0.04, h * 0.58, d / 2 + 0.016),
            (0.045, h * 0.62, d / 2 - 0.002),
        ],
        9,
    )
    parts.append(tube(grip, 0.005, metal, 6))
    if stuff == "fabric":
        parts.append(
            box((-0.04, h * 0.25, d / 2 - 0.002), (0.04, h * 0.45, d / 2 + 0.002), solid("label", (0.93, 0.92, 0.88)))
        )
    return finish(parts, limits, {"material": stuff, "shape": "rectangular"}, surface=True)


def tissue_box(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A box of tissues, oblong or a cube, one tissue out."""
    w, h, d = (0.23, 0.07, 0.12) if chance(rng, 0.6) else (0.12, 0.13, 0.12)
    side = skin("box", patterns.fabric(rng, 0.15, SOFT + VIVID)[0])
    parts = [
        soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), side, 0.003),
        ellipsoid((0, h, 0), (w * 0.25, 0.002, d * 0.2), BLACK, 16, 4),
    ]
    white = paint(rng, WHITES, "tissue")
    for k in range(3):
        fold = spline(
            [
                (0.012 * (k - 1), h - 0.004, 0.01 * (k - 1)),
                (0.022 * (k - 1), h + 0.035, 0.008),
                (0.05 * (k - 1), h + 0.065 - 0.012 * (k % 2), 0.012 * (k - 1)),
            ],
            6,
        )
        parts.append(leaf(fold, [0.03, 0.05, 0.06, 0.055, 0.04, 0.004], white, (0, 0, 1), 0.4))
    return finish(parts, limits, {"material": "cardboard"})


def teddy_bear(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A sitting teddy bear; with a bow, or as a rabbit with long ears."""
    fur_colour = tone(
        rng,
        (
            (0.60, 0.40, 0.22),
            (0.76, 0.58, 0.36),
            (0.90, 0.84, 0.74),
            (0.38, 0.26, 0.18),
            (0.84, 0.62, 0.66),
            (0.62, 0.62, 0.64),
        ),
    )
    fur, pale = (
        skin("fur", patterns.fur(rng, fur_colour, 64, 0.09)),
        solid("snout", dimmed(fur_colour, 1.5)),
    )
    e, dark = ellipsoid, solid("eye", (0.06, 0.05, 0.05))
    rabbit = chance(rng, 0.25)
    parts = [
        e((0, 0.11, 0), (0.075, 0.1, 0.066), fur),
        e((0, 0.105, 0.03), (0.05, 0.065, 0.045), pale),
        e((0, 0.255, 0.012), (0.072, 0.066, 0.064), fur),
        e((0, 0.237, 0.068), (0.032, 0.026, 0.024), pale),
        e((0, 0.248, 0.09), (0.011, 0.008, 0.008), dark, 8, 5),
    ]
    for s in (-1, 1):
        parts.append(e((s * 0.028, 0.272, 0.067), (0.008, 0.009, 0.006), dark, 8, 5))
        if rabbit:
            parts += [placed(e((0, 0.075, 0), (0.022, 0.08, 0.012), fur), (s * 0.03, 0.3, 0), turn(2, -s * 0.2))]
        else:
            parts += [
                e((s * 0.055, 0.31, 0.0), (0.027, 0.027, 0.014), fur),
                e((s * 0.055, 0.31, 0.009), (0.016, 0.016, 0.009), pale),
            ]
        parts += [
            placed(
                e((0, -0.055, 0), (0.028, 0.068, 0.03), fur),
                (s * 0.068, 0.175, 0.012),
                turn(2, s * 0.5) @ turn(0, -0.5),
            )
        ]
        parts += [
            placed(e((0, 0, 0.065), (0.033, 0.035, 0.08), fur), (s * 0.05, 0.036, 0.01), turn(1, s * 0.4)),
            placed(e((0, 0, 0.142), (0.022, 0.024, 0.006), pale), (s * 0.05, 0.036, 0.01), turn(1, s * 0.4)),
        ]
    if chance(rng, 0.5):
        bow = paint(rng, VIVID, "bow")
        parts += [
            placed(e((s * 0.024, 0, 0), (0.026, 0.016, 0.01), bow, 10, 6), (0, 0.19, 0.068), turn(2, s * 0.3))
            for s in (-1, 1)
        ] + [e((0, 0.19, 0.072), (0.01, 0.01, 0.01), bow, 8, 5)]
    size = between(rng, 0.75, 1.5)
    return finish(
        [placed(p, scale=size) for p in parts],
        limits,
        {"material": "plush", "shape": "rabbit" if rabbit else "bear"},
        smallest=0.5,
    )


def toy_car(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A toy car, truck or bus, about 15-28 cm long."""
    body, glass, tyre, hub = (
        paint(rng, VIVID, "body"),
        solid("window", (0.62, 0.76, 0.84)),
        solid("tyre", (0.10, 0.10, 0.10)),
        paint(rng, METALS + VIVID, "hub"),
    )
    style, long = pick(rng, "car", "truck", "bus"), 0.1
    parts = []
    if style == "car":
        parts += [
            soft_box((-0.1, 0.022, -0.042), (0.1, 0.062, 0.042), body, 0.014, 2),
            soft_box((-0.055, 0.05, -0.037), (0.05, 0.097, 0.037), body, 0.016, 2),
        ]
        parts += [
            soft_box((-0.045, 0.064, -0.0385), (0.04, 0.087, 0.0385), glass, 0.004),
            soft_box((-0.057, 0.066, -0.028), (0.053, 0.086, 0.028), glass, 0.004),
        ]
        parts += [
            ellipsoid((0.098, 0.046, z), (0.006, 0.008, 0.008), solid("headlight", (0.98, 0.94, 0.7)), 8, 5)
            for z in (-0.028, 0.028)
        ]
    elif style == "truck":
        load = paint(rng, VIVID, "bed")
        parts += [
            soft_box((0.035, 0.022, -0.045), (0.12, 0.11, 0.045), body, 0.012, 2),
            soft_box((0.06, 0.07, -0.0465), (0.105, 0.1, 0.0465), glass, 0.004),
            soft_box((0.1, 0.07, -0.036), (0.1215, 0.1, 0.036), glass, 0.004),
            soft_box((-0.13, 0.022, -0.04), (0.05, 0.04, 0.04), BLACK, 0.006),
        ]
        parts += (
            [soft_box((-0.13, 0.04, s * 0.047 - 0.003), (0.028, 0.09, s * 0.047 + 0.003), load, 0.002) for s in (-1, 1)]
            + [soft_box((x, 0.04, -0.047), (x + 0.006, 0.09, 0.047), load, 0.002) for x in (-0.13, 0.022)]
            + [soft_box((-0.13, 0.038, -0.047), (0.028, 0.05, 0.047), load, 0.003)]
        )
        long = 0.12
    else:
        parts += [
            soft_box((-0.13, 0.022, -0.045), (0.13, 0.12, 0.045), body, 0.016, 2),
            soft_box((0.11, 0.07, -0.036), (0.1315, 0.105, 0.036), glass, 0.004),
        ]
        parts += [
            soft_box((x - 0.018, 0.07, -0.0465), (x + 0.018, 0.105, 0.0465), glass, 0.003)
            for x in (-0.095, -0.047, 0.001, 0.049)
        ]
        long = 0.12
    wheel = lathe(
        [(0, 0.012), (0.013, 0.012), (0.013, 0.009), (0.024, 0.008), (0.025, 0), (0.024, -0.008), (0, -0.008)][::-1],
        tyre,
        16,
    )
    cap = lathe([(0.013, 0.0085), (0.011, 0.013), (0, 0.014)], hub, 12)
    for x in (-long * 0.62, long * 0.62):
        for s in (-1, 1):
            parts += [placed(p, (x, 0.025, s * 0.04), turn(0, s * np.pi / 2)) for p in (wheel, cap)]
    size = between(rng, 0.7, 1.2)
    return finish(
        [placed(p, scale=size) for p in parts],
        limits,
        {"shape": style, "material": pick(rng, "plastic", "metal", "wood")},
    )


def ball(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A ball: beach, foot, basket, tennis or plain rubber."""
    style = pick(rng, "beach ball", "football", "basketball", "tennis ball", "rubber ball")
    r = {
        "beach ball": between(rng, 0.12, 0.2),
        "football": 0.11,
        "basketball": 0.12,
        "tennis ball": 0.034,
        "rubber ball": between(rng, 0.06, 0.11),
    }[style]
    u, v = patterns.unit(96)
    if style == "beach ball":
        colours = np.array(
            [
                tone(rng, VIVID),
                (0.95, 0.95, 0.93),
                tone(rng, VIVID),
                (0.95, 0.95, 0.93),
                tone(rng, VIVID),
                tone(rng, VIVID),
            ]
        )
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
    sphere = placed(
        ellipsoid((0, 0, 0), (r, r, r), skin("ball", patterns.to_image(rgb)), 24, 14),
        rotation=turn(0, between(rng, 0.2, 1.2)) @ turn(1, between(rng, 0, 6.3)),
    )
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
    parts = [
        lathe([(0, 0), (foot, 0), (foot, 0.015), (foot * 0.5, 0.035), (0.016, 0.05), (0.014, h), (0, h)], body, 22)
    ]
    wire, head = paint(rng, METALS, "cage"), []
    phi = np.linspace(0, 2 * np.pi, 29)[:-1]
    for z, q in ((0.0, 1.0), (0.05, 0.8), (-0.05, 0.8), (0.058, 0.45), (-0.058, 0.45)):
        head.append(
            tube(np.stack([q * r * np.cos(phi), q * r * np.sin(phi), np.full(28, z)], 1), 0.0025, wire, 4, closed=True)
        )
    spokes = np.stack([turn(2, 2 * np.pi * k / 14) for k in range(14)])
    for z in (-0.055, 0.055):
        wire_bow = tube([(0.03, 0, z), (0.8 * r, 0, 0.9 * z), (r, 0, 0.0)], 0.0018, wire, 4)
        head.append(copies(wire_bow, np.zeros((14, 3)), spokes))
    blade = soft_box(
        (0.02, -0.05, -0.002), (r * 0.82, 0.05, 0.002), paint(rng, VIVID + WHITES + METALS, "blade"), 0.0015
    )
    for k in range(3):
        head.append(placed(blade, rotation=turn(2, 2.1 * k) @ turn(0, 0.5)))
    head += [
        ellipsoid((0, 0, 0.05), (0.032, 0.032, 0.018), body, 14, 8),
        placed(
            lathe([(0, 0), (0.045, 0), (0.05, 0.03), (0.035, 0.12), (0, 0.13)], body, 16),
            (0, 0, -0.05),
            turn(0, -np.pi / 2),
        ),
    ]
    R = turn(1, between(rng, -0.4, 0.4)) @ turn(0, between(rng, -0.2, 0.1))
    return finish(
        [*parts, *(placed(p, (0, h + r * 0.55 if not tall else h, 0.08), R) for p in head)],
        limits,
        {"style": "standing" if tall else "table"},
    )


GENERATORS: dict[str, Generator] = {
    "cardboard box": cardboard_box,
    "storage box": storage_box,
    "tissue box": tissue_box,
    "teddy bear": teddy_bear,
    "toy car": toy_car,
    "ball": ball,
    "building blocks": building_blocks,
    "fan": fan,
    **luggage.GENERATORS,
    **cleaning.GENERATORS,
}
