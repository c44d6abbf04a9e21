"""The online mapper at its door and over its life: bad frames, skipped frames, ids, views, structure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from openmap_agents.mapping import InstanceMap, MappingSettings, OpenMapper, PinholeCamera
from openmap_agents.mapping.back_projection import pixel_voxels
from openmap_agents.mapping.frame import unpack_keys, voxel_centres
from openmap_agents.mapping.semantics import CosineStatistics, semantic_weight, soft_weight

CAMERA = PinholeCamera.from_hfov(64, 48, 90.0)
SMALL = MappingSettings(voxel_size=0.05, min_mask_pixels=4, min_mask_voxels=3, min_novelty=0.0)


def pose(x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> npt.NDArray[np.float64]:
    """Camera-to-world at x, 1.2 + y, 0, turned left by ``heading`` rad."""
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, 0, s, x], [0, 1, 0, 1.2 + y], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def room(T_world_camera: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    """Depth and labels of an empty 6 x 2.6 x 6 m room around the origin: 1 floor, 2 ceiling, 3..6 walls, 7 a box on the floor."""
    rays = CAMERA.rays().astype(np.float64) @ T_world_camera[:3, :3].T
    start = T_world_camera[:3, 3]
    depth, labels = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape[:2], np.int32)
    planes = [(1, 0.0, 1), (1, 2.6, 2), (0, -3.0, 3), (0, 3.0, 4), (2, -3.0, 5), (2, 3.0, 6)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, at, label in planes:
            d = (at - start[axis]) / rays[..., axis]
            nearer = (d > 0) & (d < depth)
            depth[nearer], labels[nearer] = d[nearer], label
        for axis, at in ((2, -1.5), (1, 0.5)):
            d = (at - start[axis]) / rays[..., axis]
            hit = start + d[..., None] * rays
            on = (
                (np.abs(hit[..., 0]) < 0.4)
                & (hit[..., 2] <= -1.5 + 1e-6)
                & (hit[..., 2] >= -2.2)
                & (hit[..., 1] <= 0.5 + 1e-6)
            )
            on &= (hit[..., 1] > 0) & (d > 0) & (d < depth)
            depth[on], labels[on] = d[on], 7
    return depth.astype(np.float32), labels


def walk_room(mapper: OpenMapper, n: int = 24, **extra: Any) -> None:
    for k in range(n):
        T_world_camera = pose(0.02 * k, 0.01 * k, 2 * np.pi * k / n * 2)
        depth, labels = room(T_world_camera)
        mapper.integrate(depth, labels, None, T_world_camera, **extra)


def test_room_becomes_six_planes_and_a_box_in_the_right_places() -> None:
    mapper = OpenMapper(CAMERA, SMALL)
    walk_room(mapper, rgb=np.full((48, 64, 3), (10, 200, 30), np.uint8))
    found = mapper.finalize()
    assert sum(i.is_structure for i in found) == 6
    (box,) = [i for i in found if not i.is_structure]
    np.testing.assert_allclose(box.centre, (0.0, 0.25, -1.85), atol=0.1)
    np.testing.assert_allclose(box.aabb_max - box.aabb_min, (0.8, 0.5, 0.7), atol=0.15)
    assert box.colour is not None
    assert box.colour.tolist() == [10, 200, 30]
    assert 0 < box.confidence <= 1
    assert box.n_observations == len(np.unique(box.views[:, 0]))


def test_views_name_the_call_and_the_label_and_come_largest_first() -> None:
    mapper, pictures = OpenMapper(CAMERA, SMALL), []
    for k in range(8):
        T_world_camera = pose(0.1 * k - 0.4)
        depth, labels = room(T_world_camera)
        if k == 3:
            depth[:] = 0
        pictures.append(labels)
        assert mapper.integrate(depth, labels, None, T_world_camera) == (k != 3)
    for instance in mapper.finalize():
        assert (np.diff(instance.views[:, 2]) <= 0).all()
        for call, label, pixels in instance.views.tolist():
            assert call != 3
            assert int((pictures[call] == label).sum()) == pixels


GOOD = room(pose())
BAD: list[tuple[str, dict[str, Any], str]] = [
    ("depth of another size", {"depth": np.zeros((4, 4), np.float32)}, r"depth is .*\(4, 4\), expected"),
    ("depth that is no number", {"depth": np.full((48, 64), "x")}, "depth is .*expected numbers"),
    ("masks of another size", {"masks": np.zeros((48, 63), np.int32)}, "masks is"),
    ("masks that are not whole numbers", {"masks": np.zeros((48, 64))}, "masks is float64"),
    ("negative masks", {"masks": np.full((48, 64), -1)}, "masks hold -1"),
    ("a pose that is lost", {"T_world_camera": np.full((4, 4), -np.inf)}, "not finite.*tracking was lost"),
    ("a pose with NaN", {"T_world_camera": np.where(np.eye(4) > 0, np.nan, 0)}, "not finite"),
    ("a pose of another shape", {"T_world_camera": np.eye(3)}, r"shape \(3, 3\)"),
    ("a pose that scales", {"T_world_camera": np.diag([2.0, 2, 2, 1])}, "not a rigid transform"),
    ("a pose beyond all houses", {"T_world_camera": pose(1e9)}, "within 5 km"),
    ("a pose that mirrors", {"T_world_camera": np.diag([1.0, 1, -1, 1])}, "not a rigid transform"),
    ("a label that tables have no room for", {"masks": np.full((48, 64), 2**31 - 1)}, "masks hold 2147483647"),
    (
        "a label that wraps round in 32 bits",
        {"masks": np.full((48, 64), 2**32 + 1), "features": None},
        "masks hold 429",
    ),
    ("a picture that is no numbers", {"rgb": np.full((48, 64, 3), "x")}, "expected uint8"),
    ("a picture of floats", {"rgb": np.full((48, 64, 3), 0.5)}, "rgb is float64 .*expected uint8"),
    ("fewer features than masks", {"features": np.ones((5, 3))}, "label 7.* 1..5"),
    ("features of one dimension", {"features": np.ones(9)}, r"expected numbers of shape \(n, D\)"),
    ("features of another length", {"features": np.ones((9, 4))}, "4 dimensions, expected 3"),
    ("a picture of another size", {"rgb": np.zeros((2, 2, 3), np.uint8)}, r"rgb is uint8 of shape \(2, 2, 3\)"),
]


@pytest.mark.parametrize(("bad", "message"), [b[1:] for b in BAD], ids=[b[0] for b in BAD])
def test_bad_frame_is_refused_and_leaves_the_map_as_it_was(bad: dict[str, Any], message: str) -> None:
    mapper, spared = OpenMapper(CAMERA, SMALL), OpenMapper(CAMERA, SMALL)
    for x in (0.0, 0.1, 0.2):
        depth, labels = room(pose(x))
        frame = {"depth": depth, "masks": labels, "features": np.eye(3)[np.arange(9) % 3], "T_world_camera": pose(x)}
        for one in (mapper, spared):
            one.integrate(**frame)
        with pytest.raises(ValueError, match=message):
            mapper.integrate(**{**frame, **bad})
    assert_equal_maps(mapper.finalize(), spared.finalize())


def assert_equal_maps(a: InstanceMap, b: InstanceMap) -> None:
    assert [i.id for i in a] == [i.id for i in b]
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.views, other.views)
        assert (one.feature is None) == (other.feature is None)


def test_empty_frames_and_an_empty_walk_are_fine() -> None:
    mapper = OpenMapper(CAMERA, SMALL)
    assert len(mapper.finalize()) == 0
    depth, labels = GOOD
    for bad_depth in (np.zeros_like(depth), np.full_like(depth, np.nan), np.full_like(depth, np.inf), -depth):
        assert not mapper.integrate(bad_depth, labels, None, pose())
    assert not mapper.integrate(depth, np.zeros_like(labels), None, pose())
    assert len(mapper.instance_map) == 0
    assert mapper.n_frames == 0


def test_features_that_are_zero_or_not_finite_count_as_none() -> None:
    features = np.ones((7, 3), np.float32)
    features[6] = np.nan
    features[0] = 0
    mapper = OpenMapper(CAMERA, SMALL)
    for x in (0.0, 0.1, 0.2):
        depth, labels = room(pose(x))
        mapper.integrate(depth, labels, features, pose(x))
    for instance in mapper.finalize():
        if instance.views[0, 1] in (1, 7):
            assert instance.feature is None
        else:
            assert instance.feature is not None
            np.testing.assert_allclose(instance.feature, np.ones(3) / np.sqrt(3), atol=1e-6)


def test_turning_on_the_spot_stops_costing_memory() -> None:
    mapper = OpenMapper(CAMERA, replace(SMALL, max_views=3, min_novelty=0.1))
    depth, labels = GOOD
    used = [mapper.integrate(depth, labels, None, pose()) for _ in range(10)]
    assert used == [True] * 3 + [False] * 7
    assert len(mapper.finalize()) > 3


def test_ids_stay_with_their_things_while_the_map_grows() -> None:
    mapper = OpenMapper(CAMERA, SMALL)
    earlier: InstanceMap | None = None
    for k in range(16):
        T_world_camera = pose(0.05 * k, 0.0, np.pi / 8 * k)
        depth, labels = room(T_world_camera)
        mapper.integrate(depth, labels, None, T_world_camera)
        now = mapper.instance_map
        assert now is mapper.instance_map, "not kept until the next frame"
        assert [i.id for i in now] == sorted({i.id for i in now})
        if earlier is not None:
            for old in earlier:
                views = {(v[0], v[1]) for v in old.views.tolist()}
                same = [i for i in now if views <= {(v[0], v[1]) for v in i.views.tolist()}]
                assert all(i.id == old.id for i in same if len(old.views) * 2 > len(i.views))
        earlier = now
    assert earlier is not None
    assert len(earlier) >= 6


def test_two_mappers_give_the_same_bytes() -> None:
    first, second = OpenMapper(CAMERA, SMALL), OpenMapper(CAMERA, SMALL)
    walk_room(first)
    walk_room(second)
    second.instance_map  # noqa: B018  asking changes nothing
    assert_equal_maps(first.finalize(), second.finalize())


def test_calibrated_weight_ignores_an_encoder_that_tells_nothing_and_heeds_one_that_does() -> None:
    choice = MappingSettings()
    rng = np.random.default_rng(0)
    poor, same, different = CosineStatistics(), CosineStatistics(), CosineStatistics()
    poor.add(rng.normal(0.7, 0.1, 500))
    same.add(rng.normal(0.8, 0.05, 500))
    different.add(rng.normal(0.3, 0.15, 500))
    flat = semantic_weight(choice, poor, poor)
    neutral = choice.tau_thres / choice.tau_structural
    assert flat(0.1) == flat(0.9) == pytest.approx(neutral)
    assert semantic_weight(choice, CosineStatistics(), different)(0.9) == pytest.approx(neutral), "too few examples"
    steep = semantic_weight(choice, same, different)
    assert steep(0.9) > 0.95
    assert steep(0.2) < 0.1
    assert steep(float("nan")) == pytest.approx(neutral)
    assert semantic_weight(choice, different, same)(0.9) == pytest.approx(neutral), "a reversed encoder was trusted"


def test_the_soft_weight_tips_scales_within_its_trust_and_lets_only_a_good_encoder_say_same() -> None:
    choice = MappingSettings(trust=1.5)
    rng = np.random.default_rng(0)
    poor, same, near, different = (CosineStatistics() for _ in range(4))
    poor.add(rng.normal(0.7, 0.1, 500))
    near.add(rng.normal(0.75, 0.1, 500))
    same.add(rng.normal(0.8, 0.05, 500))
    different.add(rng.normal(0.3, 0.15, 500))
    for a, b in ((poor, poor), (different, same), (CosineStatistics(), different)):
        assert set(soft_weight(choice, a, b).table.tolist()) == {1.0}
    weak = soft_weight(choice, near, poor)
    assert weak.table.max() == 1.0
    assert 1 / 1.5 <= weak(0.5) < 1.0
    heard = soft_weight(choice, same, different)
    assert heard(0.9) == pytest.approx(1.5, abs=0.02)
    assert heard(0.1) == pytest.approx(1 / 1.5, abs=0.02)
    assert heard(float("nan")) == 1.0
    assert (np.diff(heard.table[:-1]) >= 0).all(), "more alike counted for less"


@pytest.mark.parametrize(
    ("name", "value"),
    [("voxel_size", 0.0), ("voxel_size", 1e-9), ("voxel_size", 1e9), ("max_depth", 1e30),
     ("consensus", "hard"), ("trust", 0.5), ("tau_soft", 0.0), ("min_vote", -1.0), ("doubt", -1.0),
     ("voxel_size", float("nan")), ("tau_sub", 0.5), ("tau_obs", 1.5), ("min_masks", 0),
     ("semantics", "magic"), ("visibility", "all"), ("tau_structural", 0.3), ("top_k", 2.5)],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused_by_name(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"^{name} is "):
        MappingSettings(**{name: value})


def test_voxels_are_those_of_the_points_that_the_camera_says() -> None:
    depth, labels = GOOD
    T_world_camera = pose(0.3, 0.2, 0.4)
    keys, own = pixel_voxels(depth, labels, CAMERA, T_world_camera, replace(SMALL, max_gap=0.0))
    centres = voxel_centres(keys, SMALL.voxel_size)
    points = CAMERA.unproject(depth, T_world_camera).reshape(-1, 3)
    np.testing.assert_array_equal(own, labels.ravel())
    assert np.abs(centres - points).max() <= SMALL.voxel_size / 2 + 1e-5
    assert voxel_centres(np.empty(0, np.int64), 0.1).shape == (0, 3)


def test_surfaces_are_filled_between_pixels_but_not_across_edges() -> None:
    depth, labels = GOOD
    keys, own = pixel_voxels(depth, labels, CAMERA, pose(), SMALL)
    floor = np.unique(unpack_keys(keys[own == 1]), axis=0)
    # What is seen of the floor from 1.2 m up, beside the box: a stretch without a hole.
    x, z = floor[:, 0], floor[:, 2]
    ahead = (
        (x * SMALL.voxel_size > 0.8)
        & (x * SMALL.voxel_size < 1.4)
        & (z * SMALL.voxel_size > -2.9)
        & (z * SMALL.voxel_size < -2.3)
    )
    assert len(np.unique(floor[ahead][:, [0, 2]], axis=0)) == (np.ptp(x[ahead]) + 1) * (np.ptp(z[ahead]) + 1)
    # Nothing hangs in the air between the box and the wall behind it.
    y = voxel_centres(keys[own == 7], SMALL.voxel_size)
    assert y[:, 2].min() > -2.2 - SMALL.voxel_size
    assert (np.abs(voxel_centres(keys[own == 5], SMALL.voxel_size)[:, 2] + 3.0) <= SMALL.voxel_size).all()
