"""CLIP-like encoders: equal to the torch models they are exports of, crops, memory, one clear error for every bad file."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import tiny_clips as tiny
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from safetensors.numpy import save_file

from openmap_agents.perception.conse import unit
from openmap_agents.perception.crop_encoder import VOCABULARY
from openmap_agents.perception.crops import Crops, white_square
from openmap_agents.perception.onnx.clip import OnnxClipEncoder, cover
from openmap_agents.perception.onnx.clip_files import read_clip_folder
from openmap_agents.perception.onnx.tokens import load_tokens
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

TEXTS = ["a chair", "The red TABLE, please!", "", "chair " * 60, "the  lamp 7"]
POSE, CAMERA = np.eye(4), PinholeCamera(width=60, height=48, fx=50.0, fy=50.0, cx=29.5, cy=23.5)


def _scene() -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32], Masks]:
    """A picture with three masks, the second of them without a pixel."""
    rgb = tiny.pictures(1, [(48, 60)])[0]
    labels = np.zeros((48, 60), np.int32)
    labels[3:20, 40:58], labels[25:48, 0:33] = 1, 3
    labels[30:35, 5:9] = 0
    return rgb, np.ones((48, 60), np.float32), Masks(labels, np.ones(3, np.float32))


@pytest.fixture(scope="module")
def models() -> dict[str, Any]:
    return {"clip": tiny.clip_model(), "siglip": tiny.siglip_model()}


@pytest.fixture(scope="module")
def folders(models: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of both kinds with towers, with one combined file, and with towers whose batch axis is three."""
    there = {}
    for kind, model in models.items():
        for layout, options in {"towers": {}, "combined": {"combined": True}, "fixed": {"fixed": 3}}.items():
            folder = tmp_path_factory.mktemp(f"{kind}-{layout}")
            tiny.write_settings(model, folder)
            tiny.export(model, folder, **options)
            if layout != "combined":
                _set(folder / "config.json", **_learnt(model))
            there[f"{kind} {layout}"] = folder
    return there


def _learnt(model: Any) -> dict[str, float]:
    return {n: float(getattr(model, n).detach()) for n in ("logit_scale", "logit_bias") if hasattr(model, n)}


def _set(path: Path, **values: Any) -> None:
    """Change values of a JSON file; None takes one out."""
    config = json.loads(path.read_text()) | values
    path.write_text(json.dumps({k: v for k, v in config.items() if v is not None}))


def _copy(folder: Path, to: Path) -> Path:
    shutil.copytree(folder, to, dirs_exist_ok=True)
    return to


def _torch_images(kind: str, model: Any, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
    pixels = tiny.processor(kind == "siglip")(pictures)["pixel_values"]
    with torch.no_grad():
        return unit(tiny.images_of(model, torch.tensor(np.stack(pixels))).numpy())


def _torch_texts(kind: str, model: Any, texts: list[str]) -> npt.NDArray[np.float32]:
    tokenizer = tiny.siglip_tokenizer() if kind == "siglip" else tiny.clip_tokenizer()
    tokens = tokenizer(texts, padding="max_length", truncation=True, return_tensors="pt")
    given = {n: tokens[n] for n in (["input_ids"] if kind == "siglip" else ["input_ids", "attention_mask"])}
    with torch.no_grad():
        return unit(tiny.texts_of(model, **given).numpy())


# --- tokens --------------------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(st.lists(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=120), min_size=1, max_size=4))
def test_tokens_equal_those_of_transformers(folders: dict[str, Path], texts: list[str]) -> None:
    for kind, theirs, length in (("clip", tiny.clip_tokenizer(), 77), ("siglip", tiny.siglip_tokenizer(), 16)):
        ids, there = load_tokens(folders[f"{kind} towers"], positions=length, pad="?", lower=kind == "siglip")(texts)
        expected = theirs(texts, padding="max_length", truncation=True, max_length=length)
        assert ids.tolist() == expected["input_ids"]
        assert there.tolist() == expected["attention_mask"]


def test_tokens_are_cleaned_and_filled_as_the_model_was_trained(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = folders["siglip towers"]
    plain = load_tokens(folder, positions=16, pad=0)
    bare = load_tokens(folder, positions=16, pad=0, lower=True, bare=True)
    assert bare(["  A  chair,\tplease! "])[0].tolist() == plain(["a chair please"])[0].tolist()
    first = _copy(folder, tmp_path)
    _set(first / "tokenizer_config.json", tokenizer_class="SiglipTokenizer", padding_side="left")
    left = load_tokens(first, positions=10, pad=0)
    ids, there = left(["the-chair"])
    assert left.bare
    assert ids.shape == (1, 10)
    assert there[0].tolist() == sorted(there[0].tolist())
    number = load_tokens(folders["clip towers"], positions=77, pad=0)(["a chair"])[0][0]
    assert number[-1] == 0  # whatever the files name


# --- equality with torch -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["towers", "combined", "fixed"])
@pytest.mark.parametrize("kind", ["clip", "siglip"])
def test_pictures_and_texts_equal_the_torch_original(
    models: dict[str, Any], folders: dict[str, Path], kind: str, layout: str
) -> None:
    encoder = OnnxClipEncoder(folders[f"{kind} {layout}"], batch=2)
    pictures = tiny.pictures()
    images, texts = encoder.encode_pictures(pictures), encoder.encode_text(TEXTS)
    expected = _torch_images(kind, models[kind], pictures)
    assert np.abs(images - expected).max() < 1e-4
    assert np.abs(texts - _torch_texts(kind, models[kind], TEXTS)).max() < 1e-4
    assert np.abs(expected[0] - expected[1]).max() > 0.05  # the equality would not hold for just any pictures
    for vectors in (images, texts):
        assert vectors.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-6)
    assert encoder.dim == images.shape[1] == texts.shape[1]


@pytest.mark.parametrize("layout", ["towers", "combined"])
def test_siglips_calibration_is_its_own_sigmoid(models: dict[str, Any], folders: dict[str, Path], layout: str) -> None:
    encoder, pictures = OnnxClipEncoder(folders[f"siglip {layout}"]), tiny.pictures()
    pixels = torch.tensor(np.stack(tiny.processor(True)(pictures)["pixel_values"]))
    ids = tiny.siglip_tokenizer()(TEXTS, padding="max_length", truncation=True, return_tensors="pt")["input_ids"]
    with torch.no_grad():
        expected = torch.sigmoid(models["siglip"](input_ids=ids, pixel_values=pixels).logits_per_image).numpy()
    found = encoder.calibration(encoder.encode_pictures(pictures) @ encoder.encode_text(TEXTS).T)
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("layout", ["towers", "combined"])
def test_clips_calibration_is_its_softmax_against_words_that_do_not_fit(
    models: dict[str, Any], folders: dict[str, Path], layout: str
) -> None:
    calibration = OnnxClipEncoder(folders[f"clip {layout}"]).calibration
    scale = float(models["clip"].logit_scale.detach().exp())
    assert calibration.slope == pytest.approx(scale, rel=1e-4)
    unfit = -(calibration.offset + np.log(VOCABULARY)) / scale
    assert -1 <= unfit <= 1
    others = np.exp(scale * unfit)
    assert calibration(0.9) == pytest.approx(
        np.exp(scale * 0.9) / (np.exp(scale * 0.9) + VOCABULARY * others), rel=1e-3
    )


def test_the_scale_is_read_from_weights_or_is_where_clips_training_ends(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    folder = _copy(folders["clip towers"], tmp_path)
    _set(folder / "config.json", logit_scale=None)
    assert read_clip_folder(folder).logit == (100.0, None)
    _set(folder / "config.json", logit_scale_init_value=3.0)
    assert read_clip_folder(folder).logit == (pytest.approx(np.exp(3.0)), None)
    save_file({"logit_scale": np.array(4.0, np.float32), "x": np.zeros(3, np.float32)}, folder / "model.safetensors")
    assert read_clip_folder(folder).logit == (pytest.approx(np.exp(4.0)), None)
    (folder / "model.safetensors").write_bytes(b"123")
    with pytest.raises(DataError, match=r"model\.safetensors"):
        read_clip_folder(folder)


def test_openclips_own_layout_with_names_of_its_own(
    models: dict[str, Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    import onnx

    source = folders["clip towers"]
    (tmp_path / "visual").mkdir()
    (tmp_path / "textual").mkdir()
    for tower, part, old, new in (
        ("visual", "vision", "pixel_values", "image"),
        ("textual", "text", "input_ids", "words"),
    ):
        network = onnx.load(str(source / "onnx" / f"{part}_model.onnx"))
        for node in network.graph.node:
            node.input[:] = [new if n == old else n for n in node.input]
        next(i for i in network.graph.input if i.name == old).name = new
        onnx.save(network, str(tmp_path / tower / "model.onnx"))
    for name in ("tokenizer.json", "tokenizer_config.json"):
        shutil.copy(source / name, tmp_path / "textual" / name)
    vision = {"image_size": tiny.SIZE, "patch_size": tiny.PATCH, "layers": 2, "width": 32}
    config = {"embed_dim": 24, "vision_cfg": vision, "text_cfg": {"context_length": 77}, "init_logit_scale": 3.5}
    (tmp_path / "config.json").write_text(json.dumps(config))
    (tmp_path / "visual" / "preprocess_cfg.json").write_text(json.dumps({"size": [32, 32], "resize_mode": "squash"}))
    encoder = OnnxClipEncoder(tmp_path)
    assert encoder.calibration.slope == pytest.approx(np.exp(3.5))
    squares = [white_square(p) for p in tiny.pictures()]
    assert np.abs(encoder.encode_pictures(squares) - _torch_images("clip", models["clip"], squares)).max() < 1e-4
    # CLIP attends backwards only, so that what texts are filled up with does not show.
    assert np.abs(encoder.encode_text(TEXTS) - _torch_texts("clip", models["clip"], TEXTS)).max() < 1e-4


def test_lesser_precisions_and_newer_processor_files_are_found(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = _copy(folders["clip towers"], tmp_path)
    whole = OnnxClipEncoder(folder).encode_pictures(tiny.pictures())
    for part in ("vision", "text"):
        (folder / "onnx" / f"{part}_model.onnx").rename(folder / f"{part}_model_fp16.onnx")
    settings = json.loads((folder / "preprocessor_config.json").read_text())
    (folder / "preprocessor_config.json").unlink()
    (folder / "processor_config.json").write_text(json.dumps({"image_processor": settings}))
    assert np.array_equal(OnnxClipEncoder(folder).encode_pictures(tiny.pictures()), whole)


# --- regions, crops, memory ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["towers", "fixed"])
@pytest.mark.parametrize("whiten", [False, True])
def test_regions_are_the_mean_of_their_crops(folders: dict[str, Path], layout: str, whiten: bool) -> None:
    crops, (rgb, depth, masks) = Crops(2, 0.3, whiten), _scene()
    encoder = OnnxClipEncoder(folders[f"clip {layout}"], crops=crops, batch=3)
    found = encoder.encode_regions(rgb, depth, masks, POSE, CAMERA)
    assert np.array_equal(found, encoder.encode_regions(rgb, depth, masks, POSE, CAMERA))
    for i in (0, 2):
        rows, columns = np.nonzero(masks.labels == i + 1)
        total = np.zeros(encoder.dim)
        for level in range(2):
            dv = level * int(np.ceil((np.ptp(rows) + 1) * 0.3))
            du = level * int(np.ceil((np.ptp(columns) + 1) * 0.3))
            box = (
                slice(max(0, rows.min() - dv), rows.max() + 1 + dv),
                slice(max(0, columns.min() - du), columns.max() + 1 + du),
            )
            part = rgb[box].copy()
            if whiten:
                part[masks.labels[box] != i + 1] = 255
            total += encoder.encode_crops([part])[0]
        np.testing.assert_allclose(found[i], total / np.linalg.norm(total), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6)


def test_crops_of_things_are_not_cut(models: dict[str, Any], folders: dict[str, Path]) -> None:
    encoder, pictures = OnnxClipEncoder(folders["clip towers"]), tiny.pictures()
    expected = _torch_images("clip", models["clip"], [white_square(p) for p in pictures])
    assert np.abs(encoder.encode_crops(pictures) - expected).max() < 1e-4


def test_nothing_gives_nothing(folders: dict[str, Path]) -> None:
    none = Masks(np.zeros((48, 60), np.int32), np.zeros(0, np.float32))
    rgb, depth, _ = _scene()
    for dense in (False, True):
        encoder = OnnxClipEncoder(folders["siglip towers"], dense=dense)
        for found in (
            encoder.encode_text([]),
            encoder.encode_crops([]),
            encoder.encode_regions(rgb, depth, none, POSE, CAMERA),
        ):
            assert found.shape == (0, encoder.dim)
            assert found.dtype == np.float32


def test_texts_are_encoded_once_and_the_latest_are_remembered(folders: dict[str, Path]) -> None:
    encoder = OnnxClipEncoder(folders["clip towers"], remembered=3, batch=4, template="a photo of a {}")
    asked: list[str] = []
    tower = encoder._text_tower
    encoder._text_tower = lambda texts: (asked.extend(texts), tower(texts))[1]  # type: ignore[method-assign]
    first = encoder.encode_text(["a", "b", "a", "c", "d", "e"])
    assert asked == [f"a photo of a {c}" for c in "abcde"]
    again = encoder.encode_text(["e", "c", "e"])
    assert len(asked) == 5
    assert np.array_equal(again, first[[5, 3, 5]])
    encoder.encode_text(["a"])
    assert len(asked) == 6
    encoder.encode_text(["e", "c"])
    assert len(asked) == 6  # d was the one not asked for the longest
    again[:] = 0  # what was given away is a copy
    assert np.array_equal(encoder.encode_text(["e"])[0], first[5])


def test_wrong_arguments_are_refused(folders: dict[str, Path]) -> None:
    for wrong in ({"batch": 0}, {"remembered": 0}, {"template": "a photo"}, {"threads": 0}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            OnnxClipEncoder(folders["clip towers"], **wrong)  # type: ignore[arg-type]
    encoder = OnnxClipEncoder(folders["clip towers"])
    with pytest.raises(ValueError, match="a picture is"):
        encoder.encode_pictures([np.zeros((4, 4), np.uint8)])
    with pytest.raises(ValueError, match="dense=True"):
        encoder.dense(_scene()[0])


# --- one dense pass ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["towers", "fixed"])
@pytest.mark.parametrize("kind", ["clip", "siglip"])
def test_a_dense_pass_is_the_models_own_head_on_each_patch(
    models: dict[str, Any], folders: dict[str, Path], kind: str, layout: str
) -> None:
    encoder, (rgb, depth, masks) = OnnxClipEncoder(folders[f"{kind} {layout}"], dense=True), _scene()
    small = np.asarray(Image.fromarray(rgb).resize((tiny.SIZE, tiny.SIZE), Image.Resampling.BICUBIC))
    pixels = torch.tensor(np.stack(tiny.processor(kind == "siglip")([small])["pixel_values"]))
    vision, model = models[kind].vision_model, models[kind]
    with torch.no_grad():
        hidden = vision(pixel_values=pixels).last_hidden_state[0]
        if kind == "clip":
            expected = model.visual_projection(vision.post_layernorm(hidden[1:])).numpy()
        else:
            expected = np.stack([vision.head(token[None, None])[0].numpy() for token in hidden])
    side = tiny.SIZE // tiny.PATCH
    dense = encoder.dense(rgb)
    assert np.abs(dense - unit(expected).reshape(side, side, -1)).max() < 1e-4
    found = encoder.encode_regions(rgb, depth, masks, POSE, CAMERA)
    for i in (0, 2):
        share = (masks.labels == i + 1).reshape(side, 48 // side, side, 60 // side).mean((1, 3))
        np.testing.assert_allclose(found[i], unit((share[..., None] * dense).sum((0, 1))[None])[0], atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-6)


def test_the_smallest_mask_covers_some_patch() -> None:
    labels = np.zeros((480, 640), np.int32)
    labels[479, 639] = 1
    weights = cover(Masks(labels, np.ones(1, np.float32)), 14, 14)
    assert weights[0, -1] == pytest.approx(1)


def test_a_model_without_tokens_refuses_the_dense_pass(
    models: dict[str, Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    with pytest.raises(DataError, match=r"model\.onnx.*last_hidden_state"):
        OnnxClipEncoder(folders["clip combined"], dense=True)
    folder = _copy(folders["clip towers"], tmp_path)
    tiny.export(models["clip"], folder, hidden=False)
    OnnxClipEncoder(folder)
    with pytest.raises(DataError, match=r"vision_model\.onnx.*last_hidden_state"):
        OnnxClipEncoder(folder, dense=True)


# --- bad files -----------------------------------------------------------------------------------------------------------


def _cut(name: str) -> Callable[[Path], object]:
    return lambda f: (f / name).write_bytes((f / name).read_bytes()[: (f / name).stat().st_size // 2])


def _gone(name: str) -> Callable[[Path], object]:
    return lambda f: (f / name).unlink()


def _with(name: str, **values: Any) -> Callable[[Path], object]:
    return lambda f: _set(f / name, **values)


def _write(name: str, text: str) -> Callable[[Path], object]:
    return lambda f: (f / name).write_text(text)


VISION, TEXT, PREPARED = "onnx/vision_model.onnx", "onnx/text_model.onnx", "preprocessor_config.json"
BAD: list[tuple[str, Callable[[Path], object], str]] = [
    ("no image tower", _gone(VISION), "vision_model.onnx"),
    ("no text tower", _gone(TEXT), "text_model.onnx"),
    ("half an image tower", _cut(VISION), "vision_model.onnx"),
    ("half a text tower", _cut(TEXT), "text_model.onnx"),
    ("an empty tower", _write(TEXT, ""), "text_model.onnx"),
    ("towers exchanged", lambda f: shutil.copy(f / TEXT, f / VISION), "vision_model.onnx"),
    ("no config", _gone("config.json"), "config.json"),
    ("half a config", _cut("config.json"), "config.json"),
    ("a config that is a list", _write("config.json", "[]"), "config.json"),
    ("another kind of model", _with("config.json", model_type="blip"), "config.json"),
    ("no kind of model", _with("config.json", model_type=None), "config.json"),
    ("a part that is none", _with("config.json", text_config=3), "config.json"),
    ("a patch of nothing", _with("config.json", vision_config={"patch_size": 0}), "config.json"),
    ("a scale that is none", _with("config.json", logit_scale="big"), "config.json"),
    ("fewer tokens", _with("config.json", text_config={"max_position_embeddings": 40}), "text_model.onnx"),
    ("no tokenizer", _gone("tokenizer.json"), "tokenizer.json"),
    ("half a tokenizer", _cut("tokenizer.json"), "tokenizer.json"),
    ("half its settings", _cut("tokenizer_config.json"), "tokenizer_config.json"),
    ("unknown padding", _with("tokenizer_config.json", pad_token="<none>"), "tokenizer.json"),
    ("an unknown side", _with("tokenizer_config.json", padding_side="top"), "tokenizer_config.json"),
    ("no preprocessor", _gone(PREPARED), PREPARED),
    ("half a preprocessor", _cut(PREPARED), PREPARED),
    ("another preprocessor", _with(PREPARED, image_processor_type="Siglip2ImageProcessor"), PREPARED),
    ("a size of words", _with(PREPARED, size="large"), PREPARED),
    ("a size of nothing", _with(PREPARED, crop_size={"height": 0, "width": 3}), PREPARED),
    ("no final size", _with(PREPARED, do_center_crop=False), PREPARED),
    ("an unknown filter", _with(PREPARED, resample=17), PREPARED),
    ("two colours", _with(PREPARED, image_mean=[0.5, 0.5]), PREPARED),
    ("a colour that is none", _with(PREPARED, image_std=[0.5, 0.5, "x"]), PREPARED),
    ("no spread", _with(PREPARED, image_std=[0.0, 1.0, 1.0]), PREPARED),
    ("pictures of another size", _with(PREPARED, crop_size={"height": 24, "width": 24}), "vision_model.onnx"),
]


@pytest.mark.parametrize(("change", "name"), [b[1:] for b in BAD], ids=[b[0].replace(" ", "-") for b in BAD])
def test_a_bad_folder_ends_in_one_error_that_names_the_file(
    folders: dict[str, Path], tmp_path: Path, change: Callable[[Path], object], name: str
) -> None:
    folder = _copy(folders["clip towers"], tmp_path / "model")
    change(folder)
    with pytest.raises(DataError) as error:
        OnnxClipEncoder(folder)
    assert error.value.source.endswith(name)
    assert error.value.expected


def test_a_folder_that_is_none_and_a_siglip_without_its_scale(folders: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        OnnxClipEncoder(tmp_path / "nowhere")
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="a file"):
        OnnxClipEncoder(tmp_path / "file")
    folder = _copy(folders["siglip towers"], tmp_path / "model")
    _set(folder / "config.json", logit_bias=None)
    with pytest.raises(DataError, match="logit_bias"):
        OnnxClipEncoder(folder)


def test_wrong_input_names_and_towers_of_two_models(
    models: dict[str, Any], folders: dict[str, Path], tmp_path: Path
) -> None:
    folder = _copy(folders["clip towers"], tmp_path)
    at, length = folder / "onnx", 77
    ids = torch.ones((2, length), dtype=torch.int64)
    tiny._write(
        tiny._Text(models["clip"]), (ids, ids), at / "text_model.onnx", ["first", "second"], ["text_embeds"], None
    )
    with pytest.raises(DataError, match=r"text_model\.onnx.*first.*expected.*input_ids"):
        OnnxClipEncoder(folder)
    # Without its projection a tower's pooled output is no vector among the words.
    tiny._write(
        tiny._Vision(models["clip"], False),
        (torch.zeros(2, 3, 32, 32),),
        at / "vision_model.onnx",
        ["x"],
        ["pooler_output"],
        None,
    )
    with pytest.raises(DataError, match=r"vision_model\.onnx.*pooler_output.*expected.*image_embeds"):
        OnnxClipEncoder(folder)


# --- open_clip -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def open_clip_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    open_clip = tiny.open_clip_or_skip()
    from safetensors.torch import save_file as save_tensors

    folder = tmp_path_factory.mktemp("open_clip")
    torch.manual_seed(0)
    vision = {"image_size": 32, "layers": 2, "width": 32, "head_width": 16, "patch_size": 8}
    text = {"context_length": 77, "vocab_size": 49408, "width": 16, "heads": 2, "layers": 2}
    config = {"embed_dim": 24, "vision_cfg": vision, "text_cfg": text}
    prepared = {"mean": [0.5, 0.4, 0.3], "std": [0.2, 0.3, 0.4], "resize_mode": "squash"}
    (folder / "open_clip_config.json").write_text(json.dumps({"model_cfg": config, "preprocess_cfg": prepared}))
    save_tensors(open_clip.model.CLIP(**config).state_dict(), folder / "open_clip_model.safetensors")
    return folder


def test_an_open_clip_folder_gives_what_open_clip_gives(open_clip_folder: Path) -> None:
    open_clip = tiny.open_clip_or_skip()
    from openmap_agents.perception.openclip import OpenClipEncoder

    encoder, pictures = OpenClipEncoder(str(open_clip_folder), batch=2, device="cpu"), tiny.pictures()
    name = f"local-dir:{open_clip_folder}"
    model, prepare = open_clip.create_model_from_pretrained(name)
    with torch.no_grad():
        images = model.encode_image(torch.stack([prepare(Image.fromarray(p)) for p in pictures]), normalize=True)
        texts = model.encode_text(open_clip.get_tokenizer(name)(TEXTS), normalize=True)
    assert np.abs(encoder.encode_pictures(pictures) - images.numpy()).max() < 1e-4
    assert np.abs(encoder.encode_text(TEXTS) - texts.numpy()).max() < 1e-4
    assert encoder.calibration.slope == pytest.approx(1 / 0.07, rel=1e-4)
    rgb, depth, masks = _scene()
    assert encoder.encode_regions(rgb, depth, masks, POSE, CAMERA).shape == (3, 24)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("ViT-Q-7/openai", "no architecture 'ViT-Q-7'"),
        ("vit-b-32/openai", "Did you mean ViT-B-32"),
        ("ViT-B-32/nobody", "no weights 'nobody'.*openai"),
        ("ViT-B-32", "no weights ''"),
        ("ViT-B-32//no/where.pt", "no such file"),
        ("./no/where", "no such folder"),
    ],
)
def test_wrong_names_of_open_clip_models(name: str, message: str) -> None:
    tiny.open_clip_or_skip()
    from openmap_agents.perception.openclip import OpenClipEncoder

    with pytest.raises(DataError, match=message):
        OpenClipEncoder(name)


def test_weights_of_open_clip_that_are_damaged_or_of_another_model_or_code(
    open_clip_folder: Path, tmp_path: Path
) -> None:
    from openmap_agents.perception.openclip import OpenClipEncoder

    (tmp_path / "damaged.safetensors").write_bytes(b"{}")
    torch.save({"state_dict": print}, tmp_path / "code.pt")
    weights = open_clip_folder / "open_clip_model.safetensors"
    for path in (tmp_path / "damaged.safetensors", tmp_path / "code.pt", weights):
        with pytest.raises(DataError, match="no usable weights"):
            OpenClipEncoder(f"ViT-S-32/{path}", device="cpu")
    with pytest.raises(DataError, match="from a hub"):
        OpenClipEncoder(f"ViT-B-16-SigLIP/{weights}")
    folder = _copy(open_clip_folder, tmp_path / "folder")
    (folder / weights.name).unlink()
    with pytest.raises(DataError, match="no weights"):
        OpenClipEncoder(str(folder))


def test_a_hub_that_cannot_be_reached_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    open_clip = tiny.open_clip_or_skip()
    from openmap_agents.perception.openclip import OpenClipEncoder

    def refuse(*_: Any, **__: Any) -> None:
        raise OSError("no route to host")

    monkeypatch.setattr(open_clip.factory, "download_pretrained", refuse)
    with pytest.raises(DataError, match=r"no route to host.*come from a hub.*name a file"):
        OpenClipEncoder("ViT-B-32/openai", device="cpu")


def test_without_the_package_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from openmap_agents.perception.openclip import OpenClipEncoder

    monkeypatch.setitem(sys.modules, "open_clip", None)
    monkeypatch.setitem(sys.modules, "torchvision", None)
    with pytest.raises(DataError, match=r"pip install 'openmap-nav\[clip\]'"):
        OpenClipEncoder("ViT-B-32/openai")


def test_a_torchvision_whose_operators_cannot_be_loaded_is_imported_all_the_same(tmp_path: Path) -> None:
    package = tmp_path / "torchvision"
    package.mkdir()
    registers = "\n".join(f"torch.library.register_fake('torchvision::{n}')(lambda *a: None)" for n in ("nms", "qnms"))
    other = "if 'OTHER' in os.environ: raise RuntimeError('something else')"
    (package / "__init__.py").write_text(f"import os, torch\n{other}\n{registers}\nfrom torchvision import part\n")
    (package / "part.py").write_text("VALUE = 3\n")
    program = (
        "import os, sys; sys.path.insert(0, sys.argv[1])\n"
        "from openmap_agents.perception.torchvision_import import import_torchvision\n"
        "os.environ['OTHER'] = ''\n"
        "try: import_torchvision()\n"
        "except RuntimeError as error: assert str(error) == 'something else'\n"
        "else: raise AssertionError('another fault went by')\n"
        "del os.environ['OTHER']\n"
        "assert import_torchvision().part.VALUE == 3 and import_torchvision() is sys.modules['torchvision']\n"
    )
    run = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_nothing_of_torch_is_loaded_for_onnx() -> None:
    program = (
        "import sys\n"
        "import openmap_agents.perception.onnx.clip, openmap_agents.perception.openclip, openmap_agents.perception.crops\n"
        "assert not {'torch', 'transformers', 'onnx', 'open_clip'} & set(sys.modules), sorted(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
