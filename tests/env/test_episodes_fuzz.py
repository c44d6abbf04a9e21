"""Damaged episode files of every format are read or refused with a DataError; nothing else comes out."""

from __future__ import annotations

import gzip
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzzing import CASES, hold_to_data_error

from openmap_env.episodes import Episode, Target, load_episodes, write_episodes
from openmap_env.episodes.benchmark import FrozenHome, Makeup, read_split, write_split
from openmap_env.episodes.jsonl import as_line
from openmap_env.episodes.readers import complete
from openmap_scenes import DataError
from openmap_scenes.formats.checked_json import Value

POSITION, ROTATION = [1.25, 0.05, -3.5], [0.0, -0.7071067811865475, 0.0, 0.7071067811865476]
COMMON = {"scene_id": "mp3d/toy/toy.glb", "start_position": POSITION, "start_rotation": ROTATION, "info": {"d": 1.5}}
GOAL = {"position": POSITION, "radius": 3.0, "object_id": 7, "object_category": "tv_monitor"}
R2R = [
    {
        **COMMON, "episode_id": n, "trajectory_id": n, "goals": [GOAL], "reference_path": [POSITION, POSITION],
        "instruction": {"instruction_text": "Leave the bedroom.", "instruction_tokens": [1, 2]},
    }
    for n in range(3)
]  # fmt: skip
OBJECTNAV = [{**COMMON, "episode_id": str(n), "goals": [], "object_category": "tv_monitor"} for n in range(3)]
VLMAPS = [
    {
        "task_id": n, "tf_habitat": np.eye(4).ravel().tolist(), "map_grid_size": 1000, "map_cell_size": 0.05,
        "scene": "toy", "instruction": "go to the sofa, then the bed", "objects_info": [{"name": "sofa"}, {"name": "bed"}],
    }
    for n in range(3)
]  # fmt: skip
OURS = [
    Episode(
        f"e{n}", "mp3d:/data/toy", "Find the “blue” armchair.", "object_goal", (0.1, 0.0, -0.3), 1.25,
        (Target(4, (1.0, 0.5, -2.0), (0.5, 0.0, -2.5), (1.5, 1.0, -1.5)),), {"expression": {"noun": "armchair"}},
    )
    for n in range(3)
]  # fmt: skip


@pytest.fixture
def healthy(tmp_path):
    folder = tmp_path / "healthy"
    folder.mkdir()
    for name, data in (
        ("r2r.json", {"episodes": R2R}),
        ("objectnav.json", {"episodes": OBJECTNAV, "goals_by_category": {"toy.glb_tv_monitor": [GOAL]}}),
        ("vlmaps.json", VLMAPS),
    ):
        (folder / name).write_text(json.dumps(data))
        (folder / f"{name}.gz").write_bytes(gzip.compress(json.dumps(data).encode(), mtime=0))
    write_episodes(folder / "ours.jsonl", OURS)
    write_episodes(folder / "ours.jsonl.gz", OURS)
    return folder


@pytest.mark.parametrize("name", ["r2r.json", "objectnav.json", "vlmaps.json", "ours.jsonl"])
def test_damaged_files_are_refused_or_read(healthy, tmp_path, name, toy_scene):
    def read(folder: Path) -> None:
        for packed in ("", ".gz"):
            for episode in load_episodes(folder / f"{name}{packed}", "mp3d:/data/toy"):
                as_line(episode.__dict__ | {"targets": []})

    read(healthy)
    (tmp_path / "scratch").mkdir()
    refused = hold_to_data_error(read, healthy, [name, f"{name}.gz"], tmp_path / "scratch", 300, seed=len(name))
    assert refused > 50


def test_damaged_files_of_the_benchmark_are_refused_or_read(tmp_path, toy_scene):
    folder = tmp_path / "healthy"
    lines = tuple(as_line(json.loads(json.dumps(e, default=vars))).encode() for e in OURS)
    header = json.loads(json.dumps(vars(Makeup.of(toy_scene))))
    for name in ("val.jsonl", "val.jsonl.gz"):
        write_split(folder / name, "val", 0, 3, [FrozenHome("homes:val/0", Value(header, "toy"), lines)])

    def read(where: Path) -> None:
        for name in ("val.jsonl", "val.jsonl.gz"):
            for home in read_split(where / name).homes.values():
                assert len(home.episodes()) <= 3
                home.makeup.difference(toy_scene)

    read(folder)
    (tmp_path / "scratch").mkdir()
    refused = hold_to_data_error(read, folder, ["val.jsonl", "val.jsonl.gz"], tmp_path / "scratch", 300)
    assert refused > 50


ODD = (None, True, -1, 10**400, 1e308, "", "x", "\ud800", "/", [], [[]], {}, {"a": 1}, 0.5, [1, 2, 3], 2**70, "a\0b")


def with_odd_values(data: Any, rng: np.random.Generator) -> Any:
    """A copy in which one value, of any depth, is another, or is gone."""
    data = json.loads(json.dumps(data))
    node = data
    while True:
        keys = sorted(node) if isinstance(node, dict) else range(len(node))
        key = keys[int(rng.integers(len(keys)))]
        if not isinstance(node[key], dict | list) or not node[key] or rng.random() < 0.2:
            break
        node = node[key]
    if isinstance(node, dict) and rng.random() < 0.2:
        del node[key]
    else:
        node[key] = ODD[int(rng.integers(len(ODD)))]
    return data


@pytest.mark.parametrize("name", ["r2r.json", "objectnav.json", "vlmaps.json", "ours.jsonl"])
def test_any_value_may_be_anything(healthy, tmp_path, name, toy_scene):
    rng = np.random.default_rng(5)
    whole = (healthy / name).read_text()
    data = [json.loads(line) for line in whole.splitlines()] if name.endswith("l") else json.loads(whole)
    path, refused = tmp_path / name, 0
    for case in range(CASES or 400):
        odd = with_odd_values(data, rng)
        path.write_text("\n".join(map(json.dumps, odd)) if name.endswith("l") else json.dumps(odd))
        try:
            # What is read can be written, and what the scene adds is found or missed.
            episodes = load_episodes(path, "mp3d:/data/toy")
            write_episodes(tmp_path / "again.jsonl", [e for e in episodes if e.targets])
            for episode in episodes:
                with suppress(DataError):
                    complete(episode, toy_scene)
            with suppress(DataError):
                load_episodes(path)
        except DataError:
            refused += 1
        except Exception as error:
            raise AssertionError(f"case {case}: {type(error).__name__}: {error}; {path.read_text()}") from error
    assert 50 < refused < (CASES or 400)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"episodes": ' + "9" * 5000 + "}", '{"episodes": [{"scene_id": "\\ud800"}]}']
)
@pytest.mark.parametrize("name", ["a.json", "a.jsonl"])
def test_json_that_breaks_parsers_is_refused(tmp_path, text, name):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match=name):
        load_episodes(tmp_path / name)
