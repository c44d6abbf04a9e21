"""The space of instructions: Gymnasium's ``Text``, which also comes through the shared memory of its ``AsyncVectorEnv``.

That class reads shared memory once, when it is made, and hands the same arrays out after every step, since they show what the
workers write. A ``Text`` is read into strings, which do not: they stay what was in the memory at first, the first character of
the character set over and over. Here a batch of texts is read when somebody looks at it.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector.utils import create_shared_memory, read_from_shared_memory, write_to_shared_memory


class InstructionSpace(spaces.Text):
    """``Text`` of which batches in shared memory show what was written last.

    Parameters are those of ``gymnasium.spaces.Text``. In shared memory a text is its code points, int32, with a 0 after it
    where it is shorter than the longest one.
    """


class SharedTexts(tuple[str, ...]):
    """A batch of texts in shared memory, read when it is looked at; a deep copy is a plain tuple of what they are now.

    Parameters
    ----------
    memory : (n, max_length) int32
        Code points, each text ended by a 0.
    """

    _memory: npt.NDArray[np.int32]

    def __new__(cls, memory: npt.NDArray[np.int32]) -> SharedTexts:
        texts = super().__new__(cls, ("",) * len(memory))
        texts._memory = memory
        return texts

    def _now(self) -> tuple[str, ...]:
        return tuple(_decode(row) for row in self._memory)

    def __iter__(self) -> Iterator[str]:
        return iter(self._now())

    def __getitem__(self, index: Any) -> Any:
        return self._now()[index]

    def __contains__(self, text: object) -> bool:
        return text in self._now()

    def __eq__(self, other: object) -> bool:
        return self._now() == (other._now() if isinstance(other, SharedTexts) else other)

    def __hash__(self) -> int:
        return hash(self._now())

    def __repr__(self) -> str:
        return repr(self._now())

    def __deepcopy__(self, memo: dict[int, Any]) -> tuple[str, ...]:
        return self._now()

    def __reduce__(self) -> Any:
        return tuple, (list(self._now()),)


def _decode(row: npt.NDArray[np.int32]) -> str:
    ends = np.flatnonzero(row == 0)
    return row[: ends[0] if len(ends) else None].astype("<i4").tobytes().decode("utf-32-le")


@create_shared_memory.register(InstructionSpace)
def _create(space: InstructionSpace, n: int = 1, ctx: Any = multiprocessing) -> Any:
    return ctx.Array(np.dtype(np.int32).char, n * space.max_length)


@read_from_shared_memory.register(InstructionSpace)
def _read(space: InstructionSpace, shared_memory: Any, n: int = 1) -> SharedTexts:
    return SharedTexts(np.frombuffer(shared_memory.get_obj(), np.int32).reshape(n, space.max_length))


@write_to_shared_memory.register(InstructionSpace)
def _write(space: InstructionSpace, index: int, value: str, shared_memory: Any) -> None:
    codes = np.frombuffer(value.encode("utf-32-le"), "<i4")
    if len(codes) > space.max_length:
        raise ValueError(f"text has {len(codes)} characters, expected at most {space.max_length}")
    row = np.frombuffer(shared_memory.get_obj(), np.int32).reshape(-1, space.max_length)[index]
    row[: len(codes)] = codes
    row[len(codes) : len(codes) + 1] = 0
