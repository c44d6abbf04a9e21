"""The agent of the paper: it explores, builds the instance map while it walks, and answers from the map.

``retrieval``: it explores once for each episode frame; a later episode in the same frame is answered at once. ``navigation``:
it explores until all is seen or more looking would not change the answer (``stopping.py``), grounds the instruction, walks to
where the chosen instance is in plain sight from beside it, and stops there. It reads nothing but observations.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from openmap_agents.agent import Answer, Observation
from openmap_agents.colour_votes import ColourVotes
from openmap_agents.exploration import Explorer, ExplorerSettings, OccupancyMap, standing_place
from openmap_agents.grounding import Grounder, Grounding
from openmap_agents.mapping import InstanceMap, MapInstance, MappingSettings, OpenMapper
from openmap_agents.naming import Naming
from openmap_agents.perception import Encoder, Masks, Segmenter
from openmap_agents.perception.specs import check_feature_length, check_text_space
from openmap_agents.stopping import EarlyStop, StopSettings
from openmap_env.actions import Action
from openmap_scenes import PinholeCamera

Protocol = Literal["retrieval", "navigation"]


@dataclass(frozen=True)
class OpenMapAgentSettings:
    """How the agent goes about it."""

    protocol: Protocol = "retrieval"
    keyframe_distance: float = 0.3
    """A frame is looked at closely when the body has moved farther than this since the last one, m ..."""
    keyframe_turn_deg: float = 25.0
    """... or its camera has turned by more than this."""
    arm: float = 0.1
    """Places to stand this much farther from the chosen instance than the nearest one count as beside it, m."""
    stop: StopSettings = field(default_factory=StopSettings)
    """When exploration ends before all is seen (navigation)."""
    explorer: ExplorerSettings = field(default_factory=ExplorerSettings)
    mapping: MappingSettings = field(default_factory=MappingSettings)
    max_walk: int = 150
    """Actions after which the walk to the chosen instance is given up (navigation)."""


class OpenMapAgent:
    """See the module; implements ``openmap_agents.agent.Agent``.

    Parameters
    ----------
    camera : PinholeCamera
        Of the observations.
    segmenter : Segmenter
    encoder : Encoder
    grounder : Grounder
        In the encoder's space.
    settings : OpenMapAgentSettings or None
    rng : np.random.Generator or None
        None = seed 0.
    made_by : (str, str)
        Specs of the segmenter and of the encoder, which are kept with the map; "" = not known.

    Attributes
    ----------
    last_masks : Masks or None
        Of the last keyframe.
    keyframes : int
        How many frames were looked at closely in this episode frame.
    """

    def __init__(
        self,
        camera: PinholeCamera,
        segmenter: Segmenter,
        encoder: Encoder,
        grounder: Grounder,
        settings: OpenMapAgentSettings | None = None,
        rng: np.random.Generator | None = None,
        made_by: tuple[str, str] = ("", ""),
    ) -> None:
        self.camera, self.segmenter, self.encoder, self.grounder = camera, segmenter, encoder, grounder
        self.settings = settings or OpenMapAgentSettings()
        self._made_by = made_by
        self._seed = int((rng if rng is not None else np.random.default_rng(0)).integers(2**32))
        self._frame: str | None = None
        self._naming = Naming(encoder, made_by)
        self._on_the_way: Grounder | None = None
        self._forget()

    def _forget(self) -> None:
        """A new home, or a new frame: nothing learned so far holds."""
        # Drawn anew for each episode frame, so that an evaluation that was resumed draws the same.
        rng = np.random.default_rng([self._seed, zlib.crc32(str(self._frame).encode())])
        self.explorer = Explorer(self.settings.explorer, rng)
        self.mapper = OpenMapper(self.camera, self.settings.mapping)
        self.last_masks: Masks | None = None
        self.keyframes = 0
        self._colours = ColourVotes()
        self._last_keyframe: npt.NDArray[np.float64] | None = None
        self._final: InstanceMap | None = None
        self._begin("")

    def _begin(self, instruction: str) -> None:
        """An episode begins; the map stays."""
        self._instruction = instruction
        self._grounding: Grounding | None = None
        self._walked = 0
        self._early = EarlyStop(self.settings.stop)
        self._stopped_early = False
        self.explorer.walker.lift()

    @property
    def occupancy(self) -> OccupancyMap:
        """The explorer's grid."""
        return self.explorer.occupancy

    @property
    def trajectory(self) -> npt.NDArray[np.float64]:
        """Where the body stood after each action, (n, 3) m, episode frame."""
        return self.explorer.trajectory

    @property
    def instance_map(self) -> InstanceMap:
        """The map so far; once exploration has ended, with elected colours and labels."""
        return self.mapper.instance_map if self._final is None else self._final

    def reset(self, observation: Observation, info: dict[str, Any]) -> None:
        """An episode begins. Unless ``info["episode_frame"]`` is that of the last one, everything learned is dropped."""
        frame = str(info["episode_frame"])
        if frame != self._frame:
            self._frame = frame
            self._forget()
        elif self.settings.protocol == "retrieval" and self.keyframes and self._final is None:
            self.finish_map()  # The episode before was cut off while exploring: what it saw is what there is.
        elif self._stopped_early:
            self._final = None  # What was enough for the instruction before may not be for this one.
        self._begin(str(observation["instruction"]))

    def act(self, observation: Observation) -> int:
        """The next action: explore, then (navigation) walk to the chosen instance, then STOP."""
        if self._final is not None and self.settings.protocol == "retrieval":
            return int(Action.STOP)
        self._see(observation)
        if self._final is None:
            action = None if self._may_stop() else self.explorer.next_action()
            if action is not None:
                return int(action)
            self.finish_map()
        if self.settings.protocol == "retrieval":
            return int(Action.STOP)
        return int(self._walk())

    def answer(self) -> Answer:
        """All instances of the map, ranked for the episode's instruction."""
        grounding, instance_map = self._ground(), self.instance_map
        ranked = [instance_map.get(i) for i in grounding.ranking]
        positions = np.array([i.centre for i in ranked], np.float32).reshape(-1, 3)
        trace = {
            **grounding.trace,
            "ranking": grounding.ranking[:16],
            "instances": len(instance_map),
            "keyframes": self.keyframes,
            "steps": self.explorer.steps,
            "stopped_early": self._stopped_early,
            "asked_on_the_way": self._early.asked,
        }
        return Answer(positions, [i.label for i in ranked], trace)

    def finish_map(self) -> InstanceMap:
        """End exploration: merge what there is, elect colours, give every instance a name."""
        self._final = self._naming.finish(self.mapper.finalize(), self._colours)
        self._grounding = None
        return self._final

    def save(self, path: str | Path) -> None:
        """Write the map (``InstanceMap.save``)."""
        (self._final or self.finish_map()).save(path)

    def load(self, path: str | Path, episode_frame: str) -> None:
        """Take a saved map for that of an episode frame, in which the agent then answers without exploring.

        Raises
        ------
        DataError
            The map cannot be read, or another encoder made its features.
        """
        instance_map = InstanceMap.load(path)
        check_text_space(path, instance_map.encoder, self._made_by[1])
        check_feature_length(path, instance_map.feature_lengths, self.encoder.dim)
        self._frame = episode_frame
        self._forget()
        self._final = instance_map

    def _may_stop(self) -> bool:
        """Whether more looking would not change the answer (navigation)."""
        if self.settings.protocol != "navigation" or self._stopped_early or not self._early.due(self.keyframes):
            return False
        so_far = self._naming.finish(self.mapper.instance_map, self._colours)
        # A language model is asked once an episode, for its answer: on the way the built-in interpreter is.
        grounding = self._scout().ground(self._instruction, so_far)
        self._stopped_early = self._early.settled(grounding, so_far, self.keyframes)
        return self._stopped_early

    def _scout(self) -> Grounder:
        if self._on_the_way is None:
            asks_a_model = getattr(self.grounder, "llm", None) is not None
            self._on_the_way = Grounder(None, encoder=self.encoder) if asks_a_model else self.grounder
        return self._on_the_way

    def _see(self, observation: Observation) -> None:
        """Occupancy from every observation, instances from keyframes."""
        depth = np.asarray(observation["depth"], np.float32)[..., 0]
        T_episode_camera = np.asarray(observation["T_episode_camera"], np.float64)
        self.explorer.update(depth, T_episode_camera, self.camera)
        if self._final is not None or not self._is_keyframe(T_episode_camera):
            return
        rgb = observation["rgb"]
        masks = self.segmenter.segment(rgb, depth, T_episode_camera, self.camera)
        features = self.encoder.encode_regions(rgb, depth, masks, T_episode_camera, self.camera)
        self.mapper.integrate(depth, masks.labels, features if len(masks) else None, T_episode_camera, rgb)
        self._colours.add(rgb, masks)
        self.last_masks, self._last_keyframe = masks, T_episode_camera
        self.keyframes += 1

    def _is_keyframe(self, T_episode_camera: npt.NDArray[np.float64]) -> bool:
        """Whether the camera sees something new: it has moved or turned enough, and the body is not pushing against something."""
        if self._last_keyframe is None:
            return True
        if self.explorer.walker.blocked:
            return False
        moved = float(np.linalg.norm(T_episode_camera[:3, 3] - self._last_keyframe[:3, 3]))
        cosine = float((np.trace(T_episode_camera[:3, :3].T @ self._last_keyframe[:3, :3]) - 1.0) / 2.0)
        turned = math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
        return moved > self.settings.keyframe_distance or turned > self.settings.keyframe_turn_deg

    def _ground(self) -> Grounding:
        if self._grounding is None:
            self._grounding = self.grounder.ground(self._instruction, self._final or self.finish_map())
        return self._grounding

    def _walk(self) -> Action:
        """The next action on the way to stand beside the chosen instance and face it; STOP there, or without a choice."""
        grounding = self._ground()
        chosen = grounding.choice if grounding.choice is not None else next(iter(grounding.ranking), None)
        self._walked += 1
        if chosen is None or self._walked > self.settings.max_walk:
            return Action.STOP
        return self._towards(self.instance_map.get(chosen)) or Action.STOP

    def _towards(self, instance: MapInstance) -> Action | None:
        walker = self.explorer.walker
        ways = walker.ways()
        tall = self.settings.explorer.tall
        found = standing_place(self.occupancy, ways, instance.points, arm=self.settings.arm, tall=tall)
        if found is not None and (action := walker.follow(ways, found[0])):
            return action
        x, _, z = instance.centre.tolist()
        return walker.turn_towards(math.atan2(walker.x - x, walker.z - z))


def with_budget(settings: OpenMapAgentSettings, max_steps: int) -> OpenMapAgentSettings:
    """The settings of an agent that has ``max_steps`` actions: time is left to answer and, in navigation, to walk there."""
    least = 1 if settings.protocol == "retrieval" else min(settings.max_walk, max_steps // 2) + 1
    explorer = replace(settings.explorer, max_steps=max(0, min(settings.explorer.max_steps, max_steps - least)))
    return replace(settings, explorer=explorer)
