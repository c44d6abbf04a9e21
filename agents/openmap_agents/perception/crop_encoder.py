"""An encoder out of two towers that know whole pictures and texts only: regions through crops, texts remembered.

What CLIP-like models have in common, whatever runs them. A subclass gives the two towers and says how sure a cosine makes it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from functools import cached_property

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.conse import unit
from openmap_agents.perception.crops import Crops, white_square
from openmap_agents.perception.protocol import Calibration, Masks
from openmap_scenes import PinholeCamera

VOCABULARY = 1000
"""Words that do not fit, against which CLIP's softmax is taken for its calibration."""
_WORDS = (
    *("chair", "table", "sofa", "bed", "lamp", "window", "door", "plant"),
    *("shelf", "sink", "mirror", "curtain", "picture", "pillow", "book", "floor"),
)


class CropEncoder(ABC):
    """Unit vectors of texts, of pictures, and of regions as the mean of their crops'.

    Parameters
    ----------
    crops : Crops
    batch : int
        Pictures or texts that go through a tower at once.
    template : str
        What a text is put into, such as "a photo of a {}".
    remembered : int
        Texts whose vectors are kept, the latest asked for.

    Raises
    ------
    ValueError
        ``batch`` or ``remembered`` below 1, or a template without ``{}``.
    """

    dim: int

    def __init__(self, crops: Crops, batch: int, template: str, remembered: int) -> None:
        if batch < 1 or remembered < 1:
            raise ValueError(f"batch is {batch} and remembered {remembered}, expected at least 1")
        if "{}" not in template:
            raise ValueError(f"template is {template!r}, expected a text with {{}} where the words go")
        self._crops, self._batch, self._template, self._remembered = crops, batch, template, remembered
        self._known: OrderedDict[str, npt.NDArray[np.float32]] = OrderedDict()

    @abstractmethod
    def _image_tower(self, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Vectors (n, D) of any length of 1 to ``batch`` pictures (h, w, 3) uint8."""

    @abstractmethod
    def _text_tower(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Vectors (n, D) of any length of 1 to ``batch`` texts."""

    @abstractmethod
    def _logit(self) -> tuple[float, float | None]:
        """What the model was trained with: the factor of the cosine and what is added, None where nothing is (a softmax)."""

    @cached_property
    def calibration(self) -> Calibration:
        """p of a cosine, from the scale (and bias) that the model learnt.

        SigLIP was trained with exactly this sigmoid. CLIP was trained with a softmax, which says nothing of one text alone; its p
        is that softmax against ``VOCABULARY`` words that do not fit, each with the same cosine c:
        p = exp(s x) / (exp(s x) + V exp(s c)), the sigmoid of s x - s c - ln V. c is measured: the mean cosine of names of things
        with pictures that show nothing.
        """
        scale, bias = self._logit()
        if bias is None:
            unfit = float((self.encode_pictures(_pictures_of_nothing()) @ self.encode_text(list(_WORDS)).T).mean())
            bias = -scale * unfit - float(np.log(VOCABULARY))
        return Calibration(scale, bias)

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32; the empty list gives (0, D)."""
        new = [text for text in dict.fromkeys(texts) if text not in self._known]
        asked = {text: self._known[text] for text in texts if text in self._known}
        for start in range(0, len(new), self._batch):
            part = new[start : start + self._batch]
            asked.update(
                zip(part, unit(self._text_tower([self._template.replace("{}", t) for t in part])), strict=True)
            )
        for text in texts:
            self._known[text] = asked[text]
            self._known.move_to_end(text)
        while len(self._known) > self._remembered:
            self._known.popitem(last=False)
        return np.stack([asked[text] for text in texts]) if texts else np.zeros((0, self.dim), np.float32)

    def encode_pictures(self, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of n pictures (h, w, 3) uint8, prepared as the model says and no otherwise."""
        for picture in pictures:
            if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or picture.size == 0:
                raise ValueError(f"a picture is {picture.shape} {picture.dtype}, expected (h, w, 3) uint8")
        out = np.zeros((len(pictures), self.dim), np.float32)
        for start in range(0, len(pictures), self._batch):
            part = pictures[start : start + self._batch]
            out[start : start + len(part)] = unit(self._image_tower(part))
        return out

    def encode_crops(self, crops: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of n pictures (h, w, 3) uint8, padded to white squares so that the tower cuts nothing off."""
        return self.encode_pictures([white_square(crop) for crop in crops])

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, one for each mask 1..n: the mean of its crops' unit vectors, brought to unit length.

        A mask without a pixel gets the first axis. Depth, pose and camera are not used.
        """
        crops = self._crops.of_masks(rgb, masks.labels, len(masks))
        owners = np.repeat(np.arange(len(masks)), [len(part) for part in crops])
        vectors = self.encode_pictures([crop for part in crops for crop in part])
        total = np.zeros((len(masks), self.dim), np.float32)
        np.add.at(total, owners, vectors)
        return unit(total)


def _pictures_of_nothing() -> list[npt.NDArray[np.uint8]]:
    """Plain dark, grey and light, and one of coarse noise, (224, 224, 3) uint8."""
    plain = [np.full((224, 224, 3), level, np.uint8) for level in (32, 128, 224)]
    noise = np.random.default_rng(0).integers(64, 192, (14, 14, 3)).astype(np.uint8)
    return [*plain, noise.repeat(16, 0).repeat(16, 1)]
