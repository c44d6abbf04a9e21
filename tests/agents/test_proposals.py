"""The prediction format, points from files, and other methods' 3-D instances as masks of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from fuzzing import hold_to_data_error
from hypothesis import given
from hypothesis import strategies as st

from openmap_agents.perception import make_segmenter, read_segmenter_spec
from openmap_agents.perception.cloud_files import read_points, scan_name
from openmap_agents.perception.prediction_format import (
    PredictedInstance,
    list_scans,
    read_mask,
    read_predictions,
    write_predictions,
)
from openmap_agents.perception.proposals import CELL, REACH, ProposalSegmenter, owner_of_points
from openmap_agents.perception.scannet200 import NUMBER_OF
from openmap_scenes import DataError, PinholeCamera, load_scene
from openmap_scenes.recordings import open_recording

CHAIR = NUMBER_OF["chair"]


def instance(*indices: int, confidence: float = 0.5, category: int = CHAIR) -> PredictedInstance:
    return PredictedInstance(np.array(indices, np.int64), confidence, category)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_predictions(tmp_path / "p", "scan", [instance(0, 2), instance(1, confidence=1 / 3)], 4)
    return tmp_path / "p"


def test_what_is_written_is_the_benchmarks_format(folder: Path) -> None:
    assert (folder / "scan.txt").read_text() == (
        "predicted_masks/scan_000.txt 2 0.5\npredicted_masks/scan_001.txt 2 0.3333333333333333\n"
    )
    assert (folder / "predicted_masks" / "scan_000.txt").read_text() == "1\n0\n1\n0\n"
    assert list_scans(folder) == ["scan"]


@given(st.data())
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 30))
    points = st.sets(st.integers(0, n - 1)).map(sorted)
    numbers = st.floats(-1e9, 1e9)
    made = [
        instance(*data.draw(points), confidence=data.draw(numbers), category=data.draw(st.sampled_from([1, 2, 1191])))
        for _ in range(data.draw(st.integers(0, 4)))
    ]
    where = tmp_path_factory.mktemp("p")
    write_predictions(where, "scan", made, n)
    read = read_predictions(where, "scan", n)
    assert [(r.indices.tolist(), r.confidence, r.category) for r in read] == [
        (m.indices.tolist(), m.confidence, m.category) for m in made
    ]


@pytest.mark.parametrize("text", ["1\n0\n1\n0", "1\n0\n1\n0\n\n", "1\r\n0\r\n1\r\n0\r\n", " 1\n0 \n1\n0\n"])
def test_masks_as_other_tools_write_them(tmp_path: Path, text: str) -> None:
    (tmp_path / "mask.txt").write_bytes(text.encode())
    assert read_mask(tmp_path / "mask.txt", 4).tolist() == [0, 2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "found 0 lines, expected 4"),
        ("1\n0\n1\n", "found 3 lines, expected 4"),
        ("1\n0\n1\n0\n1\n", "found 5 lines, expected 4"),
        ("1\n0\n2\n0\n", "line 3: found '2', expected 0 or 1"),
        ("1\n-1\n1\n0\n", "line 2: found '-1', expected 0 or 1"),
        ("1\n0\n\n0\n", "line 3: found '', expected 0 or 1"),
        ("11\n0\n1\n0\n", "line 1: found '11', expected 0 or 1"),
        ("nan\n0\n1\n0\n", "line 1: found 'nan', expected 0 or 1"),
    ],
)
def test_masks_that_cannot_be_are_one_error(folder: Path, text: str, message: str) -> None:
    (folder / "predicted_masks" / "scan_000.txt").write_text(text)
    with pytest.raises(DataError, match=message):
        read_predictions(folder, "scan", 4)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("predicted_masks/scan_000.txt 2", "found 2 words"),
        ("a mask.txt 2 0.5", "found 4 words"),
        ("../secret.txt 2 0.5", "'../secret.txt', expected one relative to"),
        ("predicted_masks/../../secret.txt 2 0.5", "expected one relative to"),
        ("/etc/hostname 2 0.5", "'/etc/hostname', expected one relative to"),
        (". 2 0.5", "expected one relative to"),
        ("link.txt 2 0.5", "'link.txt', expected one relative to"),
        ("predicted_masks/none.txt 2 0.5", "none.txt: found no such file"),
        ("predicted_masks 2 0.5", "found an unreadable file"),
        ("predicted_masks/scan_001.txt 2 nan", "found confidence 'nan'"),
        ("predicted_masks/scan_001.txt 2 inf", "found confidence 'inf'"),
        ("predicted_masks/scan_001.txt 2 sure", "found confidence 'sure'"),
        ("predicted_masks/scan_001.txt 12 0.5", "found label 12, expected a class number"),
        ("predicted_masks/scan_001.txt -2 0.5", "found label '-2'"),
        ("predicted_masks/scan_001.txt 2.5 0.5", "found label '2.5'"),
        ("predicted_masks/scan_001.txt chair 0.5", "found label 'chair'"),
        ("predicted_masks/scan_001.txt inf 0.5", "found label 'inf'"),
        ("./predicted_masks/scan_000.txt 2 0.5", "a second time"),
        ("bad\0name.txt 2 0.5", "expected a file in"),
    ],
)
def test_lines_that_cannot_be_are_one_error(folder: Path, line: str, message: str) -> None:
    secret = folder.parent / "secret.txt"
    secret.write_text("1\n0\n0\n0\n")
    (folder / "link.txt").symlink_to(secret)
    path = folder / "scan.txt"
    path.write_text(f"predicted_masks/scan_000.txt 2 0.5\n{line}\n")
    with pytest.raises(DataError, match=message):
        read_predictions(folder, "scan", 4)


def test_labels_of_other_sets_are_taken_where_none_is_needed(folder: Path) -> None:
    (folder / "scan.txt").write_text("predicted_masks/scan_000.txt 0 0.5\n\npredicted_masks/scan_001.txt 5.0 1\n")
    assert [p.category for p in read_predictions(folder, "scan", 4, any_label=True)] == [0, 5]


def test_damaged_predictions_are_one_error(folder: Path, tmp_path: Path) -> None:
    files = ["scan.txt", "predicted_masks/scan_000.txt", "predicted_masks/scan_001.txt"]
    (tmp_path / "work").mkdir()
    refused = hold_to_data_error(lambda f: read_predictions(f, "scan", 4), folder, files, tmp_path / "work", 300)
    assert refused > 100


def test_what_cannot_be_read_is_not_written(tmp_path: Path) -> None:
    for scan in ("", "a/b", "..", ".a", "a b"):
        with pytest.raises(ValueError, match="scan is"):
            write_predictions(tmp_path, scan, [], 4)
    with pytest.raises(ValueError, match="beyond"):
        write_predictions(tmp_path, "scan", [instance(4)], 4)
    with pytest.raises(ValueError, match="confidence"):
        write_predictions(tmp_path, "scan", [instance(0, confidence=np.nan)], 4)
    assert not (tmp_path / "scan.txt").exists()


def ascii_ply(points: np.ndarray) -> str:
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in points.tolist())
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
    return head + "property float x\nproperty float y\nproperty float z\nend_header\n" + rows


def test_points_of_files(tmp_path: Path) -> None:
    points = np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8.5]], np.float32)
    np.savez(tmp_path / "scan.npz", points=points)
    (tmp_path / "scan.ply").write_text(ascii_ply(points))
    for name in ("scan.npz", "scan.ply"):
        np.testing.assert_array_equal(read_points(tmp_path / name), points)
    # ScanNet's meshes are Z up: (x, y, z) -> (x, z, -y).
    (tmp_path / "scene0000_00_vh_clean_2.ply").write_text(ascii_ply(points))
    found = read_points(tmp_path / "scene0000_00_vh_clean_2.ply")
    np.testing.assert_array_equal(found, points[:, [0, 2, 1]] * [1, 1, -1])
    assert scan_name(tmp_path / "scene0000_00_vh_clean_2.ply") == "scene0000_00"
    assert scan_name("there/home.map.npz") == "home"


@pytest.mark.parametrize(
    ("name", "write", "message"),
    [
        ("a.txt", lambda p: p.write_text("0 0 0"), "a .ply or an .npz"),
        ("a.npz", lambda p: None, "no such file"),
        ("a.ply", lambda p: None, "no such file"),
        ("a.npz", lambda p: p.write_bytes(b"PK"), "unreadable"),
        ("a.npz", lambda p: np.savez(p, other=np.zeros(3)), "no array points"),
        ("a.npz", lambda p: np.savez(p, points=np.array([{}], object)), "unreadable"),
        ("a.npz", lambda p: np.savez(p, points=np.zeros((4, 2))), "numbers"),
        ("a.npz", lambda p: np.savez(p, points=np.zeros((0, 3))), "numbers"),
        ("a.npz", lambda p: np.savez(p, points=np.full((2, 3), np.nan)), "not finite"),
        ("a.ply", lambda p: p.write_text("ply\nformat ascii 1.0\nelement vertex 1\nend_header\n"), "no points"),
    ],
)
def test_files_without_points_are_one_error(
    tmp_path: Path, name: str, write: Callable[[Path], object], message: str
) -> None:
    write(tmp_path / name)
    with pytest.raises(DataError, match=message):
        read_points(tmp_path / name)


CAMERA = PinholeCamera.from_hfov(40, 30, 70.0)


def facing_wall(tmp_path: Path, found: list[PredictedInstance]) -> tuple[str, np.ndarray]:
    """A wall at z = -2 with a point every 2.5 cm, as a spec; the points."""
    x, y = np.meshgrid(np.arange(-1, 1, 0.025), np.arange(-1, 1, 0.025), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], 1).astype(np.float32)
    np.savez(tmp_path / "wall.npz", points=points)
    write_predictions(tmp_path / "found", "wall", found, len(points))
    return f"proposals:{tmp_path / 'found'}?cloud={tmp_path / 'wall.npz'}", points


def test_masks_are_where_the_instances_are_seen(tmp_path: Path) -> None:
    _, points = facing_wall(tmp_path, [])
    left, low, behind = points[:, 0] < 0, points[:, 1] < 0, points[:, 0] > 0.9
    found = [
        instance(*np.flatnonzero(left), confidence=0.3),
        instance(*np.flatnonzero(low), confidence=2.0, category=7),
        instance(*np.flatnonzero(behind & ~low & (points[:, 1] > 0.96)), confidence=0.9),
    ]
    spec, _ = facing_wall(tmp_path, found)
    segmenter = make_segmenter(spec)
    depth = np.full((30, 40), 2.0, np.float32)
    depth[:2] = 0.0
    depth[2] = np.inf
    masks = segmenter.segment(np.zeros((30, 40, 3), np.uint8), depth, np.eye(4), CAMERA)
    places = CAMERA.rays() * 2.0
    inside = (np.abs(places[..., :2]) < 0.97).all(-1) & (depth == 2.0)
    # The surer one has the corner where they overlap; the third is seen by too few pixels.
    expected = np.where(places[..., 1] < 0, 2, np.where(places[..., 0] < 0, 1, 0))
    far = (np.abs(places[..., :2]) > 0.04).all(-1)  # of the borders, where the nearest point may be either one's
    np.testing.assert_array_equal(masks.labels[inside & far], expected[inside & far])
    assert (masks.labels[:3] == 0).all()
    np.testing.assert_allclose(masks.scores, [0.3, 1.0])
    # Another 30 cm away nothing is within reach; a picture without depth has no masks.
    for empty in (np.full((30, 40), 2.3, np.float32), np.zeros((30, 40), np.float32)):
        assert len(segmenter.segment(np.zeros((30, 40, 3), np.uint8), empty, np.eye(4), CAMERA)) == 0


@given(st.integers(0, 2**32 - 1))
def test_pixels_take_the_nearest_point_of_their_cell(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("p")
    points = rng.uniform(-0.3, 0.3, (60, 3)).astype(np.float32)
    np.savez(folder / "cloud.npz", points=points)
    owner = rng.integers(-1, 3, len(points))
    found = [instance(*np.flatnonzero(owner == k)) for k in range(3)]
    write_predictions(folder, "cloud", found, len(points))
    segmenter = ProposalSegmenter(folder, folder / "cloud.npz")
    places = rng.uniform(-0.5, 0.5, (50, 3))
    for place, number in zip(places, segmenter._instance_at(places), strict=True):
        gaps = np.linalg.norm(points - place, axis=1)
        # The cell's centre is at most half its diagonal from the pixel.
        slack = np.sqrt(3) / 2 * CELL + 1e-6
        near = gaps <= min(gaps.min() + 2 * slack, REACH + slack)
        allowed = set(owner[near].tolist()) | ({-1} if gaps.min() > REACH - slack else set())
        assert number in allowed


def test_equally_sure_instances_go_by_their_order() -> None:
    found = [instance(0, 1), instance(1, 2), instance(2, 3, confidence=0.9)]
    assert owner_of_points(found, 5).tolist() == [0, 0, 2, 2, -1]


def test_specs_of_proposals(tmp_path: Path) -> None:
    spec, _ = facing_wall(tmp_path, [])
    read = read_segmenter_spec(spec)
    assert (read.rest, read.cloud) == (str(tmp_path / "found"), str(tmp_path / "wall.npz"))
    for bad in (
        "proposals",
        "proposals:",
        f"proposals:{tmp_path}",
        f"proposals:{tmp_path}?cloud=",
        "proposals:?cloud=x",
    ):
        with pytest.raises(ValueError, match="proposals:<folder>"):
            read_segmenter_spec(bad)
    for missing in (f"proposals:{tmp_path}?cloud={tmp_path}/none.ply", f"proposals:none?cloud={tmp_path}/wall.npz"):
        with pytest.raises(DataError, match="nothing there"):
            read_segmenter_spec(missing)
    write_predictions(tmp_path / "found", "other", [], 3)
    write_predictions(tmp_path / "found", "third", [], 3)
    (tmp_path / "found" / "wall.txt").unlink()
    with pytest.raises(DataError, match="2 scans, none called wall"):
        make_segmenter(spec)


def test_true_instances_of_a_scan_are_its_true_masks(shared_scenes: Path, tmp_path: Path) -> None:
    scan = shared_scenes / "scannet" / "scene0900_00"
    scene = load_scene(f"scannet:{scan}")
    owner = np.zeros(len(scene.vertices), np.int32)
    owner[scene.faces.ravel()] = np.repeat(scene.face_instance, 3)
    ids = np.unique(owner[owner > 0])
    found = [instance(*np.flatnonzero(owner == i), confidence=1.0) for i in ids]
    write_predictions(tmp_path, scan.name, found, len(owner))
    segmenter = make_segmenter(f"proposals:{tmp_path}?cloud={scan / f'{scan.name}_vh_clean_2.ply'}")
    recording = open_recording(scan, "scannet")
    agree = []
    for position in (0, 20, 40):
        frame = recording.frame(position)
        masks = segmenter.segment(frame.rgb, frame.depth, frame.T_world_camera, recording.camera)
        truth = cv2.imread(str(scan / "instance-filt" / f"{frame.index}.png"), cv2.IMREAD_UNCHANGED)
        assert truth is not None
        # Each mask is of one instance: the one that most of its pixels have.
        own = np.zeros(1 + len(masks), np.int64)
        for n in range(1, 1 + len(masks)):
            own[n] = np.bincount(truth[masks.labels == n]).argmax()
        known = (truth > 0) & (frame.depth > 0)
        agree.append(float((own[masks.labels] == truth)[known].mean()))
    assert min(agree) > 0.93, agree
