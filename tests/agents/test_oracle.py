"""The oracle and its noise dial: what it says is true where the dial is at zero, and wrong as asked, the same way every time."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception import Masks, make_encoder, make_segmenter
from openmap_agents.perception.noise import OracleNoise
from openmap_agents.perception.oracle import WORDS
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import PinholeCamera

CAMERA = PinholeCamera.from_hfov(160, 120, 90.0)
POSE = np.eye(4)
NAMES = {7: "floor", 9: "sofa", 20: "lamp", 31: "window", 40: "kettle"}
IDS = np.kron(np.array([[7, 7, 9, 9], [7, 20, 20, 9], [31, 31, 40, 40]], np.int32), np.ones((40, 40), np.int32))
DEPTH = np.full(IDS.shape, 2.0, np.float32)


def rgb(number: int = 0) -> np.ndarray:
    return np.full((*IDS.shape, 3), number, np.uint8)


@pytest.fixture(scope="module")
def text() -> TextEncoder:
    return TextEncoder()


def segment(spec: str, number: int = 0, ids: np.ndarray = IDS) -> Masks:
    return make_segmenter(spec, semantic=lambda: ids).segment(rgb(number), DEPTH, POSE, CAMERA)


def encode(spec: str, text: TextEncoder, masks: Masks, number: int = 0) -> np.ndarray:
    encoder = make_encoder(spec, semantic=lambda: IDS, categories=NAMES, text=text)
    return encoder.encode_regions(rgb(number), DEPTH, masks, POSE, CAMERA)


def test_with_the_dial_at_zero_it_is_the_truth(text: TextEncoder):
    for spec in ("oracle", "oracle:seed=4", "oracle:split=0,merge=0,features=0.0"):
        masks = segment(spec)
        np.testing.assert_array_equal(np.array([0, *sorted(NAMES)])[masks.labels], IDS)
        np.testing.assert_array_equal(encode(spec, text, masks), text.encode_text([NAMES[i] for i in sorted(NAMES)]))


def test_noise_depends_on_seed_and_picture_and_not_on_what_came_before():
    spec = "oracle:drop=.5,boundary=3"
    segmenter = make_segmenter(spec, semantic=lambda: IDS)
    stream = [segmenter.segment(rgb(n), DEPTH, POSE, CAMERA).labels for n in range(6)]
    for n in (5, 0, 3):
        np.testing.assert_array_equal(segment(spec, n).labels, stream[n])
    assert len({labels.tobytes() for labels in stream}) > 1
    assert any((segment(f"{spec},seed=1", n).labels != stream[n]).any() for n in range(6))


def test_the_same_stream_gives_the_same_masks_and_features_in_another_process():
    code = (
        "import numpy as np, zlib\n"
        "from openmap_agents.perception import make_perception\n"
        "ids = np.kron(np.arange(12, dtype=np.int32).reshape(3, 4), np.ones((30, 30), np.int32))\n"
        "told = dict(semantic=lambda: ids, categories={i: f'thing {i}' for i in range(1, 12)})\n"
        "spec = 'oracle:split=.5,merge=.2,drop=.2,boundary=2,features=.3,names=.4,seed=3'\n"
        "seg, enc = make_perception(spec, spec, **told)\n"
        "rgb, depth = np.zeros((90, 120, 3), np.uint8), np.ones((90, 120), np.float32)\n"
        "m = seg.segment(rgb, depth, np.eye(4), None)\n"
        "print(zlib.crc32(m.labels.tobytes()), zlib.crc32(enc.encode_regions(rgb, depth, m, np.eye(4), None).tobytes()))\n"
    )
    first, second = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in "ab"
    )
    assert first.stdout == second.stdout
    assert len(first.stdout.split()) == 2


def test_dropping_everything_leaves_a_picture_without_masks(text: TextEncoder):
    masks = segment("oracle:drop=1")
    assert len(masks) == 0
    assert not masks.labels.any()
    assert encode("oracle:drop=1,features=.3,names=1", text, masks).shape == (0, 384)


@pytest.mark.parametrize("strength", [0.3, 1.0, 3.0])
def test_feature_noise_costs_the_cosine_that_it_says(text: TextEncoder, strength: float):
    masks = segment("oracle")
    clean = encode("oracle", text, masks)
    cosines = []
    for number in range(20):
        noisy = encode(f"oracle:features={strength}", text, masks, number)
        assert noisy.dtype == np.float32
        np.testing.assert_allclose(np.linalg.norm(noisy, axis=1), 1.0, atol=1e-5)
        cosines += (clean * noisy).sum(1).tolist()
    assert np.mean(cosines) == pytest.approx(1 / np.hypot(1, strength), abs=0.02)
    np.testing.assert_array_equal(encode("oracle:features=1", text, masks), encode("oracle:features=1", text, masks))


def test_wrong_names_are_names_of_other_things_of_the_scene(text: TextEncoder):
    masks = segment("oracle")
    words = text.encode_text(sorted(NAMES.values()))
    true = [sorted(NAMES.values()).index(NAMES[i]) for i in sorted(NAMES)]
    for number in range(10):
        said = (encode("oracle:names=1", text, masks, number) @ words.T).argmax(1)
        assert not (said == true).any()
    wrong = [(encode("oracle:names=.3", text, masks, n) @ words.T).argmax(1) != true for n in range(80)]
    assert 0.2 < np.mean(wrong) < 0.4


def test_noise_may_be_on_either_side_alone(text: TextEncoder):
    """A mask cut in two: both pieces are still called what they are."""
    masks = segment("oracle:split=1,seed=2")
    assert len(masks) > len(NAMES)
    features = encode("oracle", text, masks)
    for k in range(1, len(masks) + 1):
        shown = np.unique(IDS[masks.labels == k])
        assert len(shown) == 1
        np.testing.assert_array_equal(features[k - 1], text.encode_text([NAMES[int(shown[0])]])[0])


def test_the_calibration_tells_a_synonym_from_something_else_with_noise_and_without(text: TextEncoder):
    sofa, couch, kettle = text.encode_text(["sofa", "couch", "kettle"])
    assert WORDS(sofa @ couch) > 0.8
    assert WORDS(sofa @ kettle) < 0.2
    for strength in (0.0, 1.0):
        encoder = make_encoder(f"oracle:features={strength}", semantic=lambda: IDS, categories=NAMES, text=text)
        found = encoder.calibration(np.array([sofa @ couch, sofa @ kettle]) / np.hypot(1, strength))
        np.testing.assert_allclose(found, WORDS(np.array([sofa @ couch, sofa @ kettle])), atol=1e-6)


def test_crops_carry_no_ids(text: TextEncoder):
    encoder = make_encoder("oracle", semantic=lambda: IDS, categories=NAMES, text=text)
    with pytest.raises(ValueError, match="crops, which carry no ids"):
        encoder.encode_crops([np.zeros((4, 4, 3), np.uint8)])


probabilities = st.floats(0, 1)


@given(
    st.builds(
        OracleNoise,
        split=probabilities,
        merge=probabilities,
        drop=probabilities,
        boundary=st.floats(0, 32),
        features=st.floats(0, 10),
        names=probabilities,
        seed=st.integers(0, 2**32 - 1),
    )
)
@settings(max_examples=60, deadline=None)
def test_noise_is_read_as_it_is_written(noise: OracleNoise):
    again = OracleNoise.parse(str(noise))
    assert str(again) == str(noise)
    assert again.seed == noise.seed
    assert again.boundary == pytest.approx(noise.boundary, rel=1e-5)


@pytest.mark.parametrize(
    "text",
    ["splits=.1", "split", "split=", "split=2", "split=nan", "drop=-.1", "boundary=33", "features=x", "seed=1.5", "seed=-1",
     "split=.1,split=.2", "split=.1;drop=.2"],
)  # fmt: skip
@pytest.mark.parametrize("make", [make_segmenter, make_encoder])
def test_noise_that_cannot_be_meant_is_refused_with_all_keys_and_ranges(make, text):
    with pytest.raises(
        ValueError, match=r"split 0\.\.1, merge 0\.\.1, drop 0\.\.1, boundary 0\.\.32, features 0\.\.10"
    ):
        make(f"oracle:{text}")
