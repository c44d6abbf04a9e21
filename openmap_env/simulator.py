"""A body with a camera in a home: it turns, walks, looks up and down, and sees.

Poses are world frame: Y up, m; heading 0 looks along -Z and grows to the left (about +Y), pitch grows upwards, both in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_env.actions import Action
from openmap_env.navigation import Body, NavigableSurface
from openmap_env.rendering import Frame, LooksAhead, Renderer, make_renderer
from openmap_scenes import PinholeCamera, Scene

PITCH_LIMIT = math.radians(60.0)
_ACTIONS = frozenset(int(action) for action in Action)
_STOP, _FORWARD, _LEFT, _RIGHT, _UP = (
    int(a) for a in (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT, Action.LOOK_UP)
)
LARGE = 0.1
"""Floors of less than this share of the largest are not looked at ahead."""
COLLISION_SHARE = 0.9
"""A step counts as a collision if the body ends less than this share of it, horizontally, from where it was."""


class Simulator:
    """One scene, one body, one camera.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    renderer : str, mapping or Renderer
        Name of a backend; or its name and settings, ``{"name": "opengl", "platform": "osmesa"}``; or a renderer for this scene
        and camera, which the simulator then owns and closes.
    body : Body
    camera_height : float
        Metres above the floor.
    forward_step, turn_deg, look_deg : float
        Of one action: m, degrees, degrees.
    surface : NavigableSurface or None
        Where the body can stand, if it is at hand already; made from the scene otherwise.
    """

    def __init__(
        self,
        scene: Scene,
        camera: PinholeCamera,
        *,
        renderer: str | Mapping[str, Any] | Renderer = "opengl",
        body: Body | None = None,
        camera_height: float = 1.25,
        forward_step: float = 0.25,
        turn_deg: float = 15.0,
        look_deg: float = 15.0,
        surface: NavigableSurface | None = None,
    ) -> None:
        for name, value in (("camera_height", camera_height), ("forward_step", forward_step)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} is {value} m, expected more than 0")
        for name, value in (("turn_deg", turn_deg), ("look_deg", look_deg)):
            if not 0.0 < value <= 180.0:
                raise ValueError(f"{name} is {value}, expected more than 0 and at most 180 degrees")
        if surface is not None and body is not None and surface.body != body:
            raise ValueError(f"the surface was made for {surface.body}, not for {body}")
        self.scene, self.camera = scene, camera
        self.surface = surface or NavigableSurface.from_scene(scene, body)
        self.body = self.surface.body
        self.camera_height, self.forward_step = camera_height, forward_step
        self.turn, self.look = math.radians(turn_deg), math.radians(look_deg)
        self.renderer = _renderer(renderer, scene, camera)
        if isinstance(self.renderer, LooksAhead):
            self.renderer.recall(eye_places(self.surface, camera_height))
        self._position: npt.NDArray[np.float64] | None = None
        self._heading = self._pitch = 0.0
        self._T_world_camera: npt.NDArray[np.float64] | None = None
        self._frame: Frame | None = None

    @property
    def position(self) -> npt.NDArray[np.float64]:
        """Where the body stands, (3,) float64 m, on the floor; a copy."""
        if self._position is None:
            raise RuntimeError("the simulator has no pose yet; call reset(position, heading) first")
        return self._position.copy()

    @property
    def heading(self) -> float:
        """Radians in [-pi, pi)."""
        return self._heading

    @property
    def pitch(self) -> float:
        """Radians, at most ``PITCH_LIMIT`` up or down."""
        return self._pitch

    @property
    def T_world_body(self) -> npt.NDArray[np.float64]:
        """Body-to-world (4, 4): origin on the floor, -z forward, y up."""
        c, s = math.cos(self._heading), math.sin(self._heading)
        x, y, z = self.position.tolist()
        return np.array([[c, 0.0, s, x], [0.0, 1.0, 0.0, y], [-s, 0.0, c, z], [0.0, 0.0, 0.0, 1.0]])

    @property
    def T_world_camera(self) -> npt.NDArray[np.float64]:
        """Camera-to-world (4, 4), OpenGL axes: the body's pose, raised, then pitched about its x axis; a copy."""
        return self._camera_pose().copy()

    def _camera_pose(self) -> npt.NDArray[np.float64]:
        if self._T_world_camera is None:
            c, s = math.cos(self._heading), math.sin(self._heading)
            cp, sp = math.cos(self._pitch), math.sin(self._pitch)
            x, y, z = self.position.tolist()
            self._T_world_camera = np.array(
                [
                    [c, s * sp, s * cp, x],
                    [0.0, cp, -sp, y + self.camera_height],
                    [-s, c * sp, c * cp, z],
                    [0.0, 0.0, 0.0, 1.0],
                ]
            )
        return self._T_world_camera

    def reset(self, position: npt.ArrayLike, heading: float, pitch: float = 0.0) -> None:
        """Stand at the nearest place to a position (3,) m, at most 0.5 m off, and look along a heading and pitch (radians).

        Raises
        ------
        ValueError
            There is nowhere to stand near the position, or the angles are not finite.
        """
        if not (math.isfinite(heading) and math.isfinite(pitch)):
            raise ValueError(f"heading is {heading} and pitch is {pitch}, expected finite radians")
        snapped = self.surface.snap(position)
        if snapped is None:
            low, high = self.surface.centres.min(0).round(2).tolist(), self.surface.centres.max(0).round(2).tolist()
            raise ValueError(
                f"position {np.asarray(position).tolist()} is not navigable in {self.scene.name}: {self.body} cannot stand "
                f"within 0.5 m of it, expected a place on a floor between {low} and {high}; draw one with surface.random_point"
            )
        self._position, self._heading = snapped, _wrap(heading)
        self._pitch = min(max(pitch, -PITCH_LIMIT), PITCH_LIMIT)
        self._forget_view()

    def step(self, action: Action | int) -> bool:
        """Do one action; whether the body collided (see ``COLLISION_SHARE``). STOP changes nothing.

        Raises
        ------
        ValueError
            There is no such action.
        """
        position = self._position
        if position is None:
            raise RuntimeError("the simulator has no pose yet; call reset(position, heading) first")
        if action not in _ACTIONS:
            raise ValueError(
                f"action is {action!r}, expected one of {', '.join(f'{a.value} {a.name}' for a in Action)}"
            )
        if action == _STOP:
            return False
        self._forget_view()
        if action == _FORWARD:
            dx, dz = -self.forward_step * math.sin(self._heading), -self.forward_step * math.cos(self._heading)
            self._position = end = self.surface.try_step(position, (dx, 0.0, dz))
            moved = math.hypot(end[0] - position[0], end[2] - position[2])
            return moved < COLLISION_SHARE * self.forward_step
        if action in (_LEFT, _RIGHT):
            self._heading = _wrap(self._heading + (self.turn if action == _LEFT else -self.turn))
        else:
            pitch = self._pitch + (self.look if action == _UP else -self.look)
            self._pitch = min(max(pitch, -PITCH_LIMIT), PITCH_LIMIT)
        return False

    def observe(self) -> Frame:
        """What the camera sees. The same arrays come back until the pose changes: copy before writing into them."""
        if self._frame is None:
            self._frame = self.renderer.render(self._camera_pose())
        return self._frame

    def hand_out(self) -> Frame:
        """What the camera sees, in arrays that nobody else holds: they are the caller's. Another look draws anew."""
        frame, self._frame = self.observe(), None
        return frame

    def _forget_view(self) -> None:
        self._T_world_camera = self._frame = None

    def close(self) -> None:
        """Close the renderer; closing twice is harmless."""
        self.renderer.close()


def eye_places(surface: NavigableSurface, camera_height: float) -> npt.NDArray[np.float64]:
    """Where the camera may be, (n, 3) m: above each cell of every large floor, so many m."""
    large = np.flatnonzero(surface.grounded_areas >= LARGE * surface.grounded_areas.max())
    return np.asarray(surface.centres[np.isin(surface.island, large)] + np.array([0.0, camera_height, 0.0]))


def _renderer(renderer: str | Mapping[str, Any] | Renderer, scene: Scene, camera: PinholeCamera) -> Renderer:
    if isinstance(renderer, str):
        return make_renderer(renderer, scene, camera)
    if isinstance(renderer, Mapping):
        settings = dict(renderer)
        return make_renderer(settings.pop("name"), scene, camera, **settings)
    return renderer


def _wrap(angle: float) -> float:
    """The same angle in [-pi, pi) radians."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
