"""Cloth: rugs and mats, curtains and blinds, cushions, towels, blankets, folded clothes."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.models import Model
from openmap_scenes.homes.parametric import patterns, rugs
from openmap_scenes.homes.parametric.base import Generator, Limits, Made
from openmap_scenes.homes.parametric.making import (
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
from openmap_scenes.homes.primitives import box, merge
from openmap_scenes.homes.revolve import Array, ellipsoid, grid, lathe, placed, sheet, soft_box, tube, turn
from openmap_scenes.homes.textures import Image
from openmap_scenes.scene import Material


def flat_rug(texture: Material, width: float, depth: float, thick: float, edge: Material, fringe: bool) -> list[Model]:
    """A rug with its texture once over it; fringes at the short sides."""
    hw, hd = width / 2, depth / 2
    sides = {0: edge, 1: edge, 2: edge, 3: edge, 4: texture, 5: edge}
    parts = [box((-hw, 0.0, -hd), (hw, thick, hd), sides, step=0.25)]
    if fringe:
        threads = skin("fringe", _fringe())
        for sign in (-1, 1):
            a, b = sorted((sign * hw, sign * (hw + 0.06)))
            strip = box((a, 0.0, -hd), (b, thick * 0.4, hd), threads, step=0.25)
            parts.append(strip)
    return parts


def _fringe() -> Image:
    """Threads side by side across the strip."""
    v = np.arange(128) % 4 < 3
    return np.broadcast_to(np.where(v, 225, 150)[:, None, None], (128, 8, 3)).astype(np.uint8)


def rug(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A rectangular rug, 1.1-3 m long where there is room, the long side along x if that is where there is more."""
    room = min(limits.width, 3.0), min(limits.depth, 3.0)
    if min(room) < 0.5:
        return None
    long = between(rng, 0.75, 1.0) * min(max(room), between(rng, 1.4, 3.0))
    short = min(long * between(rng, 0.55, 0.75), min(room))
    if long > 1.6 and chance(rng, 0.08):
        short = min(short, 0.75)
    width, depth = (long, short) if room[0] >= room[1] else (short, long)
    image, pattern = rugs.any_rug(rng, width / depth)
    fringe = pattern in ("oriental", "striped", "zigzag") and chance(rng, 0.6)
    thick = 0.022 if pattern == "shaggy" else between(rng, 0.006, 0.012)
    edge = solid("rug edge", tone(rng, SOFT) if pattern == "shaggy" else (0.34, 0.27, 0.22))
    hem = min(width - 0.13, width) if fringe else width
    parts = flat_rug(skin("rug", image), hem, depth, thick, edge, fringe)
    words = {"shape": "rectangular", "pattern": pattern, "material": pick(rng, "wool", "cotton")}
    return finish(parts, limits, words, smallest=0.4)


def round_rug(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A round rug, 0.9-2.2 m across."""
    radius = min(between(rng, 0.45, 1.1), limits.width / 2, limits.depth / 2)
    if radius < 0.35:
        return None
    style = pick(rng, "rings", "rings", "shaggy", "braided")
    image = rugs.rings(rng) if style == "rings" else patterns.fur(rng, tone(rng, SOFT), 160)
    if style == "braided":
        image = _braid(rng)
    return finish(
        disc(radius, between(rng, 0.008, 0.02), skin("rug", image)), limits, {"shape": "round", "pattern": style}
    )


def _braid(rng: np.random.Generator, size: int = 160) -> Image:
    u, v = patterns.unit(size)
    r, phi = np.hypot(u - 0.5, v - 0.5) * 28, np.arctan2(v - 0.5, u - 0.5)
    shade = 0.75 + 0.3 * np.sin(np.pi * (r % 1)) * (0.7 + 0.3 * np.sin(phi * 40 + 3 * np.floor(r)))
    return patterns.to_image(np.array(tone(rng, SOFT)) * shade[..., None])


def disc(radius: float, thick: float, material: Material) -> list[Model]:
    """A flat round with its texture laid over it from above, its rings close enough for the light."""
    radii = np.linspace(radius - thick * 0.5, 0.0, max(3, int(np.ceil(radius / 0.2)) + 1))
    profile = [(radius - thick * 0.3, 0.0), (radius, thick * 0.4), *((r, thick) for r in radii)]
    model = lathe([(0.0, 0.0), *profile], material, max(24, int(radius * 40)))
    uv = (0.5 + model.vertices[:, [0, 2]] / (2 * radius)).astype(np.float32)
    return [Model(model.vertices, model.normals, uv, model.faces, model.face_material, model.materials)]


def bath_mat(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A thick soft mat, oblong, with a band or ribs or pile; sometimes half round."""
    width, depth = between(rng, 0.6, 0.9), between(rng, 0.42, 0.58)
    style = pick(rng, "shaggy", "ribbed", "bordered", "striped")
    colour = tone(rng, SOFT + VIVID)
    image = {
        "shaggy": lambda: patterns.fur(rng, colour),
        "ribbed": lambda: patterns.stripes(rng, [colour, dimmed(colour, 0.8)], 12, False),
        "bordered": lambda: rugs.bordered(rng, width / depth),
        "striped": lambda: patterns.stripes(rng, [colour, tone(rng, WHITES)], 4, True),
    }[style]()
    half = width / 2, between(rng, 0.012, 0.03), depth / 2
    parts = [soft_box((-half[0], 0, -half[2]), (half[0], half[1], half[2]), skin("bath mat", image), 0.02, 2)]
    return finish(parts, limits, {"shape": "rectangular", "pattern": style, "material": "cotton"}, smallest=0.6)


def doormat(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A stiff mat of coir or rubber, 0.6-0.8 m wide; rectangular or half round."""
    width, depth = between(rng, 0.58, 0.8), between(rng, 0.38, 0.5)
    colour = tone(rng, ((0.55, 0.42, 0.28), (0.28, 0.27, 0.26), (0.42, 0.32, 0.24), (0.35, 0.38, 0.40)))
    style, u_v = pick(rng, "plain", "bordered", "striped", "dotted"), patterns.unit(128)
    edge = np.minimum(np.minimum(u_v[0], 1 - u_v[0]) * width / depth, np.minimum(u_v[1], 1 - u_v[1]))
    dark = {
        "plain": edge < 0,
        "bordered": (edge > 0.06) & (edge < 0.12),
        "striped": (u_v[0] * 9) % 1 < 0.35,
        "dotted": np.hypot((u_v[0] * 10) % 1 - 0.5, (u_v[1] * 6) % 1 - 0.5) < 0.2,
    }[style]
    rgb = patterns.fur(rng, colour, 128, 0.16) / 255.0 * np.where(dark, 0.45, 1.0)[..., None]
    parts = flat_rug(
        skin("doormat", patterns.to_image(rgb)),
        width,
        depth,
        between(rng, 0.01, 0.018),
        solid("rubber", (0.12, 0.12, 0.12)),
        False,
    )
    return finish(parts, limits, {"shape": "rectangular", "pattern": style, "material": "coir"}, smallest=0.6)


def _pleats(rng: np.random.Generator, width: float, height: float, folds: float, gather: float) -> Array:
    """A hanging panel (nv + 1, nu + 1, 3): its left edge at x = 0, folds that deepen downwards, drawn in where it is tied."""
    nu, nv = int(np.clip(folds * 5, 12, 40)), max(4, int(np.ceil(height / 0.28)))
    u, v = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(1, 0, nv + 1))
    v = v[::-1]
    phase = float(rng.uniform(0, 6.3))
    waist = 1 - gather * np.exp(-(((v - 0.42) / 0.22) ** 2))
    x = u * width * waist
    deep = (0.018 + 0.022 * (1 - v)) * (0.6 + 0.4 * waist)
    z = deep * np.sin(2 * np.pi * folds * u + phase + 0.5 * np.sin(3 * v + phase))
    return np.stack([x, v * height, z], 2)


def curtain(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A pair of pleated panels on a rod, drawn aside: as wide as ``limits.width`` up to 4 m and as long as ``limits.height``."""
    width, height = min(limits.width, 4.0), min(limits.height, 2.75)
    if width < 0.5 or height < 0.6 or limits.depth < 0.13:
        return None
    cloth, pattern, _ = patterns.fabric(rng, 0.6, SOFT + VIVID[:4])
    front = skin("curtain", cloth)
    rod = paint(rng, METALS + WOODS, "rod")
    bar = between(rng, 0.009, 0.014)
    ends = 0.05
    share = between(rng, 0.2, 0.32)
    panel = min((width - 2 * ends) * share, 0.75)
    gather = pick(rng, "straight", "tied") == "tied" and height > 1.4
    folds = max(3.0, round(panel / 0.085))
    long = height - 0.05
    parts: list[Model] = []
    for sign in (-1, 1):
        points = _pleats(rng, panel, long, folds, 0.5 if gather else 0.0)
        points[..., 0] = sign * (points[..., 0] - (width / 2 - ends))
        points = points if points[0, 0, 0] < points[0, -1, 0] else points[:, ::-1]
        uv = _cloth_uv(points.shape[1] - 1, points.shape[0] - 1, panel * 2 / 0.5, long / 0.5)
        parts.append(sheet(points, 0.004, front, uv=uv))
        if gather:
            at = sign * -(width / 2 - ends - panel * 0.25)
            phi = np.linspace(0, 2 * np.pi, 13)[:-1]
            ring = np.stack([at + panel * 0.3 * np.cos(phi), np.full(12, 0.42 * long), 0.05 * np.sin(phi)], 1)
            parts.append(tube(ring, 0.014, solid("tie", tone(rng, SOFT)), 6, closed=True))
    y = height - 0.028
    path = np.stack([np.linspace(-width / 2 + 0.03, width / 2 - 0.03, 12), np.full(12, y), np.zeros(12)], 1)
    parts.append(tube(path, bar, rod))
    parts += [ellipsoid((s * (width / 2 - 0.026), y, 0), (0.026, 0.024, 0.024), rod, 10, 6) for s in (-1, 1)]
    words = {"material": pick(rng, "cotton", "linen", "velvet"), "pattern": pattern}
    return finish(parts, limits, words, smallest=0.9)


def _cloth_uv(nu: int, nv: int, across: float, along: float) -> Array:
    s, t = np.meshgrid(np.linspace(0, across, nu + 1), np.linspace(along, 0, nv + 1))
    return np.stack([s, t], 2)


def blinds(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Blinds for a window as wide and high as the limits: slats, a roller, or Roman folds, pulled down most of the way."""
    width, height = min(limits.width, 2.4), min(limits.height, 2.0)
    if width < 0.3 or height < 0.3 or limits.depth < 0.06:
        return None
    style = pick(rng, "venetian", "roller", "roman")
    down = height * between(rng, 0.45, 1.0)
    w = width / 2
    head = paint(rng, WHITES + METALS[:1], "head rail")
    parts = [soft_box((-w, height - 0.045, -0.025), (w, height, 0.025), head, 0.006)]
    if style == "venetian":
        slat = paint(rng, WHITES + WOODS + SOFT[:3], "slat")
        n = max(3, min(26, int((down - 0.06) / 0.042)))
        tilt = turn(0, between(rng, 0.4, 1.0))
        for k in range(n):
            y = height - 0.06 - (down - 0.08) * k / n
            blade = box((-w + 0.01, -0.001, -0.021), (w - 0.01, 0.001, 0.021), slat, step=0.45)
            parts.append(placed(blade, (0.0, y, 0.0), tilt))
        parts.append(box((-w + 0.01, height - down, -0.02), (w - 0.01, height - down + 0.018, 0.02), slat))
    else:
        image, _, _ = patterns.fabric(rng, 0.6)
        nv = 26 if style == "roman" else 6
        v, u = np.meshgrid(np.linspace(0, 1, nv + 1), np.linspace(0, 1, 9), indexing="ij")
        swell = 0.018 * np.abs(np.sin(np.pi * v * 5)) if style == "roman" else 0.0 * v
        points = np.stack([(u - 0.5) * (width - 0.03), height - down + v * (down - 0.04), swell], 2)
        parts.append(sheet(points, 0.004, skin("blind", image)))
        parts.append(box((-w + 0.015, height - down - 0.012, -0.008), (w - 0.015, height - down + 0.01, 0.008), head))
    return finish(parts, limits, {"style": style}, elevation=max(0.0, 2.2 - down), smallest=0.9)


def cushion(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A cushion lying flat: square, oblong, round or a roll."""
    image, pattern, _ = patterns.fabric(rng, 0.4, SOFT + VIVID)
    cover, shape = skin("cushion", image), pick(rng, "square", "square", "square", "rectangular", "round", "bolster")
    size, high = between(rng, 0.36, 0.5), between(rng, 0.11, 0.16)
    if shape == "round":
        parts = [ellipsoid((0, high / 2, 0), (size / 2, high / 2, size / 2), cover, 22, 10, 0.7)]
        parts.append(ellipsoid((0, high - 0.004, 0), (0.018, 0.008, 0.018), cover, 8, 4))
    elif shape == "bolster":
        r = between(rng, 0.08, 0.1)
        roll = lathe(
            [
                (0, -size * 0.7),
                (r * 0.8, -size * 0.7),
                (r, -size * 0.66),
                (r, 0),
                (r, size * 0.66),
                (r * 0.8, size * 0.7),
                (0, size * 0.7),
            ],
            cover,
        )
        parts = [placed(roll, rotation=turn(2, np.pi / 2))]
    else:
        depth = size if shape == "square" else size * between(rng, 0.6, 0.75)
        parts = [pillow(size, depth, high, cover)]
    return finish(parts, limits, {"shape": shape, "pattern": pattern, "material": "fabric"})


def pillow(width: float, depth: float, high: float, cover: Material, n: int = 10) -> Model:
    """A stuffed cover lying flat, its seams drawn in between the corners."""
    s = np.sin(np.linspace(-np.pi / 2, np.pi / 2, n + 1))
    u, v = np.meshgrid(s, -s)
    swell = ((1 - u**4) * (1 - v**4)) ** 0.55
    x = u * (1 - 0.07 * (1 - v**2)) * width / 2
    z = v * (1 - 0.07 * (1 - u**2)) * depth / 2
    top = np.stack([x, high / 2 * swell, z], 2)
    return merge([grid(top, cover), grid((top * [1.0, -0.9, 1.0])[:, ::-1], cover)])


def folded(rng: np.random.Generator, width: float, depth: float, thick: float, cover: Material) -> Model:
    """One folded cloth: a soft slab whose front shows the fold."""
    return soft_box(
        (-width / 2, 0, -depth / 2), (width / 2, thick, depth / 2), cover, thick * 0.48, 2, puff=0.12 * thick
    )


def _stack(
    rng: np.random.Generator, layers: int, width: float, depth: float, thick: float, covers: list[Material]
) -> list[Model]:
    parts, y = [], 0.0
    for k in range(layers):
        t = thick * between(rng, 0.8, 1.2)
        model = folded(rng, width * between(rng, 0.9, 1.0), depth * between(rng, 0.9, 1.0), t, covers[k % len(covers)])
        parts.append(
            placed(
                model, (between(rng, -0.01, 0.01), y, between(rng, -0.01, 0.01)), turn(1, float(rng.normal(0, 0.04)))
            )
        )
        y += t * 1.02
    return parts


def folded_clothes(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Three to six folded shirts and jumpers, each of its own cloth."""
    n = int(rng.integers(3, 7))
    covers = [skin("clothes", patterns.fabric(rng, 0.6, SOFT + VIVID)[0]) for _ in range(n)]
    return finish(
        _stack(rng, n, between(rng, 0.24, 0.32), between(rng, 0.22, 0.34), 0.035, covers),
        limits,
        {"material": "cotton"},
    )


def towel(rng: np.random.Generator, limits: Limits) -> Made | None:
    """Folded towels in a pile, or one rolled up."""
    colour = tone(rng, SOFT + VIVID + WHITES)
    covers = [skin("towel", patterns.fur(rng, colour, 64, 0.07))]
    if chance(rng, 0.3):
        turns = np.linspace(0, 2 * np.pi * 3, 40)
        spiral = np.stack([(0.008 + 0.0032 * turns) * np.cos(turns), (0.008 + 0.0032 * turns) * np.sin(turns)], 1)
        across = np.linspace(-0.16, 0.16, 4)
        points = np.stack(
            [np.broadcast_to(across[None], (40, 4)), np.repeat(spiral[:, 1:], 4, 1), np.repeat(spiral[:, :1], 4, 1)], 2
        )
        return finish([sheet(points, 0.016, covers[0])], limits, {"shape": "rolled", "material": "cotton"})
    if chance(rng, 0.4):
        covers.append(skin("towel", patterns.fur(rng, tone(rng, SOFT + WHITES), 64, 0.07)))
    n = int(rng.integers(1, 5))
    return finish(
        _stack(rng, n, between(rng, 0.26, 0.38), between(rng, 0.2, 0.28), 0.045, covers),
        limits,
        {"shape": "folded", "material": "cotton"},
    )


def hanging_towel(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A towel over a bar on the wall, or hanging from a ring."""
    colour = tone(rng, SOFT + VIVID + WHITES)
    image = (
        patterns.stripes(rng, [colour, colour, tone(rng, WHITES)], 3, False)
        if chance(rng, 0.3)
        else patterns.fur(rng, colour, 96, 0.07)
    )
    cover, metal = skin("towel", image), paint(rng, METALS, "metal")
    width, front, back = between(rng, 0.3, 0.5), between(rng, 0.4, 0.65), between(rng, 0.25, 0.4)
    y, z, r = 0.0, 0.07, 0.016
    down = [(z + r + 0.006, y - front * t) for t in np.linspace(1, 0, 8)]
    over = [(z + r * np.cos(a), y + r * np.sin(a)) for a in np.linspace(0.3, np.pi - 0.3, 5)]
    up = [(z - r - 0.004, y - back * t) for t in np.linspace(0, 1, 5)]
    line = np.array(down + over + up)
    s = np.linspace(-1, 1, 15)
    wave = 0.006 * np.sin(s * 7 + float(rng.uniform(0, 6)))[None] * np.clip(-line[:, 1:] / front, 0, 1)
    points = np.stack(
        [np.broadcast_to(s * width / 2, (len(line), 15)), np.repeat(line[:, 1:], 15, 1), line[:, :1] + wave], 2
    )
    parts = [sheet(points, 0.007, cover)]
    half = width / 2 + 0.06
    parts.append(tube([(x, y - 0.006, z) for x in np.linspace(-half, half, 6)], 0.008, metal))
    for sign in (-1, 1):
        parts.append(tube([(sign * half, y - 0.006, 0.0), (sign * half, y - 0.006, z + 0.008)], 0.011, metal))
        parts.append(
            placed(
                lathe([(0, 0), (0.022, 0), (0.022, 0.008), (0, 0.008)], metal, 12),
                (sign * half, y - 0.006, 0.0),
                turn(0, np.pi / 2),
            )
        )
    return finish(parts, limits, {"material": "cotton"}, elevation=between(rng, 0.75, 0.95))


def blanket(rng: np.random.Generator, limits: Limits) -> Made | None:
    """A throw folded to a slab with fringes, a soft pile of folds, or a knitted one rolled."""
    image, pattern, _ = patterns.fabric(rng, 0.3)
    cover = skin("blanket", image)
    width, depth, layers = between(rng, 0.4, 0.6), between(rng, 0.3, 0.42), int(rng.integers(2, 5))
    parts = []
    for k in range(layers):
        parts.append(placed(folded(rng, width, depth, 0.035, cover), (0, 0.034 * k, 0)))
    if chance(rng, 0.5):
        threads = solid("fringe", tone(rng, WHITES + SOFT))
        for x in np.linspace(-width / 2 + 0.02, width / 2 - 0.02, 16).tolist():
            drop = [(x, 0.05, depth / 2 - 0.005), (x, 0.045, depth / 2 + 0.012), (x + 0.004, 0.008, depth / 2 + 0.02)]
            parts.append(tube(drop, 0.004, threads, 4))
    return finish(
        parts, limits, {"material": pick(rng, "wool", "cotton", "fleece"), "pattern": pattern, "shape": "folded"}
    )


GENERATORS: dict[str, Generator] = {
    "rug": rug,
    "round rug": round_rug,
    "bath mat": bath_mat,
    "doormat": doormat,
    "curtain": curtain,
    "blinds": blinds,
    "cushion": cushion,
    "folded clothes": folded_clothes,
    "towel": towel,
    "hanging towel": hanging_towel,
    "blanket": blanket,
}
