"""Words -> the numbers that a text tower takes, with the model's own ``tokenizer.json`` and ``tokenizer_config.json``.

Every text is cut and padded to one length, because the towers were trained so: CLIP reads at the end-of-text token and pads
behind it, SigLIP reads at the last place, padding and all.
"""

from __future__ import annotations

import json
import string
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from tokenizers import Tokenizer

from openmap_scenes import DataError

_REMEDY = "Copy the tokenizer's files again from where the model was published."
_NO_PUNCTUATION = str.maketrans("", "", string.punctuation)


@dataclass(frozen=True)
class Tokens:
    """Texts as numbers, all of one length.

    Parameters
    ----------
    tokenizer : Tokenizer
        With truncation and padding set.
    length : int
        Tokens of every text.
    lower : bool
        Whether texts are lower-cased first, as SigLIP's are in training.
    bare : bool
        Whether punctuation and doubled spaces are taken out first, as SigLIP's first tokenizer does.
    """

    tokenizer: Tokenizer
    length: int
    lower: bool = False
    bare: bool = False

    def __call__(self, texts: list[str]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Tokens (n, T) int64 and where they are not padding, (n, T) int64 of 0 and 1."""
        encoded = self.tokenizer.encode_batch([self._cleaned(text) for text in texts])
        shape = (len(texts), self.length)
        ids = np.array([e.ids for e in encoded], np.int64).reshape(shape)
        return ids, np.array([e.attention_mask for e in encoded], np.int64).reshape(shape)

    def _cleaned(self, text: str) -> str:
        text = text.lower() if self.lower else text
        return " ".join(text.translate(_NO_PUNCTUATION).split()) if self.bare else text


def load_tokens(
    folder: Path, *, positions: int | None, pad: str | int, lower: bool = False, bare: bool | None = None
) -> Tokens:
    """The tokenizer of a model's folder.

    Parameters
    ----------
    folder : Path
        With ``tokenizer.json`` and, where the model has one, ``tokenizer_config.json``.
    positions : int, optional
        Tokens that the text tower takes; the tokenizer's own maximum where that is smaller or this is None.
    pad : str or int
        The token that fills texts up where the files name none, or the number of the one that does whatever they name.
    lower, bare : bool
        As of :class:`Tokens`. ``bare`` None: where the files name SigLIP's first tokenizer.

    Raises
    ------
    DataError
        A file is missing or damaged, or does not say how to pad or how long a text may be.
    """
    path = folder / "tokenizer.json"
    try:
        tokenizer = Tokenizer.from_str(path.read_text(encoding="utf-8"))
    except Exception as error:  # the library raises bare Exceptions
        found = "no such file" if not path.is_file() else f"no usable tokenizer ({str(error)[:200]})"
        raise DataError(path, found, "the model's tokenizer.json", _REMEDY) from error
    settings = folder / "tokenizer_config.json"
    config = read_json(settings, optional=True)
    own = config.get("model_max_length")
    limits = [n for n in (positions, own) if isinstance(n, int | float) and 1 < n < 1e5]
    if not limits:
        raise DataError(settings, f"model_max_length {own!r}", "how many tokens a text may have", _REMEDY)
    side = config.get("padding_side", "right")
    if side not in ("left", "right"):
        raise DataError(settings, f"padding_side {side!r}", "left or right", _REMEDY)
    number, token = (pad, "") if isinstance(pad, int) else _pad(config, tokenizer, pad, path)
    length = int(min(limits))
    tokenizer.enable_truncation(length)
    tokenizer.enable_padding(direction=side, pad_id=number, pad_token=token, length=length)
    if bare is None:
        bare = config.get("tokenizer_class") in ("SiglipTokenizer", "SiglipTokenizerFast")
    return Tokens(tokenizer, length, bool(lower or config.get("do_lower_case", False)), bare)


def read_json(path: Path, *, optional: bool = False) -> dict[str, Any]:
    """An object of a JSON file; {} where it is ``optional`` and not there.

    Raises
    ------
    DataError
        Missing, not JSON, or not an object.
    """
    remedy = "Copy the file again from where the model was published."
    if not path.is_file():
        if optional:
            return {}
        raise DataError(path, "no such file", f"the model's {path.name}", remedy)
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(path, f"no readable JSON ({error})", f"the model's {path.name}", remedy) from error
    if not isinstance(value, dict):
        raise DataError(path, f"JSON of a {type(value).__name__}", "an object", remedy)
    return value


def _pad(config: Mapping[str, Any], tokenizer: Tokenizer, default: str, path: Path) -> tuple[int, str]:
    """Number and name of the token that fills texts up."""
    named = config.get("pad_token")
    if isinstance(named, Mapping):
        named = named.get("content")
    if named is None and tokenizer.padding is not None:
        return int(tokenizer.padding["pad_id"]), str(tokenizer.padding["pad_token"])
    token = default if named is None else str(named)
    number = tokenizer.token_to_id(token)
    if number is None:
        raise DataError(path, f"no token {token!r} to fill texts up with", "a tokenizer that has it", _REMEDY)
    return int(number), token
