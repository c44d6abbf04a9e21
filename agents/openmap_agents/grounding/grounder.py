"""Which instance of the map does an instruction mean? Parse, retrieve, select, as in section "instruction-to-instance
grounding" of OpenMap.

1. Parse: instruction -> ``Description``, by a language model or by the built-in interpreter.
2. Retrieve: text features against every instance; attributes, rooms and relations scored by geometry; the
   ``n_candidates`` best are candidates.
3. Select: each candidate with its place, similarity and its neighbours' labels, as multiple choice. Without a model
   the best score is the choice.

The whole ranking survives, so that SR_k means what it says, and every answer carries its trace.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from openmap_agents.grounding import dialogue
from openmap_agents.grounding.description import Description, Thing
from openmap_agents.grounding.interpreter import Interpreter
from openmap_agents.grounding.lexicon import load_lexicon
from openmap_agents.grounding.llm import Budget, LanguageModel, LanguageModelError, make_llm
from openmap_agents.grounding.needs import Needs
from openmap_agents.grounding.scoring import MapView, Scores, score
from openmap_agents.grounding.text_space import TextEncoder, TextSpace
from openmap_agents.mapping.instance_map import InstanceMap

SURE_NEED = 0.65
"""Cosine with a known need (shared words included) from which unknown words are taken for a need."""


@dataclass(frozen=True)
class GroundingSettings:
    """How to ground; N_c, N_s and 2 m are the paper's."""

    n_candidates: int = 8
    """N_c: how many instances are looked at closely."""
    n_neighbours: int = 5
    """N_s: how many things around a candidate are named."""
    neighbour_radius: float = 2.0
    """Metres, centre to centre."""
    min_confidence: float = 0.1
    """Below this nothing in the map fits, and there is no choice; the ranking stays."""
    parse: bool = True
    """False: the instruction as it is goes to the encoder (ablation)."""
    select: bool = True
    """False: text similarity alone ranks (ablation)."""
    llm_seconds: float = 30.0
    """Wall clock that one grounding may spend on its language model."""
    llm_calls: int = 6
    """Requests that one grounding may make, retries included."""
    prompts: Path | None = None
    """A folder of one's own parse.md and select.md for the language model; None: those of this package."""


@dataclass(frozen=True)
class Grounding:
    """The answer.

    Parameters
    ----------
    ranking : list of int
        All instance ids, best first.
    choice : int or None
        The first of the ranking; None if nothing fits.
    confidence : float
        0..1 that what was asked for is in the map, whichever it is; after a model's choice, the model's own.
    trace : dict
        How it came about; plain JSON.
    scores : list of float
        Of the instances in ``ranking``; the model's choice stands first whatever its score.
    fits : list of float
        How well each of them is what was asked for by itself, whatever stands around it or was ranked before it.
    """

    ranking: list[int]
    choice: int | None
    confidence: float
    trace: dict[str, Any]
    scores: list[float] = field(default_factory=list)
    fits: list[float] = field(default_factory=list)


class Grounder:
    """Instructions -> instances.

    Parameters
    ----------
    llm : str or LanguageModel or None
        A spec for ``make_llm``, or a model; None is "builtin".
    encoder : TextEncoder
        In the space of the instances' features.
    text_encoder : TextEncoder, optional
        For sentences (needs); the encoder itself if not given.
    settings : GroundingSettings, optional
    """

    def __init__(
        self,
        llm: str | LanguageModel | None = "builtin",
        *,
        encoder: TextEncoder,
        text_encoder: TextEncoder | None = None,
        settings: GroundingSettings | None = None,
    ) -> None:
        self.llm = make_llm(llm) if isinstance(llm, str) else llm
        self.settings = settings or GroundingSettings()
        dialogue.check_prompts(self.settings.prompts)
        self._lexicon = load_lexicon()
        self._space = TextSpace(encoder)
        self._needs = Needs(self._lexicon, self._space if text_encoder is None else TextSpace(text_encoder))
        self._interpreter = Interpreter(self._lexicon)
        self._view: MapView | None = None

    def ground(self, instruction: str, instance_map: InstanceMap) -> Grounding:
        """Rank all instances of the map by how well they are what the instruction asks for."""
        clock = _Clock()
        budget = Budget(self.settings.llm_seconds, self.settings.llm_calls)
        trace: dict[str, Any] = {
            "backend": self.llm.name if self.llm else "builtin",
            "instruction": instruction,
            "llm_calls": [],
            "fallbacks": [],
        }
        description = self._parse(instruction, budget, trace)
        trace["description"] = description.to_json()
        clock.lap("parse")
        view = self._viewed(instance_map)
        scores = score(description, view)
        order = _order(scores.total if self.settings.select else scores.fit, view)
        clock.lap("retrieve")
        candidates = [self._candidate(index, view, scores) for index in order[: self.settings.n_candidates]]
        trace["candidates"] = candidates
        confidence = _confidence(scores, order, view)
        chosen = order[0] if order and confidence >= self.settings.min_confidence else None
        if self.llm is not None and candidates and self.settings.select:
            order, chosen, confidence = self._select(
                instruction, description, candidates, order, chosen, confidence, budget, trace
            )
        clock.lap("select")
        trace["choice"] = None if chosen is None else view.ids[chosen]
        trace["confidence"] = round(confidence, 4)
        trace["milliseconds"] = clock.milliseconds
        return Grounding(
            ranking=[view.ids[k] for k in order],
            choice=trace["choice"],
            confidence=confidence,
            trace=trace,
            scores=[float(scores.total[k]) for k in order],
            fits=[float(scores.fit[k]) for k in order],
        )

    def _viewed(self, instance_map: InstanceMap) -> MapView:
        """The map prepared for questions; kept while the same map is asked."""
        if self._view is None or self._view.map is not instance_map or len(self._view) != len(instance_map):
            self._view = MapView(instance_map, self._space, self._lexicon)
        return self._view

    def _parse(self, instruction: str, budget: Budget, trace: dict[str, Any]) -> Description:
        if not self.settings.parse:
            return Description(kind="object_goal", target=Thing(phrase=instruction, queries=((instruction, 0.0),)))
        if self.llm is not None:
            reply = self._ask(
                "parse",
                dialogue.parse_messages(instruction, self.settings.prompts),
                dialogue.PARSE_SCHEMA,
                budget,
                trace,
            )
            if reply is not None:
                return dialogue.description_from_reply(reply, self._interpreter.nouns, self._lexicon)
        description = self._interpreter.parse(instruction)
        target = description.target
        # "Nature calls": no verb, no name and nothing said of a thing. What things are for may know it as a need.
        unknown = description.kind == "object_goal" and target is not None and not self._interpreter.knows(target)
        if unknown and self._needs.strength(instruction) >= SURE_NEED:
            description = Description(kind="demand", needs=(instruction,))
        return replace(description, serves=self._needs.serving(description.needs))

    def _ask(
        self,
        purpose: str,
        messages: list[dict[str, str]],
        schema: dict[str, Any],
        budget: Budget,
        trace: dict[str, Any],
    ) -> dict[str, Any] | None:
        """The model's reply, None if it gave none; either way the trace says what happened."""
        if self.llm is None:
            return None
        reply: dict[str, Any] | None = None
        try:
            reply, record = self.llm.complete(messages, schema, budget)
        except LanguageModelError as error:
            record = error.args[1] if len(error.args) > 1 else []
            trace["fallbacks"].append({"step": purpose, "to": "builtin", "because": str(error.args[0])})
        trace["llm_calls"].extend({"purpose": purpose, **entry} for entry in record)
        return reply

    def _candidate(self, index: int, view: MapView, scores: Scores) -> dict[str, Any]:
        boxes = view.boxes
        around = view.neighbours(index, self.settings.neighbour_radius, self.settings.n_neighbours)
        return {
            "id": view.ids[index],
            "label": view.labels[index],
            "colour": view.colours[index],
            "similarity": round(float(scores.fit[index]), 4),
            "score": round(float(scores.total[index]), 4),
            "geometry": scores.detail(index),
            "centre": [round(float(v), 2) for v in boxes.centre[index]],
            "size": [round(float(v), 2) for v in boxes.size[index]],
            "neighbours": [
                {
                    "id": view.ids[k],
                    "label": view.labels[k],
                    "metres": round(float(np.linalg.norm(boxes.centre[k] - boxes.centre[index])), 2),
                }
                for k in around
            ],
        }

    def _select(
        self,
        instruction: str,
        description: Description,
        candidates: list[dict[str, Any]],
        order: list[int],
        chosen: int | None,
        confidence: float,
        budget: Budget,
        trace: dict[str, Any],
    ) -> tuple[list[int], int | None, float]:
        """The model's choice moves to the front; without a reply everything stays as it was."""
        messages = dialogue.select_messages(instruction, description, candidates, self.settings.prompts)
        reply = self._ask("select", messages, dialogue.select_schema(len(candidates)), budget, trace)
        if reply is None:
            return order, chosen, confidence
        if reply["choice"] == "none":
            return order, None, 1.0 - float(reply["confidence"])
        picked = order[dialogue.LETTERS.index(reply["choice"])]
        return [picked, *(k for k in order if k != picked)], picked, float(reply["confidence"])


class _Clock:
    def __init__(self) -> None:
        self._start = self._last = time.perf_counter()
        self.milliseconds: dict[str, float] = {"total": 0.0}

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.milliseconds[name] = round(1000 * (now - self._last), 2)
        self.milliseconds["total"] = round(1000 * (now - self._start), 2)
        self._last = now


def _order(values: np.ndarray[Any, np.dtype[np.float64]], view: MapView) -> list[int]:
    """Indices by falling score; equal scores by id."""
    return [int(k) for k in np.lexsort((np.array(view.ids, np.int64), -values))] if len(view) else []


NAMED = (0.71, 0.075)
"""Where a named thing is as probably here as not, and the width of the slope: logistic regression over the true maps of ten homes,
asked for what they have and, as often, for what only other homes have."""
NEEDED = (-2.83, 1.13)
"""The same for the logarithm of the chance that a need is served."""
LEAST_OWN = 0.35
"""An instance is likened to its own name at least this much: a feature that is like nothing makes nobody sure."""


def _confidence(scores: Scores, order: list[int], view: MapView) -> float:
    """Probability that what was asked for is in the map, 0..1.

    Of a named thing: how like the name the first of the ranking is, as a share of how like its own likeliest name it is (features
    of real pictures are less like any name), less what conditions cost it. Of a need: the chance that it is served.
    """
    if not order:
        return 0.0
    if scores.chance is not None:
        return _logistic(math.log(max(scores.chance, 1e-9)), NEEDED)
    first = order[0]
    share = scores.fit[first] / max(float(view.best[first]), LEAST_OWN) if scores.named else 1.0
    return _logistic(float(share + scores.total[first] - scores.fit[first]), NAMED)


def _logistic(value: float, centre_width: tuple[float, float]) -> float:
    centre, width = centre_width
    return float(1 / (1 + math.exp(min((centre - value) / width, 500.0))))
