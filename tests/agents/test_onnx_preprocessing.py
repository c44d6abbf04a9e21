"""What goes into a CLIP-like tower: crops of things, and pictures resized, cut and scaled as the model's own configuration says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_clips as tiny
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from openmap_agents.perception.crops import Crops, white_square
from openmap_agents.perception.onnx.preprocessing import from_open_clip, from_transformers


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.floats(0.01, 0.8), st.booleans())
def test_crops_are_squares_that_hold_the_mask_and_grow(seed: int, levels: int, ratio: float, whiten: bool) -> None:
    rng = np.random.default_rng(seed)
    h, w = rng.integers(1, 40, 2)
    labels = rng.integers(0, 4, (h, w)).astype(np.int32) * (rng.random((h, w)) < 0.2)
    rgb = rng.integers(0, 250, (h, w, 3)).astype(np.uint8)
    crops = Crops(levels, ratio, whiten).of_masks(rgb, labels.astype(np.int32), 3)
    assert len(crops) == 3
    for number, part in enumerate(crops, start=1):
        mask = labels == number
        assert len(part) == (levels if mask.any() else 0)
        contents = [int((crop < 255).any(-1).sum()) for crop in part]  # padding and what was whitened are 255
        assert all(crop.shape[0] == crop.shape[1] and crop.shape[2] == 3 for crop in part)
        if whiten:
            assert all(n == mask.sum() for n in contents)
        elif part:
            rows, columns = np.nonzero(mask)
            tight = rgb[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
            assert np.array_equal(part[0], white_square(tight))
            grew = np.diff(contents)
            assert (grew >= 0).all()
            assert all(g > 0 or n == h * w for g, n in zip(grew, contents[1:], strict=True))


def test_a_box_grows_by_the_ratio_of_itself_and_stops_at_the_edge() -> None:
    boxes = Crops(3, 0.1).boxes((slice(10, 30), slice(2, 12)), 100, 50)
    assert boxes == [
        (slice(10, 30), slice(2, 12)),
        (slice(8, 32), slice(1, 13)),
        (slice(6, 34), slice(0, 14)),
    ]


def test_wrong_crop_settings_and_pictures_are_refused() -> None:
    for wrong in ({"levels": 0}, {"ratio": -0.1}, {"ratio": float("nan")}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            Crops(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="rgb is"):
        Crops().of_masks(np.zeros((4, 4, 3), np.uint8), np.zeros((4, 5), np.int32), 1)


WAYS = [
    (False, {}),
    (True, {}),
    (False, {"size": {"shortest_edge": 20}, "crop_size": {"height": 31, "width": 26}}),
    (False, {"size": {"height": 30, "width": 21}, "do_center_crop": False, "resample": 2}),
    (False, {"do_normalize": False, "crop_size": {"height": 17, "width": 20}}),
    (True, {"do_rescale": False, "image_mean": [1.0, 2.0, 3.0], "image_std": [4.0, 5.0, 6.0], "resample": 1}),
    (True, {"rescale_factor": 0.01, "do_pad": True, "pad_size": {"height": 40, "width": 37}}),
    (False, {"do_resize": False}),
]


@pytest.mark.parametrize(("siglip", "changes"), WAYS)
def test_preprocessing_equals_the_image_processors_of_transformers(siglip: bool, changes: dict[str, Any]) -> None:
    theirs = type(tiny.processor(siglip)).from_dict(tiny.processor(siglip).to_dict() | changes)
    ours = from_transformers(theirs.to_dict(), Path("x"), siglip=siglip)
    sizes = np.random.default_rng(3).integers(3, 90, (25, 2))
    pictures = tiny.pictures(2, [(int(h), int(w)) for h, w in sizes])
    expected = np.stack(theirs(pictures)["pixel_values"])
    assert ours.output == expected.shape[2:]
    np.testing.assert_allclose(ours(pictures), expected, rtol=0, atol=2e-6)


def test_old_and_short_configurations_mean_what_they_meant() -> None:
    old = {"feature_extractor_type": "CLIPFeatureExtractor", "size": 32, "crop_size": 30, "resample": 3}
    clip, siglip = (from_transformers(c, Path("x"), siglip=s) for c, s in ((old, True), ({"size": 32}, True)))
    assert (clip.mode, clip.size, clip.crop) == ("shortest", (32, 32), (30, 30))
    assert (siglip.mode, siglip.size, siglip.crop, siglip.mean) == ("exact", (32, 32), None, (0.5, 0.5, 0.5))


def test_open_clips_longest_edge_keeps_all_of_the_picture_in_the_middle() -> None:
    config = {"size": 20, "resize_mode": "longest", "fill_color": 255, "mean": [0, 0, 0], "std": [1, 1, 1]}
    pixels = from_open_clip(config, Path("x"))([np.zeros((10, 40, 3), np.uint8)])[0]
    assert pixels.shape == (3, 20, 20)
    assert np.array_equal(pixels[0] == 0, np.repeat((np.arange(20) >= 7) & (np.arange(20) < 12), 20).reshape(20, 20))


@pytest.mark.parametrize("mode", ["shortest", "longest", "squash"])
def test_preprocessing_equals_open_clips(mode: str) -> None:
    tiny.open_clip_or_skip()
    from open_clip.transform import PreprocessCfg, image_transform_v2  # type: ignore[import-not-found]

    config = {"size": 32, "mean": [0.5, 0.4, 0.3], "std": [0.2, 0.3, 0.4], "resize_mode": mode, "fill_color": 9}
    ours, theirs = from_open_clip(config, Path("x")), image_transform_v2(PreprocessCfg(**config), is_train=False)
    for picture in tiny.pictures(4, [(int(h), int(w)) for h, w in np.random.default_rng(5).integers(4, 99, (25, 2))]):
        np.testing.assert_allclose(ours([picture])[0], theirs(Image.fromarray(picture)).numpy(), rtol=0, atol=1e-6)
