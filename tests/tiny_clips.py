"""Tiny CLIP and SigLIP with random weights, exported the way published folders are laid out."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from tokenizers import Tokenizer, models, normalizers, pre_tokenizers, processors

from openmap_agents.perception.torchvision_import import import_torchvision

# transformers imports torchvision where it is installed, whether or not that fits torch.
with contextlib.suppress(ImportError):
    import_torchvision()

from transformers import CLIPConfig, CLIPModel, CLIPTokenizer, PreTrainedTokenizerFast, SiglipConfig, SiglipModel
from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil
from transformers.models.siglip.image_processing_pil_siglip import SiglipImageProcessorPil

SIZE, PATCH = 32, 8
_TOWER = {"hidden_size": 32, "intermediate_size": 48, "num_hidden_layers": 2, "num_attention_heads": 2}


def clip_tokenizer() -> CLIPTokenizer:
    """Letters as bytes, a few merges, CLIP's own two special tokens."""
    letters = [chr(c) for c in range(33, 127)]
    merges = [("c", "h"), ("a", "i"), ("ch", "ai"), ("chai", "r</w>")]
    pieces = [*letters, *(c + "</w>" for c in letters), *("".join(m) for m in merges)]
    vocab = {p: i for i, p in enumerate([*pieces, "<|startoftext|>", "<|endoftext|>"])}
    return CLIPTokenizer(vocab, merges, model_max_length=77)


def siglip_tokenizer() -> PreTrainedTokenizerFast:
    """Pieces of words, ``</s>`` at the end and as padding."""
    pieces = ["</s>", "<unk>", "▁", "▁a", "▁the", "chair", "▁chair", *(chr(c) for c in range(97, 123))]
    tokenizer = Tokenizer(models.Unigram([(p, -float(i) / 8 - 1) for i, p in enumerate(pieces)], unk_id=1))
    tokenizer.normalizer = normalizers.Sequence([normalizers.Lowercase(), normalizers.Strip()])
    tokenizer.pre_tokenizer = pre_tokenizers.Metaspace()
    tokenizer.post_processor = processors.TemplateProcessing("$A </s>", special_tokens=[("</s>", 0)])
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, eos_token="</s>", pad_token="</s>", unk_token="<unk>", model_max_length=16
    )


def clip_model(seed: int = 0) -> CLIPModel:
    """A CLIPModel whose learnt scale is not the one of its config."""
    torch.manual_seed(seed)
    tokenizer = clip_tokenizer()
    text = {**_TOWER, "vocab_size": len(tokenizer), "max_position_embeddings": 77}
    text |= {"eos_token_id": tokenizer.eos_token_id, "bos_token_id": tokenizer.bos_token_id}
    vision = {**_TOWER, "image_size": SIZE, "patch_size": PATCH}
    model = CLIPModel(CLIPConfig(text_config=text, vision_config=vision, projection_dim=24)).eval()
    _shake(model)
    torch.nn.init.constant_(model.logit_scale, 3.5)
    return model


def siglip_model(seed: int = 0) -> SiglipModel:
    """A SiglipModel with a scale and a bias."""
    torch.manual_seed(seed)
    text = {**_TOWER, "vocab_size": len(siglip_tokenizer()), "max_position_embeddings": 16, "projection_size": 32}
    vision = {**_TOWER, "image_size": SIZE, "patch_size": PATCH}
    model = SiglipModel(SiglipConfig(text_config=text, vision_config=vision)).eval()
    _shake(model)
    torch.nn.init.constant_(model.logit_scale, 2.0)
    torch.nn.init.constant_(model.logit_bias, -3.0)
    return model


def _shake(model: torch.nn.Module) -> None:
    """Weights large enough that every part of the model shows in its output."""
    for parameter in model.parameters():
        torch.nn.init.normal_(parameter, std=0.5)


def images_of(model: Any, pixels: torch.Tensor) -> torch.Tensor:
    """What the torch model makes of pixels."""
    return model.get_image_features(pixel_values=pixels).pooler_output


def texts_of(model: Any, **tokens: torch.Tensor) -> torch.Tensor:
    """What the torch model makes of tokens."""
    return model.get_text_features(**tokens).pooler_output


class _Vision(torch.nn.Module):
    def __init__(self, model: Any, hidden: bool) -> None:
        super().__init__()
        self.model, self.hidden = model, hidden

    def forward(self, pixels: torch.Tensor) -> Any:
        out = self.model.get_image_features(pixel_values=pixels)
        return (out.pooler_output, out.last_hidden_state) if self.hidden else out.pooler_output


class _Text(torch.nn.Module):
    def __init__(self, model: Any) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tokens: torch.Tensor) -> torch.Tensor:
        names = ("input_ids", "attention_mask")
        return texts_of(self.model, **dict(zip(names, tokens, strict=False)))


class _Both(torch.nn.Module):
    def __init__(self, model: Any) -> None:
        super().__init__()
        self.model = model

    def forward(self, ids: torch.Tensor, pixels: torch.Tensor, mask: torch.Tensor) -> Any:
        out = self.model(input_ids=ids, pixel_values=pixels, attention_mask=mask)
        return out.logits_per_image, out.logits_per_text, out.text_embeds, out.image_embeds


def export(
    model: Any,
    folder: Path,
    *,
    combined: bool = False,
    fixed: int | None = None,
    hidden: bool = True,
    sub: str = "onnx",
) -> None:
    """Write the networks: towers or one file, with free batch axes or ``fixed`` ones, in the subfolder ``sub``."""
    siglip = isinstance(model, SiglipModel)
    length, at, n = (16 if siglip else 77), folder / sub, fixed or 2
    at.mkdir(parents=True, exist_ok=True)
    ids, mask = torch.ones((n, length), dtype=torch.int64), torch.ones((n, length), dtype=torch.int64)
    if not siglip:
        ids[:, 5] = model.config.text_config.eos_token_id
    pixels = torch.zeros((n, 3, SIZE, SIZE))
    vector = ("pooler_output", "pooler_output") if siglip else ("image_embeds", "text_embeds")
    if combined:
        outputs = ["logits_per_image", "logits_per_text", "text_embeds", "image_embeds"]
        _write(
            _Both(model),
            (ids, pixels, mask),
            at / "model.onnx",
            ["input_ids", "pixel_values", "attention_mask"],
            outputs,
            fixed,
        )
        return
    names = [vector[0], "last_hidden_state"] if hidden else [vector[0]]
    _write(_Vision(model, hidden), (pixels,), at / "vision_model.onnx", ["pixel_values"], names, fixed)
    texts, inputs = ((ids,), ["input_ids"]) if siglip else ((ids, mask), ["input_ids", "attention_mask"])
    _write(_Text(model), texts, at / "text_model.onnx", inputs, [vector[1]], fixed)


def _write(
    module: torch.nn.Module, args: tuple[Any, ...], path: Path, inputs: list[str], outputs: list[str], fixed: int | None
) -> None:
    axes = {
        n: {0: "image_batch" if n in ("pixel_values", "image_embeds", "last_hidden_state") else "batch"}
        for n in inputs + outputs
    }
    if "logits_per_image" in outputs:
        axes |= {"logits_per_image": {0: "image_batch", 1: "batch"}, "logits_per_text": {0: "batch", 1: "image_batch"}}
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            args,
            str(path),
            input_names=inputs,
            output_names=outputs,
            dynamic_axes=None if fixed else axes,
            dynamo=False,
            opset_version=17,
        )


def processor(siglip: bool) -> Any:
    """The image processor of transformers, of the tiny models' size."""
    if siglip:
        return SiglipImageProcessorPil(size={"height": SIZE, "width": SIZE})
    return CLIPImageProcessorPil(size={"shortest_edge": SIZE}, crop_size={"height": SIZE, "width": SIZE})


def write_settings(model: Any, folder: Path) -> None:
    """The files beside the networks, as transformers writes them."""
    siglip = isinstance(model, SiglipModel)
    folder.mkdir(parents=True, exist_ok=True)
    model.config.save_pretrained(folder)
    (siglip_tokenizer() if siglip else clip_tokenizer()).save_pretrained(folder)
    (folder / "preprocessor_config.json").write_text(json.dumps(processor(siglip).to_dict()))


SIZES = [(33, 61), (100, 40), (7, 9), (64, 64), (32, 31)]


def pictures(seed: int = 0, sizes: list[tuple[int, int]] = SIZES) -> list[npt.NDArray[np.uint8]]:
    """Coloured ramps under noise: alike neither from far nor from near."""
    rng, made = np.random.default_rng(seed), []
    for h, w in sizes:
        ends = rng.uniform(0, 255, (2, 2, 3))
        rows, columns = np.linspace(0, 1, h)[:, None, None], np.linspace(0, 1, w)[None, :, None]
        ramp = rows * (columns * ends[0, 0] + (1 - columns) * ends[0, 1]) + (1 - rows) * (
            columns * ends[1, 0] + (1 - columns) * ends[1, 1]
        )
        made.append(np.clip(ramp + rng.normal(0, 30, (h, w, 3)), 0, 255).astype(np.uint8))
    return made


def open_clip_or_skip() -> Any:
    """The package, made importable beside any torch; it is an extra, and not there on every machine."""
    if importlib.util.find_spec("open_clip") is None or importlib.util.find_spec("torchvision") is None:
        pytest.skip("open_clip is not installed: pip install 'openmap-nav[clip]'")
    from openmap_agents.perception.torchvision_import import import_torchvision

    import_torchvision()
    return importlib.import_module("open_clip")
