"""Things asked for by what they are for: "something to sit on", "to keep food cold"."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from openmap_env.episodes.vocabulary import vocabulary


@cache
def uses() -> dict[str, frozenset[str]]:
    """What is asked -> the kinds that serve, from ``data/uses.json``; "=kind" is one without its sorts."""
    data = json.loads(files("openmap_eval.perception").joinpath("data", "uses.json").read_text("utf-8"))
    return {question: frozenset(kinds) for question, kinds in data["uses"].items()}


def serves(question: str, categories: Sequence[str]) -> npt.NDArray[np.bool_]:
    """Which instances of these categories (n,) would do: those of a kind that serves, or of a sort of one."""
    kinds = uses()[question]
    known = vocabulary()
    every = (known.lineage(category) | {f"={known.kind(category)}"} for category in categories)
    return np.array([not kinds.isdisjoint(names) for names in every], bool)


def that_apply(categories: Sequence[str]) -> list[str]:
    """The questions that some instance of these categories answers."""
    return [question for question in uses() if serves(question, categories).any()]
