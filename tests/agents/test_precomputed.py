"""Masks and features from disk: written, found by their pictures, and refused in one message where they do not fit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception import Masks, make_encoder, make_perception, make_segmenter, make_text_tower, resolve
from openmap_agents.perception.precomputed import PrecomputedEncoder, PrecomputedSegmenter
from openmap_agents.perception.protocol import Calibration
from openmap_agents.perception.specs import read_encoder_spec
from openmap_agents.perception.stored_frames import picture_digest, read_frame, write_frame, write_index
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import DataError, PinholeCamera

CAMERA = PinholeCamera.from_hfov(8, 6, 90.0)
DEPTH = np.ones((6, 8), np.float32)
POSE = np.eye(4)
LABELS = np.kron(np.array([[0, 1], [2, 3]], np.uint8), np.ones((3, 4), np.uint8))


class Tower:
    """Words and pictures in a space of three dimensions."""

    dim = 3
    calibration = Calibration(3.0, -1.0)

    def encode_text(self, texts: list[str]) -> np.ndarray:
        return np.eye(3, dtype=np.float32)[[len(t) % 3 for t in texts]].reshape(-1, 3)

    def encode_crops(self, crops: list[np.ndarray]) -> np.ndarray:
        return np.tile(np.eye(3, dtype=np.float32)[0], (len(crops), 1))


def picture(number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 256, (6, 8, 3), np.uint8)


def segment(segmenter, rgb: np.ndarray) -> Masks:
    return segmenter.segment(rgb, DEPTH, POSE, CAMERA)


def test_frames_are_found_by_their_pictures_in_whatever_order(tmp_path: Path):
    for n in range(4):
        scores, features = np.full(3, n / 4), np.eye(3) * (n + 1) + 0.5
        write_frame(tmp_path, picture(n), np.roll(LABELS, n, 0), scores=scores, features=features)
    segmenter, encoder = PrecomputedSegmenter(tmp_path), PrecomputedEncoder(tmp_path, Tower())
    for n in (2, 0, 3, 0, 1):
        masks = segment(segmenter, picture(n))
        np.testing.assert_array_equal(masks.labels, np.roll(LABELS, n, 0))
        assert masks.labels.dtype == np.int32
        np.testing.assert_array_equal(masks.scores, np.full(3, n / 4, np.float32))
        features = encoder.encode_regions(picture(n), DEPTH, masks, POSE, CAMERA)
        expected = np.eye(3) * (n + 1) + 0.5
        np.testing.assert_allclose(features, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-6)
        assert features.dtype == np.float32
    assert encoder.calibration == Tower.calibration
    assert encoder.encode_crops([picture(0)]).shape == (1, 3)
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".npz"] * 4


def test_the_digest_is_what_the_format_says():
    import hashlib

    rgb = picture(1)
    assert picture_digest(rgb) == hashlib.sha256(b"6x8:" + rgb.tobytes()).hexdigest()[:24]
    assert picture_digest(np.asfortranarray(rgb)) == picture_digest(rgb)
    assert picture_digest(rgb.reshape(8, 6, 3)) != picture_digest(rgb)
    with pytest.raises(ValueError, match="expected uint8"):
        picture_digest(rgb.astype(np.float32))


def test_a_file_that_numpy_alone_wrote_will_do(tmp_path: Path):
    np.savez(tmp_path / f"{picture_digest(picture(0))}.npz", labels=LABELS.astype(np.int64))
    masks = segment(make_segmenter(f"precomputed:{tmp_path}"), picture(0))
    np.testing.assert_array_equal(masks.labels, LABELS)
    np.testing.assert_array_equal(masks.scores, np.ones(3))


def test_an_index_says_which_picture_a_named_file_is_of(tmp_path: Path):
    for n in range(3):
        write_frame(tmp_path, f"frame-{n}", np.roll(LABELS, n, 1))
    write_index(tmp_path, {f"frame-{n}.npz": picture(n) for n in range(2)})
    write_index(tmp_path, {"frame-2.npz": picture(2)})
    segmenter = PrecomputedSegmenter(tmp_path)
    for n in (2, 0, 1):
        np.testing.assert_array_equal(segment(segmenter, picture(n)).labels, np.roll(LABELS, n, 1))


def test_frames_are_taken_in_the_order_of_their_numbers_where_asked(tmp_path: Path):
    for n in (9, 10, 100):
        write_frame(tmp_path, str(n), LABELS, scores=[n / 100] * 3, features=np.ones((3, 384)) * n)
    segmenter, encoder = make_perception(*[f"precomputed:{tmp_path}?frames=order"] * 2)
    for n in (9, 10, 100):
        masks = segment(segmenter, picture(0))
        assert masks.scores[0] == np.float32(n / 100)
        assert encoder.encode_regions(picture(0), DEPTH, masks, POSE, CAMERA).shape == (3, 384)
    with pytest.raises(DataError, match="3 frames, expected one more"):
        segment(segmenter, picture(0))
    write_frame(tmp_path, "last", LABELS)
    with pytest.raises(DataError, match="a name that is no number"):
        make_segmenter(f"precomputed:{tmp_path}?frames=order")


def test_names_do_where_there_are_no_features(tmp_path: Path):
    write_frame(tmp_path, picture(0), LABELS, names=["sofa", "floor lamp", "küche"])
    write_frame(tmp_path, picture(1), np.zeros_like(LABELS))
    text = TextEncoder()
    encoder = make_encoder(f"precomputed:{tmp_path}", text=text)
    masks = read_frame(next(tmp_path.glob(f"{picture_digest(picture(0))}*"))).masks
    features = encoder.encode_regions(picture(0), DEPTH, masks, POSE, CAMERA)
    np.testing.assert_array_equal(features, text.encode_text(["sofa", "floor lamp", "küche"]))
    nothing = Masks(np.zeros((6, 8), np.int32), np.zeros(0, np.float32))
    assert encoder.encode_regions(picture(1), DEPTH, nothing, POSE, CAMERA).shape == (0, 384)
    with pytest.raises(ValueError, match="given crops"):
        encoder.encode_crops([picture(0)])


def test_features_are_for_the_masks_of_their_file_alone(tmp_path: Path):
    write_frame(tmp_path, picture(0), LABELS, features=np.eye(3))
    encoder = PrecomputedEncoder(tmp_path, Tower())
    fewer = Masks(np.where(np.arange(8) < 3, LABELS, 0).astype(np.int32), np.ones(3, np.float32))
    np.testing.assert_array_equal(encoder.encode_regions(picture(0), DEPTH, fewer, POSE, CAMERA), np.eye(3))
    for labels, n in ((LABELS.T.reshape(6, 8), 3), (np.minimum(LABELS, 2), 2)):
        with pytest.raises(DataError, match="other masks"):
            encoder.encode_regions(picture(0), DEPTH, Masks(labels.astype(np.int32), np.ones(n)), POSE, CAMERA)


def test_features_of_another_length_than_the_words_are_refused_at_once(tmp_path: Path):
    write_frame(tmp_path, picture(0), LABELS, features=np.ones((3, 5)))
    with pytest.raises(DataError, match=r"features of 5 values, expected 384.*\?text="):
        make_encoder(f"precomputed:{tmp_path}", text=TextEncoder())
    with pytest.raises(DataError, match="features of 5 values, expected 3"):
        PrecomputedEncoder(tmp_path, Tower())


def test_masks_alone_cannot_be_encoded(tmp_path: Path):
    write_frame(tmp_path, picture(0), LABELS)
    with pytest.raises(DataError, match="neither features nor names"):
        PrecomputedEncoder(tmp_path, Tower())


BAD = {
    "wrong shape": ({"labels": np.ones((5, 8), np.int32)}, r"labels \(5, 8\), expected \(6, 8\)"),
    "three axes": ({"labels": np.ones((6, 8, 1), np.int32)}, r"labels \(H, W\)"),
    "floats": ({"labels": np.ones((6, 8))}, "integers"),
    "negative": ({"labels": np.full((6, 8), -1)}, "labels -1..0"),
    "too many": ({"labels": np.full((6, 8), 2**40)}, "labels 0..n"),
    "few scores": ({"labels": LABELS, "scores": np.ones(2)}, "2 scores"),
    "scores of nothing": ({"labels": LABELS, "scores": np.float32(1)}, "scores"),
    "high scores": ({"labels": LABELS, "scores": np.full(3, 1.5)}, "from 0 to 1"),
    "unlike lengths": ({"labels": LABELS, "scores": np.ones(4), "features": np.ones((3, 3))}, "n of each"),
    "zero feature": ({"labels": LABELS, "features": np.zeros((3, 3))}, "zero or not finite"),
    "nan feature": ({"labels": LABELS, "features": np.full((3, 3), np.nan)}, "zero or not finite"),
    "flat features": ({"labels": LABELS, "features": np.ones(3)}, r"\(n, D\)"),
    "names of bytes": ({"labels": LABELS, "names": np.array([b"a", b"b", b"c"])}, "text"),
    "no labels": ({"masks": LABELS}, "no labels"),
    "objects": ({"labels": np.array([[{"a": 1}]], dtype=object)}, "Object arrays"),
    "object names": ({"labels": LABELS, "names": np.array(["a", None, "c"], dtype=object)}, "Object arrays"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_file_that_does_not_hold_what_it_should_is_named(tmp_path: Path, case: str):
    arrays, message = BAD[case]
    path = tmp_path / f"{picture_digest(picture(0))}.npz"
    np.savez(path, **arrays)
    with pytest.raises(DataError, match=message) as refused:
        segment(PrecomputedSegmenter(tmp_path), picture(0))
    assert refused.value.source == str(path)
    if "labels" in arrays and case not in ("objects", "object names", "wrong shape", "names of bytes"):
        with pytest.raises(ValueError, match="found"):
            write_frame(tmp_path / "new", picture(0), **arrays)
        assert not (tmp_path / "new").exists()


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_a_cut_or_altered_file_is_one_error_or_read_as_it_was(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("frames")
    path = write_frame(folder, picture(0), LABELS, features=np.eye(3), names=["a", "b", "c"])
    content = bytearray(path.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bytes(content))
    try:
        read = read_frame(path)
    except DataError:
        return
    np.testing.assert_array_equal(read.masks.labels, LABELS)


def test_a_missing_picture_or_folder_is_named(tmp_path: Path):
    with pytest.raises(DataError, match="nothing there"):
        make_segmenter(f"precomputed:{tmp_path / 'none'}")
    with pytest.raises(DataError, match="no such folder"):
        PrecomputedSegmenter(tmp_path / "none")
    with pytest.raises(DataError, match=r"no \.npz file"):
        PrecomputedSegmenter(tmp_path)
    write_frame(tmp_path, picture(0), LABELS)
    with pytest.raises(DataError, match="no frame of this picture"):
        segment(PrecomputedSegmenter(tmp_path), picture(1))


@pytest.mark.parametrize(
    ("index", "message"),
    [("{", "no JSON"), ("[]", "no frames"), ('{"frames": {"a": "../b.npz"}}', "the file '../b.npz'"),
     ('{"frames": {"a": 3}}', "the file 3")],
)  # fmt: skip
def test_an_index_is_not_trusted(tmp_path: Path, index: str, message: str):
    write_frame(tmp_path, "0", LABELS)
    (tmp_path / "index.json").write_text(index)
    with pytest.raises(DataError, match=message):
        PrecomputedSegmenter(tmp_path)


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch):
    path = write_frame(tmp_path, picture(0), LABELS)
    before = path.read_bytes()

    def full(file, **arrays):
        file.write(b"half of it")
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="no space"):
        write_frame(tmp_path, picture(0), np.roll(LABELS, 1, 0))
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    with pytest.raises(ValueError, match="without folders"):
        write_frame(tmp_path, "../escape", LABELS)


def test_what_a_spec_says_is_read_and_what_it_cannot_mean_refused(tmp_path: Path):
    spec = read_encoder_spec(f"precomputed:{tmp_path}?frames=order&text=openclip:ViT-B-32/a?b&c")
    assert (spec.rest, spec.frames, spec.text_spec) == (str(tmp_path), "order", "openclip:ViT-B-32/a?b&c")
    assert spec.text_space == "openclip:ViT-B-32/a?b&c"
    assert read_encoder_spec(f"precomputed:{tmp_path}").text_space == read_encoder_spec("oracle:drop=.1").text_space
    for wrong in ("?frames=random", "?order", "?text=oracle", "?text=clip", "?text=precomputed:x", "?frames=order&x=1"):
        with pytest.raises(ValueError, match="expected"):
            read_encoder_spec(f"precomputed:{tmp_path}{wrong}")


def test_specs_for_both_and_for_each(tmp_path: Path):
    (tmp_path / "m.onnx").touch()
    assert resolve() == ("embedded", "embedded")
    assert resolve("oracle", encoder="embedded") == ("oracle", "embedded")
    assert resolve(segmenter=f"sam:{tmp_path}/m.onnx") == (f"sam:{tmp_path}/m.onnx", "embedded")
    with pytest.raises(ValueError, match="is no encoder; expected --encoder"):
        resolve(f"yolo:{tmp_path}/m.onnx")
    with pytest.raises(ValueError, match="is no segmenter; expected --segmenter"):
        resolve("openclip:ViT-B-32/laion")
    with pytest.raises(DataError, match="nothing there"):
        resolve(segmenter="sam:/no/such/file.onnx")
    with pytest.raises(DataError, match="nothing there"):
        make_segmenter("embedded:/no/such/folder")
    for spec in ("eyes", "embedded:", "sam", "sam:", "oracle:", "precomputed"):
        with pytest.raises(ValueError, match=r"segmenter spec is .*'embedded', .*'oracle', .*'precomputed:<folder>'"):
            make_segmenter(spec)


def test_a_map_of_precomputed_features_can_be_asked_without_them():
    assert make_text_tower("precomputed:/gone", text=(text := TextEncoder())) is text
    assert json.dumps(make_text_tower("oracle:drop=.5", text=text).dim) == "384"
