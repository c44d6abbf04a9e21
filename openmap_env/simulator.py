"""A body with a camera in a home: it turns, walks, looks up and down, and sees.

Poses are world frame: Y up, m; heading 0 looks along -Z and grows to the left (about +Y), pitch grows upwards, both in radians.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from openmap_env.actions import Action
from openmap_env.navigation import Body, NavigableSurface
from openmap_env.rendering import Frame, Renderer, make_renderer
from openmap_scenes import PinholeCamera, Scene

PITCH_LIMIT = math.radians(60.0)
COLLISION_SHARE = 0.9
"""A step counts as a collision if the body ends less than this share of it, horizontally, from where it was."""


class Simulator:
    """One scene, one body, one camera.

    Parameters
    ----------
    scene : Scene
    camera : PinholeCamera
    renderer : str or Renderer
        Name of a backend, or a renderer for this scene and camera, which the simulator then owns and closes.
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
        renderer: str | Renderer = "opengl",
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
        self.renderer = make_renderer(renderer, scene, camera) if isinstance(renderer, str) else renderer
        self._position: npt.NDArray[np.float64] | None = None
        self._heading = self._pitch = 0.0
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
        T_world_body = np.eye(4)
        T_world_body[:3, :3] = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
        T_world_body[:3, 3] = self.position
        return T_world_body

    @property
    def T_world_camera(self) -> npt.NDArray[np.float64]:
        """Camera-to-world (4, 4), OpenGL axes."""
        c, s = math.cos(self._pitch), math.sin(self._pitch)
        T_body_camera = np.eye(4)
        T_body_camera[1:3, 1:3] = [[c, -s], [s, c]]
        T_body_camera[1, 3] = self.camera_height
        return self.T_world_body @ T_body_camera

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
        self._frame = None

    def step(self, action: Action | int) -> bool:
        """Do one action; whether the body collided (see ``COLLISION_SHARE``). STOP changes nothing.

        Raises
        ------
        ValueError
            There is no such action.
        """
        position = self.position
        if action not in tuple(Action):
            raise ValueError(
                f"action is {action!r}, expected one of {', '.join(f'{a.value} {a.name}' for a in Action)}"
            )
        if action == Action.STOP:
            return False
        self._frame = None
        if action == Action.MOVE_FORWARD:
            ahead = np.array([-math.sin(self._heading), 0.0, -math.cos(self._heading)])
            self._position = self.surface.try_step(position, self.forward_step * ahead)
            moved = math.hypot(*(self._position - position)[[0, 2]])
            return moved < COLLISION_SHARE * self.forward_step
        if action in (Action.TURN_LEFT, Action.TURN_RIGHT):
            self._heading = _wrap(self._heading + (self.turn if action == Action.TURN_LEFT else -self.turn))
        else:
            pitch = self._pitch + (self.look if action == Action.LOOK_UP else -self.look)
            self._pitch = min(max(pitch, -PITCH_LIMIT), PITCH_LIMIT)
        return False

    def observe(self) -> Frame:
        """What the camera sees. The same arrays come back until the pose changes: copy before writing into them."""
        if self._frame is None:
            self._frame = self.renderer.render(self.T_world_camera)
        return self._frame

    def close(self) -> None:
        """Close the renderer; closing twice is harmless."""
        self.renderer.close()


def _wrap(angle: float) -> float:
    """The same angle in [-pi, pi) radians."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
