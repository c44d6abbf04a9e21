"""A folder with an exported CLIP or SigLIP -> where its parts lie and what its own files say of them.

Three layouts are known: Hugging Face's (Optimum, transformers.js: ``onnx/vision_model.onnx`` and ``onnx/text_model.onnx``, or one
``model.onnx``, in ``onnx/`` or the folder itself, beside ``config.json``, ``preprocessor_config.json`` and the tokenizer); the same
towers beside an ``open_clip_config.json``; and OpenCLIP's towers in ``visual/`` and ``textual/``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from openmap_agents.perception.onnx.preprocessing import Preprocessing, from_open_clip, from_transformers
from openmap_agents.perception.onnx.tokens import Tokens, load_tokens, read_json
from openmap_scenes import DataError

PRECISIONS = ("", "_fp16", "_int8", "_uint8", "_quantized")
"""What exporters add to a file's name, the best first."""

_FIRST_SCALE = 1 / 0.07  # where CLIP's training starts, which configs repeat whatever was learnt
_LAST_SCALE = 100.0  # where CLIP's training holds it (Radford et al. 2021, section 2.5), and published models stand
_REMEDY = "Copy the file again from where the model was published."


@dataclass(frozen=True)
class ClipFiles:
    """What a folder says of its model.

    Parameters
    ----------
    folder : Path
    siglip : bool
        Trained with a sigmoid, which has a bias, and not with a softmax.
    open_clip : bool
        Exported from OpenCLIP, whose exporters agree on no names: the only output of a tower is its vector.
    vision, text : Path, optional
        The towers; both or none.
    combined : Path, optional
        Both in one file.
    preprocessing : Preprocessing
    tokens : Tokens
    patch : int, optional
        Pixels of a patch's edge, where the image tower is a plain ViT.
    logit : (float, float or None), optional
        Factor of the cosine and what is added, as learnt; None where only running the combined file can tell.
    """

    folder: Path
    siglip: bool
    open_clip: bool
    vision: Path | None
    text: Path | None
    combined: Path | None
    preprocessing: Preprocessing
    tokens: Tokens
    patch: int | None
    logit: tuple[float, float | None] | None


def read_clip_folder(folder: str | Path) -> ClipFiles:
    """Find and read everything but the networks.

    Raises
    ------
    DataError
        A file is missing, damaged, or of a kind of model that is not known here.
    """
    folder = Path(folder)
    if not folder.is_dir():
        found = "a file" if folder.exists() else "no such folder"
        raise DataError(folder, found, "a folder with an exported CLIP or SigLIP", "Check the path of the spec.")
    path = folder / "open_clip_config.json"
    config = read_json(path, optional=True) or read_json(folder / "config.json")
    if not path.is_file():
        path = folder / "config.json"
    vision, text, combined = _networks(folder)
    if "model_cfg" in config or {"embed_dim", "vision_cfg", "text_cfg"} <= set(config):
        return _open_clip(folder, path, config, (vision, text, combined))
    kind = config.get("model_type")
    if kind not in ("clip", "siglip", "siglip2"):
        expected = "clip, siglip, siglip2 (of one picture size) or OpenCLIP's own configuration"
        raise DataError(path, f"model_type {kind!r}", expected, "Other kinds of models are not known here.")
    siglip = kind != "clip"
    words, looks = _part(config, "text_config", path), _part(config, "vision_config", path)
    positions = _count(words, "max_position_embeddings", path, 64 if siglip else 77)
    return ClipFiles(
        folder,
        siglip,
        False,
        vision,
        text,
        combined,
        _preprocessing(folder, siglip),
        load_tokens(folder, positions=positions, pad="</s>" if siglip else "<|endoftext|>", lower=siglip),
        _count(looks, "patch_size", path, 16 if siglip else 32),
        _learnt(folder, path, config, siglip, combined),
    )


def _open_clip(
    folder: Path, path: Path, config: Mapping[str, Any], networks: tuple[Path | None, Path | None, Path | None]
) -> ClipFiles:
    model = _part(config, "model_cfg", path) if "model_cfg" in config else config
    words, looks = _part(model, "text_cfg", path), _part(model, "vision_cfg", path)
    siglip = model.get("init_logit_bias") is not None
    prepared = folder / "visual" / "preprocess_cfg.json"
    if "preprocess_cfg" in config:
        preprocessing = from_open_clip(_part(config, "preprocess_cfg", path), path, looks.get("image_size", 224))
    elif prepared.is_file():
        preprocessing = from_open_clip(read_json(prepared), prepared, looks.get("image_size", 224))
    else:
        preprocessing = _preprocessing(folder, siglip)
    clean = _part(words, "tokenizer_kwargs", path).get("clean")
    # OpenCLIP's own tokenizer fills up with 0, and a tower without a causal mask sees what it is filled up with.
    pad: str | int = "</s>" if siglip else "<|endoftext|>" if words.get("hf_tokenizer_name") else 0
    tokens = load_tokens(
        folder if (folder / "tokenizer.json").is_file() or not (folder / "textual").is_dir() else folder / "textual",
        positions=_count(words, "context_length", path, 77),
        pad=pad,
        lower=siglip or clean in ("lower", "canonicalize"),
        bare=clean == "canonicalize",
    )
    renamed = {"logit_scale_init_value": model.get("init_logit_scale")} | {
        k: v for k, v in config.items() if k in ("logit_scale", "logit_bias")
    }
    plain = "patch_size" in looks or "timm_model_name" not in looks
    patch = _count(looks, "patch_size", path, 16) if plain and not isinstance(looks.get("layers"), list) else None
    logit = _learnt(folder, path, {k: v for k, v in renamed.items() if v is not None}, siglip, networks[2])
    return ClipFiles(folder, siglip, True, *networks, preprocessing, tokens, patch, logit)


def _networks(folder: Path) -> tuple[Path | None, Path | None, Path | None]:
    """The image tower, the text tower, and the file that has both."""

    def first(*names: str) -> Path | None:
        paths = [folder / name.format(p) for p in PRECISIONS for name in names]
        return next((path for path in paths if path.is_file()), None)

    vision = first("onnx/vision_model{}.onnx", "vision_model{}.onnx", "visual/model{}.onnx")
    text = first("onnx/text_model{}.onnx", "text_model{}.onnx", "textual/model{}.onnx")
    combined = first("onnx/model{}.onnx", "model{}.onnx")
    if combined is None and (vision is None or text is None):
        missing = "vision_model.onnx" if vision is None else "text_model.onnx"
        other = "text_model.onnx" if vision is None else "vision_model.onnx"
        raise DataError(
            folder / "onnx" / missing,
            "no such file",
            f"{missing} and {other}, or model.onnx, in the folder or its onnx/",
            "Export both towers, for example with Optimum.",
        )
    return (vision, text, combined) if vision and text else (None, None, combined)


def _preprocessing(folder: Path, siglip: bool) -> Preprocessing:
    """Of ``preprocessor_config.json``, or of ``processor_config.json`` that newer transformers write."""
    path, newer = folder / "preprocessor_config.json", folder / "processor_config.json"
    if not path.is_file() and newer.is_file():
        return from_transformers(_part(read_json(newer), "image_processor", newer), newer, siglip=siglip)
    return from_transformers(read_json(path), path, siglip=siglip)


def _learnt(
    folder: Path, path: Path, config: Mapping[str, Any], siglip: bool, combined: Path | None
) -> tuple[float, float | None] | None:
    """Factor and addend of the cosine, from the first of: ``logit_scale`` and ``logit_bias`` (as trained: the factor's logarithm)
    of the configuration; of ``model.safetensors``; the combined network (None, it has to be run); ``logit_scale_init_value``, or
    100 where that is where every CLIP's training starts.
    """
    found = {k: config[k] for k in ("logit_scale", "logit_bias") if k in config} or _tensors(folder)
    if "logit_scale" in found and (not siglip or "logit_bias" in found):
        scale, bias = (_logit(found.get(k, 0.0), k, path) for k in ("logit_scale", "logit_bias"))
        return float(np.exp(scale)), bias if siglip else None
    if combined is not None:
        return None
    if siglip:
        raise DataError(
            path,
            "no learnt logit_scale and logit_bias",
            "both in it, or model.safetensors or the combined model.onnx beside it",
            "Copy one of these files too, or write the two numbers of the trained model into the configuration.",
        )
    first = float(
        np.exp(_logit(config.get("logit_scale_init_value", np.log(_FIRST_SCALE)), "logit_scale_init_value", path))
    )
    return (_LAST_SCALE if abs(first - _FIRST_SCALE) < 0.01 * _FIRST_SCALE else first), None


def _tensors(folder: Path) -> dict[str, float]:
    """``logit_scale`` and ``logit_bias`` of the folder's ``model.safetensors`` or OpenCLIP's, where there is one."""
    from safetensors import SafetensorError, safe_open

    for name in ("model.safetensors", "open_clip_model.safetensors"):
        path = folder / name
        if not path.is_file():
            continue
        try:
            with safe_open(path, framework="numpy") as file:
                there = [k for k in ("logit_scale", "logit_bias") if k in file.keys()]  # noqa: SIM118 - it is no mapping
                return {k: float(np.asarray(file.get_tensor(k), np.float64).reshape(-1)[0]) for k in there}
        except (SafetensorError, OSError, TypeError, IndexError) as error:
            raise DataError(path, f"no readable weights ({error})", "safetensors with logit_scale", _REMEDY) from error
    return {}


def _logit(value: object, name: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or abs(value) > 50:
        raise DataError(path, f"{name} {value!r}", "a number as trained, such as 4.6", _REMEDY)
    return float(value)


def _part(config: Mapping[str, Any], name: str, path: Path) -> Mapping[str, Any]:
    """An object inside a configuration, {} where there is none."""
    value = config.get(name) or {}
    if not isinstance(value, Mapping):
        raise DataError(path, f"{name} of a {type(value).__name__}", "an object", _REMEDY)
    return value


def _count(config: Mapping[str, Any], name: str, path: Path, default: int) -> int:
    value = config.get(name, default)
    if type(value) is not int or value < 1:
        raise DataError(path, f"{name} {value!r}", "a number of at least 1", _REMEDY)
    return value
