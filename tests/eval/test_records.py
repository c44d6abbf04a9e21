"""Records survive kills, refuse strangers, and add up to the figures that are reported."""

from __future__ import annotations

import json

import pytest

from openmap_eval.records import EpisodeRecord, RecordFile
from openmap_eval.summary import summarise
from openmap_scenes import DataError


def record(number: int, scene: str = "toy:0", kind: str = "demand", **metrics: float | None) -> EpisodeRecord:
    return EpisodeRecord(str(number), scene, "I am thirsty", kind, {"sr_1": 1.0, **metrics}, 0.5)


def test_what_was_appended_is_read_back(tmp_path):
    first = RecordFile(tmp_path / "episodes.jsonl")
    for n in range(3):
        first.append(record(n, distance_to_goal=None))
    again = RecordFile(tmp_path / "episodes.jsonl")
    assert again.records == first.records
    assert again.done == {("toy:0", "0"), ("toy:0", "1"), ("toy:0", "2")}


@pytest.mark.parametrize("cut", [1, 10, 40])
def test_a_line_cut_short_by_a_kill_is_dropped_and_written_anew(tmp_path, cut):
    path = tmp_path / "episodes.jsonl"
    for n in range(2):
        RecordFile(path).append(record(n))
    whole = path.read_bytes()
    path.write_bytes(whole[:-cut])
    recovered = RecordFile(path)
    assert [r.episode_id for r in recovered.records] == ["0"]
    recovered.append(record(1))
    assert path.read_bytes() == whole


def test_a_file_of_something_else_is_named(tmp_path):
    path = tmp_path / "episodes.jsonl"
    path.write_text('{"some": "thing"}\n')
    with pytest.raises(DataError, match=r"episodes\.jsonl, line 1"):
        RecordFile(path)


def test_infinite_numbers_never_reach_the_file(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        RecordFile(tmp_path / "episodes.jsonl").append(record(0, distance_to_goal=float("inf")))
    assert not (tmp_path / "episodes.jsonl").exists()


def test_means_are_taken_over_all_and_by_kind():
    records = [
        record(0, kind="demand", sr_1=1.0),
        record(1, kind="demand", sr_1=0.0),
        record(2, kind="object_goal", sr_1=1.0),
    ]
    summary = summarise(records)
    assert summary["all"]["sr_1"]["mean"] == pytest.approx(2 / 3)
    assert summary["by_kind"]["demand"]["sr_1"]["mean"] == 0.5
    assert summary["by_kind"]["object_goal"]["episodes"] == 1
    assert 0.0 <= summary["all"]["sr_1"]["low"] <= 2 / 3 <= summary["all"]["sr_1"]["high"] <= 1.0


def test_a_measure_without_a_number_is_left_out_of_its_mean():
    summary = summarise([record(0, distance_to_goal=None), record(1, distance_to_goal=3.0)])
    assert summary["all"]["distance_to_goal"]["mean"] == 3.0


def test_intervals_resample_scenes_where_there_are_several():
    # Two scenes, one all hits, one all misses: resampled means are 0, .5 or 1, whatever the number of episodes.
    records = [record(n, scene=s, sr_1=float(s == "a")) for s in "ab" for n in range(50)]
    interval = summarise(records)["all"]["sr_1"]
    assert (interval["low"], interval["high"]) == (0.0, 1.0)


def test_the_same_records_give_the_same_summary():
    records = [record(n, sr_1=float(n % 3 == 0)) for n in range(20)]
    assert json.dumps(summarise(records, seed=0)) == json.dumps(summarise(records, seed=0))
