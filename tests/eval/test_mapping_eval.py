"""Maps measured: trouble and drawn features are what they say, scores mean something, runs can be stopped and repeated."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from openmap_agents.perception.corruption import TYPICAL, Corruption
from openmap_eval.mapping import jobs, report
from openmap_eval.mapping.command import EvalMapping
from openmap_eval.mapping.inputs import DrawnFeatures, MapperFrame, MaskSpec, scaled
from openmap_eval.mapping.jobs import Job, Store, run_job
from openmap_eval.mapping.noise import Trouble, noisy_depth, troubled, wandering
from openmap_eval.mapping.robustness import CURVES
from openmap_eval.mapping.walks import WalkSpec, open_walk
from openmap_scenes import DataError

QUIET = Console(quiet=True)


def frames_of(n: int) -> list[MapperFrame]:
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 4, (n, 24, 32)).astype(np.float32)
    labels = rng.integers(0, 4, (n, 24, 32)).astype(np.int32)
    return [(depth[k], labels[k], None, np.eye(4)) for k in range(n)]


def test_no_trouble_changes_nothing() -> None:
    before = frames_of(4)
    after = list(troubled(before, 4, Trouble(), 0))
    for old, new in zip(before, after, strict=True):
        np.testing.assert_array_equal(old[0], new[0])
        np.testing.assert_array_equal(old[1], new[1])
        np.testing.assert_array_equal(old[3], new[3])


def test_depth_errors_grow_with_the_square_of_depth() -> None:
    rng = np.random.default_rng(0)
    errors = [noisy_depth(np.full((200, 300), d, np.float32), 0.002, 0.0, rng) - d for d in (1.0, 2.0, 4.0)]
    found = [float(e.std()) for e in errors]
    np.testing.assert_allclose(found, [0.002, 0.008, 0.032], rtol=0.05)


def test_holes_take_their_share_and_nothing_fills_what_was_empty() -> None:
    depth = np.full((120, 160), 2.0, np.float32)
    depth[:30] = 0
    out = noisy_depth(depth, 0.01, 0.2, np.random.default_rng(1))
    assert not out[:30].any()
    assert 0.1 < float((out[30:] == 0).mean()) < 0.3
    assert (out[out > 0] > 0.5).all()


def test_a_drift_starts_at_nothing_and_ends_as_far_as_it_says() -> None:
    ends = []
    for seed in range(200):
        errors = wandering(30, 0.1, 2.0, np.random.default_rng(seed))
        np.testing.assert_array_equal(errors[0], np.eye(4))
        np.testing.assert_allclose(errors[-1, :3, :3] @ errors[-1, :3, :3].T, np.eye(3), atol=1e-9)
        ends.append(errors[-1, :3, 3])
    assert 0.085 < float(np.std(ends)) < 0.115


def test_kinds_of_trouble_do_not_disturb_each_other() -> None:
    both = Trouble(depth_sigma=0.01, drift=0.1, keep_every=2)
    alone = Trouble(drift=0.1)
    some, every = list(troubled(frames_of(6), 6, both, 5)), list(troubled(frames_of(6), 6, alone, 5))
    assert len(some) == 3
    for a, b in zip(some, every[::2], strict=True):
        np.testing.assert_array_equal(a[3], b[3])
    shuffled = list(troubled(frames_of(6), 6, replace(alone, shuffle=1), 5))
    assert sorted(f[0].tobytes() for f in shuffled) == sorted(f[0].tobytes() for f in every)
    assert [f[0].tobytes() for f in shuffled] != [f[0].tobytes() for f in every]
    for wrong in ({"holes": 1.0}, {"keep_every": 0}, {"drift": -0.1}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            Trouble(**wrong)  # type: ignore[arg-type]


def test_strength_scales_what_corrupts() -> None:
    assert scaled(1.0) == TYPICAL
    half, double = scaled(0.5), scaled(2.0)
    assert (half.warp, half.drop, half.split_structure) == (1.0, 0.05, 0.5)
    assert (double.grow, double.merge, double.split_structure) == (8.0, 0.24, 1.0)
    none = scaled(0.0)
    names = ("warp", "merge", "drop", "split", "split_structure", "spurious", "grow")
    assert all(getattr(none, name) == getattr(Corruption(), name) for name in names)


@pytest.mark.parametrize(("kind", "within", "between"), [("good", 0.8, 0.0), ("poor", 0.8, 0.7)])
def test_drawn_features_know_categories_as_well_as_they_should(kind: str, within: float, between: float) -> None:
    draw = DrawnFeatures(kind, {1: "chair", 2: "chair", 3: "lamp"}, 4)  # type: ignore[arg-type]
    rows = np.array([[1, 1, 50], [2, 2, 70], [3, 3, 20], [4, 1, 10], [4, 3, 10]])
    same, other, half = [], [], []
    for frame in range(300):
        f = draw(rows, 4, frame).astype(np.float64)
        np.testing.assert_allclose(np.linalg.norm(f, axis=1), 1, atol=1e-6)
        same.append(f[0] @ f[1])
        other.append(f[0] @ f[2])
        half.append(f[0] @ f[3])
    assert abs(np.mean(same) - within) < 0.03
    # Directions of categories are random, not orthogonal.
    assert abs(np.mean(other) - between) < 0.25
    assert np.mean(other) < np.mean(half) < np.mean(same)
    np.testing.assert_array_equal(draw(rows, 4, 7), draw(rows, 4, 7))


TOY = {"frames": 40, "width": 128, "height": 96}


def walk_spec(toy_specs: list[str], **more: int) -> WalkSpec:
    return WalkSpec(toy_specs[0], **{**TOY, **more})  # type: ignore[arg-type]


def test_scores_fall_with_drift_and_with_worse_masks(toy_specs: list[str]) -> None:
    base = Job(walk_spec(toy_specs), MaskSpec())
    good = run_job(base)
    assert good["ap50"] > 0.6
    assert good["ap"] <= good["ap50"] <= good["ap25"] <= 1
    drifted = run_job(replace(base, trouble=Trouble(drift=0.5, drift_deg=10.0)))
    assert drifted["ap"] < good["ap"] - 0.2
    assert run_job(replace(base, masks=MaskSpec(strength=2.0)))["ap"] < good["ap"] - 0.2


def test_features_alone_do_worse_when_they_are_poor(toy_specs: list[str]) -> None:
    base = Job(walk_spec(toy_specs), MaskSpec(strength=1.0), "good", semantics="alone")
    good, poor = run_job(base), run_job(replace(base, features="poor"))
    assert poor["ap"] < good["ap"]
    with pytest.raises(ValueError, match="no features of their own"):
        run_job(replace(base, features="own"))


def test_the_truth_of_a_piece_of_a_walk_is_what_it_shows(toy_specs: list[str]) -> None:
    whole, piece = walk_spec(toy_specs), walk_spec(toy_specs, first=3, step=2)
    walk = open_walk(piece)
    assert (len(walk), walk.camera.width, walk.camera.height) == (3, 64, 48)
    frame, full = walk.read(1), open_walk(whole).read(1)
    np.testing.assert_array_equal(frame.depth, full.depth[::2, ::2])
    # The same pixel is the same point, whatever its number.
    np.testing.assert_allclose(
        walk.camera.unproject(frame.depth, frame.T_world_camera),
        open_walk(whole).camera.unproject(full.depth, full.T_world_camera)[::2, ::2],
        atol=1e-5,
    )
    assert 0 < len(jobs.truth_of(walk, piece)) < len(jobs.truth_of(open_walk(whole), whole))


def command(out: Path, toy_specs: list[str], **more: object) -> EvalMapping:
    given = {"scene": (toy_specs[0],), "masks": ("perfect", "corrupted"), **TOY, **more}
    return EvalMapping(out, **given)  # type: ignore[arg-type]


def test_the_table_repeats_resumes_and_holds_the_reference_against_the_mapper(
    toy_specs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = command(tmp_path / "a", toy_specs, part=("table",), frames=24, width=96, height=72)
    report.run_eval_mapping(first, QUIET)
    found = json.loads((tmp_path / "a" / "mapping.json").read_text())
    assert {(r["features"], r["semantics"]) for r in found["table"]} == {
        ("none", "structural"),
        *((f, s) for f in ("good", "poor") for s in ("alone", "product", "calibrated")),
    }
    assert len(found["table"]) == 2 * 7 * 2
    assert found["reference"]
    assert all(r["same"] and r["ap"] == r["fast_ap"] for r in found["reference"])
    ap = {(r["masks"], r["consensus"], r["semantics"], r["features"]): r["ap"] for r in found["table"]}
    for consensus in ("soft", "paper"):
        assert ap["perfect", consensus, "structural", "none"] > ap["corrupted", consensus, "structural", "none"]
    page = (tmp_path / "a" / "mapping.html").read_text()
    assert "Do both together beat each alone?" in page
    assert "12.2" in page

    # Half of the results and a line that a kill cut short: only the rest is made, and comes out the same.
    kept = (tmp_path / "a" / "scores.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "scores.jsonl").write_text("".join(kept[: len(kept) // 2]) + kept[-1][:40])
    made: list[Job] = []

    def counted(job: Job) -> jobs.Result:
        made.append(job)
        return run_job(job)

    monkeypatch.setattr(jobs, "run_job", counted)
    report.run_eval_mapping(replace(first, out=tmp_path / "b"), QUIET)
    assert len(made) == len(kept) - len(kept) // 2
    assert (tmp_path / "a" / "mapping.json").read_bytes() == (tmp_path / "b" / "mapping.json").read_bytes()


def test_quick_curves_are_drawn(toy_specs: list[str], tmp_path: Path) -> None:
    out = command(tmp_path, toy_specs, part=("robustness",), quick=True, width=160, height=120, frames=48)
    report.run_eval_mapping(out, QUIET)
    found = json.loads((tmp_path / "mapping.json").read_text())
    assert {r["curve"] for r in found["robustness"]} == set(CURVES)
    assert (tmp_path / "robustness.png").read_bytes().startswith(b"\x89PNG")
    assert "data:image/png;base64," in (tmp_path / "mapping.html").read_text()
    for consensus in ("soft", "paper"):
        first = {
            r["curve"]: r["ap"]
            for r in reversed(found["robustness"])
            if r["consensus"] == consensus and r["curve"] != "mask corruption"
        }
        assert len(set(first.values())) == 1, "every curve starts at the same map"


def test_results_of_other_code_are_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = Job(WalkSpec("homes:val/0"), MaskSpec())
    store = Store(tmp_path / "scores.jsonl")
    store.add(job, {"ap": 0.5})
    assert Store(tmp_path / "scores.jsonl")[job] == {"ap": 0.5}
    assert replace(job, seed=1) not in Store(tmp_path / "scores.jsonl")
    monkeypatch.setattr(jobs, "code_digest", lambda: "other")
    assert job not in Store(tmp_path / "scores.jsonl")
    (tmp_path / "scores.jsonl").write_text("nothing\n")
    with pytest.raises(DataError, match="line 1, no result"):
        Store(tmp_path / "scores.jsonl")


def test_command_lines_that_make_no_sense_are_named(tmp_path: Path) -> None:
    for wrong, found in (
        ({"frames": 0}, "--frames"),
        ({"scene": ("homes:val/0", "homes:val/0")}, "twice"),
        ({"recording": (tmp_path,)}, "instance-filt"),
    ):
        with pytest.raises(DataError, match=found):
            report.run_eval_mapping(EvalMapping(tmp_path / "out", **wrong), QUIET)  # type: ignore[arg-type]


def test_a_recordings_pictures_and_mesh_agree(shared_scenes: Path) -> None:
    walk = open_walk(WalkSpec(str(shared_scenes / "scannet" / "scene0900_00"), "recording", every=20, step=8))
    from scipy.spatial import cKDTree

    cloud = walk.make_cloud()
    things = set(np.unique(cloud.instance[cloud.category > 0]).tolist())
    assert things
    assert not things & set(walk.structure)
    frame = walk.read(1)
    seen = (frame.depth > 0) & (frame.instance > 0)
    points = walk.camera.unproject(frame.depth, frame.T_world_camera)[seen]
    gap, nearest = cKDTree(cloud.points).query(points)
    assert float(np.median(gap)) < 0.03
    assert float((cloud.instance[nearest] == frame.instance[seen])[gap < 0.05].mean()) > 0.95
