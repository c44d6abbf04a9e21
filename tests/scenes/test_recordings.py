"""Recordings of ScanNet: against the mesh of the same scan, tiny ones written here, and damaged ones."""

from __future__ import annotations

import io
import shutil
import struct
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from fuzzing import hold_to_data_error
from PIL import Image

from openmap_scenes import DataError
from openmap_scenes.camera import PinholeCamera
from openmap_scenes.formats.scannet import read_scannet
from openmap_scenes.recordings import open_recording
from openmap_scenes.recordings.images import ColourToDepth

SCAN = "scene0900_00"
LOST = np.full((4, 4), -np.inf)
DEPTH_SIZE, COLOUR_SIZE = (12, 8), (24, 16)
DEPTH_MATRIX = np.array([[10, 0, 5.5, 0], [0, 10, 3.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float)
# Twice as fine and with the same edges, whose pixels' centres lie at 0.5 of the coarse ones.
COLOUR_MATRIX = np.array([[20, 0, 11.5, 0], [0, 20, 7.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float)


def poses_of(n: int) -> list[npt.NDArray[np.float64]]:
    """Camera-to-scan matrices: one step along x each, turned about z by a right angle each."""
    poses = []
    for k in range(n):
        pose = np.eye(4)
        c, s = np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)
        pose[:2, :2], pose[0, 3] = [[c, -s], [s, c]], k
        poses.append(pose)
    return poses


def depth_of(frame: int) -> npt.NDArray[np.uint16]:
    """Millimetres: frame 0 is 1 m away in its left column, each column 1 mm and each frame 1 m more; nothing in one corner."""
    depth = np.tile(1000 * (frame + 1) + np.arange(DEPTH_SIZE[0]), (DEPTH_SIZE[1], 1)).astype(np.uint16)
    depth[0, 0] = 0
    return depth


def colour_of(frame: int) -> npt.NDArray[np.uint8]:
    """A ramp of 10 levels a pixel to the right in red, down in green, the frame in blue."""
    width, height = COLOUR_SIZE
    rgb = np.zeros((height, width, 3), np.uint8)
    rgb[..., 0], rgb[..., 1], rgb[..., 2] = 10 * np.arange(width), 10 * np.arange(height)[:, None], frame
    return rgb


def encoded(pixels: npt.NDArray[np.generic], kind: str) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **({"quality": 98} if kind == "JPEG" else {}))
    return stream.getvalue()


def write_matrix(path: Path, matrix: npt.NDArray[np.float64]) -> None:
    path.write_text("".join(" ".join(f"{v:.6f}" for v in row) + "\n" for row in matrix))


def write_exported(folder: Path, poses: list[npt.NDArray[np.float64]], step: int = 1) -> Path:
    for part in ("color", "depth", "pose", "intrinsic"):
        (folder / part).mkdir(parents=True)
    for k, pose in enumerate(poses):
        (folder / f"color/{k * step}.jpg").write_bytes(encoded(colour_of(k), "JPEG"))
        (folder / f"depth/{k * step}.png").write_bytes(encoded(depth_of(k), "PNG"))
        write_matrix(folder / f"pose/{k * step}.txt", pose)
    write_matrix(folder / "intrinsic/intrinsic_color.txt", COLOUR_MATRIX)
    write_matrix(folder / "intrinsic/intrinsic_depth.txt", DEPTH_MATRIX)
    return folder


def write_sens(
    path: Path, poses: list[npt.NDArray[np.float64]], colour: int = 2, depth: int = 1, version: int = 4
) -> Path:
    packed_colour = [lambda k: colour_of(k).tobytes(), lambda k: encoded(colour_of(k), "PNG")]
    packed_colour.append(lambda k: encoded(colour_of(k), "JPEG"))
    plain = [lambda k: depth_of(k).tobytes(), lambda k: zlib.compress(depth_of(k).tobytes())]
    data = struct.pack("<IQ5s", version, 5, b"hands")
    for matrix in (COLOUR_MATRIX, np.eye(4), DEPTH_MATRIX, np.eye(4)):
        data += struct.pack("<16f", *matrix.ravel())
    data += struct.pack("<2i4IfQ", colour, depth, *COLOUR_SIZE, *DEPTH_SIZE, 1000.0, len(poses))
    for k, pose in enumerate(poses):
        a, b = packed_colour[colour](k), plain[min(depth, 1)](k)
        data += struct.pack("<16f4Q", *pose.ravel(), 5, 6, len(a), len(b)) + a + b
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data + struct.pack("<Q", 0))
    return path


def hold_to_what_was_written(recording, step: int = 1, tolerance: float = 3.0) -> None:
    """Four frames, the third one lost; see ``poses_of``, ``depth_of`` and ``colour_of``."""
    assert recording.camera == PinholeCamera(*DEPTH_SIZE, 10.0, 10.0, 5.5, 3.5)
    assert recording.skipped == (2 * step,)
    frames = list(recording)
    assert len(recording) == 3
    assert [f.index for f in frames] == [0, step, 3 * step]
    assert [f.index for f in recording] == [0, step, 3 * step]
    for frame, k in zip(frames, (0, 1, 3), strict=True):
        np.testing.assert_allclose(frame.depth, depth_of(k) / 1000.0, atol=1e-6)
        assert frame.rgb.shape == (*frame.depth.shape, 3)
        # A depth pixel covers two colour pixels, u_c = 2 u_d + 0.5 between them.
        ramp = np.stack(np.broadcast_arrays(20.0 * np.arange(12) + 5, 20.0 * np.arange(8)[:, None] + 5, k), axis=-1)
        assert np.abs(frame.rgb - ramp).max() <= tolerance
    # The first pose is the identity: it stands at the scan's origin and looks up its z, which is the world's y.
    np.testing.assert_allclose(frames[0].T_world_camera[:3, :3] @ [0, 0, -1], [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(frames[0].T_world_camera[:3, :3] @ [1, 0, 0], [1, 0, 0], atol=1e-6)
    # The next one is turned from the scan's x to its y, which is the world's -z.
    np.testing.assert_allclose(frames[1].T_world_camera[:3, :3] @ [1, 0, 0], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(frames[1].T_world_camera[:3, 3], [1, 0, 0], atol=1e-6)


@pytest.fixture
def poses() -> list[npt.NDArray[np.float64]]:
    poses = poses_of(4)
    poses[2] = LOST
    return poses


@pytest.mark.parametrize("step", [1, 20])
def test_an_exported_folder(tmp_path: Path, poses, step: int):
    hold_to_what_was_written(open_recording(write_exported(tmp_path / "scene", poses, step)), step)


@pytest.mark.parametrize(("colour", "depth"), [(0, 0), (1, 1), (2, 1), (2, 0)])
def test_a_sens_file(tmp_path: Path, poses, colour: int, depth: int):
    path = write_sens(tmp_path / "scene" / "scene.sens", poses, colour, depth)
    hold_to_what_was_written(open_recording(path), tolerance=3.0 if colour == 2 else 1.0)
    hold_to_what_was_written(open_recording(path.parent))


def test_the_alignment_beside_it_turns_a_recording(tmp_path: Path):
    text = "axisAlignment = 0 -1 0 5 1 0 0 0 0 0 1 -1 0 0 0 1\n"
    exported = write_exported(tmp_path / "scene", poses_of(2))
    sens = write_sens(tmp_path / "scene" / "scene.sens", poses_of(2))
    for place in (tmp_path / "scene" / "scene.txt", tmp_path / "scene.txt"):
        place.write_text(text)
        for path in (exported, sens) if place.parent == exported else (exported,):
            frame = list(open_recording(path))[1]
            # scan (1, 0, 0) -> aligned (5, 1, -1) -> world (5, -1, -1)
            np.testing.assert_allclose(frame.T_world_camera[:3, 3], [5, -1, -1], atol=1e-6)
        place.unlink()


def test_colour_and_depth_of_one_camera_stay_as_they_are():
    camera = PinholeCamera(24, 16, 20.0, 20.0, 11.5, 7.5)
    assert ColourToDepth("here", camera, camera)(colour_of(0)) is not None
    np.testing.assert_array_equal(ColourToDepth("here", camera, camera)(colour_of(0)), colour_of(0))


def test_depth_pixels_beyond_the_colour_picture_are_black():
    colour, depth = PinholeCamera(10, 8, 20.0, 20.0, 4.5, 3.5), PinholeCamera(20, 8, 20.0, 20.0, 9.5, 3.5)
    seen = ColourToDepth("here", colour, depth)(np.full((8, 10, 3), 200, np.uint8))
    assert (seen[:, 5:15] == 200).all()
    assert (seen[:, :5] == 0).all()
    assert (seen[:, 15:] == 0).all()


def damage(folder: Path, name: str, how: object) -> None:
    path = folder / name
    if how is None:
        path.unlink()
    elif isinstance(how, str):
        path.write_text(how)
    elif isinstance(how, bytes):
        path.write_bytes(how)


IDENTITY = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
SMALL_PNG = encoded(np.zeros((3, 3), np.uint16), "PNG")
BYTE_PNG = encoded(np.zeros((8, 12), np.uint8), "PNG")
WHOLE_PNG = encoded(depth_of(1), "PNG")


@pytest.mark.parametrize(
    ("name", "how", "says"),
    [
        ("pose/1.txt", "nan " + IDENTITY[2:], "pose of frame 1 that is not finite"),
        ("pose/1.txt", "-inf " + IDENTITY[2:], "pose of frame 1 that is not finite"),
        ("pose/1.txt", "2 " + IDENTITY[2:], "pose of frame 1 whose 3x3 part is not a rotation"),
        ("pose/1.txt", "-1 " + IDENTITY[2:], "pose of frame 1 whose 3x3 part is not a rotation"),
        ("pose/1.txt", "1 0 0 0\n", r"lines of \[4\] numbers"),
        ("pose/1.txt", "a b c d\n", "words that are no numbers"),
        ("pose/1.txt", "", r"lines of \[\] numbers"),
        ("pose/1.txt", None, "no file of frame 1"),
        ("color/1.jpg", None, "no file of frame 1"),
        ("color/1.jpg", b"", "found 0 bytes"),
        ("color/1.jpg", b"no picture", "no picture"),
        ("color/1.jpg", encoded(colour_of(1), "JPEG")[:-60], "cannot be decoded"),
        ("color/01.jpg", b"", "01.jpg and 1.jpg"),
        ("depth/1.png", None, "no file of frame 1"),
        ("depth/1.png", b"", "found 0 bytes"),
        ("depth/1.png", SMALL_PNG, "found 3 x 3 pixels, expected 12 x 8"),
        ("depth/1.png", BYTE_PNG, "uint8 pixels"),
        ("depth/1.png", WHOLE_PNG[:-30], "cannot be decoded"),
        ("intrinsic/intrinsic_depth.txt", None, "no such file"),
        ("intrinsic/intrinsic_depth.txt", "0 " + IDENTITY[2:], "intrinsics fx=0"),
        ("intrinsic/intrinsic_color.txt", "1e-9 " + IDENTITY[2:], "differ by"),
    ],
)
def test_a_broken_export_is_refused_by_name(tmp_path: Path, name: str, how: object, says: str):
    folder = write_exported(tmp_path / "scene", poses_of(3))
    damage(folder, name, how)
    with pytest.raises(DataError, match=says) as caught:
        list(open_recording(folder))
    assert str(folder / Path(name).parent) in str(caught.value) or "differ" in says


def test_a_gap_in_the_numbers_is_named(tmp_path: Path):
    folder = write_exported(tmp_path / "scene", poses_of(5))
    for name in ("color/3.jpg", "depth/3.png", "pose/3.txt"):
        (folder / name).unlink()
    with pytest.raises(DataError, match="no frame 3"):
        open_recording(folder)


def test_a_truncated_sens_says_where_and_gives_the_rest_if_asked(tmp_path: Path):
    path = write_sens(tmp_path / "whole.sens", poses_of(3))
    whole = path.read_bytes()
    for cut in (len(whole) - 20, len(whole) - 9):
        path.write_bytes(whole[:cut])
        with pytest.raises(DataError, match=r"truncated in frame 2 of 3"):
            open_recording(path)
        assert [f.index for f in open_recording(path, lenient=True)] == [0, 1]
    path.write_bytes(whole[:-8])  # no inertial measurements, not even their number
    assert len(list(open_recording(path))) == 3


@pytest.mark.parametrize(
    ("at", "value", "says"),
    [
        (0, struct.pack("<I", 3), "version 3"),
        (4, struct.pack("<Q", 1 << 60), "a name of 1152921504606846976 bytes"),
        (273, struct.pack("<i", -1), "colour compression -1"),
        (277, struct.pack("<i", 2), "occi_ushort"),
        (289, struct.pack("<I", 1 << 31), "2147483648 x 8 pixels"),
        (297, struct.pack("<f", 0), "a depth shift of 0"),
        (301, struct.pack("<Q", 1 << 50), "truncated in frame 2 of 1125899906842624"),
        (309, struct.pack("<f", np.nan), "pose of frame 0 that is not finite"),
        (389, struct.pack("<Q", 1 << 63), "truncated in frame 0 of 2"),
        (389, struct.pack("<QQ", 0, 100), "truncated in frame 1 of 2"),
    ],
)
def test_a_broken_sens_is_refused(tmp_path: Path, at: int, value: bytes, says: str):
    path = write_sens(tmp_path / "a.sens", poses_of(2))
    data = path.read_bytes()
    path.write_bytes(data[:at] + value + data[at + len(value) :])
    with pytest.raises(DataError, match=says) as caught:
        list(open_recording(path))
    assert str(path) in str(caught.value)


def test_a_frame_without_colour_is_named(tmp_path: Path):
    path = write_sens(tmp_path / "a.sens", poses_of(1), colour=0, depth=0)
    data, n = path.read_bytes(), COLOUR_SIZE[0] * COLOUR_SIZE[1] * 3
    path.write_bytes(
        data[:273] + struct.pack("<i", 2) + data[277:389] + struct.pack("<Q", 0) + data[397:405] + data[405 + n :]
    )
    with pytest.raises(DataError, match=r"a.sens frame 0 colour: found 0 bytes"):
        list(open_recording(path))


def test_depth_that_unpacks_to_more_than_a_picture_is_refused(tmp_path: Path):
    path = write_sens(tmp_path / "a.sens", poses_of(1), colour=0)
    data, bomb = path.read_bytes(), zlib.compress(bytes(10_000_000))
    head = 309 + 96
    colour_bytes = COLOUR_SIZE[0] * COLOUR_SIZE[1] * 3
    path.write_bytes(data[: head - 8] + struct.pack("<Q", len(bomb)) + data[head : head + colour_bytes] + bomb)
    with pytest.raises(DataError, match="bytes of depth"):
        list(open_recording(path))


def test_what_is_no_recording_is_said(tmp_path: Path):
    with pytest.raises(DataError, match="no such file or folder"):
        open_recording(tmp_path / "none")
    with pytest.raises(DataError, match=r"nothing of a recording.*scannet .color, depth"):
        open_recording(tmp_path)


@pytest.mark.parametrize("name", ["", f"{SCAN}.sens"])
def test_a_recording_lies_on_its_mesh(shared_scenes: Path, name: str):
    """Points of the depth pictures against the surface of the scan's mesh, which was fused with 2 cm voxels."""
    import open3d as o3d

    folder = shared_scenes / "scannet" / SCAN
    scan, recording = read_scannet(folder), open_recording(folder / name)
    assert recording.skipped == ((4,) if name else (41,))
    assert len(recording) == (9 if name else 59)
    surface = o3d.t.geometry.RaycastingScene()
    surface.add_triangles(scan.vertices, scan.faces.astype(np.uint32))
    for frame in recording:
        points = recording.camera.unproject(frame.depth, frame.T_world_camera)[frame.depth > 0][::211]
        assert np.median(surface.compute_distance(points.astype(np.float32)).numpy()) < 0.004, frame.index


def test_both_forms_of_a_recording_say_the_same(shared_scenes: Path):
    folder = shared_scenes / "scannet" / SCAN
    exported = {f.index: f for f in open_recording(folder)}
    for frame in open_recording(folder / f"{SCAN}.sens"):
        other = exported[frame.index * 6]
        np.testing.assert_allclose(frame.T_world_camera, other.T_world_camera, atol=1e-5)
        np.testing.assert_allclose(frame.depth, other.depth, atol=1e-5)
        # Another size and another compression of one picture.
        assert np.abs(frame.rgb[9:-9, 9:-9].astype(int) - other.rgb[9:-9, 9:-9]).mean() < 6


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("04_nan_pose", r"pose/1.txt: found a pose of frame 1 that is not finite"),
        ("05_zero_byte_depth", r"depth/1.png: found 0 bytes"),
        ("06_truncated_sens", r"scene0900_00.sens: found a file that is truncated in frame 2 of 10"),
    ],
)
def test_the_broken_recordings_are_refused(shared_scenes: Path, name: str, says: str):
    with pytest.raises(DataError, match=says):
        list(open_recording(shared_scenes / "broken" / name / SCAN))


def test_frames_before_the_cut_of_the_broken_sens(shared_scenes: Path):
    folder = shared_scenes / "broken" / "06_truncated_sens" / SCAN
    assert [f.index for f in open_recording(folder, lenient=True)] == [0, 1]


def test_fuzz_exported_only_data_errors(tmp_path: Path, poses):
    healthy = write_exported(tmp_path / "healthy", poses)
    (healthy / "healthy.txt").write_text("axisAlignment = 0 -1 0 5 1 0 0 0 0 0 1 -1 0 0 0 1\n")
    files = [str(p.relative_to(healthy)) for p in sorted(healthy.rglob("*.*"))]
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    assert hold_to_data_error(lambda f: list(open_recording(f)), healthy, files, scratch, cases=1000) > 300


@pytest.mark.parametrize(("colour", "depth"), [(2, 1), (1, 0)])
def test_fuzz_sens_only_data_errors(tmp_path: Path, poses, colour: int, depth: int):
    healthy = tmp_path / "healthy"
    write_sens(healthy / "a.sens", poses, colour, depth)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    assert hold_to_data_error(lambda f: list(open_recording(f)), healthy, ["a.sens"], scratch, cases=1000) > 300
    shutil.rmtree(scratch)
