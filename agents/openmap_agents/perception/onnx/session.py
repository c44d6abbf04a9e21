"""An ONNX file -> something that can be run, or one clear error that says what is wrong with the file.

Exports of one model differ in small things: what a tensor is called, float16 or float32, int32 or int64 tokens, which axes are
free. A caller says what it needs as named :class:`Port`\\ s; :func:`open_model` finds them in the file, and :meth:`Model.run` takes
and gives arrays by the caller's own names, converted to and from the file's types::

    model = open_model(
        path,
        inputs={"pixel_values": Port(4)},
        outputs={"image_embeds": Port(2, aliases=("embeddings", "output"))},
        expected="an image tower",
    )
    vectors = model.run(pixel_values=pixels)["image_embeds"]

Where a file's layout is not known before it is looked at, :func:`load` opens it, and :meth:`File.bind` finds the ports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnxruntime  # type: ignore[import-untyped,unused-ignore]

from openmap_scenes import DataError

PROVIDERS = ("CUDAExecutionProvider", "CPUExecutionProvider")
"""What a model is run on, best first; the ones this machine lacks are left out."""

_TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
    "tensor(uint8)": np.uint8,
    "tensor(bool)": np.bool_,
}
_KINDS = {"float": "f", "int": "iu", "any": "fiub"}


@dataclass(frozen=True)
class Port:
    """What an input or output must look like.

    Parameters
    ----------
    rank : int or tuple of int
        Number of axes, or the numbers it may have.
    aliases : tuple of str
        Other names it goes by, most common first.
    kind : {"float", "int", "any"}
        float16, float32 and float64 are all "float": arrays are converted.
    optional : bool
        It may be missing.
    unnamed : bool
        Where no name fits, the only tensor left of that rank and kind will do.
    """

    rank: int | tuple[int, ...]
    aliases: tuple[str, ...] = ()
    kind: str = "float"
    optional: bool = False
    unnamed: bool = False

    @property
    def ranks(self) -> tuple[int, ...]:
        """The numbers of axes it may have."""
        return (self.rank,) if isinstance(self.rank, int) else self.rank


@dataclass(frozen=True)
class Tensor:
    """An input or output as the file declares it; ``shape`` has None where an axis is free."""

    name: str
    type: str
    shape: tuple[int | None, ...]

    @property
    def dtype(self) -> np.dtype[Any] | None:
        """Its dtype, None for what numpy arrays cannot stand for (strings, sequences)."""
        return np.dtype(_TYPES[self.type]) if self.type in _TYPES else None

    def fits(self, port: Port) -> bool:
        """Whether rank and kind are those of the port."""
        # A file may leave an output's shape unsaid, which reads as rank 0.
        rank = len(self.shape) in port.ranks or not self.shape
        return rank and self.dtype is not None and self.dtype.kind in _KINDS[port.kind]

    def __str__(self) -> str:
        axes = ", ".join("?" if n is None else str(n) for n in self.shape)
        return f"{self.name} ({axes}) {self.dtype or self.type}"


@dataclass(frozen=True)
class File:
    """An ONNX file that onnxruntime can run, with its inputs and outputs as declared.

    Parameters
    ----------
    path : Path
    inputs, outputs : tuple of Tensor
    metadata : dict
        What the exporter wrote beside the graph, such as YOLO's ``imgsz``.
    """

    path: Path
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    metadata: dict[str, str]
    session: Any = field(repr=False)

    def has(self, *names: str) -> bool:
        """Whether all the names are inputs of the file."""
        return set(names) <= {t.name for t in self.inputs}

    def __str__(self) -> str:
        return f"inputs {_listed(self.inputs)} and outputs {_listed(self.outputs)}"

    def bind(self, inputs: Mapping[str, Port], outputs: Mapping[str, Port], expected: str) -> Model:
        """The file as a model with these ports.

        Parameters
        ----------
        inputs, outputs : {name: Port}
            By the caller's names, which are looked for first. The file may have more outputs, but no more inputs.
        expected : str
            What the file should be, for the error: "the decoder of a Segment Anything export".

        Raises
        ------
        DataError
            An input or output that is missing, has another rank or kind, or an input that nothing is known of.
        """
        found_in, found_out = _match(self.inputs, inputs), _match(self.outputs, outputs)
        unknown = [t for t in self.inputs if t not in found_in.values()]
        if any(n not in found_in and not p.optional for n, p in inputs.items()) or unknown:
            raise self._mismatch(inputs, outputs, expected)
        if any(n not in found_out and not p.optional for n, p in outputs.items()):
            raise self._mismatch(inputs, outputs, expected)
        return Model(self, found_in, found_out)

    def _mismatch(self, inputs: Mapping[str, Port], outputs: Mapping[str, Port], expected: str) -> DataError:
        return DataError(
            self.path,
            str(self),
            f"{expected} with inputs {_wanted(inputs)} and outputs {_wanted(outputs)}",
            "Name the file of such a model, or export it again in that layout.",
        )


@dataclass(frozen=True)
class Model:
    """A file whose inputs and outputs go by the caller's names.

    Parameters
    ----------
    file : File
    inputs, outputs : {name: Tensor}
        The caller's name -> the tensor of the file. Optional ones that are missing are not there.
    """

    file: File
    inputs: dict[str, Tensor]
    outputs: dict[str, Tensor]

    @property
    def path(self) -> Path:
        """Where it was read from."""
        return self.file.path

    @property
    def metadata(self) -> dict[str, str]:
        """What the exporter wrote beside the graph."""
        return self.file.metadata

    @property
    def provider(self) -> str:
        """What it runs on, such as "CPUExecutionProvider"."""
        return str(self.file.session.get_providers()[0])

    def axis(self, name: str, axis: int) -> int | None:
        """The declared length of an axis of an input or output, None where it is free."""
        shape = (self.inputs.get(name) or self.outputs[name]).shape
        return shape[axis] if shape else None

    def run(self, **arrays: npt.ArrayLike) -> dict[str, npt.NDArray[Any]]:
        """Outputs of arrays, both by the caller's names.

        Inputs are converted to the file's types (an array for an optional input that the file lacks is ignored); floating outputs
        come as float32.

        Raises
        ------
        DataError
            The model refuses the shapes, or runs out of memory.
        """
        feed = {t.name: np.ascontiguousarray(arrays[n], dtype=t.dtype) for n, t in self.inputs.items()}
        try:
            results = self.file.session.run([t.name for t in self.outputs.values()], feed)
        except Exception as error:  # onnxruntime raises a dozen types of its own, with no base but Exception
            shapes = ", ".join(f"{n} {a.shape}" for n, a in feed.items())
            raise DataError(
                self.path,
                f"that it cannot be run on {shapes} ({_first_line(error)})",
                "a model that takes these shapes",
                "Export it again with the axes of batch and size free.",
            ) from error
        return {
            n: r.astype(np.float32, copy=False) if r.dtype.kind == "f" else r
            for n, r in zip(self.outputs, results, strict=True)
        }


def open_model(
    path: str | Path, inputs: Mapping[str, Port], outputs: Mapping[str, Port], expected: str, *, threads: int = 1
) -> Model:
    """A model with these ports from an ONNX file; arguments and errors as of :func:`load` and :meth:`File.bind`."""
    return load(path, expected, threads=threads).bind(inputs, outputs, expected)


def load(path: str | Path, expected: str, *, threads: int = 1) -> File:
    """An ONNX file, opened.

    Parameters
    ----------
    path : path
        The ``.onnx`` file. Weights that it keeps in a file beside itself must lie there.
    expected : str
        What it should be, for the error.
    threads : int
        On CPU; the result does not depend on the machine's number of cores.

    Raises
    ------
    DataError
        No such file, not a file, or not a whole ONNX model.
    ValueError
        ``threads`` below 1.
    """
    if threads < 1:
        raise ValueError(f"threads is {threads}, expected at least 1")
    path = Path(path)
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file"
        raise DataError(path, found, f"an ONNX file, {expected}", "Check the path of the spec.")
    try:
        session = onnxruntime.InferenceSession(str(path), _options(threads), providers=_providers())
    except Exception as error:
        raise DataError(
            path,
            f"{path.stat().st_size} bytes that are no whole ONNX model ({_first_line(error)})",
            f"an ONNX file, {expected}",
            "Copy or export the file again, with its weights file beside it if it has one.",
        ) from error
    metadata = dict(session.get_modelmeta().custom_metadata_map)
    return File(path, _declared(session.get_inputs()), _declared(session.get_outputs()), metadata, session)


def _options(threads: int) -> Any:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.use_deterministic_compute = True
    options.log_severity_level = 4  # what is wrong is said once, by the error
    return options


def _providers() -> list[Any]:
    settings = {"CUDAExecutionProvider": {"cudnn_conv_algo_search": "DEFAULT", "use_tf32": "0"}}
    there = onnxruntime.get_available_providers()
    return [(p, settings.get(p, {})) for p in PROVIDERS if p in there]


def _declared(arguments: Any) -> tuple[Tensor, ...]:
    return tuple(
        Tensor(a.name, a.type, tuple(n if isinstance(n, int) and n > 0 else None for n in a.shape or ()))
        for a in arguments
    )


def _match(tensors: tuple[Tensor, ...], ports: Mapping[str, Port]) -> dict[str, Tensor]:
    """Caller's name -> tensor, by name first and then, where that is allowed, by being the only one left that fits."""
    by_name = {t.name: t for t in tensors}
    found: dict[str, Tensor] = {}
    for name, port in ports.items():
        candidates = [by_name[n] for n in (name, *port.aliases) if n in by_name and by_name[n].fits(port)]
        if candidates:
            found[name] = candidates[0]
    for name, port in ports.items():
        left = [t for t in tensors if t not in found.values() and t.fits(port)]
        if name not in found and port.unnamed and len(left) == 1:
            found[name] = left[0]
    return {name: found[name] for name in ports if name in found}


def _listed(tensors: tuple[Tensor, ...]) -> str:
    return "[" + "; ".join(map(str, tensors)) + "]"


def _wanted(ports: Mapping[str, Port]) -> str:
    def one(name: str, port: Port) -> str:
        names = "/".join((name, *port.aliases))
        return f"{names} of {' or '.join(map(str, port.ranks))} axes{', optional' if port.optional else ''}"

    return "[" + "; ".join(one(n, p) for n, p in ports.items()) + "]"


def _first_line(error: Exception) -> str:
    line = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return line if len(line) <= 200 else line[:197] + "..."
