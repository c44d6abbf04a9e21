"""Description x map -> a score for every instance: text similarity, then what attributes, rooms and relations take off
it.

score_i = fit_i + T * sum_c w_c * log(max(s_ci, floor)),   fit_i = max over queries q of cos(f_i, q) - cost_q

so that a relation that does not hold costs what about 0.3 of cosine is worth: it decides between chairs, and does not
make a chair of a lamp. Superlatives and "second from" come last, over the instances that still compete. A need without a
thing named is scored by ``needs.cover`` instead.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from openmap_agents.grounding import spatial
from openmap_agents.grounding.colours import colour_fits, colour_word
from openmap_agents.grounding.description import Description, Relation, Thing
from openmap_agents.grounding.lexicon import FLAT, OPENINGS, STRUCTURE, Lexicon
from openmap_agents.grounding.needs import cover
from openmap_agents.grounding.rooms import rooms_of
from openmap_agents.grounding.text_space import TextSpace, unit
from openmap_agents.mapping.instance_map import InstanceMap

Array = npt.NDArray[np.float64]
TEMPERATURE = 0.1
FLOOR = 0.05
LABEL_TEMPERATURE = 0.04
KIND_COST = 0.05
"""Similarity that a need's less probable kinds lose, per factor e of probability."""
COMPETE = 0.12
STRUCTURE_COST = 0.5
ROOM_REACH = 1.6
"""How far things tell which room it is, where no walls are known, m ..."""
WITHIN_ROOM_REACH = 2.5
"""... and between the same walls."""
THROUGH_WALL = 0.1
"""How much of that is left beyond a wall."""
RELIABLE = 0.9
"""How often something that looks like its kind is one, and stands where the map says."""
STRUCTURE_SERVES = 0.1
"""How often something shaped like a wall or floor is the thing that it looks like."""
ELSEWHERE_SERVES = 0.1
"""How far something helps that is not in the room where it was asked for."""


class MapView:
    """A map prepared for questions: features, boxes, labels, the room that the things around imply.

    Parameters
    ----------
    instance_map : InstanceMap
    space : TextSpace
        In the space of the instances' features.
    lexicon : Lexicon
    """

    def __init__(self, instance_map: InstanceMap, space: TextSpace, lexicon: Lexicon) -> None:
        self.map, self.space, self.lexicon = instance_map, space, lexicon
        self.ids = [instance.id for instance in instance_map.instances]
        self.colours = [colour_word(instance.colour) for instance in instance_map.instances]
        self.colour_fits = [colour_fits(instance.colour) for instance in instance_map.instances]
        self.boxes = spatial.boxes_of(instance_map)
        names = list(lexicon.names)
        surfaces = [surface for name, others in lexicon.names.items() for surface in (name, *others)]
        starts = np.cumsum([0, *(1 + len(others) for others in lexicon.names.values())])[:-1]
        text = space.listed(surfaces)
        features = [
            i.feature if i.feature is not None else np.zeros(text.shape[1], np.float32) for i in instance_map.instances
        ]
        for instance, feature in zip(instance_map.instances, features, strict=True):
            if feature.shape != (text.shape[1],):
                raise ValueError(
                    f"instance {instance.id} has a feature of shape {feature.shape}, the encoder gives ({text.shape[1]},); "
                    "ground with the encoder that the map was made with"
                )
        # What all words of a home have in common says nothing; some encoders leave it out and some do not. A column that is the
        # same for all of them is none of that: by it an encoder says how sure it is of a region.
        self._common = text.mean(0) * (np.ptp(text, axis=0) > 0)
        stacked = unit(np.stack(features)) if features else np.zeros((0, text.shape[1]), np.float32)
        self.features = unit(stacked - self._common) * stacked.any(1, keepdims=True)
        text = unit(text - self._common)
        # A thing is as much a sofa as it is the likest of sofa, couch and settee.
        likeness = np.maximum.reduceat((self.features @ text.T).astype(np.float64), starts, axis=1)
        self.best = likeness.max(1, initial=0.0)
        self.labels = [names[k] for k in likeness.argmax(1)]
        self.structure = np.array(
            [
                label in STRUCTURE or (instance.is_structure and label not in FLAT)
                for instance, label in zip(instance_map.instances, self.labels, strict=True)
            ],
            bool,
        )
        weights = np.exp((likeness - likeness.max(1, keepdims=True)) / LABEL_TEMPERATURE) if len(self) else likeness
        self.is_called = weights / weights.sum(1, keepdims=True) if len(self) else weights
        self.column = {name: k for k, name in enumerate(names)}
        self._tree = cKDTree(self.boxes.centre) if len(self) else None
        self.rooms = self._rooms()

    def __len__(self) -> int:
        return len(self.ids)

    def _rooms(self) -> dict[str, Array]:
        """Room -> belief (N,) that an instance is in it, from the telling things around it (within about ``ROOM_REACH`` m)."""
        if not len(self):
            return {room: np.zeros(0) for room in self.lexicon.rooms}
        distance = np.linalg.norm(self.boxes.centre[:, None] - self.boxes.centre[None], axis=2)
        # A floor or a wall has its centre nowhere in particular: it neither tells nor is told.
        between = rooms_of(self.map, self.structure | np.isin(self.labels, sorted(OPENINGS)))
        parted = between[:, None] != between[None]
        known = (between[:, None] > 0) & (between[None] > 0)
        reach = np.where(known & ~parted, WITHIN_ROOM_REACH, ROOM_REACH)
        nearby = np.exp(-distance / reach) * np.where(known & parted, THROUGH_WALL, 1.0) * ~self.structure[None]
        tells: dict[str, Array] = {}
        for room, things in self.lexicon.rooms.items():
            weights = np.zeros(len(self.column))
            for name, weight in things.items():
                weights[self.column[name]] = weight
            tells[room] = nearby @ (self.is_called @ weights)
        total = np.sum(list(tells.values()), axis=0) + 0.05
        return {room: told / total for room, told in tells.items()}

    def neighbours(self, index: int, radius: float, count: int) -> list[int]:
        """Indices of at most ``count`` other instances within ``radius`` m (centre to centre), nearest first."""
        if self._tree is None:
            return []
        distances, found = self._tree.query(
            self.boxes.centre[index], k=min(count + 1, len(self)), distance_upper_bound=radius
        )
        pairs = zip(np.atleast_1d(distances), np.atleast_1d(found), strict=True)
        return [int(k) for d, k in pairs if np.isfinite(d) and k != index][:count]

    def similarity(self, queries: tuple[tuple[str, float], ...]) -> Array:
        """Best cosine less its cost over the queries, (N,)."""
        text = unit(self.space.vectors([query for query, _ in queries]) - self._common)
        costs = np.array([cost for _, cost in queries])
        return np.asarray((self.features @ text.T - costs).max(1), np.float64)


@dataclass
class Scores:
    """What every instance got, and for what.

    Parameters
    ----------
    fit : (N,)
        Text similarity alone.
    total : (N,)
    parts : dict
        Condition -> (N,) 0..1, for the trace.
    chance : float, optional
        Probability that the first is right, for a ranking that comes with one.
    named : bool
        False for "the blue thing", which has no name to be like.
    """

    fit: Array
    total: Array
    parts: dict[str, Array] = field(default_factory=dict)
    chance: float | None = None
    named: bool = True

    def apply(self, name: str, score: Array, weight: float = 1.0) -> None:
        """Take off what a condition that holds to ``score`` costs."""
        self.parts[name] = score
        self.total = self.total + TEMPERATURE * weight * np.log(np.maximum(score, FLOOR))

    def detail(self, index: int) -> dict[str, Any]:
        """One instance's parts, plain JSON."""
        return {name: round(float(score[index]), 3) for name, score in self.parts.items()}


def score(description: Description, view: MapView) -> Scores:
    """Scores of all instances for a description; larger fits better."""
    target = description.target
    if target is None and description.serves:
        scores = _score_need(description, view)
        for thing in description.avoid:
            scores.total *= 1 - _landmark_weights(thing, None, view, 0)
        return scores
    scores = _from_fit(view, np.zeros(len(view)), ()) if target is None else _score_thing(target, view)
    if target is not None and description.serves:
        marks = Relation("near", (Thing(phrase="need", queries=_as_queries(description.serves[:4])),))
        scores.apply("near what the need calls for", _relation(marks, None, view), 0.4)
    _apply_route(description, view, scores)
    for thing in description.avoid:
        scores.apply(f"not the {thing.phrase}", 1 - _landmark_weights(thing, None, view, 0))
    return scores


def _score_need(description: Description, view: MapView) -> Scores:
    """What each instance adds to the chance that one of those ranked so far answers the need."""
    serves = description.serves
    fit = view.similarity(_as_queries(serves))
    hits = RELIABLE * view.is_called[:, [view.column[kind] for kind, _ in serves]]
    hits[view.structure] *= STRUCTURE_SERVES
    if description.needs_room in view.rooms:
        hits *= np.maximum(view.rooms[description.needs_room], ELSEWHERE_SERVES)[:, None]
    probabilities = np.array([probability for _, probability in serves])
    first = hits @ probabilities
    return Scores(
        fit=fit, total=cover(probabilities, hits), parts={"serves": first}, chance=float(first.max(initial=0))
    )


def _as_queries(serves: tuple[tuple[str, float], ...]) -> tuple[tuple[str, float], ...]:
    """Kinds with what a lower probability costs in similarity."""
    return tuple((kind, KIND_COST * float(np.log(serves[0][1] / max(p, 1e-12)))) for kind, p in serves)


def _from_fit(view: MapView, fit: Array, queries: tuple[tuple[str, float], ...]) -> Scores:
    asked = {view.lexicon.name_of(text) for text, _ in queries} & STRUCTURE
    return Scores(fit=fit, total=fit if asked else fit - STRUCTURE_COST * view.structure)


def _score_thing(thing: Thing, view: MapView, depth: int = 0) -> Scores:
    if thing.queries:
        scores = _from_fit(view, view.similarity(thing.queries), thing.queries)
    elif thing.room and not (thing.colour or thing.relations):
        # "stop in the kitchen": the things that make it one, those in its middle first.
        telling = tuple((name, 0.2 * (1 - weight)) for name, weight in view.lexicon.rooms[thing.room].items())
        scores = _from_fit(view, view.similarity(telling), telling)
    else:
        scores = replace(_from_fit(view, np.full(len(view), 0.5), ()), named=False)
    if thing.colour:
        scores.apply(f"colour {thing.colour}", np.array([fits[thing.colour] for fits in view.colour_fits]))
    if thing.not_colour:
        scores.apply(f"not {thing.not_colour}", 1 - np.array([fits[thing.not_colour] for fits in view.colour_fits]))
    if thing.room in view.rooms:
        scores.apply(f"in the {thing.room}", view.rooms[thing.room])
    if thing.not_room in view.rooms:
        scores.apply(f"not in the {thing.not_room}", 1 - view.rooms[thing.not_room])
    if depth < 3:
        for relation in sorted(thing.relations, key=lambda r: r.name in ("closest", "farthest")):
            held = _relation(relation, thing, view, scores, depth)
            title = f"{'not ' if relation.negated else ''}{relation.name} {' and '.join(m.phrase for m in relation.landmarks)}"
            scores.apply(title, 1 - held if relation.negated else held)
    if thing.superlative and len(view):
        ranks = _ranks(-spatial.extent(thing.superlative, view.boxes), _competing(scores))
        scores.apply(thing.superlative, 0.5**ranks, 2.0 if thing.strict else 0.6)
    return scores


def _landmark_weights(thing: Thing, owner: Thing | None, view: MapView, depth: int) -> Array:
    """How surely every instance is the landmark, 1 for the best."""
    if owner is not None and owner.room and not thing.room:
        thing = replace(thing, room=owner.room)
    if not len(view):
        return np.zeros(0)
    total = _score_thing(thing, view, depth + 1).total
    return np.asarray(np.exp((total - total.max()) / TEMPERATURE))


def _relation(
    relation: Relation, owner: Thing | None, view: MapView, scores: Scores | None = None, depth: int = 0
) -> Array:
    """How well the relation holds for every instance, (N,) 0..1: over the likely landmarks, likelihood x geometry."""
    held = np.zeros(len(view))
    if not len(view):
        return held
    weights = [_landmark_weights(mark, owner, view, depth) for mark in relation.landmarks]
    likely = [np.flatnonzero(w > 0.1) for w in weights]
    if relation.name in ("closest", "farthest") and scores is not None:
        marks = np.flatnonzero(weights[0] > 0.5)
        distance = np.min([spatial.gaps(view.boxes, int(j)) for j in marks], axis=0)
        distance = distance + 0.01 * np.linalg.norm(view.boxes.centre - view.boxes.centre[marks[0]], axis=1)
        members = _competing(scores)
        members[marks] = False
        ranks = _ranks(distance if relation.name == "closest" else -distance, members)
        return np.asarray(0.4 ** np.abs(ranks - ((owner.ordinal if owner and owner.ordinal else 1) - 1)))
    if relation.name == "between" and len(weights) > 1:
        for j in likely[0]:
            for k in likely[1]:
                if j != k:
                    line = spatial.between(view.boxes, int(j), int(k))
                    line[[j, k]] = 0
                    held = np.maximum(held, weights[0][j] * weights[1][k] * line)
        return held
    for weight, marks in zip(weights, likely, strict=True):
        for j in marks:
            held = np.maximum(held, weight[j] * spatial.relation_scores(relation.name, view.boxes, int(j)))
    return held


def _competing(scores: Scores) -> npt.NDArray[np.bool_]:
    return np.asarray(scores.total >= scores.total.max() - COMPETE)


def _ranks(values: Array, members: npt.NDArray[np.bool_]) -> Array:
    """Place (N,) of every member in ascending order of value, 0 first; those who do not compete come last."""
    ranks = np.full(len(values), float(members.sum()))
    order = np.flatnonzero(members)[np.argsort(values[members], kind="stable")]
    ranks[order] = np.arange(len(order))
    return ranks


def _apply_route(description: Description, view: MapView, scores: Scores) -> None:
    """A walk's legs say softly where its end is: near what it came by last, not in the room that it left."""
    target = description.target
    for leg in description.route:
        if leg.motion == "leave" and leg.room in view.rooms and (target is None or leg.room != target.room):
            scores.apply(f"left the {leg.room}", 1 - view.rooms[leg.room], 0.5)
    passed = [leg.thing for leg in description.route if leg.thing is not None and leg.motion != "leave"]
    if passed:
        marks = Relation("facing", (replace(passed[-1], relations=()),))
        scores.apply(f"after {passed[-1].phrase}", _relation(marks, None, view), 0.15)
