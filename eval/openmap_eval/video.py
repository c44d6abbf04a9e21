"""The walk as an MP4: what the camera sees, its depth, the masks of the last keyframe and the growing map."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import imageio.v2 as imageio
import numpy as np

from openmap_agents.agent import Agent, Observation
from openmap_agents.mapping import MapInstance
from openmap_agents.openmap_agent import OpenMapAgent
from openmap_env.env import OpenMapNavEnv
from openmap_env.picture import coloured_depth
from openmap_eval.pictures import (
    Picture,
    Plan,
    draw_instances,
    draw_occupancy,
    draw_path,
    mask_picture,
    things,
    titled,
)

PANEL = (480, 360)
FRAMES_A_SECOND = 20
ORACLE_SHORT = "ORACLE: "
"""In the letters that OpenCV can draw."""
MAP_EVERY = 20
"""The map is asked for its instances every so many steps: merging anew for every frame would slow the walk down."""


class WalkVideo:
    """A step observer that writes one video frame every ``every`` steps; a context manager.

    The file appears under its name only when the video is complete. ``oracle`` puts the word before the titles of masks and
    map.
    """

    def __init__(self, path: Path, every: int = 2, oracle: bool = False) -> None:
        self._title = ORACLE_SHORT if oracle else ""
        self._path, self._temporary, self._every = path, path.with_name(f".{path.name}.tmp.mp4"), every
        self._steps = 0
        self._seen_masks: Any = None
        self._things: list[MapInstance] = []
        self._mask_panel = np.zeros((PANEL[1], PANEL[0], 3), np.uint8)
        self._writer = imageio.get_writer(
            self._temporary,
            fps=FRAMES_A_SECOND,
            codec="libx264",
            quality=6,
            macro_block_size=8,
            ffmpeg_log_level="error",
        )

    def __call__(self, env: OpenMapNavEnv, agent: Agent, observation: Observation) -> None:
        if not isinstance(agent, OpenMapAgent):
            raise ValueError(f"the agent is a {type(agent).__name__}; only the openmap agent's walk can be filmed")
        if agent.last_masks is not None and agent.last_masks is not self._seen_masks:
            self._seen_masks = agent.last_masks
            self._mask_panel = _panel(mask_picture(observation["rgb"], agent.last_masks.labels))
        if self._steps % MAP_EVERY == 0:
            self._things = things(agent.instance_map)
        if self._steps % self._every == 0:
            self._writer.append_data(self._compose(agent, observation))
        self._steps += 1

    def _compose(self, agent: OpenMapAgent, observation: Observation) -> Picture:
        top = [
            titled(_panel(observation["rgb"]), "camera"),
            titled(_panel(coloured_depth(observation["depth"][..., 0])), "depth"),
        ]
        bottom = [
            titled(
                self._mask_panel,
                f"{self._title}masks of the last keyframe: {0 if self._seen_masks is None else len(self._seen_masks)}",
            ),
            titled(
                _growing_map(agent, self._things),
                f"{self._title}map: {len(self._things)} things after {self._steps} steps",
            ),
        ]
        return np.vstack([np.hstack(top), np.hstack(bottom)])

    def __enter__(self) -> WalkVideo:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()
        if kind is None and self._steps:
            self._temporary.replace(self._path)
        else:
            self._temporary.unlink(missing_ok=True)


def _panel(picture: Picture) -> Picture:
    return np.asarray(cv2.resize(picture, PANEL, interpolation=cv2.INTER_AREA), np.uint8)


def _growing_map(agent: OpenMapAgent, seen: list[MapInstance]) -> Picture:
    trajectory = np.asarray(agent.trajectory)
    extent = [trajectory, *(np.stack([i.aabb_min, i.aabb_max]) for i in seen)]
    # At least 8 m across, so that the picture does not jump about in the first steps.
    plan = Plan.around(np.concatenate([*extent, trajectory[:1] - 4.0, trajectory[:1] + 4.0]), PANEL)
    picture = plan.blank()
    draw_occupancy(picture, plan, agent.occupancy)
    draw_instances(picture, plan, seen)
    draw_path(picture, plan, trajectory)
    return picture
