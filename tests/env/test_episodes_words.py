"""The words of instructions: kinds and their names, looks, relations, needs and patterns, and that their tables hang together."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib.resources import files
from string import Formatter

import numpy as np
import pytest

from openmap_env.episodes.attributes import looks
from openmap_env.episodes.demands import Entry, Need, demands, needs
from openmap_env.episodes.expressions import Expression, is_clear, with_article
from openmap_env.episodes.relations import Relation
from openmap_env.episodes.routes import Bend, Landmark, Stretch, Wording, bend_at
from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_scenes import Instance

TABLE = load_data("kinds.json")["kinds"]
PATTERNS = load_data("patterns.json")


def test_attributes_single_out_what_the_name_does_not(toy_scene):
    assert len(Expression("armchair").matches(toy_scene)) == 2
    blue = Expression("armchair", colour="blue")
    assert [i.attributes["colour"] for i in blue.matches(toy_scene)] == ["blue"]
    assert blue.say(toy_scene) == "the blue armchair"
    assert Expression("armchair").say(toy_scene) == "an armchair"
    assert Expression("couch").say(toy_scene) == "the couch", "a corner sofa is one"
    assert len(Expression("chair").matches(toy_scene)) == 3, "armchairs are chairs"
    assert Expression("vase", relation=Relation("on", "table")).say(toy_scene) == "the vase on the table"
    assert Expression("picture", relation=Relation("above", "sofa")).matches(toy_scene)
    assert not Expression("vase", relation=Relation("next to", "table")).matches(toy_scene), "it stands on it"
    assert not Expression("table", relation=Relation("next to", "vase")).matches(toy_scene)
    assert not Expression("wall").matches(toy_scene)
    wooden = Expression("dining table", material="wooden", room="kitchen")
    assert wooden.say(toy_scene) == "the wooden dining table in the kitchen"


def test_expressions_survive_json():
    for expression in (Expression("bed"), Expression("vase", colour="blue", relation=Relation("on", "table"))):
        assert Expression.from_json(json.loads(json.dumps(expression.to_json()))) == expression


def test_an_article_goes_by_the_first_sound():
    said = {word: with_article(word, word, unique=False) for word in ("umbrella", "utensil holder", "oven", "urinal")}
    assert [phrase.split()[0] for phrase in said.values()] == ["an", "a", "an", "a"]
    assert with_article("scissors", "scissors", unique=False) == "some scissors"
    assert with_article("blue bread", "bread", unique=False) == "some blue bread"
    assert with_article("staircase", "staircase", unique=False) == "a staircase"


def test_nothing_is_said_on_which_people_would_disagree(toy_scene):
    assert is_clear(toy_scene, Expression("armchair", colour="blue"))
    turquoise = {i.id: {**i.attributes, "colour": "turquoise"} for i in toy_scene.instances if i.category == "armchair"}
    red, _ = sorted(turquoise, key=lambda n: toy_scene.instance(n).attributes["colour"], reverse=True)
    scene = _with_attributes(toy_scene, {red: turquoise[red]})
    assert not is_clear(scene, Expression("armchair", colour="blue")), "the other one is turquoise"
    scene = _with_attributes(toy_scene, {red: {}})
    assert not is_clear(scene, Expression("armchair", colour="blue")), "the other one's colour is not known"
    assert not is_clear(toy_scene, Expression("armchair", most="largest")), "they are of a size"
    assert not is_clear(toy_scene, Expression("bed", most="largest")), "there is one"


def _with_attributes(scene, attributes):
    instances = [replace(i, attributes=attributes.get(i.id, i.attributes)) for i in scene.instances]
    return replace(scene, instances=instances)


def test_the_largest_is_the_largest_by_far(toy_scene):
    chairs = Expression("chair").matches(toy_scene)
    assert len(chairs) == 3
    assert Expression("table", most="tallest").matches(toy_scene) == Expression("table").matches(toy_scene)


def test_a_need_is_not_asked_where_something_serves_it_only_perhaps(toy_scene):
    mine = Need("sit", ("I want to sit",), (Entry.read("chair"),), (Entry.read("armchair"),))
    chair, armchair = (next(i for i in toy_scene.instances if i.category == c) for c in ("chair", "armchair"))
    assert mine.serves(toy_scene, armchair)
    assert mine.divides(toy_scene, armchair)
    assert not mine.divides(toy_scene, chair)
    finer = Need("sit", ("I want to sit",), (Entry.read("armchair:blue"), Entry.read("chair")), (Entry.read("chair"),))
    blue = next(i for i in toy_scene.instances if i.attributes.get("colour") == "blue" and i.category == "armchair")
    assert not finer.divides(toy_scene, blue)
    assert finer.divides(toy_scene, chair)
    named = {d.need.name for options in demands(toy_scene, toy_scene.instances, 6) for d in options}
    assert "sleep" in named
    assert "use toilet" not in named


def test_the_tables_of_names_hang_together():
    words = [w for entry in TABLE.values() for w in {w.lower() for w in entry["say"] + entry.get("also", [])}]
    assert len(words) == len(set(words)), "a word with two kinds"
    assert {p for entry in TABLE.values() for p in entry.get("is_a", [])} <= set(TABLE)
    for kind, entry in TABLE.items():
        assert vocabulary().kind(kind) == kind, kind
        assert set(entry) <= {"say", "also", "is_a", "called", "number"}, kind
        for name in entry.get("called", []):
            assert vocabulary().kind(name) in vocabulary().lineage(kind), f"{kind} is no {name}"
    listed = load_data("attributes.json")
    kinds = {
        k for key, v in listed.items() if isinstance(v, list) and key not in ("alike", "unclear_materials") for k in v
    }
    kinds |= {k for v in listed["material_said_of"].values() for k in v}
    kinds |= {k for entry in listed["looks"].values() for k in entry["of"]}
    assert kinds <= set(TABLE)
    assert set(listed["material_said_of"]) <= set(listed["materials"])
    assert set(load_data("purposes.json")) <= set(TABLE)


def test_needs_name_kinds_that_there_are_and_many_kinds_have_one():
    table = load_data("needs.json")["needs"]
    kinds = set()
    for name, entry in table.items():
        for line in entry["served_by"] + entry.get("unsure", []) + entry.get("not", []):
            assert Entry.read(line).kind in TABLE, (name, line)
        kinds |= {Entry.read(line).kind for line in entry["served_by"]}
        assert len(entry["sentences"]) >= 2, name
        assert all(s[0].isupper() and s[-1] not in ".?! " for s in entry["sentences"]), name
        assert all({f for _, f, _, _ in Formatter().parse(s) if f} <= {"room"} for s in entry["sentences"]), name
    assert len(kinds) >= 80
    sentences = [s for entry in table.values() for s in entry["sentences"]]
    assert len(sentences) == len(set(sentences))
    assert len(needs()) == len(table)


def test_all_kinds_of_the_built_in_homes_have_a_name_that_can_be_said():
    lines = files("openmap_scenes.homes").joinpath("kinds.tsv").read_text("utf-8").splitlines()
    kinds = sorted({line.split("\t")[0] for line in lines if line and not line.startswith("#")})
    assert len(kinds) > 200
    words = vocabulary()
    for category in kinds:
        assert words.kind(category) in TABLE, category
        assert not words.is_structure(category), category
        for name in words.sayable(category):
            assert re.fullmatch(r"[A-Za-z][A-Za-z' -]+", name), (category, name)


FIELDS = {
    "leave": {"room"},
    "leave_door": {"room"},
    "turn": {"side", "room"},
    "straight": {"room"},
    "enter": {"room"},
    "cross": {"room"},
    "pass": {"landmark"},
    "pass_side": {"landmark", "side"},
    "end": {"ref"},
    "end_standing": {"ref"},
    "end_under": {"ref"},
}


def fields(pattern):
    return {name for _, name, _, _ in Formatter().parse(pattern) if name}


def test_there_are_a_dozen_patterns_a_kind_and_all_can_be_filled_in():
    for group in PATTERNS["object_goal"].values():
        assert len(group) == len(set(group)) >= 12
        assert all(fields(p) <= {"ref", "is"} and "ref" in fields(p) and p[-1] in ".?" for p in group)
    assert len(PATTERNS["demand"]) >= 12
    assert all(len(fields(p)) == 1 and fields(p) <= {"need", "need_inside"} for p in PATTERNS["demand"])
    assert set(PATTERNS["language_guided"]) == set(FIELDS)
    for name, group in PATTERNS["language_guided"].items():
        assert len(group) == len(set(group)) >= 2
        assert all(fields(p) == FIELDS[name] for p in group), name
    assert all(fields(p) == {"ref"} for group in load_data("purposes.json").values() for p in group)


def test_every_clause_is_said_some_time():
    rng = np.random.default_rng(0)
    wording = Wording(PATTERNS["language_guided"], rng)
    bends: tuple[Bend | None, ...] = (None, "left", "straight", "right")
    marks = [Landmark("sofa", 10, None), Landmark("desk", 12, "left")]
    said = set()
    for number in range(2500):
        way = [
            Stretch(room, 0, 20, bends[(number + k) % 4] if k else None, (marks[number % 2],), door=number % 2 == 0)
            for k, room in enumerate(("kitchen", "hall", "office")[: 1 + number % 3])
        ]
        told = wording.tell(way, lambda room_said: "the globe", ("end", "end_standing", "end_under")[number % 3])
        assert told is not None
        text, info = told
        assert re.fullmatch(r"[A-Z][a-z', ]+\.( [A-Z][a-z', ]+\.)?", text), text
        said |= set(info["pattern"])
    assert said == {p for group in PATTERNS["language_guided"].values() for p in group}


@pytest.mark.parametrize(
    ("corner", "bend"),
    [
        ((-2.0, 0.0, -2.0), "left"),
        ((2.0, 0.0, -2.0), "right"),
        ((0.0, 0.0, -4.0), "straight"),
        ((-0.8, 0.0, -4.0), None),
    ],
)
def test_a_path_along_minus_z_turns_left_towards_minus_x(corner, bend):
    first = np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, -2.0), 21)
    path = np.concatenate([first, np.linspace(first[-1], corner, 21)[1:]])
    assert bend_at(path, 20) == bend


def test_looks_are_told_by_attributes():
    def thing(category, **attributes):
        return Instance(1, category, np.zeros(3), np.zeros(3), np.ones(3), attributes=attributes)

    words = looks()
    assert words.colour_said(thing("sofa", colour="red")) == "red"
    assert words.colour_said(thing("cactus", colour="red")) is None, "the pot is red"
    assert words.material_said(thing("dining chair", material="oak")) == "wooden"
    assert words.material_said(thing("towel", material="cotton")) is None
    assert words.looks_said(thing("rug", shape="round", pattern="striped")) == ["round", "striped"]
    assert not words.colour_clear(thing("vase", colour="white", material="glass"), "blue")


@pytest.mark.parametrize(
    ("category", "kind"),
    [
        ("Rattan Sofa", "sofa"),
        ("kitchen cabinet", "kitchen cabinet"),
        ("guitar case", "guitar case"),
        ("chest_of_drawers", "chest of drawers"),
        ("spice rack", "spice rack"),
        ("quux", "quux"),
    ],
)
def test_category_words_find_their_kind(category, kind):
    assert vocabulary().kind(category) == kind


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("region 5", None),
        ("Region_12", None),
        ("7", None),
        ("bedroom 2", "bedroom"),
        ("familyroom/lounge", "family room"),
    ],
)
def test_nobody_says_the_number_of_a_room(name, said):
    assert vocabulary().room(name) == said


@pytest.mark.parametrize(
    "category", ["wall /otherroom", "bath wall", "support beam", "unknown object", "undefined", "handrail"]
)
def test_what_belongs_to_the_building_or_has_no_name_is_not_asked_for(category):
    assert vocabulary().is_structure(category)


@pytest.mark.parametrize(
    "category", ["wall cabinet", "rug", "floor lamp", "unknown picture", "partition", "column radiator", "quux"]
)
def test_what_people_name_is_asked_for(category):
    assert not vocabulary().is_structure(category)
