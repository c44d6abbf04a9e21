"""Which stage lost the target of an episode that failed? True ids of what the agent saw are held against what it made of it.

The first of these that lost it, of the target that got farthest:

- exploration: no keyframe shows it by as much as ``seen_share`` of the picture
- segmentation: no mask of a keyframe that shows it overlaps it by ``min_iou``
- association: no instance of the map is mostly made of its pixels and has its centre within ``radius`` of the target's
- feature: asked for by its true category alone, so many others are more like it that it is not among the first N_c
- parse: its true category would have brought it among the N_c candidates, what was made of the instruction does not
- selection: it is among the candidates, and another was chosen
- navigation: the answer is right, and the agent did not stop there, or did not stop in time to give one

The ids are rendered again where the agent stands, beside it and never for it: an agent answers the same with and without.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from openmap_agents.agent import Agent, Answer, Observation
from openmap_agents.baselines.oracle_map import OracleMapAgent
from openmap_agents.grounding import Grounder
from openmap_agents.mapping import InstanceMap, MapInstance, OpenMapper
from openmap_agents.openmap_agent import OpenMapAgent
from openmap_agents.perception import Masks
from openmap_env.env import OpenMapNavEnv
from openmap_env.episodes import Target
from openmap_env.measures import SUCCESS_RADIUS
from openmap_eval.records import STAGES

Ids = npt.NDArray[np.int64]
Loss = tuple[str, dict[str, Any]]
"""A stage, and what shows that it was this one."""


@dataclass(frozen=True)
class AttributionSettings:
    """What counts as seen, as segmented, and as an instance of the map."""

    seen_share: float = 100 / (640 * 480)
    """Share of a picture's pixels from which a thing in it counts as seen; one pixel at least."""
    min_iou: float = 0.5
    """Pixels that a mask and a thing have in common, of those that either has."""
    min_purity: float = 0.5
    """Share of a map instance's pixels, over all of its masks, that have to be the thing's."""
    radius: float = SUCCESS_RADIUS
    """Between the centres of the two boxes, m: as success is measured."""


@dataclass
class Sights:
    """What the keyframes of one map truly show; ids index the arrays (n,).

    Parameters
    ----------
    enough : int
        Pixels from which a thing counts as seen in a keyframe.
    pixels : (n,) int64
        Most pixels of a thing in one keyframe.
    iou : (n,) float64
        Best overlap of a thing with a mask, of the keyframes that show enough of it.
    masks : dict
        (keyframe from 0, label) -> true ids and how many of the mask's pixels each has.
    """

    enough: int
    pixels: Ids
    iou: npt.NDArray[np.float64]
    masks: dict[tuple[int, int], tuple[Ids, Ids]] = field(default_factory=dict)

    @classmethod
    def none(cls, n: int, enough: int) -> Sights:
        """Before the first keyframe, for ids below n."""
        return cls(enough, np.zeros(n, np.int64), np.zeros(n))

    def add(self, keyframe: int, labels: npt.NDArray[np.int32], ids: npt.NDArray[np.int32]) -> None:
        """Take in a keyframe's masks (H, W) and true ids (H, W); both 0 = none."""
        n, n_masks = len(self.pixels), int(labels.max(initial=0))
        table = np.bincount((labels.astype(np.int64) * n + ids).ravel(), minlength=(n_masks + 1) * n).reshape(-1, n)
        shown = table.sum(0)
        either = table[1:].sum(1, keepdims=True) + shown - table[1:]
        iou = (table[1:] / np.maximum(either, 1)).max(0, initial=0.0)
        self.pixels = np.maximum(self.pixels, shown)
        self.iou = np.where(shown >= self.enough, np.maximum(self.iou, iou), self.iou)
        for label in range(1, n_masks + 1):
            true = np.flatnonzero(table[label])
            self.masks[keyframe, label] = (true, table[label, true])

    def made_of(self, instance: MapInstance) -> Ids:
        """How many pixels (n,) of an instance's masks each true id has."""
        total = np.zeros(len(self.pixels), np.int64)
        for keyframe, label in instance.views[:, :2].tolist():
            true, count = self.masks.get((keyframe, label), (np.empty(0, np.int64), np.empty(0, np.int64)))
            total[true] += count
        return total


@dataclass(frozen=True)
class _Known:
    """A finished map and what is truly in it; arrays are in the order of its instances.

    Parameters
    ----------
    map : InstanceMap
    centres : (M, 3) float64 m, world frame
    purity : (M, n) float64
        Share of each instance that each true id has.
    categories : dict
        Of every true id.
    called : dict
        Of what an instance of the map, by its id, mostly is; "" = of nothing.
    sights : Sights or None
        None = the map is the true one.
    """

    map: InstanceMap
    centres: npt.NDArray[np.float64]
    purity: npt.NDArray[np.float64]
    categories: dict[int, str]
    called: dict[int, str]
    sights: Sights | None


class Attribution:
    """A step observer that remembers what keyframes truly show, and says afterwards where a target was lost.

    Agents other than openmap and oracle_map have no such stages: their failures are not attributed.
    """

    def __init__(self, settings: AttributionSettings | None = None) -> None:
        self.settings = settings or AttributionSettings()
        self._mapper: OpenMapper | None = None
        self._masks: Masks | None = None
        self._sights: Sights | None = None
        self._known: _Known | None = None
        self._by_name: dict[str, list[int]] = {}

    def __call__(self, env: OpenMapNavEnv, agent: Agent, observation: Observation) -> None:
        """Look at what the agent has just seen, if it looked closely."""
        if not isinstance(agent, OpenMapAgent) or agent.last_masks is None or agent.last_masks is self._masks:
            return
        if self._sights is None or agent.mapper is not self._mapper:
            enough = max(1, round(self.settings.seen_share * env.camera.width * env.camera.height))
            self._mapper, self._sights = agent.mapper, Sights.none(_n_ids(env), enough)
        self._masks = agent.last_masks
        frame = env.simulator.observe()
        ids = np.where(frame.depth > 0, frame.instance, 0)
        self._sights.add(agent.keyframes - 1, self._masks.labels, ids)

    def lost_at(
        self, env: OpenMapNavEnv, agent: Agent, metrics: Mapping[str, float], answer: Answer | None
    ) -> Loss | None:
        """The stage that lost the episode which has just ended; None for a success, and where it cannot be told."""
        right = metrics.get("sr_1")
        there = metrics["nav_success"] if env.protocol == "navigation" and "nav_success" in metrics else 1.0
        if right is None or not isinstance(agent, OpenMapAgent | OracleMapAgent) or (right >= 1.0 and there >= 1.0):
            return None
        if right >= 1.0:
            return "navigation", {"stopped_at_m": _finite(metrics.get("distance_to_goal"))}
        known = self._look_at(env, agent)
        losses = [self._loss(target, known, agent.grounder, answer) for target in env.episode.targets]
        return max(losses, key=lambda loss: STAGES.index(loss[0])) if losses else None

    def _look_at(self, env: OpenMapNavEnv, agent: OpenMapAgent | OracleMapAgent) -> _Known:
        """The agent's map, compared with the scene; kept while it stays."""
        instance_map = agent.instance_map
        if self._known is not None and self._known.map is instance_map:
            return self._known
        self._by_name = {}
        n, ids = _n_ids(env), np.array([i.id for i in instance_map], np.int64)
        if isinstance(agent, OracleMapAgent):
            sights, T, made_of = None, np.eye(4), np.eye(n)[ids]
        else:
            sights, T = self._sights or Sights.none(n, 1), env.T_world_episode
            made_of = np.array([sights.made_of(i) for i in instance_map], np.float64).reshape(-1, n)
        categories = {i.id: i.category for i in env.simulator.scene.instances}
        called = {int(i): categories.get(int(true), "") for i, true in zip(ids, made_of.argmax(1), strict=True)}
        centres = instance_map.centres.astype(np.float64) @ T[:3, :3].T + T[:3, 3]
        purity = made_of / np.maximum(made_of.sum(1, keepdims=True), 1)
        self._known = _Known(instance_map, centres, purity, categories, called, sights)
        return self._known

    def _loss(self, target: Target, known: _Known, grounder: Grounder, answer: Answer | None) -> Loss:
        """Where one target was lost."""
        thing, settings, sights = target.instance_id, self.settings, known.sights
        shown: dict[str, Any] = {"target": thing, "category": known.categories.get(thing, "place")}
        if sights is not None and thing:
            shown["pixels"] = int(sights.pixels[thing])
            if sights.pixels[thing] < sights.enough:
                return "exploration", shown
            shown["iou"] = round(float(sights.iou[thing]), 3)
            if sights.iou[thing] < settings.min_iou:
                return "segmentation", shown
        off = np.linalg.norm(known.centres - np.asarray(target.centre), axis=1)
        pure = known.purity[:, thing] >= settings.min_purity if thing else np.ones(len(off), bool)
        its = np.flatnonzero(pure & (off <= settings.radius)).tolist()
        if not its:
            shown["purity"] = round(float(known.purity[:, thing].max(initial=0.0)), 3) if thing else None
            shown["centre_off_m"] = round(float(off[pure].min()), 2) if pure.any() else None
            return "association", shown
        ids = [known.map.instances[k].id for k in its]
        shown["instances"] = ids
        wanted = grounder.settings.n_candidates
        if thing:
            shown["rank_by_name"] = self._rank_by_name(shown["category"], ids, known, grounder)
            if shown["rank_by_name"] > wanted:
                return "feature", shown
        if answer is None:
            return "navigation", {**shown, "answered": False}
        candidates = [c["id"] for c in answer.trace.get("candidates", [])]
        places = [candidates.index(i) + 1 for i in ids if i in candidates]
        ranked = answer.trace.get("ranking", [])
        shown["rank"] = min((ranked.index(i) + 1 for i in ids if i in ranked), default=None)
        if not places:
            return "parse", shown
        return "selection", {**shown, "candidate": min(places), "chosen": answer.trace.get("choice")}

    def _rank_by_name(self, category: str, ids: list[int], known: _Known, grounder: Grounder) -> int:
        """The best place of the instances when asked for by that name alone; others truly of that name do not count."""
        if category not in self._by_name:
            self._by_name[category] = _by_similarity(grounder)(category, known.map)
        rank = 1
        for instance_id in self._by_name[category]:
            if instance_id in ids:
                break
            rank += known.called[instance_id] != category
        return rank


def _by_similarity(grounder: Grounder) -> Callable[[str, InstanceMap], list[int]]:
    """A grounder's retrieval without its parsing, conditions and selection: words, map -> ids, most similar first."""
    # A copy has the vectors and the prepared map of the other, and leaves it as it is.
    bare = copy.copy(grounder)
    bare.llm, bare.settings = None, replace(grounder.settings, parse=False, select=False)
    return lambda words, instance_map: bare.ground(words, instance_map).ranking


def _n_ids(env: OpenMapNavEnv) -> int:
    """One more than the largest true id."""
    return 1 + max((i.id for i in env.simulator.scene.instances), default=0)


def _finite(value: float | None) -> float | None:
    return round(value, 2) if value is not None and np.isfinite(value) else None
