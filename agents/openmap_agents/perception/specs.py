"""The specs by which segmenters and encoders are asked for, read and checked without importing what they name.

``<family>`` or ``<family>:<what of it>``: a model's file or folder, a noise setting, a folder of precomputed frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from openmap_agents.perception.noise import OracleNoise
from openmap_agents.perception.stored_frames import ORDERS, Order
from openmap_scenes import DataError

_BOTH = ("embedded", "embedded:<folder of weights>", "oracle", "oracle:<noise>")
_PROPOSALS = "proposals:<folder>?cloud=<points file>"
SEGMENTERS = (*_BOTH, "sam:<folder or encoder.onnx>", "yolo:<model.onnx>", "precomputed:<folder>", _PROPOSALS)
ENCODERS = (*_BOTH, "clip-onnx:<folder>", "openclip:<architecture>/<tag>", "precomputed:<folder>")
_MINILM = "all-MiniLM-L6-v2"


@dataclass(frozen=True)
class Spec:
    """A spec, taken apart.

    Parameters
    ----------
    text : str
        As it was given.
    family : str
    rest : str
        What follows the colon; of "precomputed" and "proposals" the folder alone.
    text_spec : str
        Of "precomputed": the encoder whose text tower is meant, "" for MiniLM.
    frames : {"picture", "order"}
        Of "precomputed": how files are found.
    cloud : str
        Of "proposals": the file of the points that its masks are of.
    """

    text: str
    family: str
    rest: str = ""
    text_spec: str = ""
    frames: Order = "picture"
    cloud: str = ""

    @property
    def noise(self) -> OracleNoise:
        """Of "oracle"."""
        return OracleNoise.parse(self.rest)

    @property
    def text_space(self) -> str:
        """Name of the space that the encoder puts words into: those of one space can read each other's maps."""
        if self.family == "oracle":
            return _MINILM
        if self.family == "precomputed":
            return read_encoder_spec(self.text_spec, paths=False).text_space if self.text_spec else _MINILM
        # The same model may lie elsewhere on another machine: its folder's name has to do.
        return f"{self.family}:{Path(self.rest).name}" if self.family == "clip-onnx" else self.text


def read_segmenter_spec(spec: str) -> Spec:
    """A segmenter's spec; ValueError, or DataError for a path where nothing is, if it cannot be one."""
    return _read(spec, "segmenter", SEGMENTERS)


def read_encoder_spec(spec: str, paths: bool = True) -> Spec:
    """An encoder's spec; ValueError, or DataError for a path where nothing is, if it cannot be one.

    Without ``paths`` what it names need not be there.
    """
    return _read(spec, "encoder", ENCODERS, paths)


def resolve(perception: str = "embedded", segmenter: str | None = None, encoder: str | None = None) -> tuple[str, str]:
    """The specs of the segmenter and of the encoder; ``perception`` is for both, the others override it.

    Raises
    ------
    ValueError
        One of them is none; DataError for a path where nothing is.
    """
    chosen = segmenter or perception, encoder or perception
    for spec, what, forms in ((chosen[0], "segmenter", SEGMENTERS), (chosen[1], "encoder", ENCODERS)):
        if _family(spec) not in map(_family, forms) and _family(spec) in map(_family, SEGMENTERS + ENCODERS):
            raise ValueError(f"{spec!r} is no {what}; expected --{what} with one of {', '.join(map(repr, forms))}")
    read_segmenter_spec(chosen[0])
    read_encoder_spec(chosen[1])
    return chosen


def check_text_space(source: str | Path, made_by: str, spec: str) -> None:
    """Refuse to ask a map of one encoder's features with the words of another.

    Parameters
    ----------
    source : path
        Of the map, for the message.
    made_by, spec : str
        The encoders' specs; "" = not known, and then there is nothing to refuse.

    Raises
    ------
    DataError
    """
    if not made_by or not spec:
        return
    there, here = (read_encoder_spec(s, paths=False).text_space for s in (made_by, spec))
    if there != here:
        raise DataError(
            source, f"features of the encoder {made_by!r}", f"those of {spec!r}", f"Ask with --encoder {made_by}."
        )


def check_feature_length(source: str | Path, lengths: Iterable[int], dim: int) -> None:
    """Refuse features of other lengths than an encoder's ``dim``, where all that is known of a map is its vectors."""
    others = sorted(set(lengths) - {dim})
    if others:
        raise DataError(
            source,
            f"features of {others[0]} values",
            f"{dim}, as the encoder's",
            "Ask with the --encoder that made it.",
        )


def is_oracle(spec: str) -> bool:
    """Whether what a spec names is told instead of seeing."""
    return _family(spec) == "oracle"


def _family(spec: str) -> str:
    return spec.partition(":")[0]


def _read(spec: str, what: str, forms: tuple[str, ...], paths: bool = True) -> Spec:
    family, colon, rest = spec.partition(":")
    if not any(_family(form) == family and (bool(colon) == (":" in form)) for form in forms) or (colon and not rest):
        raise ValueError(f"{what} spec is {spec!r}, expected one of {', '.join(map(repr, forms))}")
    found = Spec(spec, family, rest)
    if family == "oracle":
        OracleNoise.parse(rest)
    if family == "precomputed":
        found = Spec(spec, family, *_options(rest, spec, paths))
    if family == "proposals":
        folder, option, cloud = rest.partition("?cloud=")
        if not (folder and option and cloud):
            raise ValueError(f"segmenter spec is {spec!r}, expected {_PROPOSALS}")
        found = Spec(spec, family, folder, cloud=cloud)
    named = family in ("sam", "yolo", "clip-onnx", "precomputed", "proposals") or (family == "embedded" and bool(rest))
    for path in (found.rest, found.cloud):
        if paths and named and path and not Path(path).exists():
            raise DataError(path, "nothing there", f"what {what} {spec!r} names")
    return found


def _options(rest: str, spec: str, paths: bool) -> tuple[Any, ...]:
    """Folder, text spec and order of "folder?frames=order&text=<spec>"; a text spec goes to the end."""
    folder, _, query = rest.partition("?")
    values = {"text": "", "frames": "picture"}
    while query:
        key, _, value = query.partition("=")
        if key == "text":
            query = ""
        else:
            value, _, query = value.partition("&")
        if key not in values or (key == "frames" and value not in ORDERS):
            raise ValueError(
                f"spec is {spec!r}, expected precomputed:<folder>, then perhaps ?frames=picture or ?frames=order, "
                "and as the last option text=<encoder spec>"
            )
        values[key] = value
    if values["text"] and read_encoder_spec(values["text"], paths).family in ("oracle", "precomputed"):
        raise ValueError(f"spec is {spec!r}, expected text= an encoder that reads words by itself")
    return folder, values["text"], values["frames"]
