"""Where a thing is by another: tests on boxes, each with a wider twin that says where people would begin to disagree.

World frame, metres; "above", "under" are along Y, "next to" is on the floor plan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from openmap_env.episodes.attributes import looks
from openmap_env.episodes.vocabulary import vocabulary
from openmap_scenes import Instance

RelationName = Literal["next to", "beside", "by", "on", "above", "under"]

NEAR = 0.5
"""Two things this close, m between their boxes on the floor plan, are next to each other."""
NOT_NEAR = 0.9
"""Beyond this they are not; in between people disagree, and the generator says nothing."""
FLAT = 0.08
"""What is no higher than this, m, lies on the floor, and what stands on it does not hide it."""


@dataclass(frozen=True)
class Relation:
    """Where a thing is, by another thing: ``name`` as people say it, ``noun`` what the other is called."""

    name: RelationName
    noun: str


def holds(name: RelationName, a: Instance, b: Instance) -> bool:
    """Whether a is on, above, under or next to b; "beside" and "by" mean "next to"."""
    return a.id != b.id and _TESTS[name](a, b)


def half_holds(name: RelationName, a: Instance, b: Instance) -> bool:
    """Whether some people would say that the relation holds and others that it does not."""
    return a.id != b.id and not holds(name, a, b) and _HALF_TESTS[name](a, b)


def plan_gap(a: Instance, b: Instance) -> float:
    """Distance between the two boxes on the floor plan, m; 0 where they overlap."""
    gap = np.maximum(0.0, np.maximum(a.aabb_min - b.aabb_max, b.aabb_min - a.aabb_max))
    return float(np.hypot(gap[0], gap[2]))


def stands_on(a: Instance, b: Instance) -> bool:
    """Whether a's underside lies on b's top, or inside b's box if things lie on b's seat or boards, a's middle over b."""
    return _over(a, b) and (
        -0.05 <= a.aabb_min[1] - b.aabb_max[1] <= 0.1
        or (_holding(b) and bool(b.aabb_min[1] + 0.1 < a.aabb_min[1] <= b.aabb_max[1]))
    )


def _holding(b: Instance) -> bool:
    return not looks().holding.isdisjoint(vocabulary().lineage(b.category))


def _over(a: Instance, b: Instance) -> bool:
    return all(b.aabb_min[axis] <= a.centre[axis] <= b.aabb_max[axis] for axis in (0, 2))


def _may_stand_on(a: Instance, b: Instance) -> bool:
    """Whether a starts somewhere within b's height, over b: on it, in it or sunk into it."""
    return bool(plan_gap(a, b) == 0.0 and b.aabb_min[1] + 0.1 < a.aabb_min[1] <= b.aabb_max[1] + 0.2)


def _above(a: Instance, b: Instance, aside: float = 0.0, higher: float = 1.2) -> bool:
    rise = a.aabb_min[1] - b.aabb_max[1]
    return bool(0.0 <= rise <= higher and plan_gap(a, b) <= 0.15 + aside) and not stands_on(a, b) and _same_room(a, b)


def _under(a: Instance, b: Instance) -> bool:
    """A rug that b's middle is over, or something lower than b that lies within b's outline on the same floor."""
    if abs(a.aabb_min[1] - b.aabb_min[1]) > 0.1 or a.aabb_max[1] > b.aabb_max[1] - 0.1:
        return False
    return _over(b, a) if a.aabb_max[1] - a.aabb_min[1] <= FLAT else _over(a, b)


def _next_to(a: Instance, b: Instance, reach: float = NEAR) -> bool:
    level = a.aabb_min[1] <= b.aabb_max[1] + 0.3 and b.aabb_min[1] <= a.aabb_max[1] + 0.3
    beside = plan_gap(a, b) <= reach and not stands_on(a, b) and not stands_on(b, a)
    return bool(level and beside and _same_room(a, b))


def _near(a: Instance, b: Instance) -> bool:
    return _next_to(a, b, NOT_NEAR)


def _same_room(a: Instance, b: Instance) -> bool:
    return a.room == b.room if a.room is not None and b.room is not None else True


_TESTS: dict[RelationName, Callable[[Instance, Instance], bool]] = {
    "next to": _next_to,
    "beside": _next_to,
    "by": _next_to,
    "on": stands_on,
    "above": _above,
    "under": _under,
}
_HALF_TESTS: dict[RelationName, Callable[[Instance, Instance], bool]] = {
    "next to": _near,
    "beside": _near,
    "by": _near,
    "on": _may_stand_on,
    "above": lambda a, b: _above(a, b, 0.5, 2.2),
    "under": lambda a, b: bool(plan_gap(a, b) == 0.0 and a.aabb_min[1] < b.aabb_max[1] - 0.1),
}
