"""Segmenters and encoders: which pixels are one thing, and what does a thing look like in the space of words.

``make_segmenter``, ``make_encoder`` and, for both at once, ``make_perception`` turn specs into them:

- ``embedded`` works from pixels, offline; ``embedded:<folder>`` does so with weights of your own training;
- ``sam:``, ``yolo:`` (segmenters), ``clip-onnx:``, ``openclip:`` (encoders) run models of the user's;
- ``precomputed:<folder>`` reads what was computed elsewhere (``stored_frames`` has the format);
- ``proposals:<folder>?cloud=<points file>`` (a segmenter) shows another method's 3-D instances in each picture;
- ``oracle`` is told by the renderer and is for analysis only; ``oracle:split=.1,features=.3`` is told wrongly (``OracleNoise``).

Their modules are imported when asked for, because torch takes seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Calibration, Encoder, Masks, Segmenter
from openmap_agents.perception.specs import (
    ENCODERS,
    SEGMENTERS,
    is_oracle,
    read_encoder_spec,
    read_segmenter_spec,
    resolve,
)

if TYPE_CHECKING:
    from openmap_agents.perception.precomputed import TextTower
    from openmap_agents.perception.text import TextEncoder

Semantic = Callable[[], npt.NDArray[np.int32]]

__all__ = [
    "ENCODERS",
    "SEGMENTERS",
    "Calibration",
    "Encoder",
    "Masks",
    "Segmenter",
    "is_oracle",
    "make_encoder",
    "make_perception",
    "make_segmenter",
    "make_text_tower",
    "read_encoder_spec",
    "read_segmenter_spec",
    "resolve",
]


def make_segmenter(spec: str = "embedded", *, semantic: Semantic | None = None) -> Segmenter:
    """A segmenter.

    Parameters
    ----------
    spec : str
        One of ``SEGMENTERS``.
    semantic : () -> (H, W) int32, for "oracle"
        Instance ids of the current picture.

    Raises
    ------
    ValueError
        Not a spec, or "oracle" without ``semantic``. DataError: what it names cannot be used.
    """
    read = read_segmenter_spec(spec)
    if read.family == "sam":
        from openmap_agents.perception.onnx.sam import SamSegmenter

        return SamSegmenter(read.rest)
    if read.family == "yolo":
        from openmap_agents.perception.onnx.yolo import YoloSegmenter

        return YoloSegmenter(read.rest)
    if read.family == "precomputed":
        from openmap_agents.perception.precomputed import PrecomputedSegmenter

        return PrecomputedSegmenter(read.rest, read.frames)
    if read.family == "proposals":
        from openmap_agents.perception.proposals import ProposalSegmenter

        return ProposalSegmenter(read.rest, read.cloud)
    if read.family == "oracle":
        from openmap_agents.perception.oracle import OracleSegmenter

        if semantic is None:
            raise ValueError("segmenter 'oracle' has no semantic, expected a function that returns the picture's ids")
        return OracleSegmenter(semantic, read.noise)
    from openmap_agents.perception.segmenter import EmbeddedSegmenter

    return EmbeddedSegmenter(read.rest) if read.rest else EmbeddedSegmenter()


def make_encoder(
    spec: str = "embedded",
    *,
    semantic: Semantic | None = None,
    categories: Mapping[int, str] | None = None,
    text: TextEncoder | None = None,
) -> Encoder:
    """An encoder.

    Parameters
    ----------
    spec : str
        One of ``ENCODERS``.
    semantic, categories : for "oracle"
        Instance ids of the current picture; id -> the words for it.
    text : TextEncoder, optional
        To share one that is loaded already, where the encoder needs it.

    Raises
    ------
    ValueError
        Not a spec, or "oracle" without ``semantic`` and ``categories``. DataError: what it names cannot be used.
    """
    read = read_encoder_spec(spec)
    if read.family == "clip-onnx":
        from openmap_agents.perception.onnx.clip import OnnxClipEncoder

        return OnnxClipEncoder(read.rest)
    if read.family == "openclip":
        from openmap_agents.perception.openclip import OpenClipEncoder

        return OpenClipEncoder(read.rest)
    if read.family == "precomputed":
        from openmap_agents.perception.precomputed import PrecomputedEncoder

        return PrecomputedEncoder(read.rest, make_text_tower(spec, text=text), read.frames)
    if read.family == "oracle":
        from openmap_agents.perception.oracle import OracleEncoder

        if semantic is None or categories is None:
            raise ValueError(
                "encoder 'oracle' lacks semantic or categories, expected a function and a mapping id -> words"
            )
        return OracleEncoder(semantic, categories, text, read.noise)
    from openmap_agents.perception.encoder import EmbeddedEncoder

    return EmbeddedEncoder(text, read.rest) if read.rest else EmbeddedEncoder(text)


def make_text_tower(spec: str = "embedded", *, text: TextEncoder | None = None) -> TextTower:
    """The half of an encoder that takes words, for asking a map that it made; needs no ids and no precomputed folder.

    Parameters and errors as for ``make_encoder``.
    """
    read = read_encoder_spec(spec, paths=False)
    if read.family not in ("oracle", "precomputed") or read.text_spec:
        return make_encoder(read.text_spec or spec, text=text)
    from openmap_agents.perception.text import TextEncoder

    return text or TextEncoder()


def make_perception(
    segmenter: str = "embedded",
    encoder: str = "embedded",
    *,
    semantic: Semantic | None = None,
    categories: Mapping[int, str] | None = None,
    text: TextEncoder | None = None,
) -> tuple[Segmenter, Encoder]:
    """A segmenter and an encoder that look at the same pictures, and may share what both need.

    Parameters and errors as for ``make_segmenter`` and ``make_encoder``.
    """
    seeing = make_segmenter(segmenter, semantic=semantic)
    if segmenter == encoder and read_encoder_spec(encoder).family == "embedded":
        from openmap_agents.perception.encoder import EmbeddedEncoder
        from openmap_agents.perception.segmenter import EmbeddedSegmenter
        from openmap_agents.perception.weights import FOLDER

        assert isinstance(seeing, EmbeddedSegmenter)
        return seeing, EmbeddedEncoder(text, read_encoder_spec(encoder).rest or FOLDER, seeing.front)
    return seeing, make_encoder(encoder, semantic=semantic, categories=categories, text=text)
