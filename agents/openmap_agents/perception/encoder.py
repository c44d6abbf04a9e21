"""The default encoder: what a region looks like and how it is shaped, as a place in the space of words.

Four opinions are added up, each a unit vector f_b in the text encoder's space less the mean of the names of household things
(what all words of a home have in common says nothing): heads trained on looks and shape, on what the neck says, on shape alone,
and ConSE, which was not trained on homes and knows a thousand other things. v = sum_b w_b f_b, with weights that sum to one.

Calibration. ``S v.t`` are the logits of a softmax over the bank of the names that were learned, so S v.t - log Z says how well
a text fits *compared with what else the region may be*; a region that is surely a pillow is then a poor "sofa" although both
words lie close. This holds for names. Of a text at a distance d = 1 - max_c t.c from every learned name, such as "something to
sit on", the surest chair is no worse an answer for being surely a chair: so log Z counts by h(d), which falls from 1 to 0. And
what has learned names is seldom sure of any other, so texts get back N d (after Chao et al., calibrated stacking, ECCV 2016),
which does not change which of two regions fits a text better.

All this is put into a plain cosine: a text t becomes [c t, s h(d), n d, 0, rest], a region [a v, b (L - log Z), k, rest, 0], where
the rests fill up to length one. So a cosine is g (S v.t + h(d) (L - log Z) + N d), for every region and text.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.backbone import CHANNELS, N_FEATURES
from openmap_agents.perception.conse import Conse, unit
from openmap_agents.perception.front import FrontEnd, View
from openmap_agents.perception.heads import load_heads
from openmap_agents.perception.maps import cover, means
from openmap_agents.perception.neck import N_LOOKS, N_SHAPE_MAP
from openmap_agents.perception.protocol import Calibration, Masks
from openmap_agents.perception.shape import N_SHAPE, shape_features
from openmap_agents.perception.text import TextEncoder, one_blas_thread
from openmap_agents.perception.weights import FOLDER
from openmap_scenes import PinholeCamera

SHAPE = slice(N_FEATURES, N_FEATURES + N_SHAPE)
SHAPE_MAP = slice(SHAPE.stop, SHAPE.stop + N_SHAPE_MAP)
LOOKS = slice(SHAPE_MAP.stop, SHAPE_MAP.stop + N_LOOKS)
N_DESCRIPTION = LOOKS.stop
"""Columns of a region's description: pooled backbone, shape, the neck's shape and looks."""
HEADS = {
    "looks": slice(0, N_DESCRIPTION),
    "neck": slice(N_FEATURES, N_DESCRIPTION),
    "shape": slice(N_FEATURES, SHAPE_MAP.stop),
}
"""Which columns each head reads."""
WEIGHTS = {"looks": 1.0, "neck": 0.6, "shape": 0.8, "conse": 0.4}
SHARPNESS = 24.0
"""S above."""
NOVELTY, KNOWN_WITHIN = 9.0, 0.7
"""N above, and the d at which h is 0; chosen on kinds that only the val homes have, and on questions by use in val homes."""
FARTHEST = 0.75  # d counts no more beyond this, so that a text stays within length one
_CENTRE = 13.5  # L: the middle of what log Z can be, so that what is added is small
_TEXT, _BIAS, _NOVEL = 0.81, 0.49, 0.35  # c, s, k
_GAIN = 0.029  # g: as large as lets both sides stay within length one


class EmbeddedEncoder:
    """One frozen EfficientNet-Lite0 pass a picture and a small trained net over it and depth, pooled under each mask -> words.

    Parameters
    ----------
    text : TextEncoder, optional
        Shared with others that need one.
    weights : Path, optional
        The folder of its networks; the installed one by default.
    front : FrontEnd, optional
        Shared with the segmenter, so that a picture is looked at once.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(
        self,
        text: TextEncoder | None = None,
        weights: str | Path = FOLDER,
        front: FrontEnd | None = None,
    ) -> None:
        self._text = text or TextEncoder()
        inputs = {name: columns.stop - columns.start for name, columns in HEADS.items()}
        loaded = load_heads(inputs, self._text.dim, Path(weights) / "regions.npz")
        self._heads, self._mean, self._bank, self._step = loaded.heads, loaded.mean, loaded.bank, loaded.text
        self.calibration: Calibration = loaded.calibration
        self.front = front or FrontEnd(weights)
        self._conse = Conse(self._text)
        self.dim = self._text.dim + 4

    def encode_text(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32; the same text gives the same bytes, whatever else is asked with it."""
        if not texts:
            return np.zeros((0, self.dim), np.float32)
        with one_blas_thread():
            return np.concatenate([self._placed(self.words([text])) for text in texts])

    def _placed(self, words: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """[c t, s h(d), n d, 0, rest] of words (n, 384)."""
        novelty = (1.0 - (words @ self._bank.T).max(1, initial=-1.0, keepdims=True)).clip(0.0, FARTHEST)
        known = 1.0 - np.minimum(novelty / KNOWN_WITHIN, 1.0)
        left = np.hstack([_TEXT * words, _BIAS * known, _GAIN * NOVELTY / _NOVEL * novelty, np.zeros_like(novelty)])
        return _filled(left)

    def words(self, texts: list[str]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, 384) of texts in the space of v: less the mean of household names, uses moved towards names."""
        if not texts:
            return np.zeros((0, self._text.dim), np.float32)
        return self._step(unit(self._text.encode_text(texts) - self._mean))

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, one for each mask 1..n."""
        if len(masks) == 0:
            return np.zeros((0, self.dim), np.float32)
        view = self.front.look(rgb, depth, T_world_camera, camera)
        with one_blas_thread():
            return self.vectors(describe(view, masks))

    def encode_crops(self, crops: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32 of n pictures (h, w, 3) uint8, each of one thing; without depth, so ConSE has the say.

        A crop says nothing of size, height and form, which the trained heads need; so only what was learned from ImageNet is asked.
        """
        if not crops:
            return np.zeros((0, self.dim), np.float32)
        pooled = [self.front.backbone.dense(crop)[-1].mean((1, 2)) for crop in crops]
        vectors = self._words_of_head(np.stack(pooled)) * 0.5
        return self._as_cosines(vectors)

    def vectors(self, described: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) of descriptions (n, N_DESCRIPTION)."""
        vectors = fuse(self.opinions(described))
        return self._as_cosines(vectors)

    def opinions(self, described: npt.NDArray[np.float32]) -> dict[str, npt.NDArray[np.float32]]:
        """What each head and ConSE say, unit vectors (n, 384) by name."""
        said = {name: head(described[:, HEADS[name]]) for name, head in self._heads.items()}
        said["conse"] = self._words_of_head(described[:, N_FEATURES - CHANNELS[-1] : N_FEATURES])
        return said

    def _words_of_head(self, pooled: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return unit(self._conse(self.front.backbone.class_logits(pooled)) - self._mean)

    def _as_cosines(self, vectors: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """[a v, b (L - log Z), k, rest, 0] of v (n, 384), as unit vectors."""
        a, b, n = _GAIN * SHARPNESS / _TEXT, _GAIN / _BIAS, len(vectors)
        log_z = np.log(np.exp(SHARPNESS * (vectors @ self._bank.T)).sum(1, keepdims=True))
        filled = _filled(np.hstack([a * vectors, b * (_CENTRE - log_z), np.full((n, 1), _NOVEL, np.float32)]))
        return np.hstack([filled, np.zeros((n, 1), np.float32)])


def _filled(left: npt.NDArray[np.floating]) -> npt.NDArray[np.float32]:
    """Rows (n, D) of at most length one with a column more that makes it one."""
    length = np.linalg.norm(left, axis=1, keepdims=True)
    left = left / np.maximum(length, 1.0)
    rest = np.sqrt(np.maximum(1.0 - np.minimum(length, 1.0) ** 2, 0.0))
    return np.hstack([left, rest]).astype(np.float32)


def describe(view: View, masks: Masks) -> npt.NDArray[np.float32]:
    """Descriptions (n, N_DESCRIPTION) float32 of masks of a picture."""
    camera, surface, n = view.camera, view.surface, len(masks)
    offset = surface.step // 2
    labels = np.ascontiguousarray(masks.labels[offset :: surface.step, offset :: surface.step])
    cells = cover(labels, n, surface.step, camera.height, camera.width)
    pooled = [means(c, m) for c, m in zip(cells, view.maps, strict=True)]
    neck = [means(cells[1], m) for m in (view.features.shape, view.features.looks)]
    return np.hstack([*pooled, shape_features(surface, labels, n), *neck])


def fuse(opinions: dict[str, npt.NDArray[np.float32]]) -> npt.NDArray[np.float32]:
    """v (n, 384), the weighted mean of the opinions."""
    total = sum(WEIGHTS.values())
    return np.asarray(sum(WEIGHTS[name] / total * said for name, said in opinions.items()), np.float32)
