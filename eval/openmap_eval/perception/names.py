"""Which names the embedded weights were trained on: what is of none of their kinds is new to them."""

from __future__ import annotations

import json
from pathlib import Path

from openmap_agents.perception.weights import FOLDER
from openmap_env.episodes.vocabulary import vocabulary
from openmap_scenes import DataError, load_scene

INSTALLED = FOLDER / "names.json"


def trained_names(path: Path = INSTALLED) -> list[str]:
    """The sorted names of a JSON file: a list of strings, or an object with such a list, or with names as keys, at "names".

    Raises
    ------
    DataError
        Not there, or something else.
    """
    remedy = "Name the list with --names, or take the categories of training homes with --train-homes 20."
    expected = "the names that the embedded weights were trained on, as a JSON list of strings"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(path, f"no readable list ({error})", expected, remedy) from error
    names = content.get("names") if isinstance(content, dict) else content
    names = list(names) if isinstance(names, dict) else names
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        raise DataError(path, "something else", expected, remedy)
    return sorted(set(names))


def names_of_homes(homes: int) -> list[str]:
    """The categories of the first ``homes`` training homes, sorted."""
    return sorted({i.category for n in range(homes) for i in load_scene(f"homes:train/{n}").instances if i.category})


def unseen(category: str, trained: frozenset[str]) -> bool:
    """Whether a category is of no kind that a trained name is of; ``trained`` are kinds."""
    return vocabulary().kind(category) not in trained


def kinds_of(names: list[str]) -> frozenset[str]:
    """The kinds of names."""
    return frozenset(vocabulary().kind(name) for name in names)
