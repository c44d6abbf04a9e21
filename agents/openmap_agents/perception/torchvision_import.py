"""``import torchvision`` beside a torch that its wheel was not built for.

Package registries carry the torchvision wheel that was built for the CUDA build of torch. Beside the CPU build its library of C++
operators cannot be loaded, which torchvision allows; but its import also registers shapes of two of them (``nms``, ``qnms``) with
torch, which fails with "operator torchvision::nms does not exist" where they were never declared. open_clip and timm need
torchvision's transforms and layers, which are Python, and none of these operators. So they are declared here, without anything
behind them: calling one still fails, with torchvision's own message that its operators could not be loaded.
"""

from __future__ import annotations

import importlib
import re
import sys
from types import ModuleType
from typing import Any

_MISSING = re.compile(r"operator torchvision::(\w+) does not exist")
_SCHEMAS = {
    "nms": "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
    "qnms": "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
}
_declared: list[Any] = []  # torch forgets declarations whose library is collected


def import_torchvision() -> ModuleType:
    """torchvision, with the operators declared that its import asks for and that could not be loaded.

    Does nothing but import where torchvision fits torch, or was imported before.

    Raises
    ------
    ImportError
        It is not installed.
    RuntimeError
        It fails for another reason.
    """
    try:
        return importlib.import_module("torchvision")
    except RuntimeError as error:
        if _MISSING.search(str(error)) is None:
            raise
    import torch

    library: Any = torch.library.Library("torchvision", "FRAGMENT")  # type: ignore[no-untyped-call]
    _declared.append(library)
    for name, schema in _SCHEMAS.items():
        library.define(name + schema)
    # What was imported on the way to the failure would stay half made.
    for name in [name for name in sys.modules if name.split(".")[0] == "torchvision"]:
        del sys.modules[name]
    return importlib.import_module("torchvision")
