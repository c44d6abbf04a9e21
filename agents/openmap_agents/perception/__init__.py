"""Segmenters and encoders: which pixels are one thing, and what does a thing look like in the space of words.

``make_segmenter`` and ``make_encoder`` turn a spec into one: ``embedded`` works from pixels, offline; ``oracle`` is told by the
renderer and is for analysis only. Their modules are imported when asked for, because torch takes seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Encoder, Masks, Segmenter

if TYPE_CHECKING:
    from openmap_agents.perception.text import TextEncoder

SPECS = ("embedded", "oracle")

__all__ = ["SPECS", "Encoder", "Masks", "Segmenter", "make_encoder", "make_segmenter"]


def _check(spec: str, what: str) -> None:
    if spec not in SPECS:
        raise ValueError(f"{what} spec is {spec!r}, expected one of {', '.join(map(repr, SPECS))}")


def make_segmenter(spec: str = "embedded", *, semantic: Callable[[], npt.NDArray[np.int32]] | None = None) -> Segmenter:
    """A segmenter.

    Parameters
    ----------
    spec : {"embedded", "oracle"}
    semantic : () -> (H, W) int32, for "oracle"
        Instance ids of the current picture.

    Raises
    ------
    ValueError
        Unknown spec, or "oracle" without ``semantic``.
    """
    _check(spec, "segmenter")
    if spec == "embedded":
        from openmap_agents.perception.segmenter import EmbeddedSegmenter

        return EmbeddedSegmenter()
    from openmap_agents.perception.oracle import OracleSegmenter

    if semantic is None:
        raise ValueError("segmenter 'oracle' has no semantic, expected a function that returns the picture's ids")
    return OracleSegmenter(semantic)


def make_encoder(
    spec: str = "embedded",
    *,
    semantic: Callable[[], npt.NDArray[np.int32]] | None = None,
    categories: Mapping[int, str] | None = None,
    text: TextEncoder | None = None,
) -> Encoder:
    """An encoder.

    Parameters
    ----------
    spec : {"embedded", "oracle"}
    semantic, categories : for "oracle"
        Instance ids of the current picture; id -> the words for it.
    text : TextEncoder, optional
        To share one that is loaded already.

    Raises
    ------
    ValueError
        Unknown spec, or "oracle" without ``semantic`` and ``categories``.
    """
    _check(spec, "encoder")
    if spec == "embedded":
        from openmap_agents.perception.encoder import EmbeddedEncoder

        return EmbeddedEncoder(text)
    from openmap_agents.perception.oracle import OracleEncoder

    if semantic is None or categories is None:
        raise ValueError("encoder 'oracle' lacks semantic or categories, expected a function and a mapping id -> words")
    return OracleEncoder(semantic, categories, text)
