"""Cupboards: wardrobe, cabinet, glass cabinet, sideboard, TV stand, chests, shoe and filing cabinets, coat rack."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import finishes
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.parts import (
    Size,
    base,
    carcass,
    doors,
    draw_size,
    drawer_fronts,
    front,
    handle,
    made,
)
from openmap_scenes.homes.parametric.shelving import Filling
from openmap_scenes.homes.solids import arc, bent, box, cylinder, lathe, moved, rounded_box, tube
from openmap_scenes.scene import Material


@dataclass(frozen=True)
class Look:
    """What a cupboard is made of: case, fronts, metal; how its fronts and handles look; what it stands on."""

    case: Material
    fronts: Material
    iron: Material
    grip: str
    framed: bool
    foot: str
    low: float
    material: str


def _look(rng: np.random.Generator, *feet: str) -> Look:
    case, name = finishes.wood(rng)
    if rng.random() < 0.35:
        case, name = finishes.painted(finishes.shade(rng, finishes.PAINTS)), "wood"
    fronts = finishes.painted(finishes.shade(rng, finishes.PAINTS)) if rng.random() < 0.25 else case
    iron, _ = finishes.metal(rng)
    foot = finishes.choose(rng, *(feet or ("tapered", "block", "pins", "plinth", "sled")))
    low = {"plinth": 0.06, "block": 0.09, "sled": 0.14}.get(foot, 0.15)
    grip = finishes.choose(rng, "bar", "bar", "knob", "knob", "cup", "strip")
    return Look(case, fronts, iron, grip, bool(rng.random() < 0.35), foot, low, name)


def _case(
    rng: np.random.Generator, size: Size, look: Look
) -> tuple[list[Model], tuple[float, float], tuple[float, float], float]:
    """Base, body and top of a closed cupboard; the corners (x, y) of its front and its depth z."""
    w, d, h = size
    z = d / 2 - 0.03
    lip = 0.0 if rng.random() < 0.5 else 0.008
    parts = base(rng, look.foot, w - 0.02, d - 0.02, look.low, look.case, look.iron)
    parts.append(
        rounded_box((-w / 2 + lip, look.low, -d / 2), (w / 2 - lip, h - 0.025, z), look.case, 0.002, grain="x")
    )
    parts.append(
        rounded_box((-w / 2, h - 0.025, -d / 2), (w / 2, h, d / 2 - 0.004), look.case, 0.004, grain="x", step=0.25)
    )
    return parts, (-w / 2 + lip + 0.004, look.low + 0.004), (w / 2 - lip - 0.004, h - 0.03), z


def wardrobe(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A wardrobe: hinged doors, drawers below, a mirror, or sliding doors."""
    size = draw_size(rng, limits, (0.8, 2.2), (0.52, 0.64), (1.85, 2.3))
    if size is None:
        return None
    look = _look(rng, "plinth", "plinth", "block")
    parts, low, high, z = _case(rng, size, look)
    style = finishes.choose(rng, "hinged", "hinged", "drawers", "mirror", "sliding")
    count = max(2, round((high[0] - low[0]) / 0.5))
    words = {"material": look.material}
    if style == "sliding":
        count = 2 if size[0] < 1.8 else 3
        w = (high[0] - low[0]) / count
        for k in range(count):
            out = 0.004 + (k % 2) * 0.010
            x0 = low[0] + k * w
            m = finishes.mirror_glass() if k == 1 else look.fronts
            parts.append(
                rounded_box((x0 - 0.01 * (k > 0), low[1], z - 0.01), (x0 + w, high[1], z + out), look.iron, 0.001)
            )
            parts.append(box((x0 + 0.02, low[1] + 0.03, z), (x0 + w - 0.03, high[1] - 0.03, z + out + 0.004), m, "y"))
        return made(parts, size, words | {"style": "with mirror"})
    bottom = low[1]
    if style == "drawers":
        bottom = low[1] + 0.42
        parts += drawer_fronts(
            low, (high[0], bottom), z, max(1, count // 2), 2, look.fronts, look.iron, look.grip, framed=look.framed
        )
        words["style"] = "with drawers"
    parts += doors((low[0], bottom), high, z, count, look.fronts, look.iron, look.grip, look.framed, 0.45)
    if style == "mirror":
        w = (high[0] - low[0]) / count
        k = count // 2
        x0 = low[0] + k * w
        parts.append(
            box(
                (x0 + 0.08, bottom + 0.1, z + 0.01), (x0 + w - 0.08, high[1] - 0.1, z + 0.0205), finishes.mirror_glass()
            )
        )
        words["style"] = "with mirror"
    return made(parts, size, words)


def cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cupboard to the chest: doors, with drawers above or below."""
    size = draw_size(rng, limits, (0.6, 1.2), (0.35, 0.48), (0.8, 1.4))
    if size is None:
        return None
    look = _look(rng)
    parts, low, high, z = _case(rng, size, look)
    style, n = finishes.choose(rng, "doors", "above", "below"), 2 if size[0] < 1.05 else 3
    a, b = low, high
    if style != "doors":
        cut = high[1] - 0.18 if style == "above" else low[1] + 0.2
        drawers = ((low[0], cut), high) if style == "above" else (low, (high[0], cut))
        parts += drawer_fronts(*drawers, z, n, 1, look.fronts, look.iron, look.grip, framed=look.framed)
        a, b = (low, (high[0], cut)) if style == "above" else ((low[0], cut), high)
    parts += doors(a, b, z, n, look.fronts, look.iron, look.grip, look.framed, 0.6)
    return made(parts, size, {"material": look.material} | ({"style": "with drawers"} if style != "doors" else {}))


def glass_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A tall cupboard whose doors are glass above: crockery shows as pale shapes behind bars."""
    size = draw_size(rng, limits, (0.7, 1.2), (0.35, 0.45), (1.5, 2.0))
    if size is None:
        return None
    w, d, h = size
    look = _look(rng, "plinth", "block", "tapered")
    parts, low, high, z = _case(rng, (w, d, 0.8), look)
    parts += doors(low, high, z, 2, look.fronts, look.iron, look.grip, look.framed, 0.8)
    deep, fill = d - 0.06, Filling(rng)
    parts += [moved(p, 0, 0, -0.03) for p in carcass(w - 0.03, deep, 0.8, h - 0.03, look.case)]
    parts.append(rounded_box((-w / 2, h - 0.03, -d / 2), (w / 2, h, d / 2 - 0.02), look.case, 0.008))
    z1, x = d / 2 - 0.06, w / 2 - 0.035
    rows = 3
    step = (h - 0.85) / rows
    for r in range(rows):
        y = 0.82 + r * step
        if r:
            parts.append(box((-x, y - 0.012, -d / 2 + 0.01), (x, y, z1 - 0.03), look.case))
        parts += fill.ornaments(-x, x, y, -d / 2 + 0.02, z1 - 0.05, step - 0.04)
    glass = finishes.glass(rng)
    # Panes up to half the height of each door: behind them nothing could be seen, above them what the cupboard holds.
    for s in (-1, 1):
        x0, x1 = sorted((s * 0.002, s * (w / 2 - 0.016)))
        y0, y1, e = 0.805, h - 0.035, 0.045
        parts += [
            rounded_box((x0, y0, z1), (x0 + e, y1, z1 + 0.02), look.fronts, 0.002),
            rounded_box((x1 - e, y0, z1), (x1, y1, z1 + 0.02), look.fronts, 0.002),
            rounded_box((x0 + e, y0, z1), (x1 - e, y0 + e, z1 + 0.02), look.fronts, 0.002),
            rounded_box((x0 + e, y1 - e, z1), (x1 - e, y1, z1 + 0.02), look.fronts, 0.002),
        ]
        parts += [
            box((x0 + e, y0 + k * step - 0.009, z1), (x1 - e, y0 + k * step + 0.009, z1 + 0.016), look.fronts)
            for k in (1, 2)
        ]
        parts.append(box((x0 + e, y0 + e, z1 + 0.004), (x1 - e, y0 + step - 0.009, z1 + 0.010), glass))
        parts += handle("knob", s * 0.03, 1.15, z1 + 0.02, look.iron)
    return made(parts, size, {"material": look.material, "style": "with glass doors"}, surface=False)


def sideboard(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A long, low cupboard: doors and a stack of drawers."""
    size = draw_size(rng, limits, (1.2, 2.0), (0.38, 0.48), (0.68, 0.9))
    if size is None:
        return None
    look = _look(rng)
    parts, low, high, z = _case(rng, size, look)
    n = max(3, round(size[0] / 0.48))
    w = (high[0] - low[0]) / n
    stack = int(rng.integers(n))
    for k in range(n):
        a, b = (low[0] + k * w, low[1]), (low[0] + (k + 1) * w, high[1])
        if k == stack:
            parts += drawer_fronts(
                a, b, z, 1, int(rng.integers(3, 5)), look.fronts, look.iron, look.grip, framed=look.framed
            )
        else:
            parts += doors(a, b, z, 1, look.fronts, look.iron, look.grip, look.framed, 0.7)
    return made(parts, size, {"material": look.material, "style": "with drawers"})


def tv_stand(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A low board for a television: open bays with boxes between drawers or doors."""
    size = draw_size(rng, limits, (1.1, 2.0), (0.36, 0.45), (0.38, 0.58))
    if size is None:
        return None
    w, d, h = size
    look, fill = _look(rng, "tapered", "pins", "sled", "plinth"), Filling(rng)
    parts = base(rng, look.foot, w - 0.02, d - 0.02, look.low, look.case, look.iron)
    parts += carcass(w, d, look.low, h, look.case, 0.025)
    n = 3 if w > 1.3 else 2
    wide, y0, y1, z = (w - 0.05) / n, look.low + 0.025, h - 0.025, d / 2 - 0.02
    bays = [bool(rng.random() < 0.5) for _ in range(n)]
    bays[int(rng.integers(n))] = True
    for k in range(n):
        a, b = -w / 2 + 0.025 + k * wide, -w / 2 + 0.025 + (k + 1) * wide
        if k:
            parts.append(rounded_box((a - 0.01, y0, -d / 2 + 0.01), (a + 0.01, y1, z - 0.002), look.case, 0.001))
        if bays[k]:
            middle = (y0 + y1) / 2
            if y1 - y0 > 0.24:
                parts.append(
                    rounded_box(
                        (a + 0.01, middle - 0.009, -d / 2 + 0.01),
                        (b - 0.01, middle + 0.009, z - 0.01),
                        look.case,
                        0.001,
                    )
                )
                parts += fill.board(a + 0.02, b - 0.02, middle + 0.009, -d / 2 + 0.02, z - 0.03, y1 - middle - 0.02)
            black = finishes.painted((0.10, 0.10, 0.11), "device")
            if rng.random() < 0.6:
                x = (a + b) / 2
                parts.append(rounded_box((x - 0.17, y0, -0.1), (x + 0.17, y0 + 0.05, z - 0.06), black, 0.004))
        else:
            rows = 2 if rng.random() < 0.5 and y1 - y0 > 0.25 else 1
            parts += drawer_fronts(
                (a + 0.008, y0), (b - 0.008, y1), z - 0.019, 1, rows, look.fronts, look.iron, look.grip
            )
    return made(parts, size, {"material": look.material})


def chest_of_drawers(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Drawers over each other, three to six."""
    size = draw_size(rng, limits, (0.6, 1.1), (0.40, 0.52), (0.75, 1.25))
    return _drawers(rng, size, 1)


def dresser(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A wide, low chest with two or three columns of drawers."""
    size = draw_size(rng, limits, (1.15, 1.7), (0.42, 0.52), (0.72, 0.9))
    return _drawers(rng, size, 2 if size is None or size[0] < 1.45 else 3)


def _drawers(rng: np.random.Generator, size: Size | None, columns: int) -> Made | None:
    if size is None:
        return None
    look = _look(rng)
    parts, low, high, z = _case(rng, size, look)
    rows = max(3, round((high[1] - low[1]) / float(rng.uniform(0.17, 0.23))))
    cut = high[1]
    if rng.random() < 0.5:
        cut = high[1] - 0.7 * (high[1] - low[1]) / rows
        parts += drawer_fronts(
            (low[0], cut), high, z, columns + 1, 1, look.fronts, look.iron, look.grip, framed=look.framed
        )
        rows -= 1
    parts += drawer_fronts(low, (high[0], cut), z, columns, rows, look.fronts, look.iron, look.grip, framed=look.framed)
    return made(parts, size, {"material": look.material, "style": "with drawers"})


def shoe_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A shallow cupboard whose fronts tip out: two to four wide flaps, or louvred doors."""
    size = draw_size(rng, limits, (0.5, 1.0), (0.20, 0.34), (0.8, 1.25))
    if size is None:
        return None
    look = _look(rng, "plinth", "block", "pins")
    parts, low, high, z = _case(rng, size, look)
    if rng.random() < 0.6:
        rows = 2 if size[2] < 1.0 else 3
        columns = 1 if size[0] < 0.8 else 2
        parts += drawer_fronts(
            low, high, z, columns, rows, look.fronts, look.iron, "strip" if look.grip == "bar" else "knob"
        )
    else:
        w = (high[0] - low[0]) / 2
        for k in range(2):
            x0, x1 = low[0] + k * w + 0.003, low[0] + (k + 1) * w - 0.003
            parts.append(front((x0, low[1]), (x1, high[1]), z, look.fronts, True))
            n = int((high[1] - low[1] - 0.14) / 0.055)
            ys = np.linspace(low[1] + 0.07, high[1] - 0.1, n)
            parts += [
                rounded_box((x0 + 0.06, y, z + 0.006), (x1 - 0.06, y + 0.032, z + 0.016), look.fronts, 0.004)
                for y in ys.tolist()
            ]
            parts += handle("knob", x1 - 0.03 if k == 0 else x0 + 0.03, (low[1] + high[1]) / 2, z + 0.018, look.iron)
    return made(parts, size, {"material": look.material})


def coat_rack(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A stand for coats: a post with hooks on splayed feet, or a rail between two frames with a shelf."""
    size = draw_size(rng, limits, (0.42, 0.56), (0.42, 0.56), (1.6, 1.85))
    if size is None:
        return None
    w, d, h = size
    wood, name = finishes.wood(rng)
    iron, word = finishes.metal(rng)
    m, called = (wood, name) if rng.random() < 0.55 else (iron, word)
    r = min(w, d) / 2
    parts: list[Model] = [lathe([(0.022, 0.05), (0.022, h - 0.06), (0.03, h - 0.04), (0.015, h)], m, (), 14)]
    feet = int(rng.integers(3, 5))
    disc = rng.random() < 0.3
    if disc:
        parts.append(cylinder(r * 0.75, 0.0, 0.03, m, 0.01, 30))
    for k in range(feet):
        c, s = np.sin(2 * np.pi * k / feet), np.cos(2 * np.pi * k / feet)
        if not disc:
            parts.append(
                tube(
                    bent(
                        [(0, 0.28, 0), (c * r * 0.5, 0.2, s * r * 0.5), (c * (r - 0.02), 0.015, s * (r - 0.02))], 0.1, 3
                    ),
                    0.016,
                    m,
                )
            )
    hooks = int(rng.integers(4, 7))
    for k in range(hooks):
        c, s = np.sin(2 * np.pi * (k + 0.3) / hooks), np.cos(2 * np.pi * (k + 0.3) / hooks)
        y = h - 0.1 - 0.12 * (k % 2)
        parts.append(
            tube(arc((0, y, 0), (c * 0.13, y - 0.02, s * 0.13), (c * 0.18, y + 0.09, s * 0.18), 7), 0.010, m, 7)
        )
    for k in range(int(rng.integers(0, 3))):
        # A coat hangs as a long soft cone from a hook.
        cloth = finishes.cloth(rng)
        c, s = np.sin(2 * np.pi * (k + 0.3) / hooks), np.cos(2 * np.pi * (k + 0.3) / hooks)
        y = h - 0.1 - 0.12 * (k % 2)
        shape = [(0.03, y + 0.03), (0.07, y - 0.05), (0.09, y - 0.3), (0.11, y - 0.75), (0.10, y - 0.78)]
        parts.append(moved(lathe(shape, cloth, {0, 3}, 14), c * 0.13, 0, s * 0.13))
    return made(parts, size, {"material": called}, surface=False)


def filing_cabinet(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A metal case of two to four deep drawers with label frames, or a low one on castors."""
    size = draw_size(rng, limits, (0.40, 0.5), (0.45, 0.62), (0.55, 1.32))
    if size is None:
        return None
    w, d, h = size
    tone = finishes.shade(
        rng, ((0.62, 0.64, 0.65), (0.86, 0.86, 0.84), (0.24, 0.25, 0.27), (0.45, 0.52, 0.5), (0.75, 0.7, 0.6))
    )
    steel, black = finishes.painted(tone, "steel"), finishes.painted((0.12, 0.12, 0.12))
    iron, _ = finishes.metal(rng, "chrome", "steel")
    foot, z = 0.05, d / 2 - 0.03
    parts = [rounded_box((-w / 2, foot, -d / 2), (w / 2, h, z), steel, 0.004, grain="y")]
    if h < 0.75:
        parts += [
            moved(cylinder(0.022, 0.0, foot, black, sides=10), x, 0, s)
            for x in (-w / 2 + 0.05, w / 2 - 0.05)
            for s in (-d / 2 + 0.06, z - 0.05)
        ]
    else:
        parts.append(box((-w / 2 + 0.02, 0, -d / 2 + 0.02), (w / 2 - 0.02, foot, z - 0.03), black))
    rows = 2 if h < 0.8 else (3 if h < 1.1 else 4)
    low, high = (-w / 2 + 0.015, foot + 0.015), (w / 2 - 0.015, h - 0.02)
    parts += drawer_fronts(low, high, z, 1, rows, steel, iron, finishes.choose(rng, "bar", "cup", "strip"), gap=0.008)
    card = finishes.painted((0.95, 0.94, 0.9))
    step = (high[1] - low[1]) / rows
    parts += [
        box((-0.04, y, z + 0.017), (0.04, y + 0.03, z + 0.0195), card)
        for y in (low[1] + np.arange(rows) * step + 0.72 * step).tolist()
    ]
    return made(parts, size, {"material": "metal", "style": "with drawers"})


GENERATORS: dict[str, Generator] = {
    "wardrobe": wardrobe,
    "cabinet": cabinet,
    "glass cabinet": glass_cabinet,
    "sideboard": sideboard,
    "tv stand": tv_stand,
    "chest of drawers": chest_of_drawers,
    "dresser": dresser,
    "shoe cabinet": shoe_cabinet,
    "coat rack": coat_rack,
    "filing cabinet": filing_cabinet,
}
