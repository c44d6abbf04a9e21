"""One question to one map, and the figures of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata

from openmap_agents.grounding import Grounder, Grounding
from openmap_agents.mapping import InstanceMap
from openmap_env.episodes import Episode
from openmap_scenes import Scene

KS = (1, 4, 8, 16)
SUCCESS = 1.0
"""A declared centre within so many metres of a valid target's is a success."""
Cause = Literal["parse", "selection"]


@dataclass(frozen=True)
class Outcome:
    """What became of a question.

    Parameters
    ----------
    scene, kind, instruction : str
    absent : bool
        Nothing in the scene answers it.
    rank : int or None
        Of the first success in the ranking, from 1; None = not there, or absent.
    confidence : float
    chosen : bool
        Whether the grounder made a choice rather than to say "not here".
    wanted, got : str
    cause : "parse", "selection" or None
        Of a failure: the target was not among the candidates, or it was and another was chosen.
    """

    scene: str
    kind: str
    instruction: str
    absent: bool
    rank: int | None
    confidence: float
    chosen: bool
    wanted: str
    got: str
    cause: Cause | None

    def hit(self, k: int) -> bool:
        """Whether one of the first k succeeds."""
        return self.rank is not None and self.rank <= k


def ask(grounder: Grounder, episode: Episode, instance_map: InstanceMap, scene: Scene, spec: str) -> Outcome:
    """Put an episode's question to the scene's true map, which is in the world frame."""
    grounding = grounder.ground(episode.instruction, instance_map)
    names = {i.id: i.category for i in scene.instances}
    rank = _rank(grounding, episode, scene)
    cause: Cause | None = None
    if rank != 1:
        cause = "selection" if rank is not None and rank <= grounder.settings.n_candidates else "parse"
    return Outcome(
        scene=spec, kind=episode.kind, instruction=episode.instruction, absent=False, rank=rank,
        confidence=grounding.confidence, chosen=grounding.choice is not None,
        wanted=", ".join(sorted({names.get(t.instance_id, "a place") for t in episode.targets})),
        got=names[grounding.ranking[0]] if grounding.ranking else "", cause=cause,
    )  # fmt: skip


def ask_in_vain(grounder: Grounder, episode: Episode, instance_map: InstanceMap, scene: Scene, spec: str) -> Outcome:
    """Put a question for what is not there."""
    grounding = grounder.ground(episode.instruction, instance_map)
    names = {i.id: i.category for i in scene.instances}
    return Outcome(
        scene=spec, kind=episode.kind, instruction=episode.instruction, absent=True, rank=None,
        confidence=grounding.confidence, chosen=grounding.choice is not None, wanted="",
        got=names[grounding.ranking[0]] if grounding.ranking else "", cause=None,
    )  # fmt: skip


def _rank(grounding: Grounding, episode: Episode, scene: Scene) -> int | None:
    targets = np.array([t.centre for t in episode.targets], np.float64).reshape(-1, 3)
    centres = {i.id: np.asarray(i.centre, np.float64) for i in scene.instances}
    for place, instance in enumerate(grounding.ranking, start=1):
        if (np.linalg.norm(targets - centres[instance], axis=1) <= SUCCESS).any():
            return place
    return None


def auroc(present: Sequence[float], absent: Sequence[float]) -> float:
    """Chance that a question for what is there gets more confidence than one for what is not; ties count half (Mann-Whitney U)."""
    if not present or not absent:
        return float("nan")
    ranks = rankdata(np.array([*present, *absent]))
    n, m = len(present), len(absent)
    return float((ranks[:n].sum() - n * (n + 1) / 2) / (n * m))


def threshold_curve(outcomes: Sequence[Outcome], thresholds: npt.NDArray[np.float64]) -> list[dict[str, Any]]:
    """What a least confidence costs and saves: SR with answers below it taken as none, and answers for absent things."""
    present = [o for o in outcomes if not o.absent]
    absent = [o for o in outcomes if o.absent]
    rows = []
    for threshold in thresholds:
        kept = [o.hit(1) and o.confidence >= threshold for o in present]
        false = [o.confidence >= threshold for o in absent]
        rows.append(
            {
                "confidence": round(float(threshold), 3),
                "sr": float(np.mean(kept)) if kept else None,
                "false_answers": float(np.mean(false)) if false else None,
            }
        )
    return rows
