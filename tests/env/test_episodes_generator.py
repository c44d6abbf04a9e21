"""Generated instructions mean exactly their targets, in words and by the scene."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from openmap_env.episodes import KINDS, generate_episodes
from openmap_env.episodes.routes import rooms_along
from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_env.goals import way_to
from openmap_env.navigation import NavigableSurface
from openmap_scenes import DataError, load_scene


@pytest.fixture(scope="module")
def house(shared_scenes):
    spec = f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}"
    scene = load_scene(spec)
    surface = NavigableSurface.from_scene(scene)
    return scene, surface, generate_episodes(scene, spec, surface, 18, np.random.default_rng(3))


@pytest.fixture(scope="module")
def toy(toy_scene, toy_surface):
    return toy_scene, toy_surface, generate_episodes(toy_scene, "toy:0", toy_surface, 60, np.random.default_rng(0))


@pytest.fixture(scope="module")
def home():
    """A generated home, with attributes and hundreds of things."""
    scene = load_scene("homes:val/8")
    surface = NavigableSurface.from_scene(scene)
    return scene, surface, generate_episodes(scene, "homes:val/8", surface, 45, np.random.default_rng(5))


@pytest.fixture(params=["toy", "house", "home"])
def made(request):
    return request.getfixturevalue(request.param)


TABLE = load_data("kinds.json")["kinds"]
ATTRIBUTES = load_data("attributes.json")
WORDS = {w.lower(): kind for kind, entry in TABLE.items() for w in entry["say"] + entry.get("also", [])}


def kind_of(word):
    """The kind of a word by the table alone."""
    for first in range(len(word.split())):
        ending = " ".join(word.lower().split()[first:])
        if ending in WORDS:
            return WORDS[ending]
        if ending in load_data("kinds.json")["head_noun_exceptions"]:
            return word
    return word


def kinds_of(name):
    return {name}.union(*(kinds_of(parent) for parent in TABLE.get(name, {}).get("is_a", [])))


def room_of(scene, i):
    return next((vocabulary().room(r.name) for r in scene.rooms if r.id == i.room), None)


def gap(a, b):
    d = [max(0.0, a.aabb_min[i] - b.aabb_max[i], b.aabb_min[i] - a.aabb_max[i]) for i in (0, 2)]
    return math.hypot(*d)


def middle_over(a, b):
    return all(b.aabb_min[k] <= a.centre[k] <= b.aabb_max[k] for k in (0, 2))


def rests_on(a, b):
    inside = any(k in kinds_of(kind_of(b.category)) for k in ATTRIBUTES["things_lie_inside"])
    rise = a.aabb_min[1] - b.aabb_max[1]
    in_it = inside and b.aabb_min[1] + 0.1 < a.aabb_min[1] <= b.aabb_max[1]
    return middle_over(a, b) and (-0.05 <= rise <= 0.1 or in_it)


def related(i, other, name):
    rise = i.aabb_min[1] - other.aabb_max[1]
    if name == "on":
        return rests_on(i, other)
    if name == "under":
        lower = i.aabb_max[1] <= other.aabb_max[1] - 0.1 and abs(i.aabb_min[1] - other.aabb_min[1]) <= 0.1
        flat = i.aabb_max[1] - i.aabb_min[1] <= 0.08
        return lower and (middle_over(other, i) if flat else middle_over(i, other))
    same_room = None in (i.room, other.room) or i.room == other.room
    if name == "above":
        return same_room and 0.0 <= rise <= 1.2 and gap(i, other) <= 0.15 and not rests_on(i, other)
    same_level = rise <= 0.3 and other.aabb_min[1] - i.aabb_max[1] <= 0.3
    assert name in ("next to", "beside", "by")
    return same_room and same_level and gap(i, other) <= 0.5 and not rests_on(i, other) and not rests_on(other, i)


def extent(i, most):
    size = sorted(i.aabb_max - i.aabb_min)
    return i.aabb_max[1] - i.aabb_min[1] if most == "tallest" else size[1] * size[2]


def means(scene, phrase: dict) -> set[int]:
    """What a phrase means, written once more without the generator's code: names by the table alone, rooms by their boxes."""

    def called(i, noun):
        return i.category not in ("wall", "floor", "ceiling", "unannotated", "unknown") and kind_of(noun) in kinds_of(
            kind_of(i.category)
        )

    found = [i for i in scene.instances if called(i, phrase["noun"])]
    if "room" in phrase:
        found = [i for i in found if room_of(scene, i) == phrase["room"]]
    if "colour" in phrase:
        found = [i for i in found if i.attributes.get("colour") == phrase["colour"]]
    if "material" in phrase:
        found = [i for i in found if i.attributes.get("material") in ATTRIBUTES["materials"][phrase["material"]]]
    if "look" in phrase:
        entry = ATTRIBUTES["looks"][phrase["look"]]
        found = [i for i in found if i.attributes.get(entry["key"]) == entry.get("value", phrase["look"])]
    if "relation" in phrase:
        name, noun = phrase["relation"]["name"], phrase["relation"]["noun"]
        others = [o for o in scene.instances if called(o, noun)]
        found = [i for i in found if any(o.id != i.id and related(i, o, name) for o in others)]
    if "most" in phrase:
        largest = max(found, key=lambda i: extent(i, phrase["most"]))
        rest = [i for i in found if i is not largest]
        assert rest, "the largest of one"
        assert all(extent(largest, phrase["most"]) > 1.2 * extent(i, phrase["most"]) for i in rest)
        found = [largest]
    return {i.id for i in found}


def covers(scene, entry: str, i) -> bool:
    """Whether a line of the table of needs means a thing, read from its text once more."""
    match = re.fullmatch(r"(=?)([^:@]+)(?::([^@]+))?(?:@(.+))?", entry)
    kind = kind_of(i.category)
    return (
        (kind == match[2] if match[1] else match[2] in kinds_of(kind))
        and (match[3] is None or match[3] in i.attributes.values())
        and (match[4] is None or room_of(scene, i) == match[4])
    )


def test_every_kind_is_made_and_no_instruction_twice(made):
    _, _, episodes = made
    assert set(Counter(e.kind for e in episodes)) == set(KINDS)
    assert len({e.instruction for e in episodes}) == len({e.episode_id for e in episodes}) == len(episodes) >= 18


def test_a_phrase_means_exactly_the_targets(made):
    scene, _, episodes = made
    phrases = [e for e in episodes if "expression" in e.info]
    for episode in phrases:
        assert means(scene, episode.info["expression"]) == {t.instance_id for t in episode.targets}, episode.instruction
    assert any("relation" in e.info["expression"] for e in phrases)
    assert any("room" in e.info["expression"] for e in phrases)


def test_phrases_name_things_in_many_ways(home):
    said = Counter(key for e in home[2] for key in e.info.get("expression", {}))
    assert {"noun", "colour", "room", "relation"} <= set(said)
    assert len({e.info["expression"]["noun"] for e in home[2] if "expression" in e.info}) >= 15


def test_what_the_phrase_says_is_in_the_instruction(made):
    _, _, episodes = made
    for episode in (e for e in episodes if "expression" in e.info):
        phrase, text = episode.info["expression"], episode.instruction
        assert phrase["noun"] in text
        for key in ("colour", "material", "look", "most"):
            assert phrase.get(key, "") in text
        if "relation" in phrase:
            assert f" {phrase['relation']['name']} the {phrase['relation']['noun']}" in text
        if "room" in phrase and len(episode.info.get("rooms", [0, 0])) > 1:
            assert f"the {phrase['room']}" in text
        article = re.search(rf"\b(the|a|an|some) (?:[\w-]+ )*?{re.escape(phrase['noun'])}", text)
        assert article is not None, text
        assert (article[1] == "the") == (len(episode.targets) == 1) or episode.kind == "language_guided", text


def test_instructions_are_plain_english(made):
    for episode in made[2]:
        text = episode.instruction
        assert not re.search(r"[_{}\d]|\s\s|\s[.,?]|\.\.|\bnone\b|None", text), text
        assert text[0].isupper(), text
        assert text[-1] in ".?", text
        assert not re.search(r"\b(\w+) \1\b", text), f"a word twice: {text}"
        assert not re.search(r"\ba [aeioAEIO]|\ban [^aeiouAEIOU]", text), f"article: {text}"
        assert not re.search(r"\ba (\w+ )?(scissors|shoes|clothes|flowers|keys|shelves|books|drawers)\b", text), text
        assert len(text) <= 300, text


def test_verbs_agree_with_what_they_are_said_of(made):
    for episode in (e for e in made[2] if "{is}" in e.info.get("pattern", "")):
        many = TABLE.get(kind_of(episode.info["expression"]["noun"]), {}).get("number") == "many"
        assert bool(re.search(r"\bare\b", episode.instruction)) == many, episode.instruction


def test_a_demand_lists_everything_that_serves_it(made):
    scene, _, episodes = made
    demands = [e for e in episodes if e.kind == "demand"]
    table = load_data("needs.json")["needs"]
    for episode in demands:
        need, room = table[episode.info["need"]], episode.info.get("room")
        assert episode.info["sentence"] in need["sentences"]
        assert episode.info["sentence"].format(room=room)[1:] in episode.instruction
        assert (room is not None) == ("{room}" in episode.info["sentence"])
        serving = {
            i.id
            for i in scene.instances
            if any(covers(scene, entry, i) for entry in need["served_by"])
            and not any(covers(scene, entry, i) for entry in need.get("not", []))
            and (room is None or room_of(scene, i) == room)
        }
        assert serving == {t.instance_id for t in episode.targets}, episode.instruction
        assert len(serving) <= 6


def test_no_home_is_asked_for_a_need_that_something_in_it_serves_only_perhaps(made):
    scene, _, episodes = made
    table = load_data("needs.json")["needs"]
    for episode in (e for e in episodes if e.kind == "demand"):
        targets = {t.instance_id for t in episode.targets}
        for entry in table[episode.info["need"]].get("unsure", []):
            for i in scene.instances:
                if covers(scene, entry, i) and room_of(scene, i) in (episode.info.get("room"), room_of(scene, i)):
                    in_scope = episode.info.get("room") in (None, room_of(scene, i))
                    excepted = any(covers(scene, e, i) for e in table[episode.info["need"]].get("not", []))
                    assert i.id in targets or excepted or not in_scope, (episode.instruction, i.category)


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
    for episode in episodes[::4]:
        assert surface.island_of(episode.start_position) == 0
        distance = way_to(surface, scene, episode.targets, island=0).distance(episode.start_position)
        assert distance == pytest.approx(episode.info["geodesic_distance"])
        assert 0.0 < distance < 100.0


def test_a_guided_way_is_the_shortest_and_leads_through_the_rooms_it_names(made):
    scene, surface, episodes = made
    guided = [e for e in episodes if e.kind == "language_guided"]
    for episode in guided:
        rooms = episode.info["rooms"]
        path = way_to(surface, scene, episode.targets, island=0).path(episode.start_position)
        assert np.allclose(path, episode.info["reference_path"])
        crossed = rooms_along(scene, evenly(path))
        assert [r for r in crossed if r in rooms] == rooms
        ends = {room_of(scene, scene.instance(t.instance_id)) for t in episode.targets}
        assert ends == {rooms[-1]}, "a thing of that name elsewhere would answer the name, not the way"
        start_room = scene.room_of(np.add(episode.start_position, (0.0, 0.3, 0.0)))
        assert vocabulary().room(start_room.name) == rooms[0]
        if len(rooms) > 1:
            said = [episode.instruction.find(f"the {room}") for room in rooms[1:]]
            assert said == sorted(said) or -1 not in said
            assert f"the {rooms[-1]}" in episode.instruction
    assert any(len(e.info["rooms"]) > 1 for e in guided)


def evenly(path, step=0.1):
    parts = [np.linspace(a, b, max(2, int(np.linalg.norm(b - a) / step) + 1)) for a, b in pairwise(path)]
    return np.concatenate(parts)


def test_a_side_is_the_side_on_which_the_thing_is_passed(made):
    scene, _, episodes = made
    for episode in (e for e in episodes if e.kind == "language_guided"):
        path = evenly(np.array(episode.info["reference_path"]), 0.05)
        for mark in episode.info["landmarks"]:
            assert f"the {mark['noun']}" in episode.instruction
            ids = means(scene, {"noun": mark["noun"]})
            near = {}
            for thing in (scene.instance(n) for n in ids):
                off = np.maximum(np.maximum(thing.aabb_min - path, path - thing.aabb_max), 0.0)
                near[thing.id] = float(np.hypot(off[:, 0], off[:, 2]).min())
            assert min(near.values()) <= 1.25, episode.instruction
            if mark["side"] is None:
                continue
            assert f"your {mark['side']}" in episode.instruction or f"the {mark['side']}" in episode.instruction
            # Seen from the path's point nearest to its middle, the thing lies across the way to the left or to the right.
            crosses = []
            for thing in (scene.instance(n) for n in ids if near[n] <= 1.25):
                at = int(np.argmin(np.hypot(*(path - thing.centre)[:, [0, 2]].T)))
                way = path[min(at + 8, len(path) - 1)] - path[max(at - 8, 0)]
                right = np.array([-way[2], 0.0, way[0]])
                crosses.append("right" if right @ (thing.centre - path[at]) > 0 else "left")
            assert mark["side"] in crosses, episode.instruction


def test_a_turn_is_a_turn_to_that_side(made):
    scene, _, episodes = made
    for episode in (e for e in episodes if e.kind == "language_guided"):
        path = evenly(np.array(episode.info["reference_path"]), 0.05)
        names = [scene.room_of(p + np.array([0.0, 0.3, 0.0])) for p in path]
        names = [None if r is None else vocabulary().room(r.name) for r in names]
        for side, room in re.findall(r"(left|right)(?: turn)? into the ([a-z' ]+?)(?:,| and|\.)", episode.instruction):
            at = names.index(room)
            before, after = path[at] - path[max(at - 20, 0)], path[min(at + 20, len(path) - 1)] - path[at]
            left = before[2] * after[0] - before[0] * after[2]
            assert (left > 0) == (side == "left"), episode.instruction


def test_without_a_second_room_of_the_name_no_way_is_told_to_one_of_two(toy_scene, toy_surface):
    # Nothing but chairs, two in each of two rooms: no phrase singles one out, and "a chair" would be no goal of a way.
    chairs = {1, 3, 9, 11}
    scene = replace(
        toy_scene,
        instances=[
            replace(i, category="chair" if i.id in chairs else "wall", attributes={}) for i in toy_scene.instances
        ],
    )
    made = generate_episodes(scene, "toy:0", toy_surface, 12, np.random.default_rng(7))
    assert made
    assert all(len(e.targets) == 1 for e in made if e.kind == "language_guided")


def test_the_same_seed_makes_the_same_episodes_and_another_makes_others(toy_scene, toy_surface):
    def run(seed):
        return generate_episodes(toy_scene, "toy:0", toy_surface, 9, np.random.default_rng(seed))

    assert run(0) == run(0)
    assert run(0) != run(1)


def test_info_is_plain_json(made):
    for episode in made[2]:
        assert json.loads(json.dumps(episode.info, allow_nan=False)) == episode.info


def test_chosen_kinds_only(toy_scene, toy_surface):
    made = generate_episodes(toy_scene, "toy:0", toy_surface, 5, np.random.default_rng(1), kinds=("demand",))
    assert {e.kind for e in made} == {"demand"}
    with pytest.raises(ValueError, match="haiku"):
        generate_episodes(toy_scene, "toy:0", toy_surface, 5, np.random.default_rng(1), kinds=("haiku",))


def test_a_scene_without_semantics_is_refused_by_name(toy_scene, toy_surface):
    bare = replace(toy_scene, instances=[], face_instance=np.zeros_like(toy_scene.face_instance))
    with pytest.raises(DataError, match="toy:bare"):
        generate_episodes(bare, "toy:bare", toy_surface, 3, np.random.default_rng(0))


def test_without_rooms_ways_lead_past_things_at_hand(toy_scene, toy_surface):
    bare = replace(toy_scene, rooms=[], instances=[replace(i, room=None) for i in toy_scene.instances])
    ways = generate_episodes(bare, "toy:bare", toy_surface, 12, np.random.default_rng(0), kinds=("language_guided",))
    assert len(ways) >= 4
    for episode in ways:
        assert episode.info["rooms"] == []
        assert not re.search(r" in the (bedroom|living room|kitchen)", episode.instruction)
        (mark,) = episode.info["landmarks"]
        assert f"the {mark['noun']}" in episode.instruction
        (landmark,) = means(bare, {"noun": mark["noun"]})
        assert landmark not in {t.instance_id for t in episode.targets}


def test_what_is_shut_in_a_box_is_not_asked_for(toy_scene, toy_surface):
    # The vase goes into the wardrobe; the wardrobe's box has no opening.
    vase = next(i for i in toy_scene.instances if i.category == "vase")
    wardrobe = next(i for i in toy_scene.instances if i.category == "wardrobe")
    vertices, own = toy_scene.vertices.copy(), np.unique(toy_scene.faces[toy_scene.face_instance == vase.id])
    moved = (wardrobe.centre - vase.centre).astype(np.float32)
    vertices[own] += moved
    hidden = replace(
        vase,
        room=wardrobe.room,
        centre=vase.centre + moved,
        aabb_min=vase.aabb_min + moved,
        aabb_max=vase.aabb_max + moved,
    )
    scene = replace(
        toy_scene,
        vertices=vertices,
        instances=[hidden if i.id == vase.id else i for i in toy_scene.instances],
    )
    kinds = ("object_goal", "demand")
    made = generate_episodes(scene, "toy:0", toy_surface, 60, np.random.default_rng(0), kinds=kinds)
    assert not [e.instruction for e in made if "vase" in e.instruction]
    assert not [e.instruction for e in made if {t.instance_id for t in e.targets} == {vase.id}]
    seen = generate_episodes(toy_scene, "toy:0", toy_surface, 60, np.random.default_rng(0), kinds=kinds)
    assert [e for e in seen if {t.instance_id for t in e.targets} == {vase.id}]


def test_too_few_episodes_are_told_by_kind(toy_scene, toy_surface, caplog):
    one = next(i for i in toy_scene.instances if i.category == "bed")
    ids = np.where(toy_scene.face_instance == one.id, one.id, 0).astype(np.int32)
    lone = replace(toy_scene, instances=[replace(one, room=None)], face_instance=ids, rooms=[])
    with caplog.at_level("WARNING"):
        made = generate_episodes(lone, "toy:lone", toy_surface, 6, np.random.default_rng(0))
    assert len(made) < 6
    assert "0 language_guided" in caplog.text
