"""The working picture, its patches and the shapes of masks, held to plain twins and to depth as sensors give it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception.shape import N_SHAPE, shape_features
from openmap_agents.perception.superpixels import superpixels
from openmap_agents.perception.surface import Surface, working_picture
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(28, 21, 90.0)
SEEDS = st.integers(0, 100_000)
JUMP, BEND, REACH = 0.03, 0.01, 3


def picture(seed: int, camera: PinholeCamera = CAMERA) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """rgb and depth of a tilted floor, a wall and two cards, with noise and holes of every kind in some pictures."""
    rng = np.random.default_rng(seed)
    rays = camera.rays()
    h, w = rays.shape[:2]
    down = np.array([rng.uniform(-0.3, 0.3), -1.0, 0.0])
    along = rays @ down
    depth = np.where(along > 0.3, 1.25 / np.maximum(along, 0.3), 4.0)
    rgb = np.where((depth < 4.0)[..., None], (140, 100, 60), (220, 220, 215))
    for _ in range(2):
        v, u = int(rng.integers(0, h - 6)), int(rng.integers(0, w - 6))
        card = np.s_[v : v + 6, u : u + 6]
        depth[card], rgb[card] = rng.uniform(1.0, 3.0), rng.integers(0, 256, 3)
    if rng.random() < 0.5:
        depth = depth + rng.normal(0, 0.02, depth.shape)
        rgb = rgb + rng.integers(-20, 21, rgb.shape)
    if rng.random() < 0.5:
        holes = rng.random(depth.shape) < 0.1
        depth[holes] = rng.choice([0.0, np.nan, np.inf, -1.0, 3e38], int(holes.sum()))
        depth[: h // 4, : w // 4] = 0.0
    return rgb.clip(0, 255).astype(np.uint8), depth.astype(np.float32)


def tilted(pitch: float) -> npt.NDArray[np.float64]:
    T_world_camera = np.eye(4)
    c, s = np.cos(pitch), np.sin(pitch)
    T_world_camera[1:3, 1:3] = [[c, -s], [s, c]]
    return T_world_camera


def plain_arm(depth: npt.NDArray[np.float32], v: int, u: int, dv: int, du: int) -> int:
    """Steps one may go from (v, u) along (dv, du), walked one by one."""

    def reading(i: int) -> float:
        y, x = v + i * dv, u + i * du
        inside = 0 <= y < depth.shape[0] and 0 <= x < depth.shape[1]
        return 1.0 / float(depth[y, x]) if inside and depth[y, x] > 0 else -1.0

    for i in range(1, REACH + 1):
        last, here, there, beyond = (reading(i + k) for k in (-2, -1, 0, 1))
        if there <= 0:
            return i - 1
        as_before = last > 0 and abs(there - 2 * here + last) <= BEND * here
        as_after = beyond > 0 and abs(here - 2 * there + beyond) <= BEND * here
        if abs(here - there) > JUMP * there and not as_before and not as_after:
            return i - 1
    return REACH


def plain_normal(surface: Surface, v: int, u: int) -> npt.NDArray[np.float32]:
    if surface.depth[v, u] <= 0:
        return np.zeros(3, np.float32)
    left, right, up, down = (plain_arm(surface.depth, v, u, *d) for d in ((0, -1), (0, 1), (-1, 0), (1, 0)))
    if left and right:
        left = right = min(left, right)
    if up and down:
        up = down = min(up, down)
    p = surface.points
    a, b = p[v, u + right] - p[v, u - left], p[v + down, u] - p[v - up, u]
    n = np.cross(b, a)
    if np.linalg.norm(n) < 1e-12:
        n = -p[v, u]
    n = n / np.linalg.norm(n)
    return np.asarray(-n if n @ p[v, u] > 0 else n)


def plain_patches(surface: Surface, scale: float, min_pixels: int) -> npt.NDArray[np.int32]:
    """Felzenszwalb's cut with sets of pixels instead of a forest."""
    h, w = surface.depth.shape
    points, normals, lab = (x.reshape(-1, 3) for x in (surface.points, surface.normals, surface.lab))
    depth = surface.depth.ravel()

    def weight(a: int, b: int) -> int:
        if (depth[a] > 0) != (depth[b] > 0):
            return 4095
        total = min(np.sqrt(sum(float(x * x) for x in lab[a] - lab[b])) / 25.0, 1.0)
        if depth[a] > 0:
            d = points[b] - points[a]
            off = max(abs(sum(float(x) for x in normals[i] * d)) for i in (a, b))
            cosine = sum(float(x) for x in normals[a] * normals[b])
            off /= 0.01 + 0.01 * float(min(depth[a], depth[b]))
            total = min(off, 1.0) + min((1.0 - cosine) / 0.3, 1.0) + total
        return int(total / 3.0 * 4095)

    edges = [(i, i + 1) for i in range(h * w) if (i + 1) % w] + [(i, i + w) for i in range(h * w - w)]
    weighed = sorted((weight(a, b), a, b) for a, b in edges)
    patch = {i: {i} for i in range(h * w)}
    limit = dict.fromkeys(range(h * w), scale)

    def join(a: int, b: int) -> None:
        union = patch[a] | patch[b]
        patch.update(dict.fromkeys(union, union))

    for level, a, b in weighed:
        value = level / 4095 * 3.0
        if patch[a] is not patch[b] and value <= min(limit[min(patch[a])], limit[min(patch[b])]):
            join(a, b)
            limit[min(patch[a])] = value + scale / len(patch[a])
    for level, a, b in weighed:
        if patch[a] is not patch[b] and level < 4095 and min(len(patch[a]), len(patch[b])) < min_pixels:
            join(a, b)
    number = {first: k for k, first in enumerate(sorted({min(p) for p in patch.values()}))}
    return np.array([number[min(patch[i])] for i in range(h * w)], np.int32).reshape(h, w)


def plain_shape(surface: Surface, labels: npt.NDArray[np.int32], k: int) -> npt.NDArray[np.float64]:
    own, seen = labels == k, (labels == k) & (surface.depth > 0)
    if seen.sum() < 4:
        return np.zeros(N_SHAPE)
    points, normals = surface.points[seen].astype(np.float64), surface.normals[seen].astype(np.float64)
    low, high = np.quantile(points[:, 1], [0.02, 0.98]) - surface.floor
    flat = points[:, [0, 2]] - points[:, [0, 2]].mean(0)
    _, axes = np.linalg.eigh(flat.T @ flat)
    short, long = (np.subtract(*np.quantile(flat @ axes[:, i], [0.98, 0.02])) for i in (0, 1))
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(points.T)), 0.0))
    up, height = normals[:, 1], high - low
    border = np.zeros(own.shape, bool)
    border[[0, -1]] = border[:, [0, -1]] = True
    distance = float(np.median(surface.depth[seen]))
    sizes = [low, high, (low + high) / 2, np.log(height + 0.02), np.log(long + 0.02), np.log(short + 0.02)]
    sizes += [np.log((long + 0.02) / (height + 0.02)), np.log(spread[0] + 0.005), spread[0] / (spread[2] + 0.01)]
    facing = [(up > 0.9).mean(), (np.abs(up) < 0.2).mean(), up.mean(), np.linalg.norm(normals.mean(0))]
    away = [np.log(np.linalg.norm(points.mean(0)) + 0.1), np.log(seen.sum() * distance**2 / labels.size + 1e-4)]
    return np.array([*sizes, *facing, *away, (own & border).sum() / np.sqrt(own.sum())])


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, pitch=st.sampled_from([0.0, -0.35, 0.12]))
def test_points_normals_and_floor_are_those_of_a_plain_walk(seed: int, pitch: float) -> None:
    rgb, depth = picture(seed)
    T_world_camera = tilted(pitch)
    surface = working_picture(rgb, depth, T_world_camera, CAMERA)
    seen = np.isfinite(depth) & (depth > 0) & (depth < 1e4)
    np.testing.assert_array_equal(surface.depth, np.where(seen, depth, 0))
    np.testing.assert_allclose(
        surface.points, (surface.depth[..., None] * CAMERA.rays()) @ T_world_camera[:3, :3].T, atol=1e-5
    )
    assert surface.floor == pytest.approx(np.percentile(surface.points[..., 1][seen], 0.5), abs=1e-5)
    expected = [[plain_normal(surface, v, u) for u in range(CAMERA.width)] for v in range(CAMERA.height)]
    np.testing.assert_allclose(surface.normals, expected, atol=1e-4)


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, scale=st.sampled_from([0.1, 0.6, 1.5]), min_pixels=st.sampled_from([0, 5, 20]))
def test_patches_are_those_of_sets_of_pixels(seed: int, scale: float, min_pixels: int) -> None:
    surface = working_picture(*picture(seed), np.eye(4), CAMERA)
    patches = superpixels(surface, scale, min_pixels)
    np.testing.assert_array_equal(patches, plain_patches(surface, scale, min_pixels))
    _, renumbered = np.unique(patches[surface.depth > 0], return_inverse=True)
    seen = superpixels(surface, scale, min_pixels, seen_only=True)
    assert (seen[surface.depth <= 0] == -1).all()
    np.testing.assert_array_equal(seen[surface.depth > 0], renumbered)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, n=st.integers(1, 6))
def test_shapes_are_those_of_one_mask_at_a_time(seed: int, n: int) -> None:
    surface = working_picture(*picture(seed), tilted(-0.2), CAMERA)
    coarse = np.random.default_rng(seed).integers(0, n + 1, (3, 4)).astype(np.int32)
    labels = coarse.repeat(7, 0).repeat(7, 1)
    rows = shape_features(surface, labels, n)
    assert rows.dtype == np.float32
    np.testing.assert_allclose(rows, [plain_shape(surface, labels, k) for k in range(1, n + 1)], atol=2e-4)


def test_a_large_picture_is_taken_every_second_pixel_from_the_mean_colour_around_it() -> None:
    camera = PinholeCamera.from_hfov(640, 480, 90.0)
    depth = np.random.default_rng(0).uniform(1, 3, (480, 640)).astype(np.float32)
    rgb = np.zeros((480, 640, 3), np.uint8)
    rgb[::2] = 200  # the mean of two rows is 100, a middling grey
    surface = working_picture(rgb, depth.astype(np.float64), np.eye(4), camera)
    assert surface.step == 2
    np.testing.assert_array_equal(surface.depth, depth[1::2, 1::2])
    np.testing.assert_allclose(surface.points, (depth[..., None] * camera.rays())[1::2, 1::2], atol=1e-5)
    assert np.ptp(surface.lab[..., 0]) < 1e-3
    assert surface.lab[0, 0, 0] == pytest.approx(42.4, abs=0.5)


def test_the_caller_s_depth_is_left_as_it_was() -> None:
    rgb, depth = picture(3)
    depth[0] = np.nan
    before = depth.copy()
    working_picture(rgb, depth, np.eye(4), CAMERA)
    np.testing.assert_array_equal(depth, before)


def test_labels_of_another_picture_have_no_shape() -> None:
    surface = working_picture(*picture(0), np.eye(4), CAMERA)
    with pytest.raises(ValueError, match=r"\(5, 6\), expected \(21, 28\)"):
        shape_features(surface, np.ones((5, 6), np.int32), 1)
    assert shape_features(surface, np.zeros((21, 28), np.int32), 0).shape == (0, N_SHAPE)


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 2.0])
def test_a_pose_that_was_lost_is_refused(bad: float) -> None:
    rgb, depth = picture(0)
    with pytest.raises(ValueError, match="T_world_camera has the rotation"):
        working_picture(rgb, depth, np.full((4, 4), bad), CAMERA)


def test_depth_too_small_to_be_any_is_nothing() -> None:
    rgb, depth = picture(0)
    tiny, none = depth.copy(), depth.copy()
    tiny[3:12, 3:12], none[3:12, 3:12] = 1e-30, 0.0
    surfaces = [working_picture(rgb, d, tilted(0.2), CAMERA) for d in (tiny, none)]
    assert np.isfinite(surfaces[0].normals).all()
    np.testing.assert_array_equal(*(superpixels(s) for s in surfaces))
