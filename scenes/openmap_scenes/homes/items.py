"""Things, and things in their places: boxes, what stands on them and in them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from openmap_scenes.homes.bodies import Body
from openmap_scenes.homes.models import Model
from openmap_scenes.homes.plan import Rect
from openmap_scenes.homes.rays import RayCaster

# How the names of things begin that are made by rule.
MADE = "made/"


@dataclass(frozen=True)
class Thing:
    """What can be put down: its kind, its model, the words for it, and the library piece it comes from (or "")."""

    kind: str
    model: Model
    attributes: dict[str, str]
    piece: str = ""
    elevation: float = 0.0
    surface: bool = True
    credit: str = ""

    @property
    def made(self) -> bool:
        """Whether it was made by rule and not taken from the library."""
        return self.piece.startswith(MADE)


@dataclass(eq=False)
class Item:
    """A thing in its place: ``position`` (3,) m of the middle of its base, turned ``angle`` rad about +y (0: front to +z)."""

    thing: Thing
    position: npt.NDArray[np.float64]
    angle: float
    room: int
    low: npt.NDArray[np.float64] = field(init=False)
    high: npt.NDArray[np.float64] = field(init=False)
    support: Item | None = field(init=False, default=None, repr=False)
    _body: Body | None = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        world = self.world(self.thing.model.vertices)
        self.low, self.high = world.min(0), world.max(0)

    @property
    def middle(self) -> npt.NDArray[np.float64]:
        """The middle of its box on the floor, (x, z) m."""
        return np.asarray((self.low + self.high)[[0, 2]] / 2)

    @property
    def half_depth(self) -> float:
        """Half of its extent along its front, m."""
        return float(np.abs(self.front) @ (self.high - self.low)[[0, 2]]) / 2

    @property
    def half_width(self) -> float:
        """Half of its extent across its front, m."""
        return float(np.abs(self.front[::-1]) @ (self.high - self.low)[[0, 2]]) / 2

    @property
    def right(self) -> npt.NDArray[np.float64]:
        """What lies to its right for someone who looks at its front, (x, z)."""
        return np.array([self.front[1], -self.front[0]])

    @property
    def caster(self) -> RayCaster:
        """Casts rays against it where it stands."""
        return self.body.caster

    @property
    def body(self) -> Body:
        """Its triangles where it stands."""
        if self._body is None:
            self._body = Body(self.world(self.thing.model.vertices), self.thing.model.faces)
        return self._body

    @property
    def rotation(self) -> npt.NDArray[np.float64]:
        """R_world_model (3, 3)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    @property
    def front(self) -> npt.NDArray[np.float64]:
        """Where its front looks, (x, z)."""
        return np.array([np.sin(self.angle), np.cos(self.angle)])

    @property
    def footprint(self) -> Rect:
        """Its box on the floor."""
        return Rect(float(self.low[0]), float(self.low[2]), float(self.high[0]), float(self.high[2]))

    def world(self, points: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
        """Model points (N, 3) in the world frame."""
        return np.asarray(points.astype(np.float64) @ self.rotation.T + self.position)

    def height_under(self, rect: Rect, level: float) -> float | None:
        """Height, m, on which something with that footprint stands on this item, or None where it is not flat to ``level`` m."""
        return self.height_below(rect, float(self.high[1]) + 0.5, level)

    def height_below(self, rect: Rect, y: float, level: float) -> float | None:
        """The same for what lies below a height ``y`` m: a board of a shelf."""
        x = np.linspace(rect.x0, rect.x1, max(3, int(rect.width / 0.02) + 2))
        z = np.linspace(rect.z0, rect.z1, max(3, int(rect.depth / 0.02) + 2))
        origin, way = np.empty((len(z), len(x), 3)), np.zeros((len(z), len(x), 3))
        origin[..., 0], origin[..., 1], origin[..., 2], way[..., 1] = x, y, z[:, None], -1.0
        hit = self.caster.distance(origin.reshape(-1, 3), way.reshape(-1, 3))
        if not np.isfinite(hit).all() or np.ptp(hit) > level:
            return None
        return float(y - hit.min())


def shelf_boards(shelf: Item) -> list[tuple[float, float, float, float]]:
    """Places inside a piece of furniture: (height of the board, free height above it, m along its right, m along its front)."""
    found = []
    half = shelf.half_width
    for along in np.linspace(-0.8, 0.8, max(3, int(half / 0.12))) * half:
        off = 0.15 * shelf.half_depth
        x, z = shelf.middle + shelf.right * along + shelf.front * off
        top, y = None, float(shelf.high[1]) + 0.1
        for _ in range(40):
            hit = float(shelf.caster.distance(np.array([[x, y, z]]), np.array([[0.0, -1.0, 0.0]]))[0])
            if not np.isfinite(hit) or y - hit < shelf.low[1] + 0.03:
                break
            height = y - hit
            if top is not None and top - height > 0.14:
                found.append((height, top - height, float(along), float(off)))
            top, y = height, height - 0.012
            # A solid board or block is left before the next one is looked for.
            top = height - 0.02
    return found


def open_to_front(item: Item, shelf: Item) -> bool:
    """Whether most of a thing in a shelf can be seen from straight before the shelf."""
    s, t = (g.reshape(-1) for g in np.meshgrid((-0.7, 0.0, 0.7), (0.2, 0.5, 0.8)))
    half, tall = item.half_width, float(item.high[1] - item.low[1])
    across = item.middle + np.outer(s * half, shelf.right)
    start = np.insert(across + shelf.front * item.half_depth, 1, item.low[1] + t * tall, axis=1)
    way = np.broadcast_to(np.insert(shelf.front, 1, 0.0), start.shape)
    return bool((~np.isfinite(shelf.caster.distance(start, way))).mean() > 0.85)
