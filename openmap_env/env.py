"""The environment: an agent walks through a home, sees, and is asked for something in plain language."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import EzPickle

from openmap_env.actions import Action
from openmap_env.choice import EpisodeChoice, Wishes
from openmap_env.episodes import KINDS, Episode, Kind
from openmap_env.goals import way_to
from openmap_env.measures import Measure, Walk, default_measures, score
from openmap_env.navigation import Body
from openmap_env.observations import EpisodeFrame, Sensor, check_places, observation_space
from openmap_env.picture import EpisodePicture
from openmap_env.prefetch import Home
from openmap_env.settings import Protocol, Settings, refuse
from openmap_env.simulator import Simulator
from openmap_env.window import Window, check_display, has_display

Observation = dict[str, Any]

TIME_PENALTY = 0.001
SUCCESS_BY_PROTOCOL: dict[Protocol, str] = {"retrieval": "sr_1", "navigation": "nav_success"}
_STOP = int(Action.STOP)


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

    `openmap_env.wrappers` adds others: the instruction as a vector, scaled depth, a map of what was seen (`TopDownOccupancy`).

    ## Starting State
    The scene and then the episode are drawn by `np_random` unless `reset(options=...)` names them. The body stands on the floor,
    looking level. `navigation`: at the episode's start. `retrieval`: at the scene's start, which is that of the scene's first
    episode if episodes were given or are the benchmark's, and otherwise a place drawn once from the scene's largest floor by
    `episode_seed`.

    `reset` takes any of these options together:

    - `scene`: a catalogue spec; also one that the environment was not made with
    - `episode`: an `Episode`, the id of one, or an index among those of `scene`, or, without it, among those of all scenes in
      their order
    - `instruction`: a text, in place of the episode's; with no episode named, a free question whose answer nobody knows, asked
      somewhere on the scene's largest floor
    - `start`: where the body stands instead, as (position (3,) m, heading in radians) in the world frame

    `seed` is Gymnasium's: give it once, and later resets go on from there. The same seed gives the same episodes in every
    process.

    ## Rewards
    - STOP with success: +1. Success is `sr_1` in `retrieval` and `nav_success` in `navigation`.
    - every step, STOP included: -0.001

    ## Episode End
    - Termination: STOP.
    - Truncation: `max_steps` steps were taken. That is the environment's own count, which is scored; the `max_episode_steps` of
      `gym.make` cuts off from outside, where nothing is.

    ## Information
    `reset()` and `step()` return:
    - `episode_id`, `kind`: of the episode; for a free question, "free"
    - `episode_frame`: an opaque token that stays the same while scene and start pose do: what an agent has learned may outlive an
      episode only so long
    - `collided`: whether the last step forward was barred
    - `metrics`, at the end only: `sr_1`, `sr_4`, `sr_8`, `sr_16`, `sr_surface_1`, ..., `nav_success`, `spl`, `distance_to_goal`,
      `path_length`, ..., as `openmap_env.measures` defines them, and those of the argument `measures`; for a free question only
      those that need no target

    ## Arguments
    ```python
    import gymnasium as gym

    gym.make("openmap_env:OpenMapNav-v0", scene="homes:val/0", protocol="retrieval", sensors=("rgb", "depth"))
    ```

    * `scene=None`: a catalogue spec ("homes:val/0", "mp3d:<scan folder>", "file:<mesh>"), a path, several homes
        ("homes:train/0-9"), a split ("homes:val": its first 10 homes), or a list of these. None = the scenes of the episodes, or
        `homes:val/0` if there are none.
    * `episodes=None`: None or "benchmark" = the frozen ones of OpenMapNav-Homes for its homes, generated ones for other scenes;
        "generate" = generated for all; the path of an episode file or folder (R2R-CE, ObjectNav, VLMaps, our own JSON lines); or
        a list of `Episode`.
    * `sensors=("rgb", "depth")`: any of `rgb`, `depth`, `semantic`.
    * `width=640`, `height=480`, `hfov_deg=90.0`, `camera_height=1.25`: the camera; pixels, degrees across, metres above the floor.
    * `body=None`: a `Body`, or a dict of its fields; None = radius 0.2 m, height 1.5 m, steps up to 0.2 m.
    * `forward_step=0.25`, `turn_deg=15.0`, `look_deg=15.0`: sizes of the actions, m and degrees.
    * `max_steps=500`: steps until truncation.
    * `renderer="auto"`: `opengl`, or `raycast` on a machine without OpenGL; or one of those or `pyrender`; or a
        dict with the name and that renderer's settings, `{"name": "opengl", "platform": "osmesa"}`.
    * `protocol="retrieval"`: or `navigation`.
    * `measures=()`: `openmap_env.measures.Measure` objects beside those that are always there.
    * `episodes_per_scene=None`, `episode_seed=None`: how many episodes to generate for each scene, and by which seed; None = 24
        and 0. Given either of them, `episodes=None` means "generate".
    * `kinds=("object_goal", "demand", "language_guided")`: which of the benchmark's to take, or what to generate.
    * `prefetch=True`: load the next scene in the background while an episode runs, if there are several. It changes nothing but the
        time that a reset takes; two scenes are then in memory instead of one.
    * `render_mode=None`: `rgb_array`: what the agent sees, how far that is, and a map from above with path and targets, for people,
        not for agents; `human`: the same in a window, if there is a display (extra `window`).

    Settings that are plain data go through `env.spec.to_json()` and back.

    ## Version History
    * v0: Initial version release
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 8}  # noqa: RUF012 - Gymnasium's own name and type

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
        body: Body | Mapping[str, float] | None = None,
        forward_step: float = 0.25,
        turn_deg: float = 15.0,
        look_deg: float = 15.0,
        max_steps: int = 500,
        renderer: str | Mapping[str, Any] = "auto",
        protocol: Protocol = "retrieval",
        measures: Sequence[Measure] = (),
        episodes_per_scene: int | None = None,
        episode_seed: int | None = None,
        kinds: Sequence[Kind] = KINDS,
        prefetch: bool = True,
        render_mode: str | None = None,
    ) -> None:
        values = locals()
        given = {name: values[name] for name in OpenMapNavEnv.__init__.__kwdefaults__ or ()}
        # A pickled environment is its settings: it wakes up before its first reset.
        EzPickle.__init__(self, **copy.copy(given))
        self.render_mode = _render_mode(given.pop("render_mode"))
        if not has_display():
            self.metadata = {**self.metadata, "render_modes": ["rgb_array"]}
        self.settings = Settings.check(**given)
        s = self.settings
        self.camera, self.sensors, self.max_steps, self.protocol = s.camera, s.sensors, s.max_steps, s.protocol
        self._measures = (*default_measures(), *s.measures)
        self._choice = EpisodeChoice(s)
        self.action_space = spaces.Discrete(len(Action))  # type: ignore[assignment]
        self.observation_space = observation_space(self.camera, self.sensors)
        self._window = Window("OpenMapNav", self.metadata["render_fps"]) if self.render_mode == "human" else None
        self._simulator: Simulator | None = None
        self._home: Home | None = None
        self._episode: Episode | None = None
        self._walk: Walk | None = None
        self._over = True
        self._frame = EpisodeFrame(np.eye(4), 0.0)
        self._said: dict[str, Any] = {}
        self._picture: EpisodePicture | None = None

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
        if self._home is None:
            raise RuntimeError("the environment has no scene yet; call reset() first")
        return self._choice.of(self._home)

    @property
    def T_world_episode(self) -> npt.NDArray[np.float64]:
        """Episode-to-world transform (4, 4) float64; a copy."""
        return self._frame.T_world_episode.copy()

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
        wishes = Wishes.of(options)
        super().reset(seed=seed)
        self._over, self._episode, self._walk = True, None, None
        episode, home = self._choice.choose(wishes, self.np_random)
        simulator = self._enter(home)
        simulator.reset(episode.start_position, episode.start_heading)
        self._begin(episode, simulator)
        self._choice.look_ahead(self.np_random)
        self._show()
        return self._observe(simulator), self._info(False)

    def step(self, action: int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Play one action; see "Action Space".

        Raises
        ------
        ValueError
            There is no such action.
        RuntimeError
            The episode is over, or none has begun.
        """
        walk, simulator = self._running(), self.simulator
        # The space's own answer takes longer than the rest of a turn.
        if not (type(action) is int and 0 <= action < len(Action)) and not self.action_space.contains(action):
            refuse("action", action, f"an integer from 0 to {len(Action) - 1}")
        action = int(action)
        collided = simulator.step(action)
        walk.path.append(simulator.position)
        walk.collisions += collided
        walk.stopped = action == _STOP
        truncated = not walk.stopped and len(walk.path) > self.max_steps
        self._over = walk.stopped or truncated
        info, reward = self._info(collided), -TIME_PENALTY
        if self._over:
            info["metrics"] = self._metrics(walk)
            if walk.stopped:
                reward += info["metrics"].get(SUCCESS_BY_PROTOCOL[self.protocol], 0.0)
        self._show()
        return self._observe(simulator), reward, walk.stopped, truncated, info

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
        walk.declared = self._frame.to_world(check_places(positions))

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The picture that ``render_mode`` asks for, (h, w, 3) uint8; None without one, and with ``human``, which shows it itself.

        Its size follows from that of the camera and never changes.
        """
        if self._walk is None or self._home is None:
            raise RuntimeError("nothing to render yet; call reset() first")
        if self.render_mode is None:
            gym.logger.warn("render() without a render_mode gives nothing; pass render_mode='rgb_array' to gym.make")
            return None
        return self._draw(self._walk, self._home) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Give the scene, the graphics context, the window and the thread back; a later reset makes them again."""
        if self._window is not None:
            self._window.close()
        if self._simulator is not None:
            self._simulator.close()
        self._choice.close()
        self._simulator = self._home = self._episode = self._walk = self._picture = None
        self._over = True

    # Homes

    def _enter(self, home: Home) -> Simulator:
        """The simulator of a home, a new one unless it is the one at hand."""
        if self._simulator is None or self._home is not home:
            if self._simulator is not None:
                self._simulator.close()
            self._simulator = self._picture = None
            self._simulator, self._home = self.settings.simulator(home.scene, home.surface), home
        return self._simulator

    def _begin(self, episode: Episode, simulator: Simulator) -> None:
        self._episode = episode
        self._frame = EpisodeFrame(simulator.T_world_body, simulator.heading)
        self._said = {
            "episode_id": episode.episode_id,
            "kind": episode.kind if episode.targets else "free",
            "episode_frame": self._frame.token(episode.scene),
        }
        self._walk = Walk(episode.targets, None, [simulator.position], surface=simulator.surface)
        self._over = False

    # What goes out

    def _running(self) -> Walk:
        if self._walk is None or self._over:
            raise RuntimeError("the episode is over, or none has begun; call reset() first")
        return self._walk

    def _observe(self, simulator: Simulator) -> Observation:
        # Whoever gets a picture may write into it; a copy stays only if render() will ask for the same view.
        frame = simulator.hand_out() if self.render_mode is None else copy.deepcopy(simulator.observe())
        seen: dict[Sensor, npt.NDArray[Any]] = {
            "rgb": frame.rgb,
            "depth": frame.depth[..., None],
            "semantic": frame.instance[..., None],
        }
        return {
            **{name: seen[name] for name in self.sensors},
            **self._frame.pose(simulator.T_world_camera, simulator.heading),
            "instruction": self.episode.instruction,
        }

    def _info(self, collided: bool) -> dict[str, Any]:
        return {**self._said, "collided": collided}

    def _metrics(self, walk: Walk) -> dict[str, float]:
        simulator = self.simulator
        if walk.targets:
            island = simulator.surface.island_of(walk.path[0])
            walk.way = way_to(simulator.surface, simulator.scene, walk.targets, island)
        return score(walk, self._measures)

    def _draw(self, walk: Walk, home: Home) -> npt.NDArray[np.uint8]:
        if self._picture is None:
            self._picture = EpisodePicture(home.scene, home.surface, self.camera)
        return self._picture.draw(self.simulator.observe(), self.episode.instruction, walk, self.simulator.heading)

    def _show(self) -> None:
        if self._window is not None and self._walk is not None and self._home is not None:
            self._window.show(self._draw(self._walk, self._home))


def _render_mode(render_mode: Any) -> str | None:
    modes = OpenMapNavEnv.metadata["render_modes"]
    if render_mode is not None and render_mode not in modes:
        refuse("render_mode", render_mode, f"None or one of {', '.join(modes)}")
    if render_mode == "human":
        check_display()
    return render_mode if render_mode is None else str(render_mode)
