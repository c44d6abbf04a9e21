"""Every failure has the stage that lost its target, each stage is told from the next, and nobody's answers change for it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from openmap_agents.agent import Answer
from openmap_agents.mapping import MapInstance
from openmap_env.episodes import Target
from openmap_eval.attribution import Attribution, AttributionSettings, Sights
from openmap_eval.console import print_answers, print_losses, print_summary
from openmap_eval.records import STAGES, EpisodeRecord, RecordFile
from openmap_eval.report import write_report
from openmap_eval.runner import EvalSettings, SceneTask, described, evaluate, make_env, run_scene
from openmap_eval.summary import summarise

SIZE = EvalSettings(width=64, height=48, max_steps=40, perception="oracle")


class Letters:
    """A text encoder that takes no time: the letters of a text are its vector."""

    dim = 26

    def encode_text(self, texts: list[str]) -> np.ndarray:
        counts = np.array([[text.lower().count(chr(97 + k)) for k in range(26)] for text in texts], np.float32) + 1e-3
        return counts / np.linalg.norm(counts, axis=1, keepdims=True)


@pytest.fixture(autouse=True)
def _letters(monkeypatch):
    monkeypatch.setattr("openmap_agents.perception.text.TextEncoder", Letters)


def read(folder) -> list[dict]:
    return [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]


def without(records: list[dict], *names: str) -> list[dict]:
    """Records without what a clock or the attribution put into them."""
    for record in records:
        for name in ("seconds", *names):
            del record[name]
        record["trace"].pop("milliseconds", None)
    return records


def test_what_a_keyframe_shows_is_counted_by_hand():
    sights = Sights.none(5, enough=2)
    labels = np.array([[1, 1, 0], [1, 2, 2]], np.int32)
    ids = np.array([[3, 3, 3], [4, 4, 1]], np.int32)
    sights.add(0, labels, ids)
    assert sights.pixels.tolist() == [0, 1, 0, 3, 2]
    # Thing 3: two pixels of mask 1 (three pixels) and one outside: 2 of 4. Thing 4: one of mask 2, 1 of 3. Thing 1: too small.
    np.testing.assert_allclose(sights.iou, [0, 0, 0, 0.5, 1 / 3])
    sights.add(1, np.zeros((2, 3), np.int32), np.full((2, 3), 4, np.int32))
    assert sights.pixels[4] == 6
    views = np.array([[0, 1, 3], [0, 2, 2], [7, 1, 1]], np.int32)
    made_of = sights.made_of(MapInstance(1, np.zeros((1, 3), np.float32), None, views=views))
    assert made_of.tolist() == [0, 1, 0, 2, 2]


@pytest.mark.parametrize("protocol", ["retrieval", "navigation"])
def test_answers_are_the_same_with_and_without(tmp_path, toy_specs, protocol):
    settings = replace(SIZE, protocol=protocol, max_steps=24)
    for name, on in (("with", True), ("without", False)):
        evaluate([SceneTask(toy_specs[0], 4)], settings, tmp_path / name, attribution=on)
    told, untold = read(tmp_path / "with"), read(tmp_path / "without")
    assert all(r["lost_at"] is None and r["evidence"] == {} for r in untold)
    for record in told:
        failed = record["metrics"]["sr_1"] == 0 or (protocol == "navigation" and record["metrics"]["nav_success"] == 0)
        assert (record["lost_at"] in STAGES) if failed else (record["lost_at"] is None)
    assert without(told, "lost_at", "evidence") == without(untold, "lost_at", "evidence")


def test_a_run_that_goes_on_attributes_as_one_that_was_not_stopped(tmp_path, toy_specs):
    for name in ("whole", "cut"):
        evaluate([SceneTask(toy_specs[0], 6)], replace(SIZE, max_steps=6), tmp_path / name)
        path = tmp_path / name / "episodes.jsonl"
        if name == "cut":
            path.write_text("".join(path.read_text().splitlines(keepends=True)[:2]))
            evaluate([SceneTask(toy_specs[0], 6)], replace(SIZE, max_steps=6), tmp_path / name)
    whole = without(read(tmp_path / "whole"))
    assert any(record["lost_at"] == "exploration" for record in whole)
    assert without(read(tmp_path / "cut")) == whole


@pytest.fixture(scope="module")
def walked(toy_specs):
    """An environment whose home was explored, the agent that did it and the observer that watched."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("openmap_agents.perception.text.TextEncoder", Letters)
        settings = replace(SIZE, max_steps=200)
        env = make_env(SceneTask(toy_specs[0], 1), settings)
        env.reset(seed=0)
        from openmap_agents import make_agent

        agent, witness = make_agent("openmap", env, perception="oracle"), Attribution()
        episodes = env.unwrapped.episodes[:1]
        for _ in run_scene(env, agent, episodes, episodes[0], settings, witness=witness):
            pass
        yield env.unwrapped, agent, witness
        env.close()


MISSED, REACHED = {"sr_1": 0.0, "nav_success": 0.0}, {"sr_1": 1.0, "nav_success": 0.0, "distance_to_goal": np.inf}


def loss(walked, category: str, candidates=(), monkeypatch=None, metrics=MISSED, answered=True, only=0, **settings):
    """Where the things of a category were lost, by an observer that had other settings."""
    env, agent, witness = walked
    things = [i for i in env.simulator.scene.instances if i.category == category and only in (0, i.id)]
    targets = tuple(Target(i.id, tuple(i.centre), tuple(i.aabb_min), tuple(i.aabb_max)) for i in things)
    monkeypatch.setattr(env, "_episode", replace(env.episode, targets=targets))
    asked = Attribution(AttributionSettings(**settings))
    asked._sights = witness._sights
    trace = {"candidates": [{"id": i} for i in candidates], "choice": None, "ranking": list(candidates)}
    return asked.lost_at(env, agent, metrics, Answer(np.zeros((0, 3), np.float32), [], trace) if answered else None)


def test_each_stage_is_told_from_the_next(walked, monkeypatch):
    env, agent, witness = walked
    stage, evidence = loss(walked, "refrigerator", monkeypatch=monkeypatch)
    assert stage == "parse", evidence
    (found,) = evidence["instances"]
    centre = agent.instance_map.get(found).centre
    true = next(i for i in env.simulator.scene.instances if i.category == "refrigerator")
    place = env.T_world_episode[:3, :3] @ centre + env.T_world_episode[:3, 3]
    assert np.linalg.norm(place - true.centre) <= 1.0
    assert evidence["rank_by_name"] == 1

    assert loss(walked, "refrigerator", [found], monkeypatch)[0] == "selection"
    assert loss(walked, "refrigerator", [], monkeypatch, answered=False)[0] == "navigation"
    for changed, expected in (
        ({"min_purity": 1.1}, "association"),
        ({"radius": 0.0}, "association"),
        ({"min_iou": 1.1}, "segmentation"),
    ):
        assert loss(walked, "refrigerator", [found], monkeypatch, **changed)[0] == expected
    monkeypatch.setattr(witness._sights, "enough", 10**6)
    assert loss(walked, "refrigerator", [found], monkeypatch)[0] == "exploration"


def test_a_feature_is_to_blame_when_others_are_more_like_the_name(walked, monkeypatch):
    _, agent, _ = walked
    _, evidence = loss(walked, "refrigerator", monkeypatch=monkeypatch)
    (found,) = evidence["instances"]
    elsewhere = agent.encoder.encode_text(["zzzz"])[0]
    wrong = [replace(i, feature=elsewhere) if i.id == found else i for i in agent.instance_map]
    monkeypatch.setattr(agent, "_final", replace(agent.instance_map, instances=wrong))
    stage, evidence = loss(walked, "refrigerator", [found], monkeypatch)
    assert stage == "feature"
    assert evidence["rank_by_name"] > agent.grounder.settings.n_candidates


def test_things_of_the_same_name_do_not_count_against_each_other(walked, monkeypatch):
    env, agent, _ = walked
    monkeypatch.setattr(agent.grounder, "settings", replace(agent.grounder.settings, n_candidates=1))
    chairs = [i.id for i in env.simulator.scene.instances if i.category == "armchair"]
    assert len(chairs) == 2
    for chair in chairs:
        stage, evidence = loss(walked, "armchair", monkeypatch=monkeypatch, only=chair)
        assert (stage, evidence["rank_by_name"]) == ("parse", 1)


def test_the_target_that_got_farthest_counts(walked, monkeypatch):
    env, _, witness = walked
    chairs = [i.id for i in env.simulator.scene.instances if i.category == "armchair"]
    pixels = witness._sights.pixels.copy()
    for hidden in chairs:
        monkeypatch.setattr(witness._sights, "pixels", np.where(np.arange(len(pixels)) == hidden, 0, pixels))
        stage, evidence = loss(walked, "armchair", monkeypatch=monkeypatch)
        assert stage == "parse"
        assert evidence["target"] != hidden


def test_a_place_that_is_no_thing_is_lost_with_what_the_map_has_there(walked, monkeypatch):
    env, agent, witness = walked
    fridge = next(i for i in env.simulator.scene.instances if i.category == "refrigerator")
    for place, expected in ((fridge.centre, "parse"), (fridge.centre + 50.0, "association")):
        target = Target(0, tuple(place), tuple(place), tuple(place))
        monkeypatch.setattr(env, "_episode", replace(env.episode, targets=(target,)))
        asked = Attribution()
        asked._sights = witness._sights
        answer = Answer(np.zeros((0, 3), np.float32), [], {"candidates": [], "ranking": []})
        stage, evidence = asked.lost_at(env, agent, MISSED, answer)
        assert (stage, evidence["category"]) == (expected, "place")


def test_a_right_answer_is_only_lost_on_the_way(walked, monkeypatch):
    assert loss(walked, "refrigerator", monkeypatch=monkeypatch, metrics=REACHED) is None
    monkeypatch.setattr(walked[0], "protocol", "navigation")
    assert loss(walked, "refrigerator", monkeypatch=monkeypatch, metrics=REACHED) == (
        "navigation",
        {"stopped_at_m": None},
    )
    assert loss(walked, "refrigerator", monkeypatch=monkeypatch, metrics=REACHED | {"nav_success": 1.0}) is None


def test_the_oracle_map_loses_nothing_before_it_is_asked(tmp_path, toy_specs):
    evaluate([SceneTask(toy_specs[0], 24)], replace(SIZE, agent="oracle_map"), tmp_path)
    lost = {record["lost_at"] for record in read(tmp_path)}
    assert lost <= {None, "feature", "parse", "selection"}


def test_who_has_no_map_is_not_attributed(tmp_path, toy_specs):
    summary = evaluate([SceneTask(toy_specs[0], 4)], replace(SIZE, agent="stand_still"), tmp_path)
    assert {record["lost_at"] for record in read(tmp_path)} == {None}
    assert summary["lost_at"]["all"]["unknown"] > 0
    console = Console(record=True, width=120)
    print_losses(console, summary)
    assert console.export_text() == ""


def record(number: int, lost: str | None, kind: str = "demand", **more) -> EpisodeRecord:
    missed = {f"sr_{k}": float(lost is None) for k in (1, 4, 8, 16)} | {"sr_surface_1": 0.0}
    return EpisodeRecord(str(number), "toy:0", "I am thirsty", kind, missed, 0.5, lost_at=lost, **more)


def summary_of(records):
    return {"settings": described(SIZE), **summarise(records)}


def test_stages_are_counted_by_kind_and_printed_in_a_pipe():
    records = [record(0, "parse"), record(1, "parse"), record(2, None), record(3, "exploration", kind="object_goal")]
    summary = summary_of(records)
    assert summary["lost_at"]["all"] == {**dict.fromkeys(STAGES, 0), "parse": 2, "exploration": 1}
    assert summary["lost_at"]["by_kind"]["demand"]["parse"] == 2
    assert summary["intervals_over"] == "episodes"
    assert summary["all"]["sr_1"]["over"] == "episodes"
    other = replace(record(4, None), scene="toy:1")
    assert summarise([*records, other])["intervals_over"] == "scenes"
    console = Console(record=True, width=120, force_terminal=False)
    print_summary(console, summary)
    lines = console.export_text().splitlines()
    assert any("parse" in line and " 2 " in line for line in lines)
    assert any("2 of 3" in line and "3 of 4" in line for line in lines)


def test_records_from_before_are_read_and_shown(tmp_path):
    old = {
        "episode_id": "0",
        "scene": "toy:0",
        "instruction": "x",
        "kind": "demand",
        "metrics": {"sr_1": 0.0},
        "seconds": 1,
    }
    (tmp_path / "episodes.jsonl").write_text(json.dumps(old) + "\n")
    records = RecordFile(tmp_path / "episodes.jsonl").records
    summary = summary_of(records)
    assert summary["lost_at"]["all"]["unknown"] == 1
    del summary["lost_at"], summary["intervals_over"]
    write_report(tmp_path / "report.html", summary, records)
    assert "What was lost where" not in (tmp_path / "report.html").read_text()


HOSTILE = "<script>alert(1)</script>[/red]"


def test_the_page_shows_what_was_lost_and_how_an_answer_came_about_as_text(tmp_path):
    trace = {
        "backend": HOSTILE,
        "choice": 3,
        "confidence": 0.5,
        "milliseconds": {"parse": 1.25},
        "description": {"target": HOSTILE},
        "fallbacks": [{"step": "select", "to": "builtin", "because": HOSTILE}],
        "llm_calls": [
            {
                "purpose": "parse",
                "messages": [{"role": "user", "content": "the question " + HOSTILE}],
                "reply": "the reply",
            },
            {"purpose": "select", "error": "the error " + HOSTILE, HOSTILE: HOSTILE},
        ],
        "candidates": [
            {"id": 3, "label": "vase " + HOSTILE, "score": 0.5, "neighbours": [{"label": HOSTILE}]},
            {"id": 4},
        ],
    }
    records = [
        record(
            0, "parse", trace=trace, evidence={HOSTILE: HOSTILE}, answer=[{"position": [0, 0, 0], "label": HOSTILE}]
        ),
        record(1, "selection", trace={"candidates": 3, "llm_calls": [None], "milliseconds": [], "fallbacks": ["x"]}),
    ]
    write_report(tmp_path / "report.html", summary_of(records), records)
    page = (tmp_path / "report.html").read_text()
    assert "<script>" not in page
    for text in (
        "What was lost where",
        "lost at parse",
        "the question",
        "the reply",
        "the error",
        "3 ← chosen",
        "parse 1.2",
    ):
        assert text in page
    console = Console(record=True, width=200)
    print_answers(console, records)
    assert "[/red]" in console.export_text()
