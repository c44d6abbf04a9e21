"""The benchmark of maps: that ratios are of the right frames, and that every process measures."""

from __future__ import annotations

import pytest

from openmap_eval.bench import Map
from openmap_eval.bench.map import measure
from openmap_eval.bench.map_table import summary_of_walk, tables


def found(cpu: list[float], used: list[bool]) -> dict[str, object]:
    rest = dict.fromkeys(("asked", "finalize_seconds", "cpu_seconds", "instances", "voxels", "before_mib", "peak_mib"))
    return {"cpu_ms": cpu, "wall_ms": [2 * ms for ms in cpu], "used": used, **rest}


def test_late_over_early_is_of_medians_of_the_first_and_last_frames() -> None:
    # 1 to 4 ms early, 10 to 40 late; of each stretch the second and the fourth frame are used.
    cpu = [1.0, 2.0, 3.0, 4.0, 100.0, 100.0, 10.0, 20.0, 30.0, 40.0]
    used = [False, True, False, True, True, False, False, True, False, True]
    summary = summary_of_walk(found(cpu, used), 4)
    assert summary["frames_used"] == 5
    assert summary["early"]["frames"] == [1, 4]
    assert summary["late"]["frames"] == [7, 10]
    assert summary["early"]["cpu"]["median"] == 2.5
    assert summary["late"]["cpu_of_used"]["median"] == 30.0
    assert summary["late over early"] == {"wall": 10.0, "cpu": 10.0, "wall_of_used": 10.0, "cpu_of_used": 10.0}
    assert [p["frames"] for p in summary["stretches"]] == [[1, 4], [5, 8], [9, 10]]


def test_a_stretch_that_used_nothing_has_no_ratio() -> None:
    summary = summary_of_walk(found([1.0, 1.0, 2.0, 2.0], [True, True, False, False]), 2)
    assert summary["late over early"]["cpu"] == 2.0
    assert summary["late over early"]["cpu_of_used"] is None
    assert summary["late"]["used"] == 0


def test_settings_that_cannot_be_measured_with_are_named(toy_specs: list[str]) -> None:
    with pytest.raises(ValueError, match="a window of 30; expected at most half of the 50 frames"):
        measure(Map(toy_specs[0], frames=50, window=30))
    with pytest.raises(ValueError, match="0 threads; expected 1 or more"):
        measure(Map(toy_specs[0], threads=0))


def test_everything_is_measured(toy_specs: list[str]) -> None:
    result = measure(
        Map(
            toy_specs[0], frames=24, window=8, ask_every=8, job_frames=10, reference_frames=4,
            features="good", width=96, height=72,
        )
    )  # fmt: skip
    walk = result["long walk"]
    assert walk["frames"] == 24
    assert [row["after"] for row in walk["asked"]] == [8, 16]
    assert 0 < walk["frames_used"] <= 24
    assert 0 < walk["before_mib"] <= walk["peak_mib"]
    assert walk["instances"] > 5
    assert set(result["one round"]) == {
        "mapper, soft", "mapper, paper", "MaskClustering, as published", "MaskClustering, without its fault",
    }  # fmt: skip
    assert all(row["cpu_seconds"] > 0 and row["instances"] > 0 for row in result["one round"].values())
    assert result["small"]["reference"]["instances"] == result["small"]["mapper"]["instances"]
    assert "path" not in str(result["settings"])
    assert len(tables(result)) == 4
