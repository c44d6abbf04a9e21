"""Generated instructions mean exactly their targets, in words and by the scene."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from openmap_env.episodes import KINDS, generate_episodes
from openmap_env.episodes.expressions import Expression, Relation
from openmap_env.episodes.generator import rooms_along
from openmap_env.episodes.vocabulary import load_data, needs, vocabulary
from openmap_env.goals import way_to
from openmap_env.navigation import NavigableSurface
from openmap_scenes import DataError, load_scene


@pytest.fixture(scope="module")
def house(shared_scenes):
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    scene = load_scene(spec)
    surface = NavigableSurface.from_scene(scene)
    return scene, surface, generate_episodes(scene, spec, surface, 30, np.random.default_rng(3))


@pytest.fixture(scope="module")
def toy(toy_scene, toy_surface):
    return toy_scene, toy_surface, generate_episodes(toy_scene, "toy:0", toy_surface, 60, np.random.default_rng(0))


@pytest.fixture(params=["toy", "house"])
def made(request):
    return request.getfixturevalue(request.param)


def means(scene, phrase: dict) -> set[int]:
    """What a phrase means, written once more without the generator's code: names by the table alone, rooms by their boxes."""
    table = load_data("kinds.json")["kinds"]

    def kind(word):
        for first in range(len(word.split())):
            ending = " ".join(word.lower().split()[first:])
            for name, entry in table.items():
                if ending in [w.lower() for w in entry["say"] + entry.get("also", [])]:
                    return name
        return word

    def kinds(name):
        return {name}.union(*(kinds(parent) for parent in table.get(name, {}).get("is_a", [])))

    def gap(a, b):
        d = [max(0.0, a.aabb_min[i] - b.aabb_max[i], b.aabb_min[i] - a.aabb_max[i]) for i in (0, 2)]
        return (d[0] ** 2 + d[1] ** 2) ** 0.5

    def holds(i, other, name):
        rise = i.aabb_min[1] - other.aabb_max[1]
        over = all(other.aabb_min[k] <= i.centre[k] <= other.aabb_max[k] for k in (0, 2))
        on, under = over and -0.05 <= rise <= 0.1, over and -0.05 <= other.aabb_min[1] - i.aabb_max[1] <= 0.1
        same_level = rise <= 0.3 and other.aabb_min[1] - i.aabb_max[1] <= 0.3
        if name == "on":
            return on
        same_room = i.room == other.room
        if name == "above":
            return same_room and 0.0 <= rise <= 1.5 and gap(i, other) <= 0.15 and not on
        return same_room and same_level and gap(i, other) <= 0.5 and not on and not under

    said = {r.id: vocabulary().room(r.name) for r in scene.rooms}
    found = set()
    for i in scene.instances:
        if i.category in ("wall", "floor", "ceiling", "unannotated", "unknown") or kind(phrase["noun"]) not in kinds(
            kind(i.category)
        ):
            continue
        relation = phrase.get("relation")
        near = [
            o
            for o in scene.instances
            if relation and o.id != i.id and kind(relation["noun"]) in kinds(kind(o.category))
        ]
        if (
            all(i.attributes.get(k) == phrase[k] for k in ("colour", "material") if k in phrase)
            and ("room" not in phrase or said.get(i.room) == phrase["room"])
            and (relation is None or any(holds(i, o, relation["name"]) for o in near))
        ):
            found.add(i.id)
    return found


def test_every_kind_is_made_and_no_instruction_twice(made):
    _, _, episodes = made
    assert set(Counter(e.kind for e in episodes)) == set(KINDS)
    assert len({e.instruction for e in episodes}) == len({e.episode_id for e in episodes}) == len(episodes) >= 30


def test_a_phrase_means_exactly_the_targets(made):
    scene, _, episodes = made
    phrases = [e for e in episodes if "expression" in e.info]
    for episode in phrases:
        assert means(scene, episode.info["expression"]) == {t.instance_id for t in episode.targets}, episode.instruction
    assert any("relation" in e.info["expression"] for e in phrases)
    assert any("room" in e.info["expression"] for e in phrases)


def test_what_the_phrase_says_is_in_the_instruction(made):
    _, _, episodes = made
    for episode in (e for e in episodes if "expression" in e.info):
        phrase = episode.info["expression"]
        assert phrase["noun"] in episode.instruction
        for key in ("colour", "room"):
            assert phrase.get(key, "") in episode.instruction
        if "relation" in phrase:
            assert f"{phrase['relation']['name']} " in episode.instruction
            assert phrase["relation"]["noun"] in episode.instruction
        if episode.kind == "object_goal":
            article = re.search(rf"\b(the|a|an|some) (?:\w+ )*?{re.escape(phrase['noun'])}", episode.instruction)
            assert article is not None
            assert (article[1] == "the") == (len(episode.targets) == 1), episode.instruction


def test_a_demand_lists_everything_that_serves_it(made):
    scene, _, episodes = made
    demands = [e for e in episodes if e.kind == "demand"]
    table = load_data("needs.json")
    for episode in demands:
        need = table[episode.info["need"]]
        assert episode.info["sentence"] in need["sentences"]
        assert episode.info["sentence"][1:] in episode.instruction
        by_name = set()
        for noun in need["served_by"]:
            by_name |= means(scene, {"noun": noun})
        assert by_name == {t.instance_id for t in episode.targets}, episode.instruction


def test_targets_are_instances_with_their_boxes_and_never_structure(made):
    scene, _, episodes = made
    for episode in episodes:
        assert episode.targets
        for target in episode.targets:
            instance = scene.instance(target.instance_id)
            assert target.aabb_min == tuple(instance.aabb_min)
            assert target.aabb_max == tuple(instance.aabb_max)
            assert target.centre == tuple(instance.centre)
            assert instance.category not in ("wall", "floor", "ceiling")


def test_starts_are_navigable_and_lead_to_a_target(made):
    scene, surface, episodes = made
    for episode in episodes:
        assert surface.island_of(episode.start_position) == 0
        distance = way_to(surface, scene, episode.targets, island=0).distance(episode.start_position)
        assert distance == pytest.approx(episode.info["geodesic_distance"])
        assert 0.0 < distance < 100.0


def test_a_guided_way_is_the_shortest_and_leads_through_the_rooms_it_names(made):
    scene, surface, episodes = made
    guided = [e for e in episodes if e.kind == "language_guided"]
    for episode in guided:
        rooms = episode.info["rooms"]
        start_room = scene.room_of(np.add(episode.start_position, (0.0, 0.3, 0.0)))
        path = way_to(surface, scene, episode.targets, island=0).path(episode.start_position)
        spaced = np.concatenate(
            [np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / 0.1))) for a, b in pairwise(path)]
        )
        crossed = rooms_along(scene, spaced)
        assert [r for r in crossed if r in rooms] == rooms
        assert vocabulary().room(start_room.name) == rooms[0]
        ends = {
            vocabulary().room(next(r.name for r in scene.rooms if r.id == scene.instance(t.instance_id).room))
            for t in episode.targets
        }
        assert ends == {rooms[-1]}, "a thing of that name elsewhere would answer the name, not the way"
        if len(rooms) > 1:
            assert f"the {rooms[0]}" in episode.instruction
    assert any(len(e.info["rooms"]) > 1 for e in guided)


def test_a_guided_way_never_ends_where_its_words_could_mean_another_room(toy_scene, toy_surface):
    # Nothing but chairs: two in each of two rooms, and "a chair" is one of the phrases.
    chairs = {1, 3, 9, 11}
    scene = replace(
        toy_scene,
        instances=[
            replace(i, category="chair" if i.id in chairs else "wall", attributes={}) for i in toy_scene.instances
        ],
    )
    made = generate_episodes(scene, "toy:0", toy_surface, 12, np.random.default_rng(7), kinds=("language_guided",))
    assert len(made) >= 5
    for episode in made:
        rooms = {scene.instance(t.instance_id).room for t in episode.targets}
        assert len(rooms) == 1, episode.instruction


def test_the_same_seed_makes_the_same_episodes_and_another_makes_others(toy_scene, toy_surface):
    def run(seed):
        return generate_episodes(toy_scene, "toy:0", toy_surface, 9, np.random.default_rng(seed))

    assert run(0) == run(0)
    assert run(0) != run(1)


def test_info_is_plain_json(made):
    for episode in made[2]:
        assert json.loads(json.dumps(episode.info, allow_nan=False)) == episode.info


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
    wooden = Expression("dining table", material="wood", room="kitchen")
    assert wooden.say(toy_scene) == "the wooden dining table in the kitchen"


def test_expressions_survive_json():
    for expression in (Expression("bed"), Expression("vase", colour="blue", relation=Relation("on", "table"))):
        assert Expression.from_json(json.loads(json.dumps(expression.to_json()))) == expression


def test_chosen_kinds_only(toy_scene, toy_surface):
    made = generate_episodes(toy_scene, "toy:0", toy_surface, 5, np.random.default_rng(1), kinds=("demand",))
    assert {e.kind for e in made} == {"demand"}
    with pytest.raises(ValueError, match="haiku"):
        generate_episodes(toy_scene, "toy:0", toy_surface, 5, np.random.default_rng(1), kinds=("haiku",))


def test_a_scene_without_semantics_is_refused_by_name(toy_scene, toy_surface):
    bare = replace(toy_scene, instances=[], face_instance=np.zeros_like(toy_scene.face_instance))
    with pytest.raises(DataError, match="toy:bare"):
        generate_episodes(bare, "toy:bare", toy_surface, 3, np.random.default_rng(0))


def test_the_tables_hang_together():
    table, patterns = load_data("kinds.json")["kinds"], load_data("patterns.json")
    words = [w for entry in table.values() for w in {w.lower() for w in entry["say"] + entry.get("also", [])}]
    assert len(words) == len(set(words)), "a word with two kinds"
    assert {p for entry in table.values() for p in entry.get("is_a", [])} <= set(table)
    assert {k for need in needs() for k in need.served_by} <= set(table)
    served = [k for k in table if any(need.serves(k) for need in needs())]
    assert len(served) >= 60
    assert all(len(need.sentences) >= 4 for need in needs())
    sentences = [s for need in needs() for s in need.sentences]
    assert len(sentences) == len(set(sentences))
    assert len(patterns["object_goal"]) >= 12
    assert len(patterns["demand"]) >= 12
    assert sum(map(len, patterns["language_guided"].values())) >= 12


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


def test_without_rooms_ways_lead_past_things_at_hand(toy_scene, toy_surface):
    bare = replace(toy_scene, rooms=[], instances=[replace(i, room=None) for i in toy_scene.instances])
    ways = generate_episodes(bare, "toy:bare", toy_surface, 12, np.random.default_rng(0), kinds=("language_guided",))
    assert len(ways) >= 4
    for episode in ways:
        assert episode.info["rooms"] == []
        assert not re.search(r" in (the|a|an) ", episode.instruction)
        passed = re.search(r"(?:past|by|Pass) (?:the|some) (.+?)(?:,| and) ", episode.instruction)
        assert passed is not None, episode.instruction
        (landmark,) = Expression(passed[1]).matches(bare)
        assert landmark.id not in {t.instance_id for t in episode.targets}


def test_too_few_episodes_are_told_by_kind(toy_scene, toy_surface, caplog):
    one = next(i for i in toy_scene.instances if i.category == "bed")
    ids = np.where(toy_scene.face_instance == one.id, one.id, 0).astype(np.int32)
    lone = replace(toy_scene, instances=[replace(one, room=None)], face_instance=ids, rooms=[])
    with caplog.at_level("WARNING"):
        made = generate_episodes(lone, "toy:lone", toy_surface, 6, np.random.default_rng(0))
    assert len(made) < 6
    assert "0 language_guided" in caplog.text
