"""The trained convolutional part at run time: ``weights/neck.onnx``, by onnxruntime."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.onnx.session import Port, open_model
from openmap_agents.perception.weights import FOLDER

N_SHAPE_MAP, N_LOOKS = 64, 96
_INPUTS = ("s4", "s8", "s16", "geometry")
_OUTPUTS = ("shape", "looks", "belonging")


@dataclass(frozen=True)
class Features:
    """What the neck says of a picture.

    Parameters
    ----------
    shape : (N_SHAPE_MAP, h, w) float32, stride 8
        What depth alone tells of the thing at each cell.
    looks : (N_LOOKS, h, w) float32, stride 8
        What depth and colour tell.
    belonging : (N_BELONGING + N_CLASSES, h, w) float32, stride 4
        A place in a space where one thing's pixels lie together, then the logits of the classes.
    """

    shape: npt.NDArray[np.float32]
    looks: npt.NDArray[np.float32]
    belonging: npt.NDArray[np.float32]


class Neck:
    """Maps of the backbone and of depth -> ``Features``.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(self, path: str | Path = FOLDER / "neck.onnx", threads: int = 1) -> None:
        inputs, outputs = {name: Port(4) for name in _INPUTS}, {name: Port(4) for name in _OUTPUTS}
        self._model = open_model(path, inputs, outputs, "the neck of the default perception", threads=threads)

    def __call__(self, maps: list[npt.NDArray[np.float32]], geometry: npt.NDArray[np.float32]) -> Features:
        """Features of the backbone's maps [(C, h, w)] at strides 4, 8, 16 (others are ignored) and of ``geometry_map``."""
        feed = dict(zip(_INPUTS, (*maps[:3], geometry), strict=True))
        out = self._model.run(**{name: x[None] for name, x in feed.items()})
        return Features(*(np.asarray(out[name][0], np.float32) for name in _OUTPUTS))
