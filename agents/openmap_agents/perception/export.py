"""A torch module -> an ONNX file. Needs torch, which perception does not need otherwise."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import nn

_OPSET = 17


def export_onnx(
    module: nn.Module, inputs: Sequence[torch.Tensor], names: Sequence[str], outputs: Sequence[str], path: Path
) -> None:
    """Write a module that takes and gives (B, C, h, w), with all axes but C free; whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.getpid()}.part")
    with torch.no_grad(), warnings.catch_warnings():
        # The exporter by tracing is called old; the new one needs another package, and writes other files with each release.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module.eval(),
            tuple(inputs),
            str(unfinished),
            opset_version=_OPSET,
            input_names=list(names),
            output_names=list(outputs),
            dynamo=False,
            dynamic_axes={name: {0: "n", 2: f"h_{name}", 3: f"w_{name}"} for name in names},
        )
    os.replace(unfinished, path)
