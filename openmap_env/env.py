"""The environment: an agent walks through a home, sees, and is asked for something in plain language."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import EzPickle

from openmap_env.actions import Action
from openmap_env.episodes import KINDS, Episode, Kind
from openmap_env.episodes.source import EpisodeSource
from openmap_env.goals import way_to
from openmap_env.measures import Walk, score
from openmap_env.navigation import Body
from openmap_env.observations import SENSORS, Sensor, check_instruction, observation_space
from openmap_env.picture import TopDownPicture, coloured_depth
from openmap_env.simulator import Simulator
from openmap_scenes import PinholeCamera, load_scene

Observation = dict[str, Any]
Protocol = Literal["retrieval", "navigation"]

TIME_PENALTY = 0.001
SUCCESS_BY_PROTOCOL: dict[Protocol, str] = {"retrieval": "sr_1", "navigation": "nav_success"}
_OPTIONS = ("scene", "episode", "instruction", "start")


class OpenMapNavEnv(gym.Env[Observation, int], EzPickle):
    """
    An agent explores a home, sees colour and depth, and is asked for something in plain language.

    ## Description
    A body with a camera stands in a furnished home, a triangle mesh with textures. An instruction asks for something: a thing
    ("the blue armchair"), whatever serves a need ("I am thirsty"), or the end of a described way ("leave the bedroom and stop at
    the sink"). The agent walks, declares where it believes the thing to be, and stops.

    All that an agent sees or answers is in the **episode frame**: origin on the floor where the body starts, Y up, metres, -Z the
    way it faces at the start, X to its right. Camera axes are OpenGL's: x right, y up, looking along -z.

    There are two protocols. `retrieval`: every episode of a scene starts at the same pose, so that `info["episode_frame"]` stays
    and a map made once may answer all of the scene's instructions. `navigation`: every episode starts at its own pose.

    ## Action Space
    `Discrete(6)`; sizes are arguments.

    - 0: STOP, ends the episode
    - 1: MOVE_FORWARD (0.25 m, sliding along what bars the way)
    - 2: TURN_LEFT (15 degrees)
    - 3: TURN_RIGHT (15 degrees)
    - 4: LOOK_UP (15 degrees, at most 60 above the horizon)
    - 5: LOOK_DOWN (15 degrees, at most 60 below)

    Before STOP an agent may declare places, best first: `env.unwrapped.declare(positions)` with `(k, 3)` float32 m in the episode
    frame; the last declaration counts. An agent that stops without one has declared where it stands: the point
    on the floor under it.

    ## Observation Space
    A flat `Dict`:

    | key | shape | dtype | meaning |
    |---|---|---|---|
    | `rgb` | (H, W, 3) | uint8 | sRGB |
    | `depth` | (H, W, 1) | float32 | planar (z) metres, 0 = nothing seen |
    | `semantic` | (H, W, 1) | int32 | instance ids, 0 = none; only if asked for by `sensors` |
    | `T_episode_camera` | (4, 4) | float32 | camera-to-episode transform |
    | `gps` | (2,) | float32 | metres ahead of and to the right of the start: (-z, x), Habitat's order |
    | `compass` | (1,) | float32 | heading against that of the start, radians in [-pi, pi], positive to the left, as in Habitat |
    | `instruction` | - | str | what is asked |

    ## Starting State
    The scene and then the episode are drawn by `np_random` unless `reset(options=...)` names them. The body stands on the floor,
    looking level. `navigation`: at the episode's start. `retrieval`: at the scene's start, which is that of the scene's first
    episode if episodes were given, and otherwise a place drawn once from the scene's largest floor by `episode_seed`.

    `reset` takes the options `scene` (a catalogue spec), `episode` (an `Episode`, the id of one, or an index), `instruction` (a
    text: in place of a named episode's, or, with no episode named, a free question whose answer nobody knows) and `start`
    (world-frame position (3,) m and heading in radians).

    ## Rewards
    - STOP with success: +1. Success is `sr_1` in `retrieval` and `nav_success` in `navigation`.
    - every step, STOP included: -0.001

    ## Episode End
    - Termination: STOP.
    - Truncation: `max_steps` steps were taken.

    ## Information
    `reset()` and `step()` return:
    - `episode_id`, `kind`: of the episode; for a free question, "free"
    - `episode_frame`: an opaque token that stays the same while scene and start pose do: what an agent has learned may outlive an
      episode only so long
    - `collided`: whether the last step forward was barred
    - `metrics`, at the end only: `sr_1`, `sr_4`, `sr_8`, `sr_16`, `sr_surface_1`, ..., `nav_success`, `spl`, `distance_to_goal`,
      `path_length`, `steps`, `collisions`, as `openmap_env.measures` defines them; for a free question only the last three

    ## Arguments
    ```python
    import gymnasium as gym

    gym.make("openmap_env:OpenMapNav-v0", scene="homes:val/0", protocol="retrieval", sensors=("rgb", "depth"))
    ```

    * `scene=None`: a catalogue spec ("homes:val/0", "mp3d:<scan folder>", "file:<mesh>") or a list of them.
        None = the scenes of the episodes, or `homes:val/0` if there are none.
    * `episodes=None`: None = generate them for each scene; the path of an episode file or folder (R2R-CE, ObjectNav, our own JSON
        lines); or a list of `Episode`.
    * `sensors=("rgb", "depth")`: any of `rgb`, `depth`, `semantic`.
    * `width=640`, `height=480`, `hfov_deg=90.0`, `camera_height=1.25`: the camera; pixels, degrees across, metres above the floor.
    * `body=None`: a `Body`; None = radius 0.2 m, height 1.5 m, steps up to 0.2 m.
    * `forward_step=0.25`, `turn_deg=15.0`, `look_deg=15.0`: sizes of the actions, m and degrees.
    * `max_steps=500`: steps until truncation.
    * `renderer="opengl"`: or `pyrender`, `raycast`.
    * `protocol="retrieval"`: or `navigation`.
    * `episodes_per_scene=24`, `episode_seed=0`, `kinds=("object_goal", "demand", "language_guided")`: what is generated.
    * `render_mode=None`: or `rgb_array`: colour, depth and a map from above side by side, with targets; for people, not for agents.

    ## Version History
    * v0: Initial version release
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 4}  # noqa: RUF012 - Gymnasium's own name and type

    def __init__(
        self,
        *,
        scene: str | Sequence[str] | None = None,
        episodes: str | Path | Sequence[Episode] | None = None,
        sensors: Sequence[Sensor] = ("rgb", "depth"),
        width: int = 640,
        height: int = 480,
        hfov_deg: float = 90.0,
        camera_height: float = 1.25,
        body: Body | None = None,
        forward_step: float = 0.25,
        turn_deg: float = 15.0,
        look_deg: float = 15.0,
        max_steps: int = 500,
        renderer: str = "opengl",
        protocol: Protocol = "retrieval",
        episodes_per_scene: int = 24,
        episode_seed: int = 0,
        kinds: Sequence[Kind] = KINDS,
        render_mode: str | None = None,
    ) -> None:
        # A pickled environment is its settings: it wakes up before its first reset.
        given = locals()
        EzPickle.__init__(self, **{name: given[name] for name in type(self).__init__.__kwdefaults__ or ()})
        if protocol not in SUCCESS_BY_PROTOCOL:
            raise ValueError(f"protocol is {protocol!r}, expected one of {', '.join(SUCCESS_BY_PROTOCOL)}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode is {render_mode!r}, expected None or one of {self.metadata['render_modes']}")
        if max_steps < 1:
            raise ValueError(f"max_steps is {max_steps}, expected at least 1")
        if isinstance(sensors, str) or not set(sensors) <= set(SENSORS):
            raise ValueError(f"sensors is {sensors!r}, expected a list of any of {', '.join(SENSORS)}")
        self.camera = PinholeCamera.from_hfov(width, height, hfov_deg)
        self.sensors, self.max_steps, self.protocol, self.render_mode = tuple(sensors), max_steps, protocol, render_mode
        self._episode_seed = episode_seed
        self._source = EpisodeSource(scene, episodes, episodes_per_scene, episode_seed, kinds)
        self._body: dict[str, Any] = {
            "renderer": renderer,
            "body": body,
            "camera_height": camera_height,
            "forward_step": forward_step,
            "turn_deg": turn_deg,
            "look_deg": look_deg,
        }
        self.action_space = spaces.Discrete(len(Action))  # type: ignore[assignment]
        self.observation_space = observation_space(self.camera, self.sensors)
        self._simulator: Simulator | None = None
        self._scene_spec = ""
        self._episode: Episode | None = None
        self._walk: Walk | None = None
        self._over = True
        self._T_world_episode = np.eye(4)
        self._start_heading = 0.0
        self._frame_token = ""
        self._floor_picture: TopDownPicture | None = None

    # What analysis and oracle agents may look at; no agent that is to be scored does.

    @property
    def simulator(self) -> Simulator:
        """The scene at hand, its renderer, surface and body."""
        if self._simulator is None:
            raise RuntimeError("the environment has no scene yet; call reset() first")
        return self._simulator

    @property
    def episode(self) -> Episode:
        """The episode at hand, its targets included; as it is run, so a replaced instruction or start is in it."""
        if self._episode is None:
            raise RuntimeError("the environment has no episode yet; call reset() first")
        return self._episode

    @property
    def episodes(self) -> list[Episode]:
        """Every episode of the scene at hand."""
        simulator = self.simulator
        return list(self._source.of(self._scene_spec, simulator.scene, simulator.surface))

    @property
    def T_world_episode(self) -> npt.NDArray[np.float64]:
        """Episode-to-world transform (4, 4) float64; a copy."""
        return self._T_world_episode.copy()

    # Gymnasium's interface

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; see "Starting State" for the options.

        Raises
        ------
        ValueError
            An option is unknown or cannot be used.
        openmap_scenes.DataError
            A scene or episode cannot be used.
        """
        super().reset(seed=seed)
        episode = self._choose(dict(options or {}))
        check_instruction(episode.instruction)
        self.simulator.reset(episode.start_position, episode.start_heading)
        self._episode = episode
        self._T_world_episode = self.simulator.T_world_body
        self._start_heading = self.simulator.heading
        pose = [*self.simulator.position.tolist(), self.simulator.heading]
        self._frame_token = hashlib.sha256(f"{episode.scene} {pose!r}".encode()).hexdigest()[:16]
        self._walk = Walk(episode.targets, None, [self.simulator.position])
        self._over = False
        return self._observe(), self._info(collided=False)

    def step(self, action: int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Play one action; see "Action Space".

        Raises
        ------
        ValueError
            There is no such action.
        RuntimeError
            The episode is over, or none has begun.
        """
        walk = self._running()
        if not self.action_space.contains(action):
            raise ValueError(f"action is {action!r}, expected an integer from 0 to {len(Action) - 1}")
        collided = self.simulator.step(int(action))
        walk.path.append(self.simulator.position)
        walk.collisions += collided
        walk.stopped = int(action) == Action.STOP
        truncated = not walk.stopped and len(walk.path) > self.max_steps
        self._over = walk.stopped or truncated
        info, reward = self._info(collided), -TIME_PENALTY
        if self._over:
            info["metrics"] = self._metrics(walk)
            if walk.stopped:
                reward += info["metrics"].get(SUCCESS_BY_PROTOCOL[self.protocol], 0.0)
        return self._observe(), reward, walk.stopped, truncated, info

    def declare(self, positions: npt.ArrayLike) -> None:
        """Say where the thing asked for is, best guess first; the last declaration before the end of the episode counts.

        Parameters
        ----------
        positions : (k, 3) float32 m, episode frame
            k = 0 takes an earlier declaration back.

        Raises
        ------
        ValueError
            It is not a finite (k, 3) array.
        RuntimeError
            The episode is over, or none has begun.
        """
        walk = self._running()
        try:
            places = np.asarray(positions, np.float32).astype(np.float64)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"declared {positions!r}, expected numbers of shape (k, 3), m in the episode frame"
            ) from error
        if places.size == 0:
            places = places.reshape(0, 3)
        if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
            state = "" if np.isfinite(places).all() else ", not all finite"
            raise ValueError(
                f"declared an array of shape {places.shape}{state}, expected finite (k, 3), m in the episode frame"
            )
        T = self._T_world_episode
        walk.declared = places @ T[:3, :3].T + T[:3, 3]

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The picture that ``render_mode`` asks for, (H, 2 W + H, 3) uint8, or None without one."""
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode gives nothing; pass render_mode='rgb_array' to gym.make")
            return None
        walk, frame, size = self._walk, self.simulator.observe(), self.camera.height
        if walk is None:
            raise RuntimeError("nothing to render yet; call reset() first")
        if self._floor_picture is None:
            self._floor_picture = TopDownPicture(self.simulator.surface, size)
        floor = self._floor_picture.draw(np.array(walk.path), self.simulator.heading, walk.targets, walk.declared)
        return np.concatenate([frame.rgb, coloured_depth(frame.depth), floor], axis=1)

    def close(self) -> None:
        """Give the scene and the graphics context back; a later reset loads them again."""
        if self._simulator is not None:
            self._simulator.close()
        self._simulator, self._walk, self._floor_picture, self._scene_spec, self._over = None, None, None, "", True

    # Episodes

    def _choose(self, options: dict[str, Any]) -> Episode:
        """The episode that the options and the random generator name, as it is to be run, with its scene loaded."""
        unknown = sorted(set(options) - set(_OPTIONS))
        if unknown:
            raise ValueError(f"reset options {unknown} are unknown, expected any of {', '.join(_OPTIONS)}")
        named, instruction, spec = options.get("episode"), options.get("instruction"), options.get("scene")
        if named is not None:
            episode = self._named(named, spec)
            self._enter(episode.scene)
        else:
            self._enter(spec or self._source.draw_scene(self.np_random))
            episode = self._free(instruction) if instruction is not None else self._draw()
        episode = self._source.complete(episode, self.simulator.scene)
        if instruction is not None:
            episode = replace(episode, instruction=instruction)
        if "start" in options:
            position, heading = _start(options["start"])
        elif self.protocol == "retrieval":
            position, heading = self._scene_start()
        else:
            position, heading = episode.start_position, episode.start_heading
        return replace(episode, start_position=position, start_heading=heading)

    def _named(self, named: Any, spec: str | None) -> Episode:
        if isinstance(named, Episode):
            return named if spec is None else replace(named, scene=spec)
        if not isinstance(named, str | int | np.integer) or isinstance(named, bool):
            raise ValueError(f"option episode is {named!r}, expected an Episode, the id of one, or an index")
        named = named if isinstance(named, str) else int(named)
        episode = self._source.find(named)
        if episode is None:
            # Generated episodes exist once their scene has been entered.
            for scene in [spec] if spec else self._source.scenes:
                self._enter(scene)
                self._source.of(scene, self.simulator.scene, self.simulator.surface)
                episode = episode or self._source.find(named)
        if episode is None or (spec is not None and episode.scene != spec):
            raise ValueError(
                f"there is no episode {named!r} in {spec or self._source.scenes}; see the environment's episodes"
            )
        return episode

    def _draw(self) -> Episode:
        episodes = self._source.of(self._scene_spec, self.simulator.scene, self.simulator.surface)
        if not episodes:
            raise ValueError(f"no episode was given for scene {self._scene_spec}")
        return episodes[int(self.np_random.integers(len(episodes)))]

    def _free(self, instruction: str) -> Episode:
        position, heading = _random_start(self.simulator, self.np_random)
        return Episode("free", self._scene_spec, instruction, "object_goal", position, heading, ())

    def _scene_start(self) -> tuple[tuple[float, float, float], float]:
        given = self._source.given_for(self._scene_spec)
        if given:
            return given[0].start_position, given[0].start_heading
        return _random_start(self.simulator, np.random.default_rng(self._episode_seed))

    def _enter(self, spec: str) -> None:
        """Load a scene, unless it is the one at hand; only one is kept."""
        if not isinstance(spec, str):
            raise ValueError(f"scene is {spec!r}, expected a catalogue spec such as 'homes:val/0'")
        if spec != self._scene_spec or self._simulator is None:
            self.close()
            self._simulator = Simulator(load_scene(spec), self.camera, **self._body)
            self._scene_spec = spec

    # What goes out

    def _running(self) -> Walk:
        if self._walk is None or self._over:
            raise RuntimeError("the episode is over, or none has begun; call reset() first")
        return self._walk

    def _observe(self) -> Observation:
        simulator, frame = self.simulator, self.simulator.observe()
        T_episode_camera = np.linalg.inv(self._T_world_episode) @ simulator.T_world_camera
        ahead = self._T_world_episode[:3, :3].T @ (simulator.position - self._T_world_episode[:3, 3])
        turned = math.remainder(simulator.heading - self._start_heading, math.tau)
        seen: dict[Sensor, npt.NDArray[Any]] = {
            "rgb": frame.rgb,
            "depth": frame.depth[..., None],
            "semantic": frame.instance[..., None],
        }
        return {
            **{name: seen[name].copy() for name in self.sensors},
            "T_episode_camera": T_episode_camera.astype(np.float32),
            "gps": np.array([-ahead[2], ahead[0]], np.float32),
            "compass": np.array([turned], np.float32),
            "instruction": self.episode.instruction,
        }

    def _info(self, collided: bool) -> dict[str, Any]:
        return {
            "episode_id": self.episode.episode_id,
            "kind": self.episode.kind if self.episode.targets else "free",
            "episode_frame": self._frame_token,
            "collided": collided,
        }

    def _metrics(self, walk: Walk) -> dict[str, float]:
        surface = self.simulator.surface
        if walk.targets:
            walk.way = way_to(surface, self.simulator.scene, walk.targets, surface.island_of(walk.path[0]))
        return score(walk)


def _start(value: Any) -> tuple[tuple[float, float, float], float]:
    """The option ``start`` as a position and a heading."""
    try:
        position, heading = value
        x, y, z, angle = (float(v) for v in (*position, heading))
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"option start is {value!r}, expected (position (3,) m, heading in radians), world frame"
        ) from error
    if not all(map(math.isfinite, (x, y, z, angle))):
        raise ValueError(f"option start is {value!r}, expected finite numbers")
    return (x, y, z), angle


def _random_start(simulator: Simulator, rng: np.random.Generator) -> tuple[tuple[float, float, float], float]:
    x, y, z = simulator.surface.random_point(rng).tolist()
    return (x, y, z), float(rng.uniform(-math.pi, math.pi))
