"""What shines in a home: windows, lamps, the sun."""

from __future__ import annotations

import numpy as np

from openmap_scenes.homes.items import Item
from openmap_scenes.homes.light import DAY, GLOW, LAMP, SKY, WARM, Light, Sun
from openmap_scenes.homes.plan import WALL, Plan

SMALL_LAMPS = ("table lamp", "desk lamp", "floor lamp", "wall lamp")
HIGH_LAMPS = ("ceiling lamp", "pendant lamp", "ceiling fan")
LAMPS = (*HIGH_LAMPS[:2], *SMALL_LAMPS)
# From warm to cool light.
COOL = np.array([-1.0, 0.0, 1.4])


def home_lights(plan: Plan, items: list[Item], rng: np.random.Generator) -> tuple[list[Light], Sun | None]:
    """Windows shine inwards from a few points each, every room has a lamp under its ceiling, small lamps glow on what is near;
    in some homes the sun shines in."""
    lights = []
    day = DAY * (1.0 + rng.uniform(-0.03, 0.03) * COOL)
    warm = WARM * (1.0 - rng.uniform(0.0, 0.05) * COOL)
    sky = SKY * float(rng.uniform(0.75, 1.25))
    for o in plan.openings:
        if not o.glazed:
            continue
        rect = plan.inner(o.rooms[0])
        inward = 1.0 if (rect.z0 if o.axis == "x" else rect.x0) > o.at - WALL else -1.0
        along = o.start + (o.end - o.start) * np.array([0.2, 0.8, 0.2, 0.8])
        height = o.sill + (o.top - o.sill) * np.array([0.25, 0.25, 0.75, 0.75])
        off = np.full(4, o.at + inward * 0.09)
        points = np.stack([along, height, off] if o.axis == "x" else [off, height, along], 1)
        normal = np.array([0.0, 0.0, inward] if o.axis == "x" else [inward, 0.0, 0.0])
        lights.append(Light(points, normal, sky * (o.end - o.start) * (o.top - o.sill), day))
    for room in range(len(plan.names)):
        r = plan.inner(room)
        x, z, s = (r.x0 + r.x1) / 2, (r.z0 + r.z1) / 2, 0.35
        lamps = [i for i in items if i.room == room and i.thing.kind in LAMPS[:2]]
        y = min([float(i.low[1]) for i in lamps], default=plan.ceiling) - 0.08
        points = np.array([[x - s, y, z - s], [x + s, y, z - s], [x, y, z + s]])
        lights.append(Light(points, None, LAMP * (r.width * r.depth / 12.0) ** 0.5, warm))
    for item in items:
        if item.thing.kind in SMALL_LAMPS:
            tall = float(item.high[1] - item.low[1])
            place = np.array([[item.middle[0], float(item.low[1]) + 0.78 * tall, item.middle[1]]])
            lights.append(Light(place, None, GLOW, warm, reach=1.6, past=0.2))
    return lights, _sun(plan, rng)


def _sun(plan: Plan, rng: np.random.Generator) -> Sun | None:
    """In two homes of three the sun stands so that it shines in at the windows of one side or two."""
    if rng.random() > 0.65:
        return None
    heading, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.55, 1.0)
    towards = np.array([np.cos(heading) * np.cos(height), np.sin(height), np.sin(heading) * np.cos(height)])
    holes = []
    for o in plan.openings:
        if o.glazed:
            low, high = (o.start + 0.06, max(o.sill, 0.1) + 0.06), (o.end - 0.06, o.top - 0.06)
            holes.append((0 if o.axis == "x" else 2, float(o.at), low, high))
    return Sun(towards, holes, float(rng.uniform(0.5, 0.9)), np.array([1.06, 1.0, 0.88]))
