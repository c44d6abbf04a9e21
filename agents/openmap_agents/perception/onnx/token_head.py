"""The end of an image tower, cut out of its graph: what turns tokens into a vector among the words.

An exported tower gives ``last_hidden_state``, one token a patch, and the picture's vector, which the last few nodes make of it: for
CLIP the class token, a norm and a projection, for SigLIP attention over all tokens and a small network. The same nodes, run on
one token alone, say what that patch looks like (for CLIP this is MaskCLIP's reading, ECCV 2022, without its change of the last
attention: the tokens of CLIP know less of their place than its crops do).
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.onnx.session import Model, Port, open_model
from openmap_scenes import DataError

_AT_ONCE = 16


class TokenHead:
    """Tokens one by one -> vectors.

    Parameters
    ----------
    path : Path
        The image tower.
    hidden, vector : str
        Names of its tokens and of the picture's vector.
    shape : (int, int, int)
        Of its tokens as it gives them: pictures, tokens of each, channels.
    batch : int, optional
        Where the tower takes that many pictures and no other number.
    threads : int

    Raises
    ------
    DataError
        The vector is not made of these tokens alone, or the package ``onnx`` is not there.
    """

    def __init__(
        self,
        path: Path,
        hidden: str,
        vector: str,
        shape: tuple[int, int, int],
        *,
        batch: int | None = None,
        threads: int = 1,
    ) -> None:
        self._model = _cut(path, hidden, vector, threads)
        self._batch = batch or _AT_ONCE
        # Where the number of tokens is fixed as well, a token is given that often: attention over copies of it is that over itself.
        for self._copies in (1, shape[1]):
            try:
                self(np.zeros((self._batch, shape[2]), np.float32))
                return
            except DataError as error:
                refused = error
        raise _not_alone(
            path, vector, hidden, f"in a way that takes no single token ({refused.found[:200]})"
        ) from refused

    def __call__(self, tokens: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Vectors (n, D) of tokens (n, C), n >= 1."""
        parts = []
        for start in range(0, len(tokens), self._batch):
            part = tokens[start : start + self._batch]
            filled = np.concatenate([part, np.repeat(part[-1:], self._batch - len(part), axis=0)])
            copies = np.repeat(filled[:, None], self._copies, axis=1)
            parts.append(self._model.run(tokens=copies)["vectors"][: len(part)])
        return np.concatenate(parts)


def _cut(path: Path, hidden: str, vector: str, threads: int) -> Model:
    """The nodes between two tensors of a file, as a model ``tokens`` (n, T, C) -> ``vectors`` (n, D)."""
    try:
        import onnx
    except ImportError as error:
        raise DataError(
            "dense=True",
            "no package onnx",
            "it, to cut the tower's end out of its file",
            "pip install 'openmap-nav[train]'",
        ) from error
    model = onnx.load(str(path))
    graph = model.graph
    made_by = {output: i for i, node in enumerate(graph.node) for output in node.output}
    constants = {i.name for i in graph.initializer} | {""}
    wanted, kept, reached = [vector], set[int](), False
    while wanted:
        name = wanted.pop()
        reached = reached or name == hidden
        if name in constants or name == hidden or made_by.get(name) in kept:
            continue
        if name not in made_by:
            raise _not_alone(path, vector, hidden, f"also of the input {name}")
        kept.add(made_by[name])
        wanted.extend(graph.node[made_by[name]].input)
    if not reached:
        raise _not_alone(path, vector, hidden, "not of these")
    nodes = [graph.node[i] for i in sorted(kept)]
    used = {name for node in nodes for name in node.input}
    dtype = next(o.type.tensor_type.elem_type for o in graph.output if o.name == hidden)
    head = onnx.helper.make_graph(
        nodes,
        "token_head",
        [onnx.helper.make_tensor_value_info(hidden, dtype, ["n", "t", "c"])],
        [onnx.helper.make_tensor_value_info(vector, dtype, ["n", "d"])],
        [i for i in graph.initializer if i.name in used],
    )
    with tempfile.TemporaryDirectory() as folder:
        cut = Path(folder) / f"{path.stem}.head.onnx"
        part = onnx.helper.make_model(head, opset_imports=model.opset_import, ir_version=model.ir_version)
        onnx.save(part, str(cut))
        return open_model(
            cut,
            {"tokens": Port(3, (hidden,))},
            {"vectors": Port(2, (vector,))},
            "the end of an image tower",
            threads=threads,
        )


def _not_alone(path: Path, vector: str, hidden: str, made: str) -> DataError:
    return DataError(
        path,
        f"{vector} made {made}",
        f"one made of {hidden} alone, for dense=True",
        "Use crops (dense=False), or export the tower with its last_hidden_state.",
    )
