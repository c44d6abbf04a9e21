"""The encoder and the decoder of a SAM-family export, whatever its layout.

Four layouts are known, told apart by the decoder's inputs:

========================  ==============================================================================================
Segment Anything          The repository's own export, and MobileSAM's. Encoder: a normalised, padded picture (1, 3, S, S), or,
                          where these steps were exported with it, the scaled picture (h, w, 3) 0..255.
                          Decoder: image_embeddings, point_coords, point_labels, mask_input, has_mask_input, orig_im_size ->
                          masks, iou_predictions, low_res_masks.
Segment Anything 2        The export of ``samexporter``: the same with high_res_feats_0 and high_res_feats_1 from the encoder to the
                          decoder, and masks that may be of low resolution. The picture is stretched to S x S.
transformers              ``optimum``'s split export: vision_encoder (pixel_values -> image_embeddings,
                          image_positional_embeddings), prompt_encoder_mask_decoder (input_points, input_labels and both
                          embeddings -> iou_scores, pred_masks).
EfficientSAM              Encoder: the picture (1, 3, H, W) 0..1 at its own size. Decoder: image_embeddings,
                          batched_point_coords, batched_point_labels, orig_im_size -> output_masks, iou_predictions.
========================  ==============================================================================================

The first and the third scale the picture's long side to S (1024), subtract ImageNet's mean, divide by its deviation, and pad with
zeros at the right and the bottom; points are scaled the same way (Kirillov et al., ICCV 2023, and its repository's
``ResizeLongestSide``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_agents.perception.onnx.pictures import Frame
from openmap_agents.perception.onnx.session import File, Model, Port, load
from openmap_scenes import DataError

Floats = npt.NDArray[np.float32]
Embedding = dict[str, npt.NDArray[Any]]

MEAN = np.array([123.675, 116.28, 103.53], np.float32)
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)

ENCODER = "the image encoder of a SAM-family export"
DECODER = "the mask decoder of a SAM-family export (Segment Anything, transformers or EfficientSAM)"

_PICTURE = ("input_image", "images", "image", "x", "input", "pixel_values", "batched_images")
_EMBEDDING = ("image_embedding", "embeddings", "image_embed", "output")


class SamModel(Protocol):
    """Pictures -> embeddings; an embedding and points -> mask logits."""

    free_batch: bool
    """Whether several pictures of one size go through the encoder together."""
    points_per_call: int | None
    """How many prompts the decoder takes at once, None where that is free."""

    def frame(self, size: tuple[int, int]) -> Frame:
        """Where a picture of size (H, W) lies in the network's input."""
        ...

    def encode(self, pictures: list[npt.NDArray[np.uint8]]) -> list[Embedding]:
        """An embedding of each of n pictures (H, W, 3) uint8 of one size."""
        ...

    def decode(self, embedding: Embedding, points: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
        """Masks for points (n, 2), x and y in pixels of a picture of size (H, W).

        Returns
        -------
        (n, m, h, w), (n, m) float32
            Logits over the network's input at the decoder's resolution (EfficientSAM: over the picture), and the overlap with
            the thing that the model expects of each.
        """
        ...


def open_sam(encoder: Path, decoder: Path, *, size: int, threads: int) -> SamModel:
    """The two files as one model.

    Parameters
    ----------
    encoder, decoder : Path
    size : int
        Side of the encoder's input in pixels, where the file does not say.
    threads : int

    Raises
    ------
    DataError
        A file that is missing, broken, of no known layout, or that does not fit the other.
    """
    eyes, hands = load(encoder, ENCODER, threads=threads), load(decoder, DECODER, threads=threads)
    if hands.has("input_points"):
        model: _Sam | _EfficientSam = _TransformersSam(eyes, hands, size)
    elif hands.has("batched_point_coords"):
        model = _EfficientSam(eyes, hands)
    elif hands.has("high_res_feats_0"):
        model = _Sam2(eyes, hands, size)
    else:
        model = _Sam(eyes, hands, size)
    _check_fit(model.encoder, model.decoder)
    return model


def _check_fit(encoder: Model, decoder: Model) -> None:
    gives = encoder.outputs["image_embeddings"]
    takes = decoder.inputs["image_embeddings"]
    if any(a != b for a, b in zip(gives.shape, takes.shape, strict=False) if a is not None and b is not None):
        raise DataError(
            decoder.path,
            f"a decoder that takes {takes}",
            f"one that takes {gives}, as {encoder.path} gives it",
            "Use the encoder and the decoder of one export.",
        )


def scaled(rgb: npt.NDArray[np.uint8], inner: tuple[int, int]) -> npt.NDArray[np.float32]:
    """The picture at size ``inner`` (h, w), (h, w, 3) float32 0..255, resampled as SAM's own preprocessing does."""
    picture = Image.fromarray(rgb).resize(inner[::-1], Image.Resampling.BILINEAR)
    return np.asarray(picture, np.float32)


def normalised(rgb: npt.NDArray[np.uint8], frame: Frame) -> npt.NDArray[np.float32]:
    """The picture as the encoder wants it: (3, *frame.network) float32."""
    out = np.zeros((3, *frame.network), np.float32)
    height, width = frame.inner
    out[:, :height, :width] = ((scaled(rgb, frame.inner) - MEAN) / DEVIATION).transpose(2, 0, 1)
    return out


class _Sam:
    """Segment Anything's own layout."""

    logits = "low_res_masks"
    decoder_inputs: ClassVar[dict[str, Port]] = {
        "image_embeddings": Port(4, ("image_embedding",)),
        "point_coords": Port(3),
        "point_labels": Port(2, kind="any"),
        "mask_input": Port(4),
        "has_mask_input": Port(1, kind="any"),
        "orig_im_size": Port(1, kind="any", optional=True),
    }
    decoder_outputs: ClassVar[dict[str, Port]] = {"iou_predictions": Port(2), "low_res_masks": Port(4)}
    encoder_inputs: ClassVar[dict[str, Port]] = {"picture": Port((3, 4), _PICTURE, kind="any", unnamed=True)}
    encoder_outputs: ClassVar[dict[str, Port]] = {"image_embeddings": Port(4, _EMBEDDING, unnamed=True)}

    def __init__(self, encoder: File, decoder: File, size: int) -> None:
        self.encoder = encoder.bind(self.encoder_inputs, self.encoder_outputs, ENCODER)
        self.decoder = decoder.bind(self.decoder_inputs, self.decoder_outputs, DECODER)
        shape = self.encoder.inputs["picture"].shape
        self.raw = len(shape) == 3
        side = None if self.raw else shape[2]
        if not self.raw and shape[2] != shape[3]:
            raise DataError(encoder.path, str(encoder), f"{ENCODER} for square pictures", "Export it so.")
        self.side = side or size
        self.free_batch = not self.raw and shape[0] is None
        self.points_per_call = self._points_axis()

    def _points_axis(self) -> int | None:
        return self.decoder.axis("point_coords", 0)

    def frame(self, size: tuple[int, int]) -> Frame:
        scale = self.side / max(size)
        inner = (int(size[0] * scale + 0.5), int(size[1] * scale + 0.5))
        return Frame(size, (self.side, self.side), inner)

    def encode(self, pictures: list[npt.NDArray[np.uint8]]) -> list[Embedding]:
        frame = self.frame(_size(pictures[0]))
        if self.raw:
            return [self.encoder.run(picture=scaled(rgb, frame.inner)) for rgb in pictures]
        together = self.encoder.run(picture=np.stack([normalised(rgb, frame) for rgb in pictures]))
        return [{name: array[i : i + 1] for name, array in together.items()} for i in range(len(pictures))]

    def to_network(self, points: Floats, size: tuple[int, int]) -> Floats:
        """Points (n, 2) of the picture -> of the encoder's input."""
        height, width = self.frame(size).inner
        return points * np.array([width / size[1], height / size[0]], np.float32)

    def decode(self, embedding: Embedding, points: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
        n = len(points)
        # The export leaves out what the torch model adds where there is no box: a second point that is none.
        coords = np.stack([self.to_network(points, size), np.zeros((n, 2), np.float32)], axis=1)
        labels = np.tile(np.array([1, -1], np.float32), (n, 1))
        grid = embedding["image_embeddings"].shape[2]
        side = self.decoder.axis("mask_input", 2) or 4 * grid
        outputs = self.decoder.run(
            **embedding,
            point_coords=coords,
            point_labels=labels,
            mask_input=np.zeros((self.decoder.axis("mask_input", 0) or n, 1, side, side), np.float32),
            has_mask_input=np.zeros(1, np.float32),
            # Only the size of the output "masks" hangs on it, of which many exports have the example picture's proportions
            # frozen in: the low resolution is taken instead.
            orig_im_size=np.maximum(1, np.array(self.frame(size).inner) * side // self.side),
        )
        logits, ious = outputs[self.logits], outputs["iou_predictions"]
        # Of four masks the first is the one for several points; the other three are a point's whole, part and subpart.
        first = 1 if logits.shape[1] == 4 else 0
        return logits[:, first:], ious[:, first:]


class _Sam2(_Sam):
    """Segment Anything 2's, with features of higher resolution, and without keeping the picture's proportions."""

    _features: ClassVar[dict[str, Port]] = {
        "image_embeddings": Port(4, ("image_embed",)),
        "high_res_feats_0": Port(4),
        "high_res_feats_1": Port(4),
    }
    logits = "masks"
    decoder_inputs: ClassVar[dict[str, Port]] = {**_Sam.decoder_inputs, **_features}
    decoder_outputs: ClassVar[dict[str, Port]] = {"iou_predictions": Port(2), "masks": Port(4)}
    encoder_outputs: ClassVar[dict[str, Port]] = _features

    def frame(self, size: tuple[int, int]) -> Frame:
        return Frame(size, (self.side, self.side), (self.side, self.side))


class _TransformersSam(_Sam):
    """The split export of transformers' SamModel."""

    decoder_inputs: ClassVar[dict[str, Port]] = {
        "image_embeddings": Port(4),
        "image_positional_embeddings": Port(4),
        "input_points": Port(4),
        "input_labels": Port(3, kind="any", optional=True),
    }
    decoder_outputs: ClassVar[dict[str, Port]] = {"iou_scores": Port(3), "pred_masks": Port(5)}
    encoder_inputs: ClassVar[dict[str, Port]] = {"picture": Port(4, ("pixel_values",))}
    encoder_outputs: ClassVar[dict[str, Port]] = {"image_embeddings": Port(4), "image_positional_embeddings": Port(4)}

    def _points_axis(self) -> int | None:
        return self.decoder.axis("input_points", 1)

    def decode(self, embedding: Embedding, points: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
        outputs = self.decoder.run(
            **embedding,
            input_points=self.to_network(points, size)[None, :, None],
            input_labels=np.ones((1, len(points), 1)),
        )
        return outputs["pred_masks"][0], outputs["iou_scores"][0]


class _EfficientSam:
    """EfficientSAM's export: scaling and normalising are in the graph, and points are the picture's."""

    def __init__(self, encoder: File, decoder: File) -> None:
        self.encoder = encoder.bind(
            {"batched_images": Port(4, unnamed=True)}, {"image_embeddings": Port(4, _EMBEDDING, unnamed=True)}, ENCODER
        )
        self.decoder = decoder.bind(
            {
                "image_embeddings": Port(4),
                "batched_point_coords": Port(4),
                "batched_point_labels": Port(3, kind="any"),
                "orig_im_size": Port(1, kind="any"),
            },
            {"output_masks": Port(5), "iou_predictions": Port(3)},
            DECODER,
        )
        self.free_batch = self.encoder.axis("batched_images", 0) is None
        self.points_per_call = self.decoder.axis("batched_point_coords", 1)

    def frame(self, size: tuple[int, int]) -> Frame:
        return Frame(size, size, size)

    def encode(self, pictures: list[npt.NDArray[np.uint8]]) -> list[Embedding]:
        stack = np.stack(pictures).astype(np.float32).transpose(0, 3, 1, 2) / np.float32(255)
        together = self.encoder.run(batched_images=stack)["image_embeddings"]
        return [{"image_embeddings": together[i : i + 1]} for i in range(len(pictures))]

    def decode(self, embedding: Embedding, points: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
        outputs = self.decoder.run(
            **embedding,
            batched_point_coords=points[None, :, None],
            batched_point_labels=np.ones((1, len(points), 1)),
            orig_im_size=np.array(size),
        )
        return outputs["output_masks"][0], outputs["iou_predictions"][0]


def _size(rgb: npt.NDArray[np.uint8]) -> tuple[int, int]:
    return rgb.shape[0], rgb.shape[1]
