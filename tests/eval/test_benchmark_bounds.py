"""Frozen episodes of a home of the benchmark: who knows everything always succeeds, who does nothing never does."""

from __future__ import annotations

import pytest

from openmap_env.episodes.benchmark import frozen_home
from openmap_env.episodes.source import evenly
from openmap_eval.runner import EvalSettings, SceneTask, evaluate

SPEC = "homes:val/1"
EPISODES = {"oracle": 9, "stand_still": 30}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The summary and the records of both agents."""
    from openmap_eval.records import RecordFile

    found = {}
    for agent, episodes in EPISODES.items():
        out = tmp_path_factory.mktemp(agent)
        settings = EvalSettings(agent=agent, protocol="navigation", width=16, height=12, max_steps=500)
        summary = evaluate([SceneTask(SPEC, episodes)], settings, out)
        found[agent] = summary, RecordFile(out / "episodes.jsonl").records
    return found


def test_the_episodes_are_the_frozen_ones(results):
    for agent, (_, records) in results.items():
        frozen = evenly(frozen_home(SPEC).episodes(), EPISODES[agent])
        assert [(r.episode_id, r.instruction) for r in records] == [(e.episode_id, e.instruction) for e in frozen]


def test_the_oracle_succeeds_in_every_episode(results):
    summary, records = results["oracle"]
    assert {r.episode_id: r.metrics["nav_success"] for r in records if r.metrics["nav_success"] != 1.0} == {}
    assert {r.episode_id: r.metrics["sr_1"] for r in records if r.metrics["sr_1"] != 1.0} == {}
    assert summary["all"]["sr_1"]["mean"] == 1.0
    assert sum(r.metrics["spl"] for r in records) / len(records) >= 0.95


def test_who_stands_still_succeeds_in_none(results):
    _, records = results["stand_still"]
    assert max(r.metrics["nav_success"] for r in records) == 0.0
    assert max(r.metrics["sr_1"] for r in records) == 0.0
