"""Recordings of other formats than ScanNet's: one walk through a rendered home, written by hand in each, and damaged ones."""

from __future__ import annotations

import io
import json
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import numpy.typing as npt
import pytest
from fuzzing import hold_to_data_error
from PIL import Image
from scipy.spatial.transform import Rotation

from openmap_env.rendering import make_renderer
from openmap_scenes import DataError, PinholeCamera, Scene
from openmap_scenes.recordings import open_recording

# Of the shape of the freiburg3 camera at a tenth of its size, edges where they were.
DEPTH = PinholeCamera(64, 48, 53.54, 53.92, 31.56, 24.31)
COLOUR = PinholeCamera(128, 96, 107.08, 107.84, 63.62, 49.12)
OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
# From our world to one with Z up: x stays, -z becomes y, y becomes z.
ZUP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
LOW, HIGH = slice(0, 5), slice(5, None)  # columns of low and of high confidence


class Walk:
    """What the camera saw: colour at two sizes, depth, poses in our frame."""

    def __init__(self, scene: Scene) -> None:
        self.poses = []
        for x, turn, tilt in ((-3.0, 0.3, -0.2), (-1.0, 2.0, -0.4), (0.5, 3.5, 0.1), (0.2, 5.0, -0.3)):
            pose = np.eye(4)
            pose[:3, :3] = (Rotation.from_euler("y", turn) * Rotation.from_euler("x", tilt)).as_matrix()
            pose[:3, 3] = x, 1.4, 0.3
            self.poses.append(pose)
        small, large = (make_renderer("raycast", scene, camera) for camera in (DEPTH, COLOUR))
        seen = [(small.render(pose), large.render(pose)) for pose in self.poses]
        self.depth = [np.array(s.depth, np.float32) for s, _ in seen]
        self.rgb = [np.array(s.rgb) for s, _ in seen]
        self.fine = [np.array(f.rgb) for _, f in seen]

    def points(self, k: int) -> npt.NDArray[np.float32]:
        return DEPTH.unproject(self.depth[k], self.poses[k])


@pytest.fixture(scope="module")
def walk(toy_scene: Scene) -> Walk:
    return Walk(toy_scene)


def save(path: Path, pixels: npt.NDArray[np.generic]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".npy":
        np.save(path, pixels)
    else:
        Image.fromarray(pixels).save(path, **({"quality": 97} if path.suffix == ".jpg" else {}))


def units(depth: npt.NDArray[np.float32], scale: float) -> npt.NDArray[np.uint16]:
    return np.rint(depth.astype(np.float64) * scale).astype(np.uint16)


def quaternion(pose: npt.NDArray[np.float64]) -> list[float]:
    return Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()


def write_tum(folder: Path, walk: Walk, name: str = "rgbd_dataset_freiburg3_toy") -> Path:
    folder = folder / name
    rgb, depth, truth = (
        ["# color images", "# timestamp filename"],
        ["# depth maps"],
        ["# timestamp tx ty tz qx qy qz qw"],
    )
    for k, pose in enumerate(walk.poses):
        t = 1000.0 + k
        save(folder / f"rgb/{t:.6f}.png", walk.rgb[k])
        save(folder / f"depth/{t + 0.011:.6f}.png", units(walk.depth[k], 5000))
        rgb.append(f"{t:.6f} rgb/{t:.6f}.png")
        depth.append(f"{t + 0.011:.6f} depth/{t + 0.011:.6f}.png")
        T = ZUP @ pose @ OPENCV
        # A nearer line and farther ones, of another place.
        for late, shift in ((-0.009, 1.0), (0.004, 0.0), (0.014, 2.0)):
            numbers = [*(T[:3, 3] + shift), *quaternion(T)]
            truth.append(f"{t + late:.4f} " + " ".join(f"{v:.8f}" for v in numbers))
    for part, lines in (("rgb", rgb), ("depth", depth), ("groundtruth", truth)):
        (folder / f"{part}.txt").write_text("\n".join(lines) + "\n")
    return folder


def write_replica(folder: Path, walk: Walk) -> Path:
    folder = folder / "room0"
    lines = []
    for k, pose in enumerate(walk.poses):
        save(folder / f"results/frame{k:06d}.jpg", walk.rgb[k])
        save(folder / f"results/depth{k:06d}.png", units(walk.depth[k], 6553.5))
        lines.append(" ".join(f"{v:.18e}" for v in (ZUP @ pose @ OPENCV).ravel()))
    (folder / "traj.txt").write_text("\n".join(lines) + "\n")
    camera = {"w": 64, "h": 48, "fx": 53.54, "fy": 53.92, "cx": 31.56, "cy": 24.31, "scale": 6553.5}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return folder


def metadata(walk: Walk) -> dict[str, object]:
    K = [COLOUR.fx, 0, 0, 0, COLOUR.fy, 0, COLOUR.cx, COLOUR.cy, 1]
    poses = [[*quaternion(pose), *pose[:3, 3].tolist()] for pose in walk.poses]
    return {"w": 128, "h": 96, "dw": 64, "dh": 48, "K": K, "fps": 30, "poses": poses, "initPose": [0, 0, 0, 1, 0, 0, 0]}


def write_record3d(folder: Path, walk: Walk) -> Path:
    """As the app unpacks, its depth saved as numbers; low confidence at the left, with nonsense there."""
    folder = folder / "r3d"
    for k, depth in enumerate(walk.depth):
        depth, sure = depth.copy(), np.full(depth.shape, 2, np.uint8)
        depth[:, LOW], sure[:, LOW] = 0.123, 0
        depth[depth == 0] = np.nan
        save(folder / f"rgbd/{k}.jpg", walk.fine[k])
        save(folder / f"rgbd/{k}.npy", depth)
        save(folder / f"rgbd/{k}.conf.npy", sure)
    (folder / "metadata").write_text(json.dumps(metadata(walk)))
    return folder


def write_converted(folder: Path, walk: Walk) -> Path:
    """As scripts convert it: all pictures as small as depth, poses in files of their own."""
    folder = folder / "converted"
    for k, pose in enumerate(walk.poses):
        save(folder / f"rgb/{k}.png", walk.rgb[k])
        save(folder / f"depth/{k}.png", units(walk.depth[k], 1000))
        sure = np.full(walk.depth[k].shape, 1, np.uint8)
        sure[:, LOW] = 0
        save(folder / f"conf/{k}.npy", sure)
        save(folder / f"poses/{k}.npy", pose.astype(np.float32))
        save(folder / f"rgbd/{k}.jpg", walk.fine[k])
        (folder / f"rgbd/{k}.depth").write_bytes(b"bvx2")
    (folder / "metadata").write_text(json.dumps(metadata(walk)))
    return folder


def own_index(axes: str, up: str, ending: str, walk: Walk) -> dict[str, object]:
    frames = []
    for k, pose in enumerate(walk.poses):
        T = (ZUP if up == "z" else np.eye(4)) @ pose @ (OPENCV if axes == "opencv" else np.eye(4))
        frames.append({"color": f"color/{k}.jpg", "depth": f"depth/{k}.{ending}", "T_world_camera": T.tolist()})
    camera = {"width": 128, "height": 96, "fx": COLOUR.fx, "fy": COLOUR.fy, "cx": COLOUR.cx, "cy": COLOUR.cy}
    index: dict[str, object] = {"format": "openmap-recording", "version": 1, "camera": camera}
    return {**index, "depth_scale": 1000, "axes": axes, "up": up, "frames": frames}


def write_own(folder: Path, walk: Walk, axes: str = "opengl", up: str = "y", ending: str = "png") -> Path:
    folder = folder / f"own-{axes}-{up}-{ending}"
    for k, depth in enumerate(walk.depth):
        save(folder / f"color/{k}.jpg", walk.fine[k])
        save(folder / f"depth/{k}.{ending}", depth if ending == "npy" else units(depth, 1000))
    (folder / "recording.json").write_text(json.dumps(own_index(axes, up, ending, walk)))
    return folder


def write_own_opencv(folder: Path, walk: Walk) -> Path:
    return write_own(folder, walk, "opencv", "z", "npy")


WRITERS: dict[str, Callable[[Path, Walk], Path]] = {
    "tum": write_tum,
    "replica": write_replica,
    "record3d": write_record3d,
    "converted": write_converted,
    "own": write_own,
    "own opencv": write_own_opencv,
}
KIND = {"converted": "record3d", "own": "openmap", "own opencv": "openmap"}
every_format = pytest.mark.parametrize("form", WRITERS)


@every_format
def test_every_format_puts_the_points_where_they_were(tmp_path: Path, walk: Walk, toy_scene: Scene, form: str):
    import open3d as o3d

    recording = open_recording(WRITERS[form](tmp_path, walk))
    for name in ("width", "height"):
        assert getattr(recording.camera, name) == getattr(DEPTH, name)
    for name in ("fx", "fy", "cx", "cy"):
        assert getattr(recording.camera, name) == pytest.approx(getattr(DEPTH, name), abs=1e-9)
    assert (len(recording), recording.skipped) == (4, ())
    surface = o3d.t.geometry.RaycastingScene()
    surface.add_triangles(toy_scene.vertices, toy_scene.faces.astype(np.uint32))
    columns = HIGH if form in ("record3d", "converted") else slice(None)
    for k, frame in enumerate(recording):
        assert frame.index == k
        assert (frame.rgb.dtype, frame.depth.dtype, frame.T_world_camera.dtype) == (np.uint8, np.float32, np.float64)
        np.testing.assert_allclose(frame.T_world_camera, walk.poses[k], atol=1e-6)
        points = recording.camera.unproject(frame.depth, frame.T_world_camera)
        np.testing.assert_allclose(points[:, columns], walk.points(k)[:, columns], atol=1.5e-3)
        on_it = points[frame.depth > 0]
        assert len(on_it) > 1000
        assert surface.compute_distance(on_it).numpy().max() < 2e-3
        # JPEG smears colours and a finer picture has finer edges, so most pixels are held to it and not all.
        assert (np.abs(frame.rgb.astype(int) - walk.rgb[k]).max(axis=-1) < 16).mean() > 0.75
        if columns == HIGH:
            assert (frame.depth[:, LOW] == 0).all()


@every_format
def test_frames_by_position_are_those_in_turn_and_read_alone(tmp_path: Path, walk: Walk, form: str):
    folder = WRITERS[form](tmp_path, walk)
    recording = open_recording(folder)
    third = list(recording)[2]
    # Another frame's damage does not matter to this one.
    for broken in [p for p in folder.rglob("*1*") if p.is_file() and p.stem.lstrip("framedpth0") == "1"]:
        broken.write_bytes(b"")
    alone = recording.frame(2)
    assert alone.index == third.index
    np.testing.assert_array_equal(alone.depth, third.depth)
    np.testing.assert_array_equal(alone.rgb, third.rgb)
    np.testing.assert_array_equal(alone.T_world_camera, third.T_world_camera)
    for position in (-1, 4):
        with pytest.raises(IndexError, match=r"expected 0\.\.3"):
            recording.frame(position)


@every_format
def test_fuzz_only_data_errors(tmp_path: Path, walk: Walk, form: str):
    healthy = WRITERS[form](tmp_path / "healthy", walk)
    if form == "replica":
        (healthy / "cam_params.json").write_bytes((healthy.parent / "cam_params.json").read_bytes())
    names = [str(p.relative_to(healthy)) for p in sorted(healthy.rglob("*")) if p.is_file()]
    # Lists and trajectories decide most.
    texts = [name for name in names if "/" not in name]
    files = names + texts * (len(names) // len(texts))
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    assert hold_to_data_error(lambda f: list(open_recording(f)), healthy, files, scratch, cases=150) > 30


def png(shape: tuple[int, ...], dtype: type) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(np.zeros(shape, dtype)).save(stream, "PNG")
    return stream.getvalue()


def bomb() -> bytes:
    """A PNG that says it is 60,000 pixels wide and high."""
    data = bytearray(png((2, 2), np.uint16))
    data[16:24] = (60000).to_bytes(4, "big") * 2
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    return bytes(data)


def npy(array: npt.NDArray[np.generic], allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=allow_pickle)
    return stream.getvalue()


IDENTITY = " ".join(f"{v:g}" for v in np.eye(4).ravel())


@pytest.mark.parametrize(
    ("form", "name", "how", "says"),
    [
        ("tum", "groundtruth.txt", None, r"groundtruth.txt: found no such file, expected lines of timestamp tx"),
        ("tum", "groundtruth.txt", b"# nothing\n", "found no poses"),
        ("tum", "groundtruth.txt", b"1000 0 0 0 0 0 0\n", r"groundtruth.txt line 1: found 7 numbers"),
        ("tum", "groundtruth.txt", b"1000 0 0 0 0 0 0 0\n", r"line 1: found a quaternion of length 0"),
        ("tum", "groundtruth.txt", b"1000 0 0 0 1 1 0 0\n", r"line 1: found a quaternion of length 1.41"),
        ("tum", "groundtruth.txt", b"1000 inf 0 0 0 0 0 1\n", r"line 1: found an infinite number"),
        ("tum", "groundtruth.txt", b"1000 0 x 0 0 0 0 1\n", r"line 1: found words that are no numbers"),
        ("tum", "groundtruth.txt", b"5000 0 0 0 0 0 0 1\n", r"no frame with a pose, and 4 without"),
        ("tum", "rgb.txt", b"1000 ../../etc/passwd\n", r"rgb.txt line 1: found the name '../../etc/passwd'"),
        ("tum", "rgb.txt", b"1000 /etc/passwd\n", r"rgb.txt line 1: found the name '/etc/passwd'"),
        ("tum", "rgb.txt", b"1000\n", r"rgb.txt line 1: found 1 words"),
        ("tum", "rgb.txt", b"nan rgb/a.png\n", r"rgb.txt line 1: found the time nan"),
        ("tum", "rgb.txt", b"", r"rgb.txt: found no lines"),
        ("tum", "depth.txt", b"2000 depth/a.png\n", r"no two lines of rgb.txt and depth.txt of one time"),
        ("tum", "rgb/1001.000000.png", None, r"rgb/1001.000000.png: found no such file"),
        ("tum", "depth/1000.011000.png", png((3, 30), np.uint16), r"pictures of 30 x 3 px for a camera of 640 x 480"),
        ("tum", "depth/1001.011000.png", png((48, 63), np.uint16), r"found 63 x 48 pixels, expected 64 x 48"),
        ("tum", "depth/1001.011000.png", png((48, 64), np.uint8), r"uint8 pixels"),
        ("tum", "depth/1000.011000.png", bomb(), r"1000.011000.png: found (60000 x 60000 pixels|no picture)"),
        ("replica", "traj.txt", None, r"traj.txt: found no such file"),
        ("replica", "traj.txt", f"{IDENTITY}\n".encode(), r"found 1 poses for 4 frames"),
        ("replica", "traj.txt", f"{IDENTITY[2:]}\n".encode() * 4, r"traj.txt line 1: found 15 numbers"),
        (
            "replica",
            "traj.txt",
            f"nan{IDENTITY[1:]}\n".encode() * 4,
            r"line 1: found a pose of frame 0 that is not finite",
        ),
        ("replica", "traj.txt", f"2{IDENTITY[1:]}\n".encode() * 4, r"line 1: found a pose of frame 0 whose 3x3"),
        ("replica", "results/depth000002.png", None, r"results: found no depth of frame 2"),
        ("replica", "results/frame000002.jpg", None, r"results: found no colour of frame 2"),
        ("replica", "cam_params.json", b'{"camera": {"w": 64}}', r"cam_params.json: found nothing at camera.h"),
        ("replica", "cam_params.json", b"[", r"cam_params.json: found broken JSON"),
        ("record3d", "metadata", b"{}", r"metadata: found nothing at poses"),
        ("record3d", "metadata", b"[]", r"metadata: found \[\] at the top, expected an object"),
        ("record3d", "rgbd/2.npy", None, r"found frame 2 without depth"),
        ("record3d", "rgbd/2.jpg", None, r"found frame 2 without colour"),
        (
            "record3d",
            "rgbd/2.npy",
            npy(np.full((48, 64), 2000.0)),
            r"2.npy: found depths of 2000 to 2000, expected metres",
        ),
        ("record3d", "rgbd/2.npy", npy(np.full((48, 64), -1.0)), r"2.npy: found depths of -1 to -1"),
        ("record3d", "rgbd/2.npy", npy(np.zeros((48, 63))), r"2.npy: found an array of shape \(48, 63\)"),
        ("record3d", "rgbd/2.npy", npy(np.zeros((48, 64), bool)), r"2.npy: found an array of bool"),
        ("record3d", "rgbd/2.npy", npy(np.array({1: 2}, object), True), r"2.npy: found an array of object"),
        (
            "record3d",
            "rgbd/2.npy",
            npy(np.zeros((48, 64)))[:-8],
            r"2.npy: found 24568 bytes of numbers, expected 24576",
        ),
        ("record3d", "rgbd/0.npy", npy(np.zeros(5)), r"0.npy: found an array of shape \(5,\), expected a picture"),
        ("record3d", "rgbd/1.conf.npy", npy(np.zeros((48, 64))), r"1.conf.npy: found confidence of type float64"),
        ("converted", "poses/1.npy", npy(np.zeros((4, 4))), r"1.npy: found a pose of frame 1"),
        ("converted", "poses/1.npy", npy(np.eye(3)), r"1.npy: found an array of shape \(3, 3\)"),
        ("converted", "poses/1.npy", npy(np.full((4, 4), np.nan)), r"a pose of frame 1 that is not finite"),
        ("converted", "poses/1.npy", None, r"found frame 1 without pose"),
        ("own", "color/1.jpg", None, r"color/1.jpg: found no such file"),
        ("own", "depth/3.png", b"", r"depth/3.png: found 0 bytes"),
        ("own", "recording.json", b"{", r"recording.json: found broken JSON"),
    ],
)
def test_what_is_broken_is_refused_by_name(tmp_path: Path, walk: Walk, form: str, name: str, how: object, says: str):
    folder = WRITERS[form](tmp_path, walk)
    if how is None:
        (folder / name).unlink()
    else:
        assert isinstance(how, bytes)
        (folder / name).write_bytes(how)
    with pytest.raises(DataError, match=says) as caught:
        list(open_recording(folder, KIND.get(form, form)))
    assert str(folder) in caught.value.source


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (["format"], "other", "'other' at format, expected 'openmap-recording'"),
        (["version"], 2, "2 at version, expected version 1. A newer version"),
        (["camera", "fx"], -1, "intrinsics fx=-1"),
        (["camera", "width"], 0, "0 x 96 pixels"),
        (["camera", "width"], 640, "pictures of 64 x 48 px for a camera of 640 x 96 px"),
        (["depth_scale"], 0, "0 at depth_scale"),
        (["axes"], "colmap", "'colmap' at axes, expected 'opengl' or 'opencv'"),
        (["up"], "x", "'x' at up, expected 'y' or 'z'"),
        (["frames"], [], "no frame with a pose"),
        (["frames"], {}, "at frames, expected a list"),
        (["frames", 1], 3, r"3 at frames\[1\], expected an object"),
        (["frames", 1, "color"], "../color/1.jpg", r"frames\[1\].color: found the name"),
        (["frames", 1, "depth"], "/depth/1.png", r"frames\[1\].depth: found the name"),
        (["frames", 1, "depth"], "depth/\0.png", r"frames\[1\].depth: found the name"),
        (["frames", 1, "depth"], "", r"frames\[1\].depth: found the name ''"),
        (["frames", 1, "depth"], None, r"nothing at frames\[1\].depth, expected a string"),
        (["frames", 1, "T_world_camera"], [[1, 0, 0, 0]] * 3, r"frames\[1\].T_world_camera, expected four rows"),
        (["frames", 1, "T_world_camera"], np.zeros((4, 4)).tolist(), r"frames\[1\]: found a pose of frame 1"),
        (["frames", 1, "T_world_camera"], np.full((4, 4), np.nan).tolist(), "broken JSON .the constant NaN"),
    ],
)
def test_a_wrong_value_in_an_index_of_ones_own_is_named(
    tmp_path: Path, walk: Walk, place: list, value: object, says: str
):
    folder = write_own(tmp_path, walk)
    index = own_index("opengl", "y", "png", walk)
    inner: object = index
    for key in place[:-1]:
        inner = inner[key]  # type: ignore[index]
    inner[place[-1]] = value  # type: ignore[index]
    (folder / "recording.json").write_text(json.dumps(index))
    with pytest.raises(DataError, match=says) as caught:
        list(open_recording(folder))
    assert str(folder) in caught.value.source


def test_a_link_does_not_lead_out_of_the_folder(tmp_path: Path, walk: Walk):
    folder = write_own(tmp_path, walk)
    outside = tmp_path / "outside.jpg"
    (folder / "color/1.jpg").rename(outside)
    (folder / "color/1.jpg").symlink_to(outside)
    with pytest.raises(DataError, match=r"frames\[1\].color: found the name 'color/1.jpg'"):
        open_recording(folder)


def test_frames_without_tracking_are_skipped_and_listed(tmp_path: Path, walk: Walk):
    own = write_own(tmp_path, walk)
    index = own_index("opengl", "y", "png", walk)
    index["frames"][1]["T_world_camera"] = None  # type: ignore[index]
    (own / "recording.json").write_text(json.dumps(index))
    tum = write_tum(tmp_path, walk)
    lines = (tum / "groundtruth.txt").read_text().splitlines()
    lost = [
        f"{line.split()[0]} nan nan nan nan nan nan nan" if line.startswith(("1000.9", "1001.0")) else line
        for line in lines
    ]
    assert lost != lines
    (tum / "groundtruth.txt").write_text("\n".join(lost))
    for folder in (own, tum):
        recording = open_recording(folder)
        assert recording.skipped == (1,)
        assert len(recording) == 3
        assert [frame.index for frame in recording] == [0, 2, 3]
        np.testing.assert_allclose(recording.frame(1).T_world_camera, walk.poses[2], atol=1e-6)


def test_a_sequence_that_was_cut_short_gives_its_whole_frames_if_asked(tmp_path: Path, walk: Walk):
    replica, r3d = write_replica(tmp_path, walk), write_record3d(tmp_path, walk)
    for lost in (replica / "results/depth000003.png", r3d / "rgbd/3.npy"):
        lost.unlink()
    for folder in (replica, r3d):
        with pytest.raises(DataError, match="frame 3"):
            open_recording(folder)
        assert [frame.index for frame in open_recording(folder, lenient=True)] == [0, 1, 2]
    lines = (replica / "traj.txt").read_text().splitlines()
    (replica / "traj.txt").write_text("\n".join(lines[:2]))
    assert [frame.index for frame in open_recording(replica, lenient=True)] == [0, 1]


def lzfse(data: bytes) -> bytes:
    """Plain blocks, as LZFSE keeps what it cannot make smaller."""
    blocks = [data[i : i + 4096] for i in range(0, len(data), 4096)]
    return b"".join(b"bvx-" + len(b).to_bytes(4, "little") + b for b in blocks) + b"bvx$"


def plain_blocks(data: bytes) -> bytes:
    at, plain = 0, b""
    while data[at : at + 4] == b"bvx-":
        size = int.from_bytes(data[at + 4 : at + 8], "little")
        plain += data[at + 8 : at + 8 + size]
        at += 8 + size
    return plain


def write_packed(folder: Path, walk: Walk, pack: Callable[[bytes], bytes] = lzfse) -> Path:
    folder = write_record3d(folder, walk)
    for part, ending in ((".npy", ".depth"), (".conf.npy", ".conf")):
        for k in range(4):
            path = folder / f"rgbd/{k}{part}"
            (folder / f"rgbd/{k}{ending}").write_bytes(pack(np.load(path).tobytes()))
            path.unlink()
    return folder


def hold_to_the_walk(folder: Path, walk: Walk) -> None:
    for k, frame in enumerate(open_recording(folder)):
        np.testing.assert_array_equal(frame.depth[:, HIGH], walk.depth[k][:, HIGH])
        assert (frame.depth[:, LOW] == 0).all()


def test_packed_depth_is_read_with_the_library_for_it(tmp_path: Path, walk: Walk, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "liblzfse", SimpleNamespace(decompress=plain_blocks))
    folder = write_packed(tmp_path, walk)
    hold_to_the_walk(folder, walk)
    without = {key: value for key, value in metadata(walk).items() if key not in ("dw", "dh")}
    (folder / "metadata").write_text(json.dumps(without))
    hold_to_the_walk(folder, walk)
    whole = (folder / "rgbd/1.depth").read_bytes()
    for data, says in (
        (b"", "LZFSE data that end in a block at byte 0"),
        (b"nonsense", "a block b'nons' at byte 0"),
        (whole[:-4], "LZFSE data that end in a block"),
        (lzfse(bytes(100)), "data that unpack to 100 bytes, expected 12288 bytes"),
        (b"bvxn" + bytes(7) + b"bvx$", "LZFSE data that end"),
        (b"bvxn\xff\xff\xff\xff" + bytes(4) + b"bvx$", "data that unpack to 4294967295 bytes and more"),
        (b"bvx2\xff\xff\x00\x00" + bytes(24), "a block b'bvx2'|data that unpack to|end in a block"),
    ):
        (folder / "rgbd/1.depth").write_bytes(data)
        with pytest.raises(DataError, match=says) as caught:
            list(open_recording(folder))
        assert "1.depth" in caught.value.source


def test_packed_depth_as_the_library_makes_it(tmp_path: Path, walk: Walk):
    library = pytest.importorskip("liblzfse")
    folder = write_packed(tmp_path / "healthy", walk, library.compress)
    hold_to_the_walk(folder, walk)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    files = [str(path.relative_to(folder)) for path in sorted(folder.glob("rgbd/*.[dc]*"))]
    assert hold_to_data_error(lambda f: list(open_recording(f)), folder, files, scratch, cases=200) > 30


def test_depth_as_exr(tmp_path: Path, walk: Walk):
    library = pytest.importorskip("OpenEXR")
    folder = tmp_path / "healthy" / "exr"
    (folder / "depth").mkdir(parents=True)
    for k, depth in enumerate(walk.depth):
        save(folder / f"rgb/{k}.jpg", walk.fine[k])
        header = {"type": library.scanlineimage, "compression": library.ZIP_COMPRESSION}
        library.File(header, {"R": depth}).write(str(folder / f"depth/{k}.exr"))
    (folder / "metadata.json").write_text(json.dumps(metadata(walk)))
    for k, frame in enumerate(open_recording(folder)):
        np.testing.assert_array_equal(frame.depth, walk.depth[k])
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    files = [f"depth/{k}.exr" for k in range(4)]
    assert hold_to_data_error(lambda f: list(open_recording(f)), folder, files, scratch, cases=200) > 30


def test_packed_depth_without_the_library_is_refused_with_the_way_out(
    tmp_path: Path, walk: Walk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    for name in ("liblzfse", "OpenEXR"):
        monkeypatch.setitem(sys.modules, name, None)  # as if it were not installed
    folder = write_packed(tmp_path, walk)
    with pytest.raises(DataError, match=r"0.depth: found data that pyliblzfse.*pip install pyliblzfse.*as N.npy"):
        open_recording(folder)
    (folder / "depth").mkdir()
    for k in range(4):
        (folder / f"rgbd/{k}.depth").rename(folder / f"depth/{k}.exr")
    with pytest.raises(DataError, match=r"0.exr: found data that OpenEXR.*pip install OpenEXR.*convert N.exr to N.npy"):
        open_recording(folder)
    for k, depth in enumerate(walk.depth):
        save(folder / f"depth/{k}.npy", depth)
    # Depth can be read then, though not how sure it is.
    np.testing.assert_array_equal(open_recording(folder).frame(1).depth, walk.depth[1])
    assert "depth of low confidence is kept" in caplog.text
    archive = tmp_path / "walk.r3d"
    archive.write_bytes(b"PK")
    with pytest.raises(DataError, match=r"walk.r3d: found a packed Record3D recording.*unpack it"):
        open_recording(archive)


def test_the_camera_of_a_tum_folder(tmp_path: Path, walk: Walk, caplog: pytest.LogCaptureFixture):
    plain = write_tum(tmp_path, walk, "kitchen")
    assert open_recording(plain).camera.fx == pytest.approx(52.5)
    assert [r.getMessage().count("\n") for r in caplog.records] == [0]
    assert "fx=525 fy=525 cx=319.5 cy=239.5" in caplog.text
    caplog.clear()
    for text in ("50 51 31 23\n", "# given\n50 0 31\n0 51 23\n0 0 1\n"):
        (plain / "camera.txt").write_text(text)
        assert open_recording(plain).camera == PinholeCamera(64, 48, 50.0, 51.0, 31.0, 23.0)
    (plain / "camera.txt").write_text("50 51 31")
    with pytest.raises(DataError, match=r"camera.txt: found 3 numbers, expected fx fy cx cy"):
        open_recording(plain)
    for name, fx in (("rgbd_dataset_freiburg1_desk", 51.73), ("freiburg2_xyz", 52.09), ("fr3_office", 53.54)):
        assert open_recording(write_tum(tmp_path, walk, name)).camera.fx == pytest.approx(fx)
    assert not caplog.records


def test_a_folder_that_looks_like_two_is_asked_about_and_one_kind_can_be_named(tmp_path: Path, walk: Walk):
    folder = write_tum(tmp_path, walk)
    for path in sorted(write_own(tmp_path, walk).rglob("*")):
        if path.is_file():
            other = folder / path.relative_to(tmp_path / "own-opengl-y-png")
            other.parent.mkdir(exist_ok=True)
            other.write_bytes(path.read_bytes())
    with pytest.raises(DataError, match=r"looks like openmap and tum.*Name one of them as the kind"):
        open_recording(folder)
    assert type(open_recording(folder, "tum")) is not type(open_recording(folder, "openmap"))
    assert len(open_recording(folder / "recording.json")) == 4
    with pytest.raises(
        DataError, match=r"kind of recording: found 'rosbag', expected one of openmap \(recording.json\); tum"
    ):
        open_recording(folder, "rosbag")
    (tmp_path / "film.mp4").write_bytes(b"")
    with pytest.raises(DataError, match="a file of another kind, expected one of openmap"):
        open_recording(tmp_path / "film.mp4")
