"""CLIP and SigLIP from a folder of ONNX files: ``clip-onnx:/folder``.

What a picture and a text are prepared like, how a cosine is scaled, and which file is which comes from the model's own files
(:mod:`openmap_agents.perception.onnx.clip_files`); what is here runs the towers and turns their vectors into regions' features.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from openmap_agents.perception.conse import unit
from openmap_agents.perception.crop_encoder import CropEncoder
from openmap_agents.perception.crops import Crops
from openmap_agents.perception.onnx.clip_files import ClipFiles, read_clip_folder
from openmap_agents.perception.onnx.session import Model, Port, load, open_model
from openmap_agents.perception.onnx.token_head import TokenHead
from openmap_agents.perception.protocol import Masks
from openmap_scenes import DataError, PinholeCamera

_PIXELS = Port(4, ("image", "images", "input"), unnamed=True)
_IDS = Port(2, ("text", "texts", "tokens", "input"), kind="int", unnamed=True)
_MASK = Port(2, kind="int", optional=True)
_HIDDEN = Port(3, ("hidden_states",), optional=True)


class OnnxClipEncoder(CropEncoder):
    """Two towers as onnxruntime runs them, on CUDA where it is there.

    Parameters
    ----------
    folder : path
    crops : Crops
        How regions are cut out.
    batch : int
        Pictures or texts at once; a tower whose batch axis is fixed gets that many, the last ones filled up with zeros.
    dense : bool
        Regions from one pass over the whole picture instead of crops: the mean of the unit vectors of the patches under the mask,
        weighted with how much of each the mask covers. Faster by the number of crops; for most models less exact.
    template : str
        What a text is put into.
    remembered : int
        Texts whose vectors are kept.
    threads : int
        On CPU.

    Raises
    ------
    DataError
        A file is missing, damaged, or not what the others say; or the model allows no dense pass.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        crops: Crops = Crops(),  # noqa: B008 - it is frozen
        batch: int = 16,
        dense: bool = False,
        template: str = "{}",
        remembered: int = 4096,
        threads: int = 1,
    ) -> None:
        super().__init__(crops, batch, template, remembered)
        files = read_clip_folder(folder)
        self._files = files
        if files.vision is not None and files.text is not None:
            self._vision = _open_vision(files.vision, _vector(files, "image_features"), threads)
            self._text = _open_text(files.text, _vector(files, "text_features"), threads)
        else:
            assert files.combined is not None
            self._vision = self._text = _open_combined(files.combined, threads)
        self._check_inputs()
        self.dim = self._encode_text_ids([""]).shape[1]
        dim = self._pixels_to_vectors(self._nothing(1)).shape[1]
        if dim != self.dim:
            raise DataError(
                self._vision.path,
                f"vectors of {dim} dimensions",
                f"{self.dim}, as those of {self._text.path.name}",
                "Take both towers from one export, with their projections.",
            )
        self._learnt = files.logit or self._measured_logit(threads)
        self._head, self._grid = (self._open_dense(threads) if dense else None), self._patches()

    def encode_regions(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        masks: Masks,
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> npt.NDArray[np.float32]:
        """Unit vectors (n, D) float32, one for each mask 1..n, from crops or, ``dense``, from one pass."""
        if self._head is None:
            return super().encode_regions(rgb, depth, masks, T_world_camera, camera)
        if len(masks) == 0:
            return np.zeros((0, self.dim), np.float32)
        tokens = self.dense(rgb)
        return unit(cover(masks, *tokens.shape[:2]) @ tokens.reshape(-1, self.dim))

    def dense(self, rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
        """Unit vectors (gh, gw, D) float32 of the patches of a picture (H, W, 3) uint8, squashed to the tower's size.

        Raises
        ------
        ValueError
            The encoder was not made with ``dense=True``.
        """
        if self._head is None or self._grid is None:
            raise ValueError("this encoder was made with dense=False, expected dense=True")
        hidden = self._run_vision(self._files.preprocessing.whole(rgb), "last_hidden_state")[0]
        patches = hidden[len(hidden) - self._grid[0] * self._grid[1] :]
        return unit(self._head(patches)).reshape(*self._grid, self.dim)

    def _image_tower(self, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        return self._pixels_to_vectors(self._files.preprocessing(pictures))

    def _text_tower(self, texts: list[str]) -> npt.NDArray[np.float32]:
        return self._encode_text_ids(texts)

    def _logit(self) -> tuple[float, float | None]:
        return self._learnt

    def _pixels_to_vectors(self, pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return self._run_vision(pixels, "image_embeds")

    def _run_vision(self, pixels: npt.NDArray[np.float32], output: str) -> npt.NDArray[np.float32]:
        others = {} if self._text is not self._vision else self._words([""])
        return _in_batches(self._vision, {"pixel_values": pixels}, others)[output]

    def _encode_text_ids(self, texts: list[str]) -> npt.NDArray[np.float32]:
        others = {} if self._text is not self._vision else {"pixel_values": self._nothing(1)}
        return _in_batches(self._text, self._words(texts), others)["text_embeds"]

    def _words(self, texts: list[str]) -> dict[str, npt.NDArray[Any]]:
        """What the text tower takes. SigLIP attends to its padding, so there everything counts as there."""
        ids, there = self._files.tokens(texts)
        return {"input_ids": ids, "attention_mask": np.ones_like(there) if self._files.siglip else there}

    def _nothing(self, n: int) -> npt.NDArray[np.float32]:
        size = self._files.preprocessing.output
        assert size is not None
        return np.zeros((n, 3, *size), np.float32)

    def _check_inputs(self) -> None:
        """DataError where a tower takes another size of picture or number of tokens than the configuration says."""
        files, size = self._files, self._files.preprocessing.output
        assert size is not None
        declared = [self._vision.axis("pixel_values", axis) for axis in (1, 2, 3)]
        if any(have not in (None, want) for have, want in zip(declared, (3, *size), strict=True)):
            raise DataError(
                self._vision.path,
                f"a tower for pictures {declared}",
                f"[3, {size[0]}, {size[1]}] as the preprocessor's configuration says",
                "Take all files from one export.",
            )
        length = self._text.axis("input_ids", 1)
        if length not in (None, files.tokens.length):
            raise DataError(
                self._text.path,
                f"a tower for {length} tokens",
                f"{files.tokens.length} as the configurations say",
                "Take all files from one export.",
            )

    def _measured_logit(self, threads: int) -> tuple[float, float | None]:
        """Scale and bias as the combined model applies them: the line through its logits over its cosines."""
        assert self._files.combined is not None
        both = self._vision if self._vision is self._text else _open_combined(self._files.combined, threads)
        pixels = np.random.default_rng(0).uniform(-2, 2, (3, *self._nothing(1).shape[1:])).astype(np.float32)
        cosines, logits = [], []
        for picture in pixels:
            for word in ("a chair", "blue sky", "0"):
                out = _in_batches(both, self._words([word]), {"pixel_values": picture[None]}, one=True)
                cosines.append(float((unit(out["image_embeds"][:1]) @ unit(out["text_embeds"][:1]).T)[0, 0]))
                logits.append(float(out["logits_per_image"][0, 0]))
        x, y = np.array(cosines), np.array(logits)
        columns = np.stack([x, np.ones_like(x)] if self._files.siglip else [x], axis=1)
        line = np.linalg.lstsq(columns, y, rcond=None)[0]
        if line[0] <= 0 or np.abs(columns @ line - y).max() > 0.05 * max(1.0, float(np.ptp(y))):
            raise DataError(
                both.path,
                "logits that are no rising line over the cosines of its vectors",
                "logits_per_image of a CLIP or SigLIP",
                "Write the trained logit_scale (and logit_bias) into config.json.",
            )
        return float(line[0]), float(line[1]) if self._files.siglip else None

    def _patches(self) -> tuple[int, int] | None:
        size, patch = self._files.preprocessing.output, self._files.patch
        return None if size is None or patch is None else (size[0] // patch, size[1] // patch)

    def _open_dense(self, threads: int) -> TokenHead:
        """The tower's end that turns tokens into vectors; DataError where the model has none that can be found."""
        hidden, grid = self._vision.outputs.get("last_hidden_state"), self._patches()
        if self._vision is self._text or hidden is None or grid is None:
            raise DataError(
                self._vision.path,
                str(self._vision.file),
                "a tower of its own, of patches, that also gives last_hidden_state, for dense=True",
                "Use crops (dense=False), or export the tower with its last_hidden_state.",
            )
        n, tokens, channels = self._run_vision(self._nothing(1), "last_hidden_state").shape
        if tokens - grid[0] * grid[1] not in (0, 1):
            raise DataError(
                self._vision.path,
                f"{tokens} tokens",
                f"{grid[0]} x {grid[1]} patches as the configuration says, and one more at most",
                "Take all files from one export.",
            )
        vector, batch = self._vision.outputs["image_embeds"].name, self._vision.axis("pixel_values", 0)
        shape = (n, tokens, channels)
        return TokenHead(self._vision.path, hidden.name, vector, shape, batch=batch, threads=threads)


def cover(masks: Masks, height: int, width: int) -> npt.NDArray[np.float32]:
    """How much each mask covers of each cell of a grid laid over the picture, (n, height * width), each row of sum 1 or 0."""
    out = np.zeros((len(masks), height * width), np.float32)
    for i in range(len(masks)):
        part = cv2.resize((masks.labels == i + 1).astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        out[i] = part.ravel() / max(float(part.sum()), 1e-12)
    return out


def _in_batches(
    model: Model, arrays: dict[str, npt.NDArray[Any]], others: dict[str, npt.NDArray[Any]], *, one: bool = False
) -> dict[str, npt.NDArray[np.float32]]:
    """Outputs for arrays (n, ...) side by side, the towers' fixed batch axes heeded.

    Parameters
    ----------
    model : Model
    arrays : {name: (n, ...)}
    others : {name: (1, ...)}
        What the other tower of a combined model gets.
    one : bool
        All outputs of the first run as they are.
    """
    first = next(iter(arrays))
    n, fixed = len(arrays[first]), model.axis(first, 0)
    fillers = {name: _filled(a, model.axis(name, 0) or 1) for name, a in others.items() if name in model.inputs}
    outputs: dict[str, list[npt.NDArray[np.float32]]] = {}
    step = fixed or n
    for start in range(0, n, step):
        parts = {name: _filled(a[start : start + step], step) for name, a in arrays.items()}
        results = model.run(**parts, **fillers)
        if one:
            return results
        for name, result in results.items():
            outputs.setdefault(name, []).append(result[: min(step, n - start)])
    return {name: np.concatenate(parts) for name, parts in outputs.items()}


def _filled(array: npt.NDArray[Any], n: int) -> npt.NDArray[Any]:
    """An array (m, ...) with its last entry repeated until there are n."""
    return np.concatenate([array, np.repeat(array[-1:], n - len(array), axis=0)]) if len(array) < n else array


def _vector(files: ClipFiles, name: str) -> Port:
    """What a tower's vector goes by. CLIP's pooled output will not do, it is not projected; SigLIP has no projection behind it."""
    pooled = ("pooler_output",) if files.siglip else ()
    return Port(2, (*pooled, name, "embedding", "embeddings"), unnamed=files.open_clip)


def _open_vision(path: Path, vector: Port, threads: int) -> Model:
    outputs = {"image_embeds": vector, "last_hidden_state": _HIDDEN}
    return open_model(path, {"pixel_values": _PIXELS}, outputs, "an image tower", threads=threads)


def _open_text(path: Path, vector: Port, threads: int) -> Model:
    inputs = {"input_ids": _IDS, "attention_mask": _MASK}
    return open_model(path, inputs, {"text_embeds": vector}, "a text tower", threads=threads)


def _open_combined(path: Path, threads: int) -> Model:
    """Both towers in one file, which has to be given something for each at every run."""
    inputs = {"pixel_values": Port(4, ("image",)), "input_ids": Port(2, ("text",), kind="int"), "attention_mask": _MASK}
    outputs = {
        "image_embeds": Port(2),
        "text_embeds": Port(2),
        "logits_per_image": Port(2, ("logits",)),
    }
    return load(path, "a CLIP or SigLIP", threads=threads).bind(inputs, outputs, "a CLIP or SigLIP")
