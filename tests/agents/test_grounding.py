"""The grounder on small maps with a tiny encoder: rankings, empty maps, geometry, parses, and what happens to bad input."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.grounding import Grounder, GroundingSettings, Interpreter, spatial
from openmap_agents.grounding.colours import colour_word
from openmap_agents.grounding.lexicon import load_lexicon
from openmap_agents.mapping.instance_map import InstanceMap, MapInstance


class WordsAsVectors:
    """Each word is a fixed random direction; a text is the sum of its words. Deterministic in every process."""

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        vectors = np.zeros((len(texts), 512), np.float32)
        for row, text in enumerate(texts):
            for word in re.findall(r"[a-z]+", text.lower()):
                vectors[row] += np.random.default_rng(zlib.crc32(word.encode())).normal(size=512).astype(np.float32)
        return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9), np.float32)


WORDS = re.findall(
    r"\S+", "the chair window table not between and from second leave stop at go it near red kitchen in my is want , ."
)
ENCODER = WordsAsVectors()
CORNERS = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5]), -1).reshape(-1, 3)


def instance(
    number: int, name: str, centre: tuple[float, float, float], size: tuple[float, float, float] = (0.5, 0.5, 0.5)
) -> MapInstance:
    points = (np.array(centre) + CORNERS * size).astype(np.float32)
    return MapInstance(id=number, points=points, feature=ENCODER.encode_text([name])[0])


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder of the tests' own."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


@pytest.fixture(scope="module")
def grounder() -> Grounder:
    return Grounder(encoder=ENCODER)


@pytest.fixture(scope="module")
def room() -> InstanceMap:
    return InstanceMap(
        [
            instance(2, "chair", (0, 0.4, 0)),
            instance(3, "chair", (3, 0.4, 0)),
            instance(5, "chair", (6, 0.4, 0)),
            instance(7, "window", (7, 1.5, 0), (0.1, 1.0, 1.0)),
            instance(11, "floor", (3, 0, 0), (8, 0.02, 8)),
            instance(13, "table", (0, 0.4, 2), (1.0, 0.8, 1.0)),
            instance(17, "book", (0, 0.85, 2), (0.2, 0.1, 0.2)),
            instance(19, "book", (0, 0.05, 2), (0.2, 0.1, 0.2)),
            MapInstance(id=23, points=CORNERS.astype(np.float32), feature=None),
        ]
    )


@pytest.mark.parametrize(
    ("instruction", "expected"),
    [
        ("the chair next to the table", 2),
        ("the chair closest to the window", 5),
        ("the second chair from the window", 3),
        ("the third chair from the window", 2),
        ("the chair farthest from the window", 2),
        ("the chair that is not near the window and not near the table", 3),
        ("the book on the table", 17),
        ("the book under the table", 19),
        ("find the floor", 11),
        ("a cheir by the window", 5),
    ],
)
def test_relations_choose_among_equals(instruction: str, expected: int, grounder: Grounder, room: InstanceMap) -> None:
    assert grounder.ground(instruction, room).choice == expected


@settings(max_examples=60, deadline=None)
@given(
    instruction=st.one_of(
        st.text(max_size=60),
        st.lists(
            st.sampled_from(WORDS),
            max_size=14,
        ).map(" ".join),
    )
)
def test_any_text_ranks_every_instance_once(instruction: str, grounder: Grounder, room: InstanceMap) -> None:
    grounding = grounder.ground(instruction, room)
    assert sorted(grounding.ranking) == [i.id for i in room.instances]
    assert len(grounding.scores) == len(room)
    assert np.isfinite(grounding.scores).all()
    assert 0 <= grounding.confidence <= 1
    assert grounding.choice in (None, grounding.ranking[0])
    json.dumps(grounding.trace, allow_nan=False)


def test_scores_fall_along_the_ranking(grounder: Grounder, room: InstanceMap) -> None:
    scores = grounder.ground("the chair next to the table", room).scores
    assert scores == sorted(scores, reverse=True)


def test_an_empty_map_has_no_choice(grounder: Grounder) -> None:
    for instruction in (
        "find the blue chair next to the sofa",
        "I am thirsty",
        "leave the bedroom and stop at the sink",
    ):
        grounding = grounder.ground(instruction, InstanceMap([]))
        assert (grounding.ranking, grounding.choice, grounding.confidence) == ([], None, 0.0)


@pytest.mark.parametrize("feature", [None, np.full(512, np.nan, np.float32)])
def test_nothing_is_sure_of_an_instance_without_a_feature(grounder: Grounder, feature: npt.NDArray[np.float32]) -> None:
    alone = InstanceMap([MapInstance(1, CORNERS.astype(np.float32), feature)])
    for instruction in ("find the chair", "I am thirsty", "", "anything but the chair, I want to sit"):
        assert grounder.ground(instruction, alone).choice is None


def test_what_is_ruled_out_of_an_empty_map(grounder: Grounder) -> None:
    assert grounder.ground("anything but the chair, I want to sit", InstanceMap([])).ranking == []


def test_what_is_not_there_is_not_chosen(grounder: Grounder, room: InstanceMap) -> None:
    grounding = grounder.ground("find the zeppelin", room)
    assert grounding.choice is None
    assert grounding.confidence < 0.1
    assert len(grounding.ranking) == len(room)


def test_structure_ranks_last_unless_asked_for(grounder: Grounder, room: InstanceMap) -> None:
    ranking = grounder.ground("the book", room).ranking
    assert ranking.index(11) >= len(room) - 2
    assert grounder.ground("the floor", room).ranking[0] == 11


def test_the_same_question_gets_the_same_answer(room: InstanceMap) -> None:
    first, second = (Grounder(encoder=ENCODER).ground("the chair by the window", room) for _ in range(2))
    assert (first.ranking, first.scores) == (second.ranking, second.scores)


def test_without_select_only_words_rank(room: InstanceMap) -> None:
    grounder = Grounder(encoder=ENCODER, settings=GroundingSettings(select=False))
    assert grounder.ground("the chair next to the window", room).ranking[:3] == [2, 3, 5]


def test_features_of_another_encoder_are_refused(grounder: Grounder) -> None:
    odd = MapInstance(id=1, points=CORNERS.astype(np.float32), feature=np.ones(7, np.float32))
    with pytest.raises(ValueError, match="instance 1 has a feature of shape"):
        grounder.ground("the chair", InstanceMap([odd]))


@pytest.mark.parametrize(
    ("instruction", "kind", "phrase"),
    [
        ("Could you please find the blue armchair?", "object_goal", "armchair"),
        ("leave the bedroom and stop at the sink", "language_guided", "sink"),
        ("When you can see the dining table, go up to it and stop.", "language_guided", "dining table"),
        ("Walk past the sofa, then turn left and wait by the potted plant", "language_guided", "potted plant"),
        ("I am thirsty", "demand", None),
        ("get the chair ready, I want to eat", "demand", "chair"),
        ("find something to sit on", "demand", None),
        ("I am tired. Where should I go?", "demand", None),
        ("We have nothing to eat, which piece of furniture is right for that?", "demand", None),
        ("is there a quiet corner where two of us could talk", "demand", None),
        ("Could you tell me where I can rinse this?", "demand", None),
        ("I fancy a slice of bread", "demand", None),
        ("the trash can that is not in the kitchen", "object_goal", "trash can"),
        ("Go to something I can use to heat soup and stop next to it.", "language_guided", None),
        ("where is the samovar", "object_goal", "samovar"),
        ("", "demand", None),
    ],
)
def test_parse(instruction: str, kind: str, phrase: str | None) -> None:
    description = Interpreter().parse(instruction)
    assert description.kind == kind
    assert (description.target.phrase if description.target else None) == phrase


def test_what_frames_a_need_is_left_out_of_it() -> None:
    interpreter = Interpreter()
    assert interpreter.parse("I am tired. Please take me to something suitable.").needs == ("i am tired",)
    description = interpreter.parse("I'm cold, is there anything in the living room that could help?")
    assert (description.needs, description.needs_room) == (("i'm cold",), "living room")


def test_a_noun_phrase_is_taken_apart() -> None:
    target = Interpreter().parse("find the second large red chair from the window that is not in the kitchen").target
    assert target is not None
    assert (target.ordinal, target.superlative, target.strict, target.colour) == (2, "largest", False, "red")
    assert target.not_room == "kitchen"
    assert [(r.name, [mark.phrase for mark in r.landmarks]) for r in target.relations] == [("closest", ["window"])]


def test_on_and_under_are_told_apart_by_height(room: InstanceMap) -> None:
    boxes = spatial.boxes_of(room)
    table, above, below = 5, 6, 7
    assert spatial.relation_scores("on", boxes, table)[above] > 0.9
    assert spatial.relation_scores("on", boxes, table)[below] == 0
    assert spatial.relation_scores("under", boxes, table)[below] > 0.9
    assert spatial.relation_scores("under", boxes, table)[above] == 0


def test_between_prefers_the_line_and_ends_with_it() -> None:
    places = [(0, 0, 0), (4, 0, 0), (2, 0, 0), (2, 0, 1.5), (7, 0, 0)]
    boxes = spatial.boxes_of(InstanceMap([instance(k + 1, "x", place) for k, place in enumerate(places)]))
    on_line, beside, beyond = spatial.between(boxes, 0, 1)[2:]
    assert on_line > beside > 0
    assert beyond == 0


def test_colour_words() -> None:
    seen = {
        (30, 60, 160): "blue",
        (200, 30, 40): "red",
        (240, 240, 238): "white",
        (25, 25, 28): "black",
        (110, 70, 45): "brown",
    }
    assert {rgb: colour_word(np.array(rgb, np.uint8)) for rgb in seen} == seen
    assert colour_word(None) is None


def test_the_data_files_agree_with_each_other() -> None:
    lexicon = load_lexicon()
    unknown = {name for things in lexicon.rooms.values() for name in things} - set(lexicon.names)
    assert not unknown
    assert {kind for kind in lexicon.affordances if lexicon.name_of(kind) is None} == set()
    assert len(lexicon.names) >= 300
    assert len(lexicon.affordances) >= 120
