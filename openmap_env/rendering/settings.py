"""Settings of a renderer, held against its signature before anything is opened."""

from __future__ import annotations

import inspect
import math
import typing
from collections.abc import Mapping
from typing import Any, Literal


def checked(kind: type, name: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The settings, each a keyword-only parameter of ``kind`` with a value of its annotated type (str, int, float, a Literal).

    Raises
    ------
    ValueError
        Naming the setting, what was found and what is expected. A flag is no number, and a number is finite.
    """
    parameters = inspect.signature(kind).parameters.values()
    hints = typing.get_type_hints(kind.__init__)  # type: ignore[misc]
    known = {p.name: hints[p.name] for p in parameters if p.kind is p.KEYWORD_ONLY}
    for key, value in settings.items():
        if key not in known:
            raise ValueError(f"renderer {name!r} takes no setting {key!r}, expected some of {', '.join(known)}")
        expected = _mismatch(value, known[key])
        if expected:
            raise ValueError(f"{key} of renderer {name!r} is {value!r}, expected {expected}")
    return dict(settings)


def _mismatch(value: Any, hint: Any) -> str:
    """What is expected instead of the value; "" if it fits."""
    if typing.get_origin(hint) is Literal:
        words = typing.get_args(hint)
        return "" if isinstance(value, str) and value in words else f"one of {', '.join(words)}"
    if hint is str:
        return "" if isinstance(value, str) else "a text"
    if isinstance(value, bool):
        return "a number"
    try:
        number = float(value) if not isinstance(value, str) else math.nan
        whole = hint is not int or number == int(number)
    except (TypeError, ValueError, OverflowError):
        number, whole = math.nan, False
    if hint is int:
        return "" if math.isfinite(number) and whole else "a whole number"
    return "" if math.isfinite(number) else "a finite number"
