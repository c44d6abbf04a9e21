"""The benchmark's frozen episodes: the same bytes for the same home, recognised homes, and what the checks find."""

from __future__ import annotations

import gzip
import json
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from openmap_env.episodes import KINDS, Episode, load_episodes
from openmap_env.episodes import benchmark as frozen
from openmap_env.episodes.benchmark import SIZES, Makeup, freeze, frozen_home, read_split, split_file, write_split
from openmap_env.episodes.checking import check_episodes
from openmap_env.episodes.episode import place, target_of
from openmap_env.episodes.readers import complete
from openmap_scenes import DataError

SPEC = "homes:val/0"


@pytest.fixture(scope="module")
def home(toy_scene, toy_surface):
    return freeze(toy_scene, SPEC, toy_surface, 9, 0)


@pytest.fixture(scope="module")
def episodes(home) -> list[Episode]:
    return home.episodes()


def wrong(episodes, scene, surface, **how) -> str:
    return "; ".join(problem.what for problem in check_episodes(episodes, SPEC, scene, surface, **how))


def test_frozen_episodes_are_compact_and_nothing_is_wrong_with_them(home, episodes, toy_scene, toy_surface):
    assert len(episodes) == 9
    assert {e.kind for e in episodes} == set(KINDS)
    for episode in episodes:
        numbers = [
            *episode.start_position,
            *(x for t in episode.targets for x in (*t.centre, *t.aabb_min, *t.aabb_max)),
        ]
        assert all(round(x, 3) == x for x in numbers)
        assert toy_surface.island_of(episode.start_position) == 0
        exact = complete(episode, toy_scene)
        assert all(t == target_of(toy_scene.instance(t.instance_id)) for t in exact.targets)
    assert wrong(episodes, toy_scene, toy_surface) == ""
    assert "9 episodes, fewer than 25" in wrong(episodes, toy_scene, toy_surface, benchmark=True)


def test_a_file_gives_back_its_homes_and_is_an_episode_file_as_well(tmp_path, home, episodes, toy_scene):
    path = tmp_path / "val.jsonl.gz"
    write_split(path, "val", 0, 9, [home, replace(home, spec="homes:val/1")])
    split = read_split(path)
    assert (split.split, split.seed, split.episodes_per_home) == ("val", 0, 9)
    assert list(split.homes) == [SPEC, "homes:val/1"]
    assert split.homes[SPEC].episodes() == episodes
    assert split.homes[SPEC].makeup == Makeup.of(toy_scene)
    assert split.homes[SPEC].digest() == home.digest()
    write_split(path, "val", 0, 9, [home])
    assert load_episodes(path) == episodes
    assert [p.name for p in tmp_path.iterdir()] == ["val.jsonl.gz"]


def test_a_home_is_recognised_up_to_a_centimetre(toy_scene):
    makeup = Makeup.of(toy_scene)

    def moved(by: float, which: int = 3, **other):
        things = list(toy_scene.instances)
        things[which] = replace(things[which], centre=things[which].centre + np.array([0.0, 0.0, by]), **other)
        return replace(toy_scene, instances=things)

    for by in (0.0, 1e-6, -1e-6, 0.004, -0.004):
        assert makeup.difference(moved(by)) is None
    assert "corner sofa, lies 3 cm" in (makeup.difference(moved(0.03)) or "")
    assert "sofa" in (makeup.difference(moved(0.0, category="bench")) or "")
    fewer = replace(toy_scene, instances=toy_scene.instances[:-1], face_instance=np.minimum(toy_scene.face_instance, 1))
    assert "instances instead of" in (makeup.difference(fewer) or "")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"targets": ()}, "no target"),
        ({"instruction": "Find\u0007it."}, "characters"),
        ({"start_position": (40.0, 0.0, 0.0)}, "nobody can stand"),
        ({"info": {"expression": {"noun": "armchair"}}}, "which is no target"),
        ({"info": {"expression": {"noun": "elephant"}}}, "is a target, but not what"),
        ({"info": {"expression": {"size": 3}}}, "cannot be understood"),
        ({"info": {"expression": 3}}, "cannot be understood"),
        ({"info": {"need": "to fly"}}, "not in the table of needs"),
        ({"info": {"geodesic_distance": 40.0}}, "notes 40.0 m of way"),
        ({"info": {"geodesic_distance": "far"}}, "notes far m of way"),
        ({"targets": (place((0.0, 90.0, 0.0)),)}, "outside of the scene"),
    ],
)
def test_what_is_wrong_with_an_episode_is_found(episodes, toy_scene, toy_surface, change, said):
    bed = replace(episodes[0], targets=(target_of(toy_scene.instances[0]),), info={}, start_position=(4.5, 0.0, 0.5))
    assert wrong([bed], toy_scene, toy_surface) == ""
    assert said in wrong([replace(bed, **change)], toy_scene, toy_surface)


def test_what_is_wrong_with_targets_and_starts_is_found(episodes, toy_scene, toy_surface):
    bed = target_of(toy_scene.instances[0])
    asked = replace(episodes[0], targets=(bed,), info={}, start_position=(4.5, 0.0, 0.5))
    for targets, said in (
        ((replace(bed, instance_id=999),), "target 999 is no instance"),
        ((replace(bed, aabb_max=(9.0, 9.0, 9.0)),), "another box"),
        ((bed, bed), "twice"),
    ):
        assert said in wrong([replace(asked, targets=targets)], toy_scene, toy_surface)
    beside = toy_surface.snap((-3.5, 0.0, -1.0))
    assert "stands still succeeds" in wrong([replace(asked, start_position=tuple(beside))], toy_scene, toy_surface)
    other = replace(asked, episode_id="other", targets=(target_of(toy_scene.instances[2]),))
    assert "with other targets" in wrong([asked, other], toy_scene, toy_surface)


def test_rounding_keeps_a_start_where_one_can_stand(episodes, toy_scene, toy_surface):
    inside = toy_surface.centres[toy_surface.island == 0]
    edge = inside[np.argmax(inside[:, 0])] + np.array([toy_surface.grid.cell / 2 - 3e-4, 0.0, 0.0])
    assert toy_surface.island_of(edge) == 0
    assert toy_surface.island_of(edge.round(3)) != 0, "rounding leads off the surface, or there is nothing to test"
    done = frozen._rounded(replace(episodes[0], start_position=tuple(edge)), toy_scene, toy_surface)
    assert toy_surface.island_of(done.start_position) == 0
    assert math.dist(done.start_position, edge) < toy_surface.grid.cell


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda header: header.update(version=99), "version 1"),
        (lambda header: header.update(format="else"), "format"),
        (lambda header: header["homes"][0].update(episodes=8), "9 episodes"),
        (lambda header: header["homes"][0].update(episodes=10), "9 episodes"),
        (lambda header: header["homes"][0].update(home=None), "home"),
        (lambda header: header.update(homes=None, episodes_per_home="x"), "episodes"),
    ],
)
def test_a_file_that_does_not_hold_what_it_says_is_refused(tmp_path, home, change, said):
    path = tmp_path / "val.jsonl.gz"
    write_split(path, "val", 0, 9, [home])
    first, *rest = gzip.decompress(path.read_bytes()).decode().splitlines()
    header = json.loads(first)
    change(header)
    path.write_bytes(gzip.compress("\n".join([json.dumps(header), *rest, ""]).encode()))
    with pytest.raises(DataError, match=said):
        read_split(path)


_FREEZE = """
import sys; sys.path[:0] = [sys.argv[1]]
from conftest import make_toy_scene
from openmap_env.episodes.benchmark import freeze, write_split
from openmap_env.navigation import NavigableSurface
from pathlib import Path
scene = make_toy_scene()
home = freeze(scene, "homes:val/0", NavigableSurface.from_scene(scene), 6, 0)
write_split(Path(sys.argv[2]), "val", 0, 6, [home])
"""


def test_another_process_writes_the_same_bytes(tmp_path, request, toy_scene, toy_surface):
    write_split(tmp_path / "here.jsonl.gz", "val", 0, 6, [freeze(toy_scene, SPEC, toy_surface, 6, 0)])
    tests, there = request.config.rootpath / "tests", tmp_path / "there.jsonl.gz"
    hashed_otherwise = {**os.environ, "PYTHONHASHSEED": "7"}
    subprocess.run([sys.executable, "-c", _FREEZE, str(tests), str(there)], check=True, env=hashed_otherwise)
    assert there.read_bytes() == (tmp_path / "here.jsonl.gz").read_bytes()


@pytest.mark.parametrize("split", [s for s in SIZES if split_file(s).is_file()])
def test_the_frozen_files_are_whole(split):
    found = read_split(split_file(split))
    assert found.split == split
    assert set(found.homes) <= {f"homes:{split}/{n}" for n in range(SIZES[split])}
    ids = set()
    for spec, home in found.homes.items():
        episodes = home.episodes()
        assert len(episodes) >= 25
        assert {e.scene for e in episodes} == {spec}
        assert len({e.instruction for e in episodes}) == len(episodes)
        assert min(sum(e.kind == kind for e in episodes) for kind in KINDS) >= 8
        known = {i for i, *_ in home.makeup.things}
        assert all(t.instance_id in known for e in episodes for t in e.targets)
        ids |= {e.episode_id for e in episodes}
    assert len(ids) == sum(len(home.lines) for home in found.homes.values())


def test_homes_are_found_however_their_number_is_written():
    assert frozen_home("homes:val/1").spec == frozen_home("homes:val/001").spec == "homes:val/1"
    for spec in ("homes:val/9999", "homes:nowhere/1", "mp3d:/data/x", "homes:val/1-2"):
        assert frozen_home(spec) is None
