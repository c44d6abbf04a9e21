"""Tiny random-weight torch models with the exact inputs and outputs of the exports that the ONNX segmenters read."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.torchvision_import import import_torchvision

# transformers imports torchvision where it is installed, whether or not that fits torch.
with contextlib.suppress(ImportError):
    import_torchvision()

from transformers import SamConfig, SamModel

SIDE, GRID, CHANNELS = 64, 4, 16
LOW = 4 * GRID


def export(
    module: nn.Module,
    arguments: Sequence[torch.Tensor],
    path: Path,
    inputs: Sequence[str],
    outputs: Sequence[str],
    free: dict[str, tuple[int, ...]] | None = None,
) -> Path:
    """Write a module as ONNX; ``free`` names the axes that are not fixed."""
    axes = {name: {axis: f"{name}_{axis}" for axis in which} for name, which in (free or {}).items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the tracing exporter is old, and is what such files are made with
        torch.onnx.export(
            module.eval(),
            tuple(arguments),
            str(path),
            dynamo=False,
            opset_version=17,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=axes,
        )
    return path


def model(module: type[nn.Module], seed: int = 0) -> nn.Module:
    """The module with weights of a seed."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return module().eval()


class SamEncoder(nn.Module):
    """(n, 3, 64, 64) -> (n, 16, 4, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.patches = nn.Conv2d(3, CHANNELS, SIDE // GRID, SIDE // GRID)

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return torch.tanh(self.patches(picture))


class RawSamEncoder(nn.Module):
    """(h, w, 3) 0..255, normalising and padding inside, -> (1, 16, 4, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SamEncoder()

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        mean, deviation = torch.tensor([123.675, 116.28, 103.53]), torch.tensor([58.395, 57.12, 57.375])
        x = ((picture - mean) / deviation).permute(2, 0, 1)[None]
        return self.encoder(functional.pad(x, (0, SIDE - x.shape[3], 0, SIDE - x.shape[2])))


class SamDecoder(nn.Module):
    """Segment Anything's decoder interface with its postprocessing: four masks and their quality for each prompt."""

    def __init__(self) -> None:
        super().__init__()
        self.frequencies = nn.Parameter(torch.randn(2, CHANNELS // 2), requires_grad=False)
        self.kinds = nn.Embedding(5, CHANNELS)  # -1 (none), 0, 1, 2, 3
        self.shrink = nn.Conv2d(1, CHANNELS, 4, 4)
        self.no_mask = nn.Parameter(torch.randn(CHANNELS))
        self.mix = nn.Linear(2 * CHANNELS, 4 * CHANNELS)
        self.grow = nn.ConvTranspose2d(CHANNELS, CHANNELS, 4, 4)
        self.quality = nn.Linear(2 * CHANNELS, 4)

    def forward(self, image_embeddings, point_coords, point_labels, mask_input, has_mask_input, orig_im_size):
        angle = 2 * torch.pi * (2 * (point_coords + 0.5) / SIDE - 1) @ self.frequencies
        points = torch.cat([angle.sin(), angle.cos()], -1) * (point_labels != -1)[..., None]
        prompt = (points + self.kinds(point_labels.long() + 1)).mean(1)
        dense = has_mask_input * self.shrink(mask_input) + (1 - has_mask_input) * self.no_mask[None, :, None, None]
        picture = image_embeddings + dense
        context = torch.cat([prompt, picture.mean((2, 3)).expand(prompt.shape[0], -1)], -1)
        queries = self.mix(context).reshape(-1, 4, CHANNELS)
        low = (queries[..., None, None] * self.grow(picture)[:, None]).sum(2) * 4
        return self.upscale(low, orig_im_size), torch.sigmoid(self.quality(context)), low

    def upscale(self, low: torch.Tensor, size: torch.Tensor) -> torch.Tensor:
        full = functional.interpolate(low, size=(SIDE, SIDE), mode="bilinear", align_corners=False)
        inner = torch.floor(SIDE / size.max() * size.float() + 0.5).long()
        full = full[..., : inner[0], : inner[1]]
        height, width = size.long()
        return functional.interpolate(full, size=(height, width), mode="bilinear", align_corners=False)


class DiscDecoder(SamDecoder):
    """One mask a prompt, a disc of radius 5 in the encoder's pixels round the first point."""

    def forward(self, image_embeddings, point_coords, point_labels, mask_input, has_mask_input, orig_im_size):
        centres = torch.arange(SIDE) + 0.5
        dx = centres[None, None, :] - point_coords[:, 0, 0][:, None, None]
        dy = centres[None, :, None] - point_coords[:, 0, 1][:, None, None]
        low = (5 - torch.sqrt(dx**2 + dy**2))[:, None] * 100
        unused = (image_embeddings.sum() + mask_input.sum() + has_mask_input.sum() + orig_im_size.sum()) * 0
        return low, torch.full_like(low[..., 0, 0], 0.95) + point_labels.sum() * 0, low + unused


class Sam2Encoder(nn.Module):
    """(1, 3, 64, 64) -> features of three resolutions, in samexporter's order."""

    def __init__(self) -> None:
        super().__init__()
        self.patches = SamEncoder()
        self.fine = nn.ModuleList([nn.Conv2d(3, 4, 4, 4), nn.Conv2d(3, 8, 8, 8)])

    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return self.fine[0](image), self.fine[1](image), self.patches(image)


class Sam2Decoder(nn.Module):
    """Segment Anything 2's decoder interface: three masks of low resolution for each prompt."""

    def __init__(self) -> None:
        super().__init__()
        self.decoder = SamDecoder()

    def forward(
        self, image_embed, high_res_feats_0, high_res_feats_1, point_coords, point_labels, mask_input, has_mask_input
    ):
        size = torch.tensor([SIDE, SIDE])
        _, ious, low = self.decoder(image_embed, point_coords, point_labels, mask_input, has_mask_input, size)
        fine = functional.interpolate(high_res_feats_1, size=(LOW, LOW), mode="nearest").mean(1, keepdim=True)
        return low[:, 1:] + high_res_feats_0.mean(1, keepdim=True) + fine, ious[:, 1:]


SAM_INPUTS = ("image_embeddings", "point_coords", "point_labels", "mask_input", "has_mask_input", "orig_im_size")
SAM_OUTPUTS = ("masks", "iou_predictions", "low_res_masks")


def sam_prompt(n: int = 1) -> tuple[torch.Tensor, ...]:
    """Arguments of a SamDecoder for n prompts."""
    return (
        torch.randn(1, CHANNELS, GRID, GRID, generator=torch.Generator().manual_seed(1)),
        torch.tensor([[[10.0, 20.0], [0.0, 0.0]]]).repeat(n, 1, 1),
        torch.tensor([[1.0, -1.0]]).repeat(n, 1),
        torch.zeros(1, 1, LOW, LOW),
        torch.zeros(1),
        torch.tensor([48.0, 64.0]),
    )


def write_sam(folder: Path, decoder: nn.Module, *, raw: bool = False, free: bool = True) -> Path:
    """An export of Segment Anything's own layout; ``free``: batches of pictures and of prompts."""
    folder.mkdir(exist_ok=True)
    if raw:
        encoder, example, axes = model(RawSamEncoder), torch.zeros(48, 64, 3), {"input_image": (0, 1)}
    else:
        encoder, example = model(SamEncoder), torch.zeros(1, 3, SIDE, SIDE)
        axes = {"input_image": (0,), "image_embeddings": (0,)} if free else {}
    export(encoder, [example], folder / "encoder.onnx", ["input_image"], ["image_embeddings"], axes)
    axes = {"point_coords": (0, 1) if free else (1,), "point_labels": (0, 1) if free else (1,)}
    axes |= {"masks": (0, 2, 3), "iou_predictions": (0,), "low_res_masks": (0,)}
    export(decoder, sam_prompt(), folder / "decoder.onnx", SAM_INPUTS, SAM_OUTPUTS, axes)
    return folder


def write_sam2(folder: Path) -> Path:
    """An export of Segment Anything 2."""
    folder.mkdir(exist_ok=True)
    features = ("high_res_feats_0", "high_res_feats_1", "image_embed")
    encoder, picture = model(Sam2Encoder), torch.zeros(1, 3, SIDE, SIDE)
    export(encoder, [picture], folder / "sam2.encoder.onnx", ["image"], features)
    with torch.no_grad():
        fine, middle, coarse = encoder(picture)
    example = (coarse, fine, middle, *sam_prompt(2)[1:3], torch.zeros(2, 1, LOW, LOW), torch.zeros(1))
    names = ["image_embed", "high_res_feats_0", "high_res_feats_1", *SAM_INPUTS[1:5]]
    axes = {"point_coords": (0, 1), "point_labels": (0, 1), "mask_input": (0,), "masks": (0,), "iou_predictions": (0,)}
    export(model(Sam2Decoder), example, folder / "sam2.decoder.onnx", names, SAM_OUTPUTS[:2], axes)
    return folder


def transformers_sam() -> SamModel:
    """transformers' own model, very small."""
    vision = {"image_size": SIDE, "patch_size": SIDE // GRID, "output_channels": CHANNELS, "hidden_size": CHANNELS}
    vision |= {"num_hidden_layers": 2, "num_attention_heads": 2, "mlp_dim": 32, "window_size": 2, "num_pos_feats": 8}
    prompt = {"image_size": SIDE, "patch_size": SIDE // GRID, "hidden_size": CHANNELS, "mask_input_channels": 4}
    mask = {"hidden_size": CHANNELS, "mlp_dim": 32, "num_hidden_layers": 1, "num_attention_heads": 2}
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return SamModel(
            SamConfig(
                vision_config=vision | {"global_attn_indexes": [1]},
                prompt_encoder_config=prompt,
                mask_decoder_config=mask | {"iou_head_hidden_dim": 16},
            )
        ).eval()


class TransformersEncoder(nn.Module):
    """The first half of the split export."""

    def __init__(self, sam: SamModel) -> None:
        super().__init__()
        self.sam = sam

    def forward(self, pixel_values: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        where = self.sam.get_image_wide_positional_embeddings().repeat(pixel_values.shape[0], 1, 1, 1)
        return self.sam.vision_encoder(pixel_values, return_dict=True)[0], where


class TransformersDecoder(nn.Module):
    """The second half of the split export."""

    def __init__(self, sam: SamModel) -> None:
        super().__init__()
        self.sam = sam

    def forward(self, input_points, input_labels, image_embeddings, image_positional_embeddings):
        sparse, dense = self.sam.prompt_encoder(input_points, input_labels, input_boxes=None, input_masks=None)
        masks, ious = self.sam.mask_decoder(
            image_embeddings=image_embeddings,
            image_positional_embeddings=image_positional_embeddings,
            sparse_prompt_embeddings=sparse,
            dense_prompt_embeddings=dense,
            multimask_output=True,
        )[:2]
        return ious, masks


def write_transformers(folder: Path) -> Path:
    """An export in the layout of optimum."""
    folder.mkdir(exist_ok=True)
    sam = transformers_sam()
    both = ("image_embeddings", "image_positional_embeddings")
    path = folder / "vision_encoder.onnx"
    picture = torch.zeros(1, 3, SIDE, SIDE)
    export(
        TransformersEncoder(sam), [picture], path, ["pixel_values"], both, dict.fromkeys(("pixel_values", *both), (0,))
    )
    with torch.no_grad():
        embeddings = TransformersEncoder(sam)(picture)
    example = (torch.ones(1, 2, 1, 2), torch.ones(1, 2, 1, dtype=torch.int64), *embeddings)
    axes = {"input_points": (0, 1, 2), "input_labels": (0, 1, 2), both[0]: (0,), both[1]: (0,)}
    axes |= {"iou_scores": (0, 1), "pred_masks": (0, 1)}
    path = folder / "prompt_encoder_mask_decoder.onnx"
    export(
        TransformersDecoder(sam),
        example,
        path,
        ["input_points", "input_labels", *both],
        ["iou_scores", "pred_masks"],
        axes,
    )
    return folder


class EfficientEncoder(nn.Module):
    """A picture 0..1 of any size, scaling and normalising inside, -> (n, 16, 4, 4)."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = SamEncoder()

    def forward(self, batched_images: torch.Tensor) -> torch.Tensor:
        x = functional.interpolate(batched_images, (SIDE, SIDE), mode="bilinear", align_corners=False)
        return self.encoder((x - 0.45) / 0.23)


class EfficientDecoder(nn.Module):
    """EfficientSAM's decoder interface: points of the picture, masks at its size."""

    def __init__(self) -> None:
        super().__init__()
        self.decoder = SamDecoder()

    def forward(self, image_embeddings, batched_point_coords, batched_point_labels, orig_im_size):
        scale = SIDE / torch.stack([orig_im_size[1], orig_im_size[0]]).float()
        nothing = torch.zeros(1, 1, LOW, LOW)
        size = torch.tensor([SIDE, SIDE])
        _, ious, low = self.decoder(
            image_embeddings, batched_point_coords[0] * scale, batched_point_labels[0], nothing, torch.zeros(1), size
        )
        height, width = orig_im_size
        masks = functional.interpolate(low[:, 1:], size=(height, width), mode="bilinear", align_corners=False)
        return masks[None], ious[None, :, 1:], low


def write_efficient(folder: Path) -> Path:
    """An export in the layout of EfficientSAM."""
    folder.mkdir(exist_ok=True)
    picture = torch.zeros(1, 3, 48, 64)
    axes = {"batched_images": (0, 2, 3), "image_embeddings": (0,)}
    path = folder / "efficient_encoder.onnx"
    export(model(EfficientEncoder), [picture], path, ["batched_images"], ["image_embeddings"], axes)
    example = (sam_prompt()[0], torch.ones(1, 1, 1, 2), torch.ones(1, 1, 1), torch.tensor([48, 64]))
    names = ["image_embeddings", "batched_point_coords", "batched_point_labels", "orig_im_size"]
    axes = {names[0]: (0,), names[1]: (1, 2), names[2]: (1, 2), "output_masks": (0, 1, 3, 4), "iou_predictions": (1,)}
    path = folder / "efficient_decoder.onnx"
    export(model(EfficientDecoder), example, path, names, ["output_masks", "iou_predictions", "low"], axes)
    return folder


class Yolo(nn.Module):
    """A segmentation head over three strides: (n, 4 + 3 + 32, N) and (n, 32, h / 4, w / 4)."""

    classes = 3

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, 16, 8, 8)
        self.down = nn.ModuleList([nn.Identity(), nn.Conv2d(16, 16, 2, 2), nn.Conv2d(16, 16, 4, 4)])
        self.head = nn.Conv2d(16, 4 + self.classes + 32, 1)
        self.prototypes = nn.ConvTranspose2d(16, 32, 2, 2)

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        base = torch.tanh(self.stem(images))
        rows = []
        for stride, down in zip((8, 16, 32), self.down, strict=True):
            out = self.head(torch.tanh(down(base)))
            y, x = torch.meshgrid(torch.arange(out.shape[2]), torch.arange(out.shape[3]), indexing="ij")
            centre = (torch.stack([x, y])[None] + 0.5 + torch.tanh(out[:, :2])) * stride
            extent = (1 + torch.tanh(out[:, 2:4])) * 2 * stride
            scores = torch.sigmoid(4 * out[:, 4 : 4 + self.classes])
            rows.append(torch.cat([centre, extent, scores, out[:, 4 + self.classes :]], 1).flatten(2))
        return torch.cat(rows, 2), self.prototypes(base)


class Boxes(nn.Module):
    """A network that always finds the same two things: masks that fill their boxes, of the second of two classes."""

    rows = torch.tensor([[20.0, 24.0, 16.0, 12.0, 0.9], [44.0, 40.0, 20.0, 16.0, 0.6], [21.0, 24.0, 16.0, 12.0, 0.5]])

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        unused = images.mean((1, 2, 3))[:, None, None] * 0
        rows = torch.cat([self.rows[:, :4], torch.full((3, 1), 0.1), self.rows[:, 4:], torch.ones(3, 2)], 1)
        return rows.T[None] + unused, torch.ones(1, 2, 16, 16) + unused[..., None]


class FinishedBoxes(Boxes):
    """The same things as an export gives them that suppresses by itself."""

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        centre, half, score = self.rows[:2, :2], self.rows[:2, 2:4] / 2, self.rows[:2, 4:]
        rows = torch.cat([centre - half, centre + half, score, torch.zeros(2, 1), torch.ones(2, 2)], 1)
        return rows[None] + images.sum() * 0, torch.ones(1, 2, 16, 16)


def write_yolo(path: Path, module: nn.Module, *, free: bool = False, metadata: dict[str, str] | None = None) -> Path:
    """A YOLO export for 64 x 64 pictures, or, ``free``, for any number and size."""
    axes = {"images": (0, 2, 3), "output0": (0, 2), "output1": (0, 2, 3)} if free else {}
    export(module, [torch.zeros(1, 3, SIDE, SIDE)], path, ["images"], ["output0", "output1"], axes)
    if metadata:
        import onnx

        proto = onnx.load(path)
        onnx.helper.set_model_props(proto, metadata)
        onnx.save(proto, path)
    return path


def check_masks(masks: Masks, size: tuple[int, int] = (90, 120)) -> None:
    assert masks.labels.shape == size
    assert masks.labels.dtype == np.int32
    assert masks.scores.dtype == np.float32
    assert ((masks.scores >= 0) & (masks.scores <= 1)).all()
    assert set(np.unique(masks.labels)) - {0} == set(range(1, len(masks) + 1))
