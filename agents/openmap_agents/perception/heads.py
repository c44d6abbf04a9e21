"""The trained region heads: two-layer networks from a region's description to a place among words."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.conse import unit
from openmap_agents.perception.protocol import Calibration
from openmap_agents.perception.weights import FOLDER, load_weights

PARTS = ("mean", "std", "w1", "b1", "w2", "b2")


class RegionHead:
    """unit(w2 relu(w1 (x - mean) / std + b1) + b2)."""

    def __init__(self, arrays: dict[str, npt.NDArray[np.float32]]) -> None:
        self._mean, self._std, self._w1, self._b1, self._w2, self._b2 = (arrays[part] for part in PARTS)

    def __call__(self, x: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of descriptions (n, inputs)."""
        hidden = np.maximum(((x - self._mean) / self._std) @ self._w1.T + self._b1, 0.0)
        return unit(hidden @ self._w2.T + self._b2)


@dataclass(frozen=True)
class TextStep:
    """unit(x + w2 relu(w1 x + b1) + b2): from what a thing is for towards what it is called; names stay where they are."""

    w1: npt.NDArray[np.float32]
    b1: npt.NDArray[np.float32]
    w2: npt.NDArray[np.float32]
    b2: npt.NDArray[np.float32]

    def __call__(self, x: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) of unit vectors (n, D)."""
        return unit(x + np.maximum(x @ self.w1.T + self.b1, 0.0) @ self.w2.T + self.b2)


@dataclass(frozen=True)
class Heads:
    """What the encoder learned.

    Parameters
    ----------
    heads : {name: RegionHead}
    mean : (D,) float32
        Of the vectors of the names learned.
    bank : (names, D) float32
        Their unit vectors, less the mean.
    calibration : Calibration
    text : TextStep
    """

    heads: dict[str, RegionHead]
    mean: npt.NDArray[np.float32]
    bank: npt.NDArray[np.float32]
    calibration: Calibration
    text: TextStep


def load_heads(inputs: dict[str, int], dim: int, path: str | Path = FOLDER / "regions.npz") -> Heads:
    """The heads by name, each with that many inputs, into ``dim`` dimensions.

    Raises
    ------
    DataError
        The weights cannot be used.
    """
    shapes: dict[str, tuple[int | None, ...]] = {"words.mean": (dim,), "words.bank": (None, dim), "calibration": (2,)}
    text = {"text.w1": (None, dim), "text.b1": (None,), "text.w2": (dim, None), "text.b2": (dim,)}
    shapes |= text
    for name, n in inputs.items():
        ends = ((n,), (n,), (None, n), (None,), (dim, None), (dim,))
        shapes |= {f"{name}.{part}": shape for part, shape in zip(PARTS, ends, strict=True)}
    arrays = load_weights(Path(path), shapes)
    heads = {name: RegionHead({part: arrays[f"{name}.{part}"] for part in PARTS}) for name in inputs}
    slope, offset = arrays["calibration"].tolist()
    step = TextStep(*(arrays[name] for name in text))
    return Heads(heads, arrays["words.mean"], unit(arrays["words.bank"]), Calibration(slope, offset), step)
