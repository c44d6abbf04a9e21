"""Recordings of our own that the writer makes, and parts of recordings."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from openmap_scenes import DataError, PinholeCamera
from openmap_scenes.recordings import Frame, RecordingWriter, open_recording, own, subsampled

CAMERA = PinholeCamera(16, 12, 14.0, 13.0, 7.3, 5.6)


def frame_of(k: int) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32], npt.NDArray[np.float64]]:
    rng = np.random.default_rng(k)
    depth = rng.uniform(0.3, 6, (12, 16)).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = 0
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(0, 3, 3)
    return np.full((12, 16, 3), 10 * k + 5, np.uint8), depth, pose


def leftovers(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and path.name.startswith(".")]


@pytest.mark.parametrize("exact", [False, True])
def test_what_is_written_is_read(tmp_path: Path, exact: bool):
    with RecordingWriter(tmp_path / "walk", CAMERA, exact=exact) as writer:
        for k in range(5):
            rgb, depth, pose = frame_of(k)
            writer.append(rgb, depth, None if k == 3 else pose)
    recording = open_recording(tmp_path / "walk")
    assert (recording.name, recording.camera, recording.skipped, len(recording)) == ("walk", CAMERA, (3,), 4)
    for frame, k in zip(recording, (0, 1, 2, 4), strict=True):
        rgb, depth, pose = frame_of(k)
        assert frame.index == k
        np.testing.assert_array_equal(frame.T_world_camera, pose)
        np.testing.assert_allclose(frame.depth, depth, atol=0 if exact else 0.51e-3)
        np.testing.assert_array_equal(frame.depth == 0, depth == 0)
        np.testing.assert_allclose(frame.rgb, rgb, atol=0 if exact else 2)
    assert leftovers(tmp_path) == []


def test_a_refused_frame_changes_nothing(tmp_path: Path):
    rgb, depth, pose = frame_of(0)
    bad_depth, far, sheared, not_finite = depth.copy(), depth.copy(), pose.copy(), depth.copy()
    bad_depth[0, 0], far[0, 0], not_finite[0, 0] = -1, 66, np.nan
    sheared[0, 0] += 1
    with RecordingWriter(tmp_path / "walk", CAMERA) as writer:
        writer.append(rgb, depth, pose)
        for arguments, says in (
            ((rgb[:-1], depth, pose), r"rgb is uint8 of shape \(11, 16, 3\)"),
            ((rgb.astype(float), depth, pose), "rgb is float64"),
            ((rgb, depth[..., None], pose), r"depth is float32 of shape \(12, 16, 1\)"),
            ((rgb, (depth * 1000).astype(np.uint16), pose), "depth is uint16"),
            ((rgb, bad_depth, pose), "expected finite numbers in 0..65.535"),
            ((rgb, far, pose), "expected finite numbers in 0..65.535"),
            ((rgb, not_finite, pose), "expected finite numbers"),
            ((rgb, depth, pose[:3]), r"T_world_camera has shape \(3, 4\)"),
            ((rgb, depth, sheared), "T_world_camera: found a pose whose 3x3 part is not a rotation"),
        ):
            with pytest.raises(ValueError, match=says):
                writer.append(*arguments)
        assert len(writer) == 1
    assert len(open_recording(tmp_path / "walk")) == 1
    assert leftovers(tmp_path) == []


def test_a_recording_is_not_written_over(tmp_path: Path):
    with RecordingWriter(tmp_path, CAMERA) as writer:
        writer.append(*frame_of(0))
    before = (tmp_path / "recording.json").read_bytes()
    with pytest.raises(DataError, match=r"recording.json: found a recording, expected a folder without one"):
        RecordingWriter(tmp_path, CAMERA)
    assert (tmp_path / "recording.json").read_bytes() == before
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="a place where no folder can be made"):
        RecordingWriter(tmp_path / "file", CAMERA)


def test_frames_before_an_exception_are_there(tmp_path: Path):
    def walk() -> None:
        with RecordingWriter(tmp_path, CAMERA) as writer:
            writer.append(*frame_of(0))
            writer.append(*frame_of(1))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        walk()
    assert [frame.index for frame in open_recording(tmp_path)] == [0, 1]


def test_a_disk_that_fails_leaves_whole_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    writer = RecordingWriter(tmp_path, CAMERA)
    writer.append(*frame_of(0))
    writer.close()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(own.os, "replace", full)
        with pytest.raises(DataError, match=r"1.jpg: found a file that cannot be written \(No space"):
            writer.append(*frame_of(1))
        with pytest.raises(DataError, match=r"recording.json: found a file that cannot be written"):
            writer.close()
    assert leftovers(tmp_path) == []
    assert [frame.index for frame in open_recording(tmp_path)] == [0]
    writer.append(*frame_of(1))
    writer.close()
    assert [frame.index for frame in open_recording(tmp_path)] == [0, 1]


def test_a_killed_writer_leaves_a_recording_that_can_be_read(tmp_path: Path):
    script = f"""
import os, numpy as np
from openmap_scenes import PinholeCamera
from openmap_scenes.recordings import RecordingWriter
writer = RecordingWriter({str(tmp_path / "walk")!r}, PinholeCamera(4, 4, 4.0, 4.0, 2.0, 2.0))
for k in range(40):
    writer.append(np.zeros((4, 4, 3), np.uint8), np.ones((4, 4)), np.eye(4))
os.kill(os.getpid(), 9)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    assert subprocess.run([sys.executable, "-c", script], env=environment, check=False).returncode == -9
    assert [frame.index for frame in open_recording(tmp_path / "walk")] == list(range(32))


def test_a_file_of_ones_own_may_leave_out_what_has_a_default(tmp_path: Path):
    with RecordingWriter(tmp_path, CAMERA) as writer:
        writer.append(*frame_of(0))
    index = json.loads((tmp_path / "recording.json").read_text())
    whole = open_recording(tmp_path).frame(0)
    for key in ("depth_scale", "axes", "up"):
        del index[key]
    (tmp_path / "recording.json").write_text(json.dumps(index))
    plain = open_recording(tmp_path).frame(0)
    np.testing.assert_array_equal(plain.depth, whole.depth)
    np.testing.assert_array_equal(plain.T_world_camera, whole.T_world_camera)


class Counted:
    """A recording of numbered frames that notes which were read."""

    name, camera, skipped = "counted", CAMERA, (7,)

    def __init__(self, length: int) -> None:
        self.length, self.read = length, list[int]()

    def __len__(self) -> int:
        return self.length

    def frame(self, position: int) -> Frame:
        self.read.append(position)
        return Frame(position, *frame_of(0))

    def __iter__(self):
        return map(self.frame, range(self.length))


@given(st.integers(0, 30), st.integers(1, 9), st.integers(0, 40), st.none() | st.integers(0, 40))
def test_a_part_is_a_slice_and_reads_no_other_frame(length: int, every: int, first: int, last: int | None):
    whole = Counted(length)
    part = subsampled(whole, every, first, last)
    expected = list(range(length))[first : None if last is None else last + 1 : every]
    assert len(part) == len(expected)
    assert [frame.index for frame in part] == expected == whole.read
    assert (part.name, part.camera, part.skipped) == ("counted", CAMERA, (7,))
    assert [part.frame(i).index for i in range(len(part))] == expected
    with pytest.raises(IndexError):
        part.frame(len(part))


def test_a_part_of_nothing_sensible_is_refused():
    for every, first, last in ((0, 0, None), (1, -1, None), (1, 0, -1)):
        with pytest.raises(ValueError, match=f"every={every}, first={first}, last={last}"):
            subsampled(Counted(3), every, first, last)
