"""Patches, trees of joined regions, cuts through them, shapes and weights: what the default perception stands on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception.encoder import (
    FARTHEST,
    KNOWN_WITHIN,
    N_DESCRIPTION,
    NOVELTY,
    SHARPNESS,
    WEIGHTS,
    EmbeddedEncoder,
    fuse,
)
from openmap_agents.perception.joining import N_PAIR, Tree, agglomerate, best_cut
from openmap_agents.perception.maps import N_BELONGING, N_CLASSES, cells_of, cover, geometry_map, map_shape, means
from openmap_agents.perception.overlap import ious
from openmap_agents.perception.regions import N_EXTREMES, N_SUMS, Regions, add_belonging, describe
from openmap_agents.perception.segmenter import EmbeddedSegmenter, patches_of, plain_join
from openmap_agents.perception.shape import N_SHAPE, shape_features
from openmap_agents.perception.superpixels import superpixels
from openmap_agents.perception.surface import Surface, to_full_size, working_picture
from openmap_agents.perception.weights import FOLDER, load_weights, save_weights
from openmap_scenes import DataError, PinholeCamera

CAMERA = PinholeCamera.from_hfov(96, 72, 90.0)


def room(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """rgb and depth of a floor 1.25 m below the camera, a wall 4 m ahead and a few upright coloured cards."""
    rng = np.random.default_rng(seed)
    rays = CAMERA.rays()
    depth = np.full(rays.shape[:2], 4.0, np.float32)
    below = rays[..., 1] < 0
    depth[below] = np.minimum(4.0, 1.25 / -rays[..., 1][below])
    rgb = np.where((depth < 4.0)[..., None], (140, 100, 60), (220, 220, 215)).astype(np.uint8)
    for _ in range(4):
        v, u = int(rng.integers(15, 50)), int(rng.integers(5, 75))
        part = np.s_[v : v + 15, u : u + 14]
        depth[part] = np.minimum(depth[part], np.float32(rng.uniform(1.5, 3.0)))
        rgb[part] = rng.integers(0, 255, 3)
    checks = rng.integers(-25, 26, (9, 12, 3)).repeat(8, 0).repeat(8, 1)
    return (rgb + checks).clip(0, 255).astype(np.uint8), depth


def surface_of(seed: int = 0) -> Surface:
    return working_picture(*room(seed), np.eye(4), CAMERA)


def random_tree(seed: int, n: int) -> Tree:
    rng = np.random.default_rng(seed)
    free, children = list(range(n)), []
    for i in range(int(rng.integers(0, n))):
        a, b = (free.pop(int(rng.integers(len(free)))) for _ in range(2))
        children.append((a, b))
        free.append(n + i)
    k = len(children)
    pairs = np.array(children, np.int32).reshape(k, 2)
    return Tree(pairs, np.ones(k), np.ones((n + k, N_SUMS)), np.ones((n + k, N_EXTREMES)))


def described(patches: np.ndarray, surface: Surface, seed: int = 0) -> Regions:
    """Patches with what a neck might say of their pixels, drawn at random."""
    regions = describe(patches, surface)
    cells = np.random.default_rng(seed).normal(size=(N_BELONGING + N_CLASSES, *map_shape(72, 96, 4)))
    add_belonging(regions, patches, cells.astype(np.float32), *cells_of(1, 4, 72, 96))
    return regions


def every_cut(tree: Tree, node: int) -> list[list[int]]:
    cuts = [[node]]
    if node >= tree.n_leaves:
        a, b = tree.children[node - tree.n_leaves]
        cuts += [x + y for x in every_cut(tree, int(a)) for y in every_cut(tree, int(b))]
    return cuts


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 7))
def test_best_cut_is_worth_as_much_as_the_best_of_all_cuts(seed: int, n: int):
    tree = random_tree(seed, n)
    worth = np.random.default_rng(seed).uniform(0, 1, len(tree.sums)) * np.linspace(1, 2, len(tree.sums))
    roots = set(range(len(tree.sums))) - set(tree.children.ravel().tolist())
    best = sum(max(worth[cut].sum() for cut in every_cut(tree, root)) for root in roots)
    owner = best_cut(tree, worth)
    assert worth[np.unique(owner)].sum() == pytest.approx(best)


@pytest.mark.parametrize("seed", range(3))
def test_a_joined_region_is_described_as_if_it_had_been_one_patch(seed: int):
    surface = surface_of(seed)
    patches = patches_of(surface)
    tree, _ = agglomerate(described(patches, surface), surface.floor, plain_join(), 0.05)
    assert len(tree.children) > 5
    worth = np.zeros(len(tree.sums))
    worth[tree.n_leaves :] = np.arange(1, len(tree.children) + 1)  # so that every join is kept
    owner = best_cut(tree, worth)
    nodes, merged = np.unique(owner, return_inverse=True)
    again = described(merged[patches].astype(np.int32), surface)
    np.testing.assert_allclose(tree.sums[nodes], again.sums, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(tree.extremes[nodes], again.extremes)


def test_no_pair_that_still_touches_was_more_probable_than_the_stop():
    surface = surface_of()
    log = (np.empty((5000, 2), np.int32), np.empty((5000, N_PAIR)))
    tree, n = agglomerate(describe(patches_of(surface), surface), surface.floor, plain_join(), 0.3, log)
    inside = set(tree.children.ravel().tolist())
    alive = [i for i in range(n) if not set(log[0][i].tolist()) & inside]
    assert alive
    assert (plain_join()(log[1][alive]) <= 0.3).all()
    assert (tree.probabilities > 0.3).all()


@pytest.mark.parametrize("seed", range(3))
def test_patches_cover_the_picture_hold_together_and_never_mix_depth_with_none(seed: int):
    from scipy.ndimage import label

    rgb, depth = room(seed)
    depth[:20, :30] = 0
    patches = superpixels(working_picture(rgb, depth, np.eye(4), CAMERA))
    assert set(np.unique(patches)) == set(range(patches.max() + 1))
    for i in range(patches.max() + 1):
        assert label(patches == i)[1] == 1
        assert len(np.unique(depth[patches == i] > 0)) == 1


def test_normals_and_floor_of_a_level_floor_under_a_tilted_camera():
    pitch = 0.4
    T_world_camera = np.eye(4)
    c, s = np.cos(pitch), np.sin(pitch)
    T_world_camera[:3, :3] = [[1, 0, 0], [0, c, s], [0, -s, c]]
    rays = CAMERA.rays() @ T_world_camera[:3, :3].T
    depth = np.where(rays[..., 1] < -0.1, 1.25 / np.maximum(-rays[..., 1], 0.1), 0).astype(np.float32)
    surface = working_picture(np.zeros((72, 96, 3), np.uint8), depth, T_world_camera, CAMERA)
    assert surface.floor == pytest.approx(-1.25, abs=1e-3)
    normals = surface.normals[depth > 0]
    assert (normals[:, 1] > 0.99).mean() > 0.97
    assert not surface.normals[depth == 0].any()


def test_shape_says_how_high_and_how_large_a_card_is():
    rgb, depth = np.zeros((72, 96, 3), np.uint8), np.zeros((72, 96), np.float32)
    rays = CAMERA.rays()
    depth[rays[..., 1] < -0.2] = 1.25 / -rays[..., 1][rays[..., 1] < -0.2]
    card = (np.abs(rays[..., 0]) < 0.25) & (np.abs(rays[..., 1]) < 0.15)
    depth[card] = 2.0
    row = shape_features(working_picture(rgb, depth, np.eye(4), CAMERA), card.astype(np.int32), 1)[0]
    assert row.shape == (N_SHAPE,)
    assert row[0] == pytest.approx(1.25 - 0.3, abs=0.05)
    assert row[1] == pytest.approx(1.25 + 0.3, abs=0.05)
    assert np.exp(row[4]) - 0.02 == pytest.approx(1.0, abs=0.06)
    assert np.exp(row[5]) - 0.02 == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("step", [1, 2, 3])
def test_labels_of_the_working_picture_fill_the_whole_one(step: int):
    labels = np.arange(12, dtype=np.int32).reshape(3, 4)
    full = to_full_size(labels, step, 3 * step + 1, 4 * step + 2)
    assert full.shape == (3 * step + 1, 4 * step + 2)
    np.testing.assert_array_equal(full[step // 2 : 3 * step : step, step // 2 : 4 * step : step], labels)


def test_a_cosine_is_what_the_calibration_says():
    encoder = EmbeddedEncoder()
    described_regions = np.random.default_rng(0).normal(0.3, 1.0, (20, N_DESCRIPTION)).astype(np.float32)
    names = ["chair", "sofa", "pillow", "something to sit on", "quokka"]
    cosines = encoder.vectors(described_regions) @ encoder.encode_text(names).T
    fused = fuse(encoder.opinions(described_regions))
    known = encoder.words(list_of_names())
    log_z = np.log(np.exp(SHARPNESS * fused @ known.T).sum(1, keepdims=True))
    novelty = (1 - (encoder.words(names) @ known.T).max(1)).clip(0, FARTHEST)
    share = 1 - np.minimum(novelty / KNOWN_WITHIN, 1)
    expected = SHARPNESS * fused @ encoder.words(names).T + share * (13.5 - log_z) + NOVELTY * novelty
    slope, offset = np.polyfit(expected.ravel(), cosines.ravel(), 1)
    assert slope > 0
    assert np.abs(np.linalg.norm(encoder.encode_text(names), axis=1) - 1).max() < 1e-5
    assert offset == pytest.approx(0.0, abs=2e-3)
    np.testing.assert_allclose(cosines, slope * expected + offset, atol=3e-3)


def list_of_names() -> list[str]:
    return list(json.loads((FOLDER / "names.json").read_text()))


def test_opinions_are_weighed():
    opinions = {name: np.eye(1, 384, i, dtype=np.float32) for i, name in enumerate(WEIGHTS)}
    np.testing.assert_allclose(
        fuse(opinions)[0, : len(WEIGHTS)], np.array(list(WEIGHTS.values())) / sum(WEIGHTS.values())
    )


@pytest.mark.parametrize(("width", "height"), [(64, 96), (640, 480), (320, 240), (1280, 720), (101, 67)])
def test_means_are_those_over_the_pixels_of_a_mask(width: int, height: int):
    rng = np.random.default_rng(1)
    step = max(1, round(width / 320))
    labels = rng.integers(0, 4, (len(range(step // 2, height, step)), len(range(step // 2, width, step))))
    levels = cover(labels, 3, step, height, width)
    for stride, cells in zip((4, 8, 16, 32), levels, strict=True):
        rows, columns = cells_of(step, stride, height, width)
        features = rng.normal(size=(2, *map_shape(height, width, stride))).astype(np.float32)
        full = features[:, rows[:, None], columns]
        expected = np.stack([full[:, labels == k].mean(1) for k in (1, 2, 3)])
        np.testing.assert_allclose(means(cells, features), expected, atol=1e-4)


def test_depth_s_map_does_not_care_for_the_heading_or_the_tilt_of_the_camera():
    rgb, depth = room()
    level = geometry_map(working_picture(rgb, depth, np.eye(4), CAMERA), np.eye(4), 72, 96)
    turned = np.eye(4)
    c, s = np.cos(2.0), np.sin(2.0)
    turned[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    np.testing.assert_allclose(
        geometry_map(working_picture(rgb, depth, turned, CAMERA), turned, 72, 96), level, atol=1e-4
    )
    facing = level[:, 2, 5]
    assert facing[2] == pytest.approx(1.0, abs=0.05)  # the wall ahead looks back at the camera


def test_overlaps_of_a_picture_with_itself():
    ids = np.array([[0, 5, 5], [9, 9, 0]], np.int32)
    present, overlap = ious(np.array([[0, 2, 2], [1, 0, 0]], np.int32), ids)
    assert present.tolist() == [5, 9]
    np.testing.assert_allclose(overlap, [[0, 1], [0.5, 0]])


def test_weights_come_back_as_half_floats(tmp_path: Path):
    save_weights(tmp_path / "w.npz", {"a": np.array([[1.5, 2.0]])})
    np.testing.assert_array_equal(load_weights(tmp_path / "w.npz", {"a": (None, 2)})["a"], [[1.5, 2.0]])
    assert [p.name for p in tmp_path.iterdir()] == ["w.npz"]


@pytest.mark.parametrize(
    ("make", "name"),
    [(EmbeddedSegmenter, "segmenter.npz"), (lambda folder: EmbeddedEncoder(weights=folder), "regions.npz")],
)
def test_weights_that_cannot_be_used_are_named_with_what_is_wrong(make, name: str, tmp_path: Path):
    path = tmp_path / name
    with pytest.raises(DataError, match=rf"{name}: found no readable weights"):
        make(tmp_path)
    path.write_bytes((FOLDER / name).read_bytes()[:-200])
    with pytest.raises(DataError, match="no readable weights"):
        make(tmp_path)
    save_weights(path, {"join.w1": np.zeros((4, 3))})
    with pytest.raises(DataError, match="of shape"):
        make(tmp_path)
    np.savez(path, a=np.array([{}], object))
    with pytest.raises(DataError, match="no readable weights"):
        make(tmp_path)
    with np.load(FOLDER / name) as good:
        save_weights(path, {k: v * np.nan for k, v in good.items()})
    with pytest.raises(DataError, match="not finite"):
        make(tmp_path)


def test_a_neck_that_is_none_is_named(tmp_path: Path):
    for name in ("segmenter.npz", "regions.npz"):
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    (tmp_path / "neck.onnx").write_bytes((FOLDER / "neck.onnx").read_bytes()[:5000])
    with pytest.raises(DataError, match=r"neck\.onnx"):
        EmbeddedSegmenter(tmp_path)
