"""ONNX segmenters: equal to the torch models they are exports of, geometry, disjointness, one clear error for every bad file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tiny_segmenters as tiny
import torch
from PIL import Image
from torch import nn
from torch.nn import functional

from openmap_agents.perception.onnx import sam_models, yolo
from openmap_agents.perception.onnx.disjoint import DisjointSettings, disjoint
from openmap_agents.perception.onnx.pictures import Frame
from openmap_agents.perception.onnx.sam import SamSegmenter, SamSettings, find_files, point_grid, stability
from openmap_agents.perception.onnx.session import Port, load, open_model
from openmap_agents.perception.onnx.yolo import Candidates, YoloSegmenter, YoloSettings
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

SIZE = (90, 120)
ANY_AREA = DisjointSettings(min_area=0)
# Random weights are sure of nothing.
EVERYTHING = SamSettings(
    points_per_side=4, min_iou=-10, min_stability=0, max_box_iou=1, threads=1, size=tiny.SIDE, disjoint=ANY_AREA
)
YOLO = YoloSettings(min_score=0.5, threads=1, disjoint=ANY_AREA)
CLOSE = {"rtol": 0, "atol": 1e-3}


def picture(seed: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Smooth noise (H, W, 3) uint8."""
    small = np.random.default_rng(seed).integers(0, 256, (6, 8, 3), np.uint8)
    return np.asarray(Image.fromarray(small).resize(size[::-1], Image.Resampling.BILINEAR))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One export of every layout."""
    root = tmp_path_factory.mktemp("exports")
    decoder = tiny.model(tiny.SamDecoder)
    tiny.write_sam(root / "sam", decoder)
    tiny.write_sam(root / "raw", decoder, raw=True, free=False)
    tiny.write_sam(root / "discs", tiny.model(tiny.DiscDecoder))
    tiny.write_sam2(root / "sam2")
    tiny.write_transformers(root / "transformers")
    tiny.write_efficient(root / "efficient")
    tiny.write_yolo(root / "yolo.onnx", tiny.model(tiny.Yolo))
    names = str({i: f"kind {i}" for i in range(tiny.Yolo.classes)})
    tiny.write_yolo(
        root / "yolo-free.onnx", tiny.model(tiny.Yolo), free=True, metadata={"imgsz": "[96, 128]", "names": names}
    )
    return root


def segment(segmenter: SamSegmenter | YoloSegmenter, rgb: np.ndarray) -> Masks:
    height, width = rgb.shape[:2]
    camera = PinholeCamera(width=width, height=height, fx=100.0, fy=100.0, cx=width / 2, cy=height / 2)
    return segmenter.segment(rgb, np.zeros((height, width), np.float32), np.eye(4), camera)


# What goes into the network


def plain_preprocessing(rgb: np.ndarray) -> np.ndarray:
    """SAM's, step by step: long side to 64, ImageNet mean and deviation, zeros at the right and the bottom."""
    height, width = rgb.shape[:2]
    scale = tiny.SIDE / max(height, width)
    inner = int(height * scale + 0.5), int(width * scale + 0.5)
    small = np.asarray(Image.fromarray(rgb).resize((inner[1], inner[0]), Image.Resampling.BILINEAR)).astype(float)
    out = np.zeros((3, tiny.SIDE, tiny.SIDE))
    for c in range(3):
        mean, deviation = (123.675, 116.28, 103.53)[c], (58.395, 57.12, 57.375)[c]
        out[c, : inner[0], : inner[1]] = (small[..., c] - mean) / deviation
    return out


@pytest.mark.parametrize("size", [(90, 120), (120, 91), (64, 64), (17, 201), (91, 120)])
def test_sam_preprocessing_is_the_plain_one(folder: Path, size: tuple[int, int]) -> None:
    model = SamSegmenter(folder / "sam", EVERYTHING).model
    rgb = picture(size=size)
    np.testing.assert_allclose(sam_models.normalised(rgb, model.frame(size)), plain_preprocessing(rgb), atol=1e-5)


@pytest.mark.parametrize("size", [(90, 120), (120, 90), (64, 64), (17, 201)])
def test_letterbox_keeps_proportions_in_the_middle_of_grey(size: tuple[int, int]) -> None:
    rgb = np.full((*size, 3), 255, np.uint8)
    image, frame = yolo.letterbox(rgb, (64, 96))
    white = (image == 1).all(0)
    rows, columns = np.flatnonzero(white.any(1)), np.flatnonzero(white.any(0))
    assert frame.inner == (len(rows), len(columns))
    assert frame.corner == (rows[0], columns[0])
    assert white.sum() == len(rows) * len(columns)
    np.testing.assert_allclose(image[:, ~white], 114 / 255)
    assert len(rows) == 64 or len(columns) == 96
    assert abs(len(rows) * size[1] - len(columns) * size[0]) <= max(size)
    # Ultralytics' rounding: the odd pixel of padding comes after.
    assert rows[0] == round((64 - len(rows)) / 2 - 0.1)
    assert columns[0] == round((96 - len(columns)) / 2 - 0.1)


# The same numbers as the torch originals


def test_sam_equals_torch_from_picture_to_masks(folder: Path) -> None:
    segmenter = SamSegmenter(folder / "sam", EVERYTHING)
    rgb, points = picture(), point_grid(3, SIZE)
    [embedding] = segmenter.model.encode([rgb])
    logits, ious = segmenter.model.decode(embedding, points, SIZE)
    full = np.stack([segmenter.model.frame(SIZE).to_picture(one) for one in logits])
    with torch.no_grad():
        expected = tiny.model(tiny.SamEncoder)(torch.tensor(plain_preprocessing(rgb)[None], dtype=torch.float32))
        _, _, labels, mask, has, _ = tiny.sam_prompt(len(points))
        coords = torch.zeros(len(points), 2, 2)
        coords[:, 0] = torch.tensor(points * np.array([64 / 120, 48 / 90]))
        masks, quality, low = tiny.model(tiny.SamDecoder)(expected, coords, labels, mask, has, torch.tensor(SIZE))
    np.testing.assert_allclose(embedding["image_embeddings"], expected, **CLOSE)
    np.testing.assert_allclose(logits, low[:, 1:], **CLOSE)
    np.testing.assert_allclose(ious, quality[:, 1:], **CLOSE)
    np.testing.assert_allclose(full, masks[:, 1:], **CLOSE)


def test_sam_with_preprocessing_inside_equals_the_one_without(folder: Path) -> None:
    rgb, points = picture(), point_grid(1, SIZE)
    inside, outside = (SamSegmenter(folder / name, EVERYTHING).model for name in ("raw", "sam"))
    assert inside.points_per_call == 1
    assert not inside.free_batch
    [a] = inside.encode([rgb])
    with torch.no_grad():
        small = torch.tensor(sam_models.scaled(rgb, (48, 64)))
        expected = tiny.model(tiny.RawSamEncoder)(small)
    np.testing.assert_allclose(a["image_embeddings"], expected, **CLOSE)
    for x, y in zip(inside.decode(a, points, SIZE), outside.decode(a, points, SIZE), strict=True):
        np.testing.assert_allclose(x, y, **CLOSE)


def test_sam2_equals_torch_from_picture_to_masks(folder: Path) -> None:
    model = SamSegmenter(folder / "sam2", EVERYTHING).model
    rgb, points = picture(), point_grid(3, SIZE)
    [embedding] = model.encode([rgb])
    logits, ious = model.decode(embedding, points, SIZE)
    full = np.stack([model.frame(SIZE).to_picture(one) for one in logits])
    square = np.asarray(Image.fromarray(rgb).resize((64, 64), Image.Resampling.BILINEAR))
    with torch.no_grad():
        image = torch.tensor(plain_preprocessing(square)[None], dtype=torch.float32)
        fine, middle, coarse = tiny.model(tiny.Sam2Encoder)(image)
        coords = torch.zeros(len(points), 2, 2)
        coords[:, 0] = torch.tensor(points * np.array([64 / 120, 64 / 90]))
        _, _, labels, mask, has, _ = tiny.sam_prompt(len(points))
        masks, quality = tiny.model(tiny.Sam2Decoder)(coarse, fine, middle, coords, labels, mask, has)
        expected = functional.interpolate(masks, (64, 64), mode="bilinear", align_corners=False)
        expected = functional.interpolate(expected, SIZE, mode="bilinear", align_corners=False)
    np.testing.assert_allclose(logits, masks, **CLOSE)
    np.testing.assert_allclose(ious, quality, **CLOSE)
    np.testing.assert_allclose(full, expected, **CLOSE)


def test_transformers_sam_equals_torch(folder: Path) -> None:
    model = SamSegmenter(folder / "transformers", EVERYTHING).model
    rgb, points = picture(), point_grid(3, SIZE)
    [embedding] = model.encode([rgb])
    logits, ious = model.decode(embedding, points, SIZE)
    with torch.no_grad():
        out = tiny.transformers_sam()(
            pixel_values=torch.tensor(plain_preprocessing(rgb)[None], dtype=torch.float32),
            input_points=torch.tensor(points * np.array([64 / 120, 48 / 90]), dtype=torch.float32)[None, :, None],
            input_labels=torch.ones(1, len(points), 1, dtype=torch.int64),
        )
    np.testing.assert_allclose(logits, out.pred_masks[0], **CLOSE)
    np.testing.assert_allclose(ious, out.iou_scores[0], **CLOSE)


def test_efficient_sam_equals_torch(folder: Path) -> None:
    model = SamSegmenter(folder / "efficient", EVERYTHING).model
    rgb, points = picture(), point_grid(3, SIZE)
    [embedding] = model.encode([rgb])
    logits, ious = model.decode(embedding, points, SIZE)
    with torch.no_grad():
        image = torch.tensor(rgb).permute(2, 0, 1)[None].float() / 255
        expected = tiny.model(tiny.EfficientEncoder)(image)
        coords, labels = torch.tensor(points)[None, :, None], torch.ones(1, len(points), 1)
        masks, quality, _ = tiny.model(tiny.EfficientDecoder)(expected, coords, labels, torch.tensor(SIZE))
    np.testing.assert_allclose(embedding["image_embeddings"], expected, **CLOSE)
    np.testing.assert_allclose(logits, masks[0], **CLOSE)
    np.testing.assert_allclose(ious, quality[0], **CLOSE)


@pytest.mark.parametrize(("name", "network"), [("yolo", (64, 64)), ("yolo-free", (96, 128))])
def test_yolo_equals_torch(folder: Path, name: str, network: tuple[int, int]) -> None:
    segmenter = YoloSegmenter(folder / f"{name}.onnx", YOLO)
    assert segmenter.network == network
    images = yolo.letterbox(picture(), network)[0][None]
    outputs = segmenter.model.run(images=images)
    with torch.no_grad():
        rows, prototypes = tiny.model(tiny.Yolo)(torch.tensor(images))
    np.testing.assert_allclose(outputs["output0"], rows, **CLOSE)
    np.testing.assert_allclose(outputs["output1"], prototypes, **CLOSE)


def test_a_float16_export_is_read_as_the_float32_one(folder: Path, tmp_path: Path) -> None:
    path, example = tmp_path / "half.onnx", torch.zeros(1, 3, tiny.SIDE, tiny.SIDE, dtype=torch.float16)
    tiny.export(tiny.model(tiny.Yolo).half(), [example], path, ["images"], ["output0", "output1"])
    images = yolo.letterbox(picture(), (64, 64))[0][None]
    half, single = (YoloSegmenter(p, YOLO).model.run(images=images) for p in (path, folder / "yolo.onnx"))
    for name, array in half.items():
        assert array.dtype == np.float32
        np.testing.assert_allclose(array, single[name], atol=0.02 * np.abs(single[name]).max())


@pytest.mark.parametrize("size", [(90, 120), (120, 90), (33, 70)])
def test_assembled_masks_are_those_of_torch(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(0)
    network, n = (64, 96), 5
    _, frame = yolo.letterbox(picture(size=size), network)
    prototypes = rng.normal(size=(32, 16, 24)).astype(np.float32)
    corner = rng.uniform(0, 50, (n, 2))
    boxes = np.hstack([corner, corner + rng.uniform(5, 40, (n, 2))]).astype(np.float32)
    candidates = Candidates(boxes, np.ones(n, np.float32), rng.normal(size=(n, 32)).astype(np.float32))
    got = yolo.assemble(candidates, prototypes, frame)
    (top, left), (height, width) = frame.corner, frame.inner
    logits = torch.einsum("nk,khw->nhw", torch.tensor(candidates.coefficients), torch.tensor(prototypes))
    full = functional.interpolate(logits[None], network, mode="bilinear", align_corners=False)
    full = full[..., top : top + height, left : left + width]
    full = functional.interpolate(full, size, mode="bilinear", align_corners=False)[0].numpy()
    x = (np.arange(size[1]) + 0.5) * width / size[1] + left
    y = (np.arange(size[0]) + 0.5) * height / size[0] + top
    for mask, logit, (x0, y0, x1, y1) in zip(got, full, boxes, strict=True):
        inside = ((y >= y0) & (y < y1))[:, None] & ((x >= x0) & (x < x1))[None]
        sure = np.abs(logit) > 1e-3
        assert inside.any()
        np.testing.assert_array_equal(mask[sure], ((logit > 0) & inside)[sure])


def test_segmenting_needs_no_torch() -> None:
    code = (
        "import sys; import openmap_agents.perception.onnx.sam, openmap_agents.perception.onnx.yolo; "
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# Geometry


def test_discs_of_a_handmade_decoder_lie_at_the_grid_points(folder: Path) -> None:
    points_per_side = 4
    chosen = SamSettings(points_per_side=points_per_side, points_per_batch=5, size=tiny.SIDE, min_stability=0.9)
    masks = segment(SamSegmenter(folder / "discs", chosen), picture())
    tiny.check_masks(masks)
    assert len(masks) == points_per_side**2
    np.testing.assert_allclose(masks.scores, 0.95)
    centres = np.array([np.argwhere(masks.labels == i + 1).mean(0)[::-1] + 0.5 for i in range(len(masks))])
    expected = [((x + 0.5) * 120 / 4, (y + 0.5) * 90 / 4) for y in range(4) for x in range(4)]
    np.testing.assert_allclose(centres, expected, atol=0.6)
    radius = 5 * 120 / tiny.SIDE
    areas = np.bincount(masks.labels.ravel())[1:]
    np.testing.assert_allclose(areas, np.pi * radius**2, rtol=0.12)


def test_points_per_batch_does_not_change_the_masks(folder: Path) -> None:
    chosen = {"points_per_side": 4, "size": tiny.SIDE, "min_iou": -10.0, "min_stability": 0.0}
    one, many = (
        segment(SamSegmenter(folder / "sam", SamSettings(points_per_batch=n, **chosen)), picture()) for n in (1, 7)
    )
    np.testing.assert_array_equal(one.labels, many.labels)
    np.testing.assert_allclose(one.scores, many.scores, atol=1e-5)


@pytest.mark.parametrize("finished", [False, True])
@pytest.mark.parametrize("size", [(64, 64), (90, 120), (200, 100)])
def test_boxes_of_a_handmade_network_come_back_in_the_picture(
    tmp_path: Path, finished: bool, size: tuple[int, int]
) -> None:
    path = tiny.write_yolo(tmp_path / "boxes.onnx", tiny.FinishedBoxes() if finished else tiny.Boxes())
    masks = segment(YoloSegmenter(path, YOLO), np.zeros((*size, 3), np.uint8))
    tiny.check_masks(masks, size)
    np.testing.assert_allclose(masks.scores, [0.9, 0.6])
    scale = max(size) / 64
    pad = (64 - np.array(size) / scale) / 2
    for i, (x, y, width, height, _) in enumerate(tiny.Boxes.rows[:2].numpy()):
        rows, columns = np.nonzero(masks.labels == i + 1)
        low = np.clip((np.array([y - height / 2, x - width / 2]) - pad) * scale, 0, size)
        high = np.clip((np.array([y + height / 2, x + width / 2]) - pad) * scale, 0, size)
        np.testing.assert_allclose([rows.min(), columns.min()], low, atol=1)
        np.testing.assert_allclose([rows.max() + 1, columns.max() + 1], high, atol=1)


def test_stability_is_the_overlap_of_two_thresholds() -> None:
    logits = np.stack([np.linspace(-4, 4, 81).reshape(9, 9), np.full((9, 9), -9.0)]).astype(np.float32)
    got = stability(logits, 1.0)
    np.testing.assert_allclose(got, [(logits[0] > 1).sum() / (logits[0] > -1).sum(), 0])


# As segmenters


@pytest.mark.parametrize("name", ["sam", "raw", "sam2", "transformers", "efficient", "yolo.onnx", "yolo-free.onnx"])
def test_the_same_picture_gives_the_same_disjoint_masks(folder: Path, name: str) -> None:
    def make() -> SamSegmenter | YoloSegmenter:
        return YoloSegmenter(folder / name, YOLO) if "yolo" in name else SamSegmenter(folder / name, EVERYTHING)

    first, second = segment(make(), picture()), segment(make(), picture())
    tiny.check_masks(first)
    assert len(first) > 1
    assert first.labels.tobytes() == second.labels.tobytes()
    assert first.scores.tobytes() == second.scores.tobytes()


@pytest.mark.parametrize("name", ["sam", "raw", "sam2", "transformers", "efficient", "yolo.onnx", "yolo-free.onnx"])
def test_pictures_together_give_the_masks_of_pictures_alone(folder: Path, name: str) -> None:
    segmenter = YoloSegmenter(folder / name, YOLO) if "yolo" in name else SamSegmenter(folder / name, EVERYTHING)
    pictures = [picture(0), picture(1), picture(2, (64, 80)), picture(3)]
    for rgb, masks in zip(pictures, segmenter.segment_many(pictures), strict=True):
        alone = segment(segmenter, rgb)
        np.testing.assert_array_equal(masks.labels, alone.labels)
        np.testing.assert_allclose(masks.scores, alone.scores, atol=1e-5)


def test_nothing_found_is_an_empty_picture(folder: Path) -> None:
    for segmenter in (
        SamSegmenter(folder / "sam", SamSettings(points_per_side=2, min_iou=2, size=tiny.SIDE)),
        YoloSegmenter(folder / "yolo.onnx", YoloSettings(min_score=2)),
    ):
        masks = segment(segmenter, picture())
        tiny.check_masks(masks)
        assert len(masks) == 0


def test_a_decoder_for_a_fixed_number_of_prompts_is_filled_up(folder: Path, tmp_path: Path) -> None:
    write = tiny.write_sam(tmp_path / "three", tiny.model(tiny.SamDecoder))
    tiny.export(
        tiny.model(tiny.SamDecoder), tiny.sam_prompt(3), write / "decoder.onnx", tiny.SAM_INPUTS, tiny.SAM_OUTPUTS
    )
    three = SamSegmenter(write, EVERYTHING)
    assert three.model.points_per_call == 3
    got, expected = segment(three, picture()), segment(SamSegmenter(folder / "sam", EVERYTHING), picture())
    np.testing.assert_array_equal(got.labels, expected.labels)


def test_wrong_pictures_are_refused(folder: Path) -> None:
    for segmenter in (SamSegmenter(folder / "sam", EVERYTHING), YoloSegmenter(folder / "yolo.onnx")):
        for wrong in (np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.float32), np.zeros((0, 4, 3), np.uint8)):
            with pytest.raises(ValueError, match="expected \\(H, W, 3\\) uint8"):
                segmenter.segment_many([wrong])


# Which files


def test_the_decoder_is_found_beside_the_encoder(folder: Path, tmp_path: Path) -> None:
    for name in (
        "vision_encoder.onnx",
        "vision_encoder_fp16.onnx",
        "prompt_encoder_mask_decoder.onnx",
        "prompt_encoder_mask_decoder_fp16.onnx",
    ):
        (tmp_path / name).touch()
    plain = (tmp_path / "vision_encoder.onnx", tmp_path / "prompt_encoder_mask_decoder.onnx")
    assert find_files(tmp_path) == plain
    assert find_files(plain[0]) == plain
    half = tmp_path / "vision_encoder_fp16.onnx"
    assert find_files(half) == (half, tmp_path / "prompt_encoder_mask_decoder_fp16.onnx")


def test_files_without_such_names_are_told_apart_by_their_inputs(folder: Path, tmp_path: Path) -> None:
    for name, source in (("a", "decoder"), ("b", "encoder")):
        (tmp_path / f"{name}.onnx").write_bytes((folder / "sam" / f"{source}.onnx").read_bytes())
    assert find_files(tmp_path) == (tmp_path / "b.onnx", tmp_path / "a.onnx")
    assert find_files(tmp_path / "b.onnx") == (tmp_path / "b.onnx", tmp_path / "a.onnx")


def test_a_folder_of_a_hub_has_its_files_in_onnx(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "onnx").symlink_to(folder / "transformers")
    assert find_files(tmp_path)[0] == tmp_path / "onnx" / "vision_encoder.onnx"


# One clear error


class Renamed(nn.Module):
    """A decoder without has_mask_input."""

    def __init__(self) -> None:
        super().__init__()
        self.decoder = tiny.model(tiny.SamDecoder)

    def forward(self, embeddings, points, labels, mask, size):
        return self.decoder(embeddings, points, labels, mask, torch.zeros(1), size)


def sam_copy(folder: Path, tmp_path: Path) -> Path:
    for name in ("encoder", "decoder"):
        (tmp_path / f"{name}.onnx").write_bytes((folder / "sam" / f"{name}.onnx").read_bytes())
    return tmp_path


def no_decoder(folder: Path, tmp_path: Path) -> Path:
    (sam_copy(folder, tmp_path) / "decoder.onnx").unlink()
    return tmp_path / "encoder.onnx"


def truncated(folder: Path, tmp_path: Path) -> Path:
    path = sam_copy(folder, tmp_path) / "decoder.onnx"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return tmp_path


def text(folder: Path, tmp_path: Path) -> Path:
    (sam_copy(folder, tmp_path) / "encoder.onnx").write_text("version https://example.org/spec/v1\nsize 358\n")
    return tmp_path


def empty_file(folder: Path, tmp_path: Path) -> Path:
    (sam_copy(folder, tmp_path) / "encoder.onnx").write_bytes(b"")
    return tmp_path


def wrong_names(folder: Path, tmp_path: Path) -> Path:
    example = [a for i, a in enumerate(tiny.sam_prompt()) if i != 4]
    names = [n for n in tiny.SAM_INPUTS if n != "has_mask_input"]
    tiny.export(Renamed(), example, sam_copy(folder, tmp_path) / "decoder.onnx", names, tiny.SAM_OUTPUTS)
    return tmp_path


def wrong_rank(folder: Path, tmp_path: Path) -> Path:
    tiny.export(nn.Linear(3, 2), [torch.zeros(1, 3)], sam_copy(folder, tmp_path) / "encoder.onnx", ["image"], ["out"])
    return tmp_path


def swapped(folder: Path, tmp_path: Path) -> Path:
    return sam_copy(folder, tmp_path) / "decoder.onnx"


def other_width(folder: Path, tmp_path: Path) -> Path:
    path = sam_copy(folder, tmp_path) / "encoder.onnx"
    tiny.export(nn.Conv2d(3, 8, 16, 16), [torch.zeros(1, 3, 64, 64)], path, ["image"], ["image_embeddings"])
    return tmp_path


SAM_FAULTS: dict[str, tuple[Callable[[Path, Path], Path], str]] = {
    "nothing there": (lambda folder, tmp_path: tmp_path / "none", "no such file or folder"),
    "empty folder": (lambda folder, tmp_path: tmp_path, "no .onnx file"),
    "encoder without decoder": (no_decoder, "encoder.onnx there"),
    "truncated": (truncated, "no whole ONNX model"),
    "text": (text, "45 bytes that are no whole ONNX model"),
    "empty file": (empty_file, "0 bytes"),
    "an input missing": (wrong_names, "mask_input (1, 1, 16, 16) float32; orig_im_size"),
    "wrong rank": (wrong_rank, "image (1, 3) float32"),
    "the decoder for the encoder": (swapped, "point_coords"),
    "encoder and decoder of two models": (other_width, "a decoder that takes image_embeddings (1, 16, 4, 4)"),
}


@pytest.mark.parametrize("fault", SAM_FAULTS)
def test_bad_sam_files_end_in_one_clear_error(
    folder: Path, tmp_path: Path, fault: str, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, says = SAM_FAULTS[fault]
    path = spoil(folder, tmp_path)
    capfd.readouterr()
    with pytest.raises(DataError) as error:
        SamSegmenter(path, EVERYTHING)
    check_error(error.value, tmp_path, says, capfd)


def detector(folder: Path, tmp_path: Path) -> Path:
    path = tmp_path / "detector.onnx"
    return tiny.export(nn.Conv1d(7, 7, 1), [torch.zeros(1, 7, 9)], path, ["images"], ["output0"])


def no_classes(folder: Path, tmp_path: Path) -> Path:
    return tiny.write_yolo(tmp_path / "narrow.onnx", NoClasses())


def other_names(folder: Path, tmp_path: Path) -> Path:
    names = {"names": str({i: str(i) for i in range(80)})}
    return tiny.write_yolo(tmp_path / "names.onnx", tiny.model(tiny.Yolo), metadata=names)


class NoClasses(tiny.Boxes):
    """Prototypes, but candidates that have no class."""

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        rows, prototypes = super().forward(images)
        return rows[:, :6], prototypes


YOLO_FAULTS: dict[str, tuple[Callable[[Path, Path], Path], str]] = {
    "nothing there": (lambda folder, tmp_path: tmp_path / "none.onnx", "no such file"),
    "a folder": (lambda folder, tmp_path: tmp_path, "a folder"),
    "text": (lambda folder, tmp_path: text(folder, tmp_path) / "encoder.onnx", "no whole ONNX model"),
    "truncated": (lambda folder, tmp_path: truncated(folder, tmp_path) / "decoder.onnx", "no whole ONNX model"),
    "another network": (lambda folder, tmp_path: sam_copy(folder, tmp_path) / "decoder.onnx", "point_coords"),
    "a detector": (detector, "output0"),
    "no class": (no_classes, "output0 (1, 6, 3) float32"),
    "another number of classes": (other_names, "output0 (1, 39, 84) float32"),
}


@pytest.mark.parametrize("fault", YOLO_FAULTS)
def test_bad_yolo_files_end_in_one_clear_error(
    folder: Path, tmp_path: Path, fault: str, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, says = YOLO_FAULTS[fault]
    path = spoil(folder, tmp_path)
    capfd.readouterr()
    with pytest.raises(DataError) as error:
        YoloSegmenter(path)
    check_error(error.value, tmp_path, says, capfd)


def check_error(error: DataError, tmp_path: Path, says: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert str(error).startswith(str(tmp_path))
    assert says in error.found
    assert error.expected
    assert error.remedy
    assert len(str(error).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


def test_shapes_that_a_model_refuses_are_named(folder: Path) -> None:
    model = open_model(folder / "yolo.onnx", {"images": Port(4)}, {"output0": Port(3)}, "a network")
    with pytest.raises(DataError, match=r"cannot be run on images \(1, 3, 40, 40\)"):
        model.run(images=np.zeros((1, 3, 40, 40)))


def test_an_input_of_another_type_is_no_match(folder: Path) -> None:
    with pytest.raises(DataError, match="images"):
        open_model(folder / "yolo.onnx", {"images": Port(4, kind="int")}, {"output0": Port(3)}, "a network")


def test_only_the_tensor_left_stands_in_for_a_name(folder: Path) -> None:
    file = load(folder / "yolo.onnx", "a network")
    model = file.bind({"picture": Port(4, unnamed=True)}, {"rows": Port(3, unnamed=True)}, "a network")
    assert model.inputs["picture"].name == "images"
    assert model.outputs["rows"].name == "output0"
    with pytest.raises(DataError, match="picture of 4 axes"):
        file.bind({"picture": Port(4)}, {"rows": Port(3, unnamed=True)}, "a network")


def test_inputs_nothing_is_known_of_and_doubtful_ones_are_no_match(folder: Path) -> None:
    file = load(folder / "efficient" / "efficient_decoder.onnx", "a decoder")
    known = {"image_embeddings": Port(4), "batched_point_coords": Port(4), "batched_point_labels": Port(3)}
    outputs = {"iou_predictions": Port(3)}
    assert file.bind(known | {"orig_im_size": Port(1, kind="int")}, outputs, "a decoder").inputs.keys() == {
        *known,
        "orig_im_size",
    }
    with pytest.raises(DataError, match="orig_im_size"):
        file.bind(known, outputs, "a decoder")
    doubtful = {"picture": Port(4, unnamed=True), "points": Port(4, unnamed=True, optional=True)}
    rest = {"batched_point_labels": Port(3), "orig_im_size": Port(1, kind="int")}
    with pytest.raises(DataError, match="picture of 4 axes"):
        file.bind(doubtful | rest, outputs, "a decoder")


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: SamSettings(points_per_side=0),
        lambda: YoloSettings(size=33),
        lambda: YoloSettings(max_masks=0),
        lambda: DisjointSettings(nested=2),
        lambda: disjoint(np.zeros((2, 3, 3), bool), np.zeros(1)),
    ],
)
def test_wrong_settings_are_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match="expected"):
        wrong()


def test_a_frame_without_scaling_keeps_logits() -> None:
    logits = np.random.default_rng(0).normal(size=(2, 9, 7)).astype(np.float32)
    np.testing.assert_array_equal(Frame((9, 7), (9, 7), (9, 7)).to_picture(logits), logits)
