"""When more looking would not change the answer: the rule by which an agent that is sent for one thing stops exploring.

The map so far is asked every few keyframes. Exploration ends when the same instance was chosen so many times running, each
time with enough confidence, was seen in enough frames, and nothing that was said compares it with things not seen yet: the
largest, the second, the one closest to the door and the one that is not by the sofa are only known once all are. A need may be
served by something better elsewhere, and a relation or a told way may fit another thing better, so these have to be surer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from openmap_agents.grounding import Grounding
from openmap_agents.mapping import InstanceMap

COMPARING = ("closest", "farthest", "away")
"""Relations that hold for one thing because they hold less for all others."""


@dataclass(frozen=True)
class StopSettings:
    """The rule; see the module."""

    confidence: float = 0.0
    """The grounding's confidence from which on an answer may end exploration; 0 = never: all is explored first."""
    margin: float = 0.5
    """For needs, relations and ways, this share of what the confidence lacks to 1 is asked on top."""
    views: int = 3
    """Frames in which the chosen instance was seen, at least."""
    times: int = 2
    """How often in a row the same instance must be chosen."""
    every: int = 10
    """Keyframes between two questions."""


class EarlyStop:
    """Keeps what the rule has to remember in one episode.

    Attributes
    ----------
    asked : int
        How often the map was asked.
    """

    def __init__(self, settings: StopSettings) -> None:
        self.settings = settings
        self.asked = 0
        self._last: np.ndarray[Any, np.dtype[np.float64]] | None = None
        self._agreed = 0
        self._asked_at = 0

    def due(self, keyframes: int) -> bool:
        """Whether the map, made of so many keyframes, is to be asked now."""
        return self.settings.confidence > 0 and keyframes - self._asked_at >= self.settings.every

    def settled(self, grounding: Grounding, instance_map: InstanceMap, keyframes: int) -> bool:
        """Whether this answer, from a map of so many keyframes, ends exploration."""
        self.asked += 1
        self._asked_at = keyframes
        choice = None if grounding.choice is None else instance_map.get(grounding.choice)
        enough = self.needed(grounding.trace.get("description", {}))
        if (
            choice is None
            or enough is None
            or grounding.confidence < enough
            or _frames(choice.views) < self.settings.views
        ):
            self._last, self._agreed = None, 0
            return False
        # Ids may change while the map grows; a thing stays where it is.
        same = self._last is not None and float(np.linalg.norm(choice.centre - self._last)) < 0.5
        self._agreed = self._agreed + 1 if same else 1
        self._last = np.asarray(choice.centre, np.float64)
        return self._agreed >= self.settings.times

    def needed(self, description: dict[str, Any]) -> float | None:
        """The confidence asked for what was said (``Description.to_json``); None = all must be seen first."""
        target = description.get("target") or {}
        relations = target.get("relations") or []
        compared = any(r.get("negated") or r.get("name") in COMPARING for r in relations)
        if compared or description.get("avoid") or any(target.get(name) for name in ("superlative", "ordinal")):
            return None
        enough = self.settings.confidence
        surer = relations or description.get("needs") or description.get("route")
        return enough + self.settings.margin * (1.0 - enough) if surer else enough


def _frames(views: np.ndarray[Any, Any] | None) -> int:
    return 0 if views is None else len(np.unique(np.asarray(views).reshape(-1, 3)[:, 0]))
