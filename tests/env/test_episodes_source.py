"""Which episodes an environment gets: frozen ones for the benchmark's homes, generated ones for all others, or what it is given."""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from openmap_env.episodes import KINDS, generate_episodes, source, write_episodes
from openmap_env.episodes import benchmark as frozen
from openmap_env.episodes.benchmark import freeze, write_split
from openmap_env.episodes.source import EpisodeSource, evenly

SPEC = "homes:val/0"


@pytest.fixture
def homes(tmp_path, monkeypatch, toy_scene, toy_surface):
    """A benchmark whose only home is the toy scene."""
    home = freeze(toy_scene, SPEC, toy_surface, 9, 0)
    write_split(tmp_path / "val.jsonl.gz", "val", 0, 9, [home])
    monkeypatch.setattr(frozen, "split_file", lambda split: tmp_path / f"{split}.jsonl.gz")
    monkeypatch.setattr(source, "_warned", set())
    frozen._frozen_specs.cache_clear()
    yield home
    frozen._frozen_specs.cache_clear()


def test_a_home_of_the_benchmark_has_its_frozen_episodes(homes, toy_scene, toy_surface):
    for spec in (SPEC, "homes:val/000"):
        episodes = EpisodeSource(spec).of(spec, toy_scene, toy_surface)
        assert [e.episode_id for e in episodes] == [e.episode_id for e in homes.episodes()]
        assert {e.scene for e in episodes} == {spec}
        # As exact as the scene is, not as the file is.
        assert all(t.centre == tuple(toy_scene.instance(t.instance_id).centre) for e in episodes for t in e.targets)


def test_kinds_choose_among_frozen_episodes(homes, toy_scene, toy_surface):
    episodes = EpisodeSource(SPEC, kinds=("demand",)).of(SPEC, toy_scene, toy_surface)
    assert episodes
    assert {e.kind for e in episodes} == {"demand"}


@pytest.mark.parametrize("how", [{"generated": 4}, {"seed": 0}, {"episodes": "generate"}])
def test_who_asks_for_generated_episodes_gets_them(homes, toy_scene, toy_surface, how, monkeypatch):
    seen = []

    def generate(*arguments):
        seen.append(arguments[3])
        return generate_episodes(*arguments)

    monkeypatch.setattr(source, "generate_episodes", generate)
    made = EpisodeSource(SPEC, **how).of(SPEC, toy_scene, toy_surface)
    assert seen == [how.get("generated", 24)]
    assert len(made) <= seen[0]


def test_the_benchmark_can_be_asked_for_with_a_number_for_other_scenes(homes, toy_scene, toy_surface):
    asked = EpisodeSource(None, "benchmark", 4, 3)
    assert len(asked.of(SPEC, toy_scene, toy_surface)) == 9
    assert len(asked.of("toy:0", toy_scene, toy_surface)) == 4


def test_a_home_that_is_another_has_generated_episodes_and_one_warning(
    homes, toy_scene, toy_surface, tmp_path, monkeypatch, caplog
):
    moved = [replace(i, centre=i.centre + np.array([0.5, 0.0, 0.0])) for i in toy_scene.instances]
    other = replace(toy_scene, instances=moved)
    monkeypatch.setenv("OPENMAP_FURNITURE", str(tmp_path / "nothing"))
    with caplog.at_level(logging.WARNING):
        for spec in (SPEC, "homes:val/00"):
            made = EpisodeSource(spec, "benchmark", 3).of(spec, other, toy_surface)
            assert len(made) == 3
    warnings = [r.getMessage() for r in caplog.records if "benchmark" in r.getMessage()]
    assert len(warnings) == 1
    assert "sweethome3d-furniture" in warnings[0]


def test_a_home_that_is_another_in_spite_of_the_library_is_named(
    homes, toy_scene, toy_surface, tmp_path, monkeypatch, caplog
):
    (tmp_path / "a.sh3f").touch()
    monkeypatch.setenv("OPENMAP_FURNITURE", str(tmp_path))
    other = replace(toy_scene, instances=[replace(i, category="box") for i in toy_scene.instances])
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            EpisodeSource(SPEC, "benchmark", 1).given_for(SPEC)
            EpisodeSource(SPEC, "benchmark", 1)._from_benchmark(SPEC, other)
    assert len([r for r in caplog.records if "another home" in r.getMessage() and "bed" in r.getMessage()]) == 1


def test_the_start_that_all_share_is_that_of_the_first(homes, toy_scene, toy_surface, tmp_path):
    first = homes.episodes()[0]
    assert EpisodeSource(SPEC).start_of(SPEC, toy_scene, toy_surface) == (first.start_position, first.start_heading)
    assert EpisodeSource(SPEC, "generate").start_of(SPEC, toy_scene, toy_surface) is None
    write_episodes(tmp_path / "e.jsonl", homes.episodes()[1:])
    second = homes.episodes()[1]
    given = EpisodeSource("homes:val/00", tmp_path / "e.jsonl")
    assert given.start_of("homes:val/00", toy_scene, toy_surface) == (second.start_position, second.start_heading)


def test_given_episodes_are_of_the_scene_as_it_was_named(homes, toy_scene, toy_surface):
    given = EpisodeSource("homes:val/00", homes.episodes())
    assert len(given.of("homes:val/00", toy_scene, toy_surface)) == 9
    with pytest.raises(ValueError, match="leave scene out"):
        EpisodeSource("homes:val/1", homes.episodes())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"generated": 0}, "generate"),
        ({"seed": -1}, "generate"),
        ({"kinds": ()}, "kinds"),
        ({"kinds": ("riddle",)}, "riddle"),
        ({"episodes": []}, "list of 0"),
        ({"episodes": "missing.jsonl"}, "missing.jsonl"),
    ],
)
def test_bad_arguments_are_named(arguments, said):
    with pytest.raises(ValueError, match=said):
        EpisodeSource(SPEC, **arguments)


def test_a_number_of_episodes_is_taken_evenly_from_the_kinds(homes):
    episodes = homes.episodes()
    for n in range(1, 10):
        taken = evenly(episodes, n)
        assert len(taken) == n
        assert [e for e in episodes if e in taken] == taken
        counts = Counter(e.kind for e in taken)
        assert max(counts[k] for k in KINDS) - min(counts[k] for k in KINDS) <= 1
    assert evenly(episodes, 99) == episodes
    assert evenly([], 3) == []
    only = [e for e in episodes if e.kind == "demand"]
    assert evenly(only, 2) == only[:2]
