"""The online map is what the plain reference gives, whatever the frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from openmap_agents.mapping import InstanceMap, MappingSettings, OpenMapper, PinholeCamera, agglomeration
from openmap_agents.mapping.frame import frame_voxels, pack_cells, unpack_keys, voxel_centres
from openmap_agents.mapping.reference import Frame, ReferenceInstance, frame_sets, reference_map
from openmap_agents.mapping.reference_soft import reference_soft_map
from openmap_agents.mapping.settings import Consensus
from openmap_agents.perception.corruption import corrupt
from openmap_eval.mapping.sequence import SequenceSettings, record

VOXEL, WIDTH, HEIGHT = 0.05, 14, 10
# At 2 m a pixel is one voxel wide, so that shifting the camera by voxels shifts the picture by pixels.
CAMERA = PinholeCamera(WIDTH, HEIGHT, 2.0 / VOXEL, 2.0 / VOXEL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
SMALL = MappingSettings(voxel_size=VOXEL, min_mask_pixels=2, min_mask_voxels=2, min_voxels=2, consensus="paper")
SOFT = replace(SMALL, consensus="soft")


def look(world: npt.NDArray[np.int32], x: int, y: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Depth and true labels of a painted wall (rows, columns) 2 m away, seen from x, y voxels along it; 0 = a hole."""
    labels = np.zeros((HEIGHT, WIDTH), np.int32)
    part = world[y : y + HEIGHT, x : x + WIDTH]
    labels[: part.shape[0], : part.shape[1]] = part
    return np.where(labels > 0, np.float32(2.0), np.float32(0.0)), labels


def pose(x: int, y: int) -> npt.NDArray[np.float64]:
    T_world_camera = np.eye(4)
    T_world_camera[:2, 3] = x * VOXEL + 0.013, -y * VOXEL + 0.013
    return T_world_camera


@st.composite
def walks(draw: st.DrawFn) -> list[Frame]:
    """Frames of a wall of rectangles, segmented well or badly: merged, split, dropped, eroded, empty, repeated frames, with and
    without features, many of them alike, so that ties are common."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n_things, n_frames = draw(st.integers(1, 6)), draw(st.integers(1, 9))
    noise, dim = draw(st.sampled_from([0.0, 0.15, 0.5])), draw(st.sampled_from([0, 1, 3]))
    world = np.full((18, 26), 1, np.int32)
    for thing in range(2, n_things + 2):
        top, left = rng.integers(0, 14), rng.integers(0, 22)
        world[top : top + rng.integers(2, 9), left : left + rng.integers(2, 9)] = thing
    world[rng.random(world.shape) < 0.05] = 0
    frames: list[Frame] = []
    for _ in range(n_frames):
        x, y = int(rng.integers(0, 12)), int(rng.integers(0, 8))
        depth, true = look(world, x, y)
        if rng.random() < 0.1:
            depth = np.zeros_like(depth)
        labels = true.copy()
        for thing in range(1, n_things + 2):
            if rng.random() < noise:
                kind, here = rng.integers(4), true == thing
                columns = np.arange(WIDTH)[None, :]
                if kind == 0:
                    labels[here] = rng.integers(0, n_things + 2)
                elif kind == 1:
                    labels[here & (columns > rng.integers(WIDTH))] = n_things + 1 + thing
                elif kind == 2:
                    labels[here & (rng.random(here.shape) < 0.3)] = 0
                else:
                    depth = np.where(here, np.float32(rng.choice([1.0, 2.5])), depth)
        if rng.random() < 0.1:
            labels[:] = 0
        features = None
        if dim and rng.random() < 0.9:
            features = rng.integers(-1, 3, (int(labels.max(initial=0)) + 2, dim)).astype(np.float32)
        frames.append((depth, labels, features, pose(x, y)))
        if rng.random() < 0.2:
            frames.append(frames[rng.integers(len(frames))])
    return frames


def run(frames: list[Frame], choice: MappingSettings, camera: PinholeCamera = CAMERA) -> InstanceMap:
    mapper = OpenMapper(camera, choice)
    for frame in frames:
        mapper.integrate(*frame)
    return mapper.finalize()


def plain(frames: list[Frame], choice: MappingSettings, camera: PinholeCamera = CAMERA) -> list[ReferenceInstance]:
    """What the plain twin of the consensus says."""
    return (reference_soft_map if choice.consensus == "soft" else reference_map)(camera, frames, choice)


def assert_same(found: InstanceMap, expected: list[ReferenceInstance], choice: MappingSettings) -> None:
    by_views = {frozenset((int(v[0]), int(v[1])) for v in i.views): i for i in found.instances}
    assert len(by_views) == len(found.instances)
    assert set(by_views) == {i.views for i in expected}
    for instance in expected:
        points = by_views[instance.views].points
        keys = np.array(sorted(instance.voxels), np.int64)
        np.testing.assert_array_equal(points, voxel_centres(keys, choice.voxel_size))
        feature = by_views[instance.views].feature
        assert (feature is None) == (instance.feature is None)
        if feature is not None and instance.feature is not None:
            np.testing.assert_allclose(feature, instance.feature, atol=1e-6)


PAPER = [
    SMALL,
    replace(SMALL, semantics="product"),
    replace(SMALL, semantics="structural", visibility="depth", min_masks=1),
    replace(SMALL, visibility="depth", tau_obs=0.5, tau_undersegmented=0.5, detection_ratio=0.3),
    replace(SMALL, max_views=2, min_novelty=0.3, tau_thres=0.5, tau_structural=0.7, min_mask_voxels=5, tau_overlap=0.5),
    replace(SMALL, min_masks=1, min_voxels=1, tau_undersegmented=1.0, observer_start=50, top_k=2, split_distance=0.05),
    replace(SMALL, semantics="alone", tau_undersegmented=1.0),
    replace(SMALL, observers="contained", semantics="structural", tau_structural=0.9, min_masks=1),
]
SOFTLY = [
    SOFT,
    replace(SOFT, semantics="product", min_masks=1),
    replace(SOFT, semantics="structural", visibility="depth", min_share=0.0, doubt=0.0),
    replace(SOFT, semantics="alone", tau_thres=0.3, tau_obs=0.1),
    replace(SOFT, trust=3.0, tau_soft=0.3, max_views=2, min_novelty=0.3, min_vote=0.6, min_masks=1, min_voxels=1),
]


CHOICES = [*PAPER, *SOFTLY]


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(frames=walks(), choice=st.sampled_from(PAPER))
def test_online_map_equals_the_paper_s_reference_on_random_walks(frames: list[Frame], choice: MappingSettings) -> None:
    assert_same(run(frames, choice), plain(frames, choice), choice)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(frames=walks(), choice=st.sampled_from(SOFTLY))
def test_online_map_equals_the_soft_reference_on_random_walks(frames: list[Frame], choice: MappingSettings) -> None:
    assert_same(run(frames, choice), plain(frames, choice), choice)


@pytest.mark.parametrize("listed", [1, 2])
def test_partners_kept_in_mind_are_never_taken_for_all_there_are(listed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agglomeration, "LISTED", listed)
    rng = np.random.default_rng(3)
    world = np.kron(np.arange(1, 13).reshape(3, 4), np.ones((6, 7), int))[:18, :26].astype(np.int32)
    frames: list[Frame] = []
    for _ in range(14):
        x, y = int(rng.integers(0, 12)), int(rng.integers(0, 8))
        depth, labels = look(world, x, y)
        merged = rng.random(13) < 0.4
        labels = np.where(merged[labels] & (labels > 0), 1 + labels // 4, labels + 4).astype(np.int32)
        frames.append((depth, np.where(depth > 0, labels, 0), rng.normal(0.5, 1, (20, 3)), pose(x, y)))
    choice = replace(SOFT, tau_soft=0.2, min_masks=1, trust=2.0)
    assert_same(run(frames, choice), plain(frames, choice), choice)


@pytest.mark.parametrize("consensus", ["soft", "paper"])
@pytest.mark.parametrize("spec", ["homes:val/0", "homes:val/1", "homes:val/2", "house"])
def test_walks_through_homes_give_the_reference_map(
    spec: str, consensus: Consensus, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Real occlusion, masks true and as segmenters make them in turn, in small pictures of three homes and the shared house."""
    if spec == "house":
        spec = f"mp3d:{request.getfixturevalue('shared_scenes') / 'mp3d' / 'aws_small_house'}"
    walk = record(SequenceSettings(spec, frames=36, width=80, height=60), folder=tmp_path / "walk")
    rng = np.random.default_rng(5)
    frames: list[Frame] = []
    for frame in [walk.frame(n) for n in range(0, 36, 3)] + [walk.frame(1), walk.frame(4)]:
        labels = np.where(frame.depth > 0, frame.instance, 0)
        if len(frames) % 2:
            labels = corrupt(frame.instance, frame.depth, rng, structure=walk.structure, rgb=frame.rgb)
        features = rng.normal(size=(int(labels.max(initial=0)), 6)) + 2.0
        frames.append((frame.depth, labels, features, frame.T_world_camera))
    choice = MappingSettings(voxel_size=0.12, min_mask_pixels=6, min_mask_voxels=3, min_voxels=3, consensus=consensus)
    mapper, expected = OpenMapper(walk.camera, choice), plain(frames, choice, walk.camera)
    for n, frame in enumerate(frames):
        mapper.integrate(*frame)
        if n % 4 == 3:
            _ = mapper.instance_map  # asking must not change what comes out in the end
    found = mapper.finalize()
    assert len(found) > 4
    assert_same(found, expected, choice)


@settings(max_examples=25, deadline=None)
@given(frames=walks(), choice=st.sampled_from(CHOICES))
def test_asking_on_the_way_changes_nothing(frames: list[Frame], choice: MappingSettings) -> None:
    mapper = OpenMapper(CAMERA, choice)
    for n, frame in enumerate(frames):
        mapper.integrate(*frame)
        on_the_way = mapper.instance_map
        if choice.consensus == "paper":
            assert_same(on_the_way, plain(frames[: n + 1], choice), choice)
        if n % 3 == 2 or n == len(frames) - 1:
            assert_same(mapper.finalize(), plain(frames[: n + 1], choice), choice)


@settings(max_examples=30, deadline=None)
@given(frames=walks())
def test_voxels_of_a_frame_equal_the_plain_sets(frames: list[Frame]) -> None:
    for depth, labels, _, T_world_camera in frames:
        arguments = np.asarray(depth), np.asarray(labels), CAMERA, np.asarray(T_world_camera), SMALL
        fast, (seen, sets) = frame_voxels(*arguments), frame_sets(*arguments)
        assert set(fast.keys.tolist()) == seen
        assert {
            int(name): set(fast.keys[fast.mask == n].tolist()) for n, name in enumerate(fast.labels, start=1)
        } == sets


@given(st.lists(st.tuples(*[st.integers(-(2**20), 2**20 - 1)] * 3), min_size=1, max_size=20))
def test_voxel_keys_keep_cells_and_their_order(cells: list[tuple[int, int, int]]) -> None:
    array = np.array(cells, np.int64)
    keys = pack_cells(array)
    np.testing.assert_array_equal(unpack_keys(keys), array)
    assert [cells[n] for n in np.argsort(keys, kind="stable")] == sorted(cells)


def test_real_recording_gives_the_reference_map(shared_scenes: Path) -> None:
    """Every eighth pixel of 20 frames of a scan, with its instance pictures as masks: real occlusion, real poses."""
    folder = shared_scenes / "scannet" / "scene0900_00"
    K = np.loadtxt(folder / "intrinsic" / "intrinsic_depth.txt")
    step = 8
    camera = PinholeCamera(640 // step, 480 // step, K[0, 0] / step, K[1, 1] / step, K[0, 2] / step, K[1, 2] / step)
    # The scan is Z up and its camera looks along +z with y down; ours is Y up and looks along -z.
    T_world_scan = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    frames: list[Frame] = []
    for n in range(0, 60, 3):
        T_scan_camera = np.loadtxt(folder / "pose" / f"{n}.txt")
        if not np.isfinite(T_scan_camera).all():
            continue
        depth = np.asarray(Image.open(folder / "depth" / f"{n}.png"), np.float32)[::step, ::step] / 1000
        labels = np.asarray(Image.open(folder / "instance-filt" / f"{n}.png"), np.int32)[::step, ::step]
        frames.append((depth, labels, None, T_world_scan @ T_scan_camera @ np.diag([1.0, -1, -1, 1])))
    choice = MappingSettings(voxel_size=0.1, min_mask_pixels=4, min_mask_voxels=3, min_voxels=3, split_distance=0.2)
    found = run(frames, choice, camera)
    assert len(found) > 10
    assert_same(found, plain(frames, choice, camera), choice)


def test_walls_of_two_things_become_two_instances() -> None:
    """Hand-made and without the reference: two things that every frame tells apart, one mask that spans both."""
    world = np.full((18, 26), 1, np.int32)
    world[:, 13:] = 2
    frames: list[Frame] = []
    for x in (4, 5, 6, 7, 8):
        depth, labels = look(world, x, 3)
        frames.append((depth, np.where(labels > 0, 1, 0) if x == 6 else labels, None, pose(x, 3)))
    found = run(frames, SMALL)
    assert len(found) == 2
    assert all(len({int(v[0]) for v in i.views} & {2}) == 0 for i in found.instances), "the spanning mask was kept"
    left, right = sorted(found.instances, key=lambda i: float(i.centre[0]))
    assert float(left.aabb_max[0]) < float(right.aabb_min[0])


def test_shares_find_things_that_no_mask_ever_saw_whole_and_that_many_masks_span() -> None:
    """Hand-made: one of two things is seen in halves that move, and in a third of the frames one mask spans both."""
    world = np.full((18, 26), 1, np.int32)
    world[:, 13:] = 2
    frames: list[Frame] = []
    for k, x in enumerate([3, 4, 5, 6, 7, 8, 7, 6, 5, 4, 3, 5]):
        depth, labels = look(world, x, 3)
        columns = x + np.arange(WIDTH)
        cut = np.where((labels == 2) & (columns[None, :] >= 15 + k % 3), 3, labels)
        frames.append((depth, np.where(labels > 0, 1, 0) if k % 3 == 0 else cut, None, pose(x, 3)))
    found = run(frames, replace(SOFT, tau_soft=0.4))
    assert len(found) == 2
    left, right = sorted(found.instances, key=lambda i: float(i.centre[0]))
    edge = 13 * VOXEL + 0.013 - (WIDTH - 1) / 2 * VOXEL
    assert abs(float(left.aabb_max[0]) - edge) < 1.5 * VOXEL
    assert abs(float(right.aabb_min[0]) - edge) < 1.5 * VOXEL
    assert len(run(frames, SMALL)) != 2, "the yes and no of the paper is enough for these frames"


def test_features_part_what_structure_would_join() -> None:
    """Two frames of three see a picture as part of its wall: structure alone joins them, features that differ do not."""
    choice = replace(SMALL, tau_structural=0.6, tau_undersegmented=0.5)
    world = np.full((18, 26), 1, np.int32)
    world[6:10, 8:14] = 2
    frames: list[Frame] = []
    for k in range(12):
        depth, labels = look(world, 4 + k % 4, 3 + k // 4)
        labels = labels if k % 3 == 0 else np.minimum(labels, 1)
        frames.append((depth, labels, np.eye(3)[:2], pose(4 + k % 4, 3 + k // 4)))
    bare: list[Frame] = [(depth, labels, None, T) for depth, labels, _, T in frames]

    def labels_of(given: list[Frame]) -> list[set[int]]:
        assert_same(run(given, choice), plain(given, choice), choice)
        return [{int(v) for v in i.views[:, 1]} for i in run(given, choice)]

    product = replace(choice, semantics="product", tau_overlap=1.0)
    assert labels_of(bare) == [{1, 2}]
    assert sorted(map(sorted, [{int(v) for v in i.views[:, 1]} for i in run(frames, product)])) == [[1], [2]]
