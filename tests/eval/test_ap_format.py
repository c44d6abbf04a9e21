"""Files of the truth: written, read, refused; scenes as labelled clouds; ``openmap ap`` on all of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.perception.prediction_format import PredictedInstance, write_predictions
from openmap_agents.perception.scannet200 import NUMBER_OF
from openmap_eval.ap.format import (
    SPACING,
    cloud_of_scene,
    read_cloud,
    read_proposals,
    read_truth,
    write_cloud,
    write_proposals,
    write_truth,
)
from openmap_eval.ap.protocol import LabelledCloud, Proposal, average_precision
from openmap_eval.cli import main
from openmap_scenes import DataError, Scene, load_scene

CHAIR, TABLE, WALL = NUMBER_OF["chair"], NUMBER_OF["table"], NUMBER_OF["wall"]
VOXEL = 0.05


def two_things() -> LabelledCloud:
    """A chair and a table of 8 x 5 x 5 points, 40 unannotated ones and a wall, a point every 5 cm along x."""
    cells = np.array([[x, y, z] for x in range(24) for y in range(5) for z in range(5)], np.float64)
    points = ((cells + 0.5) * VOXEL).astype(np.float32)
    column = cells[:, 0].astype(int)
    instance = np.choose(np.searchsorted([8, 16, 18], column, side="right"), [7, 3, 0, 9]).astype(np.int32)
    category = np.where(instance == 7, CHAIR, np.where(instance == 3, TABLE, np.where(instance == 9, WALL, 0)))
    return LabelledCloud(points, instance, category.astype(np.int32))


def map_of(truth: LabelledCloud, *, labels: dict[int, str]) -> InstanceMap:
    return InstanceMap(
        [MapInstance(i, truth.points[truth.instance == i], None, label=label) for i, label in sorted(labels.items())],
        VOXEL,
    )


def partition(truth: LabelledCloud) -> set[tuple[int, bytes]]:
    ids = np.unique(truth.instance[(truth.category > 0) & (truth.instance > 0)])
    return {(int(truth.category[truth.instance == i][0]), np.flatnonzero(truth.instance == i).tobytes()) for i in ids}


def test_the_benchmarks_truth_round_trips(tmp_path: Path) -> None:
    truth = two_things()
    write_truth(tmp_path / "scan.txt", truth)
    lines = (tmp_path / "scan.txt").read_text().split()
    assert set(lines) == {f"{CHAIR}001", f"{TABLE}001", f"{WALL}001", "0"}
    read = read_truth(tmp_path / "scan.txt", truth.points)
    np.testing.assert_array_equal(read.points, truth.points)
    # Walls are void in the instance task.
    assert partition(read) == {(c, i) for c, i in partition(truth) if c != WALL}
    assert np.isnan(read_truth(tmp_path / "scan.txt").points).all()
    with pytest.raises(DataError, match="600 lines, expected 3"):
        read_truth(tmp_path / "scan.txt", truth.points[:3])


def test_our_own_truth_round_trips(tmp_path: Path) -> None:
    truth = two_things()
    write_cloud(tmp_path / "scan.npz", truth)
    read = read_cloud(tmp_path / "scan.npz")
    for name in ("points", "instance", "category"):
        np.testing.assert_array_equal(getattr(read, name), getattr(truth, name))


def test_too_many_instances_of_a_label_are_refused(tmp_path: Path) -> None:
    n = 1000
    ids = np.arange(1, n + 1, dtype=np.int32)
    truth = LabelledCloud(np.zeros((n, 3), np.float32), ids, np.full(n, CHAIR, np.int32))
    with pytest.raises(ValueError, match="1000 instances"):
        write_truth(tmp_path / "scan.txt", truth)


@pytest.mark.parametrize("text", ["", "2001\nchair\n", "2001\n-1\n", "2001\n1.5\n", "99999999999\n", "4294967296\n"])
def test_numbers_that_cannot_be_are_one_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "scan.txt").write_text(text)
    with pytest.raises(DataError):
        read_truth(tmp_path / "scan.txt")
    with pytest.raises(DataError, match="no such file"):
        read_truth(tmp_path / "none.txt")


@pytest.mark.parametrize(
    "change",
    [
        {"instance": np.zeros(599, np.int32)},
        {"instance": np.zeros(600, np.float32)},
        {"category": np.full(600, -1)},
        {"category": np.full(600, 2**40)},
        {"points": np.full((600, 3), np.inf)},
    ],
)
def test_clouds_that_cannot_be_are_one_error(tmp_path: Path, change: dict[str, np.ndarray]) -> None:
    truth = two_things()
    arrays = {"points": truth.points, "instance": truth.instance, "category": truth.category} | change
    np.savez(tmp_path / "scan.npz", **arrays)
    with pytest.raises(DataError, match=r"scan\.npz"):
        read_truth(tmp_path / "scan.npz")


def test_coarse_scenes_are_drawn_on(toy_scene: Scene) -> None:
    truth = cloud_of_scene(toy_scene)
    names = {i.id: i.category for i in toy_scene.instances}
    for number in np.unique(truth.instance):
        mine = truth.instance == number
        item = next(i for i in toy_scene.instances if i.id == number)
        size = item.aabb_max - item.aabb_min
        area = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
        assert abs(mine.sum() * SPACING**2 - area) < 0.01 * area + SPACING**2 * 10
        assert (truth.points[mine] >= item.aabb_min - 1e-5).all()
        assert (truth.points[mine] <= item.aabb_max + 1e-5).all()
        # The benchmark has no class for a vase.
        void = names[number] in ("wall", "floor", "vase")
        assert set(truth.category[mine].tolist()) == {0 if void else NUMBER_OF[scannet_name(names[number])]}
    np.testing.assert_array_equal(cloud_of_scene(toy_scene).points, truth.points)


def scannet_name(name: str) -> str:
    return {"corner sofa": "couch"}.get(name, name)


def test_scans_have_their_vertices_for_points(shared_scenes: Path) -> None:
    scan = shared_scenes / "scannet" / "scene0900_00"
    scene = load_scene(f"scannet:{scan}")
    truth = cloud_of_scene(scene)
    np.testing.assert_array_equal(truth.points, scene.vertices)
    segments = json.loads((scan / f"{scan.name}_vh_clean_2.0.010000.segs.json").read_text())["segIndices"]
    groups = json.loads((scan / f"{scan.name}.aggregation.json").read_text())["segGroups"]
    exact = np.zeros(len(truth), np.int32)
    for group in groups:
        exact[np.isin(segments, group["segments"])] = group["objectId"] + 1
    # Faces tell vertices at seams a little differently.
    assert (exact == truth.instance).mean() > 0.995
    number = {i.id: truth.category[truth.instance == i.id][0] for i in scene.instances}
    found = [Proposal(np.flatnonzero(exact == i), 1.0, int(c)) for i, c in number.items() if c]
    scores = average_precision([(found, truth)], class_agnostic=False)
    assert scores.ap == 1.0
    assert scores.by_class[CHAIR].n_truth > 0


def run(*arguments: object, reach: float = 0.02) -> None:
    """Score; the reach is less than from one cell of ``two_things`` to the next."""
    main(["ap", *map(str, arguments), "--reach", str(reach)])


def refused(capsys: pytest.CaptureFixture[str], *arguments: object, reach: float = 0.02) -> str:
    with pytest.raises(SystemExit) as stop:
        run(*arguments, reach=reach)
    assert stop.value.code == 2
    return capsys.readouterr().out


@pytest.fixture
def scored(tmp_path: Path) -> Path:
    """A map with one of two things, half of the other, and truth in both forms."""
    truth = two_things()
    write_cloud(tmp_path / "scan.npz", truth)
    write_truth(tmp_path / "scan.txt", truth)
    half = LabelledCloud(truth.points, np.where(truth.points[:, 0] < 12 * VOXEL, truth.instance, 0), truth.category)
    map_of(half, labels={3: "table", 7: "chair"}).save(tmp_path / "maps" / "scan.map.npz")
    return tmp_path


def test_a_map_is_scored_against_points(scored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = scored / "ap.json"
    run(scored / "maps" / "scan.map.npz", "--truth", scored / "scan.npz", "--out", out, "--per-class")
    found = json.loads(out.read_text())
    # The chair is whole. The table has 100 of 200 points: IoU 1/2, found at .25 only; it is wrong from .50 on.
    assert (found["ap"], found["ap50"], found["ap25"]) == (0.5, 0.5, 1.0)
    assert found["groups"]["head"] == {"ap": 0.5, "ap50": 0.5, "ap25": 1.0}
    assert found["groups"]["tail"]["ap"] is None
    assert [(c["name"], c["ap"], c["instances"]) for c in found["classes"]] == [("chair", 1.0, 1), ("table", 0.0, 1)]
    shown = capsys.readouterr().out
    assert "table" in shown
    assert "50.0" in shown


def test_class_agnostic_needs_no_labels(scored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = scored / "bare.npz"
    map_of(two_things(), labels={3: "", 7: "", 9: ""}).save(bare)
    assert "no label that ScanNet200 has" in refused(capsys, bare, "--truth", scored / "scan.npz")
    out = scored / "ap.json"
    # The wall is void in a file of the benchmark, and of our own it is one of the things.
    for truth, instances in (("scan.npz", 3), ("scan.txt", 2)):
        where = ["--points", scored / "scan.npz"] if truth == "scan.txt" else []
        run(bare, "--truth", scored / truth, *where, "--class-agnostic", "--out", out)
        found = json.loads(out.read_text())
        assert (found["ap"], found["classes"][0]["instances"]) == (1.0, instances)


def test_the_benchmarks_files_score_as_the_map_does(scored: Path) -> None:
    one, other = scored / "one.json", scored / "other.json"
    run(scored / "maps", "--truth", scored / "scan.npz", "--out", one, "--write-format", scored / "written")
    run(scored / "written", "--truth", scored / "scan.txt", "--out", other)
    assert json.loads(one.read_text()) == json.loads(other.read_text())


def test_folders_of_scans(scored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = two_things()
    (scored / "truth").mkdir()
    for scan in ("a", "b"):
        write_truth(scored / "truth" / f"{scan}.txt", truth)
    right = [PredictedInstance(np.flatnonzero(truth.instance == i), 0.9, c) for i, c in ((7, CHAIR), (3, TABLE))]
    write_predictions(scored / "p", "a", right, len(truth))
    assert "no predictions for b" in refused(capsys, scored / "p", "--truth", scored / "truth")
    write_predictions(scored / "p", "b", [], len(truth))
    out = scored / "ap.json"
    run(scored / "p", "--truth", scored / "truth", "--out", out)
    found = json.loads(out.read_text())
    # One of two of each class at precision 1: half.
    assert (found["ap"], found["scans"]) == (0.5, ["a", "b"])
    # Maps of the same scans need points: by the names of scans.
    maps = scored / "two"
    for scan in ("a", "b"):
        map_of(truth, labels={3: "table", 7: "chair"}).save(maps / f"{scan}.npz")
    assert "Give --points" in refused(capsys, maps, "--truth", scored / "truth").replace("\n", " ")
    (scored / "points").mkdir()
    write_cloud(scored / "points" / "a.npz", truth)
    assert "no points of b" in refused(capsys, maps, "--truth", scored / "truth", "--points", scored / "points")
    write_cloud(scored / "points" / "b.npz", truth)
    run(maps, "--truth", scored / "truth", "--points", scored / "points", "--out", out)
    assert json.loads(out.read_text())["ap"] == 1.0
    map_of(truth, labels={3: "table"}).save(maps / "c.npz")
    assert "scan c" in refused(capsys, maps, "--truth", scored / "truth")


def test_a_scene_is_truth(toy_specs: list[str], toy_scene: Scene, tmp_path: Path) -> None:
    truth = cloud_of_scene(toy_scene)
    instances = []
    for item in toy_scene.instances:
        own = np.unique(np.floor(truth.points[truth.instance == item.id] / VOXEL), axis=0)
        instances.append(MapInstance(item.id, ((own + 0.5) * VOXEL).astype(np.float32), None, label=item.category))
    InstanceMap(instances, VOXEL).save(tmp_path / "toy.npz")
    out = tmp_path / "ap.json"
    run(tmp_path / "toy.npz", "--truth", toy_specs[0], "--class-agnostic", "--out", out, reach=VOXEL)
    found = json.loads(out.read_text())
    # Voxels that two things share go to one of them, so that it is not quite 1.
    assert found["ap50"] > 0.9
    assert found["scans"] == ["toy"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (lambda p: [p / "none", "--truth", p / "scan.npz"], "nothing there"),
        (lambda p: [p / "maps", "--truth", p / "none"], "none"),
        (lambda p: [p / "maps", "--truth", p / "scan.npz", "--min-points", 0], "--min-points 0"),
        (lambda p: [p / "maps", "--truth", p / "maps"], "no array"),
        (lambda p: [p / "scan.txt", "--truth", p / "scan.npz"], "1 words"),
    ],
)
def test_wrong_commands_end_in_one_message(
    scored: Path, capsys: pytest.CaptureFixture[str], arguments: Callable[[Path], list[object]], message: str
) -> None:
    assert message in refused(capsys, *arguments(scored))


def test_a_reach_that_is_none_is_refused(scored: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--reach nan" in refused(capsys, scored / "maps", "--truth", scored / "scan.npz", reach=float("nan"))


def test_proposals_round_trip(tmp_path: Path) -> None:
    made = [Proposal(np.arange(3), 0.25, CHAIR), Proposal(np.arange(2, 9), 0.75, TABLE)]
    write_proposals(tmp_path, "scan", made, 10)
    read = read_proposals(tmp_path, "scan", 10, class_agnostic=False)
    assert [(p.indices.tolist(), p.confidence, p.category) for p in read] == [
        (p.indices.tolist(), p.confidence, p.category) for p in made
    ]


def test_a_truth_that_is_not_there_is_called_a_missing_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    InstanceMap([MapInstance(1, two_things().points[:200], None, label="chair")], voxel_size=VOXEL).save(
        tmp_path / "m.npz"
    )
    with pytest.raises(SystemExit) as stopped:
        main(["ap", str(tmp_path / "m.npz"), "--truth", "nope.npz"])
    assert stopped.value.code == 2
    assert "nope.npz: found no such file" in " ".join(capsys.readouterr().out.split())
