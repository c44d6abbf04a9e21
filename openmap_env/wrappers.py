"""Observation wrappers: what learning libraries want instead of a text and of metres.

    env = gym.make("OpenMapNav-v0", sensors=("rgb", "depth"))
    env = RelativeDepth(TopDownOccupancy(EmbedInstruction(env)))
    env = gymnasium.wrappers.FilterObservation(env, ["rgb", "depth", "map", "instruction_embedding"])
    env = gymnasium.wrappers.FrameStackObservation(env, 4)

What Gymnasium has is not here again: ``FilterObservation`` picks keys, ``FrameStackObservation`` stacks the last observations (put
``EmbedInstruction`` or a filter before it: it cannot stack texts), ``FlattenObservation`` makes one vector of all. With
``gym.make_vec`` they go into ``wrappers=[...]`` for Gymnasium's own vector environments and into ``env_wrappers=[...]`` for ours.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from openmap_env.embedding import EMBEDDINGS, Embedding
from openmap_env.observations import FARTHEST
from openmap_env.occupancy import FREE, OCCUPIED, Occupancy
from openmap_env.settings import integer, number, refuse
from openmap_scenes import PinholeCamera

Observation = dict[str, Any]
Env = gym.Env[Observation, int]
_LARGEST = float(np.finfo(np.float32).max)
_LARGEST_MAP, _FINEST, _COARSEST = 2048, 0.009, 1.0
"""Pixels a side, and metres a pixel, of a map: a hundred square metres in pixels of 1 cm are a million."""


class EmbedInstruction(gym.ObservationWrapper[Observation, int, Observation], RecordConstructorArgs):
    """Replaces ``instruction`` by a vector of fixed size, as stable-baselines3's ``MultiInputPolicy`` takes it.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``instruction``.
    embed : str or callable
        Text -> (D,) numbers, always the same D; asked once per new instruction. Or the name of one in
        ``openmap_env.embedding.EMBEDDINGS``: ``"hashed"`` needs no model and knows no meanings.
        One that does: ``lambda text: encoder.encode_text([text])[0]`` of ``openmap_agents.perception.make_encoder("embedded")``.
    key : str
        Name of the vector in the observation.

    Raises
    ------
    ValueError
        The environment has no instruction, or ``embed`` is no known name or gives no finite vector of one size.
    """

    def __init__(self, env: Env, embed: str | Embedding = "hashed", key: str = "instruction_embedding") -> None:
        # A callable may hold a model: it is kept as it is.
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, embed=embed, key=key)
        gym.ObservationWrapper.__init__(self, env)
        kept = {name: space for name, space in _parts(env, "instruction").items() if name != "instruction"}
        chosen = EMBEDDINGS.get(embed) if isinstance(embed, str) else embed
        if not callable(chosen):
            refuse("embed", embed, f"a callable or one of {', '.join(EMBEDDINGS)}")
        if not isinstance(key, str) or not key or key in kept:
            refuse("key", key, f"a name that the observation does not have yet; it has {', '.join(kept)}")
        self._embed, self._key = chosen, key
        self._last: tuple[str, npt.NDArray[np.float32]] | None = None
        self._size: int | None = None
        self._size = len(self._vector("find the chair"))
        self.observation_space = spaces.Dict({**kept, key: spaces.Box(-_LARGEST, _LARGEST, (self._size,), np.float32)})

    def observation(self, observation: Observation) -> Observation:
        """The observation with the vector in place of the text."""
        kept = {name: value for name, value in observation.items() if name != "instruction"}
        return {**kept, self._key: self._vector(observation["instruction"]).copy()}

    def _vector(self, text: str) -> npt.NDArray[np.float32]:
        if self._last is None or self._last[0] != text:
            self._last = (text, self._checked(text, self._embed(text)))
        return self._last[1]

    def _checked(self, text: str, found: Any) -> npt.NDArray[np.float32]:
        try:
            vector = np.asarray(found, np.float32)
        except (TypeError, ValueError):
            vector = np.empty(0, np.float32)
        expected = (self._size,) if self._size is not None else vector.shape
        if vector.ndim != 1 or len(vector) == 0 or vector.shape != expected or not np.isfinite(vector).all():
            size = "D" if self._size is None else self._size
            refuse(f"embed({text[:60]!r})", found, f"finite numbers of shape ({size},)")
        return vector


class NormalizeDepth(gym.ObservationWrapper[Observation, int, Observation], RecordConstructorArgs):
    """Turns ``depth`` from metres into 0..1, as habitat-lab does: clipped to [min_depth, max_depth], scaled; 0 stays 0.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``depth``.
    min_depth, max_depth : float
        Metres.
    """

    def __init__(self, env: Env, min_depth: float = 0.0, max_depth: float = 10.0) -> None:
        RecordConstructorArgs.__init__(self, min_depth=min_depth, max_depth=max_depth)
        gym.ObservationWrapper.__init__(self, env)
        self.observation_space = _with_unit_depth(env)
        self._max = number("max_depth", max_depth, 0.0, FARTHEST, "m")
        if min_depth != 0.0:
            number("min_depth", min_depth, 0.0, np.nextafter(self._max, 0.0), "m")
        self._min = float(min_depth)

    def observation(self, observation: Observation) -> Observation:
        """The observation with scaled depth."""
        depth = observation["depth"]
        scaled = (np.clip(depth, self._min, self._max) - self._min) / np.float32(self._max - self._min)
        scaled = np.where(depth > 0.0, scaled, 0.0).astype(np.float32)
        return {**observation, "depth": scaled}


class RelativeDepth(gym.ObservationWrapper[Observation, int, Observation], RecordConstructorArgs):
    """Takes the scale out of ``depth``, as a network that sees one picture cannot know it: each frame runs from 0 to 1.

    The nearest point of a frame is 1 and the farthest 0, in between it is linear in 1 / depth, which is what monocular networks
    give (Ranftl et al. 2020, "MiDaS"). Where nothing was seen it is 0; a frame of one depth alone is 0 too.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``depth``.
    """

    def __init__(self, env: Env) -> None:
        RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        self.observation_space = _with_unit_depth(env)

    def observation(self, observation: Observation) -> Observation:
        """The observation with relative depth."""
        depth = observation["depth"]
        seen = depth > 0.0
        relative = np.zeros(depth.shape, np.float32)
        if seen.any():
            inverse = 1.0 / depth[seen].astype(np.float64)
            low, high = float(inverse.min()), float(inverse.max())
            if high > low:
                relative[seen] = (inverse - low) / (high - low)
        return {**observation, "depth": relative}


class TopDownOccupancy(gym.ObservationWrapper[Observation, int, Observation], RecordConstructorArgs):
    """Adds ``map``, (size, size, 3) uint8: what the walk has seen of the floor so far, from depth and camera poses alone.

    The agent is in the middle and looks up. Channel 0 is 255 where something bars the way, channel 1 where the floor is free,
    channel 2 where the agent has been; nothing is known of what is 0 in the first two. See ``openmap_env.occupancy``.

    Depth must be metres: put it before ``NormalizeDepth`` and ``RelativeDepth``. A body that climbs stairs takes its floor along,
    and what it saw of the floors below stays in the map.

    Parameters
    ----------
    env : gym.Env
        With a Dict observation that has ``depth`` and ``T_episode_camera``, and the attribute ``camera``.
    size : int
        Pixels a side.
    resolution : float
        Metres a pixel.
    """

    def __init__(self, env: Env, size: int = 64, resolution: float = 0.1) -> None:
        RecordConstructorArgs.__init__(self, size=size, resolution=resolution)
        gym.ObservationWrapper.__init__(self, env)
        inner = _parts(env, "depth", "T_episode_camera")
        integer("size", size, 1, _LARGEST_MAP)
        number("resolution", resolution, _FINEST, _COARSEST, "m")
        camera: PinholeCamera = env.get_wrapper_attr("camera")
        if inner["depth"].shape != (camera.height, camera.width, 1) or np.max(inner["depth"].high) <= 1.0:  # type: ignore[attr-defined]
            raise ValueError(
                f"depth is {inner['depth']}, expected metres, ({camera.height}, {camera.width}, 1): put this wrapper before "
                "those that change depth"
            )
        self._size, self._resolution = size, resolution
        self._seen = Occupancy(camera, resolution)
        self._been: set[tuple[int, int]] = set()
        self._camera_height: float | None = None
        self.observation_space = spaces.Dict({**inner, "map": spaces.Box(0, 255, (size, size, 3), np.uint8)})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, with an empty map."""
        self._seen.reset()
        self._been, self._camera_height = set(), None
        return super().reset(seed=seed, options=options)

    def observation(self, observation: Observation) -> Observation:
        """The observation with the map, which has this frame in it."""
        T = np.asarray(observation["T_episode_camera"], np.float64)
        # The episode frame's origin lies on the floor that the body starts on.
        self._camera_height = float(T[1, 3]) if self._camera_height is None else self._camera_height
        self._seen.integrate(observation["depth"][..., 0], T, float(T[1, 3]) - self._camera_height)
        self._been.add((int(np.floor(T[0, 3] / self._resolution)), int(np.floor(T[2, 3] / self._resolution))))
        state = self._seen.crop(T, self._size, self._resolution)
        picture = np.zeros((self._size, self._size, 3), np.uint8)
        picture[..., 0], picture[..., 1] = 255 * (state == OCCUPIED), 255 * (state == FREE)
        places = (np.array(sorted(self._been)) + 0.5) * self._resolution
        right = T[[0, 2], 0] / max(float(np.hypot(T[0, 0], T[2, 0])), 1e-9)
        off = (places - T[[0, 2], 3]) / self._resolution
        column = np.round(off @ right + (self._size - 1) / 2).astype(int)
        row = np.round(off @ np.array([-right[1], right[0]]) + (self._size - 1) / 2).astype(int)
        inside = (row >= 0) & (row < self._size) & (column >= 0) & (column < self._size)
        picture[row[inside], column[inside], 2] = 255
        return {**observation, "map": picture}


def _parts(env: Env, *names: str) -> dict[str, spaces.Space[Any]]:
    """The parts of an environment's observation space, which must have those names."""
    inner = env.observation_space
    missing = [n for n in names if not isinstance(inner, spaces.Dict) or n not in inner.spaces]
    if missing:
        found = sorted(inner.spaces) if isinstance(inner, spaces.Dict) else type(inner).__name__
        raise ValueError(f"observation space is {found}, expected a Dict with '{missing[0]}'")
    assert isinstance(inner, spaces.Dict)
    return dict(inner.spaces)


def _with_unit_depth(env: Env) -> spaces.Dict:
    inner = _parts(env, "depth")
    return spaces.Dict({**inner, "depth": spaces.Box(0.0, 1.0, inner["depth"].shape or (), np.float32)})
