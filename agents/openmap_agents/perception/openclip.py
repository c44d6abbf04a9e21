"""OpenCLIP's models on torch: ``openclip:ARCH/tag``, ``openclip:ARCH//path/to/weights.safetensors``, ``openclip:/folder``.

A tag (``ViT-H-14/laion2b_s32b_b79k``) is fetched by the package ``open_clip`` from the hub that it names, once, into its cache.
A file holds weights of a built-in architecture, a folder an ``open_clip_config.json``, weights and, where the model needs one, a
tokenizer; neither asks a hub. Weights are read as tensors only: a ``.pt`` that would run code is refused.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from openmap_agents.perception.crop_encoder import CropEncoder
from openmap_agents.perception.crops import Crops
from openmap_scenes import DataError

WEIGHTS = (".safetensors", ".pt", ".pth", ".bin")
_EXPECTED = "openclip:ARCH/tag, openclip:ARCH//path/to/weights.safetensors or openclip:/folder"


class OpenClipEncoder(CropEncoder):
    """Image and text towers of ``open_clip``, on CUDA where torch has it.

    Parameters
    ----------
    name : str
        "ARCH/tag", "ARCH//path/to/weights", or the path of a folder.
    crops : Crops
        How regions are cut out.
    batch : int
        Pictures or texts at once.
    template : str
        What a text is put into.
    remembered : int
        Texts whose vectors are kept.
    device : str, optional
        As torch calls it.

    Raises
    ------
    DataError
        The package is not installed; no such architecture, tag, file or folder; weights that do not fit or cannot be fetched.
    """

    def __init__(
        self,
        name: str,
        *,
        crops: Crops = Crops(),  # noqa: B008 - it is frozen
        batch: int = 16,
        template: str = "{}",
        remembered: int = 4096,
        device: str | None = None,
    ) -> None:
        super().__init__(crops, batch, template, remembered)
        open_clip = _open_clip(name)
        import torch

        self._device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        model, weights, quick_gelu = _chosen(open_clip, name)
        with _one_error(name, weights):
            self._model, self._prepare = open_clip.create_model_from_pretrained(
                model, pretrained=weights, device=self._device, force_quick_gelu=quick_gelu, weights_only=True
            )
            self._tokenizer = open_clip.get_tokenizer(model)
            self._model.eval()
            self.dim = self._text_tower([""]).shape[1]

    def _image_tower(self, pictures: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.float32]:
        import torch

        pixels = torch.stack([self._prepare(Image.fromarray(picture)) for picture in pictures])
        with torch.inference_mode():
            return np.asarray(self._model.encode_image(pixels.to(self._device)).float().cpu(), np.float32)

    def _text_tower(self, texts: list[str]) -> npt.NDArray[np.float32]:
        import torch

        with torch.inference_mode():
            tokens = self._tokenizer(texts).to(self._device)
            return np.asarray(self._model.encode_text(tokens).float().cpu(), np.float32)

    def _logit(self) -> tuple[float, float | None]:
        bias = getattr(self._model, "logit_bias", None)
        return float(self._model.logit_scale.detach().exp()), None if bias is None else float(bias.detach())


def _open_clip(name: str) -> Any:
    """The package, with torchvision importable before it asks for it."""
    try:
        from openmap_agents.perception.torchvision_import import import_torchvision

        import_torchvision()
        return importlib.import_module("open_clip")
    except (ImportError, RuntimeError) as error:
        raise DataError(
            f"openclip:{name}",
            f"no usable package open_clip ({error})",
            "it installed",
            "pip install 'openmap-nav[clip]'",
        ) from error


def _chosen(open_clip: Any, name: str) -> tuple[str, str | None, bool]:
    """What open_clip calls the model and its weights, and whether these were trained with the quick GELU."""
    if name.startswith(("/", "./", "../", "~")):
        return f"local-dir:{_folder(name)}", None, False
    architecture, _, weights = name.partition("/")
    config = open_clip.get_model_config(architecture)
    if config is None:
        known = [m for m in open_clip.list_models() if m.lower() == architecture.lower()]
        found = f"no architecture {architecture!r} in open_clip {open_clip.__version__}"
        remedy = f"Did you mean {known[0]}?" if known else "open_clip.list_models() lists them, such as ViT-H-14."
        raise DataError(f"openclip:{name}", found, _EXPECTED, remedy)
    if weights.endswith(WEIGHTS) or "/" in weights:
        path = Path(weights).expanduser()
        if not path.is_file() or path.suffix not in WEIGHTS:
            found = "no such file" if not path.is_file() else f"a {path.suffix or 'nameless'} file"
            raise DataError(
                path, found, f"weights of {architecture}: {', '.join(WEIGHTS)}", "Check the path of the spec."
            )
        _needs_no_hub(config, path)
        return architecture, str(path), False
    tags = open_clip.list_pretrained_tags_by_model(architecture)
    tag = open_clip.get_pretrained_cfg(architecture, weights) if weights else {}
    if not tag:
        found = f"no weights {weights!r} of {architecture} in open_clip {open_clip.__version__}"
        raise DataError(
            f"openclip:{name}", found, f"one of {', '.join(tags) or 'none, or a file'}", f"Name {_EXPECTED}."
        )
    return architecture, weights, bool(tag.get("quick_gelu", False))


def _folder(name: str) -> Path:
    from openmap_agents.perception.onnx.tokens import read_json

    folder = Path(name).expanduser()
    if not folder.is_dir():
        found = "a file" if folder.exists() else "no such folder"
        raise DataError(folder, found, "a folder with an OpenCLIP model", f"Name {_EXPECTED}.")
    path = folder / "open_clip_config.json"
    config = read_json(path)
    if not isinstance(config.get("model_cfg"), dict):
        raise DataError(
            path, "no model_cfg", "OpenCLIP's own configuration", "Copy it again from where it was published."
        )
    if not any(p.suffix in WEIGHTS for p in folder.iterdir()):
        raise DataError(
            folder, "no weights", "open_clip_model.safetensors", "Copy it from where the model was published."
        )
    _needs_no_hub(config["model_cfg"], path, tokenizer=(folder / "tokenizer.json").is_file())
    return folder


def _needs_no_hub(config: dict[str, Any], path: Path, *, tokenizer: bool = False) -> None:
    """DataError where open_clip would fetch a part of a model that is on disk."""
    text = config.get("text_cfg") or {}
    needed = text.get("hf_model_name") or (not tokenizer and text.get("hf_tokenizer_name"))
    if needed:
        raise DataError(
            path,
            f"a model whose words need {needed} from a hub",
            "all of it on disk",
            "Name a folder with open_clip_config.json, the weights and tokenizer.json, or one of open_clip's tags.",
        )


@contextmanager
def _one_error(name: str, weights: str | None) -> Iterator[None]:
    """Whatever open_clip, torch and the hub's client raise, as one DataError, which alone says it: nothing is logged beside it."""
    disabled = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    except Exception as error:  # network, hub, unpickling, shapes: a dozen types with no base but Exception
        line = f"{type(error).__name__}: {' '.join(str(error).split())}"[:300]
        local = weights is None or Path(weights).is_file()
        remedy = (
            "Copy the weights again, or name the architecture that they are of."
            if local
            else "The weights come from a hub: connect once, or name a file: openclip:ARCH//path/to/weights.safetensors."
        )
        expected = "whole weights of that architecture, as tensors" if local else "weights that can be fetched"
        raise DataError(f"openclip:{name}", f"no usable weights ({line})", expected, remedy) from error
    finally:
        logging.disable(disabled)
