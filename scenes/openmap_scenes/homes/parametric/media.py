"""Screens, computers, books and small electronics."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import electronics, patterns, reading, scenery
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    DEVICE,
    METALS,
    SOFT,
    VIVID,
    between,
    chance,
    finish,
    paint,
    skin,
    solid,
    tone,
)
from openmap_scenes.homes.parametric.slabs import lying, slab
from openmap_scenes.homes.revolve import ellipsoid, lathe, placed, soft_box, spline, tube, turn
from openmap_scenes.scene import Material


def television(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A flat television on a foot in the middle or on two feet, 0.6-1.4 m wide; now and then an old deep one."""
    body = paint(rng, DARK, "plastic")
    glass = skin("screen", scenery.screen(rng, False))
    if chance(rng, 0.1):
        w = between(rng, 0.45, 0.65)
        h, d = w * 0.8, w * 0.7
        grey = paint(rng, DARK + DEVICE, "plastic")
        parts = [
            soft_box((-w / 2, 0, 0), (w / 2, h, d * 0.4), grey, 0.02, 2),
            soft_box((-w * 0.36, h * 0.08, -d * 0.55), (w * 0.36, h * 0.85, 0.01), grey, 0.06, 2),
        ]
        parts.append(
            soft_box((-w * 0.44, h * 0.16, d * 0.3), (w * 0.44, h * 0.94, d * 0.4 + 0.012), glass, 0.012, 1, puff=0.01)
        )
        return finish(parts, limits, {"style": "old"}, smallest=0.6)
    w = min(between(rng, 0.65, 1.4), max(limits.width - 0.01, 0.45))
    h, d, lift = w * 0.572, between(rng, 0.025, 0.05), between(rng, 0.04, 0.08)
    parts = [placed(p, (0, lift, 0)) for p in slab(w, h, d, body, glass, 0.008)]
    metal = body if chance(rng, 0.5) else paint(rng, METALS, "metal")
    if chance(rng, 0.5):
        parts += [
            soft_box((-0.03, 0.01, -0.02), (0.03, lift + 0.05, -0.004), metal, 0.004),
            soft_box((-w * 0.2, 0, -0.11), (w * 0.2, 0.014, 0.11), metal, 0.005),
        ]
    else:
        for x in (-w * 0.36, w * 0.36):
            for z in (-0.12, 0.12):
                parts.append(tube([(x, lift + 0.01, 0), (x, 0.007, z)], 0.007, metal, 6))
    parts.append(
        soft_box((-w * 0.25, lift + h * 0.1, -d / 2 - 0.03), (w * 0.25, lift + h * 0.6, -d / 2 + 0.004), body, 0.01)
    )
    return finish(parts, limits, {"style": "flat"}, smallest=0.7)


def wall_television(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A flat television with its bracket, for a wall."""
    w = min(between(rng, 0.8, 1.5), max(limits.width - 0.01, 0.5))
    h, d = w * 0.568, between(rng, 0.025, 0.045)
    body = paint(rng, DARK, "plastic")
    parts = slab(w, h, d, body, skin("screen", scenery.screen(rng, False)), 0.007)
    parts.append(soft_box((-0.2, h * 0.3, -d / 2 - 0.03), (0.2, h * 0.7, -d / 2 + 0.004), body, 0.008))
    return finish(parts, limits, {"style": "flat"}, elevation=1.0, smallest=0.7)


def _monitor(rng: np.random.Generator) -> tuple[list[Model], float]:
    body = paint(rng, DEVICE, "plastic")
    w = between(rng, 0.44, 0.68)
    h, d, lift = w * float(rng.choice([0.57, 0.62])), 0.035, between(rng, 0.09, 0.15)
    parts = [placed(p, (0, lift, 0)) for p in slab(w, h, d, body, skin("screen", scenery.screen(rng)), 0.012)]
    if chance(rng, 0.5):
        parts += [
            soft_box((-0.025, 0.008, -0.055), (0.025, lift + h * 0.4, -0.03), body, 0.005),
            soft_box((-0.025, lift + h * 0.3, -0.05), (0.025, lift + h * 0.45, -d / 2 + 0.004), body, 0.005),
        ]
    else:
        parts.append(
            tube(spline([(0, 0.01, -0.06), (0, lift * 0.6, -0.07), (0, lift + h * 0.4, -0.02)], 8), 0.016, body, 10)
        )
    base = (
        lathe([(0, 0), (0.11, 0), (0.112, 0.008), (0.1, 0.014), (0, 0.015)], body, 26)
        if chance(rng, 0.5)
        else soft_box((-0.12, 0, -0.09), (0.12, 0.013, 0.09), body, 0.005)
    )
    return [*parts, placed(base, (0, 0, -0.04))], w


def _keyboard(rng: np.random.Generator, w: float = 0.43, body: Material | None = None) -> list[Model]:
    board, key = tone(rng, DEVICE), tone(rng, DEVICE)
    if sum(abs(a - b) for a, b in zip(board, key, strict=True)) < 0.3:
        key = (0.25, 0.25, 0.27) if sum(board) > 1.5 else (0.30, 0.30, 0.32)
    caps = skin("keys", patterns.keys(rng, board, key, 5, 18 if w > 0.35 else 14))
    case, d = body or solid("keyboard", board), 0.135
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, 0.014, d / 2), case, 0.004)]
    parts.append(
        soft_box(
            (-w / 2 + 0.007, 0.01, -d / 2 + 0.007),
            (w / 2 - 0.007, 0.0185, d / 2 - 0.007),
            {**dict.fromkeys(range(4), case), 4: caps, 5: case},
            0.0015,
        )
    )
    return [placed(p, (0, 0.003, 0), turn(0, 0.05)) for p in parts]


def _mouse(rng: np.random.Generator) -> list[Model]:
    body = paint(rng, DEVICE + VIVID, "mouse")
    return [
        ellipsoid((0, 0.015, 0), (0.031, 0.019, 0.056), body, 16, 8, 0.9, 0.8),
        ellipsoid((0, 0.031, -0.03), (0.004, 0.006, 0.008), solid("wheel", (0.2, 0.2, 0.2)), 8, 5),
    ]


def computer(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A monitor with keyboard and mouse in front of it, perhaps with the computer's tower beside it."""
    parts, w = _monitor(rng)
    parts += [placed(p, (-0.05, 0, 0.22)) for p in _keyboard(rng, 0.43 if chance(rng, 0.6) else 0.3)]
    parts += [placed(p, (0.25, 0, 0.22)) for p in _mouse(rng)]
    if chance(rng, 0.3) and limits.width > w + 0.4:
        case = paint(rng, DARK + DEVICE, "case")
        x = w / 2 + 0.16
        parts += [
            soft_box((x - 0.09, 0, -0.2), (x + 0.09, 0.38, 0.2), case, 0.006),
            soft_box((x - 0.07, 0.28, 0.19), (x + 0.07, 0.32, 0.203), solid("bay", (0.3, 0.3, 0.32)), 0.002),
            ellipsoid((x, 0.22, 0.2), (0.012, 0.012, 0.004), paint(rng, VIVID, "light"), 10, 6),
        ]
    return finish(parts, limits, {"material": "plastic"}, smallest=0.7)


def monitor(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A computer's screen on its stand."""
    return finish(_monitor(rng)[0], limits, {"material": "plastic"})


def keyboard(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A computer's keyboard, long or short."""
    return finish(_keyboard(rng, between(rng, 0.28, 0.46)), limits, {"material": "plastic"})


def laptop(rng: np.random.Generator, limits: Limits) -> Made | None:
    """An open laptop; sometimes closed."""
    shell = paint(rng, DEVICE + VIVID[1:2] + METALS[3:], "shell")
    w = between(rng, 0.3, 0.37)
    d = w * 0.68
    deck = skin("keys", patterns.keys(rng, tone(rng, DEVICE), (0.16, 0.16, 0.17), 5, 14))
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, 0.014, d / 2), shell, 0.004)]
    if chance(rng, 0.15):
        parts.append(soft_box((-w / 2, 0.0155, -d / 2), (w / 2, 0.024, d / 2), shell, 0.0035))
        parts.append(
            tube(
                [(-w * 0.3, 0.014, -d / 2 + 0.004), (w * 0.3, 0.014, -d / 2 + 0.004)],
                0.006,
                solid("hinge", (0.2, 0.2, 0.2)),
                8,
            )
        )
        parts.append(lathe([(0, 0.023), (0.018, 0.023), (0.018, 0.0246), (0, 0.0246)], paint(rng, METALS, "logo"), 16))
        return finish(parts, limits, {"material": "metal", "state": "closed"})
    parts.append(
        soft_box(
            (-w * 0.45, 0.01, -d * 0.4),
            (w * 0.45, 0.0152, d * 0.1),
            {**dict.fromkeys((0, 1, 2, 3, 5), shell), 4: deck},
            0.001,
        )
    )
    parts.append(
        soft_box(
            (-w * 0.15, 0.01, d * 0.16), (w * 0.15, 0.0148, d * 0.43), solid("touchpad", (0.45, 0.46, 0.48)), 0.001
        )
    )
    lid = slab(w, d, 0.008, shell, skin("screen", scenery.screen(rng)), 0.008, 0.003)
    lean = turn(0, -between(rng, 0.15, 0.5))
    parts += [placed(p, (0, 0.01, -d / 2), lean) for p in lid]
    return finish(parts, limits, {"material": "metal", "state": "open"})


def tablet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tablet lying or propped on its cover."""
    w, h = between(rng, 0.15, 0.2), between(rng, 0.22, 0.28)
    if chance(rng, 0.5):
        w, h = h, w
    lid = slab(w, h, 0.008, paint(rng, DEVICE, "shell"), skin("screen", scenery.screen(rng)), 0.01, 0.0035)
    if chance(rng, 0.5):
        return finish(lying(lid, h, 0.008), limits, {"material": "glass"})
    cover = paint(rng, SOFT + VIVID, "cover")
    parts = [placed(p, (0, 0.004, 0.02), turn(0, -0.35)) for p in lid]
    prop = soft_box((-w * 0.3, 0, -0.004), (w * 0.3, h * 0.7, 0.0), cover, 0.0015)
    parts += [
        placed(prop, (0, 0.0, -h * 0.45), turn(0, 0.55)),
        soft_box((-w / 2, 0, -h * 0.45), (w / 2, 0.004, 0.03), cover, 0.0015),
    ]
    return finish(parts, limits, {"material": "glass"})


GENERATORS: dict[str, Generator] = {
    "television": television,
    "wall television": wall_television,
    "computer": computer,
    "monitor": monitor,
    "keyboard": keyboard,
    "laptop": laptop,
    "tablet": tablet,
    **reading.GENERATORS,
    **electronics.GENERATORS,
}
