"""The evaluation loop on a toy home: agents that bound each other, resuming, and pages that say what they are."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from openmap_agents.mapping import InstanceMap
from openmap_eval.cli import main
from openmap_eval.report import write_report
from openmap_eval.runner import EvalSettings, SceneTask, described, evaluate
from openmap_scenes import DataError


def settings(**changes) -> EvalSettings:
    return EvalSettings(**{"width": 64, "height": 48, "max_steps": 30, **changes})


def run(agent: str, out, toy_specs, protocol="retrieval", episodes=4, **changes):
    return evaluate([SceneTask(toy_specs[0], episodes)], settings(agent=agent, protocol=protocol, **changes), out)


class Letters:
    """A text encoder that takes no time: the letters of a text are its vector."""

    dim = 26

    def encode_text(self, texts: list[str]) -> np.ndarray:
        counts = np.array([[text.lower().count(chr(97 + k)) for k in range(26)] for text in texts], np.float32) + 1e-3
        return counts / np.linalg.norm(counts, axis=1, keepdims=True)


def lines(out) -> list[dict]:
    return [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("protocol", ["retrieval", "navigation"])
def test_the_oracle_bounds_from_above_and_the_idle_agents_from_below(tmp_path, toy_specs, protocol):
    means = {
        agent: run(agent, tmp_path / agent, toy_specs, protocol, max_steps=120)["all"]["sr_1"]["mean"]
        for agent in ("oracle", "random", "stand_still")
    }
    assert means["oracle"] == 1.0
    assert means["random"] < 1.0
    assert means["stand_still"] < 1.0


def test_a_record_holds_what_scripts_read(tmp_path, toy_specs):
    run("oracle", tmp_path, toy_specs)
    for line in lines(tmp_path):
        assert {"episode_id", "scene", "instruction", "kind", "metrics", "seconds", "trace"} <= set(line)
        assert {"sr_1", "sr_4", "sr_8", "sr_16", "sr_surface_1", "nav_success", "spl"} <= set(line["metrics"])
        assert line["targets"]
    assert json.loads((tmp_path / "summary.json").read_text())["episodes"] == 4


def test_a_run_that_was_killed_goes_on_where_it_was(tmp_path, toy_specs):
    whole = run("random", tmp_path / "whole", toy_specs)
    run("random", tmp_path / "cut", toy_specs)
    path = tmp_path / "cut" / "episodes.jsonl"
    kept = path.read_text().splitlines(keepends=True)[:2]
    path.write_text("".join(kept) + '{"episode_id": "half of a li')
    (tmp_path / "cut" / "summary.json").unlink()
    resumed = run("random", tmp_path / "cut", toy_specs)
    assert path.read_text().startswith("".join(kept))
    ids = [line["episode_id"] for line in lines(tmp_path / "cut")]
    assert sorted(ids) == sorted(line["episode_id"] for line in lines(tmp_path / "whole"))
    assert resumed["episodes"] == whole["episodes"]


def test_an_agent_is_asked_once_an_episode(tmp_path, toy_specs, monkeypatch):
    from openmap_agents.baselines import StandStillAgent

    asked = []
    monkeypatch.setattr(StandStillAgent, "answer", lambda self: asked.append(self))
    run("stand_still", tmp_path, toy_specs, episodes=3)
    assert len(asked) == 3


def test_a_finished_run_is_not_run_again(tmp_path, toy_specs):
    run("random", tmp_path, toy_specs)
    before = (tmp_path / "episodes.jsonl").read_bytes()
    run("random", tmp_path, toy_specs)
    assert (tmp_path / "episodes.jsonl").read_bytes() == before


def test_other_settings_do_not_mix_with_what_is_there(tmp_path, toy_specs):
    run("random", tmp_path, toy_specs)
    with pytest.raises(DataError, match="seed"):
        run("random", tmp_path, toy_specs, seed=1)


def test_other_perception_does_not_mix_with_what_is_there_but_another_way_to_say_the_same_does(tmp_path, toy_specs):
    run("random", tmp_path, toy_specs, perception="oracle:drop=.1")
    for chosen in ({}, {"perception": "oracle"}, {"perception": "oracle:drop=.1", "encoder": "embedded"}):
        with pytest.raises(DataError, match=r"an evaluation with .*encoder|an evaluation with .*segmenter"):
            run("random", tmp_path, toy_specs, **chosen)
    run("random", tmp_path, toy_specs, segmenter="oracle:drop=.1", encoder="oracle:drop=.1")


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"perception": "eyes"}, "'eyes'"),
        ({"segmenter": "oracle:split=3"}, "split 0..1"),
        ({"segmenter": "sam:/no/such.onnx"}, "/no/such.onnx"),
        ({"encoder": "sam:/no/such.onnx"}, "is no encoder"),
        ({"stop_confidence": 1.5}, "stop_confidence is 1.5"),
    ],
)
def test_a_bad_spec_is_refused_before_a_home_is_loaded(tmp_path, toy_specs, monkeypatch, chosen, message):
    monkeypatch.setattr("openmap_eval.runner.make_env", lambda *_: pytest.fail("an environment was made"))
    with pytest.raises(ValueError, match=message):
        run("openmap", tmp_path / "out", toy_specs, **chosen)
    assert not (tmp_path / "out").exists()


def test_one_seed_gives_one_result(tmp_path, toy_specs):
    for name in ("a", "b"):
        run("random", tmp_path / name, toy_specs, protocol="navigation", seed=3)
    timeless = [[{k: v for k, v in line.items() if k != "seconds"} for line in lines(tmp_path / name)] for name in "ab"]
    assert timeless[0] == timeless[1]


@pytest.mark.parametrize(
    ("chosen", "says"),
    [
        ({"agent": "oracle"}, "the agent reads the answers"),
        ({"agent": "oracle_map"}, "map comes from the simulator, not"),
        ({"perception": "oracle"}, "masks and names come from the simulator, not"),
        ({"perception": "oracle:drop=.1"}, "masks and names come from the simulator (noise: drop=.1), not"),
        ({"segmenter": "oracle"}, "masks come from the simulator, not"),
        ({"encoder": "oracle:names=.5"}, "names (noise: names=.5) come from the simulator, not"),
        ({"segmenter": "oracle:split=.2", "encoder": "oracle"}, "masks (noise: split=.2) and names come from"),
        ({}, ""),
        ({"perception": "oracle", "segmenter": "embedded", "encoder": "embedded"}, ""),
    ],
)
def test_a_page_with_an_oracle_in_it_says_so(tmp_path, toy_specs, chosen, says):
    summary = run("stand_still", tmp_path, toy_specs)
    summary["settings"] = described(settings(**chosen))
    write_report(tmp_path / "report.html", summary, [])
    page = (tmp_path / "report.html").read_text()
    assert ("<title>ORACLE" in page) == bool(says)
    assert says in page


def test_whatever_an_oracle_had_a_part_in_says_so_and_its_map_is_asked_in_its_own_words(
    tmp_path, toy_specs, capsys, monkeypatch
):
    monkeypatch.setattr("openmap_agents.perception.text.TextEncoder", Letters)
    noise = "oracle:drop=.1,features=.2"
    size = ["--width", "64", "--height", "48", "--max-steps", "12", "--episodes", "3"]
    main(["eval", "--scene", toy_specs[0], "--out", str(tmp_path), "--perception", noise, *size])
    shown = capsys.readouterr().out
    assert "ORACLE · What was asked" in shown
    assert "ORACLE: masks and names" in shown
    kept = json.loads((tmp_path / "summary.json").read_text())["settings"]
    assert (kept["segmenter"], kept["encoder"]) == (noise, noise)
    pictures = json.loads((tmp_path / "pictures.json").read_text())
    captions = [*pictures["maps"], *pictures["heatmaps"]]
    assert len(captions) > 1
    assert all(caption.startswith("ORACLE") for caption in captions)
    path = next(tmp_path.glob("*.map.npz"))
    assert InstanceMap.load(path).encoder == noise

    main(["query", str(path), "a chair"])
    assert "ORACLE · “a chair”" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["query", str(path), "a chair", "--encoder", "embedded"])
    assert "features of the encoder 'oracle:drop=.1" in capsys.readouterr().out.replace("\n", " ")


def test_pictures_of_an_oracle_have_it_in_their_corner(tmp_path):
    from openmap_eval.gallery import Gallery

    blank = np.full((40, 120, 3), 250, np.uint8)
    told, seen = (Gallery(tmp_path, oracle)._write(f"{oracle}.png", blank) for oracle in (True, False))
    assert (np.asarray(Image.open(seen)) == blank).all()
    assert (np.asarray(Image.open(told))[:20, :60] != blank[:20, :60]).any()


def test_the_page_shows_no_markup_of_its_episodes(tmp_path, toy_specs):
    from dataclasses import replace

    from openmap_eval.records import RecordFile

    summary = run("stand_still", tmp_path, toy_specs)
    hostile = [
        replace(r, instruction="<script>alert(1)</script>") for r in RecordFile(tmp_path / "episodes.jsonl").records
    ]
    write_report(tmp_path / "report.html", summary, hostile)
    page = (tmp_path / "report.html").read_text()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_the_command_line_runs_it(tmp_path, toy_specs, capsys):
    main(
        [
            "eval",
            "--scene",
            toy_specs[0],
            "--episodes",
            "3",
            "--agent",
            "random",
            "--out",
            str(tmp_path),
            "--width",
            "64",
            "--height",
            "48",
            "--max-steps",
            "20",
        ]
    )
    assert len(lines(tmp_path)) == 3
    assert (tmp_path / "report.html").exists()
    assert "SR_16" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--scene", "nonsense:1"], "nonsense"),
        ([], "--scene"),
        (["--scene", "toy:0", "--agent", "nobody"], "nobody"),
        (["--scene", "toy:0", "--episodes", "0"], "at least one"),
        (["--scene", "toy:0", "--episodes", "missing.jsonl"], "missing.jsonl"),
    ],
)
def test_bad_input_ends_in_one_message(tmp_path, toy_specs, capsys, arguments, says):
    with pytest.raises(SystemExit) as stopped:
        main(["eval", *arguments, "--out", str(tmp_path / "out")])
    assert stopped.value.code == 2
    assert says in capsys.readouterr().out


def test_what_a_resumed_run_adds_is_what_an_unbroken_one_has(tmp_path, toy_specs):
    run("random", tmp_path / "whole", toy_specs, protocol="navigation", episodes=6)
    run("random", tmp_path / "cut", toy_specs, protocol="navigation", episodes=6)
    path = tmp_path / "cut" / "episodes.jsonl"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:2]))
    run("random", tmp_path / "cut", toy_specs, protocol="navigation", episodes=6)
    timeless = [
        [{k: v for k, v in line.items() if k != "seconds"} for line in lines(tmp_path / n)] for n in ("whole", "cut")
    ]
    assert timeless[0] == timeless[1]


def test_other_episodes_do_not_mix_with_what_is_there(tmp_path, toy_specs):
    run("random", tmp_path, toy_specs, episodes=3)
    with pytest.raises(DataError, match="tasks"):
        run("random", tmp_path, toy_specs, episodes=4)


def test_a_refused_run_leaves_its_folder_free(tmp_path, toy_specs):
    with pytest.raises(ValueError, match="nobody"):
        run("nobody", tmp_path, toy_specs)
    run("random", tmp_path, toy_specs)
