"""Screens, computers, books and small electronics."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns, scenery
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
    DARK,
    DEVICE,
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
from openmap_scenes.homes.revolve import Array, ellipsoid, lathe, placed, sheet, soft_box, spline, tube, turn
from openmap_scenes.scene import Material

PAPER = solid("pages", (0.93, 0.90, 0.83))


def slab(w: float, h: float, d: float, body: Material, front: Material, rim: float, radius: float = 0.006) -> list[Model]:
    """A flat thing that stands on y = 0 with a picture on its front (+z): a screen, a tablet."""
    shell = soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), body, radius)
    glass = box((-w / 2 + rim, rim, 0), (w / 2 - rim, h - rim, d / 2 + 0.0012), {0: front}, step=0.3)
    frame = _edge(w - 2 * rim, h - 2 * rim, d / 2, front)
    return [shell, placed(glass), *[placed(f, (0, rim, 0)) for f in frame]]


def _edge(w: float, h: float, z: float, material: Material) -> list[Model]:
    """The thin sides of a glass that lies 1.2 mm proud of its frame, so that the surface is closed."""
    return [box((-w / 2, 0, z - 0.001), (w / 2, h, z + 0.0011), {k: material for k in (1, 2, 3, 4, 5)}, step=0.3)]


def television(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A flat television on a foot in the middle or on two feet, 0.6-1.4 m wide; now and then an old deep one."""
    body = paint(rng, DARK, "plastic")
    glass = skin("screen", scenery.screen(rng, False))
    if chance(rng, 0.1):
        w = between(rng, 0.45, 0.65)
        h, d = w * 0.8, w * 0.7
        grey = paint(rng, DARK + DEVICE, "plastic")
        parts = [soft_box((-w / 2, 0, 0), (w / 2, h, d * 0.4), grey, 0.02, 2), soft_box((-w * 0.36, h * 0.08, -d * 0.55), (w * 0.36, h * 0.85, 0.01), grey, 0.06, 2)]
        parts.append(soft_box((-w * 0.44, h * 0.16, d * 0.3), (w * 0.44, h * 0.94, d * 0.4 + 0.012), glass, 0.012, 1, puff=0.01))
        return finish(parts, limits, {"style": "old"}, smallest=0.6)
    w = min(between(rng, 0.65, 1.4), max(limits.width - 0.01, 0.45))
    h, d, lift = w * 0.572, between(rng, 0.025, 0.05), between(rng, 0.04, 0.08)
    parts = [placed(p, (0, lift, 0)) for p in slab(w, h, d, body, glass, 0.008)]
    metal = body if chance(rng, 0.5) else paint(rng, METALS, "metal")
    if chance(rng, 0.5):
        parts += [soft_box((-0.03, 0.01, -0.02), (0.03, lift + 0.05, -0.004), metal, 0.004), soft_box((-w * 0.2, 0, -0.11), (w * 0.2, 0.014, 0.11), metal, 0.005)]
    else:
        for x in (-w * 0.36, w * 0.36):
            for z in (-0.12, 0.12):
                parts.append(tube([(x, lift + 0.01, 0), (x, 0.007, z)], 0.007, metal, 6))
    parts.append(soft_box((-w * 0.25, lift + h * 0.1, -d / 2 - 0.03), (w * 0.25, lift + h * 0.6, -d / 2 + 0.004), body, 0.01))
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
        parts += [soft_box((-0.025, 0.008, -0.055), (0.025, lift + h * 0.4, -0.03), body, 0.005), soft_box((-0.025, lift + h * 0.3, -0.05), (0.025, lift + h * 0.45, -d / 2 + 0.004), body, 0.005)]
    else:
        parts.append(tube(spline([(0, 0.01, -0.06), (0, lift * 0.6, -0.07), (0, lift + h * 0.4, -0.02)], 8), 0.016, body, 10))
    base = lathe([(0, 0), (0.11, 0), (0.112, 0.008), (0.1, 0.014), (0, 0.015)], body, 26) if chance(rng, 0.5) else soft_box((-0.12, 0, -0.09), (0.12, 0.013, 0.09), body, 0.005)
    return [*parts, placed(base, (0, 0, -0.04))], w


def _keyboard(rng: np.random.Generator, w: float = 0.43, body: Material | None = None) -> list[Model]:
    board, key = tone(rng, DEVICE), tone(rng, DEVICE)
    if sum(abs(a - b) for a, b in zip(board, key, strict=True)) < 0.3:
        key = (0.25, 0.25, 0.27) if sum(board) > 1.5 else (0.30, 0.30, 0.32)
    caps = skin("keys", patterns.keys(rng, board, key, 5, 18 if w > 0.35 else 14))
    case, d = body or solid("keyboard", board), 0.135
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, 0.014, d / 2), case, 0.004)]
    parts.append(soft_box((-w / 2 + 0.007, 0.01, -d / 2 + 0.007), (w / 2 - 0.007, 0.0185, d / 2 - 0.007), {**dict.fromkeys(range(4), case), 4: caps, 5: case}, 0.0015))
    return [placed(p, (0, 0.003, 0), turn(0, 0.05)) for p in parts]


def _mouse(rng: np.random.Generator) -> list[Model]:
    body = paint(rng, DEVICE + VIVID, "mouse")
    return [ellipsoid((0, 0.015, 0), (0.031, 0.019, 0.056), body, 16, 8, 0.9, 0.8), ellipsoid((0, 0.031, -0.03), (0.004, 0.006, 0.008), solid("wheel", (0.2, 0.2, 0.2)), 8, 5)]


def computer(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A monitor with keyboard and mouse in front of it, perhaps with the computer's tower beside it."""
    parts, w = _monitor(rng)
    parts += [placed(p, (-0.05, 0, 0.22)) for p in _keyboard(rng, 0.43 if chance(rng, 0.6) else 0.3)]
    parts += [placed(p, (0.25, 0, 0.22)) for p in _mouse(rng)]
    if chance(rng, 0.3) and limits.width > w + 0.4:
        case = paint(rng, DARK + DEVICE, "case")
        x = w / 2 + 0.16
        parts += [soft_box((x - 0.09, 0, -0.2), (x + 0.09, 0.38, 0.2), case, 0.006), soft_box((x - 0.07, 0.28, 0.19), (x + 0.07, 0.32, 0.203), solid("bay", (0.3, 0.3, 0.32)), 0.002), ellipsoid((x, 0.22, 0.2), (0.012, 0.012, 0.004), paint(rng, VIVID, "light"), 10, 6)]  # fmt: skip
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
        parts.append(tube([(-w * 0.3, 0.014, -d / 2 + 0.004), (w * 0.3, 0.014, -d / 2 + 0.004)], 0.006, solid("hinge", (0.2, 0.2, 0.2)), 8))
        parts.append(lathe([(0, 0.023), (0.018, 0.023), (0.018, 0.0246), (0, 0.0246)], paint(rng, METALS, "logo"), 16))
        return finish(parts, limits, {"material": "metal", "state": "closed"})
    parts.append(soft_box((-w * 0.45, 0.01, -d * 0.4), (w * 0.45, 0.0152, d * 0.1), {**dict.fromkeys((0, 1, 2, 3, 5), shell), 4: deck}, 0.001))
    parts.append(soft_box((-w * 0.15, 0.01, d * 0.16), (w * 0.15, 0.0148, d * 0.43), solid("touchpad", (0.45, 0.46, 0.48)), 0.001))
    lid = slab(w, d, 0.008, shell, skin("screen", scenery.screen(rng)), 0.008, 0.003)
    lean = turn(0, -between(rng, 0.15, 0.5))
    parts += [placed(p, (0, 0.01, -d / 2), lean) for p in lid]
    return finish(parts, limits, {"material": "metal", "state": "open"})


def _lying(models: list[Model], h: float, d: float) -> list[Model]:
    """A slab laid on its back: front up, its top to -z."""
    return [placed(p, (0, d / 2, h / 2), turn(0, -np.pi / 2)) for p in models]


def tablet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tablet lying or propped on its cover."""
    w, h = between(rng, 0.15, 0.2), between(rng, 0.22, 0.28)
    if chance(rng, 0.5):
        w, h = h, w
    lid = slab(w, h, 0.008, paint(rng, DEVICE, "shell"), skin("screen", scenery.screen(rng)), 0.01, 0.0035)
    if chance(rng, 0.5):
        return finish(_lying(lid, h, 0.008), limits, {"material": "glass"})
    cover = paint(rng, SOFT + VIVID, "cover")
    parts = [placed(p, (0, 0.004, 0.02), turn(0, -0.35)) for p in lid]
    prop = soft_box((-w * 0.3, 0, -0.004), (w * 0.3, h * 0.7, 0.0), cover, 0.0015)
    parts += [placed(prop, (0, 0.0, -h * 0.45), turn(0, 0.55)), soft_box((-w / 2, 0, -h * 0.45), (w / 2, 0.004, 0.03), cover, 0.0015)]
    return finish(parts, limits, {"material": "glass"})


def _book(w: float, h: float, t: float, front: Material, cloth: Material) -> list[Model]:
    """A book lying with its spine along -x: boards above and below, pages between."""
    b = 0.0025
    boards = [
        box((-w / 2, y, -h / 2), (w / 2, y + b, h / 2), {**dict.fromkeys((0, 1, 2, 3, 5), cloth), 4: top})
        for y, top in ((0, cloth), (t - b, front))
    ]
    spine = box((-w / 2 - 0.001, 0, -h / 2), (-w / 2 + 0.002, t, h / 2), cloth)
    pages = box((-w / 2 + 0.001, b, -h / 2 + 0.003), (w / 2 - 0.004, t - b, h / 2 - 0.003), {k: PAPER for k in range(6)})
    return [*boards, spine, pages]


def _cover(rng: np.random.Generator) -> tuple[Material, Material]:
    image = patterns.cover(rng)
    return skin("cover", image), solid("cloth", tuple((image[2, 2] / 255.0).tolist()))  # type: ignore[arg-type]


def book(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A book lying closed, or open with its pages bending to both sides."""
    w, h, t = between(rng, 0.12, 0.19), between(rng, 0.18, 0.27), between(rng, 0.015, 0.045)
    front, cloth = _cover(rng)
    if chance(rng, 0.25):
        s = np.linspace(-1, 1, 17)
        swell = 0.012 + 0.016 * np.abs(s) ** 0.5 * (1 - np.abs(s)) * 2
        lines = np.full((64, 64, 3), 236, np.uint8)
        lines[8:56:4, 6:28] = lines[8:56:4, 36:58] = 150
        points = np.stack([np.broadcast_to(s * w, (3, 17)), np.broadcast_to(swell, (3, 17)), np.repeat(np.linspace(h / 2, -h / 2, 3)[:, None], 17, 1)], 2)
        low = points.copy()
        low[..., 1] = 0.004
        parts = [sheet(points, 0.003, skin("pages", lines)), soft_box((-w - 0.004, 0, -h / 2 - 0.003), (w + 0.004, 0.004, h / 2 + 0.003), cloth, 0.001), sheet((points + low) / 2, 0.006, PAPER)]  # fmt: skip
        return finish(parts, limits, {"material": "paper", "state": "open"})
    return finish(_book(w, h, t, front, cloth), limits, {"material": "paper"})


def books(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A pile of books lying, a row standing, or a row that leans."""
    parts: list[Model] = []
    if chance(rng, 0.5):
        y = 0.0
        for _ in range(int(rng.integers(2, 7))):
            w, h, t = between(rng, 0.13, 0.19), between(rng, 0.19, 0.26), between(rng, 0.015, 0.045)
            R = turn(1, float(rng.normal(0, 0.14)))
            at = between(rng, -0.01, 0.01), y, between(rng, -0.01, 0.01)
            parts += [placed(p, at, R) for p in _book(w, h, t, *_cover(rng))]
            y += t + 0.0005
        return finish(parts, limits, {"material": "paper", "style": "pile"})
    x, n = 0.0, int(rng.integers(4, 10))
    for k in range(n):
        w, h, t = between(rng, 0.13, 0.18), between(rng, 0.18, 0.26), between(rng, 0.014, 0.045)
        upright = [placed(p, (0, h / 2, w / 2), turn(1, np.pi / 2) @ turn(0, np.pi / 2)) for p in _book(w, h, t, *_cover(rng))]
        lean = 0.25 if k == n - 1 and chance(rng, 0.5) else 0.0
        along = np.concatenate([(p.vertices @ turn(2, lean).T)[:, 0] for p in upright])
        parts += [placed(p, (x - float(along.min()), 0, -w / 2), turn(2, lean)) for p in upright]
        x += float(np.ptp(along)) + 0.0008
    return finish(parts, limits, {"material": "paper", "style": "row"})


def magazine(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A magazine, or a few of them fanned."""
    n, parts = int(rng.integers(1, 5)), []
    for k in range(n):
        w, h, t = 0.21, 0.28, between(rng, 0.003, 0.007)
        page = {**dict.fromkeys((0, 1, 2, 3, 5), PAPER), 4: skin("cover", patterns.cover(rng))}
        flat = soft_box((-w / 2, 0, -h / 2), (w / 2, t, h / 2), page, 0.001, step=0.1)
        parts.append(placed(flat, (0.015 * k, 0.0075 * k, 0.01 * k), turn(1, float(rng.normal(0, 0.2)) if n > 1 else 0.0)))
    return finish(parts, limits, {"material": "paper"})


def remote_control(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A remote control with rows of buttons."""
    w, h, t = between(rng, 0.038, 0.052), between(rng, 0.14, 0.21), 0.018
    body = paint(rng, DARK + DEVICE, "plastic")
    parts = [soft_box((-w / 2, 0, -h / 2), (w / 2, t, h / 2), body, 0.006, 2)]
    pale = paint(rng, ((0.80, 0.80, 0.80), (0.45, 0.46, 0.48)), "button")
    for row in range(6):
        for column in (-1, 0, 1):
            mat = solid("red button", (0.75, 0.12, 0.12)) if row == 0 and column < 0 else pale
            parts.append(placed(ellipsoid((0, 0, 0), (0.0055, 0.003, 0.0045), mat, 8, 4), (column * w * 0.28, t, (row / 6 - 0.42) * h)))
    parts.append(placed(lathe([(0.008, -0.002), (0.013, 0.002), (0.008, 0.003), (0, 0.003)], pale, 14), (0, t - 0.001, h * 0.32)))
    return finish(parts, limits, {"material": "plastic"})


def phone(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A mobile phone lying, or a desk telephone with its handset."""
    if chance(rng, 0.5):
        lid = slab(0.073, 0.15, 0.009, paint(rng, DEVICE + VIVID, "shell"), skin("screen", scenery.screen(rng)), 0.0035, 0.004)
        return finish(_lying(lid, 0.15, 0.009), limits, {"style": "mobile"})
    body = paint(rng, DARK + WHITES + VIVID[:2] + SOFT[:2], "plastic")
    parts = [placed(soft_box((-0.1, 0, -0.1), (0.1, 0.045, 0.1), body, 0.015, 2), (0, 0.002, 0), turn(0, 0.12))]
    for row in range(4):
        for column in range(3):
            parts.append(soft_box((column * 0.024 - 0.005, 0.04, row * 0.022 - 0.035), (column * 0.024 + 0.012, 0.052 - row * 0.003, row * 0.022 - 0.02), solid("key", (0.85, 0.85, 0.83)), 0.003))
    bar = spline([(-0.065, 0.062, 0.085), (-0.065, 0.082, 0.04), (-0.065, 0.085, -0.03), (-0.065, 0.07, -0.08)], 9)
    parts += [tube(bar, 0.014, body, 10), ellipsoid((-0.065, 0.06, 0.085), (0.028, 0.02, 0.026), body, 14, 8), ellipsoid((-0.065, 0.065, -0.085), (0.028, 0.02, 0.026), body, 14, 8)]
    return finish(parts, limits, {"style": "desk"})


def game_console(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A console lying or standing with a controller before it."""
    body, accent = paint(rng, DARK + WHITES, "plastic"), paint(rng, VIVID + DARK, "accent")
    w, h, d = between(rng, 0.26, 0.32), between(rng, 0.045, 0.07), between(rng, 0.2, 0.27)
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), body, 0.012, 2), box((-w / 2 + 0.02, h * 0.45, 0), (w / 2 - 0.02, h * 0.55, d / 2 + 0.0015), accent)]
    pad = [ellipsoid((0, 0.022, 0), (0.05, 0.018, 0.03), body, 18, 8, 0.7, 0.7)]
    for side in (-1, 1):
        pad += [placed(ellipsoid((0, 0, 0), (0.018, 0.016, 0.045), body, 12, 8), (side * 0.055, 0.018, 0.022), turn(1, side * 0.35)), ellipsoid((side * 0.025, 0.042, 0.014), (0.009, 0.005, 0.009), accent, 10, 5), ellipsoid((side * 0.052, 0.036, -0.008), (0.006, 0.004, 0.006), accent, 8, 4)]  # fmt: skip
    aside, R = between(rng, -0.06, 0.06), turn(1, between(rng, -0.4, 0.4))
    parts += [placed(p, (aside, 0, d / 2 + 0.08), R) for p in pad]
    return finish(parts, limits, {"material": "plastic"})


def _cone(at: Array, r: float, rim: Material) -> list[Model]:
    """A loudspeaker's cone that looks along +z."""
    dark = solid("cone", (0.12, 0.12, 0.13))
    parts = [lathe([(r * 1.12, -0.004), (r * 1.12, 0.004), (r, 0.005), (r * 0.9, 0.002)], rim, 22), lathe([(r * 0.92, 0.002), (r * 0.8, 0.004), (r * 0.35, 0.0012), (r * 0.25, 0.004), (0, 0.007)], dark, 22)]
    return [placed(p, at, turn(0, np.pi / 2)) for p in parts]


def speaker(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A shelf speaker, a tower, or a round wireless one."""
    style = pick(rng, "shelf", "tower", "round")
    wood = skin("wood", patterns.wood(rng)) if chance(rng, 0.5) else paint(rng, DARK + WHITES, "case")
    if style == "round":
        r, h = between(rng, 0.045, 0.075), between(rng, 0.1, 0.2)
        mesh = skin("mesh", patterns.dots(rng, tone(rng, SOFT + DARK), (0.2, 0.2, 0.22), 24))
        profile = [(0, 0), (r * 0.9, 0), (r, 0.01), (r, h - 0.012), (r * 0.9, h)]
        return finish([lathe(profile, mesh, 24), lathe([(r * 0.9, h), (r * 0.7, h + 0.004), (0, h + 0.003)], paint(rng, DARK, "top"), 24)], limits, {"shape": "round"})
    w, h, d = (0.18, between(rng, 0.27, 0.36), 0.22) if style == "shelf" or limits.height < 0.8 else (0.21, between(rng, 0.85, 1.1), 0.28)
    rim = paint(rng, METALS + DARK, "rim")
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h, d / 2), wood, 0.004), *_cone(np.array([0, h - 0.2 if h > 0.5 else h * 0.36, d / 2]), w * 0.38, rim), *_cone(np.array([0, h - 0.07, d / 2]), 0.025, rim)]
    if h > 0.5:
        parts += _cone(np.array([0, h - 0.38, d / 2]), w * 0.38, rim)
    return finish(parts, limits, {"style": style})


def radio(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A radio with a grille, a dial and knobs; a handle and an aerial."""
    w, h, d = between(rng, 0.22, 0.32), between(rng, 0.13, 0.18), between(rng, 0.07, 0.1)
    case = skin("wood", patterns.wood(rng)) if chance(rng, 0.35) else paint(rng, VIVID + SOFT + CASES, "case")
    metal, z = paint(rng, METALS, "metal"), d / 2
    grille = skin("grille", patterns.stripes(rng, [(0.75, 0.70, 0.60), (0.35, 0.32, 0.28)], 12, bool(chance(rng, 0.5)), 64))
    parts = [soft_box((-w / 2, 0, -z), (w / 2, h, z), case, 0.018, 2)]
    parts += [soft_box((-w * 0.43, h * 0.15, z - 0.004), (w * 0.1, h * 0.85, z + 0.002), grille, 0.001), soft_box((w * 0.15, h * 0.55, z - 0.004), (w * 0.43, h * 0.82, z + 0.002), solid("dial", (0.92, 0.88, 0.74)), 0.001)]
    for x in (0.21, 0.36):
        parts.append(placed(lathe([(0.019, 0), (0.017, 0.012), (0, 0.012)], metal, 16), (w * x, h * 0.3, z - 0.001), turn(0, np.pi / 2)))
    if chance(rng, 0.5):
        parts.append(tube(spline([(-w * 0.4, h - 0.01, 0), (-w * 0.36, h + 0.035, 0), (w * 0.36, h + 0.035, 0), (w * 0.4, h - 0.01, 0)], 12), 0.005, metal, 6))
    parts.append(tube([(w * 0.42, h - 0.01, -z * 0.6), (w * 0.6, h + 0.13, -z * 0.6)], 0.002, metal, 5))
    return finish(parts, limits, {"style": "portable"})


CASES = WOODS[:2]


def printer(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A printer with paper in its tray, a lid and a small panel."""
    w, h, d = between(rng, 0.38, 0.46), between(rng, 0.14, 0.24), between(rng, 0.3, 0.38)
    body, dark = paint(rng, DEVICE + WHITES, "plastic"), solid("slot", (0.15, 0.15, 0.16))
    sheets = solid("paper", (0.96, 0.96, 0.95))
    parts = [soft_box((-w / 2, 0, -d / 2), (w / 2, h * 0.75, d / 2), body, 0.015, 2), soft_box((-w * 0.49, h * 0.77, -d * 0.49), (w * 0.49, h, d * 0.42), body, 0.012, 2)]
    parts += [soft_box((-w * 0.33, h * 0.2, d / 2 - 0.01), (w * 0.33, h * 0.48, d / 2 + 0.0015), dark, 0.001), soft_box((-w * 0.3, h * 0.2, d / 2), (w * 0.3, h * 0.24, d / 2 + 0.13), body, 0.003), soft_box((-0.105, h * 0.25, d / 2), (0.105, h * 0.27, d / 2 + 0.11), sheets, 0.001)]  # fmt: skip
    tray = [soft_box((-0.13, 0, -0.006), (0.13, 0.16, 0), body, 0.003), soft_box((-0.105, 0, 0.001), (0.105, 0.21, 0.008), sheets, 0.001)]
    if chance(rng, 0.6):
        parts += [placed(p, (0, h * 0.7, -d * 0.46), turn(0, -0.3)) for p in tray]
    parts.append(soft_box((w * 0.2, h * 0.55, d / 2 - 0.006), (w * 0.42, h * 0.7, d / 2 + 0.0015), solid("panel", (0.25, 0.40, 0.55)), 0.001))
    return finish(parts, limits, {"material": "plastic"})


GENERATORS: dict[str, Generator] = {
    "television": television,
    "wall television": wall_television,
    "computer": computer,
    "monitor": monitor,
    "keyboard": keyboard,
    "laptop": laptop,
    "tablet": tablet,
    "book": book,
    "books": books,
    "magazine": magazine,
    "remote control": remote_control,
    "phone": phone,
    "game console": game_console,
    "speaker": speaker,
    "radio": radio,
    "printer": printer,
}
