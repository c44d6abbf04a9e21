"""Doors and windows: frames, leaves that stand open or shut, panes with the open behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.colour import model_colour
from openmap_scenes.homes.doors import KNOB, LINING, THICK, hinge_frame
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.outdoors import Weather, draw_weather, outdoors
from openmap_scenes.homes.palette import HomeFinish
from openmap_scenes.homes.plan import OUTER, WALL, Opening, Plan
from openmap_scenes.homes.primitives import box, material, merge
from openmap_scenes.scene import Material

Span = tuple[float, float]
Parts = tuple[str, int, Model, dict[str, str]]
# How far trim stands out of the wall, m.
PROUD = 0.015
SILL_PROUD = 0.02
EYE = 1.5
_DARKER = 0.86
# The name of the material that shows what lies outside.
VIEW = "view"


@dataclass(frozen=True)
class _Frame:
    """An opening's wall: boxes are given along it, in height, and by how far they lie into the room from its middle."""

    opening: Opening
    into: int

    def bar(self, along: Span, height: Span, off: Span, m: Material) -> Model:
        """A box, m."""
        a, b = sorted((self.opening.at + self.into * off[0], self.opening.at + self.into * off[1]))
        if self.opening.axis == "x":
            return box((along[0], height[0], a), (along[1], height[1], b), m)
        return box((a, height[0], along[0]), (b, height[1], along[1]), m)

    def pane(self, along: Span, height: Span, off: float, view: Material, back: Material) -> Model:
        """A thin sheet that shows the view to the room."""
        o, a, b = self.opening, *sorted((self.opening.at + self.into * off, self.opening.at + self.into * (off - 0.01)))
        if o.axis == "x":
            sides = {0: view, 1: back} if self.into > 0 else {0: back, 1: view}
            return box((along[0], height[0], a), (along[1], height[1], b), sides)
        sides = {2: view, 3: back} if self.into > 0 else {2: back, 3: view}
        return box((a, height[0], along[0]), (b, height[1], along[1]), sides)


def build_joinery(plan: Plan, finish: HomeFinish, rng: np.random.Generator) -> list[Parts]:
    """Everything in the openings of a plan: (kind, room, mesh in the world frame, attributes)."""
    weather = draw_weather(rng)
    panels = str(rng.choice(["flush", "two", "four", "three", "plank"], p=[0.25, 0.25, 0.2, 0.15, 0.15]))
    sashes = str(rng.choice(["plain", "double", "cross", "transom"], p=[0.25, 0.35, 0.25, 0.15]))
    boxed, plain = bool(rng.random() < 0.5 and finish.window_frame.colour.min() > 0.5), bool(rng.random() < 0.4)
    leaves = {leaf.opening: leaf for leaf in plan.leaves}
    brass = material("threshold", (0.66, 0.62, 0.54))
    parts: list[Parts] = []
    for index, o in enumerate(plan.openings):
        inner = plan.inner(o.rooms[0])
        into = 1 if (inner.z0 if o.axis == "x" else inner.x0) > o.at else -1
        f = _Frame(o, into)
        if o.glazed:
            view = material(VIEW, (1, 1, 1), _view(o, weather, rng))
            parts.append((o.kind, o.rooms[0], merge(_glazing(f, finish, view, sashes, boxed)), {}))
            continue
        back = OUTER if o.rooms[1] < 0 else WALL / 2
        trim = finish.plaster if o.wide and plain else finish.trim
        frame = _casing(f, trim, back, flat=o.wide and plain)
        if o.rooms[1] >= 0 and finish.rooms[o.rooms[0]].floor is not finish.rooms[o.rooms[1]].floor:
            frame.append(f.bar((o.start, o.end), (0.0, 0.005), (-0.02, 0.02), brass))
        parts.append(("door frame", o.rooms[0], merge(frame), {}))
        if o.kind == "front door":
            mesh = _hung(
                _leaf(o.width - 0.036, o.top, _front_paint(finish, rng), finish.metal, "four"), plan, o, o.rooms[0]
            )
            parts.append(("front door", o.rooms[0], mesh, {"colour": model_colour(mesh)}))
        elif (leaf := leaves.get(index)) is not None:
            day = all(plan.kinds[r] in ("living room", "dining room", "kitchen", "hall") for r in o.rooms)
            style = "glazed" if day and rng.random() < 0.6 else panels
            slab = _leaf(o.width - 0.036, o.top, finish.door, finish.metal, style)
            mesh = _hung(slab, plan, o, leaf.room, leaf.at_start, leaf.angle)
            parts.append(("door", leaf.room, mesh, {"colour": model_colour(mesh), "material": finish.door_word}))
    return parts


def _view(o: Opening, weather: Weather, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    return outdoors(rng, weather, (o.top - EYE) / (o.top - o.sill), o.width / (o.top - o.sill))


def _casing(f: _Frame, trim: Material, back: float, flat: bool, width: float = 0.07) -> list[Model]:
    """A lining of the hole, from the room's face to ``back`` m behind the wall's middle, and trim around it; ``flat``: none."""
    o, t = f.opening, LINING
    front = WALL / 2 + (0.0 if flat else PROUD)
    behind = -back - (PROUD if back == WALL / 2 and not flat else 0.0)
    parts = [
        f.bar((o.start, o.start + t), (0.0, o.top - t), (behind, front), trim),
        f.bar((o.end - t, o.end), (0.0, o.top - t), (behind, front), trim),
        f.bar((o.start, o.end), (o.top - t, o.top), (behind, front), trim),
    ]
    if flat:
        return parts
    for off in ((WALL / 2, front), *([(behind, -WALL / 2)] if back == WALL / 2 else [])):
        parts.append(f.bar((o.start - width, o.start), (0.0, o.top), off, trim))
        parts.append(f.bar((o.end, o.end + width), (0.0, o.top), off, trim))
        parts.append(f.bar((o.start - width, o.end + width), (o.top, o.top + width), off, trim))
    return parts


def _front_paint(finish: HomeFinish, rng: np.random.Generator) -> Material:
    tints = ((0.26, 0.33, 0.37), (0.42, 0.19, 0.16), (0.24, 0.34, 0.28), (0.93, 0.93, 0.91), (0.30, 0.31, 0.33))
    if rng.random() < 0.4:
        return finish.door
    return material("front door paint", tints[int(rng.integers(len(tints)))])


def _darker(m: Material) -> Material:
    return material(f"{m.name} panel", tuple((m.colour * _DARKER).tolist()), m.texture)


def _leaf(width: float, top: float, paint: Material, metal: Material, style: str) -> Model:
    """A leaf from its hinge (x = 0) to its lock, z = 0 its face on the room's side, z = THICK the other, handles on both."""
    height = top - LINING - 0.004
    low = 0.008
    dark = _darker(paint)
    parts = []
    inset = {
        "two": [(0.14, width - 0.14, 0.2, 0.86), (0.14, width - 0.14, 1.08, height - 0.16)],
        "four": [
            (a, b, c, d)
            for a, b in ((0.12, width / 2 - 0.05), (width / 2 + 0.05, width - 0.12))
            for c, d in ((0.2, 0.86), (1.08, height - 0.14))
        ],
        "three": [(0.13, width - 0.13, c, c + 0.48) for c in (0.16, 0.76, 1.36)],
        "glazed": [(0.14, width - 0.14, 0.2, 0.7)],
    }.get(style, [])
    glass = [(0.14, width - 0.14, 0.82, height - 0.14)] if style == "glazed" else []
    if glass:
        a, b, c, d = glass[0]
        milk = material("frosted glass", (0.86, 0.90, 0.91))
        parts += [box((0.0, low, 0.0), (width, c, THICK), paint), box((0.0, d, 0.0), (width, height, THICK), paint)]
        parts += [box((0.0, c, 0.0), (a, d, THICK), paint), box((b, c, 0.0), (width, d, THICK), paint)]
        parts.append(box((a, c, 0.014), (b, d, 0.026), milk))
    else:
        parts.append(box((0.0, low, 0.0), (width, height, THICK), paint))
    for a, b, c, d in inset:
        # A darker bevel around a raised field.
        parts.append(box((a, c, -0.002), (b, d, THICK + 0.002), dark))
        parts.append(box((a + 0.03, c + 0.03, -0.005), (b - 0.03, d - 0.03, THICK + 0.005), paint))
    if style == "plank":
        parts += [box((x, low, -0.001), (x + 0.008, height, THICK + 0.001), dark) for x in np.arange(1, 6) * width / 6]
    for side, face in ((-1.0, 0.0), (1.0, THICK)):
        for x, y, z in (((-0.095, -0.045), (0.96, 1.08), (0.0, 0.006)), ((-0.078, -0.062), (1.02, 1.036), (0.006, 0.042)),
                        ((-0.18, -0.06), (1.018, 1.038), (0.042, KNOB))):  # fmt: skip
            a, b = sorted((face + side * z[0], face + side * z[1]))
            parts.append(box((width + x[0], y[0], a), (width + x[1], y[1], b), metal))
    return merge(parts)


def _hung(leaf: Model, plan: Plan, o: Opening, room: int, at_start: bool = True, angle: float = 0.0) -> Model:
    """A leaf in its place, opened by ``angle`` rad into the room."""
    along, off, forth, into, _ = hinge_frame(plan, o, room, at_start)
    c, s = np.cos(angle), np.sin(angle)
    # Rows: along the wall, up, into the plan's other axis; columns: the leaf's x, y, z.
    turn = np.array([[forth * c, 0.0, forth * s], [0.0, 1.0, 0.0], [into * s, 0.0, -into * c]])
    shift = np.array([along, 0.0, off])
    if o.axis == "z":
        turn, shift = turn[[2, 1, 0]], shift[[2, 1, 0]]
    faces = leaf.faces if np.linalg.det(turn) > 0 else leaf.faces[:, ::-1]
    vertices = leaf.vertices.astype(np.float64) @ turn.T + shift
    normals = leaf.normals.astype(np.float64) @ turn.T
    return Model(
        vertices.astype(np.float32),
        normals.astype(np.float32),
        leaf.uv,
        np.ascontiguousarray(faces),
        leaf.face_material,
        leaf.materials,
    )


def _glazing(f: _Frame, finish: HomeFinish, view: Material, sashes: str, boxed: bool) -> list[Model]:
    """A window or a glazed door: reveal, frame, sashes, panes, handle, sill."""
    o, m = f.opening, finish.window_frame
    door, t, inside = o.kind == "balcony door", 0.012, WALL / 2 + 0.001
    reveal = m if boxed else finish.plaster
    parts = [
        f.bar((o.start, o.start + t), (o.sill, o.top), (-OUTER, inside), reveal),
        f.bar((o.end - t, o.end), (o.sill, o.top), (-OUTER, inside), reveal),
        f.bar((o.start + t, o.end - t), (o.top - t, o.top), (-OUTER, inside), reveal),
    ]
    low = o.sill + (0.012 if door else 0.025)
    if door:
        parts.append(f.bar((o.start + t, o.end - t), (0.0, low), (-OUTER, -0.02), m))
    else:
        board = finish.trim if m.colour.min() > 0.5 else m
        parts.append(f.bar((o.start, o.end), (o.sill, low), (-OUTER, WALL / 2), board))
        parts.append(f.bar((o.start - 0.04, o.end + 0.04), (o.sill, low), (WALL / 2, WALL / 2 + SILL_PROUD), board))
    if boxed:
        w, off = 0.055, (WALL / 2, WALL / 2 + PROUD)
        parts.append(f.bar((o.start - w, o.start), (low, o.top), off, m))
        parts.append(f.bar((o.end, o.end + w), (low, o.top), off, m))
        parts.append(f.bar((o.start - w, o.end + w), (o.top, o.top + w), off, m))
    a, b, high = o.start + t, o.end - t, o.top - t
    outer, rim = (-0.12, -0.05), 0.045
    parts += _ring(f, (a, b), (low, high), rim, outer, m)
    a, b, low, high = a + rim, b - rim, low + (0.01 if door else rim), high - rim
    parts.append(f.pane((a, b), (low, high), -0.09, view, finish.facade))
    if sashes == "transom" and not door:
        cut = low + (high - low) * 0.7
        parts.append(f.bar((a, b), (cut - 0.03, cut + 0.03), outer, m))
        high = cut - 0.03
    count = 1 if b - a < (0.9 if sashes != "plain" or door else 1.35) else 2
    for k in range(count):
        c, d = a + (b - a) * k / count, a + (b - a) * (k + 1) / count
        sash = (-0.085, -0.035)
        parts += _ring(f, (c, d), (low, high), 0.055, sash, m)
        if door:
            parts.append(f.bar((c + 0.05, d - 0.05), (low, low + 0.14), sash, m))
        if sashes == "cross":
            y, x = low + (high - low) * (0.5 if not door else 0.62), (c + d) / 2
            parts.append(f.bar((c + 0.05, d - 0.05), (y - 0.012, y + 0.012), (-0.09, -0.05), m))
            if not door:
                parts.append(f.bar((x - 0.012, x + 0.012), (low + 0.05, high - 0.05), (-0.09, -0.05), m))
        if k == 0:
            x = d - 0.028
            y = 1.05 if door else (low + high) / 2
            parts.append(f.bar((x - 0.012, x + 0.012), (y - 0.03, y + 0.03), (-0.035, -0.025), finish.metal))
            parts.append(f.bar((x - 0.009, x + 0.009), (y - 0.10, y + 0.01), (-0.025, -0.01), finish.metal))
    return parts


def _ring(f: _Frame, along: Span, height: Span, width: float, off: Span, m: Material) -> list[Model]:
    """Four bars around a rectangle."""
    (a, b), (c, d) = along, height
    return [
        f.bar((a, a + width), (c, d), off, m),
        f.bar((b - width, b), (c, d), off, m),
        f.bar((a + width, b - width), (c, c + width), off, m),
        f.bar((a + width, b - width), (d - width, d), off, m),
    ]
