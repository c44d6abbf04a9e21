"""``openmap episodes``: making, checking, showing and listing, on the toy home in place of built ones."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from openmap_env.episodes import benchmark, read_episodes, write_episodes
from openmap_env.episodes.benchmark import read_split
from openmap_eval import episode_work
from openmap_eval.cli import main


@pytest.fixture
def homes(tmp_path, monkeypatch, toy_scene):
    """Every home is the toy scene; the benchmark's files are in the folder that is returned."""
    loads: list[str] = []

    def load(spec):
        loads.append(spec)
        return toy_scene

    for module in ("openmap_eval.episode_work", "openmap_eval.episode_commands"):
        monkeypatch.setattr(f"{module}.load_scene", load)
    monkeypatch.setattr(benchmark, "split_file", lambda split: tmp_path / f"{split}.jsonl.gz")
    monkeypatch.setenv("COLUMNS", "200")
    benchmark._frozen_specs.cache_clear()
    yield tmp_path, loads
    benchmark._frozen_specs.cache_clear()


def run(*arguments, status=0):
    if status == 0:
        main(["episodes", *map(str, arguments)])
        return
    with pytest.raises(SystemExit) as stopped:
        main(["episodes", *map(str, arguments)])
    assert stopped.value.code == status


def make(out, *homes, n=6, **how):
    run("make", "--out", out, "--split", "val", "--homes", *homes, "--n", n, "--jobs", "1", **how)


def test_homes_are_made_checked_listed_and_shown(homes, capsys):
    out, _ = homes
    make(out, 1, 0)
    assert list(read_split(out / "val.jsonl.gz").homes) == ["homes:val/0", "homes:val/1"]
    assert [p.name for p in out.iterdir()] == ["val.jsonl.gz"]
    run("list")
    listed = capsys.readouterr().out
    assert "2 of 10" in listed
    assert "0 of 20" in listed
    run("show", "homes:val/1", "--n", "3")
    shown = capsys.readouterr().out
    episodes = read_split(out / "val.jsonl.gz").homes["homes:val/1"].episodes()
    assert episodes[0].instruction[:20] in shown
    # A toy home has fewer episodes than a home of the benchmark must have.
    run("check", "--homes", "1", "--jobs", "1", status=1)
    said = capsys.readouterr().out
    assert "homes:val/1: 6 episodes, fewer than 25" in said
    assert "homes:val/0" not in said


def test_a_run_that_was_stopped_goes_on_where_it_was(homes, monkeypatch):
    out, loads = homes
    work = episode_work.make_home

    def stop(task):
        if task[0] == "homes:val/2":
            raise KeyboardInterrupt
        return work(task)

    monkeypatch.setattr(episode_work, "make_home", stop)
    run("make", "--out", out, "--split", "val", "--homes", 0, 1, 2, "--n", 3, "--jobs", 1, status=130)
    assert not (out / "val.jsonl.gz").exists()
    assert loads == ["homes:val/0", "homes:val/1"]
    monkeypatch.setattr(episode_work, "make_home", work)
    make(out, 0, 1, 2, n=3)
    assert loads[2:] == ["homes:val/2"], "what was made is not made again"
    whole = (out / "val.jsonl.gz").read_bytes()
    make(out, 0, 1, 2, n=3)
    assert (out / "val.jsonl.gz").read_bytes() == whole
    assert len(loads) == 6, "a run that was finished starts afresh"


def test_what_other_words_or_settings_made_is_made_again(homes, monkeypatch, tmp_path):
    out, _ = homes
    parts = episode_work.Parts(out / "parts", 3, 0)
    part = episode_work.make_home(("homes:val/0", 3, 0))
    parts.put(part)
    assert parts.get("homes:val/0")["lines"] == part["lines"]
    assert parts.get("homes:val/1") is None
    assert episode_work.Parts(out / "parts", 3, 1).get("homes:val/0") is None
    monkeypatch.setattr(episode_work, "files", lambda package: tmp_path)
    assert episode_work.Parts(out / "parts", 3, 0).get("homes:val/0") is None
    (out / "parts" / "000.json").write_text("{")
    assert parts.get("homes:val/0") is None


def test_homes_that_are_not_made_again_stay(homes):
    out, _ = homes
    make(out, 0, n=3)
    make(out, 5, n=3)
    assert list(read_split(out / "val.jsonl.gz").homes) == ["homes:val/0", "homes:val/5"]
    make(out, 5, n=6)
    assert list(read_split(out / "val.jsonl.gz").homes) == ["homes:val/5"], "other settings make another file"


def test_another_home_is_found_out(homes, monkeypatch, toy_scene, capsys):
    out, _ = homes
    make(out, 0, n=3)
    moved = replace(toy_scene, instances=[replace(i, centre=i.centre + 1.0) for i in toy_scene.instances])
    monkeypatch.setattr(episode_work, "load_scene", lambda spec: moved)
    run("check", "--jobs", "1", status=1)
    assert "is another home here: instance 1, a bed" in capsys.readouterr().out


def test_a_file_of_ones_own_is_checked_and_shown(homes, capsys):
    out, _ = homes
    make(out, 0)
    mine = out / "mine.jsonl"
    write_episodes(mine, read_split(out / "val.jsonl.gz").homes["homes:val/0"].episodes())
    run("check", mine, "--jobs", "1")
    run("show", mine)
    capsys.readouterr()
    good = read_episodes(mine)
    write_episodes(mine, [replace(good[0], start_position=(90.0, 0.0, 0.0)), *good[1:]])
    run("check", mine, "--jobs", "1", status=1)
    assert "nobody can stand" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["make", "--out", "x", "--n", "0"], "--n 0"),
        (["check", "nowhere.jsonl"], "nowhere.jsonl"),
        (["check", "--homes", "77"], "no such home"),
        (["check", "--jobs", "0"], "--jobs"),
        (["show", "homes:val/1", "--n", "0"], "--n"),
        (["show", "nonsense:1"], "nonsense"),
    ],
)
def test_bad_input_ends_in_one_message(homes, capsys, arguments, said):
    run(*arguments, status=2)
    assert said in capsys.readouterr().out


def test_an_evaluation_asks_what_the_benchmark_asks(homes, toy_scene, monkeypatch, tmp_path):
    from openmap_scenes.catalog import READERS

    out, _ = homes
    make(out, 0, n=9)
    monkeypatch.setitem(READERS, "homes", lambda rest: toy_scene)
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    base = ["eval", "--agent", "stand_still", "--protocol", "navigation", "--width", "32", "--height", "24"]
    main([*base, "--scene", "homes:val/0", "--episodes", "4", "--out", str(tmp_path / "run")])
    lines = [json.loads(line) for line in (tmp_path / "run" / "episodes.jsonl").read_text().splitlines()]
    frozen = [e.episode_id for e in read_split(out / "val.jsonl.gz").homes["homes:val/0"].episodes()]
    assert [line["episode_id"] for line in lines] == frozen[:4]
    assert len({line["kind"] for line in lines}) == 3
    assert all(line["metrics"]["nav_success"] == 0.0 for line in lines)
    settings = json.loads((tmp_path / "run" / "settings.json").read_text())
    assert "OpenMapNav-Homes" in settings["tasks"][0][1]


def test_an_environment_has_the_frozen_episodes_unless_told_otherwise(homes, toy_scene, monkeypatch):
    import gymnasium as gym

    import openmap_env  # noqa: F401 - registers the environment
    from openmap_scenes.catalog import READERS

    out, _ = homes
    make(out, 0, n=6)
    monkeypatch.setitem(READERS, "homes", lambda rest: toy_scene)
    monkeypatch.setenv("OPENMAP_CACHE_GB", "0")
    frozen = read_split(out / "val.jsonl.gz").homes["homes:val/0"].episodes()
    for how, n in (({}, 6), ({"episodes": "generate"}, 24), ({"episodes_per_scene": 3}, 3)):
        env = gym.make("OpenMapNav-v0", scene="homes:val/0", width=32, height=24, **how)
        env.reset(seed=0)
        episodes = env.unwrapped.episodes
        assert len(episodes) == n
        start = (env.unwrapped.episode.start_position, env.unwrapped.episode.start_heading)
        assert (start == (frozen[0].start_position, frozen[0].start_heading)) == (not how)
        env.close()
