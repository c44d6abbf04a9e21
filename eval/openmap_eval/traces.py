"""How an answer came about, as the report shows it: a grounding's trace -> what is laid out in its fold-out.

Traces are read from files, and what stands in them came from people, from perception and from language models: every part may
be missing or of another form, and all of it is text to show, never markup.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

SHOWN_CANDIDATES = 16


def laid_out(trace: Mapping[str, Any]) -> dict[str, Any]:
    """Parts of a trace as strings, numbers and lists of them; the whole of it as ``raw`` JSON.

    Returns
    -------
    dict
        ``backend``, ``choice``, ``confidence``, ``milliseconds`` (one line each, "" where missing), ``description`` (JSON),
        ``fallbacks`` (lines), ``calls`` (of a language model), ``candidates`` (rows), ``raw``.
    """
    choice = trace.get("choice")
    times = _mapping(trace.get("milliseconds"))
    return {
        "backend": _text(trace.get("backend")),
        "choice": "nothing fits" if "choice" in trace and choice is None else _text(choice),
        "confidence": _number(trace.get("confidence"), 2),
        "milliseconds": ", ".join(f"{name} {_number(value, 1)}" for name, value in times.items()),
        "description": _json(trace["description"]) if trace.get("description") else "",
        "fallbacks": [_fallback(entry) for entry in _list(trace.get("fallbacks"))],
        "calls": [_call(_mapping(entry)) for entry in _list(trace.get("llm_calls"))],
        "candidates": [
            _candidate(_mapping(entry), choice) for entry in _list(trace.get("candidates"))[:SHOWN_CANDIDATES]
        ],
        "raw": _json(trace),
    }


def _call(entry: Mapping[str, Any]) -> dict[str, Any]:
    """One request to a language model."""
    told = ("purpose", "messages", "reply", "error", "milliseconds")
    return {
        "purpose": _text(entry.get("purpose")) or "request",
        "milliseconds": _number(entry.get("milliseconds"), 1),
        "messages": [
            {"role": _text(_mapping(m).get("role")), "content": _text(_mapping(m).get("content"))}
            for m in _list(entry.get("messages"))
        ],
        "reply": _text(entry.get("reply")),
        "error": _text(entry.get("error")),
        "more": ", ".join(f"{key} {_text(value)}" for key, value in entry.items() if key not in told),
    }


def _candidate(entry: Mapping[str, Any], choice: Any) -> dict[str, Any]:
    """A row of the multiple choice."""
    around = [_mapping(n) for n in _list(entry.get("neighbours"))]
    return {
        "id": _text(entry.get("id")),
        "chosen": entry.get("id") is not None and entry.get("id") == choice,
        "label": " ".join(filter(None, (_text(entry.get("colour")), _text(entry.get("label"))))),
        "similarity": _number(entry.get("similarity"), 2),
        "score": _number(entry.get("score"), 2),
        "conditions": [f"{name} {_number(value, 2)}" for name, value in _mapping(entry.get("geometry")).items()],
        "centre": ", ".join(_number(v, 1) for v in _list(entry.get("centre"))),
        "neighbours": ", ".join(f"{_text(n.get('label')) or '?'} {_number(n.get('metres'), 1)} m" for n in around),
    }


def _fallback(entry: Any) -> str:
    if not isinstance(entry, Mapping):
        return _text(entry)
    return f"{_text(entry.get('step'))}: {_text(entry.get('to'))} took over, because {_text(entry.get('because'))}"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _number(value: Any, digits: int) -> str:
    return f"{value:.{digits}f}" if isinstance(value, int | float) and not isinstance(value, bool) else _text(value)


def _text(value: Any) -> str:
    return "" if value is None else value if isinstance(value, str) else _json(value)


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False)
