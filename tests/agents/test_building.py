"""A recording becomes a map; what is kept on the way makes no difference to it, and is of one run alone."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from walks import NAMES, write_walk

from openmap_agents.building import FrameReport, build_map
from openmap_agents.kept_frames import KeptFrames
from openmap_agents.mapping import MappingSettings
from openmap_agents.perception import Masks, make_encoder
from openmap_agents.perception.protocol import Calibration
from openmap_scenes import DataError
from openmap_scenes.recordings import Recording, open_recording, subsampled

MADE_BY = ("embedded", "embedded")


class ByColour:
    """Sees cards as connected pieces of one hue; its features are what the true names are in the space of words, with noise."""

    calibration = Calibration(10.0, -5.0)

    def __init__(self) -> None:
        self._words = make_encoder()
        self.dim = self._words.dim
        self._named = self.encode_text(NAMES)
        self.looked = 0

    def segment(self, rgb, depth, T_world_camera, camera) -> Masks:
        self.looked += 1
        brightness = rgb.astype(int).sum(2)
        levels = np.digitize(brightness, (100, 260, 420, 560, 640)) + 1
        return Masks(levels.astype(np.int32), np.full(6, 0.5, np.float32))

    def encode_regions(self, rgb, depth, masks, T_world_camera, camera) -> np.ndarray:
        noise = np.random.default_rng(int(rgb.sum())).normal(0, 0.02, (len(masks), self.dim))
        # Far from unit length: a reader makes it that, and so must a run that keeps nothing.
        return (3.0 * (self._named[: len(masks)] + noise)).astype(np.float32)

    def encode_text(self, texts: list[str]) -> np.ndarray:
        return self._words.encode_text(texts)

    def encode_crops(self, crops: list[np.ndarray]) -> np.ndarray:
        return self._words.encode_crops(crops)


class Stop(BaseException):
    """What a signal does to a run."""


@pytest.fixture(scope="module")
def seer() -> ByColour:
    return ByColour()


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return open_recording(write_walk(tmp_path_factory.mktemp("walk"), 8, blind=(2,), lost=(5,)))


def saved(instance_map, folder: Path) -> bytes:
    instance_map.save(folder / "map.npz")
    return (folder / "map.npz").read_bytes()


def build(walk: Recording, seer: ByColour, **options):
    return build_map(walk, seer, seer, made_by=MADE_BY, **options)


def stopping(after: int):
    def on_frame(report: FrameReport) -> None:
        if report.done == after:
            raise Stop

    return on_frame


def test_the_map_has_things_with_names_colours_and_who_saw_them(walk: Recording, seer: ByColour):
    built = build(walk, seer)
    assert len(built) >= 3
    assert (built.segmenter, built.encoder) == MADE_BY
    assert all(i.label and i.colour is not None for i in built)


def test_frames_without_depth_are_left_out_and_said(walk: Recording, seer: ByColour):
    reports: list[FrameReport] = []
    before = seer.looked
    build(walk, seer, on_frame=reports.append)
    assert [r.index for r in reports] == [0, 1, 2, 3, 4, 6, 7]  # the fifth has no pose
    assert [r.index for r in reports if not r.has_depth] == [2]
    assert seer.looked - before == 6
    assert [r.done for r in reports] == list(range(1, 8))
    assert {r.total for r in reports} == {7}


def test_a_recording_without_any_depth_is_an_error(tmp_path: Path, seer: ByColour):
    blind = open_recording(write_walk(tmp_path, 3, blind=(0, 1, 2)))
    with pytest.raises(DataError, match="3 frames without any depth"):
        build(blind, seer)


def test_a_recording_with_depth_beyond_reach_says_how_far_it_is(walk: Recording, seer: ByColour):
    nearest = min(float(frame.depth[frame.depth > 0].min()) for frame in walk if (frame.depth > 0).any())
    with pytest.raises(DataError, match=rf"no depth below {nearest:.4g}\d* m.*depth_scale"):
        build(walk, seer, settings=MappingSettings(max_depth=nearest / 2))


def test_a_frame_that_cannot_be_mapped_is_named(walk: Recording, seer: ByColour):
    class FarAway:
        """The same walk, with a pose that no tracking gives at its fourth frame."""

        name, camera, skipped = walk.name, walk.camera, walk.skipped

        def __len__(self):
            return len(walk)

        def __iter__(self):
            for n, frame in enumerate(walk):
                T_world_camera = frame.T_world_camera + np.array([[9e3], [0], [0], [0]]) * [0, 0, 0, n == 3]
                yield dataclasses.replace(frame, T_world_camera=T_world_camera)

    with pytest.raises(DataError, match=rf"{walk.name}.*frame 3: T_world_camera lies at"):
        build(FarAway(), seer)


def test_a_part_without_frames_is_an_error(walk: Recording, seer: ByColour):
    with pytest.raises(DataError, match="no frame to use, 1 without a pose"):
        build(subsampled(walk, first=99), seer)


@pytest.mark.parametrize("after", [1, 3, 7])
def test_a_run_that_was_stopped_goes_on_to_the_same_bytes(walk: Recording, seer: ByColour, tmp_path: Path, after: int):
    whole = saved(build(walk, seer), tmp_path)
    with pytest.raises(Stop):
        build(walk, seer, keep=tmp_path / "kept", on_frame=stopping(after))
    reports: list[FrameReport] = []
    before = seer.looked
    assert saved(build(walk, seer, keep=tmp_path / "kept", on_frame=reports.append), tmp_path) == whole
    usable = [r for r in reports if r.has_depth]
    assert [r.kept for r in usable] == [r.done <= after for r in usable]
    assert seer.looked - before == sum(not r.kept for r in usable)


def test_what_was_half_written_is_seen_again(walk: Recording, seer: ByColour, tmp_path: Path):
    whole = saved(build(walk, seer, keep=tmp_path / "kept"), tmp_path)
    journal = tmp_path / "kept" / "frames.jsonl"
    journal.write_bytes(journal.read_bytes()[:-30])  # the last line is cut
    damaged = tmp_path / "kept" / "000003.npz"
    damaged.write_bytes(damaged.read_bytes()[:100])
    (tmp_path / "kept" / ".000006.npzabc.tmp").write_bytes(b"half")
    reports: list[FrameReport] = []
    assert saved(build(walk, seer, keep=tmp_path / "kept", on_frame=reports.append), tmp_path) == whole
    assert [r.done - 1 for r in reports if r.has_depth and not r.kept] == [3, 6]
    again: list[FrameReport] = []
    build(walk, seer, keep=tmp_path / "kept", on_frame=again.append)
    assert all(r.kept for r in again if r.has_depth)


def test_frames_of_another_run_are_refused_by_what_differs(walk: Recording, seer: ByColour, tmp_path: Path):
    build(walk, seer, keep=tmp_path / "kept")
    with pytest.raises(DataError, match=r"settings.tau_obs 0\.3.*expected settings.tau_obs 0\.4.*--fresh"):
        build(walk, seer, keep=tmp_path / "kept", settings=MappingSettings(tau_obs=0.4))
    with pytest.raises(DataError, match=r"encoder 'embedded'.*expected encoder 'embedded:x'"):
        build_map(walk, seer, seer, made_by=("embedded", "embedded:x"), keep=tmp_path / "kept")
    with pytest.raises(DataError, match=r"recording.frames 7.*expected recording.frames 4"):
        build(subsampled(walk, 2), seer, keep=tmp_path / "kept")
    with KeptFrames(tmp_path / "kept", fresh=True) as keep:
        build(subsampled(walk, 2), seer, keep=keep)
        assert len(keep) == 3


def test_a_recording_that_has_changed_is_refused(seer: ByColour, tmp_path: Path):
    build(open_recording(write_walk(tmp_path / "walk", 4)), seer, keep=tmp_path / "kept")
    index = tmp_path / "walk" / "recording.json"
    document = json.loads(index.read_text())
    document["frames"][2]["T_world_camera"][0][3] += 0.01
    index.write_text(json.dumps(document))
    with pytest.raises(DataError, match=r"frame 2 .*as it was then"):
        build(open_recording(tmp_path / "walk"), seer, keep=tmp_path / "kept")


@pytest.mark.parametrize(
    ("name", "content"),
    [("run.json", b"[1]"), ("run.json", b"\xff{"), ("frames.jsonl", b'{"frame": 0}\n'), ("frames.jsonl", b"[]\n")],
)
def test_a_folder_that_cannot_be_read_is_one_error(walk, seer, tmp_path: Path, name: str, content: bytes):
    build(walk, seer, keep=tmp_path)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=f"{name}.*--fresh"):
        build(walk, seer, keep=tmp_path)
    with KeptFrames(tmp_path, fresh=True) as keep:
        assert len(keep) == 0


def test_one_process_at_a_time(tmp_path: Path):
    with KeptFrames(tmp_path / "kept"), pytest.raises(DataError, match="another process"):
        KeptFrames(tmp_path / "kept")
    with KeptFrames(tmp_path / "kept") as keep:
        keep.remove()
    assert not (tmp_path / "kept").exists()


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a place where no folder can be made, for root too")
def test_a_place_where_no_folder_can_be_made_is_one_error():
    with pytest.raises(DataError, match="no way to write to it"):
        KeptFrames("/proc/openmap/kept")


def test_a_lock_that_leads_nowhere_is_one_error(tmp_path: Path):
    (tmp_path / "lock").symlink_to(tmp_path / "nowhere" / "lock")
    with pytest.raises(DataError, match="no way to write to it"):
        KeptFrames(tmp_path)


def test_removing_spares_the_files_of_others(tmp_path: Path, walk: Recording, seer: ByColour):
    (tmp_path / "notes.txt").write_text("mine")
    with KeptFrames(tmp_path) as keep:
        build(walk, seer, keep=keep)
        keep.remove()
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
